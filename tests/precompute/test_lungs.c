/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the distinction of left and right lung, synthetic lungs, and volumes of displaced lungs. */

#include "precompute/lungs/phantom.h"
#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"
#include "tests/helpers/test.h"

#include "tests/helpers/lungs_helpers.h"

TEST(test_lungs_two_files_any_order_left_first) {
  for (int swap = 0; swap < 2; ++swap) {
    supine_mesh lumps[2] = {helper_lump(5, swap ? -80.0 : 90.0, 3),
                            helper_lump(6, swap ? 90.0 : -80.0, 4)};
    supine_lungs lungs = {0};
    assert_int_equal(supine_lungs_create(lumps, 2, NULL, &lungs, NULL), SUPINE_OK);
    assert_int_equal(lungs.lung_count, 2);
    assert_int_equal(lungs.lung_begin[1], lumps[swap].vertex_count);
    assert_int_equal(lungs.triangle_begin[1], lumps[swap].triangle_count);
    assert_close(lungs.midline, 0.5 * (lungs.minimum[0] + lungs.maximum[0]), 0.0);
    assert_string_equal(supine_lungs_name(&lungs, 0), "left");
    assert_string_equal(supine_lungs_name(&lungs, 1), "right");
    assert_true(lungs.topology.closed);
    for (size_t i = 0; i < lungs.mesh.vertex_count; ++i) {
      assert_true(i < lungs.lung_begin[1] ? lungs.mesh.vertices[3 * i] > 10.0
                                          : lungs.mesh.vertices[3 * i] < 0.0);
    }
    supine_lungs_free(&lungs);
    supine_mesh_free(&lumps[0]);
    supine_mesh_free(&lumps[1]);
  }
}

/* Vertices that alternate between two lungs are sorted by lung, the left lung first. */
TEST(test_lungs_interleaved_file_grouped) {
  supine_mesh lumps[2] = {helper_lump(4, -80.0, 3), helper_lump(4, 90.0, 4)};
  const size_t n = lumps[0].vertex_count;
  supine_mesh both = {2 * n, malloc(6 * n * sizeof(double)), 2 * lumps[0].triangle_count,
                      malloc(6 * lumps[0].triangle_count * sizeof(uint32_t))};
  for (size_t m = 0; m < 2; ++m) {
    for (size_t i = 0; i < n; ++i) {
      memcpy(both.vertices + 3 * (2 * i + m), lumps[m].vertices + 3 * i, 3 * sizeof(double));
    }
    for (size_t t = 0; t < lumps[m].triangle_count; ++t) {
      for (size_t k = 0; k < 3; ++k) {
        both.triangles[3 * (2 * t + m) + k] = (uint32_t)(2 * lumps[m].triangles[3 * t + k] + m);
      }
    }
  }
  supine_lungs lungs = {0};
  assert_int_equal(supine_lungs_create(&both, 1, NULL, &lungs, NULL), SUPINE_OK);
  assert_int_equal(lungs.lung_count, 2);
  assert_int_equal(lungs.lung_begin[1], n);
  assert_memory_equal(lungs.mesh.vertices, lumps[1].vertices, 3 * n * sizeof(double));
  assert_memory_equal(lungs.mesh.vertices + 3 * n, lumps[0].vertices, 3 * n * sizeof(double));
  assert_true(lungs.topology.closed);
  assert_close(supine_mesh_volume(&lungs.mesh), supine_mesh_volume(&both),
               1e-12 * supine_mesh_volume(&both));
  supine_lungs_free(&lungs);
  supine_mesh_free(&both);
  supine_mesh_free(&lumps[0]);
  supine_mesh_free(&lumps[1]);
}

