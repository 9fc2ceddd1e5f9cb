/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit the expandability (1 / relative stiffness) of each region of the lungs, and test the result
 * on held-out vertices. */
#include <math.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "precompute/patient/matching.h"

#include "base/arena.h"
#include "base/vec3.h"

/* Largest distance from a vertex to the nearest centre of a region, mm. */
static const double centre_distance_most = 35.0;

/* Radius of a region / largest distance from a vertex to the nearest centre of a region. */
static const double radius_ratio = 1.5;

enum {
  CANDIDATES = 8192, /* largest number of vertices tried as the centre of a region */
  FOLDS = 5,         /* number of parts that cross-validation holds out in turn */
  ROUNDS = 5         /* number of fits, each followed by a matching of the surfaces */
};

/* Prior standard deviation of a region's expandability (1 / relative stiffness, near 1), and of its
 * difference between neighbouring regions. */
static const double region_deviation = 1.0, neighbour_deviation = 0.3;

/* Lower bound on the standard deviation of the distance between the matched surfaces, mm. */
static const double noise_least = 0.3;

/* Regions of one lung are neighbours if the distance between their centres is less than this number
 * times the smallest distance between two centres of one lung. */
static const double neighbour_distance_ratio = 1.7;

/* Regions are kept if the held-out error with regions / that without is less than this. */
static const double kept_ratio = 0.95;

/* Factor from one trial of the prior's precision to the next, and smallest product of all. */
static const double ridge_step = 0.3, ridge_least = 1e-3;

/* Smallest expandability of a region, where 1 is the prior mean: it only keeps 1 / a finite. */
static const double expandability_least = 0.05;

/* Find the vertex of one lung that is farthest from all centres of regions. Write its distance from
 * the nearest centre into `distance`. */
static size_t farthest(const supine_lungs *lungs, const supine_patient_stiffness *stiffness,
                       int side, double *distance) {
  size_t found = 0;
  const size_t step = lungs->mesh.vertex_count / CANDIDATES + 1;
  *distance = 0.0;
  for (size_t i = 0; i < lungs->mesh.vertex_count; i += step) {
    double nearest = supine_patient_side_of(lungs, i) == side ? INFINITY : 0.0;
    for (size_t k = 0; k < stiffness->count; ++k) {
      if (stiffness->region[k].side == side) {
        nearest = fmin(nearest,
                       supine_distance(stiffness->region[k].centre, lungs->mesh.vertices + 3 * i));
      }
    }
    if (nearest > *distance) {
      *distance = nearest;
      found = i;
    }
  }
  return found;
}

/* Add regions until every vertex is near the centre of a region, or the array is full. */
static void place_regions(const supine_lungs *lungs, supine_patient_stiffness *stiffness) {
  *stiffness = (supine_patient_stiffness){0};
  for (int side = 1; side >= -1; side -= 2) {
    const size_t first = stiffness->count;
    double distance;
    size_t vertex = farthest(lungs, stiffness, side, &distance);
    while (distance > centre_distance_most &&
           stiffness->count - first < SUPINE_PATIENT_REGIONS_MAX / 2) {
      supine_patient_region *region = &stiffness->region[stiffness->count++];
      *region = (supine_patient_region){.side = side, .expandability = 1.0};
      memcpy(region->centre, lungs->mesh.vertices + 3 * vertex, sizeof region->centre);
      vertex = farthest(lungs, stiffness, side, &distance);
    }
    for (size_t k = first; k < stiffness->count; ++k) {
      stiffness->region[k].radius = radius_ratio * distance;
    }
  }
}

static void find_prior_precision(const supine_patient_stiffness *regions, double *precision) {
  const supine_patient_region *region = regions->region;
  const size_t n = regions->count;
  double nearest = INFINITY;
  for (size_t i = 0; i < n * n; ++i) {
    const size_t j = i / n;
    const size_t k = i % n;
    if (j != k && region[j].side == region[k].side) {
      nearest = fmin(nearest, supine_distance(region[j].centre, region[k].centre));
    }
    precision[i] = j == k ? pow(region_deviation, -2.0) : 0.0;
  }
  for (size_t i = 0; i < n * n; ++i) {
    const size_t j = i / n;
    const size_t k = i % n;
    if (j != k && region[j].side == region[k].side &&
        supine_distance(region[j].centre, region[k].centre) < neighbour_distance_ratio * nearest) {
      precision[j * n + j] += pow(neighbour_deviation, -2.0);
      precision[i] -= pow(neighbour_deviation, -2.0);
    }
  }
}

/* The unknowns of the fit are, in order: the expandability of each region, factors on the default
 * displacement along x, y and z, and the motion of the body between the scans. */
enum { AXES = 3, MOTION = 6, UNKNOWNS_MAX = SUPINE_PATIENT_REGIONS_MAX + AXES + MOTION };

