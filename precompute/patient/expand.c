/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit expandability to motion, and test whether it improves the prediction of held-out blocks. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>
#include <lapacke.h>

#include "precompute/patient/matching.h"

#include "sh/base/parallel.h"
#include "sh/base/vec3.h"

enum {
  REGIONS = SUPINE_PATIENT_MODES,
  LANES = 16,     /* regions solved for at once */
  ROUNDS = 3,     /* rounds of finding the nearest points */
  TURNS = 30,     /* most alternations between regions and law */
  HELD_TURNS = 8, /* the same without a fold */
  FOLDS = SUPINE_PATIENT_FOLDS
};

/* Prior standard deviations of a: between neighbouring regions, and of any region from 1. */
static const double neighbours_differ = 0.3;
static const double regions_differ = 1.0;
static const double noise_least = 0.3; /* Least noise of a surface point, mm. */
static const double together = 10.0;   /* neighbouring rows with a common error: count as one */

static const double near_by = 1.7; /* largest distance of neighbouring centres over the least one */
static const double least = 0.02;  /* Least a of a region. */
static const double worth = 0.95;  /* ratio of held-out RMS, with over without, to keep it */
static const double settled = 1e-3; /* Change of every a at which the alternation ends. */

/* The regions' values and the law fitted with them. */
typedef struct estimate {
  double a[REGIONS];
  double seen[REGIONS]; /* diagonal of the resolution matrix */
  supine_patient_power power;
} estimate;

typedef struct study {
  supine_patient_matching *m;
  const supine_patient_fit_options *options;
  supine_patient_power mean;           /* of the law, before the fit */
  supine_patient_stiffness regions;    /* centres and radii */
  size_t count;                        /* regions of both lungs */
  double *response;                    /* [rows, count] F_k of each region */
  double precision[REGIONS * REGIONS]; /* [count, count] prior precision of a - 1 */
  size_t *fold;                        /* [rows] */
} study;

/* --- the linear problem ---------------------------------------------------------------------- */

/* Compute the prior precision of a - 1. */
static void set_precision(study *s) {
  const supine_patient_mode *mode = s->regions.mode;
  double nearest = INFINITY;
  for (size_t i = 0; i < s->count * s->count; ++i) {
    const size_t j = i / s->count;
    const size_t k = i % s->count;
    nearest = j != k ? fmin(nearest, supine_distance(mode[j].centre, mode[k].centre)) : nearest;
    s->precision[i] = j == k ? pow(regions_differ, -2.0) : 0.0;
  }
  for (size_t i = 0; i < s->count * s->count; ++i) {
    const size_t j = i / s->count;
    const size_t k = i % s->count;
    if (j != k && mode[j].side == mode[k].side &&
        supine_distance(mode[j].centre, mode[k].centre) < near_by * nearest) {
      s->precision[j * s->count + j] += pow(neighbours_differ, -2.0);
      s->precision[i] -= pow(neighbours_differ, -2.0);
    }
  }
}

/* Find the most likely a of all regions under a fixed law. `space` is [(2 count + 1) count].
 * Return false if the matrix is singular. */
