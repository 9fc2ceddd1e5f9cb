# SPDX-License-Identifier: GPL-3.0-or-later
"""Test the module "Supine Postures" for 3D Slicer without 3D Slicer, which Debian does not have: its numbers are those
of `supine deform`, read by VTK; its form runs with stand-ins for the Python modules slicer, qt and ctk, and the real
VTK; CMake configures the extension with a stand-in for Slicer's own CMake files.

    test_slicer.py [BUILD_FOLDER]"""
import csv
import importlib.util
import os
import subprocess
import sys
import types
from unittest import mock

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
if importlib.util.find_spec("vtk") is None:
    print("skipped: this python has no VTK")
    sys.exit(77)
from helpers.slicer_stand_in import Base, Model  # noqa: E402
from helpers.verdict import SOURCE, command, leave  # noqa: E402
import numpy as np  # noqa: E402
import vtk  # noqa: E402
from vtk.util.numpy_support import vtk_to_numpy  # noqa: E402

EXTENSION = os.path.join(SOURCE, "examples/slicer")
LUNGS = os.path.join(SOURCE, "examples/lungs")
STATE, SINCE = "0:-1:0:rest", "supine:rest"
TARGETS = [("RLL tumour", (104, 112, -176)), ("LUL nodule", (-86, 206, -84))]  # examples/lungs/targets.csv in RAS
FIXED = [("a", (-80, 200, -60)), ("b", (-90, 120, -200)), ("c", (90, 130, -220)), ("d", (70, 120, -120))]
STORED = 2e-3  # mm: the package stores coefficients in 16 bits, the program in 32, and CSV files have three digits


class Fiducials:
    """Stands in for vtkMRMLMarkupsFiducialNode."""
    SetName = CreateDefaultDisplayNodes = mock.MagicMock()

    def __init__(self, points=()):
        self.points, self.measurements, self.notes = [(name, tuple(at)) for name, at in points], [], {}
        self.GetNumberOfControlPoints = lambda: len(self.points)
        self.GetNthControlPointLabel = lambda i: self.points[i][0]
        self.GetNthControlPointPositionStatus = lambda i: "defined" if np.isfinite(self.points[i][1]).all() else "none"
        self.RemoveAllControlPoints = lambda: self.points.clear()
        self.AddControlPointWorld = lambda at, name: self.points.append((name, tuple(at[k] for k in range(3))))
        self.SetNthControlPointDescription = self.notes.__setitem__
        self.GetNumberOfMeasurements = lambda: len(self.measurements)
        self.RemoveNthMeasurement = self.measurements.pop
        self.AddMeasurement = self.measurements.append

    def GetNthControlPointPositionWorld(self, i, position):
        position[:] = self.points[i][1]


class Measurement(types.SimpleNamespace):
    """Stands in for vtkMRMLStaticMeasurement."""

    def __init__(self):
        super().__init__(SetPrintFormat=mock.MagicMock(), SetUnits=mock.MagicMock(),
                         SetName=lambda name: setattr(self, "name", name),
                         SetControlPointValues=lambda values: setattr(self, "values", vtk_to_numpy(values)))


def stand_in():
    """Import the module of the extension with stand-ins for the Python modules of Slicer; return it, and slicer's."""
    kinds = {"vtkMRMLModelNode": Model, "vtkMRMLMarkupsFiducialNode": Fiducials}
    slicer, loadable, qt = mock.MagicMock(), types.ModuleType("slicer.ScriptedLoadableModule"), mock.MagicMock()
    slicer.mrmlScene.AddNewNodeByClass = lambda kind, name: kinds[kind]()
    slicer.vtkMRMLMarkupsNode.PositionDefined = "defined"
    slicer.vtkMRMLStaticMeasurement = Measurement
    slicer.qMRMLNodeComboBox = mock.MagicMock  # a new one for each call
    for name in ("", "Logic", "Test", "Widget"):
        setattr(loadable, "ScriptedLoadableModule" + name, Base)
    qt.QLineEdit = lambda text: types.SimpleNamespace(text=text)
    sys.modules.update({"slicer": slicer, "slicer.ScriptedLoadableModule": loadable, "qt": qt, "ctk": mock.MagicMock()})
    sys.path.insert(0, os.path.join(EXTENSION, "SupinePostures"))
    return importlib.import_module("SupinePostures"), slicer


def write(name, points):
    with open(name, "w", encoding="utf-8") as file:
        file.write("name,x,y,z\n" + "".join(f"{label},{-x},{-y},{z}\n" for label, (x, y, z) in points))


def made(*words):
    done = command(*words)
    assert done[0] != "refused", done


def of_program(name, basis, *frame):
    """Return what `supine deform` writes of points (a CSV file) or of a surface (VTP, read by VTK), with RAS axes."""
    made("deform", basis, "--posture", STATE, "--from", SINCE, *frame, "-o", name)
    if name.endswith(".vtp"):
        reader = vtk.vtkXMLPolyDataReader()
        reader.SetFileName(name)
        reader.Update()
        return vtk_to_numpy(reader.GetOutput().GetPoints().GetData()) * (-1, -1, 1)
    with open(name, encoding="utf-8") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("# "))
        return {row["name"]: ((-float(row["x"]), -float(row["y"]), float(row["z"])), row) for row in rows}


def moved_as(before, after, positions):
    """Move positions by the rotation and the translation that bring points closest to where they are afterwards."""
    before, after = np.array(before), np.array(after)
    u, _, v = np.linalg.svd((before - before.mean(0)).T @ (after - after.mean(0)))
    assert np.linalg.det(u @ v) > 0
    return (positions - before.mean(0)) @ (u @ v) + after.mean(0)


