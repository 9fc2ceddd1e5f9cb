# SPDX-License-Identifier: GPL-3.0-or-later
"""Give each input of each interface (a door) every kind of mistake that such an input can have: the matrix of the
tables DOORS and MISTAKES. A mistake must be told or refused, as the table of checks (docs/inputs.md) says where it has
a row for it. The right input beside it must be taken without a word.

    python3 tests/doors.py [BUILD_FOLDER [DOOR]]

Lungs are those of examples/lungs; another person's are synthetic. To add an input, add one row to DOORS and, if its
data are of a new type, the mistakes of this type to MISTAKES. Whatever is taken today is listed in KNOWN, by the topic
of the work that will mend it. The test fails if anything else is taken, and if a known case is mended: then delete its
line."""
import functools
import json
import os
import re
import shutil
import subprocess
import sys

from helpers.verdict import (SOURCE, SUPINE, command, even, javascript, leave, pose_in_c, python, stream, supine,
                             table, transform, verdict_of, volume_number, volume_text, voxels_of, write_image,
                             write_pairs, write_ply, write_points)
import numpy as np

try:
    import nibabel
    from helpers import segmentation
except ImportError:  # no nibabel, or no pydicom: their doors stay closed
    nibabel = None
KINDS = ("unit", "axes", "mirror", "person", "swapped", "shifted", "repeated", "range", "finite", "cut")
RIGHT = "right"
LUNGS = [os.path.join(SOURCE, "examples/lungs", side + ".obj") for side in ("left", "right")]
QUICK = ("--band", 3, "--held-out", 5)
FLIP = np.array([-1.0, 1, 1])  # mirrors left and right
RAS = np.array([-1.0, -1, 1])


# ---- Data of each type, as it is without a mistake.

def prepare():
    """Make the basis of the lungs, a grid, points, another state of them, and the lungs of another person."""
    for words in (("precompute", *LUNGS, *QUICK, "-o", "lungs.st"), ("phantom", "--vertices", 3000, "-o", "other.ply"),
                  ("precompute", "other.ply", *QUICK, "-o", "other.st"),
                  ("embed", "lungs.st", "--grid", 10, "-o", "grid.st")):
        done = command(*words)
        assert done[0] == "taken", done
    return supine.open("lungs.st"), supine.open("other.st"), supine.open("grid.st")


lungs, other, grid = prepare()
first = np.asarray(lungs.tensor("lung")).ravel() == 0
surface = lungs.vertices.astype(float), lungs.triangles
middle = surface[0].mean(axis=0)
depth = np.asarray(grid.tensor("depth")).ravel()
within = grid.vertices[depth > 12].astype(float)[::40]
seen = np.flatnonzero(depth > 12)[::40]
at = lambda basis, state, rows=slice(None): basis.deform(basis.pose(state))[rows].astype(float)
pairs = np.column_stack([within, at(grid, "supine:rest+800", seen)])


def fields():
    """Return fields of another simulator: the lungs sag along gravity, the lower part more."""
    points, directions = other.vertices.astype(float), even(40)
    place = (points - points.mean(axis=0)) / 100
    field = lambda g: (5 - (place ** 2).sum(1))[:, None] * g + 3 * np.tanh(place @ g)[:, None] * place
    return {"points": points, "gravity": directions, "displacement": np.array([field(g) for g in directions])}


# ---- Writers: a file of each type.

def write_lungs(name, value):
    write_ply(name, *value)


def write_fields(name, value):
    supine.save_fields(name, value["points"], value["gravity"], value["displacement"])


def frame_of(image):
    """Return the matrix from voxels [i, j, k] to mm, RAS."""
    frame = np.diag([*(image["step"] * RAS), 1.0])
    frame[:3, 3] = image["origin"] * RAS
    return frame


def write_nifti(name, image):
    if nibabel is not None:
        nibabel.save(nibabel.Nifti1Image(image["values"].T, frame_of(image)), name)


def write_segmentation(name, image):
    """Write a DICOM segmentation. Its segments are the left and the right lung, if `codes` are not others; `also` makes
    the first overlap the second."""
    if nibabel is None:
        write_text(name, "")
        return
    labels = image["values"].T
    masks = {1: (labels == 1) | (labels == image.get("also", 1)), 2: labels == 2}
    segmentation.write(name, masks, image.get("codes", {1: ("44029006", ""), 2: ("3341006", "")}), frame_of(image),
                       shift=image.get("shift", 0.0))


def write_lines(name, rows):
    """Write lines of sight, each from its last three numbers through its first three."""
    write_text(name, "name,x,y,z,from_x,from_y,from_z\n" + "".join(
        f"p{i}," + ",".join(f"{x:.4f}" for x in row) + "\n" for i, row in enumerate(rows)))


