/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Extend a displacement field from the lungs to the border of its grid, where it is 0. */
#include <math.h>
#include <stddef.h>

#include "base/vec3.h"

#include "precompute/warp/fade.h"

double supine_warp_fade(double largest) {
  static const double least = 60.0;
  /* The field falls linearly: tissue keeps at least a third of its length, and does not fold. */
  static const double per_displacement = 1.5;
  return fmax(least, per_displacement * largest);
}

/* Number of passes that smooth the field around the lungs. */
enum { PASSES = 8 };

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

/* Return whether a node is not at the border of the grid. */
static bool is_inner(const supine_image *nodes, const size_t at[3]) {
  bool inner = true;
  for (size_t a = 0; a < 3; ++a) {
    inner = inner && at[a] > 0 && at[a] + 1 < nodes->size[a];
  }
  return inner;
}

/* Take depth, displacement and lung of the node `i` from the neighbour by which its depth is
 * largest. */
static void take_from_neighbours(supine_field *field, const later *to, int sign, size_t i,
                                 const size_t at[3]) {
  const supine_image *nodes = &field->nodes;
  float *u = nodes->values;
  float *depth = field->depth.values;
  unsigned char *lung = field->lung.values;
  const bool inner = is_inner(nodes, at);
  size_t best = i;
  for (size_t k = 0; k < 13; ++k) {
    bool within = true;
    if (!inner) {
      for (size_t a = 0; a < 3; ++a) {
        within = within && at[a] + (size_t)(sign * to->by[k][a]) < nodes->size[a];
      }
    }
    if (within) {
      const size_t j = (size_t)((ptrdiff_t)i + sign * to->node[k]);
      const float reached = depth[j] - to->length[k];
      if (reached > depth[i]) {
        depth[i] = reached;
        best = j;
      }
    }
  }
  for (size_t c = 0; c < 3; ++c) {
    u[3 * i + c] = u[3 * best + c];
  }
  lung[i] = lung[best];
}

/* Set the depth and the displacement of the nodes outside the lungs. Follow the shortest path from
 * the lungs to the node, in steps along the 26 directions of the grid. The depth is minus the
 * length of this path, which is at most a tenth longer than the straight line; the displacement is
 * that of the node where the path starts. One pass goes forwards through the nodes, and one
 * backwards. */
static void extend(supine_field *field, const unsigned char *known) {
  const size_t *size = field->nodes.size;
  const size_t count = size[0] * size[1] * size[2];
  const later to = later_of(&field->nodes);
  size_t at[3] = {0, 0, 0};
  for (size_t i = 0; i < count; ++i) {
    if (known[i] == 0) {
      take_from_neighbours(field, &to, -1, i, at);
    }
    for (size_t a = 0; a < 3 && ++at[a] == size[a]; ++a) {
      at[a] = 0;
    }
  }
  for (size_t i = count; i-- > 0;) {
    for (size_t a = 0; a < 3 && at[a]-- == 0; ++a) {
      at[a] = size[a] - 1;
    }
    if (known[i] == 0) {
      take_from_neighbours(field, &to, 1, i, at);
    }
  }
}

/* Replace the field at the nodes more than `near` mm outside the lungs by the mean of their
 * neighbours, as between the lungs the extensions of their fields differ. */
static void smooth(supine_image *nodes, const float *depth, double near) {
  float *u = nodes->values;
  const size_t *size = nodes->size;
  const size_t row = size[0];
  const size_t slice = size[0] * size[1];
  for (int pass = 0; pass < PASSES; ++pass) {
    for (size_t r = 0; r < size[1] * size[2]; ++r) {
      const size_t line = pass % 2 == 0 ? r : size[1] * size[2] - 1 - r;
      if (!is_inner(nodes, (const size_t[]){1, line % size[1], line / size[1]})) {
        continue;
      }
      for (size_t i = line * row + 1; i + 1 < (line + 1) * row; ++i) {
        if ((double)depth[i] < -near) {
          for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
            u[c] = (u[c - 3] + u[c + 3] + u[c - 3 * row] + u[c + 3 * row] + u[c - 3 * slice] +
                    u[c + 3 * slice]) /
                   6.0F;
          }
        }
      }
    }
  }
}

/* Return the largest displacement in the lungs and at the nodes up to `near` mm from them. */
static double largest_near(const supine_image *nodes, const float *depth, double near) {
  const float *u = nodes->values;
  double square = 0.0;
  for (size_t i = 0; i < supine_image_count(nodes); ++i) {
    const double v[3] = {(double)u[3 * i], (double)u[3 * i + 1], (double)u[3 * i + 2]};
    square = (double)depth[i] >= -near ? fmax(square, supine_dot(v, v)) : square;
  }
  return sqrt(square);
}

void supine_warp_fade_out(supine_field *field, const unsigned char *known) {
  supine_image *nodes = &field->nodes;
  float *u = nodes->values;
  float *depth = field->depth.values;
  const size_t count = supine_image_count(nodes);
  const double near = supine_image_cell_diagonal(nodes);
  double height[3];
  for (size_t a = 0; a < 3; ++a) {
    height[a] = supine_image_plane_distance(nodes, a);
  }
  extend(field, known);
  const double length = supine_warp_fade(largest_near(nodes, depth, near));
  smooth(nodes, depth, near);
  for (size_t i = 0; i < count; ++i) {
    const size_t at[3] = {i % nodes->size[0], i / nodes->size[0] % nodes->size[1],
                          i / nodes->size[0] / nodes->size[1]};
    const double gone = -(double)depth[i] > near ? -(double)depth[i] - near : 0.0;
    double left = length - gone;
    for (size_t a = 0; a < 3; ++a) {
      const size_t other = nodes->size[a] - 1 - at[a];
      const double border = height[a] * (double)(at[a] < other ? at[a] : other);
      left = border < left ? border : left;
    }
    const float share = left > 0.0 ? (float)(left / (left + gone)) : 0.0F;
    for (size_t c = 0; c < 3; ++c) {
      u[3 * i + c] *= share;
    }
  }
}
