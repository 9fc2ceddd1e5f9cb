# SPDX-License-Identifier: GPL-3.0-or-later
"""Make bases of real lungs with two builds of the program, and compare them tensor by tensor. With each basis, compare
the surfaces that both programs write in several states byte by byte, and the texts that they print line by line.

    python3 compare_bases.py OLD_PROGRAM NEW_PROGRAM DATA_FOLDER

The environment variable ONLY=WORD leaves out the cases whose names do not have this word.
Print for each case the tensors, the entries of metadata, the surfaces and the lines of output that differ. The exit
status is 1 if anything differs. DATA_FOLDER has the folders lungs and covid (tests/README.md)."""
import difflib
import json
import os
import re
import subprocess
import sys
import tempfile

import numpy as np

old, new, data = (os.path.abspath(path) for path in sys.argv[1:4])
LUNGS = [f"{data}/lungs/chaste_{side}_5k.obj" for side in ("left", "right")]
COVID = {number: [f"{data}/covid/covid{number}_{side}.ply" for side in ("left", "right")] + ["--axes", "RAS"]
         for number in ("001", "002", "005")}
CASES = {
    "full": LUNGS,
    "full, another pair": COVID["001"],
    "at rest": COVID["002"] + ["--scanned", "supine:rest"],
    "at rest on the left": COVID["005"] + ["--scanned", "left:rest+200", "--resting", "supine=0.5"],
    "unknown state": LUNGS + ["--scanned", "none"],
    "law paper": LUNGS + ["--law", "paper"],
    "softened": COVID["001"] + ["--soften", "2"],
    "expandability varies": COVID["001"] + ["--expandability", "linear:z:0.5:1.5"],
    "lesion and collapse at rest": COVID["002"] + ["--scanned", "supine:rest", "--lung", "left:0.4",
                                                   "--lesion", "-80,100,-100,60,4"],
    "collapse": LUNGS + ["--lung", "right:0.5"],
    "harmonics": LUNGS + ["--band", "3", "--modes", "harmonics"],
    "few modes, no normals": COVID["002"] + ["--modes", "3", "--without-normals"],
    "a patient's law": LUNGS + ["--patient", "PATIENT"],
    "fields": LUNGS[:1] + ["--fields", "FIELDS"],
    "fields, scanned supine": LUNGS[:1] + ["--fields", "FIELDS", "--scanned", "supine", "--modes", "5", "--band", "2"],
}


def read_vertices(path):
    with open(path, encoding="ascii") as file:
        return np.array([line.split()[1:4] for line in file if line.startswith("v ")], float)


def write_pairs(path):
    """Write landmarks on both surfaces, which a breath moves up and to the front, more so near the base and the
    back."""
    full = np.vstack([read_vertices(file)[::40] for file in LUNGS])
    part = (full - full.min(0)) / np.ptp(full, axis=0)
    rest = full + np.stack([4 * (0.5 - part[:, 0]), -12 * part[:, 1], 28 * (1 - part[:, 2]) ** 1.3], 1)
    rest += np.random.default_rng(3).normal(size=rest.shape)
    np.savetxt(path, np.hstack([rest, full]), fmt="%.3f", delimiter=",", header="x,y,z,to_x,to_y,to_z", comments="")


def write_fields(path):
    """Write smooth displacements of the first surface for 40 directions of gravity, as another simulator would."""
    points = read_vertices(LUNGS[0])
    random = np.random.default_rng(7)
    gravity = random.normal(size=(40, 3))
    gravity /= np.linalg.norm(gravity, axis=1)[:, None]
    waves, phases = random.normal(size=(3, 3, 3)) / 90, random.normal(size=(3, 3))
    matrices = 4 * np.sin(np.einsum("nk,ijk->nij", points - points.mean(0), waves) + phases)
    moved = np.einsum("nij,mj->mni", matrices, gravity + 0.3 * gravity**2)
    tensors = {"points": points, "gravity": gravity, "displacement": moved}
    header, body = {}, b""
    for name, tensor in tensors.items():
        numbers = np.ascontiguousarray(tensor, "<f4").tobytes()
        header[name] = {"dtype": "F32", "shape": list(tensor.shape),
                        "data_offsets": [len(body), len(body) + len(numbers)]}
        body += numbers
    text = json.dumps(header).encode()
    with open(path, "wb") as file:
        file.write(len(text).to_bytes(8, "little") + text + body)


# Commands that read a basis. A state that a basis cannot show is refused, by the same text.
READ = [["info", "BASIS"], ["info", "BASIS", "--json"],
        ["deform", "BASIS", "--posture", "prone", "-o", "OUT.ply"],
        ["deform", "BASIS", "--posture", "left:rest+400", "-o", "OUT.vtp"],
        ["deform", "BASIS", "--posture", "upright:scan+300", "-o", "OUT.obj"],
        ["compare", "BASIS", "--postures", "supine,prone,right"],
        ["breathe", "BASIS", "--posture", "supine", "--fps", "2", "-o", "OUT.safetensors"],
        ["export", "BASIS", "-o", "OUT.glb"]]
