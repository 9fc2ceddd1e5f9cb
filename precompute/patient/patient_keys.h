/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Words of patient.json that its writer and its reader share. */
#ifndef SUPINE_PATIENT_KEYS_H
#define SUPINE_PATIENT_KEYS_H

#include "precompute/patient/krige.h"

enum { SUPINE_PATIENT_VERSION = 5 };

#define SUPINE_PATIENT_FORMAT "supine-patient"

/** Keys of the errors of each predictor, indexed by supine_patient_score. */
extern const char *const supine_patient_score_keys[SUPINE_PATIENT_SCORES];

/** The lungs of a frame, indexed by 1 + only_side: "right", "both" and "left". */
extern const char *const supine_patient_lungs_words[3];

/** What the applied force was computed from, indexed by supine_patient_applied.from_landmarks. */
extern const char *const supine_patient_applied_words[2];

/** The two scanned states, indexed by supine_patient_record.shown: "fuller" and "emptier". */
extern const char *const supine_patient_state_words[2];

#endif
