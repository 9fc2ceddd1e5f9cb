/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A patient's law as the model of a basis, and the scan that it is made of. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/patient/patient_file.h"

#include "sh/base/parallel.h"

enum { GRAIN = 64 };

/* Largest distance between the surface's box and the nearest state's, and ratio of their sizes.
 * Landmarks' boxes are guessed, so theirs may differ more. */
static const double apart_most[2] = {0.3, 0.15};
static const double size_most[2] = {1.6, 1.25};

/* Least force that a correction is divided by, of a mean of 1. */
static const double force_least = 0.2;

/* Range of what a resting lung holds of its full volume. */
static const double share_least = 0.15, share_most = 0.95;

supine_force_law supine_patient_force(const supine_patient *patient, double gain,
                                      const double gravity[3]) {
  supine_force_law law = {.gain = gain, .pair = true};
  const double *slope = patient->powers + 3;
  /* Heights fall along Y and grow along Z where the patient lies supine or stands. Those of a lung
   * seen from the side run along x, one way in each lung, so that nothing of X is theirs. */
  law.box[0] = slope[0];
  law.box[1] = slope[1] + gain * gravity[1];
  law.box[2] = slope[2] + gain * gravity[2];
  law.base = 1.0 - 0.5 * gain - 0.5 * (law.box[0] + law.box[1] + law.box[2]);
  return law;
}

/* --- the model ------------------------------------------------------------------------------- */

typedef struct work {
  const supine_patient_record *record;
  const supine_lungs *lungs;
  double *directions;
  bool by_box; /* positions are those of the fuller state, but for the box */
} work;

static bool is_full(const supine_patient_record *record) {
  return record->state[0].volume.kind == SUPINE_VOLUME_FULL && record->state[0].volume.ml == 0.0;
}

/* Where a vertex was in the fuller state. */
static void find_point(const work *w, size_t vertex, double at[3]) {
  const supine_patient_frame *frame = &w->record->patient.frame;
  const supine_lungs *lungs = w->lungs;
  for (size_t k = 0; k < 3; ++k) {
    const double t = (lungs->mesh.vertices[3 * vertex + k] - lungs->minimum[k]) /
                     (lungs->maximum[k] - lungs->minimum[k]);
    at[k] = w->by_box ? frame->minimum[k] + t * (frame->maximum[k] - frame->minimum[k])
                      : lungs->mesh.vertices[3 * vertex + k];
  }
}

static void correct_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const work *w = context;
  const supine_patient *patient = &w->record->patient;
  for (size_t i = begin; i < end; ++i) {
    const size_t lung = i >= w->lungs->lung_begin[1] ? 1 : 0;
    double at[3];
    double r[3];
    double u[3] = {0.0, 0.0, 0.0};
    double *d = w->directions + 3 * i;
    find_point(w, i, at);
    supine_patient_place place = supine_patient_find(&patient->frame, at, w->lungs->side[lung]);
    supine_patient_correct(patient, &place, r);
    if (!w->record->from_surface) { /* the box was guessed: what the guess misses is added, too */
      supine_patient_law_displacement(patient, &place, u);
      supine_lungs_box_coordinates(w->lungs, i, place.box);
    }
    const double force = fmax(force_least, supine_patient_force_at(patient, &place));
    for (size_t k = 0; k < 3; ++k) {
      d[k] = w->record->from_surface ? d[k] - r[k] / force : -(u[k] + r[k]) / force;
    }
  }
}

static void correct(const void *context, const supine_lungs *lungs, double *directions) {
  const supine_patient_record *record = context;
  work w = {record, lungs, directions, record->from_surface || !is_full(record)};
  supine_parallel_for(lungs->mesh.vertex_count, GRAIN, 0, correct_range, &w);
}

void supine_patient_model(const supine_patient_record *record, supine_model *model) {
  model->force = record->force;
  model->reach = record->reach;
  model->direction =
      (supine_direction_law){.model = SUPINE_DIRECTION_BOX, .correct = correct, .context = record};
  for (size_t k = 0; k < 3; ++k) {
    model->direction.c[2 * k] = -record->patient.lengths[k];
    model->direction.c[2 * k + 1] = record->patient.powers[k];
  }
}

