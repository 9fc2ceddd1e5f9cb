/* SPDX-License-Identifier: MIT */
/* Compute the errors that remain after a rigid registration at fiducials:
 *
 *     e_t - J_t y,   y = sum over fiducials f of P_f e_f
 *
 *     y    translation and rotation vector that fit the errors of the fiducials best, about their
 * mean J_t  [1, -[v]x], v = p_t - mean: translation + rotation x v P_f  1 / n, and T^-1 [q_f]x, q_f
 * = p_f - mean, T = sum over f of (|q_f|^2 - q_f q_f') */
#include <math.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/vec3.h"
#include "runtime/doubt.h"
#include "runtime/internal.h"
#include "runtime/rigid.h"

enum { PARAMETERS = 6 };

typedef struct fiducial {
  supine_doubt_features features;
  double weight[PARAMETERS][3]; /* P_f */
} fiducial;

struct supine_doubt_frame {
  const supine_doubt *doubt;
  double centre[3];                         /* mean position of the fiducials in the scan, mm */
  double square[PARAMETERS][PARAMETERS];    /* sum over f, g of c_fg P_f P_g', c_fg: isotropic */
  double common[DOUBT_VECTORS][PARAMETERS]; /* y of each vector of the features */
  double rotation[9], translation[3];
  size_t count;
  double *white;       /* [count, landmarks] of supine_doubt_whiten */
  fiducial fiducial[]; /* [count] */
};

static size_t struct_space(size_t count) {
  return supine_space_doubles(sizeof(supine_doubt_frame) + count * sizeof(fiducial));
}

size_t supine_doubt_frame_space(const supine_basis *basis, size_t count) {
  return struct_space(count) + count * basis->landmark_count;
}

/* Return the covariance of one axis of a point and fiducial i; all axes are alike. */
static double covary(const supine_doubt_frame *f, const supine_doubt_features *at,
                     const double *white, size_t i) {
  double covariance[9];
  supine_doubt_covary(f->doubt, at, white, &f->fiducial[i].features,
                      f->white + i * f->doubt->basis->landmark_count, covariance);
  return covariance[0];
}

/* Solve T x = b for each column of a matrix by Cramer's rule, T symmetric. */
static void solve(double t[3][3], const double b[3], double x[3]) {
  const double whole = supine_triple(t[0], t[1], t[2]);
  for (size_t k = 0; k < 3; ++k) {
    double replaced[3][3];
    memcpy(replaced, t, sizeof replaced);
    memcpy(replaced[k], b, 3 * sizeof *b);
    x[k] = supine_triple(replaced[0], replaced[1], replaced[2]) / whole;
  }
}

/* Compute T, and P_f of every fiducial. Return the smallest eigenvalue of T, mm^2. */
static double set_weights(supine_doubt_frame *f) {
  double t[3][3] = {{0}};
  for (size_t i = 0; i < f->count; ++i) {
    double q[3];
    supine_subtract(f->fiducial[i].features.place, f->centre, q);
    for (size_t k = 0; k < 9; ++k) {
      t[k / 3][k % 3] += (k % 4 == 0 ? supine_dot(q, q) : 0) - q[k / 3] * q[k % 3];
    }
  }
  double value[3];
  supine_eigenvalues((const double(*)[3])t, value);
  const double least = value[2];
  if (!(least > 0)) {
    return 0;
  }
  for (size_t i = 0; i < f->count; ++i) {
    double q[3];
    supine_subtract(f->fiducial[i].features.place, f->centre, q);
    for (size_t k = 0; k < 3; ++k) {
      const double unit[3] = {k == 0, k == 1, k == 2};
      double turned[3];
      double solved[3];
      supine_cross(q, unit, turned);
      solve(t, turned, solved);
      for (size_t r = 0; r < 3; ++r) {
        f->fiducial[i].weight[r][k] = r == k ? 1 / (double)f->count : 0;
        f->fiducial[i].weight[3 + r][k] = solved[r];
      }
    }
  }
  return least;
}

/* Sum over all pairs of fiducials, and over the vectors of each. */
static void sum_errors(supine_doubt_frame *f) {
  for (size_t i = 0; i < f->count; ++i) {
    const fiducial *a = &f->fiducial[i];
    for (size_t j = 0; j < f->count; ++j) {
      const fiducial *b = &f->fiducial[j];
      const double c = covary(f, &a->features, f->white + i * f->doubt->basis->landmark_count, j);
      for (size_t e = 0; e < PARAMETERS * PARAMETERS; ++e) {
        f->square[e / PARAMETERS][e % PARAMETERS] +=
            c * supine_dot(a->weight[e / PARAMETERS], b->weight[e % PARAMETERS]);
      }
    }
    for (size_t e = 0; e < DOUBT_VECTORS * PARAMETERS; ++e) {
      f->common[e / PARAMETERS][e % PARAMETERS] +=
          supine_dot(a->weight[e % PARAMETERS], a->features.vector[e / PARAMETERS]);
    }
  }
}

/* Find the motion from the predicted positions of the fiducials to those in the scan. */
static void find_motion(supine_doubt_frame *f) {
  supine_rigid_motion motion = {0};
  for (size_t i = 0; i < f->count; ++i) {
    float from[3];
    float to[3];
    for (size_t k = 0; k < 3; ++k) {
      from[k] = (float)f->fiducial[i].features.at[k];
      to[k] = (float)f->fiducial[i].features.place[k];
    }
    supine_rigid_add(&motion, from, to, 1);
  }
  supine_rigid_finish(&motion);
  memcpy(f->rotation, motion.rotation, sizeof f->rotation);
  for (size_t k = 0; k < 3; ++k) {
    f->translation[k] = motion.to[k] - supine_dot(f->rotation + 3 * k, motion.from);
  }
}

