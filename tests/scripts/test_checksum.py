# SPDX-License-Identifier: GPL-3.0-or-later
"""Verify the checksums of basis files by an independent implementation of supine/safetensors.h.

    python3 test_checksum.py BASIS...

XXH64 is implemented from its specification, so that no package is needed."""
import json
import struct
import sys

MASK = 2**64 - 1
P1, P2, P3, P4, P5 = (0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9,
                      0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5)


def rotate(x, bits):
    return (x << bits | x >> (64 - bits)) & MASK


def turn(lane, word):
    return rotate((lane + word * P2) & MASK, 31) * P1 & MASK


def xxh64(data, seed=0):
    if isinstance(data, str):
        data = data.encode()
    at = 0
    if len(data) >= 32:
        lanes = [(seed + P1 + P2) & MASK, (seed + P2) & MASK, seed, (seed - P1) & MASK]
        while at + 32 <= len(data):
            words = struct.unpack_from("<4Q", data, at)
            lanes = [turn(lane, word) for lane, word in zip(lanes, words)]
            at += 32
        h = sum(rotate(lane, bits) for lane, bits in zip(lanes, (1, 7, 12, 18))) & MASK
        for lane in lanes:
            h = ((h ^ turn(0, lane)) * P1 + P4) & MASK
    else:
        h = (seed + P5) & MASK
    h = (h + len(data)) & MASK
    while at + 8 <= len(data):
        h = (rotate(h ^ turn(0, struct.unpack_from("<Q", data, at)[0]), 27) * P1 + P4) & MASK
        at += 8
    if at + 4 <= len(data):
        h = (rotate(h ^ struct.unpack_from("<I", data, at)[0] * P1 & MASK, 23) * P2 + P3) & MASK
        at += 4
    for byte in data[at:]:
        h = rotate(h ^ byte * P5 & MASK, 11) * P1 & MASK
    h = (h ^ h >> 33) * P2 & MASK
    h = (h ^ h >> 29) * P3 & MASK
    return h ^ h >> 32


def checksum(path):
    with open(path, "rb") as file:
        content = file.read()
    length, = struct.unpack_from("<Q", content)
    header = json.loads(content[8:8 + length])
    metadata = header.pop("__metadata__")
    total = 0
    for name, tensor in header.items():
        begin, end = tensor["data_offsets"]
        data = content[8 + length + begin:8 + length + end]
        shape = ",".join(map(str, tensor["shape"]))
        total += xxh64(data, xxh64(f"{tensor['dtype']} [{shape}]", xxh64(name, 0)))
    for key, value in metadata.items():
        if key != "checksum":
            total += xxh64(value, xxh64(key, 1))
    return f"xxh64:{total & MASK:016x}", metadata["checksum"]


# Test values published with XXH64.
assert xxh64(b"") == 0xEF46DB3751D8E999
assert xxh64(b"a") == 0xD24EC4F1A98C6E5B
assert xxh64(b"Nobody inspects the spammish repetition") == 0xFBCEA83C8A378BF1
for path in sys.argv[1:]:
    found, stated = checksum(path)
    assert found == stated, f"{path}: {found}, stated {stated}"
    print(path, found)
