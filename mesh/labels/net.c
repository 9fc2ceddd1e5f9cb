/* SPDX-License-Identifier: MIT */
/* Make the surface of a mask as a surface net [Gibson1998]. There is a vertex between eight
 * neighbouring cubes of a grid if some of the cubes are inside the mask and some outside. There is
 * a quadrilateral around the edge between the centres of two neighbouring cubes if one of them is
 * inside and the other outside. */
#include <string.h>

#include "base/vec3.h"

#include "mesh/labels/mask.h"

#define NONE UINT32_MAX

/* A surface net. A cell is the box whose eight corners are the centres of neighbouring cubes. It
 * holds a vertex if some of these cubes are inside the mask and some outside. */
typedef struct surface_net {
  size_t count;
  uint32_t (*cell)[3];      /* [count] lowest x, y, z indices of the cell's eight cubes */
  double (*at)[3];          /* [count] position of the vertex in its cell, 0 to 1 along each axis */
  uint32_t (*neighbour)[6]; /* [count] vertices of the cells beyond faces -x, +x, ..., or NONE */
  size_t quad_count;
  uint32_t (*quad)[4]; /* vertices, counter-clockwise from outside if the axes are right-handed */
} surface_net;

static const float half = 0.5F;

typedef struct build {
  const labels_cubes *cubes;
  size_t stride[3]; /* difference of the indices of neighbouring cubes along each axis */
  uint32_t *vertex; /* [cubes] vertex, if any, between a cube and 7 neighbours at higher x, y, z */
  surface_net *net;
} build;

/* Find the mean of the points where the surface crosses the edges of a cell, 0 to 1 along each
 * axis. Return false if it crosses none. */
static bool crossing(const build *b, size_t cell, double mean[3]) {
  const float *share = b->cubes->share;
  double sum[3] = {0.0, 0.0, 0.0};
  size_t count = 0;
  size_t inside = 0;
  for (size_t c = 0; c < 8; ++c) {
    inside += share[cell + (c & 1U) * b->stride[0] + (c >> 1U & 1U) * b->stride[1] +
                    (c >> 2U) * b->stride[2]] >= half;
  }
  if (inside == 0 || inside == 8) {
    return false;
  }
  for (size_t c = 0; c < 8; ++c) {
    const size_t bit[3] = {c & 1U, c >> 1U & 1U, c >> 2U};
    const size_t from =
        cell + bit[0] * b->stride[0] + bit[1] * b->stride[1] + bit[2] * b->stride[2];
    for (size_t a = 0; a < 3; ++a) {
      if (bit[a] != 0) {
        continue;
      }
      const float u = share[from];
      const float v = share[from + b->stride[a]];
      if ((u >= half) != (v >= half)) {
        for (size_t k = 0; k < 3; ++k) {
          sum[k] += k == a ? (double)((half - u) / (v - u)) : (double)bit[k];
        }
        ++count;
      }
    }
  }
  for (size_t k = 0; k < 3; ++k) {
    mean[k] = sum[k] / (double)count;
  }
  return true;
}

/* Count the cells that the surface crosses. If `write` is true, also fill the vertices of the
 * net. */
static void find_vertices(build *b, bool write) {
  const size_t *size = b->cubes->size;
  surface_net *net = b->net;
  net->count = 0;
  for (size_t k = 0; k + 1 < size[2]; ++k) {
    for (size_t j = 0; j + 1 < size[1]; ++j) {
      for (size_t i = 0; i + 1 < size[0]; ++i) {
        const size_t cell = i + b->stride[1] * j + b->stride[2] * k;
        double mean[3];
        if (!crossing(b, cell, mean)) {
          continue;
        }
        if (write) {
          b->vertex[cell] = (uint32_t)net->count;
          memcpy(net->at[net->count], mean, sizeof mean);
          net->cell[net->count][0] = (uint32_t)i;
          net->cell[net->count][1] = (uint32_t)j;
          net->cell[net->count][2] = (uint32_t)k;
        }
        ++net->count;
      }
    }
  }
}

/* Add the quadrilateral that separates `cube` from the next cube along axis `a`, and record its
 * four vertices as neighbours. If `write` is false, only count it. */
static void add_quad(build *b, size_t cube, size_t a, bool write) {
  surface_net *net = b->net;
  const size_t u = (a + 1) % 3;
  const size_t v = (a + 2) % 3;
  const size_t cells[4] = {cube - b->stride[u] - b->stride[v], cube - b->stride[v], cube,
                           cube - b->stride[u]};
  /* Face through which each of `cells` touches the next one: +u, +v, -u, -v. */
  const size_t face[4] = {2 * u + 1, 2 * v + 1, 2 * u, 2 * v};
  if (write) {
    const bool outwards = b->cubes->share[cube] >= half;
    for (size_t c = 0; c < 4; ++c) {
      const uint32_t from = b->vertex[cells[c]];
      const uint32_t to = b->vertex[cells[(c + 1) % 4]];
      net->quad[net->quad_count][outwards ? c : 3 - c] = from;
      net->neighbour[from][face[c]] = to;
      net->neighbour[to][face[c] ^ 1U] = from;
    }
  }
  ++net->quad_count;
}

static void find_quads(build *b, bool write) {
  const size_t *size = b->cubes->size;
  const float *share = b->cubes->share;
  b->net->quad_count = 0;
  for (size_t k = 1; k + 1 < size[2]; ++k) {
    for (size_t j = 1; j + 1 < size[1]; ++j) {
      for (size_t i = 1; i + 1 < size[0]; ++i) {
        const size_t cube = i + b->stride[1] * j + b->stride[2] * k;
        for (size_t a = 0; a < 3; ++a) {
          if ((share[cube] >= half) != (share[cube + b->stride[a]] >= half)) {
            add_quad(b, cube, a, write);
          }
        }
      }
    }
  }
}

