#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how far what belongs to lungs lies outside them, and what belongs to another person.

    tests/evidence/belongs.py BUILD COPD [LOBES...]

BUILD is the folder of the build. COPD holds label maps caseNN_exp.nii.gz and caseNN_insp.nii.gz of both lungs, LOBES
are label maps of the lobes of further people. Prints, for docs/inputs.md, the share of the vertices of own and of
others' lungs and lobes that lie more than 5 mm and an edge outside the surface of a basis and not between the lungs;
how far the backs of two lungs are apart; and the share of the lungs that is no lung, hence without air, in the own CT,
in the same 12 and 30 mm off, in the exhaled one, and in others'; and how many different values label maps have, and
the slices of CT, MR and scintigraphy that pydicom brings. Needs nibabel and pydicom; exit code 77: no data."""
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


def show(title, values):
    print(f"{title}: {min(values):.3f} to {max(values):.3f}, n {len(values)}", flush=True)


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
        own = [outside(supine, made[edge, i], edge, *each[:2]) for i, each in enumerate(maps)]
        show(f"own lungs and lobes outside, edge {edge}", sum(own, []))
    for labels in ("1", "all"):
        others = [max(outside(supine, made[6, i], 6, *b[:2])) for (i, a), b in itertools.product(enumerate(maps), maps)
                  if a is not b and a[1] == b[1] == labels]
        if others:
            show(f"labels '{labels}' of others outside", others)
    show("backs apart / depth", [a / b for a, b in (apart(tensors(made[6, i])) for i in range(len(maps)))])


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
    show("own CT, without air", [airless(scan, scan) for scan in full])
    for shift in (12, 30, -30):
        show(f"own CT {shift} mm off, without air", [airless(scan, scan, shift) for scan in full])
    show("own exhaled CT, without air", [airless(scan, other) for scan, other in zip(full, rest)])
    show("CT of others, without air", [airless(a, b) for a, b in itertools.permutations(full, 2)])


def values(maps):
    """Show how many different values label maps and real slices have."""
    show("label maps, different values", [len(np.unique(np.asanyarray(nibabel.load(path).dataobj))) for path in maps])
    folder = os.path.join(os.path.dirname(pydicom.__file__), "data/test_files")
    show("slices of CT, MR and scintigraphy, different values",
         [len(np.unique(pydicom.dcmread(f"{folder}/{name}.dcm").pixel_array)) for name in SLICES])


def main(build, copd, *lobes):
    supine, copd = os.path.abspath(os.path.join(build, "supine")), os.path.abspath(copd)
    people = sorted({os.path.basename(path)[:6] for path in glob.glob(copd + "/case*_insp.nii.gz")})
    lobes = list(map(os.path.abspath, lobes))
    if not people or not os.path.exists(supine):
        sys.exit(77)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        contents(supine, [(f"{copd}/{p}_insp.nii.gz", "1", ()) for p in people] +
                 [(path, "all", ("--labels", "lobes")) for path in lobes])
        images(copd, people)
    values([*glob.glob(copd + "/*.nii.gz"), *lobes])


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
