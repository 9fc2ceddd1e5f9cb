/* SPDX-License-Identifier: MIT */
/* Compute the expected errors of predicted positions. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/vec3.h"
#include "runtime/expected.h"
#include "runtime/internal.h"
#include "runtime/lung.h"

const double supine_expected_shift = 0.01;

static const struct {
  const char *name, *source;
} terms[SUPINE_EXPECTED_TERMS] = {
    {"displacement", "landmarks of full breaths (15 people) and of quiet breaths (10 people)"},
    {"turn", "a fit in one posture does not show the effect of a turn"},
    {"assumed volume",
     "standard deviation of the share at rest in other people (metadata resting_spread)"},
    {"heart", "motion of the heart, supine to prone (Chino & Marks 2008, n 16)"},
    {"sliding", "assumed: sliding of the lungs along gravity, which the model lacks"},
    {"collapse", "assumed: as much as the collapse moves the tissue; no collapse was measured"}};

/* Return the positive number that the metadata `key` holds, or `usual`. */
static double number_of(const supine_basis *basis, const char *key, double usual) {
  const char *text = supine_basis_metadata(basis, key);
  const double stated = text == NULL ? 0 : supine_number_parse(text, NULL);
  return stated > 0 && isfinite(stated) ? stated : usual;
}

double supine_expected_constant(const supine_basis *basis) {
  return number_of(basis, "expected_error_mm", SUPINE_EXPECTED_ERROR_MM);
}

size_t supine_expected_landmark_count(const supine_basis *basis) {
  return basis->landmark_count;
}

double supine_expected_held_out(const supine_basis *basis) {
  return basis->held_out;
}

supine_status supine_expected_fit_landmarks(const supine_basis *basis, supine_kriging_point *seen,
                                            double *space, supine_kriging *fit,
                                            supine_error *error) {
  for (size_t i = 0; i < basis->landmark_count; ++i) {
    const float *number = basis->landmarks + 4 * i;
    const double place[3] = {(double)number[0], (double)number[1], (double)number[2]};
    seen[i] = supine_kriging_landmark(place, (size_t)fmaxf(0, fminf(number[3], SUPINE_LUNGS_MAX)));
  }
  return supine_kriging_fit_landmarks(basis->landmark_count, seen, space, fit, error);
}

double supine_expected_reference(const supine_basis *basis) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double sum = 0;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    sum += info->reference_volume[lung];
  }
  return sum;
}

/* Return the mean squared displacement between two poses over all vertices, mm^2. */
static double mean_square(const supine_basis *basis, const supine_pose *pose,
                          const supine_pose *from) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  float x[3 * LOCATE_BLOCK];
  float origin[3 * LOCATE_BLOCK];
  double sum = 0;
  for (size_t begin = 0; begin < n; begin += LOCATE_BLOCK) {
    const size_t end = n - begin < LOCATE_BLOCK ? n : begin + LOCATE_BLOCK;
    (void)supine_displace_range(basis, pose, begin, end, x);
    (void)supine_displace_range(basis, from, begin, end, origin);
    for (size_t i = 0; i < 3 * (end - begin); ++i) {
      const double d = (double)x[i] - (double)origin[i];
      sum += d * d;
    }
  }
  return sum / (double)n;
}

/* Return the same for the lungs around embedded points, from the products in their file. */
static double mean_square_of_lungs(const supine_basis *basis, const supine_pose *pose,
                                   const supine_pose *from) {
  const size_t k = basis->info.mode_count;
  double sum = 0;
  for (size_t row = 0; row < basis->info.lung_count * 3 * k; ++row) {
    const size_t lung = row / k / 3;
    const double *gain[2] = {&pose->gains[lung][row / k % 3], &from->gains[lung][row / k % 3]};
    const double *to = supine_basis_lung_weights(basis, pose, lung);
    const double *before = supine_basis_lung_weights(basis, from, lung);
    const double a = *gain[0] * to[row % k] - *gain[1] * before[row % k];
    for (size_t l = 0; l < k; ++l) {
      sum += basis->squares[row * k + l] * a * (*gain[0] * to[l] - *gain[1] * before[l]);
    }
  }
  return fmax(0, sum);
}

