/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Full inflation as the reference of every posture.
 *
 * A lung at full inflation has nearly the same shape in every posture; below it the lowest regions
 * are the emptiest (Milic-Emili 1966; Glazier 1967 found alveoli of one size at 30 cmH2O). So the
 * field counts from there, down to rest and beyond:
 *
 *     x_ij(g) = p_ij + A_j F_i(g) d_ij     p: the full surface; A: gains of each lung, from its
 *                                          volume (supine_volume_form_gains)
 *
 * A scan is one such state of unknown p. Its F and d are those of p, so that p is a fixed point,
 *
 *     p_j = scan_j - A_j F(g_scan; p) d_j(p)       A from the volume that the scan lacks
 *
 * and lungs of one person come out alike whatever state they were scanned in. */
#ifndef SUPINE_REFERENCE_H
#define SUPINE_REFERENCE_H

#include <supine/state.h>

#include "precompute/physics/model.h"
#include "precompute/physics/resting.h"

/** What a scan shows. */
typedef struct supine_scan {
  bool known; /**< false: the scan is the reference of every posture, and no rest is known */
  supine_state state; /**< rest or full inflation, and mL beyond it */
} supine_scan;

/** Parse what a scan shows: "full", "supine:rest", "left:rest+300", "full-2000", or "none". Without
 * a posture it is supine.
 * @retval SUPINE_ERROR_ARGUMENT  anything else; `error` says what it could be */
supine_status supine_reference_scan_parse(const char *text, supine_scan *scan, supine_error *error);

/** The axes and units that the surfaces came in; both zero where they came in several. */
typedef struct supine_scan_frame {
  supine_axes axes;
  double millimetres_per_unit;
} supine_scan_frame;

/** What was found, of each (healthy) lung; volumes are gas and tissue, mL. */
typedef struct supine_reference {
  bool known; /**< false: volumes count from the scan, and there is no rest */
  supine_scan scan;
  supine_resting resting; /**< shares, volumes settled */
  size_t lung_count;
  int side[2];           /**< +1 left, -1 right */
  double full_volume[2]; /**< F, of the reference surface */
  double scan_volume[2]; /**< of the scan beyond F: negative below full inflation */
  double scan_rest[2];   /**< at rest in the scan's posture, where the scan is not the reference */
  double scan_gains[2][3]; /**< A of the scan */
  size_t solves;           /**< of the fixed point */
  double moved;            /**< largest distance from the scan to the reference surface, mm */
} supine_reference;

/** Take lungs as scanned to the reference, in place. An open surface has no volumes: it must be
 * full, and no rest is known.
 * @param lungs  vertices and box change; the midline stays
 * @retval SUPINE_ERROR_OPEN_SURFACE  an open surface that is not said to be full
 * @retval SUPINE_ERROR_ARGUMENT      a state that leaves the scan less than tissue, or beyond full
 * @retval SUPINE_ERROR_NUMERICAL     the surface folds on the way: the volume where is named
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_MESH */
supine_status supine_reference_find(supine_lungs *lungs, const supine_model *model,
                                    const supine_scan *scan, const supine_resting *resting,
                                    supine_reference *reference, supine_error *error);

/** Volumes of the lungs [lung_count] at rest, or full, mL, with gravity along the unit vector g;
 * their sums are returned. */
double supine_reference_rest(const supine_reference *reference, const double g[3], double *ml);
double supine_reference_full(const supine_reference *reference, const double g[3], double *ml);

/** Share `total` mL out among the lungs by the lines of resting.h, into ml [lung_count]. */
void supine_reference_share_out(const supine_reference *reference, const double g[3], double total,
                                double *ml);

/** Move scanned lungs to their reference volumes, in place: the fixed point above. `reference`
 * holds the scan and the volumes; gains, solves and the largest move are written. Statuses as
 * supine_reference_find. */
supine_status supine_reference_inflate(supine_lungs *lungs, const supine_model *model,
                                       supine_reference *reference, supine_error *error);

/** Find the gains of the scan, for a field of the reference surface applied to the scan, that
 * match the volumes of full inflation, of rest and of the scan.
 * @param scan        closed lungs with the scan's vertices
 * @param directions  [N, 3] d, mm
 * @param amounts     [N] F along the scan's gravity
 * @param reference   its volumes; scan_gains are written
 * @retval SUPINE_ERROR_NUMERICAL  the surface folds on the way */
supine_status supine_reference_find_gains(const supine_lungs *scan, const double bend[3],
                                          const double *directions, const double *amounts,
                                          supine_reference *reference, supine_error *error);

#endif
