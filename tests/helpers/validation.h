/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The validation experiments of [Santhanam2008], section IV, shared by tests and
 * bench_validation. */
#ifndef SUPINE_VALIDATION_H
#define SUPINE_VALIDATION_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>

#include "precompute/physics/network.h"
#include "precompute/physics/solve.h"
#include "precompute/precompute.h"
#include <supine/volume.h>

/* A network of masses (vertices) and links (edges). Networks without triangles are allowed. */
typedef struct frame {
  supine_mesh mesh;
  supine_topology topology;
} frame;

static inline void frame_free(frame *f) {
  supine_mesh_free(&f->mesh);
  supine_mesh_topology_free(&f->topology);
}

/* Return a flat sheet of side x side masses, `spacing` mm apart. Links run along rows, along
 * columns and along one diagonal of each square. */
static inline frame frame_plane(size_t side, double spacing) {
  frame f = {.mesh = {.vertex_count = side * side, .triangle_count = 2 * (side - 1) * (side - 1)}};
  f.mesh.vertices = calloc(3 * f.mesh.vertex_count, sizeof *f.mesh.vertices);
  f.mesh.triangles = calloc(3 * f.mesh.triangle_count, sizeof *f.mesh.triangles);
  uint32_t *t = f.mesh.triangles;
  for (size_t i = 0; i < side * side; ++i) {
    const size_t x = i % side;
    const size_t y = i / side;
    f.mesh.vertices[3 * i] = spacing * (double)x;
    f.mesh.vertices[3 * i + 1] = spacing * (double)y;
    if (x + 1 < side && y + 1 < side) {
      const uint32_t corner[6] = {(uint32_t)i, (uint32_t)(i + 1),        (uint32_t)(i + side + 1),
                                  (uint32_t)i, (uint32_t)(i + side + 1), (uint32_t)(i + side)};
      memcpy(t, corner, sizeof corner);
      t += 6;
    }
  }
  if (supine_mesh_topology_create(&f.mesh, &f.topology) != SUPINE_OK) {
    abort();
  }
  return f;
}

/* Return a ring of evenly spaced masses, with neighbours linked. `radius` is in mm. */
static inline frame frame_ring(size_t count, double radius) {
  frame f = {.mesh = {.vertex_count = count}, .topology = {.edge_count = count}};
  f.mesh.vertices = calloc(3 * count, sizeof *f.mesh.vertices);
  f.topology.edges = calloc(2 * count, sizeof *f.topology.edges);
  f.topology.edges[3] = (uint32_t)(count - 1);
  for (size_t i = 0; i < count; ++i) {
    const double angle = 2.0 * M_PI * (double)i / (double)count;
    f.mesh.vertices[3 * i] = radius * cos(angle);
    f.mesh.vertices[3 * i + 1] = radius * sin(angle);
    if (i > 0) { /* store the links in sorted order: (0, 1), (0, count - 1), (1, 2), ... */
      const size_t e = i == 1 ? 0 : i;
      f.topology.edges[2 * e] = (uint32_t)(i - 1);
      f.topology.edges[2 * e + 1] = (uint32_t)i;
    }
  }
  return f;
}

/* Apply the force `force` [masses], which spreads over the links. Compute the part `catch_`
 * [masses] that each mass keeps at equilibrium, when no more force is passed on. */
static inline supine_status frame_solve(const frame *f, const double *stiffness,
                                        const double *force, double *catch_) {
  supine_equilibrium *equilibrium = NULL;
  supine_status status =
      supine_physics_equilibrium_create(&f->mesh, &f->topology, 0.0, NULL, &equilibrium, NULL);
  if (status == SUPINE_OK) {
    status = supine_physics_equilibrium_set_stiffness(equilibrium, stiffness, NULL);
  }
  if (status == SUPINE_OK) {
    status = supine_physics_equilibrium_solve(equilibrium, 1, force, catch_, NULL);
  }
  supine_physics_equilibrium_destroy(equilibrium);
  return status;
}

/* Masses of 1, linked by springs. Each mass is also tied to the ground by a damper and a spring.
 * The position y_i of mass i obeys
 *
 *     y_i'' = push_i - ground_i y_i - sum over links (i, j) of spring_ij (y_i - y_j) - damping y_i'
 *
 * where push_i is the external force. All quantities are dimensionless. */
