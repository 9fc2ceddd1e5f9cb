/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Match vertices to the nearest points of another surface. */
#include <math.h>
#include <string.h>

#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>

#include "precompute/patient/matching.h"

#include "base/arena.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "precompute/physics/solve.h"

enum { GRAIN = 64 };

static const double compatible = 0.5; /* smallest cosine between the two normals of a match */
/* Cutoff of Tukey's biweight, in robust standard deviations. */
static const double biweight = 4.685;
static const double surface_noise = 0.5; /* standard deviation of a surface's position, mm */
static const double scale_least = 0.02;  /* lower bound on the robust standard deviation, mm */
static const double matched_least = 0.3; /* a smaller share of matched vertices is an error */

static void match_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  supine_patient_matching *m = context;
  for (size_t i = begin; i < end; ++i) {
    supine_patient_match *match = &m->match[i];
    const double *from = m->fuller->mesh.vertices + 3 * match->vertex;
    supine_patient_row *row = &m->rows[i];
    supine_inside_place *place = &match->nearest;
    *place = supine_lungs_surface_nearest(m->tree, match->position, place);
    const uint32_t *corner = m->state->triangles + 3 * place->triangle;
    double normal[3] = {0.0, 0.0, 0.0};
    double cosine = 0.0;
    for (size_t k = 0; k < 9; ++k) {
      normal[k % 3] +=
          place->barycentric[k / 3] * m->state_normals[3 * (size_t)corner[k / 3] + k % 3];
    }
    const double length = supine_length(normal);
    row->value = 0.0;
    match->distance = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      row->axis[k] = length > 0.0 ? normal[k] / length : 0.0;
      row->value += row->axis[k] * (place->nearest[k] - from[k]);
      match->distance += row->axis[k] * (place->nearest[k] - match->position[k]);
      cosine += row->axis[k] * m->fuller_normals[3 * match->vertex + k];
    }
    row->weight = cosine > compatible ? 1.0 : 0.0;
  }
}

void supine_patient_matching_find(supine_patient_matching *matching) {
  supine_parallel_for(matching->count, GRAIN, 0, match_range, matching);
}

supine_status supine_patient_matching_weigh(supine_patient_matching *matching, double scale,
                                            supine_error *error) {
  size_t count = 0;
  double squares = 0.0;
  double weights = 0.0;
  for (size_t i = 0; i < matching->count; ++i) {
    if (matching->rows[i].weight > 0.0) {
      matching->space[count++] = fabs(matching->match[i].distance);
    }
  }
  matching->matched = (double)count / (double)matching->count;
  SUPINE_REFUSE_IF(matching->matched < matched_least, error, SUPINE_ERROR_MESH,
                   "only %.0f %% of the vertices have a normal like that of the nearest point of "
                   "the other surface: check that both surfaces have the same axes and show the "
                   "same person, and that no triangles face inwards",
                   100.0 * matching->matched);
  gsl_sort(matching->space, 1, count);
  const double cutoff_scale = fmax(fmax(scale_least, scale), 1.4826 * matching->space[count / 2]);
  for (size_t i = 0; i < matching->count; ++i) {
    const double distance = matching->match[i].distance;
    const double t = distance / (biweight * cutoff_scale);
    matching->rows[i].weight *= fabs(t) < 1.0 ? (1.0 - t * t) * (1.0 - t * t) : 0.0;
    squares += matching->rows[i].weight * distance * distance;
    weights += matching->rows[i].weight;
  }
  matching->rms = sqrt(squares / weights);
  return SUPINE_OK;
}

