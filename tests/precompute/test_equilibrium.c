/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that the equilibrium solves its equations, and equals the iteration of [Santhanam2008]. */

#include "precompute/physics/equilibrium.h"
#include "precompute/physics/factorisation.h"
#include "precompute/physics/network.h"
#include "tests/helpers/test.h"
#include <gsl/gsl_linalg.h>

#include "tests/helpers/full_operator.h"
#include "tests/helpers/lungs_helpers.h"

/* An irregular surface with irregular stiffness and forces. */
typedef struct fixture {
  supine_mesh mesh;
  supine_topology topology;
  double *stiffness; /* [N] of the vertices; not normalised: the geometric mean is far from 1 */
  double *force;     /* [N, 3] three sets of forces on the N vertices, one in each column */
} fixture;

static int setup(void **state) {
  fixture *f = calloc(1, sizeof *f);
  uint64_t seed = 20081;
  f->mesh = helper_lump(4, 60.0, 77);
  assert_int_equal(supine_mesh_topology_create(&f->mesh, &f->topology), SUPINE_OK);
  f->stiffness = malloc(f->mesh.vertex_count * sizeof(double));
  f->force = malloc(3 * f->mesh.vertex_count * sizeof(double));
  for (size_t i = 0; i < f->mesh.vertex_count; ++i) {
    f->stiffness[i] = 0.2 + 7.0 * helper_random(&seed);
  }
  for (size_t i = 0; i < 3 * f->mesh.vertex_count; ++i) {
    f->force[i] = helper_random(&seed);
  }
  *state = f;
  return 0;
}

static int teardown(void **state) {
  fixture *f = *state;
  supine_mesh_topology_free(&f->topology);
  supine_mesh_free(&f->mesh);
  free(f->stiffness);
  free(f->force);
  free(f);
  return 0;
}

static supine_equilibrium *equilibrium_of(const supine_mesh *mesh, const supine_topology *topology,
                                          const double *stiffness) {
  supine_equilibrium *eq = NULL;
  assert_int_equal(supine_physics_equilibrium_create(mesh, topology, 0.0, NULL, &eq, NULL),
                   SUPINE_OK);
  assert_int_equal(supine_physics_equilibrium_set_stiffness(eq, stiffness, NULL), SUPINE_OK);
  return eq;
}

static double *solve_of(const fixture *f, const double *stiffness, size_t count) {
  supine_equilibrium *eq = equilibrium_of(&f->mesh, &f->topology, stiffness);
  double *out = malloc(count * f->mesh.vertex_count * sizeof *out);
  assert_int_equal(supine_physics_equilibrium_solve(eq, count, f->force, out, NULL), SUPINE_OK);
  supine_physics_equilibrium_destroy(eq);
  return out;
}

/* Return the stiffness divided by its geometric mean (malloc). */
static double *normalised(size_t count, const double *stiffness) {
  double *out = malloc(count * sizeof *out);
  double sum = 0.0;
  for (size_t i = 0; i < count; ++i) {
    sum += log(stiffness[i]);
  }
  for (size_t i = 0; i < count; ++i) {
    out[i] = stiffness[i] / exp(sum / (double)count);
  }
  return out;
}

/* Compute the final force on each spring from the final force on each mass, by (8) and (12)-(14) of
 * [Santhanam2008]. The caller frees the result. */
static double *spring_catch(const fixture *f, const double *masses) {
  const size_t edges = f->topology.edge_count;
  double *e = normalised(f->mesh.vertex_count, f->stiffness);
  double *springs = malloc(edges * sizeof *springs);
  for (size_t k = 0; k < edges; ++k) {
    const size_t i = f->topology.edges[2 * k];
    const size_t j = f->topology.edges[2 * k + 1];
    const double *p = f->mesh.vertices;
    const double d = fmax(1.0, 0.5 * hypot(hypot(p[3 * i] - p[3 * j], p[3 * i + 1] - p[3 * j + 1]),
                                           p[3 * i + 2] - p[3 * j + 2]));
    const double spring = 0.5 * (e[i] + e[j]);
    const double z = spring + (1.0 / e[i] + 1.0 / e[j]) / d;
    springs[k] = spring / z * spring / d * (e[i] * masses[i] + e[j] * masses[j]);
  }
  free(e);
  return springs;
}

