/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make a basis: expand displacements in harmonics, compress them, measure the error, and print. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/output.h"
#include <supine/volume.h>

#include "precompute/clusters/clusters.h"
#include "precompute/precompute.h"

/* The default number of held-out directions of gravity is HELD_OUT_WORK divided by the number of
 * vertices, but at least HELD_OUT_MIN and at most HELD_OUT_MAX. With 100 directions, the measured
 * error is accurate to about 5 %, with 1000 to 1 or 2 %. */
enum { HELD_OUT_MIN = 100, HELD_OUT_MAX = 1000, HELD_OUT_WORK = 20000000 };

/* Errors in mm are measured at the resting volume (FRC). If it is unknown, they are measured at the
 * volume of the reference surface plus `breath_volume`, mL. */
static const double breath_volume = 500.0;
static const double sqrt_4pi = 3.5449077018110321;

static size_t held_out_count(const supine_lungs *lungs, size_t wanted) {
  const size_t count = HELD_OUT_WORK / lungs->mesh.vertex_count;
  if (wanted > 0) {
    return wanted;
  }
  if (count < HELD_OUT_MIN) {
    return HELD_OUT_MIN;
  }
  return count < HELD_OUT_MAX ? count : HELD_OUT_MAX;
}

/* What the displacement of a basis is compared with: exact solutions of the model for held-out
 * directions of gravity or, if another simulator computed the displacement, each of its fields
 * predicted from the others. */
typedef struct evidence {
  bool is_fields;
  supine_truth truth;       /* of the model */
  supine_error_table table; /* error against `truth`, by number of harmonics and of modes */
  supine_fields counted;    /* another simulator's fields over volume, counted from the scan */
  supine_fit fit;           /* of another simulator's fields */
} evidence;

static void evidence_free(evidence *given) {
  supine_projection_truth_free(&given->truth);
  supine_fields_fit_free(&given->fit);
  supine_fields_free(&given->counted);
}

/* Lungs, model -> expansion of the force -> field of displacements, and exact solutions. */
static supine_status solve_model(const supine_lungs *lungs, const supine_model *model,
                                 const supine_basis_choice *choice, supine_gravity_field *field,
                                 evidence *given, supine_error *error) {
  SUPINE_FREED_BY(supine_projection_free) supine_projection projection = {0};
  const size_t count = held_out_count(lungs, choice->held_out);
  SUPINE_TRY(supine_projection_create(lungs, model, choice->band, &projection, error));
  SUPINE_TRY(supine_projection_field(lungs, model, &projection, field, error));
  return supine_projection_truth_create(lungs, model, projection.span, field, count, &given->truth,
                                        error);
}

/* Another simulator's fields -> field of displacements, and predictions of each from the others. */
static supine_status fit_fields(const supine_prepared *prepared, const supine_basis_choice *choice,
                                supine_gravity_field *field, evidence *given, supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const supine_named_volumes *named = &prepared->named;
  given->is_fields = true;
  SUPINE_TRY(supine_fields_fit(choice->fields, lungs, choice->choose_band ? -1 : (int)choice->band,
                               &given->fit, error));
  SUPINE_REFUSE_IF(given->fit.report.order == 0 && (named->has_rest || named->full > 0.0), error,
                   SUPINE_ERROR_ARGUMENT,
                   "the simulations have one volume for each direction of gravity: simulate "
                   "several volumes, or leave out those at rest and at full inflation");
  if (given->fit.report.order > 0 && choice->scan_gravity != NULL) {
    const int band = (int)given->fit.report.band;
    SUPINE_TRY(
        supine_fields_count_from_scan(&given->fit, choice->scan_gravity, &given->counted, error));
    supine_fields_fit_free(&given->fit);
    SUPINE_TRY(supine_fields_fit(&given->counted, lungs, band, &given->fit, error));
    SUPINE_TRY(supine_fields_check_scan(&given->fit, choice->scan_gravity, error)); /* as moved */
  }
  return supine_fields_field(&given->fit, field, error);
}

/* Field -> K modes, without those that raise the error by less than 1 % together. Or use the
 * harmonics themselves. */
