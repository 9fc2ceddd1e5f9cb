/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * From files and the user's choices, make lungs at the reference surface and their model. */
#ifndef SUPINE_PREPARE_H
#define SUPINE_PREPARE_H

#include "base/arena.h"

#include "precompute/lungs/disease.h"
#include "precompute/lungs/expandability.h"
#include "precompute/patient/patient_file.h"
#include "precompute/source.h"

enum { SUPINE_LESIONS_MAX = 64 };

/** The user's choices for the files, the physical model and the scan. */
typedef struct supine_model_choice {
  supine_source_options source;
  int law;            /**< displacement law: a supine_law, or SUPINE_LAW_COUNT for the default */
  supine_model model; /**< constants; each that is NAN is taken from the displacement law */
  const supine_patient_record *patient; /**< fitted model, which replaces the law, or NULL */
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

/** Lungs at the reference surface, and their physical model. */
typedef struct supine_prepared {
  supine_source source; /**< what was read; its findings also hold those about the model */
  supine_model model;
  const supine_patient_record *patient; /**< the patient's, with what these lungs add, or NULL */
  supine_reference reference;
  char fit[256];       /**< for the user: of which data `patient` was made, and its errors */
  char assumed[800];   /**< for the user: axes, unit, displacement law, state and volumes */
  supine_arena memory; /**< of the arrays of the model */
} supine_prepared;

/** Load lungs from files, select the displacement law, set stiffness and lesions, and move the
 * vertices of the scan to the reference surface.
 * @param prepared  zeroed; release with supine_precompute_prepared_free, also after an error */
supine_status supine_precompute_prepare(const supine_model_choice *choice, char **paths,
                                        size_t count, supine_prepared *prepared,
                                        supine_error *error);

void supine_precompute_prepared_free(supine_prepared *prepared);

#endif
