/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Predict the lungs of a person in other states, and compare them with scans. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/remedy.h"
#include "base/vec3.h"
#include "precompute/inside/biharmonic.h"
#include "precompute/lungs/surface.h"
#include "precompute/patient/checks.h"
#include "precompute/validation/validation.h"

enum { MEASURED_VERTICES_MAX = 1500, GOLDEN_SECTION_STEPS = 24 };

/* The best factor of the displacement is sought within search_span * max(1, |s|) of the predicted
 * factor s. */
static const double search_span = 0.5;
static const double golden = 0.6180339887498949; /* (sqrt(5) - 1) / 2 */
static const double same_posture = 1e-9; /* gravity directions that differ by less count as equal */

void supine_validation_free(supine_validation *subject) {
  supine_mesh_free(&subject->start);
  supine_arena_free(&subject->arena);
}

supine_status supine_validation_begin(supine_validation *subject, supine_error *error) {
  supine_validation *s = subject;
  supine_pose pose;
  const bool scan = s->from.text[0] == '\0';
  if (scan) {
    s->from.state = supine_basis_scan(s->basis);
  }
  /* If the volume at rest is unknown, a state without a volume gets the volume of the scan. */
  if (s->from.state.volume.kind == SUPINE_VOLUME_DEFAULT &&
      !supine_basis_get_info(s->basis)->has_rest) {
    s->from.state.volume.kind = SUPINE_VOLUME_SCAN;
  }
  if (scan) {
    SUPINE_TRY(supine_basis_scan_pose(s->basis, &pose, error));
  } else {
    SUPINE_TRY(supine_basis_pose(s->basis, &s->from.state, &pose, error));
  }
  s->from_millilitres = supine_posed_volume(s->basis, &pose);
  s->from_scale = pose.gains[0][0];
  return supine_posed_mesh(s->basis, &pose, &s->start, error);
}

/* Compute the pose of a state or, if the state has no volume, of its posture and the volume of
 * `scan`, its scanned surface. */
static supine_status find_pose(const supine_validation *s, const supine_validation_state *state,
                               const supine_mesh *scan, supine_validation_outcome *outcome,
                               supine_error *error) {
  supine_state asked = state->state;
  if (asked.volume.kind == SUPINE_VOLUME_DEFAULT) {
    const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
        supine_remedy_such_as("to", "supine:rest", "")};
    SUPINE_REFUSE_ADVISE(scan == NULL, error, advice, SUPINE_ERROR_ARGUMENT,
                         "the volume of the other state is unknown, and landmarks do not give it");
    asked.volume = (supine_volume){SUPINE_VOLUME_ABSOLUTE, 1e-3 * supine_mesh_volume(scan)};
  }
  SUPINE_TRY(supine_basis_pose(s->basis, &asked, &outcome->pose, error));
  outcome->state = asked;
  outcome->scale = outcome->pose.gains[0][0];
  outcome->millilitres = supine_posed_volume(s->basis, &outcome->pose) - s->from_millilitres;
  return SUPINE_OK;
}

static supine_status predict_surface(supine_validation *s, const supine_validation_state *state,
                                     const supine_mesh *scan, supine_validation_outcome *outcome,
                                     supine_error *error) {
  const size_t n = s->start.vertex_count;
  outcome->nearest = supine_arena_take(&s->arena, n, 3 * sizeof(double));
  outcome->predicted = supine_arena_take(&s->arena, n, 3 * sizeof(double));
  SUPINE_TRY(supine_arena_check(&s->arena, error, "%zu vertices", n));
  SUPINE_TRY(find_pose(s, state, scan, outcome, error));
  return supine_posed_positions(s->basis, &outcome->pose, outcome->predicted, error);
}

supine_status supine_validation_check_landmarks(const supine_validation *subject,
                                                const supine_mesh *scan,
                                                const supine_patient_pairs *pairs,
                                                supine_findings *findings, supine_error *error) {
  static const double same_volume = 0.01;
  const supine_state shown = supine_basis_scan(subject->basis);
  supine_pose pose;
  SUPINE_TRY(supine_basis_scan_pose(subject->basis, &pose, error));
  const double scanned = supine_posed_volume(subject->basis, &pose);
  if (supine_distance(subject->from.state.gravity, shown.gravity) < same_posture &&
      fabs(scanned - subject->from_millilitres) <= same_volume * scanned) {
    SUPINE_TRY(supine_patient_check_landmarks("basis", &subject->start, pairs->count, pairs->from,
                                              findings, error));
  }
  if (scan != NULL) {
    SUPINE_TRY(
        supine_patient_check_landmarks("scan", scan, pairs->count, pairs->to, findings, error));
  }
  return SUPINE_OK;
}

/* Warn if a state that is named from rest does not fit the volume of its scan. */
static void check_rest(const supine_basis *basis, const supine_state *named, double held,
                       supine_findings *findings) {
  supine_state full = *named;
  supine_pose pose;
  full.volume = (supine_volume){SUPINE_VOLUME_FULL, 0.0};
  if (named->volume.kind == SUPINE_VOLUME_REST && named->lung_count == 0 &&
      supine_basis_pose(basis, &full, &pose, NULL) == SUPINE_OK) {
    const double share = (held - named->volume.ml) / supine_posed_volume(basis, &pose);
    (void)supine_patient_tell_rest(share, named->gravity, findings);
  }
}

