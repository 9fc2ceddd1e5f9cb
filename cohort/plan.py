# SPDX-License-Identifier: GPL-3.0-or-later
"""Read a plan of simulations, and name each run by its state, so that rows may be added, taken out and moved.

    python3 plan.py PLAN.csv

prints a line for each row: the name of its run, x, y and z of gravity, and the filling."""
import csv
import hashlib
import sys


def read_plan(path):
    """Return a dictionary from the name of each run to its state [x, y, z, fill], as texts; fill is 0 without such a
    column."""
    runs = {}
    with open(path, encoding="utf-8", newline="") as file:
        for line, row in enumerate(csv.DictReader(file), 2):
            state = [row.get(key) or "0" for key in ("x", "y", "z", "fill")]
            name = hashlib.sha256(",".join(repr(float(number)) for number in state).encode()).hexdigest()[:16]
            if name in runs:
                sys.exit(f"{path}: line {line} repeats a state: leave it out")
            runs[name] = state
    return runs


if __name__ == "__main__":
    for run, numbers in read_plan(sys.argv[1]).items():
        print(run, *numbers)
