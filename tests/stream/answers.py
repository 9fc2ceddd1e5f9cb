# SPDX-License-Identifier: GPL-3.0-or-later
"""Helpers for tests of a server: wait for an answer over OpenIGTLink, and compare triangles."""
import time


def answer(link, stamp, send):
    """Call `send`, which sends a message with this stamp; return the frame that answers the message."""
    send()
    end = time.monotonic() + 100  # ends a test that hangs
    while time.monotonic() < end:
        message = link.message()
        if message is None:
            link.receive(1.0)
        elif message[2] == stamp:
            return message
    raise AssertionError("no answer")


def number_messages(link, begin):
    """Give each message that `link` sends without a time stamp the next number after `begin` as its stamp. Return a
    function that returns the stamp of the last message."""
    last, send = [begin], link.send

    def send_numbered(kind, device, content, stamp=None):
        if stamp is None:
            stamp = last[0] = last[0] + 1
        send(kind, device, content, stamp)

    link.send = send_numbered
    return lambda: last[0]


def wait_for(read, is_wanted):
    """Call `read`, which returns the time stamp and the content of the newest message, or None, until `is_wanted` is
    true of both. Return the content."""
    end = time.monotonic() + 100  # ends a test that hangs
    while time.monotonic() < end:
        found = read()
        if found is not None and is_wanted(*found):
            return found[1]
    raise AssertionError("no answer")


def faces(corners):
    """Return the triangles sorted, each beginning with its lowest corner, so that lists of them can be compared."""
    found = []
    for i in range(0, len(corners), 3):
        low = min(range(3), key=lambda j: corners[i + j])
        found.append(tuple(corners[i + (low + j) % 3] for j in range(3)))
    return sorted(found)
