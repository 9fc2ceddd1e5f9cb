/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The options that choose the lungs and the model. */
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include <supine/parallel.h>

#include "model_options.h"

const char supine_model_options_help[] =
    "Surfaces:\n"
    "  --axes LPS|RAS       axes of the files; default: their SPACE tag, else LPS (DICOM)\n"
    "  --units UNIT         mm, cm, m, um or in, or millimetres per unit; default mm\n"
    "  --midline X          x of the sagittal plane between the lungs, mm; default: the middle of\n"
    "                       the box of two lungs, the inner face of a single lung's\n"
    "\n"
    "Force on a vertex, f = base + gain h + cx X + cy Y + cz Z, with h its height along gravity\n"
    "(0 uppermost, 1 lowermost) and X, Y, Z its place in the box (from the midline outwards, from\n"
    "the back, from the apex; 0 to 1):\n"
    "  --base B             default 0\n"
    "  --gain G             default 1\n"
    "  --box-force X,Y,Z    cx, cy, cz: fixed to the body; default 0,0,0\n"
    "  --soften S           dependent tissue is softer: E exp(-S (h - 1/2)); default 0. Only then\n"
    "                       does prone differ from supine by more than a change of sign\n"
    "\n"
    "Direction of displacement:\n"
    "  --direction MODEL    box (default): (+-c1 X^c2, -c3 Y^c4, -c5 Z^c6) mm; normal; radial\n"
    "  --constants C1,...,C6  of the box model; default 2,1.5,1.5,1,16,1.4: rounded from a fit to\n"
    "                       the 4-D CT landmarks of ten patients (DIR-Lab), where the law "
    "explains\n"
    "                       61 to 87 % of the squared displacement. (The paper's own are lost.)\n";

supine_model_options supine_model_options_default(void) {
  return (supine_model_options){.model = supine_model_default()};
}

static bool parse_axes(const char *text, supine_axes *axes) {
  if (strcasecmp(text, "LPS") == 0) {
    *axes = SUPINE_AXES_LPS;
  } else if (strcasecmp(text, "RAS") == 0) {
    *axes = SUPINE_AXES_RAS;
  } else {
    return false;
  }
  return true;
}

static bool parse_units(const char *text, double *millimetres) {
  static const struct {
    const char *name;
    double millimetres;
  } units[] = {{"mm", 1.0}, {"cm", 10.0}, {"m", 1000.0}, {"um", 1e-3}, {"in", 25.4}};
  for (size_t i = 0; i < sizeof units / sizeof *units; ++i) {
    if (strcmp(text, units[i].name) == 0) {
      *millimetres = units[i].millimetres;
      return true;
    }
  }
  return supine_parse_number(text, millimetres) && *millimetres > 0.0;
}

static bool parse_direction(const char *text, supine_direction_model *model) {
  static const char *const names[] = {"box", "normal", "radial"};
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    if (strcmp(text, names[i]) == 0) {
      *model = (supine_direction_model)i;
      return true;
    }
  }
  return false;
}

