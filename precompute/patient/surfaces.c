/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A law from surfaces: closest points, point to plane, robust, over and over. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_sort.h>

#include "precompute/patient/surfaces.h"

#include "precompute/inside/surface.h"
#include "precompute/physics/solve.h"
#include "sh/base/parallel.h"

enum {
  VERTICES_MAX = 2000, /* that take part: a law of nine constants is not better known from more */
  ROUNDS_MAX = 60,
  ROUND_STEPS = 4,
  GRAIN = 64
};

static const double compatible = 0.5;    /* cosine between normals: 60 degrees */
static const double settled = 2e-3;      /* mm RMS between two rounds */
static const double biweight = 4.685;    /* of the scale: 95 % efficient on normal errors */
static const double scale_least = 0.02;  /* mm: no surface is known better */
static const double same_state = 0.02;   /* mm RMS */
static const double overlap_least = 0.5; /* of the smaller box, along each axis */
static const double size_most = 1.6;
static const double matched_least = 0.3;
static const double round_tolerance = 1e-4;
/* mm^2 for each row, of polynomials while points are still being found: they would slide. */
static const double sliding_ridge = 0.01;

/* The surface that vertices are brought to, and those that take part. */
typedef struct matching {
  const supine_lungs *rest;
  const supine_mesh *state;
  supine_inside_surface *tree;
  double *state_normals; /* [state vertices, 3], unit */
  size_t count;
  size_t *vertex;               /* [count] of rest */
  double *normals;              /* [count, 3] at rest */
  double *moved;                /* [count, 3] where the law puts them */
  supine_patient_row *rows;     /* [count + 3 landmarks] */
  double *distance;             /* [count] along the normal */
  supine_inside_place *nearest; /* [count] */
  bool warm;
  size_t landmark_rows_count;
} matching;

/* Of the surface at rest and the other, mm. */
typedef struct boxes {
  double low[2][3], high[2][3];
} boxes;

supine_patient_frame supine_patient_frame_of_lungs(const supine_lungs *lungs) {
  supine_patient_frame frame = {.midline = lungs->midline,
                                .only_side = lungs->lung_count == 1 ? lungs->side[0] : 0};
  memcpy(frame.minimum, lungs->minimum, sizeof frame.minimum);
  memcpy(frame.maximum, lungs->maximum, sizeof frame.maximum);
  return frame;
}

/* Row i: the plane of the state's surface nearest to where vertex i is. Weight 0: none that fits.
 */
static void match_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  matching *m = context;
  for (size_t i = begin; i < end; ++i) {
    const double *at = m->moved + 3 * i;
    const double *from = m->rest->mesh.vertices + 3 * m->vertex[i];
    supine_patient_row *row = &m->rows[i];
    m->nearest[i] = supine_inside_surface_find(m->tree, at, m->warm ? &m->nearest[i] : NULL);
    const supine_inside_place *place = &m->nearest[i];
    const uint32_t *corner = m->state->triangles + 3 * place->triangle;
    double normal[3] = {0.0, 0.0, 0.0};
    double length = 0.0;
    double cosine = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      for (size_t v = 0; v < 3; ++v) {
        normal[k] += place->barycentric[v] * m->state_normals[3 * (size_t)corner[v] + k];
      }
      length += normal[k] * normal[k];
    }
    length = sqrt(length);
    row->value = 0.0;
    m->distance[i] = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      row->axis[k] = length > 0.0 ? normal[k] / length : 0.0;
      row->value += row->axis[k] * (place->nearest[k] - from[k]);
      m->distance[i] += row->axis[k] * (place->nearest[k] - at[k]);
      cosine += row->axis[k] * m->normals[3 * i + k];
    }
    row->weight = cosine > compatible ? 1.0 : 0.0;
  }
}

