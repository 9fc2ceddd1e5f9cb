/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Solve for the equilibrium of [Santhanam2008], equations (5), (8) and (12)-(14): set up
 * the symmetric matrix of equilibrium.h, and factorise it with CHOLMOD. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <suitesparse/cholmod.h>

#include "base/arena.h"
#include "base/library.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "precompute/physics/equilibrium.h"

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

/* Smallest (twice the area) / (half the sum of the squared sides) of a triangle in the weights. */
static const double flattest = 2e-3;

/* A part of the mesh without edges to the rest, such as one lung. The parts are solved in parallel,
 * or one after the other, to save memory, if the first has more than LARGE vertices. */
typedef struct part {
  size_t vertex, vertex_count; /* index of the first vertex, and number of vertices */
  size_t edge, edge_count;     /* index of the first edge, and number of edges */
  bool factorised;             /* whether `factor` matches the values of `matrix` */
  cholmod_sparse *matrix;      /* lower triangle of the part's system matrix (create_matrix) */
  cholmod_factor *factor;
  cholmod_common common;
} part;

struct supine_equilibrium {
  supine_arena memory; /* of the arrays */
  size_t vertex_count;
  const supine_topology *topology;
  double reach;        /* smoothing length of force, mm; 0: none, as in [Santhanam2008] */
  double *area;        /* [vertices] vertex area / mean vertex area; NULL without smoothing */
  double *edge_term;   /* [edges] with smoothing, the edge's off-diagonal matrix element times -1;
                          without smoothing, half the edge length, mm, at least 1 */
  double *lesions;     /* [vertices] factors on the normalised stiffness in lesions, or NULL */
  double *mass_weight; /* [vertices] weight in the matrix: 1 / stiffness, or 1 with smoothing */
  double *load_factor; /* [vertices] right-hand side of the linear system / applied force */
  size_t part_count;
  part parts[2];
};

void supine_physics_equilibrium_destroy(supine_equilibrium *equilibrium) {
  if (equilibrium != NULL) {
    for (size_t k = 0; k < equilibrium->part_count; ++k) {
      part *p = &equilibrium->parts[k];
      cholmod.free_sparse(&p->matrix, &p->common);
      cholmod.free_factor(&p->factor, &p->common);
      cholmod.finish(&p->common);
    }
    supine_arena_free(&equilibrium->memory);
    free(equilibrium);
  }
}

double supine_physics_link_distance(const double *first, const double *second) {
  return fmax(1.0, 0.5 * supine_distance(first, second));
}

supine_status supine_physics_stiffness_normalise(size_t count, const double *stiffness,
                                                 double *scaled, supine_error *error) {
  if (stiffness == NULL) {
    for (size_t i = 0; i < count; ++i) {
      scaled[i] = 1.0;
    }
    return SUPINE_OK;
  }
  double logarithms = 0.0;
  for (size_t i = 0; i < count; ++i) {
    SUPINE_REFUSE_IF(!(stiffness[i] > 0.0) || !isfinite(stiffness[i]), error, SUPINE_ERROR_ARGUMENT,
                     "the stiffness of vertex %zu is %g: give a positive number", i, stiffness[i]);
    logarithms += log(stiffness[i]);
  }
  const double factor = exp(-logarithms / (double)count);
  for (size_t i = 0; i < count; ++i) {
    scaled[i] = stiffness[i] * factor;
  }
  return SUPINE_OK;
}

/* Split the vertices into two ranges of indices without edges between them, as equal in size as
 * possible. If there are no such ranges, make one part of all vertices. */
