# SPDX-License-Identifier: GPL-3.0-or-later
"""Run each command that README.md, docs/paper.md and tests/FIGURES.md quote, and check that each quoted program exists.
README may have up to 1,450 words.

    test_quoted.py SUPINE SOURCE BUILD
"""
import gzip
import json
import os
import re
import subprocess
import sys
import tempfile

sys.path.append(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from helpers import nifti  # noqa: E402

supine, source, build = map(os.path.abspath, sys.argv[1:4])
SERVERS = ("stream",)  # run until they are stopped; the tests of the stream run them
PLACEHOLDER = re.compile(r"[A-Z]{4,}")
failures = []


def run(*words):
    return subprocess.run([supine, *words], capture_output=True, text=True, check=False)


def make_inputs():
    """Write the files that the commands name into the current folder."""
    run("phantom", "--vertices", "500", "-o", "lungs.ply")
    run("precompute", "lungs.ply", "-o", "lungs.safetensors")
    run("phantom", "--vertices", "500", "-o", "lungs.obj")
    with open("lungs.obj", encoding="ascii") as file:
        lines = list(file)
    rows = {kind: [line for line in lines if line.startswith(kind)] for kind in ("v ", "f ")}
    half = len(rows["v "]) // 2  # the left lung comes first
    for side, begin in (("left", 0), ("right", half)):
        with open(side + ".obj", "w", encoding="ascii") as file:
            file.writelines(rows["v "][begin:begin + half])
            for line in rows["f "]:
                corners = [int(word.split("/")[0]) - begin for word in line.split()[1:]]
                if 0 < corners[0] <= half:
                    file.write("f %d %d %d\n" % tuple(corners))
    with open("nodules.csv", "w", encoding="ascii") as file:
        file.write("name,x,y,z\na,71,-150,-100\nb,90,-180,-140\n")
    with open("list.csv", "w", encoding="ascii") as file:
        file.write("posture,volume,output\nprone,rest,moved.nii.gz\n")
    run("embed", "lungs.safetensors", "nodules.csv", "-o", "inside.safetensors")
    run("embed", "lungs.safetensors", "--grid", "20", "-o", "grid.safetensors")
    run("deform", "inside.safetensors", "--posture", "prone", "-o", "seen.csv")
    with gzip.open("ct.nii.gz", "wb") as file:
        file.write(nifti.header((20, 20, 20), 16, ((20, 0, 0, -200), (0, 20, 0, -10), (0, 0, 20, -300))))
        file.write((-800).to_bytes(2, "little", signed=True) * 8000)


def check(code):
    """Run a quoted command, or check that the program or the option that it names exists."""
    words = code.split()
    if words[0] == "supine":
        named = len(words) == 2 or words[1] in SERVERS or PLACEHOLDER.search(code)
        done = run(*(words[1:2] + ["--help"] if named
                     else [re.sub(r"^(left|right)\.ply", r"\1.obj", word) for word in words[1:]]))
        if PLACEHOLDER.fullmatch(words[1]) is None and done.returncode != 0:
            failures.append(f"{code}: {done.stderr}")
    elif words[0].startswith("--") and len(words) > 1 and not PLACEHOLDER.search(code):
        done = run("precompute", "lungs.ply", *words, "-o", "other.safetensors")
        if done.returncode != 0 and "no option" not in done.stderr:
            failures.append(f"supine precompute lungs.ply {code}: {done.stderr}")
    elif words[0].startswith("tests/"):
        if not any(os.path.exists(os.path.join(folder, words[0])) for folder in (source, build)):
            failures.append(f"{code}: no such file")


def write_mask(name, side):
    """Write a mask in NIfTI with an ellipsoid, the lung on the side -1 (right) or 1 (left), in voxels of 8 mm."""
    size = 48
    voxels = bytearray(size ** 3)
    for z in range(size):
        for y in range(size):
            for x in range(size):
                p = (8 * x - 190, 8 * y - 190, 8 * z - 330)
                if ((p[0] + 85 * side) / 65) ** 2 + ((p[1] + 10) / 95) ** 2 + ((p[2] + 140) / 130) ** 2 < 1:
                    voxels[(z * size + y) * size + x] = 1
    with gzip.open(name, "wb") as file:
        file.write(nifti.header((size, size, size), 8, ((8, 0, 0, -190), (0, 8, 0, -190), (0, 0, 8, -330))) + voxels)


def check_readme():
    """Run the commands of README's first screen in their order, and count its words."""
    with open(os.path.join(source, "README.md"), encoding="utf-8") as file:
        text = file.read()
    words = len(text.split())
    if words > 1450:
        failures.append(f"README.md has {words} words, more than 1450")
    os.mkdir("readme")
    os.chdir("readme")
    os.mkdir("segmentation")
    write_mask("segmentation/lung_upper_lobe_left.nii.gz", 1)
    write_mask("segmentation/lung_upper_lobe_right.nii.gz", -1)
    point = {"label": "nodule", "position": [85, 10, -140]}
    with open("nodule.mrk.json", "w", encoding="ascii") as file:
        json.dump({"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": [point]}]}, file)
    lines = re.findall(r"^    (supine .*)$", text, re.M)
    if len(lines) < 3:
        failures.append("README.md shows no commands from a CT to a page")
    for line in lines:
        done = run(*line.split()[1:])
        if done.returncode != 0:
            failures.append(f"{line}: {done.stderr}")
    os.chdir("..")


def check_paper():
    """Run the commands of docs/paper.md in their order: those of its block, then those of its table's second column."""
    with open(os.path.join(source, "docs/paper.md"), encoding="utf-8") as file:
        text = file.read()
    column = [row.split("|")[2] for row in text.split("\n") if row.startswith("| ")]
    quoted = [code for cell in column for code in re.findall(r"`(supine [^`]+)`", cell)]
    lines = re.search(r"^```sh\n(.*?)^```$", text, re.M | re.S)[1].splitlines()
    lines += [code for code in dict.fromkeys(quoted) if code.split()[1] not in SERVERS]
    if len(lines) < 15:
        failures.append(f"docs/paper.md quotes {len(lines)} commands only")
    os.mkdir("paper")
    os.mkdir("bin")
    os.symlink(supine, "bin/supine")
    path = f"{os.getcwd()}/bin:{os.environ['PATH']}"
    for line in lines:
        done = subprocess.run(["sh", "-ec", line], cwd="paper", env={**os.environ, "PATH": path}, capture_output=True,
                              text=True, check=False)
        if done.returncode != 0:
            failures.append(f"docs/paper.md: {line}: {done.stderr}")


commands = []
for page in ("README.md", "tests/FIGURES.md"):
    with open(os.path.join(source, page), encoding="utf-8") as text:
        commands += re.findall(r"`([^`]+)`", re.sub(r"```.*?```", "", text.read(), flags=re.S))
with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    make_inputs()
    for command in dict.fromkeys(commands):
        check(command)
    check_readme()
    check_paper()
    os.chdir(source)
print("\n".join(failures) if failures else f"{len(set(commands))} quoted words and commands checked")
sys.exit(1 if failures else 0)
