# SPDX-License-Identifier: GPL-3.0-or-later
"""Ask the interfaces of the program for their verdict on an input: taken, told (a warning) or refused. Tests that
import this module run in a new folder, with the Python package of the build folder that is their first argument
(default build/release)."""
import ctypes
import importlib.util
import json
import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import warnings

if importlib.util.find_spec("numpy") is None:
    print("skipped: this python has no numpy")
    sys.exit(77)
import numpy as np

BUILD = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else "build/release")
SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SUPINE = os.path.join(BUILD, "supine")
PACKAGE = os.path.join(BUILD, "runtime/js/package/supine.js")
folder = tempfile.TemporaryDirectory()
os.chdir(folder.name)
shutil.copytree(os.path.join(SOURCE, "runtime/python/supine"), "py/supine")
for library in ("runtime/libsupine_runtime.so", "precompute/library/libsupine_precompute.so"):
    name = os.path.join(BUILD, library)
    if not os.path.exists(name):
        print(f"skipped: the build has no {library}")
        sys.exit(77)
    shutil.copy(name, "py/supine")
os.environ["PATH"] = BUILD + os.pathsep + os.environ["PATH"]
sys.path.insert(0, os.path.abspath("py"))
import supine
from supine import _library as c


class Row(ctypes.Structure):
    """The C struct supine_input."""
    _fields_ = [*((name, ctypes.c_char_p) for name in ("name", "group", "input", "against", "measured")),
                ("below", ctypes.c_bool), ("told", ctypes.c_double), ("refused", ctypes.c_double),
                ("evidence", ctypes.c_char_p), ("people", ctypes.c_int), ("n", ctypes.c_int),
                ("interfaces", ctypes.c_uint)]


def table():
    """Return the rows of the table, in its order."""
    get = ctypes.CDLL(os.path.abspath("py/supine/libsupine_runtime.so")).supine_input_get
    get.restype = ctypes.POINTER(Row)
    rows = []
    while get(len(rows)):
        rows.append(get(len(rows)).contents)
    return rows


def verdict_of(code, said):
    """Return the verdict of a program that has ended with an exit code and has said something."""
    if code != 0:
        return "refused"
    return "told" if "warning:" in said else "taken"


