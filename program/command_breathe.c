/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine breathe: compute the surfaces of a breath, frame by frame. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_statistics.h>

#include <supine/safetensors.h>

#include "base/arena.h"
#include "base/clock.h"
#include "base/text.h"
#include "mesh/mesh.h"

#include "program/options/basis_input.h"
#include "program/options/breath_turn.h"
#include "program/options/pv.h"
#include "program/options/state_options.h"

static const char name[] = "breathe";

static const double budget = 15e-3; /* longest compute time allowed for one frame, s */

typedef struct request {
  supine_orientation orientation;
  bool turns;
  breath_turn turn;
  supine_pv_breath breath;
  const char *pv;
  const char *path;
  bool allow_folds, as_scanned;
  supine_from from;
  double fps;
  double duration; /* length of the output, s; 0 for the length of the turn or of one breath */
} request;

/* Names of the shapes that a breath can have over time, indexed by supine_pv_course. */
static const char *const courses[] = {"cosine", "ramp", "flow", NULL};

static const supine_option table[] = {
    {"output", 'o', "OUT",
     "NAME.vtp: one file of all frames for ParaView, which shows the index of a frame as its time. "
     "Each frame has displacements from the state of --from, normals, the lung of each point, "
     "gravity and volumes; positions are rounded to 1/256 mm\nNAME.safetensors: positions [T,N,3] "
     "in mm, triangles [M,3], time [T] in s, volume [T,G] in mL and gravity [T,3], for T frames, N "
     "vertices, M triangles and G lungs",
     SUPINE_FILLS(request, path), .required = true, .file = SUPINE_FILE_OUT,
     .endings = ".vtp or .safetensors"},
    {"turn", 0, "FROM:TO:SECONDS",
     "turn from one posture to another at constant speed: supine:left:10s takes 10 s. Between "
     "opposite postures, the body turns through left (supine to prone) or through supine (upright "
     "to inverted, left to right). The volume at rest changes with the posture",
     SUPINE_FILLS(request, turn), .read = supine_breath_turn_read, .wants = "FROM:TO:SECONDS",
     SUPINE_SAYS_GIVEN(request, turns), .rivals = "gravity"},
    {.help = "The breath:"},
    {"tidal", 0, "ML",
     "tidal volume of both lungs, in mL, above rest in the posture, or above the scan if rest is "
     "unknown; default 500",
     SUPINE_FILLS(request, breath.tidal), SUPINE_ABOVE_ZERO},
    {"rate", 0, "N", "breaths per minute; default 12", SUPINE_FILLS(request, breath.rate),
     SUPINE_ABOVE_ZERO},
    {"inhale", 0, "SHARE",
     "share of the breath's duration that is spent inhaling, between 0 and 1; default 1/3",
     SUPINE_FILLS(request, breath.inhale_fraction), .range = {0.0, 1.0}, .open = true,
     .wants = "a share between 0 and 1", .more = true},
    {"pv", 0, "FILE", "pressure-volume relation made by 'supine pv fit'; default a normal adult's",
     SUPINE_FILLS(request, pv), .file = SUPINE_FILE_IN},
    {"rest-pressure", 0, "P",
     "pressure at the end of an exhalation, in cmH2O; with --pv, of the kind in that file (airway "
     "or transpulmonary), otherwise transpulmonary; default 5",
     SUPINE_FILLS(request, breath.rest_pressure), .wants = "a number of cmH2O", .more = true},
    {"course", 0, "NAME",
     "cosine: pressure follows a cosine; ramp: pressure is linear in time; flow: inflow and "
     "outflow are constant; default cosine",
     SUPINE_FILLS(request, breath.course), .choices = courses, .more = true},
    {.table = supine_options_folds, SUPINE_FILLS(request, allow_folds)},
    {.help = "The frames:"},
    {"fps", 0, "N", "frames per second", SUPINE_FILLS(request, fps), SUPINE_ABOVE_ZERO,
     .standard = "66.66"},
    {"seconds", 0, "S", "duration in s; default the duration of the turn, or of one breath",
     SUPINE_FILLS(request, duration), SUPINE_ABOVE_ZERO},
    {.table = supine_options_from_scan, SUPINE_FILLS(request, from)},
    {.table = supine_options_as_scanned, SUPINE_FILLS(request, as_scanned)},
    {.table = supine_options_orientation, SUPINE_FILLS(request, orientation)},
    {.name = NULL}};

