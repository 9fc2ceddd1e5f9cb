/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a physical model from the user's choices, and move lungs to the reference surface. */
#ifndef SUPINE_PREPARE_H
#define SUPINE_PREPARE_H

#include "base/findings.h"

#include "precompute/lungs/disease.h"
#include "precompute/lungs/expandability.h"
#include "precompute/physics/reference.h"

enum { SUPINE_LESIONS_MAX = 64 };

/** The user's choices for the physical model and the scan. */
typedef struct supine_model_choice {
  int law;            /**< displacement law: a supine_law, or SUPINE_LAW_COUNT for the default */
  supine_model model; /**< constants; each that is NAN is taken from the displacement law */
  const char *patient_law; /**< name of the displacement law fitted to the patient, or NULL */
  const double *stiffness; /**< [N] relative stiffness fitted to the patient, or NULL */
  bool has_scan; /**< whether `scan` was given; SUPINE_LAW_DEEP assumes full inflation if not */
  supine_scan scan;
  supine_state full; /**< volume at full inflation, for a scan at rest; DEFAULT if unknown */
  supine_resting resting;
  supine_person person;
  const char *expandability; /**< path of a CSV file, or NULL to use `expandability_law` */
  supine_expandability_law expandability_law;
  size_t lesion_count;
  supine_lesion lesions[SUPINE_LESIONS_MAX];
  double share[2]; /**< volume / healthy volume, left and right; 0 for a lung without collapse */
} supine_model_choice;

supine_model_choice supine_precompute_choice_default(void);

/** A physical model, the volumes of the lungs, and a description of the assumptions. */
typedef struct supine_prepared {
  supine_model model; /**< uses `stiffness`, `lesions` and `strain` of this struct */
  supine_reference reference;
  char summary[512];     /**< for the user: displacement law, state of the scan and volumes */
  double *stiffness;     /**< [N] relative stiffness of each vertex, or NULL if uniform */
  double *lesions;       /**< [N] factors by which lesions multiply the stiffness, or NULL */
  supine_strain *strain; /**< their effect if the law has a smoothing length, or NULL */
} supine_prepared;

/** Select the displacement law, set stiffness and lesions, and move the vertices of the scan to the
 * reference surface.
 * @param lungs     in: the scan; out: the reference surface
 * @param prepared  zeroed; release with supine_precompute_prepared_free, also after an error
 * @param findings  warnings are added
 * @retval SUPINE_ERROR_ARGUMENT  a scan's posture without its volume; SUPINE_LAW_PAPER with a known
 *   state of the scan; expandability in
 *   addition to a stiffness fitted to the patient; a volume share for a lung that the model lacks
 * @retval the statuses of supine_tissue_add_lesion and supine_reference_find */
supine_status supine_precompute_prepare(supine_lungs *lungs, const supine_model_choice *choice,
                                        supine_prepared *prepared, supine_findings *findings,
                                        supine_error *error);

void supine_precompute_prepared_free(supine_prepared *prepared);

#endif