/* Linear equations of the fit. */
typedef struct work {
  supine_patient_matching *m;
  const supine_patient_stiffness *stiffness;
  size_t motion;     /* number of fitted unknowns of the body's motion */
  double *response;  /* [count, regions + 1, 3] displacement, mm, of each matched vertex if only one
                        region expands, with the expandability 1; last, if none does */
  double *precision; /* [regions, regions] inverse of the prior covariance of the expandability */
  double ridge;      /* factor on `precision` */
  double *matrix;    /* [UNKNOWNS_MAX, UNKNOWNS_MAX] normal matrix, then its Cholesky factor */
  double x[UNKNOWNS_MAX]; /* unknowns; see above */
} work;

/* Compute the displacement u [N, 3] of uniform tissue, mm, by a displacement law. */
static void find_uniform(const supine_patient_matching *m, const supine_patient_power *law,
                         double *u) {
  for (size_t i = 0; i < m->fuller->mesh.vertex_count; ++i) {
    supine_patient_place place = supine_patient_find_vertex(m->fuller, i);
    memcpy(place.force, m->smoothed_force + SUPINE_PATIENT_COLUMNS * i, sizeof place.force);
    supine_patient_direction(law, &place, supine_patient_force_at(law, &place), u + 3 * i);
  }
}

static void free_strain(supine_strain **strain) {
  supine_physics_strain_destroy(*strain);
}

supine_status supine_patient_matching_set_tissue(supine_patient_matching *matching,
                                                 const supine_patient_power *law,
                                                 const supine_patient_stiffness *stiffness,
                                                 supine_error *error) {
  const size_t n = matching->fuller->mesh.vertex_count;
  SUPINE_FREED_BY(free_strain) supine_strain *strain = NULL;
  SUPINE_ARENA arena = {0};
  matching->tissue = NULL;
  if (stiffness->count == 0) {
    return SUPINE_OK;
  }
  double *e = supine_arena_take(&arena, 4 * n, sizeof *e);
  double *tissue = supine_arena_take(&matching->arena, 3 * n, sizeof *tissue);
  if (arena.failed || matching->arena.failed) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  supine_patient_stiffness_of(stiffness, matching->fuller, e);
  find_uniform(matching, law, tissue);
  memcpy(e + n, tissue, 3 * n * sizeof *e);
  SUPINE_TRY(supine_physics_strain_create(matching->fuller, e, NULL, &strain, error));
  SUPINE_TRY(supine_physics_strain_apply(strain, NULL, 3, tissue, error));
  cblas_daxpy((int)(3 * n), -1.0, e + n, 1, tissue, 1);
  matching->tissue = tissue;
  return SUPINE_OK;
}

/* Compute w->response: one solve for each region. */
static supine_status find_responses(work *w, const supine_patient_power *law, supine_error *error) {
  const supine_patient_matching *m = w->m;
  const size_t n = m->fuller->mesh.vertex_count;
  const size_t regions = w->stiffness->count;
  SUPINE_FREED_BY(free_strain) supine_strain *strain = NULL;
  SUPINE_ARENA arena = {0};
  double *shares = supine_arena_zeros(&arena, (regions + 1) * n, sizeof *shares);
  double *u = supine_arena_take(&arena, 6 * n, sizeof *u);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_physics_strain_create(m->fuller, NULL, NULL, &strain, error));
  for (size_t i = 0; i < n; ++i) {
    double of[SUPINE_PATIENT_REGIONS_MAX];
    supine_patient_stiffness_shares(w->stiffness, m->fuller, i, of);
    cblas_dcopy((int)regions, of, 1, shares + i, (int)n);
  }
  find_uniform(m, law, u + 3 * n);
  for (size_t k = regions + 1; k-- > 0;) {
    memcpy(u, u + 3 * n, 3 * n * sizeof *u);
    SUPINE_TRY(supine_physics_strain_apply(strain, shares + k * n, AXES, u, error));
    for (size_t i = 0; i < m->count * AXES; ++i) {
      double *row = w->response + i / AXES * (regions + 1) * AXES + i % AXES;
      row[k * AXES] =
          u[3 * m->match[i / AXES].vertex + i % AXES] - (k < regions ? row[regions * AXES] : 0.0);
    }
  }
  return SUPINE_OK;
}

/* Compute the displacement u of matched vertex i, mm. Write its derivatives with respect to the
 * unknowns, along the normal of the match, into x unless that is NULL. */
