/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Factorise the matrix of a mesh with CHOLMOD, and solve for right-hand sides. */
#include <math.h>
#include <stdlib.h>

#include <suitesparse/cholmod.h>

#include "base/arena.h"
#include "base/library.h"
#include "base/parallel.h"
#include "precompute/physics/factorisation.h"

/* clang-format off */
#define FUNCTIONS(EACH)                                                                            \
  EACH(cholmod_, start) EACH(cholmod_, finish) EACH(cholmod_, allocate_sparse)                     \
  EACH(cholmod_, free_sparse) EACH(cholmod_, analyze) EACH(cholmod_, factorize)                    \
  EACH(cholmod_, free_factor) EACH(cholmod_, allocate_dense) EACH(cholmod_, free_dense)            \
  EACH(cholmod_, solve) EACH(cholmod_, sdmult)
/* clang-format on */

static struct { FUNCTIONS(SUPINE_LIBRARY_MEMBER) } cholmod;

/* BATCH: largest number of right-hand sides that are solved together, which limits the work space.
 * LARGE: largest number of vertices of a mesh part whose Cholesky factor is kept after a solve. */
enum { BATCH = 8, LARGE = 40000 };

/* Largest accepted relative residual of a solve. With a smoothing length R and edges of length h,
 * rounding errors alone cause about 1e-16 (R / h)^2. */
static const double residual_limit = 1e-8;

/* A part of the mesh without edges to the rest, such as one lung. The parts are solved in parallel,
 * or one after the other, to save memory, if the first has more than LARGE vertices. */
typedef struct part {
  size_t vertex, vertex_count; /* index of the first vertex, and number of vertices */
  size_t edge, edge_count;     /* index of the first edge, and number of edges */
  bool factorised;             /* whether `factor` matches the values of `matrix` */
  cholmod_sparse *matrix;      /* lower triangle of the part's matrix (create_matrix) */
  cholmod_factor *factor;
  cholmod_common common;
} part;

struct supine_factorisation {
  size_t vertex_count;
  const supine_topology *topology;
  size_t part_count;
  part parts[2];
};

void supine_physics_factorisation_destroy(supine_factorisation *factorisation) {
  if (factorisation != NULL) {
    for (size_t k = 0; k < factorisation->part_count; ++k) {
      part *p = &factorisation->parts[k];
      cholmod.free_sparse(&p->matrix, &p->common);
      cholmod.free_factor(&p->factor, &p->common);
      cholmod.finish(&p->common);
    }
    free(factorisation);
  }
}

/* Split the vertices into two ranges of indices without edges between them, as equal in size as
 * possible. If there are no such ranges, make one part of all vertices. */
static void split(supine_factorisation *f) {
  const size_t n = f->vertex_count;
  const supine_topology *topology = f->topology;
  size_t highest = 0; /* largest index among the neighbours of vertices 0 to i - 1 */
  size_t least = n;   /* size of the larger part in the best split so far */
  part *first = &f->parts[0];
  *first = (part){.vertex_count = n, .edge_count = topology->edge_count};
  for (size_t i = 1, e = 0; i < n; ++i) {
    for (; e < topology->edge_count && topology->edges[2 * e] < i; ++e) {
      highest = topology->edges[2 * e + 1] > highest ? topology->edges[2 * e + 1] : highest;
    }
    const size_t larger = i < n - i ? n - i : i;
    if (highest < i && larger < least) {
      least = larger;
      *first = (part){.vertex_count = i, .edge_count = e};
    }
  }
  f->part_count = first->vertex_count < n ? 2 : 1;
  f->parts[1] = (part){.vertex = first->vertex_count,
                       .vertex_count = n - first->vertex_count,
                       .edge = first->edge_count,
                       .edge_count = topology->edge_count - first->edge_count};
}

/* Create the sparsity pattern of the matrix of a mesh part: its lower triangle, column by column.
 * Column i has the diagonal element, then one element for each edge from vertex i to a later
 * vertex. Edges are sorted by their first vertex i, so element e + i + 1 belongs to edge e. */