void supine_patient_matching_choose(supine_patient_matching *matching, size_t limit) {
  supine_patient_matching *m = matching;
  const size_t n = m->fuller->mesh.vertex_count;
  m->count = n < limit ? n : limit;
  m->landmark_row_count = 0;
  for (size_t i = 0; i < m->count; ++i) {
    const size_t v = i * n / m->count;
    m->match[i] = (supine_patient_match){.vertex = v, .nearest.depth = INFINITY};
    m->rows[i] = (supine_patient_row){.place = supine_patient_find_vertex(m->fuller, v),
                                      .noise = surface_noise};
    memcpy(m->rows[i].place.force, m->smoothed_force + SUPINE_PATIENT_COLUMNS * v,
           sizeof m->rows[i].place.force);
    memcpy(m->match[i].position, m->fuller->mesh.vertices + 3 * v, sizeof m->match[i].position);
  }
}

supine_status supine_patient_matching_create(const supine_lungs *fuller, const supine_mesh *state,
                                             size_t limit, size_t landmarks,
                                             supine_patient_matching *matching,
                                             supine_error *error) {
  const size_t n = fuller->mesh.vertex_count;
  supine_patient_matching *m = matching;
  *m = (supine_patient_matching){.fuller = fuller, .state = state};
  m->frame = supine_patient_frame_of_lungs(fuller);
  supine_arena *a = &m->arena;
  m->smoothed_force = supine_arena_take(a, SUPINE_PATIENT_COLUMNS * n, sizeof(double));
  m->fuller_normals = supine_arena_take(a, 3 * n, sizeof(double));
  m->state_normals = supine_arena_take(a, 3 * state->vertex_count, sizeof(double));
  m->match = supine_arena_take(a, n, sizeof *m->match);
  m->rows = supine_arena_take(a, n + 3 * landmarks, sizeof *m->rows);
  m->space = supine_arena_take(a, n, sizeof(double));
  SUPINE_TRY(supine_arena_check(a, error, "%zu vertices", n));
  supine_mesh_vertex_normals(&fuller->mesh, m->fuller_normals);
  supine_mesh_vertex_normals(state, m->state_normals);
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  SUPINE_TRY(supine_physics_model_equilibrium(fuller, &model, &m->equilibrium, error));
  for (size_t i = 0; i < n; ++i) {
    const supine_patient_place place = supine_patient_find_vertex(fuller, i);
    memcpy(m->smoothed_force + SUPINE_PATIENT_COLUMNS * i, place.force, sizeof place.force);
  }
  SUPINE_TRY(supine_physics_equilibrium_solve(m->equilibrium, SUPINE_PATIENT_COLUMNS,
                                              m->smoothed_force, m->smoothed_force, error));
  supine_patient_matching_choose(m, limit);
  return supine_lungs_surface_create(state->vertices, state->triangle_count, state->triangles,
                                     false, &m->tree, error);
}

void supine_patient_matching_free(supine_patient_matching *matching) {
  supine_lungs_surface_destroy(matching->tree);
  supine_physics_equilibrium_destroy(matching->equilibrium);
  supine_arena_free(&matching->arena);
}

static void place_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  supine_patient_matching *m = context;
  for (size_t i = begin; i < end; ++i) {
    const supine_patient_place *place = &m->rows[i].place;
    supine_patient_match *match = &m->match[i];
    double u[3];
    double motion[3];
    supine_patient_displacement(m->patient, place, 1.0, u);
    supine_patient_motion(&m->patient->power, place, motion);
    m->space[i] = 0.0;
    for (size_t a = 0; a < 3; ++a) {
      const size_t from = 3 * match->vertex + a;
      const double at = m->fuller->mesh.vertices[from] + u[a] + motion[a] +
                        (m->tissue != NULL ? m->tissue[from] : 0.0);
      m->space[i] += pow(at - match->position[a], 2.0);
      match->position[a] = at;
    }
  }
}

double supine_patient_matching_place(supine_patient_matching *matching,
                                     const supine_patient *patient) {
  matching->patient = patient;
  supine_parallel_for(matching->count, GRAIN, 0, place_range, matching);
  return sqrt(gsl_stats_mean(matching->space, 1, matching->count));
}