void supine_validation_check_person(const supine_validation *subject, size_t i,
                                    const supine_lungs *scan, supine_findings *findings) {
  const supine_basis_info *info = supine_basis_get_info(subject->basis);
  supine_patient_size size[2] = {{.volume = {0.0}}, supine_patient_size_of(scan)};
  const double held = size[1].volume[0] + size[1].volume[1];
  supine_patient_check_volume(&subject->state[i].state.volume, held, findings);
  check_rest(subject->basis, &subject->state[i].state, held, findings);
  if (supine_distance(subject->state[i].state.gravity, subject->from.state.gravity) >=
      same_posture) {
    return;
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    supine_patient_size_add(&subject->start, info->lung_names[lung][0] == 'l' ? 1 : -1,
                            info->lung_begin[lung], info->lung_begin[lung + 1], &size[0]);
  }
  supine_patient_check_person(&size[0], &size[1], findings);
}

typedef struct search {
  const supine_lungs_surface *tree;
  size_t vertex_count, measured_count;
  double *positions; /* [N, 3] workspace: predicted positions, mm */
  double *distance;  /* [measured_count] distances from the scanned surface, mm */
} search;

/* Multiply all gains by one factor, so that the first gain becomes `scale`. Then compute the RMS
 * distance of the predicted vertices from the scanned surface, mm. */
static supine_status distance_at(const supine_validation *s,
                                 const supine_validation_outcome *outcome, double scale,
                                 const search *look, double *rms, supine_error *error) {
  supine_pose pose = outcome->pose;
  double *positions = look->positions;
  double sum = 0.0;
  if (outcome->scale == 0.0) {
    supine_pose_fill(&pose, scale);
  } else {
    for (size_t i = 0; i < 3 * SUPINE_LUNGS_MAX; ++i) {
      pose.gains[i / 3][i % 3] *= scale / outcome->scale;
    }
  }
  SUPINE_TRY(supine_posed_positions(s->basis, &pose, positions, error));
  for (size_t i = 0; i < look->measured_count; ++i) {
    memmove(positions + 3 * i, positions + 3 * (i * look->vertex_count / look->measured_count),
            3 * sizeof(double));
  }
  supine_lungs_surface_distances(look->tree, look->measured_count, positions, look->distance, NULL);
  for (size_t i = 0; i < look->measured_count; ++i) {
    sum += look->distance[i] * look->distance[i] / (double)look->measured_count;
  }
  *rms = sqrt(sum);
  return SUPINE_OK;
}

/* Find the displacement scale that brings the prediction nearest to the scan (golden section). */
static supine_status find_best(const supine_validation *s, const supine_mesh *scan,
                               supine_validation_outcome *outcome, supine_error *error) {
  const size_t n = s->start.vertex_count;
  SUPINE_ARENA arena = {0};
  SUPINE_FREED_BY(supine_lungs_surface_drop) supine_lungs_surface *tree = NULL;
  search look = {.vertex_count = n,
                 .measured_count = n < MEASURED_VERTICES_MAX ? n : MEASURED_VERTICES_MAX,
                 .positions = supine_arena_take(&arena, n, 3 * sizeof(double)),
                 .distance = supine_arena_take(&arena, n, sizeof(double))};
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_lungs_surface_create(scan->vertices, scan->triangle_count, scan->triangles,
                                         false, &tree, error));
  const double span = search_span * fmax(1.0, fabs(outcome->scale));
  double low = outcome->scale - span;
  double high = outcome->scale + span;
  look.tree = tree;
  for (int i = 0; i < GOLDEN_SECTION_STEPS; ++i) {
    const double a = high - golden * (high - low);
    const double b = low + golden * (high - low);
    double left[2] = {0};
    SUPINE_TRY(distance_at(s, outcome, a, &look, &left[0], error));
    SUPINE_TRY(distance_at(s, outcome, b, &look, &left[1], error));
    if (left[0] < left[1]) {
      high = b;
    } else {
      low = a;
    }
  }
  outcome->best_scale = 0.5 * (low + high);
  outcome->has_best = true;
  return distance_at(s, outcome, outcome->best_scale, &look, &outcome->best_rms, error);
}

void supine_validation_find_line(supine_validation *subject) {
  supine_validation *s = subject;
  double vv = 0.0;
  double vs = 0.0;
  double most = 0.0;
  double off = 0.0;
  s->line_count = 0;
  for (int pass = 0; pass < 2; ++pass) {
    for (size_t i = 0; i < s->count; ++i) {
      const supine_validation_outcome *of = &s->outcome[i];
      if (!of->has_best ||
          supine_distance(s->state[i].state.gravity, s->state[0].state.gravity) >= same_posture) {
        continue;
      }
      const double scale = of->best_scale - s->from_scale;
      if (pass == 0) {
        vv += of->millilitres * of->millilitres;
        vs += of->millilitres * scale;
        most = fmax(most, fabs(scale));
        ++s->line_count;
      } else {
        off = fmax(off, fabs(scale - s->line_slope * of->millilitres));
      }
    }
    s->line_slope = vv > 0.0 ? vs / vv : 0.0;
  }
  s->line_off = most > 0.0 ? off / most : 0.0;
}