def write_text(name, text):
    with open(name, "w", encoding="utf-8") as file:
        file.write(text)


def write_bytes(name, path):
    shutil.copy(path, name)


# ---- Mistakes: for each type, its writer and ending (None for a text), the right value, and a value for each kind that
# such data can have. Files are cut short: the value of `cut` is None.

def with_first(array, value, rows=1):
    """Return the array with its first rows replaced."""
    array = np.array(array, float)
    array[:rows] = value
    return array


def with_part(image, **parts):
    return {**image, **parts}


def moved_rows(value, order):
    return {**value, "displacement": value["displacement"][order]}


def other_lung(scale):
    """Return the lungs, whose right lung is another person's."""
    vertices, faces = surface
    centre = vertices[~first].mean(axis=0)
    return np.where(first[:, None], vertices, (vertices - centre) * scale + centre + [0, 0, 60]), faces


def named(points):
    return [("p%d" % i, *p) for i, p in enumerate(points)]


def lesion(centre, factor=3):
    """Return a stiff ball of 20 mm, which reaches the surface."""
    return ",".join(f"{x:.1f}" for x in (*centre, 20, factor))


label, ct = voxels_of(grid), None
ct = with_part(label, values=np.where(label["values"] > 0, -850, 40).astype(np.int16))
dose = with_part(label, values=np.full(label["values"].shape, 2, np.float32))
LIVER = {1: ("10200004", ""), 2: ("10200004", "")}
write_nifti("ct.nii.gz", ct)
write_text("states.csv", "posture,volume\nprone,rest\n")
field = fields()
STATE = "supine:rest+800"
rest = at(lungs, STATE)
write_points("inside.csv", named(within[::9]))
assert command("embed", "lungs.st", "inside.csv", "-o", "inside.st")[0] == "taken"
inside = supine.open("inside.st")
ROWS_INSIDE = [inside.points["p%d" % i] for i in range(len(within[::9]))]
observed = at(inside, STATE)[ROWS_INSIDE]
for name, basis in (("", lungs), ("other_", other)):
    write_ply(name + "full.ply", basis.vertices, basis.triangles)
    write_ply(name + "rest.ply", at(basis, STATE), basis.triangles)
    assert command("fit", name + "rest.ply", name + "full.ply", "--rest", STATE, "--other", "supine:full", "-o",
                   name + "patient.json")[0] != "refused"
write_pairs("pairs.csv", pairs)
held = lambda vertices: round(np.linalg.det(vertices[lungs.triangles].astype(float)).sum() / 6000)
assert command("fit", "--landmarks", "pairs.csv", "--rest", f"supine:{held(lungs.vertices)}mL", "--other",
               f"supine:{held(rest)}mL", "-o", "marks.json")[0] != "refused"
with open("patient.json", encoding="utf-8") as file:
    patient = file.read()
with open("other_patient.json", encoding="utf-8") as file:
    other_patient = file.read()
