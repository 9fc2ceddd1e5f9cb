/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that a reach, the distance in mm over which forces spread, acts alike in any mesh. */
#include "tests/helpers/test.h"

#include <gsl/gsl_linalg.h>

#include "precompute/physics/equilibrium.h"
#include "precompute/physics/model.h"
#include <supine/sh.h>

#include "tests/helpers/lungs_helpers.h"

/* Model of [Santhanam2008]. Each test sets its reach, the distance over which forces spread. */
static supine_model model;

/* Return the force that remains at each vertex in equilibrium, given the applied forces and the
 * stiffness of each vertex (malloc). */
static double *solve(const supine_lungs *lungs, const double *stiffness, const double *force) {
  const size_t n = lungs->mesh.vertex_count;
  supine_equilibrium *equilibrium = NULL;
  double *out = calloc(n + 1, sizeof *out);
  supine_error error = {0};
  assert_int_equal(supine_physics_model_equilibrium(lungs, &model, &equilibrium, NULL), SUPINE_OK);
  assert_int_equal(supine_physics_equilibrium_set_stiffness(equilibrium, stiffness, NULL),
                   SUPINE_OK);
  if (supine_physics_equilibrium_solve(equilibrium, 1, force, out, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  supine_physics_equilibrium_destroy(equilibrium);
  return out;
}

static supine_lungs lungs_of(supine_mesh mesh, double reach) {
  supine_lungs lungs = {0};
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, &lungs, NULL), SUPINE_OK);
  supine_mesh_free(&mesh);
  model = supine_physics_model(SUPINE_LAW_PAPER);
  model.reach = reach;
  return lungs;
}

static double *irregular(size_t count, double low, double span, uint64_t seed) {
  double *values = calloc(count, sizeof *values);
  for (size_t i = 0; i < count; ++i) {
    values[i] = low + span * helper_random(&seed);
  }
  return values;
}

static double triangle_area(const supine_mesh *mesh, size_t t) {
  double area[1000] = {0.0};
  const supine_mesh one = {mesh->vertex_count, mesh->vertices, 1, mesh->triangles + 3 * t};
  assert_true(mesh->vertex_count <= 1000);
  supine_mesh_vertex_area(&one, area);
  return 3.0 * area[one.triangles[0]];
}

static double square_distance(const supine_mesh *mesh, size_t i, size_t j) {
  double sum = 0.0;
  for (size_t x = 0; x < 3; ++x) {
    sum += pow(mesh->vertices[3 * i + x] - mesh->vertices[3 * j + x], 2.0);
  }
  return sum;
}

/* The solution equals the one found with a dense matrix, which describes how force flows between
 * nodes. A node is a mass (vertex) or a spring (edge). The weights of the links between nodes are
 * those of smoothing.h. */
