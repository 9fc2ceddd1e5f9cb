/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measure the error of a compressed displacement field against exact solutions of the physical
 * model for held-out directions of gravity, the share of triangles that turn over, and the
 * error that storage adds. */
#include <cblas.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "base/arena.h"
#include "base/clones.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "precompute/physics/resting.h"
#include "precompute/projection/accuracy.h"
#include <supine/compare.h>
#include <supine/runtime.h>
#include <supine/sh.h>
#include <supine/volume.h>

#include "precompute/projection/projection.h"
#include "precompute/projection/tally.h"

/* The vertices are divided into PARTS parts, which are evaluated BLOCK vertices at a time. The
 * number of parts is fixed, so that sums do not depend on the number of threads. A volume that the
 * lungs cannot reach is halved, at most VOLUME_HALVINGS times. */
enum { BLOCK = 128, PARTS = 16, VOLUME_HALVINGS = 10 };

typedef struct tally {
  double square_sum_mm2;    /* sum of the squared exact displacements before scaling, mm^2 */
  supine_tally same_gain;   /* errors of the compressed displacement before scaling, mm */
  supine_tally same_volume; /* errors after scaling both displacements to one lung volume, mm */
} tally;

typedef struct accuracy_work {
  const supine_truth *truth;
  const supine_compression *compression;
  const supine_rows *rows; /* kind of the rows of `compression` */
  const double *weights;   /* [held-out directions, modes] weight of each mode */
  const double *gains; /* [held-out directions, 2] factors on exact and compressed displacement */
  tally *tallies;
  double *space; /* work space of all threads */
} accuracy_work;

/* Compute the errors of n displacements, mm. The displacement of vertex i is its gain (a factor)
 * times the force on it, approximate[i] or exact[i], times length[i], mm per unit force. If axes is
 * 3, approximate and exact [n, 3] are displacements. */
SUPINE_CLONES static void find_errors(size_t n, size_t axes, const double *const field[2],
                                      const double *length, const double gain[2], double *out) {
  for (size_t i = 0; i < axes * n; ++i) {
    out[i] = fabs(gain[1] * field[1][i] - gain[0] * field[0][i]) * (axes == 1 ? length[i] : 1.0);
  }
  if (axes == 3) {
    for (size_t i = 0; i < n; ++i) {
      out[i] = supine_length(out + 3 * i);
    }
  }
}

/* Return the number of rows of the compression for each vertex. */
static size_t axes_of(const accuracy_work *work) {
  return supine_rows_per_vertex(work->rows->kind);
}

static void compare_block(const accuracy_work *work, size_t begin, size_t n, double *space,
                          tally *sums) {
  const supine_truth *truth = work->truth;
  const int rank = (int)truth->rank;
  const int count = (int)truth->direction_count;
  const size_t modes = work->compression->mode_count;
  const size_t axes = axes_of(work);
  const size_t rows = axes * n;
  double *coefficients = space;
  double *approximate = coefficients + modes * axes * BLOCK; /* [direction_count, rows] */
  double *exact = approximate + truth->direction_count * axes * BLOCK;
  double length[BLOCK];
  double errors[3 * BLOCK];
  if (axes == 1) {
    for (size_t i = 0; i < n; ++i) {
      length[i] = supine_length(work->rows->directions + 3 * (begin + i));
    }
  }
  for (size_t i = 0; i < rows * modes; ++i) {
    coefficients[i] = (double)work->compression->coefficients[axes * begin * modes + i];
  }
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, count, (int)rows, (int)modes, 1.0,
              work->weights, (int)modes, coefficients, (int)modes, 0.0, approximate, (int)rows);
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, count, (int)rows, rank, 1.0,
              truth->functions, rank, truth->columns + axes * begin * truth->rank, rank, 0.0, exact,
              (int)rows);
  for (size_t d = 0; d < truth->direction_count; ++d, approximate += rows, exact += rows) {
    static const double same[2] = {1.0, 1.0};
    const double *const fields[2] = {exact, approximate};
    for (size_t i = 0; i < rows; ++i) {
      const double field = exact[i] * (axes == 1 ? length[i] : 1.0);
      sums->square_sum_mm2 += field * field;
    }
    find_errors(n, axes, fields, length, same, errors);
    supine_projection_tally_add(&sums->same_gain, n, errors);
    find_errors(n, axes, fields, length, work->gains + 2 * d, errors);
    supine_projection_tally_add(&sums->same_volume, n, errors);
  }
}

