/* SPDX-License-Identifier: GPL-3.0-or-later */
/* I - A over all nodes, masses and springs, entry by entry from the definitions (3), (8): what the
 * fast solve is compared with. Shares no code with it. */
#ifndef SUPINE_FULL_OPERATOR_H
#define SUPINE_FULL_OPERATOR_H

#include <math.h>
#include <stdlib.h>

#include <supine/mesh.h>

typedef struct full_operator {
  size_t node_count;  /* masses, then springs */
  size_t entry_count; /* off the diagonal */
  size_t *row, *column;
  double *value; /* Te[column->row] */
  double *own;   /* Te[j->j] */
} full_operator;

/* Te of every pair of linked nodes, for stiffness E [N] as it stands. */
static inline full_operator full_operator_create(const supine_mesh *mesh,
                                                 const supine_topology *topology, const double *e) {
  const size_t n = mesh->vertex_count;
  full_operator op = {.node_count = n + topology->edge_count,
                      .entry_count = 4 * topology->edge_count};
  double *s = malloc(op.node_count * sizeof *s);
  double *z = malloc(op.node_count * sizeof *z);
  op.row = malloc(op.entry_count * sizeof *op.row);
  op.column = malloc(op.entry_count * sizeof *op.column);
  op.value = malloc(op.entry_count * sizeof *op.value);
  op.own = malloc(op.node_count * sizeof *op.own);
  for (size_t i = 0; i < n; ++i) {
    z[i] = s[i] = 1.0 / e[i];
  }
  for (size_t k = 0; k < topology->edge_count; ++k) {
    z[n + k] = s[n + k] = (e[topology->edges[2 * k]] + e[topology->edges[2 * k + 1]]) / 2.0;
  }
  size_t at = 0;
  for (size_t k = 0; k < topology->edge_count; ++k) {
    double middle[3];
    for (size_t x = 0; x < 3; ++x) {
      middle[x] = (mesh->vertices[3 * (size_t)topology->edges[2 * k] + x] +
                   mesh->vertices[3 * (size_t)topology->edges[2 * k + 1] + x]) /
                  2.0;
    }
    for (size_t side = 0; side < 2; ++side) {
      const size_t mass = topology->edges[2 * k + side];
      const double *p = mesh->vertices + 3 * mass;
      const double d = fmax(1.0, hypot(hypot(p[0] - middle[0], p[1] - middle[1]), p[2] - middle[2]));
      op.row[at] = mass;
      op.column[at] = n + k;
      op.value[at++] = s[mass] / d;
      op.row[at] = n + k;
      op.column[at] = mass;
      op.value[at++] = s[n + k] / d;
      z[mass] += s[n + k] / d;
      z[n + k] += s[mass] / d;
    }
  }
  for (size_t i = 0; i < op.entry_count; ++i) {
    op.value[i] /= z[op.column[i]];
  }
  for (size_t j = 0; j < op.node_count; ++j) {
    op.own[j] = s[j] / z[j];
  }
  free(s);
  free(z);
  return op;
}

static inline void full_operator_free(full_operator *op) {
  free(op->row);
  free(op->column);
  free(op->value);
  free(op->own);
}

#endif