TEST(test_solve_all_nodes_equals_dense_lu_solution) {
  const fixture *f = *state;
  const size_t n = f->mesh.vertex_count;
  double *e = normalised(n, f->stiffness);
  full_operator op = full_operator_create(&f->mesh, &f->topology, e);
  gsl_matrix *matrix = gsl_matrix_alloc(op.node_count, op.node_count);
  gsl_matrix_set_identity(matrix);
  for (size_t i = 0; i < op.entry_count; ++i) {
    gsl_matrix_set(matrix, op.row[i], op.column[i], -op.value[i]);
  }
  gsl_vector *b = gsl_vector_calloc(op.node_count);
  gsl_vector *x = gsl_vector_alloc(op.node_count);
  for (size_t i = 0; i < n; ++i) {
    gsl_vector_set(b, i, f->force[3 * i]);
  }
  gsl_permutation *p = gsl_permutation_alloc(op.node_count);
  int sign;
  gsl_linalg_LU_decomp(matrix, p, &sign);
  gsl_linalg_LU_solve(matrix, p, b, x);

  supine_equilibrium *eq = equilibrium_of(&f->mesh, &f->topology, f->stiffness);
  double *force = malloc(n * sizeof *force);
  double *masses = malloc(n * sizeof *masses);
  for (size_t i = 0; i < n; ++i) {
    force[i] = f->force[3 * i];
  }
  assert_int_equal(supine_physics_equilibrium_solve(eq, 1, force, masses, NULL), SUPINE_OK);
  double *springs = spring_catch(f, masses);
  for (size_t i = 0; i < op.node_count; ++i) {
    const double should = op.own[i] * gsl_vector_get(x, i);
    assert_close(i < n ? masses[i] : springs[i - n], should, 1e-12);
  }
  supine_physics_equilibrium_destroy(eq);
  full_operator_free(&op);
  gsl_matrix_free(matrix);
  gsl_vector_free(b);
  gsl_vector_free(x);
  gsl_permutation_free(p);
  free(e);
  free(force);
  free(masses);
  free(springs);
}

static void count_progress(void *context, size_t steps, double held) {
  double *last = context;
  assert_true(held <= last[1] + 1e-12);
  last[0] = (double)steps;
  last[1] = held;
}

TEST(test_pitcher_catcher_forces_of_both_signs_equals_solve) {
  const fixture *f = *state;
  const size_t n = f->mesh.vertex_count;
  supine_equilibrium *eq = equilibrium_of(&f->mesh, &f->topology, f->stiffness);
  double *force = malloc(n * sizeof *force);
  double *fast = malloc(n * sizeof *fast);
  double *slow = malloc(n * sizeof *slow);
  for (size_t i = 0; i < n; ++i) {
    force[i] = f->force[3 * i] - 0.4;
  }
  double last[2] = {0.0, INFINITY};
  assert_int_equal(supine_physics_equilibrium_solve(eq, 1, force, fast, NULL), SUPINE_OK);
  assert_int_equal(supine_physics_pitcher_catcher(&f->mesh, &f->topology, f->stiffness, force,
                                                  1e-13, slow, count_progress, last, NULL),
                   SUPINE_OK);
  assert_true(last[0] > (double)n);
  assert_true(helper_difference(n, fast, slow) <= 1e-9 * helper_largest(n, fast));
  supine_physics_equilibrium_destroy(eq);
  free(force);
  free(fast);
  free(slow);
}

/* Entry T[i, j] of the transfer matrix is the force that ends up on vertex i for a unit force on
 * vertex j. It is not negative, and T[i, j] E[i]^2 = T[j, i] E[j]^2 for the stiffness E of the
 * vertices. */
TEST(test_transfer_column_two_vertices_reciprocal) {
  const fixture *f = *state;
  const size_t n = f->mesh.vertex_count;
  const size_t first = f->topology.edges[20];
  const size_t second = f->topology.edges[21];
  supine_equilibrium *eq = equilibrium_of(&f->mesh, &f->topology, f->stiffness);
  double *a = malloc(n * sizeof *a);
  double *b = malloc(n * sizeof *b);
  assert_int_equal(supine_physics_transfer_column(eq, first, a, NULL), SUPINE_OK);
  assert_int_equal(supine_physics_transfer_column(eq, second, b, NULL), SUPINE_OK);
  const double ratio = f->stiffness[first] / f->stiffness[second];
  assert_true(a[second] > 0.0);
  assert_close(a[second] / (ratio * ratio), b[first], 1e-12 * b[first]);
  for (size_t i = 0; i < n; ++i) {
    assert_true(a[i] > -1e-15);
  }
  supine_error error;
  assert_int_equal(supine_physics_transfer_column(eq, n, a, &error), SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "162");
  supine_physics_equilibrium_destroy(eq);
  free(a);
  free(b);
}

