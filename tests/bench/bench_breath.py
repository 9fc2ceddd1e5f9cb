# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the file size of a breath of 334 frames in each format. Print it relative to the size of
uncompressed frames, each with points, displacements, magnitudes of displacements, and triangles.

    bench_breath.py SUPINE [VERTICES]"""
import os
import subprocess
import sys
import tempfile

supine = os.path.abspath(sys.argv[1])
vertices = sys.argv[2] if len(sys.argv) > 2 else "40000"
with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)

    def run(*arguments):
        return subprocess.run([supine, *arguments], check=True, capture_output=True, text=True).stdout

    made = run("phantom", "-o", "lungs.ply", "--vertices", vertices)
    n, m = (int(made.split(f" {what},")[0].split()[-1]) for what in ("vertices", "triangles"))
    run("precompute", "lungs.ply", "-o", "lungs.safetensors", "--band", "3")
    plain = 334 * (28 * n + 16 * m)
    print(f"{n} vertices, {m} triangles: {plain / 1e6:.1f} MB if not compressed")
    for name in ("breath.vtp", "breath.safetensors"):
        run("breathe", "lungs.safetensors", "--posture", "supine", "-o", name)
        size = os.path.getsize(name)
        print(f"{name}: {size / 1e6:.1f} MB, {size / plain:.3f} of that, {size / 334 / n:.1f} bytes per vertex and frame")