/* Weights fall to 0 at 4.7 times what most distances are. The share that has any. */
static double weigh(matching *m, double *space, double *rms) {
  size_t count = 0;
  double squares = 0.0;
  double weights = 0.0;
  for (size_t i = 0; i < m->count; ++i) {
    if (m->rows[i].weight > 0.0) {
      space[count++] = fabs(m->distance[i]);
    }
  }
  if (count == 0) {
    return 0.0;
  }
  gsl_sort(space, 1, count);
  const double scale = fmax(scale_least, 1.4826 * space[count / 2]);
  for (size_t i = 0; i < m->count; ++i) {
    const double t = m->distance[i] / (biweight * scale);
    m->rows[i].weight *= fabs(t) < 1.0 ? (1.0 - t * t) * (1.0 - t * t) : 0.0;
    squares += m->rows[i].weight * m->distance[i] * m->distance[i];
    weights += m->rows[i].weight;
  }
  *rms = weights > 0.0 ? sqrt(squares / weights) : 0.0;
  return (double)count / (double)m->count;
}

/* What a law found so far is. */
typedef struct estimate {
  supine_patient_law law;
  supine_patient_moved moved;
  supine_patient_power power;
  double polynomial[SUPINE_PATIENT_POLYNOMIAL];
} estimate;

/* Displacement at a vertex that takes part: axis by axis, what a row there would be left of. */
static void displace(const matching *m, const estimate *e, size_t i, double u[3]) {
  supine_patient_row row = m->rows[i];
  row.value = 0.0;
  supine_patient patient = {.law = SUPINE_PATIENT_QUADRATIC,
                            .frame = supine_patient_frame_of_lungs(m->rest)};
  if (e->law != SUPINE_PATIENT_PAPER) {
    memcpy(patient.polynomial, e->polynomial, sizeof patient.polynomial);
    supine_patient_displacement(&patient, m->rest->mesh.vertices + 3 * m->vertex[i], u);
    return;
  }
  for (size_t a = 0; a < 3; ++a) {
    for (size_t k = 0; k < 3; ++k) {
      row.axis[k] = a == k ? 1.0 : 0.0;
    }
    u[a] = supine_patient_power_residual(&e->power, &row);
  }
}

