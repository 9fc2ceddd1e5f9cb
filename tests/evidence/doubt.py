# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare what the random field of the expected error (<supine/doubt.h>) states with the truth, on people with COPD.

    doubt.py PROGRAM PACKAGE DATA       PACKAGE: folder with the Python package supine and its library
                                        DATA: folder with caseNN_insp.nii.gz, caseNN_exp.nii.gz and caseNN.csv (DIR-Lab)

Each basis is made of the inhaled scan by the default law, with default options, and deformed to the volume of the
exhaled scan. Landmarks give the truth, after the best translation, as that between the scans has no meaning. For each
person and over all: the stated over the true RMS error of distances of two points, by distance, beside that for
independent errors; and of the landmarks after a rigid registration at six of them, drawn nine times (not within 50 mm
of a plane's direction, as in a tree of airways). After a fit of half of the landmarks, the rank correlation of the
true with the stated errors of the others, and the ratio of their RMS."""
import glob
import os
import subprocess
import sys
import tempfile

import nibabel
import numpy as np

program, package, data = sys.argv[1:4]
sys.path.insert(0, package)
import supine  # noqa: E402  pylint: disable=import-error,wrong-import-position

BANDS = ((10, 20), (20, 40), (40, 60), (60, 100), (100, 160))


def rms(x):
    return float(np.sqrt(np.mean(x)))


def rigid(a, b):
    """Return the rotation and translation that move points a to points b best."""
    u, _, v = np.linalg.svd((a - a.mean(0)).T @ (b - b.mean(0)))
    turn = (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v).T
    return turn, b.mean(0) - turn @ a.mean(0)


def person(case, folder):
    """Return the sums of true, stated and independently stated squares by distance, and true and stated squares of
    targets."""
    marks = np.genfromtxt(f"{case}.csv", delimiter=",", skip_header=1)
    out, inhaled = marks[:, :3], marks[:, 3:]
    scan = nibabel.load(f"{case}_exp.nii.gz")
    volume = (np.asanyarray(scan.dataobj) > 0).sum() * abs(np.linalg.det(scan.affine[:3, :3])) / 1000
    basis = os.path.join(folder, "lungs.safetensors")
    subprocess.run([program, "precompute", f"{case}_insp.nii.gz", "--held-out", "20", "-o", basis], check=True,
                   capture_output=True)
    inside = supine.embed(supine.open(basis), {f"p{i}": place for i, place in enumerate(inhaled)})
    order = [inside.points[f"p{i}"] for i in range(len(inhaled))]
    mean, covariance = inside.covariance(order, f"supine:{volume:.0f}mL")
    mean, covariance = mean[0], covariance[0, :, :, 0]
    single = np.einsum("ikik->i", covariance)
    pair = np.einsum("ikjk->ij", covariance)
    error = mean - out
    i, j = np.triu_indices(len(out), 1)
    far = np.linalg.norm(inhaled[i] - inhaled[j], axis=1)
    true, stated = ((error[i] - error[j]) ** 2).sum(1), single[i] + single[j] - 2 * pair[i, j]
    distances = []
    for low, high in BANDS:
        k = (far >= low) & (far < high)
        distances.append((true[k].sum(), stated[k].sum(), (single[i] + single[j])[k].sum()))
    random, targets = np.random.default_rng(int(case[-2:])), []
    while len(targets) < 9:
        six = random.choice(len(out), 6, replace=False)
        if np.linalg.svd(inhaled[six] - inhaled[six].mean(0))[1][2] >= 50:
            turn, shift = rigid(out[six], mean[six])
            rest = np.setdiff1d(np.arange(len(out)), six)
            after = inside.registration(f"supine:{volume:.0f}mL", [order[f] for f in six])[2][order].astype(float)
            targets.append((((mean - out @ turn.T - shift) ** 2).sum(1)[rest], after[rest] ** 2))
    return np.array(distances), np.concatenate([t for t, _ in targets]), np.concatenate([s for _, s in targets])


def ranks(x):
    return np.argsort(np.argsort(x)).astype(float)


def local(case, folder):
    """Fit half of the landmarks, in blocks of 40 mm, and both surfaces. Return, of the other half, the rank correlation
    of the true with the stated error of a basis of the exhaled scan at full inflation, and the stated over the true
    RMS."""
    marks = np.genfromtxt(f"{case}.csv", delimiter=",", skip_header=1)
    out, inhaled = marks[:, :3], marks[:, 3:]
    block = np.unique(out // 40, axis=0, return_inverse=True)[1].ravel()
    shuffled = np.random.default_rng(int(case[-2:])).permutation(block.max() + 1)
    order = np.argsort(shuffled[block], kind="stable")
    held, fitted = order[:len(order) // 2], np.sort(order[len(order) // 2:])
    pairs, patient, basis = (os.path.join(folder, name) for name in ("pairs.csv", "patient.json", "fit.safetensors"))
    np.savetxt(pairs, marks[fitted], delimiter=",", fmt="%.4f", header="x,y,z,to_x,to_y,to_z", comments="")
    exhaled = f"{case}_exp.nii.gz"
    inhaled_scan = f"{case}_insp.nii.gz"
    for arguments in (("fit", exhaled, inhaled_scan, "--other", "supine:full", "--landmarks", pairs, "-o", patient),
                      ("precompute", exhaled, "--patient", patient, "--edge", "5", "--held-out", "20", "-o", basis)):
        subprocess.run([program, *arguments], check=True, capture_output=True)
    inside = supine.embed(supine.open(basis), {f"p{i}": place for i, place in enumerate(out)})
    vertices = [inside.points[f"p{i}"] for i in held]
    error = inside.deform(inside.pose("supine:full"))[vertices] - inhaled[held]
    true = np.linalg.norm(error - error.mean(0), axis=1)
    stated = inside.expected_error("supine:full")[vertices].astype(float)
    return np.corrcoef(ranks(true), ranks(stated))[0, 1], rms(stated ** 2) / rms(true ** 2)


def main():
    sums, all_targets = [], []
    for case in sorted(path[:-4] for path in glob.glob(os.path.join(data, "case*.csv"))):
        with tempfile.TemporaryDirectory() as folder:
            distances, true, stated = person(case, folder)
            rank, ratio = local(case, folder)
        sums.append(distances)
        all_targets.append((true.mean(), stated.mean()))
        print(f"{os.path.basename(case)}: distances {' '.join(f'{np.sqrt(s / t):.2f}' for t, s, _ in distances)}; "
              f"registration at six "
              f"points: true {rms(true):.1f} mm, stated {rms(stated):.1f} mm, ratio {rms(stated) / rms(true):.2f}; "
              f"after a fit of half of the landmarks: rank correlation {rank:.2f}, ratio {ratio:.2f}",
              flush=True)
    total = np.sum(sums, axis=0)
    print("all: distances of", ", ".join(f"{low} to {high} mm {np.sqrt(s / t):.2f} (independent {np.sqrt(x / t):.1f})"
                                         for (low, high), (t, s, x) in zip(BANDS, total)))
    true, stated = np.mean(all_targets, axis=0)
    print(f"all: registration {np.sqrt(stated / true):.2f}")


main()
