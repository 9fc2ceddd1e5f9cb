/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Load surfaces and label maps, and join them into lungs. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/parallel.h"
#include "base/remedy.h"
#include "base/text.h"

#include "mesh/image/image.h"
#include "precompute/lobes.h"
#include "precompute/lungs/gate.h"
#include "precompute/source.h"

/* Input files that are being read. Each array has an element for each file, and at least two. */
typedef struct reading {
  const supine_source_options *options;
  const char *const *paths;
  size_t count; /* number of files; after label maps are loaded, number of lungs */
  supine_mesh *meshes;
  supine_mesh_report *reports;
  supine_error *errors; /* error of each file; status SUPINE_OK if the file was loaded */
  supine_axes axes;     /* axes of the files, or of a label map's header */
  int side;             /* side of a single lung in a label map; else 0 */
} reading;

static void load_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const reading *r = context;
  for (size_t i = begin; i < end; ++i) {
    supine_mesh_load_options load = r->options->load;
    supine_mesh arrays;
    if (r->options->surfaces != NULL) {
      const supine_precompute_surface *given = &r->options->surfaces[i];
      arrays = (supine_mesh){given->vertex_count, (double *)given->vertices, given->triangle_count,
                             (uint32_t *)given->triangles}; /* only read */
      load.arrays = &arrays;
    }
    r->errors[i].status =
        supine_mesh_load(r->paths[i], &load, &r->meshes[i], &r->reports[i], &r->errors[i]);
  }
}

static void note_mesh(const char *path, const supine_mesh_report *report,
                      supine_findings *findings) {
  if (report->degenerate_faces > 0 || report->unreferenced_vertices > 0) {
    supine_findings_note(findings, "%s: dropped %zu degenerate face%s and %zu unreferenced vert%s",
                         path, report->degenerate_faces, report->degenerate_faces == 1 ? "" : "s",
                         report->unreferenced_vertices,
                         report->unreferenced_vertices == 1 ? "ex" : "ices");
  }
}

static supine_status load_meshes(reading *r, supine_source *source, supine_error *error) {
  supine_parallel_for(r->count, 1, r->count, load_range, r);
  for (size_t i = 0; i < r->count; ++i) {
    if (r->errors[i].status != SUPINE_OK) {
      return supine_error_wrap(error, &r->errors[i], "%s", "");
    }
    note_mesh(r->paths[i], &r->reports[i], &source->findings);
  }
  r->axes = r->reports[0].axes;
  return SUPINE_OK;
}

static void note_map(const char *path, const supine_labels_report *report,
                     supine_findings *findings) {
  if (report->frames_differ) {
    supine_findings_warn(
        findings, "%s: its qform and sform do not agree; the sform was used: check the positions",
        path);
  }
  for (size_t i = 0; i < report->lung_count; ++i) {
    const supine_labels_lung *lung = &report->lung[i];
    const char *side = lung->side > 0 ? "left" : "right";
    if (supine_input_judge(SUPINE_INPUT_LUNG_CUT, lung->cut / lung->mask) != SUPINE_INPUT_TAKEN) {
      supine_findings_warn(findings,
                           "%s: the %s lung is cut off at the image's border: give a scan "
                           "that shows all of it",
                           path, side);
    }
    if (supine_input_judge(SUPINE_INPUT_LUNG_PIECES, lung->dropped / lung->mask) !=
        SUPINE_INPUT_TAKEN) {
      supine_findings_warn(findings,
                           "%s: the %s lung is %.0f mL, without %.0f mL that are not connected to "
                           "it: check the labels",
                           path, side, lung->mask, lung->dropped);
    }
    if (lung->tunnels > 0) {
      supine_findings_note(findings,
                           "%s: %s lung: %ld open channel%s (a hole through the mask, or a "
                           "hollow open to the outside)",
                           path, side, lung->tunnels, lung->tunnels == 1 ? "" : "s");
      const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
          supine_remedy_such_as("close", "3", "to close narrow ones")};
      supine_findings_advise(findings, advice);
    }
  }
}

