#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run whole commands in which each allocation, and each call on files, fails in turn.

    faults.py PROGRAM LIBFAULTS [EACH] [WORD]
    faults.py PROGRAM            run each command once without faults, for a program built with a sanitizer

By default, a command runs once for each call that it makes, and in the n-th run the n-th call fails. If EACH is above
0, only about EACH of these runs are made, spread over all calls (CTest uses 3). If WORD is given, only commands that
contain WORD run.

Each run must end within a minute and without a signal. It must either write its complete outputs, or exit with a code
above 0 and a message that gives the reason. A run that fails must leave no file. It may leave no more blocks of memory
than a run without faults.
"""
import filecmp
import itertools
import json
import os
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

# Commands that make the input files. They run first, without faults.
BEFORE = """
phantom --vertices 100 -o lungs.ply
phantom --vertices 100 -o lungs.stl
phantom --vertices 100 -o lungs.obj
precompute lungs.ply --band 2 -o lungs.safetensors
solve lungs.ply --posture supine --reach 10 -o state.ply
embed lungs.safetensors points.csv -o points.safetensors
embed lungs.safetensors --grid 60 -o grid.safetensors
fit --landmarks pairs.csv --rest 2600mL --other 5400mL --law deep -o patient.json
pv fit samples.csv -o patient.pv.json
"""

# Commands to test, which write to the folder `out`.
COMMANDS = """
phantom --vertices 100 -o out/a.ply
phantom --vertices 100 -o out/a.obj
precompute lungs.ply --band 2 -o out/a.safetensors
precompute lungs.stl --band 2 --law paper --modes harmonics -o out/a.safetensors
precompute lungs.obj --band 2 --law paper --reach 10 --soften 1 -o out/a.safetensors
precompute lungs.ply --band 2 --lesion 0,0,0,5,3 --lung left:0.3 --scanned full-500 -o out/a.safetensors
precompute mask.nrrd --labels left=1,right=2 --edge 20 --band 2 --units mm -o out/a.safetensors
precompute lungs.ply --fields fields.safetensors -o out/a.safetensors
precompute lungs.ply --band 2 --patient patient.json -o out/a.safetensors
solve lungs.ply --posture prone -o out/a.vtp
solve lungs.ply --unit-force 3 -o out/a.csv
fit --landmarks pairs.csv --rest 2600mL --other 5400mL -o out/a.json
fit lungs.ply state.ply -o out/a.json
validate lungs.safetensors --state supine:state.ply
embed lungs.safetensors points.csv lungs.ply -o out/a.safetensors
embed lungs.safetensors image.nrrd -o out/a.safetensors
embed lungs.safetensors --grid 60 -o out/a.safetensors
embed lungs.safetensors mask.nrrd --labels all -o out/a.safetensors
info lungs.safetensors
info lungs.safetensors --json
deform lungs.safetensors --posture prone -o out/a.ply
deform lungs.safetensors --posture prone --volume rest+300 -o out/a.vtp
deform points.safetensors --allow-folds --posture prone -o out/a.csv
deform grid.safetensors --allow-folds --posture prone --inverse --field-out out/a.nrrd
deform grid.safetensors --allow-folds --posture prone --image image.nrrd -o out/a.nrrd
deform lungs.safetensors --posture prone --samples 2 -o out/a.safetensors
compare lungs.safetensors --postures supine,prone
compare lungs.safetensors --postures supine,prone --json
compare lungs.safetensors --postures supine,prone -o out/a.html
compare lungs.safetensors --inside points.safetensors --postures supine,prone -o out/a.mrk.json
compare points.safetensors --postures supine,prone
breathe lungs.safetensors --posture prone --fps 1 -o out/a.vtp
breathe lungs.safetensors --turn supine:left:1s --fps 2 --pv patient.pv.json -o out/a.safetensors
render lungs.safetensors --posture supine --size 300x200 -o out/a.png
render lungs.safetensors --turn supine:left:0.1s --size 300x200 -o out/a.webp
export lungs.safetensors -o out/a.html
export lungs.safetensors --inside points.safetensors -o out/a.html
export lungs.safetensors -o out/a.glb
export lungs.safetensors -o out/a.glb --plain --animate
export lungs.safetensors -o out/a.usda
locate lungs.safetensors points.csv --points points.safetensors --posture prone -o out/a.csv
locate lungs.safetensors points.csv --points points.safetensors --posture prone --samples 2 -o out/a.safetensors
pv show patient.pv.json
pv fit samples.csv -o out/a.csv
pv fit samples.csv --json
stream lungs.safetensors --listen 127.0.0.1:0 --seconds 0.05 --volume rest
"""

REASONS = {
    "memory": "memory",
    "file": "memory|No space left|Too many open files|Input/output error|Resource temporarily|"
            "Cannot allocate|short|truncated|changed",
}
# Libraries in which calls fail as in the program itself. In others (drivers, fonts, web server), none fails.
ALSO = {"memory": "gsl,jansson", "file": ""}
LIMIT = 60  # time limit of a command, s


class Trial:
    def __init__(self, program, library, folder):
        self.program, self.folder = program, folder
        # LD_PRELOAD needs a path without spaces
        self.library = library and shutil.copy(library, folder / "libfaults.so")
        self.out = folder / "out"
        self.report = folder / "report"
        self.environment = {"SUPINE_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **os.environ,
                            "LIBGL_ALWAYS_SOFTWARE": "1", "FAULT_REPORT": str(self.report)}

    def run(self, arguments, kind=None, nth=None):
        """Run the program. If `nth` is given, its nth call of this kind fails. Return the exit code, stdout, stderr,
        and the numbers of calls, of failed calls and of blocks not freed."""
        shutil.rmtree(self.out, ignore_errors=True)
        self.out.mkdir()
        self.report.unlink(missing_ok=True)
        environment = dict(self.environment)
        if kind is not None:
            environment.update(LD_PRELOAD=str(self.library), FAULT_KIND=kind, FAULT_ALSO=ALSO[kind])
        if nth is not None:
            environment["FAULT_NTH"] = str(nth)
        try:
            done = subprocess.run([self.program, *arguments], cwd=self.folder, env=environment,
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                  timeout=LIMIT if kind else None, check=False)
        except subprocess.TimeoutExpired:
            return None, b"", "", (0, 0, 0)
        said = re.sub(rb"[0-9.]+ ms", b"# ms", done.stdout)  # times vary between runs
        seen = tuple(map(int, self.report.read_text().split())) if self.report.exists() else None
        return done.returncode, said, done.stderr.decode(errors="replace"), seen

    def left(self):
        return sorted(p for p in self.out.rglob("*") if p.is_file())


def same_files(folder, kept):
    names = sorted(p.relative_to(folder) for p in folder.rglob("*") if p.is_file())
    return names == sorted(p.relative_to(kept) for p in kept.rglob("*") if p.is_file()) and all(
        filecmp.cmp(folder / name, kept / name, shallow=False) for name in names)


def what_is_wrong(trial, kind, kept, whole, result):
    """Return what is wrong with a run, or ''. `whole` is the result of the run without faults, `kept` its files."""
    code, said, words, seen = result
    if code is None:
        return f"did not end within {LIMIT} s"
    if code < 0:
        return f"signal {-code}"
    if seen is None:
        return "no report: it did not exit normally"
    if code == 0:
        if not same_files(trial.out, kept):
            return "reported success, but its files differ"
        if whole[1] is not None and said != whole[1]:
            return "reported success, but its output differs"
    else:
        if not re.search(REASONS[kind], words):
            return f"exit code {code} without the reason: {words.strip()!r}"
        if trial.left() or list(trial.out.iterdir()):
            return "left files: " + ", ".join(p.name for p in trial.out.iterdir())
    # After this message the program exits at once, without freeing its memory.
    ended = "supine: out of memory\n" in words
    if not ended and seen[2] > whole[3][2]:
        return f"{seen[2] - whole[3][2]} blocks were not freed (exit code {code})"
    return ""


def faultless(trial, arguments):
    """For each kind of fault, run the command once and only count the calls that could fail. Return the results of the
    runs with these counts. The text in stdout is None if the runs print different text."""
    runs = {kind: trial.run(arguments, kind) for kind in REASONS}
    same = len({run[1] for run in runs.values()}) == 1
    return {kind: (run[0], run[1] if same else None, *run[2:]) for kind, run in runs.items()}


def unnamed(trial, line):
    """Return what is wrong with the messages of a command whose outputs cannot be written: the folder is missing, is a
    file, or the disk is full. They must name the output as it was given."""
    found = []
    for name in re.findall(r"out/\S+", line):
        for kind, given in (("no folder", "missing/" + name), ("a file", "lungs.ply/" + name), ("full disk", "full")):
            if kind == "full disk":
                given = "full" + Path(name).suffix
                (trial.folder / given).unlink(missing_ok=True)
                (trial.folder / given).symlink_to("/dev/full")
            code, _, words, _ = trial.run([given if word == name else word for word in line.split()])
            if code not in (3, 4) or f": {given}: cannot write: " not in words and code == 4:
                found.append(f"{line}: {kind}: {code}, {words.strip()!r}")
    return found


def samples(folder):
    """Write the input files that the commands in BEFORE do not make."""
    (folder / "points.csv").write_text("name,x,y,z\ncarina,60,-180,-60\nnodule,-80,-120,-90\n")
    (folder / "samples.csv").write_text("pressure_cmH2O,volume_mL\n" + "".join(
        f"{p},{3000 / (1 + 2.718281828 ** ((8 - p) / 5)):.3f}\n" for p in range(-10, 36, 2)))
    (folder / "image.nrrd").write_text(
        "NRRD0004\ntype: float\ndimension: 3\nspace: LPS\nsizes: 6 6 5\nspace directions: "
        "(60,0,0) (0,60,0) (0,0,60)\nspace origin: (-150,-340,-260)\nencoding: ascii\n\n"
        + " ".join(str(i % 7) for i in range(180)) + "\n")
    (folder / "mask.nrrd").write_text(
        "NRRD0004\ntype: uchar\ndimension: 3\nspace: LPS\nsizes: 20 10 10\nspace directions: "
        "(20,0,0) (0,20,0) (0,0,20)\nspace origin: (-190,-290,-190)\nencoding: ascii\n\n"
        + " ".join(str(2 - i // 10 if (i % 10 - 4.5) ** 2 + (j - 4.5) ** 2 + (k - 4.5) ** 2 < 14 else 0)
                   for k in range(10) for j in range(10) for i in range(20)) + "\n")
    made = random.Random(7)
    rows = []
    for _ in range(30):
        x, y, z = made.uniform(-160, 150), made.uniform(-320, -75), made.uniform(-250, 20)
        rows.append(f"{x},{y},{z},{1.05 * x},{0.98 * y + 2},{1.1 * z - 1}\n")
    (folder / "pairs.csv").write_text("x,y,z,to_x,to_y,to_z\n" + "".join(rows))


def write_fields(folder):
    """Write displacements of the vertices of lungs.ply, which must exist, for gravity along the diagonals of a cube."""
    data = (folder / "lungs.ply").read_bytes()
    vertices = int(re.search(rb"element vertex (\d+)", data).group(1))
    points = struct.unpack_from(f"<{3 * vertices}f", data, data.index(b"end_header\n") + 11)
    gravity = list(itertools.product((-1, 1), repeat=3))
    moved = [(4 + 0.02 * points[3 * vertex]) * g for along in gravity for vertex in range(vertices) for g in along]
    arrays = {"points": ([vertices, 3], points), "gravity": ([len(gravity), 3], itertools.chain(*gravity)),
              "displacement": ([len(gravity), vertices, 3], moved)}
    header, values = {}, []
    for name, (shape, numbers) in arrays.items():
        begin = 8 * len(values)
        values += numbers
        header[name] = {"dtype": "F64", "shape": shape, "data_offsets": [begin, 8 * len(values)]}
    text = json.dumps(header).encode()
    (folder / "fields.safetensors").write_bytes(struct.pack(f"<Q{len(text)}s{len(values)}d", len(text), text, *values))


def main():
    program = Path(sys.argv[1]).resolve()
    library = Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else None
    each = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    word = sys.argv[4] if len(sys.argv) > 4 else ""
    faults = dict.fromkeys(REASONS, 0)
    wrong = []
    shared = "/dev/shm"  # a folder in memory, which is faster than a disk
    with tempfile.TemporaryDirectory(dir=shared if os.access(shared, os.W_OK) else None) as name:
        trial = Trial(program, library, Path(name))
        samples(trial.folder)
        for line in BEFORE.split("\n"):
            if line and trial.run(line.split())[0] != 0:
                sys.exit(f"{line}: {trial.run(line.split())[2]}")
        write_fields(trial.folder)
        kept = trial.folder / "kept"
        for line in filter(lambda text: text and word in text, COMMANDS.split("\n")):
            wrong += unnamed(trial, line)
            if library is None:
                code, _, words, _ = trial.run(line.split())
                print(f"{code}: {line}" if code == 0 else f"WRONG {code}: {line}: {words}", flush=True)
                wrong += [line] if code != 0 else []
                continue
            runs = faultless(trial, line.split())
            code, _, words, _ = runs["file"]
            if code == 3:
                print(f"skipped, not built: {line}")
                continue
            if code != 0:
                sys.exit(f"{line}: {code}, {words}")
            shutil.rmtree(kept, ignore_errors=True)
            shutil.copytree(trial.out, kept)
            for kind, whole in runs.items():
                count = whole[3][0]
                step = max(1, count // each) if each > 0 else 1
                tried = found = 0
                for nth in range(hash_of(line) % step, count, step):
                    result = trial.run(line.split(), kind, nth)
                    fault = what_is_wrong(trial, kind, kept, whole, result)
                    tried += 1
                    if fault:
                        found += 1
                        wrong.append(f"{line}: {kind} {nth}: {fault}")
                        print("WRONG " + wrong[-1], flush=True)
                faults[kind] += tried
                print(f"{kind:6} {tried:5} of {count:5} failed, {found} wrong: {line}", flush=True)
    tried = [f"{count} {kind} faults"
             for kind, count in faults.items()] if library else ["each command once, without faults"]
    print(f"{', '.join(tried)}: {len(wrong)} wrong")
    sys.exit(1 if wrong else 0)


def hash_of(text):
    """Return a number that depends only on the text. It selects the first call that fails."""
    return sum(text.encode())


if __name__ == "__main__":
    main()
