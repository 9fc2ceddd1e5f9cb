/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine locate: find the whole lung from a few observed points. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/csv.h"
#include "base/output.h"
#include "base/text.h"
#include "mesh/io/points.h"
#include "precompute/posed/located.h"
#include "program/command/deform_samples.h"
#include "program/command/list.h"
#include "program/options/basis_input.h"
#include "program/options/facts.h"
#include "program/options/inside.h"
#include "program/options/markups.h"
#include "program/options/state_options.h"
#include "program/options/surface_options.h"
#include "runtime/lung.h"

static const char name[] = "locate";

#define MEANING "mm, in the frame of the observations; expected_error_mm: " SUPINE_EXPECTED_MEANING

typedef struct request {
  const char *output, *points;
  supine_orientation orientation;
  supine_state state; /* the volume is fitted if its kind is SUPINE_VOLUME_DEFAULT */
  double noise, depth;
  bool rigid, surface;
  size_t samples, seed;
  bool samples_given;
  supine_mesh_load_options load;
} request;

static const supine_option table[] = {
    {"points", 0, "FILE", "positions of the points in the scan, made by 'supine embed BASIS'",
     SUPINE_FILLS(request, points), .file = SUPINE_FILE_IN, .required = true},
    {"output", 'o', "FILE",
     ".vtp or .ply: the surface of the lungs; .csv, or " SUPINE_MARKUPS_ENDING
     " of 3D Slicer: all structures in the file of --points. Positions are in the frame of the "
     "observations, and each has its expected error. Samples are .safetensors",
     SUPINE_FILLS(request, output), .file = SUPINE_FILE_OUT, .required = true,
     .endings = ".vtp, .ply, .csv, .safetensors or " SUPINE_MARKUPS_ENDING},
    {"samples", 0, "N",
     "write N plausible places of all structures in the file of --points to -o FILE.safetensors, "
     "as 'supine deform --samples' does. They pass near the observed points, within their noise, "
     "and are uncertain far from them",
     SUPINE_FILLS(request, samples), SUPINE_SAYS_GIVEN(request, samples_given),
     .range = {1.0, 100000.0}},
    {"surface", 0, NULL,
     "samples of the surface of the lungs, in place of the structures. Each has the volume of "
     "--volume",
     SUPINE_FILLS(request, surface)},
    {"seed", 0, "S", "number that decides the samples: another one draws other lungs",
     SUPINE_FILLS(request, seed), .standard = "0"},
    {"volume", 0, "VOLUME", SUPINE_VOLUME_HELP ". By default, it is fitted to the points",
     SUPINE_FILLS(request, state), .read = supine_options_read_volume},
    {"rigid", 0, NULL,
     "also fit a rotation, which needs at least three points. It is expected to be small (standard "
     "deviation 3 degrees), unless the points show more than 30 degrees. By default only a "
     "translation is fitted",
     SUPINE_FILLS(request, rigid)},
    {"noise", 0, "MM",
     "standard deviation of an observed coordinate; of a line of sight, across it, at the point",
     SUPINE_FILLS(request, noise), .standard = "2", SUPINE_ABOVE_ZERO, SUPINE_MEASURES(LENGTH)},
    {"depth", 0, "MM",
     "standard deviation of how far the observations' frame is translated along the lines of sight "
     "from the frame of the scan, if all lines have one source or are parallel, and no point is "
     "known in space",
     SUPINE_FILLS(request, depth), .standard = "20", SUPINE_ABOVE_ZERO, SUPINE_MEASURES(LENGTH)},
    {.table = supine_options_orientation, SUPINE_FILLS(request, orientation)},
    {.table = supine_options_surface_frame, SUPINE_FILLS(request, load)},
    {.name = NULL}};

typedef struct observations {
  size_t count, lines; /* all, and those that are lines of sight */
  supine_observation points[SUPINE_LOCATE_POINTS_MAX];
} observations;

