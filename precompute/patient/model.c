/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make a physical model from a patient's displacement law, and find the state that a scan shows. */
#include <math.h>
#include <string.h>

#include "precompute/patient/matching.h"

#include "base/arena.h"
#include "base/parallel.h"
#include "precompute/physics/solve.h"
#include "precompute/physics/volume_forms.h"

enum { GRAIN = 64 };

/* Largest distance between corresponding faces of the bounding boxes of a surface and of a scanned
 * state, as a share of the state's width: [0] if landmarks give the state, [1] if surfaces do. */
static const double apart_most[2] = {0.45, 0.2};
/* Smaller forces are replaced by this before a division. The mean force is 1. */
static const double force_least = 0.2;

/* If the patient's two scanned states are closer than this share of the path from full inflation to
 * rest, the fuller state counts as full inflation and the emptier one as rest. */
static const double part_least = 0.02;

/* Plausible range of the volume at rest divided by the volume at full inflation. */
static const double share_least = 0.15, share_most = 0.95;

double supine_patient_full_volume(const supine_state *shown, double held,
                                  const supine_resting *resting) {
  const double end = held - shown->volume.ml; /* volume at full inflation or at rest */
  if (held <= 0.0) {
    return 0.0;
  }
  switch (shown->volume.kind) {
  case SUPINE_VOLUME_FULL:
    return end / supine_physics_resting_full_share(shown->gravity);
  case SUPINE_VOLUME_REST:
    return end / supine_physics_resting_total(resting, shown->gravity);
  default:
    return 0.0;
  }
}

/* Compute the volume at full inflation, mL, from one scanned state; return 0 if it is unknown. */
static double full_volume(const supine_patient_record *record, size_t state,
                          const supine_resting *resting) {
  return supine_patient_full_volume(&record->state[state], record->volume[state], resting);
}

static double either_full_volume(const supine_patient_record *record,
                                 const supine_resting *resting) {
  const double full = full_volume(record, 0, resting);
  return full > 0.0 ? full : full_volume(record, 1, resting);
}

/* Find where the two scanned states lie on the path from full inflation (0) to rest (1). */
static void find_parts(const supine_patient_record *record, double part[2]) {
  supine_resting resting = supine_physics_resting_default();
  supine_patient_resting(record, &resting);
  const double full = either_full_volume(record, &resting);
  const double rest = full * supine_physics_resting_total(&resting, record->state[1].gravity);
  for (size_t k = 0; k < 2; ++k) {
    const supine_volume *stated = &record->state[k].volume;
    if (stated->ml == 0.0 && stated->kind == SUPINE_VOLUME_REST) {
      part[k] = 1.0;
    } else if (stated->ml == 0.0 && stated->kind == SUPINE_VOLUME_FULL) {
      part[k] = 0.0;
    } else if (full > 0.0 && record->volume[k] > 0.0) {
      part[k] = (cbrt(full) - cbrt(record->volume[k])) / (cbrt(full) - cbrt(rest));
    } else {
      part[k] = (double)k;
    }
  }
  if (part[1] - part[0] < part_least) {
    part[0] = 0.0;
    part[1] = 1.0;
  }
}

/* Compute the displacement from full inflation at two positions `part` on the path from full
 * inflation (0) to rest (1). gains [position, axis] is its share of the displacement at rest. */
static void find_gains(const double part[2], double gains[2][3]) {
  const supine_model deep = supine_physics_model(SUPINE_LAW_DEEP);
  supine_volume_bend(deep.bend, part[0], gains[0]);
  supine_volume_bend(deep.bend, part[1], gains[1]);
}

void supine_patient_path(const supine_patient_record *record, double gains[2][3]) {
  double part[2];
  find_parts(record, part);
  find_gains(part, gains);
}

typedef struct work {
  const supine_patient_record *record;
  supine_lungs lungs;      /* estimate of the lungs in the fuller state */
  const double *scan;      /* [N, 3] vertices of a scan in the emptier state, or NULL */
  double *smoothing_ratio; /* [N] force after smoothing over the surface / before it */
  double *displacement;    /* [N, 3] displacement from the fuller to the emptier state, mm */
} work;

/* Compute the displacement of each vertex from the fuller to the emptier state. If the scan shows
 * the emptier state, also compute the vertex's position in the fuller state. */
static void move_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const work *w = context;
  const supine_patient *patient = &w->record->patient;
  for (size_t i = begin; i < end; ++i) {
    const int side = supine_patient_side_of(&w->lungs, i);
    const double force_factor = w->record->from_surface ? w->smoothing_ratio[i] : 1.0;
    double *at = w->lungs.mesh.vertices + 3 * i;
    if (w->scan != NULL) {
      supine_patient_find_in_fuller(patient, w->scan + 3 * i, side, force_factor, at,
                                    w->displacement + 3 * i);
    } else {
      const supine_patient_place place = supine_patient_find(&patient->frame, at, side);
      supine_patient_displacement(patient, &place, force_factor, w->displacement + 3 * i);
    }
  }
}

