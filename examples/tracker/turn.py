# SPDX-License-Identifier: MIT
"""Turn a patient from the back to the left side, and print how far the lungs of a running 'supine stream' move:

    python3 turn.py lungs.safetensors [PORT]"""
import math
import sys

from supine_link import Basis, Link

basis = Basis(sys.argv[1])
link = Link("localhost", int(sys.argv[2]) if len(sys.argv) > 2 else 18944)
supine = None
for degrees in range(0, 91, 15):
    s, c = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    # Columns: the patient's left, back and head in a room with z up.
    link.send_pose([[c, -s, 0], [0, 0, 1], [-s, -c, 0]], stamp=1 + degrees)
    stamp, frame = None, None
    while stamp != 1 + degrees:  # the frame of this pose; the server may send earlier ones first
        received = link.newest(timeout=60)
        if received is None:
            sys.exit("no answer from the server")
        stamp, frame = received
    points = basis.deform(frame)
    supine = supine or points
    moved = max(math.dist(points[i:i + 3], supine[i:i + 3]) for i in range(0, len(points), 3))
    print(f"{degrees:2} degrees to the left: the lungs move by {moved:.1f} mm at most")
link.close()
