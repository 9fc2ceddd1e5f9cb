/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a model from the user's choices, and move the lungs from the scan to the reference. */
#ifndef SUPINE_PREPARE_H
#define SUPINE_PREPARE_H

#include "sh/base/findings.h"

#include "precompute/lungs/disease.h"
#include "precompute/lungs/expandability.h"
#include "precompute/physics/reference.h"

enum { SUPINE_LESIONS_MAX = 64 };

/** The user's choices for the model and the scan. */
typedef struct supine_model_choice {
  int law; /**< a supine_law; SUPINE_LAW_COUNT: `paper` with --scanned none, else `deep` */
  supine_model model;      /**< constants; NAN: as in the law */
  const char *patient_law; /**< name of a patient's law, which `model` contains; NULL: none */
  const double *stiffness; /**< [N] stiffness E of the patient's law, or NULL */
  bool has_scan; /**< `scan` was given; false: it is full or, with the paper's law, none */
  supine_scan scan;
  supine_resting resting;
  supine_person person;
  const char *expandability; /**< path of a CSV file; NULL: `expandability_law` */
  supine_expandability_law expandability_law;
  size_t lesion_count;
  supine_lesion lesions[SUPINE_LESIONS_MAX];
  double share[2]; /**< volume of a collapsed left or right lung over its healthy volume; 0:
                      the lung is healthy */
} supine_model_choice;

/** Return the default choices. */
supine_model_choice supine_precompute_choice_default(void);

/** A model, the volumes of its lungs, and the assumptions about both. */
typedef struct supine_prepared {
  supine_model model; /**< refers to the arrays below */
  supine_reference reference;
  char summary[512]; /**< assumptions in words: law, scan, volumes */
  double *stiffness; /**< [N] stiffness E, or NULL */
  double *lesions;   /**< [N] factors on the stiffness, or NULL */
} supine_prepared;

/** Select the law, set stiffness and lesions, and move the lungs to the reference.
 * @param lungs     as scanned; moved to the reference
 * @param prepared  zeroed; release with supine_precompute_prepared_free, also after an error
 * @param findings  warnings are added
 * @retval SUPINE_ERROR_ARGUMENT  the paper's law with a scan state, or a share of a missing lung
 * Other statuses as supine_tissue_add_lesion and supine_reference_find */
supine_status supine_precompute_prepare(supine_lungs *lungs, const supine_model_choice *choice,
                                        supine_prepared *prepared, supine_findings *findings,
                                        supine_error *error);

void supine_precompute_prepared_free(supine_prepared *prepared);

#endif
