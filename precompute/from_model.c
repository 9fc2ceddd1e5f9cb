/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute what a basis of a model stores: solve for the displacements, compress them, correct the
 * reference surface, and measure the errors. */
#include <math.h>
#include <string.h>

#include <supine/volume.h>

#include "base/arena.h"
#include "base/remedy.h"
#include "precompute/computed.h"

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

/* Lungs, model -> expansion of the force -> field of displacements, and exact solutions. */
static supine_status solve(const supine_lungs *lungs, const supine_model *model,
                           const supine_basis_choice *choice, supine_gravity_field *field,
                           supine_truth *truth, supine_error *error) {
  SUPINE_FREED_BY(supine_projection_free) supine_projection projection = {0};
  const size_t count = held_out_count(lungs, choice->held_out);
  SUPINE_TRY(supine_projection_create(lungs, model, choice->band, &projection, error));
  SUPINE_TRY(supine_projection_field(lungs, model, &projection, field, error));
  return supine_projection_truth_create(lungs, model, projection.span, field, count, truth, error);
}

/* Field -> K modes, and a table of their errors. */
static supine_status compress(const supine_basis_choice *choice, const supine_truth *truth,
                              supine_computed *made, supine_error *error) {
  supine_spectrum spectrum;
  SUPINE_TRY(supine_precompute_compress(choice, made, &spectrum, error));
  SUPINE_TRY(supine_projection_error_table_create(truth, &made->field, &made->compression,
                                                  &made->table, error));
  supine_precompute_drop_modes(choice, &spectrum,
                               made->table.modes[made->compression.mode_count - 1], made);
  return SUPINE_OK;
}

/* Correct the vertices of the reference surface so that the displacement computed from the modes
 * moves them exactly to the scan, in the posture of the scan. The corrected position of a vertex is
 *
 *     p_j = scan_j - A_j u_j        along axis j
 *
 * A_j is the gain (factor on the displacement) at which its lung has the volume of the scan, and u
 * is the displacement computed from the modes. */
static supine_status anchor(const supine_prepared *prepared, supine_computed *made,
                            supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const size_t n = lungs->mesh.vertex_count;
  double weights[SUPINE_MODES_MADE_MAX];
  if (!made->reference.known || lungs->scanned == NULL) {
    return SUPINE_OK;
  }
  SUPINE_ARENA arena = {0};
  double *u = supine_arena_take(&arena, 3 * n, sizeof *u);
  double *ones = supine_arena_take(&arena, n, sizeof *ones);
  double *vertices = supine_arena_take(&made->memory, 3 * n, sizeof *vertices);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_arena_check(&made->memory, error, "%zu vertices", n));
  supine_sh_compression_weights(&made->compression, made->reference.scan.state.gravity, weights);
  supine_projection_displacement(&made->compression, &made->field.rows, weights, u);
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

/* Find what a patient's landmarks leave of the error at every vertex. */
static supine_status share_errors(const supine_prepared *prepared, supine_computed *made,
                                  supine_error *error) {
  const supine_patient_record *record = prepared->patient;
  const supine_lungs *lungs = &made->lungs;
  const size_t n = lungs->mesh.vertex_count;
  if (record == NULL || record->patient.landmark_count == 0 ||
      !(record->report.expected_share > 0.0)) {
    return SUPINE_OK;
  }
  const supine_patient *patient = &record->patient;
  const size_t m = patient->landmark_count;
  SUPINE_ARENA arena = {0};
  double *offsets = supine_arena_take(&arena, 3 * n, sizeof *offsets);
  double *shares = supine_arena_take(&arena, n, sizeof *shares);
  int *sides = supine_arena_take(&arena, n, sizeof *sides);
  made->error_share = supine_arena_take(&made->memory, n, sizeof *made->error_share);
  made->landmarks = supine_arena_take(&made->memory, 4 * m, sizeof *made->landmarks);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_arena_check(&made->memory, error, "%zu vertices", n));
  made->landmark_count = m;
  double centre[3];
  for (size_t k = 0; k < 3; ++k) {
    centre[k] = 0.5 * (patient->frame.minimum[k] + patient->frame.maximum[k]);
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    offsets[i] = lungs->mesh.vertices[i] - centre[i % 3];
    sides[i / 3] = supine_patient_side_of(lungs, i / 3);
  }
  SUPINE_TRY(supine_patient_shares(patient, n, offsets, sides, shares, error));
  for (size_t i = 0; i < n; ++i) {
    made->error_share[i] = (float)(shares[i] / record->report.expected_share);
  }
  for (size_t i = 0; i < m; ++i) {
    const supine_patient_landmark *landmark = &patient->landmark[i];
    for (size_t k = 0; k < 3; ++k) {
      made->landmarks[4 * i + k] = (float)(landmark->offset[k] + centre[k]);
    }
    size_t lung = 0; /* or the number of lungs, if the landmark's is not there */
    while (lung < lungs->lung_count && lungs->side[lung] != landmark->side) {
      ++lung;
    }
    made->landmarks[4 * i + 3] = (float)lung;
  }
  return SUPINE_OK;
}