typedef struct mass_spring_damper {
  size_t count;
  size_t links;
  const uint32_t *ends; /* [links, 2] indices of the linked masses */
  double *spring;       /* [links] stiffness of the spring between the linked masses */
  double *ground;       /* [count] stiffness of the spring from each mass to the ground */
  double *push;         /* [count] external force on each mass */
  double damping;
  size_t evaluations; /* number of evaluations of the accelerations */
} mass_spring_damper;

/* Create a mass-spring-damper system that has the equilibrium of frame_solve for the same
 * `stiffness` [masses] and `force` [masses]: there, the position of a mass is its stiffness times
 * the force that it keeps. The geometric mean of `stiffness` must be 1. */
static inline mass_spring_damper damper_create(const frame *f, const double *stiffness,
                                               const double *force) {
  const size_t n = f->mesh.vertex_count;
  mass_spring_damper system = {.count = n, .links = f->topology.edge_count, .damping = 2.5};
  system.ends = f->topology.edges;
  system.spring = calloc(system.links, sizeof *system.spring);
  system.ground = calloc(n, sizeof *system.ground);
  system.push = calloc(n, sizeof *system.push);
  for (size_t i = 0; i < n; ++i) {
    system.ground[i] = 1.0;
    system.push[i] = force[i] * stiffness[i];
  }
  for (size_t e = 0; e < system.links; ++e) {
    const size_t i = system.ends[2 * e];
    const size_t j = system.ends[2 * e + 1];
    double square = 0.0;
    for (size_t x = 0; x < 3; ++x) {
      const double step = f->mesh.vertices[3 * i + x] - f->mesh.vertices[3 * j + x];
      square += step * step;
    }
    const double d = fmax(1.0, 0.5 * sqrt(square));
    const double mean = 0.5 * (stiffness[i] + stiffness[j]);
    system.spring[e] = mean / (d * (d * mean + 1.0 / stiffness[i] + 1.0 / stiffness[j]));
    system.ground[i] += stiffness[i] * mean / d - 2.0 * system.spring[e];
    system.ground[j] += stiffness[j] * mean / d - 2.0 * system.spring[e];
  }
  return system;
}

static inline void damper_free(mass_spring_damper *system) {
  free(system->spring);
  free(system->ground);
  free(system->push);
}

static inline int damper_slope(double time, const double *state, double *slope, void *context) {
  (void)time;
  mass_spring_damper *system = context;
  const size_t n = system->count;
  const double *velocity = state + n;
  for (size_t i = 0; i < n; ++i) {
    slope[i] = velocity[i];
    slope[n + i] = system->push[i] - system->ground[i] * state[i] - system->damping * velocity[i];
  }
  for (size_t e = 0; e < system->links; ++e) {
    const size_t i = system->ends[2 * e];
    const size_t j = system->ends[2 * e + 1];
    const double pull = system->spring[e] * (state[i] - state[j]);
    slope[n + i] -= pull;
    slope[n + j] += pull;
  }
  ++system->evaluations;
  return GSL_SUCCESS;
}

/* Integrate for `seconds`, from positions and velocities of 0. At each of `marks` evenly spaced
 * times, set `catch_` to the force that each mass keeps, which is its position divided by its
 * stiffness, and call `seen` if it is not NULL. Return false if GSL fails. */
static inline bool damper_integrate(mass_spring_damper *system, const double *stiffness,
                                    double seconds, size_t marks, double *catch_,
                                    void (*seen)(void *context, size_t evaluations,
                                                 const double *catch_),
                                    void *context) {
  const size_t n = system->count;
  gsl_odeiv2_system equation = {damper_slope, NULL, 2 * n, system};
  gsl_odeiv2_driver *driver =
      gsl_odeiv2_driver_alloc_y_new(&equation, gsl_odeiv2_step_rkf45, 1e-2, 1e-9, 1e-9);
  double *state = calloc(2 * n, sizeof *state);
  double time = 0.0;
  bool good = driver != NULL && state != NULL;
  for (size_t m = 1; m <= marks && good; ++m) {
    good = gsl_odeiv2_driver_apply(driver, &time, seconds * (double)m / (double)marks, state) ==
           GSL_SUCCESS;
    for (size_t i = 0; i < n; ++i) {
      catch_[i] = state[i] / stiffness[i];
    }
    if (seen != NULL) {
      seen(context, system->evaluations, catch_);
    }
  }
  if (driver != NULL) {
    gsl_odeiv2_driver_free(driver);
  }
  free(state);
  return good;
}