static bool create_matrix(const supine_topology *topology, part *p) {
  const size_t entries = p->vertex_count + p->edge_count;
  const uint32_t *edges = topology->edges + 2 * p->edge;
  cholmod.start(&p->common);
  p->common.print = 0;
  p->common.supernodal = CHOLMOD_SUPERNODAL;
  p->common.nmethods = 1;
  p->common.method[0].ordering = CHOLMOD_AMD;
  p->matrix = cholmod.allocate_sparse(p->vertex_count, p->vertex_count, entries, true, true, -1,
                                      CHOLMOD_REAL, &p->common);
  if (p->matrix == NULL) {
    return false;
  }
  int *begin = p->matrix->p;
  int *row = p->matrix->i;
  size_t e = 0;
  for (size_t i = 0; i < p->vertex_count; ++i) {
    begin[i] = (int)(e + i);
    row[e + i] = (int)i;
    for (; e < p->edge_count && edges[2 * e] - p->vertex == i; ++e) {
      row[e + i + 1] = (int)(edges[2 * e + 1] - p->vertex);
    }
  }
  begin[p->vertex_count] = (int)entries;
  return true;
}

supine_status supine_physics_factorisation_create(const supine_topology *topology,
                                                  size_t vertex_count,
                                                  supine_factorisation **factorisation,
                                                  supine_error *error) {
  *factorisation = NULL;
  SUPINE_TRY(SUPINE_LIBRARY_LOAD(SUPINE_CHOLMOD, FUNCTIONS, &cholmod, error));
  supine_factorisation *made = calloc(1, sizeof *made);
  if (made == NULL) {
    return supine_error_memory(error, "the equilibrium");
  }
  made->vertex_count = vertex_count;
  made->topology = topology;
  split(made);
  bool created = true;
  for (size_t k = 0; k < made->part_count; ++k) {
    created = create_matrix(topology, &made->parts[k]) && created;
  }
  if (!created) {
    supine_physics_factorisation_destroy(made);
    return supine_error_memory(error, "the equilibrium of %zu vertices", vertex_count);
  }
  *factorisation = made;
  return SUPINE_OK;
}

void supine_physics_factorisation_set(supine_factorisation *factorisation, const double *diagonal,
                                      const double *coupling) {
  for (size_t k = 0; k < factorisation->part_count; ++k) {
    part *p = &factorisation->parts[k];
    const uint32_t *edges = factorisation->topology->edges + 2 * p->edge;
    const int *begin = p->matrix->p;
    double *value = p->matrix->x;
    for (size_t i = 0; i < p->vertex_count; ++i) {
      value[begin[i]] = diagonal[p->vertex + i];
    }
    for (size_t e = 0; e < p->edge_count; ++e) {
      value[e + edges[2 * e] - p->vertex + 1] = -coupling[p->edge + e];
    }
    p->factorised = false;
  }
}

typedef struct solve {
  supine_factorisation *f;
  size_t count;
  const double *right; /* [vertices, count] right-hand sides */
  double *solution;    /* [vertices, count] written; may be `right` */
  supine_status status[2];
  double residual[2]; /* [part_count] largest relative residual of each mesh part */
} solve;

static supine_status factorise(part *p) {
  if (!p->factorised) {
    if (p->factor == NULL) {
      p->factor = cholmod.analyze(p->matrix, &p->common);
    }
    if (p->factor == NULL || !cholmod.factorize(p->matrix, p->factor, &p->common)) {
      return SUPINE_ERROR_MEMORY;
    }
    if (p->common.status == CHOLMOD_NOT_POSDEF) {
      return SUPINE_ERROR_NUMERICAL;
    }
    p->factorised = true;
  }
  return SUPINE_OK;
}

