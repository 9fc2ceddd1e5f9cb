/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute volumes at rest and at full inflation, by posture and by lung.
 *
 * Volumes are gas and tissue. F_l is the reference volume of lung l: the volume of its reference
 * surface, which shows full inflation when supine. With gravity along g, the lung has the volume
 * r_l(g) F_l at rest, and phi(g) F_l at full inflation, where phi(g) = 1 + 0.109 max(0, -g_z)^2 is
 * larger upright. Between these volumes, each lung fills linearly (Milic-Emili, J Appl Physiol
 * 1966), and both lungs have the same degree of filling t:
 *
 *     V_l = F_l [r_l + (phi - r_l) t]      for t >= 0; t is 0 at rest and 1 at full inflation
 *     V_l = F_l r_l (1 + t)                for t < 0; both lungs shrink in proportion */
#ifndef SUPINE_RESTING_H
#define SUPINE_RESTING_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

/** Published volumes with their standard deviation between people (SD), number of people (n) and
 * source. FRC, the functional residual capacity, is gas alone. "Not found": a search of public
 * texts did not show the source again. */
/* clang-format off */
#define SUPINE_REST_SHARE 0.48  /**< at rest / at full inflation, supine: sources in resting.c */
#define SUPINE_REST_SPREAD 0.08 /**< SD of this share */
#define SUPINE_COPD_SHARE 0.64  /**< the same in COPD, n 10, 0.49 to 0.81 (CTs, DIR-Lab COPDgene) */
#define SUPINE_COPD_SPREAD 0.11 /**< SD of the share in COPD */
#define SUPINE_FULL_UPRIGHT_GAIN 0.109 /**< growth of full inflation, supine to upright, n 32; left
                                        * 0.116, right 0.103 (Yamada, Respiration 99:598, 2020) */
#define SUPINE_LYING_ML 806.0    /**< FRC sitting minus supine, SD 293, n 13 (Lumb & Nimmo, Anesth
                                  * Analg 73:422, 1991) */
#define SUPINE_RESIDUAL_ML 1400.0 /**< gas left by a full expiration, supine, SD 600; not found */
#define SUPINE_TISSUE_ML 860.0   /**< tissue of both lungs, n 12 (Denison, Thorax 41:620, 1986; not
                                  * found); 836, SD 393, n 15 (Qanadli, 1999, by MRI) */
/* clang-format on */

/** Usual share of the left lung in the full volume of both lungs. */
#define SUPINE_LEFT_SHARE 0.45

enum { SUPINE_RESTING_POSTURES = 6 };

/** Names of the postures with gravity along +x, -x, +y, -y, +z, -z, ended by NULL. */
extern const char *const supine_physics_resting_names[SUPINE_RESTING_POSTURES + 1];

/** Volumes at rest in six postures, with gravity along +x, -x, +y, -y, +z, -z: lying on the left,
 * on the right, supine, prone, head down, upright. */
typedef struct supine_resting {
  double share[2][6]; /**< [lung, posture] volume at rest / reference volume; left lung first */
  double ml[6];   /**< [posture] volume of both lungs at rest, mL; 0 if `share` gives it instead */
  bool given[6];  /**< [posture] whether the volume is the patient's own, not assumed */
  bool predicted; /**< whether supine_physics_reference_predict_rest has set the supine volume */
  double assumed; /**< share of both lungs, supine, from which other volumes are assumed */
  double spread;  /**< standard deviation of an assumed volume at rest / volume at full inflation */
} supine_resting;

/** Return the default volumes at rest, those of healthy people; resting.c names their sources. */
supine_resting supine_physics_resting_default(void);

/** Set the volume at rest in a posture with gravity along an axis, such as "prone" (posture.h). A
 * share scales the default shares of the postures that are not given, by the mean of (given share)
 * / (default share). The posture "copd" stands for the usual share in COPD, supine.
 * @param value  "0.48", a share of the full volume; "0.47/0.49", shares for the left and the right
 *   lung; "2600mL", gas and tissue of both lungs together; NULL for "copd" */
supine_status supine_physics_resting_set(supine_resting *resting, const char *posture,
                                         const char *value, supine_error *error);

/** Set the volume at rest with gravity along axis 0 to 5 (supine_resting), as
 * supine_physics_resting_set does.
 * @param ml     gas and tissue of both lungs, mL; or 0 to use `share`
 * @param share  [2] shares of the full volume of the left and the right lung; if the second is 0,
 *   the first is the share of both lungs together */
supine_status supine_physics_resting_give(supine_resting *resting, size_t axis, double ml,
                                          const double share[2], supine_error *error);

/** Print the volumes at rest as shares of the full volume, left lung/right lung, in the form of the
 * option --resting: "left=0.462/0.61,...,upright=0.538/0.566". 256 characters are enough. */
void supine_physics_resting_print(const supine_resting *resting, char *text, size_t size);

/** Return whether the volume at rest in a posture is the patient's own. */
bool supine_physics_resting_given(const supine_resting *resting);

/** Convert volumes at rest in mL into shares of the reference volumes. Set the shares of the
 * postures that are not given to their defaults, times the mean of (given volume) / (default
 * volume), or times resting->assumed / SUPINE_REST_SHARE if none is given.
 * @param side  [count] +1: left lung, -1: right lung
 * @param full  [count] reference volume of each lung, mL; if NULL, volumes in mL are kept for later
 */
supine_status supine_physics_resting_settle(supine_resting *resting, size_t count, const int *side,
                                            const double *full, supine_error *error);

/** Compute a lung's volume at rest as a share of its reference volume, with gravity along g.
 * @param side  +1: left lung, -1: right lung */
double supine_physics_resting_share(const supine_resting *resting, int side, const double g[3]);

/** Compute the volume at full inflation as a share of the reference volume, for gravity along g. */
double supine_physics_resting_full_share(const double g[3]);

/** Compute the volume of both lungs at rest divided by their reference volume, with gravity along
 * g. Assume that the left lung has the share SUPINE_LEFT_SHARE of the reference volume. */
double supine_physics_resting_total(const supine_resting *resting, const double g[3]);

/** Write the direction of gravity along axis 0 to 5, which are +x, -x, +y, -y, +z, -z. */
void supine_physics_resting_axis(size_t axis, double g[3]);

/** Interpolate values v, given along +x, -x, +y, -y, +z, -z, at the unit vector g. Return
 *
 *     sum over k = x, y, z of [(v(+k) - v(-k)) g_k + (v(+k) + v(-k)) g_k^2] / 2 */
double supine_physics_resting_along_axes(const double values[6], const double g[3]);

/** Interpolate values that are given along +x, -x, +y, -y, +z, -z
 * (supine_physics_resting_along_axes), and expand the result in real spherical harmonics of degrees
 * 0 to 2, with 9 coefficients. */
void supine_physics_resting_harmonics(const double values[6], double harmonics[9]);

#endif
