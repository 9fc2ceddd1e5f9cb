/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The equilibrium of (5), (8), (12)-(14): eliminate the springs, make the matrix symmetric, and
 * solve in single precision until the residual, computed in double, meets the tolerance. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/physics/conjugate_gradients.h"

/* Most steps of a solve, and prefetch distance in rows. */
enum { STEPS_MAX = 400, AHEAD = 4 };

/* Relative residual at which single-precision steps stop and the residual is recomputed in double.
 */
static const double round_gain = 2.5e-6;

/* Relative tolerance for one column of the transfer matrix, most of which is small. */
static const double column_tolerance = 1e-14;

struct supine_equilibrium {
  const supine_network *network;
  size_t rhs_max;
  double *give;     /* [N] S of the operator, internal order; with a reach 1 */
  double *load;     /* [N] factor of a force on the right side: 1; with a reach area / E */
  bool prepared;    /* the system is set up for the stiffness */
  size_t count;     /* right-hand sides of this solve */
  double *solution; /* [N, count] t */
  supine_system system;
  supine_rows links; /* without a reach: the network's links with the stiffness in their values */
  supine_gradients gradients;
};

void supine_physics_equilibrium_destroy(supine_equilibrium *equilibrium) {
  if (equilibrium != NULL) {
    for (size_t k = 0; k < SUPINE_LEVELS_MAX; ++k) {
      supine_stage *stage = &equilibrium->system.stage[k];
      free(stage->mass);
      free(stage->inverse);
      free(stage->solution);
      free(stage->right);
      free(stage->work);
    }
    free(equilibrium->links.value);
    free(equilibrium->give);
    free(equilibrium->load);
    free(equilibrium->solution);
    free(equilibrium->gradients.direction);
    free(equilibrium->gradients.product);
    free(equilibrium->gradients.sums);
    free(equilibrium);
  }
}

static bool allocate_stage(supine_stage *stage, size_t rows, size_t lanes) {
  const size_t values = rows * lanes;
  stage->mass = malloc(rows * sizeof(float));
  stage->inverse = malloc(rows * sizeof(float));
  stage->solution = malloc(values * sizeof(float));
  stage->right = malloc(values * sizeof(float));
  stage->work = malloc(values * sizeof(float));
  return stage->mass != NULL && stage->inverse != NULL && stage->solution != NULL &&
         stage->right != NULL && stage->work != NULL;
}

/* Allocate the stages: those of the network's hierarchy, or the network alone. */
static bool allocate_system(supine_equilibrium *eq) {
  const supine_network *net = eq->network;
  supine_system *system = &eq->system;
  bool whole = true;
  if (net->coarse == NULL) {
    eq->links = net->links;
    eq->links.value = malloc((net->links.begin[net->vertex_count] + 1) * sizeof(float));
    system->stage[0].links = &eq->links;
    system->stage_count = 1;
    return eq->links.value != NULL &&
           allocate_stage(&system->stage[0], net->vertex_count, eq->rhs_max);
  }
  system->stage_count = net->coarse->level_count;
  for (size_t k = 0; k < system->stage_count && whole; ++k) {
    const supine_level *level = &net->coarse->level[k];
    system->stage[k].links = &level->links;
    system->stage[k].part = &level->part;
    system->stage[k].whole = &level->whole;
    whole = allocate_stage(&system->stage[k], level->links.count, eq->rhs_max);
  }
  return whole;
}

