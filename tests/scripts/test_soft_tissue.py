# SPDX-License-Identifier: GPL-3.0-or-later
"""Move CTs with soft tissue in the lungs: parts keep their size, soft tissue its density, and each lung its mass.

    test_soft_tissue.py SUPINE GUIDE [LABEL_MAP]

The CTs are synthetic: on the label map of real lungs, if it is there, and the one of the guide
(GUIDE/synthetic_ct.py)."""
import glob
import os
import shutil
import subprocess
import sys
import tempfile

try:
    import nibabel
    import numpy as np
except ImportError:
    print("skipped: this python has no nibabel")
    sys.exit(77)

supine, guide = map(os.path.abspath, sys.argv[1:3])
real = os.path.abspath(sys.argv[3]) if len(sys.argv) > 3 and os.path.exists(sys.argv[3]) else None
faults = []
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


def run(*words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{words}: {done.stderr or done.stdout}")
    return done.stdout + done.stderr


def check(good, what):
    if not good:
        faults.append(what)


def places(affine, index):
    """Return the places, mm, LPS, of voxels [n, 3]."""
    return nibabel.affines.apply_affine(LPS @ affine, index)


def linear(values, at):
    """Interpolate an array [i, j, k, ...] at indices [n, 3], clamped to its border."""
    last = np.array(values.shape[:3]) - 1
    at = np.clip(at, 0, last)
    low = np.minimum(np.floor(at).astype(int), last - 1)
    share, total = at - low, 0
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, share, 1 - share), axis=1)
        cell = values[tuple((low + corner).T)].astype(float)
        total = total + (weight[:, None] if cell.ndim == 2 else weight) * cell
    return total


def grow(mask):
    """Add the voxels that share a face with one of the mask, which does not reach the border."""
    return mask | np.logical_or.reduce([np.roll(mask, way, axis) for axis in range(3) for way in (-1, 1)])


def ball(affine, shape, centre, radius):
    """Return the slices of the voxels around a point, and which of these are within a distance of it, mm."""
    index = nibabel.affines.apply_affine(np.linalg.inv(LPS @ affine), centre)
    reach = np.ceil(radius / np.linalg.norm(affine[:3, :3], axis=0)) + 1
    low = np.maximum(np.rint(index - reach), 0).astype(int)
    high = np.minimum(np.rint(index + reach) + 1, shape).astype(int)
    box = np.stack(np.meshgrid(*map(np.arange, low, high), indexing="ij"), -1)
    near = np.linalg.norm(places(affine, box.reshape(-1, 3)) - centre, axis=1) < radius
    return tuple(map(slice, low, high)), near.reshape(box.shape[:3])


def tree(affine, shape, root, number):
    """Return a branching tree of vessels with radii of 4 mm and less."""
    found = np.zeros(shape, bool)
    todo = [(root, 4.0, 22.0, direction, 4) for direction in number.normal(size=(4, 3))]
    while todo:
        start, radius, length, direction, left = todo.pop()
        direction = direction / np.linalg.norm(direction)
        for along in np.arange(0, length, radius / 2):
            box, near = ball(affine, shape, start + along * direction, radius)
            found[box] |= near
        if left > 0:
            end = start + length * direction
            todo += [(end, 0.75 * radius, 0.8 * length, direction + 0.7 * number.normal(size=3), left - 1)
                     for _ in range(2)]
    return found


def check_state(name, ct, labels, affine, parts, output):
    """Compare the moved CT and label map with the originals. Labels: 1 left lung, 2 right lung, and parts, by their
    lung. @param output  numbers of the files that were written"""
    read = lambda kind: np.asarray(nibabel.load(f"{output}_{kind}.nii.gz").dataobj)
    moved, places_of = read("ct").astype(float), read("labels")
    size = abs(np.linalg.det(affine[:3, :3])) / 1000
    for lung in (1, 2):
        own = [lung] + [part for part in parts if parts[part] == lung]
        mass = [((image + 1000.0)[np.isin(map_, own)]).sum() * size / 1000
                for image, map_ in ((ct, labels), (moved, places_of))]
        print(f"{name}: lung {lung}: mass {mass[0]:.1f} -> {mass[1]:.1f} g")
        check(abs(mass[1] / mass[0] - 1) < 0.01,
              f"{name}: the mass of lung {lung} changes by {100 * (mass[1] / mass[0] - 1):+.2f} %")
    for part in parts:
        was, now = (labels == part).sum() * size, (places_of == part).sum() * size
        in_lungs = grow(places_of == part) & (places_of > 0)  # without the chest wall
        bright = (in_lungs & (moved > -420)).sum() * size  # halfway from lung to soft tissue
        print(f"{name}: part {part}: {was:.2f} -> {now:.2f} mL by label, {bright:.2f} mL above -420 HU")
        check(abs(now / was - 1) < 0.1 and abs(bright / was - 1) < 0.1,
              f"{name}: part {part} has {was:.2f} mL, then {now:.2f} and {bright:.2f} mL")
    field = nibabel.load(f"{output}_field.nii.gz")
    index = np.argwhere(places_of > 0)
    where = places(affine, index)
    shift = linear(np.asarray(field.dataobj).squeeze(),
                   nibabel.affines.apply_affine(np.linalg.inv(LPS @ field.affine), where))
    source = linear(ct, nibabel.affines.apply_affine(np.linalg.inv(LPS @ affine), where + shift))
    over = (moved[places_of > 0] - np.maximum(source, 50)).max()
    print(f"{name}: at most {over:.1f} HU above the interpolated source, or 50 HU")
    check(over <= 1, f"{name}: a voxel is {over:.0f} HU above its source, or 50 HU")


