#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Print how much of the motion in real breaths the default law explains, with and without its shear.

    tests/evidence/breaths.py BUILD [--copd FOLDER] [--landmarks FOLDER] [--quiet FOLDER] [--terms]

BUILD is the folder of the build. Each folder holds pairs of corresponding points in CSV files of six columns, mm,
LPS. --copd: caseNN.csv from the exhaled to the inhaled state, caseNN_exp.nii.gz and caseNN_insp.nii.gz with label maps
of the lungs. A basis of the inhaled lungs predicts the exhaled points; the volume of the exhaled lungs is known.
--landmarks: points from the inhaled to the exhaled state, without lungs. The law is evaluated in the box of the points,
10 mm larger on each side, with one factor per patient. --quiet: the same from rest to the end of a quiet inspiration.
A translation is free. 'explained' is the part of the squared displacement that the law predicts. 'own beta' is the
shear of least squares. 'others' predicts each patient with the mean of the other patients' own betas. --terms: leave
one patient out of the full breaths in turn, fit further terms of the law to the others, and print what is left; of
quiet breaths, with the terms that fit all full breaths."""
import argparse
import csv
import glob
import json
import os
import struct
import subprocess
import tempfile

import numpy as np

SLOPE_AT_REST = np.array([1, 0.1, 1.9])  # d A_j / d sigma of the bend: 1 + 2 c_j (supine/volume.h)


def read(path):
    """Return the two states of the points in a CSV file, [n, 3] each."""
    rows = np.array(list(csv.reader(open(path)))[1:], float)
    return rows[:, :3], rows[:, 3:]


def centred(x):
    return x - x.mean(0)


def rms(u):
    return np.sqrt((u ** 2).sum(1).mean())


class Program:
    """Predict displacements with bases that the program makes in a temporary folder."""

    def __init__(self, build, folder):
        self.program, self.folder = os.path.join(build, "supine"), folder

    def run(self, *arguments):
        return subprocess.run([self.program, *map(str, arguments)], check=True, capture_output=True, text=True).stdout

    def law(self, shear, *lungs):
        """Make a basis of the lungs in the files, or of synthetic lungs, and return its metadata."""
        path = os.path.join(self.folder, "lungs.safetensors")
        if not lungs:
            lungs = (os.path.join(self.folder, "lungs.ply"),)
            self.run("phantom", "-o", lungs[0], "--vertices", 2000)
        self.run("precompute", *lungs, *(() if shear is None else ("--shear", shear)), "--held-out", 10, "-o", path)
        with open(path, "rb") as file:
            return json.loads(file.read(struct.unpack("<Q", file.read(8))[0]))["__metadata__"]

    def predict(self, shear, case, points):
        """Predict the displacements of points in the inhaled lungs to the volume of the exhaled lungs."""
        at, inside, moved = (os.path.join(self.folder, name) for name in ("at.csv", "inside.safetensors", "moved.csv"))
        rest = float(self.law(0, case + "_exp.nii.gz", "--edge", 5)["full_volume_ml"])
        self.law(shear, case + "_insp.nii.gz", "--edge", 5, "--resting", "supine=%.1fmL" % rest)
        np.savetxt(at, np.c_[np.arange(len(points)), points], "%.5g", ",", header="name,x,y,z", comments="")
        self.run("embed", os.path.join(self.folder, "lungs.safetensors"), at, "-o", inside)
        self.run("deform", inside, "--posture", "supine", "--volume", "rest", "-o", moved)
        rows = csv.DictReader(line for line in open(moved) if not line.startswith("#"))
        return np.array([[float(row[k]) for k in "xyz"] for row in rows]) - points


def numbers(metadata, key):
    return [float(word.split("=")[1]) for word in metadata[key].split()]


def box_of(points):
    """Return the side (+1 left) and the coordinates X, Y and Z of (18) in the box of points, 10 mm larger."""
    low, high = points.min(0) - 10, points.max(0) + 10
    middle = (low[0] + high[0]) / 2
    y, z = ((high[k] - points[:, k]) / (high[k] - low[k]) for k in (1, 2))
    return np.where(points[:, 0] > middle, 1, -1), np.abs(points[:, 0] - middle) * 2 / (high[0] - low[0]), y, z


def law_at(points, metadata):
    """Return the supine displacement of points as lungs empty, mm, and that of a shear of 1, by the closed formulas."""
    base, gain, *box_force, _ = numbers(metadata, "force")
    c = numbers(metadata, "direction_constants")
    side, x, y, z = box_of(points)
    force = base + gain * (1 - y) + np.c_[x, y, z] @ box_force
    u = force[:, None] * np.c_[-side * c[0] * x ** c[1], c[2] * y ** c[3], c[4] * z ** c[5]]
    shear = np.zeros_like(u)
    shear[:, 1] = (z - 0.5) * rms(u)
    return u, shear


class Patient:
    """Displacement of a patient's points, and that of the law as a function of the shear."""

    def __init__(self, name, points, moved, plain, shear, free):
        self.box = box_of(points)
        self.name, self.moved, self.free = name, centred(moved), free
        self.size = rms(plain)  # with the common translation, as in the shear of the law
        self.plain, self.shear = centred(plain), centred(shear)
        basis = np.stack([self.plain.ravel(), self.shear.ravel()], 1)
        if free:
            scale, sheared = np.linalg.lstsq(basis, self.moved.ravel(), rcond=None)[0]
            self.beta = sheared / scale
        else:
            self.beta = basis[:, 1] @ (self.moved.ravel() - basis[:, 0]) / (basis[:, 1] @ basis[:, 1])

    def error(self, beta):
        """Return the explained part of the motion and the RMS error, mm."""
        law = self.plain + beta * self.shear
        scale = (law * self.moved).sum() / (law ** 2).sum() if self.free else 1
        left = ((self.moved - scale * law) ** 2).sum()
        return 1 - left / (self.moved ** 2).sum(), np.sqrt(left / len(law))


