/* SPDX-License-Identifier: MIT */
/** @file
 * The pressure-volume (P-V) relation of a lung, and breaths that follow it ([Santhanam2008] III-B,
 * V). In each frame of an animated breath, call
 *
 *     supine_breath_evaluate(&pv, &breath, 1, &time, &volume, NULL, &error); // mL above rest
 *     state.volume = (supine_volume){SUPINE_VOLUME_REST, volume};
 *     supine_basis_pose(basis, &state, &pose, &error);
 *     supine_deform(basis, &pose, xyz);
 *
 * The P-V loop has two limbs, inhale and exhale. On each limb, the volume V satisfies a
 * second-order differential equation in the normalised pressure x. Its control function u is the
 * sum of five Legendre polynomials L_0 to L_4, each multiplied by a control parameter:
 *
 *     V''(x) = u(x) V'(x)      u(x) = c_1 L_0(x) + c_2 L_1(x) + ... + c_5 L_4(x)
 *     x = (2 P - P_low - P_high) / (P_high - P_low)      V(-1) = V_low      V(1) = V_high
 *
 * [Santhanam2008] states such an equation with five parameters, but does not define the control
 * function. The control function has the form above for these reasons:
 * - V' is the compliance, so u is the relative rate at which compliance changes as the lung
 *   inflates. Compliance is positive for all parameters. V therefore rises with P everywhere, and
 *   P(V) exists. In the equation V'' = u, noisy data could make V fall while P rises, and a
 *   polynomial V could not follow the flat ends of a stiff lung's sigmoid.
 * - A constant u gives exactly the exponential V = Vmax (1 - exp(-k P)) of [Salazar1964], with
 *   c_1 = -k (P_high - P_low) / 2. For the sigmoid V = a + b / (1 + exp(-(P - c) / d)) of
 *   [Venegas1998], u is proportional to -tanh((P - c) / (2 d)). A few polynomials approximate this
 *   function, as it is smooth and bounded.
 * - Legendre polynomials are orthogonal over the range of x, so that the parameters hardly depend
 *   on each other if samples are spread evenly. c_1 is half of
 *   log(compliance at P_high / compliance at P_low). It is negative if the lung is stiffer at
 *   P_high. A negative c_2 makes a sigmoid: the compliance is greatest inside the range. c_3 skews
 *   the sigmoid, and c_4 and c_5 sharpen its knees.
 *
 * Pressures are in cmH2O: transpulmonary pressures for a lung alone, airway pressures for lung and
 * chest wall together. Volumes are in mL. A limb is not defined outside its range. Every function
 * is thread-safe and allocates nothing.
 *
 * [Santhanam2008]  Santhanam, Imielinska, Davenport, Kupelian, Rolland, IEEE Trans. Inf. Technol.
 *                  Biomed. 12(2), 2008
 * [Salazar1964]    Salazar, Knowles, J. Appl. Physiol. 19, 1964, 97-104
 * [Venegas1998]    Venegas, Harris, Simon, J. Appl. Physiol. 84, 1998, 389-395
 *
 * Stability: growing. A minor version may change functions and structs without a replacement;
 * CHANGELOG.md names the change. */
#ifndef SUPINE_BREATH_H
#define SUPINE_BREATH_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
  SUPINE_PV_CONTROLS = 5,
  SUPINE_PV_CONTROL_MAX = 50 /**< largest magnitude of a control parameter of a P-V curve */
};

typedef enum supine_pv_limb {
  SUPINE_PV_INHALE = 0,
  SUPINE_PV_EXHALE,
  SUPINE_PV_LIMB_COUNT
} supine_pv_limb;

/** One limb of a P-V loop: the curve of volume against pressure in inhalation or in exhalation. */
typedef struct supine_pv_curve {
  double pressure[2]; /**< pressures P_low < P_high at the ends, cmH2O */
  double volume[2];   /**< volumes V_low < V_high at the ends, mL */
  /** Control parameters c_1 to c_5 of the limb: coefficients of V''(x) / V'(x) in the Legendre
   * polynomials of degrees 0 to 4. */
  double control[SUPINE_PV_CONTROLS];
} supine_pv_curve;

/** The P-V loop of a lung: two limbs, which are equal if there is no hysteresis. */
typedef struct supine_pv {
  supine_pv_curve limb[SUPINE_PV_LIMB_COUNT];
} supine_pv;

/** Return "inhale", "exhale" or, for other values, "unknown limb"; never NULL. */
SUPINE_API const char *supine_breath_limb_name(supine_pv_limb limb);

