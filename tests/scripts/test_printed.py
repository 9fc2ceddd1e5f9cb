# SPDX-License-Identifier: GPL-3.0-or-later
"""Check what commands print of files with unusual content: tables in which a row lacks a value, and control characters,
which a terminal would obey.

    test_printed.py SUPINE
"""
import os
import subprocess
import sys
import tempfile

supine = os.path.abspath(sys.argv[1])
HEADER = """ply
format ascii 1.0
comment SPACE=LPS
element vertex {}
property float x
property float y
property float z
element face {}
property list uchar int vertex_indices
end_header
"""
# A tetrahedron, and a triangle with two sides, which encloses exactly 0 mL.
BODY = HEADER.format(4, 4) + """-80 -120 -90
-60 -120 -90
-80 -100 -90
-80 -120 -70
3 0 2 1
3 0 1 3
3 0 3 2
3 1 2 3
"""
FLAT = HEADER.format(3, 2) + """70 -150 -120
80 -150 -120
70 -140 -120
3 0 1 2
3 0 2 1
"""
HOSTILE = "\x1b]0;title\x07\x7f\u009b2J"  # sets the title of a terminal, and clears the screen
ESCAPED = "\\x1B]0;title\\x07\\x7F\\x9B2J"
NAME = " ]0;title \\x7F\\x9B2J"  # after a reader of points has replaced control characters of ASCII


def run(*words, code=0):
    """Run a command; return what it prints."""
    done = subprocess.run([supine, *words], capture_output=True, text=True, check=False)
    assert done.returncode == code, f"{words}: exit code {done.returncode}: {done.stderr}"
    return done.stdout + done.stderr


def check_volumes():
    """Compare structures of which one encloses no volume. Its row of the table has '-' in the last two columns."""
    for order in (["body.ply", "flat.ply"], ["flat.ply", "body.ply"]):
        run("embed", "lungs.safetensors", *order, "-o", "inside.safetensors")
        printed = run("compare", "lungs.safetensors", "--inside", "inside.safetensors", "--postures",
                      "supine,prone")
        lines = printed.splitlines()
        begin = lines.index("targets")
        assert lines[begin + 1].endswith("volume after, mL"), lines[begin + 1]
        rows = {line.split()[1]: line.split() for line in lines[begin + 2:begin + 4]}
        assert rows["flat"][-2:] == ["-", "-"] and "-" not in rows["body"][-2:], rows


def check_control_characters():
    """Print a basis whose metadata and names have control characters."""
    basis = f"lungs{HOSTILE}.safetensors"
    run("precompute", "lungs.ply", "--band", "3", "-o", basis)
    with open("points.csv", "w", encoding="utf-8") as file:
        file.write(f"name,x,y,z\nnodule{HOSTILE},-80,-120,-90\n")
    run("embed", basis, "points.csv", "-o", "points.safetensors")
    os.rename(basis, "renamed.safetensors")
    with open("observed.csv", "w", encoding="utf-8") as file:
        file.write(f"name,x,y,z\nother{HOSTILE},1,2,3\n")
    for printed, kept in (
            (run("info", "renamed.safetensors"), f"lungs{ESCAPED}"),
            (run("info", "points.safetensors"), ""),
            (run("info", "renamed.safetensors", "--json"), ""),
            (run("compare", "renamed.safetensors", "--inside", "points.safetensors", "--postures",
                 "supine,prone"), f"nodule{NAME}"),
            (run("locate", "renamed.safetensors", "observed.csv", "--points", "points.safetensors", "-o", "found.csv",
                 code=2), f"other{NAME}")):
        assert kept in printed, f"{kept!r} is not in {printed!r}"
        for character in printed.replace("\n", ""):
            assert ord(character) >= 0x20, f"control character {character!r} in {printed!r}"


def main():
    """Run all checks in a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for name, text in (("body.ply", BODY), ("flat.ply", FLAT)):
            with open(name, "w", encoding="ascii") as file:
                file.write(text)
        run("phantom", "--vertices", "500", "-o", "lungs.ply")
        run("precompute", "lungs.ply", "--band", "3", "-o", "lungs.safetensors")
        check_volumes()
        check_control_characters()
        os.chdir("/")


main()