TEST(test_reach_solution_equals_dense_solution) {
  const double reach = 30.0;
  supine_lungs lungs = lungs_of(helper_lump(4, 60.0, 77), reach);
  const supine_mesh *mesh = &lungs.mesh;
  const size_t n = mesh->vertex_count;
  const size_t nodes = n + lungs.topology.edge_count;
  double *e = irregular(n, 0.5, 2.0, 3); /* does not change the forces */
  double *force = irregular(n, 0.0, 1.0, 4);
  double *area = calloc(n + 1, sizeof *area);
  double mean = 0.0;
  supine_mesh_vertex_area(mesh, area);
  for (size_t i = 0; i < n; ++i) {
    mean += area[i] / (double)n;
  }
  gsl_matrix *link_weight = gsl_matrix_calloc(nodes, nodes);
  double *s = calloc(nodes, sizeof *s);
  for (size_t i = 0; i < n; ++i) {
    s[i] = 1.0;
    gsl_matrix_set(link_weight, i, i, area[i] / mean);
  }
  for (size_t k = 0; k < lungs.topology.edge_count; ++k) {
    const uint32_t *edge = lungs.topology.edges + 2 * k;
    const double h2 = square_distance(mesh, edge[0], edge[1]);
    double cotangents = 0.0;
    for (size_t t = 0; t < mesh->triangle_count; ++t) {
      const uint32_t *corner = mesh->triangles + 3 * t;
      size_t common = 0;
      double squares = 0.0;
      for (size_t c = 0; c < 3; ++c) {
        common += corner[c] == edge[0] || corner[c] == edge[1];
        squares += square_distance(mesh, corner[c], corner[(c + 1) % 3]);
      }
      /* law of cosines for the angle opposite the edge */
      cotangents += common == 2 ? (squares - 2.0 * h2) / (4.0 * triangle_area(mesh, t)) : 0.0;
    }
    s[n + k] = 1.0;
    for (size_t c = 0; c < 2; ++c) {
      const double w = reach * reach / mean * cotangents;
      gsl_matrix_set(link_weight, edge[c], n + k, w);
      gsl_matrix_set(link_weight, n + k, edge[c], w);
    }
  }
  /* Fill in I - A. A[i, j] = s_i w_ij / z_j is the share of the force at node j that goes to node
   * i. w_ij is the weight of the link between i and j, s_i is the weight of node i, and z_j is the
   * sum of s_l w_lj over all nodes l. */
  gsl_matrix *matrix = gsl_matrix_alloc(nodes, nodes);
  gsl_vector *b = gsl_vector_calloc(nodes);
  gsl_vector *x = gsl_vector_alloc(nodes);
  double *z = calloc(nodes, sizeof *z);
  for (size_t j = 0; j < nodes; ++j) {
    for (size_t l = 0; l < nodes; ++l) {
      z[j] += s[l] * gsl_matrix_get(link_weight, l, j);
    }
    for (size_t i = 0; i < nodes; ++i) {
      gsl_matrix_set(matrix, i, j, i == j ? 1.0 : -s[i] * gsl_matrix_get(link_weight, i, j) / z[j]);
    }
  }
  for (size_t i = 0; i < n; ++i) {
    gsl_vector_set(b, i, area[i] / mean * force[i]);
  }
  gsl_permutation *p = gsl_permutation_alloc(nodes);
  int sign;
  gsl_linalg_LU_decomp(matrix, p, &sign);
  gsl_linalg_LU_solve(matrix, p, b, x);
  double *found = solve(&lungs, e, force);
  const double largest = helper_largest(n, found);
  double balance = 0.0;
  double given = 0.0;
  for (size_t i = 0; i < n; ++i) {
    const double own = area[i] / mean;
    /* Of x_i, all force that reaches mass i, this remains there; the rest goes on to springs. */
    const double expected = s[i] * own / z[i] * gsl_vector_get(x, i);
    assert_true(fabs(own * found[i] - expected) < 1e-10 * largest);
    balance += own * found[i];
    given += own * force[i];
  }
  assert_true(fabs(balance - given) < 1e-10 * given);
  gsl_permutation_free(p);
  gsl_matrix_free(matrix);
  gsl_matrix_free(link_weight);
  gsl_vector_free(b);
  gsl_vector_free(x);
  free(e);
  free(force);
  free(area);
  free(s);
  free(z);
  free(found);
  supine_lungs_free(&lungs);
}

TEST(test_reach_constant_force_gives_constant_catch) {
  supine_lungs lungs = lungs_of(helper_lump(12, 60.0, 5), 25.0);
  double *force = irregular(lungs.mesh.vertex_count, 0.7, 0.0, 1);
  double *found = solve(&lungs, NULL, force);
  for (size_t i = 0; i < lungs.mesh.vertex_count; ++i) {
    assert_true(fabs(found[i] - 0.7) < 1e-12);
  }
  free(force);
  free(found);
  supine_lungs_free(&lungs);
}

/* Make a sphere of radius 100 mm about the origin, whose vertices are shifted within the surface by
 * up to about `irregularity` times the length of an edge. */
static supine_mesh sphere(size_t frequency, double irregularity) {
  supine_mesh mesh = {.vertex_count = supine_phantom_geodesic_vertex_count(frequency),
                      .triangle_count = supine_phantom_geodesic_triangle_count(frequency)};
  uint64_t seed = 99;
  mesh.vertices = calloc(3 * mesh.vertex_count, sizeof *mesh.vertices);
  mesh.triangles = calloc(3 * mesh.triangle_count, sizeof *mesh.triangles);
  supine_phantom_geodesic(frequency, 0, mesh.vertices, mesh.triangles);
  for (size_t i = 0; i < mesh.vertex_count; ++i) {
    double *p = mesh.vertices + 3 * i;
    for (size_t k = 0; k < 3; ++k) {
      p[k] += irregularity * (2.0 * helper_random(&seed) - 1.0) / (double)frequency;
    }
    const double radius = hypot(hypot(p[0], p[1]), p[2]);
    for (size_t k = 0; k < 3; ++k) {
      p[k] *= 100.0 / radius;
    }
  }
  return mesh;
}

