#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare two versions of the program: run each command in turn with the old and the new one.

    bench_versions.py path/to/old/supine path/to/new/supine [--vertices N] [--rounds R] [--folder F]
                      [--stream path/to/bench_stream] [--only WORD]

The old version makes the meshes, and each version its own bases. Print the least wall and processor seconds and the
largest memory of R rounds for both versions, and the ratios of new to old. Count the bytes in which outputs differ,
except in VTP. A row is missing if a version lacks the command. The library of a program must be
runtime/libsupine_runtime.so in the program's folder. --stream adds the median time from sending a pose to receiving its
last point, the least of R rounds. --only leaves out all but the commands whose name has WORD: with '--only render' the
ratio of the processor time of translucent shells to that of coloured lungs follows.

Versions before 0.3.0 wrote basis files of other formats. Expected differences from version 0.2.0:
- deform --image, --labels: the factors of a lung's displacement now differ between axes, which changes
  the order in which products are rounded. Displacements differ by one unit in the last place (3e-5 mm). About 1 %
  of the voxels of 16-bit noise therefore differ by 1, and 5 of 65 million labels differ.
- embed: the version in the header has another value and position, and the checksum differs. In large
  grids, one coefficient in 200,000 differs in the last place: Cholesky's factorisation replaced LU.
- render: pictures are drawn by the processor instead of OpenGL, with a grey shell and other names."""
import argparse
import gzip
import operator
import os
import shutil
import subprocess
import sys
import tempfile
import time

sys.path.append(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from helpers import nifti  # noqa: E402

VOXELS = (512, 512, 248)


def write_image(path, label):
    """Write a NIfTI image that covers the synthetic lungs, of 8-bit labels if `label`, else of 16-bit noise
    from -1024 to -769 HU, so that it holds air."""
    step, origin = (0.7, 0.7, 1.2), (-2.0 - 0.35 * 512, -173.0 - 0.35 * 512, -130.0 - 0.6 * 248)
    rows = ((-step[0], 0, 0, -origin[0]), (0, -step[1], 0, -origin[1]), (0, 0, step[2], origin[2]))
    with open(path, "wb") as file:
        file.write(nifti.header(VOXELS, 8 if label else 16, rows))
        for k in range(VOXELS[2]):
            if label:
                row = bytes(i >> 5 for i in range(VOXELS[0]))
                file.write(b"".join(bytes(v + (j >> 5) + k // 16 & 63 for v in row)
                                    for j in range(VOXELS[1])))
            else:
                plane = bytearray(b"\xfc" * (2 * VOXELS[0] * VOXELS[1]))  # -1024 to -769, as in air
                plane[::2] = os.urandom(VOXELS[0] * VOXELS[1])
                file.write(plane)


def run(command):
    """Run a command. Return its wall seconds, processor seconds and memory in MiB, or None if it fails."""
    start = time.perf_counter()
    null = os.open(os.devnull, os.O_WRONLY)
    child = os.posix_spawn(command[0], command, os.environ,
                           file_actions=[(os.POSIX_SPAWN_DUP2, null, 1)])
    os.close(null)
    _, status, used = os.wait4(child, 0)
    return None if status != 0 else (time.perf_counter() - start, used.ru_utime + used.ru_stime,
                                     used.ru_maxrss / 1024)


def count_differences(first, second):
    """Count the unequal bytes of two files, including those by which one file is longer."""
    count, step = abs(os.path.getsize(first) - os.path.getsize(second)), 1 << 20
    with open(first, "rb") as one, open(second, "rb") as other:
        while (a := one.read(step)) and (b := other.read(step)):
            count += 0 if a == b else sum(map(operator.ne, a, b))
    return count


def compare(name, programs, arguments, rounds, output=None):
    """Run both programs in turn in their folders, 0 and 1, with these arguments, of which `output` is the file written.
    Print a row of results. Return the processor seconds of both, or None."""
    best = [[float("inf"), float("inf"), 0.0] for _ in programs]
    for _ in range(rounds):
        for which, program in enumerate(programs):
            os.chdir(str(which))  # outputs contain the command line, so both programs use the same names
            used = run([program] + arguments)
            os.chdir("..")
            if used is None:
                print(f"{name:28} fails in {program}")
                return None
            wall, cpu, memory = used
            best[which] = [min(best[which][0], wall), min(best[which][1], cpu),
                           max(best[which][2], memory)]
    differing = 0 if output is None else count_differences("0/" + output, "1/" + output)
    old, new = best
    print(f"{name:28} {old[0]:8.3f} {new[0]:8.3f} {new[0] / old[0]:6.2f}   "
          f"{old[1]:8.3f} {new[1]:8.3f} {new[1] / old[1]:6.2f}   "
          f"{old[2]:7.0f} {new[2]:7.0f} {new[2] / old[2]:6.2f}"
          f"{f'   outputs differ in {differing} bytes' if differing else ''}", flush=True)
    return old[1], new[1]


# A Python program that opens a basis five times and prints the processor seconds of the fastest.
OPEN = """
import ctypes, sys, time
library, basis = ctypes.CDLL(sys.argv[1]), ctypes.c_void_p()
least = 1e9
for _ in range(5):
    start = time.process_time()
    if library.supine_basis_open(sys.argv[2].encode(), ctypes.byref(basis), None) != 0:
        raise SystemExit("cannot open " + sys.argv[2])
    least = min(least, time.process_time() - start)
    library.supine_basis_close(basis)
