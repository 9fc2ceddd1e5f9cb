/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Predict the lungs of a person in other states, and compare them with scans. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/options/model_options.h"
#include "program/validation.h"

#include "precompute/inside/biharmonic.h"
#include "precompute/lungs/surface.h"
#include "program/options/basis_input.h"

enum { MEASURED_VERTICES_MAX = 1500, GOLDEN_SECTION_STEPS = 24 };

/* The best factor of the displacement is sought within search_span * max(1, |s|) of the predicted
 * factor s. */
static const double search_span = 0.5;
static const double golden = 0.6180339887498949; /* (sqrt(5) - 1) / 2 */
static const double same_posture = 1e-9; /* gravity directions that differ by less count as equal */

void supine_command_subject_free(supine_command_subject *subject) {
  supine_basis_close(subject->basis);
  supine_mesh_free(&subject->start);
  for (size_t i = 0; i < SUPINE_COMMAND_STATES_MAX; ++i) {
    free(subject->outcome[i].predicted);
    free(subject->outcome[i].nearest);
  }
}

static bool same_direction(const double a[3], const double b[3]) {
  double off = 0.0;
  for (int k = 0; k < 3; ++k) {
    off = fmax(off, fabs(a[k] - b[k]));
  }
  return off < same_posture;
}

/* Compute the positions of all vertices in a pose, [N, 3]; the caller frees them. */
static supine_status deform(const supine_basis *basis, const supine_pose *pose, double **positions,
                            supine_error *error) {
  *positions = supine_options_basis_positions(basis, pose);
  return *positions != NULL
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices",
                                supine_basis_get_info(basis)->vertex_count);
}

supine_status supine_command_subject_open(const char *path, supine_command_subject *subject,
                                          supine_error *error) {
  supine_command_subject *s = subject;
  supine_pose pose;
  supine_status status = supine_options_basis_open(path, SUPINE_STORAGE_AUTO, &s->basis, error);
  if (status != SUPINE_OK) {
    return status;
  }
  if (s->from.text[0] == '\0') {
    s->from.state = supine_basis_scan(s->basis);
  }
  /* If the volume at rest is unknown, a state without a volume gets the volume of the scan. */
  if (s->from.state.volume.kind == SUPINE_VOLUME_DEFAULT &&
      !supine_basis_get_info(s->basis)->has_rest) {
    s->from.state.volume.kind = SUPINE_VOLUME_SCAN;
  }
  status = supine_basis_pose(s->basis, &s->from.state, &pose, error);
  if (status == SUPINE_OK) {
    s->from_millilitres = supine_options_basis_volume(s->basis, &pose);
    s->from_scale = pose.gains[0][0];
    status = supine_options_basis_mesh(s->basis, &pose, &s->start, error);
  }
  return status;
}

/* Compute the gains (factors on the displacement of each lung) that give the volume of a state or,
 * if the state has no volume, the volume of `mesh`, its scanned surface. */
static supine_status find_gains(const supine_command_subject *s, const supine_command_state *state,
                                const supine_mesh *mesh, supine_command_outcome *outcome,
                                supine_error *error) {
  supine_state asked = state->state;
  if (asked.volume.kind == SUPINE_VOLUME_DEFAULT) {
    if (mesh->vertex_count == 0) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "the volume of the other state is unknown, and landmarks do not give "
                              "it: give --to POSTURE:VOLUME");
    }
    asked.volume = (supine_volume){SUPINE_VOLUME_ABSOLUTE, 1e-3 * supine_mesh_volume(mesh)};
  }
  const supine_status status = supine_basis_gains(s->basis, &asked, &outcome->pose, error);
  outcome->state = asked;
  if (status == SUPINE_OK) {
    outcome->scale = outcome->pose.gains[0][0];
    outcome->millilitres =
        supine_options_basis_volume(s->basis, &outcome->pose) - s->from_millilitres;
  }
  return status;
}

static supine_status predict_surface(const supine_command_subject *s,
                                     const supine_command_state *state, const supine_mesh *mesh,
                                     supine_command_outcome *outcome, supine_error *error) {
  const size_t n = s->start.vertex_count;
  outcome->nearest = malloc(3 * n * sizeof(double));
  supine_status status =
      outcome->nearest != NULL
          ? supine_basis_weights(s->basis, state->state.gravity, outcome->pose.weights)
          : supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  if (status == SUPINE_OK) {
    status = find_gains(s, state, mesh, outcome, error);
  }
  if (status == SUPINE_OK) {
    status = deform(s->basis, &outcome->pose, &outcome->predicted, error);
  }
  return status;
}