/* Return the relative error with which a solve damps the harmonic Y_lm on a sphere of radius r. R
 * is the reach. The exact solution of (1 - R^2 Laplacian) F = Y_lm is
 *
 *     F = Y_lm / (1 + l (l + 1) R^2 / r^2) */
static double harmonic_error(size_t frequency, double irregularity, double reach, size_t l, int m) {
  supine_lungs lungs = lungs_of(sphere(frequency, irregularity), reach);
  const size_t n = lungs.mesh.vertex_count;
  double *force = calloc(n, sizeof *force);
  double y[49];
  for (size_t i = 0; i < n; ++i) {
    assert_int_equal(supine_sh_evaluate(6, lungs.mesh.vertices + 3 * i, y), SUPINE_OK);
    force[i] = y[supine_sh_index(l, m)];
  }
  double *found = solve(&lungs, NULL, force);
  const double ratio = reach / 100.0;
  const double damping = 1.0 + (double)(l * (l + 1)) * ratio * ratio;
  double error = 0.0;
  double norm = 0.0;
  for (size_t i = 0; i < n; ++i) {
    error += (found[i] - force[i] / damping) * (found[i] - force[i] / damping);
    norm += force[i] * (1.0 - 1.0 / damping) * (force[i] * (1.0 - 1.0 / damping));
  }
  free(force);
  free(found);
  supine_lungs_free(&lungs);
  return sqrt(error / norm);
}

TEST(test_reach_sphere_damps_harmonics_as_laplacian) {
  static const double reaches[] = {10.0, 25.0, 60.0};
  for (size_t r = 0; r < 3; ++r) {
    for (size_t l = 1; l <= 5; ++l) {
      const int m = l % 2 == 0 ? (int)l : 1 - (int)l;
      const double coarse = harmonic_error(8, 0.0, reaches[r], l, m);
      const double fine = harmonic_error(24, 0.0, reaches[r], l, m);
      const double rough = harmonic_error(24, 0.15, reaches[r], l, m);
      printf("reach %2.0f mm, l = %zu: error %.2e with 642 vertices, %.2e with 5762, %.2e if "
             "irregular\n",
             reaches[r], l, coarse, fine, rough);
      /* Some error remains even on a fine mesh, as the springs of a vertex are not isotropic. */
      assert_true(coarse < 0.1);
      assert_true(fine < 0.1);
      assert_true(rough < 0.15);
    }
  }
}

/* Return the area-weighted RMS distance over which a unit force spreads on a sphere, mm. */
static double spread(size_t frequency, double reach) {
  supine_lungs lungs = lungs_of(sphere(frequency, 0.1), reach);
  const size_t n = lungs.mesh.vertex_count;
  double *force = calloc(n, sizeof *force);
  double *area = calloc(n, sizeof *area);
  force[7] = 1.0;
  double *found = solve(&lungs, NULL, force);
  supine_mesh_vertex_area(&lungs.mesh, area);
  double sum = 0.0;
  double square = 0.0;
  for (size_t i = 0; i < n; ++i) {
    double dot = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      dot += lungs.mesh.vertices[3 * i + k] * lungs.mesh.vertices[21 + k];
    }
    const double arc = 100.0 * acos(fmax(-1.0, fmin(1.0, dot / 1e4)));
    sum += area[i] * found[i];
    square += area[i] * found[i] * arc * arc;
  }
  free(force);
  free(area);
  free(found);
  supine_lungs_free(&lungs);
  return sqrt(square / sum);
}

/* In any mesh, a point force spreads over an RMS distance of twice the reach. The response to it in
 * a plane is the Bessel function K_0(distance / reach), which has this RMS radius. */
TEST(test_reach_finer_mesh_spreads_same_distance) {
  double with[3];
  double without[3];
  static const size_t frequencies[] = {12, 24, 48};
  for (size_t f = 0; f < 3; ++f) {
    with[f] = spread(frequencies[f], 12.0);
    without[f] = spread(frequencies[f], 0.0);
    printf("%zu vertices: a unit force spreads %.2f mm with a reach of 12 mm, %.2f mm without\n",
           supine_phantom_geodesic_vertex_count(frequencies[f]), with[f], without[f]);
    assert_true(fabs(with[f] - 24.0) < 0.1 * 24.0);
  }
  assert_true(fabs(with[2] / with[0] - 1.0) < 0.05);
  assert_true(without[2] < 0.6 * without[0]);
}

