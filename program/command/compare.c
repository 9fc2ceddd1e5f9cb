/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine compare: compute the displacement and the ventilation by height in several postures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/output.h"
#include "base/text.h"
#include "base/vec3.h"

#include "program/command/list.h"
#include "program/options/basis_input.h"
#include "program/options/fiducials.h"
#include "program/options/hilum.h"
#include "program/options/inside.h"
#include "program/options/markups.h"
#include "program/options/state_options.h"
#include "program/report/comparison.h"

/* Write the structures in each posture as a list of control points. */
static supine_status write_markups(const char *path, const supine_comparison *c,
                                   supine_error *error) {
  json_t *lists = json_array();
  char meaning[SUPINE_MARKUPS_DESCRIPTION];
  supine_options_markups_describe(c->basis, c->reference.name, meaning);
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)json_array_append_new(lists,
                                supine_options_markup(c->postures.item[i].name, meaning,
                                                      c->posture[i].targets, c->names.count));
  }
  return supine_options_markups_write(path, lists, error);
}

static supine_status write_file(const char *path, const supine_comparison *comparison,
                                supine_error *error) {
  if (supine_options_markups_named(path)) {
    return write_markups(path, comparison, error);
  }
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  SUPINE_TRY(supine_output_open(path, &output, error));
  if (supine_text_ends_in(path, ".csv")) {
    supine_report_table(comparison, output.file);
  } else {
    SUPINE_TRY(supine_report_html(comparison, output.file, error));
  }
  return supine_output_commit(&output, error);
}

typedef struct request {
  supine_comparison comparison;
  const char *postures;
  const char *output;
  const char *inside;
  bool all;
  supine_frame frame;
} request;

static const supine_option table[] = {
    {"postures", 0, "LIST",
     "states to compare, separated by commas, such as supine:rest,prone:rest+500",
     SUPINE_FILLS(request, postures), .standard = "supine,prone,left,right"},
    {.table = supine_options_volume, SUPINE_FILLS(request, comparison.volume)},
    {.table = supine_options_from, SUPINE_FILLS(request, comparison.from)},
    {.table = supine_options_fiducials_frame, SUPINE_FILLS(request, frame)},
    {"breath", 0, "VOLUME", "tidal volume of the breath whose ventilation by height is computed",
     SUPINE_FILLS(request, comparison.breath), SUPINE_SAYS_GIVEN(request, comparison.breath_given),
     .standard = "500mL", SUPINE_BREATH},
    {"inside", 0, "FILE",
     "structures made by 'supine embed' from the same basis: the report has the displacement of "
     "each, with its expected error",
     SUPINE_FILLS(request, inside), .file = SUPINE_FILE_IN},
    {"all", 0, NULL,
     "also print every target, the breath, and the regional expansion by height, as -o has them",
     SUPINE_FILLS(request, all)},
    {"output", 'o', "FILE",
     ".html: a report to read and print\n.csv: a table with a row for the surface, each lung and "
     "each structure in each posture; docs/compare.md describes it and "
     "--json\n" SUPINE_MARKUPS_ENDING
     ": a list of control points of 3D Slicer for each posture, one for each "
     "structure of --inside, in mm and LPS, with the errors as measurements",
     SUPINE_FILLS(request, output), .file = SUPINE_FILE_OUT,
     .endings = ".html, .csv or " SUPINE_MARKUPS_ENDING},
    {"title", 0, "TEXT",
     "title of the report, such as the patient's name; default the name of the basis file",
     SUPINE_FILLS(request, comparison.title)},
    {.name = NULL}};

/* Append a structure to the list of targets or of anatomy. */
static void add_target(const supine_posture_item *const item[2], const supine_target *target,
                       json_t *lists) {
  const char *const name = target->anatomy ? "anatomy" : "targets";
  json_t *entry = json_pack("{s:s, s:s}", "from", item[0]->name, "to", item[1]->name);
  (void)json_object_update_new(entry, supine_options_target_json(target));
  (void)json_array_append_new(json_object_get(lists, name), entry);
}

/* Append to the lists the displacements of each named structure and of the hilum between two
 * postures. In the frame of the hilum, subtract its displacement from the others; in that of
 * points, register both postures there. */
