/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Fit a lung's pressure-volume relation (supine/breath.h) to samples; read its parameters. The
 * functions are thread-safe. Before any call, turn off GSL's error handler: it ends the program. */
#ifndef SUPINE_PV_H
#define SUPINE_PV_H

#include <stddef.h>

#include <supine/breath.h>

/** Number of unknowns of a fit: the control parameters and the two end volumes of a curve. */
enum { SUPINE_PV_UNKNOWNS = SUPINE_PV_CONTROLS + 2 };

typedef struct supine_pv_sample {
  double pressure; /**< cmH2O */
  double volume;   /**< mL */
  size_t line;     /**< line of the file, for messages */
} supine_pv_sample;

/** Quality of the fit to one limb (inhale or exhale). */
typedef struct supine_pv_report {
  size_t samples; /**< number of samples; 0 if the curve was copied from the other limb */
  double control_interval[SUPINE_PV_CONTROLS]; /**< half-widths of confidence intervals of the
                                                  control parameters */
  double volume_interval[2]; /**< half-widths of confidence intervals of the end volumes V_low and
                                V_high, mL */
  double rms;                /**< root mean square residual, mL */
  double rms_percent;        /**< rms as a percentage of the samples' range of volumes */
} supine_pv_report;

/** Fit the curve V of one limb (inhale or exhale) to samples (P_j, V_j) by Levenberg-Marquardt:
 *
 *     minimise over c, V_low, V_high:  sum of (V(P_j) - V_j)^2
 *
 * The curve is defined in supine/breath.h. It has the control parameters c = (c_1, ..., c_5),
 * covers the range of the samples' pressures, and rises from V_low to V_high. Confidence intervals
 * use Student's t and the covariance at the minimum. If the curve is nearly flat over much of its
 * range, the samples determine some parameters poorly; these parameters stay within
 * +-SUPINE_PV_CONTROL_MAX and have wide intervals.
 *
 * Pressures must keep rising or keep falling. Volumes must rise with pressure, except for noise: a
 * volume may be less than the volume at a lower pressure by at most 10 % of the range of volumes.
 *
 * @param name        the samples' file, for messages
 * @param count       at least SUPINE_PV_UNKNOWNS + 1
 * @param samples     [count] finite
 * @param confidence  confidence level of the intervals, between 0 and 1 */
supine_status supine_options_pv_fit(const char *name, size_t count, const supine_pv_sample *samples,
                                    double confidence, supine_pv_curve *curve,
                                    supine_pv_report *report, supine_error *error);

/** Fit both limbs to a file of samples. A limb without samples takes the other limb's curve.
 *
 * The file is CSV with the columns pressure_cmH2O, volume_mL and, optionally, limb (inhale or
 * exhale). Without that column all samples belong to inhale.
 * @param reports  [SUPINE_PV_LIMB_COUNT] */
supine_status supine_options_pv_fit_file(const char *path, double confidence, supine_pv *pv,
                                         supine_pv_report *reports, supine_error *error);

/** Read the parameters that 'supine pv fit -o' wrote. A file with one limb sets both limbs. */
supine_status supine_options_pv_load(const char *path, supine_pv *pv, supine_error *error);

#endif