static supine_status compress(const supine_gravity_field *field, const supine_basis_choice *choice,
                              evidence *given, supine_compression *compression,
                              supine_error *error) {
  double singular[SUPINE_MODES_MADE_MAX];
  double total = 0.0;
  if (choice->modes == 0) {
    SUPINE_TRY(supine_sh_compress_harmonics(&field->expansion, compression, error));
  } else {
    SUPINE_TRY(supine_sh_compress_modes(&field->expansion, field->weight, choice->modes,
                                        compression, singular, &total, error));
  }
  const size_t count = compression->mode_count;
  double relative = 0.0; /* relative RMS error with all modes */
  if (given->is_fields) {
    relative = supine_fields_fit_error(&given->fit);
  } else {
    SUPINE_TRY(supine_projection_error_table_create(&given->truth, field, compression,
                                                    &given->table, error));
    relative = given->table.modes[count - 1];
  }
  if (choice->modes > 0 && !choice->keep_modes) {
    supine_sh_compression_truncate(compression, field->expansion.rank,
                                   supine_sh_modes_needed(count, singular, total, relative));
  }
  return SUPINE_OK;
}

/* Compression of fields -> clusters of vertices that move alike, if the basis stores them. Their
 * coefficients then replace those of the compression, so that all that follows is of what is
 * stored.
 * @param exact  written: the coefficients that were replaced; NULL if none were */
static supine_status cluster(const supine_lungs *lungs, const supine_basis_choice *choice,
                             const evidence *given, supine_compression *compression,
                             supine_clusters *clusters, float **exact, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  SUPINE_ARENA arena = {0};
  float *vertices = supine_arena_take(&arena, 3 * n, sizeof *vertices);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_fields_cluster(&given->fit, compression, choice->storage, clusters, error));
  if (clusters->count == 0) {
    return SUPINE_OK;
  }
  float *stored = malloc(3 * n * compression->mode_count * sizeof *stored);
  if (stored == NULL) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    vertices[i] = (float)lungs->mesh.vertices[i];
  }
  supine_clusters_expand(clusters, vertices, stored);
  *exact = compression->coefficients;
  compression->coefficients = stored;
  return SUPINE_OK;
}

static void free_floats(float **array) {
  free(*array);
}

/* The surface from which displacements are measured, and the state of the scan. */
typedef struct surface {
  supine_lungs lungs; /* the given lungs, or a copy whose vertices anchor() has corrected */
  supine_reference reference;
  supine_arena memory; /* of the corrected vertices */
} surface;

static void surface_free(surface *of) {
  supine_arena_free(&of->memory);
}

/* Correct the vertices of the reference surface so that the displacement computed from the modes
 * moves them exactly to the scan, in the posture of the scan. The corrected position of a vertex is
 *
 *     p_j = scan_j - A_j u_j        along axis j
 *
 * A_j is the gain (factor on the displacement) at which its lung has the volume of the scan, and u
 * is the displacement computed from the modes. */
static supine_status anchor(const supine_prepared *prepared, const supine_rows *rows,
                            const supine_compression *compression, surface *made,
                            supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const size_t n = lungs->mesh.vertex_count;
  double weights[SUPINE_MODES_MADE_MAX];
  *made = (surface){.lungs = *lungs, .reference = prepared->reference};
  if (!made->reference.known || lungs->scanned == NULL) {
    return SUPINE_OK;
  }
  SUPINE_ARENA arena = {0};
  double *u = supine_arena_take(&arena, 3 * n, sizeof *u);
  double *ones = supine_arena_take(&arena, n, sizeof *ones);
  double *vertices = supine_arena_take(&made->memory, 3 * n, sizeof *vertices);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_arena_check(&made->memory, error, "%zu vertices", n));
  supine_sh_compression_weights(compression, made->reference.scan.state.gravity, weights);
  supine_projection_displacement(compression, rows, weights, u);
  for (size_t i = 0; i < n; ++i) {
    ones[i] = 1.0;
  }
  memcpy(vertices, lungs->scanned, 3 * n * sizeof *vertices);
  made->lungs.mesh.vertices = vertices;
  SUPINE_TRY(supine_physics_reference_find_gains(&made->lungs, prepared->model.bend, u, ones,
                                                 &made->reference, error));
  for (size_t i = 0; i < 3 * n; ++i) {
    const size_t lung = lungs->lung_count == 2 && i >= 3 * lungs->lung_begin[1];
    vertices[i] -= made->reference.scan_gains[lung][i % 3] * u[i];
  }
  supine_lungs_measure_volumes(&made->lungs);
  return SUPINE_OK;
}

