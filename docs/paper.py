# SPDX-License-Identifier: GPL-3.0-or-later
"""Print docs/paper.md, a table that compares this build with [Santhanam2008]:

    python3 docs/paper.py build/release > docs/paper.md

All numbers are measured on synthetic lungs ('supine phantom'), so that no other data are needed."""
import csv
import json
import math
import os
import re
import subprocess
import sys
import tempfile

build = os.path.abspath(sys.argv[1])
supine = os.path.join(build, "supine")


def run(*words):
    return subprocess.run([supine, *words], check=True, capture_output=True, text=True).stdout


def info(*options):
    """Return the output of 'supine info --json' for a basis made with the displacement law of [Santhanam2008]."""
    run("precompute", "lungs.ply", "--law", "paper", "-o", "basis.safetensors", *options)
    return json.loads(run("info", "basis.safetensors", "--json"))


def rows(name):
    with open(f"validation/{name}.csv", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def visits(method):
    """Return how many times a method reads a link between two nodes until its relative error is 1e-6."""
    return next(round(float(row["link_visits"])) for row in rows("fig7_convergence")
                if row["method"] == method and float(row["relative_rms_error"]) <= 1e-6)


def apart(name, a, b):
    """Return the RMS difference of the columns a and b of a table, divided by the RMS of a."""
    of = [(float(row[a]), float(row[b])) for row in rows(name)]
    return math.sqrt(sum((x - y) ** 2 for x, y in of) / sum(x * x for x, _ in of))


def off_line():
    """Return the largest deviation of the displacement from the straight line through 0 and 500 mL, in four postures.

    The deviation is in percent of the displacement at 500 mL."""
    of = [row for row in rows("linearity") if float(row["volume_mL"]) <= 500]
    return max(100 * abs(float(row[p]) / float(of[-1][p]) - float(row["volume_mL"]) / 500) for row in of
               for p in ("supine", "prone", "left", "right"))


POSTURES = ("supine", "prone", "left", "right")


def enclosed(faces):
    """Return the volume that triangles enclose, mL."""
    return abs(sum(a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
                   a[2] * (b[0] * c[1] - b[1] * c[0])
                   for a, b, c in faces) / 6000)


def part_share(faces_of, left):
    """Return the volume of one lung divided by the volume of its bounding box."""
    faces = [face for face in faces_of.faces if (face[0][0] > 0) == left]
    box = math.prod(max(p[k] for f in faces for p in f) - min(p[k] for f in faces for p in f) for k in range(3)) / 1000
    return enclosed(faces) / box


class Surface(list):
    """The vertices of a surface, and its triangles as lists of corners."""

    faces = ()


def surface(posture, volume):
    """Return the vertices of the basis in a state, and the state's volume in mL."""
    run("deform", "basis.safetensors", "--posture", posture, "--volume", volume, "-o", "state.obj")
    with open("state.obj", encoding="ascii") as file:
        lines = [line.split() for line in file]
    at = [tuple(map(float, words[1:4])) for words in lines if words[:1] == ["v"]]
    faces = [[at[int(w.split("/")[0]) - 1] for w in words[1:4]] for words in lines if words[:1] == ["f"]]
    at = Surface(at)
    at.faces = faces
    return at, enclosed(faces)


def shares():
    """Return the least and the greatest volume of a lung divided by that of its box, and the largest distance of the
    box's length (feet to head) at 250 mL from the mean of those at 0 and 500 mL, in percent of their difference, in a
    breath of 500 mL in four postures."""
    found, bent = [], []
    for posture in POSTURES:
        length = []
        for volume in ("scan", "scan+250", "scan+500"):
            at, _ = surface(posture, volume)
            z = [p[2] for p in at]
            length.append(max(z) - min(z))
            for left in (True, False):
                found.append(part_share(at, left))
        bent.append(100 * abs(length[1] - (length[0] + length[2]) / 2) / abs(length[2] - length[0]))
    return min(found), max(found), max(bent)


def bends():
    """Return the least and the greatest distance of a path's middle from the chord, in percent of the chord's length.

    The path is that of the vertex that moves most, from rest to 500 mL above it; one number for each of four
    postures."""
    percents = []
    for posture in POSTURES:
        a, b, c = (surface(posture, volume)[0] for volume in ("rest", "rest+250", "rest+500"))
        chord = [math.dist(p, q) for p, q in zip(a, c, strict=True)]
        i = max(range(len(a)), key=chord.__getitem__)
        percents.append(100 * math.dist(b[i], [(p + q) / 2 for p, q in zip(a[i], c[i], strict=True)]) / chord[i])
    return min(percents), max(percents)


os.chdir(tempfile.mkdtemp())
run("phantom", "-o", "lungs.ply", "--vertices", "5000")
run("precompute", "lungs.ply", "--law", "paper", "-o", "basis.safetensors")
least_share, most_share, box_bend = shares()
run("precompute", "lungs.ply", "-o", "basis.safetensors")
straightest, most_bent = bends()
fewest = json.loads(run("info", "basis.safetensors", "--json"))
run("precompute", "lungs.ply", "--band", "3", "--modes", "harmonics", "-o", "basis.safetensors")
default_first = json.loads(run("info", "basis.safetensors", "--json"))
subprocess.run([supine, "phantom", "-o", "small.ply", "--vertices", "160"], check=True, capture_output=True)
iterated = subprocess.run([supine, "solve", "small.ply", "--law", "paper", "--posture", "prone", "--pitcher-catcher",
                           "-o", "x.ply"], check=True, capture_output=True, text=True)
iterated = " ".join((iterated.stdout + iterated.stderr).split())
best, first = info(), info("--band", "3", "--modes", "harmonics")
soft_best = info("--reach", "10", "--soften", "1")
soft_first = info("--reach", "10", "--soften", "1", "--band", "3", "--modes", "harmonics")
subprocess.run([os.path.join(build, "tests/bench/bench_validation"), "validation", "none"], check=True,
               capture_output=True)
methods = list(dict.fromkeys(row["method"] for row in rows("fig7_convergence")))
plane = [name for name in rows("fig8_plane")[0] if name != "x_mm"]
ring = rows("fig9_ring")


def radius(column, stiff=None):
    """Return the mean radius of the ring whose x is in the given column and whose y is in the next one: of all points,
    of the third that one ring has stiffer, or of the others. The last row of the table repeats the first."""
    keys = list(ring[0])
    x, y = keys[keys.index(column)], keys[keys.index(column) + 1]
    points = ring[:-1]
    third = range(len(points) // 3, 2 * len(points) // 3)
    of = [math.hypot(float(row[x]), float(row[y])) for i, row in enumerate(points) if stiff is None
          or (i in third) == stiff]
    return sum(of) / len(of)


reached = "; ".join(f"{method}: {visits(method):,}" for method in methods
                    if any(row["method"] == method and float(row["relative_rms_error"]) <= 1e-6
                           for row in rows("fig7_convergence")))


def percent(basis):
    return f"{float(basis['error']['rms_percent']):.2g} %"


steps, left = re.findall(r"(\d+) steps, (\S+) of the force not yet balanced", iterated)[-1]
difference = re.search(r"largest difference from the direct solution [0-9.e-]+", iterated)[0]
pitcher = (f"{steps} steps leave {left} of the force; {difference} (184 vertices); of a real left lung of 5,001 "
           f"vertices, 160,032 steps leave 4.7e-05, and the difference is 7.5e-07")


def operations(basis):
    return f"{basis['modes'] + 6} multiplications and {basis['modes'] + 2} additions"


print(f"""# The paper, row by row

Santhanam, Imielinska, Davenport, Kupelian and Rolland, "Modeling Real-Time 3-D Lung Deformations for Medical
Visualization", IEEE Trans. Inf. Technol. Biomed. 12(2), 2008. Each row names the command or program that
reproduces a part of the paper, its result, and what differs here. `python3 docs/paper.py build/release > docs/paper.md`
makes this file from synthetic lungs of {best['vertices']:,} vertices. Ranges of real lungs are from the programs that a
row names; the four real pairs are chaste, covid001, covid002 and covid005, one pair or lung is chaste's.

The commands run in this order in a folder with what these make:

```sh
supine phantom --vertices 5124 -o lungs.ply
supine precompute lungs.ply -o lungs.safetensors
supine deform lungs.safetensors --posture supine:rest -o rest.ply
supine deform lungs.safetensors --posture supine:rest+1500 -o half.ply
supine pv show | sed 's/inhale_mL,/volume_mL,/' >samples.csv
```

| in the paper | reproduced by | result | difference |
|---|---|---|---|
| III-B, pressure and volume: a second-order equation with five control parameters | `supine pv fit samples.csv`, `supine pv show`, `supine breathe lungs.safetensors --posture supine --tidal 500mL -o breath.vtp` | the built-in adult relation; other curves are fitted with errors below 1 % (`test_pv_fit`) | the paper does not define the control functions; here they are Legendre polynomials (`<supine/breath.h>`) |
| III-C, displacement as a function of volume at one orientation | `tests/bench/bench_validation`, linearity.csv; `supine validate lungs.safetensors --state supine:rest:rest.ply --state supine:rest+1500:half.ply` | `paper`: at most {off_line():.1f} % of the displacement at 500 mL away from a straight line, from 0 to 500 mL in four postures (one real pair: 0.5 %) | with `deep`, the default law, the path bends: its middle is {straightest:.1f} to {most_bent:.1f} % of the chord away from it (3.3 to 11 % in four real pairs), so that steps of equal displacement (`supine_step`) are wrong |
| III-E, mass and spring nodes, expandability, local transfer; (3), (8) | `supine precompute lungs.ply --law paper -o paper.safetensors`, with `--expandability`, `--lesion` | the shares of each node sum to 1 (`network.h`), and the solution is that of the dense matrix of all nodes (`test_equilibrium`) | the spring nodes are eliminated exactly; `deep` spreads the force over 10 mm and has no spring nodes; expandability acts on its strain (`strain.h`) |
| (2), a column of the transfer matrix | `supine solve lungs.ply --unit-force 100 -o force.csv` | CSV, one row per vertex; of a unit force on a vertex of a real left lung, all vertices keep 0.38 and the springs the rest | |
| (5), (6), Pitcher/Catcher | `tests/bench/bench_validation`, fig7_convergence.csv | link visits until the error is 1e-6: {reached} | the program factorises the matrix (CHOLMOD); tests compare the solution with the paper's iteration |
| (5), (6), the iteration itself | `supine solve lungs.ply --law paper --pitcher-catcher --posture supine -o iterated.ply` | {pitcher} | |
| (9)-(14), all paths | `supine solve lungs.ply --law paper --posture supine -o solved.ply` | the fixed point of (5), (6) (`test_equilibrium`) | the paths are not enumerated; the linear system is solved |
| (15)-(17), directions | `supine fit rest.ply lungs.ply --other supine:full -o patient.json`; `--law`, `--constants` | {best['direction_constants']} | **Table I is not available**: these constants were fitted to the 4-D CT of ten patients (DIR-Lab); `supine fit` fits those of a person |
| (18), applied force | the same; `--base`, `--gain`, `--box-force` | {best['force']} | in `deep` only a part of the gradient of the force follows gravity |
| IV-B.3, (18), its result: the force grows with the height along gravity | the same computes the force from a measured displacement | a force of known gain is recovered from surfaces of one material (`test_patient_surface`). In five people with COPD (`tests/evidence/figures.py`): from landmarks the force grows with height in four of five, correlation -0.47 to 0.69; from surfaces it does not, -0.28 to 0.03, and (18) leaves 67 to 143 % of the force at the centre | surfaces do not show the motion along them, so that the report calls their force unreliable; not compared with the paper's gradients, whose 4-D CT is not available |
| Fig. 4, volume divided by that of the bounding box; the paper: 0.32 to 0.40 | `supine deform paper.safetensors --posture supine -o paper.ply`, breath of 500 mL in four postures | {least_share:.3f} to {most_share:.3f} for each lung; four real pairs 0.27 to 0.39, others 0.29 to 0.44, steady within each lung | the length of the box from feet to head is {box_bend:.0f} % away from a straight line at half the breath (3 to 34 % in four real pairs) |
| Figs. 3 and 13, lungs in several orientations | `supine render lungs.safetensors --posture supine,prone,left -o lungs.png` | one picture each | with other lungs |
| Figs. 1, 2 and 10 to 12 | | | not reproduced |
| IV, Fig. 7, convergence | `tests/bench/bench_validation`, fig7_convergence.png | as for (5), (6) | of a plane of 441 vertices, not of lungs |
| IV, Fig. 8, a plane | `tests/bench/bench_validation`, fig8_plane.png | {plane[0]} and {plane[1]} differ by {apart('fig8_plane', plane[0], plane[1]):.1g} of the displacement, in the nine digits written | a test of the solver: the springs are built to have its equilibrium, so that they are no independent simulation |
| IV, Fig. 9, a ring with a stiffer third | `tests/bench/bench_validation`, fig9_ring.png | mean radius {radius('x0'):.1f} mm before, {radius('x1'):.1f} with uniform stiffness; with a third four times as stiff, this third {radius('x4', True):.1f} and the rest {radius('x4', False):.1f} | of a ring, not of lungs |
| IV-B, expandability from displacement | `supine fit rest.ply lungs.ply --other supine:full --expandability -o patient.json` | correlation with the true log stiffness of a real lung: 0.98 for a threefold gradient (slope 0.96), 0.87 for a lesion, found 2.1 times as stiff instead of 3; of synthetic lungs of 1,600 vertices: 0.97 (slope 1.03), and 0.79 for a lesion, below the 0.85 aimed at (`test_patient_expand`; 0.83 with 4,000 vertices). Not used to choose anything, four real pairs of 10,000 vertices: gradients 0.98 (slope 0.96 to 0.99), 16 lesions of 60 mm at four places 0.56 to 0.82, four of them not found | found for regions, by ridge least squares, because surfaces do not determine it for single vertices. Surfaces with errors of 0.5 mm hold no more: of 14 lesions, 13 have less than 0.85 with the best prior of this form, and the regions could show 0.87 to 0.96 |
| IV-B, distance between surfaces, landmarks under 2 mm apart, deformation RMS below 1 % | `supine validate lungs.safetensors --state supine:rest:rest.ply -o errors.png` | not reached. Of real breaths (`tests/FIGURES.md`): landmarks 3.0 mm RMS apart in five quiet breaths (1.6 to 3.6; motion 5.0 mm) and 9.5 mm in five full ones (motion 14.2 mm), 61 and 67 % of the motion, not below 1 %; after `supine fit` to surfaces and landmarks 2.2 to 6.4 mm in full breaths | |
| V, spherical harmonics of the orientation, l <= 3 | `supine precompute lungs.ply --law paper --band 3 --modes harmonics -o harmonics.safetensors` | error {percent(first)} RMS on held-out directions ({percent(default_first)} with the default law; four real pairs 2.5 to 2.7 %, and 0.50 to 0.57 %); {operations(first)} per vertex | |
| V, with at most the same number of operations | `supine precompute lungs.ply --law paper -o paper.safetensors` | error {percent(best)} with {best['modes']} modes of band {best['band']} ({percent(fewest)} with {fewest['modes']} and the default law; four real pairs 0.21 to 0.23 %, and 0.04 to 0.06 %); {operations(best)} per vertex | uses the best functions of orientation instead of the first harmonics |
| V, with stiffness that follows gravity | `supine precompute lungs.ply --law paper --reach 10 --soften 1 -o soft.safetensors` | {percent(soft_first)} with the first 16 harmonics, {percent(soft_best)} with {soft_best['modes']} modes; four real pairs 3.4 to 3.8 %, and 0.27 to 0.28 % | |
| V, FFTW | `supine precompute lungs.ply -o lungs.safetensors` | the force on a grid of directions, by FFTW along longitude and Legendre functions along latitude | the force is transformed, not the displacement; the transfer is applied once, to the few functions whose sums are all forces, before modes are chosen |
| V, a breath of 500 mL over 5 s in steps of 4.5 and 2.25 mL, 15 ms per frame (500 mL / (66.66 frames/s x 5 s) = 1.5 mL) | `supine breathe lungs.safetensors --posture supine --tidal 500mL --course flow -o flow.vtp`, `supine_step` | three additions per vertex and step (`test_deform`); a breath of 500 mL of a real pair of 10,002 vertices: 334 frames in steps of at most 4.5 mL, 0.0001 % of the displacement away from a straight line | only for a straight path (`paper`) |
| V, evaluation in a vertex shader | `runtime/supine.glsl`, `supine export lungs.safetensors -o lungs.html` | positions equal those of the library within 0.001 mm (`test_glsl`); of three real pairs within 0.0015 mm, mostly from the 16-bit storage of the library (the formula of the shader, applied to what `supine_gl_pack` returns) | |
| VI, a loop of augmented reality: tracked pose in, deformed lungs out | `supine stream lungs.safetensors --listen 0` (OpenIGTLink, live page), the page's headset mode | `stream_*` tests; of a real pair of 10,002 vertices on a busy machine, 97 to 98 % of the surfaces were sent within 15 ms (`bench_stream`) | tried with simulated trackers and an emulated headset only |
| VI, a patient's own lungs, disease | `supine precompute lungs.ply --patient patient.json -o own.safetensors`, with `--lesion`, `--lung` | | a collapsed lung shrinks evenly about its hilum: the collapse is the displacement from the scan (`deform --from scan`, `embed`, images; in a label map of a real pair, lobes of 859 and 666 mL became 429 and 333 mL with a share of 0.5). With a volume for each lung (`--volume left=700mL,right=1400mL`) instead, the law moves the lung to the back and the head, not to its hilum |
""".rstrip())