supine_volume_kind supine_expected_assumed(const supine_basis *basis) {
  const char *scanned = supine_basis_metadata(basis, "scanned");
  const char *state = supine_basis_metadata(basis, "scan_state");
  supine_state scan = {0};
  if (state != NULL) {
    (void)supine_state_parse(state, &scan, NULL);
  }
  const bool at_rest =
      (scanned != NULL && strcmp(scanned, "rest") == 0) || scan.volume.kind == SUPINE_VOLUME_REST;
  if (!supine_basis_get_info(basis)->has_rest ||
      supine_basis_metadata(basis, "resting_known") != NULL) {
    return SUPINE_VOLUME_DEFAULT;
  }
  return at_rest ? SUPINE_VOLUME_FULL : SUPINE_VOLUME_REST;
}

/* Return the volume of all lungs at rest, in the posture of the scan, divided by that at full
 * inflation. */
static double resting_share(const supine_basis *basis) {
  supine_state rest = supine_basis_scan(basis);
  supine_pose pose;
  double volumes[SUPINE_LUNGS_MAX];
  double sum = 0;
  rest.volume.kind = SUPINE_VOLUME_REST;
  if (supine_basis_pose_any(basis, &rest, &pose, NULL) == SUPINE_OK) {
    (void)supine_basis_volumes(basis, &pose, volumes);
    for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
      sum += volumes[lung];
    }
  }
  return sum / supine_expected_reference(basis);
}

/* Add a multiple of the displacement of a lung's hilum from the reference surface. */
static void add_hilum(const supine_basis *basis, const supine_pose *pose, size_t lung,
                      double factor, double hilum[3]) {
  const size_t modes = basis->info.mode_count;
  const double *weights = supine_basis_lung_weights(basis, pose, lung);
  if (basis->hilum_modes != NULL) {
    const double *row = basis->hilum_modes + 3 * modes * lung;
    for (size_t i = 0; i < 3 * modes; ++i) {
      hilum[i / modes] += factor * pose->gains[lung][i / modes] * weights[i % modes] * row[i];
    }
  }
}

/* Find how far each lung is collapsed in the poses of a model, and where its hilum is. */
static supine_status find_collapse(const supine_basis *basis, supine_expected_model *m,
                                   supine_error *error) {
  supine_pose scan;
  if (basis->info.hilum == NULL) {
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_basis_scan_pose(basis, &scan, error));
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    for (size_t k = 0; k < 2; ++k) {
      const supine_pose *pose = &m->pose[k];
      double *hilum = m->hilum[lung][k];
      m->collapse[lung][k] = basis->scan_expansion[lung] - pose->expansion[lung];
      memcpy(hilum, basis->hilum[lung], sizeof basis->hilum[lung]);
      add_hilum(basis, pose, lung, 1, hilum);
      add_hilum(basis, &scan, lung, -1, hilum);
    }
  }
  return SUPINE_OK;
}

/* Return whether the volume of a state, of all lungs or of one lung, is relative to `kind`. */
static bool counts_from(const supine_state *state, supine_volume_kind kind) {
  const supine_volume_kind own = state->volume.kind;
  bool counts = state->lung_count == 0 &&
                (own == kind || (own == SUPINE_VOLUME_DEFAULT && kind == SUPINE_VOLUME_REST));
  for (size_t i = 0; i < state->lung_count; ++i) {
    counts = counts || state->lungs[i].volume.kind == kind;
  }
  return counts && kind != SUPINE_VOLUME_DEFAULT;
}

supine_status supine_expected_shifted(const supine_basis *basis, const supine_state *state,
                                      supine_pose *pose, supine_error *error) {
  const double ml = supine_expected_shift * supine_expected_reference(basis);
  supine_state shifted = *state;
  if (shifted.volume.kind == SUPINE_VOLUME_DEFAULT) {
    shifted.volume.kind = SUPINE_VOLUME_REST;
  }
  shifted.volume.ml += ml;
  for (size_t i = 0; i < shifted.lung_count; ++i) {
    shifted.lungs[i].volume.ml += ml / (double)shifted.lung_count;
  }
  return supine_basis_pose_any(basis, &shifted, pose, error);
}

