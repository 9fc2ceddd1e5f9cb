/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * From files and the user's options, make lungs at the reference surface and their model. */
#ifndef SUPINE_PREPARE_H
#define SUPINE_PREPARE_H

#include <supine/precompute.h>

#include "base/arena.h"

#include "precompute/patient/patient_file.h"
#include "precompute/source.h"

/** What is known of the volumes of another simulator's lungs: gas and tissue of all lungs, mL. */
typedef struct supine_named_volumes {
  bool has_rest;
  double rest[6]; /**< at rest, with gravity along +x, -x, +y, -y, +z, -z */
  double full;    /**< at full inflation, in every posture; 0 if unknown */
} supine_named_volumes;

/** Lungs at the reference surface, and their physical model. */
typedef struct supine_prepared {
  supine_source source; /**< what was read; its findings also hold those about the model */
  supine_model model;
  const supine_patient_record *patient; /**< the patient's, with what these lungs add, or NULL */
  supine_reference reference;
  supine_scan posture; /**< with another simulator's fields: the posture of the scan, if known */
  supine_named_volumes named; /**< with another simulator's fields */
  char fit[256];       /**< for the user: from which data the patient was fitted, and errors */
  char expected[64];   /**< volume at full inflation that people of this size have, or "" */
  char sources[96];    /**< metadata "sources": where facts come from (supine_basis_facts) */
  supine_arena memory; /**< of the arrays of the model */
} supine_prepared;

/** Return a law as the public header names it. */
supine_precompute_law_kind supine_precompute_law_of(supine_law law);

/** Load lungs from files, select the displacement law, set stiffness and lesions, and move the
 * vertices of the scan to the reference surface.
 * @param prepared  zeroed; release with supine_precompute_prepared_free, also after an error */
supine_status supine_precompute_prepare(const supine_precompute_options *options,
                                        supine_prepared *prepared, supine_error *error);

void supine_precompute_prepared_free(supine_prepared *prepared);

#endif