/* Predict landmark positions [count, 3], mm, and then their squared expected errors [count], mm^2,
 * by biharmonic interpolation of those of the surface.
 * @param predicted  written, followed by workspace of the same size */
static supine_status predict_points(const supine_validation *s, size_t which,
                                    const supine_patient_pairs *pairs, double *predicted,
                                    supine_error *error) {
  enum { CENTRES = 1500 };
  const supine_validation_outcome *outcome = &s->outcome[which];
  const size_t n = s->start.vertex_count;
  SUPINE_FREED_BY(supine_inside_biharmonic_free) supine_inside_biharmonic fit = {0};
  const size_t count = pairs->count;
  SUPINE_FREED_BY(supine_posed_expected_free) supine_expected expected = {0};
  SUPINE_ARENA arena = {0};
  double *values = supine_arena_take(&arena, n, 4 * sizeof *values);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_posed_expected(s->basis, &outcome->state, &s->from.state, &expected, error));
  for (size_t i = 0; i < 4 * n; ++i) {
    const size_t vertex = i / 4;
    const size_t k = 3 * vertex + i % 4;
    if (i % 4 < 3) {
      values[i] = outcome->predicted[k] - s->start.vertices[k];
    } else if (expected.sigma != NULL) {
      values[i] = (double)expected.sigma[vertex] * (double)expected.sigma[vertex];
    } else {
      values[i] = 0.0;
    }
  }
  SUPINE_TRY(supine_inside_biharmonic_fit(n, s->start.vertices, 4, values, CENTRES, &fit, error));
  supine_inside_biharmonic_evaluate(&fit, pairs->count, pairs->from, predicted + 4 * count);
  for (size_t i = 0; i < 4 * count; ++i) {
    const size_t k = 3 * (i / 4) + i % 4;
    predicted[i % 4 < 3 ? k : 3 * count + i / 4] =
        predicted[4 * count + i] + (i % 4 < 3 ? pairs->from[k] : 0.0);
  }
  return SUPINE_OK;
}

static supine_status check_points(const supine_validation *s, const supine_patient_pairs *pairs,
                                  supine_error *error) {
  double low[3];
  double high[3];
  size_t outside = 0;
  supine_mesh_box(&s->start, low, high);
  for (size_t i = 0; i < pairs->count; ++i) {
    const double *p = pairs->from + 3 * i;
    outside += p[0] < low[0] || p[0] > high[0] || p[1] < low[1] || p[1] > high[1] ||
               p[2] < low[2] || p[2] > high[2];
  }
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
      supine_remedy_set("reverse", "if first and second points are exchanged")};
  SUPINE_REFUSE_ADVISE(2 * outside > pairs->count, error, advice, SUPINE_ERROR_FORMAT,
                       "%zu of %zu landmarks lie outside the lungs' bounding box: check their "
                       "frame, unit and patient",
                       outside, pairs->count);
  return SUPINE_OK;
}

static supine_status validate_points(supine_validation *s, size_t which,
                                     const supine_patient_pairs *pairs, supine_error *error) {
  SUPINE_ARENA arena = {0};
  double *predicted = supine_arena_take(&arena, pairs->count, 8 * sizeof *predicted);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu landmarks", pairs->count));
  SUPINE_TRY(supine_patient_pairs_check(pairs, s->moved != SUPINE_PATIENT_STILL, error));
  SUPINE_TRY(check_points(s, pairs, error));
  if (s->from_millilitres > 0.0) {
    const double growth = 1.0 + s->outcome[which].millilitres / s->from_millilitres;
    SUPINE_TRY(supine_patient_check_order(pairs, growth, error));
  }
  SUPINE_TRY(predict_points(s, which, pairs, predicted, error));
  s->outcome[which].has_points = true;
  return supine_validation_points(pairs, predicted, predicted + 3 * pairs->count, s->moved,
                                  s->outcome[which].points, error);
}

supine_status supine_validation_compare(supine_validation *subject, size_t i,
                                        const supine_mesh *scan, const supine_patient_pairs *pairs,
                                        supine_error *error) {
  supine_validation *s = subject;
  supine_validation_outcome *outcome = &s->outcome[i];
  SUPINE_TRY(predict_surface(s, &s->state[i], scan, outcome, error));
  if (pairs != NULL) {
    SUPINE_TRY(validate_points(s, i, pairs, error));
  }
  if (scan == NULL) {
    return SUPINE_OK;
  }
  /* Compare surfaces last, as this changes outcome->predicted. */
  outcome->has_surface = true;
  SUPINE_TRY(supine_validation_surfaces(&s->start, s->moved, outcome->predicted, scan,
                                        outcome->nearest, outcome->surface, error));
  return s->count > 1 ? find_best(s, scan, outcome, error) : SUPINE_OK;
}
