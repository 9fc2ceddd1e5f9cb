/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print a basis file. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/locate.h>
#include <supine/safetensors.h>
#include <supine/sh.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/text.h"
#include "precompute/basis_file.h"
#include "precompute/lungs/disease.h"
#include "precompute/stored.h"
#include "runtime/checks.h"
#include "runtime/safetensors/safetensors_file.h"

enum { ENTRIES_MAX = 64 };

/* Metadata entries of a basis file. */
typedef struct entries {
  size_t count;
  supine_metadata metadata[ENTRIES_MAX];
  supine_arena *memory; /* of their values; failed if more than ENTRIES_MAX entries are added */
} entries;

SUPINE_PRINTF(3, 4)
static void add(entries *list, const char *key, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  const int length = supine_print_text_list(NULL, 0, format, arguments);
  va_end(arguments);
  char *text = supine_arena_take(list->memory, (size_t)length + 1, 1);
  va_start(arguments, format);
  if (list->count == ENTRIES_MAX) {
    list->memory->failed = true;
  } else if (text != NULL) {
    (void)supine_print_text_list(text, (size_t)length + 1, format, arguments);
    list->metadata[list->count++] = (supine_metadata){key, supine_text_make_utf8(text)};
  }
  va_end(arguments);
}

static void add_accuracy(entries *list, const supine_accuracy *accuracy, bool at_rest) {
  add(list, "error_directions", "%zu", accuracy->direction_count);
  add(list, "error_rms_percent", "%.6g", 100.0 * accuracy->relative_rms);
  add(list, "error_p95_percent", "%.6g", 100.0 * accuracy->relative_p95);
  add(list, "error_max_percent", "%.6g", 100.0 * accuracy->relative_max);
  if (accuracy->turning_rms > 0.0) {
    add(list, "error_turning_rms_percent", "%.6g", 100.0 * accuracy->turning_rms);
  }
  if (accuracy->volume > 0.0) {
    add(list, at_rest ? "error_rest_part" : "error_volume_ml", "%.6g", accuracy->volume);
  }
  if (accuracy->rms_mm > 0.0) {
    add(list, "error_rms_mm", "%.6g", accuracy->rms_mm);
    add(list, "error_p95_mm", "%.6g", accuracy->p95_mm);
    add(list, "error_max_mm", "%.6g", accuracy->max_mm);
  }
}

static void add_lesions(entries *list, size_t count, const double *factors) {
  size_t changed = 0;
  double low = 1.0;
  double high = 1.0;
  for (size_t i = 0; i < count; ++i) {
    changed += factors[i] != 1.0;
    low = fmin(low, factors[i]);
    high = fmax(high, factors[i]);
  }
  add(list, "lesions", "vertices=%zu factors=%.6g..%.6g", changed, low, high);
}

static void add_model(entries *list, const supine_lungs *lungs, const supine_model *model,
                      bool reference_known) {
  const supine_force_law *force = &model->force;
  const double *c = model->direction.c;
  const double *bend = model->bend;
  add(list, "law", "%s", supine_physics_law_names[model->law]);
  add(list, "midline_mm", "%.9g", lungs->midline);
  add(list, "force", "base=%.9g gain=%.9g cx=%.9g cy=%.9g cz=%.9g soften=%.9g", force->base,
      force->gain, force->box[0], force->box[1], force->box[2], force->soften);
  add(list, "direction", "box");
  add(list, "direction_constants", "c1=%.9g c2=%.9g c3=%.9g c4=%.9g c5=%.9g c6=%.9g shear=%.9g",
      c[0], c[1], c[2], c[3], c[4], c[5], model->direction.shear);
  add(list, "stiffness", "%s", model->stiffness == NULL ? "uniform" : "per vertex");
  if (model->lesions != NULL) {
    add_lesions(list, lungs->mesh.vertex_count, model->lesions);
  }
  if (reference_known && (bend[0] != 0.0 || bend[1] != 0.0 || bend[2] != 0.0)) {
    add(list, "bend", "%.9g,%.9g,%.9g", bend[0], bend[1], bend[2]);
  }
  if (model->reach > 0.0) {
    add(list, "reach_mm", "%.9g", model->reach);
  }
}