/** Return the P-V loop of a normal adult lung, for use if no loop was measured. Both limbs run from
 * 0 mL at 0 cmH2O to 6000 mL, an adult's total lung capacity, at 30 cmH2O.
 *
 * The exhale limb is the exponential 1 - exp(-k P) of [Salazar1964], scaled to this range, with
 * k = ln 2 / (7.58 cmH2O); 7.58 cmH2O is the mean half-inflation pressure of 20 normal subjects.
 * The inhale limb is the sigmoid a + b / (1 + exp(-(P - c) / d)) of [Venegas1998], and stays below
 * the exhale limb. Its c = 10 cmH2O and d = 6 cmH2O are round numbers, not means of measured
 * lungs. They are plausible, as b d is 44,600 mL cmH2O, and Narusawa (J. Appl. Physiol. 91, 2001,
 * 201-210) found 10^4 to 10^5 in published curves. */
SUPINE_API const supine_pv *supine_breath_normal(void);

/** Check one limb of a P-V loop: its numbers are finite, its pressures and its volumes rise from
 * the lower to the upper end, and no control parameter exceeds SUPINE_PV_CONTROL_MAX in magnitude.
 * @retval SUPINE_ERROR_ARGUMENT  a check failed */
SUPINE_API supine_status supine_breath_curve_check(const supine_pv_curve *curve,
                                                   supine_error *error);

/** Compute the volume V(P) and the compliance dV/dP of a limb at pressures P. With the normalised
 * pressure x, the control parameters c_1 to c_5 and the Legendre polynomials L_n of the top of this
 * file, the volume is
 *
 *     V(x) = V_low + (V_high - V_low) I(x) / I(1)        I(x) = integral from -1 to x of exp(U)
 *     U(x) = integral from -1 to x of u
 *          = c_1 (x + 1) + sum over n = 1 to 4 of c_(n+1) (L_(n+1)(x) - L_(n-1)(x)) / (2 n + 1)
 *
 * I is computed by Gauss-Legendre quadrature, with 16 points in each of 32 equal parts of the
 * range. Cost: 512 exponentials, and about 16 more for each pressure.
 * @param pressures    [count] cmH2O within the limb's range, in any order
 * @param volumes      [count] mL, written; may be NULL
 * @param compliances  [count] mL/cmH2O, written; may be NULL
 * @retval SUPINE_ERROR_ARGUMENT  a pressure is outside the range or not finite, or the limb fails
 *                                supine_breath_curve_check */
SUPINE_API supine_status supine_breath_curve_evaluate(const supine_pv_curve *curve, size_t count,
                                                      const double *pressures, double *volumes,
                                                      double *compliances, supine_error *error);

/** How the pressure or the volume changes with time during inhalation and during exhalation. */
typedef enum supine_pv_course {
  SUPINE_PV_COSINE = 0,    /**< pressure follows half a cosine, as in quiet breathing */
  SUPINE_PV_RAMP,          /**< pressure is linear in time, like the ramp of a ventilator */
  SUPINE_PV_CONSTANT_FLOW, /**< volume is linear in time, as in section V of [Santhanam2008] */
  SUPINE_PV_COURSE_COUNT
} supine_pv_course;

/** A breath that repeats without end. */
typedef struct supine_pv_breath {
  double tidal;           /**< tidal volume, mL, above 0 */
  double rate;            /**< breaths per minute, above 0 */
  double inhale_fraction; /**< fraction of a breath's time that is inhalation, between 0 and 1 */
  double rest_pressure;   /**< pressure at the end of an exhalation, cmH2O */
  supine_pv_course course;
} supine_pv_breath;

/** Return the default breath: 500 mL, 12 breaths per minute, inhalation in a third of the time, 5
 * cmH2O at rest, and a pressure that follows half a cosine (SUPINE_PV_COSINE). */
SUPINE_API supine_pv_breath supine_breath_default(void);

/** Compute the volume above rest, and the pressure, at given times. A breath begins at time 0, at
 * rest.
 *
 * The pressure rises along the inhale limb from the rest pressure P_rest to P_peak, where this limb
 * has gained the tidal volume, and falls along the exhale limb. Volumes are scaled so that both
 * limbs gain the tidal volume, which closes the loop:
 *
 *     V(t) = tidal (V_limb(P(t)) - V_limb(P_rest)) / (V_limb(P_peak) - V_limb(P_rest))
 *
 * V_limb is the volume of the limb at a pressure. Up to rounding, V is 0 at rest, and equals
 * the tidal volume at the peak. Cost: about 20 microseconds, and less than 1 microsecond per time.
 * @param pv         P-V loop; may be NULL for constant flow if `pressures` is NULL
 * @param times      [count] s, finite
 * @param volumes    [count] mL above rest, written; may be NULL
 * @param pressures  [count] cmH2O, written; may be NULL
 * @retval SUPINE_ERROR_ARGUMENT   a time or a member of `breath` is out of range, a limb fails
 *                                 supine_breath_curve_check, or the rest pressure, the peak
 *                                 pressure or the tidal volume is outside the range of a limb
 * @retval SUPINE_ERROR_NUMERICAL  a limb is so flat that its volume does not rise between rest and
 *                                 peak */
SUPINE_API supine_status supine_breath_evaluate(const supine_pv *pv, const supine_pv_breath *breath,
                                                size_t count, const double *times, double *volumes,
                                                double *pressures, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
