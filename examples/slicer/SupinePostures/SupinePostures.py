# SPDX-License-Identifier: MIT
"""A scripted module for 3D Slicer: lungs, and fiducials in them, in another posture and at another volume.

README.md, in the folder above, says how to add it. All numbers come from moved_lungs.py beside this file."""
import os
import sys
import warnings

import ctk
import qt
import slicer
import vtk
from slicer.ScriptedLoadableModule import (ScriptedLoadableModule, ScriptedLoadableModuleLogic,
                                           ScriptedLoadableModuleTest, ScriptedLoadableModuleWidget)

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path += [HERE, os.path.dirname(HERE)]
from slicer_lung import show_points  # noqa: E402

INSTALL = "Install the Python package: slicer.util.pip_install('supine-....whl'), and the program supine on PATH"


class SupinePostures(ScriptedLoadableModule):
    """What Slicer lists of the module."""

    def __init__(self, parent):
        super().__init__(parent)
        parent.title = "Supine Postures"
        parent.categories = ["IGT"]
        parent.contributors = ["Supine"]
        parent.helpText = ("Choose a basis file of `supine precompute`, a posture, a volume, and fiducials that were "
                           "placed in the scan. Not for diagnosis or treatment.")


class SupinePosturesLogic(ScriptedLoadableModuleLogic):
    """Reads fiducials of the scene, and shows where moved_lungs.py computes lungs and fiducials."""

    def __init__(self):
        super().__init__()
        self.model = self.markups = None

    @staticmethod
    def placed(node):
        """Return the name and the position of each point that is placed in a list of fiducials."""
        points = []
        for i in range(node.GetNumberOfControlPoints() if node else 0):
            if node.GetNthControlPointPositionStatus(i) == slicer.vtkMRMLMarkupsNode.PositionDefined:
                position = [0.0, 0.0, 0.0]
                node.GetNthControlPointPositionWorld(i, position)
                points.append((node.GetNthControlPointLabel(i), tuple(position)))
        return points

    def show(self, path, state, since, targets=None, fixed=None):
        """Show the lungs and the fiducials in a state. Return what must be told beside them."""
        from moved_lungs import Lungs
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            lungs = Lungs(path, self.placed(targets), self.placed(fixed))
            surface, points = lungs.surface(state), lungs.points(state, since)
        if self.model is None:
            self.model = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLModelNode", "Supine")
            self.markups = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode", "Supine")
            self.model.CreateDefaultDisplayNodes()
            self.markups.CreateDefaultDisplayNodes()
        self.model.SetAndObservePolyData(None)  # the basis may be another one, with other triangles
        show_points(vtk, self.model, surface, lungs.basis.triangles)
        self.model.SetName(f"Supine {state}")
        self.markups.SetName(f"Supine {state} from {since}")
        self.list_points(points)
        return "\n".join([lungs.basis.caveats, *(str(w.message) for w in said)])

    def list_points(self, points):
        """List the moved fiducials, with their displacements and errors as measurements."""
        self.markups.RemoveAllControlPoints()
        while self.markups.GetNumberOfMeasurements():
            self.markups.RemoveNthMeasurement(0)
        measures = [] if not points else points[0]._fields[2:]
        for i, point in enumerate(points):
            self.markups.AddControlPointWorld(vtk.vtkVector3d(*point.position), point.name)
            self.markups.SetNthControlPointDescription(i, ", ".join(f"{m} {getattr(point, m):.1f}" for m in measures))
        for name in measures:
            values = vtk.vtkDoubleArray()
            for point in points:
                values.InsertNextValue(getattr(point, name))
            measurement = slicer.vtkMRMLStaticMeasurement()
            measurement.SetName(name)
            measurement.SetUnits("mm")
            measurement.SetPrintFormat("")
            measurement.SetControlPointValues(values)
            self.markups.AddMeasurement(measurement)


class SupinePosturesWidget(ScriptedLoadableModuleWidget):
    """The basis file, the two states, the two lists of fiducials, and a button that shows the lungs."""

    def setup(self):
        super().setup()
        self.logic = SupinePosturesLogic()
        self.basis = ctk.ctkPathLineEdit()
        self.posture = qt.QLineEdit("prone")
        self.volume = qt.QLineEdit("rest")
        self.since = qt.QLineEdit("scan")
        self.targets, self.fixed = self.selector(), self.selector()
        self.button = qt.QPushButton("Show")
        self.button.connect("clicked(bool)", self.clicked)
        self.told = qt.QLabel()
        self.told.wordWrap = True
        form = qt.QFormLayout()
        for label, widget in (("Basis file:", self.basis), ("Posture, or gravity x:y:z (LPS):", self.posture),
                              ("Volume:", self.volume), ("Displacement from:", self.since),
                              ("Fiducials in the scan:", self.targets),
                              ("Frame (none: the body):", self.fixed), ("", self.button), ("", self.told)):
            form.addRow(label, widget)
        self.layout.addLayout(form)
        self.layout.addStretch(1)

    @staticmethod
    def selector():
        """Return a box that chooses a list of fiducials of the scene, or none."""
        box = slicer.qMRMLNodeComboBox()
        box.nodeTypes = ["vtkMRMLMarkupsFiducialNode"]
        box.noneEnabled = True
        box.addEnabled = False
        box.setMRMLScene(slicer.mrmlScene)
        return box

    def clicked(self, *_):
        state = ":".join(text for text in (self.posture.text.strip(), self.volume.text.strip()) if text)
        try:
            self.told.text = self.logic.show(self.basis.currentPath, state, self.since.text.strip(),
                                             self.targets.currentNode(), self.fixed.currentNode())
        except ImportError as error:
            slicer.util.errorDisplay(f"{error}. {INSTALL}")
        except (OSError, ValueError, RuntimeError, ArithmeticError, MemoryError) as error:  # supine.Error too
            slicer.util.errorDisplay(str(error))


class SupinePosturesTest(ScriptedLoadableModuleTest):
    """Slicer's button "Reload and Test": move a basis file that the environment variable SUPINE_BASIS names."""

    def runTest(self):
        slicer.mrmlScene.Clear()
        logic = SupinePosturesLogic()
        logic.show(os.environ["SUPINE_BASIS"], "prone:rest", "scan")
        self.assertGreater(logic.model.GetPolyData().GetNumberOfPoints(), 0)
        self.assertEqual(logic.markups.GetNumberOfControlPoints(), 0)