static void compare_range(void *context, size_t begin, size_t end, size_t thread) {
  const accuracy_work *work = context;
  const size_t n = work->compression->row_count / axes_of(work);
  const size_t room =
      BLOCK * axes_of(work) * (work->compression->mode_count + 2 * work->truth->direction_count);
  for (size_t part = begin; part < end; ++part) {
    const size_t last = n * (part + 1) / PARTS;
    for (size_t i = n * part / PARTS; i < last; i += BLOCK) {
      compare_block(work, i, last - i < BLOCK ? last - i : BLOCK, work->space + thread * room,
                    &work->tallies[part]);
    }
  }
}

/* For each held-out direction d of gravity, find the gains (factors on the displacement) of the
 * exact and of the compressed field that change the lungs' volume by `fraction` volumes[d], mL.
 * Write them to gains [direction_count, 2]. Return false if a direction has no such gain. */
static bool find_gains(const supine_truth *truth, const supine_volume_forms *forms,
                       const double *weights, const double *volumes, double fraction,
                       double *gains) {
  for (size_t d = 0; d < truth->direction_count; ++d) {
    const double volume = fraction * volumes[d];
    double cubic[3];
    supine_physics_volume_forms_contract(forms, weights + d * forms->column_count, cubic);
    if (supine_volume_scale(truth->cubic + 3 * d, volume, &gains[2 * d], NULL) != SUPINE_OK ||
        supine_volume_scale(cubic, volume, &gains[2 * d + 1], NULL) != SUPINE_OK) {
      return false;
    }
  }
  return true;
}

/* Evaluate a volume, given by its harmonics, with gravity along the unit vector g. */
static double volume_along(const double harmonics[9], const double g[3]) {
  double y[9];
  double volume = 0.0;
  (void)supine_sh_evaluate(2, g, y); /* cannot fail: g is a unit vector */
  for (size_t t = 0; t < 9; ++t) {
    volume += harmonics[t] * y[t];
  }
  return volume;
}

/* Return the largest fraction 1, 1/2, 1/4, ... of `volumes` that the lungs can reach, or 0. */
static double find_fraction(const accuracy_work *work, const supine_volume_forms *forms,
                            const double *volumes, double *gains) {
  double fraction = 1.0;
  for (int i = 0; i <= VOLUME_HALVINGS; ++i, fraction *= 0.5) {
    if (find_gains(work->truth, forms, work->weights, volumes, fraction, gains)) {
      return fraction;
    }
  }
  return 0.0;
}

static void conclude(const accuracy_work *work, supine_accuracy *made) {
  const double samples =
      (double)(work->compression->row_count / axes_of(work)) * (double)work->truth->direction_count;
  tally *all = &work->tallies[0];
  for (size_t t = 1; t < PARTS; ++t) {
    all->square_sum_mm2 += work->tallies[t].square_sum_mm2;
    supine_projection_tally_merge(&all->same_gain, &work->tallies[t].same_gain);
    supine_projection_tally_merge(&all->same_volume, &work->tallies[t].same_volume);
  }
  const double field = sqrt(all->square_sum_mm2 / samples);
  made->relative_rms = sqrt(all->same_gain.square_sum / samples) / field;
  made->relative_p95 = supine_projection_tally_percentile(&all->same_gain, 0.95) / field;
  made->relative_max = all->same_gain.largest / field;
  made->rms_mm = sqrt(all->same_volume.square_sum / samples);
  made->p95_mm = supine_projection_tally_percentile(&all->same_volume, 0.95);
  made->max_mm = all->same_volume.largest;
}