static void predict(const work *w, size_t i, double u[3], double *x) {
  const supine_patient_row *row = &w->m->rows[i];
  const size_t regions = w->stiffness->count;
  const double *scale = w->x + regions;
  const double *response = w->response + i * (regions + 1) * AXES;
  double turned[3];
  supine_patient_power motion = {.motion = {0.0}};
  memcpy(motion.motion, scale + AXES, sizeof motion.motion);
  supine_patient_motion(&motion, &row->place, u);
  supine_cross(row->place.offset, row->axis, turned);
  for (size_t axis = 0; axis < AXES; ++axis) {
    double unscaled = 0.0;
    for (size_t k = 0; k <= regions; ++k) {
      unscaled += (k < regions ? w->x[k] : 1.0) * response[k * AXES + axis];
    }
    u[axis] += scale[axis] * unscaled;
    if (x != NULL) {
      x[regions + axis] = row->axis[axis] * unscaled;
      x[regions + AXES + axis] = row->axis[axis];
      x[regions + AXES + 3 + axis] = turned[axis];
    }
  }
  if (x != NULL) {
    for (size_t k = 0; k < regions; ++k) {
      x[k] = row->axis[0] * scale[0] * response[k * AXES] +
             row->axis[1] * scale[1] * response[k * AXES + 1] +
             row->axis[2] * scale[2] * response[k * AXES + 2];
    }
  }
}

/* Make one Gauss-Newton step of all unknowns, without the measurements of one fold.
 * @param uniform  whether to keep the expandability as it is
 * @param noise    standard deviation of a measurement, mm
 * @param without  fold to leave out, or FOLDS */
static bool step(work *w, bool uniform, double noise, size_t without) {
  const size_t regions = w->stiffness->count;
  const size_t size = regions + AXES + w->motion;
  double right[UNKNOWNS_MAX] = {0.0};
  memset(w->matrix, 0, size * size * sizeof *w->matrix);
  for (size_t i = 0; i < w->m->count; ++i) {
    const supine_patient_row *row = &w->m->rows[i];
    double x[UNKNOWNS_MAX];
    double u[3];
    const double weight = row->block % FOLDS == without ? 0.0 : row->weight / (noise * noise);
    predict(w, i, u, x);
    if (uniform) {
      memset(x, 0, regions * sizeof *x);
    }
    cblas_dsyr(CblasColMajor, CblasUpper, (int)size, weight, x, 1, w->matrix, (int)size);
    cblas_daxpy((int)size, weight * (row->value - supine_dot(row->axis, u)), x, 1, right, 1);
  }
  for (size_t k = 0; k < regions; ++k) {
    for (size_t l = 0; l < regions; ++l) {
      const double precision = w->ridge * w->precision[l * regions + k];
      w->matrix[l * size + k] += precision;
      right[k] -= uniform ? 0.0 : precision * (w->x[l] - 1.0);
    }
  }
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', (lapack_int)size, 1, w->matrix, (lapack_int)size, right,
                    (lapack_int)size) != 0) {
    return false;
  }
  for (size_t t = 0; t < size; ++t) {
    w->x[t] = t < regions ? fmax(expandability_least, w->x[t] + right[t]) : w->x[t] + right[t];
  }
  return true;
}

/* Return the RMS residual, mm, of the measurements in one fold, or of all if it is FOLDS; if
 * `squares` is not NULL, add the sums of squares and weights to it. */
static double residual(const work *w, size_t fold, double squares[2]) {
  double sums[2] = {0.0, 0.0};
  for (size_t i = 0; i < w->m->count; ++i) {
    const supine_patient_row *row = &w->m->rows[i];
    double u[3];
    if (fold == FOLDS || row->block % FOLDS == fold) {
      predict(w, i, u, NULL);
      sums[0] += row->weight * pow(row->value - supine_dot(row->axis, u), 2.0);
      sums[1] += row->weight;
    }
  }
  if (squares != NULL) {
    squares[0] += sums[0];
    squares[1] += sums[1];
  }
  return sqrt(sums[0] / sums[1]);
}

/* Fit the unknowns to the present matches without each fold in turn, then to all. Write the RMS
 * residual of the held-out and of all measurements, mm. */
static bool cross_validate(work *w, bool uniform, double noise, double *held_out, double *fitted) {
  double squares[2] = {0.0, 0.0};
  bool solved = true;
  for (size_t fold = 0; fold <= FOLDS && solved; ++fold) {
    for (size_t k = 0; k < w->stiffness->count; ++k) {
      w->x[k] = 1.0;
    }
    for (size_t round = 0; round < ROUNDS && solved; ++round) {
      solved = step(w, uniform, noise, fold);
    }
    *fitted = residual(w, fold, fold < FOLDS ? squares : NULL);
  }
  *held_out = sqrt(squares[0] / squares[1]);
  return solved;
}

