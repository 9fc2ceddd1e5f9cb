/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine compare: compare postures by displacement, and ventilation by height in each. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/output.h"
#include "sh/base/vec3.h"

#include "program/inside.h"
#include "program/options/basis_input.h"
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
  double breath; /* mL */
} request;

static const supine_option table[] = {
    {"postures", 0, "LIST", "postures to compare", SUPINE_FILLS(request, postures),
     .standard = "supine,prone,left,right"},
    {.table = supine_options_volume, SUPINE_FILLS(request, volume)},
    {.table = supine_options_from, SUPINE_FILLS(request, from)},
    {"breath", 0, "ML", "tidal volume of the breath whose ventilation by height is computed",
     SUPINE_FILLS(request, breath), .standard = "500", SUPINE_ABOVE_ZERO},
    {"json", 0, NULL, "print JSON to standard output instead of text", SUPINE_FILLS(request, json)},
    {"output", 'o', "FILE", ".html: a report of one file, with charts and pictures",
     SUPINE_FILLS(request, html), .file = SUPINE_FILE_OUT, .endings = ".html"},
    {.help = SUPINE_POSTURE_LIST_HELP},
    {.name = NULL}};

/* Displacements of all named structures in all postures. */
typedef struct content_moves {
  const supine_basis *basis;
  const supine_posture_list *postures;
  supine_command_names names;
  float *step;           /* [N, 3] displacement of each vertex in one posture */
  double *moves;         /* [postures, names, 3] mm from the reference surface */
  double *square_errors; /* [names] mean square expected errors between two postures, mm^2; 0:
                            unknown */
} content_moves;

/* Average the `width` values of each vertex over the vertices of each name; 0 without vertices. */
static void average(const content_moves *c, size_t width, const float *values, double *mean) {
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

/* Compute the mean displacement of each name's vertices in posture i. */
static supine_status find_moves(const content_moves *c, const supine_state *state, size_t i,
                                supine_error *error) {
  supine_pose pose;
  const supine_status status = supine_basis_pose(c->basis, state, &pose, error);
  if (status == SUPINE_OK) {
    supine_displace_range(c->basis, &pose, 0, supine_basis_get_info(c->basis)->vertex_count,
                          c->step);
    average(c, 3, c->step, c->moves + 3 * i * c->names.count);
  }
  return status;
}

/* Compute the mean square of the expected errors of each name's vertices. */
static supine_status find_square_errors(const content_moves *c, const supine_state *to,
                                        const supine_state *from, supine_error *error) {
  const size_t n = supine_basis_get_info(c->basis)->vertex_count;
  supine_expected expected = {0};
  const supine_status status = supine_options_expected_find(c->basis, to, from, &expected, error);
  for (size_t i = 0; i < n && expected.sigma != NULL; ++i) {
    expected.sigma[i] *= expected.sigma[i];
  }
  if (expected.sigma != NULL) {
    average(c, 1, expected.sigma, c->square_errors);
  }
  supine_options_expected_free(&expected);
  return status;
}

/* Add the displacements from one posture to another to a list. */
static void add_pair(const content_moves *c, size_t from, size_t to, json_t *list) {
  for (size_t part = 0; part < c->names.count; ++part) {
    const char *const text[] = {c->postures->item[from].name, c->postures->item[to].name,
                                c->names.text[part]};
    const double *before = c->moves + 3 * (from * c->names.count + part);
    const double *after = c->moves + 3 * (to * c->names.count + part);
    const double move[3] = {after[0] - before[0], after[1] - before[1], after[2] - before[2]};
    const double length = supine_length(move);
    const double sigma = sqrt(c->square_errors[part]);
    (void)json_array_append_new(list,
                                json_pack("{s:s, s:s, s:s, s:[f,f,f], s:f, s:f}", "from", text[0],
                                          "to", text[1], "name", text[2], "move", move[0], move[1],
                                          move[2], "mm", length, "expected_error_mm", sigma));
  }
}

/* Compute the displacements between every two postures. */
static supine_status find_pairs(const content_moves *c, const supine_state *volume, json_t *list,
                                supine_error *error) {
  supine_state state[SUPINE_POSTURE_LIST_MAX];
  supine_status status = SUPINE_OK;
  for (size_t i = 0; i < c->postures->count && status == SUPINE_OK; ++i) {
    state[i] = *volume;
    memcpy(state[i].gravity, c->postures->item[i].gravity, sizeof state[i].gravity);
    status = find_moves(c, &state[i], i, error);
  }
  for (size_t i = 0; i < c->postures->count; ++i) {
    for (size_t j = i + 1; j < c->postures->count && status == SUPINE_OK; ++j) {
      status = find_square_errors(c, &state[j], &state[i], error);
      add_pair(c, i, j, list);
    }
  }
  return status;
}

/* Print the mean displacement of each named structure between every two postures. */
static supine_status compare_content(const supine_basis *basis, const supine_posture_list *postures,
                                     const supine_state *volume, bool json, supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  content_moves c = {.basis = basis, .postures = postures};
  json_t *list = json_array();
  supine_status status = supine_command_names_open(basis, &c.names, error);
  if (status == SUPINE_OK) {
    c.step = malloc(3 * n * sizeof *c.step);
    c.moves = calloc(3 * postures->count * c.names.count, sizeof *c.moves);
    c.square_errors = calloc(c.names.count, sizeof *c.square_errors);
    if (c.step == NULL || c.moves == NULL || c.square_errors == NULL) {
      status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
    }
  }
  if (status == SUPINE_OK) {
    status = find_pairs(&c, volume, list, error);
  }
  if (status == SUPINE_OK) {
    supine_options_print(json_incref(list), json);
  }
  json_decref(list);
  free(c.step);
  free(c.moves);
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
  if (comparison.state.lung_count == 0 && comparison.state.volume.kind == SUPINE_VOLUME_DEFAULT) {
    comparison.state.volume = supine_basis_default_volume(basis);
  }
  supine_status status =
      supine_options_posture_list_parse(wanted->postures, &comparison.postures, error);
  if (status != SUPINE_OK) {
    return status;
  }
  if (supine_basis_metadata(basis, "content") != NULL) { /* the basis is from 'supine embed' */
    return wanted->html != NULL
               ? supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                  "%s holds structures inside the lungs, and -o needs the lungs: "
                                  "give their basis, or leave -o out",
                                  path)
               : compare_content(basis, &comparison.postures, &comparison.state, wanted->json,
                                 error);
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
    .about = "Reports how far the lungs move from supine at rest (or from --from) to each posture, "
             "how much each lung holds, and which heights ventilate in a breath; then finds the "
             "direction of gravity farthest from supine. For structures inside ('supine embed'), "
             "reports how far and where each named part moves between every two postures.",
    .options = table,
    .notes =
        "Averages are over the surface's area; 95 % of the area moves no farther than the number "
        "under '95 %'. Ventilation by height: the lungs before a breath are cut into ten slabs of "
        "equal thickness across gravity. The gain of a slab is the volume that its part of the "
        "surface and its two cut faces enclose after the breath, minus that before. The gains sum "
        "to the volume of the breath; gain over volume is the regional expansion. For structures "
        "inside, the displacement is the mean over a "
        "part, mm to the left, to the back and to the head.\n"
        "\n"
        "Examples:\n"
        "  supine compare lungs.safetensors --postures supine,prone,supine+15,0.6:0:-0.8\n"
        "  supine compare lungs.safetensors --volume rest --breath 800 -o report.html",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