TEST(test_lungs_single_lung_midline_at_inner_face) {
  static const double places[] = {90.0, -90.0};
  for (size_t m = 0; m < 2; ++m) {
    supine_mesh lump = helper_lump(5, places[m], 3);
    supine_lungs lungs = {0};
    assert_int_equal(supine_lungs_create(&lump, 1, NULL, &lungs, NULL), SUPINE_OK);
    assert_int_equal(lungs.lung_count, 1);
    assert_int_equal(lungs.side[0], m == 0 ? 1 : -1);
    assert_close(lungs.midline, m == 0 ? lungs.minimum[0] : lungs.maximum[0], 0.0);
    double box[3];
    for (size_t i = 0; i < lump.vertex_count; ++i) {
      supine_lungs_box_coordinates(&lungs, i, box);
      assert_close(box[0],
                   fabs(lump.vertices[3 * i] - lungs.midline) /
                       (lungs.maximum[0] - lungs.minimum[0]),
                   1e-14);
    }
    supine_lungs_free(&lungs);
    supine_mesh_free(&lump);
  }
}

/* The box coordinate X is 0 at the midline and 1 at the outermost point of either lung. */
TEST(test_lungs_box_either_lung_increases_outwards) {
  supine_mesh lumps[2] = {helper_lump(5, 90.0, 3), helper_lump(5, -80.0, 4)};
  supine_lungs lungs = {0};
  assert_int_equal(supine_lungs_create(lumps, 2, NULL, &lungs, NULL), SUPINE_OK);
  assert_int_equal(lungs.lung_count, 2);
  for (size_t i = 0; i < lungs.mesh.vertex_count; ++i) {
    const double outer = i < lungs.lung_begin[1] ? lungs.maximum[0] : lungs.minimum[0];
    double box[3];
    supine_lungs_box_coordinates(&lungs, i, box);
    assert_close(box[0], (lungs.mesh.vertices[3 * i] - lungs.midline) / (outer - lungs.midline),
                 1e-14);
  }
  supine_lungs_free(&lungs);
  supine_mesh_free(&lumps[0]);
  supine_mesh_free(&lumps[1]);
}

TEST(test_lungs_given_midline_decides_sides) {
  supine_mesh lump = helper_lump(5, 90.0, 3);
  supine_lungs lungs = {0};
  double midline = 300.0;
  assert_int_equal(supine_lungs_create(&lump, 1, &midline, &lungs, NULL), SUPINE_OK);
  assert_string_equal(supine_lungs_name(&lungs, 0), "right");
  supine_lungs_free(&lungs);
  midline = NAN;
  assert_int_equal(supine_lungs_create(&lump, 1, &midline, &lungs, NULL), SUPINE_ERROR_ARGUMENT);
  supine_mesh_free(&lump);
}

/* Reverse the orientation of every triangle from `first` on. */
static void turn_inwards(supine_mesh *mesh, size_t first) {
  for (size_t t = first; t < mesh->triangle_count; ++t) {
    const uint32_t corner = mesh->triangles[3 * t];
    mesh->triangles[3 * t] = mesh->triangles[3 * t + 1];
    mesh->triangles[3 * t + 1] = corner;
  }
}

TEST(test_lungs_inward_triangles_reversed_and_reported) {
  /* Bit 0 of `which` reverses the triangles of the left lung, bit 1 those of the right. */
  for (int which = 0; which < 4; ++which) {
    supine_mesh lumps[2] = {helper_lump(5, 90.0, 3), helper_lump(6, -80.0, 4)};
    const double volume = supine_mesh_volume(&lumps[0]) + supine_mesh_volume(&lumps[1]);
    for (int lung = 0; lung < 2; ++lung) {
      if ((which >> lung & 1) != 0) {
        turn_inwards(&lumps[lung], 0);
        assert_true(supine_mesh_volume(&lumps[lung]) < 0.0);
      }
    }
    supine_lungs lungs = {0};
    assert_int_equal(supine_lungs_create(lumps, 2, NULL, &lungs, NULL), SUPINE_OK);
    assert_close(supine_mesh_volume(&lungs.mesh), volume, 1e-12 * volume);
    assert_int_equal(lungs.reversed[0], which & 1);
    assert_int_equal(lungs.reversed[1], which >> 1);
    supine_lungs_free(&lungs);
    supine_mesh_free(&lumps[0]);
    supine_mesh_free(&lumps[1]);
  }
}