static void split(supine_equilibrium *eq) {
  const size_t n = eq->vertex_count;
  const supine_topology *topology = eq->topology;
  size_t highest = 0; /* largest index among the neighbours of vertices 0 to i - 1 */
  size_t least = n;   /* size of the larger part in the best split so far */
  part *first = &eq->parts[0];
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
  eq->part_count = first->vertex_count < n ? 2 : 1;
  eq->parts[1] = (part){.vertex = first->vertex_count,
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

static bool create_matrices(supine_equilibrium *eq) {
  bool made = true;
  split(eq);
  for (size_t k = 0; k < eq->part_count; ++k) {
    made = create_matrix(eq->topology, &eq->parts[k]) && made;
  }
  return made;
}

static size_t find_edge(const supine_equilibrium *eq, uint32_t a, uint32_t b) {
  const uint32_t first = a < b ? a : b;
  const part *p = &eq->parts[first < eq->parts[0].vertex_count ? 0 : 1];
  const int *begin = p->matrix->p;
  size_t e = p->edge + (size_t)begin[first - p->vertex] - (first - p->vertex);
  while (eq->topology->edges[2 * e + 1] != (a < b ? b : a)) {
    ++e;
  }
  return e;
}

/* Compute eq->area, and eq->edge_term = w_ij / 2 for a smoothing length R = eq->reach > 0. All
 * weights of a triangle have one divisor, so that its terms stay positive semidefinite if its area
 * is less than the lower limit. */
static void set_reach(supine_equilibrium *eq, const supine_mesh *mesh) {
  const size_t n = eq->vertex_count;
  const double *p = mesh->vertices;
  double mean = 0.0;
  supine_mesh_vertex_area(mesh, eq->area);
  for (size_t i = 0; i < n; ++i) {
    mean += eq->area[i] / (double)n;
  }
  /* Lower limit of areas, mm^2, against zero weights and divisions by zero. */
  const double least = 1e-6 * mean;
  for (size_t i = 0; i < n; ++i) {
    eq->area[i] = fmax(eq->area[i], least) / mean;
  }
  memset(eq->edge_term, 0, eq->topology->edge_count * sizeof *eq->edge_term);
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    double normal[3]; /* the length of this vector is twice the area of the triangle */
    supine_normal(p + 3 * (size_t)corner[0], p + 3 * (size_t)corner[1], p + 3 * (size_t)corner[2],
                  normal);
    double dot[3]; /* of the sides at each corner; their sum is half that of the squared sides */
    for (size_t k = 0; k < 3; ++k) {
      double sides[2][3];
      supine_subtract(p + 3 * (size_t)corner[(k + 1) % 3], p + 3 * (size_t)corner[k], sides[0]);
      supine_subtract(p + 3 * (size_t)corner[(k + 2) % 3], p + 3 * (size_t)corner[k], sides[1]);
      dot[k] = supine_dot(sides[0], sides[1]);
    }
    const double divisor =
        fmax(fmax(supine_length(normal), least), flattest * (dot[0] + dot[1] + dot[2]));
    for (size_t k = 0; k < 3; ++k) {
      eq->edge_term[find_edge(eq, corner[(k + 1) % 3], corner[(k + 2) % 3])] +=
          0.5 * eq->reach * eq->reach / mean * dot[k] / divisor;
    }
  }
}

static void set_values(const supine_equilibrium *eq, part *p) {
  const int *begin = p->matrix->p;
  double *value = p->matrix->x;
  for (size_t i = 0; i < p->vertex_count; ++i) {
    const double s = eq->mass_weight[p->vertex + i];
    value[begin[i]] = (eq->area != NULL ? eq->area[p->vertex + i] : 1.0) * s * s;
  }
  for (size_t e = 0; e < p->edge_count; ++e) {
    const uint32_t *edge = eq->topology->edges + 2 * (p->edge + e);
    double *first = &value[begin[edge[0] - p->vertex]];
    double *second = &value[begin[edge[1] - p->vertex]];
    double c = eq->edge_term[p->edge + e];
    if (eq->area == NULL) {
      const double d = eq->edge_term[p->edge + e];
      const double s[2] = {eq->mass_weight[edge[0]], eq->mass_weight[edge[1]]};
      const double wide = d + 2.0 * s[0] * s[1];
      c = s[0] * s[1] / (d * wide);
      *first += (s[0] + s[1]) / (2.0 * s[1] * wide);
      *second += (s[0] + s[1]) / (2.0 * s[0] * wide);
    }
    *first += c;
    *second += c;
    value[e + edge[0] - p->vertex + 1] = -c;
  }
  p->factorised = false;
}

static supine_status create(const supine_topology *topology, size_t n, bool smoothing,
                            const double *lesions, supine_equilibrium **equilibrium,
                            supine_error *error) {
  *equilibrium = NULL;
  SUPINE_TRY(SUPINE_LIBRARY_LOAD(SUPINE_CHOLMOD, FUNCTIONS, &cholmod, error));
  supine_equilibrium *made = calloc(1, sizeof *made);
  if (made == NULL) {
    return supine_error_memory(error, "the equilibrium");
  }
  supine_arena *memory = &made->memory;
  made->vertex_count = n;
  made->topology = topology;
  made->area = smoothing ? supine_arena_take(memory, n, sizeof *made->area) : NULL;
  made->edge_term = supine_arena_take(memory, topology->edge_count, sizeof *made->edge_term);
  made->lesions = lesions != NULL ? supine_arena_take(memory, n, sizeof *lesions) : NULL;
  made->mass_weight = supine_arena_take(memory, n, sizeof *made->mass_weight);
  made->load_factor = supine_arena_take(memory, n, sizeof *made->load_factor);
  if (memory->failed || !create_matrices(made)) {
    supine_physics_equilibrium_destroy(made);
    return supine_error_memory(error, "the equilibrium of %zu vertices", n);
  }
  if (lesions != NULL) {
    memcpy(made->lesions, lesions, n * sizeof *lesions);
  }
  *equilibrium = made;
  return SUPINE_OK;
}

supine_status supine_physics_equilibrium_create(const supine_mesh *mesh,
                                                const supine_topology *topology, double reach,
                                                const double *lesions,
                                                supine_equilibrium **equilibrium,
                                                supine_error *error) {
  SUPINE_TRY(create(topology, mesh->vertex_count, reach > 0.0, lesions, equilibrium, error));
  return supine_physics_equilibrium_set_shape(*equilibrium, mesh, reach, NULL, error);
}

supine_status
supine_physics_equilibrium_create_weighted(const supine_topology *topology, size_t vertex_count,
                                           const double *diagonal, const double *weight,
                                           supine_equilibrium **equilibrium, supine_error *error) {
  SUPINE_TRY(create(topology, vertex_count, true, NULL, equilibrium, error));
  supine_equilibrium *eq = *equilibrium;
  memcpy(eq->area, diagonal, vertex_count * sizeof *diagonal);
  memcpy(eq->edge_term, weight, topology->edge_count * sizeof *weight);
  for (size_t i = 0; i < vertex_count; ++i) {
    eq->mass_weight[i] = eq->load_factor[i] = 1.0;
  }
  for (size_t k = 0; k < eq->part_count; ++k) {
    set_values(eq, &eq->parts[k]);
  }
  return SUPINE_OK;
}

supine_status supine_physics_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                                       const double *stiffness,
                                                       supine_error *error) {
  supine_equilibrium *eq = equilibrium;
  SUPINE_TRY(
      supine_physics_stiffness_normalise(eq->vertex_count, stiffness, eq->load_factor, error));
  for (size_t i = 0; i < eq->vertex_count; ++i) {
    const double a = 1.0 / (eq->load_factor[i] * (eq->lesions != NULL ? eq->lesions[i] : 1.0));
    eq->mass_weight[i] = eq->area != NULL ? 1.0 : a;
    eq->load_factor[i] = eq->area != NULL ? eq->area[i] : 1.0;
  }
  for (size_t k = 0; k < eq->part_count; ++k) {
    if (eq->area == NULL || !eq->parts[k].factorised) {
      set_values(eq, &eq->parts[k]);
    }
  }
  return SUPINE_OK;
}

