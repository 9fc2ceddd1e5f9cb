# SPDX-License-Identifier: GPL-3.0-or-later
"""Give a right and a wrong input of every row of the table of checks (docs/inputs.md) to every interface that takes it, and
show the verdicts: taken, told (a warning) or refused. All interfaces must give the same one.

    python3 tests/inputs.py [BUILD_FOLDER]

The folder, build/release by default, must have the program and the shared libraries. JavaScript runs if the target `npm`
was built and node is installed. To add a row: add it to base/inputs.c, and its cases to CASES below."""
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
SOURCE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SUPINE = os.path.join(BUILD, "supine")
PACKAGE = os.path.join(BUILD, "runtime/js/package/supine.js")
INTERFACES = ("command", "C", "Python", "JavaScript")
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
                ("remedy", ctypes.c_char_p), ("interfaces", ctypes.c_uint)]


def table():
    """Return the rows of the table, in its order."""
    get = ctypes.CDLL(os.path.abspath("py/supine/libsupine_runtime.so")).supine_input_get
    get.restype = ctypes.POINTER(Row)
    rows = []
    while get(len(rows)):
        rows.append(get(len(rows)).contents)
    return rows


def command(*words):
    """Run the program; return the verdict and what it said."""
    done = subprocess.run([SUPINE, *map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1, 2, 5), done
    return ("refused" if done.returncode else "told" if "warning:" in done.stderr else "taken"), done.stderr


def python(call):
    """Call a function of the Python package; return the verdict and what it said."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            call()
        except (ValueError, TypeError, ArithmeticError, supine.Error) as error:
            return "refused", str(error)
    return ("told" if said else "taken"), " ".join(str(w.message) for w in said)


def pose_in_c(posture, volume):
    """Compute a pose as a C program does."""
    given, other = c.State((0.0, 1.0, 0.0)), c.State()
    c.state_parse(posture.encode(), given)
    if volume:
        c.state_parse_volume(volume.encode(), other)
    c.state_join(given, other, given)
    c.basis_pose(lungs._c, given, supine.Pose())


JAVASCRIPT = """
import { readFileSync } from 'node:fs';
const { open } = await import(process.argv[1]);
const lungs = await open(readFileSync('lungs.safetensors'));
const say = (state) => { try { lungs.pose(state); return ['taken', '']; } catch (error) { return ['refused', error.message]; } };
console.log(JSON.stringify(JSON.parse(process.argv[2]).map(say)));
"""


def javascript(state):
    """Compute a pose in node; return None if it cannot run."""
    node = shutil.which("node")
    if node is None or not os.path.exists(PACKAGE):
        return None
    done = subprocess.run([node, "--input-type=module", "-e", JAVASCRIPT, PACKAGE, json.dumps([state])],
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return tuple(json.loads(done.stdout)[0])


def state(posture, volume="", javascript_state=None):
    """A state, in all interfaces. JavaScript takes posture and volume as one text."""
    text = javascript_state or (f"{posture}:{volume}" if volume else posture)
    return {"command": lambda: command("deform", "lungs.safetensors", "--posture", posture,
                                       *(["--volume", volume] if volume else []), "-o", "out.ply"),
            "C": lambda: python(lambda: pose_in_c(posture, volume)),
            "Python": lambda: python(lambda: lungs.pose(posture, volume)),
            "JavaScript": lambda: javascript(text)}


def made(path, **options):
    """A basis made from a surface. The Python package passes the options to the C library."""
    words = [word for key, value in options.items() for word in (f"--{key}", value)]
    return {"command": lambda: command("precompute", path, "--held-out", 20, *words, "-o", "out.safetensors"),
            "C": lambda: python(lambda: supine.precompute(path, held_out=20, **options)),
            "Python": lambda: python(lambda: supine.precompute(path, held_out=20, **options))}


def points(z):
    with open("points.csv", "w", encoding="utf-8") as file:
        file.write(f"name,x,y,z\nin,-80,-120,-90\nother,-80,-120,{z}\n")


def embedded(z):
    def run(call):
        points(z)
        return call()
    return {"command": lambda: run(lambda: command("embed", "lungs.safetensors", "points.csv", "-o", "out.safetensors")),
            "Python": lambda: run(lambda: python(lambda: supine.embed(lungs, "points.csv")))}


def located(volume, degrees=0.0):
    """Locate the lungs from points where they are in supine posture at rest, in a frame that is turned."""
    names = list(inside.points)
    vertices = [inside.points[name] for name in names]
    seen = inside.deform(inside.pose("supine:rest"))[vertices].astype(float)
    t, mean = np.radians(degrees), seen.mean(axis=0)
    turn = np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]])
    seen = (seen - mean) @ turn.T + mean

    def by_command():
        with open("seen.csv", "w", encoding="utf-8") as file:
            file.write("name,x,y,z\n" + "".join(f"{name},{x:.6f},{y:.6f},{z:.6f}\n" for name, (x, y, z) in zip(names, seen)))
        return command("locate", "lungs.safetensors", "seen.csv", "--points", "inside.safetensors", "--posture", "supine",
                       "--volume", volume, "-o", "found.csv")

    by_python = lambda: python(lambda: inside.locate(vertices, seen, "supine", volume))
    return {"command": by_command, "C": by_python, "Python": by_python}


def crc64(data):
    crc = 0
    for byte in data:
        crc ^= byte << 56
        for _ in range(8):
            crc = (crc << 1 ^ (0x42F0E1EBA9EA3693 if crc >> 63 else 0)) & (1 << 64) - 1
    return crc


def tracked(status, device="Patient"):
    """Send a pose with metadata to the live lungs, and stop them."""
    key, value = b"TransformStatus", status.encode()
    matrix = struct.pack(">12f", 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0)
    texts = key + value
    body = struct.pack(">HHIi", 12, 10, len(texts), 1) + matrix + struct.pack(">HHHI", 1, len(key), 3, len(value)) + texts
    head = struct.pack(">H12s20sQQQ", 2, b"TRANSFORM", b"Patient", 0, len(body), crc64(body))

    def run():
        with subprocess.Popen([SUPINE, "stream", "lungs.safetensors", "--listen", "0", "--device", device],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as server:
            line = server.stdout.readline()
            if "port" not in line:
                return "refused", server.communicate()[1]
            with socket.create_connection(("127.0.0.1", int(re.search(r"port (\d+)", line)[1]))) as peer:
                peer.sendall(head + body)
                peer.recv(1)  # the first frame
            server.terminate()
            said = "".join(server.communicate(timeout=20))
        return ("told" if "marked as invalid: 1" in said else "taken"), said
    return {"command": run}


def suggested(word):
    """The verdict is `told` if a word is suggested."""
    def verdict(run):
        done = run()
        if done is None:
            return None
        assert done[0] == "refused", done
        return ("taken" if "did you mean" in done[1] else "told"), done[1]
    return {name: lambda run=run: verdict(run) for name, run in state(word).items()}


def breath(ml):
    return {"command": lambda: command("compare", "lungs.safetensors", "--postures", "supine", "--breath", ml)}


def field(posture):
    return {"command": lambda: command("deform", "grid.safetensors", "--posture", posture, "--field", "field.nrrd")}


def members(value):
    given = value if isinstance(value, dict) else list(value)
    return {"JavaScript": lambda: javascript(given),
            "Python": lambda: python(lambda: lungs.pose(given.get("gravity", given) if isinstance(given, dict) else given,
                                                        given.get("volume", "") if isinstance(given, dict) else ""))}


# For each row: a right input, a wrong one, and the verdict on the wrong one.
CASES = {
    "volumes-of-a-state": (state("prone", "rest"),
                           state("prone:rest", "full", {"posture": "prone:rest", "volume": "full"}), "refused"),
    "tilt": (state("left+45"), state("supine+500"), "refused"),
    "roll": (state("supine@30"), state("supine@200"), "refused"),
    "volume-finite": (state("prone:rest+100"), state("prone:rest+nan"), "refused"),
    "volume-least": (state("prone:2L"), state("prone:50mL"), "refused"),
    "volume-most": (state("supine:full"), state("supine:9L"), "refused"),
    "folds": (state("0:1:-1:2L"), state("0:1:-1:700mL"), "refused"),
    "field-folds": (field("prone:rest"), field("0:1:-1:700mL"), "refused"),
    "breath": (breath(500), breath(3500), "told"),
    "state-members": (members({"gravity": [0, -1, 0], "volume": "rest"}), members({"posture": "prone", "volume": "rest"}),
                      "refused"),
    "point-outside": (embedded(-100), embedded(900), "refused"),
    "device-name": (tracked("OK"), tracked("OK", "a_name_of_21_letters_"), "refused"),
    "tracker-invalid": (tracked("OK"), tracked("INVALID"), "told"),
    "height-least": (made("lungs.ply", height=160, sex="female"), made("lungs.ply", height=135, sex="female"), "told"),
    "height-most": (made("lungs.ply", height=180, sex="male"), made("lungs.ply", height=200, sex="male"), "told"),
    "rest-share": (made("lungs.ply", height=180, sex="male"), made("lungs.ply", height=230, sex="male"), "refused"),
    "gas": (made("lungs.ply"), made("tiny.ply", units="mm"), "told"),
    "lungs-small": (made("lungs.ply"), made("small.ply", units="mm"), "told"),
    "locate-residuals": (lambda: located("rest"), lambda: located("full"), None),
    "locate-turned": (lambda: located("rest"), lambda: located("rest", 25.0), None),
    "suggestion": (suggested("pron"), suggested("Bauchlage"), "told"),
}


def scale(source, target, factor):
    """Write a copy of a binary PLY file of floats or doubles with its vertices scaled."""
    assert command("embed", "lungs.safetensors", "--grid", 8, "-o", "grid.safetensors")[0] == "taken"
    vertices, faces = lungs.vertices.astype(float) * factor, lungs.triangles
    with open(target, "w", encoding="utf-8") as file:
        file.write(f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\n"
                   f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
        np.savetxt(file, vertices, "%.6f")
        np.savetxt(file, np.column_stack([np.full(len(faces), 3), faces]), "%d")


def prepare():
    """Make the inputs that the cases share."""
    assert command("phantom", "--vertices", 3000, "-o", "lungs.ply")[0] == "taken"
    assert command("precompute", "lungs.ply", "--held-out", 20, "-o", "lungs.safetensors")[0] == "taken"
    opened = supine.open("lungs.safetensors")
    number = np.random.default_rng(1)
    low, high = (np.array(b) for b in ([-120, -180, -200], [-60, -100, -60]))
    with open("inside.csv", "w", encoding="utf-8") as file:
        file.write("name,x,y,z\n")
        for i in range(12):
            x, y, z = low + number.random(3) * (high - low)
            file.write(f"p{i},{x * (-1) ** i:.3f},{y:.3f},{z:.3f}\n")
    assert command("embed", "lungs.safetensors", "inside.csv", "-o", "inside.safetensors")[0] == "taken"
    return opened, supine.open("inside.safetensors")


lungs, inside = prepare()
scale("lungs.ply", "small.ply", 0.75)
scale("lungs.ply", "tiny.ply", 0.4)
faults = []
rows = table()
print(f"{'check':20} {'input':6} " + " ".join(f"{name:11}" for name in INTERFACES))
for row in rows:
    name = row.name.decode()
    if name not in CASES:
        faults.append(f"{name}: no cases")
        continue
    right, wrong, expected = CASES[name]
    wanted = {interface for i, interface in enumerate(INTERFACES) if row.interfaces >> i & 1}
    for kind, case in (("right", right), ("wrong", wrong)):
        calls = case() if callable(case) else case
        if set(calls) != wanted:
            faults.append(f"{name}: the table says {sorted(wanted)}, the cases {sorted(calls)}")
        said = {interface: call() for interface, call in calls.items()}
        verdicts = {interface: done[0] for interface, done in said.items() if done is not None}
        print(f"{name:20} {kind:6} " + " ".join(f"{verdicts.get(interface, '-'):11}" for interface in INTERFACES))
        good = {"taken"} if kind == "right" else {expected} if expected else {"told", "refused"}
        if len(set(verdicts.values())) > 1 or not set(verdicts.values()) <= good:
            faults.append(f"{name}, {kind}: {verdicts}, not {sorted(good)}: " + "; ".join(
                done[1].strip().split("\n")[-1] for done in said.values() if done is not None))
for name in CASES.keys() - {row.name.decode() for row in rows}:
    faults.append(f"{name}: not in the table")
print("\n".join(faults) if faults else f"{len(rows)} rows: the interfaces agree")
os.chdir(SOURCE)
folder.cleanup()
sys.exit(1 if faults else 0)