static supine_status refit(const matching *m, estimate *e, supine_error *error) {
  const size_t count = m->count + m->landmark_rows_count;
  if (e->law == SUPINE_PATIENT_PAPER) {
    return supine_patient_power_fit(m->rows, count, e->moved, e->power.powers, ROUND_STEPS,
                                    round_tolerance, &e->power, error);
  }
  supine_patient_normals *normals = calloc(1, sizeof *normals);
  double penalty[SUPINE_PATIENT_POLYNOMIAL];
  if (normals == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for normal equations");
  }
  for (size_t i = 0; i < count; ++i) {
    supine_patient_normals_add_row(normals, &m->rows[i]);
  }
  const double ridge = sliding_ridge * normals->weight;
  const bool one = m->rest->lung_count == 1;
  if (e->law == SUPINE_PATIENT_AFFINE) {
    supine_patient_penalty_affine(false, penalty);
  } else {
    supine_patient_penalty_quadratic(ridge, ridge, one, penalty);
  }
  const supine_status status = supine_patient_polynomial_fit(normals, penalty, e->polynomial);
  free(normals);
  return status == SUPINE_OK ? status
                             : supine_error_set(error, status, "the surface fixes no polynomial");
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

static supine_status settle(matching *m, const boxes *b, estimate *e,
                            supine_patient_surface_report *report, double *rms, size_t *rounds,
                            supine_error *error) {
  double *space = malloc(m->count * sizeof *space);
  supine_status status =
      space == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for distances")
                    : SUPINE_OK;
  m->warm = false;
  start_rows(m, b);
  for (*rounds = 0; status == SUPINE_OK && *rounds < ROUNDS_MAX; ++*rounds) {
    double change = 0.0;
    status = refit(m, e, error);
    for (size_t i = 0; i < m->count && status == SUPINE_OK; ++i) {
      double u[3];
      displace(m, e, i, u);
      for (size_t k = 0; k < 3; ++k) {
        const double at = m->rest->mesh.vertices[3 * m->vertex[i] + k] + u[k];
        change += pow(at - m->moved[3 * i + k], 2.0) / (double)m->count;
        m->moved[3 * i + k] = at;
      }
    }
    if (status == SUPINE_OK) {
      supine_parallel_for(m->count, GRAIN, 0, match_range, m);
      m->warm = true;
      report->matched = weigh(m, space, rms);
      if (report->matched < matched_least) {
        status = supine_error_set(error, SUPINE_ERROR_MESH,
                                  "only %.0f %% of the vertices find the other surface facing the "
                                  "same way: other axes, another person, or triangles inwards",
                                  100.0 * report->matched);
      }
    }
    if (sqrt(change) < settled) {
      break;
    }
  }
  free(space);
  return status;
}

/* --- set up ---------------------------------------------------------------------------------- */

/* What the forces 1, X - 1/2, Y - 1/2, Z - 1/2 come to at the vertices that take part. */
static supine_status solve_forces(matching *m, const supine_model *model, supine_error *error) {
  static const double up[3] = {0.0, 1.0, 0.0}; /* no force turns here: any direction */
  supine_status status = SUPINE_OK;
  for (size_t c = 0; c < 4 && status == SUPINE_OK; ++c) {
    supine_solution solution = {0};
    supine_model one = *model;
    one.direction = supine_physics_model(SUPINE_LAW_PAPER).direction;
    one.force = (supine_force_law){.base = c == 0 ? 1.0 : -0.5};
    if (c > 0) {
      one.force.box[c - 1] = 1.0;
    }
    status = supine_physics_solve(m->rest, &one, up, &solution, error);
    for (size_t i = 0; i < m->count && status == SUPINE_OK; ++i) {
      m->rows[i].force[c] = solution.catch_[m->vertex[i]];
    }
    supine_physics_solution_free(&solution);
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

static supine_status prepare(matching *m, const supine_model *model, size_t landmarks,
                             supine_error *error) {
  const size_t n = m->rest->mesh.vertex_count;
  const supine_patient_frame frame = supine_patient_frame_of_lungs(m->rest);
  m->count = n < VERTICES_MAX ? n : VERTICES_MAX;
  double *all = malloc(3 * n * sizeof *all);
  m->state_normals = malloc(3 * m->state->vertex_count * sizeof(double));
  m->vertex = malloc(m->count * sizeof *m->vertex);
  m->normals = malloc(3 * m->count * sizeof(double));
  m->moved = calloc(3 * m->count, sizeof(double));
  m->rows = calloc(m->count + 3 * landmarks, sizeof *m->rows);
  m->distance = malloc(m->count * sizeof(double));
  m->nearest = calloc(m->count, sizeof *m->nearest);
  if (all == NULL || m->state_normals == NULL || m->vertex == NULL || m->normals == NULL ||
      m->moved == NULL || m->rows == NULL || m->distance == NULL || m->nearest == NULL) {
    free(all);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  supine_mesh_vertex_normals(&m->rest->mesh, all);
  supine_mesh_vertex_normals(m->state, m->state_normals);
  for (size_t i = 0; i < m->count; ++i) {
    const size_t v = i * n / m->count;
    m->vertex[i] = v;
    memcpy(m->normals + 3 * i, all + 3 * v, 3 * sizeof(double));
    m->rows[i].place = supine_patient_find(&frame, m->rest->mesh.vertices + 3 * v);
  }
  free(all);
  const supine_status status = solve_forces(m, model, error);
  return status != SUPINE_OK
             ? status
             : supine_inside_surface_create(m->state->vertices, m->state->triangle_count,
                                            m->state->triangles, &m->tree, error);
}

static void matching_free(matching *m) {
  supine_inside_surface_destroy(m->tree);
  free(m->state_normals);
  free(m->vertex);
  free(m->normals);
  free(m->moved);
  free(m->rows);
  free(m->distance);
  free(m->nearest);
}

/* Landmarks after the surface's rows, all together as heavy as those. */
static void append(matching *m, const supine_patient_frame *frame,
                   const supine_patient_pairs *landmarks) {
  if (landmarks != NULL) {
    supine_patient_rows_of_pairs(frame, landmarks, m->rows + m->count);
    m->landmark_rows_count = 3 * landmarks->count;
    for (size_t i = 0; i < m->landmark_rows_count; ++i) {
      m->rows[m->count + i].weight = (double)m->count / (double)m->landmark_rows_count;
    }
  }
}

/* All starts of the paper's law; the rows are left as the best one found them. */
static supine_status start_all(matching *m, const boxes *b, supine_patient_moved moved,
                               estimate *best, supine_patient_surface_report *report,
                               supine_error *error) {
  double *kept = malloc(3 * m->count * sizeof *kept);
  size_t winner = 0;
  supine_status status = kept == NULL
                             ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for starts")
                             : SUPINE_OK;
  for (size_t k = 0; k < SUPINE_PATIENT_STARTS && status == SUPINE_OK; ++k) {
    estimate e = {.law = SUPINE_PATIENT_PAPER, .moved = moved};
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
  }
  if (status == SUPINE_OK) { /* the rows of the winner */
    double rms = 0.0;
    double *space = malloc(m->count * sizeof *space);
    memcpy(m->moved, kept, 3 * m->count * sizeof *kept);
    m->warm = false;
    supine_parallel_for(m->count, GRAIN, 0, match_range, m);
    if (space != NULL) {
      report->matched = weigh(m, space, &rms);
    }
    report->after = rms;
    free(space);
  }
  free(kept);
  return status;
}

supine_status supine_patient_fit_surface(const supine_lungs *rest, const supine_mesh *state,
                                         const supine_model *model,
                                         const supine_patient_pairs *landmarks,
                                         const supine_patient_fit_options *options,
                                         supine_patient *patient, supine_patient_fit_report *report,
                                         supine_patient_surface_report *surface,
                                         supine_error *error) {
  matching m = {.rest = rest, .state = state};
  const supine_patient_frame frame = supine_patient_frame_of_lungs(rest);
  supine_patient_fit_options wanted = *options;
  boxes b;
  double rms = 0.0;
  estimate e = {.law = SUPINE_PATIENT_PAPER};
  *surface = (supine_patient_surface_report){0};
  memcpy(b.low[0], rest->minimum, sizeof b.low[0]);
  memcpy(b.high[0], rest->maximum, sizeof b.high[0]);
  supine_mesh_box(state, b.low[1], b.high[1]);
  if (!options->law_given && landmarks == NULL) {
    wanted.law_given = true;
    wanted.law = SUPINE_PATIENT_PAPER;
  }
  supine_status status = check_boxes(&b, error);
  if (status == SUPINE_OK) {
    status = prepare(&m, model, landmarks != NULL ? landmarks->count : 0, error);
  }
  if (status == SUPINE_OK) {
    append(&m, &frame, landmarks);
    surface->vertices = m.count;
    for (size_t i = 0; i < m.count; ++i) {
      memcpy(m.moved + 3 * i, rest->mesh.vertices + 3 * m.vertex[i], 3 * sizeof(double));
    }
    supine_parallel_for(m.count, GRAIN, 0, match_range, &m);
    for (size_t i = 0; i < m.count; ++i) {
      surface->before += m.distance[i] * m.distance[i] / (double)m.count;
    }
    surface->before = sqrt(surface->before);
    if (surface->before < same_state) {
      status = supine_error_set(error, SUPINE_ERROR_MESH,
                                "the other surface is the same as the one at rest (%.2g mm RMS "
                                "apart): there is nothing to fit",
                                surface->before);
    }
  }
  if (status == SUPINE_OK) {
    status = start_all(&m, &b, wanted.moved, &e, surface, error);
  }
  if (status == SUPINE_OK && (!wanted.law_given || wanted.law != SUPINE_PATIENT_PAPER)) {
    size_t rounds = 0;
    e.law = wanted.law_given ? wanted.law : SUPINE_PATIENT_QUADRATIC;
    status = settle(&m, &b, &e, surface, &rms, &rounds, error);
    surface->after = rms;
  }
  if (status == SUPINE_OK) {
    status = supine_patient_fit(&frame, m.rows, m.count + m.landmark_rows_count, 1, &wanted,
                                patient, report, error);
  }
  matching_free(&m);
  return status;
}