supine_status supine_physics_equilibrium_set_shape(supine_equilibrium *equilibrium,
                                                   const supine_mesh *mesh, double reach,
                                                   const double *stiffness, supine_error *error) {
  supine_equilibrium *eq = equilibrium;
  eq->reach = reach;
  for (size_t e = 0; e < eq->topology->edge_count && eq->area == NULL; ++e) {
    const uint32_t *edge = eq->topology->edges + 2 * e;
    eq->edge_term[e] = supine_physics_link_distance(mesh->vertices + 3 * (size_t)edge[0],
                                                    mesh->vertices + 3 * (size_t)edge[1]);
  }
  if (eq->area != NULL) {
    set_reach(eq, mesh);
  }
  for (size_t k = 0; k < eq->part_count; ++k) {
    eq->parts[k].factorised = false;
  }
  return supine_physics_equilibrium_set_stiffness(eq, stiffness, error);
}

typedef struct solve {
  supine_equilibrium *eq;
  size_t count;
  const double *force; /* [vertices, count] force applied to each vertex, one column per solve */
  double *retained;    /* [vertices, count] force left at each vertex after exchange along edges */
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
  part *p = &s->eq->parts[k];
  const size_t n = p->vertex_count;
  const double *load = s->eq->load_factor + p->vertex;
  const double *mass_s = s->eq->mass_weight + p->vertex;
  const double *force = s->force + p->vertex * s->count + r;
  double *retained = s->retained + p->vertex * s->count + r;
  double norm[BATCH] = {0.0};
  double square[BATCH] = {0.0};
  double one[2] = {1.0, 0.0};
  double minus[2] = {-1.0, 0.0};
  cholmod_dense *right = cholmod.allocate_dense(n, count, n, CHOLMOD_REAL, &p->common);
  cholmod_dense *t = NULL;
  for (size_t i = 0; i < n && right != NULL; ++i) {
    for (size_t c = 0; c < count; ++c) {
      const double b = load[i] * force[i * s->count + c];
      ((double *)right->x)[c * n + i] = b;
      norm[c] += b * b;
    }
  }
  t = right != NULL ? cholmod.solve(CHOLMOD_A, p->factor, right, &p->common) : NULL;
  const bool solved = t != NULL && cholmod.sdmult(p->matrix, 0, minus, one, t, right, &p->common);
  for (size_t i = 0; i < n && solved; ++i) {
    for (size_t c = 0; c < count; ++c) {
      const double residual = ((const double *)right->x)[c * n + i];
      retained[i * s->count + c] = mass_s[i] * mass_s[i] * ((const double *)t->x)[c * n + i];
      square[c] += residual * residual;
    }
  }
  for (size_t c = 0; c < count && solved; ++c) {
    const double relative = sqrt(square[c] / (norm[c] > 0.0 ? norm[c] : 1.0));
    s->residual[k] = fmax(s->residual[k], isnan(relative) ? INFINITY : relative);
  }
  cholmod.free_dense(&right, &p->common);
  cholmod.free_dense(&t, &p->common);
  return solved ? SUPINE_OK : SUPINE_ERROR_MEMORY;
}

