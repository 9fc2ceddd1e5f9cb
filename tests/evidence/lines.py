# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare what `supine locate` finds of points seen along lines of sight with the truth, on people with COPD.

    lines.py PROGRAM DATA       DATA: folder with caseNN_insp.nii.gz, caseNN_exp.nii.gz and caseNN.csv (DIR-Lab)

Each basis is made of the inhaled scan by the default law and posed at the volume of the exhaled scan. Ten landmarks of
the exhaled scan, drawn three times for each person, are observed with 1 mm of noise on each axis: in space, or across
the lines from a source 700 mm in front of the lungs, in one view or in two that are 30 degrees apart. Their frame is
translated by 5 mm on each axis at random. The others are the truth.

Then count the fits of own and of other people's points of which the check locate-stretched tells. Another person's
points are the own ones, scaled from the box of each own lung to that of the other person's."""
import csv
import glob
import os
import subprocess
import sys
import tempfile

import nibabel
import numpy as np

program, data = sys.argv[1:3]
KINDS = ("in space", "two views", "one view, depth known to 5 mm", "one view", "not observed")
DRAWN, AWAY = 10, 700.0


def run(*arguments):
    """Run the program; return its messages."""
    return subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stderr


def read(path, count):
    with open(path, encoding="utf-8") as file:
        rows = {row["name"]: row for row in csv.DictReader(line for line in file if not line.startswith("#"))}
    rows = [rows[f"p{i}"] for i in range(count)]
    return (np.array([[float(row[axis]) for axis in "xyz"] for row in rows]),
            np.array([float(row["expected_error_mm"]) for row in rows]))


def observe(path, kind, seen, truth, random):
    """Write the file of observations."""
    middle = truth.mean(0)
    angles = {"two views": (-np.pi / 12, np.pi / 12), "in space": ()}.get(kind, (0.0,))
    with open(path, "w", encoding="utf-8") as file:
        file.write("name,x,y,z,from_x,from_y,from_z\n")
        for i in seen:
            if kind == "in space":
                place = truth[i] + random.normal(size=3)
                file.write(f"p{i},{place[0]:.4f},{place[1]:.4f},{place[2]:.4f},,,\n")
            for angle in angles:
                source = middle + AWAY * np.array([np.sin(angle), -np.cos(angle), 0])
                line, noise = truth[i] - source, random.normal(size=3)
                noise -= line * (noise @ line) / (line @ line)
                place = source + 1.5 * (line + noise)  # on a detector
                file.write(f"p{i}," + ",".join(f"{number:.4f}" for number in (*place, *source)) + "\n")


def person(case, folder):
    """Return the sums of true and stated squares, and of squares along the view, of all kinds."""
    marks = np.genfromtxt(f"{case}.csv", delimiter=",", skip_header=1)
    out, inhaled = marks[:, :3], marks[:, 3:]
    scan = nibabel.load(f"{case}_exp.nii.gz")
    volume = (np.asanyarray(scan.dataobj) > 0).sum() * abs(np.linalg.det(scan.affine[:3, :3])) / 1000
    basis, inside, points, seen_file, found = (os.path.join(folder, name) for name in (
        "lungs.safetensors", "inside.safetensors", "points.csv", "seen.csv", "found.csv"))
    state = ("--posture", "supine", "--volume", f"{volume:.1f}mL")
    run("precompute", f"{case}_insp.nii.gz", "--held-out", "20", "-o", basis)
    with open(points, "w", encoding="utf-8") as file:
        file.write("name,x,y,z\n" + "".join(f"p{i},{x:.4f},{y:.4f},{z:.4f}\n" for i, (x, y, z) in enumerate(inhaled)))
    run("embed", basis, points, "-o", inside)
    run("deform", inside, *state, "-o", found)
    law, law_error = read(found, len(out))
    random = np.random.default_rng(int(case[-2:]))
    sums = {kind: np.zeros(4) for kind in KINDS}
    for _ in range(3):
        seen = random.choice(len(out), DRAWN, replace=False)
        rest = np.setdiff1d(np.arange(len(out)), seen)
        truth = out - (out - law).mean(0) + random.normal(0, 5, 3)
        for kind in KINDS:
            at, error = law + (truth - law).mean(0), law_error
            if kind != "not observed":
                observe(seen_file, kind, seen, truth, random)
                run("locate", basis, seen_file, "--points", inside, *state, "--noise", "1",
                    *(("--depth", "5") if "5 mm" in kind else ()), "-o", found)
                at, error = read(found, len(out))
            line = truth - truth.mean(0) + [0, AWAY, 0]
            along = ((at - truth) * line).sum(1) ** 2 / (line ** 2).sum(1)
            true = ((at - truth) ** 2).sum(1)
            sums[kind] += [true[rest].mean() / 3, (error[rest] ** 2).mean() / 3, (true - along)[rest].mean() / 3,
                           along[rest].mean() / 3]
    return sums


