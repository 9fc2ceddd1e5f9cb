# SPDX-License-Identifier: GPL-3.0-or-later
"""Test which differences same_output.py accepts between a golden file and an output."""
from same_output import same, tolerance_of

FILTERED, RAW = "$ supine validate a.safetensors | rounded 3", "$ supine validate a.safetensors"
for command, golden, output, equal in (
        (RAW, "largest 0.796 mm", "largest 0.795 mm", True),
        (RAW, "largest 0.796 mm", "largest 0.794 mm", False),
        (RAW, "largest  12 mm", "largest  12.1 mm", True),
        (RAW, "largest 0.796 mm", "largest 0.796 cm", False),
        (RAW, "2885 vertices", "2886 vertices", False),
        (FILTERED, "2885 vertices", "2886 vertices", False),
        (FILTERED, "  15      21.9", "  15     21.9", True),
        (FILTERED, "  1.234", "  1.243", True),
        (FILTERED, "  1.23", "  1.25", False),
        (FILTERED, "  3.61e-05", "  3.62e-05", True),
        (FILTERED, "  2.5e-07", "  1.99e-07", True),
        (FILTERED, "  3.61e-05", "  3.81e-05", False),
        (FILTERED, "  0.0342", "  -0.0342", False),
        ("$ rounded file.csv", "-0.03361, 5.1", "-0.03364, 5.1", False),
        ("$ rounded 4 0.0001 file.csv", "-0.03361, 5.1", "-0.03364, 5.1", True),
        ("$ rounded 4 0.0001 file.csv", "-0.03361, 5.1", "-0.03364, 5.3", False)):
    assert same(golden, output, tolerance_of(command)) is equal, (command, golden, output)
