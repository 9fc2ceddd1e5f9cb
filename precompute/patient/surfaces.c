/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A law from surfaces: closest points, point to plane, robust, over and over. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/patient/surfaces.h"

#include "precompute/patient/krige.h"
#include "precompute/patient/matching.h"
#include "sh/base/parallel.h"

enum {
  VERTICES_MAX = 2000, /* that take part: a law of nine constants is not better known from more */
  ROUNDS_MAX = 60,
  ROUND_STEPS = 4,
  GRAIN = 64
};

static const double settled = 2e-3;      /* mm RMS between two rounds */
static const double same_state = 0.02;   /* mm RMS */
static const double overlap_least = 0.5; /* of the smaller box, along each axis */
static const double size_most = 1.6;
static const double matched_least = 0.3;
static const double nearer_least =
    0.6; /* of the distance as given: so near and reversed is no chance */
static const double round_tolerance = 1e-4;

typedef supine_patient_matching matching;

/* Of the surface at rest and the other, mm. */
typedef struct boxes {
  double low[2][3], high[2][3];
} boxes;

/* A law found so far; of the deep one with its correction. */
typedef struct estimate {
  supine_patient_law law;
  supine_patient_moved moved;
  supine_patient_power shape; /* of the deep law */
  supine_patient_power power;
  supine_patient_row *thinned; /* of the correction */
  supine_patient_krige *krige;
} estimate;

static void estimate_free(estimate *e) {
  supine_patient_krige_destroy(e->krige);
  free(e->thinned);
}

/* Where the law puts the vertices that take part. */
typedef struct placing {
  matching *m;
  const estimate *e;
  double *square; /* [count] of how far each went, mm^2 */
} placing;

static void place_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  placing *w = context;
  matching *m = w->m;
  const supine_patient_power *power = &w->e->power;
  double *scratch = malloc((m->count + m->landmark_rows_count) * sizeof *scratch);
  for (size_t i = begin; i < end && scratch != NULL; ++i) {
    supine_patient_row row = m->rows[i];
    row.value = 0.0;
    w->square[i] = 0.0;
    for (size_t a = 0; a < 3; ++a) {
      for (size_t k = 0; k < 3; ++k) {
        row.axis[k] = a == k ? 1.0 : 0.0;
      }
      const double u = w->e->krige == NULL
                           ? supine_patient_power_residual(power, &row)
                           : supine_patient_krige_predict(w->e->krige, &row, NULL, scratch);
      const double at = m->rest->mesh.vertices[3 * m->vertex[i] + a] + u;
      w->square[i] += pow(at - m->moved[3 * i + a], 2.0);
      m->moved[3 * i + a] = at;
    }
  }
  free(scratch);
}

/* The law's own constants, or the deep law's scale and its correction, fitted to the rows. */
static supine_status refit(const matching *m, estimate *e, supine_error *error) {
  const size_t count = m->count + m->landmark_rows_count;
  if (e->law == SUPINE_PATIENT_PAPER) {
    return supine_patient_power_fit(m->rows, count, e->moved, e->power.powers, ROUND_STEPS,
                                    round_tolerance, &e->power, error);
  }
  if (e->thinned == NULL) {
    e->thinned = malloc(count * sizeof *e->thinned);
  }
  if (e->thinned == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", count);
  }
  supine_patient_krige_destroy(e->krige);
  e->krige = NULL;
  const supine_patient_krige_options options = {.moved = e->moved, .noise_known = true};
  const supine_status status =
      supine_patient_scale_fit(m->rows, count, e->moved, &e->shape, &e->power, error);
  return status != SUPINE_OK
             ? status
             : supine_patient_krige_create(&e->power, e->thinned,
                                           supine_patient_krige_thin(m->rows, m->count,
                                                                     m->landmark_rows_count / 3,
                                                                     e->thinned),
                                           &options, &e->krige, error);
}

/* Move the vertices; mm RMS by which they moved. */
static supine_status place(matching *m, const estimate *e, double *change, supine_error *error) {
  placing w = {.m = m, .e = e, .square = calloc(m->count, sizeof(double))};
  if (w.square == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", m->count);
  }
  supine_parallel_for(m->count, GRAIN, 0, place_range, &w);
  *change = 0.0;
  for (size_t i = 0; i < m->count; ++i) {
    *change += w.square[i] / (double)m->count;
  }
  *change = sqrt(*change);
  free(w.square);
  return SUPINE_OK;
}

