# SPDX-License-Identifier: GPL-3.0-or-later
"""Move tumours on every road, prone at rest: a CT with and without labels, labels alone, the CT and labels of --states,
embedded surfaces in the command and in Python. All give one volume within 5 %, and each lung keeps its mass within 1 %.

    test_tumours.py SUPINE SOURCE LIBRARY

The tumours are a ball, one with a cavity, an irregular one, one at the pleura, and one whose label has stray voxels, in
the lungs of examples/lungs."""
import glob
import json
import os
import shutil
import subprocess
import sys
import tempfile

try:
    import nibabel
    import numpy as np
    from scipy import ndimage
except ImportError:
    print("skipped: this python has no nibabel or scipy")
    sys.exit(77)

program, source, library = map(os.path.abspath, sys.argv[1:4])
STEP = 1.6  # mm
STATE = "prone:rest"
NAMES = {3: "ball", 4: "hollow", 5: "irregular", 6: "pleural", 7: "with stray voxels"}
SIDE = {3: 1, 4: 1, 5: 2, 6: 2, 7: 1}  # lungs in the label map: 1 left, 2 right
SOFT, AERATED = 30.0, -850.0  # HU


def run(*words):
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{words}: {done.stderr}"
    return done.stdout


def read(name):
    return np.asarray(nibabel.load(name).dataobj)


def save(name, values, affine):
    nibabel.save(nibabel.Nifti1Image(values, affine), name)


def lungs():
    """Return the label map of the lungs of the guide's CT, its affine matrix, and both in voxels of STEP."""
    surfaces = [os.path.join(source, "examples/lungs", side + ".obj") for side in ("left", "right")]
    subprocess.run([sys.executable, os.path.join(source, "docs/guide/synthetic_ct.py"), *surfaces], check=True,
                   stdout=subprocess.DEVNULL)
    coarse = 0
    for path in glob.glob("segmentation/*.nii.gz"):
        coarse = np.maximum(coarse, (read(path) > 0) * (1 if "left" in path else 2))
    affine = nibabel.load("ct.nii.gz").affine
    step, fine = abs(affine[0, 0]), affine.copy()
    at = [np.rint(np.arange(int(n * step / STEP)) * STEP / step).astype(int).clip(0, n - 1) for n in coarse.shape]
    fine[:3, :3] *= STEP / step
    return coarse.astype(np.uint8), affine, coarse[np.ix_(*at)].astype(np.uint8), fine


def ball(labels, at, radius):
    """Return a mask of the voxels within a distance of a place, mm from the first voxel."""
    mask = np.zeros(labels.shape, bool)
    first = np.floor((np.asarray(at) - radius) / STEP).astype(int)
    box = tuple(slice(i, i + int(2 * radius / STEP) + 3) for i in first)
    place_of = np.stack(np.meshgrid(*[np.arange(s.start, s.stop) for s in box], indexing="ij"), -1) * STEP
    mask[box] = np.linalg.norm(place_of - at, axis=-1) < radius
    return mask


def place(labels, coarse, step):
    """Write the tumours into a label map of the lungs."""
    for side in (1, 2):
        depth = ndimage.distance_transform_edt(coarse == side) * step
        index = np.argwhere(depth > 30) * step
        low, high = index[index[:, 2].argmin()], index[index[:, 2].argmax()]  # far apart along the body
        if side == 1:
            labels[ball(labels, low, 11)] = 3
            labels[ball(labels, high, 12) & ~ball(labels, high, 6)] = 4
            middle = index[np.abs(index[:, 2] - (low[2] + high[2]) / 2).argmin()]
            labels[ball(labels, middle, 11)] = 7
            for away in np.random.default_rng(3).choice([-1, 1], (8, 3)) * np.arange(10, 16, 0.75)[:, None]:
                labels[tuple(np.rint((middle + away) / STEP).astype(int))] = 7
            continue
        shape = ball(labels, low, 10)
        for way in ([9, 4, 0], [-3, 8, 5], [0, -6, -8]):
            shape |= ball(labels, low + way, 6.5)
        labels[shape] = 5
        row = np.argwhere(labels[:, int(high[1] / STEP), int(high[2] / STEP)] == 2)[:, 0] * STEP
        outer = row.max() - 8 if high[0] > labels.shape[0] * STEP / 2 else row.min() + 8
        labels[ball(labels, [outer, *high[1:]], 12) & (labels == 2)] = 6


def in_labels(name):
    labels = read(name)
    return {part: (labels == part).sum() * STEP ** 3 / 1000 for part in NAMES}


def in_image(name, map_name):
    """Return the volume of each tumour in a CT: voxels beyond half of the way from the lung around it to soft tissue,
    in the lungs of the moved label map, near the label."""
    ct, labels, found = read(name).astype(float), read(map_name), {}
    for part in NAMES:
        box = tuple(slice(max(0, low - 8), high + 8) for low, high in
                    zip(np.argwhere(labels == part).min(0), np.argwhere(labels == part).max(0)))
        own, lung, values = labels[box] == part, labels[box] > 0, ct[box]
        near = ndimage.binary_dilation(own, iterations=3)
        shell = ndimage.binary_dilation(own, iterations=6) & ~near & (labels[box] == SIDE[part])
        found[part] = (near & lung & (values > (SOFT + np.median(values[shell])) / 2)).sum() * STEP ** 3 / 1000
    return found