/* Weaken the prior while that reduces the held-out error, and measure that of uniform tissue. */
static bool choose_ridge(work *w, double noise, supine_patient_expand_report *report) {
  double best = w->ridge;
  double held_out = 0.0;
  bool solved = cross_validate(w, true, noise, &report->held_out[0], &report->fitted[0]);
  report->held_out[1] = INFINITY;
  for (; solved && w->ridge > ridge_least; w->ridge *= ridge_step) {
    solved = cross_validate(w, false, noise, &held_out, &report->fitted[1]);
    if (held_out >= report->held_out[1]) {
      break;
    }
    report->held_out[1] = held_out;
    best = w->ridge;
  }
  w->ridge = best;
  return solved;
}

static supine_status undetermined(supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                          "the surfaces do not determine the expandability of the lungs");
}

/* Fit and match the surfaces in turn, without robust weights. */
static supine_status iterate(work *w, double *noise, supine_error *error) {
  supine_patient_matching *m = w->m;
  for (size_t round = 0; round < ROUNDS; ++round) {
    SUPINE_TRY(supine_patient_matching_weigh(m, INFINITY, error));
    *noise = fmax(noise_least, residual(w, FOLDS, NULL));
    if (!step(w, round == 0, *noise, FOLDS) || !step(w, false, *noise, FOLDS)) {
      return undetermined(error);
    }
    for (size_t i = 0; i < m->count; ++i) {
      double u[3];
      predict(w, i, u, NULL);
      for (size_t k = 0; k < 3; ++k) {
        m->match[i].position[k] = m->fuller->mesh.vertices[3 * m->match[i].vertex + k] + u[k];
      }
    }
    supine_patient_matching_find(m);
  }
  return SUPINE_OK;
}

/* Set the regions and the displacement law to the solution. After the last step, w->matrix holds
 * the Cholesky factor of the normal matrix: its inverse times the prior's precision is the part of
 * each region that the prior determines. */
static void conclude(work *w, supine_patient_power *law, supine_patient_stiffness *stiffness,
                     supine_patient_expand_report *report) {
  const size_t regions = stiffness->count;
  const size_t size = regions + AXES + w->motion;
  for (size_t k = 0; k < regions; ++k) {
    double x[UNKNOWNS_MAX] = {0.0};
    for (size_t l = 0; l < regions; ++l) {
      x[l] = w->ridge * w->precision[k * regions + l];
    }
    (void)LAPACKE_dpotrs(LAPACK_COL_MAJOR, 'U', (lapack_int)size, 1, w->matrix, (lapack_int)size, x,
                         (lapack_int)size);
    stiffness->region[k].expandability = w->x[k];
    stiffness->region[k].determined = 1.0 - x[k];
    if (stiffness->region[k].determined < SUPINE_PATIENT_DETERMINED) {
      ++report->undetermined;
    }
  }
  for (size_t axis = 0; axis < AXES; ++axis) {
    law->c[2 * axis] *= w->x[regions + axis];
  }
  memcpy(law->motion, w->x + regions + AXES, sizeof law->motion);
}

supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_fit_options *options,
                                    supine_patient *patient, supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error) {
  supine_patient_power law = supine_patient_deep(options->gravity, options->path_span);
  double noise = 0.0;
  *report = (supine_patient_expand_report){.tried = true};
  place_regions(matching->fuller, stiffness);
  const size_t n = stiffness->count;
  SUPINE_ARENA arena = {0};
  work w = {.m = matching,
            .stiffness = stiffness,
            .motion = (size_t)options->scan_motion,
            .ridge = 1.0,
            .response = supine_arena_take(&arena, matching->count * (n + 1) * AXES, sizeof(double)),
            .precision = supine_arena_take(&arena, n * n, sizeof(double)),
            .matrix =
                supine_arena_take(&arena, (size_t)UNKNOWNS_MAX * UNKNOWNS_MAX, sizeof(double))};
  size_t blocks; /* not used: the folds count the cubes modulo their number */
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu regions", n));
  SUPINE_TRY(supine_patient_rows_block(&matching->frame, matching->rows, matching->count, 1,
                                       &blocks, error));
  SUPINE_TRY(find_responses(&w, &law, error));
  find_prior_precision(stiffness, w.precision);
  for (size_t t = 0; t < n + AXES; ++t) {
    w.x[t] = 1.0;
  }
  SUPINE_TRY(iterate(&w, &noise, error));
  if (!choose_ridge(&w, noise, report)) {
    return undetermined(error);
  }
  SUPINE_TRY(iterate(&w, &noise, error));
  report->fitted[1] = residual(&w, FOLDS, NULL);
  conclude(&w, &law, stiffness, report);
  report->kept = report->held_out[1] < kept_ratio * report->held_out[0];
  stiffness->count = report->kept ? n : 0;
  patient->power = report->kept ? law : patient->power;
  return supine_patient_matching_set_tissue(matching, &law, stiffness, error);
}
