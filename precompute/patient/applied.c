/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The force that a measured displacement implies. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <lapacke.h>

#include "precompute/patient/applied.h"

#include "sh/base/parallel.h"

enum { GRAIN = 64, COLUMNS = SUPINE_PATIENT_COLUMNS };

static const double compatible = 0.5; /* cosine between normals: 60 degrees */

/* Least length of a direction, relative to their RMS: shorter ones say little about the force. */
static const double shortest = 0.1;

typedef struct study {
  const supine_patient_matching *m;
  const supine_patient *patient;
  double *normals;          /* [N, 3] of the reference surface */
  double *area;             /* [N] a third of the triangles about each vertex, mm^2 */
  double *directions;       /* [N, 3] d, mm */
  double softener;          /* (share of the RMS of |d|)^2, mm^2 */
  double *catch_;           /* [N] F, the force after spreading */
  double *force;            /* [N] f, the force before spreading */
  bool *matched;            /* [N] has a compatible point on the other surface */
  supine_patient_row *rows; /* [N] give each vertex its block */
} study;

/* Find vertex areas: the spreading operator conserves area times force (equilibrium.h). */
static void find_areas(const supine_mesh *mesh, double *area) {
  memset(area, 0, mesh->vertex_count * sizeof *area);
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    const double *p = mesh->vertices + 3 * (size_t)corner[0];
    double side[2][3];
    double square = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      side[0][k] = mesh->vertices[3 * (size_t)corner[1] + k] - p[k];
      side[1][k] = mesh->vertices[3 * (size_t)corner[2] + k] - p[k];
    }
    for (size_t k = 0; k < 3; ++k) {
      const size_t a = (k + 1) % 3;
      const size_t b = (k + 2) % 3;
      square += pow(side[0][a] * side[1][b] - side[0][b] * side[1][a], 2.0);
    }
    for (size_t k = 0; k < 3; ++k) {
      area[corner[k]] += sqrt(square) / 6.0;
    }
  }
}

static double dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Find the force after spreading: the law's, corrected by the other surface along its normal. */
static void catch_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const study *s = context;
  const supine_patient_matching *m = s->m;
  supine_inside_place place;
  for (size_t v = begin; v < end; ++v) {
    const double *p = m->rest->mesh.vertices + 3 * v;
    const double *d = s->directions + 3 * v;
    const double square = dot(d, d) + s->softener;
    const double *c = s->patient->powers + 3;
    const double *caught = m->caught + COLUMNS * v;
    double at[3];
    double motion[3];
    double normal[3] = {0.0, 0.0, 0.0};
    double off = 0.0;
    s->catch_[v] = caught[0] + c[0] * caught[1] + c[1] * caught[2] + c[2] * caught[3];
    for (size_t k = 0; k < 3; ++k) {
      at[k] = s->catch_[v] * d[k];
    }
    supine_patient_motion(s->patient, p, motion);
    for (size_t k = 0; k < 3; ++k) {
      at[k] += p[k] + motion[k];
    }
    place = supine_inside_surface_nearest(m->tree, at, v > begin ? &place : NULL);
    const uint32_t *corner = m->state->triangles + 3 * place.triangle;
    for (size_t k = 0; k < 9; ++k) {
      normal[k % 3] +=
          place.barycentric[k / 3] * m->state_normals[3 * (size_t)corner[k / 3] + k % 3];
    }
    const double length = sqrt(dot(normal, normal));
    s->matched[v] = dot(normal, s->normals + 3 * v) > compatible * length;
    for (size_t k = 0; k < 3 && s->matched[v]; ++k) {
      normal[k] /= length;
      off += normal[k] * (place.nearest[k] - at[k]);
    }
    if (s->matched[v]) {
      s->catch_[v] += off * dot(normal, d) / square;
    }
  }
}

/* Area-weighted block means of the force, the columns of (18) and the height; block areas. */
typedef struct block {
  double area, force, columns[COLUMNS], height;
} block;

static void sum_blocks(const study *s, const double gravity[3], block *blocks, size_t count) {
  const supine_lungs *lungs = s->m->rest;
  const size_t n = lungs->mesh.vertex_count;
  double low = INFINITY;
  double high = -INFINITY;
  for (size_t v = 0; v < n; ++v) {
    const double depth = dot(gravity, lungs->mesh.vertices + 3 * v);
    low = fmin(low, depth);
    high = fmax(high, depth);
  }
  for (size_t v = 0; v < n; ++v) {
    block *of = &blocks[s->rows[v].block];
    of->area += s->area[v];
    of->force += s->area[v] * s->force[v];
    of->height += s->area[v] * (dot(gravity, lungs->mesh.vertices + 3 * v) - low) / (high - low);
    for (size_t k = 0; k < COLUMNS; ++k) {
      of->columns[k] += s->area[v] * s->m->columns[COLUMNS * v + k];
    }
  }
  for (size_t b = 0; b < count; ++b) {
    blocks[b].force /= blocks[b].area;
    blocks[b].height /= blocks[b].area;
    for (size_t k = 0; k < COLUMNS; ++k) {
      blocks[b].columns[k] /= blocks[b].area;
    }
  }
}

