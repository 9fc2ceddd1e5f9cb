/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Full inflation as the reference of every posture.
 *
 * A lung at full inflation has nearly the same shape in every posture; below it the lowest regions
 * are the emptiest (Milic-Emili 1966; Glazier 1967 found alveoli of one size at 30 cmH2O). So the
 * field counts from there, down to rest and beyond:
 *
 *     x_i(g, s) = p_i + s F_i(g) d_i       p: the full surface; s <= 0 below it, from the volume
 *
 * A scan is one such state of unknown p. Its F and d are those of p, so that p is a fixed point,
 *
 *     p = scan - s F(g_scan; p) d(p),      s from the volume that the scan lacks
 *
 * and lungs of one person come out alike whatever state they were scanned in. */
#ifndef SUPINE_REFERENCE_H
#define SUPINE_REFERENCE_H

#include "precompute/physics/model.h"

/** What a scan shows. */
typedef enum supine_scan_kind {
  SUPINE_SCAN_NONE = 0, /**< unknown: the scan is the reference of every posture, and no rest is */
  SUPINE_SCAN_FULL,     /**< full inflation: its posture does not matter */
  SUPINE_SCAN_REST,     /**< the end of a quiet expiration */
  SUPINE_SCAN_VOLUME    /**< a volume relative to full, mL */
} supine_scan_kind;

typedef struct supine_scan {
  supine_scan_kind kind;
  double gravity[3]; /**< unit; of REST and VOLUME */
  double volume;     /**< mL, at most 0; of VOLUME */
} supine_scan;

/** The axes and units that the surfaces came in; both zero where they came in several. */
typedef struct supine_scan_frame {
  supine_axes axes;
  double millimetres_per_unit;
} supine_scan_frame;

/** Volume at rest as a share of the full volume, tissue included, with gravity along +x, -x, +y,
 * -y, +z, -z: lying on the left, on the right, supine, prone, head down, upright. */
typedef struct supine_resting {
  double share[6];
} supine_resting;

/** The starting values: 0.47, 0.47, 0.43, 0.47, 0.43, 0.53. resting.c has their sources. */
supine_resting supine_reference_resting_default(void);

/** Sets the share of a posture along an axis ("prone", ...; posture.h).
 * @retval SUPINE_ERROR_ARGUMENT  no such posture, one between axes, or a share out of range */
supine_status supine_reference_resting_set(supine_resting *resting, const char *posture,
                                           double share, supine_error *error);

/** Sets those that a CSV file with the columns posture,share has.
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT, SUPINE_ERROR_ARGUMENT (line named) */
supine_status supine_reference_resting_load(const char *path, supine_resting *resting,
                                            supine_error *error);

/** The function of bands 0, 1 and the two diagonal ones of band 2 that has these values along the
 * axes, at unit gravity `g`:
 *
 *     sum over k of (v(+k) - v(-k)) / 2 g_k + (v(+k) + v(-k)) / 2 g_k^2 */
double supine_reference_along_axes(const double values[6], const double g[3]);

/** The same as coefficients of real harmonics [9] (sh.h). */
void supine_reference_harmonics(const double values[6], double harmonics[9]);

/** What was found. */
typedef struct supine_reference {
  bool known; /**< false: volumes count from the scan, and there is no rest */
  supine_scan scan;
  supine_resting resting;
  double full_volume; /**< mL, of all (healthy) lungs together */
  double anchored;    /**< mL of it that came with meeting the scan by a compressed field: rest is a
                         share of full inflation without them */
  double scan_volume; /**< mL of the scan beyond full: at most 0 */
  double scan_scale;  /**< s of the scan: at most 0 */
  size_t steps;       /**< of the fixed point */
  double moved;       /**< largest distance from the scan to the full surface, mm */
} supine_reference;

/** Takes lungs as scanned to full inflation, in place. An open surface has no volumes: it must be
 * full, and no rest is known.
 * @param lungs  vertices and box change; the midline stays
 * @retval SUPINE_ERROR_OPEN_SURFACE  an open surface that is not said to be full
 * @retval SUPINE_ERROR_ARGUMENT      a volume above 0, or that leaves the scan less than tissue
 * @retval SUPINE_ERROR_NUMERICAL     the surface folds on the way: the volume where is named
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_MESH */
supine_status supine_reference_find(supine_lungs *lungs, const supine_model *model,
                                    const supine_scan *scan, const supine_resting *resting,
                                    supine_reference *reference, supine_error *error);

#endif