/* Let displacements of gravity alone count from the scan, whose gravity is known: subtract from
 * each mode its weight w in this posture, so that the given surface reproduces the scan. The
 * constant harmonic is 1 / sqrt(4 pi), so that its coefficient falls by sqrt(4 pi) w. fit_fields
 * does this for displacements over gravity and volume.
 * @param scan_gravity  [3], or NULL if gravity does not displace the given surface */
static void count_from_scan(const supine_fit *fit, const double *scan_gravity,
                            supine_compression *compression) {
  double weights[SUPINE_MODES_MADE_MAX];
  if (scan_gravity == NULL || fit->report.order > 0) {
    return;
  }
  supine_sh_compression_weights(compression, scan_gravity, weights);
  for (size_t k = 0; k < compression->mode_count; ++k) {
    compression->modes[k * supine_sh_count(compression->band)] -= sqrt_4pi * weights[k];
  }
}

/* Volumes by the direction of gravity minus those of the reference surface, mL, as coefficients of
 * the 9 spherical harmonics to degree 2. */
typedef struct volumes {
  double resting[2][9]; /* of each lung at rest (FRC), if known */
  double measured[9];   /* of all lungs, at which errors are measured */
} volumes;

/* Check that each lung can reach its resting volume (FRC) with gravity along the unit vector g.
 * @param volume  [lungs] resting volume minus that of the reference surface, mL */
static supine_status check_rest(const supine_compression *compression,
                                const supine_volume_forms *forms, const double g[3],
                                const double *volume, supine_error *error) {
  double weights[SUPINE_MODES_MADE_MAX];
  supine_error inner = {0};
  supine_sh_compression_weights(compression, g, weights);
  for (size_t lung = 0; lung < forms->lung_count; ++lung) {
    static const double straight[3] = {0.0, 0.0, 0.0};
    supine_volume_form form;
    double gains[3];
    supine_physics_volume_forms_contract_lung(forms, lung, weights, &form);
    const supine_status status =
        supine_volume_form_gains(&form, straight, 0.0, volume[lung], gains, &inner);
    if (status != SUPINE_OK) {
      inner.status = SUPINE_ERROR_NUMERICAL;
      inner.remedy = SUPINE_REMEDY_REST_OR_AS_IS;
      return supine_error_wrap(
          error, &inner,
          "with gravity along %g,%g,%g the volume at rest cannot be %.0f mL below full inflation: ",
          g[0], g[1], g[2], -volume[lung]);
    }
  }
  return SUPINE_OK;
}

/* Find the resting volumes (FRC) if they are known, and the volume at which errors in mm are
 * measured. Harmonics interpolate the volumes for gravity along the six axes.
 * @param share  volume of each lung divided by its healthy volume */
static supine_status find_volumes(const supine_reference *reference, const double share[2],
                                  const supine_compression *compression,
                                  const supine_volume_forms *forms, volumes *found,
                                  supine_error *error) {
  double volume[2][6];
  *found = (volumes){.measured = {breath_volume * sqrt_4pi}};
  if (!reference->known) {
    return SUPINE_OK;
  }
  for (size_t axis = 0; axis < 6; ++axis) {
    double g[3] = {0.0, 0.0, 0.0};
    double rest[2];
    g[axis / 2] = axis % 2 == 0 ? 1.0 : -1.0;
    (void)supine_physics_reference_rest(reference, g, rest);
    for (size_t lung = 0; lung < reference->lung_count; ++lung) {
      rest[lung] = share[lung] * (rest[lung] - reference->full_volume[lung]);
      volume[lung][axis] = rest[lung];
    }
    SUPINE_TRY(check_rest(compression, forms, g, rest, error));
  }
  for (size_t lung = 0; lung < reference->lung_count; ++lung) {
    supine_physics_resting_harmonics(volume[lung], found->resting[lung]);
  }
  for (size_t t = 0; t < 9; ++t) {
    found->measured[t] = found->resting[0][t] + found->resting[1][t];
  }
  return SUPINE_OK;
}

/* Measure the errors of a basis and, with the model, the share of triangles that turn over. */
static supine_status measure(const evidence *given, const supine_basis_content *basis,
                             const volumes *at, supine_basis_report *made, supine_error *error) {
  const supine_compression *compression = basis->compression;
  if (given->is_fields) {
    made->fit = given->fit.report;
    return supine_fields_measure(&given->fit, basis->is_harmonics ? 0 : compression->mode_count,
                                 &made->accuracy, error);
  }
  SUPINE_TRY(supine_projection_accuracy_measure(&given->truth, compression, &basis->rows,
                                                basis->forms, at->measured, &made->accuracy,
                                                error));
  made->accuracy.volume *= basis->reference != NULL ? 1.0 : breath_volume;
  return supine_projection_turned_over(basis->lungs, &basis->rows, compression, basis->forms,
                                       at->measured, &made->turned_over, error);
}