/* The product of the matrix and a vector, solved for, is the vector again, also in place and for
 * two parts of the mesh without edges between them. The elements of the matrix are irregular. */
TEST(test_factorisation_solve_of_product_returns_vector) {
  static const double area = 0.3;
  const supine_mesh lumps[2] = {helper_lump(3, 60.0, 7), helper_lump(4, -60.0, 8)};
  supine_lungs lungs = {0};
  supine_factorisation *factorisation = NULL;
  uint64_t seed = 99;
  assert_int_equal(supine_lungs_create(lumps, 2, NULL, &lungs, NULL), SUPINE_OK);
  const size_t n = lungs.mesh.vertex_count;
  const size_t edges = lungs.topology.edge_count;
  double *diagonal = malloc(n * sizeof *diagonal);
  double *coupling = malloc(edges * sizeof *coupling);
  double *vector = malloc(n * sizeof *vector);
  double *product = malloc(n * sizeof *product);
  double *expected = calloc(n, sizeof *expected);
  for (size_t i = 0; i < n; ++i) {
    diagonal[i] = area + helper_random(&seed);
    vector[i] = helper_random(&seed) - 0.4;
  }
  for (size_t e = 0; e < edges; ++e) {
    coupling[e] = 0.1 + helper_random(&seed);
    diagonal[lungs.topology.edges[2 * e]] += coupling[e];
    diagonal[lungs.topology.edges[2 * e + 1]] += coupling[e];
  }
  for (size_t i = 0; i < n; ++i) {
    expected[i] = diagonal[i] * vector[i];
  }
  for (size_t e = 0; e < edges; ++e) {
    const uint32_t *edge = lungs.topology.edges + 2 * e;
    expected[edge[0]] -= coupling[e] * vector[edge[1]];
    expected[edge[1]] -= coupling[e] * vector[edge[0]];
  }
  assert_int_equal(supine_physics_factorisation_create(&lungs.topology, n, &factorisation, NULL),
                   SUPINE_OK);
  supine_physics_factorisation_set(factorisation, diagonal, coupling);
  supine_physics_factorisation_multiply(factorisation, vector, product);
  assert_true(helper_difference(n, product, expected) < 1e-13 * helper_largest(n, expected));
  assert_int_equal(supine_physics_factorisation_solve(factorisation, 1, product, product, NULL),
                   SUPINE_OK);
  assert_true(helper_difference(n, product, vector) < 1e-12);
  supine_physics_factorisation_destroy(factorisation);
  supine_lungs_free(&lungs);
  free(diagonal);
  free(coupling);
  free(vector);
  free(product);
  free(expected);
}

TEST(test_transfer_column_all_vertices_superpose_to_solution) {
  const fixture *f = *state;
  const size_t n = f->mesh.vertex_count;
  supine_equilibrium *eq = equilibrium_of(&f->mesh, &f->topology, f->stiffness);
  double *column = malloc(n * sizeof *column);
  double *sum = calloc(n, sizeof *sum);
  double *whole = solve_of(f, f->stiffness, 3);
  /* The columns of the transfer matrix, each times the force on its vertex, sum to the solution. */
  for (size_t j = 0; j < n; ++j) {
    assert_int_equal(supine_physics_transfer_column(eq, j, column, NULL), SUPINE_OK);
    for (size_t i = 0; i < n; ++i) {
      sum[i] += column[i] * f->force[3 * j + 1];
    }
  }
  for (size_t i = 0; i < n; ++i) {
    assert_close(sum[i], whole[3 * i + 1], 1e-12);
  }
  supine_physics_equilibrium_destroy(eq);
  free(column);
  free(sum);
  free(whole);
}

/* For a large surface, each solve factorises the matrix again. A second solve gives the same bits,
 * even if it stores the solution in the array of the force. */
TEST(test_solve_large_surface_in_place_same_bits) {
  supine_mesh mesh = helper_lump(101, 60.0, 5);
  const size_t n = mesh.vertex_count;
  assert_true(n > 100000);
  supine_topology topology = {0};
  supine_equilibrium *eq = NULL;
  assert_int_equal(supine_mesh_topology_create(&mesh, &topology), SUPINE_OK);
  assert_int_equal(supine_physics_equilibrium_create(&mesh, &topology, 10.0, NULL, &eq, NULL),
                   SUPINE_OK);
  double *force = malloc(n * sizeof *force);
  double *out = malloc(n * sizeof *out);
  double *again = malloc(n * sizeof *again);
  for (size_t i = 0; i < n; ++i) {
    force[i] = mesh.vertices[3 * i + 1];
  }
  assert_int_equal(supine_physics_equilibrium_solve(eq, 1, force, out, NULL), SUPINE_OK);
  assert_int_equal(supine_physics_equilibrium_force(eq, out, again, NULL), SUPINE_OK);
  assert_true(helper_difference(n, force, again) < 1e-11 * helper_largest(n, force));
  assert_int_equal(supine_physics_equilibrium_solve(eq, 1, force, force, NULL), SUPINE_OK);
  assert_memory_equal(force, out, n * sizeof *out);
  supine_physics_equilibrium_destroy(eq);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
  free(force);
  free(again);
  free(out);
}