/* Check the options, set the start and the end of gravity's turn, and count the frames. */
static supine_status complete(request *wanted, size_t *count, supine_error *error) {
  enum { FRAMES_MAX = 1000000 };
  supine_pv_breath *breath = &wanted->breath;
  if (wanted->as_scanned && supine_text_ends_in(wanted->path, ".safetensors")) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "--as-scanned is for VTP files only: leave it out, as safetensors "
                            "files are always in LPS and mm");
  }
  if (!wanted->turns) {
    supine_state state = {.lung_count = 0};
    SUPINE_TRY(supine_options_state(&wanted->orientation, &state, error));
    if (state.volume.kind != SUPINE_VOLUME_DEFAULT || state.lung_count > 0) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "a breath starts at rest: give --posture without a volume");
    }
    memcpy(wanted->turn.to, state.gravity, sizeof wanted->turn.to);
    memcpy(wanted->turn.from, wanted->turn.to, sizeof wanted->turn.from);
  }
  double seconds = wanted->turns ? wanted->turn.seconds : 60.0 / breath->rate;
  seconds = wanted->duration > 0.0 ? wanted->duration : seconds;
  const double frames = floor(seconds * wanted->fps * (1.0 + 1e-12)) + 1.0;
  *count = (size_t)fmin(frames, FRAMES_MAX);
  return frames <= FRAMES_MAX
             ? SUPINE_OK
             : supine_error_set(
                   error, SUPINE_ERROR_ARGUMENT,
                   "%g s at %g frames a second is more than %d frames: lower --seconds or --fps",
                   seconds, wanted->fps, FRAMES_MAX);
}

/* A breath, and the memory for its frames. */
typedef struct playing {
  const request *wanted;
  supine_basis *basis;
  size_t frame_count, lung_count;
  double *time;     /* [frames] time since the start, s */
  double *above;    /* [frames] volume minus that at rest (in the scan if rest is unknown), mL */
  double *gravity;  /* [frames, 3] unit vectors */
  double *volumes;  /* [frames, lungs] volume of gas and tissue, mL */
  double *total;    /* [frames] sum of `volumes` over the lungs, mL */
  supine_mesh mesh; /* triangles; for VTP output, also the positions of the current frame */
  float *normals;   /* [N, 3] normals of the current frame, for VTP output */
  float *positions; /* [N, 3] current frame, mm; followed by all frames unless the output is VTP */
  double *compute_time; /* [frames] s */
  double *origin;       /* [N, 3] positions from which displacements are measured, mm */
  char vtp_comment[512];
  supine_arena arena;
} playing;

static void end(playing *p) {
  supine_arena_free(&p->arena);
  supine_mesh_free(&p->mesh);
  supine_basis_close(p->basis);
}

/* Allocate memory for `count` frames. If `series` is true, keep the positions of one frame only, as
 * each is written before the next is computed. */
static supine_status begin_frames(playing *p, size_t count, bool series, supine_error *error) {
  const size_t frame = 3 * supine_basis_get_info(p->basis)->vertex_count;
  p->frame_count = count;
  p->lung_count = supine_basis_get_info(p->basis)->lung_count;
  p->time = supine_arena_take(&p->arena, count, sizeof *p->time);
  p->above = supine_arena_take(&p->arena, count, sizeof *p->above);
  p->gravity = supine_arena_take(&p->arena, count, 3 * sizeof *p->gravity);
  p->volumes = supine_arena_take(&p->arena, count, p->lung_count * sizeof *p->volumes);
  p->total = supine_arena_take(&p->arena, count, sizeof *p->total);
  p->compute_time = supine_arena_take(&p->arena, count, sizeof *p->compute_time);
  p->origin = supine_arena_take(&p->arena, frame, sizeof *p->origin);
  p->normals = supine_arena_take(&p->arena, frame, sizeof *p->normals);
  p->positions = supine_arena_take(&p->arena, series ? 1 : 1 + count, frame * sizeof *p->positions);
  return p->arena.failed
             ? supine_error_memory(error,
                                   "%zu frames of %zu vertices: lower --seconds or --fps, or write "
                                   "a .vtp file",
                                   count, frame / 3)
             : supine_posed_mesh(p->basis, NULL, &p->mesh, error);
}

static supine_status find_pose(const playing *p, size_t t, supine_pose *pose, supine_error *error) {
  const supine_state state = supine_breath_state(p->basis, p->gravity + 3 * t, p->above[t]);
  return supine_basis_pose(p->basis, &state, pose, error);
}

