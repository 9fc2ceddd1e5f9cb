# SPDX-License-Identifier: GPL-3.0-or-later
"""Make a CT and a segmentation from surfaces of lungs (OBJ), for trials without a patient's scan:

    python3 synthetic_ct.py left.obj right.obj

This writes ct.nii.gz, in Hounsfield units, and the folder segmentation with one mask for each lobe, in the files and
with the names that TotalSegmentator writes. Voxels have sides of 4 mm. The program needs numpy and nibabel."""
import os
import sys

import nibabel
import numpy as np

STEP = 4.0  # mm


def read(path):
    """Return the corners of each triangle of a surface in OBJ, mm."""
    lines = [line.split() for line in open(path, encoding="utf-8")]
    vertices = np.array([line[1:4] for line in lines if line[:1] == ["v"]], float)
    return vertices[np.array([line[1:4] for line in lines if line[:1] == ["f"]], int) - 1]


def voxels_inside(corners):
    """Walk along z, and change sides at every triangle that the line through the voxels meets."""
    crossed = np.zeros(size, int)
    for a, b, c in (corners - low) / STEP:
        first = np.ceil(np.min([a, b, c], axis=0)[:2]).astype(int)
        last = np.floor(np.max([a, b, c], axis=0)[:2]).astype(int)
        x, y = np.mgrid[first[0]:last[0] + 1, first[1]:last[1] + 1]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        if x.size == 0 or area == 0:
            continue
        s = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area
        t = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area
        met = (s >= 0) & (t >= 0) & (s + t <= 1)
        z = np.ceil(a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]))[met].astype(int)
        np.add.at(crossed, (x[met], y[met], z), 1)
    return np.cumsum(crossed, axis=2) % 2 == 1


surfaces = [read(path) for path in sys.argv[1:3]]  # left, right
low = np.min([surface.min(axis=(0, 1)) for surface in surfaces], axis=0) - 20
high = np.max([surface.max(axis=(0, 1)) for surface in surfaces], axis=0) + 20
size = np.ceil((high - low) / STEP).astype(int)
left, right = map(voxels_inside, surfaces)
inside = left | right

# Divide each lung into lobes by horizontal planes, which is enough for a trial.
y = low[1] + STEP * np.arange(size[1]).reshape(1, -1, 1)
heights = np.nonzero(inside.any(axis=(0, 1)))[0]
height = (np.arange(size[2]) - heights[0]) / np.ptp(heights) + np.zeros(size)
lobes = {"lung_upper_lobe_left": left & (height >= 0.5), "lung_lower_lobe_left": left & (height < 0.5),
         "lung_upper_lobe_right": right & (height >= 0.6),
         "lung_middle_lobe_right": right & (height < 0.6) & (height >= 0.4),
         "lung_lower_lobe_right": right & (height < 0.4)}

# Write the images with NIfTI's axes (RAS), like every program that reads them expects.
affine = np.diag([-STEP, -STEP, STEP, 1])
affine[:3, 3] = [-low[0], -low[1], low[2]]
os.makedirs("segmentation", exist_ok=True)
for name, where in lobes.items():
    nibabel.save(nibabel.Nifti1Image(where.astype(np.uint8), affine), f"segmentation/{name}.nii.gz")
density = np.where(inside, -870 + 0.3 * (y - y.mean()), 40)  # denser towards the back
nibabel.save(nibabel.Nifti1Image(density.astype(np.int16), affine), "ct.nii.gz")
print(f"ct.nii.gz and 5 masks, {size[0]} x {size[1]} x {size[2]} voxels, {inside.sum() * STEP ** 3 / 1000:.0f} mL of "
      f"lung")