/* Find the vertex of the embedded point that is called `text` in the file `path`. */
static supine_status find_vertex(const char *path, const char *text,
                                 const supine_options_names *names, size_t *vertex,
                                 supine_error *error) {
  size_t found = 0;
  for (size_t part = 0; part < names->count; ++part) {
    const size_t own = names->begin[part + 1] - names->begin[part];
    if (own > 0 && strcmp(names->text[part], text) == 0) {
      *vertex = names->order[names->begin[part]];
      found += own;
    }
  }
  const char *nearest =
      supine_options_suggest(text, (const char *const *)names->text, names->count);
  char suggestion[256];
  supine_text_suggest("", nearest, suggestion, sizeof suggestion);
  SUPINE_REFUSE_IF(found > 1, error, SUPINE_ERROR_FORMAT,
                   "%s: '%s' has %zu vertices, so it is not a point: give the name of a point",
                   path, text, found);
  SUPINE_REFUSE_IF(found == 0, error, SUPINE_ERROR_FORMAT,
                   "%s: no point '%s' in the file of --points%s", path, text, suggestion);
  return SUPINE_OK;
}

static supine_status load_observed(const char *path, const request *wanted,
                                   const supine_options_names *names, observations *observed,
                                   supine_error *error) {
  SUPINE_FREED_BY(supine_io_points_free) supine_io_points read = {0};
  SUPINE_TRY(supine_io_points_read(path, &wanted->load, &read, error));
  SUPINE_REFUSE_IF(read.count > SUPINE_LOCATE_POINTS_MAX, error, SUPINE_ERROR_FORMAT,
                   "%s: %zu points, more than %d: leave some out", path, read.count,
                   (int)SUPINE_LOCATE_POINTS_MAX);
  for (; observed->count < read.count; ++observed->count) {
    supine_observation *point = &observed->points[observed->count];
    point->noise = wanted->noise;
    memcpy(point->position, read.at + 3 * observed->count, sizeof point->position);
    memcpy(point->from, read.from + 3 * observed->count, sizeof point->from);
    point->on_line = isfinite(point->from[0]);
    observed->lines += point->on_line;
    SUPINE_TRY(find_vertex(path, read.names[observed->count], names, &point->vertex, error));
  }
  return SUPINE_OK;
}

static const double determined = 0.95; /* postures at least this probable count as determined */

/* Return the names of the points that were left out as outliers, with their distances. */
static json_t *outliers_of(const supine_options_names *names, const observations *observed,
                           const supine_locate_residual *residuals) {
  json_t *outliers = json_array();
  for (size_t j = 0; j < observed->count; ++j) {
    if (residuals[j].outlier) {
      (void)json_array_append_new(
          outliers,
          json_pack("{s:o, s:f, s:f}", "name",
                    supine_options_json_text(names->text[names->part[observed->points[j].vertex]]),
                    "distance_mm", residuals[j].distance, "expected_mm", residuals[j].sigma));
    }
  }
  return outliers;
}

/* Name each point that was left out as an outlier on standard error. */
static void say_outliers(const supine_options_names *names, const observations *observed,
                         const supine_locate_residual *residuals) {
  for (size_t j = 0; j < observed->count; ++j) {
    if (residuals[j].outlier) {
      supine_options_say(name,
                         "warning: point '%s' lies %.1f mm from where the other points predict it, "
                         "where %.1f mm are expected: it is left out; check it",
                         names->text[names->part[observed->points[j].vertex]],
                         residuals[j].distance, residuals[j].sigma);
    }
  }
}

/* Return the number of different points: several rows of one name are several views of it. */
static size_t count_points(const observations *observed) {
  size_t different = 0;
  for (size_t j = 0; j < observed->count; ++j) {
    size_t first = 0;
    while (observed->points[first].vertex != observed->points[j].vertex) {
      ++first;
    }
    different += first == j;
  }
  return different;
}

