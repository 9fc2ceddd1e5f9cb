/* SPDX-License-Identifier: MIT */
/** @file
 * Lines of sight of observed points: what no view sees, and where the points may lie. */
#ifndef SUPINE_SIGHT_H
#define SUPINE_SIGHT_H

#include <supine/locate.h>

/** Return whether an observation is valid: finite, with a line between two different places. */
bool supine_sight_valid(const supine_observation *observed);

/** Return the number of different vertices that were observed. */
size_t supine_sight_count(size_t count, const supine_observation *observed);

/** Return whether the observations leave the frame's translation along one direction open: all of
 * them are lines from one place, as far as 1 % of their length tells, or parallel within a degree.
 * @param axis  [3] this direction, a unit vector; 0 if there is none; written */
bool supine_sight_unseen(size_t count, const supine_observation *observed, double axis[3]);

/** Find the places of all observations: of a point, the position; of a line, the place nearest to
 * the predicted position after the translation that fits best.
 * @param predicted  [count, 3] predicted positions, rotated to the frame of the observations, mm
 * @param axis       direction along which the translation counts as `depth` mm of standard
 * deviation about 0; 0 if all are seen
 * @param places     [count, 3] mm, written */
void supine_sight_place(size_t count, const supine_observation *observed, const double *predicted,
                        const double axis[3], double depth, double *places);

/** Compute the unit vector of the line of an observation. */
void supine_sight_direction(const supine_observation *observed, double direction[3]);

#endif