supine_status supine_projection_accuracy_measure(const supine_truth *truth,
                                                 const supine_compression *compression,
                                                 const supine_rows *rows,
                                                 const supine_volume_forms *forms,
                                                 const double volume[9], supine_accuracy *accuracy,
                                                 supine_error *error) {
  const size_t count = truth->direction_count;
  const size_t modes = compression->mode_count;
  const size_t threads = supine_thread_count();
  SUPINE_ARENA arena = {0};
  double *weights = supine_arena_take(&arena, count * modes, sizeof *weights);
  double *gains = supine_arena_take(&arena, 2 * count, sizeof *gains);
  double *volumes = supine_arena_take(&arena, count, sizeof *volumes);
  tally *tallies = supine_arena_zeros(&arena, PARTS, sizeof *tallies);
  double *space =
      supine_arena_take(&arena, threads * 3 * BLOCK * (modes + 2 * count), sizeof *space);
  *accuracy = (supine_accuracy){.direction_count = count};
  SUPINE_TRY(supine_arena_check(&arena, error, "errors in %zu directions", count));
  accuracy_work work = {truth, compression, rows, weights, gains, tallies, space};
  for (size_t d = 0; d < count; ++d) {
    const double *g = truth->directions + 3 * d;
    volumes[d] = volume_along(volume, g);
    supine_sh_compression_weights(compression, g, weights + d * modes);
  }
  accuracy->volume = find_fraction(&work, forms, volumes, gains);
  SUPINE_REFUSE_IF(
      accuracy->volume == 0.0, error, SUPINE_ERROR_NUMERICAL,
      "the error cannot be measured: the surface folds over at less than a thousandth of the "
      "volume change of %g mL; check the surface and the constants of the displacement law",
      volumes[0]);
  supine_parallel_for(PARTS, 1, threads, compare_range, &work);
  conclude(&work, accuracy);
  return SUPINE_OK;
}

supine_status supine_projection_turned_over(const supine_lungs *lungs, const supine_rows *rows,
                                            const supine_compression *compression,
                                            const supine_volume_forms *forms,
                                            const double volume[9], double *share,
                                            supine_error *error) {
  enum { SAMPLES_MAX = 50000 };
  const supine_mesh *mesh = &lungs->mesh;
  const size_t n = mesh->vertex_count;
  const size_t stride = (mesh->triangle_count + SAMPLES_MAX - 1) / SAMPLES_MAX;
  SUPINE_ARENA arena = {0};
  supine_mesh sample = {n, mesh->vertices, (mesh->triangle_count + stride - 1) / stride,
                        supine_arena_take(&arena, 3 * SAMPLES_MAX, sizeof *sample.triangles)};
  double *moved = supine_arena_take(&arena, 3 * n, sizeof *moved);
  *share = 0.0;
  SUPINE_TRY(supine_arena_check(&arena, error, "folds of %zu vertices", n));
  for (size_t t = 0; t < sample.triangle_count; ++t) {
    memcpy(sample.triangles + 3 * t, mesh->triangles + 3 * t * stride,
           3 * sizeof *sample.triangles);
  }
  for (size_t posture = 0; posture < 6; ++posture) {
    double g[3];
    double weights[SUPINE_MODES_MADE_MAX];
    double cubic[3];
    double scale = 0.0;
    supine_physics_resting_axis(posture, g);
    supine_sh_compression_weights(compression, g, weights);
    supine_physics_volume_forms_contract(forms, weights, cubic);
    if (supine_volume_scale(cubic, volume_along(volume, g), &scale, NULL) != SUPINE_OK) {
      continue;
    }
    supine_projection_displacement(compression, rows, weights, moved);
    for (size_t i = 0; i < 3 * n; ++i) {
      moved[i] = mesh->vertices[i] + scale * moved[i];
    }
    *share = fmax(*share, supine_mesh_turned_over(&sample, moved));
  }
  return SUPINE_OK;
}