static void print(const request *wanted, const supine_options_names *names,
                  const observations *observed, size_t n, double volume,
                  const supine_posed_located *located) {
  const supine_location_info *best = located->best;
  const double *r = best->rotation;
  const double *t = best->translation;
  const double cosine = fmax(-1.0, fmin(1.0, 0.5 * (r[0] + r[4] + r[8] - 1.0)));
  const double share = located->best_probability;
  const bool fitted = best->volume_error > 0.0;
  const bool given = wanted->orientation.given;
  const supine_state posture = {
      .gravity = {best->state.gravity[0], best->state.gravity[1], best->state.gravity[2]}};
  char text[160];
  (void)supine_state_describe(&posture, text, sizeof text);
  supine_options_print(json_pack(
      "{s:o, s:o*, s:I, s:f, s:f, s:s, s:o*, s:o*, s:f, s:o*, s:o*, s:[f, f, f], s:o*, s:o*, "
      "s:I, s:o*, s:f, s:o}",
      "file", supine_options_json_text(wanted->output), "samples",
      wanted->samples_given ? json_integer((json_int_t)wanted->samples) : NULL, "points",
      (json_int_t)n, "expected_rms_mm", located->expected_rms, "expected_largest_mm",
      located->expected_largest, "posture", text, "probability_percent",
      given ? NULL : json_real(100.0 * share), "determined",
      given ? NULL : json_boolean(share >= determined), "volume_ml", volume, "volume_deviation_ml",
      fitted ? json_real(best->volume_error) : NULL, "deviation_without_points_ml",
      fitted ? json_real(best->volume_prior_error) : NULL, "translation_mm", t[0], t[1], t[2],
      "rotation_degrees",
      wanted->rigid ? json_real(acos(cosine) * (180.0 / 3.14159265358979)) : NULL,
      "depth_deviation_mm", best->depth_error > 0.0 ? json_real(best->depth_error) : NULL,
      "observed_points", (json_int_t)count_points(observed), "lines_of_sight",
      observed->lines > 0 ? json_integer((json_int_t)observed->lines) : NULL, "residual_rms_mm",
      best->residual_rms, "outliers", outliers_of(names, observed, located->residuals)));
}

/* Write control points of 3D Slicer. */
static supine_status write_markups(const char *path, const supine_options_names *names, size_t n,
                                   const supine_posed_located *located, supine_error *error) {
  SUPINE_ARENA arena = {0};
  supine_target *points = supine_arena_take(&arena, n, sizeof *points);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu points", n));
  for (size_t i = 0; i < n; ++i) {
    const size_t at = names->order[i];
    points[i] = (supine_target){.name = names->text[names->part[at]],
                                .moved = NAN,
                                .moved_error = NAN,
                                .error = (double)located->sigma[at],
                                .another_error = NAN};
    for (size_t k = 0; k < 3; ++k) {
      points[i].at[k] = (double)located->xyz[3 * at + k];
    }
  }
  json_t *lists = json_array();
  (void)json_array_append_new(lists, supine_options_markup("located", MEANING, points, n));
  return supine_options_markups_write(path, lists, error);
}

/* Print first and write last, so that a failure leaves no file. */
static supine_status finish_points(const request *wanted, const supine_basis *inside,
                                   const supine_options_names *names, const observations *observed,
                                   const supine_posed_located *located, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(inside);
  print(wanted, names, observed, info->vertex_count, located->best->volume, located);
  if (supine_options_markups_named(wanted->output)) {
    return write_markups(wanted->output, names, info->vertex_count, located, error);
  }
  supine_output output = {0};
  SUPINE_TRY(supine_output_open(wanted->output, &output, error));
  char caveats[SUPINE_CAVEATS_SIZE];
  (void)supine_basis_caveats(inside, caveats, sizeof caveats);
  (void)fprintf(output.file, "# %s; %s\nname,lung,x,y,z,expected_error_mm\n", MEANING, caveats);
  for (size_t i = 0; i < info->vertex_count; ++i) {
    const size_t at = names->order[i];
    const float *p = located->xyz + 3 * at;
    supine_csv_row row = {.file = output.file};
    supine_csv_add_text(&row, names->text[names->part[at]]);
    supine_csv_add_text(&row, info->lung_names[supine_basis_lung_of(info, at)]);
    supine_csv_add(&row, "%.3f,%.3f,%.3f,%.3f", (double)p[0], (double)p[1], (double)p[2],
                   (double)located->sigma[at]);
    supine_csv_end_row(&row);
  }
  return supine_output_commit(&output, error);
}

