/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the displacement of the hilum, and expected errors relative to it. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "precompute/inside/shells.h"

#include "program/options/hilum.h"
#include "runtime/expected.h"

/* Prepare the formula of the expected error between two states, with the hila as anchors. If the
 * file does not say how the hilum moves, fail if it is needed; else write no anchors. */
static supine_status prepare(const supine_basis *basis, const supine_state *state,
                             const supine_state *from, bool needed, supine_expected_model *model,
                             supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  SUPINE_ARENA arena = {0};
  double *mean = supine_arena_take(&arena, info->lung_count * 3 * info->mode_count, sizeof *mean);
  *model = (supine_expected_model){.basis = basis};
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu modes", info->mode_count));
  bool known;
  SUPINE_TRY(supine_inside_hilum(basis, mean, &known, error));
  if (!known) {
    SUPINE_REFUSE_IF(needed, error, SUPINE_ERROR_UNSUPPORTED,
                     "--frame hilum: the file does not say how the hilum moves: make it again with "
                     "'supine embed'");
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_expected_prepare(basis, state, from, 0.0, 0.0, model, error));
  supine_expected_relate(model, mean);
  return SUPINE_OK;
}

supine_status supine_options_hilum(const supine_basis *basis, const supine_state *state,
                                   const supine_state *from, bool needed, supine_hilum *hilum,
                                   supine_error *error) {
  enum { PAIRS = EXPECTED_POSES / 2 };
  supine_expected_model model;
  double u[PAIRS][3] = {{0.0}};
  double square[SUPINE_EXPECTED_TERMS];
  double beside_heart = 0.0;
  double sum = 0.0;
  *hilum = (supine_hilum){.expected = (double)NAN};
  SUPINE_TRY(prepare(basis, state, from, needed, &model, error));
  if (model.anchor_count == 0) {
    return SUPINE_OK;
  }
  for (size_t lung = 0; lung < model.anchor_count; ++lung) {
    const supine_expected_anchor *anchor = &model.anchor[lung];
    beside_heart += anchor->beside_heart / (double)model.anchor_count;
    for (size_t i = 0; i < 3 * PAIRS; ++i) {
      u[i / 3][i % 3] += anchor->u[i / 3][i % 3] / (double)model.anchor_count;
    }
  }
  memcpy(hilum->move, u[0], sizeof hilum->move);
  supine_expected_squares(&model, u, beside_heart, square);
  for (size_t k = 0; k < SUPINE_EXPECTED_TERMS; ++k) {
    sum += square[k];
  }
  hilum->expected = supine_basis_get_info(basis)->is_fields ? (double)NAN : sqrt(sum);
  return SUPINE_OK;
}

static supine_status relate(const supine_basis *basis, const supine_state *state,
                            const supine_state *from, supine_expected *expected,
                            supine_error *error) {
  supine_expected_model model;
  double mean[SUPINE_EXPECTED_TERMS];
  if (expected->sigma == NULL) {
    return SUPINE_OK;
  }
  SUPINE_TRY(prepare(basis, state, from, true, &model, error));
  supine_expected_all(&model, expected->sigma, mean);
  for (size_t i = 0; i < supine_basis_get_info(basis)->vertex_count; ++i) {
    const double sigma = (double)expected->sigma[i];
    expected->another[i] = (float)sqrt(sigma * sigma + supine_expected_day_square(&model, i));
  }
  supine_posed_expected_measure(supine_basis_get_info(basis)->vertex_count, expected);
  return SUPINE_OK;
}

supine_status supine_options_hilum_errors(const supine_basis *basis, const supine_state *state,
                                          const supine_state *from, supine_errors *errors,
                                          supine_error *error) {
  const supine_state scan = supine_basis_scan(basis);
  SUPINE_TRY(relate(basis, state, &scan, &errors->position, error));
  return relate(basis, state, from, &errors->moved, error);
}
