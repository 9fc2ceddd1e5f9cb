/* SPDX-License-Identifier: MIT */
/** @file
 * Expected errors and their constants, for the files of this folder. */
#ifndef SUPINE_LOCATE_INTERNAL_H
#define SUPINE_LOCATE_INTERNAL_H

#include <supine/locate.h>

#include "runtime/kriging.h"

enum { LOCATE_BLOCK = 256 }; /* vertices evaluated at once */

/** A fit, at the start of the caller's workspace. */
typedef struct supine_locate_fit {
  supine_kriging kriging;
  supine_kriging_options options;
  double origin[3]; /**< where the rotated body's origin is put before the fit's terms, mm */
  double deviation; /**< prior standard deviation of the volume, mL; 0 where it is known */
} supine_locate_fit;

/** c of a file, mm. */
double supine_expected_constant(const supine_basis *basis);

/** Compute the volume of the reference surface, mL, and the share of it by which
 * supine_expected_shifted shifts. */
double supine_expected_reference(const supine_basis *basis);
extern const double supine_expected_shift;

/** Compute the RMS over all vertices of the displacement between two poses, mm. */
double supine_expected_rms(const supine_basis *basis, const supine_pose *pose,
                           const supine_pose *from);

/** Compute the pose whose volumes are 1 % of the reference volume above a state's.
 * @retval those of supine_basis_pose */
supine_status supine_expected_shifted(const supine_basis *basis, const supine_state *state,
                                      supine_pose *pose, supine_error *error);

#endif
