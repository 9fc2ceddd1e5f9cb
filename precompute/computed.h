/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute what a basis stores, from a model (from_model.c) or from another simulator's fields
 * (from_fields.c): displacements as modes of gravity, the reference surface, and their errors. */
#ifndef SUPINE_COMPUTED_H
#define SUPINE_COMPUTED_H

#include "precompute/fields/storage.h"
#include "precompute/prepare.h"
#include "precompute/projection/accuracy.h"

/** The user's choices for a basis. */
typedef struct supine_basis_choice {
  size_t band;          /**< highest degree of the harmonics */
  size_t modes;         /**< largest number of modes; 0 uses the harmonics instead of modes */
  size_t held_out;      /**< number of held-out directions of gravity, or 0 for the default */
  bool without_normals; /**< leave the modes of the normals out of the file */
  const char *made_by;  /**< for the metadata: the command line that makes the basis, or NULL */
  /** Displacements that another simulator computed, in place of the model's; or NULL. With them: */
  const supine_fields *fields;
  bool choose_band;            /**< choose the band by the leave-one-out error, instead of `band` */
  bool keep_modes;             /**< keep all `modes`, even those that hardly lower the error */
  supine_warp_storage storage; /**< how displacements are stored */
  const double *scan_gravity;  /**< [3] gravity in the scan, which is then not displaced in its own
                                  posture; NULL if gravity does not displace the scan */
  /** Receives the fraction of the work done, 0 to 1; returns false to stop. NULL: none. */
  bool (*progress)(void *context, double fraction);
  void *progress_context;
} supine_basis_choice;

typedef enum supine_computed_kind {
  SUPINE_COMPUTED_BY_MODEL,
  SUPINE_COMPUTED_BY_FIELDS
} supine_computed_kind;

/** What a basis of N vertices stores. */
typedef struct supine_computed {
  supine_computed_kind kind;
  supine_gravity_field field;     /**< `rows` is the kind of the rows of `compression` */
  supine_compression compression; /**< displacements of healthy lungs */
  supine_lungs
      lungs; /**< the reference surface: the prepared lungs, or with vertices in `memory` */
  supine_volume_forms forms;
  supine_accuracy accuracy;
  /** The state of the scan; `known` is false BY_FIELDS, or if the resting volume (FRC) is unknown.
   */
  supine_reference reference;
  double resting[2][9]; /**< [lungs] if it is known: resting volume minus that of the reference
                           surface, mL, as harmonics of the direction of gravity, to degree 2 */
  /* BY_MODEL: */
  supine_error_table table; /**< errors by number of harmonics and of modes */
  float *error_share; /**< [N] share of the error that a patient's landmarks leave at a vertex,
                         divided by its mean at those that were held out; or NULL */
  float
      *landmarks; /**< [landmark_count, 4] place in the reference surface, mm, and lung; or NULL */
  size_t landmark_count;
  double turned_over; /**< share of triangles (supine_projection_turned_over) */
  /* BY_FIELDS: */
  supine_fit fit;
  supine_fields counted;    /**< the fields over volume, counted from the scan, or empty */
  supine_clusters clusters; /**< `count` is 0 if the basis stores modes */
  supine_fit_errors errors; /**< errors of states between the runs */
  float *exact;             /**< coefficients of `compression` before clusters, or NULL */
  supine_arena memory;
} supine_computed;

/** Compute the displacements of a model, their modes and their errors.
 * @param computed  zeroed; do not move it; release it with supine_precompute_computed_free, also
 * after an error */
supine_status supine_precompute_from_model(const supine_prepared *prepared,
                                           const supine_basis_choice *choice,
                                           supine_computed *computed, supine_error *error);

/** Fit another simulator's fields, choice->fields, and find modes and errors of the fit. Otherwise
 * as supine_precompute_from_model. */
supine_status supine_precompute_from_fields(const supine_prepared *prepared,
                                            const supine_basis_choice *choice,
                                            supine_computed *computed, supine_error *error);

void supine_precompute_computed_free(supine_computed *computed);

/** Squared errors by number of modes. */
typedef struct supine_spectrum {
  double singular[SUPINE_MODES_MADE_MAX];
  double total;
} supine_spectrum;

/** Find the best modes of computed->field, or take the harmonics themselves.
 * @param spectrum  written, unless the modes are the harmonics */
supine_status supine_precompute_compress(const supine_basis_choice *choice,
                                         supine_computed *computed, supine_spectrum *spectrum,
                                         supine_error *error);

/** Drop the last modes that raise the error by less than 1 % together, unless all are to be kept.
 * @param relative  relative RMS error with all modes */
void supine_precompute_drop_modes(const supine_basis_choice *choice,
                                  const supine_spectrum *spectrum, double relative,
                                  supine_computed *computed);

/** Tell that `done` of the 7 steps of supine_precompute are done. */
supine_status supine_precompute_tell_progress(const supine_basis_choice *choice, size_t done,
                                              supine_error *error);

#endif
