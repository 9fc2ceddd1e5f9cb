#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Print the figures on which the checks of another simulator's fields rest (docs/inputs.md, group Fields).

    tests/evidence/fields.py BUILD [--sets] MAP...

BUILD is the folder of the build, each MAP a label map of a person's lungs at full inflation. The default law stands for
the simulator: the displacements from full inflation to rest, and from supine to other postures at rest, in several
plans of directions. Each plan is fitted as `precompute --fields` fits it. Then caps of the sphere are left empty, and
the error that is found in 150 other directions is divided by the leave-one-out error that would be stated.

Last, or alone with --sets, bases are made of right sets without each fifth of their directions. The errors that they
state are compared with those found in states drawn between the runs, and in the directions that are left out, which lie
in the middle of the holes of the plan, for all vertices and for each. Then right sets and the same sets made wrong are
measured as the checks of runs, points, units and axes measure them: the law of each map (at rest from two origins, and
at five volumes), formulas on its surface (nonlinear in gravity and volume, one of them with a lung that opens late),
and CalculiX where it is installed (tests/evidence/fem.py). The limits of these checks, and how stated errors follow
from the runs, were chosen on these sets, but for the last two of CalculiX."""
import itertools
import os
import pathlib
import shutil
import sys
import tempfile
import warnings

import numpy as np

from evidence import take_package

POINTS = 300  # vertices that are compared
FINE = 5000  # directions in which the gap is looked for
DRAWN = 60  # states between the runs


def even(count):
    i = np.arange(count)
    z = 1 - (2 * i + 1) / count
    r, t = np.sqrt(1 - z * z), i * np.pi * (3 - 5 ** 0.5)
    return np.column_stack([r * np.cos(t), r * np.sin(t), z])


def products(band, g):
    """Products of the coordinates that span the harmonics to a band."""
    return np.array([g[:, 0] ** i * g[:, 1] ** j * g[:, 2] ** (d - i - j)
                     for d in ({band, band - 1} if band > 0 else {0}) for i in range(d + 1)
                     for j in range(d + 1 - i)]).T


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
    """Return a row for each plan: left out, of shuffled rows, spread, RMS, largest run, worst run; from full and
    between postures."""
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


class Set:
    """Fields of a simulator: plan [M, 4] has a direction and a filling in each row, u [M, N, 3] the displacements,
    which law(row) computes for any row."""

    def __init__(self, name, points, faces, plan, law, u=None):
        self.name, self.points, self.faces, self.law = name, points, faces, law
        self.plan = np.asarray(plan, float)
        self.u = np.asarray([law(row) for row in self.plan] if u is None else u, float)


def grid(directions, volumes):
    return np.array([[*g, s] for g in even(directions) for s in np.linspace(0, 1, volumes)])


def formula_sets(points, faces):
    """Return sets whose displacements are formulas: lungs that sag, and one lung that opens late."""
    left = points[:, 0] > points[:, 0].mean()
    place = np.where(left[:, None], points - points[left].mean(0), points - points[~left].mean(0)) / 100

    def sag(g, s):
        along = place @ g
        return ((1 - 0.6 * s) * ((7 - 3 * (place ** 2).sum(1))[:, None] * g + 3 * np.tanh(along)[:, None] * place)
                + 16 * s * place + 4 * s * s * place[:, 2:] ** 2 * [0, 0, -1])

    def compress(g, s):
        along = place @ g
        return (8 * (1.2 - s / 2) * (1 - 0.3 * (place ** 2).sum(1))[:, None] * g - 3 * (along ** 2)[:, None] * g
                - 1.5 * np.tanh(2 * along)[:, None] * place + 20 * (s - 1) * place)

    def late(g, s):
        filled = np.where(left, s, 1.15 * s ** 3 / (s ** 3 + 0.15)) * (1 + 0.12 * g[1] ** 3) + 0.06 * g[1] ** 3
        return sag(g, 0) + (14 * filled - 8)[:, None] * place

    plans = [("sags, 24", sag, grid(24, 1)), ("sags, 32 x 4", sag, grid(32, 4)),
             ("compresses, 24 x 4", compress, grid(24, 4)), ("opens late, 24 x 6", late, grid(24, 6))]
    return [Set(name, points, faces, plan, lambda row, law=law: law(row[:3], row[3])) for name, law, plan in plans]


def law_sets(package, path):
    """Return the law of a person at rest, from supine and from full inflation, and at five volumes."""
    basis = package.precompute(path, edge=12, held_out=20)
    at = lambda g, volume: basis.deform(basis.pose(tuple(g), volume)).astype(float)
    faces, supine = np.array(basis.triangles), at((0, 1, 0), "scan")
    full, name = basis.vertices.astype(float), pathlib.Path(path).name.split(".")[0]
    return [Set(f"{name}, rest", supine, faces, grid(24, 1), lambda row: at(row[:3], "rest") - supine),
            Set(f"{name}, from full", full, faces, grid(24, 1), lambda row: at(row[:3], "rest") - full),
            Set(f"{name}, 24 x 5", supine, faces, grid(24, 5),
                lambda row: at(row[:3], f"rest+{1500 * row[3]:.0f}") - supine)]


def calculix_sets(build, vertices=800):
    """Yield the sets that CalculiX computes (fem.py)."""
    import fem
    points, faces = fem.surface(str(build / "supine"), vertices)
    density = fem.DENSITY
    for law, heavy, plan in (("linear", 1, grid(32, 1)), ("neo-Hookean", 1, grid(32, 1)),
                             ("neo-Hookean", 1, grid(24, 6)), ("neo-Hookean", 1.6, grid(40, 1)),
                             ("neo-Hookean", 1.6, grid(16, 5))):
        fem.DENSITY = heavy * density
        deck, pressure = fem.Deck(points, faces, law), fem.PRESSURE if np.ptp(plan[:, 3]) > 0 else 0
        solve = lambda row, deck=deck, pressure=pressure: deck.solve("run", row[:3], pressure * row[3])[0]
        yield Set(f"CalculiX, {law}{', heavy' if heavy > 1 else ''}, {len(plan)}", points, faces, plan, solve)


def gravity_part(given):
    """Displacements minus their mean over directions at each filling."""
    moved = given.u.copy()
    for fill in np.unique(given.plan[:, 3]):
        moved[given.plan[:, 3] == fill] -= given.u[given.plan[:, 3] == fill].mean(0)
    return moved


def frame_gain(given):
    """Motion along gravity that other axes of gravity gain, summed over three directions / RMS of what gravity
    changes."""
    moved = gravity_part(given)
    linear = 3 * np.einsum("mi,mj->ij", moved.mean(1), given.plan[:, :3]) / len(moved)
    sums = [sum(sign * linear[i, j] for i, (j, sign) in enumerate(zip(order, signs)))
            for order in itertools.permutations(range(3)) for signs in itertools.product((1, -1), repeat=3)]
    return (max(sums) - np.trace(linear)) / np.sqrt((moved ** 2).sum(2).mean())


def stray(given):
    """Distance of a vertex from the mean displacement of its neighbours / largest such distance of these, and above a
    tenth of the RMS."""
    edges = np.concatenate([given.faces[:, [i, j]] for i, j in itertools.permutations(range(3), 2)])
    count, worst = np.bincount(edges[:, 0], minlength=len(given.points))[:, None].clip(1), 0
    least = 0.1 * np.sqrt((given.u ** 2).sum(2).mean())
    for u in given.u:
        mean, spread = np.zeros_like(u), np.zeros(len(u))
        np.add.at(mean, edges[:, 0], u[edges[:, 1]])
        mean /= count
        np.maximum.at(spread, edges[:, 0], np.linalg.norm(u[edges[:, 1]] - mean[edges[:, 0]], axis=1))
        apart = np.linalg.norm(u - mean, axis=1)
        worst = max(worst, (apart / spread.clip(1e-9))[apart > least].max(initial=0))
    return worst


def best_fit(plan, u, kept):
    """Return band, order and the leave-one-out errors of the runs `kept`, of the fit with the least of them, and 1 - h
    of each, with h the diagonal of the hat matrix; volumes as `fill`."""
    best = None
    for order in range(1 if np.ptp(plan[:, 3]) > 0 else 0, min(4, len(np.unique(plan[kept, 3])) - 1) + 1):
        for band in range(6):
            a = fit_terms(plan[kept], band, order)
            if a.shape[1] >= len(kept) or np.linalg.cond(a) > 100:
                break
            hat = a @ np.linalg.pinv(a)
            free = 1 - np.diag(hat)
            if free.min() < 1e-3:
                break
            error = np.linalg.norm(u[kept] - hat @ u[kept], axis=1) / free
            if best is None or (error ** 2).sum() < (best[2] ** 2).sum():
                best = band, order, error, free
    return best


def fit_terms(plan, band, order):
    t = np.polynomial.chebyshev.chebvander(2 * plan[:, 3] - 1, order)
    return (terms(band, plan[:, :3])[:, :, None] * t[:, None]).reshape(len(plan), -1)


def worst_run(given):
    """Largest error of three runs that were taken out, predicted from the others / upper quartile of the errors of
    these, above a twentieth of the RMS; each error divided by the norm of the weights of its prediction."""
    u = given.u[:, ::max(1, len(given.points) // POINTS)].reshape(len(given.u), -1)
    kept, out, size = np.arange(len(u)), [], np.sqrt((u ** 2).sum(1).mean())
    band, order, error, free = best_fit(given.plan, u, kept)
    while len(out) < min(3, len(u) // 8):
        out.append(kept[error.argmax()])
        kept = np.delete(kept, error.argmax())
        band, order, error, free = best_fit(given.plan, u, kept)
    weights = fit_terms(given.plan[out], band, order) @ np.linalg.pinv(fit_terms(given.plan[kept], band, order))
    missed = np.linalg.norm(u[out] - weights @ u[kept], axis=1)
    ratio = missed / np.sqrt(1 + (weights ** 2).sum(1)) / np.percentile(error * np.sqrt(free), 75)
    return ratio.max(), ratio[missed > 0.05 * size].max(initial=0)


def made_wrong(given):
    """Yield wrong versions of a set: what was done, and the set."""
    change = lambda name, plan=given.plan, u=given.u: (name, Set(given.name, given.points, given.faces, plan, None, u))
    edit = lambda name, act: (lambda u: (act(u), change(name, u=u))[1])(given.u.copy())
    row = 7 if len(given.u) < 60 else 29
    yield change("gravity negated", given.plan * [-1, -1, -1, 1])
    yield change("gravity in RAS", given.plan * [-1, -1, 1, 1])
    yield change("y and z exchanged", given.plan[:, [0, 2, 1, 3]])
    yield change("x mirrored", given.plan * [-1, 1, 1, 1])
    yield edit("a run of zeros", lambda u: u.__setitem__(row, 0))
    yield edit("two runs exchanged", lambda u: u.__setitem__([row, row + 5], u[[row + 5, row]]))
    yield edit("a point 60 mm off",
               lambda u: u.__setitem__((3, len(given.points) // 3, 0), u[3, len(given.points) // 3, 0] + 60))


def write_surface(path, points, faces):
    with open(path, "w", encoding="ascii") as file:
        print(f"ply\nformat ascii 1.0\nelement vertex {len(points)}", *(f"property double {axis}" for axis in "xyz"),
              f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header", sep="\n", file=file)
        np.savetxt(file, points, "%.9g")
        np.savetxt(file, np.column_stack([np.full(len(faces), 3), faces]), "%d")


def draw_between(given):
    """Return rows of a plan between those of a set: other directions, evenly spread, and drawn fillings."""
    rng = np.random.default_rng(11)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    filling = rng.uniform(0.05, 0.95, DRAWN) if np.ptp(given.plan[:, 3]) > 0 else np.zeros(DRAWN)
    return np.column_stack([even(DRAWN) @ turn.T, filling])


def find_errors(package, basis, given, rows, fields):
    """Return the fillings of the states of a set that a basis takes, and the squared error of each vertex in each of
    these, mm2, as it is found and as it is stated."""
    taken, error, stated = [], [], []
    order = [np.abs(given.points - x).sum(1).argmin() for x in basis.vertices]  # vertices are grouped by lung
    for row, u in zip(rows, fields):
        volume = {}
        for name, (begin, end) in lungs_of(basis).items() if np.ptp(given.plan[:, 3]) > 0 else ():
            own = basis.triangles[(basis.triangles[:, 0] >= begin) & (basis.triangles[:, 0] < end)]
            a, b, c = (given.points + u)[order][own].transpose(1, 0, 2)
            volume[name] = f"{abs(np.einsum('ij,ij->', a, np.cross(b, c))) / 6000:.6f}mL"
        try:
            pose = basis.pose(tuple(row[:3]), volume)
        except package.NumericalError:  # beyond the smallest or the largest volume of the directions of the basis
            continue
        taken.append(row[3])
        error.append(basis.deform(pose) - (given.points + u)[order])
        stated.append(basis.expected_error(tuple(row[:3]), volume))
    return np.array(taken), (np.array(error) ** 2).sum(2), np.array(stated) ** 2


def stated_and_found(package, given):
    """Make bases of a set without each fifth of its directions. Return the number of warnings of all; then, for states
    between the runs and for the runs that were left out, their number, the volumes that the third basis refuses, the
    errors that it states and that are found, in parts of the RMS displacement, and for each vertex the stated error /
    the found one: 5 %, median and 95 %; stated / found of the states of one basis that are nearest to one volume of
    the set, smallest and largest; and of all states of each of the five bases."""
    names = [tuple(row) for row in np.unique(given.plan[:, :3], axis=0)]
    fifth = np.array([names.index(tuple(row)) % 5 for row in given.plan[:, :3]])
    write_surface("set.ply", given.points, given.faces)
    size, rms = np.sqrt((given.u ** 2).sum(2).mean()), lambda square: np.sqrt(square.mean())
    fills = np.unique(given.plan[:, 3])
    drawn, bases = draw_between(given), []
    between = drawn, [given.law(row) for row in drawn]
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for left in range(5):
            out = fifth == left
            package.save_fields("set.safetensors", given.points, given.plan[~out, :3], given.u[~out])
            bases.append((out, package.precompute("set.ply", fields="set.safetensors")))
    results = []
    for gap in (False, True):
        ratios, volumes = [], []
        for left, (out, basis) in enumerate(bases):
            rows, fields = (given.plan[out], given.u[out]) if gap else between
            taken, found, stated = find_errors(package, basis, given, rows, fields)
            ratios.append(rms(stated) / rms(found))
            nearest = np.abs(taken[:, None] - fills).argmin(1)
            volumes += [rms(stated[nearest == k]) / rms(found[nearest == k]) for k in np.unique(nearest)]
            if left == 2:
                result = (len(rows), len(rows) - len(taken), rms(stated) / size, rms(found) / size,
                          *np.percentile(np.sqrt(stated.mean(0) / found.mean(0)), (5, 50, 95)))
        results.append((*result, min(volumes), max(volumes), *ratios))
    return len(told), results


def lungs_of(basis):
    """Return the vertices of each lung: begin and end."""
    return {name: (part.start, part.stop) for name, part in basis.lungs.items()}


def all_sets(package, build, paths):
    """Yield the right sets, each as soon as it is computed."""
    first = None
    for path in paths:
        for given in law_sets(package, path):
            first = first or given
            yield given
    yield from formula_sets(first.points, first.faces)
    if shutil.which("ccx") and shutil.which("tetgen"):
        yield from calculix_sets(build)
    else:
        print("CalculiX or TetGen is not installed: its sets are not measured")


def distances(given):
    """Return how far a set is from runs of zeros, copies, repeated directions and unequal gravity: the smallest RMS
    displacement of a run and the smallest difference of two / RMS of all; the smallest angle between two directions,
    degrees; the longest / the shortest direction, rounded to two decimals."""
    flat, size = given.u.reshape(len(given.u), -1), np.sqrt((given.u ** 2).sum((1, 2)).mean())
    square = flat @ flat.T
    apart = square.diagonal()[:, None] + square.diagonal() - 2 * square + np.diag([np.inf] * len(flat))
    g = np.unique(given.plan[:, :3], axis=0)
    angle = np.degrees(np.arccos(np.clip(g @ g.T - 2 * np.eye(len(g)), -1, 1))).min()
    lengths = np.linalg.norm(np.round(g, 2), axis=1)
    return np.sqrt(square.diagonal().min()) / size, np.sqrt(apart.min()) / size, angle, lengths.max() / lengths.min()


def zero_run(given):
    """RMS prediction of a run of zeros / median error of all runs, and / RMS displacement; 0 without such a run."""
    u = given.u[:, ::max(1, len(given.points) // POINTS)].reshape(len(given.u), -1)
    zeros = np.flatnonzero(~u.any(1))
    if len(zeros) == 0:
        return 0, 0
    error = best_fit(given.plan, u, np.arange(len(u)))[2]
    return error[zeros[0]] / np.median(error), error[zeros[0]] / np.sqrt((u ** 2).sum(1).mean())


def measure_sets(package, build, paths):
    print("\nEach right set: a fifth of the directions is left out of a basis, whose stated error is compared. Then "
          "the set, and what was\nmade wrong in it, as the checks measure it.")
    for given in all_sets(package, build, paths):
        told, results = stated_and_found(package, given)
        print(f"\n{given.name}: {told} warnings of five bases")
        for where, (count, refused, stated, found, *ratios) in zip(("between the runs", "in directions left out"),
                                                                   results):
            print(f"  {where}: {count} states, {refused} refused; stated {100 * stated:.4f} %, found "
                  f"{100 * found:.4f} %: {stated / found:.2f} times; of a vertex 5 % {ratios[0]:.2f}, median "
                  f"{ratios[1]:.2f}, 95 % {ratios[2]:.2f}; at one volume of any basis {ratios[3]:.2f} to "
                  f"{ratios[4]:.2f}; of all bases", *(f"{ratio:.2f}" for ratio in ratios[5:]))
        print("  smallest run {:.2f} and difference of two runs {:.3f} of the RMS; directions {:.0f} degrees apart; "
              "longest / shortest, rounded, {:.3f}".format(*distances(given)))
        print(f"{'':28} {'runs':>4} {'what is wrong':20} {'gravity, mm':>11} {'axes':>5} {'point':>6} {'run':>6} "
              f"{'run, large':>10} {'zeros':>6} {'part':>5}")
        for wrong, now in [("", given), *made_wrong(given)]:
            moved, run, zeros = np.sqrt((gravity_part(now) ** 2).sum(2).mean()), worst_run(now), zero_run(now)
            print(f"{given.name:28} {len(given.u):4} {wrong:20} {moved:11.1f} {frame_gain(now):5.2f} "
                  f"{stray(now):6.1f} {run[0]:6.1f} {run[1]:10.1f} {zeros[0]:6.1f} {zeros[1]:5.2f}", flush=True)


def main():
    build = pathlib.Path(sys.argv[1]).resolve()
    os.environ["PATH"] = str(build) + os.pathsep + os.environ["PATH"]
    paths = [os.path.abspath(path) for path in sys.argv[2:] if path != "--sets"]
    with tempfile.TemporaryDirectory() as folder:
        package = take_package(build, pathlib.Path(folder))
        os.chdir(folder)
        if "--sets" not in sys.argv:
            measure(package, paths)
        measure_sets(package, build, paths)
        os.chdir("/")


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
    print(f"{'directions':14} {'gap':>4} {'condition':>9} {'left out':>8} {'shuffled':>8} {'spread':>6} "
          f"{'RMS, mm':>7} {'largest':>7} {'worst':>6}")
    for i, (name, g) in enumerate(plans.items()):
        m, least = measured[:, :, i].max((0, 1)), measured[:, :, i].min((0, 1))
        print(f"{name:14} {gap(g):4.0f} {condition(g):9.1f} {m[0]:8.2f} {least[1]:8.2f} {m[2]:6.2f} {least[3]:7.1f} "
              f"{m[4]:7.2f} {m[5]:6.1f}")
    print("\ncap left empty, degrees; gap; condition; found error, median and most; found / stated, median and most")
    for angle in sorted({row[0] for row in empty}):
        r = np.array([row for row in empty if row[0] == angle])
        print(f"{angle:4.0f} {r[:, 1].max():6.0f} {r[:, 2].max():6.1f} {np.median(r[:, 3]):8.3f} {r[:, 3].max():6.3f} "
              f"{np.median(r[:, 4]):7.1f} {r[:, 4].max():5.1f}")


if __name__ == "__main__":
    main()