/* Add sums of the squared errors of each vertex, over `poses` poses, to its RMS error, if given. */
static void add_to_vertices(size_t count, const double *square, size_t poses, float *vertices) {
  if (vertices != NULL && poses > 0) {
    for (size_t i = 0; i < count; ++i) {
      vertices[i] = (float)hypot((double)vertices[i], sqrt(square[i] / (double)poses));
    }
  }
}

supine_status supine_projection_accuracy_add_storage(const supine_basis *basis,
                                                     const supine_compression *compression,
                                                     const supine_rows *rows,
                                                     supine_accuracy *accuracy, float *vertices) {
  enum { DIRECTIONS = 16 };
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = info->vertex_count;
  double gravity[3 * DIRECTIONS];
  double square_sum = 0.0;
  SUPINE_ARENA arena = {0};
  float *xyz = supine_arena_take(&arena, 3 * n, sizeof *xyz);
  double *u = supine_arena_take(&arena, 3 * n, sizeof *u);
  supine_tally *errors = supine_arena_zeros(&arena, 1, sizeof *errors);
  double *square = supine_arena_zeros(&arena, n, sizeof *square);
  SUPINE_TRY(supine_arena_status(&arena));
  supine_projection_held_out_directions(DIRECTIONS, gravity);
  for (const double *g = gravity; g < gravity + 3 * DIRECTIONS; g += 3) {
    const supine_state state = {.gravity = {g[0], g[1], g[2]}};
    supine_pose pose = {.basis = 0};
    if (supine_basis_pose(basis, &state, &pose, NULL) != SUPINE_OK ||
        supine_deform(basis, &pose, xyz) != SUPINE_OK) {
      continue;
    }
    for (size_t i = 0, lung = SIZE_MAX; i < n; ++i) {
      double error[3];
      if (lung == SIZE_MAX || i >= info->lung_begin[lung + 1]) {
        ++lung;
        supine_projection_displacement(compression, rows,
                                       supine_basis_lung_weights(basis, &pose, lung), u);
      }
      for (size_t j = 3 * i; j < 3 * i + 3; ++j) {
        u[j] *= pose.gains[lung][j % 3];
        error[j % 3] = (double)xyz[j] - (double)info->vertices[j] - u[j];
      }
      square_sum += supine_dot(u + 3 * i, u + 3 * i);
      supine_projection_tally_add(errors, 1, (double[]){supine_length(error)});
      square[i] += supine_dot(error, error);
    }
  }
  add_to_vertices(n, square, errors->count / n, vertices);
  if (!(square_sum > 0.0)) {
    return SUPINE_OK;
  }
  const double rms = sqrt(errors->square_sum / (double)errors->count);
  const double p95 = supine_projection_tally_percentile(errors, 0.95);
  const double size = sqrt(square_sum / (double)errors->count);
  accuracy->relative_rms = hypot(accuracy->relative_rms, rms / size);
  accuracy->relative_p95 = hypot(accuracy->relative_p95, p95 / size);
  accuracy->relative_max += errors->largest / size;
  accuracy->rms_mm = hypot(accuracy->rms_mm, rms);
  accuracy->p95_mm = hypot(accuracy->p95_mm, p95);
  accuracy->max_mm += errors->largest;
  return SUPINE_OK;
}

supine_status supine_projection_band_shares(const supine_basis *basis, double *share,
                                            supine_error *error) {
  const size_t band = supine_basis_get_info(basis)->band;
  supine_compare *compare = NULL;
  const supine_status status = supine_compare_create(basis, &compare, error);
  double total = 0.0;
  if (status != SUPINE_OK) {
    return status == SUPINE_ERROR_MESH ? SUPINE_OK : status;
  }
  supine_compare_energy(compare, share);
  supine_compare_destroy(compare);
  for (size_t l = 0; l <= band; ++l) {
    total += share[l];
  }
  for (size_t l = 0; l <= band; ++l) {
    share[l] /= total > 0.0 ? total : 1.0;
  }
  return SUPINE_OK;
}
