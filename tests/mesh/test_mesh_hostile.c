/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Truncated, corrupt and hostile files are refused or read correctly. None causes a crash or
 * exhausts memory. */
#include <dirent.h>

#include "tests/helpers/mesh_samples.h"

/* Load a file and return the status. Assert a valid mesh, or an error with a message. */
static supine_status attempt(const char *path) {
  supine_mesh mesh = {0};
  supine_error error = {0};
  const supine_status status = supine_mesh_load(path, NULL, &mesh, NULL, &error);
  if (status == SUPINE_OK) {
    supine_topology topology = {0};
    assert_true(mesh.triangle_count > 0);
    assert_int_equal(supine_mesh_topology_create(&mesh, &topology), SUPINE_OK);
    supine_mesh_topology_free(&topology);
  } else {
    assert_true(status == SUPINE_ERROR_FORMAT || status == SUPINE_ERROR_MESH);
    assert_int_equal(error.status, status);
    assert_says(error.message, path);
    assert_null(strchr(error.message, '\n'));
    assert_null(mesh.vertices);
  }
  supine_mesh_free(&mesh);
  return status;
}

/* Write `text` to the file `name` and load it. Assert the status and the number of triangles. */
static void expect_text(void **state, const char *name, const char *text, supine_status expected,
                        size_t triangles) {
  char path[256];
  supine_mesh mesh = {0};
  supine_error error = {0};
  (void)sample_text(state, name, text, path);
  const supine_status status = supine_mesh_load(path, NULL, &mesh, NULL, &error);
  if (status != expected) {
    fail_msg("status %d for:\n%s\n%s", (int)status, text, error.message);
  }
  assert_int_equal(mesh.triangle_count, triangles);
  supine_mesh_free(&mesh);
  assert_int_equal(unlink(path), 0);
}

static void expect_bytes(void **state, const char *name, const void *bytes, size_t size,
                         supine_status expected) {
  char path[256];
  (void)sample_write(state, name, bytes, size, path);
  assert_int_equal(attempt(path), expected);
  assert_int_equal(unlink(path), 0);
}

/* Save a box as `name`, and return the bytes of the file (malloc). */
static unsigned char *saved_box(void **state, const char *name, size_t *size) {
  char path[256];
  supine_mesh box = sample_box();
  assert_int_equal(supine_mesh_save(sample_path(state, name, path), &box, NULL, NULL), SUPINE_OK);
  supine_mesh_free(&box);
  unsigned char *bytes = test_read(path, size);
  assert_int_equal(unlink(path), 0);
  return bytes;
}

TEST(test_load_truncated_binary_reports_format_error) {
  static const char *const names[] = {"a.ply", "a.stl"};
  for (size_t k = 0; k < 2; ++k) {
    size_t size = 0;
    unsigned char *bytes = saved_box(state, names[k], &size);
    for (size_t length = 0; length < size; ++length) {
      expect_bytes(state, names[k], bytes, length, SUPINE_ERROR_FORMAT);
    }
    expect_bytes(state, names[k], bytes, size, SUPINE_OK);
    free(bytes);
  }
}

#define PLY_HEAD                                                                                   \
  "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"                       \
  "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
#define PLY_BODY "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"