/* Return the RMS of a - b, divided by the RMS of b. */
static inline double relative_rms(size_t count, const double *a, const double *b) {
  double difference = 0.0;
  double norm = 0.0;
  for (size_t i = 0; i < count; ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    norm += b[i] * b[i];
  }
  return sqrt(difference / norm);
}

/* Return the force on each mass of a sheet (malloc): a Gaussian about the centre, with a radius of
 * a fifth of the side, plus a term that grows with y. */
static inline double *plane_force(const frame *f) {
  const size_t n = f->mesh.vertex_count;
  const double *last = f->mesh.vertices + 3 * (n - 1);
  double *force = calloc(n, sizeof *force);
  for (size_t i = 0; i < n; ++i) {
    const double x = f->mesh.vertices[3 * i] / last[0];
    const double y = f->mesh.vertices[3 * i + 1] / last[1];
    const double r2 = ((x - 0.5) * (x - 0.5) + (y - 0.5) * (y - 0.5)) / 0.04;
    force[i] = 0.2 * y + exp(-r2);
  }
  return force;
}

static inline double *ones(size_t count) {
  double *values = calloc(count, sizeof *values);
  for (size_t i = 0; i < count; ++i) {
    values[i] = 1.0;
  }
  return values;
}

/* Multiply the stiffness by one factor, so that its geometric mean is 1. */
static inline void normalise_stiffness(size_t count, double *stiffness) {
  double sum = 0.0;
  for (size_t i = 0; i < count; ++i) {
    sum += log(stiffness[i]) / (double)count;
  }
  for (size_t i = 0; i < count; ++i) {
    stiffness[i] /= exp(sum);
  }
}

/* Return the stiffness of each mass of a ring (malloc): `factor` in one third of the ring, 1
 * elsewhere. */
static inline double *ring_stiffness(size_t count, double factor) {
  double *stiffness = calloc(count, sizeof *stiffness);
  for (size_t i = 0; i < count; ++i) {
    stiffness[i] = i >= count / 3 && i < 2 * count / 3 ? factor : 1.0;
  }
  return stiffness;
}

/* number of horizontal slabs of equal height into which lungs are cut; slab 0 is the uppermost */
enum { ZONES = 10 };

typedef struct ventilation {
  double index[ZONES]; /* mean force on the vertices of a slab, divided by that in all lungs */
  double swept[ZONES]; /* a slab's share of the inhaled volume, divided by its share of the area */
  double slope;  /* slope of `index` against depth, which is 0 at the top and 1 at the bottom */
  double height; /* height of the lungs, mm */
} ventilation;

/* Measure the ventilation of horizontal slabs of the lungs when they inhale `volume` mL under
 * gravity g. */
