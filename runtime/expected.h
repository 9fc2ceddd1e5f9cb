/* SPDX-License-Identifier: MIT */
/** @file
 * Expected errors and their constants, for the files of this folder. */
#ifndef SUPINE_LOCATE_INTERNAL_H
#define SUPINE_LOCATE_INTERNAL_H

#include <supine/locate.h>

#include "runtime/kriging.h"

/** Number of vertices evaluated at once. */
enum { LOCATE_BLOCK = 256 };

/** The fit of supine_locate, which is at the start of the caller's work space. */
typedef struct supine_locate_fit {
  supine_kriging kriging;
  supine_kriging_options options;
  /** Translation from the rotated mean of the law's positions to the mean observed position, mm. */
  double origin[3];
  double deviation; /**< prior standard deviation of the volume, mL; 0 if the volume is known */
} supine_locate_fit;

/** Return the constant c of the expected error (supine/locate.h), mm: metadata "expected_error_mm"
 * of the file or, without it, the default. */
double supine_expected_constant(const supine_basis *basis);

/** Compute the volume of all lungs of the reference surface, mL. */
double supine_expected_reference(const supine_basis *basis);

/** Volume that supine_expected_shifted adds, divided by the reference volume: 0.01. */
extern const double supine_expected_shift;

/** Compute the RMS of the displacement between two poses over all vertices, mm. */
double supine_expected_rms(const supine_basis *basis, const supine_pose *pose,
                           const supine_pose *from);

/** Compute the pose of a state with 1 % of the reference volume added. If the state names lungs,
 * each named lung gets an equal part of this volume. Statuses: as supine_basis_pose. */
supine_status supine_expected_shifted(const supine_basis *basis, const supine_state *state,
                                      supine_pose *pose, supine_error *error);

#endif
