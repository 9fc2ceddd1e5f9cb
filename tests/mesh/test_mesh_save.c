/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that a saved file gives the same mesh when loaded, that it holds displacements and expected
 * errors, and that no incomplete file is left. */
#include <fcntl.h>
#include <float.h>
#include <sys/stat.h>

#include "tests/helpers/mesh_samples.h"

static const char *const endings[] = {"a.ply", "a.obj", "a.stl", "a.VTP"};

/* Make a box with coordinates that are not exact in float32. */
static supine_mesh make_crooked(void) {
  supine_mesh mesh = sample_box();
  for (size_t i = 0; i < 3 * mesh.vertex_count; ++i) {
    mesh.vertices[i] += 0.1 * sin(12.9898 * (double)(i + 1));
  }
  return mesh;
}

static void save(const char *path, const supine_mesh *mesh,
                 const supine_mesh_save_options *options) {
  supine_error error = {0};
  if (supine_mesh_save(path, mesh, options, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
}

/* Return the vertex nearest to `position`, and set `distance` to the largest difference in x, y or
 * z between both. Loaded vertices have another order, so tests compare positions. */
static size_t nearest(const supine_mesh *mesh, const double position[3], double *distance) {
  size_t found = 0;
  *distance = INFINITY;
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    const double *vertex = mesh->vertices + 3 * i;
    const double d = fmax(fmax(fabs(vertex[0] - position[0]), fabs(vertex[1] - position[1])),
                          fabs(vertex[2] - position[2]));
    if (d < *distance) {
      *distance = d;
      found = i;
    }
  }
  return found;
}

static void expect_same(const supine_mesh *found, const supine_mesh *expected, double tolerance) {
  assert_int_equal(found->vertex_count, expected->vertex_count);
  assert_int_equal(found->triangle_count, expected->triangle_count);
  for (size_t c = 0; c < 3 * expected->triangle_count; ++c) {
    double distance = 0.0;
    const size_t corner =
        nearest(found, expected->vertices + 3 * (size_t)expected->triangles[c], &distance);
    assert_int_equal(found->triangles[c], corner);
    assert_true(distance <= tolerance);
  }
}

TEST(test_save_load_round_trip_each_format_and_axes) {
  static const supine_axes all_axes[] = {SUPINE_AXES_AUTO, SUPINE_AXES_LPS, SUPINE_AXES_RAS};
  supine_mesh mesh = make_crooked();
  for (size_t k = 0; k < 4; ++k) {
    for (size_t a = 0; a < 3; ++a) {
      char path[256];
      const supine_mesh_save_options options = {
          .axes = all_axes[a], .from = mesh.vertices, .comment = "solid element vertex 9\nRAS"};
      save(sample_path(state, endings[k], path), &mesh, &options);
      supine_mesh again = {0};
      supine_mesh_report report = {0};
      supine_error error = {0};
      if (supine_mesh_load(path, NULL, &again, &report, &error) != SUPINE_OK) {
        fail_msg("%s", error.message);
      }
      /* PLY: float32; OBJ: rounded text; STL: float32; VTP: float32 */
      static const double tolerance[] = {64.0 * FLT_EPSILON, 512.0 * FLT_EPSILON,
                                         64.0 * FLT_EPSILON, 64.0 * FLT_EPSILON};
      expect_same(&again, &mesh, tolerance[k]);
      assert_true(report.axes_from_tag);
      assert_int_equal(report.axes,
                       all_axes[a] == SUPINE_AXES_RAS ? SUPINE_AXES_RAS : SUPINE_AXES_LPS);
      supine_mesh_free(&again);
      assert_int_equal(unlink(path), 0);
    }
  }
  supine_mesh_free(&mesh);
}

TEST(test_save_ply_loads_in_same_order) {
  supine_mesh mesh = sample_box();
  char path[256];
  save(sample_path(state, "a.ply", path), &mesh, NULL);
  supine_mesh again = {0};
  assert_int_equal(supine_mesh_load(path, NULL, &again, NULL, NULL), SUPINE_OK);
  assert_memory_equal(again.vertices, mesh.vertices, 24 * sizeof *mesh.vertices);
  assert_memory_equal(again.triangles, mesh.triangles, 36 * sizeof *mesh.triangles);
  supine_mesh_free(&again);
  supine_mesh_free(&mesh);
  assert_int_equal(unlink(path), 0);
}

static float float_at(const unsigned char *bytes) {
  const uint32_t bits = (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 |
                        (uint32_t)bytes[3] << 24;
  float value = 0.0F;
  memcpy(&value, &bits, sizeof value);
  return value;
}

static const char *find(const unsigned char *bytes, size_t size, const char *text) {
  const char *found = memmem(bytes, size, text, strlen(text));
  if (found == NULL) {
    fail_msg("no \"%s\" in the file", text);
  }
  return found + strlen(text);
}

/* Vertex 2 is displaced by (3, 4, 12) mm, 13 mm in length. In RAS axes, this is (-3, -4, 12). */
TEST(test_save_ply_displacement_in_each_row) {
  supine_mesh mesh = sample_tetrahedron();
  double rest[12];
  memcpy(rest, mesh.vertices, sizeof rest);
  rest[6] -= 3.0;
  rest[7] -= 4.0;
  rest[8] -= 12.0;
  for (int ras = 0; ras < 2; ++ras) {
    const supine_mesh_save_options options = {.axes = ras ? SUPINE_AXES_RAS : SUPINE_AXES_LPS,
                                              .from = rest};
    char path[256];
    save(sample_path(state, "a.ply", path), &mesh, &options);
    size_t size = 0;
    unsigned char *bytes = test_read(path, &size);
    (void)find(bytes, size, "property float displacement_x\n");
    const unsigned char *rows = (const unsigned char *)find(bytes, size, "end_header\n");
    const float s = ras ? -1.0F : 1.0F;
    const float expected[14] = {s * 120.0F, 0.0F,       0.0F, 0.0F,     0.0F,     0.0F,  0.0F,
                                0.0F,       s * 120.0F, 0.0F, s * 3.0F, s * 4.0F, 12.0F, 13.0F};
    for (size_t i = 0; i < 14; ++i) {
      assert_true(float_at(rows + 28 + 4 * i) == expected[i]);
    }
    assert_int_equal(rows + 4 * 28 + 4 * 13 - bytes, size);
    free(bytes);
    assert_int_equal(unlink(path), 0);
  }
  supine_mesh_free(&mesh);
}

/* The expected error is in mm even in a file in cm, and is the last value of each row. */
TEST(test_save_expected_error_stays_in_millimetres) {
  static const float errors[4] = {1.5F, 2.5F, 3.5F, 4.5F};
  supine_mesh mesh = sample_tetrahedron();
  for (int moved = 0; moved < 2; ++moved) {
    const size_t row = moved ? 32 : 16;
    const supine_mesh_save_options options = {.from = moved ? mesh.vertices : NULL,
                                              .millimetres_per_unit = 10.0,
                                              .scalars = {{"expected_error_mm", errors}}};
    char path[256];
    size_t size = 0;
    save(sample_path(state, "a.ply", path), &mesh, &options);
    unsigned char *bytes = test_read(path, &size);
    (void)find(bytes, size, "property float expected_error_mm\n");
    const unsigned char *rows = (const unsigned char *)find(bytes, size, "end_header\n");
    for (size_t i = 0; i < 4; ++i) {
      assert_true(float_at(rows + row * (i + 1) - 4) == errors[i]);
    }
    free(bytes);
    assert_int_equal(unlink(path), 0);
    save(sample_path(state, "a.vtp", path), &mesh, &options);
    bytes = test_read(path, &size);
    (void)find(bytes, size, "Name=\"expected_error_mm\" NumberOfComponents=\"1\"");
    free(bytes);
    assert_int_equal(unlink(path), 0);
  }
  supine_mesh_free(&mesh);
}

TEST(test_save_stl_header_and_normals_literal) {
  supine_mesh mesh = sample_tetrahedron();
  const supine_mesh_save_options options = {
      .comment = "a comment that is far too long for the eighty bytes that a binary STL file has "
                 "for its header, so that it must be cut"};
  char path[256];
  save(sample_path(state, "a.stl", path), &mesh, &options);
  size_t size = 0;
  unsigned char *bytes = test_read(path, &size);
  assert_int_equal(size, 84 + 4 * 50);
  assert_memory_equal(bytes, "SPACE=LPS", 9);
  assert_int_equal(bytes[80], 4);
  static const double diagonal = 0.57735026918962576; /* 1 / sqrt(3) */
  const double normals[4][3] = {{0, 0, -1}, {0, -1, 0}, {-1, 0, 0}, {diagonal, diagonal, diagonal}};
  for (size_t t = 0; t < 4; ++t) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const double found = (double)float_at(bytes + 84 + 50 * t + 4 * axis);
      assert_true(fabs(found - normals[t][axis]) <= (double)FLT_EPSILON);
    }
  }
  free(bytes);
  supine_mesh_free(&mesh);
  assert_int_equal(unlink(path), 0);
}

