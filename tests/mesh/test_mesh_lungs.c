/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that real lungs (tests/README.md) have known sizes, topology and volumes. */
#include "tests/helpers/mesh_samples.h"

/* Load a file of the test data; skip the test if the file is missing. */
static supine_mesh lung_load(const char *name, supine_mesh_report *report) {
  char path[512];
  (void)snprintf(path, sizeof path, "%s/%s", SUPINE_TEST_DATA, name);
  if (access(path, R_OK) != 0) {
    print_message("no test data in " SUPINE_TEST_DATA ": skipped\n");
    skip();
  }
  supine_mesh mesh = {0};
  supine_error error = {0};
  if (supine_mesh_load(path, NULL, &mesh, report, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return mesh;
}

static supine_topology topology_of(const supine_mesh *mesh) {
  supine_topology topology = {0};
  assert_int_equal(supine_mesh_topology_create(mesh, &topology), SUPINE_OK);
  return topology;
}

/* The lungs of examples/lungs are closed, without handles, and as large as they were before they
 * were simplified. */
TEST(test_load_example_lungs_known_counts_and_volumes) {
  static const struct {
    const char *path;
    size_t vertices;
    size_t triangles;
    double litres;
  } cases[] = {{SUPINE_EXAMPLE_LUNGS "/left.obj", 5000, 9996, 3.4308},
               {SUPINE_EXAMPLE_LUNGS "/right.obj", 5002, 10000, 4.1798}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    supine_mesh_report report = {0};
    supine_mesh mesh = {0};
    assert_int_equal(supine_mesh_load(cases[i].path, NULL, &mesh, &report, NULL), SUPINE_OK);
    supine_topology topology = topology_of(&mesh);
    assert_int_equal(mesh.vertex_count, cases[i].vertices);
    assert_int_equal(mesh.triangle_count, cases[i].triangles);
    assert_true(topology.closed);
    assert_int_equal(topology.component_count, 1);
    assert_int_equal(topology.genus, 0);
    assert_true(fabs(supine_mesh_volume(&mesh) * 1.0e-6 - cases[i].litres) <= 0.0002);
    assert_int_equal(report.axes, SUPINE_AXES_LPS);
    assert_int_equal(report.degenerate_faces, 0);
    supine_mesh_topology_free(&topology);
    supine_mesh_free(&mesh);
  }
}

TEST_FULL(test_load_real_lungs_known_counts_and_volumes) {
  static const struct {
    const char *name;
    size_t vertices;
    size_t triangles;
    long genus;
    double litres; /* volume, accurate to 0.05 litres */
  } cases[] = {
      {"lungs/chaste_left_5k.obj", 5001, 9998, 0, 3.4},
      {"lungs/chaste_right_5k.obj", 5001, 9998, 0, 4.2},
      {"lungs/chaste_left.ply", 20001, 39998, 0, 3.4},
      {"lungs/chaste_right.ply", 20001, 39998, 0, 4.2},
      {"covid/covid001_left.ply", 10001, 19998, 0, 1.5},
      {"covid/covid001_right.ply", 10001, 19998, 0, 1.8},
      {"covid/covid002_left.ply", 9999, 19998, 1, 2.2},
      {"covid/covid005_left.ply", 12000, 24000, 1, 2.2},
      {"covid/covid005_right.ply", 10000, 20000, 1, 2.7},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    supine_mesh_report report = {0};
    supine_mesh mesh = lung_load(cases[i].name, &report);
    supine_topology topology = topology_of(&mesh);
    assert_int_equal(mesh.vertex_count, cases[i].vertices);
    assert_int_equal(mesh.triangle_count, cases[i].triangles);
    assert_true(topology.closed);
    assert_int_equal(topology.component_count, 1);
    assert_int_equal(topology.genus, cases[i].genus);
    assert_true(fabs(supine_mesh_volume(&mesh) * 1.0e-6 - cases[i].litres) <= 0.05);
    assert_int_equal(report.axes, SUPINE_AXES_LPS);
    assert_int_equal(report.degenerate_faces, 0);
    supine_mesh_topology_free(&topology);
    supine_mesh_free(&mesh);
  }
}

TEST_FULL(test_load_real_stl_lungs_closed) {
  static const struct {
    const char *name;
    size_t vertices;
    size_t triangles;
  } cases[] = {{"lungs/chaste_lobe_upper_left.stl", 22300, 44596},
               {"covid/covid004_right_40k.stl", 40000, 79996}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    supine_mesh_report report = {0};
    supine_mesh mesh = lung_load(cases[i].name, &report);
    supine_topology topology = topology_of(&mesh);
    assert_int_equal(mesh.vertex_count, cases[i].vertices);
    assert_int_equal(mesh.triangle_count, cases[i].triangles);
    assert_true(topology.closed);
    assert_int_equal(topology.genus, 0);
    assert_true(supine_mesh_volume(&mesh) > 2.0e6);
    supine_mesh_topology_free(&topology);
    supine_mesh_free(&mesh);
  }
}

TEST_FULL(test_topology_damaged_real_lung_edges_counted) {
  supine_mesh mesh = lung_load("covid/covid005_left_DEFECT.ply", NULL);
  supine_topology topology = topology_of(&mesh);
  assert_int_equal(topology.boundary_edges, 2);
  assert_int_equal(topology.non_manifold_edges, 1);
  assert_int_equal(topology.inconsistent_edges, 0);
  assert_false(topology.closed);
  assert_int_equal(topology.genus, -1);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

/* An STL file repeats a vertex in every triangle that has it. Loading merges these copies. */
TEST(test_save_real_lung_as_stl_loads_same_surface) {
  supine_mesh mesh = {0};
  assert_int_equal(supine_mesh_load(SUPINE_EXAMPLE_LUNGS "/left.obj", NULL, &mesh, NULL, NULL),
                   SUPINE_OK);
  char path[256];
  const supine_mesh_save_options options = {.axes = SUPINE_AXES_RAS};
  assert_int_equal(supine_mesh_save(sample_path(state, "lung.stl", path), &mesh, &options, NULL),
                   SUPINE_OK);
  supine_mesh again = {0};
  assert_int_equal(supine_mesh_load(path, NULL, &again, NULL, NULL), SUPINE_OK);
  assert_int_equal(unlink(path), 0);
  assert_int_equal(again.vertex_count, mesh.vertex_count);
  assert_int_equal(again.triangle_count, mesh.triangle_count);
  /* The coordinates in the first file were float32, so a float32 file holds them exactly. */
  for (size_t c = 0; c < 3 * mesh.triangle_count; ++c) {
    assert_memory_equal(again.vertices + 3 * (size_t)again.triangles[c],
                        mesh.vertices + 3 * (size_t)mesh.triangles[c], 3 * sizeof(double));
  }
  supine_mesh_free(&again);
  supine_mesh_free(&mesh);
}

TEST_GROUP(sample_folder_create, sample_folder_remove)