supine_status supine_physics_equilibrium_create(const supine_network *network, size_t rhs_max,
                                                size_t threads, supine_equilibrium **equilibrium) {
  *equilibrium = NULL;
  if (rhs_max < 1 || rhs_max > SUPINE_RHS_MAX) {
    return SUPINE_ERROR_ARGUMENT;
  }
  supine_equilibrium *made = calloc(1, sizeof *made);
  if (made == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  const size_t n = network->vertex_count;
  const size_t blocks = n / SUPINE_SUM_ROWS + 1;
  supine_gradients *gradients = &made->gradients;
  made->network = network;
  made->rhs_max = rhs_max;
  made->system.threads = threads == 0 ? supine_thread_count() : threads;
  made->give = malloc(n * sizeof(double));
  made->load = malloc(n * sizeof(double));
  made->solution = malloc(n * rhs_max * sizeof(double));
  gradients->system = &made->system;
  gradients->solution = made->solution;
  gradients->direction = malloc(n * rhs_max * sizeof(float));
  gradients->product = malloc(n * rhs_max * sizeof(float));
  gradients->sums = malloc(blocks * 2 * rhs_max * sizeof(double));
  if (!allocate_system(made) || made->give == NULL || made->load == NULL ||
      made->solution == NULL || gradients->direction == NULL || gradients->product == NULL ||
      gradients->sums == NULL) {
    supine_physics_equilibrium_destroy(made);
    return SUPINE_ERROR_MEMORY;
  }
  *equilibrium = made;
  return SUPINE_OK;
}

supine_status supine_physics_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                                       const double *stiffness,
                                                       supine_error *error) {
  const supine_network *net = equilibrium->network;
  double *e = equilibrium->solution; /* [N] work space, file's order */
  const supine_status status =
      supine_physics_stiffness_normalise(net->vertex_count, stiffness, e, error);
  for (size_t i = 0; status == SUPINE_OK && i < net->vertex_count; ++i) {
    const uint32_t v = net->order[i];
    const double a = 1.0 / (e[v] * (net->lesions != NULL ? net->lesions[v] : 1.0));
    equilibrium->give[i] = net->area != NULL ? 1.0 : a;
    equilibrium->load[i] = net->area != NULL ? net->area[i] * a : 1.0;
  }
  equilibrium->prepared = equilibrium->prepared && net->area != NULL;
  return status;
}

typedef struct solve_pass {
  supine_equilibrium *eq;
  const double *force;           /* [N, lanes] */
  double *catch_;                /* [N, lanes] */
  bool warm;                     /* catch_ holds the first guess */
  double unit[SUPINE_RHS_MAX];   /* norm of the force: the unit in single precision */
  double wanted[SUPINE_RHS_MAX]; /* squared residual that ends the next round */
  double relative;               /* largest residual relative to the force */
} solve_pass;

static void run(const solve_pass *pass, supine_range_function *function) {
  supine_physics_system_run(pass->eq->system.threads, pass->eq->network->vertex_count, function,
                            (void *)pass);
}

/* Find 1 / value to 1e-14 by a single-precision division and a Newton step, several times faster
 * than a division in double. */
SUPINE_INLINE double reciprocal(double value) {
  const double guess = (double)(1.0F / (float)value);
  return guess * (2.0 - value * guess);
}

/* Without a reach: find c of a link of length d, and its addition to the mass of its first end,
 * S^2 excluded: the share that the spring catches. */
SUPINE_INLINE void paper_link(double give, double other, double d, double *c, double *mass) {
  const double product = give * other;
  const double share = reciprocal(2.0 * d * other * (d + 2.0 * product)); /* for both */
  *c = 2.0 * other * product * share;
  *mass = d * (give + other) * share;
}

/* Compute masses and, without a reach, conductances. */
static void prepare_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const solve_pass *pass = context;
  const supine_equilibrium *eq = pass->eq;
  const supine_network *net = eq->network;
  for (size_t i = begin; i < end; ++i) {
    double more = 0.0;
    for (size_t s = net->links.begin[i]; s < net->links.begin[i + 1] && net->area == NULL; ++s) {
      double c;
      double caught;
      paper_link(eq->give[i], eq->give[net->links.column[s]], net->distance[s], &c, &caught);
      eq->links.value[s] = (float)c;
      more += caught;
    }
    eq->system.stage[0].mass[i] =
        (float)((net->area == NULL ? 1.0 : net->area[i]) * eq->give[i] * eq->give[i] + more);
  }
}

/* Set the system up for the stiffness if it changed. */
static void prepare(const solve_pass *pass) {
  supine_equilibrium *eq = pass->eq;
  supine_system *system = &eq->system;
  system->lanes = eq->count;
  if (!eq->prepared) {
    run(pass, prepare_range);
    supine_physics_system_set_masses(system);
    eq->prepared = true;
  }
}

