/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Extend a displacement field from the lungs to the border of its grid, where it is 0. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "precompute/warp/fade.h"

double supine_field_fade(double largest) {
  static const double least = 60.0;
  /* The field falls linearly: tissue keeps at least a third of its length, and does not fold. */
  static const double per_displacement = 1.5;
  return fmax(least, per_displacement * largest);
}

/* Number of passes that smooth the field around the lungs. */
enum { PASSES = 8 };

static double cell_diagonal(const supine_image *nodes) {
  double longest = 0.0;
  for (unsigned signs = 0; signs < 4; ++signs) {
    double sum[3];
    for (size_t k = 0; k < 3; ++k) {
      sum[k] = nodes->step[0][k] + (signs & 1U ? -1.0 : 1.0) * nodes->step[1][k] +
               (signs & 2U ? -1.0 : 1.0) * nodes->step[2][k];
    }
    longest = fmax(longest, supine_length(sum));
  }
  return longest;
}

/* The neighbours of a node along the axes of the grid. */
typedef struct neighbours {
  size_t count;
  size_t node[6];
} neighbours;

static neighbours neighbours_of(const supine_image *nodes, size_t node) {
  neighbours found = {.count = 0};
  size_t left = node;
  size_t stride = 1;
  for (size_t a = 0; a < 3; ++a) {
    const size_t at = left % nodes->size[a];
    if (at > 0) {
      found.node[found.count++] = node - stride;
    }
    if (at + 1 < nodes->size[a]) {
      found.node[found.count++] = node + stride;
    }
    left /= nodes->size[a];
    stride *= nodes->size[a];
  }
  return found;
}

/* Offsets from a node to the 13 of its 26 neighbours that come later in the order of the nodes. */
typedef struct later {
  int by[13][3];
  ptrdiff_t node[13];
  float length[13]; /* mm */
} later;

static later later_of(const supine_image *nodes) {
  later found;
  size_t count = 0;
  const ptrdiff_t row = (ptrdiff_t)nodes->size[0];
  const ptrdiff_t slice = row * (ptrdiff_t)nodes->size[1];
  for (int code = 14; code < 27; ++code) { /* 13 is the node itself */
    const int by[3] = {code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1};
    double step[3];
    for (size_t k = 0; k < 3; ++k) {
      found.by[count][k] = by[k];
      step[k] = by[0] * nodes->step[0][k] + by[1] * nodes->step[1][k] + by[2] * nodes->step[2][k];
    }
    found.node[count] = by[0] + row * by[1] + slice * by[2];
    found.length[count++] = (float)supine_length(step);
  }
  return found;
}

/* Find the depth of the nodes at which it is unknown, -INFINITY, from that of their neighbours:
 * minus the length of the shortest path to the lungs, which is at most a tenth longer than the
 * straight one. One pass goes forwards through the nodes, and one backwards. */
static void spread_depth(const supine_image *nodes, const unsigned char *known, float *depth) {
  const later to = later_of(nodes);
  const size_t count = nodes->size[0] * nodes->size[1] * nodes->size[2];
  for (int pass = 0; pass < 2; ++pass) {
    const int sign = pass == 0 ? -1 : 1;
    for (size_t n = 0; n < count; ++n) {
      const size_t i = pass == 0 ? n : count - 1 - n;
      const size_t at[3] = {i % nodes->size[0], i / nodes->size[0] % nodes->size[1],
                            i / nodes->size[0] / nodes->size[1]};
      for (size_t k = 0; k < 13 && known[i] == 0; ++k) {
        bool within = true;
        for (size_t a = 0; a < 3; ++a) {
          within = within && at[a] + (size_t)(sign * to.by[k][a]) < nodes->size[a];
        }
        if (within) {
          const size_t j = (size_t)((ptrdiff_t)i + sign * to.node[k]);
          depth[i] = fmaxf(depth[i], depth[j] - to.length[k]);
        }
      }
    }
  }
}

/* Extend the field in layers of nodes: each takes the mean of its neighbours in earlier layers.
 * `known` is 1 at the nodes at which the field is given.
 * @param order  [nodes] work space */
