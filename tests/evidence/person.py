#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how well scans of one person are told from scans of two people, and landmarks from those of others.

    tests/evidence/person.py BUILD COPD

BUILD is the folder of the build. COPD holds label maps caseNN_exp.nii.gz and caseNN_insp.nii.gz of both lungs, and
caseNN.csv with landmarks, exhaled then inhaled, mm, LPS. Prints the lines and their spread (precompute/patient/checks.c),
the deviation of each own pair of scans from the lines of the others, how many pairs of two people deviate by more than
the limit of docs/inputs.md, and the share of landmarks more than 5 mm outside the lungs of the same and of other people.
Exit code 77: no data."""
import glob
import itertools
import json
import os
import struct
import subprocess
import sys
import tempfile

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

FLOOR, SPREAD, LIMIT = np.array([0.015, 0.015, 0.015, 0.011]), 0.05, 3.5
NAMES = ("width", "depth", "height", "left")


def tensors(path):
    """Read the vertices, triangles and depths of a basis."""
    with open(path, "rb") as file:
        data = file.read()
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:8 + size])
    kinds = {"F32": "<f4", "U32": "<u4"}
    return {name: np.frombuffer(data, kinds[each["dtype"]], int(np.prod(each["shape"])), 8 + size + each["data_offsets"][0])
            .reshape(each["shape"]) for name, each in header.items() if name in ("vertices", "triangles", "depth")}


def measure(vertices, triangles):
    """Return the sizes of the box, the volume and the share of the left lung."""
    a, b, c = (vertices[triangles[:, k]].astype(float) for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6000
    count = len(vertices)
    edges = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    label = connected_components(coo_matrix((np.ones(len(edges)), edges.T), (count, count)), directed=False)[1]
    middle = (vertices[:, 0].min() + vertices[:, 0].max()) / 2
    left = [vertices[label == piece, 0].mean() > middle for piece in range(label.max() + 1)]
    return (vertices.max(0) - vertices.min(0)).astype(float), volume.sum(), volume[np.array(left)[label[triangles[:, 0]]]].sum() / volume.sum()


def differ(first, second):
    """Return the logarithm of the volume ratio, emptier over fuller, and how the measures differ."""
    (size, volume, left), (other, smaller, share) = sorted((first, second), key=lambda each: -each[1])
    return np.log(smaller / volume), np.append(np.log(other / size), share - left)


def fit(x, y):
    """Return the slopes of the lines, and their spread among people."""
    weight = 1 / (FLOOR[0] ** 2 + (SPREAD * x) ** 2)
    slope = (weight * x) @ y / (weight @ x ** 2)
    rest = ((y - np.outer(x, slope)) ** 2).sum(0) * len(x) / (len(x) - 1) - len(x) * FLOOR ** 2
    return slope, np.sqrt(np.maximum(rest / (x @ x), 0.01 ** 2))


def deviation(x, y, slope, spread):
    return np.abs(y - np.multiply.outer(x, slope)) / np.sqrt(FLOOR ** 2 + np.multiply.outer(x, spread) ** 2)


def main(build, copd):
    supine = os.path.abspath(os.path.join(build, "supine"))
    people = sorted(os.path.basename(path)[:-4] for path in glob.glob(copd + "/case*.csv"))
    if not people or not os.path.exists(supine):
        sys.exit(77)
    with tempfile.TemporaryDirectory() as folder:
        def run(*words):
            subprocess.run([supine, *words], check=True, capture_output=True, cwd=folder)

        def outside(points, basis):
            np.savetxt(folder + "/points.csv", points, "%.3f", ",", header="x,y,z", comments="")
            run("embed", basis, "points.csv", "--clamp", "-o", "inside.safetensors")
            return (tensors(folder + "/inside.safetensors")["depth"] < -5).mean()

        scans = {}
        for person, state in itertools.product(people, ("exp", "insp")):
            # the scan is the reference of the law `paper`, so that the basis has its surface
            run("precompute", f"{os.path.abspath(copd)}/{person}_{state}.nii.gz", "--edge", "6", "--law", "paper", "--band", "3",
                "--held-out", "5", "-o", f"{person}_{state}.safetensors")
            basis = tensors(f"{folder}/{person}_{state}.safetensors")
            scans[person, state] = measure(basis["vertices"], basis["triangles"])
        x, y = (np.array(part) for part in zip(*(differ(scans[p, "insp"], scans[p, "exp"]) for p in people)))
        slope, spread = fit(x, y)
        print("lines:", *(f"{name} {s:.3f} ({q:.3f})" for name, s, q in zip(NAMES, slope, spread)))
        others = [np.arange(len(x)) != i for i in range(len(x))]
        own = [deviation(x[i], y[i], *fit(x[keep], y[keep])).max() for i, keep in enumerate(others)]
        print("own pairs, of the lines of the others, SD:", *(f"{each:.1f}" for each in own))
        pairs = [((a, "insp"), (b, "exp")) for a, b in itertools.permutations(people, 2)]
        pairs += [((a, state), (b, state)) for state in ("exp", "insp") for a, b in itertools.combinations(people, 2)]
        wrong = [deviation(*differ(scans[a], scans[b]), slope, spread).max() for a, b in pairs]
        print(f"two people: {sum(each > LIMIT for each in wrong)} of {len(wrong)} above {LIMIT} SD")
        for state, columns in (("exp", slice(0, 3)), ("insp", slice(3, 6))):
            marks = {p: np.genfromtxt(f"{copd}/{p}.csv", delimiter=",", skip_header=1)[:, columns] for p in people}
            share = np.array([[outside(marks[p], f"{q}_{state}.safetensors") for p in people] for q in people])
            same = np.eye(len(people), dtype=bool)
            print(f"{state}: share of landmarks outside: own at most {share[same].max():.3f}, others "
                  f"{share[~same].min():.3f} to {share[~same].max():.3f}, above 0.005 in {(share[~same] > 0.005).sum()} "
                  f"of {(~same).sum()}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
