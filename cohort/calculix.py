# SPDX-License-Identifier: GPL-3.0-or-later
"""Run CalculiX for one state of a plan, and write the displacements of the nodes that it prints.

    python3 calculix.py DECK X Y Z FILL OUTPUT.csv

DECK is an input of CalculiX in which @X@, @Y@ and @Z@ stand for the direction of gravity and @FILL@ for the filling, 0
to 1, such as

    *AMPLITUDE, NAME=FILL
    0., 0., 1., @FILL@
    *CLOAD, AMPLITUDE=FILL
    *DLOAD
    LUNG, GRAV, 9810., @X@, @Y@, @Z@
    *NODE PRINT, NSET=PLEURA, FREQUENCY=100
    U

The forces are those of the largest volume. OUTPUT.csv has the last displacements in the file .dat, sorted by node, as
ux,uy,uz. The program is $CCX (default: ccx)."""
import os
import subprocess
import sys
import tempfile


def last_displacements(path):
    """Return the rows [node, ux, uy, uz] of the last table of displacements in a .dat file of CalculiX."""
    rows, reading = [], False
    with open(path, encoding="ascii", errors="replace") as file:
        for line in file:
            words = line.split()
            if any(word[:1].isalpha() for word in words):  # the title of a table
                reading = words[0] == "displacements"
                rows = [] if reading else rows
            elif reading and len(words) == 4:
                rows.append((int(words[0]), *map(float, words[1:])))
    return sorted(rows)


def main():
    deck, *state, output = sys.argv[1:]
    with open(deck, encoding="utf-8", errors="surrogateescape") as file:  # comments may have any letters
        text = file.read()
    for key, value in zip(("@X@", "@Y@", "@Z@", "@FILL@"), state):
        text = text.replace(key, value)
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "run.inp"), "w", encoding="utf-8", errors="surrogateescape") as file:
            file.write(text)
        done = subprocess.run([os.environ.get("CCX", "ccx"), "run"], cwd=folder, capture_output=True, text=True,
                              check=False, errors="replace", env={"OMP_NUM_THREADS": "1", **os.environ})
        result = os.path.join(folder, "run.dat")
        rows = last_displacements(result) if os.path.exists(result) else []
        if done.returncode != 0 or "*ERROR" in done.stdout or not rows:
            sys.exit(f"ccx failed with gravity and filling {' '.join(state)}: {done.stdout[-600:]}")
    os.makedirs(os.path.dirname(os.path.abspath(output)), exist_ok=True)
    with open(output + ".part", "w", encoding="ascii") as file:
        for row in rows:
            print("%.9g,%.9g,%.9g" % row[1:], file=file)
    os.replace(output + ".part", output)


if __name__ == "__main__":
    main()
