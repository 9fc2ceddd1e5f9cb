/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * From the lungs in the scan and the user's choices to the model, and the lungs at its reference.
 */
#ifndef SUPINE_PREPARE_H
#define SUPINE_PREPARE_H

#include "sh/base/findings.h"

#include "precompute/lungs/disease.h"
#include "precompute/lungs/expandability.h"
#include "precompute/physics/capacity.h"

enum { SUPINE_LESIONS_MAX = 64 };

/** Choices for the model and the scan. */
typedef struct supine_model_choice {
  int law;            /**< a supine_law; SUPINE_LAW_COUNT: by the scan's state */
  supine_model model; /**< constants; NAN: the law's own */
  const char *own;    /**< name of a model with all its constants, a patient's; NULL: a law's */
  const double *stiffness; /**< [N] E, with `own`; or NULL */
  bool has_scan;           /**< false: full, with `paper` none */
  supine_scan scan;
  supine_resting resting;
  supine_person person;
  const char *directions;    /**< a file of vectors; NULL: the law's */
  const char *expandability; /**< a file; NULL: as follows */
  supine_expandability_law expandability_law;
  size_t lesion_count;
  supine_lesion lesions[SUPINE_LESIONS_MAX];
  double share[2]; /**< of the left and the right lung, collapsed; 0: healthy */
} supine_model_choice;

/** Return the defaults. */
supine_model_choice supine_precompute_choice_default(void);

/** Result of preparation. */
typedef struct supine_prepared {
  supine_model model; /**< its arrays are the following */
  supine_reference reference;
  char summary[512]; /**< assumptions: law, scan, full inflation, rest */
  double *stiffness; /**< [N], or NULL */
  double *lesions;   /**< [N], or NULL */
  double *vectors;   /**< [N, 3], or NULL */
} supine_prepared;

/** Choose the law, find tissue and directions, and take the lungs to the reference.
 * @param lungs     as scanned; moved to the reference
 * @param prepared  zeroed; release with supine_precompute_prepared_free, also after an error
 * @param findings  warnings are added
 * @retval SUPINE_ERROR_ARGUMENT  the paper law with a scan's state; a lung that is not there;
 * and those of the steps */
supine_status supine_precompute_prepare(supine_lungs *lungs, const supine_model_choice *choice,
                                        supine_prepared *prepared, supine_findings *findings,
                                        supine_error *error);

void supine_precompute_prepared_free(supine_prepared *prepared);

#endif
