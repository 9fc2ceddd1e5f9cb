/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Conjugate gradients (Hestenes and Stiefel 1952) on the system of equilibrium.h. */
#include <math.h>
#include <stdlib.h>

#include "precompute/physics/network.h"

#include "plain_solve.h"

enum { STEPS_MAX = 5000 };

struct plain_solve {
  const supine_lungs *lungs;
  const supine_model *model;
  supine_network *network;
  double *force, *stiffness;                                        /* [N], file's order */
  double *give, *mass, *diagonal, *right, *t, *direction, *product; /* [N] */
  double *c;                                                        /* [2 E] */
};

plain_solve *plain_solve_create(const supine_lungs *lungs, const supine_model *model) {
  plain_solve *made = calloc(1, sizeof *made);
  if (made == NULL || supine_physics_model_network(lungs, model, &made->network) != SUPINE_OK) {
    free(made);
    return NULL;
  }
  const size_t n = lungs->mesh.vertex_count;
  double **const vectors[] = {&made->force, &made->stiffness, &made->give,
                              &made->mass,  &made->diagonal,  &made->right,
                              &made->t,     &made->direction, &made->product};
  made->lungs = lungs;
  made->model = model;
  made->c = malloc((made->network->links.begin[n] + 1) * sizeof *made->c);
  bool whole = made->c != NULL;
  for (size_t i = 0; i < sizeof vectors / sizeof *vectors; ++i) {
    *vectors[i] = malloc(n * sizeof(double));
    whole = whole && *vectors[i] != NULL;
  }
  if (!whole) {
    plain_solve_destroy(made);
    return NULL;
  }
  return made;
}

void plain_solve_destroy(plain_solve *solve) {
  if (solve != NULL) {
    supine_physics_network_destroy(solve->network);
    free(solve->force);
    free(solve->stiffness);
    free(solve->give);
    free(solve->mass);
    free(solve->diagonal);
    free(solve->right);
    free(solve->t);
    free(solve->direction);
    free(solve->product);
    free(solve->c);
    free(solve);
  }
}

/* Masses, links and the diagonal of the system. */
static void set_up(plain_solve *s, const double g[3]) {
  const supine_network *net = s->network;
  const size_t n = net->vertex_count;
  double minimum;
  double maximum;
  (void)supine_physics_height_range(s->lungs, s->model->force.pair, 1, g, &minimum, &maximum);
  supine_physics_force(s->lungs, &s->model->force, g, minimum, maximum, s->force);
  supine_physics_force_stiffness(s->lungs, &s->model->force, s->model->stiffness, g, minimum,
                                 maximum, s->stiffness);
  (void)supine_physics_stiffness_normalise(n, s->stiffness, s->stiffness, NULL);
  for (size_t i = 0; i < n; ++i) {
    s->give[i] = 1.0 / s->stiffness[net->order[i]];
  }
  for (size_t i = 0; i < n; ++i) {
    const double area = net->area == NULL ? 1.0 : net->area[i];
    double links = 0.0;
    s->mass[i] = area * s->give[i] * s->give[i];
    for (size_t k = net->links.begin[i]; k < net->links.begin[i + 1]; ++k) {
      const double other = s->give[net->links.column[k]];
      const double d = net->distance[k];
      const double product = s->give[i] * other;
      s->c[k] = net->area != NULL ? net->conductance[k] : product / (d * (d + 2.0 * product));
      s->mass[i] +=
          net->area != NULL ? 0.0 : (s->give[i] + other) / (2.0 * other * (d + 2.0 * product));
      links += s->c[k];
    }
    s->diagonal[i] = s->mass[i] + links;
  }
}

static double image(const plain_solve *s, const double *from, double *to) {
  const supine_rows *links = &s->network->links;
  double sum = 0.0;
  for (size_t i = 0; i < links->count; ++i) {
    double out = s->mass[i] * from[i];
    for (size_t k = links->begin[i]; k < links->begin[i + 1]; ++k) {
      out += s->c[k] * (from[i] - from[links->column[k]]);
    }
    to[i] = out;
    sum += from[i] * out;
  }
  return sum;
}

size_t plain_solve_run(plain_solve *solve, const double g[3], double tolerance, bool warm,
                       double *catch_) {
  plain_solve *s = solve;
  const supine_network *net = s->network;
  const size_t n = net->vertex_count;
  double whole = 0.0;
  double rz = 0.0;
  set_up(s, g);
  for (size_t i = 0; i < n; ++i) {
    s->t[i] = warm ? catch_[net->order[i]] / (s->give[i] * s->give[i]) : 0.0;
  }
  (void)image(s, s->t, s->product);
  for (size_t i = 0; i < n; ++i) {
    const double b = (net->area == NULL ? 1.0 : net->area[i]) * s->force[net->order[i]];
    s->right[i] = b - s->product[i];
    s->direction[i] = s->right[i] / s->diagonal[i];
    whole += b * b / s->diagonal[i];
    rz += s->right[i] * s->direction[i];
  }
  size_t step = 0;
  for (; step < STEPS_MAX && rz > tolerance * tolerance * whole; ++step) {
    const double alpha = rz / image(s, s->direction, s->product);
    const double last = rz;
    rz = 0.0;
    for (size_t i = 0; i < n; ++i) {
      s->t[i] += alpha * s->direction[i];
      s->right[i] -= alpha * s->product[i];
      rz += s->right[i] * s->right[i] / s->diagonal[i];
    }
    for (size_t i = 0; i < n; ++i) {
      s->direction[i] = s->right[i] / s->diagonal[i] + rz / last * s->direction[i];
    }
  }
  for (size_t i = 0; i < n; ++i) {
    catch_[net->order[i]] = s->give[i] * s->give[i] * s->t[i];
  }
  return step;
}