TEST(test_set_stiffness_bad_value_names_vertex) {
  const fixture *f = *state;
  static const double bad[] = {0.0, -1.0, NAN, INFINITY};
  const double good = f->stiffness[42];
  supine_equilibrium *eq = equilibrium_of(&f->mesh, &f->topology, NULL);
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    supine_error error;
    f->stiffness[42] = bad[i];
    assert_int_equal(supine_physics_equilibrium_set_stiffness(eq, f->stiffness, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, "vertex 42 ");
  }
  f->stiffness[42] = good;
  supine_physics_equilibrium_destroy(eq);
}

TEST(test_solve_force_not_finite_numerical_error) {
  const fixture *f = *state;
  supine_equilibrium *eq = equilibrium_of(&f->mesh, &f->topology, f->stiffness);
  double *out = malloc(2 * f->mesh.vertex_count * sizeof *out);
  double *force = calloc(2 * f->mesh.vertex_count, sizeof *force);
  supine_error error;
  for (size_t column = 0; column < 2; ++column) {
    force[6 + column] = NAN;
    assert_int_equal(supine_physics_equilibrium_solve(eq, 2, force, out, &error),
                     SUPINE_ERROR_NUMERICAL);
    assert_says(error.message, "residual");
    force[6 + column] = 0.0;
  }
  assert_int_equal(supine_physics_equilibrium_solve(eq, 2, force, out, &error), SUPINE_OK);
  assert_close(helper_largest(2 * f->mesh.vertex_count, out), 0.0, 0.0);
  supine_physics_equilibrium_destroy(eq);
  free(out);
  free(force);
}

/* Compare the solution for two real lungs with a direct solution of the original equations, whose
 * unsymmetric matrix has a row for each mass and each spring. */
static void check_real_lungs(const char *const *names, supine_axes axes) {
  supine_lungs lungs = {0};
  if (!helper_real_lungs(names, 2, axes, &lungs)) {
    skip();
    return;
  }
  const size_t n = lungs.mesh.vertex_count;
  double *stiffness = malloc(n * sizeof *stiffness);
  double *force = malloc(n * sizeof *force);
  double *fast = malloc(n * sizeof *fast);
  double *x = malloc(n * sizeof *x);
  for (size_t i = 0; i < n; ++i) {
    stiffness[i] =
        exp(sin(0.05 * lungs.mesh.vertices[3 * i]) + 0.02 * lungs.mesh.vertices[3 * i + 2]);
    force[i] = lungs.mesh.vertices[3 * i + 1] - lungs.minimum[1];
  }
  double *e = normalised(n, stiffness);
  full_operator op = full_operator_create(&lungs.mesh, &lungs.topology, e);
  direct_solver direct = direct_solver_create(&op);
  direct_solver_solve(&direct, &op, n, force, x);
  direct_solver_free(&direct);

  supine_equilibrium *eq = equilibrium_of(&lungs.mesh, &lungs.topology, stiffness);
  assert_int_equal(supine_physics_equilibrium_solve(eq, 1, force, fast, NULL), SUPINE_OK);
  const double difference = helper_difference(n, x, fast) / helper_largest(n, x);
  printf("%s: %zu vertices, relative difference from the direct solution %.1e\n", names[0], n,
         difference);
  assert_true(difference <= 1e-10);
  supine_physics_equilibrium_destroy(eq);
  supine_lungs_free(&lungs);
  full_operator_free(&op);
  free(stiffness);
  free(force);
  free(fast);
  free(e);
  free(x);
}

TEST(test_solve_real_adult_equals_direct_solution) {
  static const char *const names[] = {"left.obj", "right.obj"};
  check_real_lungs(names, SUPINE_AXES_AUTO);
}

TEST_FULL(test_solve_real_ras_lungs_equal_direct_solution) {
  static const char *const names[] = {"covid/covid001_left.ply", "covid/covid001_right.ply"};
  check_real_lungs(names, SUPINE_AXES_RAS);
}

TEST_GROUP(setup, teardown)