typedef struct search {
  const supine_inside_surface *tree;
  size_t vertex_count, measured_count;
  double *distance; /* [measured_count] distances from the scanned surface, mm */
} search;

/* Multiply all gains by one factor, so that the first gain becomes `scale`. Then compute the RMS
 * distance of the predicted vertices from the scanned surface, mm. */
static supine_status distance_at(const supine_command_subject *s,
                                 const supine_command_outcome *outcome, double scale,
                                 const search *look, double *rms, supine_error *error) {
  supine_pose pose = outcome->pose;
  double *positions = NULL;
  double sum = 0.0;
  for (size_t i = 0; i < 3 * SUPINE_LUNGS_MAX; ++i) {
    pose.gains[i / 3][i % 3] *= outcome->scale != 0.0 ? scale / outcome->scale : 0.0;
  }
  if (outcome->scale == 0.0) {
    supine_pose_fill(&pose, scale);
  }
  const supine_status status = deform(s->basis, &pose, &positions, error);
  if (status != SUPINE_OK) {
    return status;
  }
  for (size_t i = 0; i < look->measured_count; ++i) {
    memmove(positions + 3 * i, positions + 3 * (i * look->vertex_count / look->measured_count),
            3 * sizeof(double));
  }
  supine_inside_surface_distances(look->tree, look->measured_count, positions, look->distance,
                                  NULL);
  for (size_t i = 0; i < look->measured_count; ++i) {
    sum += look->distance[i] * look->distance[i] / (double)look->measured_count;
  }
  *rms = sqrt(sum);
  free(positions);
  return SUPINE_OK;
}

/* Find the displacement scale that brings the prediction nearest to the scan (golden section). */
static supine_status find_best(const supine_command_subject *s, const supine_mesh *mesh,
                               supine_command_outcome *outcome, supine_error *error) {
  const size_t n = s->start.vertex_count;
  search look = {.vertex_count = n,
                 .measured_count = n < MEASURED_VERTICES_MAX ? n : MEASURED_VERTICES_MAX};
  look.distance = malloc(look.measured_count * sizeof(double));
  supine_inside_surface *tree = NULL;
  supine_status status =
      look.distance == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n)
          : supine_inside_surface_create(mesh->vertices, mesh->triangle_count, mesh->triangles,
                                         false, &tree, error);
  const double span = search_span * fmax(1.0, fabs(outcome->scale));
  double low = outcome->scale - span;
  double high = outcome->scale + span;
  look.tree = tree;
  for (int i = 0; i < GOLDEN_SECTION_STEPS && status == SUPINE_OK; ++i) {
    const double a = high - golden * (high - low);
    const double b = low + golden * (high - low);
    double left[2] = {0};
    status = distance_at(s, outcome, a, &look, &left[0], error);
    if (status == SUPINE_OK) {
      status = distance_at(s, outcome, b, &look, &left[1], error);
    }
    *(left[0] < left[1] ? &high : &low) = left[0] < left[1] ? b : a;
  }
  if (status == SUPINE_OK) {
    outcome->best_scale = 0.5 * (low + high);
    outcome->has_best = true;
    status = distance_at(s, outcome, outcome->best_scale, &look, &outcome->best_rms, error);
  }
  supine_inside_surface_destroy(tree);
  free(look.distance);
  return status;
}