/* Return displacements [n, 3] of tissue of stiffness e, if uniform tissue stretches by 1 % along x
 * and moves by 3 mm along y (malloc). */
static double *stretched(const supine_lungs *lungs, const double *e, const double *lesions) {
  supine_strain *strain = NULL;
  double *u = calloc(3 * lungs->mesh.vertex_count, sizeof *u);
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    u[3 * i] = 0.01 * lungs->mesh.vertices[3 * i];
    u[3 * i + 1] = 3.0;
  }
  assert_int_equal(supine_physics_strain_create(lungs, e, lesions, &strain, NULL), SUPINE_OK);
  assert_int_equal(supine_physics_strain_apply(strain, NULL, 3, u, NULL), SUPINE_OK);
  supine_physics_strain_destroy(strain);
  return u;
}

/* Tissue that is twice as expandable stretches twice as much, and the rest moves with it. */
TEST(test_strain_half_twice_expandable_stretches_twice_as_much) {
  supine_lungs lungs = lungs_of(sphere(24, 0.1), 10.0);
  const size_t n = lungs.mesh.vertex_count;
  double *e = irregular(n, 1.0, 0.0, 1);
  for (size_t i = 0; i < n; ++i) {
    e[i] = lungs.mesh.vertices[3 * i] > 0.0 ? 0.5 : 1.0;
  }
  double *u = stretched(&lungs, e, NULL);
  double stretch[2] = {0.0, 0.0};
  double sum[2] = {0.0, 0.0};
  for (size_t k = 0; k < lungs.topology.edge_count; ++k) {
    const uint32_t *edge = lungs.topology.edges + 2 * k;
    const double *p = lungs.mesh.vertices;
    const double along = p[3 * edge[0]] - p[3 * edge[1]];
    const double moved = u[3 * edge[0]] - u[3 * edge[1]];
    if (fabs(p[3 * edge[0]]) > 20.0) {
      stretch[p[3 * edge[0]] > 0.0] += moved * along;
      sum[p[3 * edge[0]] > 0.0] += 0.01 * along * along;
    }
    assert_true(fabs(moved) < 0.02 * fabs(along) + 0.1);
    assert_true(fabs(u[3 * edge[0] + 1] - 3.0) < 1e-9);
  }
  printf("expandability 2 beside 1: stretch over that of uniform tissue %.3f and %.3f\n",
         stretch[1] / sum[1], stretch[0] / sum[0]);
  assert_true(fabs(stretch[1] / sum[1] - M_SQRT2) < 0.03);
  assert_true(fabs(stretch[0] / sum[0] - M_SQRT1_2) < 0.03);
  free(e);
  free(u);
  supine_lungs_free(&lungs);
}

TEST(test_strain_uniform_tissue_unchanged_lesion_strains_less) {
  supine_lungs lungs = lungs_of(sphere(24, 0.1), 10.0);
  const size_t n = lungs.mesh.vertex_count;
  double *lesions = irregular(n, 1.0, 0.0, 1);
  double *even = stretched(&lungs, lesions, NULL);
  for (size_t i = 0; i < n; ++i) {
    lesions[i] = lungs.mesh.vertices[3 * i + 1] > 70.0 ? 3.0 : 1.0;
    assert_true(fabs(even[3 * i] - 0.01 * lungs.mesh.vertices[3 * i]) < 1e-9);
  }
  double *u = stretched(&lungs, NULL, lesions);
  double squares[2] = {0.0, 0.0};
  double largest = 0.0;
  for (size_t i = 0; i < n; ++i) {
    const double y = lungs.mesh.vertices[3 * i + 1];
    squares[0] += y > 80.0 ? even[3 * i] * even[3 * i] : 0.0;
    squares[1] += y > 80.0 ? u[3 * i] * u[3 * i] : 0.0;
    largest = fmax(largest, fabs(u[3 * i] - even[3 * i]));
  }
  printf("in a lesion 3 times as stiff: %.3f of the stretch of uniform tissue; at most %.3f mm\n",
         sqrt(squares[1] / squares[0]), largest);
  assert_true(sqrt(squares[1] / squares[0]) < 0.75);
  assert_true(largest < 0.5); /* the whole sphere stretches by 2 mm */
  free(lesions);
  free(even);
  free(u);
  supine_lungs_free(&lungs);
}
