/* SPDX-License-Identifier: MIT */
/** @file
 * Expected errors of predicted positions: constants and shared functions. */
#ifndef SUPINE_LOCATE_INTERNAL_H
#define SUPINE_LOCATE_INTERNAL_H

#include <supine/locate.h>

#include "runtime/kriging.h"

enum { LOCATE_BLOCK = 256 }; /**< number of vertices evaluated at once */

/** The result of kriging in supine_locate. It lies at the start of the caller's work space. */
typedef struct supine_locate_fit {
  supine_kriging kriging;
  supine_kriging_options options;
  /** Mean of the observed positions, minus the rotated mean of the predicted positions, mm. */
  double origin[3];
  double deviation; /**< prior standard deviation of the volume, mL; 0 if the volume is known */
} supine_locate_fit;

/** Return the constant c of the formula of the expected error (supine/locate.h), mm. It is the
 * metadata "expected_error_mm" of the file or, if the file lacks it, SUPINE_EXPECTED_ERROR_MM. */
double supine_expected_constant(const supine_basis *basis);

/** Return the sum of the volumes of all lungs of the reference surface, mL. */
double supine_expected_reference(const supine_basis *basis);

/** Fraction of the reference volume that supine_expected_shifted adds to the lungs: 0.01. */
extern const double supine_expected_shift;

/** Return the RMS over all vertices of the displacement between two poses, mm. */
double supine_expected_rms(const supine_basis *basis, const supine_pose *pose,
                           const supine_pose *from);

/** Compute the pose of a state whose volume is increased by 1 % of the volume of the reference
 * surface. If the state gives a volume for each lung, each lung gets an equal part of the
 * increase. Statuses: as supine_basis_pose. */
supine_status supine_expected_shifted(const supine_basis *basis, const supine_state *state,
                                      supine_pose *pose, supine_error *error);

#endif