void supine_command_find_line(supine_command_subject *subject) {
  supine_command_subject *s = subject;
  double vv = 0.0;
  double vs = 0.0;
  double most = 0.0;
  double off = 0.0;
  s->line_count = 0;
  for (int pass = 0; pass < 2; ++pass) {
    for (size_t i = 0; i < s->count; ++i) {
      const supine_command_outcome *of = &s->outcome[i];
      if (!of->has_best || !same_direction(s->state[i].state.gravity, s->state[0].state.gravity)) {
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
static supine_status predict_points(const supine_command_subject *s, size_t which,
                                    const supine_patient_pairs *pairs, double *predicted,
                                    supine_error *error) {
  enum { CENTRES = 1500 };
  const supine_command_outcome *outcome = &s->outcome[which];
  const size_t n = s->start.vertex_count;
  supine_inside_biharmonic fit = {0};
  const size_t count = pairs->count;
  supine_expected expected = {0};
  double *values = calloc(4 * n, sizeof *values);
  supine_status status =
      values == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n)
                     : supine_options_expected_find(s->basis, &outcome->state, &s->from.state,
                                                    &expected, error);
  for (size_t i = 0; i < 4 * n && status == SUPINE_OK; ++i) {
    const size_t k = 3 * (i / 4) + i % 4;
    values[i] = i % 4 < 3 ? outcome->predicted[k] - s->start.vertices[k]
                : expected.sigma != NULL
                    ? (double)expected.sigma[i / 4] * (double)expected.sigma[i / 4]
                    : 0.0;
  }
  if (status == SUPINE_OK) {
    status = supine_inside_biharmonic_fit(n, s->start.vertices, 4, values, CENTRES, &fit, error);
  }
  if (status == SUPINE_OK) {
    supine_inside_biharmonic_evaluate(&fit, pairs->count, pairs->from, predicted + 4 * count);
  }
  for (size_t i = 0; i < 4 * count && status == SUPINE_OK; ++i) {
    const size_t k = 3 * (i / 4) + i % 4;
    predicted[i % 4 < 3 ? k : 3 * count + i / 4] =
        predicted[4 * count + i] + (i % 4 < 3 ? pairs->from[k] : 0.0);
  }
  supine_inside_biharmonic_free(&fit);
  supine_options_expected_free(&expected);
  free(values);
  return status;
}

static supine_status check_points(const supine_command_subject *s,
                                  const supine_patient_pairs *pairs, supine_error *error) {
  double low[3];
  double high[3];
  size_t outside = 0;
  supine_mesh_box(&s->start, low, high);
  for (size_t i = 0; i < pairs->count; ++i) {
    const double *p = pairs->from + 3 * i;
    outside += p[0] < low[0] || p[0] > high[0] || p[1] < low[1] || p[1] > high[1] ||
               p[2] < low[2] || p[2] > high[2];
  }
  return 2 * outside <= pairs->count
             ? SUPINE_OK
             : supine_error_set(
                   error, SUPINE_ERROR_FORMAT,
                   "%zu of %zu landmarks lie outside the lungs' bounding box: check "
                   "their frame, unit and patient, or exchange first and second points by "
                   "--reverse",
                   outside, pairs->count);
}

static supine_status validate_points(supine_command_subject *s, size_t which, const char *path,
                                     bool reverse, supine_error *error) {
  supine_patient_pairs pairs = {0};
  double *predicted = NULL;
  supine_status status = supine_patient_pairs_load(path, reverse, &pairs, error);
  if (status == SUPINE_OK) {
    status = supine_patient_pairs_check(&pairs, s->moved != SUPINE_PATIENT_STILL, error);
  }
  if (status == SUPINE_OK) {
    status = check_points(s, &pairs, error);
  }
  if (status == SUPINE_OK) {
    predicted = malloc(8 * pairs.count * sizeof *predicted);
    status = predicted == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY,
                                                  "no memory for %zu landmarks", pairs.count)
                               : predict_points(s, which, &pairs, predicted, error);
  }
  if (status == SUPINE_OK) {
    status = supine_command_compare_points(&pairs, predicted, predicted + 3 * pairs.count, s->moved,
                                           s->outcome[which].points, error);
    s->outcome[which].has_points = true;
  }
  free(predicted);
  supine_patient_pairs_free(&pairs);
  return status;
}

supine_status supine_command_validate_state(supine_command_subject *subject, size_t i,
                                            const supine_source_options *source,
                                            const char *landmarks, bool reverse,
                                            supine_error *error) {
  supine_command_subject *s = subject;
  const supine_command_state *state = &s->state[i];
  supine_command_outcome *outcome = &s->outcome[i];
  supine_lungs lungs = {0};
  supine_status status = state->path == NULL ? SUPINE_OK
                                             : supine_command_load_lungs("validate", state->path,
                                                                         source, &lungs, error);
  if (status == SUPINE_OK) {
    status = predict_surface(s, state, &lungs.mesh, outcome, error);
  }
  if (status == SUPINE_OK && landmarks != NULL) {
    status = validate_points(s, i, landmarks, reverse, error);
  }
  /* Compare surfaces last, as this changes outcome->predicted. */
  if (status == SUPINE_OK && state->path != NULL) {
    status = supine_command_compare_surfaces(&s->start, s->moved, outcome->predicted, &lungs.mesh,
                                             outcome->nearest, outcome->surface, error);
    outcome->has_surface = true;
  }
  if (status == SUPINE_OK && state->path != NULL && s->count > 1) {
    status = find_best(s, &lungs.mesh, outcome, error);
  }
  supine_lungs_free(&lungs);
  return status;
}
