/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a law to surfaces by iterated nearest points, point to plane, with robust weights. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/patient/surfaces.h"

#include "precompute/patient/krige.h"
#include "precompute/patient/matching.h"
#include "sh/base/parallel.h"

enum {
  VERTICES_MAX = 600,  /* most vertices of a fit: kriging has a length of 90 mm */
  EXPANDED_MAX = 2000, /* the same if expandability is fitted, of regions some 45 mm apart */
  ROUNDS_MAX = 60,
  GRAIN = 64
};

static const double settled = 2e-3;      /* RMS change between rounds that ends the fit, mm */
static const double near_by = 0.5;       /* the same, for the first fit of a law of known shape */
static const double outlying = 1.0;      /* least cutoff of the weights, mm: kriging corrects the
                                          * law's residual, which weights must not remove */
static const double same_state = 0.02;   /* RMS distance of equal surfaces, mm */
static const double overlap_least = 0.5; /* least overlap over the smaller box, along each axis */
static const double size_most = 1.6;
static const double matched_least = 0.3;
static const double nearer_least =
    0.6; /* ratio of distances, reversed over given, that reveals reversed axes */

typedef supine_patient_matching matching;

/* Boxes of the reference surface and the other, mm. */
typedef struct boxes {
  double low[2][3], high[2][3];
} boxes;

/* Arguments of the pass that moves the vertices by the law. */
typedef struct placing {
  matching *m;
  const supine_patient *patient;
  double *square; /* [count] squared change of each position, mm^2 */
} placing;

static void place_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  placing *w = context;
  matching *m = w->m;
  for (size_t i = begin; i < end; ++i) {
    const double *from = m->rest->mesh.vertices + 3 * m->vertex[i];
    double u[3];
    double motion[3];
    supine_patient_row_displacement(w->patient, &m->rows[i], u);
    supine_patient_motion(w->patient, from, motion);
    w->square[i] = 0.0;
    for (size_t a = 0; a < 3; ++a) {
      const double at = from[a] + u[a] + motion[a];
      w->square[i] += pow(at - m->moved[3 * i + a], 2.0);
      m->moved[3 * i + a] = at;
    }
  }
}

/* Fit the deep law's size to the rows; or, if `shaped`, its constants and the correction. */
static supine_status refit(const matching *m, const supine_patient_fit_options *wanted, bool shaped,
                           supine_patient_krige_options *options, supine_patient *patient,
                           supine_error *error) {
  const size_t count = m->count + m->landmark_rows_count;
  const supine_patient_power shape = supine_patient_deep(wanted->gravity, wanted->way);
  supine_patient_krige *krige = NULL;
  supine_patient_power law;
  supine_status status;
  if (shaped) {
    status = supine_patient_krige_create(options, m->rows, count, &krige, error);
  } else {
    status = supine_patient_scale_fit(m->rows, count, wanted->moved, &shape, &law, error);
    *options = supine_patient_krige_prior(wanted->law, &law, wanted->moved);
    options->noise = 1.0;
    options->sill = wanted->uncorrected ? 0.0 : -1.0;
    supine_patient_take(&law, patient);
  }
  if (status == SUPINE_OK && shaped) {
    supine_patient_krige_take(krige, patient);
    options->sill = supine_patient_krige_sill(krige);
  }
  supine_patient_krige_destroy(krige);
  return status;
}

/* Move the vertices; return the RMS change of their positions, mm. */
static supine_status place(matching *m, const supine_patient *patient, double *change,
                           supine_error *error) {
  placing w = {.m = m, .patient = patient, .square = calloc(m->count, sizeof(double))};
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

/* Make the first rows by mapping each lung's box to the other state's, axis by axis. */
static void start_rows(matching *m, const boxes *b) {
  for (size_t i = 0; i < m->count; ++i) {
    supine_patient_row *row = &m->rows[i];
    const double *from = m->rest->mesh.vertices + 3 * m->vertex[i];
    const size_t k = i % 3; /* one axis for each vertex, in turn */
    const double t = (from[k] - b->low[0][k]) / (b->high[0][k] - b->low[0][k]);
    row->axis[0] = row->axis[1] = row->axis[2] = 0.0;
    row->axis[k] = 1.0;
    row->value = b->low[1][k] + t * (b->high[1][k] - b->low[1][k]) - from[k];
    row->weight = 1.0;
  }
}

/* Alternate between nearest points and the fit. Fit the law's size first: the motion along the
 * surfaces, which they do not show, then starts from the law's. */
static supine_status settle(matching *m, const boxes *b, const supine_patient_fit_options *wanted,
                            supine_patient *patient, supine_patient_surface_report *report,
                            supine_error *error) {
  supine_patient_krige_options options = {.sill = -1.0, .noise = 1.0};
  supine_status status = SUPINE_OK;
  bool shaped = false;
  m->warm = false;
  start_rows(m, b);
  for (report->rounds = 0; status == SUPINE_OK && report->rounds < ROUNDS_MAX; ++report->rounds) {
    double change = 0.0;
    status = refit(m, wanted, shaped, &options, patient, error);
    if (status == SUPINE_OK) {
      status = place(m, patient, &change, error);
    }
    if (status == SUPINE_OK) {
      supine_patient_matching_find(m);
      report->matched = supine_patient_matching_weigh(m, outlying, &report->after);
      if (report->matched < matched_least) {
        status = supine_error_set(
            error, SUPINE_ERROR_MESH,
            "only %.0f %% of the vertices find the other surface facing the same way: check that "
            "axes and person are the same, and that no triangles face inwards",
            100.0 * report->matched);
      }
    }
    if (change < (shaped ? settled : near_by)) {
      if (shaped) {
        break;
      }
      shaped = true;
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
                              "state: check that units and lungs are the same",
                              "xyz"[k], size[0], size[1]);
    }
    if (overlap < overlap_least * fmin(size[0], size[1])) {
      return supine_error_set(error, SUPINE_ERROR_MESH,
                              "the two surfaces do not overlap along %c (%.0f to %.0f and %.0f to "
                              "%.0f mm): check that frames and sides are the same",
                              "xyz"[k], b -> low[0][k], b -> high[0][k], b -> low[1][k],
                              b -> high[1][k]);
    }
  }
  return SUPINE_OK;
}