static inline supine_status ventilation_measure(const supine_lungs *lungs, const double g[3],
                                                double volume, ventilation *found) {
  const size_t n = lungs->mesh.vertex_count;
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_solution solution = {0};
  double low;
  double high;
  double scale = 0.0;
  double *area = calloc(n + 1, sizeof *area);
  double *vertices = calloc(3 * n + 1, sizeof *vertices);
  supine_status status = area == NULL || vertices == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  if (status == SUPINE_OK) {
    status = supine_physics_solve(lungs, &model, g, &solution, NULL);
  }
  if (status == SUPINE_OK) {
    status = supine_volume_scale(solution.cubic, volume, &scale, NULL);
  }
  if (status == SUPINE_OK) {
    status = supine_physics_height_range(lungs, false, 1, g, &low, &high);
  }
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  supine_mesh_vertex_area(&lungs->mesh, area);
  supine_physics_solution_apply(&solution, &lungs->mesh, scale, vertices);
  double areas[ZONES] = {0.0};
  double caught[ZONES] = {0.0};
  double swept[ZONES] = {0.0};
  for (size_t i = 0; i < n; ++i) {
    const double *p = lungs->mesh.vertices + 3 * i;
    const double h = (g[0] * p[0] + g[1] * p[1] + g[2] * p[2] - low) / (high - low);
    const size_t zone = h < 1.0 ? (size_t)(ZONES * h) : ZONES - 1;
    areas[zone] += area[i];
    caught[zone] += area[i] * solution.catch_[i];
  }
  /* The volume that a triangle sweeps is its mean displacement times the mean of its old and new
   * area vectors. */
  for (size_t t = 0; t < lungs->mesh.triangle_count; ++t) {
    const uint32_t *c = lungs->mesh.triangles + 3 * t;
    double middle[3] = {0.0, 0.0, 0.0};
    double move[3] = {0.0, 0.0, 0.0};
    double normal[3] = {0.0, 0.0, 0.0};
    for (size_t v = 0; v < 3; ++v) {
      for (size_t k = 0; k < 3; ++k) {
        const size_t at = 3 * (size_t)c[v] + k;
        middle[k] += lungs->mesh.vertices[at] / 3.0;
        move[k] += (vertices[at] - lungs->mesh.vertices[at]) / 3.0;
      }
    }
    for (int side = 0; side < 2; ++side) {
      const double *all = side == 0 ? lungs->mesh.vertices : vertices;
      const double *p[3] = {all + 3 * (size_t)c[0], all + 3 * (size_t)c[1], all + 3 * (size_t)c[2]};
      for (size_t k = 0; k < 3; ++k) {
        const size_t a = (k + 1) % 3;
        const size_t b = (k + 2) % 3;
        normal[k] += 0.25 * ((p[1][a] - p[0][a]) * (p[2][b] - p[0][b]) -
                             (p[1][b] - p[0][b]) * (p[2][a] - p[0][a]));
      }
    }
    const double h = (g[0] * middle[0] + g[1] * middle[1] + g[2] * middle[2] - low) / (high - low);
    const size_t zone = h < 0.0 ? 0 : h < 1.0 ? (size_t)(ZONES * h) : ZONES - 1;
    swept[zone] += move[0] * normal[0] + move[1] * normal[1] + move[2] * normal[2];
  }
  double all_area = 0.0;
  double all_caught = 0.0;
  double all_swept = 0.0;
  for (size_t z = 0; z < ZONES; ++z) {
    all_area += areas[z];
    all_caught += caught[z];
    all_swept += swept[z];
  }
  double sum_h = 0.0;
  double sum_hh = 0.0;
  double sum_i = 0.0;
  double sum_hi = 0.0;
  for (size_t z = 0; z < ZONES; ++z) {
    const double h = ((double)z + 0.5) / ZONES;
    found->index[z] = caught[z] / areas[z] / (all_caught / all_area);
    found->swept[z] = swept[z] / all_swept / (areas[z] / all_area);
    sum_h += h;
    sum_hh += h * h;
    sum_i += found->index[z];
    sum_hi += h * found->index[z];
  }
  found->slope = (ZONES * sum_hi - sum_h * sum_i) / (ZONES * sum_hh - sum_h * sum_h);
  found->height = high - low;
cleanup:
  supine_physics_solution_free(&solution);
  free(area);
  free(vertices);
  return status;
}

/* A grid of cubic cells with sides of `size` mm, to search for the nearest vertex. */
typedef struct nearest_grid {
  double low[3], size;
  size_t cells[3];
  size_t *begin; /* [number of cells + 1] index in `order` where the vertices of each cell begin */
  uint32_t *order; /* [N] indices of vertices, sorted by cell */
  const supine_mesh *mesh;
} nearest_grid;

static inline size_t nearest_cell(const nearest_grid *grid, const double *p, long cell[3]) {
  size_t at = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double c = floor((p[k] - grid->low[k]) / grid->size);
    cell[k] = c < 0.0 ? 0 : c >= (double)grid->cells[k] ? (long)grid->cells[k] - 1 : (long)c;
    at = at * grid->cells[k] + (size_t)cell[k];
  }
  return at;
}

static inline nearest_grid nearest_create(const supine_mesh *mesh, double size) {
  nearest_grid grid = {.size = size, .mesh = mesh};
  double high[3];
  long cell[3];
  supine_mesh_box(mesh, grid.low, high);
  size_t total = 1;
  for (size_t k = 0; k < 3; ++k) {
    grid.cells[k] = (size_t)((high[k] - grid.low[k]) / size) + 1;
    total *= grid.cells[k];
  }
  grid.begin = calloc(total + 2, sizeof *grid.begin);
  grid.order = calloc(mesh->vertex_count + 1, sizeof *grid.order);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    ++grid.begin[nearest_cell(&grid, mesh->vertices + 3 * i, cell) + 2];
  }
  for (size_t c = 2; c < total + 2; ++c) {
    grid.begin[c] += grid.begin[c - 1];
  }
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    grid.order[grid.begin[nearest_cell(&grid, mesh->vertices + 3 * i, cell) + 1]++] = (uint32_t)i;
  }
  return grid;
}

static inline void nearest_free(nearest_grid *grid) {
  free(grid->begin);
  free(grid->order);
}

/* Return the vertex nearest to p in its cell and the adjacent cells; SIZE_MAX if these are
 * empty. */
