/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Register a state at points of the scan, and find the errors that are left after it. */
#include <math.h>
#include <string.h>

#include <supine/doubt.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "mesh/io/points.h"

#include "program/options/command.h"
#include "program/options/fiducials.h"

/* Largest distance of a point from the vertex that stands for it, mm. */
static const double same_place = 1.0;

static supine_status read_frame(const char *text, void *field, supine_error *error) {
  supine_frame *frame = field;
  *frame = (supine_frame){.hilum = strcmp(text, "hilum") == 0};
  if (!frame->hilum && strcmp(text, "body") != 0) {
    SUPINE_REFUSE_IF(!supine_io_points_named(text), error, SUPINE_ERROR_ARGUMENT,
                     "'%s' is neither body nor hilum nor a file of points: give one of these",
                     text);
    frame->points = text;
  }
  return SUPINE_OK;
}

const supine_option supine_options_fiducials_frame[] = {
    {"frame", 0, "body|hilum|POINTS",
     "what stays in place: the body (spine, apex and back wall); the hilum, whose displacement is "
     "then subtracted, as bronchoscopy registers the airways there; or the points of a file "
     "(name,x,y,z in the scan, each a vertex of the basis, as made by 'supine embed'), to whose "
     "places in the scan all positions are moved rigidly, as a navigation system registers",
     .size = sizeof(supine_frame), .read = read_frame, .standard = "body"},
    {.name = NULL}};

/* Find the vertex at the place of each point in the scan. */
static supine_status find_vertices(const char *path, const supine_basis *basis,
                                   const supine_io_points *points, const float *scan,
                                   size_t *vertices, supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  for (size_t j = 0; j < points->count; ++j) {
    double nearest = INFINITY;
    for (size_t i = 0; i < n; ++i) {
      double square = 0.0;
      for (size_t k = 0; k < 3; ++k) {
        square += pow(points->at[3 * j + k] - (double)scan[3 * i + k], 2.0);
      }
      if (square < nearest) {
        nearest = square;
        vertices[j] = i;
      }
    }
    SUPINE_REFUSE_IF(nearest > same_place * same_place, error, SUPINE_ERROR_FORMAT,
                     "%s: point '%s' is no vertex of the basis: the nearest is %.1f mm away. Embed "
                     "the points of the frame with the targets: supine embed BASIS TARGETS %s",
                     path, points->names[j], sqrt(nearest), path);
  }
  return SUPINE_OK;
}

/* Register one state, and write the motion and the errors that remain; both may be NULL. */
static supine_status fit(const supine_doubt_task *task, size_t count, const size_t *vertices,
                         supine_motion *motion, float *sigma, supine_error *error) {
  SUPINE_ARENA arena = {0};
  double *space = supine_arena_take(&arena, supine_doubt_space(task->basis, 1), sizeof *space);
  double *more = supine_arena_take(&arena, supine_doubt_frame_space(task->basis, count), sizeof *more);
  const supine_doubt *doubt = NULL;
  const supine_doubt_frame *frame = NULL;
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu points", count));
  SUPINE_TRY(supine_doubt_prepare(task, space, &doubt, error));
  SUPINE_TRY(supine_doubt_frame_prepare(doubt, count, vertices, more, &frame, error));
  if (motion != NULL) {
    supine_doubt_frame_motion(frame, motion->rotation, motion->translation);
  }
  return sigma == NULL ? SUPINE_OK
                       : supine_doubt_frame_errors(
                             frame, 0, supine_basis_get_info(task->basis)->vertex_count, sigma);
}

static supine_status register_states(const supine_basis *basis, size_t count,
                                     const size_t *vertices, const supine_state *states[2],
                                     supine_errors *errors, supine_motion motion[2],
                                     supine_error *error) {
  supine_doubt_task task = {.basis = basis, .state_count = 1, .states = states[0]};
  SUPINE_TRY(fit(&task, count, vertices, &motion[0], errors->position.sigma, error));
  task.another_day = true;
  SUPINE_TRY(fit(&task, count, vertices, NULL, errors->position.another, error));
  task =
      (supine_doubt_task){.basis = basis, .state_count = 1, .states = states[0], .from = states[1]};
  SUPINE_TRY(fit(&task, count, vertices, NULL, errors->moved.sigma, error));
  task.from = NULL;
  task.states = states[1];
  return fit(&task, count, vertices, &motion[1], NULL, error);
}

supine_status supine_options_fiducials(const char *path, const supine_basis *basis,
                                       const supine_state *states[2], supine_errors *errors,
                                       supine_motion motion[2], supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  SUPINE_FREED_BY(supine_io_points_free) supine_io_points points = {0};
  SUPINE_ARENA arena = {0};
  supine_pose scan;
  supine_error reason;
  SUPINE_TRY(supine_io_points_read(path, NULL, &points, error));
  float *xyz = supine_arena_take(&arena, 3 * n, sizeof *xyz);
  size_t *vertices = supine_arena_take(&arena, points.count, sizeof *vertices);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_basis_scan_pose(basis, &scan, error));
  (void)supine_deform(basis, &scan, xyz);
  SUPINE_TRY(find_vertices(path, basis, &points, xyz, vertices, error));
  const supine_status status =
      register_states(basis, points.count, vertices, states, errors, motion, &reason);
  if (status == SUPINE_ERROR_ARGUMENT) { /* the file does not determine the motion */
    (void)supine_error_wrap(error, &reason, "%s: ", path);
    return error->status = SUPINE_ERROR_FORMAT;
  }
  if (status != SUPINE_OK) {
    *error = reason;
    return status;
  }
  supine_posed_expected_measure(n, &errors->position);
  supine_posed_expected_measure(n, &errors->moved);
  return SUPINE_OK;
}

void supine_options_fiducials_move(const supine_motion *motion, double at[3]) {
  const double x[3] = {at[0], at[1], at[2]};
  for (size_t k = 0; k < 3; ++k) {
    const double *row = motion->rotation + 3 * k;
    at[k] = row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + motion->translation[k];
  }
}

void supine_options_fiducials_target(const supine_motion motion[2], supine_target *target) {
  double before[3];
  for (size_t k = 0; k < 3; ++k) {
    before[k] = target->at[k] - target->move[k];
  }
  supine_options_fiducials_move(&motion[0], target->at);
  supine_options_fiducials_move(&motion[1], before);
  for (size_t k = 0; k < 3; ++k) {
    target->move[k] = target->at[k] - before[k];
  }
  target->moved = supine_length(target->move);
}
