/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine breathe: compute the surfaces of a breath. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/text.h"

#include "program/command/breath_frames.h"
#include "program/command/list.h"
#include "program/options/basis_input.h"

typedef struct request {
  supine_command_breath_frames frames;
  supine_orientation orientation;
  bool turns;
  double duration; /* length of the output, s; 0 for the length of the turn or of one breath */
} request;

/* Names of the shapes that a breath can have over time, indexed by supine_pv_course. */
static const char *const courses[] = {"cosine", "ramp", "flow", NULL};

static const supine_option table[] = {
    {"output", 'o', "OUT",
     "NAME.vtp: one file of all frames for ParaView, which shows the index of a frame as its time. "
     "Each frame has displacements from the state of --from, the RMS of the expected errors, "
     "normals, the lung of each point, gravity and volumes\nNAME.safetensors: positions [T,N,3] in "
     "mm, triangles [M,3], time [T] in s, volume [T,G] in mL and gravity [T,3], for T frames, N "
     "vertices, M triangles and G lungs",
     SUPINE_FILLS(request, frames.path), .required = true, .file = SUPINE_FILE_OUT,
     .endings = ".vtp or .safetensors"},
    {"turn", 0, "FROM:TO:SECONDS",
     "turn from one posture to another at constant speed: supine:left:10s takes 10 s. Between "
     "opposite postures, the body turns through left (supine to prone) or through supine (upright "
     "to inverted, left to right). The volume at rest changes with the posture",
     SUPINE_FILLS(request, frames.breath.turn), .read = supine_options_turn_read,
     .wants = "FROM:TO:SECONDS", SUPINE_SAYS_GIVEN(request, turns), .rivals = "gravity"},
    {.help = "The breath:"},
    {"tidal", 0, "VOLUME",
     "tidal volume of both lungs, above rest in the posture, or above the scan if rest is unknown; "
     "default 500mL",
     SUPINE_FILLS(request, frames.breath.cycle.tidal), SUPINE_BREATH},
    {"rate", 0, "N", "breaths per minute; default 12",
     SUPINE_FILLS(request, frames.breath.cycle.rate), SUPINE_ABOVE_ZERO, SUPINE_MEASURES(RATE)},
    {"inhale", 0, "SHARE",
     "share of the breath's duration that is spent inhaling, between 0 and 1; default 1/3",
     SUPINE_FILLS(request, frames.breath.cycle.inhale_fraction), .range = {0.0, 1.0}, .open = true,
     .wants = "a share between 0 and 1", .more = true},
    {"pv", 0, "FILE", "pressure-volume relation made by 'supine pv fit'; default a normal adult's",
     SUPINE_FILLS(request, frames.breath.pv), .file = SUPINE_FILE_IN},
    {"rest-pressure", 0, "P",
     "pressure at the end of an exhalation; with --pv, of the kind in that file (airway or "
     "transpulmonary), otherwise transpulmonary; default 5",
     SUPINE_FILLS(request, frames.breath.cycle.rest_pressure), SUPINE_MEASURES(PRESSURE),
     .more = true},
    {"course", 0, "NAME",
     "cosine: pressure follows a cosine; ramp: pressure is linear in time; flow: inflow and "
     "outflow are constant; default cosine",
     SUPINE_FILLS(request, frames.breath.cycle.course), .choices = courses, .more = true},
    {.table = supine_options_folds, SUPINE_FILLS(request, frames.allow_folds)},
    {.help = "The frames:"},
    {"fps", 0, "N", "frames per second", SUPINE_FILLS(request, frames.breath.fps),
     SUPINE_ABOVE_ZERO, .standard = "66.66"},
    {"seconds", 0, "S", "duration; default the duration of the turn, or of one breath",
     SUPINE_FILLS(request, duration), SUPINE_ABOVE_ZERO, SUPINE_MEASURES(TIME)},
    {.table = supine_options_from_scan, SUPINE_FILLS(request, frames.from)},
    {.table = supine_options_as_scanned, SUPINE_FILLS(request, frames.as_scanned)},
    {.table = supine_options_orientation, SUPINE_FILLS(request, orientation)},
    {.name = NULL}};

/* Check the options, set the start and the end of gravity's turn, and count the frames. */
static supine_status complete(request *wanted, supine_error *error) {
  enum { FRAMES_MAX = 1000000 };
  supine_command_breath_frames *frames = &wanted->frames;
  SUPINE_REFUSE_IF(frames->as_scanned && supine_text_ends_in(frames->path, ".safetensors"), error,
                   SUPINE_ERROR_ARGUMENT,
                   "--as-scanned is for VTP files only: leave it out, as safetensors files are "
                   "always in LPS and mm");
  if (!wanted->turns) {
    supine_state state = {.lung_count = 0};
    SUPINE_TRY(supine_options_state(&wanted->orientation, &state, error));
    SUPINE_TRY(supine_options_breath_lie(&state, &frames->breath, error));
  }
  supine_options_breath *breath = &frames->breath;
  double seconds = wanted->turns ? breath->turn.seconds : 60.0 / breath->cycle.rate;
  seconds = wanted->duration > 0.0 ? wanted->duration : seconds;
  const double count = supine_options_frame_count(seconds, breath->fps);
  breath->count = (size_t)fmin(count, FRAMES_MAX);
  SUPINE_REFUSE_IF(!(count <= FRAMES_MAX), error, SUPINE_ERROR_ARGUMENT,
                   "%g s at %g frames a second is more than %d frames: lower --seconds or --fps",
                   seconds, breath->fps, FRAMES_MAX);
  return SUPINE_OK;
}

static void begin(void *chosen) {
  ((request *)chosen)->frames.breath.cycle = supine_breath_default();
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  const char *path = given->operand[0];
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *basis = NULL;
  wanted->frames.made_by = given->made_by;
  SUPINE_TRY(complete(wanted, error));
  SUPINE_TRY(supine_options_basis_open(path, SUPINE_STORAGE_AUTO, wanted->frames.allow_folds,
                                       &basis, error));
  return supine_command_breath_write(&wanted->frames, basis, error);
}

const supine_command supine_command_breathe = {
    "breathe",
    "compute a breath, in one posture or during a turn",
    .usage = "BASIS --posture NAME -o OUT [OPTIONS]\n"
             "BASIS --turn FROM:TO:SECONDS -o OUT [OPTIONS]",
    .about = "Computes breathing lungs from a basis file, in one posture or during a turn, and "
             "writes the surface of each frame. In each frame, the lungs have exactly the volume "
             "that follows from the pressure-volume relation. The printed compute time per frame "
             "must be below 15 ms for a smooth display.",
    .options = table,
    .notes =
        "Examples:\n"
        "  supine breathe lungs.safetensors --posture prone -o prone.vtp\n"
        "  supine breathe lungs.safetensors --turn supine:left:10s --rate 15 -o turning.vtp\n"
        "  supine breathe lungs.safetensors --posture supine --tidal 800mL -o deep.safetensors",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .begin = begin,
    .run = run};