/* Set the change of unit gravity between two states across the body and sideways. */
static void find_turn(const supine_state *state, const supine_state *from,
                      supine_expected_model *m) {
  double change[3];
  double unit[3];
  double other[3];
  (void)supine_normalise(state->gravity, unit); /* supine_basis_pose has accepted both vectors */
  (void)supine_normalise(from->gravity, other);
  supine_subtract(unit, other, change);
  m->across = sqrt(change[0] * change[0] + change[1] * change[1]);
  m->sideways = fabs(change[0]);
}

/* Compute the pose of a state, or that of the scan if the state is the one in the scan. Refuse
 * other states that lungs cannot hold. */
static supine_status pose_or_scan(const supine_basis *basis, const supine_state *state,
                                  supine_pose *pose, supine_error *error) {
  if (!supine_basis_is_scan(basis, state)) {
    return supine_basis_pose(basis, state, pose, error);
  }
  return basis->info.order > 0 ? supine_basis_scan_pose(basis, pose, error)
                               : supine_basis_pose_any(basis, state, pose, error);
}

supine_status supine_expected_prepare(const supine_basis *basis, const supine_state *state,
                                      const supine_state *from, double deviation, double least,
                                      supine_expected_model *m, supine_error *error) {
  const supine_state *const states[2] = {state, from};
  const supine_volume_kind assumed = supine_expected_assumed(basis);
  const double spread = number_of(basis, "resting_spread", EXPECTED_SPREAD) *
                        (assumed == SUPINE_VOLUME_REST ? resting_share(basis) : 1);
  const double own = supine_expected_constant(basis);
  *m = (supine_expected_model){.basis = basis, .least = least};
  SUPINE_TRY(supine_basis_pose_any(basis, state, &m->pose[0], error));
  SUPINE_TRY(pose_or_scan(basis, from, &m->pose[1], error));
  for (size_t k = 0; k < 2; ++k) {
    m->pose[EXPECTED_FULLER + k] = m->pose[k];
    if (deviation > 0 ? k == 0 : counts_from(states[k], assumed)) {
      SUPINE_TRY(supine_expected_shifted(basis, states[k], &m->pose[EXPECTED_FULLER + k], error));
      m->per_step = (deviation > 0 ? deviation / supine_expected_reference(basis) : spread) /
                    supine_expected_shift;
    }
  }
  find_turn(state, from, m);
  SUPINE_TRY(find_collapse(basis, m, error));
  const double square = basis->squares != NULL
                            ? mean_square_of_lungs(basis, &m->pose[0], &m->pose[1])
                            : mean_square(basis, &m->pose[0], &m->pose[1]);
  const double full = number_of(basis, "expected_error_from_mm", EXPECTED_FULL_BREATH);
  double rms = fmax(least, sqrt(square));
  if (supine_basis_expansion(basis, &m->pose[0]) != supine_basis_expansion(basis, &m->pose[1])) {
    rms = fmax(rms, full); /* take a collapse as no smaller than a full breath */
  }
  m->law = own * fmin(1, rms / full);
  m->rms = rms;
  if (supine_basis_metadata(basis, "turn_fitted") == NULL) {
    m->turn = fmax(0, SUPINE_EXPECTED_ERROR_MM * fmin(1, rms / EXPECTED_FULL_BREATH) - m->law);
  }
  if (m->turn > 0) {
    for (size_t k = 0; k < 2; ++k) {
      supine_state level = *states[k];
      memcpy(level.gravity, basis->scan_gravity, sizeof level.gravity);
      SUPINE_TRY(supine_basis_pose_any(basis, &level, &m->pose[EXPECTED_LEVEL + k], error));
    }
  }
  return SUPINE_OK;
}

/* Return the number b of the formula at a point p, mm: about 1 beside the heart, 0 far from it. */
static double near_heart(const supine_basis *basis, const float *p) {
  const double *low = basis->box[0];
  const double *high = basis->box[1];
  const double from_midline = (double)p[0] - basis->midline;
  const double width = from_midline > 0 ? high[0] - basis->midline : basis->midline - low[0];
  const double x = width > 0 ? fabs(from_midline) / width : 0;
  const double y = high[1] > low[1] ? (high[1] - (double)p[1]) / (high[1] - low[1]) : 0.5;
  const double z = high[2] > low[2] ? (high[2] - (double)p[2]) / (high[2] - low[2]) : 0.5;
  return fmax(0, 1 - x / 0.7) * fmax(0, 4 * y * (1 - y)) * fmax(0, 1 - fabs(z - 0.65) / 0.35);
}

