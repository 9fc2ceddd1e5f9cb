/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Fit spherical harmonics of the direction of gravity to the displacement fields of another
 * simulator, and compress the fit. The field u(g_j) holds the displacements of all vertices for the
 * direction of gravity g_j, and Y(g_j) holds the values of the harmonics at g_j. The coefficients C
 * minimise
 *
 *     sum over j of |u(g_j) - C Y(g_j)|^2
 *
 * The band of a fit is the highest degree of its harmonics. By default, bands are tried in rising
 * order, and a higher band is chosen if it reduces the leave-one-out error by more than 1 %. */
#ifndef SUPINE_FIELDS_H
#define SUPINE_FIELDS_H

#include "precompute/lungs/lungs.h"
#include "precompute/physics/reference.h"
#include "precompute/projection/accuracy.h"

/** Displacements of all vertices for several directions of gravity, made by another simulator. */
typedef struct supine_fields {
  size_t direction_count; /**< number of directions of gravity */
  size_t vertex_count;
  double *directions;   /**< [direction_count, 3] unit vectors along gravity */
  double *displacement; /**< [direction_count, vertex_count, 3] displacement of each vertex, mm */
} supine_fields;

/** Read displacement fields from a safetensors file with three tensors, F32 or F64: points [P, 3],
 * the positions of P points; gravity [M, 3], M directions of gravity; and displacement [M, P, 3],
 * the displacement of each point for each direction. All are in the same axes and unit. Each vertex
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

enum { SUPINE_FIT_BAND_MAX = 11 };

/** What a fit found. */
typedef struct supine_fit_report {
  size_t direction_count; /**< number of directions of gravity */
  size_t band_highest;    /**< highest degree that the directions of gravity determine */
  size_t band;            /**< highest degree of the harmonics in the chosen fit */
  /** [l] relative RMS leave-one-out error with harmonics to degree l. */
  double error[SUPINE_FIT_BAND_MAX + 1];
} supine_fit_report;

/** Harmonics at the directions of gravity, and the least squares with them: the coefficient of each
 * harmonic is a field, a sum of `pinv` times the given fields. */
typedef struct supine_fit_matrices {
  size_t count;      /**< number of directions of gravity */
  size_t terms;      /**< number of harmonics */
  double *harmonics; /**< [count, terms] value of each harmonic at each direction */
  double *pinv;      /**< [terms, count] pseudo-inverse of `harmonics` */
  double condition;  /**< condition number of `harmonics` */
} supine_fit_matrices;

/** A fit of harmonics to fields. Zero-initialise; release with supine_fields_fit_free. */
typedef struct supine_fit {
  const supine_fields *fields;
  supine_fit_report report;
  supine_fit_matrices chosen;
  double *gram; /**< [directions, directions] scalar products of any two given fields, mm^2 */
  supine_arena memory;
} supine_fit;

/** Fit harmonics to the fields.
 * @param fields  must outlive the fit
 * @param band    highest degree of the harmonics; if negative, chosen by the leave-one-out error
 * @param fit     written; release it also after an error */
supine_status supine_fields_fit(const supine_fields *fields, int band, supine_fit *fit,
                                supine_error *error);
void supine_fields_fit_free(supine_fit *fit);

/** Return the relative RMS leave-one-out error of the fit, or 1e-4 if it is smaller: modes that
 * lower the error below that are not worth keeping. */
double supine_fields_fit_error(const supine_fit *fit);

/** Make the field of the fit: VECTOR rows whose columns are the given fields.
 * @param field  zeroed; release with supine_projection_field_free, also after an error */
supine_status supine_fields_field(const supine_fit *fit, supine_gravity_field *field,
                                  supine_error *error);

/** Measure the errors of a basis of the fit: each field predicted from the others, in mm and
 * relative to the RMS displacement. The member `volume` is 0, as nothing is scaled to a volume.
 * @param modes  number of modes of the basis, or 0 if it has the harmonics themselves */
supine_status supine_fields_measure(const supine_fit *fit, size_t modes, supine_accuracy *accuracy,
                                    supine_error *error);

#endif
