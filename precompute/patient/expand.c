/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Expandability from motion, and whether it is worth anything. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_multimin.h>

#include "precompute/patient/expand.h"

#include "precompute/physics/inverse.h"
#include "sh/base/parallel.h"

enum {
  PER_MODE = 5, /* value, centre, radius */
  UNKNOWNS_MAX = 2 * SUPINE_PATIENT_MODES * PER_MODE,
  ROUNDS = 3, /* of finding nearest points anew */
  STEPS = 20, /* of BFGS for each region that comes */
  FOLDS = 5,
  HOPELESS = 8, /* steps after which a region that was worth it would show */
  LAW_STEPS = 50,
  CANDIDATES = 200 /* places for a region, in a lung */
};

/* A region that makes tissue e times as stiff has to bring the surface 0.1 mm RMS nearer. */
static const double ridge_mm = 0.1;

static const double usual_radius = 60.0; /* mm */
static const double centre_unit = 20.0;  /* mm: a step as large as one of e in the stiffness */
static const double first_value = 0.3;
static const double worth = 0.05; /* of J: a region that brings less does not come */

static const double first_step = 0.1;
static const double line_tolerance = 0.1;
static const double settled = 1e-3; /* of J, in a step */
/* Of the law and of solves: rows are known to 1e-3 of what moves at best. For J's slopes as they
 * are told to others, what doubles reach. */
static const double rough[2] = {1e-6, 1e-8};
static const double sharp[2] = {1e-12, 1e-13};

/* One minimisation: which rows count, and where it stands. */
typedef struct study {
  const supine_patient_matching *m;
  supine_patient_moved moved;
  supine_patient_row *rows; /* the matching's, with a catch and weights of their own */
  size_t row_count;
  supine_equilibrium *equilibrium;
  double *caught;                                /* [N, SUPINE_PATIENT_COLUMNS] */
  double *stiffness, *catch_, *slope, *gradient; /* [N] */
  supine_patient_stiffness at;                   /* last looked at */
  supine_patient_power power;
  const double *tolerance; /* of the law and of solves */
  double cost;
  double slopes[UNKNOWNS_MAX];
  bool looked; /* cost and slopes are of `at` */
  supine_status status;
  supine_error *error;
} study;

static void study_free(study *s) {
  supine_physics_equilibrium_destroy(s->equilibrium);
  free(s->rows);
  free(s->caught);
  free(s->stiffness);
  free(s->catch_);
  free(s->slope);
  free(s->gradient);
}

