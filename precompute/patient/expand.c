/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Expandability from motion, and whether it improves held-out blocks. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>
#include <lapacke.h>

#include "precompute/patient/expand.h"

#include "precompute/patient/krige.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"

enum {
  REGIONS = 2 * SUPINE_PATIENT_MODES,
  LANES = 16, /* regions solved for at once */
  ROUNDS = 3, /* rounds of finding the nearest points */
  TURNS = 30, /* most alternations between regions and law */
  HELD_TURNS = 8,
  FOLDS = 5
};

/* Prior standard deviations of a: between neighbouring regions, and of any region from 1. */
static const double neighbours_differ = 0.3;
static const double regions_differ = 1.0;
static const double noise_least = 0.3; /* Least noise of a surface point, mm. */
static const double together = 10.0;   /* neighbouring rows of equal error: they count as one */

static const double near_by = 1.7;   /* largest distance of neighbours over the least one */
static const double least = 0.02;    /* Least a of a region. */
static const double worth = 0.95;    /* ratio of held-out RMS, with over without, to keep it */
static const double settled = 1e-3;  /* Change of every a at which the alternation ends. */

/* The regions' values and the law fitted with them. */
typedef struct estimate {
  double a[REGIONS];    /* left lung first */
  double seen[REGIONS]; /* diagonal of the resolution matrix */
  supine_patient_power power;
} estimate;

typedef struct study {
  supine_patient_matching *m;
  const supine_patient_expand_task *task;
  supine_patient_krige_options prior;
  supine_patient_stiffness regions; /* centres and radii */
  size_t count;                     /* regions of both lungs */
  size_t row_count;
  double *response;                 /* [row_count, count] F_k of each region */
  double belief[REGIONS * REGIONS]; /* precision of the prior of a - 1, times the squared noise */
} study;

/* --- the linear problem ---------------------------------------------------------------------- */

static const supine_patient_mode *region(const study *s, size_t k) {
  const size_t left = s->regions.count[0];
  return k < left ? &s->regions.mode[0][k] : &s->regions.mode[1][k - left];
}

static void believe(study *s) {
  double nearest = INFINITY;
  memset(s->belief, 0, sizeof s->belief);
  for (size_t j = 0; j < s->count; ++j) {
    for (size_t k = 0; k < j; ++k) {
      nearest = fmin(nearest, supine_distance(region(s, j)->centre, region(s, k)->centre));
    }
  }
  for (size_t j = 0; j < s->count; ++j) {
    s->belief[j * s->count + j] += pow(regions_differ, -2.0);
    for (size_t k = 0; k < j; ++k) {
      const bool same_lung = (j < s->regions.count[0]) == (k < s->regions.count[0]);
      if (same_lung &&
          supine_distance(region(s, j)->centre, region(s, k)->centre) < near_by * nearest) {
        const double weight = pow(neighbours_differ, -2.0);
        s->belief[j * s->count + j] += weight;
        s->belief[k * s->count + k] += weight;
        s->belief[j * s->count + k] -= weight;
        s->belief[k * s->count + j] -= weight;
      }
    }
  }
}