/* The first rows: each lung's box brought to the state's, axis by axis. */
static void start_rows(matching *m, const boxes *b) {
  for (size_t i = 0; i < m->count; ++i) {
    supine_patient_row *row = &m->rows[i];
    const double *from = m->rest->mesh.vertices + 3 * m->vertex[i];
    const size_t k = i % 3; /* one axis each, in turn */
    const double t = (from[k] - b->low[0][k]) / (b->high[0][k] - b->low[0][k]);
    row->axis[0] = row->axis[1] = row->axis[2] = 0.0;
    row->axis[k] = 1.0;
    row->value = b->low[1][k] + t * (b->high[1][k] - b->low[1][k]) - from[k];
    row->weight = 1.0;
  }
}

/* Distances that are no outliers, mm, at least: kriging carries what a law misses, and would leave
 * what is weighted down where it is. */
static double scale_of(supine_patient_law law) {
  return law == SUPINE_PATIENT_DEEP ? 1.0 : 0.0;
}

static supine_status settle(matching *m, const boxes *b, estimate *e,
                            supine_patient_surface_report *report, double *rms, size_t *rounds,
                            supine_error *error) {
  supine_status status = SUPINE_OK;
  m->warm = false;
  start_rows(m, b);
  for (*rounds = 0; status == SUPINE_OK && *rounds < ROUNDS_MAX; ++*rounds) {
    double change = 0.0;
    status = refit(m, e, error);
    if (status == SUPINE_OK) {
      status = place(m, e, &change, error);
    }
    if (status == SUPINE_OK) {
      supine_patient_matching_find(m);
      report->matched = supine_patient_matching_weigh(m, scale_of(e->law), rms);
      if (report->matched < matched_least) {
        status = supine_error_set(error, SUPINE_ERROR_MESH,
                                  "only %.0f %% of the vertices find the other surface facing the "
                                  "same way: other axes, another person, or triangles inwards",
                                  100.0 * report->matched);
      }
    }
    if (change < settled) {
      break;
    }
  }
  return status;
}

static supine_status check_boxes(const boxes *b, supine_error *error) {
  for (int k = 0; k < 3; ++k) {
    const double size[2] = {b->high[0][k] - b->low[0][k], b->high[1][k] - b->low[1][k]};
    const double overlap = fmin(b->high[0][k], b->high[1][k]) - fmax(b->low[0][k], b->low[1][k]);
    if (!(size[1] > 0.0) || size[1] > size_most * size[0] || size[0] > size_most * size[1]) {
      return supine_error_set(error, SUPINE_ERROR_MESH,
                              "along %c the lungs are %.3g mm at rest and %.3g mm in the other "
                              "state: different units, or not the same lungs?",
                              "xyz"[k], size[0], size[1]);
    }
    if (overlap < overlap_least * fmin(size[0], size[1])) {
      return supine_error_set(error, SUPINE_ERROR_MESH,
                              "the two surfaces do not overlap along %c (%.0f to %.0f and %.0f to "
                              "%.0f mm): different frames or sides?",
                              "xyz"[k], b -> low[0][k], b -> high[0][k], b -> low[1][k],
                              b -> high[1][k]);
    }
  }
  return SUPINE_OK;
}

static supine_status step_on(const supine_patient_surface_task *task, double share,
                             supine_error *error) {
  return task->progress == NULL || task->progress(task->progress_context, share)
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_INTERRUPTED, "interrupted");
}

/* Progress of the expandability, after that of the starts. */
static const double starts_share = 0.2;

static bool later_progress(void *context, double share) {
  const supine_patient_surface_task *task = context;
  return task->progress == NULL ||
         task->progress(task->progress_context, starts_share + (1.0 - starts_share) * share);
}

