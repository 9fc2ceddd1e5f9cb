# SPDX-License-Identifier: MIT
"""Show lungs in 3D Slicer that deform with the orientation of a transform node.

Start the server:

    supine stream lungs.safetensors --send points --space ras --world-down 0,-1,0 --body-from-tracker 0,0,0,1

then, in Slicer's Python console:

    import sys; sys.path.append("/path/to/examples/slicer")
    from slicer_lung import Follow
    follow = Follow("PatientToRoom")   # a linear transform node with the patient's orientation
    follow.stop()

Slicer's axes are right, front, head (RAS). The identity transform means a patient who lies on the
back; gravity points along -y of the room."""
import os
import sys

# In an extension, supine_link.py is beside this file.
sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "tracker"))
from supine_link import Link, corners, unpack  # noqa: E402

SERVER_OPTIONS = ["--send", "points", "--space", "ras", "--world-down", "0,-1,0",
                  "--body-from-tracker", "0,0,0,1"]
DEVICE = "Patient"


def rotation_of(matrix):
    """Return the rows of the 3 x 3 rotation in a 4 x 4 matrix, which is given as 16 numbers, row by row."""
    return [[matrix[4 * row + column] for column in range(3)] for row in range(3)]


class Surface:
    """Receives the newest vertex positions, and the triangles of the first frame."""

    def __init__(self, host="localhost", port=18944):
        self.link = Link(host, port)
        self.link.ask_for("points")
        self.triangles = None

    def send(self, matrix):
        self.link.send_pose(rotation_of(matrix), DEVICE)

    def newest(self, timeout=0.0):
        """Return (time stamp, flat array of vertex positions) of the newest frame; None if there is no new frame."""
        last = None
        self.link.receive(timeout)
        while True:
            message = self.link.message()
            if message is None:
                if not self.link.receive(0.0):
                    return last
                continue
            kind, _, stamp, content = message
            if kind == "POLYDATA":
                points, strips = unpack(kind, content)
                self.triangles = self.triangles or list(corners(strips))
                last = (stamp, points)


class Follow:
    """Sends the rotation of a transform node whenever it changes, and shows the lungs that the server returns."""

    def __init__(self, node, host="localhost", port=18944, interval=15):
        import qt
        import slicer
        import vtk

        self.vtk = vtk
        self.node = slicer.util.getNode(node) if isinstance(node, str) else node
        self.surface = Surface(host, port)
        self.model = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLModelNode", "Lung")
        self.model.CreateDefaultDisplayNodes()
        self.tag = self.node.AddObserver(slicer.vtkMRMLTransformNode.TransformModifiedEvent, self.turned)
        self.timer = qt.QTimer()
        self.timer.connect("timeout()", self.show)
        self.timer.start(interval)
        self.turned()

    def turned(self, *_):
        matrix = self.vtk.vtkMatrix4x4()
        self.node.GetMatrixTransformToWorld(matrix)
        self.surface.send([matrix.GetElement(row, column) for row in range(4) for column in range(4)])

    def show(self):
        frame = self.surface.newest()
        if frame is not None:
            show_points(self.vtk, self.model, frame[1], self.surface.triangles)

    def stop(self):
        self.timer.stop()
        self.node.RemoveObserver(self.tag)
        self.surface.link.close()


def show_points(vtk, model, points, triangles):
    """Set the vertex positions of a model; on the first call also set its triangles."""
    import numpy
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

    mesh = model.GetPolyData()
    if mesh is None or mesh.GetNumberOfCells() == 0:
        mesh = vtk.vtkPolyData()
        cells = numpy.asarray(triangles, numpy.int64).reshape(-1, 3)
        cells = numpy.hstack([numpy.full((len(cells), 1), 3, numpy.int64), cells])
        array = vtk.vtkCellArray()
        array.SetCells(len(cells), numpy_to_vtkIdTypeArray(cells.ravel(), deep=True))
        mesh.SetPolys(array)
        model.SetAndObservePolyData(mesh)
    place = vtk.vtkPoints()
    place.SetData(numpy_to_vtk(numpy.asarray(points, numpy.float32).reshape(-1, 3), deep=True))
    mesh.SetPoints(place)
    mesh.Modified()
