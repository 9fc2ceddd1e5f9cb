/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Normals of morph targets. Engines add weight times a target's normals to the base's and make the
 * sum unit again, so that a vertex' normal is linear in the weights, while the surface's own is
 * not. With w the weights less those at the reference surface (breath scale 0) and n_0 the normals
 * there,
 *
 *     n(w) ~ n_0 + sum over j of w_j d_j          d: least squares over postures and the breath
 *
 * The base, where the weights themselves are 0, would have n_0 less what the reference's weights
 * add. It has its surface's own instead, b, for engines that turn the base's normals with the
 * surface (Blender): what is missing, delta, is added with the weights, delta (1 + sum over j of
 * w_j c_j) being least over the same poses. As only directions count, a vertex' base and additions
 * are divided by the length of its base. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "sh/base/vec3.h"

#include "program/export/targets.h"

enum { POSES = EXPORT_POSES, PARTS = 5 };
static const double singular =
    1e-6; /* share of the largest singular value below which a direction is not determined */

/* Replace A = U S V^T, the weights of the poses [POSES, J], by pinv(A)^T. */
static supine_status invert(size_t count, double *a) {
  const int j = (int)count;
  double *u = malloc(POSES * count * sizeof *u);
  double *vt = malloc(count * count * sizeof *vt);
  double *s = malloc(count * sizeof *s);
  const bool room = u != NULL && vt != NULL && s != NULL;
  const bool good = room && count <= POSES &&
                    LAPACKE_dgesdd(LAPACK_ROW_MAJOR, 'S', POSES, j, a, j, s, u, j, vt, j) == 0;
  for (int i = 0; good && i < j; ++i) {
    cblas_dscal(POSES, s[i] > singular * s[0] ? 1 / s[i] : 0, u + i, j);
  }
  if (good) {
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, POSES, j, j, 1, u, j, vt, j, 0, a, j);
  }
  free(u);
  free(vt);
  free(s);
  return good ? SUPINE_OK : room ? SUPINE_ERROR_NUMERICAL : SUPINE_ERROR_MEMORY;
}

/* c: w . c nearest to -1 over the poses' weights [POSES, J], at rest above all, which is what is
 * seen first. */
static supine_status find_turn(size_t count, const export_pose *pose, double *turn) {
  static const double at_rest = 10.0;
  double *a = malloc(POSES * count * sizeof *a);
  double right[POSES];
  double s[EXPORT_TARGETS_MAX];
  lapack_int rank = 0;
  supine_status status = SUPINE_ERROR_MEMORY;
  if (a != NULL) {
    for (size_t p = 0; p < POSES; ++p) {
      const double share = p % PARTS == 0 ? at_rest : 1.0;
      right[p] = -share;
      for (size_t j = 0; j < count; ++j) {
        a[p * count + j] = share * pose[p].weights[j];
      }
    }
    const lapack_int j = (lapack_int)count;
    status = LAPACKE_dgelsd(LAPACK_ROW_MAJOR, POSES, j, 1, a, j, right, 1, s, singular, &rank) == 0
                 ? SUPINE_OK
                 : SUPINE_ERROR_NUMERICAL;
    memcpy(turn, right, count * sizeof *turn);
  }
  free(a);
  return status;
}

/* Puts the base's own normals into `base`, which is n_0, and divides by the length that the fit has
 * along them. */
static void settle(const export_targets *targets, size_t n, const double *turn, const float *own,
                   float *base, float *added) {
  static const double least = 0.2; /* the fit shortens this base until it has no direction */
  for (size_t i = 0; i < n; ++i) {
    double sum[3];
    double length = 0.0;
    for (size_t axis = 0; axis < 3; ++axis) {
      sum[axis] = (double)base[3 * i + axis];
      for (size_t j = 0; j < targets->count; ++j) { /* the reference's weight is -offset / unit */
        sum[axis] += targets->offset[j] / targets->unit[j] * (double)added[(j * n + i) * 3 + axis];
      }
      length += sum[axis] * (double)own[3 * i + axis];
    }
    length = fmax(length, least);
    for (size_t axis = 0; axis < 3; ++axis) {
      const double delta = sum[axis] - length * (double)own[3 * i + axis];
      base[3 * i + axis] = own[3 * i + axis];
      for (size_t j = 0; j < targets->count; ++j) {
        float *to = &added[(j * n + i) * 3 + axis];
        *to = (float)(((double)*to - turn[j] * delta) / length);
      }
    }
  }
}

/* The surface's own normals in every pose, summed into the fit. */
static void add_pose(const export_targets *targets, const double *inverse, size_t p, size_t n,
                     const float *base, const float *normals, float *added) {
  for (size_t j = 0; j < targets->count; ++j) {
    const float amount = (float)inverse[p * targets->count + j];
    float *to = added + 3 * j * n;
    for (size_t i = 0; i < 3 * n; ++i) {
      to[i] += amount * (normals[i] - base[i]);
    }
  }
}

supine_status supine_export_targets_normals(const export_source *source,
                                            const export_breath *breath,
                                            const export_targets *targets, float *base,
                                            float *added, supine_error *error) {
  const size_t n = source->info->vertex_count;
  supine_status status = SUPINE_ERROR_MEMORY;
  export_pose *pose = malloc(POSES * sizeof *pose);
  float *xyz = malloc(3 * n * sizeof *xyz);
  float *normals = malloc(3 * n * sizeof *normals);
  double *a = malloc(POSES * targets->count * sizeof *a);
  double turn[EXPORT_TARGETS_MAX];
  if (pose == NULL || xyz == NULL || normals == NULL || a == NULL) {
    (void)supine_error_set(error, status, "out of memory");
    goto cleanup;
  }
  for (size_t p = 0; p < POSES; ++p) {
    double g[3];
    supine_spiral((double)p, POSES, 0, g);
    double part = (double)(p % PARTS) / (PARTS - 1);
    do { /* a breath at which the surface folds is replaced by a shallower one */
      status = supine_export_targets_at(source, breath, targets, g, part, &pose[p], error);
      part /= 2;
    } while (status == SUPINE_ERROR_NUMERICAL && part > 1e-3);
    /* Numerical: without any breath, the reference surface, which tells nothing new. */
    if (status != SUPINE_OK && status != SUPINE_ERROR_NUMERICAL) {
      goto cleanup;
    }
    for (size_t j = 0; j < targets->count; ++j) {
      a[p * targets->count + j] = pose[p].weights[j] + targets->offset[j] / targets->unit[j];
    }
  }
  status = invert(targets->count, a);
  if (status == SUPINE_OK) {
    status = find_turn(targets->count, pose, turn);
  }
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "the targets' normals were not found: %s",
                           supine_status_string(status));
    goto cleanup;
  }
  supine_normals(source->basis, source->vertices, base);
  for (size_t i = 0; i < 3 * n * targets->count; ++i) {
    added[i] = 0;
  }
  for (size_t p = 0; p < POSES; ++p) {
    supine_deform(source->basis, &pose[p].basis, xyz);
    supine_normals(source->basis, xyz, normals);
    add_pose(targets, a, p, n, base, normals, added);
  }
  supine_export_targets_base(source, targets, xyz);
  supine_normals(source->basis, xyz, normals);
  settle(targets, n, turn, normals, base, added);
cleanup:
  free(pose);
  free(xyz);
  free(normals);
  free(a);
  return status;
}