/* Compute the right-hand side's norm and the first t. */
SUPINE_INLINE void load_rows(size_t lanes, const solve_pass *pass, size_t begin, size_t end) {
  const supine_equilibrium *eq = pass->eq;
  for (size_t block = begin; block < end; block += SUPINE_SUM_ROWS) {
    double sums[SUPINE_RHS_MAX] = {0.0};
    for (size_t i = block; i < end && i < block + SUPINE_SUM_ROWS; ++i) {
      const size_t file = (size_t)eq->network->order[i] * lanes;
      const double load = eq->load[i];
      const double square = eq->give[i] * eq->give[i];
      const double inverse = (double)eq->system.stage[0].inverse[i];
      const double *force = pass->force + file;
      const double *guess = pass->catch_ + file;
      double *restrict t = eq->solution + i * lanes;
      SUPINE_EACH_LANE(r, lanes) {
        sums[r] += load * force[r] * (load * force[r]) * inverse;
      }
      SUPINE_EACH_LANE(r, lanes) {
        t[r] = pass->warm ? guess[r] / square : 0.0;
      }
    }
    memcpy(eq->gradients.sums + block / SUPINE_SUM_ROWS * 2 * lanes, sums, lanes * sizeof *sums);
  }
}

SUPINE_CLONES static void load_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const solve_pass *pass = context;
  SUPINE_FOR_LANES(pass->eq->count, load_rows, pass, begin, end);
}

/* Set the residual of t = 0: the right-hand side. */
static void force_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const solve_pass *pass = context;
  const supine_equilibrium *eq = pass->eq;
  const size_t lanes = eq->count;
  for (size_t i = begin; i < end; ++i) {
    const double *force = pass->force + (size_t)eq->network->order[i] * lanes;
    for (size_t r = 0; r < lanes; ++r) {
      eq->system.stage[0].right[i * lanes + r] = (float)(eq->load[i] * force[r] / pass->unit[r]);
    }
  }
}

/* Compute the residual, right-hand side minus A t, in double for the next round. */
SUPINE_INLINE void residual_rows(size_t lanes, const solve_pass *pass, size_t begin, size_t end) {
  const supine_equilibrium *eq = pass->eq;
  const supine_network *net = eq->network;
  const supine_stage *stage = &eq->system.stage[0];
  for (size_t block = begin; block < end; block += SUPINE_SUM_ROWS) {
    double sums[SUPINE_RHS_MAX] = {0.0};
    for (size_t i = block; i < end && i < block + SUPINE_SUM_ROWS; ++i) {
      const double give = eq->give[i];
      const double load = eq->load[i];
      const double own = (net->area == NULL ? 1.0 : net->area[i]) * give * give;
      const double *force = pass->force + (size_t)net->order[i] * lanes;
      const double *t = eq->solution + i * lanes;
      if (i + AHEAD < end) { /* random access in the file's order */
        __builtin_prefetch(pass->force + (size_t)net->order[i + AHEAD] * lanes);
      }
      double out[SUPINE_RHS_MAX];
      SUPINE_EACH_LANE(r, lanes) {
        out[r] = load * force[r] - own * t[r];
      }
      for (size_t s = net->links.begin[i]; s < net->links.begin[i + 1]; ++s) {
        const size_t j = net->links.column[s];
        const double *other = eq->solution + j * lanes;
        double c = 0.0;
        double mass = 0.0;
        if (net->area == NULL) {
          paper_link(give, eq->give[j], net->distance[s], &c, &mass);
        } else {
          c = net->conductance[s];
        }
        SUPINE_EACH_LANE(r, lanes) {
          out[r] -= c * (t[r] - other[r]) + mass * t[r];
        }
      }
      const double inverse = (double)stage->inverse[i];
      float *restrict right = stage->right + i * lanes;
      SUPINE_EACH_LANE(r, lanes) {
        sums[r] += out[r] * out[r] * inverse;
        right[r] = (float)(out[r] / pass->unit[r]);
      }
    }
    memcpy(eq->gradients.sums + block / SUPINE_SUM_ROWS * 2 * lanes, sums, lanes * sizeof *sums);
  }
}

