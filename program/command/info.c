/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine info: describe a basis file and its accuracy. */
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"

#include <supine/runtime.h>

#include "precompute/projection/accuracy.h"
#include "program/command/list.h"
#include "program/options/basis_input.h"
#include "program/options/facts.h"

/* Keys of the basis's metadata that are printed under the same name. */
static const char *const facts[] = {"content",
                                    "patient",
                                    "scanned",
                                    "full_expected",
                                    "resting_shares",
                                    "law",
                                    "force",
                                    "direction",
                                    "stiffness",
                                    "direction_constants",
                                    "midline_mm",
                                    "reference_volume_ml",
                                    "lung_share",
                                    "lesions",
                                    "reach_mm",
                                    "made_by",
                                    "clusters",
                                    "clusters_rms_mm",
                                    "clusters_seam_percent",
                                    "error_method",
                                    "turned_over_percent"};
/* Keys of metadata that are printed in the object "error", without the prefix "error_". */
static const char *const errors[] = {"error_directions",
                                     "error_rms_percent",
                                     "error_p95_percent",
                                     "error_max_percent",
                                     "error_between_percent",
                                     "error_gap_percent",
                                     "error_turning_rms_percent",
                                     "error_volume_ml",
                                     "error_rest_part",
                                     "error_rms_mm",
                                     "error_p95_mm",
                                     "error_max_mm",
                                     "error_between_mm",
                                     "error_gap_mm"};

/* Add the value of a metadata key to a JSON object, as a number if possible; skip missing keys. */
static void add_fact(json_t *object, const char *name, const supine_basis *basis, const char *key) {
  const char *text = supine_basis_metadata(basis, key);
  double value;
  if (text != NULL) {
    (void)json_object_set_new(object, name,
                              supine_options_parse_number(text, &value) ? json_real(value)
                                                                        : json_string(text));
  }
}

/* Add the numbers of embedded vertices in each lung and outside, and of rigid structures. */
static void add_content(json_t *root, const supine_basis *basis) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_tensor *depth = supine_basis_tensor(basis, "depth");
  const supine_tensor *rigid = supine_basis_tensor(basis, "rigid");
  json_t *counts = json_object();
  size_t outside = 0;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    (void)json_object_set_new(
        counts, info->lung_names[lung],
        json_integer((json_int_t)(info->lung_begin[lung + 1] - info->lung_begin[lung])));
  }
  if (depth != NULL && depth->dtype == SUPINE_F32 && depth->rank == 1 &&
      depth->shape[0] == info->vertex_count) {
    for (size_t i = 0; i < info->vertex_count; ++i) {
      outside += ((const float *)depth->data)[i] < 0.0F;
    }
    (void)json_object_set_new(counts, "outside", json_integer((json_int_t)outside));
  }
  if (rigid != NULL) {
    (void)json_object_set_new(counts, "rigid_parts", json_integer((json_int_t)rigid->shape[0]));
  }
  (void)json_object_set_new(root, "embedded", counts);
}

/* Add the terms of the expected error of a state to a list. */
static void add_terms(json_t *terms, const supine_basis *basis, const supine_state *state,
                      const char *text) {
  const supine_state scan = supine_basis_scan(basis);
  supine_expected_part parts[SUPINE_EXPECTED_TERMS];
  (void)supine_expected_parts(basis, state, &scan, parts, NULL);
  for (size_t k = 0; k < SUPINE_EXPECTED_TERMS; ++k) {
    if (parts[k].rms > 0.0) {
      (void)json_array_append_new(terms, json_pack("{s:s, s:s, s:f, s:s}", "state", text, "term",
                                                   parts[k].name, "rms_mm", parts[k].rms, "source",
                                                   parts[k].source));
    }
  }
}

/* Add the expected error of the positions in a state, and its terms, to two lists, if known. Return
 * SUPINE_OK or SUPINE_ERROR_MEMORY. */
static supine_status add_state(json_t *rows, json_t *terms, const supine_basis *basis,
                               const supine_state *state, supine_error *error) {
  const supine_state scan = supine_basis_scan(basis);
  supine_expected expected = {0};
  const supine_status status = supine_posed_expected(basis, state, &scan, &expected, error);
  if (status == SUPINE_OK && expected.largest > 0.0) {
    char text[160];
    (void)supine_state_describe(state, text, sizeof text);
    (void)json_array_append_new(
        rows, json_pack("{s:s, s:f, s:f, s:f, s:b}", "state", text, "rms_mm", expected.rms,
                        "largest_mm", expected.largest, "another_day_mm", expected.another_rms,
                        "extrapolated", (int)expected.turned));
    add_terms(terms, basis, state, text);
  }
  supine_posed_expected_free(&expected);
  return status == SUPINE_ERROR_MEMORY ? status : SUPINE_OK;
}

/* Add the expected errors of positions, and their terms, in supine and prone posture at the default
 * volume. Return SUPINE_OK or SUPINE_ERROR_MEMORY. */
static supine_status add_expected(json_t *root, const supine_basis *basis, supine_error *error) {
  json_t *rows = json_array();
  json_t *terms = json_array();
  supine_state state = {.gravity = {0.0, 1.0, 0.0}, .volume = supine_basis_default_volume(basis)};
  (void)json_object_set_new(root, "expected_error", rows);
  (void)json_object_set_new(root, "expected_error_terms", terms);
  SUPINE_TRY(add_state(rows, terms, basis, &state, error));
  state.gravity[1] = -1.0;
  return add_state(rows, terms, basis, &state, error);
}