TERMS = {  # displacement as lungs fill, as a multiple of the RMS displacement by the law
    "each lung along x": ["s"],
    "shear along the fissure": ["fissure"],
    "both": ["s", "fissure"],
    "shear linear in Z and in Y": ["Z", "Y"],
    "both, and linear in Z and in Y": ["s", "fissure", "Z", "Y"],
}


def term(patient, name):
    """Return a term of TERMS at the points of a patient as lungs empty, for a coefficient of 1, mm.

    A positive coefficient of s moves each lung away from the midline as it fills."""
    side, _, y, z = patient.box
    axis, value = {"s": (0, side), "fissure": (1, np.tanh((z - 0.45 - 0.5 * (y - 0.3)) / 0.1) / 2),
                   "Z": (1, z - 0.5), "Y": (1, y - 0.5)}[name]
    u = np.zeros_like(patient.plain)
    u[:, axis] = -value * patient.size
    return centred(u)


def fit_terms(people, names, beta):
    """Fit one coefficient for each term to all people, weighted by 1 / squared motion."""
    matrix, right = np.zeros((len(names), len(names))), np.zeros(len(names))
    for p in people:
        law = p.plain + beta * p.shear
        columns = np.stack([term(p, name).ravel() for name in names], 1)
        scale = 1
        if p.free:  # of the law and the terms together
            scale = np.linalg.lstsq(np.column_stack([law.ravel(), columns]), p.moved.ravel(), rcond=None)[0][0]
        weight = 1 / (p.moved ** 2).sum()
        matrix += weight * scale ** 2 * columns.T @ columns
        right += weight * scale * columns.T @ (p.moved - scale * law).ravel()
    return np.linalg.solve(matrix, right)


def left_by(p, names, c, beta):
    """Return the RMS residual of a patient, mm, by the law with terms of coefficients c."""
    law = p.plain + beta * p.shear + sum((k * term(p, name) for k, name in zip(c, names)), 0 * p.plain)
    scale = (law * p.moved).sum() / (law ** 2).sum() if p.free else 1
    return rms(p.moved - scale * law)


def mean_by_kind(left, people):
    """Return the mean RMS residual, mm, of each kind of patient as text."""
    kinds = sorted({p.name[:4] for p in people})
    return "  ".join("%s %5.2f" % (k, np.mean([r for r, p in zip(left, people) if p.name[:4] == k])) for k in kinds)