def check_ct(name, basis, grid, ct, labels, affine, parts, states):
    """Move a CT into each of the states."""
    nibabel.save(nibabel.Nifti1Image(ct, affine), "moving.nii.gz")
    nibabel.save(nibabel.Nifti1Image(labels, affine), "labels.nii.gz")
    run(supine, "embed", basis, "moving.nii.gz", "--grid", grid, "-o", "grid.safetensors")
    with open("list.csv", "w") as file:
        file.write("posture,output,labels,field\n")
        for i, state in enumerate(states):
            file.write(f"{state},{i}_ct.nii.gz,{i}_labels.nii.gz,{i}_field.nii.gz\n")
    words = ["deform", "grid.safetensors", "--states", "list.csv", "--image", "moving.nii.gz", "--labels",
             "labels.nii.gz", "--density", "--inverse"]
    said = run(supine, *words)
    print(said)
    check(said.count("rigid part of") == len(parts),
          f"{name}: {said.count('rigid part of')} parts were found, not {len(parts)}")
    for i, state in enumerate(states):
        check_state(f"{name} {state}" if name != "guide" else name, ct, labels, affine, parts, i)


def check_real():
    """Two balls 4 mm apart in the left lung; in the right lung, a ball beside a tree of vessels, and one at the
    pleura."""
    image = nibabel.load(real)
    lobes, affine = np.asarray(image.dataobj), image.affine
    inside = lobes > 0
    labels = np.where(inside, np.where(lobes <= 2, 1, 2), 0).astype(np.uint8)
    number = np.random.default_rng(3)
    ct = np.where(inside, -850 + 40 * number.normal(size=lobes.shape), 40.0)
    centres = {3: [75.4, -39.5, -44.0], 4: [75.4, -67.5, -44.0], 5: [-90.0, -80.0, -68.0], 6: [0.0, -80.0, -10.0]}
    index = np.rint(nibabel.affines.apply_affine(np.linalg.inv(LPS @ affine), centres[6])).astype(int)
    row = np.argwhere(inside[:, index[1], index[2]])[:, 0]
    # 8 mm from the pleura
    centres[6][0] = (LPS @ affine)[0] @ [row.min() if (LPS @ affine)[0, 0] > 0 else row.max(), 0, 0, 1] + 8
    vessels = tree(affine, lobes.shape, np.array([-88.0, -58.0, -68.0]), number) & (labels == 2)
    for label, centre in centres.items():
        box, near = ball(affine, lobes.shape, centre, 16)
        vessels[box] &= ~near
        box, near = ball(affine, lobes.shape, centre, 12)
        labels[box][near & inside[box]], ct[box][near & inside[box]] = label, 30
    ct[vessels] = 30
    run(supine, "precompute", real, "--labels", "lobes", "--edge", 6, "--held-out", 20, "-o", "real.safetensors")
    check_ct("real", "real.safetensors", 5, np.rint(ct).astype(np.int16), labels, affine, {3: 1, 4: 1, 5: 2, 6: 2},
             ["supine:rest", "prone:rest+300"])


def check_guide():
    """A ball of 14 mm in the CT of the guide, with voxels of 4 mm."""
    lungs = os.path.join(guide, "..", "..", "examples", "lungs")
    run(sys.executable, os.path.join(guide, "synthetic_ct.py"),
        *(os.path.join(lungs, f"{side}.obj") for side in ("left", "right")))
    run(supine, "precompute", "segmentation", "--scanned", "full", "--edge", 8, "--held-out", 20, "-o",
        "guide.safetensors")
    image = nibabel.load("ct.nii.gz")
    ct, affine = np.array(image.dataobj), image.affine
    labels = np.zeros(ct.shape, np.uint8)
    for path in sorted(glob.glob("segmentation/*.nii.gz")):
        labels[np.asarray(nibabel.load(path).dataobj) > 0] = 1 if "left" in path else 2
    box, near = ball(affine, ct.shape, [80, -170, -140], 14)
    labels[box][near], ct[box][near] = 3, 30
    check_ct("guide", "guide.safetensors", 8, ct, labels, affine, {3: 1}, ["supine:rest"])


folder = tempfile.mkdtemp()
os.chdir(folder)
check_guide()
if real is None:
    print("no real lungs: their CT is left out")
else:
    check_real()
os.chdir("/")
shutil.rmtree(folder)
for fault in faults:
    print(fault)
print(f"{len(faults)} faults")
sys.exit(1 if faults else 0)
