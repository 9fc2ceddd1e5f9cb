/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a displacement law to two surfaces by iterative closest points with robust weights. */
#include <math.h>
#include <string.h>

#include <gsl/gsl_statistics.h>
#include <supine/inputs.h>

#include "precompute/patient/matching.h"

#include "base/arena.h"
#include "base/text.h"

enum {
  REGIONAL_MAX = 4000, /* most matched vertices, if the stiffness of lung regions is fitted */
  ROUNDS_MAX = 60
};

static const double converged = 2e-3;     /* RMS movement of the vertices, mm, that ends the fit */
static const double size_converged = 0.5; /* movement, mm, that ends the fit of the size only */
static const double scale_least = 1.0;    /* lower bound on the distances' robust deviation, mm */

/* Set the measurement of each vertex to a first guess: its displacement along one axis by the
 * affine map from the bounding box of the fuller surface to that of the emptier one. */
static void start_rows(supine_patient_matching *m) {
  const double *low = m->fuller->minimum;
  double to[2][3];
  supine_mesh_box(m->state, to[0], to[1]);
  for (size_t i = 0; i < m->count; ++i) {
    supine_patient_row *row = &m->rows[i];
    const double *from = m->fuller->mesh.vertices + 3 * m->match[i].vertex;
    const size_t k = i % 3;
    const double t = (from[k] - low[k]) / (m->fuller->maximum[k] - low[k]);
    row->axis[0] = row->axis[1] = row->axis[2] = 0.0;
    row->axis[k] = 1.0;
    row->value = to[0][k] + t * (to[1][k] - to[0][k]) - from[k];
    row->weight = 1.0;
  }
}

/* Fit the displacement law or, if `shaped` is false, only one factor on the default law. */
static supine_status refit(const supine_patient_matching *m, bool shaped,
                           supine_patient_fit_options *options, supine_patient *patient,
                           supine_error *error) {
  SUPINE_FREED_BY(supine_patient_krige_free) supine_patient_krige krige = {0};
  options->size_only = !shaped;
  SUPINE_TRY(
      supine_patient_krige_fit(options, m->rows, m->count + m->landmark_row_count, &krige, error));
  supine_patient_krige_copy_law(&krige, patient);
  if (shaped) {
    options->sill = krige.sill;
    options->uncorrected = krige.sill == 0.0;
    options->noise = krige.noise;
  }
  return SUPINE_OK;
}

/* Fit the displacement law and match the surfaces in turn. In the first rounds, fit only a factor
 * on the default law, because matches do not show displacement along the surface. When the vertices
 * move little from round to round, fit the whole law. */
static supine_status iterate(supine_patient_matching *m, const supine_patient_fit_options *wanted,
                             supine_patient *patient, supine_patient_surface_report *report,
                             supine_error *error) {
  supine_patient_fit_options options = *wanted;
  double change = INFINITY;
  bool shaped = false;
  start_rows(m);
  for (size_t round = 0; round < ROUNDS_MAX && !(shaped && change < converged); ++round) {
    shaped = shaped || change < size_converged;
    SUPINE_TRY(refit(m, shaped, &options, patient, error));
    change = supine_patient_matching_place(m, patient);
    supine_patient_matching_find(m);
    SUPINE_TRY(supine_patient_matching_weigh(m, scale_least, error));
  }
  report->matched = m->matched;
  report->after = m->rms;
  return SUPINE_OK;
}

static supine_status check_apart(supine_patient_matching *m, supine_patient_surface_report *report,
                                 supine_error *error) {
  report->vertices = m->count;
  supine_patient_matching_find(m);
  const size_t stride = sizeof *m->match / sizeof(double);
  report->before =
      sqrt(gsl_stats_tss_m(&m->match->distance, stride, m->count, 0.0) / (double)m->count);
  const supine_input_verdict verdict = supine_input_judge(SUPINE_INPUT_SCANS_APART, report->before);
  SUPINE_REFUSE_IF(verdict == SUPINE_INPUT_REFUSED, error, SUPINE_ERROR_MESH,
                   "the two surfaces are the same (%s mm RMS apart): give two different states",
                   supine_text_distance(report->before).text);
  return SUPINE_OK;
}

