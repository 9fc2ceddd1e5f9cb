#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the error that each command states with the error that landmarks show.

    tests/evidence/error.py BUILD COPD QUIET [CASE]...

BUILD is the folder of the build. COPD holds scans of full breaths: label maps NAME_exp.nii.gz and NAME_insp.nii.gz,
and NAME.csv with matched landmarks, exhaled then inhaled. QUIET holds NAME.csv with landmarks at the end of
expiration and of inspiration of a quiet breath, without scans: the lungs are the landmarks of each side, closed by
30 mm. All in mm and LPS. Distances are RMS after the translation that fits best, but for 'locate', which finds it, and
relative to the hilum.
Of a fit to landmarks, whole cubes of 40 mm are held out, as 'fit' does; of one to surfaces too, single landmarks.

needed: the constant c of <supine/locate.h> at which the stated error is the true one, with the other terms as stated.
The last lines have, for each path, the median ratio of stated to true error, the geometric mean of the needed
constants and, leaving out each patient in turn, that of the others and the ratio that it gives. For fits of surfaces,
they also have the share of the squared motion of the surface that is along it, as the fit has it, and the ratio if the
logarithm of the constant were a line in this share. Exit code 77: no data.
"""
import csv
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np
from scipy import ndimage

from evidence import take_package

HELD, SEEN = 100, 10  # landmarks that are held out of a fit; landmarks that 'locate' sees


class Patient:
    """A folder of files for one patient, and the program that makes them."""

    def __init__(self, build, folder, pairs):
        self.program, self.folder = pathlib.Path(build) / "supine", pathlib.Path(folder)
        rows = list(csv.reader(open(pairs, encoding="utf-8")))
        self.exhaled, self.inhaled = np.array(rows[1:], float).reshape(-1, 2, 3).transpose(1, 0, 2)
        self.order = np.random.default_rng(7).permutation(len(self.exhaled))
        cube = np.unique(self.inhaled // 40, axis=0, return_inverse=True)[1].ravel()
        self.by_cube = np.argsort(np.random.default_rng(7).permutation(len(cube))[cube], kind="stable")

    def run(self, *arguments):
        done = subprocess.run([self.program, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{arguments[0]}: {done.stderr.strip().splitlines()[-1]}")
        return done.stdout

    def basis(self, scan, points, *options):
        """Make a basis of a scan and, in it, of points."""
        self.run("precompute", scan, "--edge", 6, "--held-out", 20, *options, "-o", "b.safetensors")
        self.write("points.csv", points)
        self.run("embed", "b.safetensors", "points.csv", "-o", "i.safetensors")

    def write(self, name, points, second=None):
        head = ["name", "x", "y", "z"] if second is None else ["x", "y", "z", "to_x", "to_y", "to_z"]
        rows = [[f"p{i}", *p] for i, p in enumerate(points)] if second is None else np.hstack([points, second])
        with open(self.folder / name, "w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([head, *rows])

    def read(self, name="o.csv"):
        rows = list(csv.DictReader(line for line in open(self.folder / name, encoding="utf-8") if line[0] != "#"))
        return (np.array([[float(r[k]) for k in "xyz"] for r in rows]),
                np.array([float(r["expected_error_mm"]) for r in rows]))

    def deform(self, state):
        self.run("deform", "i.safetensors", "--posture", "supine", "--volume", state, "-o", "o.csv")
        return self.read()


def judge(found, sigma, truth, points=slice(None), free=True):
    """Return the true and the stated RMS error, mm, and the share of points within 1.8 stated errors, %."""
    off = (found - truth)[points]
    off = np.linalg.norm(off - off.mean(0) * free, axis=1)
    return np.sqrt((off ** 2).mean()), np.sqrt((sigma[points] ** 2).mean()), 100 * (off <= 1.8 * sigma[points]).mean()


def hila(points, lung):
    """Return the middle of the hilum of each lung, at the box coordinates 0.175, 0.5 and 0.5 of <supine/locate.h>."""
    low, high = points.min(0) - 10, points.max(0) + 10
    middle = (points[lung == "left", 0].min() + points[lung == "right", 0].max()) / 2
    return {side: np.array([middle + 0.175 * (face - middle), *(low + high)[1:] / 2])
            for side, face in (("left", high[0]), ("right", low[0]))}


def relative(p, state):
    """Judge errors relative to the hilum. The truth there is the mean of ten landmarks nearest to the hilum of each
    lung.

    Fail if the nearer third of the landmarks is not stated better than the farther third."""
    p.run("deform", "i.safetensors", "--posture", "supine", "--volume", state, "-o", "body.csv")
    p.run("deform", "i.safetensors", "--posture", "supine", "--volume", state, "--frame", "hilum", "-o", "o.csv")
    body, sigma = p.read("body.csv")[0], p.read()[1]
    lines = (line for line in open(p.folder / "o.csv", encoding="utf-8") if line[0] != "#")
    lung = np.array([row["lung"] for row in csv.DictReader(lines)])
    off, away, there = body - p.exhaled, np.zeros(len(body)), []
    for side, hilum in hila(p.inhaled, lung).items():
        own = np.flatnonzero(lung == side)
        away[own] = np.linalg.norm(p.inhaled[own] - hilum, axis=1)
        there.append(off[own[np.argsort(away[own])[:10]]].mean(0))
    thirds = [np.sqrt((sigma[which] ** 2).mean())
              for which in (away < np.quantile(away, 1 / 3), away > np.quantile(away, 2 / 3))]
    if thirds[0] >= thirds[1]:
        raise RuntimeError("relative to the hilum, near landmarks are stated at %.1f mm, far ones at %.1f" %
                           tuple(thirds))
    return judge(off - np.mean(there, 0), sigma, np.zeros_like(off), free=False)


def along_surface(basis):
    """Return the share of the squared displacement of the surface, from the scan to full inflation, that is along
    it."""
    before, after = (np.asarray(basis.deform(basis.pose(state)), float) for state in ("supine:scan", "supine:full"))
    a, b, c = (before[np.asarray(basis.faces).reshape(-1, 4)[:, k]] for k in (1, 2, 3))
    moved = (after - before)[np.asarray(basis.faces).reshape(-1, 4)[:, 1:]].mean(1)
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    squares = (moved ** 2).sum(1)
    return 1 - ((moved * normal).sum(1) ** 2 / area).sum() / (squares * area).sum()


def print_by_share(share, need):
    """Print the ratios for a constant that depends on the share of the motion along the surface, leaving one out."""
    share, log = np.array(share), np.log(need)
    others = [np.arange(len(log)) != i for i in range(len(log))]
    lines = [np.polyfit(share[o], log[o], 1) for o in others]
    by_share = [np.polyval(line, at) for line, at in zip(lines, share)]
    constant = [log[o].mean() for o in others]
    print("surfaces: share of motion along them %s; ratio by this share %s; RMS of its logarithm %.2f, of a "
          "constant's %.2f" % (
        share.round(2), np.exp((by_share - log) / 2).round(2), *(np.sqrt(np.mean((np.array(x) - log) ** 2)) / 2
                                                                 for x in (by_share, constant))))


def full_breath(p, exp, insp):
    """Yield the path, the constant that was used, and what 'judge' returns, for each path of a full breath."""
    made = [p.run("precompute", scan, "--edge", 6, "--held-out", 20, "-o", "b.safetensors") for scan in (exp, insp)]
    volume = [sum(float(ml) for ml in re.findall(r"vertices: ([0-9.]+) mL", text)) for text in made]
    p.basis(insp, p.inhaled, "--resting", f"supine={volume[0]:.0f}mL")
    yield "law, hilum, rest given", 4.5, *relative(p, "rest")
    p.basis(insp, p.inhaled)
    yield "law", 4.5, *judge(*p.deform(f"{volume[0]:.0f}mL"), p.exhaled)
    yield "law, relative to the hilum", 4.5, *relative(p, f"{volume[0]:.0f}mL")
    seen, others = p.order[:SEEN], p.order[SEEN:]
    p.write("seen.csv", p.exhaled)
    lines = (p.folder / "seen.csv").read_text(encoding="utf-8").splitlines()
    (p.folder / "seen.csv").write_text("\n".join([lines[0], *(lines[1 + i] for i in seen)]), encoding="utf-8")
    p.run("locate", "b.safetensors", "seen.csv", "--points", "i.safetensors", "--posture", "supine", "-o", "o.csv")
    yield "locate", 4.5, *judge(*p.read(), p.exhaled, others, False)
    states = ["--rest", "supine:rest", "--other", "supine:full"]
    alone = ["--translation", "--rest", f"{volume[0]:.0f}mL", "--other", f"{volume[1]:.0f}mL"]
    for path, options, points, order in (
            ("surfaces", [exp, insp, *states], slice(None), p.order),
            ("surfaces and landmarks", [exp, insp, "--landmarks", "fitted.csv", *states], p.order[:HELD], p.order),
            ("landmarks", ["--landmarks", "fitted.csv", *alone], p.by_cube[:HELD], p.by_cube)):
        fitted = np.sort(order[HELD:])
        p.write("fitted.csv", p.exhaled[fitted], p.inhaled[fitted])
        record = p.run("fit", *options, "--json", "-o", "p.json")
        p.basis(exp, p.exhaled, "--patient", "p.json")
        constant = float(record.split('"expected_constant_mm":')[1].split(",")[0])
        if path == "surfaces":
            p.share = along_surface(p.package.open(str(p.folder / "b.safetensors")))
        yield path, constant, *judge(*p.deform("full"), p.inhaled, points)


def quiet_breath(p):
    """Yield the same for the law alone in a quiet breath. Its volume is chosen by the landmarks."""
    low = p.exhaled.min(0) - 45
    at = np.round((p.exhaled - low) / 3).astype(int)
    labels = np.zeros(at.max(0) + 16, np.uint8)
    middle = 0.5 * (p.exhaled[:, 0].min() + p.exhaled[:, 0].max())
    for label, side in ((1, p.exhaled[:, 0] > middle), (2, p.exhaled[:, 0] <= middle)):
        empty = np.ones(labels.shape, bool)
        empty[tuple(at[side].T)] = False
        within = ndimage.distance_transform_edt(empty, sampling=3) <= 30
        labels[(ndimage.distance_transform_edt(within, sampling=3) > 25) & (labels == 0)] = label
    header = ("NRRD0004\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\nsizes: %d %d %d\nspace directions: "
              "(3,0,0) (0,3,0) (0,0,3)\nspace origin: (%g,%g,%g)\nencoding: raw\nendian: little\n\n")
    (p.folder / "m.nrrd").write_bytes((header % (*labels.shape, *low)).encode() + labels.tobytes(order="F"))
    p.basis("m.nrrd", p.exhaled, "--scanned", "supine:rest")
    spread = lambda x: np.sqrt(((x - x.mean(0)) ** 2).sum(1).mean())
    best = min(range(50, 1600, 50), key=lambda ml: spread(p.deform(f"rest+{ml}")[0] - p.inhaled))
    yield "quiet breath", 4.5, *judge(*p.deform(f"rest+{best}"), p.inhaled)


def main():
    build, copd, quiet, *cases = (pathlib.Path(a) for a in sys.argv[1:])
    paths, shares = {}, []
    imported = tempfile.TemporaryDirectory()  # pylint: disable=consider-using-with
    package = take_package(build, pathlib.Path(imported.name))
    for folder, way in ((copd, full_breath), (quiet, quiet_breath)):
        for pairs in sorted(folder.glob("*.csv")):
            if cases and pathlib.Path(pairs.stem) not in cases:
                continue
            with tempfile.TemporaryDirectory() as work:
                scans = [pairs.with_name(f"{pairs.stem}_{k}.nii.gz").resolve() for k in ("exp", "insp")]
                patient = Patient(build.resolve(), work, pairs)
                patient.package = package
                for path, c, *row in way(patient, *(scans if way is full_breath else [])):
                    paths.setdefault(path, []).append((c, *row, c * (row[0] / row[1]) ** 2))
                    print("%-26s %-8s true %5.1f stated %5.1f mm, within the band %3.0f %%, needed %.1f mm of %.1f"
                          % (path, pairs.stem, *row, paths[path][-1][4], c), flush=True)
                if way is full_breath:
                    shares.append(patient.share)
    for path, rows in paths.items():
        c, true, stated, _, need = np.array(rows).T
        other = [np.exp(np.log(np.delete(need, i)).mean()) for i in range(len(need))] if len(need) > 1 else [np.nan]
        print("%-26s stated / true %.2f (%.2f to %.2f); needed %.1f; of the others %s, ratio %s" % (
            path, np.median(stated / true), (stated / true).min(), (stated / true).max(), np.exp(np.log(need).mean()),
            np.round(other, 1), np.round(np.sqrt(other / need), 2)))
    if len(shares) > 3:
        print_by_share(shares, [row[4] for row in paths["surfaces"]])
    sys.exit(0 if paths else 77)


if __name__ == "__main__":
    main()
