/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute a breath frame by frame, and write the frames. */
#include <gsl/gsl_statistics.h>
#include <string.h>

#include <supine/safetensors.h>

#include "base/arena.h"
#include "base/clock.h"
#include "base/text.h"
#include "mesh/mesh.h"

#include "program/command/breath_frames.h"
#include "program/options/basis_input.h"
#include "program/options/facts.h"

static const char name[] = "breathe";

static const double budget = 15e-3; /* longest compute time allowed for one frame, s */

/* A breath, and the memory for its frames. */
typedef struct playing {
  const supine_command_breath_frames *wanted;
  const supine_basis *basis;
  size_t lung_count;
  double *time;        /* [frames] time since the start, s */
  supine_state *state; /* [frames] */
  double *gravity;     /* [frames, 3] unit vectors */
  /* [frames] expected errors, RMS over the vertices, mm: of the displacements, and of the positions
   * in the session of the scan and on another day */
  double *moved_error, *expected_error, *another_day_error;
  double *volumes;  /* [frames, lungs] volume of gas and tissue, mL */
  double *total;    /* [frames] sum of `volumes` over the lungs, mL */
  supine_mesh mesh; /* triangles; for VTP output, also the positions of the current frame */
  float *normals;   /* [N, 3] normals of the current frame, for VTP output */
  float *positions; /* [N, 3] current frame, mm; followed by all frames unless the output is VTP */
  double *compute_time; /* [frames] s */
  double *origin;       /* [N, 3] positions from which displacements are measured, mm */
  char vtp_comment[512 + SUPINE_CAVEATS_SIZE];
  char caveats[SUPINE_CAVEATS_SIZE]; /* what the basis assumes */
  supine_progress progress;
  supine_arena arena;
} playing;

static void end(playing *p) {
  supine_options_progress_end(&p->progress);
  supine_arena_free(&p->arena);
  supine_mesh_free(&p->mesh);
}

/* Allocate memory for the frames. If `one` is true, keep the positions of one frame only, as each
 * is written before the next is computed. */
static supine_status begin_frames(playing *p, bool one, supine_error *error) {
  const size_t count = p->wanted->breath.count;
  const size_t frame = 3 * supine_basis_get_info(p->basis)->vertex_count;
  p->lung_count = supine_basis_get_info(p->basis)->lung_count;
  p->time = supine_arena_take(&p->arena, count, sizeof *p->time);
  p->state = supine_arena_take(&p->arena, count, sizeof *p->state);
  p->gravity = supine_arena_take(&p->arena, count, 3 * sizeof *p->gravity);
  p->volumes = supine_arena_take(&p->arena, count, p->lung_count * sizeof *p->volumes);
  p->total = supine_arena_take(&p->arena, count, sizeof *p->total);
  p->moved_error = supine_arena_take(&p->arena, count, sizeof *p->moved_error);
  p->expected_error = supine_arena_take(&p->arena, count, sizeof *p->expected_error);
  p->another_day_error = supine_arena_take(&p->arena, count, sizeof *p->another_day_error);
  p->compute_time = supine_arena_take(&p->arena, count, sizeof *p->compute_time);
  p->origin = supine_arena_take(&p->arena, frame, sizeof *p->origin);
  p->normals = supine_arena_take(&p->arena, frame, sizeof *p->normals);
  p->positions = supine_arena_take(&p->arena, one ? 1 : 1 + count, frame * sizeof *p->positions);
  return p->arena.failed
             ? supine_error_memory(
                   error,
                   "%zu frames of %zu vertices: lower --seconds or --fps, or write a .vtp file",
                   count, frame / 3)
             : supine_posed_mesh(p->basis, NULL, &p->mesh, error);
}