supine_status supine_doubt_frame_prepare(const supine_doubt *doubt, size_t count,
                                         const size_t *vertices, double *space,
                                         const supine_doubt_frame **frame, supine_error *error) {
  const size_t n = supine_basis_get_info(doubt->basis)->vertex_count;
  supine_doubt_frame *f = (supine_doubt_frame *)space;
  *frame = NULL;
  if (count < SUPINE_DOUBT_FIDUCIALS_LEAST || count > SUPINE_DOUBT_FIDUCIALS_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%zu point%s of the frame: give %d to %d, spread around the targets",
                            count, count == 1 ? "" : "s", (int)SUPINE_DOUBT_FIDUCIALS_LEAST,
                            (int)SUPINE_DOUBT_FIDUCIALS_MAX);
  }
  if (doubt->location != NULL) {
    return supine_error_set(
        error, SUPINE_ERROR_UNSUPPORTED,
        "located lungs are in the frame of the observations: they have no other registration");
  }
  *f = (supine_doubt_frame){.doubt = doubt, .count = count, .white = space + struct_space(count)};
  for (size_t i = 0; i < count; ++i) {
    if (vertices[i] >= n) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "point %zu of the frame is vertex %zu: give a vertex below %zu",
                              i + 1, vertices[i], n);
    }
    const supine_doubt_point point = {vertices[i], 0};
    supine_doubt_evaluate_one(doubt, &point, &f->fiducial[i].features);
    supine_doubt_whiten(doubt, &f->fiducial[i].features,
                        f->white + i * doubt->basis->landmark_count);
    for (size_t k = 0; k < 3; ++k) {
      f->centre[k] += f->fiducial[i].features.place[k] / (double)count;
    }
  }
  const double from_line = sqrt(fmax(0, set_weights(f)) / (double)count);
  if (supine_input_judge(SUPINE_INPUT_FRAME_LINE, from_line) == SUPINE_INPUT_REFUSED) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the points of the frame lie %.1f mm (RMS) from one line, and the turn "
                            "about it is open: give points at least %.0f mm from it",
                            from_line, supine_input_get(SUPINE_INPUT_FRAME_LINE)->refused);
  }
  sum_errors(f);
  find_motion(f);
  *frame = f;
  return SUPINE_OK;
}

void supine_doubt_frame_motion(const supine_doubt_frame *frame, double *rotation,
                               double *translation) {
  memcpy(rotation, frame->rotation, sizeof frame->rotation);
  memcpy(translation, frame->translation, sizeof frame->translation);
}

/* Compute J_t y for a target at `offset` from the mean of the fiducials. */
static void apply(const double y[PARAMETERS], const double offset[3], double moved[3]) {
  supine_cross(y + 3, offset, moved);
  for (size_t k = 0; k < 3; ++k) {
    moved[k] += y[k];
  }
}

/* Return the expected squared error of a target after the registration, mm^2:
 * 3 c_tt - 2 tr(J D) + tr(J B J') + the squares of the vectors' residuals, D = sum of c_tf P_f. */
static double square_after(const supine_doubt_frame *f, const supine_doubt_features *target) {
  double offset[3];
  double cross[PARAMETERS][3] = {{0}};
  double white[SUPINE_KRIGING_LANDMARKS_MAX];
  double own[9];
  supine_doubt_whiten(f->doubt, target, white);
  supine_doubt_covary(f->doubt, target, white, target, white, own);
  double sum = 3 * own[0];
  supine_subtract(target->place, f->centre, offset);
  for (size_t i = 0; i < f->count; ++i) {
    const double c = covary(f, target, white, i);
    for (size_t e = 0; e < PARAMETERS * 3; ++e) {
      cross[e / 3][e % 3] += c * f->fiducial[i].weight[e / 3][e % 3];
    }
  }
  double row[3][PARAMETERS]; /* of J: translation, then -[offset]x */
  for (size_t e = 0; e < PARAMETERS; ++e) {
    double unit[PARAMETERS] = {0};
    double moved[3];
    unit[e] = 1;
    apply(unit, offset, moved);
    for (size_t k = 0; k < 3; ++k) {
      row[k][e] = moved[k];
    }
  }
  for (size_t k = 0; k < 3; ++k) {
    for (size_t e = 0; e < PARAMETERS; ++e) {
      sum -= 2 * row[k][e] * cross[e][k];
      for (size_t g = 0; g < PARAMETERS; ++g) {
        sum += row[k][e] * f->square[e][g] * row[k][g];
      }
    }
  }
  for (size_t v = 0; v < DOUBT_VECTORS; ++v) {
    double moved[3];
    apply(f->common[v], offset, moved);
    sum += pow(supine_distance(target->vector[v], moved), 2);
  }
  return fmax(0, sum);
}

supine_status supine_doubt_frame_errors(const supine_doubt_frame *frame, size_t begin, size_t end,
                                        float *sigma) {
  supine_doubt_walk walk = {.doubt = frame->doubt, .end = end};
  if (end > supine_basis_get_info(frame->doubt->basis)->vertex_count) {
    return SUPINE_ERROR_ARGUMENT;
  }
  for (size_t i = begin; i < end; ++i) {
    sigma[i - begin] = (float)sqrt(square_after(frame, supine_doubt_at(&walk, i)));
  }
  return SUPINE_OK;
}