/* Add an entry with one number for each lung; a comma separates the numbers. */
static void add_by_lung(entries *list, const char *key, size_t count, const double values[2]) {
  if (count == 2) {
    add(list, key, "%.9g,%.9g", values[0], values[1]);
  } else {
    add(list, key, "%.9g", values[0]);
  }
}

static void add_reference(entries *list, const supine_reference *reference, const double share[2]) {
  const double *g = reference->scan.state.gravity;
  const bool full = reference->scan.state.volume.kind == SUPINE_VOLUME_FULL;
  char text[160];
  char shares[256];
  double volume[2];
  (void)supine_state_print(&reference->scan.state, text, sizeof text);
  const char *scanned = full ? "full" : "rest";
  if (reference->scan.state.volume.ml != 0.0) {
    scanned = "volume";
  }
  add(list, "scanned", "%s", scanned);
  add(list, "scan_state", "%s", text);
  add(list, "scan_gravity", "%.9g,%.9g,%.9g", g[0], g[1], g[2]);
  for (size_t lung = 0; lung < reference->lung_count; ++lung) {
    volume[lung] = share[lung] * reference->scan_volume[lung];
  }
  add_by_lung(list, "scan_volume_ml", reference->lung_count, volume);
  add(list, "full_volume_ml", "%.9g", reference->full_volume[0] + reference->full_volume[1]);
  add(list, "full_upright_gain", "%g", SUPINE_FULL_UPRIGHT_GAIN);
  supine_physics_resting_print(&reference->resting, shares, sizeof shares);
  add(list, "resting_shares", "%s", shares);
  /* State whether the ratio of the volumes at rest (FRC) and at full inflation is the patient's own
   * or, if not, the standard deviation of its logarithm. */
  if (supine_physics_resting_given(&reference->resting) || reference->scan.full > 0.0) {
    add(list, "resting_known", "yes");
  } else {
    add(list, "resting_spread", "%.4g", reference->resting.spread / reference->resting.assumed);
  }
}

/* Add the constants of the expected position error (supine/locate.h). */
static void add_expected_error(entries *list, const supine_prepared *prepared) {
  const supine_patient_record *record = prepared->patient;
  if (record == NULL || record->report.expected_constant == 0.0) {
    add(list, "expected_error_mm", "%g", SUPINE_EXPECTED_ERROR_MM);
    return;
  }
  add(list, "expected_error_mm", "%g", supine_patient_expected(record));
  add(list, "expected_error_from_mm", "%g", record->report.expected_from);
  add(list, "expected_error_source", "%s", prepared->fit);
  if (record->report.expected_share > 0.0) {
    add(list, "expected_error_share", "%.9g", record->report.expected_share);
  }
  if (record->gain_fitted) {
    add(list, "turn_fitted", "yes");
  }
}

static void add_fields(entries *list, const double *scan_gravity, const supine_computed *computed,
                       const supine_simulated_volumes *simulated) {
  const double *g = scan_gravity;
  const supine_clusters *clusters = &computed->clusters;
  const double size = supine_fields_size(&computed->fit);
  add(list, "route", "fields");
  add(list, "error_method", "leave-one-out");
  add(list, "error_between_percent", "%.6g", 100.0 * computed->errors.between_mm / size);
  add(list, "error_gap_percent", "%.6g", 100.0 * computed->errors.gap_mm / size);
  add(list, "error_between_mm", "%.6g", computed->errors.between_mm);
  add(list, "error_gap_mm", "%.6g", computed->errors.gap_mm);
  if (computed->compression.order > 0) {
    add(list, "simulated_total_ml", "%.17g,%.17g", simulated->total[0], simulated->total[1]);
    add(list, "simulated_runs", "%zu", computed->fit.fields->run_count);
    if (computed->fit.report.extrapolated > 0.0) {
      add(list, "error_extrapolated_percent", "%.6g", 100.0 * computed->fit.report.extrapolated);
    }
  }
  if (clusters->count > 0) {
    add(list, "clusters", "%zu", clusters->count);
    add(list, "clusters_rms_mm", "%.6g", clusters->rms);
    add(list, "clusters_seam_percent", "%.6g", 100.0 * clusters->seam);
  }
  if (g != NULL) {
    add(list, "scan_gravity", "%.9g,%.9g,%.9g", g[0], g[1], g[2]);
  }
}

