# SPDX-License-Identifier: GPL-3.0-or-later
"""Helpers for tests of a server: wait for an answer over OpenIGTLink, and compare triangles."""
import time


def answer(link, stamp, send):
    """Call `send`, which sends a message with this stamp; return the frame that answers the message."""
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
    """Return the triangles sorted, each beginning with its lowest corner, so that lists of them can be compared."""
    found = []
    for i in range(0, len(corners), 3):
        low = min(range(3), key=lambda j: corners[i + j])
        found.append(tuple(corners[i + (low + j) % 3] for j in range(3)))
    return sorted(found)
