# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the example of a tracked patient with a real server, and check that the lungs move further with every turn:

    stream_turn.py TURN PORT BASIS"""
import re
import subprocess
import sys

turn, port, basis = sys.argv[1:]
told = subprocess.run([sys.executable, turn, basis, port], stdout=subprocess.PIPE, text=True, check=True).stdout
moved = [float(mm) for mm in re.findall(r"degrees to the left: the lungs move by ([\d.]+) mm at most", told)]
assert len(moved) == 7 and moved[0] == 0.0 and sorted(set(moved)) == moved, told
print(told)
