#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Print the figures on which the checks of another simulator's fields rest (docs/inputs.md, group Fields).

    tests/evidence/fields.py BUILD MAP...

BUILD is the folder of the build, each MAP a label map of a person's lungs at full inflation. The default law stands for the
simulator: the displacements from full inflation to rest, and from supine to other postures at rest, in several plans of
directions. Each plan is fitted as `precompute --fields` fits it. Then caps of the sphere are left empty, and the error that
is found in 150 other directions is divided by the leave-one-out error that would be stated."""
import os
import pathlib
import sys
import tempfile

import numpy as np

from evidence import take_package

POINTS = 300  # vertices that are compared
FINE = 5000  # directions in which the gap is looked for


def even(count):
    i = np.arange(count)
    z = 1 - (2 * i + 1) / count
    r, t = np.sqrt(1 - z * z), i * np.pi * (3 - 5 ** 0.5)
    return np.column_stack([r * np.cos(t), r * np.sin(t), z])


def products(band, g):
    """Products of the coordinates that span the harmonics to a band."""
    return np.array([g[:, 0] ** i * g[:, 1] ** j * g[:, 2] ** (d - i - j)
                     for d in ({band, band - 1} if band > 0 else {0}) for i in range(d + 1) for j in range(d + 1 - i)]).T


# For each band, what makes the products orthonormal over the sphere, as harmonics are.
SCALES = [np.linalg.inv(np.linalg.qr(products(band, even(FINE)))[1]) for band in range(6)]


def terms(band, g):
    return products(band, g) @ SCALES[band]


def condition(g):
    return np.linalg.cond(terms(1, g))


def gap(g):
    return np.degrees(np.arccos(np.clip((even(FINE) @ g.T).max(1).min(), -1, 1)))


def fit(g, u):
    """Return the chosen band, the leave-one-out error of each band, and the errors of the runs in the chosen one."""
    chosen, errors, runs = 0, [], None
    for band in range(6):
        a = terms(band, g)
        if a.shape[1] >= len(g) or np.linalg.cond(a) > 100:
            break
        hat = a @ np.linalg.pinv(a)
        if (1 - np.diag(hat)).min() < 1e-3:
            break
        left = (u - hat @ u) / (1 - np.diag(hat))[:, None]
        errors.append(np.sqrt((left ** 2).sum() / (u ** 2).sum()))
        if band == 0 or errors[band] < 0.99 * errors[chosen]:
            chosen, runs = band, np.sqrt((left ** 2).mean(1))
    return chosen, errors, runs


def displacement(basis, g, origin, step):
    return np.array([basis.deform(basis.pose(tuple(x), "rest")).astype(float)[::step] - origin for x in g])


def spread(x):
    return np.sqrt(((x - x.mean(-2, keepdims=True)) ** 2).sum(-1).mean())


def right(basis, step, plans, rng):
    """Return a row for each plan: left out, of shuffled rows, spread, RMS, largest run, worst run; from full and between postures."""
    full, supine = basis.vertices.astype(float)[::step], basis.deform(basis.pose("supine:rest")).astype(float)[::step]
    rows = []
    for origin in (full, supine):
        for g in plans:
            u = displacement(basis, g, origin, step)
            sizes, flat = np.sort(np.sqrt((u ** 2).sum(2).mean(1))), u.reshape(len(g), -1)
            part = lambda e: min(e) / min(1, e[0])
            _, errors, runs = fit(g, flat)
            shuffled = part(fit(g[rng.permutation(len(g))], flat)[1])
            rows.append((part(errors), shuffled, spread(u) / spread(origin), np.sqrt((sizes ** 2).mean()),
                         sizes[-1] / sizes[-2], runs.max() / np.median(runs)))
    return rows


def caps(basis, step):
    """Return rows: angle left empty, gap, condition, found error, found / stated."""
    origin = basis.deform(basis.pose("supine:rest")).astype(float)[::step]
    others = even(150)
    truth = displacement(basis, others, origin, step).reshape(150, -1)
    rows = []
    for angle in range(0, 130, 10):
        for centre in np.array([[0, 1, 0], [0, -1, 0], [1, 0, 0], [0, 0, 1]]):
            for count in (20, 60):
                g = even(int(2 * count / (1 + np.cos(np.radians(angle)))))
                g = g[g @ centre < np.cos(np.radians(angle)) + 1e-9]
                u = displacement(basis, g, origin, step).reshape(len(g), -1)
                band, errors, _ = fit(g, u)
                found = truth - terms(band, others) @ (np.linalg.pinv(terms(band, g)) @ u)
                found = np.sqrt((found ** 2).sum() / (truth ** 2).sum())
                rows.append((angle, gap(g), condition(g), found, found / errors[band]))
    return rows


def main():
    build = pathlib.Path(sys.argv[1]).resolve()
    os.environ["PATH"] = str(build) + os.pathsep + os.environ["PATH"]
    with tempfile.TemporaryDirectory() as folder:
        measure(take_package(build, pathlib.Path(folder)), sys.argv[2:])


def measure(package, paths):
    rng = np.random.default_rng(5)
    draw = lambda n: (lambda g: g / np.linalg.norm(g, axis=1)[:, None])(rng.normal(size=(n, 3)))
    plans = {f"even {n}": even(n) for n in (6, 8, 10, 12, 16, 20, 32, 40)}
    plans |= {f"random {n}, {k}": draw(n) for n in (8, 12, 20, 40) for k in range(3)}
    plans["six axes"] = np.concatenate([np.eye(3), -np.eye(3)])
    measured, empty = [], []
    for path in paths:
        basis = package.precompute(path, edge=10, held_out=20)
        step = max(1, basis.vertex_count // POINTS)
        measured.append(right(basis, step, plans.values(), rng))
        empty += caps(basis, step)
    measured = np.array(measured).reshape(len(measured), 2, len(plans), 6)
    print(f"{'directions':14} {'gap':>4} {'condition':>9} {'left out':>8} {'shuffled':>8} {'spread':>6} {'RMS, mm':>7} {'largest':>7} {'worst':>6}")
    for i, (name, g) in enumerate(plans.items()):
        m, least = measured[:, :, i].max((0, 1)), measured[:, :, i].min((0, 1))
        print(f"{name:14} {gap(g):4.0f} {condition(g):9.1f} {m[0]:8.2f} {least[1]:8.2f} {m[2]:6.2f} {least[3]:7.1f} {m[4]:7.2f} {m[5]:6.1f}")
    print("\ncap left empty, degrees; gap; condition; found error, median and most; found / stated, median and most")
    for angle in sorted({row[0] for row in empty}):
        r = np.array([row for row in empty if row[0] == angle])
        print(f"{angle:4.0f} {r[:, 1].max():6.0f} {r[:, 2].max():6.1f} {np.median(r[:, 3]):8.3f} {r[:, 3].max():6.3f} "
              f"{np.median(r[:, 4]):7.1f} {r[:, 4].max():5.1f}")


if __name__ == "__main__":
    main()
