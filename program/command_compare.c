/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine compare: compute the displacement and the ventilation by height in several postures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/output.h"
#include "base/vec3.h"

#include "program/options/basis_input.h"
#include "program/options/inside.h"
#include "program/options/state_options.h"
#include "program/report/comparison.h"

static const char name[] = "compare";

static supine_status write_html(const char *path, const supine_comparison *comparison,
                                supine_error *error) {
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status == SUPINE_OK) {
    status = supine_report_html(comparison, output.file, error);
  }
  if (status == SUPINE_OK) {
    status = supine_output_commit(&output, error);
  }
  supine_output_abandon(&output);
  return status;
}

typedef struct request {
  const char *postures;
  const char *html;
  bool json;
  supine_volume_options volume;
  supine_from from;
  int frame;     /* 1 if the hilum stays in place, 0 if the body does */
  double breath; /* tidal volume, mL */
  bool has_breath;
} request;

static const supine_option table[] = {
    {"postures", 0, "LIST",
     "states to compare, separated by commas, such as supine:rest,prone:rest+500",
     SUPINE_FILLS(request, postures), .standard = "supine,prone,left,right"},
    {.table = supine_options_volume, SUPINE_FILLS(request, volume)},
    {.table = supine_options_from, SUPINE_FILLS(request, from)},
    {.table = supine_options_hilum_frame, SUPINE_FILLS(request, frame)},
    {"breath", 0, "ML", "tidal volume of the breath whose ventilation by height is computed",
     SUPINE_FILLS(request, breath), SUPINE_SAYS_GIVEN(request, has_breath), .standard = "500",
     SUPINE_ABOVE_ZERO},
    {"json", 0, NULL, "print JSON to standard output instead of text", SUPINE_FILLS(request, json)},
    {"output", 'o', "FILE", ".html file to write: a report with charts and pictures",
     SUPINE_FILLS(request, html), .file = SUPINE_FILE_OUT, .endings = ".html"},
    {.name = NULL}};

typedef struct structures {
  const supine_basis *basis;
  const supine_posture_list *postures;
  supine_command_names names;
  float *xyz;            /* [N, 3] position of each vertex in one posture, mm */
  double *mean;          /* [postures, structures, 3] mean position, mm */
  double *volumes;       /* [postures, structures] mL; NAN if not closed; follows `mean` */
  double *square_errors; /* [structures] mean squared expected error, mm^2; NAN if unknown */
  bool in_hilum;         /* whether to subtract the displacement of the hilum */
  double hilum[3];       /* displacement of the hilum between two postures, mm */
} structures;

/* Average values [N, width] over each structure's vertices; the mean over no vertices is 0. */
static void average(const structures *c, size_t width, const float *values, double *mean) {
  const supine_command_names *names = &c->names;
  for (size_t part = 0; part < names->count; ++part) {
    const size_t begin = names->begin[part];
    const size_t end = names->begin[part + 1];
    for (size_t k = 0; k < width; ++k) {
      double sum = 0.0;
      for (size_t i = begin; i < end; ++i) {
        sum += (double)values[width * names->order[i] + k];
      }
      mean[width * part + k] = end > begin ? sum / (double)(end - begin) : 0.0;
    }
  }
}

/* Compute the volume of each named structure. The normals of a closed surface sum to 0, and its
 * volume is a sixth of the sum of (corner) . (normal) over its triangles. */
static void find_volumes(const structures *c, double *volumes) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  for (size_t part = 0; part < c->names.count; ++part) {
    double sum[5] = {0.0}; /* of the normals x, y, z, of their lengths, and of corner . normal */
    for (size_t t = 0; t < 3 * info->triangle_count; t += 3) {
      const uint32_t *corner = info->triangles + t;
      const bool own = c->names.part[corner[0]] == part;
      double x[3][3];
      double normal[3];
      for (size_t k = 0; k < 9 && own; ++k) {
        x[k / 3][k % 3] = (double)c->xyz[3 * corner[k / 3] + k % 3];
      }
      if (own) {
        supine_normal(x[0], x[1], x[2], normal);
        for (size_t k = 0; k < 3; ++k) {
          sum[k] += normal[k];
        }
        sum[3] += supine_length(normal);
        sum[4] += supine_dot(x[0], normal);
      }
    }
    volumes[part] = supine_length(sum) < 1e-3 * sum[3] ? sum[4] / 6000.0 : (double)NAN;
  }
}