void supine_expected_squares(const supine_expected_model *m, double u[EXPECTED_POSES / 2][3],
                             double beside_heart, double square[SUPINE_EXPECTED_TERMS]) {
  double moved = 0;
  double slope = 0;
  double turned = 0;
  for (size_t k = 0; k < 3; ++k) {
    moved += u[0][k] * u[0][k];
    slope += (u[1][k] - u[0][k]) * (u[1][k] - u[0][k]);
    turned += (u[0][k] - u[2][k]) * (u[0][k] - u[2][k]);
  }
  square[SUPINE_EXPECTED_DISPLACEMENT] = m->law * fmax(m->least, sqrt(moved));
  square[SUPINE_EXPECTED_TURN] = m->turn * sqrt(turned);
  square[SUPINE_EXPECTED_VOLUME] = m->per_step * m->per_step * slope;
  square[SUPINE_EXPECTED_HEART] = pow(EXPECTED_HEART * m->across * beside_heart, 2);
  square[SUPINE_EXPECTED_SLIDING] = pow(EXPECTED_SLIDING * m->sideways, 2);
  square[SUPINE_EXPECTED_COLLAPSE] = 0;
}

/* Compute the vector of the term of collapse at vertices begin <= i < end. */
static void evaluate_collapse(const supine_expected_model *m, size_t begin, size_t end,
                              supine_expected_block *b) {
  const supine_basis *basis = m->basis;
  const float *vertices = supine_basis_vertices(basis) + 3 * begin;
  memset(b->collapse, 0, sizeof b->collapse);
  if (basis->info.hilum == NULL) {
    return;
  }
  for (size_t i = 0; i < end - begin; ++i) {
    const size_t lung = supine_basis_lung_of(&basis->info, begin + i);
    for (size_t pose = 0; pose < 2; ++pose) {
      const double e = pose == 0 ? m->collapse[lung][0] : -m->collapse[lung][1];
      for (size_t k = 0; k < 3; ++k) {
        const double x = (double)vertices[3 * i + k] + (double)b->x[pose][3 * i + k];
        b->collapse[i][k] += e * (x - m->hilum[lung][pose][k]);
      }
    }
    b->square[i][SUPINE_EXPECTED_COLLAPSE] = supine_dot(b->collapse[i], b->collapse[i]);
  }
}

void supine_expected_relate(supine_expected_model *m, const double *mean) {
  static const double outwards = 0.175;
  const supine_basis_info *info = supine_basis_get_info(m->basis);
  const double *low = m->basis->box[0];
  const double *high = m->basis->box[1];
  const double midline = m->basis->midline;
  const size_t modes = info->mode_count;
  m->anchor_count = info->lung_count;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    supine_expected_anchor *a = &m->anchor[lung];
    const double face = info->lung_names[lung][0] == 'l' ? high[0] : low[0];
    *a = (supine_expected_anchor){.position = {midline + outwards * (face - midline),
                                               0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])}};
    const float at[3] = {(float)a->position[0], (float)a->position[1], (float)a->position[2]};
    a->beside_heart = near_heart(m->basis, at);
    for (size_t i = 0; i < EXPECTED_POSES / 2 * 3 * modes; ++i) {
      const size_t pair = i / modes / 3;
      const size_t axis = i / modes % 3;
      const size_t k = i % modes;
      const supine_pose *pose = &m->pose[2 * pair];
      const double to =
          pose[0].gains[lung][axis] * supine_basis_lung_weights(m->basis, &pose[0], lung)[k];
      const double from =
          pose[1].gains[lung][axis] * supine_basis_lung_weights(m->basis, &pose[1], lung)[k];
      a->u[pair][axis] += mean[(3 * lung + axis) * modes + k] * (to - from);
    }
  }
}

/* Return the length of a displacement of a pair of poses that counts in the error: of all of it, or
 * of the part that a turn adds. After a fit of landmarks the error depends on how far these are,
 * and not on how far a vertex moves.
 * @param share  that of the vertex (supine_basis.error_share) */
