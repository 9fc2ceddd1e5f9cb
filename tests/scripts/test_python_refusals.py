# SPDX-License-Identifier: GPL-3.0-or-later
"""Run every `raise` of the Python package: test_python_refusals.py SOURCE_FOLDER PROGRAM LIBRARY

Each case is refused with the words beside it; then each line with a raise statement must have run. A raise that no case
reaches is a fault, as a wrong name in it would be found by a user. Bases are pickled, and the package says what it
misses."""
import ast
import glob
import os
import pickle
import shutil
import subprocess
import sys
import tempfile

try:
    import numpy as np
except ImportError:
    print("skipped: no numpy")
    sys.exit(77)

source, program, library = sys.argv[1:4]
work = tempfile.TemporaryDirectory()
package = os.path.join(work.name, "python", "supine")
shutil.copytree(os.path.join(source, "runtime/python/supine"), package)

# Without its library, the package says what is missing.
told = subprocess.run([sys.executable, "-c", "import supine"], cwd=os.path.dirname(package), capture_output=True,
                      text=True, check=False, env={**os.environ, "LD_LIBRARY_PATH": ""})
assert "ImportError: the library supine_runtime is neither beside the package" in told.stderr, told.stderr
shutil.copy(library, os.path.join(package, "libsupine_runtime.so"))

ran = set()


def trace(frame, event, _):
    if not frame.f_code.co_filename.startswith(package):
        return None
    if event == "line":
        ran.add((os.path.basename(frame.f_code.co_filename), frame.f_lineno))
    return trace


sys.path.insert(0, os.path.dirname(package))
import supine  # noqa: E402
from supine import _library, _options, _program  # noqa: E402

os.chdir(work.name)
os.environ["PATH"] = ""
sys.settrace(trace)


def refused(kind, words, call, *arguments, **keywords):
    try:
        call(*arguments, **keywords)
    except kind as error:
        assert words in str(error), (words, str(error))
        assert not isinstance(error, NameError), error
        return
    raise AssertionError(f"not refused: {words}")


refused(supine.UnsupportedError, "neither on PATH nor beside", _program.find)
os.symlink(program, os.path.join(package, "supine"))
assert subprocess.run([program, "phantom", "--vertices", "600", "-o", "lungs.ply"], stdout=subprocess.DEVNULL,
                      check=True)
lungs = supine.precompute("lungs.ply", held_out=5, band=2)
inside = supine.embed(lungs, {"a": lungs.vertices[0] * .9, "b": lungs.vertices[-1] * .9})
bad, n = supine.ArgumentError, lungs.vertex_count
points, corners = np.zeros((4, 3)), np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def stop(_):
    raise KeyboardInterrupt("stopped by the caller")


def fill(options):
    _options.fill(_library.PrecomputeOptions(), options)