static supine_status study_create(study *s, const supine_patient_matching *m,
                                  supine_patient_moved moved, const supine_patient_power *power,
                                  supine_error *error) {
  const size_t n = m->rest->mesh.vertex_count;
  const size_t rows = m->count + m->landmark_rows_count;
  *s = (study){.m = m,
               .moved = moved,
               .rows = malloc(rows * sizeof(supine_patient_row)),
               .row_count = rows,
               .caught = malloc(SUPINE_PATIENT_COLUMNS * n * sizeof(double)),
               .stiffness = malloc(n * sizeof(double)),
               .catch_ = malloc(n * sizeof(double)),
               .slope = malloc(n * sizeof(double)),
               .gradient = malloc(n * sizeof(double)),
               .power = *power,
               .tolerance = rough,
               .error = error};
  /* One thread: several studies run side by side. */
  if (s->rows == NULL || s->caught == NULL || s->stiffness == NULL || s->catch_ == NULL ||
      s->slope == NULL || s->gradient == NULL ||
      supine_physics_equilibrium_create(m->network, SUPINE_PATIENT_COLUMNS, 1, &s->equilibrium) !=
          SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  memcpy(s->rows, m->rows, rows * sizeof *s->rows);
  memcpy(s->caught, m->caught, SUPINE_PATIENT_COLUMNS * n * sizeof *s->caught);
  return SUPINE_OK;
}

/* --- J and its slopes ------------------------------------------------------------------------ */

/* The catch of the force's columns under the stiffness that is looked at. */
static supine_status solve(study *s) {
  const supine_patient_matching *m = s->m;
  supine_patient_stiffness_of(&s->at, m->rest, s->stiffness);
  supine_status status =
      supine_physics_equilibrium_set_stiffness(s->equilibrium, s->stiffness, s->error);
  if (status == SUPINE_OK) {
    status = supine_physics_equilibrium_solve(s->equilibrium, SUPINE_PATIENT_COLUMNS, m->columns,
                                              s->tolerance[1], true, s->caught, NULL, s->error);
  }
  for (size_t i = 0; i < m->count && status == SUPINE_OK; ++i) {
    memcpy(s->rows[i].force, s->caught + SUPINE_PATIENT_COLUMNS * m->vertex[i],
           sizeof s->rows[i].force);
  }
  return status;
}

/* dJ/dF of every vertex, at the law as it is: 2 w r a, a: what a force of 1 moves along the axis.
 * As the law is the best for this catch, what it would change by adds nothing. */
static void set_slopes(const study *s) {
  const supine_patient_matching *m = s->m;
  const double *c = s->power.powers + 3;
  for (size_t i = 0; i < m->rest->mesh.vertex_count; ++i) {
    const double *caught = s->caught + SUPINE_PATIENT_COLUMNS * i;
    s->catch_[i] = caught[0] + c[0] * caught[1] + c[1] * caught[2] + c[2] * caught[3];
    s->slope[i] = 0.0;
  }
  for (size_t i = 0; i < m->count; ++i) {
    const supine_patient_row *row = &s->rows[i];
    if (row->weight > 0.0) {
      s->slope[m->vertex[i]] = 2.0 * row->weight * supine_patient_power_residual(&s->power, row) *
                               supine_patient_power_along(&s->power, row);
    }
  }
}

/* From slopes by log E of the vertices to those by the regions. */
static void add_modes(study *s) {
  const supine_patient_matching *m = s->m;
  double ridge = 0.0;
  size_t at = 0;
  for (size_t i = 0; i < m->count; ++i) {
    ridge += ridge_mm * ridge_mm * s->rows[i].weight;
  }
  for (size_t side = 0; side < 2; ++side) {
    for (size_t k = 0; k < s->at.count[side]; ++k, at += PER_MODE) {
      const supine_patient_mode *mode = &s->at.mode[side][k];
      const double r = mode->radius;
      const double narrow = log(r / usual_radius);
      double *of = s->slopes + at;
      memset(of, 0, PER_MODE * sizeof *of);
      for (size_t i = 0; i < m->rest->mesh.vertex_count; ++i) {
        const double *p = m->rest->mesh.vertices + 3 * i;
        double slope;
        const double w = supine_patient_mode_at(mode, p, &slope);
        if (w == 0.0 || supine_patient_side_of(m->rest, i) != side) {
          continue;
        }
        of[0] += s->gradient[i] * w;
        if (slope != 0.0) { /* t = |p - centre| / radius */
          const double t =
              sqrt(pow(p[0] - mode->centre[0], 2.0) + pow(p[1] - mode->centre[1], 2.0) +
                   pow(p[2] - mode->centre[2], 2.0)) /
              r;
          const double part = s->gradient[i] * mode->value * slope;
          for (size_t a = 0; a < 3; ++a) {
            of[1 + a] -= part * (p[a] - mode->centre[a]) / (t * r * r);
          }
          of[4] -= part * t / r;
        }
      }
      of[0] += 2.0 * ridge * mode->value;
      of[4] += 2.0 * ridge * narrow / r;
      s->cost += ridge * (mode->value * mode->value + narrow * narrow);
    }
  }
}

/* J and its slopes where the study stands. */
static supine_status look(study *s) {
  supine_status status = solve(s);
  if (status == SUPINE_OK) {
    status = supine_patient_power_fit(s->rows, s->row_count, s->moved, s->power.powers, LAW_STEPS,
                                      s->tolerance[0], &s->power, s->error);
  }
  if (status == SUPINE_OK) {
    set_slopes(s);
    status = supine_physics_inverse_gradient(s->m->network, s->equilibrium, s->stiffness, s->catch_,
                                             s->slope, s->tolerance[1], s->gradient, s->error);
  }
  if (status == SUPINE_OK) {
    s->cost = s->power.squares + s->power.pulled;
    add_modes(s);
  }
  return status;
}

supine_status supine_patient_expand_cost(const supine_patient_matching *matching,
                                         supine_patient_moved moved,
                                         const supine_patient_stiffness *stiffness,
                                         supine_patient_power *power, double *cost, double *slopes,
                                         supine_error *error) {
  study s;
  supine_status status = study_create(&s, matching, moved, power, error);
  s.at = *stiffness;
  s.tolerance = sharp;
  if (status == SUPINE_OK) {
    status = look(&s);
  }
  if (status == SUPINE_OK) {
    *cost = s.cost;
    *power = s.power;
    memcpy(slopes, s.slopes,
           PER_MODE * (stiffness->count[0] + stiffness->count[1]) * sizeof *slopes);
  }
  study_free(&s);
  return status;
}

/* --- the least J ----------------------------------------------------------------------------- */

static size_t unknowns(const study *s) {
  return PER_MODE * (s->at.count[0] + s->at.count[1]);
}

/* Unknown j of a stiffness, and the unit in which GSL counts it; radii are counted as logarithms.
 */
static double *unknown(supine_patient_stiffness *stiffness, size_t j, double *unit) {
  const size_t k = j / PER_MODE;
  supine_patient_mode *mode = k < stiffness->count[0]
                                  ? &stiffness->mode[0][k]
                                  : &stiffness->mode[1][k - stiffness->count[0]];
  *unit = j % PER_MODE == 0 || j % PER_MODE == 4 ? 1.0 : centre_unit;
  return j % PER_MODE == 0   ? &mode->value
         : j % PER_MODE == 4 ? &mode->radius
                             : &mode->centre[j % PER_MODE - 1];
}

static bool look_at(study *s, const gsl_vector *q) {
  bool same = s->looked;
  for (size_t j = 0; j < q->size; ++j) {
    double unit;
    double *of = unknown(&s->at, j, &unit);
    const double value = unit * gsl_vector_get(q, j);
    const double now = j % PER_MODE == 4 ? usual_radius * exp(value) : value;
    same = same && *of == now;
    *of = now;
  }
  if (!same && s->status == SUPINE_OK) {
    s->status = look(s);
    s->looked = s->status == SUPINE_OK;
  }
  return s->status == SUPINE_OK;
}

static double cost_at(const gsl_vector *q, void *context) {
  study *s = context;
  return look_at(s, q) ? s->cost : GSL_NAN;
}

static void slopes_at(const gsl_vector *q, void *context, gsl_vector *slopes) {
  study *s = context;
  const bool right = look_at(s, q);
  for (size_t j = 0; j < q->size; ++j) {
    double unit;
    const double *of = unknown(&s->at, j, &unit);
    const double by = j % PER_MODE == 4 ? *of : unit; /* d radius = radius d log radius */
    gsl_vector_set(slopes, j, right ? s->slopes[j] * by : GSL_NAN);
  }
}

static void both_at(const gsl_vector *q, void *context, double *cost, gsl_vector *slopes) {
  *cost = cost_at(q, context);
  slopes_at(q, context, slopes);
}

/* Minimises from where the study stands; it stands at the least J found in the end. Stops early
 * where J is not below `hoped` soon. */
static supine_status minimise(study *s, size_t steps, double hoped) {
  gsl_multimin_function_fdf system = {cost_at, slopes_at, both_at, unknowns(s), s};
  gsl_multimin_fdfminimizer *work =
      gsl_multimin_fdfminimizer_alloc(gsl_multimin_fdfminimizer_vector_bfgs2, system.n);
  gsl_vector *q = gsl_vector_alloc(system.n);
  s->status = SUPINE_OK;
  s->looked = false;
  if (work == NULL || q == NULL) {
    s->status = supine_error_set(s->error, SUPINE_ERROR_MEMORY, "no memory for regions");
  } else {
    for (size_t j = 0; j < system.n; ++j) {
      double unit;
      const double *of = unknown(&s->at, j, &unit);
      gsl_vector_set(q, j, j % PER_MODE == 4 ? log(*of / usual_radius) : *of / unit);
    }
    int going = gsl_multimin_fdfminimizer_set(work, &system, q, first_step, line_tolerance);
    double last = INFINITY;
    for (size_t k = 0; k < steps && going == GSL_SUCCESS && s->status == SUPINE_OK; ++k) {
      going = gsl_multimin_fdfminimizer_iterate(work);
      const double cost = gsl_multimin_fdfminimizer_minimum(work);
      if (cost > (1.0 - settled) * last || (k + 1 >= HOPELESS && cost > hoped)) {
        going = GSL_ENOPROG;
      }
      last = cost;
    }
    (void)look_at(s, gsl_multimin_fdfminimizer_x(work));
  }
  if (q != NULL) {
    gsl_vector_free(q);
  }
  if (work != NULL) {
    gsl_multimin_fdfminimizer_free(work);
  }
  return s->status;
}

/* A region more, where J falls most for a little of it; false where both lungs have all. */
static bool add_mode(study *s) {
  const supine_lungs *lungs = s->m->rest;
  supine_patient_mode best = {.radius = usual_radius};
  double most = 0.0;
  size_t best_side = 0;
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    const size_t side = lungs->side[lung] > 0 ? 0 : 1;
    const size_t begin = lungs->lung_begin[lung];
    const size_t count = lungs->lung_begin[lung + 1] - begin;
    for (size_t c = 0; c < CANDIDATES && s->at.count[side] < SUPINE_PATIENT_MODES; ++c) {
      supine_patient_mode mode = {.radius = usual_radius};
      double fall = 0.0;
      memcpy(mode.centre, lungs->mesh.vertices + 3 * (begin + c * count / CANDIDATES),
             sizeof mode.centre);
      for (size_t i = begin; i < begin + count; ++i) {
        fall -= s->gradient[i] * supine_patient_mode_at(&mode, lungs->mesh.vertices + 3 * i, NULL);
      }
      if (fabs(fall) > most) {
        most = fabs(fall);
        best = mode;
        best.value = fall > 0.0 ? first_value : -first_value;
        best_side = side;
      }
    }
  }
  if (most > 0.0) {
    s->at.mode[best_side][s->at.count[best_side]++] = best;
  }
  return most > 0.0;
}