/* Add a list of compression errors: "error_harmonics" by band, "error_modes" by number of modes. */
static void add_errors(json_t *root, const supine_basis *basis, const char *key) {
  const supine_tensor *tensor = supine_basis_tensor(basis, key);
  const bool valid = tensor != NULL && tensor->dtype == SUPINE_F64 && tensor->rank == 1;
  (void)json_object_set_new(root, key,
                            valid ? supine_options_json_numbers(tensor->shape[0], tensor->data)
                                  : json_array());
}

/* Operations of supine_deform for one vertex. */
typedef struct cost {
  size_t products, sums;
} cost;

static cost cost_of(const supine_basis_info *info) {
  if (info->cluster_count > 0) {
    return (cost){15, 15}; /* b + A p + a_0 Q_0 + a_1 Q_1 */
  }
  if (info->vector) {
    return (cost){3 * info->mode_count + 3, 3 * info->mode_count};
  }
  return (cost){info->mode_count + 6, info->mode_count + 2};
}

static supine_status describe(const char *path, const supine_basis *basis, const double *energy,
                              json_t **described, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const cost per_vertex = cost_of(info);
  const char *lungs = supine_basis_metadata(basis, "lungs");
  const char *at = supine_basis_metadata(basis, "warnings");
  json_t *of = json_object();
  json_t *warnings = json_array();
  size_t length;
  json_t *root =
      json_pack("{s:o, s:s, s:I, s:I, s:I, s:I, s:I, s:b, s:s, s:I, s:I}", "file",
                supine_options_json_text(path), "lungs", lungs != NULL ? lungs : "?", "vertices",
                (json_int_t)info->vertex_count, "triangles", (json_int_t)info->triangle_count,
                "modes", (json_int_t)info->mode_count, "band", (json_int_t)info->band, "lung_count",
                (json_int_t)info->lung_count, "has_volume", (int)info->has_volume, "kind",
                info->vector ? "vector" : "scalar", "multiplications",
                (json_int_t)per_vertex.products, "additions", (json_int_t)per_vertex.sums);
  for (size_t i = 0; i < sizeof facts / sizeof *facts; ++i) {
    add_fact(root, facts[i], basis, facts[i]);
  }
  (void)json_object_set_new(root, "facts", supine_options_facts(basis, !supine_options_as_json()));
  if (supine_basis_metadata(basis, "content") != NULL) {
    add_content(root, basis);
  }
  if (at != NULL) {
    for (; *at != '\0'; at += length + (at[length] == '\n' ? 1 : 0)) {
      length = strcspn(at, "\n");
      (void)json_array_append_new(warnings, json_stringn(at, length));
    }
  }
  (void)json_object_set_new(root, "warnings", warnings);
  for (size_t i = 0; i < sizeof errors / sizeof *errors; ++i) {
    add_fact(of, errors[i] + strlen("error_"), basis, errors[i]);
  }
  (void)json_object_set_new(root, "error", of);
  const supine_status status = add_expected(root, basis, error);
  (void)json_object_set_new(
      root, "energy_per_band",
      supine_options_json_numbers(info->triangle_count > 0 ? info->band + 1 : 0, energy));
  add_errors(root, basis, "error_harmonics");
  add_errors(root, basis, "error_modes");
  *described = root;
  return status;
}

typedef struct request {
  bool all;
} request;

static const supine_option table[] = {
    {"all", 0, NULL, "also print the terms of the expected error, and how the basis is made",
     SUPINE_FILLS(request, all)},
    {.name = NULL}};

/* What the text begins with: what the basis is, how sure, and what is assumed. */
static const char *const first[] = {"file",           "lungs",    "made_by",
                                    "expected_error", "facts",    "full_expected",
                                    "resting_shares", "warnings", "embedded"};

/* Put what matters into the order of the text, and add the rest if it is wanted. Free
 * `described`. */
static json_t *order_text(json_t *described, bool all) {
  json_t *text = json_object();
  for (size_t i = 0; i < sizeof first / sizeof *first; ++i) {
    json_t *value = json_object_get(described, first[i]);
    if (value != NULL) {
      (void)json_object_set(text, first[i], value);
    }
  }
  if (all) {
    (void)json_object_update_missing(text, described);
  }
  json_decref(described);
  return text;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  const request *wanted = chosen;
  const char *path = given->operand[0];
  static const supine_basis_options options = {sizeof options, .without_normals = true};
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *basis = NULL;
  double energy[SUPINE_SH_BAND_MAX + 1] = {0.0};
  json_auto_t *described = NULL;
  SUPINE_TRY(supine_basis_open_with(path, &options, &basis, error));
  SUPINE_TRY(supine_projection_band_shares(basis, energy, error));
  SUPINE_TRY(describe(path, basis, energy, &described, error));
  if (!supine_options_as_json()) {
    described = order_text(described, wanted->all);
  }
  supine_options_print(json_incref(described));
  return SUPINE_OK;
}

const supine_command supine_command_info = {
    "info",
    "describe a basis file and its accuracy",
    .usage = "BASIS [--json|--all]",
    .about = "Describes a basis file: its lungs, its basis functions (modes), the model it was "
             "made with, and its accuracy.",
    .options = table,
    .notes =
        "The compression error is the difference from the full solve on held-out directions, in "
        "percent of the RMS displacement, and in mm at the volume that is printed with it. It is "
        "also listed, as a share of the RMS displacement, for a basis cut off at band 0, 1, 2, ... "
        "and for the best 1, 2, 3, ... modes.\nTriangles that turn over are counted in the worst "
        "of six postures.\n"
        "The expected error is given for the displacement from the scan: " SUPINE_EXPECTED_MEANING
        ". " SUPINE_EXPECTED_SUPPORT "\n"
        "Displacement by band is the share of the squared displacement, over the surface and all "
        "orientations, in the harmonics of each band l = 0, 1, 2, ... Displacements of odd bands "
        "are reversed when gravity is reversed; those of even bands are not.",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
