#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how far what belongs to lungs lies outside them, and what belongs to another person.

    tests/evidence/belongs.py BUILD COPD [LOBES...]

BUILD is the folder of the build. COPD holds label maps caseNN_exp.nii.gz and caseNN_insp.nii.gz of both lungs, LOBES
are label maps of the lobes of further people. Prints, for docs/inputs.md, the share of the vertices of own and of
others' lungs and lobes that lie more than 5 mm and an edge outside the surface of a basis and not between the lungs;
how far the backs of two lungs are apart; and of CTs made from the label maps (-850 and 30 HU), the share of the lungs
without air, and the largest share of soft tissue of a lung that `deform --density` finds. Needs nibabel; exit code 77:
no data."""
import glob
import itertools
import os
import re
import subprocess
import sys
import tempfile

import numpy as np

from person import spread, tensors

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


class Scan:
    """A person's inhaled scan, with the grid of a basis, and CTs in it."""

    def __init__(self, supine, copd, person):
        self.supine, self.copd, self.person = supine, copd, person
        path = f"{copd}/{person}_insp.nii.gz"
        run(supine, "precompute", path, "--edge", "8", "--held-out", "5", "-o", person + ".st")
        run(supine, "embed", person + ".st", "--grid", "10", "-o", person + "_grid.st")
        surface, self.grid = tensors(person + ".st"), tensors(person + "_grid.st")
        self.volumes = [spread(surface["vertices"].astype(float), surface["triangles"][
            surface["lung"][surface["triangles"][:, 0]] == lung])[0] for lung in (0, 1)]

    def look(self, other, state="insp", shift=0.0):
        """Return the shares without air and of soft tissue of the CT of a person, in the middle of the own scan."""
        import nibabel
        own, mask = (nibabel.load(f"{self.copd}/{p}_{s}.nii.gz") for p, s in ((self.person, "insp"), (other, state)))
        image = np.where(np.asarray(mask.dataobj) > 0, -850, 30).astype(np.int16)
        affine = mask.affine.copy()
        if other != self.person or state != "insp":  # scans have frames of their own: their centres meet
            centre = lambda scan: scan.affine @ np.append(np.argwhere(np.asarray(scan.dataobj) > 0).mean(0), 1)
            affine[:, 3] += (centre(own) - centre(mask)) * [1, 1, 1, 0]
        affine[2, 3] += shift
        nibabel.save(nibabel.Nifti1Image(image, affine), "ct.nii.gz")
        nodes = self.grid["vertices"][self.grid["depth"] > 3] * [-1, -1, 1]
        at = np.rint((nodes - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T).astype(int)
        at = at[((at >= 0) & (at < image.shape)).all(1)]
        said = run(self.supine, "deform", self.person + "_grid.st", "--posture", "prone:rest", "--image", "ct.nii.gz",
                   "--density", "-o", "moved.nii.gz", check=False)
        soft = re.search("soft tissue in the lungs: left ([0-9.]+) mL, right ([0-9.]+) mL", said)
        most = max(float(soft.group(k + 1)) / self.volumes[k] for k in (0, 1)) if soft else np.nan
        return (image[tuple(at.T)] > -300).mean(), most


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
        scans = [Scan(supine, copd, person) for person in people]
        for title, look in (("own CT", lambda s: [s.look(s.person)]),
                            ("own CT 12 mm off", lambda s: [s.look(s.person, shift=12)]),
                            ("own CT 30 mm off", lambda s: [s.look(s.person, shift=30)]),
                            ("own exhaled CT", lambda s: [s.look(s.person, "exp")]),
                            ("CT of others", lambda s: [s.look(p) for p in people if p != s.person])):
            airless, soft = zip(*sum(map(look, scans), []))
            show(title + ", without air", airless)
            show(title + ", soft tissue", soft)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
