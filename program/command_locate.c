/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine locate: find the whole lung from a few observed points. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/locate.h>
#include <supine/posture.h>

#include "base/arena.h"
#include "base/output.h"
#include "base/text.h"

#include "mesh/io/points.h"
#include "program/options/basis_input.h"
#include "program/options/inside.h"
#include "program/options/state_options.h"
#include "program/options/surface_options.h"

static const char name[] = "locate";

typedef struct request {
  const char *output, *points;
  supine_orientation orientation;
  supine_state state; /* the volume is fitted if its kind is SUPINE_VOLUME_DEFAULT */
  double noise;
  bool rigid, json;
  supine_mesh_load_options load;
} request;

static const supine_option table[] = {
    {"points", 0, "FILE", "positions of the points in the scan, made by 'supine embed BASIS'",
     SUPINE_FILLS(request, points), .file = SUPINE_FILE_IN, .required = true},
    {"output", 'o', "FILE",
     ".vtp or .ply: the surface of the lungs; .csv: all structures in the file of --points. "
     "Positions are in the frame of the observations, and each has its expected error",
     SUPINE_FILLS(request, output), .file = SUPINE_FILE_OUT, .required = true,
     .endings = ".vtp, .ply or .csv"},
    {"volume", 0, "VOLUME", SUPINE_VOLUME_HELP ". By default, it is fitted to the points",
     SUPINE_FILLS(request, state), .read = supine_options_read_volume},
    {"rigid", 0, NULL,
     "also fit a rotation, which needs at least three points. It is expected to be small (standard "
     "deviation 3 degrees), unless the points show more than 30 degrees. By default only a "
     "translation is fitted",
     SUPINE_FILLS(request, rigid)},
    {"noise", 0, "MM", "standard deviation of an observed coordinate", SUPINE_FILLS(request, noise),
     .standard = "2", SUPINE_ABOVE_ZERO, .wants = "millimetres"},
    {"json", 0, NULL, "print JSON instead of text", SUPINE_FILLS(request, json)},
    {.table = supine_options_orientation, SUPINE_FILLS(request, orientation)},
    {.table = supine_options_surface_frame, SUPINE_FILLS(request, load)},
    {.name = NULL}};

typedef struct observations {
  size_t count;
  supine_observation points[SUPINE_LOCATE_POINTS_MAX];
} observations;

/* Find the vertex of the embedded point that is called `text` in the file `path`. */
static supine_status find_vertex(const char *path, const char *text,
                                 const supine_command_names *names, size_t *vertex,
                                 supine_error *error) {
  size_t found = 0;
  for (size_t part = 0; part < names->count; ++part) {
    const size_t own = names->begin[part + 1] - names->begin[part];
    if (own > 0 && strcmp(names->text[part], text) == 0) {
      *vertex = names->order[names->begin[part]];
      found += own;
    }
  }
  if (found == 1) {
    return SUPINE_OK;
  }
  if (found > 1) {
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: '%s' has %zu vertices, so it is not a point: give the name of a point", path, text,
        found);
  }
  const char *nearest =
      supine_options_suggest(text, (const char *const *)names->text, names->count);
  return supine_error_set(error, SUPINE_ERROR_FORMAT,
                          "%s: no point '%s' in the file of --points%s%s%s", path, text,
                          nearest == NULL ? "" : "; did you mean '", nearest == NULL ? "" : nearest,
                          nearest == NULL ? "" : "'?");
}

static supine_status load_observed(const char *path, const request *wanted,
                                   const supine_command_names *names, observations *observed,
                                   supine_error *error) {
  SUPINE_FREED_BY(supine_mesh_points_free) supine_mesh_points read = {0};
  SUPINE_TRY(supine_mesh_points_read(path, &wanted->load, &read, error));
  if (read.count > SUPINE_LOCATE_POINTS_MAX) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: %zu points, more than %d: leave some out", path, read.count,
                            (int)SUPINE_LOCATE_POINTS_MAX);
  }
  for (; observed->count < read.count; ++observed->count) {
    supine_observation *point = &observed->points[observed->count];
    point->noise = wanted->noise;
    memcpy(point->position, read.at + 3 * observed->count, sizeof point->position);
    SUPINE_TRY(find_vertex(path, read.names[observed->count], names, &point->vertex, error));
  }
  return SUPINE_OK;
}

