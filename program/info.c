/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine info: describe a basis file and its accuracy. */
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "sh/base/findings.h"
#include "sh/base/text.h"

#include <supine/compare.h>
#include <supine/runtime.h>

#include "program/options/basis_input.h"

/* Compute the share of the squared displacement in each band, [band + 1]; 0 where the surface has
 * no area. */
static supine_status band_energy(const supine_basis *basis, double *energy, supine_error *error) {
  supine_compare *compare = NULL;
  const supine_status status = supine_compare_create(basis, &compare, error);
  if (status != SUPINE_OK) {
    return status == SUPINE_ERROR_MESH ? SUPINE_OK : status;
  }
  supine_compare_energy(compare, energy);
  supine_compare_destroy(compare);
  double total = 0.0;
  const size_t band = supine_basis_get_info(basis)->band;
  for (size_t l = 0; l <= band; ++l) {
    total += energy[l];
  }
  for (size_t l = 0; l <= band; ++l) {
    energy[l] /= total > 0.0 ? total : 1.0;
  }
  return SUPINE_OK;
}

static const char *const shown[] = {"assumed",
                                    "patient",
                                    "scanned",
                                    "resting_shares",
                                    "law",
                                    "force",
                                    "direction",
                                    "direction_constants",
                                    "stiffness",
                                    "midline_mm",
                                    "reference_volume_ml",
                                    "lung_share",
                                    "lesions",
                                    "reach_mm",
                                    "made_by"};
static const char *const errors[] = {"error_directions",  "error_rms_percent", "error_p95_percent",
                                     "error_max_percent", "error_volume_ml",   "error_rest_part",
                                     "error_rms_mm",      "error_p95_mm",      "error_max_mm"};
static const char *const error_lists[] = {"error_harmonics", "error_modes"};

static const char turned_over[] = "turned_over_percent";

static const char *text_or(const supine_basis *basis, const char *key, const char *missing) {
  const char *value = supine_basis_metadata(basis, key);
  return value != NULL ? value : missing;
}

static const char *text_of(const supine_basis *basis, const char *key) {
  return text_or(basis, key, "?");
}

/* Describe the state for which errors are given in mm. */
static void state_words(const supine_basis *basis, char *words, size_t size) {
  const char *part = supine_basis_metadata(basis, "error_rest_part");
  const char *volume = supine_basis_metadata(basis, "error_volume_ml");
  if (part != NULL && strcmp(part, "1") != 0) {
    (void)snprintf(words, size, "at %s of the way to rest", part);
  } else if (volume != NULL) {
    (void)snprintf(words, size, "at %s mL", volume);
  } else {
    (void)snprintf(words, size, part != NULL ? "at rest" : "of the fields as given");
  }
}

/* Print how many embedded vertices lie in each lung, and how deep. */
static void print_content(const supine_basis *basis, const char *content) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_tensor *tensor = supine_basis_tensor(basis, "depth");
  const bool well = tensor != NULL && tensor->dtype == SUPINE_F32 && tensor->rank == 1 &&
                    tensor->shape[0] == info->vertex_count;
  const float *depth = well ? tensor->data : NULL;
  size_t outside = 0;
  (void)printf("  %zu %s", info->vertex_count,
               strcmp(content, "grid") == 0   ? "nodes"
               : strcmp(content, "mesh") == 0 ? "vertices and points"
                                              : "points");
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    (void)printf("%s%zu %s", lung == 0 ? ": " : ", ",
                 info->lung_begin[lung + 1] - info->lung_begin[lung], info->lung_names[lung]);
  }
  for (size_t i = 0; depth != NULL && i < info->vertex_count; ++i) {
    outside += depth[i] < 0.0F;
  }
  if (depth != NULL) {
    (void)printf("; %zu of them outside", outside);
  }
  (void)printf("; %zu triangles; %s\n", info->triangle_count,
               info->has_volume ? "volumes are the lungs'" : "no volumes");
  const supine_tensor *rigid = supine_basis_tensor(basis, "rigid");
  if (rigid != NULL) {
    (void)printf("  rigid parts, moved and turned, never deformed: %zu\n", rigid->shape[0]);
  }
}

/* Print the expected error of a displacement from the scan to the default state, supine and prone.
 */
static supine_status print_expected(const supine_basis *basis, supine_error *error) {
  const supine_state scan = supine_basis_scan(basis);
  supine_status status = SUPINE_OK;
  bool first = true;
  for (int prone = 0; prone < 2 && status != SUPINE_ERROR_MEMORY; ++prone) {
    const supine_state state = {.gravity = {0.0, prone == 1 ? -1.0 : 1.0, 0.0},
                                .volume = supine_basis_default_volume(basis)};
    supine_expected expected = {0};
    char text[160];
    status = supine_options_expected_find(basis, &state, &scan, &expected, error);
    if (status == SUPINE_OK && expected.largest > 0.0) {
      (void)supine_state_describe(&state, text, sizeof text);
      (void)printf("%s  %s, counted from the scan: ",
                   first ? "\nExpected error, " SUPINE_EXPECTED_MEANING
                           ".\n" SUPINE_EXPECTED_SUPPORT "\n"
                         : "",
                   text);
      supine_options_expected_print(&expected, stdout);
      first = false;
    }
    supine_options_expected_free(&expected);
  }
  return status == SUPINE_ERROR_MEMORY ? status : SUPINE_OK; /* others: no error is stated */
}