static supine_status add_pair(const supine_basis *basis, const supine_options_names *names,
                              const supine_posture_item *const item[2], const supine_frame *frame,
                              json_t *lists, supine_error *error) {
  const bool in_hilum = frame->hilum;
  supine_motion motion[2];
  supine_target row = {.name = in_hilum ? "hilum, subtracted" : "hilum"};
  supine_hilum hilum;
  supine_pose pose[2];
  const supine_state scan = supine_basis_scan(basis);
  SUPINE_FREED_BY(supine_posed_errors_free) supine_errors errors = {.moved = {0}};
  SUPINE_FREED_BY(supine_options_targets_free) supine_target *targets = NULL;
  for (size_t i = 0; i < 2; ++i) {
    SUPINE_TRY(supine_basis_pose(basis, &item[i]->state, &pose[i], error));
  }
  SUPINE_TRY(supine_posed_errors(basis, &item[1]->state, &item[0]->state, &errors, error));
  if (frame->points != NULL) {
    const supine_state *states[2] = {&item[1]->state, &item[0]->state};
    SUPINE_TRY(supine_options_fiducials(frame->points, basis, states, &errors, motion, error));
  }
  if (in_hilum) {
    SUPINE_TRY(
        supine_options_hilum_errors(basis, &item[1]->state, &item[0]->state, &errors, error));
  }
  SUPINE_TRY(supine_options_targets_find(basis, names,
                                         (const supine_pose *const[2]){&pose[0], &pose[1]}, &errors,
                                         false, &targets, error));
  SUPINE_TRY(
      supine_options_hilum(basis, &item[1]->state, &item[0]->state, in_hilum, &hilum, error));
  for (size_t i = 0; i < names->count; ++i) {
    if (in_hilum) {
      supine_options_target_shift(&targets[i], hilum.move);
    }
    if (frame->points != NULL) {
      supine_options_fiducials_target(motion, &targets[i]);
    }
    add_target(item, &targets[i], lists);
  }
  if (supine_length(hilum.move) > 0.0 && frame->points == NULL) {
    memcpy(row.move, hilum.move, sizeof row.move);
    row.moved = supine_length(hilum.move);
    row.moved_error = hilum.expected;
    SUPINE_TRY(supine_options_hilum(basis, &item[1]->state, &scan, in_hilum, &hilum, error));
    row.error = hilum.expected;
    row.another_error = supine_expected_another_day(hilum.expected);
    row.volume[0] = row.volume[1] = targets[0].volume[0] != 0.0 ? (double)NAN : 0.0;
    add_target(item, &row, lists);
  }
  return SUPINE_OK;
}

/* Print the displacement of each named structure between every two postures. */
static supine_status compare_content(supine_comparison *c, const request *wanted,
                                     supine_error *error) {
  json_auto_t *lists = json_pack("{s:[], s:[]}", "targets", "anatomy");
  SUPINE_TRY(supine_options_names_open(c->basis, &c->names, error));
  for (size_t i = 0; i < c->postures.count; ++i) {
    for (size_t j = i + 1; j < c->postures.count; ++j) {
      const supine_posture_item *const item[2] = {&c->postures.item[i], &c->postures.item[j]};
      SUPINE_TRY(add_pair(c->basis, &c->names, item, &wanted->frame, lists, error));
    }
  }
  supine_options_print(json_incref(lists));
  return SUPINE_OK;
}

static void end(request **wanted) {
  supine_comparison *c = &(*wanted)->comparison;
  supine_report_free(c);
  supine_options_names_close(&c->names);
  supine_basis_close(c->inside);
  supine_basis_close(c->basis);
}

