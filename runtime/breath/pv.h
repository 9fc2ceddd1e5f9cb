/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The lung's pressure-volume relation, and the breath that it shapes ([Santhanam2008] III-B, V).
 *
 * Each limb of the P-V loop, inhale and exhale, is a second-order differential equation for the
 * volume V over the normalised pressure x, -1 to 1 over the limb's range, driven by a control
 * function u that is a sum of five control parameters times basis functions:
 *
 *     V''(x) = u(x) V'(x)      u(x) = c_1 P_0(x) + c_2 P_1(x) + ... + c_5 P_4(x)
 *     x = (2 P - P_low - P_high) / (P_high - P_low)      V(-1) = V_low      V(1) = V_high
 *
 * The source gives this form and not the functions; these are chosen because:
 * - V' is the compliance, so u is the relative rate at which compliance changes as the lung
 *   inflates. Compliance stays positive whatever the parameters, so V rises with P all the way and
 *   P(V) exists. A control function that is added (V'' = u) can fold a noisy limb over, and its V
 *   is a polynomial, which does not follow the flat ends of a stiff lung's sigmoid.
 * - Constant u is Salazar-Knowles' V = Vmax (1 - exp(-k P)) exactly, with c_1 = -k (P_high - P_low)
 *   / 2. Venegas' sigmoid V = a + b / (1 + exp(-(P - c) / d)) is u = -tanh((P - c) / 2d) in units
 *   of 1/d: smooth and bounded, what few polynomials follow.
 * - Legendre polynomials P_0 to P_4 are orthogonal over the range, so that the parameters are as
 *   independent as evenly spread samples allow. c_1 is half the logarithm of the ratio of the
 *   compliances at the two ends (negative: stiffer when full), c_2 < 0 puts the greatest compliance
 *   inside the range (a sigmoid), c_3 skews it, c_4 and c_5 sharpen its knees.
 *
 * Pressures are cmH2O (transpulmonary for a lung, airway for lung and chest wall together; the
 * samples decide), volumes mL. Nothing is said outside the range of a limb's samples.
 * Everything here is thread-safe. GSL's default error handler aborts: programs turn it off.
 *
 * [Santhanam2008]  Santhanam, Imielinska, Davenport, Kupelian, Rolland, IEEE Trans. Inf. Technol.
 *                  Biomed. 12(2), 2008
 * [Salazar1964]    Salazar, Knowles, J. Appl. Physiol. 19, 1964, 97-104
 * [Venegas1998]    Venegas, Harris, Simon, J. Appl. Physiol. 84, 1998, 389-395 */
#ifndef SUPINE_PV_H
#define SUPINE_PV_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
  SUPINE_PV_CONTROLS = 5,    /**< control parameters of a limb */
  SUPINE_PV_UNKNOWNS = 7,    /**< and the volumes at the two ends: what a fit determines */
  SUPINE_PV_CONTROL_MAX = 50 /**< largest |c_i|: compliance changes e^100-fold, far past any lung */
};

typedef enum supine_pv_limb {
  SUPINE_PV_INHALE = 0,
  SUPINE_PV_EXHALE,
  SUPINE_PV_LIMB_COUNT
} supine_pv_limb;

/** One limb. */
typedef struct supine_pv_curve {
  double pressure[2];                 /**< P_low < P_high, cmH2O */
  double volume[2];                   /**< V_low < V_high, mL */
  double control[SUPINE_PV_CONTROLS]; /**< c_1 to c_5 */
} supine_pv_curve;

/** Both limbs of a lung; the same twice where there is no hysteresis to speak of. */
typedef struct supine_pv {
  supine_pv_curve limb[SUPINE_PV_LIMB_COUNT];
} supine_pv;

/** "inhale" or "exhale"; never NULL. */
const char *supine_breath_limb_name(supine_pv_limb limb);

/** The normal adult lung that stands in where nothing was measured, 0 to 30 cmH2O, 0 to 6000 mL.
 *
 * Exhale: Salazar-Knowles with k = ln 2 / 7.58 cmH2O, the mean half-inflation pressure of 20 normal
 * subjects [Salazar1964], and 6000 mL, an adult's total lung capacity, at 30 cmH2O. Inhale: a
 * Venegas sigmoid between the same ends with c = 10 and d = 6 cmH2O, which stays under the exhale
 * limb. Its b d = 44,600 mL cmH2O lies in the 10^4 to 10^5 that Narusawa (J. Appl. Physiol. 91,
 * 2001, 201-210) found over published curves, but c and d are round numbers, no mean of measured
 * lungs. */