/* Compute the time, the direction of gravity and the volumes of each frame. */
static supine_status find_volumes(playing *p, supine_error *error) {
  SUPINE_TRY(
      supine_options_breath_list(p->basis, name, &p->wanted->breath, p->time, p->state, error));
  for (size_t t = 0; t < p->wanted->breath.count; ++t) {
    supine_pose pose;
    (void)supine_basis_pose(p->basis, &p->state[t], &pose, NULL);
    memcpy(p->gravity + 3 * t, p->state[t].gravity, 3 * sizeof *p->gravity);
    (void)supine_basis_volumes(p->basis, &pose, p->volumes + t * p->lung_count);
    p->total[t] = supine_posed_volume(p->basis, &pose);
  }
  return SUPINE_OK;
}

static void report(const playing *p) {
  double least;
  double largest;
  gsl_stats_minmax(&least, &largest, p->total, 1, p->wanted->breath.count);
  const double median = gsl_stats_median(p->compute_time, 1, p->wanted->breath.count);
  const double longest = gsl_stats_max(p->compute_time, 1, p->wanted->breath.count);
  supine_options_line("%s: %zu frame%s, %.2f s at %.4g a second; volumes of %.2f to %.2f mL\n",
                      p->wanted->path, p->wanted->breath.count,
                      p->wanted->breath.count == 1 ? "" : "s", p->time[p->wanted->breath.count - 1],
                      p->wanted->breath.fps, least, largest);
  supine_options_line("compute time per frame: median %.3f ms, longest %.3f ms, allowed %.0f ms\n",
                      1e3 * median, 1e3 * longest, 1e3 * budget);
  SUPINE_ADD_RESULT(json_pack(
      "{s:o, s:I, s:f, s:[f, f], s:f, s:f}", "file", supine_options_json_text(p->wanted->path),
      "frames", (json_int_t)p->wanted->breath.count, "frames_per_second", p->wanted->breath.fps,
      "volume_ml", least, largest, "median_compute_ms", 1e3 * median, "longest_compute_ms",
      1e3 * longest));
}

/* Compute frame t into p->positions. Call find_volumes first: it checks that each frame has a valid
 * pose. */