enum { POSTURES = 6 };
static const char *const postures[POSTURES] = {"supine", "prone",   "left",
                                               "right",  "upright", "inverted"};

static const double negligible = 0.01; /* probability below which a posture is ignored */
static const double determined = 0.95; /* postures at least this probable count as determined */

typedef struct lungs_found {
  size_t count; /* number of postures tried */
  supine_location location[POSTURES];
  double probability[POSTURES];
  const supine_location *best;       /* fit in the most probable posture */
  supine_locate_residual *residuals; /* [postures, points] residual of each fitted point */
  float *xyz;                        /* [N, 3] positions in the most probable posture, mm */
  float *sigma;                      /* [N] expected errors of the positions, mm */
  double volume;                     /* volume of the lungs, mL; of the surface if it is written */
  double *space;                     /* a workspace of supine_locate for each posture */
  supine_arena arena;
} lungs_found;

/* Fit the lungs in the given posture or in all six; a failed fit gets probability 0. */
static supine_status try_postures(const supine_locate_task *task, bool posture_given,
                                  lungs_found *located, supine_error *error) {
  const size_t n = task->count;
  const size_t space = supine_locate_space(n);
  supine_status status = SUPINE_OK;
  double highest = -INFINITY;
  double sum = 0.0;
  located->count = posture_given ? 1 : POSTURES;
  for (size_t k = 0; k < located->count; ++k) {
    supine_locate_task one = *task;
    if (!posture_given) {
      (void)supine_posture_gravity(postures[k], one.state.gravity);
    }
    const supine_status tried =
        supine_locate(&one, located->residuals + k * n, located->space + k * space,
                      &located->location[k], status == SUPINE_OK ? error : NULL);
    status = tried == SUPINE_OK ? status : tried;
    located->probability[k] = tried == SUPINE_OK ? located->location[k].log_evidence : -INFINITY;
    if (located->probability[k] > highest) {
      highest = located->probability[k];
      located->best = &located->location[k];
    }
  }
  if (located->best == NULL) {
    return status;
  }
  for (size_t k = 0; k < located->count; ++k) {
    located->probability[k] = exp(located->probability[k] - highest);
    sum += located->probability[k];
  }
  for (size_t k = 0; k < located->count; ++k) {
    located->probability[k] /= sum;
  }
  return SUPINE_OK;
}

/* If points that do not fit fit ten times better (mean squared residual) when they are read in
 * another way, say so in the error. */
static void suggest_reading(const supine_locate_task *task, bool posture_given,
                            lungs_found *located, supine_error *error) {
  static const double residual_most = 40.0; /* largest residual that supine_locate accepts, mm */
  static const struct {
    const char *way;
    double factor[3];
  } readings[] = {{"in centimetres (--units cm)", {10.0, 10.0, 10.0}},
                  {"in RAS (--axes RAS)", {-1.0, -1.0, 1.0}},
                  {"mirrored (--axes RPS)", {-1.0, 1.0, 1.0}}};
  const supine_observation *given = task->observed;
  supine_observation other[SUPINE_LOCATE_POINTS_MAX];
  supine_locate_task changed = *task;
  double most = residual_most;
  for (size_t k = 0; k < located->count; ++k) {
    most = fmax(most, located->location[k].residual_rms);
  }
  changed.observed = other;
  for (size_t i = 0; i < sizeof readings / sizeof *readings && task->count > 2; ++i) {
    for (size_t j = 0; j < 3 * task->count; ++j) {
      other[j / 3] = j % 3 == 0 ? given[j / 3] : other[j / 3];
      other[j / 3].position[j % 3] *= readings[i].factor[j % 3];
    }
    if (try_postures(&changed, posture_given, located, NULL) == SUPINE_OK &&
        10.0 * pow(located->best->residual_rms, 2.0) < most * most) {
      const size_t length = strlen(error->message);
      (void)snprintf(error->message + length, sizeof error->message - length,
                     ". Read %s, they fit within %.1f mm", readings[i].way,
                     located->best->residual_rms);
      return;
    }
  }
}

