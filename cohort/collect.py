# SPDX-License-Identifier: GPL-3.0-or-later
"""Collect the displacements of a plan of simulations into one file for 'supine precompute --fields'.

    python3 collect.py FIELDS.safetensors POINTS.csv PLAN.csv RUNS

POINTS.csv has the positions x,y,z of the points, without a header; PLAN.csv the columns x, y and z of the directions of
gravity, and fill; RUNS/NAME.csv the displacements ux,uy,uz of all points in the run of this name (plan.py)."""
import array
import csv
import json
import os
import sys

from plan import read_plan


def numbers(path):
    """Return the numbers of a CSV file that has three in each row, one after the other."""
    made = array.array("f")
    with open(path, encoding="utf-8", newline="") as file:
        for line, row in enumerate(csv.reader(file), 1):
            if len(row) != 3:
                sys.exit(f"{path}: line {line} has {len(row)} numbers, not 3")
            made.extend(map(float, row))
    return made


def main():
    fields, points, plan, runs = sys.argv[1:]
    states = read_plan(plan)
    gravity = [list(map(float, state[:3])) for state in states.values()]
    positions, displacement = numbers(points), array.array("f")
    for name in states:
        path = os.path.join(runs, f"{name}.csv")
        run = numbers(path)
        if len(run) != len(positions):
            sys.exit(f"{path}: {len(run) // 3} displacements of {len(positions) // 3} points: compute this run again")
        displacement.extend(run)
    arrays = {"points": (positions, [len(positions) // 3, 3]),
              "gravity": (array.array("f", sum(gravity, [])), [len(gravity), 3]),
              "displacement": (displacement, [len(gravity), len(positions) // 3, 3])}
    header, at = {}, 0
    for name, (values, shape) in arrays.items():
        if sys.byteorder == "big":
            values.byteswap()
        header[name] = {"dtype": "F32", "shape": shape, "data_offsets": [at, at + 4 * len(values)]}
        at += 4 * len(values)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    with open(fields + ".part", "wb") as file:
        file.write(len(text).to_bytes(8, "little") + text)
        for values, _ in arrays.values():
            file.write(values.tobytes())
    os.replace(fields + ".part", fields)


if __name__ == "__main__":
    main()