SUPINE_CLONES static void residual_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const solve_pass *pass = context;
  SUPINE_FOR_LANES(pass->eq->count, residual_rows, pass, begin, end);
}

/* Store F = S^2 t in the file's order. */
static void store_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const solve_pass *pass = context;
  const supine_equilibrium *eq = pass->eq;
  const size_t count = eq->count;
  for (size_t i = begin; i < end; ++i) {
    double *out = pass->catch_ + (size_t)eq->network->order[i] * count;
    for (size_t r = 0; r < count; ++r) {
      out[r] = eq->give[i] * eq->give[i] * eq->solution[i * count + r];
    }
  }
}

static double total(const solve_pass *pass, size_t lane) {
  const supine_equilibrium *eq = pass->eq;
  return supine_physics_gradients_total(eq->gradients.sums, eq->network->vertex_count, eq->count, 0,
                                        lane);
}

/* Set the residual that the next round must reach. */
static void aim(solve_pass *pass, double tolerance) {
  pass->relative = 0.0;
  for (size_t r = 0; r < pass->eq->count; ++r) {
    const double relative = sqrt(total(pass, r)) / pass->unit[r];
    const double next = fmax(round_gain * relative, 0.5 * tolerance);
    pass->wanted[r] = next * next;
    pass->relative = relative <= pass->relative ? pass->relative : relative; /* keeps NaN */
  }
}

/* Repeat rounds until the residual meets the tolerance or no longer halves. */
static size_t iterate(solve_pass *pass, double tolerance) {
  size_t steps = 0;
  double last = INFINITY;
  run(pass, pass->warm ? residual_range : force_range);
  aim(pass, tolerance); /* cold start: the norms are known already */
  while (pass->relative > tolerance && pass->relative < 0.5 * last && steps < STEPS_MAX) {
    last = pass->relative;
    steps += supine_physics_conjugate_gradients(&pass->eq->gradients, STEPS_MAX - steps);
    run(pass, residual_range);
    aim(pass, tolerance);
  }
  return steps;
}

/* Eight parameters: the system, the right-hand sides, the tolerance and the results. */
supine_status supine_physics_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                               const double *force, double tolerance, bool warm,
                                               double *catch_, supine_solve_report *report,
                                               supine_error *error) {
  supine_equilibrium *eq = equilibrium;
  const double wanted = tolerance > 0.0 ? tolerance : SUPINE_SOLVE_TOLERANCE;
  if (count < 1 || count > eq->rhs_max) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%zu right-hand sides, but the solver was created for at most %zu",
                            count, eq->rhs_max);
  }
  solve_pass pass = {.eq = eq, .force = force, .catch_ = catch_, .warm = warm};
  eq->count = count;
  prepare(&pass);
  run(&pass, load_range);
  for (size_t r = 0; r < count; ++r) {
    const double norm = sqrt(total(&pass, r));
    pass.unit[r] = norm > 0.0 ? norm : 1.0;
  }
  eq->gradients.unit = pass.unit;
  eq->gradients.wanted = pass.wanted;
  const supine_solve_report made = {iterate(&pass, wanted), pass.relative};
  run(&pass, store_range);
  if (report != NULL) {
    *report = made;
  }
  if (!(made.residual <= wanted)) {
    return supine_error_set(
        error, SUPINE_ERROR_NUMERICAL,
        "equilibrium: the relative residual is %.3g after %zu steps, above the tolerance %.3g",
        made.residual, made.iterations, wanted);
  }
  return SUPINE_OK;
}

supine_status supine_physics_transfer_column(supine_equilibrium *equilibrium, size_t vertex,
                                             double *column, supine_error *error) {
  const size_t n = equilibrium->network->vertex_count;
  if (vertex >= n) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "vertex %zu is out of range: the mesh has %zu vertices, counted from 0",
                            vertex, n);
  }
  double *force = calloc(n, sizeof *force);
  if (force == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu forces", n);
  }
  force[vertex] = 1.0;
  const supine_status status = supine_physics_equilibrium_solve(
      equilibrium, 1, force, column_tolerance, false, column, NULL, error);
  free(force);
  return status;
}
