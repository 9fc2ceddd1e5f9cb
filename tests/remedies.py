# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow each advice of the program, and check the result: give the command an input that it refuses or tells of, do
what the message says, and compare the lungs that come out with those of the right input.

    /usr/bin/python3 tests/remedies.py [BUILD_FOLDER [CASE]]

CASES has a row for each mistake: the words of the command, the words without the mistake (None if the advised argument
accepts the input as it is), and which of the advised arguments bring the result of the right words; the others must be
accepted. An argument that a library advises and no case follows is listed in NOT_FOLLOWED, with the reason."""
import glob
import os
import re
import subprocess
import sys

from helpers.verdict import (SOURCE, SUPINE, command, leave, supine, voxels_of, write_image, write_pairs, write_ply,
                             write_points)
import numpy as np

LUNGS = [os.path.join(SOURCE, "examples/lungs", side + ".obj") for side in ("left", "right")]
QUICK = ("--band", "3", "--held-out", "5")
STATE = "supine:rest+800"
RAS, FLIP = np.array([-1.0, -1, 1]), np.array([-1.0, 1, 1])


def make(*words):
    done = command(*words)
    assert done[0] != "refused", done


make("precompute", *LUNGS, *QUICK, "-o", "lungs.st")
make("embed", "lungs.st", "--grid", 8, "-o", "grid.st")
lungs, grid = supine.open("lungs.st"), supine.open("grid.st")
surface, faces = lungs.vertices.astype(float), lungs.triangles
state_of = lambda basis, state: basis.deform(basis.pose(state)).astype(float)


def write_inputs():
    """Write right inputs and such with a mistake."""
    for name, scale in (("right", 1), ("ras", RAS), ("mirrored", FLIP), ("metres", 1e-3), ("mouse", 1 / 22),
                        ("small", 0.9)):
        write_ply(name + ".ply", surface * scale, faces[:, ::-1] if name == "mirrored" else faces)
    write_ply("rest.ply", state_of(lungs, STATE), faces)
    make("fit", "rest.ply", "right.ply", "--rest", STATE, "--other", "supine:full", "-o", "patient.json")
    image = voxels_of(grid)
    sides = image["values"]
    height = np.indices(sides.shape)[0] / len(sides)
    lobes = np.where(sides == 1, 1 + (height < 0.5), np.where(sides == 2, 3 + (height < 0.6) + (height < 0.4), 0))
    lobes = lobes.astype(np.uint8)
    organs = np.where(lobes > 0, lobes + 9, 0).astype(np.uint8)
    organs[0, 0, 0] = 51
    right_first = np.array([0, 4, 5, 1, 2, 3], np.uint8)[lobes]
    maps = {"lobes": lobes, "lobes_mirrored": lobes[:, :, ::-1], "lobes_of_right": right_first, "organs": organs,
            "one": (sides == 1).astype(np.uint8), "sides": sides}
    for name, values in maps.items():
        write_image(name + ".nrrd", {**image, "values": values})
    write_image("mouse.nrrd", {**image, "step": image["step"] / 22, "origin": image["origin"] / 22})
    ct = np.where(sides > 0, 60, 40).astype(np.int16)
    write_image("solid.nrrd", {**image, "values": ct})
    deep = np.asarray(grid.tensor("depth")).ravel() > 12
    within = grid.vertices[deep].astype(float)[::40]
    write_points("far.csv", [("far", *(within[0] + [0, 0, 400]))])
    pairs = np.column_stack([within, state_of(grid, STATE)[deep][::40]])
    write_pairs("pairs.csv", pairs)
    write_pairs("swapped.csv", pairs[:, [3, 4, 5, 0, 1, 2]])
    write_pairs("moved.csv", pairs[:, [3, 4, 5, 0, 1, 2]] + [0, 0, 0, 0, 0, 150])


def precompute(*words, end=QUICK):
    return ("precompute", *words, *end, "-o", "out.st")


MAP = ("--edge", "12")
PERSON = ("--height", "190cm", "--sex", "male")
VALIDATE = ("validate", "lungs.st", "--from", "supine:full")
CASES = {
    "axes": (precompute("ras.ply"), precompute("right.ply"), {"axes"}),
    "mirrored axes": (precompute("mirrored.ply"), precompute("right.ply"), {"axes"}),
    "unit": (precompute("metres.ply"), precompute("right.ply"), {"units m"}),
    "mouse": (precompute("mouse.ply", "--law", "paper"), None, set()),
    "mouse as a map": (precompute("mouse.nrrd", "--edge", "0.5", "--law", "paper"), None, set()),
    "mirrored lobes": (precompute("lobes_mirrored.nrrd", *MAP), precompute("lobes.nrrd", *MAP), {"axes"}),
    "lobes in another order": (precompute("lobes_of_right.nrrd", *MAP), precompute("lobes.nrrd", *MAP),
                               {"labels"}),
    "labels of lungs": (precompute("organs.nrrd", *MAP), precompute("lobes.nrrd", *MAP), {"labels"}),
    "one lung": (precompute("one.nrrd", *MAP), precompute("one.nrrd", *MAP, "--labels", "left=1"),
                 {"labels"}),
    "side of a lung": (precompute(LUNGS[0]), None, set()),
    "unit of a map": (precompute("sides.nrrd", "--units", "cm", *MAP), precompute("sides.nrrd", *MAP), {"units"}),
    "labels of a surface": (precompute("right.ply", "--labels", "one"), precompute("right.ply"), {"labels"}),
    "edge of a surface": (precompute("right.ply", "--edge", "3"), precompute("right.ply"), {"edge"}),
    "close of a surface": (precompute("right.ply", "--close", "3"), precompute("right.ply"), {"close"}),
    "surfaces of a surface": (precompute("right.ply", "--surfaces-out", "x.ply"), precompute("right.ply"),
                              {"surfaces-out"}),
    "small at full inflation": (precompute("small.ply", *PERSON),
                                precompute("small.ply", *PERSON, "--scanned", "supine:rest"), {"scanned"}),
    "large at rest": (precompute("right.ply", "--scanned", "supine:rest"), None, set()),
    "rest above full": (precompute("right.ply", "--resting", "supine=7500mL"), None, set()),
    "fitted in another state": (precompute("rest.ply", "--patient", "patient.json", "--scanned", "supine:full"),
                                precompute("rest.ply", "--patient", "patient.json"), {"scanned"}),
    "law and scanned": (precompute("right.ply", "--law", "paper", "--scanned", "supine:rest+1000"),
                        precompute("right.ply", "--law", "paper"), {"scanned"}),
    "full": (precompute("right.ply", "--full", "8000mL"), precompute("right.ply"), {"full"}),
    "band of harmonics": (precompute("right.ply", "--modes", "harmonics", end=("--band", "17", "--held-out", "5")),
                          None, set()),
    "softening without reach": (precompute("right.ply", "--law", "paper", "--soften", "5"),
                                precompute("right.ply", "--law", "paper"), {"soften"}),
    "volume that lungs cannot hold": (("deform", "lungs.st", "--posture", "supine:full+1800", "-o", "out.ply"),
                                      None, set()),
    "far point": (("embed", "lungs.st", "far.csv", "-o", "out.st"), None, set()),
    "density without air": (("deform", "grid.st", "--posture", "prone:rest", "--image", "solid.nrrd", "--density",
                             "-o", "moved.nrrd"), None, set()),
    "reversed landmarks": ((*VALIDATE, "--landmarks", "swapped.csv", "--to", STATE),
                           (*VALIDATE, "--landmarks", "pairs.csv", "--to", STATE), {"reverse"}),
    "reversed landmarks of a fit": (("fit", "rest.ply", "right.ply", "--rest", STATE, "--other", "supine:full",
                                     "--landmarks", "pairs.csv", "-o", "out.json"), None, set()),
    "landmarks of moved scans": (("fit", "--landmarks", "moved.csv", "--rest", "2600mL", "--other", "7600mL",
                                  "-o", "out.json"), None, set()),
    "landmarks without a state": (("validate", "lungs.st", "--landmarks", "pairs.csv"), None, set()),
}
NOT_FOLLOWED = {
    "expandability": "needs a patient's file with stiffness, which takes a minute",
    "rest": "of a fit to landmarks alone: the other volume is needed, too"}


SWITCHES = ("allow-folds", "clamp", "density", "reverse", "rigid", "translation")
ADVICE = re.compile(r"[Gg]ive --([a-z-]+)(?:, such as)?(?: (?!if\b|to\b|or\b|for\b)(\S+?)(?=[,;]?(?:\s|$)))?"
                    r"|[Ll]eave --([a-z-]+) out")


def run(words):
    """Run the program; return its exit code and all that it said, on one line."""
    done = subprocess.run([SUPINE, *words], capture_output=True, text=True, check=False)
    return done.returncode, " ".join(done.stderr.split()), done.stdout


def advice(said):
    """Return the arguments and values of all advice that says enough to be followed: the value of a switch is "", that
    of an argument to leave out None."""
    found = [(give or omit, value or ("" if give else None)) for give, value, omit in ADVICE.findall(said)]
    return [(name, value) for name, value in found if value != "" or name in SWITCHES]


def follow(words, name, value):
    """Return the words with an option set or left out."""
    words, option = list(words), "--" + name
    if option in words:
        at = words.index(option)
        del words[at:at + (1 if name in SWITCHES else 2)]
    if value is None:
        return words
    return words + ([option] if value == "" else [option, value])


def result(words):
    """Return what a command brings: the boxes of the lungs of a basis, about their centre, and the volumes, or else
    what it prints."""
    code, said, printed = run(words)
    assert code == 0, (words, said)
    if words[0] != "precompute":
        return printed
    basis = supine.open("out.st")
    lung = basis.tensor("lung")
    sides = np.zeros(len(basis.vertices)) if lung is None else np.asarray(lung).ravel()
    boxes = [f(basis.vertices[sides == side], axis=0) for side in np.unique(sides) for f in (np.min, np.max)]
    return np.concatenate([np.ravel(boxes - np.mean(boxes, axis=0)), np.cbrt(basis.volumes(basis.pose("supine")))])


def same(first, second):
    if isinstance(first, str) or len(first) != len(second):
        return isinstance(first, str) and first == second
    return bool(np.abs(first - second).max() < 2.0)  # mm; surfaces of a mirrored map differ so much


def judge(name, wrong, right, exact):
    """Follow the advice of a case; return the arguments that were followed, and the faults."""
    code, said, _ = run(wrong)
    found = advice(said)
    print(f"{name}: {said[-240:]}", flush=True)
    if not found:
        return set(), [f"{name}: no advice: {said}"]
    faults, followed = [], set()
    for argument, value in found:
        words = follow(wrong, argument, value)
        done, now, _ = run(words)
        text = f"--{argument} {'' if value is None else value}".strip()
        followed.add(argument)
        if done != 0:
            faults.append(f"{name}: {text} is refused: {now}")
        elif {argument, text[2:]} & exact and not same(result(words), result(right)):
            faults.append(f"{name}: {text} brings other lungs: {result(words)}, not {result(right)}")
    missing = {text.split()[0] for text in exact} - followed
    return followed, faults + [f"{name}: {missing} not advised: {said}"] * bool(missing)


def advised():
    """Return the arguments that libraries advise to give with a value, to set or to leave out."""
    found = set()
    for part in ("mesh", "precompute", "runtime", "sh"):
        for path in glob.glob(f"{SOURCE}/{part}/**/*.c", recursive=True):
            with open(path, encoding="utf-8") as file:
                found |= set(re.findall(r'supine_remedy_(?:give|such_as|set|omit)\(\s*"(\w+)"(?!, "",)', file.read()))
    return {name.replace("_", "-") for name in found}


def main():
    write_inputs()
    only = sys.argv[2] if len(sys.argv) > 2 else ""
    followed, faults = set(), []
    for name, case in CASES.items():
        if only in name:
            done, wrong = judge(name, *case)
            followed |= done
            faults += wrong
    if not only:
        missing = sorted(advised() - followed - NOT_FOLLOWED.keys())
        faults += [f"{name}: advised, but no case follows it" for name in missing]
        faults += [f"{name}: in NOT_FOLLOWED, but followed" for name in sorted(NOT_FOLLOWED.keys() & followed)]
    print("\n".join(faults) or f"{len(CASES)} mistakes: each advice was followed")
    return 1 if faults else 0


leave(main())
