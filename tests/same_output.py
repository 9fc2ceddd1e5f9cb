# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the output of a session with its golden file: same_output.py GOLDEN NOW.

In output piped through `rounded`, the last of the four digits of a decimal number may differ by one, as results
differ slightly between processors; everything else must be identical."""
import difflib
import math
import re
import sys

NUMBER = re.compile(r"-?\d+(?:\.\d+(?:e[-+]?\d+)?|e[-+]?\d+)")


def lines_of(path):
    with open(path, encoding="utf-8") as text:
        return text.read().splitlines()


def close(a, b):
    """Return whether two numbers of four digits differ by at most one in the last digit."""
    a, b = float(a), float(b)
    largest = max(abs(a), abs(b))
    return a == b or abs(a - b) < 1.5 * 10.0 ** (math.floor(math.log10(largest)) - 3)


def same(golden, now, rounded):
    if golden == now or not rounded:
        return golden == now
    numbers = [NUMBER.findall(line) for line in (golden, now)]
    return (NUMBER.sub("#", golden) == NUMBER.sub("#", now)
            and all(close(a, b) for a, b in zip(*numbers, strict=True)))


golden, now = (lines_of(path) for path in sys.argv[1:3])
alike = len(golden) == len(now)
rounded = False
for is_golden, is_now in zip(golden, now):
    if is_golden.startswith("$ "):
        rounded = re.search(r"[$|;] rounded\b", is_golden) is not None
    alike = alike and same(is_golden, is_now, rounded)
if not alike:
    print("\n".join(difflib.unified_diff(golden, now, *sys.argv[1:3], lineterm="")))
sys.exit(0 if alike else 1)