static double length_of(const supine_expected_model *m, double u[EXPECTED_POSES / 2][3],
                        bool turned, double share) {
  double part[3];
  if (turned) {
    supine_subtract(u[0], u[2], part);
    return supine_length(part);
  }
  return m->basis->error_share != NULL ? m->rms * share : fmax(m->least, supine_length(u[0]));
}

/* Return V_i + V_h - 2 C_ih (supine_expected_relate), mm^2, for a vertex. If u_i and u_h have the
 * lengths `length` and `lengths`, mm, their variances are 4/3 c times these.
 * @param per_mm   squared error per mm of displacement of the term, c, mm
 * @param lengths  [anchors] */
static double relative_square(const supine_expected_model *m, double per_mm, size_t vertex,
                              double length, const double *lengths) {
  const supine_basis_info *info = supine_basis_get_info(m->basis);
  const float *p = supine_basis_vertices(m->basis) + 3 * vertex;
  const double at[3] = {(double)p[0], (double)p[1], (double)p[2]};
  const double count = (double)m->anchor_count;
  supine_kriging_model model = supine_kriging_default;
  model.sill = 4.0 / 3.0 * per_mm;
  model.least = 0.0;
  double square = model.sill * length;
  for (size_t j = 0; j < m->anchor_count; ++j) {
    const double *place = m->anchor[j].position;
    const bool same = vertex >= info->lung_begin[j] && vertex < info->lung_begin[j + 1];
    square -=
        3.0 * 2.0 / count * supine_kriging_covariance(&model, at, length, place, lengths[j], same);
    for (size_t k = 0; k < m->anchor_count; ++k) {
      square += 3.0 / count / count *
                supine_kriging_covariance(&model, place, lengths[j], m->anchor[k].position,
                                          lengths[k], j == k);
    }
  }
  return fmax(0, square);
}

/* Return the share of the error of a vertex after a fit of landmarks; 1 without one. */
static double share_of(const supine_expected_model *m, size_t vertex) {
  return m->basis->error_share != NULL ? (double)m->basis->error_share[vertex] : 1;
}

/* Return relative_square of a displacement, or of the part of it that a turn adds. */
static double relative_part(const supine_expected_model *m, double per_mm, bool turned,
                            size_t vertex, double u[EXPECTED_POSES / 2][3]) {
  double lengths[SUPINE_LUNGS_MAX];
  for (size_t j = 0; j < m->anchor_count; ++j) {
    supine_expected_anchor anchor = m->anchor[j];
    lengths[j] = length_of(m, anchor.u, turned, 1);
  }
  return relative_square(m, per_mm, vertex, length_of(m, u, turned, share_of(m, vertex)), lengths);
}

double supine_expected_day_square(const supine_expected_model *m, size_t vertex) {
  static const double square = SUPINE_ANOTHER_DAY_MM * SUPINE_ANOTHER_DAY_MM;
  double lengths[SUPINE_LUNGS_MAX];
  for (size_t j = 0; j < m->anchor_count; ++j) {
    lengths[j] = 1;
  }
  return m->anchor_count == 0 ? square : relative_square(m, square, vertex, 1, lengths);
}

/* Replace the squared errors of a vertex by those relative to the mean of the anchors. */
static void relate_squares(const supine_expected_model *m, size_t vertex,
                           double u[EXPECTED_POSES / 2][3], double beside_heart,
                           double square[SUPINE_EXPECTED_TERMS]) {
  double slope[3];
  double b = beside_heart;
  supine_subtract(u[1], u[0], slope);
  for (size_t j = 0; j < m->anchor_count; ++j) {
    const supine_expected_anchor *anchor = &m->anchor[j];
    b -= anchor->beside_heart / (double)m->anchor_count;
    for (size_t k = 0; k < 3; ++k) {
      slope[k] -= (anchor->u[1][k] - anchor->u[0][k]) / (double)m->anchor_count;
    }
  }
  square[SUPINE_EXPECTED_DISPLACEMENT] = relative_part(m, m->law, false, vertex, u);
  square[SUPINE_EXPECTED_TURN] = relative_part(m, m->turn, true, vertex, u);
  square[SUPINE_EXPECTED_VOLUME] = m->per_step * m->per_step * supine_dot(slope, slope);
  square[SUPINE_EXPECTED_HEART] = pow(EXPECTED_HEART * m->across * b, 2);
}