static supine_status load_maps(reading *r, supine_source *source, supine_error *error) {
  supine_labels_options wanted = r->options->labels;
  const bool folder = r->count == 1 && supine_precompute_is_folder(r->paths[0]);
  const char *masks[SUPINE_LOBES_MAX];
  supine_lobe_files lobes = {.left = 0};
  if (folder) {
    SUPINE_TRY(supine_precompute_lobes_find(r->paths[0], &lobes, error));
  }
  for (size_t i = 0; i < SUPINE_LOBES_MAX; ++i) {
    masks[i] = lobes.path[i];
  }
  wanted.left_masks = lobes.left;
  wanted.right_masks = lobes.right;
  wanted.axes = r->options->load.axes;
  wanted.any_size = r->options->load.millimetres_per_unit != 0.0;
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
      supine_remedy_omit("units"),
      supine_remedy_give("units", "mm", "to accept any size of the lungs")};
  SUPINE_REFUSE_ADVISE(r->options->load.millimetres_per_unit != 0.0 &&
                           r->options->load.millimetres_per_unit != 1.0,
                       error, advice, SUPINE_ERROR_ARGUMENT,
                       "a label map's header states its unit, but another unit was given");
  const char *const *paths = r->paths;
  size_t count = r->count;
  if (folder) {
    paths = masks;
    count = lobes.left + lobes.right;
  }
  SUPINE_TRY(supine_labels_surfaces(paths, count, &wanted, r->meshes, &source->report, error));
  r->count = source->report.lung_count;
  r->axes = source->report.coordinates;
  for (size_t i = 0; i < r->count; ++i) {
    r->reports[i] = (supine_mesh_report){.axes = SUPINE_AXES_LPS, .axes_from_tag = true};
  }
  r->side = source->report.lung[0].side;
  note_map(r->paths[0], &source->report, &source->findings);
  return SUPINE_OK;
}

/* Return the axes and unit of the files, or zeros if files differ in their axes. */
static supine_scan_frame frame_of(const reading *r) {
  for (size_t i = 1; i < r->count; ++i) {
    if (r->reports[i].axes != r->reports[0].axes) {
      return (supine_scan_frame){0};
    }
  }
  const double unit = r->options->load.millimetres_per_unit;
  return (supine_scan_frame){r->reports[0].axes, unit == 0.0 ? 1.0 : unit};
}

static void summarize(const reading *r, supine_source *source) {
  const supine_mesh_load_options *load = &r->options->load;
  const supine_mesh_report *report = &r->reports[0];
  const supine_lungs *lungs = &source->lungs;
  const size_t size = sizeof source->summary;
  char letters[4];
  supine_mesh_axes_letters(load->axes != SUPINE_AXES_AUTO ? load->axes : report->axes, letters);
  if (strcmp(letters, "RAI") == 0) {
    supine_findings_note(&source->findings,
                         "the axes RAI grow to the right, front and feet; what ITK calls RAI "
                         "is LPS here");
  }
  source->axes_from = report->axes_from_tag ? "file" : "default";
  if (load->axes != SUPINE_AXES_AUTO) {
    source->axes_from = "given";
  }
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    supine_text_add(source->summary, size, "%s%s lung in", lung == 0 ? "" : "; ",
                    supine_lungs_name(lungs, lung));
    for (size_t axis = 0; axis < 3; ++axis) {
      supine_text_add(source->summary, size, "%s %c %.0f to %.0f", axis == 0 ? "" : ",",
                      "xyz"[axis], lungs -> low[lung][axis], lungs -> high[lung][axis]);
    }
    supine_text_add(source->summary, size, " mm");
  }
}

/* Check that the files are all label maps, or all surfaces without options for label maps. */
static supine_status check_kinds(const supine_source_options *options, const char *const *paths,
                                 size_t count, bool *is_map, supine_error *error) {
  const supine_labels_options *labels = &options->labels;
  size_t images = 0;
  if (options->surfaces == NULL) {
    for (size_t i = 0; i < count; ++i) {
      images +=
          supine_image_is_named(paths[i]) || (count == 1 && supine_precompute_is_folder(paths[i]));
    }
  }
  *is_map = images == count;
  SUPINE_REFUSE_IF(images > 0 && images < count, error, SUPINE_ERROR_ARGUMENT,
                   "label maps and surfaces were given together: give only one kind");
  const struct {
    const char *argument;
    bool given;
  } for_maps[] = {{"labels", labels->labels != NULL},
                  {"edge", labels->edge > 0.0},
                  {"close", labels->close > 0.0},
                  {"surfaces_out", options->surfaces_out != NULL}};
  for (size_t i = 0; i < sizeof for_maps / sizeof *for_maps; ++i) {
    const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_omit(for_maps[i].argument)};
    SUPINE_REFUSE_ADVISE(images == 0 && for_maps[i].given, error, advice, SUPINE_ERROR_ARGUMENT,
                         "%s, which is for label maps (.nrrd, .nii, .nii.gz, .mha), was given with "
                         "surfaces",
                         for_maps[i].argument);
  }
  return SUPINE_OK;
}