/* Print how the basis was made, and the findings about its input. */
static void print_facts(const supine_basis *basis) {
  for (size_t i = 0; i < sizeof shown / sizeof *shown; ++i) {
    if (supine_basis_metadata(basis, shown[i]) != NULL) {
      (void)printf("  %-20s %s\n", shown[i], supine_basis_metadata(basis, shown[i]));
    }
  }
  const char *at = text_or(basis, "warnings", "");
  size_t length;
  for (const char *line; (line = supine_findings_next(&at, &length)) != NULL;) {
    (void)printf("  %-20s %.*s\n", "warnings", (int)length, line);
  }
}

static supine_status print_text(const char *path, const supine_basis *basis, const double *energy,
                                supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const char *content = supine_basis_metadata(basis, "content");
  char state[64];
  state_words(basis, state, sizeof state);
  (void)printf("%s: basis of %s%s%zu lung%s (%s), %s field\n", path, content != NULL ? content : "",
               content != NULL ? " inside " : "", info->lung_count,
               info->lung_count == 1 ? "" : "s", text_of(basis, "lungs"),
               info->vector ? "vector" : "scalar");
  if (content != NULL) {
    print_content(basis, content);
  } else {
    (void)printf("  %zu vertices, %zu triangles, %s\n", info->vertex_count, info->triangle_count,
                 info->has_volume ? "closed: volumes are exact" : "open: no volumes");
  }
  (void)printf(
      "  %zu %s of band %zu: %zu multiplications and %zu additions per vertex at run time\n",
      info->mode_count, strcmp(text_of(basis, "modes"), "harmonics") == 0 ? "harmonics" : "modes",
      info->band, info->mode_count * (info->vector ? 3 : 1) + (info->vector ? 0 : 3),
      info->mode_count * (info->vector ? 3 : 1) + (info->vector ? 0 : 2));
  print_facts(basis);
  const supine_status status = print_expected(basis, error);
  if (supine_basis_metadata(basis, "error_rms_percent") != NULL) {
    (void)printf(
        "\nCompression error%s against the full fields, on %s directions%s:\n"
        "             RMS   95th percentile   largest\n"
        "  %%   %10s   %15s   %7s   of the RMS displacement\n",
        content != NULL ? " of the lungs' surface" : "", text_of(basis, "error_directions"),
        supine_basis_metadata(basis, "error_method") != NULL ? ", each predicted from the others"
                                                             : " that no grid used",
        text_of(basis, "error_rms_percent"), text_of(basis, "error_p95_percent"),
        text_of(basis, "error_max_percent"));
    if (supine_basis_metadata(basis, "error_rms_mm") != NULL) {
      (void)printf("  mm  %10s   %15s   %7s   %s\n", text_of(basis, "error_rms_mm"),
                   text_of(basis, "error_p95_mm"), text_of(basis, "error_max_mm"), state);
    }
  }
  if (supine_basis_metadata(basis, turned_over) != NULL) {
    (void)printf("\nTriangles that are turned over %s, in the worst of six postures: %s %%\n",
                 state, text_of(basis, turned_over));
  }
  if (info->triangle_count == 0) {
    return status; /* energy is defined on the surface */
  }
  (void)puts("\nEnergy per band:");
  double odd = 0.0;
  double even = 0.0;
  for (size_t l = 0; l <= info->band; ++l) {
    odd += l % 2 == 1 ? energy[l] : 0.0;
    even += l % 2 == 0 && l > 0 ? energy[l] : 0.0;
    if (energy[l] >= 5e-8) {
      (void)printf("  l = %-3zu %10.5f %%\n", l, 100.0 * energy[l]);
    }
  }
  (void)printf("  odd    %10.5f %%   even beyond l = 0: %.5f %%\n", 100.0 * odd, 100.0 * even);
  return status;
}

static const double *error_list(const supine_basis *basis, const char *key, size_t *count) {
  const supine_tensor *tensor = supine_basis_tensor(basis, key);
  if (tensor == NULL || tensor->dtype != SUPINE_F64 || tensor->rank != 1) {
    *count = 0;
    return NULL;
  }
  *count = tensor->shape[0];
  return tensor->data;
}

