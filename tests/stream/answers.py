# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests of a server share: wait for an answer over OpenIGTLink, and compare faces."""
import time


def answer(link, stamp, send):
    """Return the frame that answers the message with that stamp, which `send` sends."""
    send()
    end = time.monotonic() + 20
    while time.monotonic() < end:
        message = link.message()
        if message is None:
            link.receive(1.0)
        elif message[2] == stamp:
            return message
    raise AssertionError("no answer")


def faces(corners):
    """Return triangles sorted, each from its lowest corner, so that two lists of them compare."""
    found = []
    for i in range(0, len(corners), 3):
        low = min(range(3), key=lambda j: corners[i + j])
        found.append(tuple(corners[i + (low + j) % 3] for j in range(3)))
    return sorted(found)