static bool solve_regions(const study *s, const supine_patient_row *rows, double *space,
                          estimate *e) {
  const size_t n = s->count;
  const int size = (int)n;
  double *normal = space;
  double *whole = normal + n * n;
  double *design = whole + n * n; /* [n] */
  double squares = 0.0;
  double weight = 0.0;
  double right[REGIONS] = {0.0};
  memset(normal, 0, n * n * sizeof *normal);
  for (size_t i = 0; i < s->m->count; ++i) {
    double along[3];
    double motion[3];
    const supine_patient_row *row = &rows[i];
    supine_patient_direction(&e->power, &row->place, 1.0, along);
    supine_patient_motion(&e->power, &row->place, motion);
    const double target = row->value - supine_dot(motion, row->axis);
    const double left = row->place.force[0] * supine_dot(along, row->axis) - target;
    squares += row->weight * left * left;
    weight += row->weight;
    cblas_dcopy(size, s->response + i * n, 1, design, 1);
    cblas_dscal(size, supine_dot(along, row->axis), design, 1);
    cblas_dsyr(CblasColMajor, CblasLower, size, row->weight, design, 1, normal, size);
    cblas_daxpy(size, row->weight * target, design, 1, right, 1);
  }
  const double noise = together * fmax(noise_least * noise_least, squares / fmax(weight, 1.0));
  for (size_t j = 0; j < n; ++j) {
    for (size_t k = 0; k <= j; ++k) { /* the lower triangle of a symmetric matrix */
      normal[j * n + k] = normal[k * n + j];
      whole[j * n + k] = whole[k * n + j] = normal[j * n + k] + noise * s->precision[j * n + k];
    }
    right[j] += noise * pow(regions_differ, -2.0); /* (a - 1)^2; differences have mean 0 */
  }
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', size, 1, whole, size, right, size) != 0 ||
      LAPACKE_dpotrs(LAPACK_COL_MAJOR, 'L', size, size, whole, size, normal, size) != 0) {
    return false;
  }
  for (size_t k = 0; k < n; ++k) {
    e->a[k] = fmax(least, right[k]);
    e->seen[k] = normal[k * n + k];
  }
  return true;
}

/* Set the rows' force from the regions' a. */
static void set_forces(const study *s, const estimate *e, supine_patient_row *rows) {
  for (size_t i = 0; i < s->m->count; ++i) {
    memset(rows[i].place.force, 0, sizeof rows[i].place.force);
    rows[i].place.force[0] = cblas_ddot((int)s->count, s->response + i * s->count, 1, e->a, 1);
  }
}

/* Fit the regions (if `with`) and the law in turn, with the rows' weights fixed. */
static supine_status fit_rows(const study *s, supine_patient_row *rows, bool with, size_t turns,
                              estimate *e, supine_error *error) {
  double *space = malloc((2 * s->count + 1) * s->count * sizeof *space);
  double change = INFINITY;
  supine_status status = space == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY,
                                                          "no memory for %zu regions", s->count)
                                       : SUPINE_OK;
  for (size_t turn = 0; turn < turns && status == SUPINE_OK && change > settled; ++turn) {
    const estimate before = *e;
    set_forces(s, e, rows);
    status = supine_patient_law_fit(s->options, &s->mean, rows, s->m->count, &e->power, error);
    if (status == SUPINE_OK && with && !solve_regions(s, rows, space, e)) {
      status = supine_error_set(
          error, SUPINE_ERROR_NUMERICAL,
          "the surfaces do not determine the expandability: leave --expandability out");
    }
    change = 0.0;
    for (size_t k = 0; k < s->count; ++k) {
      change = fmax(change, fabs(e->a[k] - before.a[k]));
    }
  }
  set_forces(s, e, rows);
  free(space);
  return status;
}

/* Solve for the force on each region alone, LANES at a time. */
static supine_status find_responses(const study *s, const supine_model *model,
                                    supine_error *error) {
  const supine_patient_matching *m = s->m;
  const size_t n = m->rest->mesh.vertex_count;
  double range[2];
  double *force = malloc(n * sizeof *force);
  double *alone = malloc(n * LANES * sizeof *alone);
  double *caught = malloc(n * LANES * sizeof *caught);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (force == NULL || alone == NULL || caught == NULL ||
      supine_physics_height_range(m->rest, model->force.pair, 1, s->options->gravity, range,
                                  range + 1) != SUPINE_OK) {
    (void)supine_error_set(error, status, "no memory for %zu vertices", n);
    goto cleanup;
  }
  const supine_gravities gravity = {1, s->options->gravity, range, range + 1};
  supine_physics_force(m->rest, &model->force, &gravity, n, NULL, force);
  status = supine_physics_equilibrium_set_stiffness(m->equilibrium, NULL, error);
  for (size_t first = 0; first < s->count && status == SUPINE_OK; first += LANES) {
    const size_t lanes = s->count - first < LANES ? s->count - first : LANES;
    for (size_t i = 0; i < n; ++i) {
      double shares[SUPINE_PATIENT_MODES];
      supine_patient_stiffness_shares(&s->regions, m->rest, i, shares);
      for (size_t r = 0; r < lanes; ++r) {
        alone[i * lanes + r] = force[i] * shares[first + r];
      }
    }
    status = supine_physics_equilibrium_solve(m->equilibrium, lanes, alone, caught, NULL, error);
    for (size_t i = 0; i < m->count && status == SUPINE_OK; ++i) {
      memcpy(s->response + i * s->count + first, caught + m->vertex[i] * lanes,
             lanes * sizeof *caught);
    }
  }
cleanup:
  free(force);
  free(alone);
  free(caught);
  return status;
}

