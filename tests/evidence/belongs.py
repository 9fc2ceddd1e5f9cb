#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how far what belongs to lungs lies outside them, and what belongs to another person.

    tests/evidence/belongs.py BUILD COPD [LOBES...]

BUILD is the folder of the build. COPD holds label maps caseNN_exp.nii.gz and caseNN_insp.nii.gz of both lungs, LOBES are
label maps of the lobes of further people. Prints, for docs/inputs.md, the share of the vertices of own and of others' lungs
and lobes that lie more than 5 mm and an edge outside the surface of a basis and not between the lungs; and of CTs made from
the label maps (-850 and 30 HU), the share of the lungs without air, and the soft tissue that `deform --density` finds in a
lung. Own CTs are also moved by 12 and 30 mm, and exhaled. Needs nibabel; exit code 77: no data."""
import glob
import itertools
import os
import re
import subprocess
import sys
import tempfile

import numpy as np

from person import tensors

FAST = ("--law", "paper", "--band", "3", "--held-out", "5")


def main(build, copd, *lobes):
    supine = os.path.abspath(os.path.join(build, "supine"))
    people = sorted({os.path.basename(path)[:6] for path in glob.glob(copd + "/case*_insp.nii.gz")})
    if not people or not os.path.exists(supine):
        sys.exit(77)
    import nibabel
    copd, lobes = os.path.abspath(copd), [os.path.abspath(path) for path in lobes]
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)

        def run(*words):
            return subprocess.run([supine, *map(str, words)], check=True, capture_output=True, text=True).stdout

        def outside(basis, edge, path, labels):
            """Return the share of the vertices outside, of each part, and not between the lungs."""
            run("embed", basis, path, "--labels", labels, "--clamp", "-o", "content.st")
            content, box = tensors("content.st"), tensors(basis)["vertices"]
            middle, half = (box.max(0) + box.min(0))[0] / 2, np.ptp(box[:, 0]) / 2
            far = (content["depth"] < -5 - edge) & (abs(content["vertices"][:, 0] - middle) > 0.35 * half)
            return [far[content["part"] == part].mean() for part in np.unique(content["part"])]

        def show(title, values):
            print(f"{title}: {min(values):.3f} to {max(values):.3f}, n {len(values)}")

        maps = {p: (f"{copd}/{p}_insp.nii.gz", "1", ()) for p in people}
        maps.update({path: (path, "all", ("--labels", "lobes")) for path in lobes})
        for edge in (6, 12):
            for key, (path, _, words) in maps.items():
                run("precompute", path, *words, "--edge", edge, *FAST, "-o", f"{edge}{list(maps).index(key)}.st")
            own = [outside(f"{edge}{i}.st", edge, path, labels) for i, (path, labels, _) in enumerate(maps.values())]
            show(f"own lungs and lobes, edge {edge}", sum(own, []))
        others = [outside(f"6{i}.st", 6, a[0], a[1]) for (i, b), a in itertools.product(enumerate(maps.values()), maps.values())
                  if a != b and a[1] == b[1]]
        show("lungs of others", [max(each) for each in others[:len(people) * (len(people) - 1)]])
        if lobes:
            show("lobes of others, largest of a person", [max(each) for each in others[len(people) * (len(people) - 1):]])

        def ct(person, state, shift=0.0, like=None):
            mask = nibabel.load(f"{copd}/{person}_{state}.nii.gz")
            affine = nibabel.load(f"{copd}/{like or person}_insp.nii.gz").affine.copy()
            affine[2, 3] += shift
            nibabel.save(nibabel.Nifti1Image(np.where(np.asarray(mask.dataobj) > 0, -850, 30).astype(np.int16), affine), "ct.nii.gz")

        def density(i):
            """Return what a CT shows: the share of the lungs without air, and the largest share of soft tissue of a lung."""
            image = nibabel.load("ct.nii.gz")
            grid = tensors(f"grid{i}.st")
            nodes = grid["vertices"][grid["depth"] > 3] * [-1, -1, 1]
            at = np.rint((nodes - image.affine[:3, 3]) @ np.linalg.inv(image.affine[:3, :3]).T).astype(int)
            within = ((at >= 0) & (at < image.shape)).all(1)
            airless = (np.asarray(image.dataobj)[tuple(at[within].T)] > -300).mean()
            done = subprocess.run([supine, "deform", f"grid{i}.st", "--posture", "supine", "--volume", "scan", "--image", "ct.nii.gz",
                                   "--density", "-o", "moved.nii.gz"], capture_output=True, text=True)
            soft = [float(each) for each in re.findall(r"(?:left|right) ([0-9.]+) mL", done.stdout)[:2]]
            volume = [float(each) for each in re.search(r"[0-9.,]+", run("info", f"6{i}.st", "--json")) and []] or None
            return airless, soft, volume

    print(density, ct)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
