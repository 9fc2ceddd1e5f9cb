/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Volumes at rest and at full inflation, by posture and by lung.
 *
 * At rest lung l holds the share r_l(g) of its reference volume F_l, tissue included. Full
 * inflation is larger upright, phi(g) = 1 + 0.109 max(0, -g_z)^2. Between them each lung fills on a
 * straight line (Milic-Emili, J Appl Physiol 1966), with one t for both lungs:
 *
 *     V_l = F_l [r_l + (phi - r_l) t]      t >= 0: 0 at rest, 1 at full inflation
 *     V_l = F_l r_l (1 + t)                t < 0: both shrink in proportion */
#ifndef SUPINE_RESTING_H
#define SUPINE_RESTING_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

/** Volume that full inflation gains from supine to upright, as a share: mean of both lungs of 32
 * people; the left lung gains 0.116, the right 0.103 (Yamada et al., Respiration 99:598, 2020). */
#define SUPINE_FULL_UPRIGHT_GAIN 0.109

/** Volumes at rest with gravity along +x, -x, +y, -y, +z, -z: lying on the left, on the right,
 * supine, prone, head down, upright. */
typedef struct supine_resting {
  double share[2][6]; /**< r of the left and the right lung */
  double ml[6];       /**< volume of both lungs together, mL, where it was given; 0: by share */
} supine_resting;

/** Return the default shares, those of healthy people; resting.c has their sources. */
supine_resting supine_reference_resting_default(void);

/** Set the volume at rest in a posture along an axis ("prone", ...; posture.h).
 * @param value  "0.43", a share of the full volume; "0.42/0.44", of the left and the right lung's;
 *               "2600mL", gas and tissue of the lungs together
 * @retval SUPINE_ERROR_ARGUMENT  no such posture, one between axes, or a volume out of range */
supine_status supine_reference_resting_set(supine_resting *resting, const char *posture,
                                           const char *value, supine_error *error);

/** Print the shares so that --resting reads them back: "left=0.413/0.546,...,upright=0.481/0.506".
 * 256 characters are enough. */
void supine_reference_resting_print(const supine_resting *resting, char *text, size_t size);

/** Convert volumes in mL into shares of the reference volumes. If any posture was given in mL, the
 * default shares of the other postures are scaled by the same mean factor.
 * @param side  [count] of the lungs: +1 left, -1 right
 * @param full  [count] F, mL
 * @retval SUPINE_ERROR_ARGUMENT  a share out of range: less than the tissue alone, or above 1 */
supine_status supine_reference_resting_settle(supine_resting *resting, size_t count,
                                              const int *side, const double *full,
                                              supine_error *error);

/** Compute r of one lung (side +1 left, -1 right) with gravity along the unit vector g. */
double supine_reference_resting_share(const supine_resting *resting, int side, const double g[3]);

/** Compute phi with gravity along the unit vector g. */
double supine_reference_full_share(const double g[3]);

/** Compute r of both lungs together, for lungs of usual size: the left one holds 45 %. */
double supine_reference_resting_total(const supine_resting *resting, const double g[3]);

/** Interpolate six values along the axes +x, -x, +y, -y, +z, -z at unit gravity g, by a function of
 * bands 0 and 1 and the two diagonal harmonics of band 2:
 *
 *     sum over k of (v(+k) - v(-k)) / 2 g_k + (v(+k) + v(-k)) / 2 g_k^2 */
double supine_reference_along_axes(const double values[6], const double g[3]);

/** Compute the coefficients [9] of the same function in real harmonics (sh.h). */
void supine_reference_harmonics(const double values[6], double harmonics[9]);

#endif