supine_status supine_patient_set_stiffness(const supine_patient_record *record,
                                           const supine_lungs *lungs, double *stiffness,
                                           supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const work w = {.record = record, .lungs = lungs, .by_box = true};
  supine_lungs fuller = *lungs;
  fuller.mesh.vertices = malloc(3 * n * sizeof(double));
  if (fuller.mesh.vertices == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  for (size_t i = 0; i < n; ++i) {
    find_point(&w, i, fuller.mesh.vertices + 3 * i);
  }
  supine_patient_stiffness_of(&record->stiffness, &fuller, stiffness);
  free(fuller.mesh.vertices);
  return SUPINE_OK;
}

/* --- the scan -------------------------------------------------------------------------------- */

/* The largest difference between a surface's box and a state's, of the state's width. */
static double box_distance(const supine_patient_record *record, size_t state,
                           const supine_lungs *lungs) {
  const supine_patient_frame *frame = &record->patient.frame;
  double most = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    const double low = state == 0 ? frame->minimum[k] : record->emptier[0][k];
    const double high = state == 0 ? frame->maximum[k] : record->emptier[1][k];
    most = fmax(most,
                fmax(fabs(lungs->minimum[k] - low), fabs(lungs->maximum[k] - high)) / (high - low));
  }
  return most;
}

supine_status supine_patient_check_place(const supine_patient_record *record,
                                         const supine_lungs *lungs, size_t *state,
                                         supine_error *error) {
  const supine_patient_frame *frame = &record->patient.frame;
  const int only_side = lungs->lung_count == 1 ? lungs->side[0] : 0;
  *state = box_distance(record, 1, lungs) < box_distance(record, 0, lungs) ? 1 : 0;
  if (frame->only_side != 0 && frame->only_side != only_side) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "the patient's law is of the %s lung alone: it moves no other",
                            frame->only_side > 0 ? "left" : "right");
  }
  for (size_t k = only_side != frame->only_side ? 1 : 0; k < 3; ++k) {
    const double low = *state == 0 ? frame->minimum[k] : record->emptier[0][k];
    const double high = *state == 0 ? frame->maximum[k] : record->emptier[1][k];
    const double size = (lungs->maximum[k] - lungs->minimum[k]) / (high - low);
    const double apart =
        0.5 * fabs(lungs->maximum[k] + lungs->minimum[k] - high - low) / (high - low);
    if (apart > apart_most[record->from_surface] || size > size_most[record->from_surface] ||
        size < 1.0 / size_most[record->from_surface]) {
      return supine_error_set(
          error, SUPINE_ERROR_MESH,
          "the patient's law was fitted between %c = %.0f and %.0f mm, the surface reaches from "
          "%.0f to %.0f: another frame, unit or person",
          "xyz"[k], low, high, lungs -> minimum[k], lungs -> maximum[k]);
    }
  }
  return SUPINE_OK;
}

/* Full volume by one of the two states, mL; 0 where it does not tell. */
static double full_volume(const supine_patient_record *record, size_t state, double volume,
                          const supine_resting *resting) {
  const supine_state *of = &record->state[state];
  const double held = volume > 0.0 ? volume : record->volume[state];
  return held <= 0.0 ? 0.0
         : of->volume.kind == SUPINE_VOLUME_FULL
             ? (held - of->volume.ml) / supine_reference_full_share(of->gravity)
         : of->volume.kind == SUPINE_VOLUME_REST
             ? (held - of->volume.ml) / supine_reference_resting_total(resting, of->gravity)
             : 0.0;
}

double supine_patient_below_full(const supine_patient_record *record) {
  const supine_resting resting = supine_reference_resting_default();
  const double *v = record->volume;
  double full = full_volume(record, 0, 0.0, &resting);
  full = full > 0.0 ? full : full_volume(record, 1, 0.0, &resting);
  return v[0] > v[1] && v[1] > 0.0 && full > v[0] ? (full - v[0]) / (v[0] - v[1]) : 0.0;
}

void supine_patient_resting(const supine_patient_record *record, supine_resting *resting) {
  for (size_t k = 0; k < 2; ++k) {
    const supine_state *of = &record->state[k];
    const double full = record->state[1 - k].volume.kind == SUPINE_VOLUME_FULL
                            ? full_volume(record, 1 - k, 0.0, resting)
                            : 0.0;
    if (of->volume.kind != SUPINE_VOLUME_REST || record->volume[k] <= 0.0 || full <= 0.0) {
      continue;
    }
    const double share = (record->volume[k] - of->volume.ml) / full;
    if (share > share_least && share < share_most) {
      const double assumed = supine_reference_resting_total(resting, of->gravity);
      for (size_t a = 0; a < 6; ++a) {
        resting->share[0][a] *= share / assumed;
        resting->share[1][a] *= share / assumed;
      }
    }
  }
}

supine_scan supine_patient_scan(const supine_patient_record *record, size_t state, double volume,
                                const supine_resting *resting) {
  const supine_state *of = &record->state[state];
  supine_scan scan = {.state = *of};
  const double full = full_volume(record, 1 - state, 0.0, resting);
  scan.known = of->volume.kind == SUPINE_VOLUME_REST || of->volume.kind == SUPINE_VOLUME_FULL;
  if (!scan.known && full > 0.0) {
    scan.known = true;
    scan.state.volume = (supine_volume){SUPINE_VOLUME_FULL, fmin(0.0, volume - full)};
  }
  return scan;
}