/* Make the located surface, state its volume, print the report, and write the surface. */
static supine_status finish_surface(const request *wanted, const supine_basis *lungs,
                                    const supine_options_names *names, const observations *observed,
                                    const supine_posed_located *located, supine_error *error) {
  const size_t n = supine_basis_get_info(lungs)->vertex_count;
  const supine_tensor *lung = supine_basis_tensor(lungs, "lung");
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh mesh = {0};
  SUPINE_TRY(supine_posed_mesh(lungs, NULL, &mesh, error));
  for (size_t i = 0; i < 3 * n; ++i) {
    mesh.vertices[i] = (double)located->xyz[i];
  }
  const double volume = 1e-3 * supine_mesh_volume(&mesh);
  const supine_mesh_field fields[] = {{"gravity_LPS", 3, located->best->state.gravity},
                                      {"volume_mL", 1, &volume}};
  char comment[64 + SUPINE_CAVEATS_SIZE];
  char caveats[SUPINE_CAVEATS_SIZE];
  (void)supine_basis_caveats(lungs, caveats, sizeof caveats);
  (void)snprintf(comment, sizeof comment, "in the frame of the observations; %s", caveats);
  const supine_mesh_save_options save = {.comment = comment,
                                         .scalars = {{"expected_error_mm", located->sigma}},
                                         .lung = lung == NULL ? NULL : lung->data,
                                         .fields = fields,
                                         .field_count = 2};
  print(wanted, names, observed, n, volume, located);
  return supine_mesh_save(wanted->output, &mesh, &save, error);
}

/* Print the report, and write samples of the located lungs or structures. */
static supine_status finish_samples(const request *wanted, const supine_basis *shown,
                                    const supine_options_names *names, const observations *observed,
                                    const supine_posed_located *located, supine_error *error) {
  const supine_deform_samples samples = {.path = wanted->output,
                                         .count = wanted->samples,
                                         .seed = wanted->seed,
                                         .basis = shown,
                                         .state = &located->best->state,
                                         .location = located->location[0]};
  double distance = 0.0;
  bool held = false;
  print(wanted, names, observed, supine_basis_get_info(shown)->vertex_count, located->best->volume,
        located);
  return supine_command_deform_samples(&samples, &distance, &held, error);
}