static void add_lungs(entries *list, const supine_lungs *lungs, const double share[2]) {
  if (lungs->lung_count == 2) {
    add(list, "lungs", "left,right");
  } else {
    add(list, "lungs", "%s", supine_lungs_name(lungs, 0));
  }
  double volume[2];
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    volume[lung] = share[lung] * lungs->volume[lung];
  }
  add_by_lung(list, "reference_volume_ml", lungs->lung_count, volume);
  if (share[0] != 1.0 || share[1] != 1.0) {
    double hilum[2][3];
    /* As supine_pose.expansion. It follows from the share, but is stored, so that the run-time
     * library for WebAssembly needs no cube roots. */
    double expansion[2];
    for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
      supine_lungs_hilum_mean(
          lungs, lung, lungs->scanned != NULL ? lungs->scanned : lungs->mesh.vertices, hilum[lung]);
      expansion[lung] = 1.0 / cbrt(share[lung]) - 1.0;
    }
    add_by_lung(list, "lung_share", lungs->lung_count, share);
    add_by_lung(list, "lung_expansion", lungs->lung_count, expansion);
    if (lungs->lung_count == 2) {
      add(list, "lung_hilum_mm", "%.9g,%.9g,%.9g,%.9g,%.9g,%.9g", hilum[0][0], hilum[0][1],
          hilum[0][2], hilum[1][0], hilum[1][1], hilum[1][2]);
    } else {
      add(list, "lung_hilum_mm", "%.9g,%.9g,%.9g", hilum[0][0], hilum[0][1], hilum[0][2]);
    }
  }
}

static void add_normals(entries *list, const supine_normals_modes *normals, bool rest_known) {
  if (normals->count > 0) {
    add(list, rest_known ? "normals_range_ml" : "normals_range_mm", "%.0f..%.0f", normals->range[0],
        normals->range[1]);
    add(list, "normals_mean_degrees", "%.2g", normals->mean);
    add(list, "normals_p999_degrees", "%.2g", normals->p999);
  }
}

static void add_texts(entries *list, const supine_prepared *prepared) {
  const supine_findings *findings = &prepared->source.findings;
  const size_t room = SUPINE_FINDINGS_MAX * (SUPINE_FINDING_TEXT_MAX + sizeof "warning: \n");
  char *told = supine_arena_zeros(list->memory, room, 1);
  if (prepared->patient != NULL) {
    char *law = supine_patient_text(prepared->patient, NULL);
    list->memory->failed |= law == NULL;
    add(list, "patient_law", "%s", law != NULL ? law : "");
    add(list, "patient", "%s", prepared->fit);
    free(law);
  }
  add(list, "sources", "%s", prepared->sources);
  if (prepared->expected[0] != '\0') {
    add(list, "full_expected", "%s mL", prepared->expected);
  }
  const size_t count = told != NULL ? findings->count : 0;
  for (size_t i = 0; i < count; ++i) {
    supine_text_add(told, room, "%s%s: %s", i > 0 ? "\n" : "",
                    findings->list[i].is_warning ? "warning" : "note", findings->list[i].text);
  }
  if (count > 0) {
    add(list, "warnings", "%s", told);
  }
  if (prepared->source.frame.millimetres_per_unit > 0.0) {
    char letters[4];
    supine_mesh_axes_letters(prepared->source.frame.axes, letters);
    add(list, "scan_axes", "%s", letters);
    add(list, "scan_unit_mm", "%.17g", prepared->source.frame.millimetres_per_unit);
  }
}