/* --- whether expandability improves held-out blocks ------------------------------------------ */

/* Squared residuals of blocks held out, fold by fold. */
typedef struct holding {
  const study *s;
  const estimate *from;
  bool with;
  double squares[FOLDS], weight[FOLDS];
  supine_status status[FOLDS];
} holding;

/* Add up the weighted squared residuals of the law in one fold, or all rows (fold NULL). */
static void add_squares(const study *s, const supine_patient_row *rows, const size_t *fold,
                        size_t which, const supine_patient_power *power, double *squares,
                        double *weight) {
  for (size_t i = 0; i < s->m->count; ++i) {
    if (fold == NULL || fold[i] == which) {
      *squares += s->m->rows[i].weight * pow(supine_patient_power_residual(power, &rows[i]), 2.0);
      *weight += s->m->rows[i].weight;
    }
  }
}

static void hold_out_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  holding *h = context;
  const supine_patient_matching *m = h->s->m;
  for (size_t fold = begin; fold < end; ++fold) {
    estimate e = *h->from;
    supine_patient_row *rows = malloc(m->count * sizeof *rows);
    if (rows == NULL) {
      h->status[fold] = SUPINE_ERROR_MEMORY;
      continue;
    }
    for (size_t i = 0; i < m->count; ++i) {
      rows[i] = m->rows[i];
      rows[i].weight = h->s->fold[i] == fold ? 0.0 : rows[i].weight;
    }
    h->status[fold] = fit_rows(h->s, rows, h->with, HELD_TURNS, &e, NULL);
    add_squares(h->s, rows, h->s->fold, fold, &e.power, &h->squares[fold], &h->weight[fold]);
    free(rows);
  }
}

/* Compute the RMS residual, mm, of held-out blocks. */
static supine_status hold_out(const study *s, const estimate *from, bool with, double *rms,
                              supine_error *error) {
  holding h = {.s = s, .from = from, .with = with};
  double squares = 0.0;
  double weight = 0.0;
  if (supine_patient_rows_fold(&s->m->frame, s->m->rows, s->m->count, 1, s->fold) == 0) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", s->m->count);
  }
  supine_parallel_for(FOLDS, 1, 0, hold_out_range, &h);
  for (size_t fold = 0; fold < FOLDS; ++fold) {
    if (h.status[fold] != SUPINE_OK) {
      return supine_error_set(error, h.status[fold], "fitting without the held-out blocks failed");
    }
    squares += h.squares[fold];
    weight += h.weight[fold];
  }
  *rms = sqrt(squares / weight);
  return SUPINE_OK;
}

/* --- the whole fit --------------------------------------------------------------------------- */

/* Move the vertices by an estimate and find the nearest points anew, with full weights: the law's
 * residual is the signal here. */
static void match_anew(const study *s, const estimate *e, supine_patient *patient) {
  set_forces(s, e, s->m->rows);
  patient->power = e->power;
  patient->centre_count = 0;
  (void)supine_patient_matching_place(s->m, patient);
  supine_patient_matching_find(s->m);
}