static uint64_t size_at(const unsigned char *bytes) {
  uint64_t value = 0;
  for (unsigned k = 0; k < 8; ++k) {
    value |= (uint64_t)bytes[k] << (8 * k);
  }
  return value;
}

/* Copy an array; assert that it has `expected` bytes. Return the start of the next array. */
static const unsigned char *unpack(const unsigned char *at, unsigned char *array, size_t expected) {
  assert_int_equal(size_at(at), expected);
  memcpy(array, at + 8, expected);
  return at + 8 + expected;
}

TEST(test_save_vtp_arrays_and_header_as_documented) {
  supine_mesh mesh = sample_tetrahedron();
  double rest[12];
  memcpy(rest, mesh.vertices, sizeof rest);
  rest[9] -= 3.0;
  rest[10] += 4.0;
  const supine_mesh_save_options options = {.from = rest, .comment = "a -- b -\xC3\xA4-"};
  char path[256];
  save(sample_path(state, "a.vtp", path), &mesh, &options);
  size_t size = 0;
  unsigned char *bytes = test_read(path, &size);
  (void)find(bytes, size,
             "<!-- SPACE=LPS mm a - - b -?"
             "?-  -->\n");
  (void)find(bytes, size, "Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">76 80 83 0<");
  (void)find(bytes, size, "NumberOfPoints=\"4\"");
  (void)find(bytes, size, "NumberOfPolys=\"4\"");
  (void)find(bytes, size, "Name=\"displacement\" NumberOfComponents=\"3\"");
  (void)find(bytes, size, "Name=\"displacement_magnitude\" NumberOfComponents=\"1\"");
  const unsigned char *at =
      (const unsigned char *)find(bytes, size, "<AppendedData encoding=\"raw\">\n_");
  const unsigned char *begin = at;
  const size_t sizes[5] = {48, 48, 16, 48, 16};
  static unsigned char arrays[5][64];
  for (size_t i = 0; i < 5; ++i) {
    char offset[32];
    (void)snprintf(offset, sizeof offset, "offset=\"%zu\"", (size_t)(at - begin));
    (void)find(bytes, size, offset);
    at = unpack(at, arrays[i], sizes[i]);
  }
  assert_memory_equal(at, "\n</AppendedData>\n</VTKFile>\n", 28);
  assert_true(float_at(arrays[0] + 12) == 120.0F);
  assert_int_equal(arrays[1][4], 2);
  assert_int_equal(arrays[2][12], 12);
  assert_true(float_at(arrays[3] + 36) == 3.0F);
  assert_true(float_at(arrays[3] + 40) == -4.0F);
  assert_true(float_at(arrays[4] + 12) == 5.0F);
  free(bytes);
  supine_mesh_free(&mesh);
  assert_int_equal(unlink(path), 0);
}

/* A strip of triangles with more points than a 16-bit index holds. */
TEST(test_save_vtp_more_than_65536_points_loads_same) {
  enum { POINTS = 70001 };
  supine_mesh mesh = {.vertex_count = POINTS,
                      .vertices = malloc(3 * POINTS * sizeof(double)),
                      .triangle_count = POINTS - 2,
                      .triangles = malloc(3 * (POINTS - 2) * sizeof(uint32_t))};
  for (size_t i = 0; i < POINTS; ++i) {
    const double p[3] = {1e-3 * (double)i, i % 2 == 0 ? 0.0 : 1.0, sin(1e-4 * (double)i)};
    memcpy(mesh.vertices + 3 * i, p, sizeof p);
  }
  for (uint32_t t = 0; t < POINTS - 2; ++t) {
    const uint32_t corner[3] = {t, t + 1 + t % 2, t + 2 - t % 2};
    memcpy(mesh.triangles + 3 * (size_t)t, corner, sizeof corner);
  }
  char path[256];
  supine_mesh found = {0};
  save(sample_path(state, "a.vtp", path), &mesh, NULL);
  assert_int_equal(supine_mesh_load(path, NULL, &found, NULL, NULL), SUPINE_OK);
  assert_int_equal(found.vertex_count, POINTS);
  assert_int_equal(found.triangle_count, POINTS - 2);
  for (size_t c = 0; c < 3 * mesh.triangle_count; ++c) {
    for (size_t k = 0; k < 3; ++k) {
      const double expected = mesh.vertices[3 * (size_t)mesh.triangles[c] + k];
      assert_true(fabs(found.vertices[3 * (size_t)found.triangles[c] + k] - expected) < 1e-5);
    }
  }
  supine_mesh_free(&found);
  supine_mesh_free(&mesh);
  assert_int_equal(unlink(path), 0);
}

TEST_FULL(test_save_vtp_opens_in_vtk) {
  static const char check[] =
      "import sys, vtk\n"
      "r = vtk.vtkXMLPolyDataReader()\n"
      "r.SetFileName(sys.argv[1])\n"
      "r.Update()\n"
      "p = r.GetOutput()\n"
      "m = vtk.vtkMassProperties()\n"
      "m.SetInputData(p)\n"
      "d = p.GetPointData()\n"
      "ok = (p.GetNumberOfPoints(), p.GetNumberOfPolys()) == (8, 12)\n"
      "ok = ok and abs(m.GetVolume() - 1430000) < 1\n"
      "ok = ok and d.GetArray('displacement').GetTuple(5) == (1, 2, 2)\n"
      "ok = ok and d.GetArray('displacement_magnitude').GetTuple(5) == (3,)\n"
      "ok = ok and p.GetFieldData().GetAbstractArray('SPACE').GetValue(0) == 'LPS'\n"
      "sys.exit(0 if ok else 1)\n";
  char script[256];
  char path[256];
  if (system("/usr/bin/python3 -c 'import vtk' >/dev/null 2>&1") != 0) { /* NOLINT(cert-env33-c) */
    print_message("python3 has no vtk: skipped\n");
    skip();
  }
  supine_mesh mesh = sample_box();
  double rest[24];
  for (size_t i = 0; i < 24; ++i) {
    rest[i] = mesh.vertices[i] - (i % 3 == 0 ? 1.0 : 2.0);
  }
  const supine_mesh_save_options options = {.from = rest, .comment = "box & <tag> -- end"};
  save(sample_path(state, "a.vtp", path), &mesh, &options);
  (void)sample_text(state, "check.py", check, script);
  assert_int_equal(setenv("CHECK", script, 1), 0);
  assert_int_equal(setenv("WRITTEN", path, 1), 0);
  assert_int_equal(system("/usr/bin/python3 \"$CHECK\" \"$WRITTEN\""),
                   0); /* NOLINT(cert-env33-c) */
  supine_mesh_free(&mesh);
  assert_int_equal(unlink(script), 0);
  assert_int_equal(unlink(path), 0);
}

/* Double a coordinate; stop at the third frame. */
static supine_status next_frame(void *context, size_t frame, supine_error *error) {
  supine_mesh *mesh = context;
  mesh->vertices[4] *= 2.0;
  return frame < 2 ? SUPINE_OK : supine_error_set(error, SUPINE_ERROR_INTERRUPTED, "stopped");
}

/* Frames with an impossible path are refused. Frames that fail leave no file. Frames can be written
 * into a pipe. */
TEST(test_save_frames_impossible_or_failing_leaves_no_file) {
  static const double times[3] = {0.0, 0.5, 1.0};
  supine_mesh mesh = sample_tetrahedron();
  supine_mesh_frames frames = {2, times, next_frame, &mesh};
  supine_error error;
  char path[256];
  (void)sample_path(state, "a.vtp", path);
  assert_int_equal(supine_mesh_save_frames("/nowhere/a.vtp", &mesh, NULL, &frames, &error),
                   SUPINE_ERROR_WRITE);

  assert_int_equal(mkfifo(path, 0600), 0);
  /* Opening a FIFO for writing does not block if it has a reader. */
  const int reader = open(path, O_RDONLY | O_NONBLOCK);
  assert_true(reader >= 0);
  assert_int_equal(supine_mesh_save_frames(path, &mesh, NULL, &frames, &error), SUPINE_OK);
  char text[8192];
  const ssize_t size = read(reader, text, sizeof text);
  assert_true(size > 28 && size < (ssize_t)sizeof text);
  assert_memory_equal(text + size - 28, "\n</AppendedData>\n</VTKFile>\n", 28);
  assert_int_equal(close(reader), 0);
  assert_int_equal(unlink(path), 0);

  mesh.vertices[4] = 1e38; /* a float holds twice this, but not four times */
  assert_int_equal(supine_mesh_save_frames(path, &mesh, NULL, &frames, &error), SUPINE_ERROR_MESH);
  assert_says(error.message, "vertex 1");
  assert_int_equal(access(path, F_OK), -1);

  mesh.vertices[4] = 0.0;
  frames.count = 3;
  assert_int_equal(supine_mesh_save_frames(path, &mesh, NULL, &frames, &error),
                   SUPINE_ERROR_INTERRUPTED);
  assert_int_equal(access(path, F_OK), -1);

  frames.count = 1;
  assert_int_equal(supine_mesh_save_frames("/dev/full", &mesh, NULL, &frames, &error),
                   SUPINE_ERROR_WRITE);
  supine_mesh_free(&mesh);
}

TEST(test_save_vtp_axes_and_units_apply_to_all_arrays) {
  supine_mesh mesh = sample_tetrahedron();
  double rest[12];
  memcpy(rest, mesh.vertices, sizeof rest);
  rest[9] -= 3.0;
  static const float normals[12] = {1, 0, 0, 0, 0.6F, 0.8F, 0, 0, 1, 0, 0, -1};
  const supine_mesh_save_options options = {
      .axes = SUPINE_AXES_RAS, .millimetres_per_unit = 1000.0, .from = rest, .normals = normals};
  char path[256];
  save(sample_path(state, "a.vtp", path), &mesh, &options);
  size_t size = 0;
  unsigned char *bytes = test_read(path, &size);
  (void)find(bytes, size, ">82 65 83 0<");
  char units[64] = {0};
  for (const char *c = "m, mL, s"; *c != '\0'; ++c) {
    (void)snprintf(units + strlen(units), sizeof units - strlen(units), "%d ", *c);
  }
  (void)find(bytes, size, units);
  const unsigned char *at =
      (const unsigned char *)find(bytes, size, "<AppendedData encoding=\"raw\">\n_");
  static const size_t sizes[6] = {48, 48, 16, 48, 16, 48};
  static unsigned char arrays[6][64];
  for (size_t i = 0; i < 6; ++i) {
    at = unpack(at, arrays[i], sizes[i]);
  }
  for (size_t i = 0; i < 12; ++i) {
    const double sign = i % 3 == 2 ? 1.0 : -1.0;
    assert_close(float_at(arrays[0] + 4 * i), sign * mesh.vertices[i] / 1000.0, 1e-8);
    assert_true((double)float_at(arrays[5] + 4 * i) == sign * (double)normals[i]);
  }
  assert_close(float_at(arrays[3] + 36), -0.003, 1e-9);
  assert_close(float_at(arrays[4] + 12), 0.003, 1e-9);
  free(bytes);
  supine_mesh_free(&mesh);
  assert_int_equal(unlink(path), 0);
}

TEST(test_save_unknown_ending_refused) {
  static const char *const names[] = {"a.txt", "a", "a.ply.gz", "ply", ".ply/a"};
  supine_mesh mesh = sample_tetrahedron();
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    char path[256];
    supine_error error = {0};
    assert_int_equal(supine_mesh_save(sample_path(state, names[i], path), &mesh, NULL, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, ".vtp");
    assert_false(supine_mesh_save_supports(names[i]));
    assert_int_not_equal(access(path, F_OK), 0);
  }
  for (size_t i = 0; i < sizeof endings / sizeof *endings; ++i) {
    assert_true(supine_mesh_save_supports(endings[i]));
  }
  supine_mesh_free(&mesh);
}

TEST(test_save_vertex_not_finite_refused_without_file) {
  static const double bad[] = {(double)NAN, (double)INFINITY, -1.0e39};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    supine_mesh mesh = sample_tetrahedron();
    mesh.vertices[7] = bad[i];
    char path[256];
    supine_error error = {0};
    assert_int_equal(supine_mesh_save(sample_path(state, "a.ply", path), &mesh, NULL, &error),
                     SUPINE_ERROR_MESH);
    assert_says(error.message, "vertex 2");
    assert_int_not_equal(access(path, F_OK), 0);
    supine_mesh_free(&mesh);
  }
}

