#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Carry the dose in several states of the lungs to the CT that was planned on, and add it up. Not for treatment.

    python3 dose.py GRID CT STATES FOLDER [--dose FILE]

GRID is a basis that 'supine embed --grid' made for CT. STATES is a CSV file with a row for each state: posture, volume,
weight (its share of the time; the shares sum to 1), dose (an image of the dose in this state, relative to STATES), and
sample, as for 'supine deform --states'. --dose is for rows without a dose: one image, which stays in the room while the
lungs move through it (a static cloud). FOLDER, which must not exist, gets

    mean.nii.gz     the sum of all doses, each times its weight, on the voxels of CT; NaN outside the lungs
    spread.nii.gz   the standard deviation of the dose between the states
    states.csv      for each state the mean dose of the lungs; the energy carried from the aerated tissue, divided by
                    that in the state; the share of the lungs outside the image of the dose, which counts as 0

Dose is carried with the tissue's mass: a voxel of CT gets the mean over eight points of its tissue, wherever these
move. Energy is then kept as far as the densities of the moved CT keep mass ('supine deform --density'). Adding doses
voxel by voxel, without regard to mass, would not keep it. The program is $SUPINE (default: supine). Also needed: numpy
and nibabel (Debian: python3-nibabel)."""
import argparse
import csv
import os
import sys
import tempfile
import zlib
from itertools import product
from pathlib import Path

from whole import check_new, new_folder, run

try:
    import nibabel
    import numpy as np
except ImportError as error:
    sys.exit(f"{error}: apt-get install python3-nibabel, and run this with /usr/bin/python3")

OUTSIDE_MOST = 0.25  # of the lungs; beyond, the image is in another frame, or of another part of the body
AERATED = -300       # HU; what is denser, at the rim of the lungs, may be the chest wall, which does not move with them


def read(path):
    """Return the numbers of an image [x, y, z] and its affine map from voxels to mm."""
    try:
        image = nibabel.load(path)
        values = np.asarray(image.dataobj, np.float32)
    except (OSError, EOFError, ValueError, zlib.error, nibabel.filebasedimages.ImageFileError) as error:
        sys.exit(f"{path}: {error}: give a whole image")
    return values.reshape(image.shape[:3] + image.shape[4:]), image.affine


def sample(values, affine, points):
    """Interpolate an image at points [N, 3], mm. Return the values, and which points lie in the image."""
    last = np.array(values.shape[:3]) - 1
    place = (points - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T
    inside = ((place >= -0.5) & (place <= last + 0.5)).all(axis=1)
    place = np.clip(place, 0, last)
    low = np.minimum(place.astype(int), np.maximum(last - 1, 0))
    share = place - low
    found = 0
    for corner in product((0, 1), repeat=3):
        at = np.minimum(low + corner, last)
        weight = np.where(corner, share, 1 - share).prod(axis=1)
        found = found + (values[tuple(at.T)].T * weight).T
    return found, inside


def rows_of(path, dose):
    """Return the rows of the list of states, checked."""
    with open(path, encoding="utf-8-sig", newline="") as file:
        rows = list(csv.DictReader(file))
    for line, row in enumerate(rows, start=2):
        named = row.get("dose") or ""
        row["dose"] = path.parent / named if named else dose
        if not row.get("posture") or row["dose"] is None:
            sys.exit(f"{path}:{line}: give a posture, and a dose here or by --dose")
        try:
            row["weight"] = float(row.get("weight") or 1 / len(rows))
        except ValueError:
            sys.exit(f"{path}:{line}: weight '{row['weight']}': give a share, such as 0.1")
        if not row["weight"] > 0:
            sys.exit(f"{path}:{line}: weight {row['weight']:g}: give a share above 0")
    total = sum(row["weight"] for row in rows)
    if not abs(total - 1) <= 1e-3:
        sys.exit(f"{path}: the weights sum to {total:g}: give shares of the time, which sum to 1")
    return rows


def deform(wanted, *options):
    run(os.environ.get("SUPINE", "supine"), "deform", wanted.grid, "--image", wanted.ct, *options)


def move(work, wanted, rows, ct):
    """Let the program write CT, aerated tissue and field of each state; return where the lungs are in CT."""
    deform(wanted, "--quiet", "--posture", "supine", "--volume", "scan", "--ventilation", work / "scan.nii.gz")
    values, affine = read(work / "scan.nii.gz")
    lungs = ~np.isnan(values)
    aerated = lungs & (ct < AERATED)
    nibabel.save(nibabel.Nifti1Image(aerated.astype(np.uint8), affine), work / "aerated.nii.gz")
    columns = ("posture", "volume", "sample")
    with open(work / "states.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow((*columns, "output", "labels", "field"))
        for i, row in enumerate(rows):
            table.writerow([row.get(name) or "" for name in columns] +
                           [f"ct{i}.nii.gz", f"aerated{i}.nii.gz", f"field{i}.nii.gz"])
    deform(wanted, "--states", work / "states.csv", "--density", "--labels", work / "aerated.nii.gz")
    return lungs


def mass(ct, affine):
    """Return the mass of each voxel of a CT, g."""
    return np.maximum(ct + 1000, 0) * 1e-6 * abs(np.linalg.det(affine[:3, :3]))


def carry(dose, field, voxels, affine):
    """Return the dose that voxels [N, 3] of CT get in a state, and the share of them that lies in the dose's image."""
    displacement, field_affine = field
    total = inside = 0
    for corner in product((-0.25, 0.25), repeat=3):
        points = (voxels + corner) @ affine[:3, :3].T + affine[:3, 3]
        moves = sample(displacement, field_affine, points)[0] * [-1, -1, 1]  # of ITK (LPS) in the axes of NIfTI
        values, known = sample(*dose, points + moves)
        total, inside = total + np.where(known, values, 0) / 8, inside + known / 8
    return total, inside.mean()


