/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Fit functions of gravity and volume to the displacement fields of another simulator
 * (regression.h), and compress the fit.
 *
 * If the simulator ran at several volumes for one direction of gravity, each lung's volume in each
 * run is measured on its displaced surface, and mapped to a parameter t from -1 to 1. Otherwise the
 * fit is of gravity alone (order 0).
 *
 * The band and the order of a fit are the highest degrees of its harmonics and of its polynomials.
 * By default they are chosen by the error of runs that are left out: each run alone, and the runs
 * of one volume between the smallest and the largest. More terms are chosen if they reduce this
 * error by more than 1 %, and do not raise the error with all runs of a direction left out in place
 * of each run alone. */
#ifndef SUPINE_FIELDS_H
#define SUPINE_FIELDS_H

#include "precompute/fields/regression.h"
#include "precompute/lungs/lungs.h"
#include "precompute/physics/reference.h"
#include "precompute/projection/accuracy.h"

/** Displacements of all vertices in several runs of another simulator. */
typedef struct supine_fields {
  size_t run_count;
  size_t vertex_count;
  double *directions; /**< [run_count, 3] unit vectors along gravity; several runs may share one */
  double *displacement; /**< [run_count, vertex_count, 3] displacement of each vertex, mm */
} supine_fields;

/** Read displacement fields from a safetensors file with three tensors, F32 or F64: points [P, 3],
 * the positions of P points; gravity [M, 3], the directions of gravity of M runs; and displacement
 * [M, P, 3], the displacement of each point in each run. A fourth tensor, run [M], has the number
 * of the run of each row of displacement: it then belongs to the row of gravity whose fourth column
 * is this number, or else to the row of this number. All are in the same axes and unit. Each vertex
 * of `lungs` takes the displacement of the point at its position, within 1e-4 of the diagonal of
 * the bounding box. Other points, such as inner nodes of a volume mesh, are left out.
 * @param lungs   the reference surface
 * @param frame   axes and unit of the file, which are those of the files of the lungs; a frame of
 *   zeros stands for LPS and mm
 * @param fields  release with supine_fields_free */
supine_status supine_fields_load(const char *path, const supine_lungs *lungs,
                                 const supine_scan_frame *frame, supine_fields *fields,
                                 supine_error *error);
void supine_fields_free(supine_fields *fields);

enum { SUPINE_FIT_BAND_MAX = 11, SUPINE_FIT_ORDER_MAX = 4, SUPINE_LIMIT_BAND_MAX = 11 };

enum { SUPINE_FIT_SUSPECTS_MAX = 3 };

/** A run that the others predict badly (suspects.h). */
typedef struct supine_fit_suspect {
  size_t run;
  double ratio; /**< RMS error / upper quartile of the errors of the other runs, each predicted from
                     the others and divided by the norm of its weights (suspects.c); for `zero`, /
                     their median, undivided */
  double part;  /**< RMS error / RMS displacement of all runs */
} supine_fit_suspect;

/** How the displacements follow gravity (frame.h). */
typedef struct supine_fit_frame {
  double moved_mm; /**< RMS of what gravity changes: displacement minus its mean over directions */
  double gain;     /**< motion along gravity that the turned axes gain / `moved_mm` */
  int axis[3];     /**< these axes of gravity: 1, 2, 3 for x, y, z, negative if reversed */
} supine_fit_frame;

/** What a fit found. */
typedef struct supine_fit_report {
  size_t direction_count; /**< number of different directions of gravity */
  size_t volume_count; /**< most volumes for one direction; 1 if fields do not depend on volume */
  size_t band_highest; /**< highest band that the runs determine, with the chosen order */
  size_t band;         /**< highest degree of the harmonics in the chosen fit */
  size_t order;        /**< highest degree of the polynomials of volume */
  /** [order][band] relative RMS error of the runs left out; 0 if the runs do not determine it. */
  double error[SUPINE_FIT_ORDER_MAX + 1][SUPINE_FIT_BAND_MAX + 1];
  /** Relative RMS error between the volumes, continued from lower orders; 0 if it was measured by
   * leaving volumes out, or if there are no volumes. */
  double between;
  /** Relative RMS error between the volumes, measured or `between`; and what six volumes would make
   * of it, a guess, or 0 if they gain nothing. */
  double volume_error, six_volumes;
  /** Relative RMS error of the smallest and the largest volumes of each direction, predicted from
   * the others: an extrapolation; 0 if the others do not determine the fit. */
  double extrapolated;
  supine_fit_suspect suspects[SUPINE_FIT_SUSPECTS_MAX]; /**< runs that the others do not predict */
  size_t suspect_count;
  supine_fit_suspect zero; /**< the run without displacement that the others predict worst; ratio 0
                                if its prediction is below 0.3 of the RMS displacement */
  supine_fit_frame frame;
} supine_fit_report;

/** A fit to fields. Zero-initialise; release with supine_fields_fit_free. */
typedef struct supine_fit {
  const supine_fields *fields;
  const supine_lungs *lungs;
  supine_fit_report report;
  double *volume;     /**< [lungs, runs] volume of each lung minus that of the surface, mL */
  double *parameter;  /**< [lungs, runs] t */
  double range[2][2]; /**< [lungs] volumes at t = -1 and 1, mL above the surface */
  supine_run_groups
      groups;              /**< runs that are left out together: of a direction, then of a volume */
  size_t direction_groups; /**< how many of them are of a direction */
  size_t inner_groups; /**< number of groups of a volume, also if the chosen fit cannot leave them
                            out: `groups` then ends before them */
  supine_run_groups ends; /**< all runs of the smallest volume of their direction; of the largest */
  supine_regression chosen;
  double *gram; /**< [lungs, runs, runs] scalar products of any two fields in each lung, mm^2 */
  supine_arena memory;
} supine_fit;