/* All starts of the paper's law; the rows are left as the best one found them. */
static supine_status start_all(matching *m, const supine_patient_surface_task *task, const boxes *b,
                               estimate *best, supine_patient_surface_report *report,
                               supine_error *error) {
  double *kept = malloc(3 * m->count * sizeof *kept);
  size_t winner = 0;
  supine_status status = kept == NULL
                             ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for starts")
                             : SUPINE_OK;
  for (size_t k = 0; k < SUPINE_PATIENT_STARTS && status == SUPINE_OK; ++k) {
    estimate e = {.law = SUPINE_PATIENT_PAPER, .moved = task->options.moved};
    size_t rounds = 0;
    memcpy(e.power.powers, supine_patient_starts[k], sizeof e.power.powers);
    status = settle(m, b, &e, report, &report->distance[k], &rounds, error);
    for (size_t i = 0; i < m->count && k > 0 && status == SUPINE_OK; ++i) {
      double square = 0.0;
      for (size_t a = 0; a < 3; ++a) {
        square += pow(m->moved[3 * i + a] - kept[3 * i + a], 2.0);
      }
      report->point_apart = fmax(report->point_apart, sqrt(square));
    }
    if (status == SUPINE_OK && (k == 0 || report->distance[k] < report->distance[winner])) {
      winner = k;
      *best = e;
      report->rounds = rounds;
      memcpy(kept, m->moved, 3 * m->count * sizeof *kept);
    }
    if (status == SUPINE_OK) {
      const double all = task->expandability ? starts_share : 1.0;
      status = step_on(task, all * (double)(k + 1) / SUPINE_PATIENT_STARTS, error);
    }
  }
  if (status == SUPINE_OK) { /* the rows of the winner */
    memcpy(m->moved, kept, 3 * m->count * sizeof *kept);
    m->warm = false;
    supine_patient_matching_find(m);
    report->matched = supine_patient_matching_weigh(m, 0.0, &report->after);
  }
  free(kept);
  return status;
}

/* How far rest is from the state, box laid on box, some axes reversed; mm RMS to nearest points. */
static double laid_distance(const matching *m, const boxes *b, const bool reversed[3]) {
  double square = 0.0;
  for (size_t i = 0; i < m->count; ++i) {
    double at[3];
    for (size_t k = 0; k < 3; ++k) {
      const double t = (m->rest->mesh.vertices[3 * m->vertex[i] + k] - b->low[0][k]) /
                       (b->high[0][k] - b->low[0][k]);
      at[k] = b->low[1][k] + (reversed[k] ? 1.0 - t : t) * (b->high[1][k] - b->low[1][k]);
    }
    const supine_inside_place place = supine_inside_surface_find(m->tree, at, NULL);
    for (size_t k = 0; k < 3; ++k) {
      square += pow(place.nearest[k] - at[k], 2.0) / (double)m->count;
    }
  }
  return sqrt(square);
}

/* Refuses lungs that are the same but for the sign of axes: RAS beside LPS, a mirror image. */
static supine_status check_axes(const matching *m, const boxes *b, supine_error *error) {
  static const struct {
    const char *name;
    bool reversed[3];
  } ways[] = {{"x", {true, false, false}},
              {"y", {false, true, false}},
              {"z", {false, false, true}},
              {"x and y", {true, true, false}}}; /* the last is RAS beside LPS */
  const double given = laid_distance(m, b, (const bool[3]){false, false, false});
  double least = given;
  size_t nearest = 0;
  for (size_t k = 0; k < sizeof ways / sizeof *ways; ++k) {
    const double other = laid_distance(m, b, ways[k].reversed);
    nearest = other < least ? k : nearest;
    least = fmin(other, least);
  }
  return least >= nearer_least * given
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_MESH,
                                "the other surface is %.1f mm from the one at rest, box on box, "
                                "and %.1f mm with %s reversed: are both in the same axes (--axes)?",
                                given, least, ways[nearest].name);
}

/* How far the surfaces are apart at rest; nothing to fit where they are not. */
static supine_status look_at_rest(matching *m, supine_patient_surface_report *report,
                                  supine_error *error) {
  report->vertices = m->count;
  supine_patient_matching_find(m);
  for (size_t i = 0; i < m->count; ++i) {
    report->before += m->distance[i] * m->distance[i] / (double)m->count;
  }
  report->before = sqrt(report->before);
  return report->before >= same_state
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_MESH,
                                "the other surface is the same as the one at rest (%.2g mm RMS "
                                "apart): there is nothing to fit",
                                report->before);
}

/* The stiffness, and the rows of the law with it. What is held out is then counted as the
 * expandability's blocks have it, as their stiffness had not seen them either. */