def strays(name):
    """Return the number of stray voxels of the tumour that has some: those that are not of its largest component."""
    pieces, count = ndimage.label(read(name) == 7)
    return (pieces > 0).sum() - max((pieces == i).sum() for i in range(1, count + 1))


def mass(ct, labels):
    """Return the mass of each lung with its tumours, g."""
    return np.array([(ct + 1000.0)[np.isin(labels, [side, *(part for part in SIDE if SIDE[part] == side)])].sum()
                     for side in (1, 2)]) * STEP ** 3 / 1e6


def in_command(name):
    """Return the volumes of embedded surfaces as 'compare' prints them."""
    printed = json.loads(run("compare", name, "--postures", f"supine:full,{STATE}", "--json"))
    rows = {row["name"]: row.get("volume_after_ml") for row in printed["targets"]}
    return {part: rows[name] for part, name in NAMES.items()}


def in_python(name):
    """Return the volumes of embedded surfaces from the positions of the Python package."""
    shutil.copytree(os.path.join(source, "runtime/python/supine"), "python/supine")
    shutil.copy(library, "python/supine/libsupine_runtime.so")
    sys.path.insert(0, "python")
    import supine  # pylint: disable=import-outside-toplevel
    basis = supine.open(name)
    corners = basis.deform(basis.pose(STATE))[basis.triangles].astype(float)
    six = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    of = np.asarray(basis.tensor("part")).ravel()[basis.triangles[:, 0]]
    return {part: six[of == i].sum() / 6000 for i, part in enumerate(NAMES)}


def main():
    coarse, of_coarse, labels, affine = lungs()
    save("lungs.nii", coarse, of_coarse)
    place(labels, coarse, abs(of_coarse[0, 0]))
    noise = np.random.default_rng(7).normal(size=labels.shape)
    ct = np.rint(np.where(labels > 0, AERATED + 20 * noise, 40.0))
    ct[labels > 2] = SOFT
    ct = ct.astype(np.int16)
    save("ct.nii", ct, affine)
    save("labels.nii", labels, affine)
    run("precompute", "lungs.nii", "--labels", "left=1,right=2", "--scanned", "full", "--edge", 8, "--held-out", 10,
        "-o", "lungs.safetensors")
    run("embed", "lungs.safetensors", "--grid", 5, "-o", "grid.safetensors")
    run("embed", "lungs.safetensors", "labels.nii", "--labels", ",".join(f"{k}={v}" for k, v in NAMES.items()), "-o",
        "parts.safetensors")
    move = ("deform", "grid.safetensors", "--posture", STATE)
    run(*move, "--image", "ct.nii", "--density", "-o", "a.nii")
    run(*move, "--labels", "labels.nii", "-o", "b.nii")
    with open("states.csv", "w", encoding="utf-8") as file:
        file.write(f"posture,output,labels\n{STATE},c.nii,d.nii\n")
    run("deform", "grid.safetensors", "--states", "states.csv", "--image", "ct.nii", "--labels", "labels.nii",
        "--density")
    roads = {"scan": in_labels("labels.nii"), "CT": in_image("a.nii", "d.nii"),
             "labels": in_labels("b.nii"), "CT of --states": in_image("c.nii", "d.nii"),
             "labels of --states": in_labels("d.nii"), "embedded": in_command("parts.safetensors"),
             "Python": in_python("parts.safetensors")}
    faults = []
    for part, name in NAMES.items():
        volumes = [road[part] for road in roads.values()]
        print(f"{name}: " + ", ".join(f"{road[part]:.2f} mL ({of})" for of, road in roads.items()))
        if not max(volumes) < 1.05 * min(volumes):
            faults.append(f"{name}: {min(volumes):.2f} to {max(volumes):.2f} mL")
    left = [strays(name) for name in ("labels.nii", "b.nii", "d.nii")]
    print(f"stray voxels: {left[0]} in the scan, {left[1]} and {left[2]} at rest")
    if min(left) == 0:
        faults.append("stray voxels vanish")
    before = mass(ct, labels)
    for output, of in (("a", "d"), ("c", "d")):
        change = mass(read(output + ".nii"), read(of + ".nii")) / before - 1
        print(f"mass of the lungs, {output}: {100 * change[0]:+.2f} and {100 * change[1]:+.2f} %")
        if np.abs(change).max() > 0.01:
            faults.append(f"mass changes by {100 * np.abs(change).max():.2f} %")
    print("\n".join(faults) or "every road gives one volume")
    return 1 if faults else 0


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    code = main()
    os.chdir("/")
sys.exit(code)