/* Compute the mean position and the volume of each named structure in posture i. */
static supine_status find_means(const structures *c, const supine_state *state, size_t i,
                                supine_error *error) {
  supine_pose pose;
  const supine_status status = supine_basis_pose(c->basis, state, &pose, error);
  if (status == SUPINE_OK) {
    (void)supine_deform(c->basis, &pose, c->xyz);
    average(c, 3, c->xyz, c->mean + 3 * i * c->names.count);
    find_volumes(c, c->volumes + i * c->names.count);
  }
  return status;
}

/* For each structure, average the squared expected error of the displacement between two states
 * over the vertices, mm^2. */
static supine_status find_square_errors(const structures *c, const supine_state *to,
                                        const supine_state *from, supine_error *error) {
  const size_t n = supine_basis_get_info(c->basis)->vertex_count;
  supine_expected expected = {0};
  const supine_status status = supine_options_expected_find(c->basis, to, from, &expected, error);
  for (size_t i = 0; i < n && expected.sigma != NULL; ++i) {
    expected.sigma[i] *= expected.sigma[i];
  }
  for (size_t part = 0; part < c->names.count; ++part) {
    c->square_errors[part] = (double)NAN;
  }
  if (expected.sigma != NULL) {
    average(c, 1, expected.sigma, c->square_errors);
  }
  supine_options_expected_free(&expected);
  return status;
}

/* Append to a list the displacement of the hilum from one posture to another. Keep it as
 * c->hilum. */
static supine_status add_hilum(structures *c, size_t from, size_t to, json_t *list,
                               supine_error *error) {
  const supine_posture_item *item = c->postures->item;
  const double *h = c->hilum;
  supine_pose pose[2];
  (void)supine_basis_pose(c->basis, &item[from].state, &pose[0], NULL); /* find_means found both */
  (void)supine_basis_pose(c->basis, &item[to].state, &pose[1], NULL);
  const supine_status status =
      supine_options_hilum(c->basis, &pose[1], &pose[0], c->in_hilum, c->hilum, error);
  if (status == SUPINE_OK && supine_length(h) > 0.0) {
    (void)json_array_append_new(
        list, json_pack("{s:s, s:s, s:s, s:[f,f,f], s:f, s:n}", "from", item[from].name, "to",
                        item[to].name, "name", c->in_hilum ? "hilum, subtracted" : "hilum", "move",
                        h[0], h[1], h[2], "mm", supine_length(h), "expected_error_mm"));
  }
  return status;
}

/* Append to a list the displacement and volumes of each structure from one posture to another. */
static void add_pair(const structures *c, size_t from, size_t to, json_t *list) {
  for (size_t part = 0; part < c->names.count; ++part) {
    const char *const text[] = {c->postures->item[from].name, c->postures->item[to].name,
                                c->names.text[part]};
    const double *before = c->mean + 3 * (from * c->names.count + part);
    const double *after = c->mean + 3 * (to * c->names.count + part);
    const double kept = c->in_hilum ? 1.0 : 0.0;
    const double move[3] = {after[0] - before[0] - kept * c->hilum[0],
                            after[1] - before[1] - kept * c->hilum[1],
                            after[2] - before[2] - kept * c->hilum[2]};
    const double length = supine_length(move);
    const double sigma = sqrt(c->square_errors[part]);
    const double ml[2] = {c->volumes[from * c->names.count + part],
                          c->volumes[to * c->names.count + part]};
    json_t *row = json_pack("{s:s, s:s, s:s, s:[f,f,f], s:f, s:o}", "from", text[0], "to", text[1],
                            "name", text[2], "move", move[0], move[1], move[2], "mm", length,
                            "expected_error_mm", isnan(sigma) ? json_null() : json_real(sigma));
    if (supine_basis_get_info(c->basis)->triangle_count > 0) {
      (void)json_object_set_new(row, "volumes_ml", supine_options_json_numbers(2, ml));
    }
    (void)json_array_append_new(list, row);
  }
}

/* Append to a list the displacement of each named structure between every two postures. */
static supine_status find_pairs(structures *c, json_t *list, supine_error *error) {
  supine_status status = SUPINE_OK;
  for (size_t i = 0; i < c->postures->count && status == SUPINE_OK; ++i) {
    status = find_means(c, &c->postures->item[i].state, i, error);
  }
  for (size_t i = 0; i < c->postures->count; ++i) {
    for (size_t j = i + 1; j < c->postures->count && status == SUPINE_OK; ++j) {
      status =
          find_square_errors(c, &c->postures->item[j].state, &c->postures->item[i].state, error);
      status = status == SUPINE_OK ? add_hilum(c, i, j, list, error) : status;
      add_pair(c, i, j, list);
    }
  }
  return status;
}

