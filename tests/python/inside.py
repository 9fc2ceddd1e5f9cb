# SPDX-License-Identifier: GPL-3.0-or-later
"""Test the Python package. test_python.py runs this program in the environment into which it installed the wheel.

    inside.py REFERENCE BASIS        REFERENCE is the program reference.c, which computes expected results"""
import ctypes
import gc
import locale
import os
import shutil
import subprocess
import sys
import threading
import time
import warnings

import numpy as np

import supine

locale.setlocale(locale.LC_ALL, "")  # as host programs do: results must not depend on it
reference, path, maker = sys.argv[1:4]  # maker: "program" or "library", which makes bases


def refused(kind, text, call, *arguments, **keywords):
    try:
        call(*arguments, **keywords)
    except kind as error:
        assert text in str(error), (text, str(error))
        return str(error)
    raise AssertionError(f"not refused: {text}")


assert os.path.dirname(supine.__file__).startswith(sys.prefix), supine.__file__
lungs = supine.open(path)
n, k = lungs.vertex_count, lungs.mode_count
assert lungs.has_volume and lungs.has_normals and list(lungs.lungs) == ["left", "right"]

# Arrays of a basis are read-only views, not copies. The basis stays open while one of its arrays exists.
for array, shape, dtype in ((lungs.vertices, (n, 3), np.float32),
                            (lungs.triangles, (lungs.triangle_count, 3), np.uint32),
                            (lungs.coefficients, (n, k), np.float32), (lungs.direction, (n, 3), np.float32),
                            (lungs.modes, (k, (lungs.band + 1) ** 2, 1), np.float64),
                            (lungs.bounds, (2, 2, 3), np.float32), (lungs.tensor("lung"), (n,), np.uint8),
                            (lungs.tensor("normals"), lungs.tensor("normals").shape, np.int8)):
    assert array.shape == shape and array.dtype == dtype and not array.flags.owndata
    assert not array.flags.writeable and array.flags.c_contiguous
assert lungs.tensor("vertices").ctypes.data == lungs.vertices.ctypes.data
assert lungs.tensor("none") is None
for i, part in enumerate(lungs.lungs.values()):
    assert (lungs.tensor("lung")[part] == i).all()
    assert (lungs.vertices[part].min(0) == lungs.bounds[i, 0]).all()
    assert (lungs.vertices[part].max(0) == lungs.bounds[i, 1]).all()
faces = lungs.faces.reshape(-1, 4)
assert faces.dtype == np.int64 and (faces[:, 0] == 3).all() and (faces[:, 1:] == lungs.triangles).all()
kept, first = supine.open(path).vertices, lungs.vertices.copy()
gc.collect()
assert (kept == first).all()