for case in (
        (ValueError, "gravity must be 3 numbers", supine.tilt, (0, 1), 5),
        (bad, "not finite", supine.tilt, (0, 1, np.nan), 5),
        (bad, "has no unit and no reference", lungs.pose, "prone", 500),
        (bad, "the volume is list", lungs.pose, "prone", ["rest"]),
        (bad, "is not a lung and its volume", lungs.pose, "prone", {"left": 5}),
        (bad, "the gain is nan", lungs.pose("prone").fill, np.nan),
        (ValueError, "of type float32", lungs.deform, lungs.pose("prone"), np.empty(3)),
        (ValueError, "must be contiguous", lungs.deform, lungs.pose("prone"), np.empty((3, n), np.float32).T),
        (ValueError, "is read-only", lungs.deform, lungs.pose("prone"), lungs.vertices),
        (bad, "names no structures", lungs.targets, "prone"),
        (IndexError, "must lie within", lungs.deform, lungs.pose("prone"), None, 5, n + 1),
        (bad, "xyz has a number", lungs.normals, np.full((n, 3), np.nan, np.float32)),
        (ValueError, "is not the number of positions", inside.locate, [0], np.zeros((2, 3))),
        (ValueError, "the number of sources", lambda: inside.locate([0], np.zeros((1, 3)), sources=np.zeros((2, 3)))),
        (TypeError, "cannot be pickled", pickle.dumps, inside.locate([0, 1], inside.vertices, "supine", "scan")),
        (ValueError, "image must be an array [z, y, x]", inside.warp, np.zeros((2, 2)), "prone"),
        (ValueError, "image must be an array [z, y, x]", inside.warp, [[1, 2]], "prone"),
        (ValueError, "step must be [3]", lambda: inside.warp(np.zeros((2, 2, 2), "i2"), "prone", step=[1])),
        (bad, "states:2: 'pron' is neither a posture", next,
         supine.augment(lungs, np.zeros((2, 2, 2), "i2"), states="pron")),
        (TypeError, "cannot be interpreted as an integer", inside.locate, [0.5], np.zeros((1, 3))),
        (ValueError, "give labels", next, supine.augment(lungs, rigid=[1], states=1)),
        (bad, "shapes of image and labels differ", next,
         supine.augment(lungs, np.zeros((2, 2, 2)), labels=np.zeros((3, 2, 2)), states=1)),
        (ValueError, "2 channels; a scan has 1", supine.Deform(lungs, affine=np.eye(4)),
         {"image": np.zeros((2, 4, 4, 4))}),
        (ValueError, "the position of the voxels is unknown", supine.Deform(lungs), {"image": np.zeros((4, 4, 4))}),
        (Exception, "must be a pose", lungs.deform, None),
        (supine.FormatError, "", supine.open, b"no basis"),
        (bad, "edge takes", fill, {"edge": "far"}), (bad, "band takes", fill, {"band": 2.5}),
        (bad, "constants takes", fill, {"constants": "1,2"}), (bad, "sex takes", fill, {"sex": "other"}),
        (bad, "resting takes", fill, {"resting": "supine"}), (bad, "scanned: ", fill, {"scanned": "sideways"}),
        (bad, "'sideways' is not one of", fill, {"resting": {"sideways": .5}}),
        (bad, "full takes", fill, {"full": "rest"}),
        (bad, "expandability takes", fill, {"expandability": "linear:q:1:2"}),
        (bad, "at most 64", fill, {"lesion": ["0,0,0,1,1"] * 65}),
        (bad, "the last two above 0", fill, {"lesion": "0,0,0,0,1"}), (bad, "lung takes", fill, {"lung": "middle:0.5"}),
        (bad, "given twice", fill, {"lung": ["left:0.5", "left:0.4"]}), (bad, "modes takes", fill, {"modes": 65}),
        (bad, "held_out takes", fill, {"held_out": 0}), (TypeError, "cannot be an array", fill, {"edge": np.ones(2)}),
        (bad, "no option 'egde'", fill, {"egde": 3}),
        (TypeError, "cannot be an array", lambda: supine.embed(lungs, {"a": [0, 0, 0]}, edge=np.ones(2))),
        (ValueError, "vertices must be [N, 3]", supine.precompute, np.zeros((4, 2)), corners),
        (ValueError, "faces must be integers", supine.precompute, points, corners * 1.0),
        (ValueError, "give each point a name of its own", supine.embed, lungs,
         {"n": np.zeros((3, 3)), "m": np.zeros((3, 3))}),
        (ValueError, "points must be [n, 3]", supine.embed, lungs, np.zeros((2, 2))),
        (ValueError, "points must be [n, 3], not []", supine.embed, lungs, 5.0),
        (ValueError, "expected points [P, 3]", supine.save_fields, "f", points, points, points),
        (ValueError, "expected the run of each row", supine.save_fields, "f", points, points, np.zeros((4, 4, 3)),
         [1, 2]),
        (supine.ReadError, "cannot read", supine.precompute, "absent.ply"),
        (supine.Error, "", supine.precompute, points, corners),
        (KeyboardInterrupt, "stopped by the caller", lambda: supine.precompute("lungs.ply", progress=stop))):
    refused(*case)
    print("refused:", case[1] or case[0].__name__)

# What is open is pickled by its bytes or by its path.
lungs2 = supine.precompute("lungs.ply", held_out=5, band=2, output="lungs.safetensors")
for basis in (lungs, supine.open("lungs.safetensors", storage="exact"), supine.open(memoryview(lungs._owner.source))):
    again = pickle.loads(pickle.dumps(basis))
    assert again.storage == basis.storage and again.report == basis.report
    assert (again.deform(again.pose("prone")) == basis.deform(basis.pose("prone"))).all()
    assert (again.deform(pickle.loads(pickle.dumps(basis.pose("prone")))) == basis.deform(basis.pose("prone"))).all()

sys.settrace(None)
# Two run only with the offline library beside the package: a fault at its output, and an exception in its progress.
offline = {"_replace", "precompute"}
faults = []
for path in glob.glob(os.path.join(package, "*.py")):
    with open(path, encoding="utf-8") as opened:
        tree = ast.parse(opened.read())
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef) and function.name not in offline | {"_load"}:
            for node in ast.walk(function):
                if isinstance(node, ast.Raise) and not any((os.path.basename(path), line) in ran
                                                           for line in range(node.lineno, node.end_lineno + 1)):
                    faults.append(f"{os.path.basename(path)}:{node.lineno}: no case runs this raise")
assert not faults, "\n".join(sorted(set(faults)))
