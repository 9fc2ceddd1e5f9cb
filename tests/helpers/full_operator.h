/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The matrix I - A of [Santhanam2008] over all nodes (masses and springs), where A is the fraction
 * of the force on each node that passes to each neighbour. It is computed entry by entry from
 * equations (3) and (8), as an independent reference for the solver. */
#ifndef SUPINE_FULL_OPERATOR_H
#define SUPINE_FULL_OPERATOR_H

#include <math.h>
#include <stdlib.h>

#include <suitesparse/umfpack.h>

#include "mesh/mesh.h"

typedef struct full_operator {
  size_t node_count;  /* number of masses and springs; masses come first */
  size_t entry_count; /* number of nonzero entries of the matrix; its diagonal is zero */
  size_t *row, *column;
  double *value; /* [entries] fraction of the force on node `column` that passes to node `row` */
  double *own; /* [nodes] fraction of the force on each node that it keeps, and does not pass on */
} full_operator;

/* Compute A and the fractions that nodes keep from the stiffness e [masses] of each mass. Unlike
 * the solver, do not first scale e to a geometric mean of 1. */
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
      const double d =
          fmax(1.0, hypot(hypot(p[0] - middle[0], p[1] - middle[1]), p[2] - middle[2]));
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

/* Sparse LU factorisation, by UMFPACK, of I - A, where A is the transfer of force between nodes. */
typedef struct direct_solver {
  int *ap, *ai;
  double *ax, *right, *solution;
  void *numeric;
} direct_solver;

static inline direct_solver direct_solver_create(const full_operator *op) {
  const int nodes = (int)op->node_count;
  const int entries = (int)(op->entry_count + op->node_count);
  int *ti = malloc((size_t)entries * sizeof *ti);
  int *tj = malloc((size_t)entries * sizeof *tj);
  double *tx = malloc((size_t)entries * sizeof *tx);
  direct_solver d = {
      malloc(((size_t)nodes + 1) * sizeof(int)), malloc((size_t)entries * sizeof(int)),
      malloc((size_t)entries * sizeof(double)),  malloc((size_t)nodes * sizeof(double)),
      malloc((size_t)nodes * sizeof(double)),    NULL};
  for (size_t i = 0; i < op->entry_count; ++i) {
    ti[i] = (int)op->row[i];
    tj[i] = (int)op->column[i];
    tx[i] = -op->value[i];
  }
  for (size_t j = 0; j < op->node_count; ++j) {
    ti[op->entry_count + j] = tj[op->entry_count + j] = (int)j;
    tx[op->entry_count + j] = 1.0;
  }
  void *symbolic = NULL;
  if (umfpack_di_triplet_to_col(nodes, nodes, entries, ti, tj, tx, d.ap, d.ai, d.ax, NULL) != 0 ||
      umfpack_di_symbolic(nodes, nodes, d.ap, d.ai, d.ax, &symbolic, NULL, NULL) != 0 ||
      umfpack_di_numeric(d.ap, d.ai, d.ax, symbolic, &d.numeric, NULL, NULL) != 0) {
    abort();
  }
  umfpack_di_free_symbolic(&symbolic);
  free(ti);
  free(tj);
  free(tx);
  return d;
}

/* Apply the force `force` [masses], which spreads between neighbouring nodes. Compute the part
 * `catch_` [masses] that each mass keeps at equilibrium, when no more force is passed on. */
static inline void direct_solver_solve(direct_solver *d, const full_operator *op, size_t masses,
                                       const double *force, double *catch_) {
  for (size_t j = 0; j < op->node_count; ++j) {
    d->right[j] = j < masses ? force[j] : 0.0;
  }
  if (umfpack_di_solve(UMFPACK_A, d->ap, d->ai, d->ax, d->solution, d->right, d->numeric, NULL,
                       NULL) != 0) {
    abort();
  }
  for (size_t i = 0; i < masses; ++i) {
    catch_[i] = op->own[i] * d->solution[i];
  }
}

static inline void direct_solver_free(direct_solver *d) {
  umfpack_di_free_numeric(&d->numeric);
  free(d->ap);
  free(d->ai);
  free(d->ax);
  free(d->right);
  free(d->solution);
}

#endif
