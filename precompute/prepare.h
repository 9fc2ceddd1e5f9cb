/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a model from the user's choices, and move lungs from the scan to the reference surface. */
#ifndef SUPINE_PREPARE_H
#define SUPINE_PREPARE_H

#include "sh/base/findings.h"

#include "precompute/lungs/disease.h"
#include "precompute/lungs/expandability.h"
#include "precompute/physics/reference.h"

enum { SUPINE_LESIONS_MAX = 64 };

/** The user's choices for the model and the scan. */
typedef struct supine_model_choice {
  int law;                 /**< a supine_law, or SUPINE_LAW_COUNT to use the default law */
  supine_model model;      /**< constants that the user gave; NAN selects the constant of the law */
  const char *patient_law; /**< name of the law fitted to the patient; NULL if none */
  const double *stiffness; /**< [N] stiffness E of the patient's law, or NULL */
  bool has_scan; /**< whether the user gave `scan`; if not, the law `deep` assumes "full" */
  supine_scan scan;
  supine_resting resting;
  supine_person person;
  const char *expandability; /**< path of a CSV file, or NULL to use `expandability_law` */
  supine_expandability_law expandability_law;
  size_t lesion_count;
  supine_lesion lesions[SUPINE_LESIONS_MAX];
  double share[2]; /**< volume / healthy volume, left and right; 0 for a lung without collapse */
} supine_model_choice;

supine_model_choice supine_precompute_choice_default(void);

/** A physical model, the volumes of the lungs, and the assumptions about both. */
typedef struct supine_prepared {
  supine_model model; /**< uses the arrays `stiffness` and `lesions` of this struct */
  supine_reference reference;
  char summary[512]; /**< the assumed law, scan and volumes in words */
  double *stiffness; /**< [N] stiffness E, or NULL */
  double *lesions;   /**< [N] factors by which lesions multiply the stiffness, or NULL */
} supine_prepared;

/** Select the law, set stiffness and lesions, and move the lungs to the reference surface.
 * @param lungs     in: the scan; out: the reference surface
 * @param prepared  zeroed; release with supine_precompute_prepared_free, also after an error
 * @param findings  warnings are added
 * @retval SUPINE_ERROR_ARGUMENT  the paper's law with a scan state, or a share of a missing lung
 * Other statuses as supine_tissue_add_lesion and supine_reference_find */
supine_status supine_precompute_prepare(supine_lungs *lungs, const supine_model_choice *choice,
                                        supine_prepared *prepared, supine_findings *findings,
                                        supine_error *error);

void supine_precompute_prepared_free(supine_prepared *prepared);

#endif
