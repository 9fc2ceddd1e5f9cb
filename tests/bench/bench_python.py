# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how much longer supine_deform takes if called from Python instead of C, in the fastest of TURNS
alternating runs of each.

    bench_python.py REFERENCE BASIS [TURNS]     REFERENCE: the program of tests/python/reference.c

Needs the Python package."""
import subprocess
import sys
import timeit

import numpy as np

import supine

reference, path = sys.argv[1:3]
lungs = supine.open(path)
pose = lungs.pose("prone")
points = np.empty((lungs.vertex_count, 3), np.float32)
CALLS = 20000  # as in tests/python/reference.c
calls = {"deform into an array": lambda: lungs.deform(pose, points),
         "deform into a new array": lambda: lungs.deform(pose)}
fastest = dict.fromkeys(calls, float("inf"))
in_c = float("inf")
for _ in range(int(sys.argv[3]) if len(sys.argv) > 3 else 9):
    in_c = min(in_c, float(subprocess.run([reference, path, "prone"], capture_output=True,
                                          check=True, text=True).stdout))
    for name, call in calls.items():
        fastest[name] = min(fastest[name], timeit.timeit(call, number=CALLS) / CALLS)
print(f"{lungs.vertex_count} vertices, {lungs.mode_count} modes: supine_deform {1e6 * in_c:.2f} us in C")
for name, taken in fastest.items():
    print(f"{name}: {1e6 * taken:.2f} us in Python, {1e6 * (taken - in_c):.2f} us more")
