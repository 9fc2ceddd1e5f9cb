# SPDX-License-Identifier: GPL-3.0-or-later
"""A breath as a series for ParaView, read back: the index by an XML parser, each frame by VTK's own
reader. (VTK itself has no reader for the index; ParaView's is built on the same two.)

    test_series_vtk.py SUPINE
"""
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

try:
    import vtk
except ImportError:
    print("skipped: this python has no vtk")
    sys.exit(77)

supine = sys.argv[1]
with tempfile.TemporaryDirectory() as folder:
    def run(*arguments):
        subprocess.run([supine, *arguments], check=True, cwd=folder, stdout=subprocess.DEVNULL)

    run("phantom", "-o", "lungs.ply", "--vertices", "500")
    run("precompute", "lungs.ply", "-o", "lungs.safetensors", "--band", "3")
    run("breathe", "lungs.safetensors", "--turn", "supine:left:1s", "--fps", "5", "-o", "breath.pvd")

    def read(path):
        reader = vtk.vtkXMLPolyDataReader()
        reader.SetFileName(path)
        reader.Update()
        return reader.GetOutput()

    index = ElementTree.parse(os.path.join(folder, "breath.pvd")).getroot()
    assert index.tag == "VTKFile" and index.get("type") == "Collection"
    frames = index.findall("./Collection/DataSet")
    times = [float(frame.get("timestep")) for frame in frames]
    assert len(frames) >= 5 and times == sorted(set(times)), times
    volumes = []
    for frame in frames:
        surface = read(os.path.join(folder, frame.get("file")))
        assert surface.GetNumberOfPoints() == surface.GetPointData().GetArray("displacement").GetNumberOfTuples()
        assert surface.GetNumberOfPolys() > 0
        magnitude = surface.GetPointData().GetArray("displacement_magnitude")
        vector = surface.GetPointData().GetArray("displacement")
        for i in range(0, surface.GetNumberOfPoints(), 37):
            length = sum(x * x for x in vector.GetTuple(i)) ** 0.5
            assert abs(length - magnitude.GetValue(i)) <= 1e-4 * max(1.0, length)
        properties = vtk.vtkMassProperties()
        properties.SetInputData(surface)
        properties.Update()
        volumes.append(properties.GetVolume() * 1e-3)
    assert max(volumes) - volumes[0] > 100.0, volumes  # it breathes: mL, by VTK's own measure
    print(f"{len(frames)} frames, {volumes[0]:.1f} to {max(volumes):.1f} mL")
