#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare what 'deform --image' costs with and without --density, in turn in one run.

    bench_density.py SUPINE [--rounds R] [--program OTHER]

The CT has 512 x 512 x 282 voxels of 16 bits around the lungs of examples/lungs: aerated lung with noise, 200 straight
vessels, a tumour in each lung, and a body in air. Print the name of the processor, the least wall and processor seconds
of R rounds (default 5), and their ratios. --program measures another version in the same rounds."""
import argparse
import glob
import os
import subprocess
import sys
import tempfile

import nibabel
import numpy as np

from bench_versions import run

SIZE = (512, 512, 282)
SOURCE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../..")


def draw_line(ct, lung, begin, end, radius, step):
    """Make the voxels of the lungs near a line soft. Places are in mm from the first voxel."""
    low = np.maximum(np.floor((np.minimum(begin, end) - radius) / step).astype(int), 0)
    high = np.ceil((np.maximum(begin, end) + radius) / step).astype(int) + 1
    box = tuple(map(slice, low, high))
    at = np.stack(np.meshgrid(*[np.arange(a, min(b, n)) for a, b, n in zip(low, high, ct.shape)], indexing="ij"), -1)
    at = at * step - begin
    along = np.clip(at @ (end - begin) / max((end - begin) @ (end - begin), 1e-9), 0, 1)[..., None]
    ct[box][(np.linalg.norm(at - along * (end - begin), axis=-1) < radius) & lung[box]] = 40


def make_ct(program):
    """Write ct.nii and grid.safetensors."""
    surfaces = [os.path.join(SOURCE, "examples/lungs", side + ".obj") for side in ("left", "right")]
    subprocess.run([sys.executable, os.path.join(SOURCE, "docs/guide/synthetic_ct.py"), *surfaces], check=True,
                   stdout=subprocess.DEVNULL)
    coarse = sum(np.asarray(nibabel.load(path).dataobj) for path in glob.glob("segmentation/*.nii.gz")) > 0
    affine, number = nibabel.load("ct.nii.gz").affine, np.random.default_rng(5)
    shrink = np.array(coarse.shape) / SIZE
    step = np.abs(np.diag(affine)[:3]) * shrink
    lung = coarse[np.ix_(*[(np.arange(n) * s).astype(int) for n, s in zip(SIZE, shrink)])]
    ct = np.where(lung, -850, 40).astype(np.int16, order="F")
    x, y = np.meshgrid(np.linspace(-1, 1, SIZE[0]), np.linspace(-1, 1, SIZE[1]), indexing="ij")
    ct[(x ** 2 + y ** 2 > 0.95)[:, :, None] & ~lung] = -1000
    for k in range(SIZE[2]):
        ct[:, :, k] += number.integers(-40, 41, SIZE[:2], np.int16)
    inner = np.argwhere(coarse) / shrink * step
    for radius in number.uniform(1, 2.8, 200):
        draw_line(ct, lung, *number.choice(inner, 2, replace=False), radius, step)
    for place in number.choice(inner, 2, replace=False):
        draw_line(ct, lung, place, place, 11, step)
    affine[:3, :3] *= shrink
    nibabel.save(nibabel.Nifti1Image(ct, affine), "ct.nii")
    for command in (["precompute", *surfaces, "--held-out", "10", "-o", "lungs.safetensors"],
                    ["embed", "lungs.safetensors", "--grid", "4", "-o", "grid.safetensors"]):
        subprocess.run([program, *command], check=True, stdout=subprocess.DEVNULL)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("supine")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--program")
    wanted = parser.parse_args()
    programs = [os.path.abspath(path) for path in (wanted.supine, wanted.program) if path]
    with tempfile.TemporaryDirectory() as folder, open("/proc/cpuinfo", encoding="ascii") as processor:
        os.chdir(folder)
        make_ct(programs[0])
        print(next(line.split(":")[1].strip() for line in processor if line.startswith("model name")))
        best = np.full((len(programs), 2, 2), np.inf)
        for _ in range(wanted.rounds):
            for i, program in enumerate(programs):
                for j, option in enumerate(([], ["--density"])):
                    used = run([program, "deform", "grid.safetensors", "--posture", "prone:rest", "--image", "ct.nii",
                                *option, "-o", "moved.nii"])
                    best[i, j] = np.minimum(best[i, j], used[:2])
        for program, (plain, density) in zip(programs, best):
            print(f"{program}: wall {plain[0]:.2f} and {density[0]:.2f} s, {density[0] / plain[0]:.2f} times; "
                  f"processor {plain[1]:.2f} and {density[1]:.2f} s, {density[1] / plain[1]:.2f} times")
        os.chdir("/")


if __name__ == "__main__":
    main()