/** Fit functions of gravity and volume to the fields.
 * @param fields  must outlive the fit, as `lungs`
 * @param band    highest degree of the harmonics; if negative, chosen by the error
 * @param fit     written; release it also after an error */
supine_status supine_fields_fit(const supine_fields *fields, const supine_lungs *lungs, int band,
                                supine_fit *fit, supine_error *error);
void supine_fields_fit_free(supine_fit *fit);

/** Return the relative RMS error of the fit in runs left out, or 1e-4 if it is smaller: modes that
 * lower the error below that are not worth keeping. */
double supine_fields_fit_error(const supine_fit *fit);

/** Return the RMS displacement of the fields, mm. */
double supine_fields_size(const supine_fit *fit);

/** Make the field of the fit: VECTOR rows.
 * @param field  zeroed; release with supine_projection_field_free, also after an error */
supine_status supine_fields_field(const supine_fit *fit, supine_gravity_field *field,
                                  supine_error *error);

/** Errors of a fit to band L in states between the runs (errors.c). */
typedef struct supine_fit_errors {
  float *vertices; /**< [vertices] RMS error of each vertex over all directions of gravity, mm */
  double gravity_part; /**< mean over the vertices of the part of its square that depends on the
                            direction of gravity, mm^2 */
  size_t rows, terms;  /**< 2 L + 4 and (L + 2)^2 */
  /** [rows, terms] harmonics E of the direction of gravity, to degree L + 1: the error in the
   * direction g is |E y(g)| times that in `vertices`; the mean of |E y|^2 over all directions is 1
   */
  double *harmonics;
  size_t volume_count; /**< 0 if the fit does not depend on volume */
  /** [volume_count] at evenly spaced total volumes, from the smallest to the largest simulated: the
   * part of the squared error that depends on the direction of gravity / its mean over all runs */
  double *by_volume;
  double between_mm; /**< RMS of `vertices` */
  double gap_mm;     /**< that in the direction of gravity and at the volume where it is largest, in
                          a gap between the directions of the runs */
} supine_fit_errors;

/** Measure the errors of a basis of the fit: each run predicted from the others, in mm and relative
 * to the RMS displacement. The member `volume` is 0, as nothing is scaled to a volume. Derive the
 * errors of states between the runs.
 * @param modes   number of modes of the basis, or 0 if it has the harmonics themselves
 * @param errors  its members `vertices`, `gravity_part` and `by_volume` are written;
 * supine_fields_complete_errors completes `harmonics` */
supine_status supine_fields_measure(const supine_fit *fit, size_t modes, supine_accuracy *accuracy,
                                    supine_fit_errors *errors, supine_error *error);

/** Complete the errors of a fit, when `vertices` has the error of storage too, which is the same in
 * all directions. */
void supine_fields_complete_errors(size_t vertex_count, supine_fit_errors *errors);

/** Refuse a posture in which a lung was not simulated at the volume of the given surface.
 * @param fit      of order 1 or more
 * @param gravity  [3] of the posture */
supine_status supine_fields_check_scan(const supine_fit *fit, const double gravity[3],
                                       supine_error *error);

/** Subtract from every run the displacement, by a fit over gravity and volume, in the posture of
 * the scan and at the volumes of the given surface, which then shows that posture.
 * @param fit      of order 1 or more
 * @param gravity  [3] of the scan
 * @param counted  written; release it with supine_fields_free, also after an error
 * @retval SUPINE_ERROR_ARGUMENT  these volumes were not simulated in that posture */
supine_status supine_fields_count_from_scan(const supine_fit *fit, const double gravity[3],
                                            supine_fields *counted, supine_error *error);

/** What a basis needs to find the parameter of each lung from volumes (runtime/simulated.h).
 * Volumes are mL above the given surface. */
typedef struct supine_simulated_volumes {
  size_t share_count; /**< number of polynomials of the total volume */
  size_t limit_terms; /**< number of harmonics of the limits, of all degrees to some band */
  /** [lungs, 2, limit_terms] smallest and largest simulated volume, and 1 % of this range beyond,
   * as harmonics that have these values in the directions of the runs. */
  double limits[2 * 2 * (SUPINE_LIMIT_BAND_MAX + 1) * (SUPINE_LIMIT_BAND_MAX + 1)];
  double shares[2][9][SUPINE_FIT_ORDER_MAX + 1]; /**< [lungs][harmonic][polynomial] */
  double total[2];                               /**< total volumes mapped to -1 and 1 */
} supine_simulated_volumes;

/** Find these numbers by least squares over the runs. All simulated volumes lie within the limits.
 * @param fit  of order 1 or more */
supine_status supine_fields_volumes_fit(const supine_fit *fit, supine_simulated_volumes *made,
                                        supine_error *error);

/** Find the volume of each lung where all lungs hold a total volume, as the simulator divided it.
 * @param basis      of fields over volume
 * @param totals     [6] total volumes with gravity along +x, -x, +y, -y, +z, -z, mL
 * @param name       of these volumes, for messages
 * @param harmonics  [lungs] written: volumes as harmonics of the direction of gravity, mL above the
 *   reference surface
 * @return the status of supine_basis_pose: a total was not simulated */
supine_status supine_fields_divide_volume(const supine_basis *basis, const double totals[6],
                                          const char *name, double (*harmonics)[9],
                                          supine_error *error);

#endif