def boxes(case):
    """Return the middle between the lungs of the exhaled scan, x, the boxes of the right and the left lung, and the
    volume, mL."""
    scan = nibabel.load(f"{case}_exp.nii.gz")
    mask = np.asanyarray(scan.dataobj) > 0
    at = (np.argwhere(mask) @ scan.affine[:3, :3].T + scan.affine[:3, 3]) * [-1, -1, 1]
    middle = (at[:, 0].min() + at[:, 0].max()) / 2
    sides = [at[(at[:, 0] > middle) == left] for left in (False, True)]
    volume = mask.sum() * abs(np.linalg.det(scan.affine[:3, :3])) / 1000
    return middle, [(side.min(0), side.max(0)) for side in sides], volume


def scaled(points, own, other):
    """Scale points from the box of each lung of a person to that of another."""
    moved = points.copy()
    for left in (False, True):
        side = (points[:, 0] > own[0]) == left
        (low, high), (to_low, to_high) = own[1][left], other[1][left]
        moved[side] = to_low + (points[side] - low) / (high - low) * (to_high - to_low)
    return moved


def told(cases, folder):
    """Print of how many fits the check locate-stretched tells."""
    people = {case: boxes(case) for case in cases}
    counts = {key: [0, 0] for key in [(whose, count) for whose in ("own", "another's") for count in (10, 20, 60)]}
    for case in cases:
        basis, inside, points, seen_file, found = (os.path.join(folder, name) for name in (
            "lungs.safetensors", "inside.safetensors", "points.csv", "seen.csv", "found.csv"))
        marks = np.genfromtxt(f"{case}.csv", delimiter=",", skip_header=1)
        run("precompute", f"{case}_insp.nii.gz", "--edge", "6", "--held-out", "5", "-o", basis)
        with open(points, "w", encoding="utf-8") as file:
            file.write("name,x,y,z\n" + "".join(f"p{i},{x},{y},{z}\n" for i, (x, y, z) in enumerate(marks[:, 3:])))
        run("embed", basis, points, "--clamp", "-o", inside)
        random = np.random.default_rng(30 + int(case[-2:]))
        for (whose, count), sums in counts.items():
            for other in [case] * 10 if whose == "own" else [name for name in cases if name != case] * 2:
                seen = random.choice(len(marks), count, replace=False)
                observe(seen_file, "in space", seen, scaled(marks[:, :3], people[case], people[other]), random)
                for volume in ((), ("--volume", f"{people[other][2]:.1f}mL")):
                    done = subprocess.run([program, "locate", basis, seen_file, "--points", inside, "--posture",
                                           "supine", *volume, "-o", found], capture_output=True, text=True,
                                          check=False)
                    sums[0] += done.returncode != 0 or "of what the points show" in done.stderr
                    sums[1] += 1
    for (whose, count), sums in counts.items():
        print(f"{whose} {count} points: {sums[0]} of {sums[1]} told by locate-stretched, or refused")


def main():
    total = {kind: [] for kind in KINDS}
    for case in sorted(path[:-4] for path in glob.glob(os.path.join(data, "case*.csv"))):
        with tempfile.TemporaryDirectory() as folder:
            for kind, sums in person(case, folder).items():
                total[kind].append(sums)
    print("RMS over people, mm                  true  stated  across the view  along it  stated over true, by person")
    for kind in KINDS:
        each = np.array(total[kind])
        true, stated, across, along = np.sqrt(each.mean(0))
        print(f"{kind:35}  {true:5.1f}  {stated:5.1f}  {across:10.1f}  {along:14.1f}   "
              + " ".join(f"{ratio:6.2f}" for ratio in np.sqrt(each[:, 1] / each[:, 0])))

    with tempfile.TemporaryDirectory() as folder:
        told(sorted(path[:-4] for path in glob.glob(os.path.join(data, "case*.csv"))), folder)


main()