/* Compute the time, the direction of gravity and the volumes of each frame. */
static supine_status find_volumes(playing *p, const supine_pv *pv, supine_error *error) {
  for (size_t t = 0; t < p->frame_count; ++t) {
    p->time[t] = (double)t / p->wanted->fps;
    supine_breath_turn_gravity(&p->wanted->turn, p->time[t], p->gravity + 3 * t);
  }
  SUPINE_TRY(supine_breath_evaluate(pv, &p->wanted->breath, p->frame_count, p->time, p->above, NULL,
                                    error));
  for (size_t t = 0; t < p->frame_count; ++t) {
    supine_pose pose;
    supine_error cause;
    const supine_status status = find_pose(p, t, &pose, &cause);
    if (status != SUPINE_OK) {
      return supine_error_set(error, status, "frame at %.3f s: %s", p->time[t], cause.message);
    }
    (void)supine_basis_volumes(p->basis, &pose, p->volumes + t * p->lung_count);
    p->total[t] = supine_posed_volume(p->basis, &pose);
  }
  return SUPINE_OK;
}

static void report(const playing *p) {
  double least;
  double largest;
  gsl_stats_minmax(&least, &largest, p->total, 1, p->frame_count);
  (void)printf("%s: %zu frame%s, %.2f s at %.4g a second; volumes of %.2f to %.2f mL\n",
               p->wanted->path, p->frame_count, p->frame_count == 1 ? "" : "s",
               p->time[p->frame_count - 1], p->wanted->fps, least, largest);
  (void)printf("compute time per frame: median %.3f ms, longest %.3f ms, allowed %.0f ms\n",
               1e3 * gsl_stats_median(p->compute_time, 1, p->frame_count),
               1e3 * gsl_stats_max(p->compute_time, 1, p->frame_count), 1e3 * budget);
}

/* Compute all frames. Call find_volumes first: it checks that each frame has a valid pose.
 * @param series  receives each frame; NULL to store all frames in p->positions */