static void move(work *w) {
  supine_parallel_for(w->lungs.mesh.vertex_count, GRAIN, 0, move_range, w);
  supine_lungs_measure(&w->lungs);
}

/* Compute w->smoothing_ratio of each vertex, for the posture of the two scans. */
static supine_status find_ratio(const work *w, supine_error *error) {
  const supine_patient_record *record = w->record;
  supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  SUPINE_FREED_BY(supine_physics_solution_free) supine_solution solution = {0};
  model.force = record->force;
  SUPINE_TRY(supine_physics_solve(&w->lungs, &model, record->state[1].gravity, &solution, error));
  for (size_t i = 0; i < w->lungs.mesh.vertex_count; ++i) {
    const supine_patient_place place = supine_patient_find_vertex(&w->lungs, i);
    w->smoothing_ratio[i] =
        solution.catch_[i] /
        fmax(force_least, supine_patient_force_at(&record->patient.power, &place));
  }
  return SUPINE_OK;
}

/* Compute w->displacement and, if `scan` [vertices, 3] shows the emptier state, the vertices of
 * w->lungs in the fuller state. Set the last [vertices] of w->smoothing_ratio to 1. */
static supine_status displace(work *w, const double *scan, supine_error *error) {
  w->scan = scan;
  for (size_t i = 0; i < 2 * w->lungs.mesh.vertex_count; ++i) {
    w->smoothing_ratio[i] = 1.0;
  }
  if (scan != NULL) {
    move(w);
  }
  for (int pass = 0; pass < (scan != NULL ? 2 : 1); ++pass) {
    SUPINE_TRY(find_ratio(w, error));
    move(w);
  }
  return SUPINE_OK;
}

/* Extrapolate the displacement between the two scanned states to full inflation (end 0) or to rest
 * (end 1). Return the change of volume, mL, from the fuller scanned state to this end.
 * @param part  positions of the two states on the path from full inflation (0) to rest (1) */
static double volume_to_end(const supine_volume_form *form, const double part[2], size_t end) {
  double gains[2][3];
  double towards[3];
  find_gains(part, gains);
  for (size_t k = 0; k < 3; ++k) {
    towards[k] = ((double)end - gains[0][k]) / (gains[1][k] - gains[0][k]);
  }
  return supine_volume_form_at(form, towards);
}

/* Compute, along x, y and z, the share of the displacement from full inflation to rest that lies
 * between the two scanned states. To find it, adjust the positions of the states on this path until
 * the extrapolated displacement gives the known volumes at full inflation and at rest.
 * @param form  the displacement between the two states, of all lungs */
static void find_path_span(const work *w, const supine_resting *resting,
                           const supine_volume_form *form, double path_span[3]) {
  enum { ROUNDS = 30 };
  static const double step = 1e-4;
  const supine_patient_record *record = w->record;
  const double lung_volume = w->lungs.volume[0] + w->lungs.volume[1];
  const double full = either_full_volume(record, resting);
  const double volume[2] = {full,
                            full * supine_physics_resting_total(resting, record->state[1].gravity)};
  const int rounds = full > 0.0 ? ROUNDS : 0; /* without a known volume, keep the positions */
  double part[2];
  double gains[2][3];
  find_parts(record, part);
  for (int round = 0; round < rounds; ++round) {
    const size_t k = (size_t)round % 2;
    const supine_volume *stated = &record->state[k].volume;
    if (stated->ml == 0.0 && stated->kind == (k == 0 ? SUPINE_VOLUME_FULL : SUPINE_VOLUME_REST)) {
      continue; /* the state is known to be full inflation or rest: keep its position */
    }
    const double off = volume_to_end(form, part, k) - (volume[k] - lung_volume);
    part[k] += step;
    const double slope = (volume_to_end(form, part, k) - (volume[k] - lung_volume) - off) / step;
    part[k] -= step + (isfinite(off / slope) ? fmin(0.05, fmax(-0.05, off / slope)) : 0.0);
  }
  find_gains(part, gains);
  for (size_t k = 0; k < 3; ++k) {
    path_span[k] = gains[1][k] - gains[0][k];
  }
}

/* Find which of the two scanned states the lungs show, by comparing the bounding boxes. Refuse
 * lungs that are too far from both. */