static inline size_t nearest_find(const nearest_grid *grid, const double *p) {
  long cell[3];
  size_t found = SIZE_MAX;
  double least = INFINITY;
  (void)nearest_cell(grid, p, cell);
  for (long x = cell[0] - 1; x <= cell[0] + 1; ++x) {
    for (long y = cell[1] - 1; y <= cell[1] + 1; ++y) {
      for (long z = cell[2] - 1; z <= cell[2] + 1; ++z) {
        if (x < 0 || y < 0 || z < 0 || x >= (long)grid->cells[0] || y >= (long)grid->cells[1] ||
            z >= (long)grid->cells[2]) {
          continue;
        }
        const size_t at = ((size_t)x * grid->cells[1] + (size_t)y) * grid->cells[2] + (size_t)z;
        for (size_t s = grid->begin[at]; s < grid->begin[at + 1]; ++s) {
          const double *q = grid->mesh->vertices + 3 * (size_t)grid->order[s];
          const double d2 = (p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                            (p[2] - q[2]) * (p[2] - q[2]);
          if (d2 < least) {
            least = d2;
            found = grid->order[s];
          }
        }
      }
    }
  }
  return found;
}

/* Compute the displacements `moves` [N, 3], mm, when lungs inhale `volume` mL under gravity g.
 * `reach` is the distance over which a force spreads, mm; 0 for the transfer of force in
 * [Santhanam2008]. */
static inline supine_status breathe_at(const supine_lungs *lungs, double reach, const double g[3],
                                       double volume, double *moves) {
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_solution solution = {0};
  double scale = 0.0;
  model.reach = reach;
  supine_status status = supine_physics_solve(lungs, &model, g, &solution, NULL);
  if (status == SUPINE_OK) {
    status = supine_volume_scale(solution.cubic, volume, &scale, NULL);
  }
  for (size_t at = 0; status == SUPINE_OK && at < 3 * lungs->mesh.vertex_count; ++at) {
    moves[at] = scale * solution.catch_[at / 3] * solution.directions[at];
  }
  supine_physics_solution_free(&solution);
  return status;
}

/* Apply a unit force to `vertex`, and compute how far it spreads: the RMS distance from `vertex` to
 * all vertices, mm, weighted by the force times the area there. `reach` is that of breathe_at. */
static inline supine_status spread_of(const supine_lungs *lungs, double reach, size_t vertex,
                                      double *spread) {
  const size_t n = lungs->mesh.vertex_count;
  supine_equilibrium *equilibrium = NULL;
  double *area = calloc(n + 1, sizeof *area);
  double *column = calloc(n, sizeof *column);
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  model.reach = reach;
  supine_status status = supine_physics_model_equilibrium(lungs, &model, &equilibrium, NULL);
  if (status == SUPINE_OK) {
    status = supine_physics_transfer_column(equilibrium, vertex, column, NULL);
  }
  if (status == SUPINE_OK) {
    double sum = 0.0;
    double square = 0.0;
    const double *q = lungs->mesh.vertices + 3 * vertex;
    supine_mesh_vertex_area(&lungs->mesh, area);
    for (size_t i = 0; i < n; ++i) {
      const double *p = lungs->mesh.vertices + 3 * i;
      const double weight = area[i] * column[i];
      sum += weight;
      square += weight * ((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                          (p[2] - q[2]) * (p[2] - q[2]));
    }
    *spread = sqrt(square / sum);
  }
  supine_physics_equilibrium_destroy(equilibrium);
  free(area);
  free(column);
  return status;
}

/* Compare the displacement of each vertex of `coarse` with that of the nearest vertex of `fine`,
 * two meshes of one lung. Return the RMS difference divided by the RMS displacement of `fine`. */
static inline double drift_of(const supine_mesh *coarse, const double *coarse_moves,
                              const supine_mesh *fine, const double *fine_moves) {
  nearest_grid grid = nearest_create(fine, 5.0);
  double difference = 0.0;
  double norm = 0.0;
  for (size_t i = 0; i < coarse->vertex_count; ++i) {
    const size_t j = nearest_find(&grid, coarse->vertices + 3 * i);
    for (size_t k = 0; k < 3 && j != SIZE_MAX; ++k) {
      const double a = coarse_moves[3 * i + k];
      const double b = fine_moves[3 * j + k];
      difference += (a - b) * (a - b);
      norm += b * b;
    }
  }
  nearest_free(&grid);
  return sqrt(difference / norm);
}

#endif