TEST(test_save_too_many_vertices_refused) {
  const supine_mesh mesh = {.vertex_count = (size_t)INT32_MAX + 1};
  char path[256];
  assert_int_equal(supine_mesh_save(sample_path(state, "a.ply", path), &mesh, NULL, NULL),
                   SUPINE_ERROR_ARGUMENT);
}

TEST(test_save_missing_folder_reports_write_error) {
  supine_mesh mesh = sample_tetrahedron();
  for (size_t i = 0; i < sizeof endings / sizeof *endings; ++i) {
    char name[64];
    char path[256];
    supine_error error = {0};
    (void)snprintf(name, sizeof name, "nowhere/%s", endings[i]);
    assert_int_equal(supine_mesh_save(sample_path(state, name, path), &mesh, NULL, &error),
                     SUPINE_ERROR_WRITE);
    assert_says(error.message, path);
  }
  supine_mesh_free(&mesh);
}

TEST(test_save_full_disk_reports_write_error) {
  supine_mesh mesh = sample_tetrahedron();
  for (size_t i = 0; i < sizeof endings / sizeof *endings; ++i) {
    char path[256];
    supine_error error = {0};
    assert_int_equal(symlink("/dev/full", sample_path(state, endings[i], path)), 0);
    assert_int_equal(supine_mesh_save(path, &mesh, NULL, &error), SUPINE_ERROR_WRITE);
    assert_says(error.message, "No space left");
    assert_int_equal(unlink(path), 0);
  }
  supine_mesh_free(&mesh);
}

TEST(test_save_failure_leaves_old_file) {
  supine_mesh mesh = sample_tetrahedron();
  char path[256];
  (void)sample_text(state, "a.ply", "precious", path);
  mesh.vertices[0] = (double)NAN;
  assert_int_equal(supine_mesh_save(path, &mesh, NULL, NULL), SUPINE_ERROR_MESH);
  size_t size = 0;
  unsigned char *bytes = test_read(path, &size);
  assert_int_equal(size, 8);
  assert_memory_equal(bytes, "precious", 8);
  free(bytes);
  mesh.vertices[0] = 0.0;
  assert_int_equal(supine_mesh_save(path, &mesh, NULL, NULL), SUPINE_OK);
  bytes = test_read(path, &size);
  assert_memory_equal(bytes, "ply\n", 4);
  free(bytes);
  supine_mesh_free(&mesh);
  assert_int_equal(unlink(path), 0);
}

TEST_GROUP(sample_folder_create, sample_folder_remove)