static supine_status read_files(reading *r, supine_source *source, supine_error *error) {
  bool is_map = false;
  SUPINE_TRY(check_kinds(r->options, r->paths, r->count, &is_map, error));
  if (is_map) {
    SUPINE_TRY(load_maps(r, source, error));
  } else {
    SUPINE_TRY(load_meshes(r, source, error));
  }
  const supine_lungs_source given = {.name = r->paths[0],
                                     .axes = r->axes,
                                     .units_given = r->options->load.millimetres_per_unit != 0.0,
                                     .midline =
                                         r->options->has_midline ? &r->options->midline : NULL,
                                     .side = r->side};
  SUPINE_TRY(supine_lungs_gate(r->meshes, r->count, &given, &source->lungs, &source->axes_hold,
                               &source->findings, error));
  if (r->options->surfaces_out != NULL) {
    SUPINE_TRY(supine_mesh_save(r->options->surfaces_out, &source->lungs.mesh, NULL, error));
  }
  source->is_map = is_map;
  source->frame = frame_of(r);
  summarize(r, source);
  return SUPINE_OK;
}

supine_status supine_precompute_source_load(const supine_source_options *options,
                                            const char *const *paths, size_t count,
                                            supine_source *source, supine_error *error) {
  const size_t most = count > 2 ? count : 2;
  SUPINE_ARENA arena = {0};
  reading r = {.options = options,
               .paths = paths,
               .count = count,
               .meshes = supine_arena_zeros(&arena, most, sizeof *r.meshes),
               .reports = supine_arena_zeros(&arena, most, sizeof *r.reports),
               .errors = supine_arena_zeros(&arena, most, sizeof *r.errors)};
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu files", count));
  const supine_status status = read_files(&r, source, error);
  for (size_t i = 0; i < most; ++i) {
    supine_mesh_free(&r.meshes[i]);
  }
  return status;
}

bool supine_precompute_go_on(void *context, double fraction) {
  const supine_precompute_options *options = context;
  return options->progress == NULL || options->progress(options->context, fraction) == 0;
}

supine_status supine_precompute_source_load_lungs(const supine_precompute_options *options,
                                                  supine_source *source, supine_error *error) {
  enum { NAME = 32 };
  const supine_precompute_lungs *given = &options->lungs;
  const size_t count = given->path_count + given->surface_count;
  supine_precompute_options told = *options; /* of the progress */
  supine_source_options wanted = {.load = {.millimetres_per_unit = given->unit},
                                  .surfaces = given->surface_count > 0 ? given->surfaces : NULL,
                                  .labels = {.labels = given->labels,
                                             .edge = given->edge,
                                             .close = given->close,
                                             .progress = supine_precompute_go_on,
                                             .progress_context = &told},
                                  .surfaces_out = given->surfaces_out,
                                  .has_midline = given->has_midline || given->midline != 0.0,
                                  .midline = given->midline};
  SUPINE_REFUSE_IF(count == 0, error, SUPINE_ERROR_ARGUMENT,
                   "no lungs: give files or arrays of surfaces");
  SUPINE_REFUSE_IF(given->path_count > 0 && given->surface_count > 0, error, SUPINE_ERROR_ARGUMENT,
                   "give files or arrays, not both");
  const bool axes_fit =
      given->axes == NULL || supine_mesh_axes_parse(given->axes, &wanted.load.axes);
  SUPINE_REFUSE_IF(!axes_fit, error, SUPINE_ERROR_ARGUMENT,
                   "axes are three letters, one each of L or R, P or A, S or I, not '%s'",
                   given->axes);
  SUPINE_REFUSE_IF(!(given->unit >= 0.0 && given->edge >= 0.0 && given->close >= 0.0), error,
                   SUPINE_ERROR_ARGUMENT, "unit, edge and close must not be negative");
  if (given->surface_count == 0) {
    return supine_precompute_source_load(&wanted, given->paths, count, source, error);
  }
  SUPINE_ARENA arena = {0};
  const char **names = supine_arena_take(&arena, count, sizeof *names);
  char(*texts)[NAME] = supine_arena_take(&arena, count, sizeof *texts);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu surfaces", count));
  for (size_t i = 0; i < count; ++i) {
    (void)snprintf(texts[i], NAME, "surface %zu", i + 1);
    names[i] = texts[i];
  }
  return supine_precompute_source_load(&wanted, names, count, source, error);
}