/* Alternate between finding the nearest points and the estimate. */
static supine_status settle(const study *s, bool with, estimate *e, supine_patient *patient,
                            double *rms, supine_error *error) {
  supine_status status = SUPINE_OK;
  for (size_t round = 0; round < ROUNDS && status == SUPINE_OK; ++round) {
    status = fit_rows(s, s->m->rows, with, TURNS, e, error);
    if (status == SUPINE_OK) {
      double squares = 0.0;
      double weight = 0.0;
      add_squares(s, s->m->rows, NULL, 0, &e->power, &squares, &weight);
      *rms = sqrt(squares / weight);
      match_anew(s, e, patient);
    }
  }
  return status;
}

/* Store the values of all regions, and find the range of stiffness E of the determined ones. */
static void note_regions(study *s, const estimate *e, supine_patient_expand_report *report) {
  double stiffness[REGIONS];
  double logarithms = 0.0;
  size_t seen = 0;
  for (size_t k = 0; k < s->count; ++k) {
    s->regions.mode[k].value = e->a[k];
    s->regions.mode[k].seen = e->seen[k];
    logarithms -= log(e->a[k]) / (double)s->count;
  }
  for (size_t k = 0; k < s->count; ++k) {
    if (e->seen[k] >= SUPINE_PATIENT_SEEN) {
      stiffness[seen++] = 1.0 / (e->a[k] * exp(logarithms));
    }
  }
  report->regions = s->count;
  report->unseen = s->count - seen;
  if (seen > 0) {
    gsl_sort(stiffness, 1, seen);
    report->softest = gsl_stats_quantile_from_sorted_data(stiffness, 1, seen, 0.05);
    report->stiffest = gsl_stats_quantile_from_sorted_data(stiffness, 1, seen, 0.95);
  }
}

/* Fit without and with expandability, and keep one: set matching, law and stiffness to it. */
static supine_status compare(study *s, supine_patient *patient, supine_patient_stiffness *stiffness,
                             supine_patient_expand_report *report, supine_error *error) {
  const size_t n = s->m->rest->mesh.vertex_count;
  double *tissue = malloc(n * sizeof *tissue);
  estimate found[2] = {{.power = s->mean}}; /* without and with expandability */
  supine_status status = tissue == NULL
                             ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for tissue")
                             : SUPINE_OK;
  for (size_t k = 0; k < s->count; ++k) {
    found[0].a[k] = 1.0;
  }
  supine_patient_matching_find(s->m);
  for (int with = 0; with < 2 && status == SUPINE_OK; ++with) {
    found[with] = found[0];
    status = settle(s, with == 1, &found[with], patient, &report->fitted[with], error);
    if (status == SUPINE_OK) {
      status = hold_out(s, &found[with], with == 1, &report->held_out[with], error);
    }
  }
  if (status == SUPINE_OK) {
    report->kept = report->held_out[1] < worth * report->held_out[0];
    match_anew(s, &found[report->kept], patient);
    if (report->kept) {
      note_regions(s, &found[1], report);
      *stiffness = s->regions;
    }
    supine_patient_stiffness_of(stiffness, s->m->rest, tissue);
    status = supine_patient_matching_solve(s->m, tissue, error);
  }
  free(tissue);
  return status;
}

supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_fit_options *options,
                                    const supine_model *model, supine_patient *patient,
                                    supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error) {
  const size_t rows = matching->count;
  study *s = calloc(1, sizeof *s);
  *report = (supine_patient_expand_report){.tried = true, .softest = 1.0, .stiffest = 1.0};
  *stiffness = (supine_patient_stiffness){0};
  if (s == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for regions");
  }
  *s = (study){.m = matching, .options = options, .mean = patient->power};
  supine_patient_stiffness_spread(matching->rest, &s->regions);
  s->count = s->regions.count;
  s->response = malloc((rows * s->count + 1) * sizeof *s->response);
  s->fold = malloc(rows * sizeof *s->fold);
  supine_status status =
      s->response == NULL || s->fold == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu regions", s->count)
          : find_responses(s, model, error);
  if (status == SUPINE_OK) {
    set_precision(s);
    status = compare(s, patient, stiffness, report, error);
  }
  free(s->fold);
  free(s->response);
  free(s);
  return status;
}