def print_terms(people, quiet, beta):
    """Print what each set of further terms leaves of the motion of a patient who was left out of its fit."""
    now, now_quiet = ([left_by(p, [], [], beta) for p in them] for them in (people, quiet))
    print("\nleave one of %d out, RMS mm\n%-32s %s  %s" % (
        len(people), "the law", mean_by_kind(now, people), mean_by_kind(now_quiet, quiet)))
    for title, names in TERMS.items():
        left = [left_by(p, names, fit_terms([q for q in people if q is not p], names, beta), beta) for p in people]
        fitted = fit_terms(people, names, beta)
        quiet_left = [left_by(p, names, fitted, beta) for p in quiet]
        print("%-32s %s  %s  %+.1f %%, better in %d; all: %s" % (
            title, mean_by_kind(left, people), mean_by_kind(quiet_left, quiet),
            100 * (np.mean(left) / np.mean(now) - 1), sum(a < b for a, b in zip(left, now)),
            ", ".join("%s %.2f" % t for t in zip(names, fitted))))


def print_outward(people, beta):
    """Print how far the lungs move outwards as they fill, half of the difference of x between the left and right
    lung."""
    print("\noutward motion as lungs fill, mm: seen, by the law; in the medial half seen, by the law")
    for p in people:
        law = p.plain + beta * p.shear
        law *= (law * p.moved).sum() / (law ** 2).sum() if p.free else 1
        row = []
        for which in (p.box[1] <= 1, p.box[1] < 0.5):
            left, right = (which & (p.box[0] == side) for side in (1, -1))
            row += [(u[right, 0].mean() - u[left, 0].mean()) / 2 for u in (p.moved, law)]
        print("%-9s %6.2f %6.2f %6.2f %6.2f" % (p.name, *row))


def patients(options, folder):
    """Yield the patients of all folders, and whether they count for beta."""
    program = Program(options.build, folder)
    metadata = program.law(None)
    usual = numbers(metadata, "direction_constants")[6]
    for path in sorted(glob.glob(os.path.join(options.landmarks or "-", "*.csv"))):
        points, to = read(path)
        yield usual, True, Patient(os.path.basename(path)[:7], points, to - points, *law_at(points, metadata), True)
    for path in sorted(glob.glob(os.path.join(options.copd or "-", "case*.csv"))):
        to, points = read(path)
        plain, sheared = (program.predict(shear, path[:-4], points) for shear in (0, 0.5))
        yield usual, True, Patient("copd " + os.path.basename(path)[4:6], points, to - points, plain,
                                   2 * (sheared - plain), False)
    for path in sorted(glob.glob(os.path.join(options.quiet or "-", "*.csv"))):
        points, to = read(path)
        plain, shear = (SLOPE_AT_REST * u for u in law_at(points, metadata))
        yield usual, False, Patient("quiet " + os.path.basename(path)[4:6], points, to - points, plain, shear, True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    for name in ("--copd", "--landmarks", "--quiet"):
        parser.add_argument(name, metavar="FOLDER")
    parser.add_argument("--terms", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = list(patients(options, folder))
    if not found:
        print("skipped: no patients")
        return
    usual, full = found[0][0], [patient for _, counts, patient in found if counts]
    betas = [patient.beta for patient in full]
    kinds = {}
    print("%-9s %6s | %-14s | %-14s | %-14s | own beta" % ("", "motion", "without shear", "shear %g" % usual, "others"))
    for _, counts, patient in found:
        rest = np.mean([b for b, p in zip(betas, full) if p is not patient]) if counts else usual
        row = [rms(patient.moved)] + [v for b in (0, usual, rest) for v in patient.error(b)]
        kinds.setdefault(patient.name[:4], []).append(row)
        print("%-9s %6.1f" % (patient.name, row[0]) +
              "".join(" | %4.0f %% %5.2f mm" % (100 * a, b) for a, b in zip(row[1::2], row[2::2])) +
              (" | %.2f" % patient.beta if counts else " |"))
    for kind, rows in kinds.items():
        row = np.mean(rows, 0)
        print("%-9s %6.1f" % (kind + " mean", row[0]) +
              "".join(" | %4.0f %% %5.2f mm" % (100 * a, b) for a, b in zip(row[1::2], row[2::2])) + " |")
    print("own beta: mean %.2f, SD %.2f, standard error of the mean %.2f, n %d" % (
        np.mean(betas), np.std(betas, ddof=1), np.std(betas, ddof=1) / len(betas) ** 0.5, len(betas)))
    if options.terms:
        print_terms(full, [patient for _, counts, patient in found if not counts], usual)
        print_outward(full, usual)


if __name__ == "__main__":
    main()
