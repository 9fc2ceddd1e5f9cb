# SPDX-License-Identifier: GPL-3.0-or-later
"""Test the example of a client in Python with a real server: stream_link.py FOLDER PORT BASIS

The client shares no code with the server: it was written from the descriptions of the protocol and of the basis
file."""
import sys

sys.path.insert(0, sys.argv[1])
from answers import answer, faces  # noqa: E402
from supine_link import Basis, Link, array, corners, crc64, instruments, quaternion, string, unpack  # noqa: E402

port, basis = int(sys.argv[2]), Basis(sys.argv[3])
TOLERANCE_MM = 5e-3  # largest error of the library's packed storage, mm

assert crc64(b"123456789") == 0x6C40DF5F0B497347  # published check value of CRC-64/ECMA-182

SUPINE = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # columns: the patient's left, back and head in a room with z up
LEFT = [[0, -1, 0], [0, 0, 1], [-1, 0, 0]]


def far(a, b):
    return max(abs(x - y) for x, y in zip(a, b, strict=True))


for version in (1, 2):
    link = Link("127.0.0.1", port, version=version, check=True)
    frames = {}
    sends = {
        101: lambda: link.send_pose(SUPINE, stamp=101),
        102: lambda: link.send_pose(LEFT, stamp=102),
        103: lambda: link.send("POSITION", "Patient", quaternion((0.5**0.5, -0.5**0.5, 0, 0)), 103),
        104: lambda: link.send("QTDATA", "Tracker", instruments(
            {"Probe": (1, 0, 0, 0), "Patient": (0.5**0.5, 0, 0.5**0.5, 0)}), 104),
        105: lambda: link.send("NDARRAY", "Patient", array((0, 3.0, 0)), 105),
        106: lambda: (link.send("IMAGE", "Camera", bytes(300000), 9), link.send_pose(LEFT, stamp=106)),
    }
    for stamp, send in sends.items():
        kind, device, _, content = answer(link, stamp, send)
        assert (kind, device) == ("NDARRAY", "SUPINE")
        frames[stamp] = unpack(kind, content)
        assert len(frames[stamp]) == basis.modes + 6  # weights of modes; 3 displacement factors for each of 2 lungs
    # All message types give the same weights for a posture; weights of different postures differ.
    assert far(frames[101], frames[103]) < 1e-5 and far(frames[101], frames[105]) < 1e-5
    assert far(frames[102], frames[104]) < 1e-5 and far(frames[102], frames[106]) < 1e-5
    assert far(frames[101], frames[102]) > 0.05
    # Surfaces sent by the server equal those computed from the basis file and the received weights.
    link.check = False  # checking 650 kB per frame takes too long in plain Python
    link.ask_for("points")
    _, (points, strips) = link.newest(100.0)
    assert faces(list(corners(strips))) == faces(basis.triangles)
    for stamp, pose in ((201, SUPINE), (202, LEFT)):
        kind, _, _, content = answer(link, stamp, lambda: link.send_pose(pose, stamp=stamp))
        points, strips = unpack(kind, content)
        assert not strips
        assert far(points, basis.deform(frames[stamp - 100])) < TOLERANCE_MM
        assert far(points, basis.vertices) > 1.0
    link.set_volume("full")  # Full inflation gives the basis file's surface in all postures.
    kind, _, _, content = answer(link, 203, lambda: link.send_pose(LEFT, stamp=203))
    assert far(unpack(kind, content)[0], basis.vertices) < TOLERANCE_MM
    link.send("STRING", "VOLUME", string("rest+400"))
    # Wait until the server has read the volume: closing a socket with unread data discards what was sent.
    kind, _, _, content = answer(link, 204, lambda: link.send_pose(LEFT, stamp=204))
    assert far(unpack(kind, content)[0], basis.vertices) > 1.0
    link.close()
print("messages of both versions equal the description of the protocol")