first_number = re.search(r"-?\d+\.\d{4,}", patient)[0]
person = at(other, STATE) * [0.8, 1, 1.2], other.triangles
places = np.array([[0, -900, 0], [900, 0, 0]])[np.arange(len(observed)) % 2] + observed.mean(axis=0)
sights = np.column_stack([places + 1.3 * (observed - places), places])
small = 0.02 * (surface[0] - middle) + within[0]
columns = lambda scale: np.tile(scale, 2)
MISTAKES = {
    "lungs": (write_lungs, ".ply", {
        RIGHT: surface, "unit": (surface[0] / 1000, surface[1]), "axes": (surface[0][:, [0, 2, 1]] * FLIP, surface[1]),
        "mirror": (surface[0] * FLIP, surface[1][:, ::-1]), "person": other_lung([0.8, 0.7, 1.2]),
        "shifted": (np.where(first[:, None], surface[0], surface[0] + [0, 0, 150]), surface[1]),
        "range": (with_first(surface[0], 1e7), surface[1]), "finite": (with_first(surface[0], np.nan), surface[1]),
        "cut": None}),
    "scan": (write_lungs, ".ply", {  # at rest, of the person whose lungs the door has at full inflation
        RIGHT: (rest, surface[1]), "unit": (rest / 1000, surface[1]), "axes": (rest[:, [0, 2, 1]] * FLIP, surface[1]),
        "mirror": (rest * FLIP, surface[1][:, ::-1]), "person": person, "swapped": surface,
        "range": (with_first(rest, 1e7), surface[1]), "finite": (with_first(rest, np.nan), surface[1]), "cut": None}),
    "points": (write_points, ".csv", {
        RIGHT: named(within[:3]), "unit": named(within[:3] / 1000), "axes": named(within[:3] * RAS),
        "shifted": named(within[:3] + [0, 0, 400]), "repeated": [("p", *p) for p in within[:3]],
        "range": named(within[:3] * 1e7),
        "finite": named(with_first(within[:3], np.nan)), "cut": None}),
    "mesh": (write_lungs, ".ply", {  # inside the lungs
        RIGHT: (small, surface[1]), "unit": (small / 1000, surface[1]), "axes": (small * RAS, surface[1]),
        "shifted": (small + [0, 0, 400], surface[1]), "range": (with_first(small, 1e7), surface[1]),
        "finite": (with_first(small, np.nan), surface[1]), "cut": None}),
    "pairs": (write_pairs, ".csv", {
        RIGHT: pairs, "unit": pairs / 1000, "axes": pairs * columns(RAS), "mirror": pairs * columns(FLIP),
        "person": pairs * columns([1.25, 0.8, 0.9]) - columns([0, 60, 60]), "swapped": pairs[:, [3, 4, 5, 0, 1, 2]],
        "shifted": np.column_stack([pairs[1:, :3], pairs[:-1, 3:]]), "repeated": np.tile(pairs[:1], (len(pairs), 1)),
        "range": with_first(pairs, 1e7), "finite": with_first(pairs, np.nan), "cut": None}),
    "labels": (write_image, ".nrrd", {
        RIGHT: label, "unit": with_part(label, step=label["step"] / 1000, origin=label["origin"] / 1000),
        "axes": with_part(label, values=label["values"].transpose(1, 0, 2), step=label["step"][[0, 2, 1]]),
        "mirror": with_part(label, values=label["values"][:, :, ::-1]),
        "range": with_part(label, values=label["values"].astype(np.float32) * 1.5),
        "finite": with_part(label, values=np.where(label["values"] > 0, label["values"], np.nan).astype(np.float32)),
        "cut": None}),
    "segments": (write_segmentation, ".dcm", {  # of the lungs
        RIGHT: label, "unit": with_part(label, step=label["step"] / 1000, origin=label["origin"] / 1000),
        "mirror": with_part(label, values=label["values"][:, :, ::-1]), "swapped": with_part(label, codes=LIVER),
        "shifted": with_part(label, shift=1.0), "repeated": with_part(label, also=2), "cut": None}),
    "parts": (write_segmentation, ".dcm", {  # of what moves with the lungs
        RIGHT: label, "person": with_part(label, step=label["step"] * [0.8, 0.7, 0.9]),
        "swapped": with_part(label, origin=label["origin"] + [0, 0, 400], codes=LIVER),
        "shifted": with_part(label, shift=1.0), "repeated": with_part(label, also=2), "cut": None}),
    "dose": (write_nifti, ".nii.gz", {
        RIGHT: dose, "axes": with_part(dose, origin=dose["origin"] * RAS, step=dose["step"] * RAS),
        "shifted": with_part(dose, origin=dose["origin"] + [0, 0, 400]),
        "finite": with_part(dose, values=dose["values"] * np.float32(np.nan)), "cut": None}),
    "image": (write_image, ".nrrd", {
        RIGHT: ct, "unit": with_part(ct, values=(ct["values"] + 1000).astype(np.int16)),
        "axes": with_part(ct, origin=ct["origin"] * RAS, step=ct["step"] * RAS),
        "person": with_part(ct, step=ct["step"] * [0.8, 0.7, 0.9]),
        "shifted": with_part(ct, origin=ct["origin"] + [0, 0, 60]),
        "range": with_part(ct, values=(-ct["values"] - 810).astype(np.int16)),
        "finite": with_part(ct, values=np.full(ct["values"].shape, np.nan, np.float32)), "cut": None}),
    "frame": (write_image, ".nrrd", {  # an image of which only the grid of voxels counts
        RIGHT: ct, "unit": with_part(ct, step=ct["step"] / 1000, origin=ct["origin"] / 1000),
        "axes": with_part(ct, origin=ct["origin"] * RAS, step=ct["step"] * RAS),
        "shifted": with_part(ct, origin=ct["origin"] + [0, 0, 300])}),
    "fields": (write_fields, ".fields.st", {
        RIGHT: field, "unit": {**field, "displacement": field["displacement"] / 1000},
        "axes": {**field, "displacement": field["displacement"] * RAS},
        "mirror": {**field, "gravity": -field["gravity"]},
        "person": {**field, "points": field["points"] * [0.8, 0.7, 1.2]},
        "swapped": moved_rows(field, slice(None, None, -1)),
        "shifted": moved_rows(field, np.r_[1:40, 0]), "repeated": moved_rows(field, np.r_[0, 0, 2:40]),
        "range": {**field, "displacement": field["displacement"] * with_first(np.ones((40, 1, 1)), 10.0)},
        "finite": {**field, "displacement": field["displacement"] * with_first(np.ones((40, 1, 1)), np.nan)},
        "cut": None}),
    "basis": (write_bytes, ".st", {RIGHT: "lungs.st", "cut": None}),
    "observed": (write_points, ".csv", {
        RIGHT: named(observed), "unit": named(observed / 1000), "axes": named(observed * RAS),
        "mirror": named(observed * FLIP), "person": named(observed * [1.3, 0.75, 0.8]),
        "shifted": named(np.roll(observed, 1, axis=0)), "repeated": [("p0", *p) for p in observed],
        "range": named(with_first(observed, 1e7)), "finite": named(with_first(observed, np.nan)), "cut": None}),
    "registered": (write_points, ".csv", {  # points of a basis, at which its lungs are registered
        RIGHT: named(within[::9]), "unit": named(within[::9] / 1000), "axes": named(within[::9] * RAS),
        "mirror": named(within[::9] * FLIP), "shifted": named(within[::9] + [0, 0, 60]),
        "repeated": named(np.tile(within[:1], (5, 1))), "range": named(with_first(within[::9], 1e7)),
        "finite": named(with_first(within[::9], np.nan)), "cut": None}),
    "lines": (write_lines, ".csv", {  # of sight, from two places
        RIGHT: sights, "unit": sights / 1000, "axes": sights * columns(RAS), "mirror": sights * columns(FLIP),
        "shifted": np.column_stack([np.roll(sights[:, :3], 1, axis=0), sights[:, 3:]]),
        "repeated": np.tile(sights[:, 3:], 2), "range": with_first(sights, 1e7),
        "finite": with_first(sights, np.nan), "cut": None}),
    "lesion": (None, "", {RIGHT: lesion(within[0]), "unit": lesion(within[0] / 1000), "axes": lesion(within[0] * RAS),
                          "shifted": lesion(within[0] + [0, 0, 400]), "range": lesion(within[0], -3),
                          "finite": lesion(within[0], np.nan), "cut": lesion(within[0])[:-4]}),
    "patient": (write_text, ".json", {
        RIGHT: patient, "person": other_patient, "range": patient.replace(first_number, "1e30", 1),
        "finite": patient.replace(first_number, "NaN", 1), "cut": None}),
    "scanned": (None, "", {RIGHT: STATE, "swapped": "supine:full", "axes": STATE.replace("supine", "prone"),
                           "unit": "supine:rest+8", "range": "supine:rest+9000", "cut": "supine:rest+"}),
    "above": (None, "", {RIGHT: "300", "range": "9000", "finite": "nan", "repeated": "300 300"}),
    "volume": (None, "", {RIGHT: "rest+300", "unit": "4000", "range": "rest+9000", "finite": "rest+nan", "cut": "rest+",
                          "repeated": "rest+300+300"}),
    "state": (None, "", {RIGHT: "prone:rest", "unit": "prone:4000", "range": "prone:rest+9000", "finite": "prone:inf",
                         "cut": "pron", "repeated": "prone:rest:full"}),
    "posture": (None, "", {RIGHT: "left+15", "range": "left+100", "finite": "0:nan:0", "cut": "pron",
                           "repeated": "left+15+15"}),
    "gravity": (None, "", {RIGHT: "0,-1,0", "range": "0,0,0", "finite": "0,nan,0", "cut": "0,-1",
                           "repeated": "0,-1,0,0,-1,0"}),
    "breath": (None, "", {RIGHT: "500mL", "unit": "0.5mL", "range": "9000mL", "finite": "nanmL", "cut": "500"}),
    "height": (None, "", {RIGHT: "180", "unit": "1.8", "range": "500", "finite": "nan", "cut": ""}),
    "share": (None, "", {RIGHT: "left:0.5", "unit": "left:50", "range": "left:-1", "finite": "left:nan", "cut": "left:",
                         "repeated": "left:0.5:0.5"}),
    "pose": (None, "", {RIGHT: transform(), "range": transform((2, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0)),
                        "mirror": transform((-1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0)), "finite": transform((np.nan,) * 12),
                        "repeated": transform(status="INVALID")}),
}


