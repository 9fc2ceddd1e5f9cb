# SPDX-License-Identifier: MIT
"""Compute where lungs and points in them are in another posture, by numpy and the package `supine`, without 3D Slicer.
Positions are those of Slicer: mm, RAS (to the right, front and head)."""
from typing import NamedTuple

import numpy as np
import supine


class Moved(NamedTuple):
    """A point in another state: its position, and the columns of `supine deform -o FILE.csv` with the same names."""
    name: str
    position: np.ndarray
    moved_mm: float
    moved_error_mm: float
    expected_error_mm: float
    another_day_error_mm: float


def swapped(positions):
    """Convert positions from RAS to LPS, or from LPS to RAS."""
    return np.asarray(positions, float) * (-1, -1, 1)


class Lungs:
    """The lungs of a basis file.

    targets: (name, position in the scan) of points that are inside the lungs
    fixed: the same of three points or more that stay in place, as a navigation system registers; if there are none, the
        body stays in place (spine, apex and back wall)"""

    def __init__(self, path, targets=(), fixed=()):
        self.basis = supine.open(path)
        places = {}
        for name, position in [*targets, *fixed]:
            place = tuple(swapped(position))
            if places.setdefault(name, place) != place:
                raise ValueError(f"two fiducials have the name '{name}': rename one")
        self.inside = supine.embed(self.basis, places) if places else None
        self.wanted = [name for name, _ in targets]
        self.fixed = [self.inside.points[name] for name, _ in fixed]

    def register(self, positions, state):
        """Move LPS positions in a state so that the fixed points are at their places in the scan."""
        if not self.fixed:
            return positions
        rotation, translation, _ = self.inside.registration(state, self.fixed)
        return positions @ rotation.T + translation

    def surface(self, state):
        """Return the vertices [N, 3] of the surface."""
        return swapped(self.register(self.basis.deform(self.basis.pose(state)), state))

    def errors(self, vertex, state, since):
        """Return the expected errors that are left at a vertex when the fixed points are registered."""
        return [float(self.inside.registration(state, self.fixed, **options)[2][vertex])
                for options in ({"since": since}, {}, {"another_day": True})]

    def points(self, state, since):
        """Return where the targets are in a state, and how far they have moved since another state."""
        if not self.wanted:
            return []
        found = {target.name: target for target in self.inside.targets(state, since=since)}
        moved = []
        for name in self.wanted:
            target = found[name]
            after, before = self.register(target.at, state), self.register(target.at - target.move, since)
            errors = [target.moved_error, target.expected_error, target.another_day_error]
            if self.fixed:
                errors = self.errors(self.inside.points[name], state, since)
            moved.append(Moved(name, swapped(after), float(np.linalg.norm(after - before)), *errors))
        return moved
