/* SPDX-License-Identifier: MIT */
/** @file
 * The pressure-volume relation of a lung, and the breath that follows from it ([Santhanam2008]
 * III-B, V), as in `supine breathe`. One frame of a breathing basis:
 *
 *     supine_breath_evaluate(&pv, &breath, 1, &time, &volume, NULL, &error);   mL above rest
 *     state.volume = (supine_volume){SUPINE_VOLUME_REST, volume};
 *     supine_basis_pose(basis, &state, &pose, &error);
 *     supine_deform(basis, &pose, xyz);
 *
 * Each limb of the P-V loop, inhale and exhale, is a second-order differential equation for the
 * volume V over the normalised pressure x, -1 to 1 over the limb's range, driven by a control
 * function u that is a sum of five control parameters times basis functions:
 *
 *     V''(x) = u(x) V'(x)      u(x) = c_1 P_0(x) + c_2 P_1(x) + ... + c_5 P_4(x)
 *     x = (2 P - P_low - P_high) / (P_high - P_low)      V(-1) = V_low      V(1) = V_high
 *
 * [Santhanam2008] gives the form of the equation but not the functions. They are chosen because:
 * - V' is the compliance, so u is the relative rate at which compliance changes as the lung
 *   inflates. Compliance is positive for all parameters, so V rises with P everywhere and P(V)
 *   exists. With an added control function (V'' = u) a noisy limb can fold over, and V is a
 *   polynomial, which does not follow the flat ends of a stiff lung's sigmoid.
 * - A constant u gives exactly the exponential V = Vmax (1 - exp(-k P)) of [Salazar1964], with
 *   c_1 = -k (P_high - P_low) / 2. The sigmoid V = a + b / (1 + exp(-(P - c) / d)) of [Venegas1998]
 *   has u = -tanh((P - c) / 2d) in units of 1/d: smooth and bounded, so that few polynomials
 *   approximate it.
 * - Legendre polynomials P_0 to P_4 are orthogonal over the range, so that the parameters are as
 *   independent as evenly spread samples allow. c_1 is half the logarithm of the ratio of the
 *   compliances at the two ends (negative: stiffer when full), c_2 < 0 puts the greatest compliance
 *   inside the range (a sigmoid), c_3 skews it, c_4 and c_5 sharpen its knees.
 *
 * Pressures are in cmH2O: transpulmonary for a lung, airway for lung and chest wall together,
 * whichever was sampled. Volumes are in mL. A limb is not defined outside its range. Every function
 * is thread-safe and allocates nothing.
 *
 * [Santhanam2008]  Santhanam, Imielinska, Davenport, Kupelian, Rolland, IEEE Trans. Inf. Technol.
 *                  Biomed. 12(2), 2008
 * [Salazar1964]    Salazar, Knowles, J. Appl. Physiol. 19, 1964, 97-104
 * [Venegas1998]    Venegas, Harris, Simon, J. Appl. Physiol. 84, 1998, 389-395 */
#ifndef SUPINE_BREATH_H
#define SUPINE_BREATH_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
  SUPINE_PV_CONTROLS = 5,    /**< number of control parameters of a limb */
  SUPINE_PV_CONTROL_MAX = 50 /**< largest |c_i|; c_1 = 50 changes the compliance e^100-fold over the
                                range, far more than in any lung */
};

/** The limbs of a P-V loop. */
typedef enum supine_pv_limb {
  SUPINE_PV_INHALE = 0,
  SUPINE_PV_EXHALE,
  SUPINE_PV_LIMB_COUNT
} supine_pv_limb;

/** One limb of the P-V loop. */
typedef struct supine_pv_curve {
  double pressure[2]; /**< pressures P_low < P_high at the ends of the limb, cmH2O */
  double volume[2];   /**< volumes V_low < V_high at the ends of the limb, mL */
  double control[SUPINE_PV_CONTROLS]; /**< control parameters c_1 to c_5 */
} supine_pv_curve;

/** The P-V loop of a lung: two limbs, which are equal if there is no hysteresis. */
typedef struct supine_pv {
  supine_pv_curve limb[SUPINE_PV_LIMB_COUNT];
} supine_pv;

/** Return "inhale", "exhale" or, for other values, "unknown limb"; never NULL. */
SUPINE_API const char *supine_breath_limb_name(supine_pv_limb limb);