# ---- Doors: a row for each input of each interface, with the type of its data, and a call with a file or a text.

def numbers(text):
    return [float(x) for x in text.split(",")]


def warp(path, kind_of_data="image", augment=False):
    """Move an image or labels of a file by the Python package."""
    image = next(value for kind, value in MISTAKES[kind_of_data][2].items() if f"-{kind}." in path)
    if image is None:  # cut short
        raise ValueError("no array")
    where = {"step": image["step"], "origin": image["origin"]}
    if augment:
        next(supine.augment(lungs, image["values"], states=["prone:rest"], grid=10, **where))
    else:
        grid.warp(image["values"], "prone:rest",
                  labels=kind_of_data == "labels", density=kind_of_data == "image", **where)


def dicom(*words):
    """Run the program on a DICOM object; return None if nothing here can write or read one."""
    return command(*words) if nibabel is not None and shutil.which("dcm2json") else None


def script(name, *words):
    """Run a script of the cohort; return the verdict and what it said, or None if it cannot run."""
    if nibabel is None:
        return None
    done = subprocess.run([sys.executable, os.path.join(SOURCE, "cohort", name), *words], capture_output=True,
                          text=True, check=False, env={**os.environ, "SUPINE": SUPINE})
    said = done.stderr + done.stdout
    assert "Traceback" not in said, said
    return verdict_of(done.returncode, said), said


