/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * patient.json: a patient's law with the force that goes with it, how it was fitted and how well it
 * held out; and what it makes of a surface. */
#ifndef SUPINE_PATIENT_FILE_H
#define SUPINE_PATIENT_FILE_H

#include "precompute/patient/applied.h"
#include "precompute/patient/expand.h"
#include "precompute/patient/fit.h"
#include "precompute/physics/model.h"

enum { SUPINE_PATIENT_TEXT = 48 };

/** One scan: which posture, and how full. */
typedef struct supine_patient_scan {
  char posture[SUPINE_PATIENT_TEXT]; /**< as the user wrote it */
  char volume[SUPINE_PATIENT_TEXT];  /**< "full", "rest", mL as text, or empty: not said */
  double gravity[3];
} supine_patient_scan;

/** What a further state told. */
typedef struct supine_patient_told {
  char posture[SUPINE_PATIENT_TEXT];
  double scale;              /**< 1 where it is as far from rest as the fitted state */
  double left, left_without; /**< mm RMS, with the gain and without */
} supine_patient_told;

enum { SUPINE_PATIENT_OTHERS_MAX = 8 };

/** What patient.json holds. */
typedef struct supine_patient_record {
  char name[SUPINE_PATIENT_TEXT]; /**< whose */
  supine_patient patient;
  supine_force_law force; /**< 1 at the box's centre in the state's posture */
  supine_patient_scan rest, state;
  double inflation;  /**< +1 where the state is the larger one, -1 where rest is */
  bool from_surface; /**< the frame is a surface's box, else that of landmarks */
  size_t points;
  double held_out, held_out_baseline, fitted, explained; /**< of the kept law, mm RMS and share */
  supine_patient_stiffness stiffness;                    /**< counts 0: even */
  supine_patient_expand_report expand; /**< written, where it was tried; not read */
  supine_patient_applied applied;      /**< written, where there are blocks; not read */
  size_t told_count;                   /**< further states; written, not read */
  supine_patient_told told[SUPINE_PATIENT_OTHERS_MAX];
  bool gain_told;    /**< some of them in another posture */
  double gain_error; /**< standard error of the gain */
} supine_patient_record;

/** Whether the record has a stiffness of its own. */
bool supine_patient_is_uneven(const supine_patient_record *record);

/** The force of a patient's law: its slopes c7 to c9 for the paper's law, those of `law` for the
 * others; `gain` of it turns with gravity. Seen in one posture, any gain gives the same field. */
supine_force_law supine_patient_force(const supine_patient *patient, double gain,
                                      const double gravity[3]);

/** +1 where the field swells the box it was fitted in, -1 where it shrinks it. */
double supine_patient_inflation(const supine_patient *patient);

/** Writes the record whole or not at all.
 * @param report   optional: all laws' scores, starts, constants and their intervals
 * @param made_by  how
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_patient_write(const char *path, const supine_patient_record *record,
                                   const supine_patient_fit_report *report, const char *made_by,
                                   supine_error *error);

/** The same as text, for standard output; free() it; NULL: no memory. */
char *supine_patient_text(const supine_patient_record *record,
                          const supine_patient_fit_report *report, const char *made_by);

/** @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT (what is missing or wrong is named) */
supine_status supine_patient_read(const char *path, supine_patient_record *record,
                                  supine_error *error);

/** The same from text, such as a basis file's metadata.
 * @param name  for messages */
supine_status supine_patient_parse(const char *name, const char *text,
                                   supine_patient_record *record, supine_error *error);

/** The patient's law as directions d [N, 3], mm, of a surface: with the catch F of the record's
 * force in the fitted posture, F_i d_i = u_i, outwards where the lung grows.
 *
 * @param model  its force is ignored and set to the record's; its stiffness counts, and is the
 *               record's own where it has one (stiffness.h): to be set before
 * @retval SUPINE_ERROR_MESH       the surface lies elsewhere than where the law was fitted, or is
 * the other lung
 * @retval SUPINE_ERROR_NUMERICAL  a vertex catches no force */
supine_status supine_patient_directions(const supine_patient_record *record,
                                        const supine_lungs *lungs, supine_model *model,
                                        double *directions, supine_error *error);

#endif