/* Check that each lung can reach its resting volume (FRC) with gravity along the unit vector g.
 * @param volume  [lungs] resting volume minus that of the reference surface, mL */
static supine_status check_rest(const supine_computed *made, const double g[3],
                                const double *volume, supine_error *error) {
  const supine_volume_forms *forms = &made->forms;
  double weights[SUPINE_MODES_MADE_MAX];
  supine_error inner = {0};
  supine_sh_compression_weights(&made->compression, g, weights);
  for (size_t lung = 0; lung < forms->lung_count; ++lung) {
    static const double straight[3] = {0.0, 0.0, 0.0};
    supine_volume_form form;
    double gains[3];
    supine_physics_volume_forms_contract_lung(forms, lung, weights, &form);
    const supine_status status =
        supine_volume_form_gains(&form, straight, 0.0, volume[lung], gains, &inner);
    if (status != SUPINE_OK) {
      inner.status = SUPINE_ERROR_NUMERICAL;
      const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
          supine_remedy_change("resting", ""),
          supine_remedy_give("scanned", "none", "to use the scan as it is")};
      supine_error_advise(&inner, advice);
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
 * @param share     volume of each lung divided by its healthy volume
 * @param measured  [9] written: volume of all lungs minus that of the reference surface, mL, as
 *   harmonics of the direction of gravity */
static supine_status find_volumes(const double share[2], supine_computed *made, double measured[9],
                                  supine_error *error) {
  const supine_reference *reference = &made->reference;
  double volume[2][6];
  memset(measured, 0, 9 * sizeof *measured);
  if (!reference->known) {
    measured[0] = breath_volume * sqrt_4pi;
    return SUPINE_OK;
  }
  for (size_t axis = 0; axis < 6; ++axis) {
    double g[3];
    double rest[2];
    supine_physics_resting_axis(axis, g);
    (void)supine_physics_reference_rest(reference, g, rest);
    for (size_t lung = 0; lung < reference->lung_count; ++lung) {
      rest[lung] = share[lung] * (rest[lung] - reference->full_volume[lung]);
      volume[lung][axis] = rest[lung];
    }
    SUPINE_TRY(check_rest(made, g, rest, error));
  }
  for (size_t lung = 0; lung < reference->lung_count; ++lung) {
    supine_physics_resting_harmonics(volume[lung], made->resting[lung]);
    for (size_t t = 0; t < 9; ++t) {
      measured[t] += made->resting[lung][t];
    }
  }
  return SUPINE_OK;
}

/* Measure the errors, at a volume given as harmonics, and the share of triangles that turn over. */
static supine_status measure(const supine_truth *truth, const double volume[9],
                             supine_computed *made, supine_error *error) {
  SUPINE_TRY(supine_projection_accuracy_measure(truth, &made->compression, &made->field.rows,
                                                &made->forms, volume, &made->accuracy, error));
  if (!made->reference.known) {
    made->accuracy.volume *= breath_volume;
  }
  return supine_projection_turned_over(&made->lungs, &made->field.rows, &made->compression,
                                       &made->forms, volume, &made->turned_over, error);
}

supine_status supine_precompute_from_model(const supine_prepared *prepared,
                                           const supine_basis_choice *choice,
                                           supine_computed *computed, supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const supine_model *model = &prepared->model;
  SUPINE_FREED_BY(supine_projection_truth_free) supine_truth truth = {0};
  double volume[9];
  computed->kind = SUPINE_COMPUTED_BY_MODEL;
  computed->lungs = *lungs;
  computed->reference = prepared->reference;
  SUPINE_TRY(solve(lungs, model, choice, &computed->field, &truth, error));
  SUPINE_TRY(supine_precompute_tell_progress(choice, 2, error));
  SUPINE_TRY(compress(choice, &truth, computed, error));
  SUPINE_TRY(supine_precompute_tell_progress(choice, 3, error));
  SUPINE_TRY(anchor(prepared, computed, error));
  SUPINE_TRY(share_errors(prepared, computed, error));
  SUPINE_TRY(supine_projection_volume_forms(&computed->compression, &computed->lungs, model->share,
                                            &computed->field.rows, &computed->forms, error));
  SUPINE_TRY(find_volumes(model->share, computed, volume, error));
  SUPINE_TRY(supine_precompute_tell_progress(choice, 4, error));
  return measure(&truth, volume, computed, error);
}