def add_dose(path):
    """Add up the dose of a state."""
    shutil.rmtree("sum", ignore_errors=True)
    return script("dose.py", "grid.st", "ct.nii.gz", "states.csv", "sum", "--dose", path)


def written_all_the_same():
    """Return the commands that do not refuse an output in a folder that does not exist, by its name."""
    markups, image, new = "none/out.mrk.json", "none/out.nii.gz", "none/new"
    seen_points, moved = given("observed", RIGHT), ("deform", "grid.st", "--posture", "prone")
    return [f"{name}: {done}" for name, done in {
        markups: command("deform", "inside.st", "--posture", "prone", "-o", markups),
        "locate " + markups: command("locate", "lungs.st", seen_points, "--points", "inside.st", "--posture", "supine",
                                     "-o", markups),
        "compare " + markups: command("compare", "lungs.st", "--inside", "inside.st", "--postures", "supine,prone",
                                      "-o", markups),
        image: command(*moved, "--image", given("image", RIGHT), "--ventilation", image),
        "dose.py " + new: script("dose.py", "grid.st", "ct.nii.gz", "states.csv", new, "--dose", "ct.nii.gz"),
        "postures.py " + new: script("postures.py", "grid.st", "ct.nii.gz", "states.csv", new),
    }.items() if done is not None and (done[0] != "refused" or name.split()[-1] not in done[1])]


PAGE = {"posture": "posture", "link": "posture", "above": "above", "linked": "above"}  # inputs, and types of their data


@functools.lru_cache
def page():
    """Give the inputs of a page in Chromium their texts; return the verdicts, or nothing if it cannot run."""
    texts = [(name, text) for name, kind in PAGE.items() for text in MISTAKES[kind][2].values()]
    assert command("export", "lungs.st", "-o", "lungs.html")[0] == "taken"
    where = os.path.join(SOURCE, "tests/export")
    tools = {"MODULES": where, "CHROMIUM": shutil.which("chromium") or "", "SUPINE": SUPINE}
    done = subprocess.run(["node", os.path.join(where, "page_door.mjs"), "lungs.html", json.dumps(texts)],
                          capture_output=True, text=True, env={**tools, **os.environ}, check=False)
    assert done.returncode in (0, 77), done.stderr
    return dict(zip(texts, map(tuple, json.loads(done.stdout)))) if done.returncode == 0 else {}