TEST(test_load_truncated_text_reports_format_error) {
  static const struct {
    const char *name;
    const char *text;
  } cases[] = {
      {"a.ply", "ply\nformat ascii 1.0\n" PLY_HEAD PLY_BODY},
      {"a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                "vertex 0 1 0\nendloop\nendfacet\nendsolid\n"},
  };
  for (size_t k = 0; k < sizeof cases / sizeof *cases; ++k) {
    const size_t size = strlen(cases[k].text);
    /* The file is complete even without its last line feed. */
    for (size_t length = 0; length + 1 < size; ++length) {
      expect_bytes(state, cases[k].name, cases[k].text, length, SUPINE_ERROR_FORMAT);
    }
    expect_bytes(state, cases[k].name, cases[k].text, size - 1, SUPINE_OK);
    expect_bytes(state, cases[k].name, cases[k].text, size, SUPINE_OK);
  }
}

TEST(test_load_truncated_obj_read_or_refused) {
  static const char text[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf -1 -2 -3\n";
  char path[256];
  for (size_t length = 0; length < sizeof text; ++length) {
    (void)attempt(sample_write(state, "a.obj", text, length, path));
  }
  assert_int_equal(unlink(path), 0);
}

#define PLY_ASCII "ply\nformat ascii 1.0\n"

TEST(test_load_ply_header_illegal_reports_format_error) {
  static const char *const texts[] = {
      "plx\nformat ascii 1.0\n" PLY_HEAD PLY_BODY,
      "ply\n" PLY_HEAD PLY_BODY,
      "ply\nformat morse 1.0\n" PLY_HEAD PLY_BODY,
      "ply\nformat\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "property float x\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element vertex\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element vertex -1\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element vertex 99999999999999999999\n" PLY_HEAD PLY_BODY,
      /* PLY_HEAD declares the element `vertex` a second time. */
      PLY_ASCII "element vertex 3\nproperty float x\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element none 0\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element a 0\nproperty\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element a 0\nproperty float\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element a 0\nproperty half x\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element a 0\nproperty list\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element a 0\nproperty list uchar\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element a 0\nproperty list float int b\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element a 0\nproperty list uchar half b\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "comment \001\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n",
  };
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    expect_text(state, "a.ply", texts[i], SUPINE_ERROR_FORMAT, 0);
  }
}

TEST(test_load_ply_header_too_long_reports_format_error) {
  char text[16384];
  for (int kind = 0; kind < 2; ++kind) {
    int length = snprintf(text, sizeof text, PLY_ASCII "element first 0\n");
    for (int i = 0; i < (kind == 0 ? 300 : 40); ++i) {
      length += snprintf(text + length, sizeof text - (size_t)length, "property uchar a\n%s",
                         kind == 0 ? "" : "element more 0\n");
    }
    (void)snprintf(text + length, sizeof text - (size_t)length, PLY_HEAD PLY_BODY);
    expect_text(state, "a.ply", text, SUPINE_ERROR_FORMAT, 0);
  }
}

TEST(test_load_ply_body_illegal_reports_format_error) {
  static const char *const bodies[] = {
      "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",          "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n",
      "0 0 0\n1 0 0\n0 1 0\n3 0 1 1.5\n",        "0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n",
      "0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n", "0 0 0\n1 0 0\n0 one 0\n3 0 1 2\n",
      "0 0 0\n1 0 0\n0 0,5 0\n3 0 1 2\n",        "0 0 0\n1 0 0\n0 1e 0\n3 0 1 2\n",
      "0 0 0\n1 0 0\n\n0 1 0\n3 0 1 2\n",        "0 0 0 1 0 0 0 1 0\n3 0 1 2\n\n\n",
      "0 0 0\r1 0 0\n0 1 0\n3 0 1 2\nx\n",
  };
  for (size_t i = 0; i < sizeof bodies / sizeof *bodies; ++i) {
    char text[512];
    (void)snprintf(text, sizeof text, PLY_ASCII PLY_HEAD "%s", bodies[i]);
    expect_text(state, "a.ply", text, SUPINE_ERROR_FORMAT, 0);
  }
}

/* assimp 5.2 misreads these legal files: it mistakes words for counts, elements or coordinates. */
TEST(test_load_ply_unusual_but_legal_read) {
  static const char *const texts[] = {
      PLY_ASCII "comment 3 lungs\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "comment 4000000000 lungs\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "comment vertex 8\ncomment face 9\n" PLY_HEAD PLY_BODY,
      PLY_ASCII "obj_info end_header_not\nMade by hand\n\n" PLY_HEAD PLY_BODY,
      PLY_ASCII
      "element camera 2\nproperty float x\nproperty list uchar int vertex_indices\n" PLY_HEAD
      "7 0\n8 2 5 5\n" PLY_BODY,
      "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty double x\r\nproperty float32 "
      "y\r\nproperty float z\r\nproperty uchar red\r\nelement face 1\r\nproperty uchar "
      "flag\r\nproperty list uint8 uint32 vertex_index\r\nend_header\r\n"
      "0 0 0 255\r\n1 0 0 255\r\n0 1 0 255\r\n1 3 0 1 2\r\n",
      "PLY\nFORMAT ASCII 1.0\nELEMENT VERTEX 3\nPROPERTY FLOAT X\nPROPERTY FLOAT Y\nPROPERTY FLOAT "
      "Z\nELEMENT FACE 1\nPROPERTY LIST UCHAR INT VERTEX_INDICES\nEND_HEADER\n" PLY_BODY,
  };
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    expect_text(state, "a.ply", texts[i], SUPINE_OK, 1);
  }
}

/* Append the four bytes of `bits`, most significant first if `big`; return the new length. */
static size_t append(unsigned char *bytes, size_t at, uint32_t bits, bool big) {
  for (size_t k = 0; k < 4; ++k) {
    bytes[at + k] = (unsigned char)(bits >> (8 * (big ? 3 - k : k)));
  }
  return at + 4;
}

/* The data of a binary PLY file may begin with a line feed, and unknown elements may precede and
 * follow the surface. Both byte orders are tested. */