static supine_status play_frames(playing *p, supine_mesh_series *series, supine_error *error) {
  const size_t frame = 3 * p->mesh.vertex_count;
  SUPINE_FREED_BY(supine_options_progress_end)
  supine_progress progress = supine_options_progress_begin(name);
  for (size_t t = 0; t < p->frame_count; ++t) {
    supine_pose pose;
    const double start = supine_clock_seconds();
    (void)find_pose(p, t, &pose, NULL);
    (void)supine_deform(p->basis, &pose, p->positions);
    p->compute_time[t] = supine_clock_seconds() - start;
    if (series != NULL) {
      for (size_t i = 0; i < frame; ++i) {
        p->mesh.vertices[i] = (double)p->positions[i];
      }
      supine_normals(p->basis, p->positions, p->normals);
      SUPINE_TRY(supine_mesh_series_add(series, error));
    } else {
      memcpy(p->positions + (1 + t) * frame, p->positions, frame * sizeof *p->positions);
    }
    if (!supine_options_progress_step(&progress, (double)(t + 1) / (double)p->frame_count)) {
      return supine_error_set(error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
    }
  }
  return SUPINE_OK;
}

static void drop_series(supine_mesh_series **series) {
  supine_mesh_series_close(*series);
}

/* Compute the frames, and write them as VTP.
 * @param save  axes, unit and comment of the output; the other options are set here */
static supine_status write_series(playing *p, supine_mesh_save_options save, supine_error *error) {
  /* Positions are rounded to multiples of this length, mm. */
  static const double rounding = 1.0 / 256.0;
  const supine_tensor *lung = supine_basis_tensor(p->basis, "lung");
  const supine_mesh_field fields[] = {{"gravity_LPS", 3, p->gravity},
                                      {"volume_mL", p->lung_count, p->volumes}};
  SUPINE_FREED_BY(drop_series) supine_mesh_series *series = NULL;
  save.from = p->origin;
  save.normals = p->normals;
  save.lung = lung == NULL ? NULL : lung->data;
  save.fields = fields;
  save.field_count = sizeof fields / sizeof *fields;
  save.rounding = rounding;
  SUPINE_TRY(supine_mesh_series_open(p->wanted->path, &p->mesh, &save, p->frame_count, p->time,
                                     &series, error));
  SUPINE_TRY(play_frames(p, series, error));
  return supine_mesh_series_commit(series, error);
}

static supine_status write_tensors(playing *p, const char *made_by, supine_error *error) {
  const size_t t = p->frame_count;
  const supine_tensor tensors[] = {
      {"positions",
       SUPINE_F32,
       3,
       {t, p->mesh.vertex_count, 3},
       p->positions + 3 * p->mesh.vertex_count},
      {"triangles", SUPINE_U32, 2, {p->mesh.triangle_count, 3}, p->mesh.triangles},
      {"time", SUPINE_F64, 1, {t}, p->time},
      {"volume", SUPINE_F64, 2, {t, p->lung_count}, p->volumes},
      {"gravity", SUPINE_F64, 2, {t, 3}, p->gravity}};
  const supine_metadata metadata[] = {{"format", "supine-breath"},
                                      {"version", "1"},
                                      {"units", "mm, s, mL (gas and tissue of each lung)"},
                                      {"axes", "LPS"},
                                      {"made_by", made_by}};
  SUPINE_TRY(play_frames(p, NULL, error));
  return supine_safetensors_write(p->wanted->path, tensors, sizeof tensors / sizeof *tensors,
                                  metadata, sizeof metadata / sizeof *metadata, error);
}

/* Check the surfaces of smallest and of largest volume with supine_options_pose_check. */
static supine_status check_ends(const playing *p, supine_error *error) {
  size_t ends[2];
  gsl_stats_minmax_index(&ends[0], &ends[1], p->total, 1, p->frame_count);
  for (size_t i = 0; i < 2; ++i) {
    supine_pose pose;
    const supine_state state =
        supine_breath_state(p->basis, p->gravity + 3 * ends[i], p->above[ends[i]]);
    SUPINE_TRY(supine_basis_pose(p->basis, &state, &pose, error));
    SUPINE_TRY(
        supine_options_pose_check(p->basis, name, p->wanted->allow_folds, &state, &pose, error));
  }
  return SUPINE_OK;
}

static supine_status play(playing *p, size_t count, const char *made_by, supine_error *error) {
  const request *wanted = p->wanted;
  const bool tensors = supine_text_ends_in(wanted->path, ".safetensors");
  supine_mesh_save_options save = {.comment = p->vtp_comment};
  supine_pv pv = *supine_breath_normal();
  supine_reference_pose from;
  SUPINE_TRY(supine_options_basis_frame(p->basis, wanted->as_scanned, &save, error));
  SUPINE_TRY(begin_frames(p, count, !tensors, error));
  if (wanted->pv != NULL) {
    SUPINE_TRY(supine_breath_load(wanted->pv, &pv, error));
  }
  SUPINE_TRY(find_volumes(p, &pv, error));
  SUPINE_TRY(supine_options_reference(p->basis, &wanted->from, false, &from, error));
  SUPINE_TRY(check_ends(p, error));
  SUPINE_TRY(supine_posed_positions(p->basis, &from.pose, p->origin, error));
  supine_options_signals_catch(true);
  (void)snprintf(p->vtp_comment, sizeof p->vtp_comment,
                 "displacement from %s; volumes are gas and tissue of each lung; %s", from.name,
                 made_by);
  SUPINE_TRY(tensors ? write_tensors(p, made_by, error) : write_series(p, save, error));
  report(p);
  return SUPINE_OK;
}

static void begin(void *chosen) {
  ((request *)chosen)->breath = supine_breath_default();
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  const char *path = given->operand[0];
  SUPINE_FREED_BY(end) playing p = {.wanted = wanted};
  size_t count = 1;
  SUPINE_TRY(complete(wanted, &count, error));
  SUPINE_TRY(supine_options_basis_open(path, SUPINE_STORAGE_AUTO, &p.basis, error));
  return play(&p, count, given->made_by, error);
}

const supine_command supine_command_breathe = {
    name,
    "compute a breath, in one posture or during a turn",
    .usage = "BASIS --posture NAME -o OUT [OPTIONS]\n"
             "BASIS --turn FROM:TO:SECONDS -o OUT [OPTIONS]",
    .about = "Computes breathing lungs from a basis file, in one posture or during a turn, and "
             "writes the surface of each frame. In each frame, the lungs have exactly the volume "
             "that follows from the pressure-volume relation. The printed compute time per frame "
             "must be below 15 ms for a smooth display.",
    .options = table,
    .notes = "Examples:\n"
             "  supine breathe lungs.safetensors --posture prone -o prone.vtp\n"
             "  supine breathe lungs.safetensors --turn supine:left:10s --rate 15 -o turning.vtp\n"
             "  supine breathe lungs.safetensors --posture supine --tidal 800 -o deep.safetensors",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .begin = begin,
    .run = run};