DOORS = [
    ("precompute MESH", "command", "lungs", lambda x: command("precompute", x, *QUICK, "-o", "out.st")),
    ("precompute()", "Python", "lungs", lambda x: python(lambda: supine.precompute(x, band=3, held_out=5))),
    ("solve MESH", "command", "lungs", lambda x: command("solve", x, "--posture", "prone", "-o", "out.ply")),
    ("fit REST", "command", "scan",
     lambda x: command("fit", x, "full.ply", "--rest", STATE, "--other", "supine:full", "-o", "out.json")),
    ("fit --state", "command", "scan",
     lambda x: command("fit", "rest.ply", "full.ply", "--rest", STATE, "--other", "supine:full",
                       "--state", f"{STATE}:{x}", "-o", "out.json")),
    ("validate --state", "command", "scan", lambda x: command("validate", "lungs.st", "--state", f"{STATE}:{x}")),
    ("embed POINTS", "command", "points", lambda x: command("embed", "lungs.st", x, "-o", "out.st")),
    ("embed(file)", "Python", "points", lambda x: python(lambda: supine.embed(lungs, x))),
    ("embed MESH", "command", "mesh", lambda x: command("embed", "lungs.st", x, "-o", "out.st")),
    ("embed(mesh)", "Python", "mesh", lambda x: python(lambda: supine.embed(lungs, x))),
    ("fit --landmarks", "command", "pairs",
     lambda x: command("fit", "full.ply", "rest.ply", "--rest", "supine:full", "--other", STATE, "--landmarks", x,
                       "-o", "out.json")),
    ("validate --landmarks", "command", "pairs",
     lambda x: command("validate", "lungs.st", "--landmarks", x, "--from", "supine:full", "--to", STATE)),
    ("precompute LABELS", "command", "labels",
     lambda x: command("precompute", x, "--edge", 12, *QUICK, "-o", "out.st")),
    ("precompute(labels)", "Python", "labels",
     lambda x: python(lambda: supine.precompute(x, edge=12, band=3, held_out=5))),
    ("precompute SEGMENTATION", "command", "segments",
     lambda x: dicom("precompute", x, "--edge", 12, *QUICK, "-o", "out.st")),
    ("embed SEGMENTATION", "command", "parts",
     lambda x: dicom("embed", "lungs.st", x, "--labels", "all", "-o", "out.st")),
    ("deform --labels SEGMENTATION", "command", "parts",
     lambda x: dicom("deform", "grid.st", "--posture", "prone:rest", "--labels", x, "-o", "out.nrrd")),
    ("dose.py --dose", "script", "dose", add_dose),
    ("embed LABELS", "command", "labels", lambda x: command("embed", "lungs.st", x, "--labels", "all", "-o", "out.st")),
    ("embed IMAGE", "command", "frame", lambda x: command("embed", "lungs.st", x, "--grid", 10, "-o", "out.st")),
    ("deform --image", "command", "image",
     lambda x: command("deform", "grid.st", "--posture", "prone:rest", "--image", x, "--density", "-o", "out.nrrd")),
    ("deform --labels", "command", "labels",
     lambda x: command("deform", "grid.st", "--posture", "prone:rest", "--labels", x, "-o", "out.nrrd")),
    ("warp()", "Python", "image", lambda x: python(lambda: warp(x))),
    ("warp(labels)", "Python", "labels", lambda x: python(lambda: warp(x, "labels"))),
    ("augment()", "Python", "image", lambda x: python(lambda: warp(x, augment=True))),
    ("precompute --fields", "command", "fields",
     lambda x: command("precompute", "other.ply", "--fields", x, "-o", "out.st")),
    ("precompute(fields)", "Python", "fields", lambda x: python(lambda: supine.precompute("other.ply", fields=x))),
    ("deform BASIS", "command", "basis", lambda x: command("deform", x, "--posture", "prone", "-o", "out.ply")),
    ("info BASIS", "command", "basis", lambda x: command("info", x)),
    ("stream BASIS", "stream", "basis", lambda x: stream(x)),
    ("export BASIS", "command", "basis", lambda x: command("export", x, "-o", "out.html")),
    ("open(path)", "Python", "basis", lambda x: python(lambda: supine.open(x))),
    ("open()", "JavaScript", "basis", lambda x: javascript("prone", x)),
    ("deform --volume", "command", "volume",
     lambda x: command("deform", "lungs.st", "--posture", "prone", "--volume", x, "-o", "out.ply")),
    ("compare --volume", "command", "volume",
     lambda x: command("compare", "lungs.st", "--postures", "supine,prone", "--volume", x)),
    ("stream --volume", "stream", "volume", lambda x: stream("lungs.st", "--volume", x)),
    ("supine_state_join", "C", "volume", lambda x: python(lambda: pose_in_c(lungs, "prone", x))),
    ("pose(, volume)", "Python", "volume", lambda x: python(lambda: lungs.pose("prone", x))),
    ("pose({volume})", "JavaScript", "volume", lambda x: javascript({"gravity": [0, -1, 0], "volume": x}, "lungs.st")),
    ("deform --posture", "command", "state", lambda x: command("deform", "lungs.st", "--posture", x, "-o", "out.ply")),
    ("compare --postures", "command", "state", lambda x: command("compare", "lungs.st", "--postures", "supine," + x)),
    ("render --posture", "command", "state",
     lambda x: command("render", "lungs.st", "--posture", x, "--size", "320x240", "-o", "out.png")),
    ("supine_state_parse", "C", "state", lambda x: python(lambda: pose_in_c(lungs, x))),
    ("pose()", "Python", "state", lambda x: python(lambda: lungs.pose(x))),
    ("pose()", "JavaScript", "state", lambda x: javascript(x, "lungs.st")),
    ("solve --posture", "command", "posture", lambda x: command("solve", "other.ply", "--posture", x, "-o", "out.ply")),
    ("gravity()", "Python", "posture", lambda x: python(lambda: supine.gravity(x))),
    ("posture", "page", "posture", lambda x: page().get(("posture", x))),
    ("link", "page", "posture", lambda x: page().get(("link", x))),
    ("volume", "page", "above", lambda x: page().get(("above", x))),
    ("link, volume", "page", "above", lambda x: page().get(("linked", x))),
    ("VOLUME, number", "stream", "above",
     lambda x: stream("lungs.st", message=volume_number(float(x))) if x != "300 300" else None),
    ("VOLUME", "stream", "volume", lambda x: stream("lungs.st", message=volume_text(x))),
    ("locate OBSERVED", "command", "observed",
     lambda x: command("locate", "lungs.st", x, "--points", "inside.st", "--posture", "supine", "-o", "out.vtp")),
    ("locate LINES", "command", "lines",
     lambda x: command("locate", "lungs.st", x, "--points", "inside.st", "--posture", "supine", "-o", "out.vtp")),
    ("deform --frame", "command", "registered",
     lambda x: command("deform", "inside.st", "--posture", "prone", "--frame", x, "-o", "out.csv")),
    ("compare --frame", "command", "registered",
     lambda x: command("compare", "inside.st", "--postures", "supine,prone", "--frame", x)),
    ("precompute --lesion", "command", "lesion",
     lambda x: command("precompute", "full.ply", "--lesion", x, *QUICK, "-o", "out.st")),
    ("locate()", "Python", "observed",
     lambda x: None if "repeated" in x else  # it takes no names
     python(lambda: inside.locate(ROWS_INSIDE, np.loadtxt(x, delimiter=",", skiprows=1, usecols=(1, 2, 3))))),
    ("precompute --patient", "command", "patient",
     lambda x: command("precompute", "full.ply", "--patient", x, "--scanned", "full", *QUICK, "-o", "out.st")),
    ("precompute --patient --scanned", "command", "scanned",
     lambda x: command("precompute", "rest.ply", "--patient", "patient.json", "--scanned", x, *QUICK, "-o", "out.st")),
    ("precompute(patient, scanned)", "Python", "scanned",
     lambda x: python(lambda: supine.precompute("rest.ply", patient="patient.json", scanned=x, band=3, held_out=5))),
    ("precompute SCAN --patient", "command", "scan",  # of landmarks; the scan may be either of the two
     lambda x: None if "swapped" in x else command("precompute", x, "--patient", "marks.json", *QUICK, "-o", "out.st")),
    ("deform --gravity", "command", "gravity",
     lambda x: command("deform", "lungs.st", "--gravity", x, "-o", "out.ply")),
    ("pose([x, y, z])", "Python", "gravity", lambda x: python(lambda: lungs.pose(numbers(x)))),
    ("pose({gravity})", "JavaScript", "gravity", lambda x: javascript({"gravity": numbers(x)}, "lungs.st")),
    ("compare --breath", "command", "breath",
     lambda x: command("compare", "lungs.st", "--postures", "supine", "--breath", x)),
    ("export --breath", "command", "breath", lambda x: command("export", "lungs.st", "--breath", x, "-o", "out.html")),
    ("breathe --tidal", "command", "breath",
     lambda x: command("breathe", "lungs.st", "--posture", "prone", "--tidal", x, "--fps", 5, "-o", "out.vtp")),
    ("stream --tidal", "stream", "breath", lambda x: stream("lungs.st", "--tidal", x)),
    ("precompute --height", "command", "height",
     lambda x: command("precompute", "full.ply", "--height", x, "--sex", "male", *QUICK, "-o", "out.st")),
    ("precompute(height)", "Python", "height",
     lambda x: python(lambda: supine.precompute("full.ply", height=x, sex="male", band=3, held_out=5))),
    ("precompute --lung", "command", "share",
     lambda x: command("precompute", "full.ply", "--lung", x, *QUICK, "-o", "out.st")),
    ("precompute(lung)", "Python", "share",
     lambda x: python(lambda: supine.precompute("full.ply", lung=x, band=3, held_out=5))),
    ("TRANSFORM", "stream", "pose", lambda x: stream("lungs.st", "--device", "Patient", message=x)),
]