/* Tell that `done` of the steps of supine_precompute are done. */
static supine_status tell_progress(const supine_basis_choice *choice, size_t done,
                                   supine_error *error) {
  enum { STEPS = 7 };
  bool wanted = true;
  if (choice->progress != NULL) {
    wanted = choice->progress(choice->progress_context, (double)done / STEPS);
  }
  SUPINE_REFUSE_IF(!wanted, error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
  return SUPINE_OK;
}

supine_status supine_precompute(const supine_prepared *prepared, const supine_basis_choice *choice,
                                supine_bytes *bytes, supine_basis_report *report,
                                supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  SUPINE_FREED_BY(evidence_free) evidence given = {.is_fields = choice->fields != NULL};
  SUPINE_FREED_BY(supine_projection_field_free) supine_gravity_field field = {0};
  SUPINE_FREED_BY(supine_sh_compression_free) supine_compression compression = {0};
  SUPINE_FREED_BY(supine_clusters_free) supine_clusters clusters = {0};
  SUPINE_FREED_BY(free_floats) float *exact = NULL;
  SUPINE_FREED_BY(surface_free) surface of = {.reference = {.known = false}};
  SUPINE_FREED_BY(supine_physics_volume_forms_free) supine_volume_forms forms = {0};
  volumes at;
  supine_basis_report made = {0};
  SUPINE_TRY(tell_progress(choice, 0, error));
  if (given.is_fields) {
    SUPINE_TRY(fit_fields(prepared, choice, &field, &given, error));
  } else {
    SUPINE_TRY(solve_model(lungs, &prepared->model, choice, &field, &given, error));
  }
  SUPINE_TRY(tell_progress(choice, 2, error));
  SUPINE_TRY(compress(&field, choice, &given, &compression, error));
  SUPINE_TRY(tell_progress(choice, 3, error));
  SUPINE_TRY(anchor(prepared, &field.rows, &compression, &of, error));
  if (given.is_fields) {
    count_from_scan(&given.fit, choice->scan_gravity, &compression);
    SUPINE_TRY(cluster(&of.lungs, choice, &given, &compression, &clusters, &exact, error));
  }
  SUPINE_TRY(supine_projection_volume_forms(&compression, &of.lungs, prepared->model.share,
                                            &field.rows, &forms, error));
  SUPINE_TRY(find_volumes(&of.reference, prepared->model.share, &compression, &forms, &at, error));
  SUPINE_TRY(tell_progress(choice, 4, error));
  const supine_basis_content basis = {.lungs = &of.lungs,
                                      .prepared = prepared,
                                      .rows = field.rows,
                                      .compression = &compression,
                                      .forms = &forms,
                                      .accuracy = &made.accuracy,
                                      .reference = of.reference.known ? &of.reference : NULL,
                                      .resting = of.reference.known ? at.resting[0] : NULL,
                                      .turned_over = given.is_fields ? NULL : &made.turned_over,
                                      .table = given.is_fields ? NULL : &given.table,
                                      .is_fields = given.is_fields,
                                      .fit = &given.fit,
                                      .clusters = &clusters,
                                      .exact = exact != NULL ? exact : compression.coefficients,
                                      .scan_gravity = choice->scan_gravity,
                                      .is_harmonics = choice->modes == 0,
                                      .without_normals = choice->without_normals,
                                      .made_by = choice->made_by};
  SUPINE_TRY(measure(&given, &basis, &at, &made, error));
  SUPINE_TRY(tell_progress(choice, 5, error));
  SUPINE_TRY(supine_precompute_print(&basis, bytes, error));
  if (report != NULL) {
    *report = made;
    report->band = compression.band;
    report->mode_count = compression.mode_count;
    report->cluster_count = clusters.count;
  }
  return tell_progress(choice, 7, error);
}

supine_status supine_precompute_save(const char *path, const supine_bytes *bytes,
                                     supine_error *error) {
  supine_output output;
  SUPINE_TRY(supine_output_open(path, &output, error));
  (void)fwrite(bytes->data, 1, bytes->size, output.file); /* the commit reports errors */
  return supine_output_commit(&output, error);
}
