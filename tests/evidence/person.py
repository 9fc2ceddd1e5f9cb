#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how well scans of one person are told from scans of two people, and landmarks from those of others.

    tests/evidence/person.py BUILD COPD QUIET [LOBES...]

BUILD is the folder of the build. COPD holds label maps caseNN_exp.nii.gz and caseNN_insp.nii.gz of both lungs, and
caseNN.csv with landmarks, exhaled then inhaled, mm, LPS. QUIET holds caseNN.csv with landmarks of quiet breaths, which
stand for lungs: their spread is measured. LOBES are label maps of further people. Prints the lines and
their spread (precompute/patient/checks.c); the deviation of each own pair of scans from the lines of the others; how
many pairs of two people deviate by more than the limit of docs/inputs.md from the lines of the rest; the same of own
pairs that are scaled to a child's size, of single lungs, of pairs without the lower part of one lung, and of scans that
are thicker than they were; the distance of two surfaces of one scan, and of two states; and the share of landmarks more
than 5 mm outside the lungs of the same and of other people.
Exit code 77: no data."""
import glob
import itertools
import json
import os
import re
import struct
import subprocess
import sys
import tempfile

import numpy as np

# y of the left and the right lung: width, depth, height; and the share of the left lung.
LINES = {"width": (0, 3), "depth": (1, 4), "height": (2, 5), "left share": (6,)}
FLOOR, KNEE, LEAST, LIMIT = np.array([0.015] * 6 + [0.010]), 0.25, 0.02, 3.5


def tensors(path):
    """Read the vertices, triangles, lungs, depths and parts of a basis."""
    with open(path, "rb") as file:
        data = file.read()
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:8 + size])
    kinds = {"F32": "<f4", "U32": "<u4", "U8": "u1"}
    found = {}
    for name in ("vertices", "triangles", "depth", "lung", "part"):
        if name in header:
            kind, shape, at = (header[name][key] for key in ("dtype", "shape", "data_offsets"))
            found[name] = np.frombuffer(data, kinds[kind], int(np.prod(shape)), 8 + size + at[0]).reshape(shape)
    return found


def spread(vertices, triangles):
    """Return the volume within a closed surface, and the logarithms of its standard deviations along x, y and z."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    part = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    mean = part @ (a + b + c) / 4 / part.sum()
    square = part @ (a ** 2 + b ** 2 + c ** 2 + (a + b + c) ** 2) / 20 / part.sum()
    return part.sum() / 1000, np.log(np.sqrt(square - mean ** 2))


def measure(basis):
    """Return the volume of both lungs, and what is compared."""
    vertices, triangles = basis["vertices"].astype(float), basis["triangles"]
    sides = [triangles[basis["lung"][triangles[:, 0]] == lung] for lung in (0, 1)]
    (left, first), (right, second) = (spread(vertices - vertices.mean(0), side) for side in sides)
    return left + right, np.r_[first, second, left / (left + right)]


def differ(first, second):
    """Return the logarithm of the volume ratio, emptier over fuller, and how the measures differ."""
    (volume, measures), (smaller, other) = sorted((first, second), key=lambda each: -each[0])
    return np.log(smaller / volume), other - measures


def breath(path):
    """Return the logarithm of the volume ratio of a quiet breath, and how the spreads of its landmarks differ."""
    rows = np.genfromtxt(path, delimiter=",", skip_header=1)[:, :6]
    first, second = rows[:, :3], rows[:, 3:]
    left = first[:, 0] > (first[:, 0].min() + first[:, 0].max()) / 2
    growth, spreads = [], []
    for side in (left, ~left):
        affine = np.linalg.lstsq(np.c_[first[side], np.ones(side.sum())], second[side], rcond=None)[0][:3]
        growth.append(np.log(np.linalg.det(affine)))
        spreads.append(np.log(second[side].std(0) / first[side].std(0)))
    return -np.mean(growth), -np.r_[spreads[0], spreads[1], np.nan]