/* Compute located->xyz, the positions x in the most probable posture, and located->sigma. If
 * posture k has probability p_k, positions x_k and expected errors s_k, then located->sigma squared
 * is the mean of s_k^2 + |x_k - x|^2 over all k, weighted by p_k.
 * @param xyz, sigma  workspace, [N, 3] and [N] */
static supine_status find_positions(const supine_basis *shown, float *xyz, float *sigma,
                                    lungs_found *located, supine_error *error) {
  const size_t n = supine_basis_get_info(shown)->vertex_count;
  SUPINE_TRY(supine_locate_positions(located->best, shown, located->xyz, located->sigma, error));
  double sum = located->probability[located->best - located->location];
  for (size_t i = 0; i < n; ++i) {
    located->sigma[i] *= located->sigma[i] * (float)sum;
  }
  for (size_t k = 0; k < located->count; ++k) {
    const double share = located->probability[k];
    if (&located->location[k] == located->best || share < negligible) {
      continue;
    }
    SUPINE_TRY(supine_locate_positions(&located->location[k], shown, xyz, sigma, error));
    sum += share;
    for (size_t i = 0; i < n; ++i) {
      float square = sigma[i] * sigma[i];
      for (size_t j = 3 * i; j < 3 * i + 3; ++j) {
        square += (xyz[j] - located->xyz[j]) * (xyz[j] - located->xyz[j]);
      }
      located->sigma[i] += (float)share * square;
    }
  }
  for (size_t i = 0; i < n; ++i) {
    located->sigma[i] = sqrtf(located->sigma[i] / (float)sum);
  }
  return SUPINE_OK;
}

/* Fit the lungs to the points, and compute the positions of the vertices of `shown`. If no posture
 * was given, try six postures. */
static supine_status find(const supine_locate_task *task, bool posture_given,
                          const supine_basis *shown, lungs_found *located, supine_error *error) {
  const size_t n = supine_basis_get_info(shown)->vertex_count;
  const size_t tries = POSTURES;
  SUPINE_ARENA arena = {0};
  supine_arena *kept = &located->arena;
  float *xyz = supine_arena_take(&arena, 3 * n, sizeof *xyz);
  float *sigma = supine_arena_take(&arena, n, sizeof *sigma);
  located->residuals = supine_arena_take(kept, tries * task->count, sizeof *located->residuals);
  located->xyz = supine_arena_take(kept, 3 * n, sizeof *xyz);
  located->sigma = supine_arena_take(kept, n, sizeof *sigma);
  located->space =
      supine_arena_take(kept, tries * supine_locate_space(task->count), sizeof(double));
  if (arena.failed || kept->failed) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  const supine_status status = try_postures(task, posture_given, located, error);
  if (status == SUPINE_ERROR_NUMERICAL) {
    suggest_reading(task, posture_given, located, error);
  }
  SUPINE_TRY(status);
  located->volume = located->best->volume;
  return find_positions(shown, xyz, sigma, located, error);
}

/* Make the located surface, and set located->volume to the volume that it encloses. */
static supine_status make_surface(const supine_basis *basis, lungs_found *located,
                                  supine_mesh *mesh, supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  SUPINE_TRY(supine_posed_mesh(basis, NULL, mesh, error));
  for (size_t i = 0; i < 3 * n; ++i) {
    mesh->vertices[i] = (double)located->xyz[i];
  }
  located->volume = 1e-3 * supine_mesh_volume(mesh);
  return SUPINE_OK;
}