static supine_status play(playing *p, size_t t, supine_error *error) {
  supine_pose pose;
  const double start = supine_clock_seconds();
  (void)supine_basis_pose(p->basis, &p->state[t], &pose, NULL);
  (void)supine_deform(p->basis, &pose, p->positions);
  p->compute_time[t] = supine_clock_seconds() - start;
  const bool goes_on =
      supine_options_progress_step(&p->progress, (double)(t + 1) / (double)p->wanted->breath.count);
  SUPINE_REFUSE_IF(!goes_on, error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
  return SUPINE_OK;
}

/* Compute frame t with its normals, for VTP. */
static supine_status next_frame(void *context, size_t t, supine_error *error) {
  playing *p = context;
  SUPINE_TRY(play(p, t, error));
  for (size_t i = 0; i < 3 * p->mesh.vertex_count; ++i) {
    p->mesh.vertices[i] = (double)p->positions[i];
  }
  supine_normals(p->basis, p->positions, p->normals);
  return SUPINE_OK;
}

/* Compute the expected errors of each frame, whose displacements are from the state `from`. Set
 * `known` to false for a basis without expected errors. */
static supine_status find_expected(const playing *p, const supine_state *from, bool *known,
                                   supine_error *error) {
  *known = true;
  for (size_t t = 0; t < p->wanted->breath.count && *known; ++t) {
    SUPINE_FREED_BY(supine_posed_errors_free) supine_errors errors = {.moved = {0}};
    SUPINE_TRY(supine_posed_errors(p->basis, &p->state[t], from, &errors, error));
    *known = errors.moved.sigma != NULL;
    p->moved_error[t] = errors.moved.rms;
    p->expected_error[t] = errors.position.rms;
    p->another_day_error[t] = errors.position.another_rms;
  }
  return SUPINE_OK;
}

/* Compute the frames, and write them as VTP.
 * @param save  axes, unit and comment of the output; the other options are set here */
static supine_status write_vtp(playing *p, const supine_state *from, supine_mesh_save_options save,
                               supine_error *error) {
  const supine_tensor *lung = supine_basis_tensor(p->basis, "lung");
  const supine_mesh_field fields[] = {{"gravity_LPS", 3, p->gravity},
                                      {"volume_mL", p->lung_count, p->volumes},
                                      {"moved_error_RMS_mm", 1, p->moved_error},
                                      {"expected_error_RMS_mm", 1, p->expected_error},
                                      {"another_day_error_RMS_mm", 1, p->another_day_error}};
  const supine_mesh_frames frames = {p->wanted->breath.count, p->time, next_frame, p};
  bool known;
  SUPINE_TRY(find_expected(p, from, &known, error));
  save.from = p->origin;
  save.normals = p->normals;
  save.lung = lung == NULL ? NULL : lung->data;
  save.fields = fields;
  save.field_count = known ? 5 : 2;
  return supine_mesh_save_frames(p->wanted->path, &p->mesh, &save, &frames, error);
}

static supine_status write_tensors(playing *p, supine_error *error) {
  const size_t t = p->wanted->breath.count;
  const size_t frame = 3 * p->mesh.vertex_count;
  const supine_tensor tensors[] = {
      {"positions", SUPINE_F32, 3, {t, p->mesh.vertex_count, 3}, p->positions + frame},
      {"triangles", SUPINE_U32, 2, {p->mesh.triangle_count, 3}, p->mesh.triangles},
      {"time", SUPINE_F64, 1, {t}, p->time},
      {"volume", SUPINE_F64, 2, {t, p->lung_count}, p->volumes},
      {"gravity", SUPINE_F64, 2, {t, 3}, p->gravity}};
  const supine_metadata metadata[] = {{"format", "supine-breath"},
                                      {"version", "1"},
                                      {"units", "mm, s, mL (gas and tissue of each lung)"},
                                      {"axes", "LPS"},
                                      {"caveats", p->caveats},
                                      {"made_by", p->wanted->made_by}};
  for (size_t i = 0; i < t; ++i) {
    SUPINE_TRY(play(p, i, error));
    memcpy(p->positions + (1 + i) * frame, p->positions, frame * sizeof *p->positions);
  }
  return supine_safetensors_write(p->wanted->path, tensors, sizeof tensors / sizeof *tensors,
                                  metadata, sizeof metadata / sizeof *metadata, error);
}

supine_status supine_command_breath_write(const supine_command_breath_frames *wanted,
                                          const supine_basis *basis, supine_error *error) {
  SUPINE_FREED_BY(end) playing p = {.wanted = wanted, .basis = basis};
  const bool tensors = supine_text_ends_in(wanted->path, ".safetensors");
  supine_mesh_save_options save = {.comment = p.vtp_comment};
  supine_options_reference_pose from;
  SUPINE_TRY(supine_options_basis_frame(basis, wanted->as_scanned, &save, error));
  SUPINE_TRY(begin_frames(&p, !tensors, error));
  SUPINE_TRY(find_volumes(&p, error));
  SUPINE_TRY(supine_options_reference(basis, name, &wanted->from, false, &from, error));
  SUPINE_TRY(supine_posed_positions(basis, &from.pose, p.origin, error));
  supine_options_signals_catch(true);
  p.progress = supine_options_progress_begin(name);
  (void)supine_basis_caveats(basis, p.caveats, sizeof p.caveats);
  (void)snprintf(p.vtp_comment, sizeof p.vtp_comment,
                 "displacement from %s; volumes are gas and tissue of each lung; %s; %s", from.name,
                 p.caveats, wanted->made_by);
  if (tensors) {
    SUPINE_TRY(write_tensors(&p, error));
  } else {
    SUPINE_TRY(write_vtp(&p, &from.state, save, error));
  }
  report(&p);
  return SUPINE_OK;
}