const supine_pv *supine_breath_normal(void);

/** Whether a limb's numbers are finite, its ranges rise and its parameters are within bounds.
 * @retval SUPINE_ERROR_ARGUMENT */
supine_status supine_breath_curve_check(const supine_pv_curve *curve, supine_error *error);

/** V(P) and the compliance dV/dP: integrates the equation (GSL, Prince-Dormand 8(9)).
 *
 * @param pressures    [count] cmH2O within the limb's range, in any order
 * @param volumes      [count] mL, written; NULL: not wanted
 * @param compliances  [count] mL/cmH2O, written; NULL: not wanted
 * @retval SUPINE_ERROR_ARGUMENT   a pressure outside the range, or not finite; a bad curve
 * @retval SUPINE_ERROR_NUMERICAL  the integration failed
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_breath_curve_evaluate(const supine_pv_curve *curve, size_t count,
                                           const double *pressures, double *volumes,
                                           double *compliances, supine_error *error);

/** P(V), the inverse of supine_breath_curve_evaluate; it exists for every limb.
 *
 * @param volumes    [count] mL within the limb's range, in any order
 * @param pressures  [count] cmH2O, written
 * Statuses as supine_breath_curve_evaluate. */
supine_status supine_breath_invert(const supine_pv_curve *curve, size_t count,
                                   const double *volumes, double *pressures, supine_error *error);

/** How well samples determine a limb. */
typedef struct supine_pv_report {
  size_t samples;    /**< 0: the limb had none, and its curve is the other limb's */
  double confidence; /**< of the intervals, 0 to 1 */
  double control_interval[SUPINE_PV_CONTROLS];               /**< c_i +- this, Student t */
  double volume_interval[2];                                 /**< V_low, V_high +- this, mL */
  double covariance[SUPINE_PV_UNKNOWNS][SUPINE_PV_UNKNOWNS]; /**< c_1 ... c_5, V_low, V_high */
  double rms;                                                /**< root mean square misfit, mL */
  double rms_percent; /**< the same as a percentage of the samples' volume range */
  double condition;   /**< of the least-squares problem, columns scaled to unit length */
} supine_pv_report;

/** The limb that fits samples best: the inverse problem.
 *
 *     minimise over c, V_low, V_high:  sum of (V(P_j) - V_j)^2
 *
 * by Levenberg-Marquardt on the equation and its variational equations, which give the response of
 * V to each basis function; covariance and Student-t intervals follow from the responses at the
 * minimum. The range of the limb is that of the samples. Where a limb is flat over much of its
 * range the samples say little about some parameters: those stop at +-SUPINE_PV_CONTROL_MAX at the
 * latest and their intervals are wide, while the curve itself still fits. Samples that no lung
 * gives, such as a single step, end there too: `rms_percent` tells.
 *
 * Pressures must rise or fall strictly. Volumes must rise with pressure, but for noise: a sample
 * may step back from the local trend, or from the greatest volume so far, by up to 8 % of the
 * volume range. Where at least 15 samples tell what the noise is, by up to 7 sigma of the
 * difference of two samples, sigma estimated from the median misfit, and never more than 15 %.
 *
 * @param count       more than SUPINE_PV_UNKNOWNS
 * @param pressures   [count] cmH2O
 * @param volumes     [count] mL
 * @param lines       [count] line of each sample, for messages; NULL: samples count from 1
 * @param name        of the samples, for messages; NULL: none
 * @param confidence  of the intervals, e.g. 0.95, between 0 and 1
 * @param curve       written
 * @param report      written; NULL: not wanted
 * @retval SUPINE_ERROR_FORMAT     too few samples, not finite, repeated or unordered pressures,
 *                                 volumes that fall: the message names the line
 * @retval SUPINE_ERROR_ARGUMENT   confidence
 * @retval SUPINE_ERROR_NUMERICAL  no minimum was reached
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_breath_fit(size_t count, const double *pressures, const double *volumes,
                                const size_t *lines, const char *name, double confidence,
                                supine_pv_curve *curve, supine_pv_report *report,
                                supine_error *error);

/** Samples of a lung as a file holds them. */
typedef struct supine_pv_samples {
  char *name; /**< the file's */
  size_t count[SUPINE_PV_LIMB_COUNT];
  double *pressure[SUPINE_PV_LIMB_COUNT]; /**< [count] cmH2O, in the file's order */
  double *volume[SUPINE_PV_LIMB_COUNT];   /**< [count] mL */
  size_t *line[SUPINE_PV_LIMB_COUNT];     /**< [count] where each stood */
} supine_pv_samples;

