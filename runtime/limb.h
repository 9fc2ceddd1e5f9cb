/* SPDX-License-Identifier: MIT */
/** @file
 * One limb of the pressure-volume loop: integrated once, then evaluated at pressures and volumes.
 */
#ifndef SUPINE_LIMB_H
#define SUPINE_LIMB_H

#include <supine/breath.h>

/** Number of equal parts into which a limb's range is divided for integration. Within their bounds,
 * the control parameters change the compliance by at most e^500 over the range, and so by at most
 * e^16 over a part, which a rule of 16 points integrates to 1e-15. */
enum { LIMB_PARTS = 32 };

typedef struct supine_limb {
  supine_pv_curve curve;
  double sum[LIMB_PARTS + 1]; /**< I(x) at the ends of the parts (supine_breath_curve_evaluate) */
} supine_limb;

/** Integrate a curve that supine_breath_curve_check accepts. */
void supine_limb_begin(const supine_pv_curve *curve, supine_limb *limb);

/** Compute V(P) and dV/dP (NULL: not wanted); a pressure outside the range counts as its end. */
double supine_limb_volume(const supine_limb *limb, double pressure, double *compliance);

/** Compute P(V) of a volume within the range, to within 1e-11 of the range of volumes.
 * @retval SUPINE_ERROR_NUMERICAL  no pressure was found */
supine_status supine_limb_pressure(const supine_limb *limb, double volume, double *pressure);

#endif
