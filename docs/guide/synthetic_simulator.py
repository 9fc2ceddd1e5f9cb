# SPDX-License-Identifier: GPL-3.0-or-later
"""Stand in for a simulator: move the left synthetic lung for each row of a plan, by a formula.

    python3 synthetic_simulator.py PLAN.csv NAME

The lung hangs on the chest wall, sags along gravity, more in the middle than at its border, is compressed where it lies
low, and widens as it fills. Files that are written: lung.ply, the surface; points.csv, its vertices; and for each row
of the plan NAME0.dat, NAME1.dat, ..., the displacements in the format of CalculiX. Files that exist are kept, so that
results of a real simulator can take their place."""
import os
import subprocess
import sys

import numpy as np


def left_lung():
    """Return the vertices and triangles of the left lung of `supine phantom`."""
    subprocess.run(["supine", "phantom", "--vertices", "2400", "-o", "both.obj"], check=True, stdout=subprocess.DEVNULL)
    with open("both.obj", encoding="utf-8") as file:
        rows = [line.split() for line in file]
    os.remove("both.obj")
    points = np.array([row[1:4] for row in rows if row[:1] == ["v"]], float)
    faces = np.array([[corner.split("/")[0] for corner in row[1:]] for row in rows if row[:1] == ["f"]], int) - 1
    used, faces = np.unique(faces[:len(faces) // 2], return_inverse=True)  # the left lung is first
    return points[used], faces.reshape(-1, 3)


def write_ply(path, points, faces):
    with open(path, "w", encoding="ascii") as file:
        print(f"ply\nformat ascii 1.0\nelement vertex {len(points)}", *(f"property double {axis}" for axis in "xyz"),
              f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header", sep="\n", file=file)
        np.savetxt(file, points, "%.9g")
        np.savetxt(file, np.column_stack([np.full(len(faces), 3), faces]), "%d")


def displacement(points, gravity, fill):
    """Return the displacement of each point, mm; `fill` is 0 to 1."""
    place = (points - points.mean(0)) / 100
    low = place @ gravity  # how far a point lies along gravity
    sag = (8 - 3 * (place ** 2).sum(1))[:, None] * gravity - 2.5 * np.tanh(low)[:, None] * place
    return 12 * fill * place + (1 - 0.5 * fill) * sag


def main():
    plan, name = sys.argv[1:]
    rows = np.genfromtxt(plan, delimiter=",", names=True)
    if not os.path.exists("lung.ply") or not os.path.exists("points.csv"):
        points, faces = left_lung()
        write_ply("lung.ply", points, faces)
        np.savetxt("points.csv", points, "%.9g", delimiter=",")
    points = np.loadtxt("points.csv", delimiter=",")
    for i, row in enumerate(rows):
        path = f"{name}{i}.dat"
        if not os.path.exists(path):
            fill = row["fill"] if "fill" in rows.dtype.names else 0.0
            moved = displacement(points, np.array([row[axis] for axis in "xyz"]), fill)
            np.savetxt(path, np.column_stack([np.arange(1, len(points) + 1), moved]), "%d %.9g %.9g %.9g",
                       header="\n displacements (vx,vy,vz) for set PLEURA\n", comments="")


if __name__ == "__main__":
    main()