/* Solve mesh part k for the right-hand sides r to r + count - 1. Update s->residual[k]. */
static supine_status solve_columns(solve *s, size_t k, size_t r, size_t count) {
  part *p = &s->f->parts[k];
  const size_t n = p->vertex_count;
  const double *from = s->right + p->vertex * s->count + r;
  double *to = s->solution + p->vertex * s->count + r;
  double norm[BATCH] = {0.0};
  double square[BATCH] = {0.0};
  double one[2] = {1.0, 0.0};
  double minus[2] = {-1.0, 0.0};
  cholmod_dense *right = cholmod.allocate_dense(n, count, n, CHOLMOD_REAL, &p->common);
  if (right == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t i = 0; i < n; ++i) {
    for (size_t c = 0; c < count; ++c) {
      const double b = from[i * s->count + c];
      ((double *)right->x)[c * n + i] = b;
      norm[c] += b * b;
    }
  }
  cholmod_dense *t = cholmod.solve(CHOLMOD_A, p->factor, right, &p->common);
  /* Replace `right` by the residual b - A t. */
  const bool solved = t != NULL && cholmod.sdmult(p->matrix, 0, minus, one, t, right, &p->common);
  if (solved) {
    for (size_t i = 0; i < n; ++i) {
      for (size_t c = 0; c < count; ++c) {
        const double residual = ((const double *)right->x)[c * n + i];
        to[i * s->count + c] = ((const double *)t->x)[c * n + i];
        square[c] += residual * residual;
      }
    }
    for (size_t c = 0; c < count; ++c) {
      const double relative = sqrt(square[c] / (norm[c] > 0.0 ? norm[c] : 1.0));
      s->residual[k] = fmax(s->residual[k], isnan(relative) ? INFINITY : relative);
    }
  }
  cholmod.free_dense(&right, &p->common);
  cholmod.free_dense(&t, &p->common);
  return solved ? SUPINE_OK : SUPINE_ERROR_MEMORY;
}

static void solve_parts(void *context, size_t begin, size_t end, size_t thread) {
  solve *s = context;
  (void)thread;
  for (size_t k = begin; k < end; ++k) {
    part *p = &s->f->parts[k];
    s->status[k] = factorise(p);
    for (size_t r = 0; r < s->count && s->status[k] == SUPINE_OK; r += BATCH) {
      const size_t count = s->count - r < BATCH ? s->count - r : BATCH;
      s->status[k] = solve_columns(s, k, r, count);
    }
    if (p->vertex_count > LARGE) {
      cholmod.free_factor(&p->factor, &p->common);
      p->factorised = false;
    }
  }
}

supine_status supine_physics_factorisation_solve(supine_factorisation *factorisation, size_t count,
                                                 const double *right, double *solution,
                                                 supine_error *error) {
  solve s = {factorisation, count, right, solution, {SUPINE_OK, SUPINE_OK}, {0.0, 0.0}};
  const size_t threads = factorisation->parts[0].vertex_count > LARGE ? 1 : 0;
  supine_parallel_for(factorisation->part_count, 1, threads, solve_parts, &s);
  for (size_t k = 0; k < 2; ++k) {
    if (s.status[k] == SUPINE_ERROR_MEMORY) {
      return supine_error_memory(error, "the equilibrium of %zu vertices",
                                 factorisation->vertex_count);
    }
    const double residual = s.status[k] == SUPINE_OK ? s.residual[k] : INFINITY;
    SUPINE_REFUSE_IF(!(residual <= residual_limit), error, SUPINE_ERROR_NUMERICAL,
                     "the equilibrium was not solved: the relative residual is %.3g, above %.3g. "
                     "Check that forces and stiffnesses are finite, or use a shorter smoothing "
                     "length (reach)",
                     residual, residual_limit);
  }
  return SUPINE_OK;
}

void supine_physics_factorisation_multiply(supine_factorisation *factorisation,
                                           const double *vector, double *product) {
  double one[2] = {1.0, 0.0};
  double zero[2] = {0.0, 0.0};
  for (size_t k = 0; k < factorisation->part_count; ++k) {
    part *p = &factorisation->parts[k];
    const size_t m = p->vertex_count;
    /* CHOLMOD reads `from` only, although its type is not const. */
    double *at = (double *)(uintptr_t)(vector + p->vertex);
    cholmod_dense from = {m, 1, m, m, at, NULL, CHOLMOD_REAL, CHOLMOD_DOUBLE};
    cholmod_dense to = {m, 1, m, m, product + p->vertex, NULL, CHOLMOD_REAL, CHOLMOD_DOUBLE};
    (void)cholmod.sdmult(p->matrix, 0, one, zero, &from, &to, &p->common);
  }
}
