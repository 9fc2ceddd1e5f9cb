# SPDX-License-Identifier: GPL-3.0-or-later
"""Make bases of real lungs with two builds of the program, and compare them tensor by tensor.

    python3 compare_bases.py OLD_PROGRAM NEW_PROGRAM DATA_FOLDER

Print for each case the tensors, the entries of metadata and the lines of output that differ. The exit status is 1 if
anything differs. DATA_FOLDER has the folders lungs and covid (tests/README.md)."""
import difflib
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

old, new, data = sys.argv[1:4]
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
    "fields": LUNGS[:1] + ["--fields", "FIELDS"],
    "fields, scanned supine": LUNGS[:1] + ["--fields", "FIELDS", "--scanned", "supine", "--modes", "5", "--band", "2"],
}


def write_fields(path):
    """Write smooth displacements of the first surface for 40 directions of gravity, as another simulator would."""
    with open(LUNGS[0], encoding="ascii") as file:
        points = np.array([line.split()[1:4] for line in file if line.startswith("v ")], float)
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
        header[name] = {"dtype": "F32", "shape": list(tensor.shape), "data_offsets": [len(body), len(body) + len(numbers)]}
        body += numbers
    text = json.dumps(header).encode()
    with open(path, "wb") as file:
        file.write(len(text).to_bytes(8, "little") + text + body)


def make(program, words, folder):
    path = os.path.join(folder, "basis.safetensors")
    fields = os.path.join(folder, "fields.safetensors")
    words = [fields if word == "FIELDS" else word for word in words]
    few = [] if fields in words else ["--held-out", "100"]  # directions, to save time
    result = subprocess.run([program, "precompute", *words, *few, "-o", path], capture_output=True, text=True, check=False)
    said = result.stdout + result.stderr
    if result.returncode != 0:
        return {}, {}, said
    with open(path, "rb") as file:
        content = file.read()
    size = int.from_bytes(content[:8], "little")
    header = json.loads(content[8:8 + size])
    metadata = header.pop("__metadata__")
    del metadata["checksum"]
    metadata["made_by"] = metadata["made_by"].replace(program, "supine")
    kinds = {"F32": "<f4", "F64": "<f8", "U32": "<u4", "U8": "u1", "I8": "i1"}
    tensors = {name: np.frombuffer(content[8 + size:][slice(*about["data_offsets"])], kinds[about["dtype"]])
               .reshape(about["shape"]) for name, about in header.items()}
    return tensors, metadata, said


def compare(name, words, folder):
    first, second = (make(program, words, folder) for program in (old, new))
    found = []
    for tensor in sorted(first[0].keys() | second[0].keys()):
        a, b = first[0].get(tensor), second[0].get(tensor)
        if a is None or b is None or a.shape != b.shape:
            found.append(f"tensor {tensor}: {None if a is None else a.shape} and {None if b is None else b.shape}")
        elif a.tobytes() != b.tobytes():
            scale = np.abs(a.astype(float)).max()
            found.append(f"tensor {tensor}: differs by {np.abs(a.astype(float) - b).max() / scale:.2g} of its largest value")
    for key in sorted(first[1].keys() | second[1].keys()):
        if first[1].get(key) != second[1].get(key):
            found.append(f"metadata {key}: {first[1].get(key)} and {second[1].get(key)}")
    found += [line for line in difflib.unified_diff(first[2].splitlines(), second[2].splitlines(), lineterm="", n=0)
              if not line.startswith(("---", "+++", "@@"))]
    print(f"{name}: {len(second[0])} tensors, {second[1].get('mode_count')} modes:", "equal" if not found else "")
    for line in found:
        print("   ", line)
    return found


with tempfile.TemporaryDirectory() as work:
    write_fields(os.path.join(work, "fields.safetensors"))
    sys.exit(1 if any([compare(name, words, work) for name, words in CASES.items()]) else 0)
