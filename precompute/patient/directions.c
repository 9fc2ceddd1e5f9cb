/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A patient's law as the directions of a surface, and the force that goes with them. */
#include <math.h>

#include "precompute/patient/patient_file.h"

#include "precompute/physics/solve.h"

/* The slope of measured motion from the back to the front, and of it what stays with the body: the
 * `deep` law's, at a gain of 0.4. */
static const double supine_slope = -0.6;

/* How far the surface's box may lie from the fit's, and differ in size. Landmarks' boxes are
 * guessed, so theirs may differ more. */
static const double apart_most[2] = {0.3, 0.15};
static const double size_most[2] = {1.6, 1.25};

/* Catch below which a direction is not defined, of a force that is 1 on average. */
static const double catch_least = 1e-3;

supine_force_law supine_patient_force(const supine_patient *patient, double gain,
                                      const double gravity[3]) {
  supine_force_law law = {.gain = gain};
  double slope[3] = {0.0, supine_slope, 0.0};
  if (patient->law == SUPINE_PATIENT_PAPER) {
    for (size_t k = 0; k < 3; ++k) {
      slope[k] = patient->powers[3 + k];
    }
  }
  /* Heights fall along Y and grow along Z where the patient lies supine or stands. Those of a lung
   * seen from the side run along x, one way in each lung, so that nothing of X is theirs. */
  law.box[0] = slope[0];
  law.box[1] = slope[1] + gain * gravity[1];
  law.box[2] = slope[2] + gain * gravity[2];
  law.base = 1.0 - 0.5 * gain - 0.5 * (law.box[0] + law.box[1] + law.box[2]);
  return law;
}

double supine_patient_inflation(const supine_patient *patient) {
  enum { SAMPLES = 4 };
  const supine_patient_frame *frame = &patient->frame;
  double divergence = 0.0;
  for (int cell = 0; cell < SAMPLES * SAMPLES * SAMPLES; ++cell) {
    const int index[3] = {cell % SAMPLES, cell / SAMPLES % SAMPLES, cell / (SAMPLES * SAMPLES)};
    for (int k = 0; k < 3; ++k) {
      double low[3];
      double high[3];
      double below[3];
      double above[3];
      for (int j = 0; j < 3; ++j) {
        const double width = frame->maximum[j] - frame->minimum[j];
        low[j] = high[j] = frame->minimum[j] + width * (index[j] + 0.5) / SAMPLES;
        low[j] -= j == k ? 0.05 * width : 0.0;
        high[j] += j == k ? 0.05 * width : 0.0;
      }
      supine_patient_displacement(patient, low, below);
      supine_patient_displacement(patient, high, above);
      divergence += (above[k] - below[k]) / (high[k] - low[k]);
    }
  }
  return divergence < 0.0 ? -1.0 : 1.0;
}

static supine_status check_place(const supine_patient_record *record, const supine_lungs *lungs,
                                 supine_error *error) {
  const supine_patient_frame *frame = &record->patient.frame;
  const int only_side = lungs->lung_count == 1 ? lungs->side[0] : 0;
  if (frame->only_side != 0 && frame->only_side != only_side) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "the patient's law is of the %s lung alone: it moves no other",
                            frame->only_side > 0 ? "left" : "right");
  }
  for (int k = only_side != frame->only_side ? 1 : 0; k < 3; ++k) {
    const double width = frame->maximum[k] - frame->minimum[k];
    const double size = (lungs->maximum[k] - lungs->minimum[k]) / width;
    const double apart =
        0.5 * fabs(lungs->maximum[k] + lungs->minimum[k] - frame->maximum[k] - frame->minimum[k]) /
        width;
    if (apart > apart_most[record->from_surface] || size > size_most[record->from_surface] ||
        size < 1.0 / size_most[record->from_surface]) {
      return supine_error_set(
          error, SUPINE_ERROR_MESH,
          "the patient's law was fitted between %c = %.0f and %.0f mm, the surface reaches from "
          "%.0f to %.0f: another frame, unit or person",
          "xyz"[k], frame -> minimum[k], frame -> maximum[k], lungs -> minimum[k],
          lungs -> maximum[k]);
    }
  }
  return SUPINE_OK;
}

supine_status supine_patient_directions(const supine_patient_record *record,
                                        const supine_lungs *lungs, supine_model *model,
                                        double *directions, supine_error *error) {
  supine_solution solution = {0};
  supine_status status = check_place(record, lungs, error);
  if (status != SUPINE_OK) {
    return status;
  }
  model->force.base = record->force.base;
  model->force.gain = record->force.gain;
  for (int k = 0; k < 3; ++k) {
    model->force.box[k] = record->force.box[k];
  }
  supine_model one_way = *model;
  one_way.direction = supine_physics_model(SUPINE_LAW_PAPER).direction;
  status = supine_physics_solve(lungs, &one_way, record->state.gravity, &solution, error);
  for (size_t i = 0; i < lungs->mesh.vertex_count && status == SUPINE_OK; ++i) {
    double u[3];
    if (!(solution.catch_[i] > catch_least)) {
      status = supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                "vertex %zu catches no force of the patient's law (%.2g): a "
                                "smaller --gain, or another law",
                                i, solution.catch_[i]);
      break;
    }
    const double *p = lungs->mesh.vertices + 3 * i;
    const bool as_it_is = record->patient.law == SUPINE_PATIENT_PAPER && record->from_surface;
    if (as_it_is) { /* fitted with this very force */
      supine_patient_paper_direction(&record->patient, p, u);
    } else {
      supine_patient_displacement(&record->patient, p, u);
    }
    for (size_t k = 0; k < 3; ++k) {
      directions[3 * i + k] = record->inflation * u[k] / (as_it_is ? 1.0 : solution.catch_[i]);
    }
  }
  supine_physics_solution_free(&solution);
  return status;
}