/* Find the most likely a of all regions under a fixed law. `normal` is work space. */
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
  for (size_t i = 0; i < s->row_count; ++i) {
    supine_patient_row still = rows[i];
    const double left = supine_patient_power_residual(&e->power, &rows[i]);
    const double along = supine_patient_power_along(&e->power, &rows[i]);
    memset(still.force, 0, sizeof still.force);
    const double target = -supine_patient_power_residual(&e->power, &still);
    if (rows[i].weight == 0.0) {
      continue;
    }
    squares += rows[i].weight * left * left;
    weight += rows[i].weight;
    cblas_dcopy(size, s->response + i * n, 1, design, 1);
    cblas_dscal(size, along, design, 1);
    cblas_dsyr(CblasColMajor, CblasLower, size, rows[i].weight, design, 1, normal, size);
    cblas_daxpy(size, rows[i].weight * target, design, 1, right, 1);
  }
  const double noise = together * fmax(noise_least * noise_least, squares / fmax(weight, 1.0));
  for (size_t j = 0; j < n; ++j) {
    for (size_t k = 0; k <= j; ++k) { /* the lower triangle of a symmetric matrix */
      normal[j * n + k] = normal[k * n + j];
      whole[j * n + k] = whole[k * n + j] = normal[j * n + k] + noise * s->belief[j * n + k];
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
  for (size_t i = 0; i < s->row_count; ++i) {
    memset(rows[i].force, 0, sizeof rows[i].force);
    rows[i].force[0] = cblas_ddot((int)s->count, s->response + i * s->count, 1, e->a, 1);
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
    status = supine_patient_law_fit(&s->prior, rows, s->row_count, &e->power, error);
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

/* --- the force of each region alone ---------------------------------------------------------- */

/* Fill the response of a landmark's row, where the force is taken not to spread. */
static void respond_landmark(const study *s, size_t row, const double slopes[4]) {
  const supine_patient_place *place = &s->m->rows[row].place;
  const size_t side = place->side > 0.0 ? 0U : 1U;
  double *out = s->response + row * s->count;
  double point[3];
  double shares[SUPINE_PATIENT_MODES];
  double force = slopes[0];
  for (size_t k = 0; k < 3; ++k) {
    point[k] = 0.5 * (s->m->frame.minimum[k] + s->m->frame.maximum[k]) + place->arm[k];
    force += slopes[1 + k] * (place->box[k] - 0.5);
  }
  supine_patient_stiffness_shares(&s->regions, side, point, shares);
  memset(out, 0, s->count * sizeof *out);
  for (size_t k = 0; k < s->regions.count[side]; ++k) {
    out[(side == 0 ? 0 : s->regions.count[0]) + k] = force * shares[k];
  }
}

/* Find the model's force (18) [N] in the other state, and its least-squares fit by the columns. */
static supine_status find_force(const study *s, double *force, double slopes[4],
                                supine_error *error) {
  enum { COLUMNS = SUPINE_PATIENT_COLUMNS };
  const supine_lungs *lungs = s->m->rest;
  const supine_force_law *law = &s->task->model->force;
  double range[2];
  double matrix[COLUMNS * COLUMNS] = {0.0};
  if (supine_physics_height_range(lungs, law->pair, 1, s->task->gravity, range, range + 1) !=
      SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for the force");
  }
  const supine_gravities gravity = {1, s->task->gravity, range, range + 1};
  supine_physics_force(lungs, law, &gravity, lungs->mesh.vertex_count, NULL, force);
  memset(slopes, 0, COLUMNS * sizeof *slopes);
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    const double *column = s->m->columns + COLUMNS * i;
    cblas_dsyr(CblasColMajor, CblasLower, COLUMNS, 1.0, column, 1, matrix, COLUMNS);
    cblas_daxpy(COLUMNS, force[i], column, 1, slopes, 1);
  }
  return LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', COLUMNS, 1, matrix, COLUMNS, slopes, COLUMNS) == 0
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                "the reference surface is flat: give closed lungs");
}

/* Solve for the force on each region alone, LANES at a time. */
static supine_status find_responses(const study *s, supine_error *error) {
  const supine_patient_matching *m = s->m;
  const size_t n = m->rest->mesh.vertex_count;
  double slopes[SUPINE_PATIENT_COLUMNS];
  double *force = malloc(n * sizeof *force);
  double *alone = calloc(n * LANES, sizeof *alone);
  double *caught = malloc(n * LANES * sizeof *caught);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (force == NULL || alone == NULL || caught == NULL) {
    (void)supine_error_set(error, status, "no memory for %zu vertices", n);
    goto cleanup;
  }
  status = supine_physics_equilibrium_set_stiffness(m->equilibrium, NULL, error);
  if (status == SUPINE_OK) {
    status = find_force(s, force, slopes, error);
  }
  for (size_t first = 0; first < s->count && status == SUPINE_OK; first += LANES) {
    const size_t lanes = s->count - first < LANES ? s->count - first : LANES;
    for (size_t i = 0; i < n; ++i) {
      const size_t side = supine_patient_side_of(m->rest, i);
      const size_t begin = side == 0 ? 0 : s->regions.count[0];
      double shares[SUPINE_PATIENT_MODES];
      supine_patient_stiffness_shares(&s->regions, side, m->rest->mesh.vertices + 3 * i, shares);
      for (size_t r = 0; r < lanes; ++r) {
        const size_t k = first + r - begin; /* wraps for the other lung's regions */
        alone[i * lanes + r] = k < s->regions.count[side] ? force[i] * shares[k] : 0.0;
      }
    }
    status = supine_physics_equilibrium_solve(m->equilibrium, lanes, alone, caught, NULL, error);
    for (size_t i = 0; i < m->count && status == SUPINE_OK; ++i) {
      memcpy(s->response + i * s->count + first, caught + m->vertex[i] * lanes,
             lanes * sizeof *caught);
    }
  }
  for (size_t i = m->count; i < s->row_count && status == SUPINE_OK; ++i) {
    respond_landmark(s, i, slopes);
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
  const size_t *fold_of; /* [blocks] */
  double squares[FOLDS], weight[FOLDS];
  supine_status status[FOLDS];
  supine_error error[FOLDS];
} holding;

static void hold_out_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  holding *h = context;
  const supine_patient_matching *m = h->s->m;
  for (size_t fold = begin; fold < end; ++fold) {
    estimate e = *h->from;
    supine_patient_row *rows = malloc(h->s->row_count * sizeof *rows);
    if (rows == NULL) {
      h->status[fold] =
          supine_error_set(&h->error[fold], SUPINE_ERROR_MEMORY, "no memory for rows");
      continue;
    }
    memcpy(rows, m->rows, h->s->row_count * sizeof *rows);
    for (size_t i = 0; i < h->s->row_count; ++i) {
      rows[i].weight = h->fold_of[rows[i].block] == fold ? 0.0 : rows[i].weight;
    }
    h->status[fold] = fit_rows(h->s, rows, h->with, HELD_TURNS, &e, &h->error[fold]);
    for (size_t i = 0; i < m->count && h->status[fold] == SUPINE_OK; ++i) {
      if (h->fold_of[rows[i].block] == fold) {
        const double left = supine_patient_power_residual(&e.power, &rows[i]);
        h->squares[fold] += m->rows[i].weight * left * left;
        h->weight[fold] += m->rows[i].weight;
      }
    }
    free(rows);
  }
}

/* Compute the RMS residual, mm, of held-out blocks. */
static supine_status hold_out(const study *s, const estimate *from, bool with, double *rms,
                              supine_error *error) {
  holding h = {.s = s, .from = from, .with = with};
  const size_t blocks = supine_patient_rows_block(&s->m->frame, s->m->rows, s->row_count, 1);
  size_t *fold_of = malloc((blocks + 1) * sizeof *fold_of);
  double squares = 0.0;
  double weight = 0.0;
  if (fold_of == NULL || blocks == 0 ||
      supine_patient_rows_deal(blocks, FOLDS, 1, fold_of) != SUPINE_OK) {
    free(fold_of);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", s->row_count);
  }
  h.fold_of = fold_of;
  supine_parallel_for(FOLDS, 1, 0, hold_out_range, &h);
  free(fold_of);
  for (size_t fold = 0; fold < FOLDS; ++fold) {
    if (h.status[fold] != SUPINE_OK) {
      return supine_error_set(error, h.status[fold], "%s", h.error[fold].message);
    }
    squares += h.squares[fold];
    weight += h.weight[fold];
  }
  *rms = weight > 0.0 ? sqrt(squares / weight) : 0.0;
  return SUPINE_OK;
}

/* --- the whole fit --------------------------------------------------------------------------- */

/* Move the vertices by an estimate and find the nearest points anew. */
static void match_anew(const study *s, const estimate *e) {
  supine_patient_matching *m = s->m;
  set_forces(s, e, m->rows);
  for (size_t i = 0; i < m->count; ++i) {
    supine_patient_row row = m->rows[i];
    row.value = 0.0;
    for (size_t a = 0; a < 3; ++a) {
      for (size_t k = 0; k < 3; ++k) {
        row.axis[k] = a == k ? 1.0 : 0.0;
      }
      m->moved[3 * i + a] = m->rest->mesh.vertices[3 * m->vertex[i] + a] +
                            supine_patient_power_residual(&e->power, &row);
    }
  }
  supine_patient_matching_find(m); /* full weights: the law's residual is the signal here */
}

static double root_mean(const study *s, const estimate *e) {
  double squares = 0.0;
  double weight = 0.0;
  for (size_t i = 0; i < s->m->count; ++i) {
    const supine_patient_row *row = &s->m->rows[i];
    squares += row->weight * pow(supine_patient_power_residual(&e->power, row), 2.0);
    weight += row->weight;
  }
  return weight > 0.0 ? sqrt(squares / weight) : 0.0;
}

/* Alternate between finding the nearest points and the estimate. */
static supine_status settle(const study *s, bool with, estimate *e, double *rms,
                            supine_error *error) {
  supine_status status = SUPINE_OK;
  for (size_t round = 0; round < ROUNDS && status == SUPINE_OK; ++round) {
    const double share = (with ? 0.3 : 0.0) + 0.3 * (double)round / ROUNDS;
    if (s->task->progress != NULL && !s->task->progress(s->task->context, share)) {
      return supine_error_set(error, SUPINE_ERROR_INTERRUPTED, "interrupted");
    }
    status = fit_rows(s, s->m->rows, with, TURNS, e, error);
    if (status == SUPINE_OK) {
      *rms = root_mean(s, e);
      match_anew(s, e);
    }
  }
  return status;
}

/* Find the range of E that holds nine tenths of the seen area, with a geometric mean of 1 over
 * the whole surface, and the share not seen. e [N] is sorted. */
static void note_range(const study *s, double *e, supine_patient_expand_report *report) {
  const supine_lungs *lungs = s->m->rest;
  const size_t n = lungs->mesh.vertex_count;
  double logarithms = 0.0;
  size_t seen_count = 0;
  for (size_t i = 0; i < n; ++i) {
    logarithms += log(e[i]) / (double)n;
  }
  for (size_t i = 0; i < n; ++i) {
    const size_t side = supine_patient_side_of(lungs, i);
    double shares[SUPINE_PATIENT_MODES];
    double seen = 0.0;
    supine_patient_stiffness_shares(&s->regions, side, lungs->mesh.vertices + 3 * i, shares);
    for (size_t k = 0; k < s->regions.count[side]; ++k) {
      seen += shares[k] * s->regions.mode[side][k].seen;
    }
    if (seen >= SUPINE_PATIENT_SEEN) {
      e[seen_count++] = e[i] / exp(logarithms);
    }
  }
  if (seen_count > 0) {
    gsl_sort(e, 1, seen_count);
    report->softest = gsl_stats_quantile_from_sorted_data(e, 1, seen_count, 0.05);
    report->stiffest = gsl_stats_quantile_from_sorted_data(e, 1, seen_count, 0.95);
  }
  for (size_t k = 0; k < s->count; ++k) {
    report->unseen += region(s, k)->seen < SUPINE_PATIENT_SEEN;
  }
  report->regions = s->count;
}

/* Set matching, law and stiffness to the estimate that is kept. */
static supine_status finish(study *s, const estimate *e, supine_patient *patient,
                            supine_patient_stiffness *stiffness,
                            supine_patient_expand_report *report, supine_error *error) {
  const size_t n = s->m->rest->mesh.vertex_count;
  double *space = malloc(n * sizeof *space);
  if (space == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  for (size_t k = 0; k < s->count; ++k) {
    const size_t left = s->regions.count[0];
    supine_patient_mode *mode = k < left ? &s->regions.mode[0][k] : &s->regions.mode[1][k - left];
    mode->value = e->a[k];
    mode->seen = e->seen[k];
  }
  supine_patient_stiffness_of(&s->regions, s->m->rest, space);
  *stiffness = report->kept ? s->regions : (supine_patient_stiffness){0};
  supine_patient_take(&e->power, patient);
  match_anew(s, e);
  const supine_status status =
      supine_patient_matching_solve(s->m, report->kept ? space : NULL, error);
  if (report->kept) {
    note_range(s, space, report);
  }
  free(space);
  return status;
}

supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_expand_task *task, supine_patient *patient,
                                    supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error) {
  supine_patient_matching *m = matching;
  supine_patient_power law;
  memcpy(law.powers, patient->powers, sizeof law.powers);
  memcpy(law.linear, patient->lengths, sizeof patient->lengths);
  memcpy(law.linear + 3, patient->motion, sizeof patient->motion);
  estimate found[2] = {{.power = law}, {.power = law}}; /* even tissue; fitted tissue */
  study *s = calloc(1, sizeof *s);
  *report = (supine_patient_expand_report){.tried = true, .softest = 1.0, .stiffest = 1.0};
  *stiffness = (supine_patient_stiffness){0};
  if (s == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for regions");
  }
  *s = (study){.m = m, .task = task, .row_count = m->count + m->landmark_rows_count};
  s->prior = supine_patient_krige_prior(SUPINE_PATIENT_PAPER, &law, task->moved);
  supine_patient_stiffness_spread(m->rest, &s->regions);
  s->count = s->regions.count[0] + s->regions.count[1];
  s->response = malloc((s->row_count * s->count + 1) * sizeof *s->response);
  supine_status status =
      s->response == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu regions", s->count)
          : find_responses(s, error);
  believe(s);
  supine_patient_matching_find(m);
  for (size_t k = 0; k < s->count; ++k) {
    found[0].a[k] = found[1].a[k] = 1.0;
  }
  for (int with = 0; with < 2 && status == SUPINE_OK; ++with) {
    found[with].power = found[0].power;
    status = settle(s, with == 1, &found[with], &report->fitted[with], error);
    if (status == SUPINE_OK) {
      status = hold_out(s, &found[with], with == 1, &report->held_out[with], error);
    }
  }
  if (status == SUPINE_OK) {
    report->kept = report->held_out[1] < worth * report->held_out[0];
    status = finish(s, &found[report->kept], patient, stiffness, report, error);
  }
  free(s->response);
  free(s);
  return status;
}