def energy_in_state(dose, work, i):
    """Return the energy of a dose in the aerated tissue of the moved lungs, mJ if the dose is in Gy."""
    ct, affine = read(work / f"ct{i}.nii.gz")
    aerated = np.argwhere(read(work / f"aerated{i}.nii.gz")[0] > 0)
    values, known = sample(*dose, aerated @ affine[:3, :3].T + affine[:3, 3])
    return float((np.where(known, values, 0) * mass(ct, affine)[tuple(aerated.T)]).sum())


def add_up(work, rows, lungs, ct, affine):
    """Return mean and standard deviation of the dose between the states; add to the rows what is known of each."""
    where = np.argwhere(lungs)
    held = mass(ct, affine)[lungs]
    aerated = ct[lungs] < AERATED
    first = second = np.zeros(len(where))
    for i, row in enumerate(rows):
        dose = read(row["dose"])
        if dose[0].ndim != 3 or not np.isfinite(dose[0]).all() or dose[0].min() < 0:
            sys.exit(f"{row['dose']}: a dose is one number a voxel, finite and not below 0")
        found, inside = carry(dose, read(work / f"field{i}.nii.gz"), where, affine)
        row["outside"] = 1 - inside
        if row["outside"] > OUTSIDE_MOST:
            sys.exit(f"{row['dose']}: {100 * row['outside']:.0f} % of the lungs lie outside it: give the dose in the "
                     "frame of the CT")
        energy = energy_in_state(dose, work, i)
        row["energy_kept"] = float((found * held)[aerated].sum()) / energy if energy > 0 else float("nan")
        row["mean_dose"] = float((found * held).sum() / held.sum())
        print(f"{row['posture']} {row.get('volume') or ''}: mean {row['mean_dose']:.4g}, energy kept to "
              f"{100 * (row['energy_kept'] - 1):+.2f} %, {100 * row['outside']:.2g} % of the lungs outside the dose",
              flush=True)
        first = first + row["weight"] * found
        second = second + row["weight"] * found**2
    return first, np.sqrt(np.maximum(second - first**2, 0))


def fill(folder, wanted, rows):
    with tempfile.TemporaryDirectory(dir=folder.parent) as work:
        ct, affine = read(wanted.ct)
        lungs = move(Path(work), wanted, rows, ct)
        for name, values in zip(("mean", "spread"), add_up(Path(work), rows, lungs, ct, affine)):
            image = np.full(ct.shape, np.nan, np.float32)
            image[lungs] = values
            nibabel.save(nibabel.Nifti1Image(image, affine), folder / f"{name}.nii.gz")
    names = ("posture", "volume", "sample", "weight", "dose", "mean_dose", "energy_kept", "outside")
    with open(folder / "states.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, names, restval="", extrasaction="ignore")
        table.writeheader()
        table.writerows(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("grid", "ct", "states", "folder"):
        parser.add_argument(name, type=Path, metavar=name.upper())
    parser.add_argument("--dose", type=Path, help="dose that stays in the room, for rows without one")
    wanted = parser.parse_args()
    check_new(wanted.folder)
    if not wanted.states.is_file():
        sys.exit(f"{wanted.states}: no such file: give a list of states")
    rows = rows_of(wanted.states, wanted.dose)
    with new_folder(wanted.folder) as folder:
        fill(folder, wanted, rows)


if __name__ == "__main__":
    main()