/* Regions one by one, from those that are there, until one more is worth next to nothing. */
static supine_status grow(study *s) {
  s->status = look(s);
  for (bool going = true; going && s->status == SUPINE_OK;) {
    const supine_patient_stiffness before = s->at;
    const supine_patient_power law = s->power;
    const double cost = s->cost;
    going = add_mode(s) && minimise(s, STEPS, (1.0 - worth) * cost) == SUPINE_OK &&
            s->cost < (1.0 - worth) * cost;
    if (!going) { /* back to without */
      s->at = before;
      s->power = law;
      s->cost = cost;
    }
  }
  return s->status;
}

/* --- whether it is worth anything ------------------------------------------------------------ */

/* Blocks held out of one fold after the other: squares left of them, by fold. */
typedef struct holding {
  const supine_patient_matching *m;
  supine_patient_moved moved;
  const supine_patient_power *begin;
  bool with;             /* stiffness as well as the law */
  const size_t *fold_of; /* [blocks] */
  double squares[FOLDS], weight[FOLDS];
  supine_status status[FOLDS];
  supine_error error[FOLDS];
  supine_patient_progress *progress;
  void *context;
  double share; /* of the work that was done before */
  bool stopped;
} holding;

static void hold_out_range(void *context, size_t begin, size_t end, size_t thread) {
  holding *h = context;
  const supine_patient_matching *m = h->m;
  for (size_t fold = begin; fold < end && !h->stopped; ++fold) {
    study s;
    h->status[fold] = study_create(&s, m, h->moved, h->begin, &h->error[fold]);
    for (size_t i = 0; i < s.row_count && h->status[fold] == SUPINE_OK; ++i) {
      s.rows[i].weight = h->fold_of[s.rows[i].block] == fold ? 0.0 : s.rows[i].weight;
    }
    if (h->status[fold] == SUPINE_OK) {
      h->status[fold] = h->with ? grow(&s) : look(&s);
    }
    if (h->status[fold] == SUPINE_OK) { /* the rows stand where BFGS looked last */
      h->status[fold] = solve(&s);
    }
    for (size_t i = 0; i < m->count && h->status[fold] == SUPINE_OK; ++i) {
      if (h->fold_of[m->rows[i].block] == fold) {
        const double left = supine_patient_power_residual(&s.power, &s.rows[i]);
        h->squares[fold] += m->rows[i].weight * left * left;
        h->weight[fold] += m->rows[i].weight;
      }
    }
    study_free(&s);
    if (thread == 0 && h->progress != NULL) { /* the others keep pace */
      const double done = (double)(fold + 1 - begin) / (double)(end - begin);
      h->stopped = !h->progress(h->context, h->share + (1.0 - h->share) * done);
    }
  }
}