/* Fit (18) by weighted least squares, and find the residual. */
static bool fit_force(const block *blocks, size_t count, supine_patient_applied *applied) {
  double matrix[COLUMNS * COLUMNS] = {0.0};
  double k[COLUMNS] = {0.0};
  double squares = 0.0;
  double about = 0.0;
  double weight = 0.0;
  double mean = 0.0;
  for (size_t b = 0; b < count; ++b) {
    for (size_t i = 0; i < COLUMNS; ++i) {
      for (size_t j = 0; j < COLUMNS; ++j) {
        matrix[COLUMNS * i + j] += blocks[b].area * blocks[b].columns[i] * blocks[b].columns[j];
      }
      k[i] += blocks[b].area * blocks[b].columns[i] * blocks[b].force;
    }
    weight += blocks[b].area;
    mean += blocks[b].area * blocks[b].force;
  }
  mean /= weight;
  if (count <= COLUMNS ||
      LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', COLUMNS, 1, matrix, COLUMNS, k, COLUMNS) != 0 ||
      k[0] == 0.0) {
    return false;
  }
  for (size_t b = 0; b < count; ++b) {
    double left = -blocks[b].force;
    for (size_t i = 0; i < COLUMNS; ++i) {
      left += k[i] * blocks[b].columns[i];
    }
    squares += blocks[b].area * left * left;
    about += blocks[b].area * pow(blocks[b].force - mean, 2.0);
  }
  for (size_t i = 0; i < 3; ++i) {
    applied->slopes[i] = k[1 + i] / k[0];
  }
  applied->left = sqrt(squares / weight) / fabs(k[0]);
  applied->spread = sqrt(about / weight) / fabs(k[0]);
  return true;
}

static double correlation(const block *blocks, size_t count) {
  double sums[6] = {0.0}; /* 1, f, h, ff, hh, fh */
  for (size_t b = 0; b < count; ++b) {
    const double w = blocks[b].area;
    const double f = blocks[b].force;
    const double h = blocks[b].height;
    const double terms[6] = {1.0, f, h, f * f, h * h, f * h};
    for (size_t k = 0; k < 6; ++k) {
      sums[k] += w * terms[k];
    }
  }
  const double ff = sums[3] - sums[1] * sums[1] / sums[0];
  const double hh = sums[4] - sums[2] * sums[2] / sums[0];
  return ff > 0.0 && hh > 0.0 ? (sums[5] - sums[1] * sums[2] / sums[0]) / sqrt(ff * hh) : 0.0;
}

static supine_status find(study *s, const double *stiffness, const double gravity[3],
                          supine_patient_applied *applied, supine_error *error) {
  const supine_lungs *lungs = s->m->rest;
  const size_t n = lungs->mesh.vertex_count;
  supine_mesh_vertex_normals(&lungs->mesh, s->normals);
  find_areas(&lungs->mesh, s->area);
  for (size_t v = 0; v < n; ++v) {
    double *d = s->directions + 3 * v;
    supine_patient_place *place = &s->rows[v].place;
    *place = supine_patient_find(&s->m->frame, lungs->mesh.vertices + 3 * v, 0.0);
    supine_patient_direction(s->patient, place, d);
    s->softener += shortest * shortest * dot(d, d) / (double)n;
  }
  supine_parallel_for(n, GRAIN, 0, catch_range, s);
  for (size_t v = 0; v < n; ++v) {
    applied->matched += s->matched[v] ? 1.0 / (double)n : 0.0;
  }
  supine_status status =
      supine_physics_equilibrium_set_stiffness(s->m->equilibrium, stiffness, error);
  if (status == SUPINE_OK) {
    status = supine_physics_equilibrium_force(s->m->equilibrium, s->catch_, s->force, error);
  }
  if (status != SUPINE_OK) {
    return status;
  }
  applied->blocks = supine_patient_rows_block(&s->m->frame, s->rows, n, 1);
  block *blocks = calloc(applied->blocks + 1, sizeof *blocks);
  if (blocks == NULL || applied->blocks == 0) {
    free(blocks);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for blocks");
  }
  sum_blocks(s, gravity, blocks, applied->blocks);
  applied->correlation = correlation(blocks, applied->blocks);
  if (!fit_force(blocks, applied->blocks, applied)) {
    status = supine_error_set(
        error, SUPINE_ERROR_NUMERICAL,
        "the displacement determines no force: it is nowhere along the law's directions");
  }
  free(blocks);
  return status;
}

supine_status supine_patient_applied_find(const supine_patient_matching *matching,
                                          const supine_patient *patient, const double *stiffness,
                                          const double gravity[3], supine_patient_applied *applied,
                                          supine_error *error) {
  const size_t n = matching->rest->mesh.vertex_count;
  study s = {.m = matching,
             .patient = patient,
             .normals = malloc(3 * n * sizeof(double)),
             .area = malloc(n * sizeof(double)),
             .directions = malloc(3 * n * sizeof(double)),
             .catch_ = malloc(n * sizeof(double)),
             .force = malloc(n * sizeof(double)),
             .matched = calloc(n, sizeof(bool)),
             .rows = calloc(n, sizeof(supine_patient_row))};
  *applied = (supine_patient_applied){0};
  const supine_status status =
      s.normals == NULL || s.area == NULL || s.directions == NULL || s.catch_ == NULL ||
              s.force == NULL || s.matched == NULL || s.rows == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n)
          : find(&s, stiffness, gravity, applied, error);
  free(s.normals);
  free(s.area);
  free(s.directions);
  free(s.catch_);
  free(s.force);
  free(s.matched);
  free(s.rows);
  return status;
}
