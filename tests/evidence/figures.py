#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Print tables of tests/FIGURES.md and docs/paper.md in their format.

    tests/evidence/figures.py BUILD [--landmarks FOLDER] [--copd FOLDER] [--pairs FOLDER[:AXES]]...

BUILD is the folder of the build. --landmarks: caseNNN*.csv with points of two states, inhaled then exhaled, for fits of
a patient's own law. --copd: caseNN.csv, exhaled then inhaled, with label maps caseNN_exp.nii.gz and caseNN_insp.nii.gz,
for the applied force (IV-B.3 of the paper). --pairs: NAME_left.* and NAME_right.*, for the errors of the normals.
Volumes of landmarks alone are unknown: 2500 and 5500 mL are given, which change neither the errors nor the force.
"""
import argparse
import glob
import json
import os
import struct
import subprocess
import tempfile

from evidence import pairs


class Program:
    def __init__(self, build, folder):
        self.program, self.folder = os.path.abspath(os.path.join(build, "supine")), folder

    def fit(self, *arguments):
        """Return the report of a fit."""
        return json.loads(subprocess.run([self.program, "fit", *arguments, "--json"], check=True, capture_output=True,
                                         text=True).stdout)

    def fit_landmarks(self, path):
        return self.fit("--landmarks", path, "--translation", "--rest", "2500mL", "--other", "5500mL")

    def metadata(self, *arguments):
        """Return the metadata of a basis with default options."""
        path = os.path.join(self.folder, "b.safetensors")
        subprocess.run([self.program, "precompute", *arguments, "-o", path], check=True, capture_output=True)
        with open(path, "rb") as file:
            return json.loads(file.read(struct.unpack("<Q", file.read(8))[0]))["__metadata__"]


def print_fits(program, folder):
    print("| case | translation | affine | `deep` | `deep` + kriging | expected | within the 95 % band "
          "|\n|---|---|---|---|---|---|---|")
    rows = []
    for path in sorted(glob.glob(os.path.join(folder, "*.csv"))):
        report = program.fit_landmarks(path)
        held = report["held_out_rms_mm"]
        rows.append([held["translation"], held["affine"], held["law"], held["corrected"], report["expected_rms_mm"],
                     report["band_95_percent_holds"]])
        print("| %s | %.1f | %.1f | %.1f | %.2f | %.2f | %.0f %% |" % (os.path.basename(path)[4:7], *rows[-1]))
    print("| mean | %.1f | %.1f | %.1f | %.2f | | |" % tuple(sum(r[k] for r in rows) / len(rows) for k in range(4)))


def print_forces(program, folder):
    print("\n| case | correlation with the height: landmarks | surfaces | gain / base: landmarks | surfaces | left by "
          "(18): landmarks | surfaces |\n"
          "|---|---|---|---|---|---|---|")
    for path in sorted(glob.glob(os.path.join(folder, "case*.csv"))):
        scans = [path[:-4] + end for end in ("_exp.nii.gz", "_insp.nii.gz")]
        forces = [program.fit_landmarks(path), program.fit(*scans, "--other", "supine:full")]
        forces = [report["applied_force"] for report in forces]
        # The force is 1 + c8 (Y - 1/2) + ..., and Y falls from 1 to 0 along gravity in supine lungs.
        gains = [-f["c7_to_c9"][1] / (1 + 0.5 * f["c7_to_c9"][1]) for f in forces]
        values = []
        for row in ([f["correlation_with_height"] for f in forces], gains):
            values += ["%.2f" % v for v in row]
        values += ["%.0f %%" % (100 * f["left_rms"]) for f in forces]
        print("| %s | %s |" % (os.path.basename(path)[4:6], " | ".join(values)))


def print_normals(program, arguments):
    print("\n| pair | normals: mean error, degrees | 99.9th percentile |\n|---|---|---|")
    for argument in arguments:
        for name, left, right, axes in pairs(argument):
            found = program.metadata(left, right, *(["--axes", axes] if axes else []))
            print("| %s | %s | %s |" % (name, found["normals_mean_degrees"], found["normals_p999_degrees"]), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("--landmarks", metavar="FOLDER")
    parser.add_argument("--copd", metavar="FOLDER")
    parser.add_argument("--pairs", metavar="FOLDER[:AXES]", action="append", default=[])
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        program = Program(options.build, folder)
        if options.landmarks:
            print_fits(program, options.landmarks)
        if options.copd:
            print_forces(program, options.copd)
        if options.pairs:
            print_normals(program, options.pairs)


if __name__ == "__main__":
    main()