int supine_model_options_take(supine_model_options *options, const char *command, int option,
                              const char *value) {
  supine_force_law *force = &options->model.force;
  const char *wanted = NULL; /* set where the value is not what it should be */
  switch (option) {
  case OPTION_AXES:
    wanted = parse_axes(value, &options->load.axes) ? NULL : "--axes takes LPS or RAS";
    break;
  case OPTION_UNITS:
    wanted = parse_units(value, &options->load.millimetres_per_unit)
                 ? NULL
                 : "--units takes mm, cm, m, um, in or millimetres per unit";
    break;
  case OPTION_MIDLINE:
    options->has_midline = true;
    wanted = supine_parse_number(value, &options->midline) ? NULL : "--midline takes an x in mm";
    break;
  case OPTION_BASE:
    wanted = supine_parse_number(value, &force->base) ? NULL : "--base takes a number";
    break;
  case OPTION_GAIN:
    wanted = supine_parse_number(value, &force->gain) ? NULL : "--gain takes a number";
    break;
  case OPTION_BOX_FORCE:
    wanted = supine_parse_numbers(value, 3, force->box)
                 ? NULL
                 : "--box-force takes three numbers, CX,CY,CZ";
    break;
  case OPTION_SOFTEN:
    wanted = supine_parse_number(value, &force->soften) ? NULL : "--soften takes a number";
    break;
  case OPTION_DIRECTION:
    wanted = parse_direction(value, &options->model.direction.model)
                 ? NULL
                 : "--direction takes box, normal or radial";
    break;
  case OPTION_CONSTANTS:
    wanted = supine_parse_numbers(value, 6, options->model.direction.c)
                 ? NULL
                 : "--constants takes six numbers, C1,C2,C3,C4,C5,C6";
    break;
  default:
    break;
  }
  if (wanted != NULL) {
    return supine_command_usage(command, "%s, not '%s'", wanted, value);
  }
  return SUPINE_EXIT_OK;
}

typedef struct load_work {
  const supine_mesh_load_options *options;
  char **paths;
  supine_mesh *meshes;
  supine_mesh_report *reports;
  supine_error *errors; /* status SUPINE_OK where loading went well */
} load_work;

static void load_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const load_work *work = context;
  for (size_t i = begin; i < end; ++i) {
    work->errors[i].status = supine_mesh_load(work->paths[i], work->options, &work->meshes[i],
                                              &work->reports[i], &work->errors[i]);
  }
}

/* What a careful colleague would mention about a file. */
static void mention(const char *command, const char *path, const supine_mesh_report *report) {
  if (report->degenerate_faces > 0 || report->unreferenced_vertices > 0) {
    supine_command_say(command, "%s: dropped %zu degenerate faces and %zu unreferenced vertices",
                       path, report->degenerate_faces, report->unreferenced_vertices);
  }
  if (report->comment_names_ras) {
    supine_command_say(command,
                       "%s: note: read as LPS, but its comment mentions RAS: if its x points to "
                       "the right, add --axes RAS",
                       path);
  }
  if (report->likely_unit != NULL) {
    supine_command_say(command,
                       "%s: warning: its size cannot be a lung's in mm; the likely unit is '%s': "
                       "add --units %s",
                       path, report->likely_unit, report->likely_unit);
  }
}

int supine_model_load(const supine_model_options *options, const char *command, char **paths,
                      size_t count, supine_lungs *lungs) {
  int result = SUPINE_EXIT_OK;
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  load_work work = {&options->load, paths, calloc(count, sizeof(supine_mesh)),
                    calloc(count, sizeof(supine_mesh_report)), calloc(count, sizeof(supine_error))};
  if (work.meshes == NULL || work.reports == NULL || work.errors == NULL) {
    result = supine_command_fail(command, &error);
    goto cleanup;
  }
  supine_parallel_for(count, 1, count, load_range, &work);
  for (size_t i = 0; i < count; ++i) {
    if (work.errors[i].status != SUPINE_OK) {
      result = supine_command_fail(command, &work.errors[i]);
      goto cleanup;
    }
    mention(command, paths[i], &work.reports[i]);
  }
  if (supine_lungs_create(work.meshes, count, options->has_midline ? &options->midline : NULL,
                          lungs, &error) != SUPINE_OK) {
    result = supine_command_fail(command, &error);
    goto cleanup;
  }
  if (!lungs->topology.closed) {
    supine_command_say(command,
                       "note: the surface is not closed (%zu boundary, %zu non-manifold, %zu "
                       "inconsistent edges): no volumes, only --scale",
                       lungs->topology.boundary_edges, lungs->topology.non_manifold_edges,
                       lungs->topology.inconsistent_edges);
  }
cleanup:
  for (size_t i = 0; work.meshes != NULL && i < count; ++i) {
    supine_mesh_free(&work.meshes[i]);
  }
  free(work.meshes);
  free(work.reports);
  free(work.errors);
  return result;
}
