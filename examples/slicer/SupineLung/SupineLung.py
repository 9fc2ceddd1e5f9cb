# SPDX-License-Identifier: MIT
"""A scripted module for 3D Slicer: lungs that deform with the orientation of a linear transform node.

Add this folder to "Additional module paths" in Slicer's settings, or build it with CMakeLists.txt as part of an
extension. It needs slicer_lung.py, which has the command of the server, from the folder above or beside this file."""
import os
import sys

import qt
import slicer
from slicer.ScriptedLoadableModule import ScriptedLoadableModule, ScriptedLoadableModuleWidget

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path += [HERE, os.path.dirname(HERE)]
from slicer_lung import Follow  # noqa: E402


class SupineLung(ScriptedLoadableModule):
    """What Slicer lists of the module."""

    def __init__(self, parent):
        super().__init__(parent)
        parent.title = "Supine Lung"
        parent.categories = ["IGT"]
        parent.contributors = ["Supine"]
        parent.helpText = ("Start `supine stream` as slicer_lung.py says, choose a linear transform with the patient's "
                           "orientation.")


class SupineLungWidget(ScriptedLoadableModuleWidget):
    """A transform, the server's address, and a button that starts and stops."""

    def setup(self):
        super().setup()
        self.follow = None
        self.node = slicer.qMRMLNodeComboBox()
        self.node.nodeTypes = ["vtkMRMLLinearTransformNode"]
        self.node.setMRMLScene(slicer.mrmlScene)
        self.host = qt.QLineEdit("localhost")
        self.port = qt.QLineEdit("18944")
        self.button = qt.QPushButton("Follow")
        self.button.checkable = True
        self.button.connect("toggled(bool)", self.toggled)
        form = qt.QFormLayout()
        for label, widget in (("Transform:", self.node), ("Host:", self.host), ("Port:", self.port), ("", self.button)):
            form.addRow(label, widget)
        self.layout.addLayout(form)
        self.layout.addStretch(1)

    def toggled(self, on):
        if self.follow is not None:
            self.follow.stop()
            self.follow = None
        if on:
            try:
                self.follow = Follow(self.node.currentNode(), self.host.text, int(self.port.text))
            except (OSError, ValueError, AttributeError) as error:  # no server, no number, no transform
                slicer.util.errorDisplay(f"Cannot follow: {error}")
                self.button.checked = False

    def cleanup(self):
        self.toggled(False)
