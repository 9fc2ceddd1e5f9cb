# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the output of a session with its golden file: same_output.py GOLDEN OUTPUT.

Numbers differ slightly between processors. If a command is piped through `rounded`, which keeps four significant digits,
the last of these digits may therefore differ by one. All other output must be identical."""
import difflib
import math
import re
import sys

NUMBER = re.compile(r"-?\d+(?:\.\d+(?:e[-+]?\d+)?|e[-+]?\d+)")


def lines_of(path):
    with open(path, encoding="utf-8") as text:
        return text.read().splitlines()


def close(a, b):
    """Return whether two numbers differ by at most one in the fourth significant digit."""
    a, b = float(a), float(b)
    largest = max(abs(a), abs(b))
    return a == b or abs(a - b) < 1.5 * 10.0 ** (math.floor(math.log10(largest)) - 3)


def same(golden, output, rounded):
    if golden == output or not rounded:
        return golden == output
    numbers = [NUMBER.findall(line) for line in (golden, output)]
    return (NUMBER.sub("#", golden) == NUMBER.sub("#", output)
            and all(close(a, b) for a, b in zip(*numbers, strict=True)))


golden, output = (lines_of(path) for path in sys.argv[1:3])
equal = len(golden) == len(output)
rounded = False
for expected, found in zip(golden, output):
    if expected.startswith("$ "):
        rounded = re.search(r"[$|;] rounded\b", expected) is not None
    equal = equal and same(expected, found, rounded)
if not equal:
    print("\n".join(difflib.unified_diff(golden, output, *sys.argv[1:3], lineterm="")))
sys.exit(0 if equal else 1)