static supine_status find_state(supine_patient_record *record, const supine_lungs *lungs,
                                supine_error *error) {
  const supine_patient_frame *frame = &record->patient.frame;
  const int only_side = lungs->lung_count == 1 ? lungs->side[0] : 0;
  const double *low[2] = {frame->minimum, record->emptier[0]};
  const double *high[2] = {frame->maximum, record->emptier[1]};
  double off[2] = {0.0, 0.0}; /* [state] largest distance of its bounding box's faces from the
                                 surface's, divided by the width of the state's box */
  double sum[2] = {0.0, 0.0}; /* [state] sum of the squares of all these distances */
  size_t axis[2] = {0};
  SUPINE_REFUSE_IF(frame->only_side != 0 && frame->only_side != only_side, error, SUPINE_ERROR_MESH,
                   "the patient's law was fitted to the %s lung alone: give that lung, or fit the "
                   "law to both lungs",
                   frame->only_side > 0 ? "left" : "right");
  for (size_t s = 0; s < 2; ++s) {
    /* Do not compare x if the surface lacks one of two fitted lungs. */
    for (size_t k = only_side != frame->only_side ? 1 : 0; k < 3; ++k) {
      const double ends[2] = {lungs->minimum[k] - low[s][k], lungs->maximum[k] - high[s][k]};
      const double apart = fmax(fabs(ends[0]), fabs(ends[1])) / (high[s][k] - low[s][k]);
      sum[s] += ends[0] * ends[0] + ends[1] * ends[1];
      axis[s] = apart > off[s] ? k : axis[s];
      off[s] = fmax(off[s], apart);
    }
  }
  const size_t state =
      record->volume[0] > 0.0 && record->volume[1] > 0.0 && only_side == frame->only_side
          ? lungs->volume[0] + lungs->volume[1] < sqrt(record->volume[0] * record->volume[1])
          : sum[1] < sum[0];
  const size_t k = axis[state];
  record->in_basis = true;
  record->shown = state;
  SUPINE_REFUSE_IF(!(off[state] <= apart_most[record->from_surface]), error, SUPINE_ERROR_MESH,
                   "the patient's law was fitted to lungs from %c = %.0f to %.0f mm, but this "
                   "surface extends from %.0f to %.0f mm: check that it has the same coordinate "
                   "frame and unit, and shows the same person",
                   "xyz"[k], low[state][k], high[state][k], lungs -> minimum[k],
                   lungs -> maximum[k]);
  return SUPINE_OK;
}

double supine_patient_rest_share(const supine_patient_record *record, size_t k,
                                 const supine_resting *resting) {
  const supine_volume *shown = &record->state[k].volume;
  const double full = full_volume(record, 1 - k, resting);
  const bool known = shown->kind == SUPINE_VOLUME_REST && record->volume[k] > 0.0 &&
                     record->state[1 - k].volume.kind == SUPINE_VOLUME_FULL && full > 0.0;
  return known ? (record->volume[k] - shown->ml) / full : 0.0;
}

void supine_patient_resting(const supine_patient_record *record, supine_resting *resting) {
  for (size_t k = 0; k < 2; ++k) {
    const supine_state *shown = &record->state[k];
    const double share = supine_patient_rest_share(record, k, resting);
    if (share <= share_least || share >= share_most) {
      continue;
    }
    resting->assumed *= share / supine_physics_resting_total(resting, shown->gravity);
    (void)supine_physics_resting_settle(resting, 0, NULL, NULL, NULL);
    const double *of = record->lung_volume[k];
    const double *full_of = record->lung_volume[1 - k];
    const double own[2] = {supine_physics_resting_along_axes(resting->share[0], shown->gravity),
                           supine_physics_resting_along_axes(resting->share[1], shown->gravity)};
    for (size_t i = 0; i < 12; ++i) {
      const size_t side = i / 6;
      const double found =
          share * of[side] / record->volume[k] * record->volume[1 - k] / full_of[side];
      resting->share[side][i % 6] =
          fmin(1.0, resting->share[side][i % 6] * (of[side] > 0.0 ? found / own[side] : 1.0));
      resting->given[i % 6] = true;
    }
  }
}

supine_scan supine_patient_scan(const supine_patient_record *record, size_t state, double volume,
                                const supine_resting *resting) {
  const supine_state *shown = &record->state[state];
  supine_scan scan = {.state = *shown};
  const double full = full_volume(record, 1 - state, resting);
  scan.known = shown->volume.kind == SUPINE_VOLUME_REST || shown->volume.kind == SUPINE_VOLUME_FULL;
  if (!scan.known && full > 0.0) {
    scan.known = true;
    scan.state.volume = (supine_volume){SUPINE_VOLUME_FULL, fmin(0.0, volume - full)};
  }
  return scan;
}

