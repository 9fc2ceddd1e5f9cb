# SPDX-License-Identifier: GPL-3.0-or-later
"""Read a breath in VTP by VTK's reader, and compare its frames with those of the same breath in safetensors.

    test_series_vtk.py SUPINE
"""
import json
import os
import subprocess
import sys
import tempfile

try:
    import numpy as np
    import vtk
    from vtkmodules.util.numpy_support import vtk_to_numpy
except ImportError:
    print("skipped: this python has no vtk, or no numpy")
    sys.exit(77)

supine = sys.argv[1]
ROUNDING = 3e-5  # mm, largest rounding of a position to float32


def read(path, step=None):
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(path)
    reader.UpdateInformation()
    if step is None:
        reader.Update()
    else:
        reader.UpdateTimeStep(step)
    assert reader.GetErrorCode() == 0
    return reader.GetNumberOfTimeSteps(), reader.GetOutput()


def normals_of(points, triangles):
    a, b, c = (points[triangles[:, i]] for i in range(3))
    normals = np.zeros_like(points)
    for i in range(3):
        np.add.at(normals, triangles[:, i], np.cross(b - a, c - a))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def check_surface(surface, points, triangles, rest, lung):
    """Check every array of a frame; return its field data."""
    data = surface.GetPointData()
    found = vtk_to_numpy(surface.GetPoints().GetData())
    assert (found == points).all()
    assert (vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3) == triangles).all()
    moved = vtk_to_numpy(data.GetArray("displacement"))
    # The program rounds reference positions by at most 0.0005 mm when it opens a basis.
    assert np.abs(moved - (points - rest)).max() <= ROUNDING + 0.0006
    normals = vtk_to_numpy(data.GetNormals()).astype(float)
    assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < 1e-6
    cosine = (normals * normals_of(points, triangles)).sum(1) / np.linalg.norm(normals, axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.05
    assert (vtk_to_numpy(data.GetArray("lung")) == lung).all()
    fields = surface.GetFieldData()
    assert fields.GetAbstractArray("SPACE").GetValue(0) == "LPS"
    assert fields.GetAbstractArray("units").GetValue(0) == "mm, mL, s"
    assert fields.GetAbstractArray("note").GetValue(0).startswith("displacement from ")
    assert data.GetScalars().GetName() == "displacement_magnitude"
    return fields


def tensors(path):
    with open(path, "rb") as file:
        raw = file.read()
    size = int.from_bytes(raw[:8], "little")
    types = {"F32": np.float32, "F64": np.float64, "U32": np.uint32, "U8": np.uint8}
    return {name: np.frombuffer(raw[8 + size + t["data_offsets"][0]:8 + size + t["data_offsets"][1]],
                                types[t["dtype"]]).reshape(t["shape"])
            for name, t in json.loads(raw[8:8 + size]).items() if t.get("dtype") in types}


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)

    def run(*arguments):
        subprocess.run([supine, *arguments], check=True, stdout=subprocess.DEVNULL)

    run("phantom", "-o", "lungs.ply", "--vertices", "5000")
    run("precompute", "lungs.ply", "-o", "lungs.safetensors", "--band", "3")
    for name in ("breath.vtp", "exact.safetensors"):
        run("breathe", "lungs.safetensors", "--turn", "supine:left:1s", "--fps", "10", "-o", name)
    basis, exact = tensors("lungs.safetensors"), tensors("exact.safetensors")
    points, triangles = exact["positions"].astype(float), exact["triangles"]
    rest, lung = basis["vertices"].astype(float), basis["lung"]
    frames = len(points)
    assert frames == 11 and np.ptp(exact["volume"].sum(1)) > 50

    # All frames have the same triangles; the file holds them once.
    for step in (0, 7, 3, 10):
        steps, surface = read("breath.vtp", step)
        fields = check_surface(surface, points[step], triangles, rest, lung)
        assert steps == frames
        for name, wanted in (("time_s", "time"), ("gravity_LPS", "gravity"), ("volume_mL", "volume")):
            table = vtk_to_numpy(fields.GetArray(name))
            assert (table == exact[wanted]).all(), name
    # The first frame is supine at rest: the RMS of the expected errors there is that of 'deform'.
    run("deform", "lungs.safetensors", "--posture", "supine:rest", "-o", "rest.vtp")
    _, surface = read("rest.vtp")
    for name in ("moved_error", "expected_error", "another_day_error"):
        stated = vtk_to_numpy(surface.GetPointData().GetArray(name + "_mm")).astype(float)
        found = fields.GetArray(name + "_RMS_mm").GetValue(0)
        assert abs(found - np.sqrt(np.mean(stated**2))) < 1e-4 * found, (name, found)
    # Displacements are measured from the scan, also in a basis without a rest volume.
    run("precompute", "lungs.ply", "-o", "paper.safetensors", "--law", "paper", "--band", "3")
    for name in ("paper.vtp", "paper_exact.safetensors"):
        run("breathe", "paper.safetensors", "--posture", "supine", "--fps", "4", "-o", name)
    other, paper = tensors("paper_exact.safetensors"), tensors("paper.safetensors")
    fullest = other["volume"].sum(1).argmax()
    assert fullest > 0
    for step in (0, int(fullest)):
        _, surface = read("paper.vtp", step)
        check_surface(surface, other["positions"][step].astype(float), triangles,
                      paper["vertices"].astype(float), paper["lung"])
        moved = np.abs(vtk_to_numpy(surface.GetPointData().GetArray("displacement"))).max()
        assert (moved > 1) == (step != 0), moved  # mm; only the first frame is the scan
    # Each frame has points, displacements, magnitudes and normals; the file has triangles, offsets and lungs once.
    n, m = len(rest), len(triangles)
    head = os.path.getsize("breath.vtp") - (frames * 40 * n + 16 * m + n)
    assert 0 < head < 20000, head

    # A file with a single surface has the same arrays as a file with a breath.
    run("deform", "lungs.safetensors", "--posture", "prone", "-o", "prone.vtp")
    _, surface = read("prone.vtp")
    found = vtk_to_numpy(surface.GetPoints().GetData())
    fields = check_surface(surface, found.astype(float), triangles, rest, lung)
    assert fields.GetArray("gravity_LPS").GetTuple(0) == (0, -1, 0)
    measured = vtk.vtkMassProperties()
    measured.SetInputData(surface)
    measured.Update()
    held = sum(fields.GetArray("volume_mL").GetTuple(0))  # mL of gas and tissue
    assert abs(measured.GetVolume() / 1000 - held) < 0.05, held
    print("all arrays have the expected values")
