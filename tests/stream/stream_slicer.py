# SPDX-License-Identifier: GPL-3.0-or-later
"""Test the example for 3D Slicer, without Slicer, with a real server started with the options of the example:

    stream_slicer.py EXAMPLES PORT BASIS"""
import os
import sys
import types
from unittest import mock

sys.path[:0] = [os.path.join(sys.argv[1], folder) for folder in ("slicer", "tracker")]
sys.path.append(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from helpers.slicer_stand_in import Base, Model  # noqa: E402
from answers import faces, number_messages, wait_for  # noqa: E402
from slicer_lung import SERVER_OPTIONS, Surface  # noqa: E402
from supine_link import Basis, Link, array  # noqa: E402

assert "--world-down 0,-1,0 --body-from-tracker 0,0,0,1" in " ".join(SERVER_OPTIONS)
port, basis = int(sys.argv[2]), Basis(sys.argv[3])
surface = Surface("127.0.0.1", port)
weights = Link("127.0.0.1", port)
weights.ask_for("weights")

# Matrices of Slicer (RAS, 4 x 4 by rows) for rotations about the patient's long axis, and gravity in the patient (LPS).
TURNS = {
    "supine": ([1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1], (0, 1, 0)),
    "prone": ([-1, 0, 0, 5, 0, -1, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1], (0, -1, 0)),
    # On the left side: the patient's right is the room's +y (ceiling), and the patient's front is the room's -x.
    "left": ([0, -1, 0, 5, 1, 0, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1], (1, 0, 0)),
}


def far(a, b):
    return max(abs(x - y) for x, y in zip(a, b, strict=True))


seen = {}
surface_sent, weights_sent = number_messages(surface.link, 1000), number_messages(weights, 2000)
for name, (matrix, gravity) in TURNS.items():
    surface.send(matrix)
    points = wait_for(lambda: surface.newest(0.05), lambda stamp, _: stamp == surface_sent())
    frame = wait_for(lambda: weights.newest(0.05), lambda stamp, _: stamp == surface_sent())
    wanted = basis.deform(frame)
    for i in range(0, len(wanted), 3):  # LPS to RAS: x and y change their sign
        assert abs(points[i] + wanted[i]) < 5e-3 and abs(points[i + 1] + wanted[i + 1]) < 5e-3
        assert abs(points[i + 2] - wanted[i + 2]) < 5e-3
    seen[name] = frame
    # The same gravity, sent as the reading of a tilt sensor in the patient's axes (RAS), gives the same weights.
    weights.send("NDARRAY", "Patient", array((-gravity[0], -gravity[1], gravity[2])))
    same = wait_for(lambda: weights.newest(0.05), lambda stamp, _: stamp == weights_sent())
    assert far(same, frame) < 1e-5, name
assert faces(surface.triangles) == faces(basis.triangles)
assert max(abs(a - b) for a, b in zip(seen["supine"], seen["prone"])) > 0.05
assert max(abs(a - b) for a, b in zip(seen["supine"], seen["left"])) > 0.05

try:
    import numpy  # noqa: F401
    import vtk
except ImportError:
    print("VTK is not installed: the model is not tested")
else:
    from slicer_lung import show_points

    model = Model()
    for _ in range(2):
        show_points(vtk, model, points, surface.triangles)
    assert model.mesh.GetNumberOfPoints() == len(points) // 3
    assert model.mesh.GetNumberOfPolys() == len(surface.triangles) // 3
    assert max(abs(a - b) for a, b in zip(model.mesh.GetPoint(7), points[21:24])) < 1e-6


# The scripted module, with stand-ins for Slicer's modules: it starts, follows a transform, stops, and reports a dead
# server.
class VtkMatrix:
    def GetElement(self, row, column):
        return float(row == column)


loadable = types.ModuleType("slicer.ScriptedLoadableModule")
loadable.ScriptedLoadableModule = loadable.ScriptedLoadableModuleWidget = Base
slicer, qt = mock.MagicMock(), mock.MagicMock()
qt.QLineEdit = lambda text: types.SimpleNamespace(text=text)
sys.modules.update({"slicer": slicer, "slicer.ScriptedLoadableModule": loadable, "qt": qt,
                    "vtk": types.SimpleNamespace(vtkMatrix4x4=VtkMatrix)})
sys.path.insert(0, os.path.join(sys.argv[1], "slicer", "SupineLung"))
import SupineLung  # noqa: E402

listed = mock.MagicMock()
SupineLung.SupineLung(listed)
assert listed.title == "Supine Lung"
widget = SupineLung.SupineLungWidget()
widget.setup()
widget.host.text, widget.port.text = "127.0.0.1", str(port)
widget.toggled(True)
node = widget.node.currentNode()
assert widget.follow is not None and node.AddObserver.called and not slicer.util.errorDisplay.called
wait_for(lambda: weights.newest(0.05), lambda _, frame: far(frame, seen["supine"]) < 1e-5)  # the identity: on the back
widget.cleanup()
assert widget.follow is None and node.RemoveObserver.called
widget.port.text = "1"
widget.toggled(True)
assert widget.follow is None and slicer.util.errorDisplay.called and widget.button.checked is False