/* mm RMS of blocks that the law, and where wanted its stiffness, had not seen. */
static supine_status hold_out(holding *h, double *rms, supine_error *error) {
  const supine_patient_matching *m = h->m;
  const size_t count = m->count + m->landmark_rows_count;
  const size_t blocks = supine_patient_rows_block(&m->frame, m->rows, count, 1);
  size_t *fold_of = malloc((blocks + 1) * sizeof *fold_of);
  double squares = 0.0;
  double weight = 0.0;
  if (fold_of == NULL || blocks == 0 ||
      supine_patient_rows_deal(blocks, FOLDS, 1, fold_of) != SUPINE_OK) {
    free(fold_of);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", count);
  }
  h->fold_of = fold_of;
  supine_parallel_for(FOLDS, 1, 0, hold_out_range, h);
  free(fold_of);
  if (h->stopped) {
    return supine_error_set(error, SUPINE_ERROR_INTERRUPTED, "interrupted");
  }
  for (size_t fold = 0; fold < FOLDS; ++fold) {
    if (h->status[fold] != SUPINE_OK) {
      return supine_error_set(error, h->status[fold], "%s", h->error[fold].message);
    }
    squares += h->squares[fold];
    weight += h->weight[fold];
  }
  *rms = weight > 0.0 ? sqrt(squares / weight) : 0.0;
  return SUPINE_OK;
}