/** Return the P-V loop of a normal adult lung, the default if no loop was measured: 0 to 30 cmH2O,
 * 0 to 6000 mL.
 *
 * The exhale limb is the exponential of [Salazar1964] with k = ln 2 / 7.58 cmH2O, the mean
 * half-inflation pressure of 20 normal subjects, and 6000 mL, an adult's total lung capacity, at 30
 * cmH2O. The inhale limb is a sigmoid [Venegas1998] between the same ends with c = 10 and d = 6
 * cmH2O; it stays below the exhale limb. The product b d, 44,600 mL cmH2O, lies between the 10^4
 * and 10^5 that Narusawa (J. Appl. Physiol. 91, 2001, 201-210) found in published curves, but c and
 * d are round numbers, not means of measured lungs. */
SUPINE_API const supine_pv *supine_breath_normal(void);

/** Check a limb: finite numbers, rising ranges, and parameters within SUPINE_PV_CONTROL_MAX.
 * @retval SUPINE_ERROR_ARGUMENT  the limb fails one of these checks */
SUPINE_API supine_status supine_breath_curve_check(const supine_pv_curve *curve,
                                                   supine_error *error);

/** Compute the volume V(P) and the compliance dV/dP of a limb. The solution of its equation is
 *
 *     V(x) = V_low + (V_high - V_low) I(x) / I(1)        I(x) = integral from -1 to x of exp(U)
 *     U(x) = integral from -1 to x of u
 *          = c_1 (x + 1) + sum over n of c_n+1 (P_n+1 - P_n-1) / (2 n + 1)
 *
 * I is computed by Gauss-Legendre quadrature, with 16 points in each of 32 parts of the range.
 * Cost: 512 exponentials, and 16 for each pressure.
 *
 * @param pressures    [count] cmH2O within the limb's range, in any order
 * @param volumes      [count] mL, written; may be NULL
 * @param compliances  [count] mL/cmH2O, written; may be NULL
 * @retval SUPINE_ERROR_ARGUMENT  a pressure is outside the range or not finite, or the limb fails
 *                                supine_breath_curve_check */
SUPINE_API supine_status supine_breath_curve_evaluate(const supine_pv_curve *curve, size_t count,
                                                      const double *pressures, double *volumes,
                                                      double *compliances, supine_error *error);

/** The course of pressure from rest to its peak and back. */
typedef enum supine_pv_course {
  SUPINE_PV_COSINE = 0,    /**< half a cosine of pressure each way, as in quiet breathing */
  SUPINE_PV_RAMP,          /**< pressure linear in time, as a ventilator's ramp */
  SUPINE_PV_CONSTANT_FLOW, /**< volume linear in time, as in [Santhanam2008] V: 500 mL in 5 s of
                              inhalation, 1.5 mL in each step of 15 ms */
  SUPINE_PV_COURSE_COUNT
} supine_pv_course;

/** A breath, repeated without end. */
typedef struct supine_pv_breath {
  double tidal;           /**< volume of a breath, mL, > 0 */
  double rate;            /**< breaths per minute, > 0 */
  double inhale_fraction; /**< fraction of the breath's time that is inhalation, > 0 and < 1 */
  double rest_pressure;   /**< pressure at the end of an exhalation, cmH2O */
  supine_pv_course course;
} supine_pv_breath;

/** Return the default breath: 500 mL, 12 per minute, a third of the time inhaling, from a pressure
 * of 5 cmH2O at rest, by half cosines of pressure. */
SUPINE_API supine_pv_breath supine_breath_default(void);

/** Compute the volume above rest, and the pressure, at given times. A breath begins at time 0, at
 * rest.
 *
 * At the peak pressure, the inhale limb holds the tidal volume above rest. The breath follows both
 * limbs between the pressure at rest and the peak, scaled to the tidal volume so that the loop
 * closes:
 *
 *     V(t) = tidal (V_limb(P(t)) - V_limb(P_rest)) / (V_limb(P_peak) - V_limb(P_rest))
 *
 * The scale is 1 on the inhale limb. V is 0 at rest and the tidal volume at the peak, to rounding.
 *
 * @param pv         may be NULL for constant flow if `pressures` is NULL
 * @param times      [count] s, any finite
 * @param volumes    [count] mL above rest, written; may be NULL
 * @param pressures  [count] cmH2O, written; may be NULL
 * @retval SUPINE_ERROR_ARGUMENT   the breath is outside its documented ranges, the pressure at rest
 *                                 is outside the range of a limb, or the tidal volume or its peak
 *                                 pressure is beyond the end of a limb
 * @retval SUPINE_ERROR_NUMERICAL  a limb is so flat that its volume does not rise between rest and
 *                                 peak
 *
 * Cost: about 20 microseconds, and less than 1 microsecond for each time. */
SUPINE_API supine_status supine_breath_evaluate(const supine_pv *pv, const supine_pv_breath *breath,
                                                size_t count, const double *times, double *volumes,
                                                double *pressures, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