/* Find the RMS distance of the surfaces with their boxes matched and some axes reversed, mm. */
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

/* Refuse lungs that match better with reversed axes: RAS for LPS, or a mirror image. */
static supine_status check_axes(const matching *m, const boxes *b, supine_error *error) {
  static const struct {
    const char *name;
    bool reversed[3];
  } ways[] = {{"x", {true, false, false}},
              {"y", {false, true, false}},
              {"z", {false, false, true}},
              {"x and y", {true, true, false}}}; /* the last is RAS for LPS */
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
             : supine_error_set(
                   error, SUPINE_ERROR_MESH,
                   "with boxes matched, the other surface is %.1f mm from the one at rest, but "
                   "%.1f mm with %s reversed: give both in the same axes (--axes)",
                   given, least, ways[nearest].name);
}

/* Find the distance of the surfaces before the fit; fail if they are equal. */
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

/* Fit the expandability and the law with it. The held-out error is then that of the
 * expandability's own blocks, which its fit did not use. */
static supine_status expand(matching *m, const supine_patient_surface_task *task,
                            supine_patient_surface_fit *fit, supine_error *error) {
  const supine_patient_expand_task wanted = {task->options.moved, task->model, task->gravity,
                                             task->progress, task->progress_context};
  const supine_status status =
      supine_patient_expand(m, &wanted, &fit->patient, &fit->stiffness, &fit->expand, error);
  if (status == SUPINE_OK) {
    fit->surface.matched = supine_patient_matching_weigh(m, 0.0, &fit->surface.after);
  }
  return status;
}

/* Fill the report of all laws, and the force that the displacement implies. */
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

/* Match the nearest points, then fit and judge the law. */
static supine_status run(matching *m, const supine_patient_surface_task *task, const boxes *b,
                         const supine_patient_fit_options *wanted, supine_patient_surface_fit *fit,
                         supine_error *error) {
  fit->patient = (supine_patient){.law = wanted->law, .frame = m->frame};
  supine_status status = look_at_rest(m, &fit->surface, error);
  if (status == SUPINE_OK) {
    status = check_axes(m, b, error);
  }
  if (status == SUPINE_OK) {
    status = settle(m, b, wanted, &fit->patient, &fit->surface, error);
  }
  if (status == SUPINE_OK && task->expandability) {
    status = expand(m, task, fit, error);
  }
  return status == SUPINE_OK ? judge(m, task, wanted, fit, error) : status;
}

supine_status supine_patient_fit_surface(const supine_patient_surface_task *task,
                                         supine_patient_surface_fit *fit, supine_error *error) {
  matching m = {0};
  supine_patient_fit_options wanted = task->options;
  boxes b;
  memcpy(wanted.gravity, task->gravity, sizeof wanted.gravity);
  if (task->expandability) { /* the stiffness replaces the correction */
    wanted.law = SUPINE_PATIENT_PAPER;
    wanted.uncorrected = true;
  }
  *fit = (supine_patient_surface_fit){0};
  memcpy(b.low[0], task->rest->minimum, sizeof b.low[0]);
  memcpy(b.high[0], task->rest->maximum, sizeof b.high[0]);
  supine_mesh_box(task->state, b.low[1], b.high[1]);
  supine_status status = check_boxes(&b, error);
  if (status == SUPINE_OK) {
    status = supine_patient_matching_create(
        task->rest, task->state, task->model, task->expandability ? EXPANDED_MAX : VERTICES_MAX,
        task->landmarks != NULL ? task->landmarks->count : 0, &m, error);
  }
  if (status == SUPINE_OK && task->landmarks != NULL) {
    supine_patient_matching_append(&m, task->landmarks);
  }
  if (status == SUPINE_OK) {
    status = run(&m, task, &b, &wanted, fit, error);
  }
  supine_patient_matching_free(&m);
  return status;
}