/* Add all metadata in the file's order. */
static void add_all(entries *list, const supine_prepared *prepared,
                    const supine_basis_choice *choice, const supine_computed *computed,
                    const supine_stored *stored) {
  const double *share = prepared->model.share;
  const bool rest_known = computed->reference.known;
  const bool by_model = computed->kind == SUPINE_COMPUTED_BY_MODEL;
  add(list, "format", "supine-basis");
  add(list, "version", "4");
  add(list, "kind", "%s", stored->rows.kind == SUPINE_ROWS_VECTOR ? "vector" : "scalar");
  add(list, "band", "%zu", stored->field.band);
  add(list, "modes", "%s", choice->modes == 0 ? "harmonics" : "best");
  add(list, "mode_count", "%zu", stored->field.mode_count);
  add(list, "units", "mm");
  add(list, "axes", "LPS");
  add_lungs(list, &computed->lungs, share);
  if (by_model) {
    add_model(list, &computed->lungs, &prepared->model, rest_known);
    if (rest_known) {
      add_reference(list, &computed->reference, share);
    }
    add_expected_error(list, prepared);
  } else {
    add_fields(list, choice->scan_gravity, computed, &stored->simulated);
  }
  add_accuracy(list, &computed->accuracy, rest_known);
  if (by_model) {
    add(list, "turned_over_percent", "%.3g", 100.0 * computed->turned_over);
  }
  add_texts(list, prepared);
  add_normals(list, &stored->normals, rest_known);
  add(list, "made_by", "%s", choice->made_by != NULL ? choice->made_by : "supine_precompute");
}

enum { TENSORS_MAX = 28 };

/* Return the tensor of the coefficients, without data if they follow from clusters. */
static supine_tensor list_coefficients(const supine_computed *computed,
                                       const supine_stored *stored) {
  const size_t n = computed->lungs.mesh.vertex_count;
  const size_t k = stored->field.mode_count;
  const float *data = computed->clusters.count > 0 ? NULL : stored->field.coefficients;
  if (stored->rows.kind == SUPINE_ROWS_VECTOR) {
    return (supine_tensor){"coefficients", SUPINE_F32, 3, {n, 3, k}, data};
  }
  return (supine_tensor){"coefficients", SUPINE_F32, 2, {n, k}, data};
}