# Texts and patient.json of fits to landmarks.
FITS = [["fit", "--landmarks", "pairs.csv", "--law", law, "--rest", "2600mL", "--other", "5400mL", "-o", "OUT.json"]
        for law in ("deep", "paper")]
KINDS = {"F32": "<f4", "F64": "<f8", "U32": "<u4", "U8": "u1", "I8": "i1", "U16": "<u2", "I16": "<i2"}


def run(program, words, folder, places):
    """Run a command in a folder; return what it said and wrote, without the name of the program."""
    words = [places.get(word, word) for word in words]
    result = subprocess.run([program, *words], cwd=folder, capture_output=True, text=True, check=False)
    wrote = {}
    for name in [word for word in words if word.startswith("OUT.") and os.path.exists(os.path.join(folder, word))]:
        with open(os.path.join(folder, name), "rb") as file:
            wrote[name] = file.read().replace(program.encode(), b"supine")
        os.remove(os.path.join(folder, name))
    said = re.sub("(?m)^compute time per frame: .*\n", "", result.stdout + result.stderr)
    return said.replace(program, "supine"), wrote


def open_basis(path):
    """Return the tensors and the metadata of a basis; nothing if there is none."""
    if not os.path.exists(path):
        return {}, {}
    with open(path, "rb") as file:
        content = file.read()
    size = int.from_bytes(content[:8], "little")
    header = json.loads(content[8:8 + size])
    metadata = header.pop("__metadata__")
    del metadata["checksum"], metadata["made_by"]
    tensors = {name: np.frombuffer(content[8 + size:][slice(*about["data_offsets"])], KINDS[about["dtype"]])
               .reshape(about["shape"]) for name, about in header.items()}
    return tensors, metadata


def text_differences(before, after):
    return [line for line in difflib.unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=0)
            if not line.startswith(("---", "+++", "@@"))]


def tensor_differences(before, after):
    for name in sorted(before.keys() | after.keys()):
        a, b = before.get(name), after.get(name)
        if a is None or b is None or a.shape != b.shape:
            yield f"tensor {name}: {None if a is None else a.shape} and {None if b is None else b.shape}"
        elif a.tobytes() != b.tobytes():
            scale = np.abs(a.astype(float)).max()
            yield f"tensor {name}: differs by {np.abs(a.astype(float) - b).max() / scale:.2g} of its largest value"


def compare_runs(words, folder, places):
    """Compare what both programs say and write."""
    (said, wrote), (says, writes) = (run(program, words, folder, places[program]) for program in (old, new))
    found = [f"{' '.join(words)}: {line}" for line in text_differences(said, says)]
    for name in sorted(wrote.keys() | writes.keys()):
        if wrote.get(name) != writes.get(name):
            sizes = f"{len(wrote.get(name, b''))} and {len(writes.get(name, b''))}"
            found.append(f"{' '.join(words)}: {sizes} bytes differ")
    return found


def compare(name, words, folder):
    few = [] if "FIELDS" in words else ["--held-out", "100"]  # directions, to save time
    places = {old: {"BASIS": "old.safetensors"}, new: {"BASIS": "new.safetensors"}}
    for program in (old, new):
        places[program] |= {"FIELDS": "fields.safetensors", "PATIENT": "patient.json"}
        path = os.path.join(folder, places[program]["BASIS"])
        if os.path.exists(path):
            os.remove(path)
    said, says = (run(program, ["precompute", *words, *few, "-o", places[program]["BASIS"]], folder, places[program])[0]
                  .replace(places[program]["BASIS"], "basis") for program in (old, new))
    first, second = (open_basis(os.path.join(folder, places[program]["BASIS"])) for program in (old, new))
    found = [*tensor_differences(first[0], second[0]), *text_differences(said, says)]
    for key in sorted(first[1].keys() | second[1].keys()):
        if first[1].get(key) != second[1].get(key):
            found.append(f"metadata {key}: {first[1].get(key)} and {second[1].get(key)}")
    if second[0]:  # both programs read the new basis, so that its name is the same
        places[old]["BASIS"] = places[new]["BASIS"]
        for command in READ:
            found += compare_runs(command, folder, places)
    print(f"{name}: {len(second[0])} tensors, {second[1].get('mode_count')} modes, {len(READ)} commands:",
          "equal" if not found else "", flush=True)
    for line in found:
        print("   ", line)
    return found


def compare_fits(folder):
    found = []
    for words in FITS:
        found += compare_runs(words, folder, {old: {}, new: {}})
    print("fits:", "equal" if not found else "", *found, sep="\n    " if found else " ", flush=True)
    return found


with tempfile.TemporaryDirectory() as work:
    write_fields(os.path.join(work, "fields.safetensors"))
    write_pairs(os.path.join(work, "pairs.csv"))
    differs = bool(compare_fits(work))
    subprocess.run([new, *FITS[0][:-1], "patient.json"], cwd=work, capture_output=True, check=True)
    sys.exit(1 if any([compare(name, words, work) for name, words in CASES.items()
                      if os.environ.get("ONLY", "") in name]) or differs else 0)