TEST(test_load_ply_data_beginning_with_line_feed_read) {
  for (int big = 0; big < 2; ++big) {
    unsigned char bytes[512] = {0};
    size_t at = (size_t)snprintf(
        (char *)bytes, sizeof bytes,
        "ply\nformat binary_%s_endian 1.0\nelement mark 1\nproperty list char short "
        "a\n%selement tail 3\nproperty short a\nend_header\n",
        big ? "big" : "little",
        "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list int int vertex_indices\n");
    bytes[at++] = 10;
    memset(bytes + at, '\n', 20);
    at += 20;
    uint32_t line_feed = big ? UINT32_C(0x0A0000C1) : UINT32_C(0xC100000A);
    float first = 0.0F;
    memcpy(&first, &line_feed, sizeof first);
    const float rows[9] = {first, 2, 3, 4, 5, 6, 7, 8, 10};
    const uint32_t face[4] = {3, 0, 1, 2};
    for (size_t i = 0; i < 9; ++i) {
      uint32_t bits = 0;
      memcpy(&bits, &rows[i], sizeof bits);
      at = append(bytes, at, bits, big);
    }
    for (size_t i = 0; i < 4; ++i) {
      at = append(bytes, at, face[i], big);
    }
    memset(bytes + at, 0, 6);
    at += 6;
    char path[256];
    supine_mesh mesh = {0};
    supine_error error = {0};
    (void)sample_write(state, "a.ply", bytes, at, path);
    if (supine_mesh_load(path, NULL, &mesh, NULL, &error) != SUPINE_OK) {
      fail_msg("%s", error.message);
    }
    for (size_t i = 0; i < 9; ++i) {
      assert_true(mesh.vertices[i] == (double)rows[i]);
    }
    supine_mesh_free(&mesh);
    expect_bytes(state, "a.ply", bytes, at - 7, SUPINE_ERROR_FORMAT);
  }
}

static void refuse_bytes(void **state, const void *bytes, size_t size, const char *words) {
  char path[256];
  supine_mesh mesh = {0};
  supine_error error = {0};
  (void)sample_write(state, "a.ply", bytes, size, path);
  assert_int_equal(supine_mesh_load(path, NULL, &mesh, NULL, &error), SUPINE_ERROR_FORMAT);
  assert_says(error.message, words);
  assert_int_equal(unlink(path), 0);
}

TEST(test_load_ply_list_of_impossible_length_refused) {
#define LIST(length)                                                                               \
  PLY_ASCII "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n"             \
            "element face 1\nproperty list int int vertex_indices\nend_header\n1 2 3\n" length
  static const char below[] = LIST("-3 0 0 0\n");
  static const char above[] = LIST("1000 0 0 0\n"); /* more numbers than the file has bytes */
  refuse_bytes(state, below, sizeof below - 1, "a list has the impossible length -3");
  refuse_bytes(state, above, sizeof above - 1, "a list has the impossible length 1000");
  unsigned char bytes[512] = {0};
  static const char *const types[] = {"char", "short", "int"};
  for (int k = 0; k < 3; ++k) {
    const size_t head = (size_t)snprintf(
        (char *)bytes, sizeof bytes,
        "ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty float x\nproperty float "
        "y\nproperty float z\nelement face 1\nproperty list %s uchar vertex_indices\nend_header\n",
        types[k]);
    memset(bytes + head, 0, sizeof bytes - head);
    memset(bytes + head + 12, 0xFF, (size_t)1 << k);
    bytes[head + 12 + ((size_t)1 << k) - 1] = 0xFD;
    refuse_bytes(state, bytes, sizeof bytes, "a list has the impossible length -3");
  }
}

TEST(test_load_ply_without_surface_reports_mesh_error) {
  static const char *const texts[] = {
      PLY_ASCII "element vertex 1\nproperty float x\nproperty float y\nproperty float w\nelement "
                "face 1\nproperty list uchar int vertex_indices\nend_header\n1 2 3\n0\n",
      PLY_ASCII "element vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement "
                "face 1\nproperty list uchar int others\nend_header\n1 2 3\n1 0\n",
  };
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    expect_text(state, "a.ply", texts[i], SUPINE_ERROR_MESH, 0);
  }
}

TEST(test_load_stl_and_obj_garbage_refused) {
  expect_text(state, "a.stl",
              "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 zero 0\nvertex 0 1 "
              "0\nendloop\nendfacet\nendsolid\n",
              SUPINE_ERROR_FORMAT, 0);
  expect_text(state, "a.stl", "solid\nvertex 0 0 0\nvertex 1 0 0\nendsolid\n", SUPINE_ERROR_MESH,
              0);
  expect_text(state, "a.stl", "short", SUPINE_ERROR_FORMAT, 0);
  expect_text(state, "a.obj", "v 0 0 0\nv 1 zero 0\nv 0 1 0\nf 1 2 3\n", SUPINE_ERROR_FORMAT, 0);
  expect_text(state, "a.obj", "v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", SUPINE_ERROR_FORMAT, 0);
  expect_text(state, "a.obj", "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r", SUPINE_ERROR_FORMAT, 0);
  expect_text(state, "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", SUPINE_ERROR_FORMAT, 0);
  static const unsigned char utf16[] = {0xFE, 0xFF, 0, 'v', 0, ' ', 0, '1', 0, '\n'};
  expect_bytes(state, "a.obj", utf16, sizeof utf16, SUPINE_ERROR_FORMAT);
}

