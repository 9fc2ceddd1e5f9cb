# SPDX-License-Identifier: GPL-3.0-or-later
"""Check what commands print: every command with --json and --quiet; and of files with unusual content, tables in which
a row lacks a value, and control characters, which a terminal would obey.

    test_printed.py SUPINE
"""
import json
import os
import pty
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


# A call of each command.
CALLS = {
    "phantom": "--vertices 500 -o o.ply",
    "precompute": "lungs.ply --band 3 -o o.safetensors",
    "fit": "rest.ply fuller.ply --other supine:rest+700 -o o.json",
    "validate": "lungs.safetensors --from supine:rest --state supine:rest+700:fuller.ply",
    "embed": "lungs.safetensors points.csv -o o.safetensors",
    "locate": "lungs.safetensors points.csv --points inside.safetensors --posture supine -o o.csv",
    "info": "lungs.safetensors",
    "deform": "lungs.safetensors --posture prone:900mL -o o.ply",
    "compare": "lungs.safetensors --postures supine,prone",
    "render": "lungs.safetensors --posture prone --size 200x200 -o o.png",
    "breathe": "lungs.safetensors --posture prone --fps 1 -o o.vtp",
    "export": "lungs.safetensors -o o.html",
    "solve": "lungs.ply --posture prone -o o.ply",
    "pv": "show --step 10",
    "stream": "lungs.safetensors --listen 0 --seconds 0.1"}


def objects(text):
    """Return the JSON values of which a text consists: 'stream' prints one when it listens, and one at its end."""
    found, at, decoder = [], 0, json.JSONDecoder()
    while text[at:].strip():
        value, at = decoder.raw_decode(text, at + len(text[at:]) - len(text[at:].lstrip()))
        found.append(value)
    return found


def on_terminal(words):
    """Run a command whose standard error is a terminal; return what it shows there."""
    terminal, side = pty.openpty()
    with subprocess.Popen([supine, *words], stdout=subprocess.DEVNULL, stderr=side) as done:
        os.close(side)
        shown = b""
        try:
            while part := os.read(terminal, 4096):
                shown += part
        except OSError:  # the other side is closed
            pass
    os.close(terminal)
    assert done.returncode == 0, f"{words}: {shown}"
    return shown.decode()


def check_every_command():
    """Run every command with --json, and with --quiet: it prints only JSON, and neither progress nor notes."""
    for state in ("rest", "rest+700"):
        run("deform", "lungs.safetensors", "--posture", "supine", "--volume", state, "-o",
            "rest.ply" if state == "rest" else "fuller.ply")
    with open("points.csv", "w", encoding="utf-8") as file:
        file.write("name,x,y,z\nnodule,-80,-120,-90\nother,80,-120,-90\n")
    run("embed", "lungs.safetensors", "points.csv", "-o", "inside.safetensors")
    listed = [line.split()[0] for line in run("--help").split("Commands:\n")[1].split("\n\n")[0].splitlines()]
    assert listed == list(CALLS), f"give each command a call: {set(listed) ^ set(CALLS)}"
    noted = 0
    for name, words in CALLS.items():
        words = [name, *words.split()]
        said = {}
        for option in ("", "--json", "--quiet"):
            done = subprocess.run([supine, *words, *([option] if option else [])], capture_output=True, text=True,
                                  check=False)
            assert done.returncode == 0, f"{words} {option}: {done.stderr}"
            said[option] = done
        printed = objects(said["--json"].stdout)
        assert printed and all(printed), f"{words} --json: {printed}"
        assert said["--json"].stderr == said[""].stderr, f"{words}: {said['--json'].stderr}"
        assert bool(said["--quiet"].stdout) == bool(said[""].stdout), f"{words} --quiet: {said['--quiet'].stdout}"
        warned = [line for line in said[""].stderr.splitlines() if ": warning: " in line]
        assert said["--quiet"].stderr.splitlines() == warned, f"{words} --quiet: {said['--quiet'].stderr}"
        noted += said[""].stderr.count(": note: ")
    assert noted > 1, "no command has printed a note"
    words = ["precompute", *CALLS["precompute"].split()]
    assert "\x1b[K" in on_terminal(words) and on_terminal([*words, "--quiet"]) == ""


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
        check_every_command()
        os.chdir("/")


main()
