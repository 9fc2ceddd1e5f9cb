#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how far what belongs to lungs lies outside them, and what belongs to another person.

    tests/evidence/belongs.py BUILD COPD [--all] [LOBES...]

Takes the first three people of COPD, about a minute of processor time, or with --all every one, as docs/inputs.md does.
BUILD is the folder of the build. COPD holds label maps caseNN_exp.nii.gz and caseNN_insp.nii.gz of both lungs, LOBES
are label maps of the lobes of further people. Prints, for docs/inputs.md, the share of the vertices of own and of
others' lungs and lobes that lie more than 5 mm and an edge outside the surface of a basis and not between the lungs;
how far the backs of two lungs are apart; the share of the lungs that is no lung, hence without air, in the own CT,
in the same 12 and 30 mm off, in the exhaled one, and in others'; the half ball on the section of a lung at the border
of an image that shows all but a share of it; how often labels that are moved are told of; and how many different
values label maps have, and the slices of CT, MR and scintigraphy that pydicom brings. Each line states the people,
the measurements n, and the range of the largest and of the smallest value if each person is left out in turn.
Needs nibabel and pydicom; exit code 77: no data."""
import glob
import itertools
import os
import subprocess
import sys
import tempfile

import nibabel
import numpy as np
import pydicom

from person import tensors

SLICES = ("CT_small", "693_J2KI", "J2K_pixelrep_mismatch", "MR_small", "JPEG2000")  # files of pydicom
FAST = ("--law", "paper", "--band", "3", "--held-out", "5")


def run(*words, check=True):
    return subprocess.run(list(map(str, words)), check=check, capture_output=True, text=True).stdout


def show(title, found):
    """Print the range of what was found. found: values, each a list of the people who are in it, and a number"""
    values = [value for _, value in found]
    people = {person for who, _ in found for person in who}
    without = [[value for who, value in found if person not in who] for person in people]
    ends = [sorted(end(rest) for rest in without if rest) for end in (min, max)]
    left_out = "".join(f", {name} {each[0]:.4f} to {each[-1]:.4f}"
                       for name, each in zip(("least", "most"), ends) if each)
    print(f"{title}: {min(values):.4f} to {max(values):.4f}, {len(people)} people, n {len(values)}"
          f"{left_out and '; without one' + left_out}", flush=True)


def outside(supine, basis, edge, path, labels):
    """Return the share of the vertices that lie outside and not between the lungs, of each part."""
    run(supine, "embed", basis, path, "--labels", labels, "--clamp", "-o", "content.st")
    content, surface = tensors("content.st"), tensors(basis)["vertices"]
    middle, half = (surface.max(0) + surface.min(0))[0] / 2, np.ptp(surface[:, 0]) / 2
    far = (content["depth"] < -5 - edge) & (abs(content["vertices"][:, 0] - middle) > 0.35 * half)
    return [far[content["part"] == part].mean() for part in np.unique(content["part"])]


def apart(basis):
    """Return the distance of the backs of the lungs, and the depth of the deeper one, mm."""
    sides = [basis["vertices"][basis["lung"] == lung, 1] for lung in (0, 1)]
    return abs(sides[0].max() - sides[1].max()), max(map(np.ptp, sides))


def contents(supine, maps):
    """Show what lies outside bases. maps: for each person, a label map, the labels to embed, options of the lungs"""
    made = {}
    for edge, (i, (path, _, words)) in itertools.product((6, 12), enumerate(maps)):
        made[edge, i] = f"{edge}_{i}.st"
        run(supine, "precompute", path, *words, "--edge", edge, *FAST, "-o", made[edge, i])
    for edge in (6, 12):
        own = [((i,), share) for i, each in enumerate(maps)
               for share in outside(supine, made[edge, i], edge, *each[:2])]
        show(f"own lungs and lobes outside, edge {edge}", own)
    for labels in ("1", "all"):
        others = [((i, j), max(outside(supine, made[6, i], 6, *b[:2])))
                  for (i, a), (j, b) in itertools.permutations(enumerate(maps), 2) if a[1] == b[1] == labels]
        if others:
            show(f"labels '{labels}' of others outside", others)
    show("backs apart / depth", [((i,), a / b) for i in range(len(maps)) for a, b in (apart(tensors(made[6, i])),)])


def read_mask(path):
    """Return every third voxel of a label map, and its affine matrix, mm."""
    image = nibabel.load(path)
    return np.asarray(image.dataobj)[::3, ::3, ::3] > 0, image.affine @ np.diag([3, 3, 3, 1])


def airless(lungs, other, shift=0.0):
    """Return the share of lungs, 3 mm below their surface, that is no lung in another scan with the same centre."""
    from scipy.ndimage import distance_transform_edt
    (mask, affine), (seen, there) = lungs, other
    place = lambda voxels, matrix: voxels @ matrix[:3, :3].T + matrix[:3, 3]
    deep = place(np.argwhere(distance_transform_edt(mask, abs(np.diag(affine)[:3])) > 3), affine)
    moved = np.zeros(3)
    if lungs is not other:
        moved = deep.mean(0) - place(np.argwhere(seen), there).mean(0)
    at = np.rint((deep - moved - [0, 0, shift] - there[:3, 3]) @ np.linalg.inv(there[:3, :3]).T).astype(int)
    return 1 - seen[tuple(at[((at >= 0) & (at < seen.shape)).all(1)].T)].mean()


def images(copd, people):
    """Show how much of the lungs has no air in their own CT, in this CT moved, and in that of another person."""
    full, rest = ([read_mask(f"{copd}/{p}_{state}.nii.gz") for p in people] for state in ("insp", "exp"))
    each = lambda measure: [((i,), measure(i)) for i in range(len(people))]
    show("own CT, without air", each(lambda i: airless(full[i], full[i])))
    for shift in (12, 30, -30):
        show(f"own CT {shift} mm off, without air", each(lambda i, shift=shift: airless(full[i], full[i], shift)))
    show("own exhaled CT, without air", each(lambda i: airless(full[i], rest[i])))
    show("CT of others, without air",
         [((i, j), airless(full[i], full[j])) for i, j in itertools.permutations(range(len(people)), 2)])


def label_maps(mask, affine):
    """Return the matrix of maps with room around the lungs, a map of each lung alone, and one of both with the wall of
    the chest (2) and an organ below the right lung and the midline (3). The third axis leads to the head."""
    from scipy.ndimage import distance_transform_edt
    lungs, frame = np.pad(mask, 30), affine.copy()
    frame[:3, 3] -= affine[:3, :3] @ [30, 30, 30]
    columns = lungs.sum((1, 2))
    third = len(columns) // 3
    middle = third + np.argmin(columns[third:2 * third])
    alone = [np.where((np.arange(len(columns)) < middle)[:, None, None] == side, lungs, 0) for side in (True, False)]
    right = slice(0, middle + 8) if affine[0, 0] < 0 else slice(middle - 8, None)  # x leads to the right in RAS
    beside = np.where(distance_transform_edt(~lungs, sampling=abs(np.diag(affine)[:3])) < 14, 2, 0)
    beside[right][lungs.any(2)[right][:, :, None] & (lungs[right].cumsum(2) == 0)] = 3
    return frame, *alone, np.where(lungs, 1, beside)


def labels(supine, maps):
    """Show how often labels that are moved with a basis of contents() are told of."""
    def told(voxels, frame):
        nibabel.save(nibabel.Nifti1Image(voxels.astype(np.uint8), frame), "labels.nii.gz")
        done = subprocess.run([supine, "deform", "grid.st", "--posture", "prone", "--labels", "labels.nii.gz",
                               "--allow-folds", "-o", "moved.nii.gz"], check=True, capture_output=True, text=True)
        return "lie outside" in done.stderr or "lie in the image" in done.stderr
    masks = [read_mask(path) for path, *_ in maps]
    made = [label_maps(*mask) for mask in masks]
    found = {"own lungs": [], "one lung alone": [], "own lungs, wall and organ": [], "lungs of others": []}
    for edge, (i, (frame, *alone, organs)) in itertools.product((6, 12), enumerate(made)):
        run(supine, "embed", f"{edge}_{i}.st", "--grid", 10, "-o", "grid.st")
        found["own lungs"].append(told(*masks[i]))
        found["one lung alone"] += [told(lung, frame) for lung in alone]
        found["own lungs, wall and organ"].append(told(organs, frame))
        found["lungs of others"] += [told(*mask) for j, mask in enumerate(masks) if j != i]
    for title, each in found.items():
        print(f"moved labels, {title}: {sum(each)} of {len(each)} told", flush=True)


def cuts(copd, people):
    """Show the half ball at the border of an image that shows all of a lung but a share at the head or the feet."""
    found = {lost: [] for lost in (0.0005, 0.005)}
    for (i, person), state in itertools.product(enumerate(people), ("insp", "exp")):
        image = nibabel.load(f"{copd}/{person}_{state}.nii.gz")
        mask, spacing = np.asarray(image.dataobj) > 0, np.abs(np.diag(image.affine)[:3])
        columns = np.flatnonzero(mask.any((1, 2)))
        middle = (columns[0] + columns[-1]) // 2
        for lung, step, lost in itertools.product((mask[:middle], mask[middle:]), (1, -1), found):
            layers = lung.sum((0, 1))[::step]
            area = layers[np.searchsorted(np.cumsum(layers), lost * layers.sum())] * spacing[0] * spacing[1]
            found[lost].append(((i,), 2 / 3 / np.pi ** 0.5 * area ** 1.5 / (layers.sum() * spacing.prod())))
    for lost, values in found.items():
        show(f"half ball / lung, without {lost:g} of its volume", values)


def values(maps):
    """Show how many different values label maps and real slices have."""
    count = lambda title, found: print(f"{title}: {min(found)} to {max(found)}, n {len(found)}", flush=True)
    count("label maps, different values", [len(np.unique(np.asanyarray(nibabel.load(path).dataobj))) for path in maps])
    folder = os.path.join(os.path.dirname(pydicom.__file__), "data/test_files")
    count("slices of CT, MR and scintigraphy, different values",
          [len(np.unique(pydicom.dcmread(f"{folder}/{name}.dcm").pixel_array)) for name in SLICES])


def main(build, copd, *lobes):
    supine, copd = os.path.abspath(os.path.join(build, "supine")), os.path.abspath(copd)
    people = sorted({os.path.basename(path)[:6] for path in glob.glob(copd + "/case*_insp.nii.gz")})
    people = people if "--all" in lobes else people[:3]
    lobes = [os.path.abspath(path) for path in lobes if path != "--all"]
    if not people or not os.path.exists(supine):
        sys.exit(77)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        maps = [(f"{copd}/{p}_insp.nii.gz", "1", ()) for p in people]
        maps += [(path, "all", ("--labels", "lobes")) for path in lobes]
        contents(supine, maps)
        labels(supine, maps)
        images(copd, people)
        cuts(copd, people)
    values([*glob.glob(copd + "/*.nii.gz"), *lobes])


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
