#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how far full inspirations of one person on different days differ, and compare it with what is stated.

    tests/evidence/sessions.py HEADER SESSIONS

HEADER is runtime/include/supine/locate.h, which has the term SUPINE_ANOTHER_DAY_MM. SESSIONS holds NAME.csv with
matched landmarks of the first and the second scan: x,y,z,to_x,to_y,to_z, mm, LPS. For each person it prints the RMS
distance of the landmarks after the rigid motion that fits best, the same after a motion and one scale, which stands for
another volume, the share of the square that is along z, and stated / true. Exit code 77: no data."""
import csv
import pathlib
import re
import sys

import numpy as np


def rest_of(first, second, scaled):
    """Return the landmarks of `first`, moved as fits best, minus those of `second`."""
    a, b = first - first.mean(0), second - second.mean(0)
    u, s, v = np.linalg.svd(a.T @ b)
    turn = np.diag([1, 1, np.sign(np.linalg.det(u @ v))])
    scale = np.trace(np.diag(s) @ turn) / np.square(a).sum() if scaled else 1.0
    return scale * a @ u @ turn @ v - b


rms = lambda x: float(np.sqrt(np.square(x).sum(-1).mean()))
stated = float(re.search(r"SUPINE_ANOTHER_DAY_MM ([\d.]+)", pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))[1])
people = sorted(pathlib.Path(sys.argv[2]).glob("*.csv")) if len(sys.argv) > 2 else []
if not people:
    print("skipped: no landmarks")
    sys.exit(77)
ratios = []
print("person     rigid  and scale  along z  stated / true")
for person in people:
    rows = np.array(list(csv.reader(person.open(encoding="utf-8")))[1:], float)
    rest, matched = (rest_of(rows[:, :3], rows[:, 3:6], scaled) for scaled in (False, True))
    along = np.square(rest[:, 2]).sum() / np.square(rest).sum()
    ratios.append(stated / rms(matched))
    print(f"{person.stem:10s} {rms(rest):5.2f}  {rms(matched):9.2f}  {along:7.2f}  {ratios[-1]:13.2f}")
mean = float(np.exp(np.mean(np.log(ratios))))
print(f"stated {stated} mm: {min(ratios):.2f} to {max(ratios):.2f} of the truth, geometric mean {mean:.2f}, "
      f"n {len(ratios)}")
sys.exit(0 if 0.8 < mean < 1.25 else 1)