static supine_status create(const labels_cubes *cubes, supine_arena *arena, surface_net *net) {
  const size_t count = cubes->size[0] * cubes->size[1] * cubes->size[2];
  build b = {
      .cubes = cubes, .stride = {1, cubes->size[0], cubes->size[0] * cubes->size[1]}, .net = net};
  find_vertices(&b, false);
  find_quads(&b, false);
  SUPINE_ARENA temporary = {0};
  b.vertex = supine_arena_take(&temporary, count, sizeof *b.vertex);
  net->cell = supine_arena_take(arena, net->count, sizeof *net->cell);
  net->at = supine_arena_take(arena, net->count, sizeof *net->at);
  net->neighbour = supine_arena_take(arena, net->count, sizeof *net->neighbour);
  net->quad = supine_arena_take(arena, net->quad_count, sizeof *net->quad);
  if (temporary.failed || arena->failed || net->count >= INT32_MAX) {
    return SUPINE_ERROR_MEMORY;
  }
  memset(net->neighbour, 0xFF, net->count * sizeof *net->neighbour); /* sets all to NONE */
  find_vertices(&b, true);
  find_quads(&b, true);
  return SUPINE_OK;
}

/* Factors lambda and mu of the two alternating smoothing steps [Taubin1995]. The pass-band
 * frequency 1 / lambda + 1 / mu = 0.04 keeps features longer than 16 cubes, but no stairs between
 * slices. */
static const double shrink = 0.5;
static const double swell = -0.51;
enum { TURNS = 40 }; /* number of times that the net is shrunk and inflated */

/* Move every vertex by the fraction `share` of the way to the mean of its neighbours, but not out
 * of its cell. */
static void step(const surface_net *net, double share, double (*next)[3]) {
  for (size_t v = 0; v < net->count; ++v) {
    double sum[3] = {0.0, 0.0, 0.0};
    double count = 0.0;
    for (size_t n = 0; n < 6; ++n) {
      const uint32_t other = net->neighbour[v][n];
      if (other != NONE) {
        for (size_t a = 0; a < 3; ++a) {
          sum[a] += (double)net->cell[other][a] - (double)net->cell[v][a] + net->at[other][a];
        }
        count += 1.0;
      }
    }
    for (size_t a = 0; a < 3; ++a) {
      const double here = net->at[v][a];
      const double there = here + share * (sum[a] / count - here);
      next[v][a] = fmin(fmax(there, 0.0), 1.0);
    }
  }
}

/* Smooth the net by alternate shrinking and inflation, a low-pass filter [Taubin1995]. Every vertex
 * stays in its cell. */
static supine_status relax(surface_net *net) {
  SUPINE_ARENA arena = {0};
  double(*next)[3] = supine_arena_take(&arena, net->count, sizeof *next);
  SUPINE_TRY(supine_arena_status(&arena));
  for (int turn = 0; turn < 2 * TURNS; ++turn) { /* an even number of exchanges */
    step(net, turn % 2 == 0 ? shrink : swell, next);
    double(*old)[3] = net->at;
    net->at = next;
    next = old;
  }
  return SUPINE_OK;
}

static void in_voxels(const surface_net *net, const labels_cubes *cubes, size_t vertex,
                      double voxel[3]) {
  for (size_t a = 0; a < 3; ++a) {
    voxel[a] =
        cubes->origin[a] + cubes->ratio[a] * ((double)net->cell[vertex][a] + net->at[vertex][a]);
  }
}

static supine_status make_mesh(const surface_net *net, const labels_cubes *cubes,
                               const labels_mask *mask, supine_mesh *mesh) {
  const bool turned = supine_triple(mask->step[0], mask->step[1], mask->step[2]) < 0.0;
  SUPINE_TRY(supine_mesh_allocate(net->count, 2 * net->quad_count, mesh));
  for (size_t i = 0; i < net->count; ++i) {
    double voxel[3];
    in_voxels(net, cubes, i, voxel);
    supine_labels_mask_place(mask, voxel, mesh->vertices + 3 * i);
  }
  for (size_t q = 0; q < net->quad_count; ++q) { /* cut along the shorter diagonal */
    uint32_t c[4];
    for (size_t k = 0; k < 4; ++k) {
      c[k] = net->quad[q][turned ? 3 - k : k];
    }
    const bool first = supine_distance(mesh->vertices + 3 * c[0], mesh->vertices + 3 * c[2]) <=
                       supine_distance(mesh->vertices + 3 * c[1], mesh->vertices + 3 * c[3]);
    const uint32_t corners[6] = {c[0], c[1], first ? c[2] : c[3], first ? c[0] : c[1], c[2], c[3]};
    memcpy(mesh->triangles + 6 * q, corners, sizeof corners);
  }
  return SUPINE_OK;
}

supine_status supine_labels_mask_surface(const labels_mask *mask, double edge, bool one,
                                         supine_mesh *mesh) {
  SUPINE_ARENA arena = {0};
  labels_cubes cubes;
  surface_net net;
  SUPINE_TRY(supine_labels_cubes_create(mask, edge, one, &arena, &cubes));
  SUPINE_TRY(create(&cubes, &arena, &net));
  SUPINE_TRY(relax(&net));
  return make_mesh(&net, &cubes, mask, mesh);
}