void supine_expected_evaluate(const supine_expected_model *m, size_t begin, size_t end,
                              supine_expected_block *b) {
  const float *vertices = supine_basis_vertices(m->basis);
  const bool used[EXPECTED_POSES / 2] = {true, m->per_step > 0, m->turn > 0};
  for (size_t k = 0; k < EXPECTED_POSES; ++k) {
    if (used[k / 2]) {
      (void)supine_displace_range(m->basis, &m->pose[k], begin, end, b->x[k]);
    } else {
      memset(b->x[k], 0, sizeof b->x[k]);
    }
  }
  for (size_t i = 0; i < end - begin; ++i) {
    double u[EXPECTED_POSES / 2][3];
    for (size_t j = 0; j < EXPECTED_POSES / 2 * 3; ++j) {
      const size_t at = 3 * i + j % 3;
      u[j / 3][j % 3] = (double)b->x[j / 3 * 2][at] - (double)b->x[j / 3 * 2 + 1][at];
    }
    const double beside_heart = near_heart(m->basis, vertices + 3 * (begin + i));
    supine_expected_squares(m, u, beside_heart, b->square[i]);
    if (m->basis->error_share != NULL) {
      b->square[i][SUPINE_EXPECTED_DISPLACEMENT] = m->law * m->rms * share_of(m, begin + i);
    }
    if (m->anchor_count > 0) {
      relate_squares(m, begin + i, u, beside_heart, b->square[i]);
    }
  }
  evaluate_collapse(m, begin, end, b);
}

void supine_expected_all(const supine_expected_model *m, float *sigma,
                         double mean[SUPINE_EXPECTED_TERMS]) {
  const size_t n = supine_basis_get_info(m->basis)->vertex_count;
  supine_expected_block block;
  memset(mean, 0, SUPINE_EXPECTED_TERMS * sizeof *mean);
  for (size_t begin = 0; begin < n; begin += LOCATE_BLOCK) {
    const size_t count = n - begin < LOCATE_BLOCK ? n - begin : LOCATE_BLOCK;
    supine_expected_evaluate(m, begin, begin + count, &block);
    for (size_t i = 0; i < count; ++i) {
      double square = 0;
      for (size_t k = 0; k < SUPINE_EXPECTED_TERMS; ++k) {
        square += block.square[i][k];
        mean[k] += block.square[i][k] / (double)n;
      }
      if (sigma != NULL) {
        sigma[begin + i] = (float)sqrt(square);
      }
    }
  }
}

static supine_status refuse_fields(const supine_basis *basis, supine_error *error) {
  if (supine_basis_get_info(basis)->is_fields) {
    return supine_error_set(
        error, SUPINE_ERROR_UNSUPPORTED,
        "the basis holds another simulator's displacements, whose error is unknown");
  }
  return SUPINE_OK;
}

/* Return whether two poses are the same state. */
static bool is_same(const supine_basis *basis, const supine_pose *a, const supine_pose *b) {
  const size_t count = supine_basis_weight_count(basis);
  double apart = 0;
  for (size_t i = 0; i < count; ++i) {
    apart = fmax(apart, fabs(a->weights[i] - b->weights[i]));
  }
  return apart == 0;
}

double supine_expected_along(size_t band, const double *harmonics, const double gravity[3],
                             double factor) {
  double y[(FIT_BAND_MAX + 2) * (FIT_BAND_MAX + 2)];
  const size_t count = supine_sh_count(band + 1);
  double square = 0;
  if (harmonics == NULL) {
    return 1;
  }
  (void)supine_sh_evaluate(band + 1, gravity, y); /* fails for no vector that has a direction */
  for (size_t row = 0; row < 2 * band + 4; ++row) {
    const double part = supine_dot_n(count, harmonics + row * count, y);
    square += (row == 0 ? 1 : factor) * part * part;
  }
  return sqrt(square);
}

