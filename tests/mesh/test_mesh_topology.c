/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the edges, components, genus and defects of known surfaces. */
#include "tests/helpers/mesh_samples.h"

static supine_topology topology_of(const supine_mesh *mesh) {
  supine_topology topology = {0};
  assert_int_equal(supine_mesh_topology_create(mesh, &topology), SUPINE_OK);
  return topology;
}

/* Assert the properties of a closed surface; free the surface. */
static void expect_closed(supine_mesh mesh, size_t vertices, size_t edges, size_t triangles,
                          size_t components, long genus) {
  supine_topology topology = topology_of(&mesh);
  assert_int_equal(mesh.vertex_count, vertices);
  assert_int_equal(topology.edge_count, edges);
  assert_int_equal(mesh.triangle_count, triangles);
  assert_int_equal(topology.boundary_edges, 0);
  assert_int_equal(topology.non_manifold_edges, 0);
  assert_int_equal(topology.inconsistent_edges, 0);
  assert_int_equal(topology.component_count, components);
  assert_int_equal(topology.euler_characteristic, (long)vertices - (long)edges + (long)triangles);
  assert_int_equal(topology.genus, genus);
  assert_true(topology.closed);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

/* Make a torus: join opposite sides of a grid of `around` x `across` vertices. */
static supine_mesh make_torus(uint32_t around, uint32_t across) {
  supine_mesh mesh = {.vertex_count = (size_t)around * across,
                      .triangle_count = (size_t)2 * around * across};
  mesh.vertices = calloc(3 * mesh.vertex_count, sizeof *mesh.vertices);
  mesh.triangles = malloc(3 * mesh.triangle_count * sizeof *mesh.triangles);
  assert_non_null(mesh.vertices);
  assert_non_null(mesh.triangles);
  uint32_t *corner = mesh.triangles;
  for (uint32_t i = 0; i < around; ++i) {
    for (uint32_t j = 0; j < across; ++j) {
      const uint32_t a = i * across + j;
      const uint32_t b = (i + 1) % around * across + j;
      const uint32_t c = (i + 1) % around * across + (j + 1) % across;
      const uint32_t d = i * across + (j + 1) % across;
      const uint32_t two[6] = {a, b, c, a, c, d};
      memcpy(corner, two, sizeof two);
      corner += 6;
    }
  }
  return mesh;
}

TEST(test_topology_closed_surfaces_known_numbers) {
  expect_closed(sample_tetrahedron(), 4, 6, 4, 1, 0);
  expect_closed(sample_box(), 8, 18, 12, 1, 0);
  expect_closed(make_torus(7, 5), 35, 105, 70, 1, 1);
  expect_closed(make_torus(64, 48), 3072, 9216, 6144, 1, 1);
}

TEST(test_topology_edges_sorted_and_complete) {
  supine_mesh mesh = make_torus(9, 11);
  supine_topology topology = topology_of(&mesh);
  for (size_t e = 0; e < topology.edge_count; ++e) {
    const uint32_t *edge = topology.edges + 2 * e;
    assert_true(edge[0] < edge[1]);
    assert_true(edge[1] < mesh.vertex_count);
    assert_true(e == 0 || edge[0] > edge[-2] || (edge[0] == edge[-2] && edge[1] > edge[-1]));
  }
  static const uint32_t tetrahedron[] = {0, 1, 0, 2, 0, 3, 1, 2, 1, 3, 2, 3};
  supine_mesh small = sample_tetrahedron();
  supine_topology of_small = topology_of(&small);
  assert_memory_equal(of_small.edges, tetrahedron, sizeof tetrahedron);
  supine_mesh_topology_free(&of_small);
  supine_mesh_free(&small);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

TEST(test_topology_open_sheet_boundary_counted) {
  static const double vertices[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  static const uint32_t triangles[] = {0, 1, 2, 0, 2, 3};
  supine_mesh mesh = sample_make(4, vertices, 2, triangles);
  supine_topology topology = topology_of(&mesh);
  assert_int_equal(topology.edge_count, 5);
  assert_int_equal(topology.boundary_edges, 4);
  assert_int_equal(topology.euler_characteristic, 1);
  assert_int_equal(topology.genus, -1);
  assert_false(topology.closed);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

TEST(test_topology_two_tetrahedra_components_in_order) {
  /* Even vertices form one tetrahedron, odd ones the other. Positions do not matter. */
  static const double vertices[24] = {0};
  static const uint32_t triangles[] = {1, 5, 3, 1, 3, 7, 1, 7, 5, 3, 5, 7,
                                       0, 4, 2, 0, 2, 6, 0, 6, 4, 2, 4, 6};
  static const uint32_t expected[] = {0, 1, 0, 1, 0, 1, 0, 1};
  supine_mesh mesh = sample_make(8, vertices, 8, triangles);
  supine_topology topology = topology_of(&mesh);
  assert_int_equal(topology.component_count, 2);
  assert_memory_equal(topology.component, expected, sizeof expected);
  assert_int_equal(topology.euler_characteristic, 4);
  assert_int_equal(topology.genus, 0);
  assert_true(topology.closed);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

TEST(test_topology_components_joined_late_count_as_one) {
  /* Three separate triangles, joined by two more. Positions do not matter. */
  static const double vertices[27] = {0};
  static const uint32_t triangles[] = {8, 7, 6, 5, 4, 3, 2, 1, 0, 6, 5, 7, 3, 2, 4};
  supine_mesh mesh = sample_make(9, vertices, 5, triangles);
  supine_topology topology = topology_of(&mesh);
  assert_int_equal(topology.component_count, 1);
  for (size_t i = 0; i < 9; ++i) {
    assert_int_equal(topology.component[i], 0);
  }
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

/* If two points of a sphere become one vertex, V - E + F = 1, and the genus is undefined. */
TEST(test_topology_pinched_in_a_vertex_no_genus) {
  static const double vertices[21] = {0};
  static const uint32_t triangles[] = {0, 2, 1, 0, 3, 2, 0, 1, 3, 1, 2, 5, 1, 5, 4, 2, 3, 6,
                                       2, 6, 5, 3, 1, 4, 3, 4, 6, 0, 4, 5, 0, 5, 6, 0, 6, 4};
  supine_mesh mesh = sample_make(7, vertices, 12, triangles);
  supine_topology topology = topology_of(&mesh);
  assert_true(topology.closed);
  assert_int_equal(topology.component_count, 1);
  assert_int_equal(topology.euler_characteristic, 1);
  assert_int_equal(topology.genus, -1);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

TEST(test_topology_fan_on_one_edge_non_manifold) {
  static const double vertices[15] = {0};
  static const uint32_t triangles[] = {0, 1, 2, 1, 0, 3, 0, 1, 4};
  supine_mesh mesh = sample_make(5, vertices, 3, triangles);
  supine_topology topology = topology_of(&mesh);
  assert_int_equal(topology.edge_count, 7);
  assert_int_equal(topology.non_manifold_edges, 1);
  assert_int_equal(topology.boundary_edges, 6);
  assert_int_equal(topology.inconsistent_edges, 0);
  assert_false(topology.closed);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

TEST(test_topology_flipped_triangle_inconsistent) {
  supine_mesh mesh = sample_box();
  const uint32_t swap = mesh.triangles[0];
  mesh.triangles[0] = mesh.triangles[1];
  mesh.triangles[1] = swap;
  supine_topology topology = topology_of(&mesh);
  assert_int_equal(topology.inconsistent_edges, 3);
  assert_int_equal(topology.boundary_edges, 0);
  assert_int_equal(topology.non_manifold_edges, 0);
  assert_int_equal(topology.euler_characteristic, 2);
  assert_int_equal(topology.genus, -1);
  assert_false(topology.closed);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

TEST(test_topology_hub_of_many_edges_sorted) {
  /* A fan of triangles around vertex 0. Indices of its rim vertices advance by 331, modulo RIM. */
  enum { RIM = 997 };
  static double vertices[3 * (RIM + 1)];
  static uint32_t triangles[3 * RIM];
  for (uint32_t i = 0; i < RIM; ++i) {
    triangles[3 * i] = 0;
    triangles[3 * i + 1] = 1 + i * 331 % RIM;
    triangles[3 * i + 2] = 1 + (i + 1) * 331 % RIM;
  }
  supine_mesh mesh = sample_make(RIM + 1, vertices, RIM, triangles);
  supine_topology topology = topology_of(&mesh);
  assert_int_equal(topology.edge_count, 2 * RIM);
  assert_int_equal(topology.boundary_edges, RIM);
  assert_int_equal(topology.inconsistent_edges, 0);
  for (uint32_t i = 0; i < RIM; ++i) {
    assert_int_equal(topology.edges[2 * i], 0);
    assert_int_equal(topology.edges[2 * i + 1], i + 1);
  }
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

TEST(test_topology_touching_tetrahedra_no_genus) {
  /* Two tetrahedra with a common vertex: V - E + F = 7 - 12 + 8 = 3, impossible for one closed
   * surface. */
  static const double vertices[21] = {0};
  static const uint32_t triangles[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3,
                                       0, 5, 4, 0, 4, 6, 0, 6, 5, 4, 5, 6};
  supine_mesh mesh = sample_make(7, vertices, 8, triangles);
  supine_topology topology = topology_of(&mesh);
  assert_true(topology.closed);
  assert_int_equal(topology.component_count, 1);
  assert_int_equal(topology.euler_characteristic, 3);
  assert_int_equal(topology.genus, -1);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

TEST(test_topology_illegal_triangles_refused) {
  static const double vertices[9] = {0};
  static const uint32_t beyond[] = {0, 1, 3};
  static const uint32_t twice[] = {0, 1, 1};
  const uint32_t *const illegal[] = {beyond, twice};
  for (size_t i = 0; i < 2; ++i) {
    supine_mesh mesh = sample_make(3, vertices, 1, illegal[i]);
    supine_topology topology = {0};
    assert_int_equal(supine_mesh_topology_create(&mesh, &topology), SUPINE_ERROR_ARGUMENT);
    assert_null(topology.edges);
    assert_null(topology.component);
    supine_mesh_free(&mesh);
  }
}

TEST(test_topology_empty_mesh_not_closed) {
  const supine_mesh mesh = {0};
  supine_topology topology = topology_of(&mesh);
  assert_int_equal(topology.edge_count, 0);
  assert_int_equal(topology.component_count, 0);
  assert_false(topology.closed);
  supine_mesh_topology_free(&topology);
  supine_mesh_topology_free(&topology);
}
