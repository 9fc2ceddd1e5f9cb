# SPDX-License-Identifier: GPL-3.0-or-later
"""Write images in NIfTI."""
import math
import struct


def header(size, bits, rows, begin=352):
    """Return the header of an image of integers of 8 bits (labels) or 16 (a CT), in mm.

    size: voxels along x, y and z. rows: the three rows of the matrix from voxels to RAS. begin: where the voxels
    begin, as the header states it."""
    spacing = [math.hypot(*column) for column in list(zip(*rows))[:3]]
    made = bytearray(352)
    struct.pack_into("<i", made, 0, 348)
    struct.pack_into("<8h", made, 40, 3, *size, 1, 1, 1, 1)
    struct.pack_into("<2h", made, 70, {8: 2, 16: 4}[bits], bits)
    struct.pack_into("<9f", made, 76, 1, *spacing, 1, 1, 1, 1, begin)
    struct.pack_into("<2f", made, 112, 1, 0)  # slope and offset of the numbers
    made[123] = 2  # mm
    struct.pack_into("<2h", made, 252, 0, 1)  # the matrix holds
    for k, row in enumerate(rows):
        struct.pack_into("<4f", made, 280 + 16 * k, *row)
    made[344:347] = b"n+1"
    return bytes(made)