static supine_status measure(supine_patient_matching *m, const supine_patient_fit_options *wanted,
                             supine_patient_record *record, supine_error *error) {
  supine_patient_fit_report *report = &record->report;
  const supine_patient_power expanding = record->patient.power;
  SUPINE_TRY(supine_patient_fit(wanted, m->rows, m->count, m->landmark_row_count / 3,
                                &record->patient, report, error));
  if (m->landmark_row_count == 0) {
    const double volume = 1e3 * (m->fuller->volume[0] + m->fuller->volume[1]);
    report->stretch = cbrt(volume / supine_mesh_volume(m->state));
  }
  if (record->expand.kept) {
    record->patient.power = expanding;
    record->patient.law = SUPINE_PATIENT_DEEP;
    report->has_errors = false;
    memset(report->error, 0, sizeof report->error);
    report->held_out[SUPINE_PATIENT_SCORE_CORRECTED] = record->expand.held_out[1];
    report->explained = 100.0 * (1.0 - pow(record->expand.held_out[1] / report->baseline, 2.0));
  }
  const size_t landmarks = m->landmark_row_count / 3;
  if (landmarks == 0) {
    return supine_patient_applied_find(m, &record->patient, wanted->gravity, &record->applied,
                                       error);
  }
  return supine_patient_applied_find_landmarks(m->rows + m->count, landmarks, &record->patient,
                                               wanted->gravity, &record->applied, error);
}

static supine_status run(supine_patient_matching *m, const supine_patient_fit_options *wanted,
                         bool expandability, supine_patient_record *record, supine_error *error) {
  record->patient = (supine_patient){.law = wanted->law, .frame = m->frame};
  SUPINE_TRY(check_apart(m, &record->surface, error));
  SUPINE_TRY(iterate(m, wanted, &record->patient, &record->surface, error));
  if (expandability) {
    SUPINE_TRY(supine_patient_expand(m, wanted, &record->patient, &record->stiffness,
                                     &record->expand, error));
    record->surface.after = record->expand.kept ? record->expand.fitted[1] : record->surface.after;
  }
  return measure(m, wanted, record, error);
}

supine_status supine_patient_fit_surface(const supine_lungs *fuller, const supine_mesh *emptier,
                                         const supine_patient_pairs *landmarks,
                                         const supine_patient_fit_options *options,
                                         bool expandability, supine_patient_record *record,
                                         supine_error *error) {
  const size_t landmark_count = expandability ? 0 : landmarks->count;
  SUPINE_FREED_BY(supine_patient_matching_free) supine_patient_matching m = {0};
  supine_patient_fit_options wanted = *options;
  if (expandability) { /* fit the stiffness of regions instead of a kriging correction */
    wanted.law = SUPINE_PATIENT_PAPER;
    wanted.uncorrected = true;
  }
  record->stiffness.count = 0;
  SUPINE_TRY(supine_patient_check_boxes(&fuller->mesh, emptier, error));
  SUPINE_TRY(supine_patient_matching_create(
      fuller, emptier, expandability ? REGIONAL_MAX : SUPINE_PATIENT_VERTICES_MAX, landmark_count,
      &m, error));
  if (landmark_count > 0) {
    supine_patient_rows_of_pairs(&m.frame, landmarks, m.rows + m.count);
  }
  m.landmark_row_count = 3 * landmark_count;
  /* Give all landmarks together the same weight as all matched vertices. */
  for (size_t i = 0; i < m.landmark_row_count; ++i) {
    m.rows[m.count + i].weight = (double)m.count / (double)m.landmark_row_count;
  }
  return run(&m, &wanted, expandability, record, error);
}
