# SPDX-License-Identifier: MIT
"""Deform lungs from one state to another, and print how far they and a nodule in them move:

    python3 lungs.py lungs.safetensors supine:rest left:rest+300"""
import sys

import numpy as np
import supine

path, before, after = sys.argv[1:]
lungs = supine.open(path)
moved = lungs.deform(lungs.pose(after)) - lungs.deform(lungs.pose(before))  # float32 [N, 3], mm, LPS
distances = np.linalg.norm(moved, axis=1)
for name, vertices in lungs.lungs.items():
    print(f"{name} lung: moves by {distances[vertices].mean():.1f} mm on average, {distances[vertices].max():.1f} mm "
          f"at most")

centre = lungs.vertices[lungs.lungs["left"]].mean(axis=0)  # inside the left lung
nodules = supine.embed(lungs, {"nodule": centre})
for target in nodules.targets(after, since=before):
    print(f"{target.name}: moves by {target.mm:.1f} mm, expected error {target.expected_error:.1f} mm")