/* Load every file in a folder of the test data; return the number of files. */
static size_t sweep(const char *name) {
  char folder[256];
  (void)snprintf(folder, sizeof folder, "%s/defects/%s", SUPINE_TEST_DATA, name);
  DIR *stream = opendir(folder);
  if (stream == NULL) {
    return 0;
  }
  size_t count = 0;
  for (struct dirent *entry = readdir(stream); entry != NULL; entry = readdir(stream)) {
    if (entry->d_name[0] != '.') {
      char path[640];
      (void)snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
      const supine_status status = attempt(path);
      /* In the folder `invalid`, only malformed2.obj, without its material, can be read. */
      if (strcmp(name, "invalid") == 0) {
        assert_int_equal(
            status, strcmp(entry->d_name, "malformed2.obj") == 0 ? SUPINE_OK : SUPINE_ERROR_FORMAT);
      }
      ++count;
    }
  }
  assert_int_equal(closedir(stream), 0);
  return count;
}

TEST_FULL(test_load_each_test_file_of_assimp_read_or_refused) {
  static const char *const folders[] = {"OBJ", "OFF", "PLY", "STL", "invalid"};
  for (size_t i = 0; i < sizeof folders / sizeof *folders; ++i) {
    if (sweep(folders[i]) == 0) {
      print_message("no test data in " SUPINE_TEST_DATA "/defects: skipped\n");
      skip();
    }
  }
}

TEST_FULL(test_load_known_files_of_assimp_expected_counts) {
  static const struct {
    const char *name;
    supine_status status;
    size_t vertices;
    size_t triangles;
  } cases[] = {
      {"PLY/cube.ply", SUPINE_OK, 8, 12},
      {"PLY/cube_binary.ply", SUPINE_OK, 8, 12},
      {"PLY/cube_binary_header_with_RN_newline.ply", SUPINE_OK, 8, 12},
      {"PLY/cube_binary_starts_with_nl.ply", SUPINE_OK, 8, 12},
      {"PLY/cube_uv.ply", SUPINE_OK, 8, 12},
      {"PLY/Wuson.ply", SUPINE_OK, 2117, 3732},
      {"PLY/points.ply", SUPINE_ERROR_MESH, 0, 0},
      {"PLY/issue623.ply", SUPINE_ERROR_MESH, 0, 0}, /* the header lacks `element face` */
      {"STL/Wuson.stl", SUPINE_OK, 2117, 3732},
      {"STL/triangle_with_two_solids.stl", SUPINE_OK, 6, 2},
      {"STL/triangle_with_empty_solid.stl", SUPINE_OK, 3, 1},
      {"OFF/Wuson.off", SUPINE_OK, 2117, 3732},
      {"OFF/Cube.off", SUPINE_OK, 8, 12},
      {"OFF/invalid.off", SUPINE_ERROR_FORMAT, 0, 0}, /* a line ends in CR alone */
      {"OBJ/WusonOBJ.obj", SUPINE_OK, 2117, 3732},
      {"OBJ/box_without_lineending.obj", SUPINE_OK, 8, 12},
      {"OBJ/concave_polygon.obj", SUPINE_OK, 64, 64},
      {"OBJ/testline.obj", SUPINE_ERROR_MESH, 0, 0},
      {"OBJ/point_cloud.obj", SUPINE_ERROR_MESH, 0, 0},
      {"OBJ/box_UTF16BE.obj", SUPINE_ERROR_FORMAT, 0, 0},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    char path[512];
    (void)snprintf(path, sizeof path, "%s/defects/%s", SUPINE_TEST_DATA, cases[i].name);
    if (access(path, R_OK) != 0) {
      print_message("no test data in " SUPINE_TEST_DATA "/defects: skipped\n");
      skip();
    }
    supine_mesh mesh = {0};
    supine_error error = {0};
    const supine_status status = supine_mesh_load(path, NULL, &mesh, NULL, &error);
    if (status != cases[i].status || mesh.vertex_count != cases[i].vertices ||
        mesh.triangle_count != cases[i].triangles) {
      fail_msg("%s: status %d, %zu vertices, %zu triangles: %s", path, (int)status,
               mesh.vertex_count, mesh.triangle_count, error.message);
    }
    supine_mesh_free(&mesh);
  }
}

TEST_GROUP(sample_folder_create, sample_folder_remove)
