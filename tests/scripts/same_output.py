# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the output of a session with its golden file: same_output.py GOLDEN OUTPUT.

Numbers differ slightly between processors, so that rounding may go either way: numbers with decimals may differ by one
in the last digit that is printed. If a command is piped through `rounded DIGITS LEAST`, which keeps that many
significant digits, they may differ by one in the last of these, or by LEAST. The width of a column follows its numbers,
so that runs of spaces count as one space. All other output must be identical."""
import difflib
import math
import re
import sys
from decimal import Decimal

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def lines_of(path):
    with open(path, encoding="utf-8") as text:
        return text.read().splitlines()


def tolerance_of(command):
    """Return the number of significant digits and the smallest difference that the filter `rounded` of a command keeps.
    Without the filter, return None and 0."""
    found = re.search(r"[$|;] rounded\b(?: ([1-9])(?: (0\.\d+))?)?(?= |;|$)", command)
    return (None, 0.0) if found is None else (int(found[1] or 4), float(found[2] or 1e-7))


def close(golden, output, digits, least):
    """Return whether two numbers, given as text, are equal within the tolerance."""
    if golden == output or golden.lstrip("-").isdigit() and output.lstrip("-").isdigit():
        return golden == output  # counts must be equal
    a, b = float(golden), float(output)
    largest = max(abs(a), abs(b))
    unit = 10.0 ** min(Decimal(text).as_tuple().exponent for text in (golden, output))
    if digits is not None and largest > 0:
        unit = max(unit, 10.0 ** (math.floor(math.log10(largest)) - digits + 1))
    return abs(a - b) <= max(1.5 * unit, 1.5 * least)


def same(golden, output, tolerance):
    golden, output = (re.sub(" +", " ", line) for line in (golden, output))
    numbers = [NUMBER.findall(line) for line in (golden, output)]
    return (NUMBER.sub("#", golden) == NUMBER.sub("#", output)
            and all(close(a, b, *tolerance) for a, b in zip(*numbers, strict=True)))


def main(paths):
    golden, output = (lines_of(path) for path in paths)
    equal = len(golden) == len(output)
    tolerance = (None, 0.0)
    for expected, found in zip(golden, output):
        if expected.startswith("$ "):
            tolerance = tolerance_of(expected)
        equal = equal and same(expected, found, tolerance)
    if not equal:
        print("\n".join(difflib.unified_diff(golden, output, *paths, lineterm="")))
    return 0 if equal else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