static void extend(supine_image *nodes, unsigned char *known, uint32_t *order) {
  enum { UNKNOWN = 0, KNOWN = 1, NEXT = 2 };
  float *u = nodes->values;
  const size_t count = nodes->size[0] * nodes->size[1] * nodes->size[2];
  size_t end = 0;
  for (size_t i = 0; i < count; ++i) {
    const neighbours next = neighbours_of(nodes, i);
    for (size_t k = 0; k < next.count && known[i] == KNOWN; ++k) {
      if (known[next.node[k]] == UNKNOWN) {
        known[next.node[k]] = NEXT;
        order[end++] = (uint32_t)next.node[k];
      }
    }
  }
  for (size_t begin = 0; begin < end;) {
    const size_t layer_end = end;
    for (size_t n = begin; n < layer_end; ++n) {
      const neighbours next = neighbours_of(nodes, order[n]);
      float sum[3] = {0.0F, 0.0F, 0.0F};
      float from = 0.0F;
      for (size_t k = 0; k < next.count; ++k) {
        const float weight = known[next.node[k]] == KNOWN ? 1.0F : 0.0F;
        from += weight;
        for (size_t c = 0; c < 3; ++c) {
          sum[c] += weight * u[3 * next.node[k] + c];
        }
      }
      for (size_t c = 0; c < 3; ++c) {
        u[3 * (size_t)order[n] + c] = sum[c] / from;
      }
    }
    for (size_t n = begin; n < layer_end; ++n) {
      known[order[n]] = KNOWN;
    }
    for (size_t n = begin; n < layer_end; ++n) {
      const neighbours next = neighbours_of(nodes, order[n]);
      for (size_t k = 0; k < next.count; ++k) {
        if (known[next.node[k]] == UNKNOWN) {
          known[next.node[k]] = NEXT;
          order[end++] = (uint32_t)next.node[k];
        }
      }
    }
    begin = layer_end;
  }
}

/* Replace the field at the nodes deeper than `near` mm outside the lungs by the mean of their
 * neighbours, as between the lungs the extensions of their fields differ. */
static void smooth(supine_image *nodes, const float *depth, double near) {
  float *u = nodes->values;
  const size_t count = nodes->size[0] * nodes->size[1] * nodes->size[2];
  for (int pass = 0; pass < PASSES; ++pass) {
    for (size_t n = 0; n < count; ++n) {
      const size_t i = pass % 2 == 0 ? n : count - 1 - n;
      if ((double)depth[i] >= -near) {
        continue;
      }
      const neighbours next = neighbours_of(nodes, i);
      for (size_t c = 0; c < 3; ++c) {
        float sum = 0.0F;
        for (size_t k = 0; k < next.count; ++k) {
          sum += u[3 * next.node[k] + c];
        }
        u[3 * i + c] = sum / (float)next.count;
      }
    }
  }
}

/* Return the distance, mm, of a node from the border of the grid. */
static double border_distance(const supine_image *nodes, const double height[3], size_t node) {
  double least = INFINITY;
  size_t left = node;
  for (size_t a = 0; a < 3; ++a) {
    const size_t at = left % nodes->size[a];
    const size_t last = nodes->size[a] - 1 - at;
    least = fmin(least, height[a] * (double)(at < last ? at : last));
    left /= nodes->size[a];
  }
  return least;
}

static void find_heights(const supine_image *nodes, double height[3]) {
  const double whole = supine_triple(nodes->step[0], nodes->step[1], nodes->step[2]);
  for (size_t a = 0; a < 3; ++a) {
    double normal[3];
    supine_cross(nodes->step[(a + 1) % 3], nodes->step[(a + 2) % 3], normal);
    height[a] = fabs(whole) / supine_length(normal);
  }
}

/* Return the largest displacement in the lungs and at the nodes up to `near` mm from them. */
static double largest_near(const supine_image *nodes, const float *depth, double near) {
  const float *u = nodes->values;
  double square = 0.0;
  for (size_t i = 0; i < nodes->size[0] * nodes->size[1] * nodes->size[2]; ++i) {
    const double v[3] = {(double)u[3 * i], (double)u[3 * i + 1], (double)u[3 * i + 2]};
    square = (double)depth[i] >= -near ? fmax(square, supine_dot(v, v)) : square;
  }
  return sqrt(square);
}

supine_status supine_field_fade_out(supine_field *field, unsigned char *known,
                                    supine_error *error) {
  supine_image *nodes = &field->nodes;
  float *u = nodes->values;
  float *depth = field->depth.values;
  const size_t count = nodes->size[0] * nodes->size[1] * nodes->size[2];
  const double near = cell_diagonal(nodes);
  double height[3];
  SUPINE_ARENA arena = {0};
  uint32_t *order = supine_arena_take(&arena, count, sizeof *order);
  SUPINE_TRY(supine_arena_check(&arena, error, "a field of %zu nodes", count));
  find_heights(nodes, height);
  spread_depth(nodes, known, depth);
  const double length = supine_field_fade(largest_near(nodes, depth, near));
  extend(nodes, known, order);
  smooth(nodes, depth, near);
  for (size_t i = 0; i < count; ++i) {
    const double gone = fmax(0.0, -(double)depth[i] - near);
    const double left = fmin(border_distance(nodes, height, i), length - gone);
    const float share = left > 0.0 ? (float)(left / (left + gone)) : 0.0F;
    for (size_t c = 0; c < 3; ++c) {
      u[3 * i + c] *= share;
    }
  }
  return SUPINE_OK;
}