/* Set record->lung_volume to the volumes of the scan and of its surface displaced to the other
 * state. If one state is full inflation, also set record->volume, so that later volumes agree with
 * the displacement. */
static void set_volumes(supine_patient_record *record, const supine_lungs *fuller,
                        const supine_volume_form forms[2]) {
  static const double ones[3] = {1.0, 1.0, 1.0};
  double sum[2] = {0.0, 0.0};
  memset(record->lung_volume, 0, sizeof record->lung_volume);
  for (size_t lung = 0; lung < fuller->lung_count; ++lung) {
    const size_t side = fuller->side[lung] > 0 ? 0 : 1;
    record->lung_volume[0][side] = fuller->volume[lung];
    record->lung_volume[1][side] = fuller->volume[lung] + supine_volume_form_at(&forms[lung], ones);
    sum[0] += record->lung_volume[0][side];
    sum[1] += record->lung_volume[1][side];
  }
  if (record->state[0].volume.kind == SUPINE_VOLUME_FULL ||
      record->state[1].volume.kind == SUPINE_VOLUME_FULL) {
    memcpy(record->volume, sum, sizeof sum);
  }
}

supine_status supine_patient_model(supine_patient_record *record, const supine_lungs *lungs,
                                   supine_resting *resting, supine_scan *scan, double *arrays,
                                   supine_model *model, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  double *directions = arrays;
  double *stiffness = arrays + 3 * n;
  SUPINE_ARENA arena = {0};
  work w = {.record = record,
            .lungs = *lungs,
            .smoothing_ratio = supine_arena_take(&arena, 2 * n, sizeof(double)),
            .displacement = directions};
  double *path_span = record->path_span;
  supine_volume_form forms[2] = {{{0.0}}};
  SUPINE_TRY(find_state(record, lungs, error));
  w.lungs.mesh.vertices = supine_arena_take(&arena, 3 * n, sizeof(double));
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  memcpy(w.lungs.mesh.vertices, lungs->mesh.vertices, 3 * n * sizeof(double));
  const double *emptier_scan = record->shown == 1 ? lungs->mesh.vertices : NULL;
  SUPINE_TRY(displace(&w, emptier_scan, error));
  SUPINE_TRY(supine_patient_hold_volume(record, &w.lungs, directions, error));
  SUPINE_TRY(supine_physics_volume_of_field(&w.lungs, NULL, w.displacement, w.smoothing_ratio + n,
                                            forms, error));
  set_volumes(record, &w.lungs, forms);
  supine_patient_resting(record, resting);
  *scan = supine_patient_scan(record, record->shown, lungs->volume[0] + lungs->volume[1], resting);
  for (size_t i = 0; i < sizeof forms[0].of / sizeof *forms[0].of; ++i) {
    forms[0].of[i] += forms[1].of[i];
  }
  find_path_span(&w, resting, forms, path_span);
  for (size_t i = 0; i < n; ++i) {
    const supine_patient_place place = supine_patient_find_vertex(&w.lungs, i);
    const double force =
        fmax(force_least, supine_patient_force_at(&record->patient.power, &place)) *
        fmax(force_least, w.smoothing_ratio[i]);
    for (size_t k = 0; k < 3; ++k) {
      directions[3 * i + k] /= -force * path_span[k];
    }
  }
  supine_patient_stiffness_of(&record->stiffness, &w.lungs, stiffness);
  model->force = record->force;
  model->stiffness = record->stiffness.count > 0 ? stiffness : NULL;
  model->direction.vectors = directions;
  model->direction.shear = 0.0; /* the fitted law has none */
  for (size_t k = 0; k < 3; ++k) {
    model->direction.c[2 * k] = -record->patient.power.c[2 * k] / path_span[k];
    model->direction.c[2 * k + 1] = record->patient.power.c[2 * k + 1];
  }
  return SUPINE_OK;
}

double supine_patient_expected(const supine_patient_record *record) {
  const supine_patient_fit_report *report = &record->report;
  const bool forwards = record->shown == 0 && report->stretch > 0.0;
  return report->expected_constant / (forwards ? report->stretch * report->stretch : 1.0);
}

void supine_patient_field(const void *record, const double point[3], double side, double u[3]) {
  const supine_patient_record *of = record;
  const int lung = (side > 0.0) - (side < 0.0);
  double at[3] = {point[0], point[1], point[2]};
  if (of->shown == 1) {
    supine_patient_find_in_fuller(&of->patient, point, lung, 1.0, at, u);
  } else {
    const supine_patient_place place = supine_patient_find(&of->patient.frame, point, lung);
    supine_patient_displacement(&of->patient, &place, 1.0, u);
  }
  for (size_t k = 0; k < 3; ++k) {
    u[k] /= -of->path_span[k];
  }
}
