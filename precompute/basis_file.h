/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Write a basis file. */
#ifndef SUPINE_BASIS_FILE_H
#define SUPINE_BASIS_FILE_H

#include "precompute/precompute.h"

#include "precompute/projection/accuracy.h"

/** Content of a basis file with N vertices. */
typedef struct supine_basis_content {
  const supine_lungs *lungs;
  const supine_prepared *prepared; /**< texts and model; the model is unused if `is_fields` */
  const supine_basis_choice *choice;
  bool is_fields;             /**< whether another simulator computed the displacements; if so: */
  const double *scan_gravity; /**< [3] gravity in the scan, or NULL if it is unknown */
  const double *directions;   /**< [N, 3] displacement of each vertex per unit force, mm; NULL if
                                 `compression` holds the displacement itself */
  const supine_compression *compression;
  const supine_volume_forms *forms;
  supine_accuracy *accuracy;         /**< supine_writer_basis_write adds the error of storage */
  const supine_reference *reference; /**< NULL if the resting volume (FRC) is unknown */
  /** [lungs, 9] resting volume (FRC) minus the volume of the reference surface, mL: coefficients of
   * spherical harmonics of the direction of gravity, to degree 2; NULL if `reference` is NULL */
  const double *resting;
  /** Share of triangles whose normals turn by more than 90 degrees as the lungs deform, or NULL. */
  const double *turned_over;
  /** Relative RMS errors by number of modes and by number of harmonics, or NULL. */
  const supine_error_table *table;
} supine_basis_content;

/** Add the error of storage to content->accuracy, and write a basis file atomically: a failure
 * leaves no partial file. */
supine_status supine_writer_basis_write(const char *path, const supine_basis_content *content,
                                        supine_error *error);

#endif