/* --- all of it ------------------------------------------------------------------------------- */

/* The matching at a law: its vertices to where the law has them, and their rows. */
static void match_anew(supine_patient_matching *m, const study *s) {
  for (size_t i = 0; i < m->count; ++i) {
    supine_patient_row row = s->rows[i];
    row.value = 0.0;
    for (size_t a = 0; a < 3; ++a) {
      for (size_t k = 0; k < 3; ++k) {
        row.axis[k] = a == k ? 1.0 : 0.0;
      }
      m->moved[3 * i + a] = m->rest->mesh.vertices[3 * m->vertex[i] + a] +
                            supine_patient_power_residual(&s->power, &row);
    }
    memcpy(m->rows[i].force, s->rows[i].force, sizeof row.force);
  }
  supine_patient_matching_find(m); /* whole weights: what the law misses is what is looked for */
}

static double root_mean(const study *s) {
  double squares = 0.0;
  double weight = 0.0;
  for (size_t i = 0; i < s->m->count; ++i) {
    squares += s->rows[i].weight * pow(supine_patient_power_residual(&s->power, &s->rows[i]), 2.0);
    weight += s->rows[i].weight;
  }
  return weight > 0.0 ? sqrt(squares / weight) : 0.0;
}

static void note_range(const double *e, size_t count, supine_patient_expand_report *report) {
  double logarithms = 0.0;
  double low = INFINITY;
  double high = 0.0;
  for (size_t i = 0; i < count; ++i) {
    logarithms += log(e[i]) / (double)count;
    low = fmin(low, e[i]);
    high = fmax(high, e[i]);
  }
  report->softest = low / exp(logarithms);
  report->stiffest = high / exp(logarithms);
}