static void solve_parts(void *context, size_t begin, size_t end, size_t thread) {
  solve *s = context;
  (void)thread;
  for (size_t k = begin; k < end; ++k) {
    part *p = &s->eq->parts[k];
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

supine_status supine_physics_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                               const double *force, double *retained,
                                               supine_error *error) {
  solve s = {equilibrium, count, force, retained, {SUPINE_OK, SUPINE_OK}, {0.0, 0.0}};
  const size_t threads = equilibrium->parts[0].vertex_count > LARGE ? 1 : 0;
  supine_parallel_for(equilibrium->part_count, 1, threads, solve_parts, &s);
  for (size_t k = 0; k < 2; ++k) {
    if (s.status[k] == SUPINE_ERROR_MEMORY) {
      return supine_error_memory(error, "the equilibrium of %zu vertices",
                                 equilibrium->vertex_count);
    }
    SUPINE_REFUSE_IF(s.status[k] != SUPINE_OK || !(s.residual[k] <= residual_limit), error,
                     SUPINE_ERROR_NUMERICAL,
                     "the equilibrium was not solved: the relative residual is %.3g, above %.3g. "
                     "Check that forces and stiffnesses are finite, or give a shorter --reach",
                     s.status[k] != SUPINE_OK ? INFINITY : s.residual[k], residual_limit);
  }
  return SUPINE_OK;
}

supine_status supine_physics_equilibrium_force(supine_equilibrium *equilibrium,
                                               const double *retained, double *force,
                                               supine_error *error) {
  supine_equilibrium *eq = equilibrium;
  const size_t n = eq->vertex_count;
  double one[2] = {1.0, 0.0};
  double zero[2] = {0.0, 0.0};
  SUPINE_ARENA arena = {0};
  double *t = supine_arena_take(&arena, n, sizeof *t);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  for (size_t i = 0; i < n; ++i) {
    t[i] = retained[i] / (eq->mass_weight[i] * eq->mass_weight[i]);
  }
  for (size_t k = 0; k < eq->part_count; ++k) {
    part *p = &eq->parts[k];
    const size_t m = p->vertex_count;
    cholmod_dense from = {m, 1, m, m, t + p->vertex, NULL, CHOLMOD_REAL, CHOLMOD_DOUBLE};
    cholmod_dense to = {m, 1, m, m, force + p->vertex, NULL, CHOLMOD_REAL, CHOLMOD_DOUBLE};
    (void)cholmod.sdmult(p->matrix, 0, one, zero, &from, &to, &p->common);
  }
  for (size_t i = 0; i < n; ++i) {
    force[i] /= eq->load_factor[i];
  }
  return SUPINE_OK;
}

supine_status supine_physics_transfer_column(supine_equilibrium *equilibrium, size_t vertex,
                                             double *column, supine_error *error) {
  const size_t n = equilibrium->vertex_count;
  SUPINE_REFUSE_IF(vertex >= n, error, SUPINE_ERROR_ARGUMENT,
                   "vertex %zu is out of range: the mesh has %zu vertices, counted from 0", vertex,
                   n);
  SUPINE_ARENA arena = {0};
  double *force = supine_arena_zeros(&arena, n, sizeof *force);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu forces", n));
  force[vertex] = 1.0;
  return supine_physics_equilibrium_solve(equilibrium, 1, force, column, error);
}
