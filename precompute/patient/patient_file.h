/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file patient.json: a patient's law with its force and states, how it was fitted and its
 * held-out error; and the model that it gives for a surface. */
#ifndef SUPINE_PATIENT_FILE_H
#define SUPINE_PATIENT_FILE_H

#include <supine/state.h>

#include "precompute/patient/applied.h"
#include "precompute/patient/expand.h"
#include "precompute/patient/fit.h"
#include "precompute/physics/model.h"
#include "precompute/physics/reference.h"

enum { SUPINE_PATIENT_TEXT = 48, SUPINE_PATIENT_OTHERS_MAX = 8, SUPINE_PATIENT_STATE_TEXT = 160 };

/** Fit of a further state; not read. */
typedef struct supine_patient_told {
  supine_state state;
  double scale;              /**< 1 if it is as far from the fuller state as the emptier one */
  double left, left_without; /**< RMS residual, mm, with the gain and without */
} supine_patient_told;

/** Result of the matching of surfaces. */
typedef struct supine_patient_surface_report {
  size_t vertices;      /**< vertices that took part */
  double matched;       /**< share of them with a compatible point */
  double before, after; /**< RMS distance, point to plane, before and after the fit, mm */
} supine_patient_surface_report;

/** What is known of a person; patient.json holds most of it. */
typedef struct supine_patient_record {
  char name[SUPINE_PATIENT_TEXT]; /**< name of the patient */
  supine_patient patient;
  supine_force_law force; /**< 1 at the box's centre in the emptier state's posture */
  double reach;           /**< spreading length of the force, mm */
  supine_state state[2];  /**< the fuller and the emptier */
  double volume[2];       /**< mL; 0: unknown */
  double emptier[2][3];   /**< box of the emptier state, mm; the fuller one's is the frame */
  bool from_surface;      /**< the boxes are of surfaces, else of landmarks */
  double points;
  double held_out, held_out_baseline, fitted; /**< mm RMS */
  double explained;                           /**< % of the squared displacement */
  double expected_constant;           /**< mm: expected square error per mm of displacement */
  double expected;                    /**< of held-out points, mm RMS */
  double band;                        /**< % of held-out points in the 95 % band */
  supine_patient_stiffness stiffness; /**< no regions: even tissue */
  size_t told_count;                  /**< further states */
  supine_patient_told told[SUPINE_PATIENT_OTHERS_MAX];
  bool gain_told;    /**< some further state was in another posture */
  bool gain_open;    /**< the further states do not determine the gain */
  double gain_error; /**< standard error of the gain */
  /* Not in a record that was read: */
  supine_patient_fit_report report; /**< written if it has blocks */
  supine_patient_surface_report surface;
  supine_patient_expand_report expand; /**< written if it was tried */
  supine_patient_applied applied;      /**< written if it has blocks */
} supine_patient_record;

/** Write the record whole or not at all.
 * @param made_by  command line, or NULL
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_patient_write(const char *path, const supine_patient_record *record,
                                   const char *made_by, supine_error *error);

/** Print the same as text, for standard output; free() it; NULL: no memory. */
char *supine_patient_text(const supine_patient_record *record, const char *made_by);

/** @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT (names what is missing or wrong) */
supine_status supine_patient_read(const char *path, supine_patient_record *record,
                                  supine_error *error);

/** Displacement of a surface's vertices by a patient's law, (15)-(17) and the correction. */
typedef struct supine_patient_field {
  const supine_patient_record *record; /**< owned by the caller; must outlive the field */
  double way[3];                       /**< share of full inflation to rest, by axis */
  double *moved;                       /**< [N, 3] mm to rest, for a spread force of 1 */
} supine_patient_field;

/** Find the displacement of every vertex between the two fitted states; free it afterwards.
 * @param resting    volumes at rest
 * @param state      of the surface: 0 the fuller, 1 the emptier
 * @param stiffness  optional [N]: E, relative, of a record that has one
 * @retval SUPINE_ERROR_MEMORY, those of supine_physics_solve */
supine_status supine_patient_field_find(const supine_patient_record *record,
                                        const supine_resting *resting, const supine_lungs *lungs,
                                        size_t state, double *stiffness,
                                        supine_patient_field *field, supine_error *error);
void supine_patient_field_free(supine_patient_field *field);

/** Set force, directions and reach of a model to the patient's. The field must outlive the
 * model. With u the displacement and f the force in the fitted posture, at least 0.2 of its
 * mean, the directions are
 *
 *     d = -u / f               so that f d is the person's displacement */
void supine_patient_model(const supine_patient_field *field, supine_model *model);

/** Find the state of a surface from its box.
 * @param state  0 the fuller, 1 the emptier
 * @retval SUPINE_ERROR_MESH  the surface lies elsewhere, or is the other lung */
supine_status supine_patient_check_place(const supine_patient_record *record,
                                         const supine_lungs *lungs, size_t *state,
                                         supine_error *error);

/** Compute the gains of the two states along x, y and z: 0 at full inflation, 1 at rest, on the
 * deep law's path between them (supine_volume_bend), by their states or the cube roots of their
 * volumes. Where neither tells, the fuller state counts as full and the emptier one as at rest. */
void supine_patient_path(const supine_patient_record *record, double gains[2][3]);

/** Scale the shares at rest to the one that the two states show, where they show it. */
void supine_patient_resting(const supine_patient_record *record, supine_resting *resting);

/** Find what a scan shows that is one of the two states.
 * @param volume  of the scan, mL
 * @return not known where nothing tells how far it is from full inflation */
supine_scan supine_patient_scan(const supine_patient_record *record, size_t state, double volume,
                                const supine_resting *resting);

#endif
