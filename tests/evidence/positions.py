#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how many landmarks lie within the stated error of their printed positions, whatever --from says.

    tests/evidence/positions.py BUILD COPD [CASE]...

BUILD and COPD are as in error.py. The lungs of the inhaled scan are moved to the exhaled volume; their landmarks are
compared with the exhaled ones after the translation that fits best. For each --from and person it prints the stated and
the true error, RMS, and the share within 1.8 times the stated error. The exit code is 1 if less than 85 % of all
landmarks of a --from are within, or if a --from changes an error of a position. Exit code 77: no data."""
import pathlib
import sys
import tempfile

import nibabel
import numpy as np

from error import Patient

FROMS = {"the scan": (), "supine:rest+300": ("--from", "supine:rest+300"), "supine:full": ("--from", "supine:full"),
         "prone:rest": ("--from", "prone:rest")}
LEAST = 0.85


def rms(x):
    return float(np.sqrt(np.square(x).sum(-1).mean()))


def volume(path):
    """Return the volume of a label map, mL."""
    image = nibabel.load(path)
    return float((np.asanyarray(image.dataobj) > 0).sum() * abs(np.linalg.det(image.affine[:3, :3])) / 1000)


build, copd = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else "").resolve()
wanted = set(sys.argv[3:] or [path.stem for path in copd.glob("*.csv")])
cases = sorted({path.name[:-len("_exp.nii.gz")] for path in copd.glob("*_exp.nii.gz")} & wanted)
if not cases:
    print("skipped: no scans")
    sys.exit(77)
within, faults = {start: [] for start in FROMS}, []
for case in cases:
    with tempfile.TemporaryDirectory() as folder:
        patient = Patient(build, folder, copd / f"{case}.csv")
        patient.basis(copd / f"{case}_insp.nii.gz", patient.inhaled)
        held, first = volume(copd / f"{case}_exp.nii.gz"), None
        for start, options in FROMS.items():
            patient.run("deform", "i.safetensors", "--posture", "supine", "--volume", f"{held:.1f}mL", *options,
                        "-o", "o.csv")
            rows = np.genfromtxt(pathlib.Path(folder) / "o.csv", delimiter=",", names=True, skip_header=1, dtype=None,
                                 encoding="utf-8")
            place = np.stack([rows[axis] for axis in "xyz"], axis=1)
            off = place - patient.exhaled
            off -= off.mean(0)
            near = np.linalg.norm(off, axis=1) <= 1.8 * rows["expected_error_mm"]
            within[start].append(near)
            first = rows["expected_error_mm"] if first is None else first
            if np.abs(rows["expected_error_mm"] - first).max() > 1e-3:
                faults.append(f"{case}: --from {start} changes the error of a position")
            stated, moved = (rms(rows[column][:, None]) for column in ("expected_error_mm", "moved_error_mm"))
            print(f"{case} from {start:16s} stated {stated:5.2f} true {rms(off):5.2f} mm, "
                  f"{100 * near.mean():5.1f} % within 1.8; displacements {moved:5.2f} mm")
for start, near in within.items():
    share = np.concatenate(near).mean()
    print(f"pooled from {start:16s} {100 * share:5.1f} % within 1.8 times the stated error")
    if share < LEAST:
        faults.append(f"{start}: {100 * share:.1f} % are within")
print("\n".join(faults) or "an error of a position is that of the position")
sys.exit(1 if faults else 0)