/* Print the mean displacement of each named structure between every two postures. */
static supine_status compare_content(const supine_basis *basis, const supine_posture_list *postures,
                                     const request *wanted, supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  structures c = {.basis = basis, .postures = postures, .in_hilum = wanted->frame == 1};
  json_t *list = json_array();
  supine_status status = supine_command_names_open(basis, &c.names, error);
  if (status == SUPINE_OK) {
    c.xyz = malloc(3 * n * sizeof *c.xyz);
    c.mean = calloc(4 * postures->count * c.names.count, sizeof *c.mean);
    c.volumes = c.mean + 3 * postures->count * c.names.count;
    c.square_errors = calloc(c.names.count, sizeof *c.square_errors);
    if (c.xyz == NULL || c.mean == NULL || c.square_errors == NULL) {
      status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
    }
  }
  if (status == SUPINE_OK) {
    status = find_pairs(&c, list, error);
  }
  if (status == SUPINE_OK) {
    supine_options_print(json_incref(list), wanted->json);
  }
  json_decref(list);
  free(c.xyz);
  free(c.mean);
  free(c.square_errors);
  supine_command_names_close(&c.names);
  return status;
}

static supine_status compare(const char *path, const char *made_by, const supine_basis *basis,
                             const request *wanted, supine_error *error) {
  supine_comparison comparison = {.path = path,
                                  .command = name,
                                  .made_by = made_by,
                                  .allow_folds = wanted->volume.allow_folds,
                                  .basis = basis,
                                  .state = wanted->volume.state,
                                  .from = wanted->from,
                                  .breath = wanted->breath};
  comparison.state.gravity[1] = 1.0;
  if (supine_basis_get_info(basis)->is_fields && !wanted->has_breath) {
    comparison.breath = 0.0; /* fields of gravity have no volumes and no breaths */
  }
  if (comparison.state.lung_count == 0 && comparison.state.volume.kind == SUPINE_VOLUME_DEFAULT) {
    comparison.state.volume = supine_basis_default_volume(basis);
  }
  supine_status status = supine_options_posture_list_parse(wanted->postures, &comparison.state,
                                                           &comparison.postures, error);
  if (status != SUPINE_OK) {
    return status;
  }
  const bool content = supine_basis_metadata(basis, "content") != NULL;
  if (content && wanted->from.given) {
    return supine_error_set(
        error, SUPINE_ERROR_ARGUMENT,
        "%s holds structures inside the lungs, which are compared between every "
        "two postures: leave --from out, or use 'supine deform --from'",
        path);
  }
  if (content) { /* only 'supine embed' writes this key */
    return wanted->html != NULL
               ? supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                  "%s holds structures inside the lungs, but -o needs the lungs: "
                                  "give the basis of the lungs, or leave -o out",
                                  path)
               : compare_content(basis, &comparison.postures, wanted, error);
  }
  if (wanted->frame == 1) {
    return supine_error_set(
        error, SUPINE_ERROR_ARGUMENT,
        "--frame hilum is for structures inside the lungs: give a basis made by "
        "'supine embed', or use 'supine deform --frame hilum'");
  }
  status = supine_report_find(&comparison, error);
  if (status == SUPINE_OK) {
    supine_report_print(&comparison, wanted->json);
  }
  if (status == SUPINE_OK && wanted->html != NULL) {
    status = write_html(wanted->html, &comparison, error);
  }
  supine_report_free(&comparison);
  return status;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  supine_basis *basis = NULL;
  supine_status status =
      supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, &basis, error);
  if (status == SUPINE_OK) {
    status = compare(given->operand[0], given->made_by, basis, chosen, error);
  }
  supine_basis_close(basis);
  return status;
}

const supine_command supine_command_compare = {
    name,
    "compare postures: displacement, and ventilation by height",
    .usage = "BASIS [--postures LIST] [--volume VOLUME] [-o report.html] [OPTIONS]",
    .about = "For each posture, reports the displacement from supine at rest or from the state of "
             "--from, the volume of each lung, and the ventilation by height in a breath. Then "
             "finds the direction of gravity with the largest displacement from supine. If BASIS "
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
    "over a part, in mm to the left, to the back and to the head.\n"
    "\n"
    "Examples:\n"
    "  supine compare lungs.safetensors --postures supine,prone:rest+500,supine+15,0.6:0:-0.8\n"
    "  supine compare lungs.safetensors --volume rest --breath 800 -o report.html",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