def fit(own):
    """Return the slopes of the lines of own pairs, and their SD among people: chi square is as expected."""
    slope, sd = np.zeros(7), np.zeros(7)
    for columns in map(list, LINES.values()):
        floor, here = FLOOR[columns[0]], [each for each in own if np.isfinite(each[1][columns]).all()]
        along = np.tile([each[0] for each in here], len(columns))
        across = np.array([each[1][columns] for each in here]).T.ravel()
        near, found = np.minimum(abs(along), KNEE), 0.1
        for _ in range(20):
            weight = 1 / (floor ** 2 + (found * near) ** 2)
            line = (weight * along) @ across / (weight @ along ** 2)
            tried = np.linspace(LEAST, 0.6, 2000)
            chi = ((across - line * along) ** 2 / (floor ** 2 + np.outer(tried, near) ** 2)).sum(1)
            found = tried[min(np.searchsorted(-chi, 1 - len(along)), len(tried) - 1)]
        slope[columns], sd[columns] = line, found
    return slope, sd


def deviation(pair, lines):
    """Return the largest deviation of a pair of scans from lines, SD."""
    (x, y), (slope, sd) = pair, lines
    return np.nanmax(np.abs(y - x * slope) / np.hypot(FLOOR, sd * min(abs(x), KNEE)))


def without_base(basis):
    """Flatten the lower 30 % of the right lung, which stands for a pair after the same lobe was removed."""
    vertices, right = basis["vertices"].astype(float), basis["lung"] == 1
    low, high = vertices[right, 2].min(), vertices[right, 2].max()
    vertices[right, 2] = np.maximum(vertices[right, 2], low + 0.3 * (high - low))
    return {**basis, "vertices": vertices}


def single(basis, lung):
    """Return the measures of a lung alone."""
    vertices, triangles = basis["vertices"].astype(float), basis["triangles"]
    volume, sizes = spread(vertices - vertices.mean(0), triangles[basis["lung"][triangles[:, 0]] == lung])
    return volume, np.r_[sizes, sizes, 1.0]


def compare(bases, people, quiet, further):
    """Print how pairs of scans deviate from the lines of people who are not in them."""
    scans = {key: measure(basis) for key, basis in bases.items()}
    own = {**{p: differ(scans[p, "insp"], scans[p, "exp"]) for p in people}, **{path: breath(path) for path in quiet}}
    lines = fit(list(own.values()))
    without = lambda *names: fit([pair for p, pair in own.items() if p not in names])
    print("lines:", *(f"{name} {lines[0][c[0]]:.3f} ({lines[1][c[0]]:.3f})" for name, c in LINES.items()))
    show = lambda title, change: print(title, *(f"{deviation(change(p), without(p)):.1f}" for p in people))
    show("own pairs, SD:", own.get)
    print("quiet breaths:", *(f"{deviation(own[p], without(p)):.1f}" for p in quiet))
    changed = lambda p, first, second=None: differ(first(bases[p, "insp"]), (second or first)(bases[p, "exp"]))
    scaled = lambda by: lambda basis: measure({**basis, "vertices": basis["vertices"] * np.float32(by)})
    show("own pairs without the base of a lung:", lambda p: changed(p, lambda basis: measure(without_base(basis))))
    for lung in (0, 1):
        show("single lungs:", lambda p, lung=lung: changed(p, lambda basis: single(basis, lung)))
    show("own pairs scaled to 0.6:", lambda p: changed(p, scaled(0.6)))
    show("the exhaled scan 10 % thicker in z:", lambda p: changed(p, measure, scaled([1, 1, 1.1])))
    show("scans 3 % apart:", lambda p: differ(scans[p, "insp"], scaled(0.97 ** (1 / 3))(bases[p, "insp"])))
    show("the same scan 10 % thicker in z:", lambda p: differ(scans[p, "insp"], scaled([1, 1, 1.1])(bases[p, "insp"])))
    pairs = [(a, b) for a, b in itertools.combinations(scans, 2) if a[0] != b[0]]
    wrong = [deviation(differ(scans[a], scans[b]), without(a[0], b[0])) for a, b in pairs]
    above = sum(each > LIMIT for each in wrong)
    print(f"two people ({len(people)} and {len(further)}): {above} of {len(wrong)} above {LIMIT} SD")