/* Compute, print and write the comparison of the lungs. */
static supine_status report(supine_comparison *c, const request *wanted, supine_error *error) {
  SUPINE_REFUSE_IF(wanted->output != NULL && supine_options_markups_named(wanted->output) &&
                       wanted->inside == NULL,
                   error, SUPINE_ERROR_ARGUMENT,
                   "%s: no structures to write: give --inside FILE, made by 'supine embed'",
                   wanted->output);
  if (wanted->inside != NULL) {
    SUPINE_TRY(supine_options_inside_open(c->basis, wanted->inside, &c->inside, &c->names, error));
  }
  SUPINE_TRY(supine_report_find(c, error));
  supine_report_print(c, wanted->all);
  return wanted->output != NULL ? write_file(wanted->output, c, error) : SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  SUPINE_FREED_BY(end) request *wanted = chosen;
  supine_comparison *c = &wanted->comparison;
  supine_state *state = &c->volume.state;
  c->path = given->operand[0];
  c->made_by = given->made_by;
  SUPINE_TRY(supine_options_basis_open(c->path, SUPINE_STORAGE_AUTO, c->volume.allow_folds,
                                       &c->basis, error));
  const bool has_volume = state->lung_count > 0 || state->volume.kind != SUPINE_VOLUME_DEFAULT;
  state->gravity[1] = 1.0;
  if (supine_basis_get_info(c->basis)->is_fields && !c->breath_given) {
    c->breath = 0.0; /* fields of gravity have no volumes and no breaths */
  }
  if (state->lung_count == 0 && state->volume.kind == SUPINE_VOLUME_DEFAULT) {
    state->volume = supine_basis_default_volume(c->basis);
  }
  SUPINE_TRY(supine_options_posture_list_parse(wanted->postures, state, &c->postures, error));
  SUPINE_TRY(supine_options_posture_list_check(&c->postures, has_volume, error));
  const bool content = supine_basis_metadata(c->basis, "content") != NULL; /* by 'supine embed' */
  SUPINE_REFUSE_IF(
      content && c->from.given, error, SUPINE_ERROR_ARGUMENT,
      "%s holds structures inside the lungs, which are compared between every two postures: "
      "leave --from out, or use 'supine deform --from'",
      c->path);
  SUPINE_REFUSE_IF(
      content && wanted->output != NULL, error, SUPINE_ERROR_ARGUMENT,
      "%s holds structures inside the lungs, but -o needs the lungs: give the basis of the "
      "lungs, and the structures by --inside",
      c->path);
  const char *const frame = wanted->frame.points != NULL ? "POINTS" : "hilum";
  const bool in_frame = wanted->frame.hilum || wanted->frame.points != NULL;
  SUPINE_REFUSE_IF(!content && in_frame, error, SUPINE_ERROR_ARGUMENT,
                   "%s holds no structures inside the lungs, which --frame %s is for: give a basis "
                   "made by 'supine embed', or use 'supine deform --frame %s'",
                   c->path, frame, frame);
  return content ? compare_content(c, wanted, error) : report(c, wanted, error);
}

const supine_command supine_command_compare = {
    "compare",
    "compare postures: displacement, and ventilation by height",
    .usage = "BASIS [--postures LIST] [--volume VOLUME] [-o FILE] [OPTIONS]",
    .about = "For each posture, reports the displacement from supine at rest or from the state of "
             "--from, the volume of each lung, and the ventilation by height in a breath. If BASIS "
             "was made by 'supine embed', reports only the displacement of each named part between "
             "every two postures, and the volumes of closed parts in both.",
    .options = table,
    .notes = SUPINE_POSTURE_LIST_HELP
    "\n\nStatistics are weighted by the area of the surface; '95 %' is the 95th percentile. "
    "Ventilation by height: the lungs before a breath are cut into ten slabs of equal thickness, "
    "perpendicular to gravity. The gain of a slab is the volume that its part of the surface and "
    "its two cut faces enclose after the breath, minus the volume that they enclose before it. The "
    "gains sum to the volume of the breath. The regional expansion of a slab is its gain divided "
    "by its volume before the breath. For a basis of 'supine embed', the displacement is the mean "
    "over a part, in mm to the left, to the back and to the head. Parts that are open surfaces, or "
    "as long as a ball of a fifth of a lung, such as airways, vessels and lobes, are listed as "
    "anatomy, not as targets.\n"
    "\n"
    "Examples:\n"
    "  supine compare lungs.safetensors --postures supine,prone:rest+500,supine+15,0.6:0:-0.8\n"
    "  supine compare lungs.safetensors --inside nodules.safetensors -o report.html\n"
    "  supine compare lungs.safetensors --inside nodules.safetensors -o table.csv",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
