#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the memory, disk use and time of supine.augment over many states.

    PYTHONPATH=path/to/python bench_augment.py BASIS STATES [EVERY]

The package must find the program and the library. The CT has 65 million voxels of noise and covers the lungs of the
basis; labels have the same size. Every EVERY states (default 50), print the number of states, the resident memory of
this process and of the program (VmRSS), the bytes that both wrote to a disk (write_bytes of /proc/PID/io), and the
processor time of both. The CT is an array of this process and a file in memory that the program maps; each counts
it."""
import os
import sys
import time

import numpy as np
import supine

basis, states = sys.argv[1], int(sys.argv[2])
every = int(sys.argv[3]) if len(sys.argv) > 3 else 50


def numbers(pid, file, key):
    with open(f"/proc/{pid}/{file}", encoding="ascii") as lines:
        return next(int(line.split()[1]) for line in lines if line.startswith(key + ":"))


def seconds(pid):
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        return sum(map(int, file.read().rsplit(")", 1)[1].split()[11:13])) / os.sysconf("SC_CLK_TCK")


lungs = supine.open(basis)
size = np.array([248, 512, 512])
low, high = lungs.vertices.min(axis=0) - 15, lungs.vertices.max(axis=0) + 15
number = np.random.default_rng(1)
ct = number.integers(-900, 100, size, np.int16)
labels = number.integers(0, 30, size, np.uint8)
place = {"step": (high - low) / (size[::-1] - 1), "origin": low}
start = time.time()
print("states,python_MB,program_MB,written_bytes,processor_s,elapsed_s", flush=True)
for i, sample in enumerate(supine.augment(lungs, ct, labels=labels, states=states, seed=1, **place), 1):
    if i == 1 or i % every == 0:
        with open(f"/proc/self/task/{os.getpid()}/children", encoding="ascii") as file:
            pids = ["self", *file.read().split()]
        memory = [numbers(pid, "status", "VmRSS") / 1024 for pid in pids]
        written = sum(numbers(pid, "io", "write_bytes") for pid in pids)
        print(f"{i},{memory[0]:.0f},{memory[-1]:.0f},{written},{sum(map(seconds, pids)):.1f},{time.time() - start:.0f}",
              flush=True)