/* List the tensors in the file's order; return their number. */
static size_t list_tensors(const supine_computed *computed, const supine_stored *made,
                           supine_tensor list[TENSORS_MAX]) {
  const supine_lungs *lungs = &computed->lungs;
  const supine_compression *field = &made->field;
  const supine_volume_forms *forms = &computed->forms;
  const supine_error_table *table = &computed->table;
  const supine_fit_errors *e = &computed->errors;
  const size_t bands = table->band_count;
  const size_t modes = table->mode_count;
  const size_t n = lungs->mesh.vertex_count;
  const size_t k = field->mode_count;
  const size_t g = lungs->lung_count;
  const size_t q = made->normals.count;
  const supine_clusters *c = &computed->clusters;
  const supine_simulated_volumes *s = &made->simulated;
  const bool simulated = field->order > 0;
  const supine_tensor all[TENSORS_MAX] = {
      {"vertices", SUPINE_F32, 2, {n, 3}, made->vertices},
      {"triangles", SUPINE_U32, 2, {lungs->mesh.triangle_count, 3}, lungs->mesh.triangles},
      {"modes", SUPINE_F64, 3, {k, supine_sh_count(field->band), field->order + 1}, field->modes},
      {"lung", SUPINE_U8, 1, {n}, made->lung},
      list_coefficients(computed, made),
      {"clusters", SUPINE_U16, 1, {n}, c->cluster},
      {"cluster_scalars", SUPINE_I16, 2, {n, 2}, c->scalars},
      {"cluster_vectors", SUPINE_F32, 3, {c->count, k, SUPINE_CLUSTER_NUMBERS}, c->vectors},
      {"simulated_range", SUPINE_F64, 2, {g, 2}, simulated ? computed->fit.range : NULL},
      {"simulated_limits", SUPINE_F64, 3, {g, 2, s->limit_terms}, simulated ? s->limits : NULL},
      {"simulated_shares", SUPINE_F64, 3, {g, 9, s->share_count}, simulated ? made->shares : NULL},
      {"direction", SUPINE_F32, 2, {n, 3}, made->directions},
      {"lungs_hilum", SUPINE_F64, 3, {g, 3, k}, made->hilum},
      {"volume_linear", SUPINE_F64, 3, {g, 3, k}, forms->linear},
      {"volume_quadratic", SUPINE_F64, 4, {g, 3, k, k}, forms->quadratic},
      {"volume_cubic", SUPINE_F64, 4, {g, k, k, k}, forms->cubic},
      {"resting_volume", SUPINE_F64, 2, {g, 9}, made->rest},
      {"full_volume", SUPINE_F64, 2, {g, 9}, made->full},
      {"volume_range", SUPINE_F64, 3, {SUPINE_RANGE_NODES, g, 2}, made->volume_range},
      {"error_harmonics", SUPINE_F64, 1, {bands}, bands > 0 ? table->harmonics : NULL},
      {"error_modes", SUPINE_F64, 1, {modes}, modes > 0 ? table->modes : NULL},
      {"error_vertices", SUPINE_F32, 1, {n}, e->vertices},
      {"error_gravity", SUPINE_F64, 2, {e->rows, e->terms}, e->harmonics},
      {"error_volume", SUPINE_F64, 1, {e->volume_count}, e->by_volume},
      {"error_share", SUPINE_F32, 1, {n}, computed->error_share},
      {"landmarks", SUPINE_F32, 2, {computed->landmark_count, 4}, computed->landmarks},
      {"normals", SUPINE_I8, 3, {n, 3, q + 1}, made->normals.modes},
      {"normal_weights",
       SUPINE_F64,
       4,
       {g, q, 3, 1 + 2 * k + k * (k + 1) / 2},
       made->normals.weights}};
  size_t count = 0;
  for (size_t i = 0; i < TENSORS_MAX; ++i) {
    if (all[i].data != NULL) {
      list[count++] = all[i];
    }
  }
  return count;
}

/* Print the metadata and the tensors into memory. */
static supine_status print_bytes(const supine_prepared *prepared, const supine_basis_choice *choice,
                                 const supine_computed *computed, const supine_stored *stored,
                                 supine_bytes *bytes, supine_error *error) {
  SUPINE_ARENA arena = {0};
  entries list = {.memory = &arena};
  supine_tensor tensors[TENSORS_MAX];
  const size_t count = list_tensors(computed, stored, tensors);
  add_all(&list, prepared, choice, computed, stored);
  SUPINE_TRY(supine_arena_check(&arena, error, "metadata of a basis"));
  FILE *file = open_memstream(&bytes->data, &bytes->size);
  if (file == NULL) {
    return supine_error_memory(error, "a basis in memory");
  }
  supine_safetensors_print(file, tensors, count, list.metadata, list.count);
  const bool whole = ferror(file) == 0;
  if (fclose(file) != 0 || !whole) {
    return supine_error_memory(error, "a basis in memory");
  }
  return SUPINE_OK;
}

supine_status supine_precompute_print(const supine_prepared *prepared,
                                      const supine_basis_choice *choice, supine_computed *computed,
                                      supine_bytes *bytes, supine_error *error) {
  SUPINE_ARENA arena = {0};
  supine_stored stored;
  SUPINE_TRY(supine_precompute_store(prepared, choice, computed, &arena, &stored, error));
  SUPINE_TRY(print_bytes(prepared, choice, computed, &stored, bytes, error));
  SUPINE_TRY(supine_precompute_measure_stored(prepared, bytes->data, bytes->size, computed, &arena,
                                              &stored, error));
  free(bytes->data);
  *bytes = (supine_bytes){0};
  return print_bytes(prepared, choice, computed, &stored, bytes,
                     error); /* with what was measured */
}