# The errors of two vertices in two states have a covariance; samples and registrations follow from it.
mean, covariance = lungs.covariance([0, 5, n - 1], ["supine:rest", "prone:rest"])
assert mean.shape == (2, 3, 3) and covariance.shape == (2, 3, 3, 2, 3, 3)
square = covariance.reshape(18, 18)
assert (square == square.T).all() and np.linalg.eigvalsh(square).min() > -1e-9 * square.max()
assert np.abs(mean[1] - lungs.deform(lungs.pose("prone:rest"))[[0, 5, n - 1]]).max() < 1e-3
other = lungs.covariance([0], "supine:rest", another_day=True)[1]
assert abs(other[0, 0, 0, 0, 0, 0] - square[0, 0] - 4 / 9 * 6.2 ** 2) < 1e-9
drawn = lungs.samples("supine:rest", 2, seed=3)
assert drawn.shape == (2, n, 3) and (drawn[0] != drawn[1]).any()
assert (drawn == lungs.samples("supine:rest", 2, seed=3)).all()
fiducials = [0, n // 4, n // 2, n - 1]
turn, shift, left = lungs.registration("prone:rest", fiducials)
placed = lungs.deform(lungs.pose("prone:rest"))[fiducials] @ turn.T + shift
assert np.abs(turn @ turn.T - np.eye(3)).max() < 1e-6
assert np.abs((placed - lungs.deform(lungs.pose("supine:scan"))[fiducials]).mean(0)).max() < 0.01
assert left.shape == (n,) and (left > 0).all() and left[0] < lungs.expected_error("prone:rest")[0] * (4 / 3) ** .5
refused(supine.ArgumentError, "2 points of the frame", lungs.registration, "prone", [0, 1])

# A basis of clusters has computed coefficients. In fields over gravity and volume, each lung has weights of its own.
for name, shape in (("clusters", (5,)), ("simulated", (2, 2))):
    other = supine.open(f"{name}.safetensors", storage="exact")
    asked = other.pose("prone", "scan+100")
    weights, gains = other.weights(asked), other.gains(asked)
    assert weights.shape == shape and other.coefficients.shape == (60, 3, shape[-1])
    assert other.order == len(shape[1:]) * 2
    expected = other.vertices.astype(float)
    for i, part in enumerate(other.lungs.values()):
        own = weights if weights.ndim == 1 else weights[i]
        expected[part] += gains[i] * (other.coefficients[part].astype(float) @ own)
    assert np.abs(other.deform(asked) - expected).max() < 1e-3

# Results have the same bits as in C, for a basis from a file, for a basis from memory, and for ranges of vertices.
STATE = "prone:rest+321.5"
pose, supine_rest = lungs.pose(STATE), lungs.pose("supine")
assert abs(lungs.volumes(pose).sum() - lungs.volumes(lungs.pose("prone:rest")).sum() - 321.5) < 1e-6
assert lungs.weights(pose).shape == (k,) and lungs.gains(pose).shape == (2, 3)
out = path + ".raw"
subprocess.run([reference, path, STATE, out], check=True)
raw = np.fromfile(out, np.float32).reshape(5, n, 3)
assert np.ptp(raw[0] - lungs.vertices) > 1.0  # the state must displace the vertices, or nothing is tested
with open(path, "rb") as file:
    in_memory = supine.open(file.read())
for basis in (lungs, in_memory):
    points, normals = basis.deform_lit(pose)
    assert points.tobytes() == raw[0].tobytes() and normals.tobytes() == raw[1].tobytes()
    assert basis.deform(pose).tobytes() == raw[0].tobytes()
    assert basis.normals(points).tobytes() == raw[2].tobytes()
    assert basis.deform_batch([pose, supine_rest]).tobytes() == raw[3:].tobytes()
part = np.empty((50, 3), np.float32)
assert lungs.deform(pose, part, 100, 150) is part and part.tobytes() == raw[0, 100:150].tobytes()
moved = lungs.displace(pose)
assert np.abs(lungs.vertices + moved - raw[0]).max() <= 2 * lungs.error(pose)
assert bytes(lungs.pose((0, -2, 0), "rest+321.5")) == bytes(pose) == bytes(lungs.pose(STATE, out=supine.Pose()))
assert (lungs.deform(supine.Pose().fill(0.0)) == lungs.deform(lungs.pose("full"))).all()

# A gain is judged by the volumes that it gives, in the posture of the pose.
full = lungs.pose("full")
assert np.abs(lungs.deform(lungs.pose("prone").fill(1.0)) - lungs.deform(full)).max() > 1
refused(supine.NumericalError, "of full inflation", lungs.pose("prone").fill, 9.81)
refused(supine.ArgumentError, "finite", lungs.pose("prone").fill, np.nan)
allowed = supine.open(path, allow_folds=True)
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    allowed.pose("prone")
    assert not said, said
    allowed.pose("supine:full+2L")
    assert len(said) == 1 and "outside the 10 to 120 %" in str(said[0].message), said
    allowed.pose("prone").fill(9.81)
    assert len(said) == 2 and "of full inflation" in str(said[1].message), said

# A state `since` is judged as that of a pose, by all that take one.
TOO_FULL = "supine:full+2L"
for ask in (lambda basis, since: basis.expected_error("prone", since=since),
            lambda basis, since: basis.covariance([0], "prone", since),
            lambda basis, since: basis.samples("prone", 1, since=since),
            lambda basis, since: basis.registration("prone", [0, 60, 120], since)):
    refused(supine.NumericalError, "of full inflation", ask, lungs, TOO_FULL)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        ask(allowed, TOO_FULL)
    assert [str(one.message).partition(":")[0] for one in said] == ["supine at full inflation + 2000 mL"], said

# A number is neither a volume nor a state.
for wrong in (2600, 2600.0, np.float64(2600)):
    refused(supine.ArgumentError, "'2600mL'", lungs.pose, "prone", wrong)
    refused(supine.ArgumentError, "'2600mL'", lungs.pose, wrong)
refused(supine.ArgumentError, "give a text", lungs.pose, "prone", None)
refused(supine.ArgumentError, "20 mL or more", supine.breath, [0], tidal=0.5)

# A pose of another basis is refused, but a basis and the structures embedded in it share their poses.
other = supine.open("other.safetensors").pose("prone")
refused(supine.ArgumentError, "made by another basis", lungs.deform, other)
refused(supine.ArgumentError, "made by another basis", lungs.volumes, other)
grid = supine.open("grid.safetensors")
assert (grid.deform(pose) == grid.deform(grid.pose(STATE))).all()

# The direction of gravity can be given as a name, a tilt or a rotation.
assert tuple(supine.gravity("HFP")) == (0.0, -1.0, 0.0) and "prone" in supine.postures()
assert np.allclose(supine.tilt("supine", 90), (0, 0, 1))
assert np.allclose(supine.gravity_of_rotation((1, 0, 0, 0), (0, 0, 1)), supine.gravity("upright"))
back = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # a Unity object that faced +z, and now lies on its back
assert np.allclose(supine.gravity_of_rotation(back, (0, 1, 0), "unity"), supine.gravity("supine"))
refused(supine.ArgumentError, "mirrored", supine.gravity_of_rotation, np.diag((1, 1, -1)), (0, 1, 0), "unity")
refused(supine.ArgumentError, "Normalise", supine.gravity_of_rotation, (1, 1, 0, 0), (0, 1, 0), "unity")
refused(supine.ArgumentError, "not finite", supine.gravity_of_rotation, (np.nan, 1, 0, 0), (0, 1, 0))
refused(supine.ArgumentError, "give one of lps unity", supine.gravity_of_rotation, (1, 0, 0, 0), (0, 1, 0), "blender")

# supine.breath computes the volume inhaled at each time of a breath.
times = np.array([[0, 5 / 3], [5, 2]])
volumes = supine.breath(times)
assert volumes.shape == (2, 2) and np.allclose(volumes[:, 0], 0, atol=1e-9) and abs(volumes[0, 1] - 500) < 1e-9
assert np.allclose(supine.breath([0.5, 3], course="flow", inhale=0.5, tidal=100), [20, 80])
straight = [[0, 30, 0, 3000, 0, 0, 0, 0, 0]] * 2  # a pressure-volume relation of 100 mL per cmH2O
assert np.allclose(supine.breath([5 / 6], pv=straight, course="ramp"), 250) and supine.breath(5 / 6).shape == ()
refused(supine.ArgumentError, "tidal volume", supine.breath, [0], tidal=9000)
refused(ValueError, "pv must be 18 numbers", supine.breath, [0], pv=straight[0])

# An error in the C library raises an exception of Supine that is also an exception of Python, such as ValueError.
with open(path, "rb") as file:
    whole = file.read()
with open(path + ".cut", "wb") as file:
    file.write(whole[:-1000])
in_c = subprocess.run([reference, path + ".cut", "prone", out], capture_output=True, text=True, check=False)
assert in_c.returncode == 2 and in_c.stderr.startswith(path + ".cut: ")
assert refused(ValueError, ".cut: ", supine.open, path + ".cut") == in_c.stderr.rstrip("\n")
refused(supine.FormatError, "basis in memory: ", supine.open, whole[:-1000])
refused(OSError, "missing.safetensors: cannot read", supine.open, "missing.safetensors")
refused(supine.ArgumentError, "did you mean 'prone'", lungs.pose, "pron")
refused(supine.ArgumentError, "", lungs.pose, "prone:500")
refused(supine.ArgumentError, "gravity", lungs.pose, (0, 0, 0))
refused(supine.ArgumentError, "gravity", lungs.pose, (0, 0, float("nan")))
for wrong in (float("nan"), float("inf")):
    refused(supine.ArgumentError, "gain is", lungs.pose("prone").fill, wrong)
    refused(supine.ArgumentError, "xyz", lungs.normals, np.full((lungs.vertex_count, 3), wrong, np.float32))
    own = lungs.pose("prone")
    own.gains[0][1] = wrong
    for use in (lungs.deform, lungs.displace, lungs.volumes):
        refused(supine.ArgumentError, "not finite", use, own)
    own = lungs.pose("prone")
    own.weights[0] = wrong
    refused(supine.ArgumentError, "not finite", lungs.deform, own)
refused(supine.NumericalError, "volume", lungs.pose, "rest-1e6")
each = lungs.pose((0, -1, 0), {"left": "rest", "right": "rest+250"})
assert list(each.weights) == list(lungs.pose((0, -1, 0), "left=rest,right=rest+250").weights)
for wrong in ({"left": 3}, {"left": "rest,right=2L"}, {"middle": "rest"}):
    refused(supine.ArgumentError, "left" if "left" in wrong else "named", lungs.pose, (0, -1, 0), wrong)
unlit = supine.open(path, normals=False)  # normals of the triangles, then
own = unlit.pose("prone")
xyz, normals = unlit.deform_lit(own)
assert (xyz == unlit.deform(own)).all() and np.abs(normals - unlit.normals(xyz)).max() < 1e-6
assert issubclass(supine.NumericalError, supine.Error) and issubclass(supine.Error, Exception)
# These exceptions are raised by the package itself, not for an error in the C library.
refused(ValueError, "float32", lungs.deform, pose, np.empty((n, 3)))
refused(ValueError, "float32", lungs.deform, pose, np.empty((n - 1, 3), np.float32))
refused(ValueError, "contiguous", lungs.deform, pose, np.empty((n, 6), np.float32)[:, ::2])
refused(IndexError, "vertices 0 to", lungs.deform, pose, None, 0, n + 1)
refused(ValueError, "gravity must be 3 numbers", lungs.pose, (0, 1))
refused(ctypes.ArgumentError, "", lungs.deform, None)
refused(ValueError, "", supine.open, path, storage="tiny")
refused(ValueError, "read-only", lungs.displace, pose, lungs.vertices)
try:
    lungs.vertices[0] = 0
    raise AssertionError("an open basis was written to")
except ValueError:
    pass

# Lungs are located from observed points: a wrong point is reported, a rotation is found, and invalid points are
# refused.
seen = list(range(0, n, n // 20))
truth = lungs.deform(lungs.pose("left:rest+300"))
turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
observed = truth[seen] @ turn.T + [500, 20, -7]
found = lungs.locate(seen, observed, "left", rigid=True, noise=1)
xyz, sigma = found.positions(lungs)
assert np.sqrt(((xyz - truth @ turn.T - [500, 20, -7]) ** 2).sum(1).mean()) < 2.5
assert np.abs(found.rotation - turn).max() < 0.05 and (sigma > 0).all() and not found.outliers.any()
assert abs(found.volume - lungs.volumes(lungs.pose("left:rest+300")).sum()) < 2 * found.volume_error
observed = truth[seen] + np.array([12, -7, 20])
observed[7, 2] += 60
found = lungs.locate(seen, observed, "left", "rest+300")
assert list(np.flatnonzero(found.outliers)) == [7] and found.volume_error == 0
# The field of located lungs is that which `positions` states, and samples have the volume that was given.
mean, covariance = found.covariance(lungs, seen[:3])
assert np.abs(mean - found.positions(lungs)[0][seen[:3]]).max() < 1e-3
assert np.abs(np.sqrt(np.einsum("ikik->i", covariance)) - found.positions(lungs)[1][seen[:3]]).max() < 1e-3
drawn = found.samples(lungs, 2, seed=3)
assert drawn.shape == (2, n, 3) and (drawn[1] != drawn[0]).any()
assert (found.positions(lungs)[1] <= np.maximum(3.01, 1.001 * lungs.expected_error("left", "rest+300"))).all()
assert (lungs.expected_error("scan") == 0).all()
# Two views, rows of one vertex, show where the points are; one view leaves the depth to its prior.
place = truth[seen] + np.array([12, -7, 20])
source = np.array([[12.0, -700, 20], [400, -560, 20]])
views = np.concatenate([a + 1.5 * (place - a) for a in source]), np.repeat(source, len(seen), axis=0)
found = lungs.locate(seen * 2, views[0], "left", "rest+300", sources=views[1])
assert found.depth_error == 0 and np.abs(found.translation - [12, -7, 20]).max() < 0.5, found.translation
found = lungs.locate(seen, views[0][:len(seen)], "left", "rest+300", sources=views[1][:len(seen)], depth=9)
assert 2 < found.depth_error < 9 and np.abs(found.translation - [12, -7, 20]).max() < 9, found.depth_error
mixed = np.where(np.arange(len(seen))[:, None] % 2, views[1][:len(seen)], np.nan)
found = lungs.locate(seen, np.where(np.isnan(mixed), place, views[0][:len(seen)]), "left", "rest+300", sources=mixed)
assert found.depth_error == 0 and np.abs(found.translation - [12, -7, 20]).max() < 0.5, found.translation
refused(ValueError, "sources", lungs.locate, [0, 1], truth[:2], sources=truth[:1])
refused(supine.ArgumentError, "two finite positions that differ", lungs.locate, [0], truth[:1], sources=truth[:1])
refused(supine.ArgumentError, "depth", lungs.locate, seen, place, depth=-1)
refused(supine.ArgumentError, "observed points", lungs.locate, [], [])
refused(supine.ArgumentError, "give a vertex below", lungs.locate, [n], [(0, 0, 0)])
refused(supine.ArgumentError, "three", lungs.locate, [0, 1], truth[:2], rigid=True)
refused(ValueError, "positions", lungs.locate, [0, 1], truth[:1])

# Calls that compute all vertices release the interpreter's lock. The switch interval below is so long that another
# thread runs only if a call releases the lock. As a control, `repr` must not release it.
def lets_others_run(call, *arguments, tries=None):
    gate, ran = threading.Lock(), []

    def wait():
        with gate:
            ran.append(True)

    gate.acquire()
    waiting = threading.Thread(target=wait)
    waiting.start()
    gate.release()
    count, until = 0, time.monotonic() + 60  # 60 s are enough even on a busy machine
    while not ran and (count < tries if tries else time.monotonic() < until):
        call(*arguments)
        count += 1
    result = bool(ran)
    waiting.join()
    return result


sys.setswitchinterval(1000)
assert not lets_others_run(repr, lungs, tries=2000), "repr released the lock, so nothing is tested"
points = np.empty((n, 3), np.float32)
for call, *arguments in ((lungs.deform, pose, points), (lungs.displace, pose, points),
                         (lungs.deform_lit, pose, points, points.copy()), (lungs.normals, raw[0], points),
                         (lungs.deform_batch, [pose] * 100), (supine.open, path)):
    assert lets_others_run(call, *arguments), f"{call} does not release the lock"
sys.setswitchinterval(0.005)

# An image is unchanged in the state of the scan, and warped in other states. A call may get one state or several.
# Wrong input is refused.
grid = supine.open("grid.safetensors")
low, high = lungs.vertices.min(0) - 20, lungs.vertices.max(0) + 20
size = ((high - low) / [6, 7, 8]).astype(int)
z, y, x = np.indices(size[::-1])
image = (-800 + 100 * np.sin(x / 3) + 60 * np.cos(y / 2 + z / 4)).astype(np.int16)
frame = {"step": (6, 7, 8), "origin": low}
assert (grid.warp(image, "scan", **frame) == image).all()
moved, dense = (grid.warp(image, ["prone:rest", "left:rest+300"], **frame, density=d) for d in (False, True))
assert all(m.shape == image.shape and m.dtype == np.int16 and (m != image).any() for m in moved)
assert (moved[0] != moved[1]).any() and (dense[0] > moved[0]).any()
assert (supine.open(open("grid.safetensors", "rb").read()).warp(image, "prone:rest", **frame) == moved[0]).all()
# Samples of a grid hold the volumes: the Jacobians at the centres of its cells, times their share in the lungs, have
# the sum that they have in the prediction.
def volumes_of(xyz):
    """Return the volume of a grid's cells in the lungs, mL, by the Jacobian at their centres."""
    places = np.full((np.prod(grid.tensor("grid_size")), 3), np.nan)
    deep = np.full(len(places), np.nan)
    places[grid.tensor("part")], deep[grid.tensor("part")] = xyz, grid.tensor("depth")
    shape = tuple(grid.tensor("grid_size")[::-1])
    places, deep = places.reshape(*shape, 3), deep.reshape(shape)
    edges = [np.diff(places, axis=a) for a in (2, 1, 0)]
    for a, edge in zip((2, 1, 0), edges):
        for other in {0, 1, 2} - {a}:
            last = edge.shape[other] - 1
            edge = (np.take(edge, range(1, last + 1), other) + np.take(edge, range(last), other)) / 2
        edges[2 - a] = edge
    corners = np.stack([deep[i:shape[0] - 1 + i, j:shape[1] - 1 + j, k:shape[2] - 1 + k]
                        for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    share = np.clip(0.5 + corners.mean(0) / (corners.max(0) - corners.min(0)), 0, 1)
    share = np.where(corners.min(0) >= 0, 1, np.where(corners.max(0) <= 0, 0, share))
    return np.nansum(share * np.einsum("...i,...i", edges[0], np.cross(edges[1], edges[2]))) / 1000


held = volumes_of(grid.deform(grid.pose("prone:rest")))
for drawn in grid.samples("prone:rest", 3, seed=2):
    assert abs(volumes_of(drawn) / held - 1) < 1e-3, (volumes_of(drawn), held)
turned = grid.warp(image.astype(">f8")[:, :, ::-1], "prone:rest", step=np.diag([-6, 7, 8]),
                   origin=low + [6 * (size[0] - 1), 0, 0])
assert abs(turned[:, :, ::-1] - moved[0]).max() < 0.51
lobes = (x // 8).astype(np.uint8)
assert set(np.unique(grid.warp(lobes, "prone:rest", **frame, labels=True))) <= set(np.unique(lobes))
back = grid.warp(moved[0], "scan", **frame, since="prone:rest")
inner = abs(back.astype(int) - image)[size[2] // 3:-size[2] // 3, size[1] // 3:-size[1] // 3]
assert np.median(inner) < 20, np.median(inner)
assert 20 < np.median(abs(moved[0].astype(int) - image)[size[2] // 3:-size[2] // 3])
refused(supine.FormatError, "no grid", lungs.warp, image, "prone:rest", **frame)
refused(ValueError, "[z, y, x]", grid.warp, image[0], "prone:rest", **frame)
refused(ValueError, "uint8", grid.warp, image.astype(np.int64), "prone:rest", **frame)
refused(supine.ArgumentError, "needs a reference", grid.warp, image, "500", **frame)

# A basis made from arrays has the same bits as the file `path`, which the program made with --band 3.
parts = []
made = supine.precompute(lungs.vertices, lungs.triangles, band=3, progress=parts.append)
for name in ("vertices", "triangles", "coefficients", "modes", "volume_cubic"):
    assert (made.tensor(name) == lungs.tensor(name)).all(), name
assert parts and parts == sorted(parts) and 0 <= parts[0] and parts[-1] == 1
assert "error against the full solve" in made.report and lungs.report == ""
left, right = (slice(part.start, part.stop) for part in lungs.lungs.values())
assert supine.precompute(lungs.vertices, lungs.triangles, band=3)._owner.source == made._owner.source
halves = [lungs.triangles[(lungs.triangles >= part.start).all(1) & (lungs.triangles < part.stop).all(1)] - part.start
          for part in (left, right)]
apart = supine.precompute((lungs.vertices[right], halves[1]), (lungs.vertices[left].tolist(), halves[0]), band=3,
                          held_out=60, resting={"supine": "2600mL"}, output=path + ".made")
assert apart.vertex_count == n and supine.open(path + ".made").metadata["resting_known"]
assert "--held-out 60" in apart.metadata["made_by"]
assert supine.precompute(lungs.vertices, lungs.faces, band=3, modes=2).mode_count == 2  # `faces` has VTK's layout
with warnings.catch_warnings(record=True) as warned:
    warnings.simplefilter("always")
    supine.precompute(1.2 * lungs.vertices, lungs.triangles, band=3)
assert warned and "an adult's" in str(warned[0].message) and warned[0].filename == __file__, warned
refused(supine.MeshError, f"surface 1: face 0 names vertex {n + 3}", supine.precompute, lungs.vertices,
        lungs.triangles[:1].astype(np.int64) * 0 + n + 3)
refused(supine.MeshError, "names vertex", supine.precompute, lungs.vertices, lungs.triangles.astype(np.int64) + 2**32)
refused(supine.ArgumentError, "no option 'colour'", supine.precompute, lungs.vertices, lungs.triangles, colour="red")
refused(supine.ArgumentError, "or leave soften out", supine.precompute, lungs.vertices, lungs.triangles, law="paper",
        soften=1)
refused(supine.ArgumentError, "needs a reference", supine.precompute, lungs.vertices, lungs.triangles,
        scanned="supine:500")
refused(supine.ReadError, "nowhere.ply: cannot read", supine.precompute, "nowhere.ply")
refused(ValueError, "[N, 3]", supine.precompute, lungs.vertices[:, :2], lungs.triangles)
refused(ValueError, "integers", supine.precompute, lungs.vertices, lungs.vertices)
refused(TypeError, "array", supine.precompute, lungs.vertices, lungs.triangles, expandability=np.ones(n))

# Another simulator's fields, of all vertices in any order and of an inner point, come back as given.
turns = np.random.default_rng(4).normal(size=(20, 3))
turns /= np.linalg.norm(turns, axis=1)[:, None]
shuffled = np.random.default_rng(5).permutation(n)
points = np.vstack([lungs.vertices.mean(0), lungs.vertices[shuffled]])
fields = points, turns, np.einsum("mk,pk->mpk", turns, 0.02 * points)
given = supine.precompute(lungs.vertices, lungs.triangles, fields=fields, scanned="supine")
moved = given.deform(given.pose("prone")) - lungs.vertices
assert np.abs(moved - lungs.vertices * (0, -0.04, 0)).max() < 2e-3 and given.mode_count == 3
assert np.abs(given.deform(given.pose("supine")) - lungs.vertices).max() <= given.storage_error + 1e-5
refused(supine.ArgumentError, "no volumes and no breaths", given.pose, "prone:scan+500")
supine.save_fields(path + ".fields", *fields)
from_file = supine.precompute(lungs.vertices, lungs.triangles, fields=path + ".fields", scanned="supine")
assert (from_file.coefficients == given.coefficients).all()
refused(ValueError, "displacement [M, P, 3]", supine.save_fields, path + ".fields", points[1:], *fields[1:])
refused(supine.MeshError, "fields: the vertex at", supine.precompute, lungs.vertices + 1, lungs.triangles,
        fields=fields)


def interrupt(part):
    raise KeyboardInterrupt


try:
    supine.precompute(lungs.vertices, lungs.triangles, progress=interrupt, output=path + ".stopped")
    raise AssertionError("not interrupted")
except KeyboardInterrupt:
    assert not os.path.exists(path + ".stopped")

# Points with or without names, a mesh and a grid can be embedded into a basis. The basis can be made from a file or
# from arrays. A point on the surface moves with the surface.
place = lungs.vertices[7].astype(float)
for basis in (lungs, made):
    inside = supine.embed(basis, {"on, the surface": place, "other": (-80, -120, -90)})
    assert set(inside.points) == {"on, the surface", "other"} and "2 points" in inside.report
    moved = inside.deform(inside.pose("prone:rest"))[inside.points["on, the surface"]]
    assert np.abs(moved - lungs.deform(lungs.pose("prone:rest"))[7]).max() < 0.05
parts = supine.embed(made, {"nodule": place}, (0.2 * lungs.vertices + 0.8 * place, lungs.triangles))
wanted = parts.targets("left", since="supine:rest")
table = path + ".csv"
with open(path + ".parts", "wb") as file:
    file.write(parts._owner.source)
subprocess.run(["supine", "deform", file.name, "--posture", "left", "--from", "supine:rest", "-o", table], check=True,
               stdout=subprocess.DEVNULL)
with open(table) as file:
    rows = [line.split(",") for line in file.read().split("\n")[2:-1]]
assert len(rows) == len(wanted) == 2 and all(t.mm > 0 and not t.anatomy for t in wanted)
for row, t in zip(rows, wanted):
    assert row[:2] == [t.name, t.lung] and np.allclose(np.array(row[2:], float),
                                                       [*t.at, *t.move, t.mm, t.moved_error, t.expected_error,
                                                        t.another_day_error], atol=2e-3), (row, t)
refused(supine.ArgumentError, "no structures", lungs.targets, "left")
assert supine.embed(made, place).vertex_count == 1
parts = supine.embed(made, (0.9 * lungs.vertices, lungs.triangles), np.array([place]))
assert parts.vertex_count == n + 1 and sorted(t.anatomy for t in parts.targets("left")) == [False, True]
assert supine.embed(made, grid=40, clamp=True).vertex_count > 100
refused(supine.ArgumentError, "nothing to embed", supine.embed, made)
refused(ValueError, "points must be", supine.embed, made, [(1, 2)])
program, os.environ["PATH"] = shutil.which("supine"), ""
refused(supine.UnsupportedError, "neither on PATH nor beside", supine.embed, made, place)
if maker == "program":
    refused(supine.UnsupportedError, "neither on PATH nor beside", supine.precompute, lungs.vertices, lungs.triangles)
else:
    assert supine.precompute(lungs.vertices, lungs.triangles, band=2, modes=2).mode_count == 2
os.symlink(program, os.path.join(os.path.dirname(supine.__file__), "supine"))
assert supine.embed(made, place).vertex_count == 1
print("results equal those in C")