static supine_status expand(matching *m, const supine_patient_surface_task *task, estimate *e,
                            supine_patient_surface_fit *fit, supine_error *error) {
  const supine_patient_expand_task wanted = {task->options.moved, task->model, task->gravity,
                                             later_progress, (void *)task};
  const supine_status status =
      supine_patient_expand(m, &wanted, &e->power, &fit->stiffness, &fit->expand, error);
  if (status == SUPINE_OK) {
    fit->surface.matched = supine_patient_matching_weigh(m, 0.0, &fit->surface.after);
  }
  return status;
}

/* The report on all laws, and the force that the displacement shows. */
static supine_status judge(matching *m, const supine_patient_surface_task *task,
                           const supine_patient_fit_options *wanted,
                           supine_patient_surface_fit *fit, supine_error *error) {
  const size_t n = m->rest->mesh.vertex_count;
  supine_patient_fit_report *report = &fit->report;
  double *e = malloc(n * sizeof *e);
  supine_status status =
      e == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n)
                : supine_patient_fit(&m->frame, m->rows, m->count, m->landmark_rows_count / 3,
                                     wanted, &fit->patient, report, error);
  if (status == SUPINE_OK && fit->expand.kept) {
    double *held = &report->held_out.corrected;
    const double baseline = wanted->moved != SUPINE_PATIENT_STILL ? report->held_out.translation
                                                                  : report->held_out.none;
    *held = fit->expand.held_out[1];
    report->explained = 1.0 - pow(*held / baseline, 2.0);
  }
  if (status == SUPINE_OK) {
    supine_patient_stiffness_of(&fit->stiffness, m->rest, e);
    status = supine_patient_applied_find(m, &fit->patient, fit->expand.kept ? e : NULL,
                                         task->gravity, &fit->applied, error);
  }
  free(e);
  return status;
}

/* Nearest points by the law that is wanted, then all that is to be said of it. */
static supine_status run(matching *m, const supine_patient_surface_task *task, const boxes *b,
                         const supine_patient_fit_options *wanted, estimate *e,
                         supine_patient_surface_fit *fit, supine_error *error) {
  supine_patient_surface_report *report = &fit->surface;
  supine_status status = look_at_rest(m, report, error);
  if (status == SUPINE_OK) {
    status = check_axes(m, b, error);
  }
  if (status == SUPINE_OK) {
    status = wanted->law == SUPINE_PATIENT_PAPER
                 ? start_all(m, task, b, e, report, error)
                 : settle(m, b, e, report, &report->after, &report->rounds, error);
  }
  if (status == SUPINE_OK && task->expandability) {
    status = expand(m, task, e, fit, error);
  }
  return status == SUPINE_OK ? judge(m, task, wanted, fit, error) : status;
}

supine_status supine_patient_fit_surface(const supine_patient_surface_task *task,
                                         supine_patient_surface_fit *fit, supine_error *error) {
  matching m = {0};
  supine_patient_fit_options wanted = task->options;
  boxes b;
  memcpy(wanted.gravity, task->gravity, sizeof wanted.gravity);
  if (task->expandability) { /* stiffness carries what the law leaves */
    wanted.law = SUPINE_PATIENT_PAPER;
    wanted.uncorrected = true;
  }
  estimate e = {.law = wanted.law, .moved = wanted.moved};
  e.shape = supine_patient_deep(wanted.gravity);
  *fit = (supine_patient_surface_fit){0};
  memcpy(b.low[0], task->rest->minimum, sizeof b.low[0]);
  memcpy(b.high[0], task->rest->maximum, sizeof b.high[0]);
  supine_mesh_box(task->state, b.low[1], b.high[1]);
  supine_status status = check_boxes(&b, error);
  if (status == SUPINE_OK) {
    status = supine_patient_matching_create(task->rest, task->state, task->model, VERTICES_MAX,
                                            task->landmarks != NULL ? task->landmarks->count : 0,
                                            &m, error);
  }
  if (status == SUPINE_OK && task->landmarks != NULL) {
    supine_patient_matching_append(&m, task->landmarks);
  }
  if (status == SUPINE_OK) {
    status = run(&m, task, &b, &wanted, &e, fit, error);
  }
  estimate_free(&e);
  supine_patient_matching_free(&m);
  return status;
}