/* Return the factor, at the volume of a pose, of the part of the squared error that depends on the
 * direction of gravity: by linear interpolation between those of the file. */
static double factor_at(const supine_basis *basis, const supine_pose *pose) {
  const double *range = basis->simulated.total;
  const double *factor = basis->error_volume;
  const double last = (double)basis->error_volume_count - 1;
  double volumes[SUPINE_LUNGS_MAX];
  double total = -supine_expected_reference(basis);
  if (factor == NULL) {
    return 1;
  }
  (void)supine_basis_volumes(basis, pose, volumes);
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    total += volumes[lung];
  }
  const double at = fmin(fmax((total - range[0]) / (range[1] - range[0]), 0), 1) * last;
  const size_t low = (size_t)fmin(at, last - 1);
  return factor[low] + (at - (double)low) * (factor[low + 1] - factor[low]);
}

/* Return the error of a fit to another simulator's fields in a state / that over all runs. */
static double relative_error(const supine_basis *basis, const double gravity[3],
                             const supine_pose *pose) {
  return supine_expected_along(basis->info.band, basis->error_gravity, gravity,
                               factor_at(basis, pose));
}

/* Write the errors of a fit to another simulator's fields. The errors of two states are taken as
 * independent; the surface of the scan has none.
 * @param from  NULL for the state of the scan */
static supine_status evaluate_fields(const supine_basis *basis, const supine_state *state,
                                     const supine_pose *pose, const supine_state *from,
                                     float *sigma, supine_error *error) {
  if (basis->vertex_error == NULL) {
    return refuse_fields(basis, error);
  }
  double factor = relative_error(basis, state->gravity, pose);
  if (from != NULL && !supine_basis_is_scan(basis, from)) {
    supine_pose other;
    SUPINE_TRY(supine_basis_pose(basis, from, &other, error));
    const double before = relative_error(basis, from->gravity, &other);
    factor = is_same(basis, pose, &other) ? 0 : hypot(factor, before);
  }
  for (size_t i = 0; i < basis->info.vertex_count; ++i) {
    sigma[i] = (float)(factor * (double)basis->vertex_error[i]);
  }
  return SUPINE_OK;
}

/* Compute what supine_expected_all writes. */
static supine_status evaluate_all(const supine_basis *basis, const supine_state *state,
                                  const supine_state *from, float *sigma,
                                  double mean[SUPINE_EXPECTED_TERMS], supine_error *error) {
  const supine_state scan = supine_basis_scan(basis);
  supine_expected_model model;
  const supine_status status =
      supine_expected_prepare(basis, state, from == NULL ? &scan : from, 0, 0, &model, error);
  if (status == SUPINE_OK) {
    supine_expected_all(&model, sigma, mean);
  }
  return status;
}

double supine_expected_another_day(double same_session) {
  return hypot(same_session, SUPINE_ANOTHER_DAY_MM);
}

supine_status supine_expected_error(const supine_basis *basis, const supine_state *state,
                                    const supine_state *from, float *sigma, supine_error *error) {
  double mean[SUPINE_EXPECTED_TERMS];
  supine_pose pose;
  SUPINE_TRY(supine_basis_pose(basis, state, &pose, error)); /* refuses impossible volumes */
  if (supine_basis_get_info(basis)->is_fields) {
    return evaluate_fields(basis, state, &pose, from, sigma, error);
  }
  return evaluate_all(basis, state, from, sigma, mean, error);
}

supine_status supine_expected_parts(const supine_basis *basis, const supine_state *state,
                                    const supine_state *from, supine_expected_part *parts,
                                    supine_error *error) {
  const char *own = supine_basis_metadata(basis, "expected_error_source");
  double mean[SUPINE_EXPECTED_TERMS];
  SUPINE_TRY(refuse_fields(basis, error));
  const supine_status status = evaluate_all(basis, state, from, NULL, mean, error);
  if (status == SUPINE_OK) {
    for (size_t k = 0; k < SUPINE_EXPECTED_TERMS; ++k) {
      const bool fitted = k == SUPINE_EXPECTED_DISPLACEMENT && own != NULL;
      parts[k] =
          (supine_expected_part){terms[k].name, fitted ? own : terms[k].source, sqrt(mean[k])};
    }
  }
  return status;
}
