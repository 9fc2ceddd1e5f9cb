#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Print the effects of posture and breathing on real lungs, beside published values.

    tests/evidence/evidence.py [--check] BUILD FOLDER[:AXES]...

BUILD is the folder of the build. FOLDER holds pairs NAME_left.* and NAME_right.* of closed surfaces at full
inflation, and may hold maps of their lobes, lobes_001.nii.gz for a NAME that ends in 001, whose volumes nobody
fitted. AXES, such as RAS, is passed to 'supine precompute --axes'. Every basis is made with default options.
There is a column for each pair. Columns differ because lungs have different shapes; they do not show the uncertainty
of the model. Only one constant, the curvature of the vertices' paths between rest and full inflation, was fitted to
data of this kind (quiet breaths of ten people). With --check, the exit code is 1 if a value is outside its range.
The exit code is 77 if there is no pair.
"""
import ctypes
import glob
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

POSTURES = ("supine", "prone", "left", "right", "upright", "inverted")
FULL_DENSITY = 0.12  # g/mL at full inflation: 0.86 L of tissue (Denison 1986) in lungs of 7.2 L

# Name of the quantity, lowest and highest value allowed (None: any), unit, published value.
ROWS = (
    ("lowest / uppermost third, supine", 1.65, 1.85, "", "1.75, supine (Sa 2010, n 8)"),
    ("lowest / uppermost third, prone", 1.1, 1.25, "", "1.0 to 1.4"),
    ("diaphragm's share (z), supine", 0.58, 0.76, "", "0.63 (SD 0.11; Aliverti 2001, n 10)"),
    ("diaphragm's share (z), prone", 0.53, 0.70, "", "0.535 (SD 0.13; Aliverti 2001)"),
    ("share of lower lung, left side", 51, 56, "%", "57.6 (SD 7.2; Volk 2011, n 10)"),
    ("share of lower lung, right side", 58, 65, "%", "64.7 (SD 6.7; Volk 2011)"),
    ("right lung at rest, left side", 21, 26, "%", "+25 (SD 11; Little 2021, n 10)"),
    ("left lung at rest, left side", -3, 1, "%", "0 (SD 44; Little 2021)"),
    ("left lung full, upright", 10, 12, "%", "+11.6 (Yamada 2020, n 32)"),
    ("right lung full, upright", 10, 12, "%", "+10.3 (Yamada 2020)"),
    ("both lungs at rest, upright", 12, 18, "%", "about +15 (Yamada 2020, n 100)"),
    ("left upper lobe full, upright", None, None, "%", "+7.1 (Yamada 2020, n 32)"),
    ("left lower lobe full, upright", None, None, "%", "+16.0 (Yamada 2020)"),
    ("right upper lobe full, upright", None, None, "%", "+8.6 (Yamada 2020)"),
    ("right middle lobe full, upright", None, None, "%", "about 0 (Yamada 2020): missed"),
    ("right lower lobe full, upright", None, None, "%", "+14.6 (Yamada 2020)"),
    ("right middle lobe at rest, upright", None, None, "%", "-16.3 (Yamada 2020, n 100): missed"),
    ("density, front third, prone", None, None, "g/mL", "+0.07 (Prisk 2007, n 6): missed"),
    ("density, back third, prone", None, None, "g/mL", "-0.11 (Prisk 2007): missed"),
    ("mean displacement to prone, rest", 6, 20, "mm", ""),
    ("lower half / upper third, to prone", 2, 10, "", "lesions move below the carina (Yankelevitz 1995)"),
    ("expansion of upper / lower lobes, supine", 0.61, 0.94, "", "0.61 to 0.94 (Shin 2020, n 56)"),
    ("expansion of upper / lower lobes, prone", 0.93, 1.06, "", "0.98 to 1.06 (Shin 2020, n 34)"),
    ("SD to upright at rest, left-right", None, 6.2, "mm", "at most 6.2 (MRI, AAPM 2021 abstract 58775, n not given)"),
    ("SD to upright at rest, front-back", None, 7.2, "mm", "at most 7.2 (AAPM 2021): probably too small here"),
    ("SD to upright at rest, head-feet", None, 9.9, "mm", "at most 9.9 (AAPM 2021): probably too small here"),
    ("stated error to upright at rest", None, None, "mm", ""),
    ("dome's motion in a breath, prone / supine", None, None, "", "0.75 (hepatic dome, n 9)"),
    ("diaphragm's motion, supine / upright", None, None, "", "above 1 at 15 of 18 points (Takazakura 2004, n 10)"),
    ("largest displacement, supine to side, rest", None, None, "mm",
     "up to 40, sliding up to 30 (Alvarez 2023, n 6): no sliding"),
    ("reversed triangles, at most", 0, 0, "%", ""),
    ("reversed triangles added by the bend", None, 2, "", ""),
)


class Slab(ctypes.Structure):
    """The struct supine_slab of supine/compare.h."""
    _fields_ = [("volume", ctypes.c_double), ("gain", ctypes.c_double)]


def take_package(build, folder):
    """Import the Python package from the sources, with the library of the build beside it."""
    source = pathlib.Path(__file__).resolve().parents[2] / "runtime" / "python" / "supine"
    package = folder / "supine"
    package.mkdir()
    for file in source.glob("*.py"):
        (package / file.name).symlink_to(file)
    (package / "libsupine_runtime.so").symlink_to((build / "runtime" / "libsupine_runtime.so").resolve())
    sys.path.insert(0, str(folder))
    import supine  # pylint: disable=import-outside-toplevel,import-error
    return supine


class Lungs:
    """A basis of one pair of lungs, and what is measured on it."""

    def __init__(self, supine, path):
        self.basis = supine.open(path)
        self.library = ctypes.CDLL(str(pathlib.Path(supine.__file__).parent / "libsupine_runtime.so"))
        self.faces = np.asarray(self.basis.faces).reshape(-1, 4)[:, 1:]
        self.owner = self.basis._owner.pointer  # pylint: disable=protected-access
        self.gravity = supine.gravity

    def at(self, state):
        """Return the positions of the vertices, mm, and the volume of each lung, mL, in a state."""
        pose = self.basis.pose(state)
        return self.basis.deform(pose), np.array(self.basis.volumes(pose))

    def area_vectors(self, xyz):
        a, b, c = (xyz[self.faces[:, i]].astype(float) for i in range(3))
        return np.cross(b - a, c - a) / 2

    def thirds(self, posture, before, after):
        """Return the volume at positions `before`, and its increase from `before` to `after`, mL, of both lungs
        together, in the upper, the middle and the lower third of their height."""
        slabs = (Slab * 6)()
        g = (ctypes.c_double * 3)(*self.gravity(posture))
        pointers = [ctypes.c_void_p(np.ascontiguousarray(x).ctypes.data) for x in (before, after)]
        if self.library.supine_compare_slabs(self.owner, g, *pointers, ctypes.c_size_t(3), slabs, None) != 0:
            raise RuntimeError("slabs")
        both = np.array([(s.volume, s.gain) for s in slabs]).reshape(2, 3, 2).sum(0)
        return both[:, 0], both[:, 1]

    def turned_over(self, xyz):
        return int((np.einsum("ij,ij->i", self.area_vectors(xyz), self.reference) < 0).sum())

    def straight(self, posture, total):
        """Return positions at `total` mL if the vertices moved on straight lines: multiply the displacements of a lung
        by one factor for all axes, such that each lung has the volume that the model gives it at `total` mL."""
        pose = self.basis.pose(f"{posture}:{total:.3f}mL")
        wanted = np.array(self.basis.volumes(pose))
        gains = self.basis.gains(pose)
        gains[:] = gains[:, :1]
        for _ in range(40):  # Newton's method, with a difference quotient as slope
            held = np.array(self.basis.volumes(pose))
            gains *= 1.0001
            slope = (np.array(self.basis.volumes(pose)) - held) / 1e-4
            gains *= ((1 + (wanted - held) / slope) / 1.0001)[:, None]
        return self.basis.deform(pose)

    def measure_turns(self, out, full, rest, after):
        """Add what imaging of several postures has shown.

        The published standard deviations include breathing and the error of registration, and are upper bounds. The
        diaphragm is where the surface faces the feet."""
        upright = rest["upright"][0] - rest["supine"][0]
        for axis, name in enumerate(("left-right", "front-back", "head-feet")):
            out[f"SD to upright at rest, {name}"] = upright[:, axis].std()
        sigma = np.asarray(self.basis.expected_error("upright:rest", since="supine:rest"))
        out["stated error to upright at rest"] = np.sqrt((sigma ** 2).mean())
        down = self.reference[:, 2] < -0.8 * np.linalg.norm(self.reference, axis=1)
        right = full[self.faces][:, :, 0].mean(1) < (full[:, 0].min() + full[:, 0].max()) / 2
        moved = {p: np.abs((after[p][0] - rest[p][0])[self.faces].mean(1)[:, 2])
                 for p in ("supine", "prone", "upright")}
        dome = down & right  # its highest quarter
        dome &= full[self.faces].mean(1)[:, 2] > np.quantile(full[self.faces].mean(1)[dome, 2], 0.75)
        out["dome's motion in a breath, prone / supine"] = moved["prone"][dome].mean() / moved["supine"][dome].mean()
        out["diaphragm's motion, supine / upright"] = moved["supine"][down].mean() / moved["upright"][down].mean()
        out["largest displacement, supine to side, rest"] = max(
            np.linalg.norm(rest[p][0] - rest["supine"][0], axis=1).max() for p in ("left", "right"))

    def measure(self):
        """Return the values of all quantities in ROWS, by name."""
        out = {}
        full, full_ml = self.at("supine:full")
        self.reference = self.area_vectors(full)
        breath = full_ml.sum() / 15
        rest = {p: self.at(f"{p}:rest") for p in POSTURES}
        after = {p: self.at(f"{p}:rest+{breath:.3f}") for p in POSTURES}
        for p in ("supine", "prone"):
            volume, gain = self.thirds(p, rest[p][0], after[p][0])
            out[f"lowest / uppermost third, {p}"] = gain[2] / volume[2] * volume[0] / gain[0]
            move = (after[p][0] - rest[p][0])[self.faces].mean(1)
            areas = (self.area_vectors(rest[p][0]) + self.area_vectors(after[p][0])) / 2
            flux = (move * areas).sum(0)
            out[f"diaphragm's share (z), {p}"] = flux[2] / flux.sum()
        for lung, side in enumerate(("left", "right")):
            gained = after[side][1] - rest[side][1]
            out[f"share of lower lung, {side} side"] = 100 * gained[lung] / gained.sum()
            out[f"{side} lung at rest, left side"] = 100 * (rest["left"][1][lung] / rest["supine"][1][lung] - 1)
            out[f"{side} lung full, upright"] = 100 * (self.at("upright:full")[1][lung] / full_ml[lung] - 1)
        out["both lungs at rest, upright"] = 100 * (rest["upright"][1].sum() / rest["supine"][1].sum() - 1)
        density = {}
        for p in ("supine", "prone"):  # density of the front, middle and back third of the lungs at rest
            volume, gain = self.thirds("supine", rest[p][0], full)
            density[p] = FULL_DENSITY * (volume + gain) / volume
        for name, third in (("front", 0), ("back", 2)):
            out[f"density, {name} third, prone"] = density["prone"][third] - density["supine"][third]
        move = np.linalg.norm(rest["prone"][0] - rest["supine"][0], axis=1)
        height = full[:, 2] - full[:, 2].min()
        height /= height.max()
        out["mean displacement to prone, rest"] = move.mean()
        out["lower half / upper third, to prone"] = move[height < 1 / 2].mean() / move[height > 2 / 3].mean()
        self.measure_turns(out, full, rest, after)
        over, more = 0, 0
        for p in POSTURES:
            for share in (0.3, 0.5, 0.7, 0.9, 1.1):
                total = share * full_ml.sum()
                bent = self.turned_over(self.at(f"{p}:{total:.3f}mL")[0])
                over = max(over, bent)
                more = max(more, bent - self.turned_over(self.straight(p, total)))
        out["reversed triangles, at most"] = 100 * over / len(self.faces)
        out["reversed triangles added by the bend"] = more
        return out


def lobes(program, path, folder):
    """Return the change of volume of the lobes of a label map (1, 2: left; 3, 4, 5: right) from supine to upright, %,
    and the expansion of the upper lobes from rest to full, divided by that of the lower ones."""
    def run(*words):
        return subprocess.run([program, *words], check=True, capture_output=True, text=True).stdout
    out = {}
    basis, inside = str(folder / "lobes.safetensors"), str(folder / "parts.safetensors")
    run("precompute", path, "--labels", "lobes", "--edge", "4", "--held-out", "20", "-o", basis)
    names = "1=left upper,2=left lower,3=right upper,4=right middle,5=right lower"
    run("embed", basis, path, "--labels", names, "-o", inside)

    def compared(postures):
        lists = json.loads(run("compare", inside, "--postures", postures, "--json"))
        return lists["targets"] + lists["anatomy"]

    for volume, words in (("full", "full"), ("rest", "at rest")):
        for row in compared(f"supine:{volume},upright:{volume}"):
            before, after = row.get("volume_before_ml"), row.get("volume_after_ml")
            if before is not None:  # the hilum has no volume
                out[f"{row['name']} lobe {words}, upright"] = 100 * (after / before - 1)
    for posture in ("supine", "prone"):
        ml = {row["name"]: (row.get("volume_before_ml"), row.get("volume_after_ml"))
              for row in compared(f"{posture}:rest,{posture}:full")}
        upper, lower = (sum(ml[f"{side} {part}"][1] for side in ("left", "right")) /
                        sum(ml[f"{side} {part}"][0] for side in ("left", "right")) for part in ("upper", "lower"))
        out[f"expansion of upper / lower lobes, {posture}"] = upper / lower
    return out


def pairs(argument):
    """Yield name, left file, right file and axes of each pair in `argument`, which is FOLDER or FOLDER:AXES."""
    folder, _, axes = argument.partition(":")
    for left in sorted(glob.glob(os.path.join(folder, "*_left.*"))):
        right = left.replace("_left.", "_right.")
        if os.path.exists(right):
            yield os.path.basename(left).partition("_left")[0], left, right, axes


def main(arguments):
    check = "--check" in arguments
    words = [word for word in arguments if word != "--check"]
    if len(words) < 2:
        print(__doc__, file=sys.stderr)
        return 1
    build = pathlib.Path(words[0])
    found = [pair for word in words[1:] for pair in pairs(word)]
    if not found:
        print("skipped: no pair NAME_left.* and NAME_right.* in " + ", ".join(words[1:]))
        return 77
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        supine = take_package(build, folder)
        columns = {}
        for title, left, right, axes in found:
            basis = str(folder / (title + ".safetensors"))
            subprocess.run([str(build / "supine"), "precompute", left, right, "-o", basis,
                            *(["--axes", axes] if axes else [])],
                           check=True, stdout=subprocess.DEVNULL)
            columns[title] = Lungs(supine, basis).measure()
            for path in glob.glob(os.path.join(os.path.dirname(left), f"lobes_{title[-3:]}.nii.gz")):
                columns[title] |= lobes(str(build / "supine"), path, folder)
    print("%-44s" % "" + "".join("%16s" % title for title in columns) + "  range          published")
    misses = 0
    for what, low, high, unit, published in ROWS:
        values = [column.get(what, float("nan")) for column in columns.values()]
        bad = [bool((low is not None and v < low) or (high is not None and v > high)) for v in values]
        misses += sum(bad)
        held = "shown" if high is None else f"{'' if low is None else low}..{high}"
        text = "".join("%16s" % ("-" if v != v else f"{v:.3g}" + "!" * int(b)) for v, b in zip(values, bad))
        print("%-44s%s  %-14s %s" % (what + (f", {unit}" if unit else ""), text, held, published))
    print(f"values outside their range (marked !): {misses}")
    return 1 if check and misses else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