# The row of docs/inputs.md that judges a kind of mistake of a type. Without one, it must be told or refused.
ROWS = {("scan", "person"): "one-person", ("scan", "swapped"): "rest-most",
        ("points", "shifted"): "point-outside", ("points", "range"): "point-outside",
        ("points", "axes"): "point-outside",
        ("pairs", "swapped"): "landmarks-order", ("labels", "range"): "label-value",
        ("image", "range"): "ct-air", ("image", "axes"): "ct-frame",
        ("fields", "unit"): "fields-unit", ("fields", "range"): "fields-run-size",
        ("fields", "shifted"): "fields-run-error", ("fields", "swapped"): "fields-left-out",
        ("volume", "range"): "volume-most", ("volume", "finite"): "volume-finite", ("state", "range"): "volume-most",
        ("state", "finite"): "volume-finite", ("state", "cut"): "suggestion", ("posture", "range"): "tilt",
        ("breath", "range"): "breath", ("pose", "repeated"): "tracker-invalid"}

# Mistakes that are taken today, or get different verdicts: door, kind, and the topic of the work that will mend them.
KNOWN = {}


# Mistakes in texts that different doors judge differently, and the topic of the work that will mend them.
DIFFERENT = {}


def given(kind_of_data, kind):
    """Return the file or the text of a type of data, with a mistake."""
    writer, ending, values = MISTAKES[kind_of_data]
    value = values[kind]
    if writer is None:
        return value
    name = f"{kind_of_data}-{kind}{ending}"
    writer(name, values[RIGHT] if kind == "cut" else value)
    if kind == "cut":
        os.truncate(name, os.path.getsize(name) * 3 // 5)
    return name


def expected(rows, kind_of_data, kind):
    """Return the verdicts that a mistake may have."""
    row = rows.get(ROWS.get((kind_of_data, kind)))
    if kind == RIGHT:
        return {"taken"}
    if row is None or row.name == b"suggestion" or not (row.refused == row.refused and row.told != row.told):
        return {"told", "refused"}
    return {"refused"}


def judge(rows, only):
    """Try every case; yield the door, the kind, whether the verdict is right, and what was said."""
    for name, interface, kind_of_data, call in DOORS:
        for kind in (RIGHT, *KINDS):
            if kind not in MISTAKES[kind_of_data][2] or only not in f"{interface} {name}":
                continue
            done = call(given(kind_of_data, kind))
            if done is None:
                continue
            said = " / ".join(done[1].strip().splitlines())[:150]
            print(f"{interface:10} {name:22} {kind:9} {done[0]:8} {said}", flush=True)
            right = done[0] in expected(rows, kind_of_data, kind)
            yield f"{interface} {name}", (kind_of_data, kind), right, done[0], f"{done[0]}: {said}"


def differences(verdicts):
    """Return the mistakes in texts that doors judge differently, and those of DIFFERENT that are mended."""
    faults = []
    for case, doors in verdicts.items():
        if MISTAKES[case[0]][0] is not None:  # files, which one door takes for lungs, another for what is inside
            continue
        differ = len(set(doors.values())) > 1
        if differ and case not in DIFFERENT:
            faults.append(f"{case}: one mistake, different verdicts: {doors}")
        elif case in DIFFERENT and not differ:
            faults.append(f"{case}: mended: delete its line in DIFFERENT")
    return faults


def silent_though_allowed():
    """Return the doors of the stream that say nothing of a volume that lungs cannot hold, where folds are allowed."""
    return [f"stream --allow-folds, {door}: {said}" for door, (verdict, said) in {
        "--volume": stream("lungs.st", "--allow-folds", "--volume", "full+2L"),
        "VOLUME": stream("lungs.st", "--allow-folds", message=volume_text("full+2L")),
        "a breath": stream("lungs.st", "--allow-folds"),
    }.items() if verdict != ("taken" if door == "a breath" else "told")]


def main():
    rows = {row.name.decode(): row for row in table()}
    faults = [f"ROWS names {name}, which docs/inputs.md lacks" for name in set(ROWS.values()) - set(rows)]
    count = known = 0
    verdicts, only = {}, sys.argv[2] if len(sys.argv) > 2 else ""
    for door, case, right, verdict, said in judge(rows, only):
        count += 1
        kind = case[1]
        topic = KNOWN.get((door, kind))
        if not topic:
            verdicts.setdefault(case, {})[door] = verdict
        known += topic is not None
        if right and topic:
            faults.append(f"{door}, {kind}: mended: delete its line in KNOWN")
        elif not right and not topic:
            faults.append(f"{door}, {kind}: {said}")
    faults += [] if only else differences(verdicts) + silent_though_allowed() + written_all_the_same()
    print("\n".join(faults) or f"{count} cases at {len(DOORS)} doors, of which {known} are known to be taken")
    return 1 if faults else 0


leave(main())
