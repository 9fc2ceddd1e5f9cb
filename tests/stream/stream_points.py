# SPDX-License-Identifier: GPL-3.0-or-later
"""Send observed points, and receive the located lungs with their expected error.

    stream_points.py PROGRAM FOLDER_OF_SUPINE_LINK

The observed points come from deformed and shifted lungs. Send a TRANSFORM message for each, then all in a POINT
message."""
import csv
import os
import re
import struct
import subprocess
import sys
import tempfile

supine, folder_of_link = sys.argv[1:]
sys.path.insert(0, folder_of_link)
from answers import answer  # noqa: E402
from supine_link import Link, transform, unpack  # noqa: E402

SHIFT = (12.0, -7.0, 20.0)
LEFT = [[0, -1, 0], [0, 0, 1], [-1, 0, 0]]  # rotation matrix, by rows, of a patient on the left side
SENSOR = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]  # rotation matrix of a sensor; the server ignores rotations of sensors


def run(*words):
    subprocess.run([supine, *words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def positions(path):
    """Return the positions of the vertices of a binary PLY file."""
    with open(path, "rb") as file:
        data = file.read()
    begin = data.index(b"end_header\n") + 11
    count = int(re.search(rb"element vertex (\d+)", data)[1])
    row = 4 * data[:begin].count(b"property float")
    return [struct.unpack_from("<3f", data, begin + row * i) for i in range(count)]


def point(name, place):
    """Return the bytes of one point of a POINT message."""
    return struct.pack(">64s32s4B3ff20s", name.encode(), b"sensors", 255, 0, 0, 255, *place, 1.0, b"")


def check(message, truth, count):
    kind, _, _, content = message
    assert kind == "POLYDATA"
    points, _ = unpack(kind, content)
    assert struct.unpack_from(">10I", content)[9] == 1, "no attribute"
    block = content[-(24 + 4 * count):]
    assert block[:2] == b"\0\1" and struct.unpack_from(">I", block, 2)[0] == count
    assert block[6:24] == b"expected_error_mm\0"
    errors = struct.unpack_from(f">{count}f", block, 24)
    assert all(0.5 < e < 40 for e in errors), (min(errors), max(errors))
    miss = sum((points[3 * i + k] - truth[i][k] - SHIFT[k]) ** 2 for i in range(count) for k in range(3))
    assert (miss / count) ** 0.5 < 2.5, (miss / count) ** 0.5
    return errors


with tempfile.TemporaryDirectory(prefix="supine-stream-") as folder:
    def at(name):
        return os.path.join(folder, name)
    run("phantom", "--vertices", "1000", "-o", at("lungs.ply"))
    run("precompute", at("lungs.ply"), "-o", at("lungs.safetensors"))
    with open(at("points.csv"), "w", encoding="ascii") as file:
        print("name,x,y,z", file=file)
        for i in range(20):
            print(f"p{i},{(1 if i % 2 else -1) * (65 + 9 * (i % 4))},{-180 + 11 * (i % 7)},{-150 + 5 * i}", file=file)
    run("embed", at("lungs.safetensors"), at("points.csv"), "-o", at("inside.safetensors"))
    run("deform", at("inside.safetensors"), "--posture", "left", "--volume", "rest+400", "-o", at("seen.csv"))
    run("deform", at("lungs.safetensors"), "--posture", "left", "--volume", "rest+400", "-o", at("truth.ply"))
    truth = positions(at("truth.ply"))
    with open(at("seen.csv"), encoding="ascii") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    seen = {r["name"]: [float(r[k]) + s for k, s in zip("xyz", SHIFT, strict=True)] for r in rows}
    server = subprocess.Popen([supine, "stream", at("lungs.safetensors"), "--listen", "0", "--seconds", "600",
                               "--points", at("inside.safetensors"), "--send", "surface", "--device", "Patient"],
                              stdout=subprocess.PIPE, text=True)
    try:
        port = int(re.match(r"listening on port (\d+)", server.stdout.readline())[1])
        for version in (1, 2):
            link = Link("127.0.0.1", port, version=version, check=True)
            names = list(seen)
            if version == 1:  # a point may arrive before the first pose
                answer(link, 4, lambda: link.send("TRANSFORM", names[0], transform(SENSOR, seen[names[0]]), 4))
            link.send_pose(LEFT, stamp=5)
            for name in names[:-1]:
                link.send("TRANSFORM", name, transform(SENSOR, seen[name]), 6)
            last = names[-1]
            check(answer(link, 7, lambda: link.send("TRANSFORM", last, transform(SENSOR, seen[last]), 7)),
                  truth, len(truth))
            wrong = dict(seen, p3=[v + 30 for v in seen["p3"]])  # a wrong point, which the server must leave out
            body = b"".join(point(n, p) for n, p in wrong.items()) + point("stranger", (0, 0, 0))
            check(answer(link, 8, lambda: link.send("POINT", "Tracker", body, 8)), truth, len(truth))
            link.send("POINT", "Tracker", body[:-1], 9)  # a truncated message, which the server must drop
            # Wait until the server has read it: closing a socket with unread data discards what was sent.
            answer(link, 10, lambda: link.send_pose(LEFT, stamp=10))
            link.close()
    finally:
        server.terminate()
        said = server.communicate(timeout=100)[0]
    print(said, end="")
    assert server.returncode == 0
    assert said.startswith("received positions of observed points: 81\n"), said
    assert "malformed messages: 2;" in said, said