static supine_status write_surface(const char *path, const supine_basis *basis,
                                   const supine_mesh *mesh, const lungs_found *located,
                                   supine_error *error) {
  const supine_tensor *lung = supine_basis_tensor(basis, "lung");
  const supine_mesh_field fields[] = {{"gravity_LPS", 3, located->best->state.gravity},
                                      {"volume_mL", 1, &located->volume}};
  const supine_mesh_save_options save = {.comment = "in the frame of the observations",
                                         .scalars = {{"expected_error_mm", located->sigma}},
                                         .lung = lung == NULL ? NULL : lung->data,
                                         .fields = fields,
                                         .field_count = 2};
  return supine_mesh_save(path, mesh, &save, error);
}

static supine_status write_points(const char *path, const supine_basis *inside,
                                  const supine_command_names *names, const lungs_found *located,
                                  supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(inside);
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status != SUPINE_OK) {
    return status;
  }
  (void)fputs("# mm, in the frame of the observations; expected_error_mm: " SUPINE_EXPECTED_MEANING
              "\nname,lung,x,y,z,expected_error_mm\n",
              output.file);
  for (size_t i = 0; i < info->vertex_count; ++i) {
    const size_t at = names->order[i];
    const float *p = located->xyz + 3 * at;
    (void)fprintf(output.file, "%s,%s,%.3f,%.3f,%.3f,%.3f\n", names->text[names->part[at]],
                  info->lung_names[supine_command_lung_of(info, at)], (double)p[0], (double)p[1],
                  (double)p[2], (double)located->sigma[at]);
  }
  return supine_output_commit(&output, error);
}

static void print(const request *wanted, const supine_command_names *names,
                  const observations *observed, size_t n, const lungs_found *located) {
  const supine_location *best = located->best;
  const double share = located->probability[best - located->location];
  const double *r = best->rotation;
  const double *t = best->translation;
  supine_state posture = best->state;
  char text[160];
  double square = 0.0;
  double largest = 0.0;
  json_t *outliers = json_array();
  posture.volume = (supine_volume){0};
  posture.lung_count = 0;
  (void)supine_state_describe(&posture, text, sizeof text);
  for (size_t i = 0; i < n; ++i) {
    square += (double)located->sigma[i] * (double)located->sigma[i];
    largest = fmax(largest, (double)located->sigma[i]);
  }
  json_t *root =
      json_pack("{s:o, s:I, s:f, s:f, s:s}", "file", supine_options_json_text(wanted->output),
                "points", (json_int_t)n, "expected_rms_mm", sqrt(square / (double)n),
                "expected_largest_mm", largest, "posture", text);
  if (!wanted->orientation.given) {
    (void)json_object_update_new(root, json_pack("{s:f, s:b}", "probability_percent", 100.0 * share,
                                                 "determined", (int)(share >= determined)));
  }
  (void)json_object_set_new(root, "volume_ml", json_real(located->volume));
  if (best->volume_error > 0.0) {
    (void)json_object_update_new(root, json_pack("{s:f, s:f}", "volume_deviation_ml",
                                                 best->volume_error, "deviation_without_points_ml",
                                                 best->volume_prior_error));
  }
  (void)json_object_set_new(root, "translation_mm", json_pack("[f, f, f]", t[0], t[1], t[2]));
  if (wanted->rigid) {
    const double cosine = fmax(-1.0, fmin(1.0, 0.5 * (r[0] + r[4] + r[8] - 1.0)));
    (void)json_object_set_new(root, "rotation_degrees",
                              json_real(acos(cosine) * (180.0 / 3.14159265358979)));
  }
  (void)json_object_update_new(root, json_pack("{s:I, s:f}", "observed_points",
                                               (json_int_t)observed->count, "left_rms_mm",
                                               best->residual_rms));
  const supine_locate_residual *residuals =
      located->residuals + (size_t)(best - located->location) * observed->count;
  for (size_t j = 0; j < observed->count; ++j) {
    const supine_locate_residual *residual = &residuals[j];
    if (residual->outlier) {
      (void)json_array_append_new(
          outliers,
          json_pack("{s:o, s:f, s:f}", "name",
                    supine_options_json_text(names->text[names->part[observed->points[j].vertex]]),
                    "distance_mm", residual->distance, "expected_mm", residual->sigma));
    }
  }
  (void)json_object_set_new(root, "outliers", outliers);
  supine_options_print(root, wanted->json);
}