/* Nearest points, and the law (with its stiffness) by turns; the matching stands at both. */
static supine_status settle(supine_patient_matching *m, study *s, bool with, holding *h,
                            double *rms) {
  supine_status status = SUPINE_OK;
  for (size_t round = 0; round < ROUNDS && status == SUPINE_OK; ++round) {
    memcpy(s->rows, m->rows, s->row_count * sizeof *s->rows);
    const bool even = s->at.count[0] + s->at.count[1] == 0;
    status = !with ? look(s) : round == 0 || even ? grow(s) : minimise(s, STEPS, INFINITY);
    if (status == SUPINE_OK) {
      status = solve(s); /* the rows stand where BFGS looked last */
    }
    if (status == SUPINE_OK) {
      *rms = root_mean(s);
      match_anew(m, s);
    }
    h->stopped = with && h->progress != NULL &&
                 !h->progress(h->context, h->share * (double)(round + 1) / ROUNDS);
    if (h->stopped) {
      status = supine_error_set(s->error, SUPINE_ERROR_INTERRUPTED, "interrupted");
    }
  }
  return status;
}

/* Eight parameters: what is fitted to, how to tell of it, and what comes of it. */
supine_status supine_patient_expand(supine_patient_matching *matching, supine_patient_moved moved,
                                    supine_patient_progress *progress, void *context,
                                    supine_patient_power *power,
                                    supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error) {
  supine_patient_matching *m = matching;
  const size_t n = m->rest->mesh.vertex_count;
  supine_patient_stiffness found[2] = {0}; /* without and with */
  supine_patient_power law[2] = {*power, *power};
  study s;
  *report = (supine_patient_expand_report){.tried = true, .softest = 1.0, .stiffest = 1.0};
  supine_patient_matching_find(m);
  supine_status status = study_create(&s, m, moved, power, error);
  for (int with = 0; with < 2 && status == SUPINE_OK; ++with) {
    holding h = {.m = m,
                 .moved = moved,
                 .begin = &law[0],
                 .with = with == 1,
                 .progress = with == 1 ? progress : NULL,
                 .context = context,
                 .share = 0.4}; /* of the work is the fit of all rows */
    status = settle(m, &s, with == 1, &h, &report->fitted[with]);
    law[with] = s.power;
    found[with] = s.at;
    if (status == SUPINE_OK) {
      status = hold_out(&h, &report->held_out[with], error);
    }
  }
  if (status == SUPINE_OK) {
    note_range(s.stiffness, n, report);
    report->kept = report->held_out[1] < report->held_out[0];
    s.power = *power = law[report->kept];
    s.at = *stiffness = found[report->kept];
    status = solve(&s);
  }
  if (status == SUPINE_OK) {
    match_anew(m, &s);
    memcpy(m->caught, s.caught, SUPINE_PATIENT_COLUMNS * n * sizeof *m->caught);
  }
  study_free(&s);
  return status;
}