static supine_status check_samples(const request *wanted, supine_error *error) {
  SUPINE_TRY(supine_command_deform_samples_check(wanted->output, wanted->samples_given, error));
  SUPINE_REFUSE_IF(wanted->surface && !wanted->samples_given, error, SUPINE_ERROR_ARGUMENT,
                   "--surface is one of samples: give --samples N, or -o FILE.vtp for the located "
                   "surface");
  SUPINE_REFUSE_IF(wanted->samples_given && !wanted->orientation.given, error,
                   SUPINE_ERROR_ARGUMENT,
                   "samples are of one posture, which a few points seldom determine: give "
                   "--posture NAME");
  return SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  enum { OUTLIER_POINTS = 5 }; /* supine_locate leaves out at most a fifth of the points */
  request *wanted = chosen;
  const bool points = wanted->samples_given ? !wanted->surface
                                            : supine_text_ends_in(wanted->output, ".csv") ||
                                                  supine_options_markups_named(wanted->output);
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *lungs = NULL;
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *inside = NULL;
  SUPINE_FREED_BY(supine_options_names_close) supine_options_names names = {0};
  SUPINE_FREED_BY(supine_posed_located_free) supine_posed_located located = {0};
  observations observed = {0};
  SUPINE_TRY(check_samples(wanted, error));
  if (wanted->orientation.given) {
    SUPINE_TRY(supine_options_state(&wanted->orientation, &wanted->state, error));
  }
  SUPINE_TRY(
      supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, false, &lungs, error));
  SUPINE_TRY(supine_options_inside_open(lungs, wanted->points, &inside, &names, error));
  SUPINE_TRY(load_observed(given->operand[1], wanted, &names, &observed, error));
  const supine_locate_task task = {inside,        observed.count, observed.points,
                                   wanted->state, wanted->rigid,  wanted->depth};
  const supine_status status = supine_posed_locate(&task, wanted->orientation.given,
                                                   points ? inside : lungs, &located, error);
  if (status == SUPINE_ERROR_ARGUMENT && wanted->rigid) {
    /* Report a format error: the points in the file do not determine a rotation. */
    return error->status = SUPINE_ERROR_FORMAT;
  }
  SUPINE_TRY(status);
  supine_findings findings = {.count = 0};
  supine_location_check(located.best, &findings);
  supine_options_say_findings(name, &findings);
  say_outliers(&names, &observed, located.residuals);
  if (count_points(&observed) < OUTLIER_POINTS) {
    supine_options_note(name, "with fewer than %d points, a wrong one cannot be found: check them",
                        (int)OUTLIER_POINTS);
  }
  if (wanted->samples_given) {
    return finish_samples(wanted, points ? inside : lungs, &names, &observed, &located, error);
  }
  return points ? finish_points(wanted, inside, &names, &observed, &located, error)
                : finish_surface(wanted, lungs, &names, &observed, &located, error);
}

const supine_command supine_command_locate = {
    name,
    "find the whole lung from a few observed points",
    .usage = "BASIS OBSERVED --points INSIDE [--posture NAME] [--volume VOLUME] -o FILE",
    .about =
        "Fits the lungs to a few points observed inside them, for example by a navigation "
        "system. Finds the volume and the translation between the frames of the scan and of "
        "the observations, and corrects the predicted positions near the points. OBSERVED is "
        "a .mrk.json or .fcsv of 3D Slicer, or a CSV with the columns name,x,y,z, with the "
        "names given to 'supine embed'. In the columns from_x,from_y,from_z of the CSV, a row "
        "may have the source of a line of sight, in the same frame: the point lies on the line "
        "from there through x,y,z, as an X-ray or a camera shows it. Several rows of one name "
        "are several views.",
    .options = table,
    .notes = "Expected errors are " SUPINE_EXPECTED_MEANING ". " SUPINE_EXPECTED_SUPPORT
             " They are multiplied by a factor that the residuals of the points decide. A few "
             "points seldom determine the posture: give --posture. Without it, six postures are "
             "tried, and the error includes the differences between them.\n"
             "\n"
             "Two views from different sources show a point in space. One view shows where it lies "
             "across the lines, but hardly how far along them: its position there is that of the "
             "scan's frame, within --depth, and the expected errors contain it. Give a smaller "
             "--depth if the distance is known, as from the spine.\n"
             "\n"
             "Examples:\n"
             "  supine embed lungs.safetensors airways.csv -o inside.safetensors\n"
             "  supine locate lungs.safetensors observed.csv --points inside.safetensors --posture "
             "supine -o found.vtp\n"
             "  supine locate lungs.safetensors observed.csv --points inside.safetensors --posture "
             "left --volume rest --rigid -o found.csv\n"
             "  supine locate lungs.safetensors observed.csv --points inside.safetensors --posture "
             "supine --samples 100 -o drawn.safetensors",
    .operands_least = 2,
    .operands_most = 2,
    .operands_missing = "name a basis file and a file of observed points",
    .request_size = sizeof(request),
    .run = run};
