/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print a basis file. */
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/compare.h>
#include <supine/locate.h>
#include <supine/safetensors.h>
#include <supine/sh.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/text.h"
#include "precompute/basis_file.h"
#include "precompute/lungs/disease.h"
#include "precompute/normals/normal_modes.h"
#include "precompute/volume_range.h"
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
static void add_expected_error(entries *list, const supine_basis_content *content) {
  const supine_patient_record *record = content->prepared->patient;
  const bool fitted = record != NULL && record->report.expected_constant > 0.0;
  if (!content->is_fields) {
    add(list, "expected_error_mm", "%g",
        fitted ? supine_patient_expected(record) : SUPINE_EXPECTED_ERROR_MM);
  }
  if (fitted) {
    add(list, "expected_error_from_mm", "%g", record->report.expected_from);
    add(list, "expected_error_source", "%s", content->prepared->fit);
  }
  if (fitted && record->gain_fitted) {
    add(list, "turn_fitted", "yes");
  }
}

static void add_fields(entries *list, const supine_basis_content *content,
                       const supine_simulated_volumes *simulated) {
  const double *g = content->scan_gravity;
  const supine_clusters *clusters = content->clusters;
  add(list, "route", "fields");
  add(list, "error_method", "leave-one-out");
  if (content->compression->order > 0) {
    add(list, "simulated_total_ml", "%.17g,%.17g", simulated->total[0], simulated->total[1]);
    add(list, "simulated_runs", "%zu", content->fit->fields->run_count);
    if (content->fit->report.extrapolated > 0.0) {
      add(list, "error_extrapolated_percent", "%.6g", 100.0 * content->fit->report.extrapolated);
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
      supine_lungs_find_hilum(lungs, lung, hilum[lung]);
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

static void to_float(const double *values, size_t count, float *out) {
  for (size_t i = 0; i < count; ++i) {
    out[i] = (float)values[i];
  }
}

/* Arrays of a basis file, as they are stored. */
typedef struct stored {
  float *vertices;          /* [N, 3] */
  float *directions;        /* [N, 3] of SCALAR rows, otherwise NULL */
  unsigned char *lung;      /* [N] */
  supine_compression field; /* coefficients for collapsed lungs */
  supine_rows rows;         /* of `field`, in double precision */
  supine_normals_modes normals;
  supine_simulated_volumes simulated;                /* of fields over volume */
  double shares[2 * 9 * (SUPINE_FIT_ORDER_MAX + 1)]; /* simulated.shares without gaps */
  double named[2][2][9]; /* harmonics of rest and of full inflation, of fields over volume */
  const double *rest,
      *full;            /* [lungs, 9] harmonics of these volumes, mL above the surface; or NULL */
  double *volume_range; /* [SUPINE_RANGE_NODES, lungs, 2] volumes without folds, mL, or NULL */
} stored;

/* Shrink the displacements of VECTOR rows in collapsed lungs to the cube root of the lung's share.
 */
static void collapse_coefficients(const supine_lungs *lungs, const double share[2],
                                  const supine_compression *field, float *coefficients) {
  for (size_t i = 0; i < field->row_count; ++i) {
    const size_t lung = lungs->lung_count == 2 && i >= 3 * lungs->lung_begin[1];
    const float factor = (float)cbrt(share[lung]);
    for (size_t k = 0; k < field->mode_count; ++k) {
      const size_t at = i * field->mode_count + k;
      coefficients[at] = factor * field->coefficients[at];
    }
  }
}

/* Collapse the lungs and their displacements, and round them as in the file. */
static supine_status store(const supine_basis_content *content, supine_arena *arena, stored *made,
                           supine_error *error) {
  const supine_lungs *lungs = content->lungs;
  const double *share = content->prepared->model.share;
  const size_t n = lungs->mesh.vertex_count;
  const supine_compression *field = content->compression;
  double *collapsed = supine_arena_take(arena, 3 * n, sizeof *collapsed);
  *made = (stored){.vertices = supine_arena_take(arena, 3 * n, sizeof(float)),
                   .lung = supine_arena_take(arena, n, 1),
                   .rest = content->resting,
                   .field = *field,
                   .rows = content->rows};
  SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices of a basis", n));
  supine_lungs_collapse(lungs, share, collapsed);
  to_float(collapsed, 3 * n, made->vertices);
  for (size_t i = 0; i < n; ++i) {
    made->lung[i] = lungs->lung_count == 2 && i >= lungs->lung_begin[1] ? 1 : 0;
  }
  if (content->rows.kind == SUPINE_ROWS_SCALAR) {
    made->directions = supine_arena_take(arena, 3 * n, sizeof(float));
    SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices of a basis", n));
    memcpy(collapsed, content->rows.directions, 3 * n * sizeof *collapsed);
    supine_lungs_collapse_directions(lungs, share, collapsed);
    to_float(collapsed, 3 * n, made->directions);
    made->rows.directions = collapsed;
  } else if (share[0] != 1.0 || share[1] != 1.0) {
    made->field.coefficients =
        supine_arena_take(arena, field->row_count * field->mode_count, sizeof(float));
    SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices of a basis", n));
    collapse_coefficients(lungs, share, field, made->field.coefficients);
  }
  return SUPINE_OK;
}

/* Find the numbers by which a basis over volume finds its parameters. */
static supine_status store_volumes(const supine_fit *fit, stored *made, supine_error *error) {
  SUPINE_TRY(supine_fields_volumes_fit(fit, &made->simulated, error));
  const size_t count = made->simulated.share_count;
  for (size_t i = 0; i < 2 * 9 * count; ++i) {
    made->shares[i] = made->simulated.shares[i / count / 9][i / count % 9][i % count];
  }
  return SUPINE_OK;
}

/* Find the modes of the vertex normals from vertices and displacements rounded as in the file. */
static supine_status find_normals(const supine_basis_content *content, supine_arena *arena,
                                  stored *made, supine_error *error) {
  static const double straight[3] = {0.0, 0.0, 0.0};
  const supine_normals_surface surface = {
      .lungs = content->lungs,
      .vertices = made->vertices,
      .kind = made->rows.kind,
      .directions = made->directions,
      .field = &made->field,
      .resting = content->resting,
      .forms = content->forms,
      .bend = content->reference != NULL ? content->prepared->model.bend : straight};
  return supine_normals_modes_create(&surface, arena, &made->normals, error);
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
  const char *findings = prepared->source.findings.text;
  if (prepared->patient != NULL) {
    char *law = supine_patient_text(prepared->patient, NULL);
    list->memory->failed |= law == NULL;
    add(list, "patient_law", "%s", law != NULL ? law : "");
    add(list, "patient", "%s", prepared->fit);
    free(law);
  }
  if (prepared->assumed[0] != '\0') {
    add(list, "assumed", "%s", prepared->assumed);
  }
  if (findings[0] != '\0') {
    add(list, "warnings", "%.*s", (int)strlen(findings) - 1, findings);
  }
  if (prepared->source.frame.millimetres_per_unit > 0.0) {
    char letters[4];
    supine_mesh_axes_letters(prepared->source.frame.axes, letters);
    add(list, "scan_axes", "%s", letters);
    add(list, "scan_unit_mm", "%.17g", prepared->source.frame.millimetres_per_unit);
  }
}

/* Add all metadata in the file's order. */
static void add_all(entries *list, const supine_basis_content *content, const stored *made) {
  const double *share = content->prepared->model.share;
  add(list, "format", "supine-basis");
  add(list, "version", "4");
  add(list, "kind", "%s", content->rows.kind == SUPINE_ROWS_VECTOR ? "vector" : "scalar");
  add(list, "band", "%zu", content->compression->band);
  add(list, "modes", "%s", content->is_harmonics ? "harmonics" : "best");
  add(list, "mode_count", "%zu", content->compression->mode_count);
  add(list, "units", "mm");
  add(list, "axes", "LPS");
  add_lungs(list, content->lungs, share);
  if (!content->is_fields) {
    add_model(list, content->lungs, &content->prepared->model, content->reference != NULL);
  }
  if (content->reference != NULL) {
    add_reference(list, content->reference, share);
  }
  add_expected_error(list, content);
  if (content->is_fields) {
    add_fields(list, content, &made->simulated);
  }
  add_accuracy(list, content->accuracy, content->reference != NULL);
  if (content->turned_over != NULL) {
    add(list, "turned_over_percent", "%.3g", 100.0 * *content->turned_over);
  }
  add_texts(list, content->prepared);
  add_normals(list, &made->normals, content->resting != NULL);
  add(list, "made_by", "%s", content->made_by != NULL ? content->made_by : "supine_precompute");
}

enum { TENSORS_MAX = 22 };

static void basis_close(supine_basis **basis) {
  supine_basis_close(*basis);
}

/* Return the tensor of the coefficients, without data if they follow from clusters. */
static supine_tensor list_coefficients(const supine_basis_content *content, const stored *made) {
  const size_t n = content->lungs->mesh.vertex_count;
  const size_t k = made->field.mode_count;
  const float *data = content->clusters->count > 0 ? NULL : made->field.coefficients;
  if (content->rows.kind == SUPINE_ROWS_VECTOR) {
    return (supine_tensor){"coefficients", SUPINE_F32, 3, {n, 3, k}, data};
  }
  return (supine_tensor){"coefficients", SUPINE_F32, 2, {n, k}, data};
}

/* List the tensors in the file's order; return their number. */
static size_t list_tensors(const supine_basis_content *content, const stored *made,
                           supine_tensor list[TENSORS_MAX]) {
  static const supine_error_table no_table;
  const supine_lungs *lungs = content->lungs;
  const supine_compression *field = &made->field;
  const supine_volume_forms *forms = content->forms;
  const supine_error_table *table = content->table != NULL ? content->table : &no_table;
  const size_t n = lungs->mesh.vertex_count;
  const size_t k = field->mode_count;
  const size_t g = lungs->lung_count;
  const size_t q = made->normals.count;
  const supine_clusters *clusters = content->clusters;
  const supine_simulated_volumes *s = &made->simulated;
  const bool simulated = field->order > 0;
  const supine_tensor all[TENSORS_MAX] = {
      {"vertices", SUPINE_F32, 2, {n, 3}, made->vertices},
      {"triangles", SUPINE_U32, 2, {lungs->mesh.triangle_count, 3}, lungs->mesh.triangles},
      {"modes", SUPINE_F64, 3, {k, supine_sh_count(field->band), field->order + 1}, field->modes},
      {"lung", SUPINE_U8, 1, {n}, made->lung},
      list_coefficients(content, made),
      {"clusters", SUPINE_U16, 1, {n}, clusters->cluster},
      {"cluster_scalars", SUPINE_I16, 2, {n, 2}, clusters->scalars},
      {"cluster_vectors",
       SUPINE_F32,
       3,
       {clusters->count, k, SUPINE_CLUSTER_NUMBERS},
       clusters->vectors},
      {"simulated_range", SUPINE_F64, 2, {g, 2}, simulated ? content->fit->range : NULL},
      {"simulated_limits", SUPINE_F64, 3, {g, 2, 9}, simulated ? s->limits : NULL},
      {"simulated_shares", SUPINE_F64, 3, {g, 9, s->share_count}, simulated ? made->shares : NULL},
      {"direction", SUPINE_F32, 2, {n, 3}, made->directions},
      {"volume_linear", SUPINE_F64, 3, {g, 3, k}, forms->linear},
      {"volume_quadratic", SUPINE_F64, 4, {g, 3, k, k}, forms->quadratic},
      {"volume_cubic", SUPINE_F64, 4, {g, k, k, k}, forms->cubic},
      {"resting_volume", SUPINE_F64, 2, {g, 9}, made->rest},
      {"full_volume", SUPINE_F64, 2, {g, 9}, made->full},
      {"volume_range", SUPINE_F64, 3, {SUPINE_RANGE_NODES, g, 2}, made->volume_range},
      {"error_harmonics",
       SUPINE_F64,
       1,
       {table->band_count},
       table == &no_table ? NULL : table->harmonics},
      {"error_modes", SUPINE_F64, 1, {table->mode_count}, table == &no_table ? NULL : table->modes},
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
static supine_status print_bytes(const supine_basis_content *content, const stored *made,
                                 supine_bytes *bytes, supine_error *error) {
  SUPINE_ARENA arena = {0};
  entries list = {.memory = &arena};
  supine_tensor tensors[TENSORS_MAX];
  const size_t count = list_tensors(content, made, tensors);
  add_all(&list, content, made);
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

/* Find the volume of each lung, as harmonics of the direction of gravity, where all lungs hold a
 * total volume: as the simulator divided it.
 * @param totals      [6] with gravity along +x, -x, +y, -y, +z, -z, mL
 * @param harmonics   [lungs] written, mL above the reference surface */
static supine_status divide(const supine_basis *basis, const double totals[6], const char *what,
                            double (*harmonics)[9], supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double volume[2][6];
  for (size_t axis = 0; axis < 6; ++axis) {
    supine_state state = {.volume = {SUPINE_VOLUME_ABSOLUTE, totals[axis]}};
    double held[SUPINE_LUNGS_MAX];
    char text[160];
    supine_pose pose;
    supine_error inner;
    state.gravity[axis / 2] = axis % 2 == 0 ? 1.0 : -1.0;
    (void)supine_state_describe(&state, text, sizeof text);
    supine_status status = supine_basis_pose(basis, &state, &pose, &inner);
    if (status != SUPINE_OK) {
      return supine_error_wrap(error, &inner, "%s, %s: ", what, text);
    }
    SUPINE_TRY(supine_basis_volumes(basis, &pose, held));
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      volume[lung][axis] = held[lung] - info->reference_volume[lung];
    }
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    supine_physics_resting_harmonics(volume[lung], harmonics[lung]);
  }
  return SUPINE_OK;
}

/* Name rest and full inflation among the simulated volumes, where they are known. */
static supine_status name_volumes(const supine_basis *basis, const supine_named_volumes *named,
                                  stored *made, supine_error *error) {
  const double full = named->full;
  const double totals[6] = {full, full, full, full, full, full};
  if (named->has_rest) {
    SUPINE_TRY(divide(basis, named->rest,
                      "volumes at rest (those not given are assumed from the others)",
                      made->named[0], error));
    made->rest = made->named[0][0];
  }
  if (full > 0.0) {
    SUPINE_TRY(divide(basis, totals, "volume at full inflation", made->named[1], error));
    made->full = made->named[1][0];
  }
  return SUPINE_OK;
}

/* Measure the error of the basis relative to what depends on gravity: the squared displacement
 * without that of band 0. A surface without area has none. */
static supine_status measure_turning(const supine_basis *basis, supine_accuracy *accuracy,
                                     supine_error *error) {
  const size_t bands = supine_basis_get_info(basis)->band + 1;
  double energy[SUPINE_SH_BAND_MAX + 1];
  double turning = 0.0;
  supine_compare *compare = NULL;
  const supine_status status = supine_compare_create(basis, &compare, error);
  if (status != SUPINE_OK) {
    return status == SUPINE_ERROR_MESH ? SUPINE_OK : status;
  }
  supine_compare_energy(compare, energy);
  supine_compare_destroy(compare);
  for (size_t l = 1; l < bands; ++l) {
    turning += energy[l];
  }
  if (turning > 0.0) {
    accuracy->turning_rms = accuracy->relative_rms * sqrt(1.0 + energy[0] / turning);
  }
  return SUPINE_OK;
}

/* Open the printed basis, add the error of storage to content->accuracy, and measure the volumes
 * that the lungs can hold, or those of rest and full inflation. */
static supine_status measure_printed(const supine_basis_content *content, const supine_bytes *bytes,
                                     supine_arena *arena, stored *made, supine_error *error) {
  const supine_basis_options options = {
      .size = sizeof options, .simd = SUPINE_SIMD_PORTABLE, .without_normals = true};
  SUPINE_FREED_BY(basis_close) supine_basis *basis = NULL;
  SUPINE_TRY(supine_basis_open_memory_with(bytes->data, bytes->size, &options, &basis, error));
  supine_compression exact = made->field;
  if (content->clusters->count > 0) {
    exact.coefficients = (float *)(uintptr_t)content->exact; /* only read */
  }
  SUPINE_TRY(supine_projection_accuracy_add_storage(basis, &exact, &made->rows, content->accuracy));
  SUPINE_TRY(measure_turning(basis, content->accuracy, error));
  if (content->compression->order > 0) { /* the simulations give the range of volumes */
    return name_volumes(basis, &content->prepared->named, made, error);
  }
  if (content->resting == NULL) {
    return SUPINE_OK;
  }
  made->volume_range = supine_arena_take(arena, SUPINE_RANGE_NODES * content->lungs->lung_count * 2,
                                         sizeof *made->volume_range);
  SUPINE_TRY(supine_arena_check(arena, error, "the range of volumes"));
  return supine_precompute_volume_range(basis, made->volume_range, error);
}

supine_status supine_precompute_print(const supine_basis_content *content, supine_bytes *bytes,
                                      supine_error *error) {
  SUPINE_ARENA arena = {0};
  stored made;
  SUPINE_TRY(store(content, &arena, &made, error));
  if (content->compression->order > 0) {
    SUPINE_TRY(store_volumes(content->fit, &made, error));
  }
  if (!content->without_normals && content->compression->order == 0) {
    SUPINE_TRY(find_normals(content, &arena, &made, error));
  }
  SUPINE_TRY(print_bytes(content, &made, bytes, error));
  SUPINE_TRY(measure_printed(content, bytes, &arena, &made, error));
  free(bytes->data);
  *bytes = (supine_bytes){0};
  return print_bytes(content, &made, bytes, error); /* again, with what was measured */
}
