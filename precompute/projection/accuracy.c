/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Error of a compressed field against the full solve on held-out directions. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/projection/accuracy.h"
#include "sh/base/clones.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"
#include <supine/sh.h>
#include <supine/volume.h>

#include "precompute/projection/compression.h"
#include "precompute/projection/tally.h"

/* Sums are of so many parts of the vertices, whatever the number of threads. */
enum { BLOCK = 512, PARTS = 16, VOLUME_HALVINGS = 10 };

/* What is seen of one part of the vertices. */
typedef struct tally {
  double field2;
  supine_tally error;    /* at one breath scale */
  supine_tally error_mm; /* at one volume */
} tally;

typedef struct accuracy_work {
  const supine_truth *truth;
  const supine_compression *compression;
  const double *directions; /* [N, 3] */
  const double *weights;    /* [D, K] */
  const double *scales;     /* [D, 2] true and compressed breath scale; NULL: open */
  tally *tallies;           /* [PARTS] */
  struct transposed *blocks;
} accuracy_work;

/* A block of vertices, transposed so that vertices run along the rows: [rank or modes][BLOCK]. */
typedef struct transposed {
  size_t count;
  double length[BLOCK]; /* |d| */
  double columns[SUPINE_SPAN_MAX][BLOCK];
  float coefficients[SUPINE_MODES_MADE_MAX][BLOCK];
} transposed;

static void transpose(const accuracy_work *work, size_t begin, size_t count, transposed *block) {
  const supine_truth *truth = work->truth;
  const size_t modes = work->compression->mode_count;
  block->count = count;
  for (size_t i = 0; i < count; ++i) {
    const double *u = work->directions + 3 * (begin + i);
    const float *c = work->compression->coefficients + (begin + i) * modes;
    block->length[i] = supine_length(u);
    for (size_t k = 0; k < modes; ++k) {
      block->coefficients[k][i] = c[k];
    }
    for (size_t r = 0; r < truth->rank; ++r) {
      block->columns[r][i] = truth->columns[(begin + i) * truth->rank + r];
    }
  }
}

/* F of the compression at one direction for the whole block. */
SUPINE_CLONES static void compressed_block(const transposed *block, size_t modes,
                                           const double *weights, double *out) {
  for (size_t i = 0; i < BLOCK; ++i) {
    out[i] = 0.0;
  }
  for (size_t k = 0; k < modes; ++k) {
    for (size_t i = 0; i < BLOCK; ++i) {
      out[i] += weights[k] * (double)block->coefficients[k][i];
    }
  }
}

SUPINE_CLONES static void true_block(const transposed *block, size_t rank, const double *functions,
                                     double *out) {
  for (size_t i = 0; i < BLOCK; ++i) {
    out[i] = 0.0;
  }
  for (size_t r = 0; r < rank; ++r) {
    for (size_t i = 0; i < BLOCK; ++i) {
      out[i] += functions[r] * block->columns[r][i];
    }
  }
}

/* out = |s1 is - s0 should| length */
SUPINE_CLONES static void miss_block(const double *is, const double *should, const double *length,
                                     double s1, double s0, double *out) {
  for (size_t i = 0; i < BLOCK; ++i) {
    out[i] = fabs(s1 * is[i] - s0 * should[i]) * length[i];
  }
}

static void compare_block(const accuracy_work *work, tally *sums, const transposed *block) {
  const supine_truth *truth = work->truth;
  const size_t modes = work->compression->mode_count;
  double is[BLOCK];
  double should[BLOCK];
  double miss[BLOCK];
  for (size_t d = 0; d < truth->direction_count; ++d) {
    compressed_block(block, modes, work->weights + d * modes, is);
    true_block(block, truth->rank, truth->functions + d * truth->rank, should);
    for (size_t i = 0; i < block->count; ++i) {
      const double field = should[i] * block->length[i];
      sums->field2 += field * field;
    }
    miss_block(is, should, block->length, 1.0, 1.0, miss);
    supine_accuracy_tally_add(&sums->error, block->count, miss);
    if (work->scales != NULL) {
      miss_block(is, should, block->length, work->scales[2 * d + 1], work->scales[2 * d], miss);
      supine_accuracy_tally_add(&sums->error_mm, block->count, miss);
    }
  }
}

static void compare_range(void *context, size_t begin, size_t end, size_t thread) {
  const accuracy_work *work = context;
  const size_t n = work->compression->vertex_count;
  const size_t blocks = (n + BLOCK - 1) / BLOCK;
  transposed *block = &work->blocks[thread];
  for (size_t part = begin; part < end; ++part) {
    for (size_t b = blocks * part / PARTS; b < blocks * (part + 1) / PARTS; ++b) {
      const size_t left = n - b * BLOCK;
      transpose(work, b * BLOCK, left < BLOCK ? left : BLOCK, block);
      compare_block(work, &work->tallies[part], block);
    }
  }
}

/* Breath scales at which both sides gain a part of their volumes [D]; false where some direction
 * does not reach it. */