static void expect_refused(const supine_mesh *meshes, size_t count, const double *midline,
                           const char *words) {
  supine_lungs lungs = {0};
  supine_error error = {0};
  assert_int_equal(supine_lungs_create(meshes, count, midline, &lungs, &error), SUPINE_ERROR_MESH);
  assert_says(error.message, words);
  assert_null(lungs.mesh.vertices);
}

TEST(test_lungs_same_lung_twice_refused) {
  supine_mesh lumps[3] = {helper_lump(20, 90.0, 3), helper_lump(6, -80.0, 4),
                          helper_lump(20, 90.0, 3)};
  expect_refused(lumps, 3, NULL,
                 "surfaces 1 and 3 have the same bounding box: give each lung once");
  supine_mesh_free(&lumps[2]);
  lumps[2] = helper_lump(30, 90.0, 3);
  expect_refused(lumps, 3, NULL,
                 "surfaces 1 and 3 have the same bounding box: give each lung once");
  for (size_t m = 0; m < 3; ++m) {
    supine_mesh_free(&lumps[m]);
  }
}

TEST(test_lungs_small_piece_beside_lung_refused) {
  supine_mesh lump = helper_lump(6, 90.0, 3);
  double vertices[] = {-81.3, 12.0, 33.1, -80.1, 12.6, 34.0, -79.9, 13.5, 33.3};
  uint32_t triangles[] = {0, 1, 2};
  supine_mesh meshes[2] = {{3, vertices, 1, triangles}, lump};
  expect_refused(meshes, 2, NULL, "surface 1 is 1.5 mm long beside");
  meshes[1] = meshes[0];
  meshes[0] = lump;
  expect_refused(meshes, 2, NULL, "surface 2 is 1.5 mm long beside");
  supine_mesh_free(&lump);
}

TEST(test_lungs_midline_out_of_place_refused) {
  supine_mesh lumps[2] = {helper_lump(5, 90.0, 3), helper_lump(6, -80.0, 4)};
  double midline = 400.0;
  expect_refused(lumps, 2, &midline, "x = 400 mm leaves both lungs on its right side");
  midline = -400.0;
  expect_refused(lumps, 2, &midline, "x = -400 mm leaves both lungs on its left side");
  midline = 80.0;
  expect_refused(lumps, 2, &midline, "x = 80 mm runs through the left lung");
  midline = 95.0;
  expect_refused(lumps, 1, &midline, "runs through the right lung");
  midline = 20.0; /* a midline 20 mm from the middle is accepted */
  supine_lungs lungs = {0};
  assert_int_equal(supine_lungs_create(lumps, 2, &midline, &lungs, NULL), SUPINE_OK);
  assert_int_equal(lungs.lung_count, 2);
  supine_lungs_free(&lungs);
  supine_mesh_free(&lumps[0]);
  supine_mesh_free(&lumps[1]);
}

TEST(test_lungs_debris_not_taken_for_lung) {
  supine_mesh meshes[2] = {helper_lump(12, 90.0, 3), helper_lump(2, 20.0, 4)};
  supine_lungs lungs = {0};
  assert_int_equal(supine_lungs_create(meshes, 2, NULL, &lungs, NULL), SUPINE_OK);
  assert_int_equal(lungs.lung_count, 1);
  supine_lungs_free(&lungs);
  supine_mesh_free(&meshes[0]);
  supine_mesh_free(&meshes[1]);
}