def command(*words):
    """Run the program; return the verdict and what it said."""
    done = subprocess.run([SUPINE, *map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode in range(6), done
    return verdict_of(done.returncode, done.stderr), done.stderr


def python(call):
    """Call a function of the Python package; return the verdict and what it said."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            call()
        except (ValueError, TypeError, ArithmeticError, supine.Error) as error:
            return "refused", str(error)
    return ("told" if said else "taken"), " ".join(str(w.message) for w in said)


def pose_in_c(basis, posture, volume=""):
    """Compute a pose as a C program does."""
    given, other = c.State((0.0, 1.0, 0.0)), c.State()
    c.state_parse(posture.encode(), given)
    if volume:
        c.state_parse_volume(volume.encode(), other)
    c.state_join(given, other, given)
    c.basis_pose(basis._c, given, supine.Pose())


JAVASCRIPT = """
import { readFileSync } from 'node:fs';
const { open } = await import(process.argv[1]);
const state = new Function(`return ${process.argv[2]}`)(); // JSON has no NaN
let said = ['taken', ''];
try {
  const [basis, fiducials] = process.argv.slice(3);
  const lungs = await open(readFileSync(basis), { doubt: true });
  lungs.pose(state);
  if (fiducials !== undefined) lungs.registration(JSON.parse(fiducials));
} catch (error) {
  said = ['refused', error.message];
}
console.log(JSON.stringify(said));
"""


def javascript(state, basis, *fiducials):
    """Open a basis and compute a pose in node, and register it at fiducials; return None if it cannot run."""
    node = shutil.which("node")
    if node is None or not os.path.exists(PACKAGE):
        return None
    done = subprocess.run([node, "--input-type=module", "-e", JAVASCRIPT, PACKAGE, json.dumps(state), basis,
                           *([json.dumps(fiducials)] if fiducials else [])],
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return tuple(json.loads(done.stdout))


def crc64(data):
    crc = 0
    for byte in data:
        crc ^= byte << 56
        for _ in range(8):
            crc = (crc << 1 ^ (0x42F0E1EBA9EA3693 if crc >> 63 else 0)) & (1 << 64) - 1
    return crc


def transform(matrix=(1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0), status="OK"):
    """Return an OpenIGTLink message that holds a pose and its metadata."""
    key, value = b"TransformStatus", status.encode()
    texts = key + value
    body = (struct.pack(">HHIi", 12, 10, len(texts), 1) + struct.pack(">12f", *matrix)
            + struct.pack(">HHHI", 1, len(key), 3, len(value)) + texts)
    return struct.pack(">H12s20sQQQ", 2, b"TRANSFORM", b"Patient", 0, len(body), crc64(body)) + body


def message(kind, device, body):
    """Return an OpenIGTLink message."""
    return struct.pack(">H12s20sQQQ", 1, kind, device, 0, len(body), crc64(body)) + body


def volume_text(text):
    """Return the message that gives the volume as a text."""
    return message(b"STRING", b"VOLUME", struct.pack(">HH", 3, len(text)) + text.encode())


def volume_number(ml):
    """Return the message that gives the volume above rest as a number."""
    return message(b"NDARRAY", b"VOLUME", struct.pack(">BBHd", 11, 1, 1, ml))


def stream(basis, *words, message=None):
    """Run the live lungs, send a message if there is one, and stop them when they have read it, or sent a frame."""
    with subprocess.Popen([SUPINE, "stream", basis, "--listen", "0", *words], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True) as server:
        line = server.stdout.readline()
        if "port" not in line:
            return "refused", server.communicate()[1]
        with socket.create_connection(("127.0.0.1", int(re.search(r"port (\d+)", line)[1])), timeout=60) as peer:
            if message is None:
                peer.recv(1)
            else:
                peer.sendall(message)
                peer.shutdown(socket.SHUT_WR)
                while peer.recv(4096):  # the peer is closed when all that it sent is read
                    pass
        server.terminate()
        said = "".join(server.communicate(timeout=60))
    if re.search(r"refused: [1-9]|volume is refused", said):
        return "refused", said
    return ("told" if re.search(r"(repaired|as invalid): [1-9]|warning:", said) else "taken"), said


def even(count):
    """Directions spread evenly over the sphere."""
    i = np.arange(count)
    z = 1 - (2 * i + 1) / count
    return np.column_stack([np.sqrt(1 - z * z) * np.cos(i * np.pi * (3 - 5 ** 0.5)),
                            np.sqrt(1 - z * z) * np.sin(i * np.pi * (3 - 5 ** 0.5)), z])


def write_ply(target, vertices, faces):
    with open(target, "w", encoding="utf-8") as file:
        file.write(f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\n"
                   f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\n"
                   "end_header\n")
        np.savetxt(file, vertices, "%.6f")
        np.savetxt(file, np.column_stack([np.full(len(faces), 3), faces]), "%d")


def write_points(name, rows):
    with open(name, "w", encoding="utf-8") as file:
        file.write("name,x,y,z\n" + "".join("%s,%.3f,%.3f,%.3f\n" % row for row in rows))


def write_pairs(name, rows):
    with open(name, "w", encoding="utf-8") as file:
        file.write("x,y,z,to_x,to_y,to_z\n")
        np.savetxt(file, rows, "%.4f", ",")


def write_image(name, image):
    kind = {"uint8": "uchar", "int16": "short", "float32": "float"}[image["values"].dtype.name]
    vectors = " ".join("(%g,%g,%g)" % tuple(row) for row in np.diag(image["step"]))
    with open(name, "wb") as file:
        file.write((f"NRRD0004\ntype: {kind}\ndimension: 3\nspace: left-posterior-superior\nsizes: "
                    f"{' '.join(map(str, image['values'].shape[::-1]))}\nspace directions: {vectors}\nspace origin: "
                    f"({','.join(map(str, image['origin']))})\nencoding: raw\nendian: little\n\n").encode())
        file.write(np.ascontiguousarray(image["values"]).tobytes())


def voxels_of(grid):
    """Return labels 1 (left) and 2 (right) of the voxels of a basis's grid, [z, y, x], their spacing and origin, mm."""
    depth = np.asarray(grid.tensor("depth")).ravel()
    frame, size = np.asarray(grid.tensor("grid"), float), np.asarray(grid.tensor("grid_size"), int)
    place = np.rint((grid.vertices - frame[0]) @ np.linalg.inv(frame[1:])).astype(int).T[::-1]
    labels = np.zeros(tuple(size)[::-1], np.uint8)
    labels[tuple(place)] = np.where(depth > 0, 1 + np.asarray(grid.tensor("lung")).ravel(), 0)
    return {"values": labels, "step": np.diag(frame[1:]).copy(), "origin": frame[0].copy()}


def leave(status):
    """Remove the folder, and end with a status."""
    os.chdir(SOURCE)
    folder.cleanup()
    sys.exit(status)