static bool find_scales(const supine_truth *truth, const supine_volume_forms *forms,
                        const double *weights, const double *volumes, double part, double *scales) {
  for (size_t d = 0; d < truth->direction_count; ++d) {
    const double volume = part * volumes[d];
    double cubic[3];
    supine_physics_volume_forms_contract(forms, weights + d * forms->column_count, cubic);
    if (supine_volume_scale(truth->cubic + 3 * d, volume, &scales[2 * d], NULL) != SUPINE_OK ||
        supine_volume_scale(cubic, volume, &scales[2 * d + 1], NULL) != SUPINE_OK) {
      return false;
    }
  }
  return true;
}

double supine_accuracy_state_volume(const supine_accuracy_state *state, const double *y) {
  double volume = state->resting == NULL ? state->volume : 0.0;
  for (size_t t = 0; state->resting != NULL && t < supine_sh_count(2); ++t) {
    volume += state->resting[t] * y[t];
  }
  return volume;
}

/* Weights of the modes at every direction, [D, K] = Y [D, P] modes^T, and the state's volumes [D].
 */
static supine_status find_weights(const supine_truth *truth, const supine_compression *compression,
                                  const supine_accuracy_state *state, double *weights,
                                  double *volumes) {
  const size_t band = compression->band < 2 ? 2 : compression->band;
  double *y = malloc(supine_sh_count(band) * sizeof *y);
  if (y == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_status status = SUPINE_OK;
  for (size_t d = 0; d < truth->direction_count && status == SUPINE_OK; ++d) {
    status = supine_sh_evaluate(band, truth->directions + 3 * d, y);
    if (status == SUPINE_OK) {
      volumes[d] = supine_accuracy_state_volume(state, y);
      supine_projection_compression_weights(compression, y, weights + d * compression->mode_count);
    }
  }
  free(y);
  return status;
}

/* Over 60 lines: what is measured shares one walk over the held-out directions. */
supine_status supine_accuracy_measure(const supine_truth *truth,
                                      const supine_compression *compression,
                                      const double *directions, const supine_volume_forms *forms,
                                      const supine_accuracy_state *state, supine_accuracy *accuracy,
                                      supine_error *error) {
  const size_t count = truth->direction_count;
  const size_t n = compression->vertex_count;
  const size_t threads = supine_thread_count();
  const bool closed = forms != NULL && truth->cubic != NULL;
  double *weights = malloc(count * compression->mode_count * sizeof *weights);
  double *scales = malloc(3 * count * sizeof *scales);
  tally *tallies = calloc(PARTS, sizeof *tallies);
  transposed *blocks = calloc(threads, sizeof *blocks);
  supine_accuracy made = {.direction_count = count};
  supine_status status = SUPINE_OK;
  if (compression->mode_count > SUPINE_MODES_MADE_MAX || truth->rank > SUPINE_SPAN_MAX) {
    status = supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "%zu modes against %zu columns: at most %d and %d can be compared",
                              compression->mode_count, truth->rank, SUPINE_MODES_MADE_MAX,
                              SUPINE_SPAN_MAX);
    goto cleanup;
  }
  if (weights == NULL || scales == NULL || tallies == NULL || blocks == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to measure the error");
    goto cleanup;
  }
  double *volumes = scales == NULL ? NULL : scales + 2 * count;
  status = find_weights(truth, compression, state, weights, volumes);
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "held-out directions: %s", supine_status_string(status));
    goto cleanup;
  }
  if (closed) {
    double part = 1.0;
    for (int i = 0; !find_scales(truth, forms, weights, volumes, part, scales); ++i) {
      if (i == VOLUME_HALVINGS) {
        status = supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                  "the lungs do not reach even %g mL before the surface folds",
                                  part * volumes[0]);
        goto cleanup;
      }
      part *= 0.5;
    }
    made.volume = state->resting != NULL ? part : part * state->volume;
  }
  accuracy_work work = {truth,   compression, directions, weights, closed ? scales : NULL,
                        tallies, blocks};
  supine_parallel_for(PARTS, 1, threads, compare_range, &work);
  tally *all = &tallies[0];
  for (size_t t = 1; t < PARTS; ++t) {
    all->field2 += tallies[t].field2;
    supine_accuracy_tally_merge(&all->error, &tallies[t].error);
    supine_accuracy_tally_merge(&all->error_mm, &tallies[t].error_mm);
  }
  const double samples = (double)n * (double)count;
  const double field = sqrt(all->field2 / samples);
  made.relative_rms = sqrt(all->error.square_sum / samples) / field;
  made.relative_p95 = supine_accuracy_tally_percentile(&all->error, 0.95) / field;
  made.relative_max = all->error.largest / field;
  made.rms_mm = sqrt(all->error_mm.square_sum / samples);
  made.p95_mm = supine_accuracy_tally_percentile(&all->error_mm, 0.95);
  made.max_mm = all->error_mm.largest;
  *accuracy = made;
cleanup:
  free(weights);
  free(scales);
  free(tallies);
  free(blocks);
  return status;
}
