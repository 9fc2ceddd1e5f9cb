/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The force that gravity and breath apply to the mass nodes, (18) for any orientation, and the
 * direction that they move in, (15)-(17).
 *
 *     h_i(g) = (g.p_i - min_j g.p_j) / (max_j g.p_j - min_j g.p_j)      1 where most dependent
 *     f_i(g) = base + gain h_i(g) + cx X_i + cy Y_i + cz Z_i
 *     E_i(g) = E_i exp(-soften (h_i(g) - 1/2))
 *
 * with X, Y, Z the box coordinates of lungs.h, and min and max over all lungs of the model. */
#ifndef SUPINE_FORCE_H
#define SUPINE_FORCE_H

#include "precompute/lungs/lungs.h"

/** Constants of the law. */
typedef struct supine_force_law {
  double base;
  double gain;   /**< the part that turns with gravity */
  double box[3]; /**< cx, cy, cz: fixed to the body */
  double soften; /**< how much softer dependent tissue is; not 0 breaks the linear route */
  bool pair;     /**< a lung alone has the heights of the pair that it and its mirror image in the
                      midline make, so that it moves as beside its fellow; false: its own */
} supine_force_law;

/** min and max over the vertices of g.p for `count` directions [count, 3] into minimum [count] and
 * maximum [count], mm. Uses all cores.
 * @param pair  of a lung alone, those of the pair (supine_force_law)
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_height_range(const supine_lungs *lungs, bool pair, size_t count,
                                          const double *directions, double *minimum,
                                          double *maximum);

/** f [N] for gravity along the unit vector `g`, given its height range. */
void supine_physics_force(const supine_lungs *lungs, const supine_force_law *law, const double g[3],
                          double minimum, double maximum, double *force);

/** E [N] for gravity along `g` from E without gravity (NULL: 1). */
void supine_physics_force_stiffness(const supine_lungs *lungs, const supine_force_law *law,
                                    const double *stiffness, const double g[3], double minimum,
                                    double maximum, double *softened);

/** The law as a sum of a few forces that do not turn, times functions of gravity alone:
 * f_i(g) = sum over r of columns[i, r] functions[r](g). The columns are 1 and the position (about
 * the box's centre, in half diagonals), and the body-fixed part where there is one. */
enum { SUPINE_FORCE_COLUMNS_MAX = 5 };

/** Number of columns: 4, or 5 with a body-fixed part. */
size_t supine_physics_force_column_count(const supine_force_law *law);

/** The columns, [N, R]. */
void supine_physics_force_columns(const supine_lungs *lungs, const supine_force_law *law,
                                  double *columns);

/** The functions at one direction, [R]. */
void supine_physics_force_functions(const supine_lungs *lungs, const supine_force_law *law,
                                    const double g[3], double minimum, double maximum,
                                    double *functions);

/** How vertices move. */
typedef enum supine_direction_model {
  SUPINE_DIRECTION_BOX = 0, /**< (15)-(17): d = (+-c1 X^c2, -c3 Y^c4, -c5 Z^c6) mm */
  SUPINE_DIRECTION_NORMAL,  /**< the outward unit normal, 1 mm */
  SUPINE_DIRECTION_RADIAL,  /**< away from the centroid of the lung's vertices, 1 mm */
  SUPINE_DIRECTION_VECTORS  /**< whatever the caller says, mm */
} supine_direction_model;

/** The model and the constants c1 to c6 of the box model (model.h has three sets of them). */
typedef struct supine_direction_law {
  supine_direction_model model;
  double c[6];
  const double *vectors; /**< [N, 3] of SUPINE_DIRECTION_VECTORS, mm; the caller's */
} supine_direction_law;

/** Reads vectors for SUPINE_DIRECTION_VECTORS: CSV with the columns dx,dy,dz, mm, a row for each of
 * `count` vertices in the model's order, into vectors [count, 3].
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT (line named), SUPINE_ERROR_MEMORY */
supine_status supine_physics_directions_load(const char *path, size_t count, double *vectors,
                                             supine_error *error);

/** d [N, 3], mm; of any length, so that the fixed planes stay fixed.
 * @retval SUPINE_ERROR_ARGUMENT  a constant that is not finite, or an exponent that is not positive
 * @retval SUPINE_ERROR_MESH      no vertex would move */
supine_status supine_physics_directions(const supine_lungs *lungs, const supine_direction_law *law,
                                        double *directions, supine_error *error);

#endif