static void free_found(lungs_found *located) {
  supine_arena_free(&located->arena);
}

static supine_status locate(const request *wanted, const supine_basis *lungs,
                            const supine_basis *inside, const supine_command_names *names,
                            const observations *observed, supine_error *error) {
  const bool csv = supine_text_ends_in(wanted->output, ".csv");
  const supine_basis *shown = csv ? inside : lungs;
  enum { OUTLIER_POINTS = 5 }; /* supine_locate leaves out at most a fifth of the points */
  SUPINE_FREED_BY(free_found) lungs_found located = {0};
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh mesh = {0};
  const supine_locate_task task = {.inside = inside,
                                   .count = observed->count,
                                   .observed = observed->points,
                                   .state = wanted->state,
                                   .rigid = wanted->rigid};
  const supine_status status = find(&task, wanted->orientation.given, shown, &located, error);
  if (status == SUPINE_ERROR_ARGUMENT && wanted->rigid) {
    /* Report a format error: the points in the file do not determine a rotation. */
    return error->status = SUPINE_ERROR_FORMAT;
  }
  SUPINE_TRY(status);
  if (!csv) {
    SUPINE_TRY(make_surface(lungs, &located, &mesh, error));
  }
  /* Print first and write last, so that a failure leaves no file. */
  if (observed->count < OUTLIER_POINTS) {
    supine_options_say(name, "with fewer than %d points, a wrong one cannot be found: check them",
                       (int)OUTLIER_POINTS);
  }
  print(wanted, names, observed, supine_basis_get_info(shown)->vertex_count, &located);
  return csv ? write_points(wanted->output, inside, names, &located, error)
             : write_surface(wanted->output, lungs, &mesh, &located, error);
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *lungs = NULL;
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *inside = NULL;
  SUPINE_FREED_BY(supine_command_names_close) supine_command_names names = {0};
  observations observed = {0};
  if (wanted->orientation.given) {
    SUPINE_TRY(supine_options_state(&wanted->orientation, &wanted->state, error));
  }
  SUPINE_TRY(supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, &lungs, error));
  SUPINE_TRY(supine_command_inside_open(lungs, wanted->points, &inside, &names, error));
  SUPINE_TRY(load_observed(given->operand[1], wanted, &names, &observed, error));
  return locate(wanted, lungs, inside, &names, &observed, error);
}

const supine_command supine_command_locate = {
    name,
    "find the whole lung from a few observed points",
    .usage = "BASIS OBSERVED --points INSIDE [--posture NAME] [--volume VOLUME] -o FILE",
    .about = "Fits the lungs to a few points observed inside them, for example by a navigation "
             "system. Finds the volume and the translation between the frames of the scan and of "
             "the observations, and corrects the predicted positions near the points. OBSERVED is "
             "a .mrk.json of 3D Slicer, or a CSV with the columns name,x,y,z, with the names given "
             "to 'supine embed'.",
    .options = table,
    .notes =
        "Expected errors are " SUPINE_EXPECTED_MEANING ". " SUPINE_EXPECTED_SUPPORT
        " They are multiplied by a factor that the residuals of the points decide. A few points "
        "seldom determine the posture: give --posture. Without it, six postures are "
        "tried, and the error includes the differences between them.\n"
        "\n"
        "Examples:\n"
        "  supine embed lungs.safetensors airways.csv -o inside.safetensors\n"
        "  supine locate lungs.safetensors observed.csv --points inside.safetensors --posture "
        "supine -o found.vtp\n"
        "  supine locate lungs.safetensors observed.csv --points inside.safetensors --posture left "
        "--volume rest --rigid -o found.csv",
    .operands_least = 2,
    .operands_most = 2,
    .operands_missing = "name a basis file and a file of observed points",
    .request_size = sizeof(request),
    .run = run};