/* Print the error against the number of functions of orientation. */
static void print_table(const supine_basis *basis) {
  size_t bands;
  size_t modes;
  const double *harmonics = error_list(basis, error_lists[0], &bands);
  const double *best = error_list(basis, error_lists[1], &modes);
  if (harmonics == NULL || best == NULL) {
    return;
  }
  (void)puts("\nRMS error against the number of multiplications:\n"
             "             first harmonics     best modes");
  for (size_t k = 1, l = 0; k <= modes || (l < bands && (l + 1) * (l + 1) <= 64); ++k) {
    const bool square = l < bands && (l + 1) * (l + 1) == k;
    if (square || k <= modes) {
      (void)printf("  %4zu + 3  ", k);
      if (square) {
        (void)printf("  %8.3f %% (l <= %zu)", 100.0 * harmonics[l], l);
        ++l;
      } else {
        (void)printf("%22s", "");
      }
      if (k <= modes) {
        (void)printf("  %7.3f %%", 100.0 * best[k - 1]);
      }
      (void)putchar('\n');
    }
  }
}

/* Add a fact of the metadata, where the basis has it, as a number where it is one. */
static void add_fact(json_t *object, const char *name, const supine_basis *basis, const char *key) {
  const char *text = supine_basis_metadata(basis, key);
  double value;
  if (text != NULL) {
    (void)json_object_set_new(object, name,
                              supine_options_parse_number(text, &value) ? json_real(value)
                                                                        : json_string(text));
  }
}

static json_t *list_numbers(const double *values, size_t count) {
  json_t *list = json_array();
  for (size_t k = 0; k < count; ++k) {
    (void)json_array_append_new(list, json_real(values[k]));
  }
  return list;
}

/* Print JSON; a failure of standard output is reported when the command ends. */
static void print_json(const char *path, const supine_basis *basis, const double *energy) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  json_t *error = json_object();
  json_t *warnings = json_array();
  const char *at = text_or(basis, "warnings", "");
  size_t length;
  for (size_t i = 0; i < sizeof errors / sizeof *errors; ++i) {
    add_fact(error, errors[i] + strlen("error_"), basis, errors[i]);
  }
  for (const char *line; (line = supine_findings_next(&at, &length)) != NULL;) {
    (void)json_array_append_new(warnings, json_stringn(line, length));
  }
  char printable[PATH_MAX] = "";
  supine_text_add(printable, sizeof printable, "%s", path);
  (void)supine_text_make_utf8(printable);
  json_t *root = json_pack(
      "{s:s, s:s, s:I, s:I, s:I, s:I, s:I, s:b, s:s, s:o, s:o, s:o}", "file", printable, "lungs",
      text_of(basis, "lungs"), "vertices", (json_int_t)info->vertex_count, "triangles",
      (json_int_t)info->triangle_count, "modes", (json_int_t)info->mode_count, "band",
      (json_int_t)info->band, "lung_count", (json_int_t)info->lung_count, "has_volume",
      (int)info->has_volume, "kind", info->vector ? "vector" : "scalar", "energy_per_band",
      list_numbers(energy, info->band + 1), "error", error, "warnings", warnings);
  for (size_t i = 0; i < sizeof shown / sizeof *shown; ++i) {
    add_fact(root, shown[i], basis, shown[i]);
  }
  add_fact(root, turned_over, basis, turned_over);
  for (size_t i = 0; i < 2; ++i) {
    size_t count;
    const double *values = error_list(basis, error_lists[i], &count);
    (void)json_object_set_new(root, error_lists[i], list_numbers(values, count));
  }
  (void)json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
  (void)putchar('\n');
  json_decref(root);
}

typedef struct request {
  bool json;
} request;

static const supine_option table[] = {
    {"json", 0, NULL, "print JSON instead of text", SUPINE_FILLS(request, json)}, {.name = NULL}};

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  const request *wanted = chosen;
  const char *path = given->operand[0];
  supine_basis *basis = NULL;
  double *energy = NULL;
  supine_status status = supine_options_basis_open(path, SUPINE_STORAGE_AUTO, &basis, error);
  if (status == SUPINE_OK) {
    energy = calloc(supine_basis_get_info(basis)->band + 1, sizeof *energy);
    status = energy != NULL ? band_energy(basis, energy, error) : SUPINE_ERROR_MEMORY;
  }
  if (status == SUPINE_OK && wanted->json) {
    print_json(path, basis, energy);
  } else if (status == SUPINE_OK) {
    status = print_text(path, basis, energy, error);
    print_table(basis);
  }
  free(energy);
  supine_basis_close(basis);
  return status;
}

const supine_command supine_command_info = {
    "info",
    "describe a basis file and its accuracy",
    .usage = "BASIS [--json]",
    .about =
        "Describes a basis file: lungs, functions of orientation, the model it was made with, and "
        "its error against the full solve, measured on held-out directions.\n"
        "\n"
        "Energy per band is the share of the squared displacement, over the surface and all "
        "orientations, that the harmonics of each band l carry. Odd bands change sign when gravity "
        "does; the even bands beyond l = 0 make prone differ from the exact reverse of supine.",
    .options = table,
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