print(least)
"""

# A Python program that poses a basis in C, and prints the processor milliseconds of the fastest of 50 frames: of
# positions if its last argument is "positions", of positions and unit normals if it is "lit".
POSE = """
import ctypes, sys, time
library, basis = ctypes.CDLL(sys.argv[1]), ctypes.c_void_p()
state, pose = ctypes.create_string_buffer(4096), ctypes.create_string_buffer(65536)
if (library.supine_basis_open(sys.argv[2].encode(), ctypes.byref(basis), None) != 0
        or library.supine_state_parse(b"prone:rest", state, None) != 0
        or library.supine_basis_pose(basis, state, pose, None) != 0):
    raise SystemExit("cannot pose " + sys.argv[2])
size = 24 * int(sys.argv[3])  # twice the size asked for: the meshes have somewhat more vertices
positions, normals = ctypes.create_string_buffer(size), ctypes.create_string_buffer(size)
least = 1e9
for _ in range(50):
    start = time.process_time()
    if sys.argv[4] == "positions":
        failed = library.supine_deform(basis, pose, positions)
    else:
        failed = library.supine_deform_lit(basis, pose, positions, normals)
    least = min(least, time.process_time() - start)
    if failed:
        raise SystemExit("cannot deform " + sys.argv[2])
print(1000 * least)
"""


def compare_numbers(name, commands, rounds, number):
    """Run both commands in turn, `rounds` times. `number` reads a number from the output of a command. Print
    the least number of each command."""
    best = [float("inf"), float("inf")]
    for _ in range(rounds):
        for which, command in enumerate(commands):
            said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            best[which] = min(best[which], number(said))
    print(f"{name:28} {best[0]:8.4f} {best[1]:8.4f} {best[1] / best[0]:6.2f}", flush=True)


def write_inputs(programs, vertices, rows):
    """Write the inputs of the commands in `rows` to the folders 0 and 1 of the programs. They share the files that the
    first program makes, but not the bases."""
    def make(which, *arguments):
        subprocess.run([programs[which], *arguments], check=True, stdout=subprocess.DEVNULL, cwd=str(which))

    for which in range(len(programs)):
        os.mkdir(str(which))
    for name, count in (("large.ply", vertices), ("middle.ply", "100000"), ("small.ply", "20000")):
        make(0, "phantom", "--vertices", count, "-o", name)
    for count in (1, 4):
        with open(f"0/states{count}.csv", "w", encoding="ascii") as file:
            file.write("posture,volume,output\n")
            for posture in ("prone", "supine", "left", "right")[:count]:
                file.write(f"{posture},rest,{posture}.nii\n")
    if any("grid.safetensors" in arguments for _, arguments, _ in rows):
        write_image("0/image.nii", False)
        with open("0/image.nii", "rb") as image, gzip.open("0/packed.nii.gz", "wb", compresslevel=1) as packed:
            shutil.copyfileobj(image, packed, 1 << 20)
        write_image("0/labels.nii", True)
    with open("0/points.csv", "w", encoding="ascii") as file:
        file.write("x,y,z\n")
        for i in range(20000):  # each point is in the left lung
            file.write(f"{40 + i % 61},{-200 + i // 61 % 61},{-170 + i // 3721 * 10}\n")
    for name in os.listdir("0"):
        os.link(f"0/{name}", f"1/{name}")
    for which in range(len(programs)):
        for size in ("large", "small"):
            make(which, "precompute", size + ".ply", "-o", size + ".safetensors")
        make(which, "deform", "large.safetensors", "--posture", "prone", "-o", "state.ply")
        make(which, "embed", "small.safetensors", "--grid", "4", "-o", "grid.safetensors")


PANELS = ["large.safetensors", "--posture", "supine,prone,left,right,upright",
          "--view", "anterior,posterior,left,right", "-o", "panels.png"]
# Name, arguments and output of each command that is timed.
ROWS = [
    ("--help", ["--help"], None),
    ("info", ["info", "large.safetensors"], None),
    ("deform --image, 65 M voxels",
     ["deform", "grid.safetensors", "--posture", "prone", "--image", "image.nii", "-o",
      "moved.nii"], "moved.nii"),
    ("deform --image, .nii.gz",
     ["deform", "grid.safetensors", "--posture", "prone", "--image", "packed.nii.gz", "-o",
      "moved.nii.gz"], None),
    ("deform --image --density",
     ["deform", "grid.safetensors", "--posture", "prone", "--image", "image.nii",
      "--density", "-o", "moved.nii"], "moved.nii"),
    ("deform --states, 1 image",
     ["deform", "grid.safetensors", "--states", "states1.csv", "--image", "image.nii"],
     None),
    ("deform --states, 4 images",
     ["deform", "grid.safetensors", "--states", "states4.csv", "--image", "image.nii"],
     None),
    ("deform --labels",
     ["deform", "grid.safetensors", "--posture", "prone", "--labels", "labels.nii", "-o",
      "moved.nii"], "moved.nii"),
    ("embed, 20,000 points",
     ["embed", "small.safetensors", "points.csv", "-o", "inside.safetensors"],
     "inside.safetensors"),
    ("breathe as VTP, 20 frames",
     ["breathe", "large.safetensors", "--posture", "prone", "--seconds", "0.3", "-o",
      "breath.vtp"], None),
    ("validate", ["validate", "large.safetensors", "--state", "prone:rest:state.ply"],
     None),
    ("render, 20 panels", ["render", *PANELS], "panels.png"),
    ("render, 20 coloured panels", ["render", *PANELS, "--look", "displacement"], "panels.png"),
    ("precompute", ["precompute", "large.ply", "-o", "made.safetensors"], None),
    ("precompute, 100,000 vertices", ["precompute", "middle.ply", "-o", "made.safetensors"],
     None),
    ("precompute, harmonics",
     ["precompute", "large.ply", "--band", "3", "--modes", "harmonics", "-o",
      "made.safetensors"], None),
]


def compare_library(programs, vertices, rounds):
    """Print rows of the time in which the libraries open and pose bases."""
    libraries = [os.path.join(os.path.dirname(program), "runtime", "libsupine_runtime.so") for program in programs]
    compare_numbers("opening, processor s",
                    [[sys.executable, "-c", OPEN, library, f"{which}/large.safetensors"]
                     for which, library in enumerate(libraries)], rounds, float)
    for name, count in (("large", vertices), ("small", "20000")):
        for what in ("positions", "lit"):
            compare_numbers(f"{what}, {name}, processor ms",
                            [[sys.executable, "-c", POSE, library, f"{which}/{name}.safetensors", count, what]
                             for which, library in enumerate(libraries)], rounds, float)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("--vertices", default="508000")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder")
    parser.add_argument("--stream")
    parser.add_argument("--only", default="")
    chosen = parser.parse_args()
    programs = [os.path.abspath(chosen.old), os.path.abspath(chosen.new)]
    stream = None if chosen.stream is None else os.path.abspath(chosen.stream)
    with tempfile.TemporaryDirectory(dir=chosen.folder) as folder:
        os.chdir(folder)

        rows = [row for row in ROWS if chosen.only in row[0]]
        write_inputs(programs, chosen.vertices, rows)

        print(f"{'':28} {'wall, s':^24}   {'processors, s':^24}   {'memory, MB':^22}")
        print(f"{'':28}" + 3 * f" {'old':>8} {'new':>8} {'ratio':>6}  ")
        if not chosen.only:
            compare_library(programs, chosen.vertices, chosen.rounds)
        if stream is not None:
            compare_numbers("stream of points, median ms",
                            [[stream, program, f"{which}/large.safetensors", "3", "points"]
                             for which, program in enumerate(programs)], chosen.rounds,
                            lambda said: float(said.splitlines()[1].split()[5]))
        seconds = {}
        for name, arguments, output in rows:
            rounds = 20 * chosen.rounds if name == "--help" else chosen.rounds
            seconds[name] = compare(name, programs, arguments, rounds, output)
        shells, coloured = [seconds.get(name) for name in ("render, 20 panels", "render, 20 coloured panels")]
        if shells and coloured:
            ratios = [f"{shell / other:.2f}" for shell, other in zip(shells, coloured)]
            print(f"shells / coloured lungs, processors: {' '.join(ratios)}")


if __name__ == "__main__":
    main()