/** Reads samples: CSV with a header naming the columns pressure_cmH2O, volume_mL and, optionally,
 * limb (inhale or exhale; without it all are inhale), in any order. Lines that begin with # and
 * empty lines are skipped.
 * @retval SUPINE_ERROR_READ    missing file
 * @retval SUPINE_ERROR_FORMAT  the message names the line
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_breath_samples_load(const char *path, supine_pv_samples *samples,
                                         supine_error *error);

/** Frees what load allocated; legal on a zeroed struct, and twice. */
void supine_breath_samples_clear(supine_pv_samples *samples);

/** Fits both limbs. A limb without samples takes the other's curve.
 * @param reports  [SUPINE_PV_LIMB_COUNT] written; NULL: not wanted
 * Statuses as supine_breath_fit. */
supine_status supine_breath_fit_samples(const supine_pv_samples *samples, double confidence,
                                        supine_pv *pv, supine_pv_report *reports,
                                        supine_error *error);

/** Writes parameters, whole or not at all: CSV, one row a limb, digits enough to read back the very
 * same numbers.
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_ARGUMENT (a bad curve), SUPINE_ERROR_MEMORY */
supine_status supine_breath_save(const char *path, const supine_pv *pv, supine_error *error);

/** Reads what supine_breath_save wrote. Where a file has one limb alone it serves for both.
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT, SUPINE_ERROR_MEMORY */
supine_status supine_breath_load(const char *path, supine_pv *pv, supine_error *error);

/** How pressure goes from rest to its peak and back. */
typedef enum supine_pv_course {
  SUPINE_PV_COSINE = 0,    /**< half a cosine each way: quiet breathing */
  SUPINE_PV_RAMP,          /**< straight lines: a ventilator's pressure ramp */
  SUPINE_PV_CONSTANT_FLOW, /**< volume, not pressure, goes in straight lines: [Santhanam2008] V,
                                500 mL over 5 s of inhalation, 1.5 mL in each step of 15 ms */
  SUPINE_PV_COURSE_COUNT
} supine_pv_course;

/** A breath, over and over. */
typedef struct supine_pv_breath {
  double tidal;           /**< mL inhaled, > 0 */
  double rate;            /**< breaths a minute, > 0 */
  double inhale_fraction; /**< of the breath's time, between 0 and 1 */
  double rest_pressure;   /**< cmH2O at the end of an exhalation */
  supine_pv_course course;
} supine_pv_breath;

/** 500 mL, 12 a minute, inhaling a third of the time, from 5 cmH2O, half cosines. */
supine_pv_breath supine_breath_default(void);

/** Volume above rest, and pressure, at given times. A breath begins at time 0, at rest.
 *
 * The inhale limb says which peak pressure holds the tidal volume over rest; both limbs are
 * followed between rest and that pressure and scaled to the tidal volume, so that the loop closes:
 *
 *     V(t) = tidal (V_limb(P(t)) - V_limb(P_rest)) / (V_limb(P_peak) - V_limb(P_rest))
 *
 * The scale is 1 on the inhale limb. V is 0 at rest and the tidal volume at the peak, to rounding.
 *
 * @param pv         NULL is legal for constant flow without pressures
 * @param times      [count] s, any finite
 * @param volumes    [count] mL, written; NULL: not wanted
 * @param pressures  [count] cmH2O, written; NULL: not wanted
 * @retval SUPINE_ERROR_ARGUMENT  a breath outside its documented ranges, a rest pressure outside a
 *                                limb, or a tidal volume or its peak pressure past a limb's end
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_breath_evaluate(const supine_pv *pv, const supine_pv_breath *breath,
                                     size_t count, const double *times, double *volumes,
                                     double *pressures, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