def test_postures_in_two_frames_show_numbers_of_program(module, slicer):
    """Push the button of the form, and compare the model and the list of fiducials with the files of the program."""
    widget = module.SupinePosturesWidget()
    widget.setup()
    widget.basis.currentPath, widget.posture.text, widget.since.text = "lungs.st", "0:-1:0", SINCE
    for fixed in ([], FIXED):
        frame = ["--frame", "fixed.csv"] if fixed else []
        widget.targets.currentNode = lambda: Fiducials([*TARGETS, ("not yet placed", [np.nan] * 3)])
        widget.fixed.currentNode = lambda: Fiducials(fixed)
        widget.clicked()
        assert not slicer.util.errorDisplay.called, slicer.util.errorDisplay.call_args
        assert "supine at full inflation" in widget.told.text, widget.told.text
        rows, shown = of_program("out.csv", "inside.st", *frame), widget.logic.markups
        assert [name for name, _ in shown.points] == [name for name, _ in TARGETS], shown.points
        for i, (name, position) in enumerate(shown.points):
            assert np.abs(np.subtract(position, rows[name][0])).max() < STORED, (name, position, rows[name])
            for measure in shown.measurements:
                assert abs(measure.values[i] - float(rows[name][1][measure.name])) < STORED, (name, measure.name)
        assert len(shown.measurements) == 4 and "expected_error_mm" in shown.notes[1]
        wanted = of_program("out.vtp", "lungs.st")
        if fixed:
            body = of_program("body.csv", "inside.st")
            wanted = moved_as([body[name][0] for name in body], [rows[name][0] for name in body], wanted)
        found = vtk_to_numpy(widget.logic.model.GetPolyData().GetPoints().GetData())
        assert len(found) > 10000 and np.abs(found - wanted).max() < (5e-3 if fixed else STORED)
    module.SupinePosturesTest.assertGreater = lambda self, a, b: a > b or sys.exit(1)
    module.SupinePosturesTest.assertEqual = lambda self, a, b: a == b or sys.exit(1)
    os.environ["SUPINE_BASIS"] = "lungs.st"
    module.SupinePosturesTest().runTest()
    return widget


def test_postures_wrong_input_shows_reason(widget, slicer):
    """Push the button with wrong inputs: each is told with its name, and what is shown stays."""
    kept = widget.logic.markups.points
    widget.targets.currentNode = Fiducials
    for words, change in (("nowhere.st", lambda: setattr(widget.basis, "currentPath", "nowhere.st")),
                          ("RLL tumour", lambda: setattr(widget.targets, "currentNode", lambda: Fiducials(
                              [*TARGETS, ("RLL tumour", (0, 0, 0))]))),
                          ("far", lambda: setattr(widget.targets, "currentNode", lambda: Fiducials(
                              [("far", (0, 900, 0))]))),
                          ("pron", lambda: setattr(widget.posture, "text", "pron"))):
        widget.basis.currentPath, widget.posture.text = "lungs.st", "prone"
        change()
        slicer.util.errorDisplay.reset_mock()
        widget.clicked()
        assert slicer.util.errorDisplay.called and words in slicer.util.errorDisplay.call_args[0][0], words
        assert widget.logic.markups.points == kept
        widget.targets.currentNode = Fiducials


def test_extension_configure_names_files_that_exist():
    """Configure the extension with CMake: it states its metadata, and each file that a module names exists."""
    os.mkdir("slicer")
    with open("slicer/SlicerConfig.cmake", "w", encoding="utf-8") as file:
        file.write("""
foreach(name HOMEPAGE CATEGORY CONTRIBUTORS DESCRIPTION DEPENDS)
  if("${EXTENSION_${name}}" STREQUAL "")
    message(FATAL_ERROR "no ${name}")
  endif()
endforeach()
file(WRITE ${CMAKE_BINARY_DIR}/nothing.cmake "")
foreach(name Slicer_USE_FILE Slicer_EXTENSION_GENERATE_CONFIG Slicer_EXTENSION_CPACK)
  set(${name} ${CMAKE_BINARY_DIR}/nothing.cmake)
endforeach()
function(slicerMacroBuildScriptedModule)
  cmake_parse_arguments(module "WITH_GENERIC_TESTS" "NAME" "SCRIPTS;RESOURCES" ${ARGN})
  foreach(script ${module_SCRIPTS})
    if(NOT EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${script})
      message(FATAL_ERROR "no ${script}")
    endif()
  endforeach()
  message(STATUS "module ${module_NAME}")
endfunction()
""")
    done = subprocess.run(["cmake", "-S", EXTENSION, "-B", "extension", f"-DSlicer_DIR={os.path.abspath('slicer')}",
                           "-DCMAKE_C_COMPILER_WORKS=1", "-DCMAKE_CXX_COMPILER_WORKS=1"],
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert all(f"module {name}" in done.stdout for name in ("SupineLung", "SupinePostures")), done.stdout


def main():
    made("precompute", os.path.join(LUNGS, "left.obj"), os.path.join(LUNGS, "right.obj"), "--band", 3, "--held-out", 5,
         "-o", "lungs.st")
    write("points.csv", [*TARGETS, *FIXED])
    write("fixed.csv", FIXED)
    made("embed", "lungs.st", "points.csv", "-o", "inside.st")
    module, slicer = stand_in()
    listed = mock.MagicMock()
    module.SupinePostures(listed)
    assert listed.title == "Supine Postures"
    widget = test_postures_in_two_frames_show_numbers_of_program(module, slicer)
    test_postures_wrong_input_shows_reason(widget, slicer)
    test_extension_configure_names_files_that_exist()
    print("the module shows the numbers of the program, in two frames")
    return 0


leave(main())