TEST(test_lungs_flat_or_empty_surface_refused) {
  double vertices[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  uint32_t triangles[] = {0, 1, 2};
  const supine_mesh flat = {3, vertices, 1, triangles};
  const supine_mesh empty = {0};
  supine_lungs lungs = {0};
  supine_error error;
  assert_int_equal(supine_lungs_create(&flat, 1, NULL, &lungs, &error), SUPINE_ERROR_MESH);
  assert_says(error.message, "along z");
  assert_int_equal(supine_lungs_create(&empty, 1, NULL, &lungs, &error), SUPINE_ERROR_MESH);
}

TEST(test_phantom_pair_closed_with_given_volume) {
  static const size_t sizes[] = {84, 1000, 5000, 30000};
  for (size_t s = 0; s < sizeof sizes / sizeof *sizes; ++s) {
    supine_mesh mesh = {0};
    supine_lungs lungs = {0};
    assert_int_equal(supine_phantom_create(sizes[s], 2500.0, &mesh, NULL), SUPINE_OK);
    assert_in_range(mesh.vertex_count, sizes[s] - sizes[s] / 5, sizes[s] + sizes[s] / 5);
    assert_close(supine_mesh_volume(&mesh), 2.5e6, 1e-6);
    assert_int_equal(supine_lungs_create(&mesh, 1, NULL, &lungs, NULL), SUPINE_OK);
    assert_true(lungs.topology.closed);
    assert_int_equal(lungs.topology.component_count, 2);
    assert_int_equal(lungs.topology.genus, 0);
    assert_int_equal(lungs.lung_count, 2);
    assert_int_equal(lungs.lung_begin[1], mesh.vertex_count / 2);
    supine_lungs_free(&lungs);
    supine_mesh_free(&mesh);
  }
  supine_mesh mesh = {0};
  assert_int_equal(supine_phantom_create(10, 2500.0, &mesh, NULL), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_phantom_create(1000, 0.0, &mesh, NULL), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_phantom_create(1000, NAN, &mesh, NULL), SUPINE_ERROR_ARGUMENT);
}

/* The expected sums over vertices were computed with NumPy from the coefficients. They depend on
 * all coefficients of the shape. */
TEST(test_phantom_create_fixed_size_shape_as_computed_apart) {
  static const double made[2] = {-763.870223, 414.035588};
  supine_mesh mesh = {0};
  assert_int_equal(supine_phantom_create(1000, 6000.0, &mesh, NULL), SUPINE_OK);
  const size_t half = mesh.vertex_count / 2;
  for (size_t lung = 0; lung < 2; ++lung) {
    double sum = 0.0;
    for (size_t v = lung * half; v < (lung + 1) * half; ++v) {
      for (size_t a = 0; a < 3; ++a) {
        sum += sin((double)(v + 1) * (double)(a + 1)) * mesh.vertices[3 * v + a];
      }
    }
    /* Every coefficient of the shape affects `sum` by at least 0.02 mm, 200 times this
     * tolerance. */
    assert_true(fabs(sum - made[lung]) < 1e-4);
  }
  supine_mesh_free(&mesh);
}

/* Return the volume that a lung gains when its surface is displaced, mL. */
static double gained(const supine_lungs *lungs, size_t lung, const double *d, const double *columns,
                     size_t count, const double *weights, const double gains[3]) {
  const size_t n = lungs->mesh.vertex_count;
  double *moved = malloc(3 * n * sizeof *moved);
  for (size_t i = 0; i < n; ++i) {
    double f = 0.0;
    for (size_t k = 0; k < count; ++k) {
      f += columns[i * count + k] * weights[k];
    }
    for (size_t k = 0; k < 3; ++k) {
      moved[3 * i + k] = lungs->mesh.vertices[3 * i + k] + gains[k] * f * d[3 * i + k];
    }
  }
  const size_t first = lungs->triangle_begin[lung];
  supine_mesh part = {n, lungs->mesh.vertices, lungs->triangle_begin[lung + 1] - first,
                      lungs->mesh.triangles + 3 * first};
  const double before = supine_mesh_volume(&part);
  part.vertices = moved;
  const double volume = 1e-3 * (supine_mesh_volume(&part) - before);
  free(moved);
  return volume;
}

TEST(test_volume_forms_any_scale_equal_measured_volume) {
  enum { COLUMNS = 5 };
  supine_mesh lumps[2] = {helper_lump(7, 90.0, 3), helper_lump(8, -85.0, 4)};
  supine_lungs lungs = {0};
  assert_int_equal(supine_lungs_create(lumps, 2, NULL, &lungs, NULL), SUPINE_OK);
  const size_t n = lungs.mesh.vertex_count;
  double *columns = malloc(n * COLUMNS * sizeof *columns);
  double *vectors = malloc(3 * n * COLUMNS * sizeof *vectors);
  double *d = malloc(3 * n * sizeof *d);
  uint64_t seed = 44;
  const supine_direction_law law = supine_physics_model(SUPINE_LAW_PAPER).direction;
  assert_int_equal(supine_physics_directions(&lungs, NULL, &law, d, NULL), SUPINE_OK);
  for (size_t i = 0; i < n * COLUMNS; ++i) {
    columns[i] = helper_random(&seed);
  }
  /* `columns` holds lengths along d; `vectors` holds the same displacements as xyz vectors. */
  for (size_t i = 0; i < 3 * n * COLUMNS; ++i) {
    vectors[i] = columns[i / (3 * COLUMNS) * COLUMNS + i % COLUMNS] * d[i / COLUMNS];
  }
  supine_volume_forms forms[2] = {{0}};
  const supine_rows scalar = {SUPINE_ROWS_SCALAR, d};
  const supine_rows vector = {.kind = SUPINE_ROWS_VECTOR};
  assert_int_equal(
      supine_physics_volume_forms_create(&lungs, NULL, &scalar, columns, COLUMNS, &forms[0], NULL),
      SUPINE_OK);
  assert_int_equal(
      supine_physics_volume_forms_create(&lungs, NULL, &vector, vectors, COLUMNS, &forms[1], NULL),
      SUPINE_OK);
  static const double weights[COLUMNS] = {0.7, -0.2, 0.9, 0.31, 0.11};
  static const double gains[3] = {2.0, -0.7, 1.3};
  static const double even[3] = {-1.3, -1.3, -1.3};
  double *amounts = malloc(n * sizeof *amounts);
  for (size_t which = 0; which < 2; ++which) {
    double cubic[3];
    double direct = 0.0;
    supine_physics_volume_forms_contract(&forms[which], weights, cubic);
    for (size_t lung = 0; lung < 2; ++lung) {
      supine_volume_form form;
      supine_physics_volume_forms_contract_lung(&forms[which], lung, weights, &form);
      assert_close(supine_volume_form_at(&form, gains),
                   gained(&lungs, lung, d, columns, COLUMNS, weights, gains), 1e-9 * 1e3);
      direct += gained(&lungs, lung, d, columns, COLUMNS, weights, even);
    }
    assert_close(even[0] * (cubic[0] + even[0] * (cubic[1] + even[0] * cubic[2])), direct,
                 1e-9 * 1e3);
  }
  for (size_t k = 0; k < COLUMNS; ++k) {
    supine_volume_form alone[2];
    double one[COLUMNS] = {0.0};
    one[k] = 1.0;
    for (size_t i = 0; i < n; ++i) {
      amounts[i] = columns[i * COLUMNS + k];
    }
    assert_int_equal(supine_physics_volume_of_field(&lungs, NULL, d, amounts, alone, NULL),
                     SUPINE_OK);
    for (size_t lung = 0; lung < 2; ++lung) {
      assert_close(supine_volume_form_at(&alone[lung], gains),
                   gained(&lungs, lung, d, columns, COLUMNS, one, gains), 1e-9 * 1e3);
    }
  }
  free(amounts);
  supine_physics_volume_forms_free(&forms[0]);
  supine_physics_volume_forms_free(&forms[1]);
  supine_lungs_free(&lungs);
  supine_mesh_free(&lumps[0]);
  supine_mesh_free(&lumps[1]);
  free(columns);
  free(vectors);
  free(d);
}