def apart(run, folder, scans):
    """Print the RMS distance, mm, of surfaces of 3 and 6 mm edge of a scan, and of one and its state 3 % of full
    inflation below."""
    def distance(scan, other, state):
        found = run("fit", scan, other, "--rest", state, "--other", "supine:full", "-o", "fit.json")
        return float(re.search(r"distance before the fit, RMS, mm +(\S+)", found)[1])
    found = []
    for path, words in scans:
        for name, edge in (("fine", 3), ("coarse", 6)):
            run("precompute", os.path.abspath(path), *words, "--edge", edge, "--band", 3, "--held-out", 5,
                "--surfaces-out", f"{name}.ply", "-o", "basis.safetensors")
        basis = tensors(folder + "/basis.safetensors")
        state = f"supine:full-{0.03 * measure(basis)[0]:.0f}"
        run("deform", "basis.safetensors", "--posture", state, "-o", "state.ply")
        found.append([distance(f"{first}.ply", f"{second}.ply", state) for first, second in
                      (("fine", "coarse"), ("coarse", "fine"), ("state", "coarse"))])
    titles = ("one scan, fine and coarse", "one scan, coarse and fine", "states 3 % apart")
    for title, values in zip(titles, zip(*found)):
        print(f"{title}: {min(values):.2f} to {max(values):.2f} mm apart, {len(values)} people")


def main(build, copd, quiet, *lobes):
    supine = os.path.abspath(os.path.join(build, "supine"))
    people = sorted(os.path.basename(path)[:-4] for path in glob.glob(copd + "/case*.csv"))
    if not people or not os.path.exists(supine):
        sys.exit(77)
    with tempfile.TemporaryDirectory() as folder:
        def run(*words):
            return subprocess.run([supine, *map(str, words)], check=True, capture_output=True, text=True,
                                  cwd=folder).stdout

        def outside(points, basis):
            np.savetxt(folder + "/points.csv", points, "%.3f", ",", header="x,y,z", comments="")
            run("embed", basis, "points.csv", "--clamp", "-o", "inside.safetensors")
            return (tensors(folder + "/inside.safetensors")["depth"] < -5).mean()

        def basis(path, name, *words):
            # the scan is the reference of the law `paper`, so that the basis has its surface
            fast = ("--edge", "6", "--law", "paper", "--band", "3", "--held-out", "5")
            run("precompute", os.path.abspath(path), *fast, *words, "-o", name)
            return tensors(f"{folder}/{name}")

        bases = {(p, s): basis(f"{copd}/{p}_{s}.nii.gz", f"{p}_{s}.safetensors")
                 for p, s in itertools.product(people, ("exp", "insp"))}
        bases.update({(path, ""): basis(path, "further.safetensors", "--labels", "lobes") for path in lobes})
        compare(bases, people, sorted(glob.glob(os.path.abspath(quiet) + "/case*.csv")), lobes)
        apart(run, folder, [(f"{copd}/{p}_insp.nii.gz", ()) for p in people] +
              [(path, ("--labels", "lobes")) for path in lobes])
        for state, columns in (("exp", slice(0, 3)), ("insp", slice(3, 6))):
            marks = {p: np.genfromtxt(f"{copd}/{p}.csv", delimiter=",", skip_header=1)[:, columns] for p in people}
            share = np.array([[outside(marks[p], f"{q}_{state}.safetensors") for p in people] for q in people])
            same = np.eye(len(people), dtype=bool)
            others = share[~same]
            print(f"{state}: share of landmarks outside: own at most {share[same].max():.3f}, of others "
                  f"{others.min():.3f} to {others.max():.3f}, above 0.005 in {(others > 0.005).sum()} of {len(others)}")


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
