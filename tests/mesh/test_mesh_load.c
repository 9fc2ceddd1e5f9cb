/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test small files of every format: merging of equal corners, dropped elements, orientation, axes,
 * units. */
#include <float.h>
#include <pthread.h>
#include <sys/inotify.h>
#include <sys/stat.h>

#include "base/number.h"
#include "tests/helpers/mesh_samples.h"

static const char tetrahedron_obj[] = "v 0 0 0\nv 120 0 0\nv 0 120 0\nv 0 0 120\n"
                                      "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
static const char tetrahedron_stl[] =
    "solid\n"
    "facet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 120 "
    "0\nvertex 120 0 0\nendloop\nendfacet\n"
    "facet normal 0 -1 0\nouter loop\nvertex 0 -0 0\nvertex 120 0 "
    "0\nvertex 0 0 120\nendloop\nendfacet\n"
    "facet normal -1 0 0\nouter loop\nvertex 0 0 -0\nvertex 0 0 "
    "120\nvertex 0 120 0\nendloop\nendfacet\n"
    "facet normal 1 1 1\nouter loop\nvertex 120 0 0\nvertex 0 120 "
    "0\nvertex 0 0 120\nendloop\nendfacet\n"
    "endsolid\n";

/* Load a file, assert that this succeeds, and remove the file. */
static supine_mesh load(const char *path, const supine_mesh_load_options *options,
                        supine_mesh_report *report) {
  supine_mesh mesh = {0};
  supine_error error = {0};
  const supine_status status = supine_mesh_load(path, options, &mesh, report, &error);
  if (status != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  assert_int_equal(unlink(path), 0);
  return mesh;
}

static void expect_refused(const char *path, const supine_mesh_load_options *options,
                           supine_status expected, const char *words) {
  supine_mesh mesh = {0};
  supine_mesh_report report = {.degenerate_faces = 77};
  supine_error error = {0};
  assert_int_equal(supine_mesh_load(path, options, &mesh, &report, &error), expected);
  assert_says(error.message, words);
  assert_says(error.message, path);
  assert_null(strchr(error.message, '\n'));
  assert_int_equal(error.status, expected);
  assert_null(mesh.vertices);
  assert_null(mesh.triangles);
  assert_int_equal(report.degenerate_faces, 77);
  assert_int_equal(supine_mesh_load(path, options, &mesh, NULL, NULL), expected);
}

static void refuse_text(void **state, const char *name, const char *text, supine_status expected,
                        const char *words) {
  char path[256];
  expect_refused(sample_text(state, name, text, path), NULL, expected, words);
  assert_int_equal(unlink(path), 0);
}

static void expect_tetrahedron(const supine_mesh *mesh) {
  assert_int_equal(mesh->vertex_count, 4);
  assert_int_equal(mesh->triangle_count, 4);
  assert_true(fabs(supine_mesh_volume(mesh) - 288000.0) < 1.0e-6);
}

TEST(test_load_stl_equal_corners_become_one_vertex) {
  char path[256];
  supine_mesh_report report = {0};
  supine_mesh soup = load(sample_text(state, "a.stl", tetrahedron_stl, path), NULL, &report);
  expect_tetrahedron(&soup);
  assert_int_equal(report.degenerate_faces, 0);
  assert_int_equal(report.unreferenced_vertices, 0);
  /* Vertices are numbered in the order in which they first appear in the file. */
  static const double vertices[] = {0, 0, 0, 0, 120, 0, 120, 0, 0, 0, 0, 120};
  static const uint32_t triangles[] = {0, 1, 2, 0, 2, 3, 0, 3, 1, 2, 1, 3};
  assert_memory_equal(soup.vertices, vertices, sizeof vertices);
  assert_memory_equal(soup.triangles, triangles, sizeof triangles);
  supine_mesh_free(&soup);
}

/* Readers turn -0 into 0, so that equal positions have equal bits. */
/* Write a text in small or capital letters. */
static char *capitals(const char *text, char *out) {
  size_t i = 0;
  for (; text[i] != '\0'; ++i) {
    out[i] = (char)(text[i] >= 'a' && text[i] <= 'z' ? text[i] - 'a' + 'A' : text[i]);
  }
  out[i] = '\0';
  return out;
}

TEST(test_load_stl_capitals_spare_bytes_or_no_count_read) {
  char path[256];
  static char text[2048];
  static unsigned char binary[84 + 4 * 50 + 7];
  supine_mesh small = load(sample_text(state, "s.stl", tetrahedron_stl, path), NULL, NULL);
  supine_mesh large =
      load(sample_text(state, "c.stl", capitals(tetrahedron_stl, text), path), NULL, NULL);
  assert_int_equal(large.triangle_count, small.triangle_count);
  assert_memory_equal(large.vertices, small.vertices, 12 * sizeof(double));
  for (uint32_t count = 0; count <= 4; count += 4) {
    memset(binary, 0, sizeof binary);
    memcpy(binary + 80, &count, 4);
    for (size_t t = 0; t < small.triangle_count; ++t) {
      for (size_t k = 0; k < 9; ++k) {
        const float x = (float)small.vertices[3 * small.triangles[3 * t + k / 3] + k % 3];
        memcpy(binary + 84 + 50 * t + 12 + 4 * k, &x, 4);
      }
    }
    (void)sample_path(state, "b.stl", path);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    /* a count of 0 fits whole triangles, another count may be followed by spare bytes */
    assert_int_equal(fwrite(binary, sizeof binary - (count == 0 ? 7 : 0), 1, file), 1);
    assert_int_equal(fclose(file), 0);
    supine_mesh mesh = load(path, NULL, NULL);
    assert_int_equal(mesh.triangle_count, 4);
    assert_int_equal(mesh.vertex_count, 4);
    supine_mesh_free(&mesh);
  }
  supine_mesh_free(&small);
  supine_mesh_free(&large);
}

TEST(test_load_obj_byte_order_mark_and_continued_line_read) {
  char path[256];
  supine_mesh mesh = load(sample_text(state, "m.obj",
                                      "\xEF\xBB\xBFv 0 0 0\nv 120 \\\n0 0\nv 0 120 0\nv 0 0 120\n"
                                      "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
                                      path),
                          NULL, NULL);
  assert_int_equal(mesh.triangle_count, 4);
  assert_int_equal(mesh.vertex_count, 4);
  supine_mesh_free(&mesh);
}

/* Comments end with their line, and names may hold their sign. */
TEST(test_load_obj_comments_ignored) {
  char path[256];
  supine_mesh mesh =
      load(sample_text(state, "c.obj",
                       "# a path: C:\\lungs\\\nv 0 0 0 # 1 \\\nv 120 0 0\n"
                       "v 0 120 0\nv 0 0 120\no lung#1\nf 1 3 2 # base\nf 1 2 \\\n4 # "
                       "back\nf 1 4 3#left\nf 2 3 4\n",
                       path),
           NULL, NULL);
  expect_tetrahedron(&mesh);
  supine_mesh_free(&mesh);
}

/* The normals of facets without area, as compilers of Microsoft print them. */
TEST(test_load_stl_normals_not_numbers_read) {
  static const char *const normals[] = {"-nan(ind) -nan(ind) -nan(ind)", "-1.#IND 1.#INF 1.#QNAN",
                                        "nan nan inf"};
  for (size_t i = 0; i < sizeof normals / sizeof *normals; ++i) {
    char text[1024];
    char path[256];
    const char *at = strstr(tetrahedron_stl, "0 0 -1");
    (void)snprintf(text, sizeof text, "%.*s%s%s", (int)(at - tetrahedron_stl), tetrahedron_stl,
                   normals[i], at + strlen("0 0 -1"));
    supine_mesh mesh = load(sample_text(state, "n.stl", text, path), NULL, NULL);
    expect_tetrahedron(&mesh);
    supine_mesh_free(&mesh);
  }
}

/* A file that holds more than it counts is not cut: a whole lung could be lost. */
TEST(test_load_more_than_counted_refused) {
  static unsigned char binary[84 + 4 * 50];
  char path[256];
  for (unsigned char count = 0; count <= 4; ++count) {
    binary[80] = count;
    for (size_t t = 0; t < 4; ++t) {
      const float corners[9] = {(float)t, 0.0F, 0.0F, (float)t, 120.0F, 0.0F, (float)t, 0.0F, 9.0F};
      memcpy(binary + 84 + 50 * t + 12, corners, sizeof corners);
    }
    (void)sample_path(state, "b.stl", path);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(binary, sizeof binary, 1, file), 1);
    assert_int_equal(fclose(file), 0);
    if (count % 4 == 0) { /* 0: the file does not count */
      supine_mesh mesh = load(path, NULL, NULL);
      assert_int_equal(mesh.triangle_count, 4);
      supine_mesh_free(&mesh);
    } else {
      expect_refused(path, NULL, SUPINE_ERROR_FORMAT, "but it has room for 4");
    }
  }
  refuse_text(state, "more.ply",
              "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float "
              "y\nproperty float z\nelement face 1\nproperty list uchar int "
              "vertex_indices\nend_header\n0 0 0\n120 0 0\n0 120 0\n3 0 1 2\n3 0 2 1\n",
              SUPINE_ERROR_FORMAT, "follow what the PLY header counts");
#define OFF(count) "OFF # text\n3 " count " 0\n\n0 0 0\n120 0 0\n0 120 0\n3 0 1 2\n3 0 2 1 # back\n"
  supine_mesh two = load(sample_text(state, "two.off", OFF("2"), path), NULL, NULL);
  assert_int_equal(two.triangle_count, 2);
  supine_mesh_free(&two);
  refuse_text(state, "more.off", OFF("1"), SUPINE_ERROR_FORMAT, "it counts 4 lines of vertices");
  refuse_text(state, "less.off", OFF("3"), SUPINE_ERROR_FORMAT, "but it holds 5");
#define AC(count)                                                                                  \
  "AC3Db\nMATERIAL \"m\" rgb 1 1 1 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0\nOBJECT world\n"  \
  "kids 1\nOBJECT poly\nnumvert 3\n0 0 0\n120 0 0\n0 120 0\nnumsurf " count                        \
  "\nSURF 0x20\nmat 0\nrefs 3\n0 0 0\n1 0 0\n2 0 0\nSURF 0x20\nmat 0\nrefs 3\n0 0 0\n2 0 0\n"      \
  "1 0 0\nkids 0\n"
  two = load(sample_text(state, "two.ac", AC("2"), path), NULL, NULL);
  assert_int_equal(two.triangle_count, 2);
  supine_mesh_free(&two);
  refuse_text(state, "more.ac", AC("1"), SUPINE_ERROR_FORMAT, "it counts 1 surfaces");
}

/* A text of a surface whose second vertex is 2 units along y, and the unit in mm. */
typedef struct text_in_unit {
  const char *text;
  double millimetres;
} text_in_unit;

static void expect_units(void **state, const char *name, const text_in_unit *files, size_t count) {
  char path[256];
  for (size_t i = 0; i < count; ++i) {
    supine_mesh mesh = load(sample_text(state, name, files[i].text, path), NULL, NULL);
    assert_true(fabs(mesh.vertices[4] - 2.0 * files[i].millimetres) < 1e-12);
    supine_mesh_free(&mesh);
  }
}

#define AMF(unit)                                                                                  \
  "<?xml version=\"1.0\"?>\n<amf" unit " version=\"1.1\"><object id=\"0\"><mesh><vertices>"        \
  "<vertex><coordinates><x>1</x><y>0</y><z>0</z></coordinates></vertex>"                           \
  "<vertex><coordinates><x>0</x><y>2</y><z>0</z></coordinates></vertex>"                           \
  "<vertex><coordinates><x>0</x><y>0</y><z>3</z></coordinates></vertex></vertices><volume>"        \
  "<triangle><v1>0</v1><v2>1</v2><v3>2</v3></triangle></volume></mesh></object></amf>\n"

TEST(test_load_amf_unit_of_the_file_used) {
  static const text_in_unit files[] = {
      {AMF(""), 1.0},
      {AMF(" unit=\"millimeter\""), 1.0},
      {AMF(" unit='inch'"), 25.4},
      {AMF(" unit=\"feet\""), 304.8},
      {AMF(" unit=\"meter\""), 1000.0},
      {AMF(" unit=\"micron\""), 0.001},
      {"<!-- <amf unit=\"meter\"> -->" AMF("\n  unit = 'inch'"), 25.4}};
  char path[256];
  expect_units(state, "u.amf", files, sizeof files / sizeof *files);
  const supine_mesh_load_options cm = {.millimetres_per_unit = 10.0}; /* replaces the file's unit */
  supine_mesh mesh = load(sample_text(state, "u.amf", AMF(" unit=\"inch\""), path), &cm, NULL);
  assert_true(mesh.vertices[4] == 20.0);
  supine_mesh_free(&mesh);
  refuse_text(state, "u.amf", AMF(" unit=\"ell\""), SUPINE_ERROR_FORMAT, "unit \"ell\" is unknown");
}

#define X3D(units)                                                                                 \
  "<X3D version=\"3.3\"><head>" units "</head><Scene><Shape><IndexedFaceSet coordIndex=\"0 1 2 "   \
  "-1\"><Coordinate point=\"1 0 0 0 2 0 0 0 3\"/></IndexedFaceSet></Shape></Scene></X3D>"

TEST(test_load_x3d_unit_of_length_used) {
  static const text_in_unit files[] = {
      {X3D(""), 1.0},
      {X3D("<unit category=\"length\" conversionFactor=\"0.01\" name=\"cm\"/>"), 10.0},
      {X3D("<unit category='angle' conversionFactor='2' name='a'/>"
           "<unit category='length' conversionFactor='0.001' name='mm'/>"),
       1.0},
      {X3D("<unit category='mass' conversionFactor='0.001' name='g'/>"), 1.0}};
  expect_units(state, "u.x3d", files, sizeof files / sizeof *files);
}

TEST(test_load_legacy_vtk_conversion_named) {
  refuse_text(state, "old.vtk", "# vtk DataFile Version 4.2\n", SUPINE_ERROR_FORMAT,
              "save the surface as .vtp or .ply");
}

TEST(test_load_negative_zero_becomes_zero) {
  static const char text[] = SAMPLE_PLY(5, 2) "-0 -0 -0\n120 -0 0\n0 120 -0\n0 -0 0\n-0 0 120\n"
                                              "3 0 2 1\n3 3 1 4\n";
  for (int ras = 0; ras < 2; ++ras) {
    char path[256];
    const supine_mesh_load_options options = {.axes = ras ? SUPINE_AXES_RAS : SUPINE_AXES_LPS};
    supine_mesh_report report = {0};
    supine_mesh mesh = load(sample_text(state, "a.ply", text, path), &options, &report);
    assert_int_equal(mesh.vertex_count, 4);
    for (size_t i = 0; i < 12; ++i) {
      assert_true(mesh.vertices[i] != 0.0 || !signbit(mesh.vertices[i]));
    }
    supine_mesh_free(&mesh);
  }
}

TEST(test_load_polygons_triangulated_points_and_lines_dropped) {
  static const char text[] =
      "v 0 0 0\nv 100 0 0\nv 100 100 0\nv 0 100 0\nv 50 50 90\nv 7 7 7\nv 8 8 8\n"
      "f 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nl 6 7\np 6\n";
  char path[256];
  supine_mesh_report report = {0};
  supine_mesh mesh = load(sample_text(state, "pyramid.obj", text, path), NULL, &report);
  assert_int_equal(mesh.vertex_count, 5);
  assert_int_equal(mesh.triangle_count, 6);
  assert_int_equal(report.degenerate_faces, 2);
  assert_int_equal(report.unreferenced_vertices, 2);
  assert_true(fabs(supine_mesh_volume(&mesh) - 300000.0) < 1.0e-6);
  supine_mesh_free(&mesh);
}

TEST(test_load_degenerate_faces_and_unused_vertices_dropped) {
  static const char text[] =
      "ply\nformat ascii 1.0\nelement vertex 7\nproperty float x\nproperty float y\nproperty float "
      "z\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n"
      "55 55 55\n0 0 0\n120 0 0\n0 120 0\n0 0 120\n0 0 0\n66 66 66\n"
      "3 1 3 2\n3 1 2 4\n3 5 4 3\n3 2 3 4\n3 1 1 2\n3 1 5 6\n";
  char path[256];
  supine_mesh_report report = {0};
  supine_mesh mesh = load(sample_text(state, "a.PLY", text, path), NULL, &report);
  expect_tetrahedron(&mesh);
  assert_int_equal(report.degenerate_faces, 2);
  assert_int_equal(report.unreferenced_vertices, 2);
  supine_mesh_free(&mesh);
}

TEST(test_load_ply_faces_before_vertices_refused) {
  refuse_text(state, "order.ply",
              "ply\nformat ascii 1.0\nelement face 1\nproperty list int int vertex_indices\n"
              "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
              "end_header\n3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n",
              SUPINE_ERROR_FORMAT, "before its vertices");
}

TEST(test_load_ply_strips_refused) {
  refuse_text(state, "strip.ply",
              "ply\nformat ascii 1.0\nelement tristrips 1\nproperty list int int vertex_indices\n"
              "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
              "end_header\n3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n",
              SUPINE_ERROR_MESH, "save the mesh as triangles");
  refuse_text(state, "mixed.ply",
              "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
              "property float z\nelement face 1\nproperty list int int vertex_indices\n"
              "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
              "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 2\n",
              SUPINE_ERROR_MESH, "strips of triangles");
}

/* A flat concave face is cut within its outline: all triangles face the same way and their areas
 * add up to that of the face. */
TEST(test_load_concave_face_triangulated_inside_outline) {
  static const double corners[7][3] = {{0, 0, 0},   {90, 0, 0}, {90, 30, 0}, {30, 30, 0},
                                       {30, 60, 0}, {0, 60, 0}, {0, 0, 50}};
  for (double size = 1.0; size > 1.0e-4; size /= 100.0) {
    char text[1024] = SAMPLE_PLY(7, 2);
    char path[256];
    for (size_t i = 0; i < 7; ++i) {
      const size_t length = strlen(text);
      (void)supine_print_text(text + length, sizeof text - length, "%g %g %g\n",
                              size * corners[i][0], size * corners[i][1], size * corners[i][2]);
    }
    (void)strcat(text, "6 0 1 2 3 4 5\n4 6 5 3 0\n");
    supine_mesh mesh = load(sample_text(state, "u.ply", text, path), NULL, NULL);
    assert_int_equal(mesh.vertex_count, 7);
    assert_int_equal(mesh.triangle_count, 6);
    double area = 0.0;
    for (size_t t = 0; t < 4; ++t) {
      const double *a = mesh.vertices + 3 * (size_t)mesh.triangles[3 * t];
      const double *b = mesh.vertices + 3 * (size_t)mesh.triangles[3 * t + 1];
      const double *c = mesh.vertices + 3 * (size_t)mesh.triangles[3 * t + 2];
      const double twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
      assert_true(twice > 0.0);
      area += 0.5 * twice;
    }
    assert_true(fabs(area / (size * size) - 3600.0) < 3600.0 * 4.0 * FLT_EPSILON);
    supine_mesh_free(&mesh);
  }
}

/* Even a face with collinear corners or self-intersections is cut into as many triangles as it has
 * corners, less two. */
TEST(test_load_collinear_or_crossing_face_triangulated) {
  static const char text[] = SAMPLE_PLY(6, 3) "0 0 0\n10 0 0\n20 0 0\n30 0 0\n0 10 0\n10 10 0\n"
                                              "4 0 1 2 3\n5 0 1 2 3 4\n4 0 5 4 1\n";
  char path[256];
  supine_mesh mesh = load(sample_text(state, "flat.ply", text, path), NULL, NULL);
  assert_int_equal(mesh.triangle_count, 2 + 3 + 2);
  supine_mesh_free(&mesh);
}

TEST(test_load_face_of_too_many_corners_refused) {
  enum { CORNERS = 1025 };
  char text[256 + 8 * CORNERS];
  int length = snprintf(text, sizeof text, SAMPLE_PLY(3, 1) "0 0 0\n1 0 0\n0 1 0\n%d", CORNERS);
  for (int i = 0; i < CORNERS; ++i) {
    length += snprintf(text + length, sizeof text - (size_t)length, " %d", i % 3);
  }
  refuse_text(state, "a.ply", text, SUPINE_ERROR_FORMAT, "face 0 has 1025 corners");
}

/* Two nodes of a scene show the same tetrahedron, and the second node mirrors it. The triangles of
 * both copies face outwards. */
TEST(test_load_mirrored_node_triangles_face_outwards) {
  static const char text[] =
      "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":["
      "{\"children\":[1,2],\"translation\":[0,0,1000]},"
      "{\"mesh\":0,\"translation\":[10,20,30]},{\"mesh\":0,\"scale\":[-1,1,1],\"translation\":[-"
      "10,0,0]}],"
      "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1}]}],"
      "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\","
      "\"min\":[0,0,0],\"max\":[120,120,120]},"
      "{\"bufferView\":1,\"componentType\":5123,\"count\":12,\"type\":\"SCALAR\"}],"
      "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":48},"
      "{\"buffer\":0,\"byteOffset\":48,\"byteLength\":24}],"
      "\"buffers\":[{\"byteLength\":72,\"uri\":\"data:application/octet-stream;base64,"
      "AAAAAAAAAAAAAAAAAADwQgAAAAAAAAAAAAAAAAAA8EIAAAAAAAAAAAAAAAAAAPBCAAACAAEAAAABAAMAAAADAAIAAQAC"
      "A"
      "AMA\"}]}";
  char path[256];
  supine_mesh mesh = load(sample_text(state, "a.gltf", text, path), NULL, NULL);
  assert_int_equal(mesh.vertex_count, 8);
  assert_int_equal(mesh.triangle_count, 8);
  assert_true(fabs(supine_mesh_volume(&mesh) - 2.0 * 288000.0) < 1.0e-6);
  double minimum[3];
  double maximum[3];
  supine_mesh_box(&mesh, minimum, maximum);
  const double expected_minimum[3] = {-130.0, 0.0, 1000.0};
  const double expected_maximum[3] = {130.0, 140.0, 1150.0};
  assert_memory_equal(minimum, expected_minimum, sizeof minimum);
  assert_memory_equal(maximum, expected_maximum, sizeof maximum);
  supine_topology topology = {0};
  assert_int_equal(supine_mesh_topology_create(&mesh, &topology), SUPINE_OK);
  assert_true(topology.closed);
  assert_int_equal(topology.component_count, 2);
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
}

/* Load a tetrahedron with the option `axes`, from a file that begins with the line `head`. Return
 * its only x coordinate that is not 0: 120 or -120. */
static double x_under(void **state, const char *name, const char *head, supine_axes axes,
                      supine_mesh_report *report) {
  char text[512];
  char path[256];
  (void)snprintf(text, sizeof text, "%s%s", head, tetrahedron_obj);
  const supine_mesh_load_options options = {.axes = axes};
  supine_mesh mesh = load(sample_text(state, name, text, path), &options, report);
  expect_tetrahedron(&mesh);
  double x = 0.0;
  for (size_t i = 0; i < 12; ++i) {
    x = i % 3 == 0 && mesh.vertices[i] != 0.0 ? mesh.vertices[i] : x;
  }
  supine_mesh_free(&mesh);
  return x;
}

TEST(test_load_axes_option_overrides_tag) {
  static const struct {
    const char *head;
    supine_axes asked;
    double x;
    supine_axes axes;
    bool from_tag;
  } cases[] = {
      {"", SUPINE_AXES_AUTO, 120.0, SUPINE_AXES_LPS, false},
      {"# SPACE=RAS\n", SUPINE_AXES_AUTO, -120.0, SUPINE_AXES_RAS, true},
      {"# 3D Slicer output. SPACE=LPS\n", SUPINE_AXES_AUTO, 120.0, SUPINE_AXES_LPS, true},
      {"# x;space=ras;\n", SUPINE_AXES_AUTO, -120.0, SUPINE_AXES_RAS, true},
      {"# SPACE=RAS\n", SUPINE_AXES_LPS, 120.0, SUPINE_AXES_LPS, false},
      {"# SPACE=LPS\n", SUPINE_AXES_RAS, -120.0, SUPINE_AXES_RAS, false},
      {"# left lung, RAS+ mm\n", SUPINE_AXES_AUTO, 120.0, SUPINE_AXES_LPS, false},
      {"# SPACE=XYZ\n", SUPINE_AXES_RAS, -120.0, SUPINE_AXES_RAS, false},
      {"# AIRSPACE=RAS\n", SUPINE_AXES_AUTO, 120.0, SUPINE_AXES_LPS, false},
      {"# 2SPACE=RAS\n", SUPINE_AXES_AUTO, 120.0, SUPINE_AXES_LPS, false},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    supine_mesh_report report = {0};
    const double x = x_under(state, "a.obj", cases[i].head, cases[i].asked, &report);
    assert_true(x == cases[i].x);
    assert_int_equal(report.axes, cases[i].axes);
    assert_int_equal(report.axes_from_tag, cases[i].from_tag);
  }
}

/* A SPACE tag may be anywhere in the header of a binary STL file; 3D Slicer writes it first. */
TEST(test_load_axes_tag_in_stl_header_used) {
  static const char *const heads[] = {"SPACE=RAS", "a lung, SPACE=RAS"};
  for (size_t i = 0; i < 2; ++i) {
    unsigned char stl[134] = {0};
    const float facet[12] = {0, 0, 1, 0, 0, 0, 100, 0, 0, 0, 100, 0};
    memcpy(stl, heads[i], strlen(heads[i]));
    stl[80] = 1;
    memcpy(stl + 84, facet, sizeof facet);
    char path[256];
    supine_mesh_report report = {0};
    supine_mesh mesh = load(sample_write(state, "a.stl", stl, sizeof stl, path), NULL, &report);
    assert_int_equal(report.axes, SUPINE_AXES_RAS);
    assert_true(report.axes_from_tag);
    assert_true(mesh.vertices[3] == -100.0);
    supine_mesh_free(&mesh);
  }
}

TEST(test_load_axes_unknown_tag_refused) {
  refuse_text(state, "a.obj", "# SPACE=LLS\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
              SUPINE_ERROR_FORMAT, "SPACE tag");
  refuse_text(state, "a.obj", "# SPACE=RASP\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
              SUPINE_ERROR_FORMAT, "SPACE tag");
}

TEST(test_load_units_scaled_to_millimetres) {
  static const double scales[] = {0.0, 1.0, 10.0, 0.125};
  for (size_t i = 0; i < sizeof scales / sizeof *scales; ++i) {
    char path[256];
    const supine_mesh_load_options options = {.millimetres_per_unit = scales[i]};
    supine_mesh mesh = load(sample_text(state, "a.ply",
                                        SAMPLE_PLY(4, 4) "0 0 0\n24 0 0\n0 24 0\n0 0 24\n3 0 2 1\n"
                                                         "3 0 1 3\n3 0 3 2\n3 1 2 3\n",
                                        path),
                            &options, NULL);
    double minimum[3];
    double maximum[3];
    const double side = supine_mesh_box(&mesh, minimum, maximum);
    assert_true(side == 24.0 * (scales[i] == 0.0 ? 1.0 : scales[i]));
    assert_true(maximum[0] == side && minimum[0] == 0.0);
    supine_mesh_free(&mesh);
  }
}

TEST(test_unit_is_likely_known_sizes_give_unit) {
  static const struct {
    double side;
    bool likely;
    const char *other;
  } cases[] = {{120, true, NULL}, {600, true, NULL},     {80, true, NULL},
               {12, false, "in"}, {24, false, "cm"},     {0.25, false, "m"},
               {6, false, "in"},  {240000, false, "um"}, {0.0625, false, NULL},
               {72, false, NULL}, {1048576, false, NULL}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    const char *other = "";
    assert_int_equal(supine_mesh_unit_is_likely(cases[i].side, &other), cases[i].likely);
    assert_string_equal(cases[i].likely || other == NULL ? "" : other,
                        cases[i].other == NULL ? "" : cases[i].other);
  }
}

TEST(test_load_units_not_positive_refused) {
  char path[256];
  (void)sample_text(state, "a.obj", tetrahedron_obj, path);
  static const double scales[] = {-1.0, (double)INFINITY, (double)NAN};
  for (size_t i = 0; i < sizeof scales / sizeof *scales; ++i) {
    const supine_mesh_load_options options = {.millimetres_per_unit = scales[i]};
    expect_refused(path, &options, SUPINE_ERROR_ARGUMENT, "mm per unit");
  }
  assert_int_equal(unlink(path), 0);
}

TEST(test_load_unreadable_path_reports_read_error) {
  char path[256];
  expect_refused(sample_path(state, "missing.ply", path), NULL, SUPINE_ERROR_READ, "No such file");
  expect_refused(*state, NULL, SUPINE_ERROR_READ, "is a folder");
  expect_refused("/dev/null", NULL, SUPINE_ERROR_READ, "not a regular file");
  (void)sample_text(state, "a.obj", tetrahedron_obj, path);
  assert_int_equal(chmod(path, 0), 0);
  if (access(path, R_OK) != 0) { /* false for root, who may read any file */
    expect_refused(path, NULL, SUPINE_ERROR_READ, "Permission denied");
  }
  assert_int_equal(unlink(path), 0);
}

TEST(test_load_unknown_kind_of_file_reports_format_error) {
  refuse_text(state, "empty.ply", "", SUPINE_ERROR_FORMAT, "empty");
  refuse_text(state, "a.jpg", tetrahedron_obj, SUPINE_ERROR_FORMAT, "no importer");
  refuse_text(state, "none", tetrahedron_obj, SUPINE_ERROR_FORMAT, "no importer");
  refuse_text(state, "a.vtp", "<VTKFile/>", SUPINE_ERROR_FORMAT, "no VTKFile of type PolyData");
  refuse_text(state, "a.gltf", "{", SUPINE_ERROR_FORMAT, "malformed");
  refuse_text(state, "a.dae", "\n<a>\n\n</b>\n", SUPINE_ERROR_FORMAT, "malformed");
}

TEST(test_load_no_triangles_reports_mesh_error) {
  refuse_text(state, "points.obj", "v 1 2 3\nv 4 5 6\n", SUPINE_ERROR_MESH, "no triangles");
  refuse_text(state, "lines.obj", "v 1 2 3\nv 4 5 6\nl 1 2\n", SUPINE_ERROR_MESH, "no triangles");
  refuse_text(state, "flat.obj", "v 1 2 3\nv 4 5 6\nv 1 2 3\nf 1 2 3\n", SUPINE_ERROR_MESH,
              "no triangles");
  refuse_text(state, "comment.obj", "# nothing here but words that go on for a while\n",
              SUPINE_ERROR_MESH, "no triangles");
  refuse_text(state, "points.ply",
              "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
              "y\nproperty float z\nend_header\n1 2 3\n",
              SUPINE_ERROR_MESH, "no triangles");
}

TEST(test_load_vertex_not_finite_named_in_message) {
  static const char head[] =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
      "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  static const char *const bad[] = {"nan", "inf", "-inf", "1e60"};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    char text[512];
    (void)snprintf(text, sizeof text, "%s0 0 0\n1 0 0\n0 %s 0\n1 1 1\n3 0 1 3\n", head, bad[i]);
    refuse_text(state, "a.ply", text, SUPINE_ERROR_MESH, "vertex 2 of 4");
  }
  const float soup[12] = {0, 0, 1, 0, 0, 0, 1, 0, 0, 0, NAN, 0};
  unsigned char stl[134] = {0};
  stl[80] = 1;
  memcpy(stl + 84, soup, sizeof soup);
  char path[256];
  expect_refused(sample_write(state, "a.stl", stl, sizeof stl, path), NULL, SUPINE_ERROR_MESH,
                 "vertex 2 of 3");
  assert_int_equal(unlink(path), 0);
}

TEST(test_load_stl_binary_beginning_with_solid_read) {
  unsigned char stl[134] = "solid of a scanner that does not know better";
  const float soup[12] = {0, 0, 1, 0, 0, 0, 100, 0, 0, 0, 100, 0};
  stl[80] = 1;
  memcpy(stl + 84, soup, sizeof soup);
  char path[256];
  supine_mesh mesh = load(sample_write(state, "a.stl", stl, sizeof stl, path), NULL, NULL);
  assert_int_equal(mesh.vertex_count, 3);
  assert_int_equal(mesh.triangle_count, 1);
  supine_mesh_free(&mesh);
}

typedef struct reader {
  const char *good;
  const char *bad;
  int wrong;
} reader;

static void *read_often(void *argument) {
  reader *self = argument;
  for (int i = 0; i < 40; ++i) {
    supine_mesh mesh = {0};
    supine_error error = {0};
    const supine_status good = supine_mesh_load(self->good, NULL, &mesh, NULL, &error);
    self->wrong += good != SUPINE_OK || mesh.vertex_count != 4;
    supine_mesh_free(&mesh);
    const supine_status bad = supine_mesh_load(self->bad, NULL, &mesh, NULL, &error);
    self->wrong += bad != SUPINE_ERROR_FORMAT || strstr(error.message, self->bad) == NULL ||
                   strstr(error.message, "index") == NULL;
  }
  return NULL;
}

/* Material files that an OBJ file names are not opened, however the line is written: inotify
 * reports no access. */
TEST(test_load_obj_materials_not_opened) {
  static const char *const lines[] = {"mtllib %s\n", " MtlLib %s\n", "mtl\\\nlib %s\n",
                                      "mtllib \\\n%s\n", "# \\\nmtllib %s\n"};
  char materials[256];
  (void)sample_text(state, "a.mtl", "newmtl a\n", materials);
  const int watch = inotify_init1(IN_NONBLOCK);
  assert_true(watch >= 0);
  assert_true(inotify_add_watch(watch, materials, IN_OPEN) >= 0);
  for (size_t i = 0; i < sizeof lines / sizeof *lines; ++i) {
    char line[300];
    char text[1024];
    char path[256];
    char events[4096];
    (void)snprintf(line, sizeof line, lines[i], materials); /* NOLINT(*-nonliteral) */
    (void)snprintf(text, sizeof text, "%s%susemtl a\n", line, tetrahedron_obj);
    supine_mesh mesh = load(sample_text(state, "a.obj", text, path), NULL, NULL);
    expect_tetrahedron(&mesh);
    if (read(watch, events, sizeof events) >= 0) {
      fail_msg("opened for %s", line);
    }
    supine_mesh_free(&mesh);
  }
  assert_int_equal(close(watch), 0);
  assert_int_equal(unlink(materials), 0);
}

/* Write a glTF file whose numbers are in the file `uri`. */
static const char *gltf_naming(void **state, const char *uri, char path[256]) {
  static const char text[] =
      "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
      "\"nodes\":[{\"mesh\":0}],"
      "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1}]}],"
      "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\","
      "\"min\":[0,0,0],\"max\":[120,120,120]},"
      "{\"bufferView\":1,\"componentType\":5123,\"count\":12,\"type\":\"SCALAR\"}],"
      "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":48},"
      "{\"buffer\":0,\"byteOffset\":48,\"byteLength\":24}],"
      "\"buffers\":[{\"byteLength\":72,\"uri\":\"%s\"}]}";
  char made[2048];
  (void)snprintf(made, sizeof made, text, uri);
  return sample_text(state, "a.gltf", made, path);
}

/* Write the numbers of a tetrahedron for gltf_naming. */
static const char *gltf_numbers(void **state, const char *name, char path[256]) {
  static const float vertices[12] = {0, 0, 0, 120, 0, 0, 0, 120, 0, 0, 0, 120};
  static const uint16_t corners[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
  unsigned char bytes[72];
  memcpy(bytes, vertices, sizeof vertices);
  memcpy(bytes + 48, corners, sizeof corners);
  return sample_write(state, name, bytes, sizeof bytes, path);
}

/* Replace the first `from` in the file of gltf_naming by `to`. Return its path. */
static const char *gltf_with(void **state, const char *from, const char *to, char path[256]) {
  char text[2048];
  char made[2560];
  FILE *file = fopen(gltf_naming(state, "n.bin", path), "rb");
  assert_non_null(file);
  text[fread(text, 1, sizeof text - 1, file)] = '\0';
  assert_int_equal(fclose(file), 0);
  const char *at = strstr(text, from);
  assert_non_null(at);
  (void)snprintf(made, sizeof made, "%.*s%s%s", (int)(at - text), text, to, at + strlen(from));
  return sample_text(state, "a.gltf", made, path);
}

/* assimp reads such files, but takes negative offsets for 0, reads numbers of another accessor, and
 * loses triangles. */
TEST(test_load_gltf_numbers_elsewhere_than_stated_refused) {
  static const struct {
    const char *from, *to, *words;
  } changed[] = {
      {"\"count\":4", "\"count\":3", "it counts 3 positions, but it holds 4"},
      {"\"count\":4", "\"count\":5", "it counts 5 positions, but it holds 4"},
      {"\"count\":4", "\"count\":-4", "impossible"},
      {"\"count\":4", "\"count\":1e300", "impossible"},
      {"\"count\":12", "\"count\":9", "it counts 9 corners, but it holds 12"},
      {"\"count\":12", "\"count\":11", "11 corners, which is no multiple of three"},
      {"\"count\":4", "\"byteOffset\":-12,\"count\":4", "impossible"},
      {"\"count\":4", "\"byteOffset\":12,\"count\":4", "counts 4 positions, but it holds 3"},
      {"\"byteOffset\":0", "\"byteOffset\":-12", "impossible"},
      {"\"byteOffset\":0", "\"byteOffset\":0,\"byteStride\":4", "impossible"},
      {"\"byteLength\":48", "\"byteLength\":36", "counts 4 positions, but it holds 3"},
      {"\"byteLength\":48", "\"byteLength\":72", "counts 4 positions, but it holds 6"},
      {"\"componentType\":5123", "\"componentType\":5121", "counts 12 corners, but it holds 24"},
      {"\"componentType\":5126", "\"componentType\":5123", "not three numbers of single precision"},
      {"VEC3", "VEC2", "not three numbers of single precision"}};
  char numbers[256];
  char path[256];
  (void)gltf_numbers(state, "n.bin", numbers);
  for (size_t i = 0; i < sizeof changed / sizeof *changed; ++i) {
    expect_refused(gltf_with(state, changed[i].from, changed[i].to, path), NULL,
                   SUPINE_ERROR_FORMAT, changed[i].words);
  }
  /* a view that is padded, and one that two accessors read */
  static const char *const right[][2] = {
      {"\"byteLength\":48", "\"byteLength\":50"},
      {"{\"bufferView\":1,\"componentType\":5123,\"count\":12,\"type\":\"SCALAR\"}],"
       "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":48}",
       "{\"bufferView\":0,\"byteOffset\":48,\"componentType\":5123,\"count\":12,\"type\":"
       "\"SCALAR\"}],"
       "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":72}"}};
  for (size_t i = 0; i < sizeof right / sizeof *right; ++i) {
    supine_mesh mesh = load(gltf_with(state, right[i][0], right[i][1], path), NULL, NULL);
    expect_tetrahedron(&mesh);
    supine_mesh_free(&mesh);
  }
  assert_int_equal(unlink(numbers), 0);
}

TEST(test_load_gltf_file_in_same_folder_read) {
  static const char *const names[] = {"n.bin", "./n.bin", "link.bin"};
  char numbers[256];
  char link[256];
  (void)gltf_numbers(state, "n.bin", numbers);
  assert_int_equal(symlink("n.bin", sample_path(state, "link.bin", link)), 0);
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    char path[256];
    supine_mesh mesh = load(gltf_naming(state, names[i], path), NULL, NULL);
    expect_tetrahedron(&mesh);
    supine_mesh_free(&mesh);
  }
  assert_int_equal(unlink(link) + unlink(numbers), 0);
}

/* A glTF file in the folder `in` names files elsewhere that hold what it needs, and what is no file
 * at all. None is opened, and none makes the reader wait. */
TEST(test_load_gltf_other_files_refused) {
  char numbers[256];
  char folder[64];
  char pipe[256];
  char link[256];
  void *inner = folder;
  (void)gltf_numbers(state, "n.bin", numbers);
  (void)snprintf(folder, sizeof folder, "%s/in", (const char *)*state);
  assert_int_equal(mkdir(folder, 0700), 0);
  assert_int_equal(mkfifo(sample_path(&inner, "pipe.bin", pipe), 0600), 0);
  assert_int_equal(symlink("../n.bin", sample_path(&inner, "link.bin", link)), 0);
  const struct {
    const char *uri, *words;
    supine_status status;
  } refused[] = {{"../n.bin", "in another folder", SUPINE_ERROR_FORMAT},
                 {numbers, "in another folder", SUPINE_ERROR_FORMAT},
                 {"..\\\\n.bin", "in another folder", SUPINE_ERROR_FORMAT},
                 {".//n.bin", "in another folder", SUPINE_ERROR_FORMAT},
                 {"./../n.bin", "in another folder", SUPINE_ERROR_FORMAT},
                 {"link.bin", "link to another folder", SUPINE_ERROR_FORMAT},
                 {"pipe.bin", "not a regular file", SUPINE_ERROR_FORMAT},
                 {".", "link to another folder", SUPINE_ERROR_FORMAT},
                 {"..", "link to another folder", SUPINE_ERROR_FORMAT},
                 {"absent\\n.bin", "absent?.bin", SUPINE_ERROR_READ},
                 {"/dev/zero", "in another folder", SUPINE_ERROR_FORMAT}};
  const int watch = inotify_init1(IN_NONBLOCK);
  assert_true(watch >= 0);
  assert_true(inotify_add_watch(watch, numbers, IN_OPEN) >= 0);
  (void)alarm(60); /* ends a reader that waits for the pipe */
  for (size_t i = 0; i < sizeof refused / sizeof *refused; ++i) {
    char path[256];
    char events[4096];
    expect_refused(gltf_naming(&inner, refused[i].uri, path), NULL, refused[i].status,
                   refused[i].words);
    if (read(watch, events, sizeof events) >= 0) {
      fail_msg("opened for %s", refused[i].uri);
    }
    assert_int_equal(unlink(path), 0);
  }
  (void)alarm(0);
  assert_int_equal(close(watch), 0);
  assert_int_equal(unlink(pipe) + unlink(link) + rmdir(folder) + unlink(numbers), 0);
}

/* Pipes, which opening would wait for, are refused. */
TEST(test_load_pipe_refused_without_waiting) {
  static const char *const names[] = {"p.ply", "p.obj", "p.stl", "p.vtp", "p.gltf"};
  (void)alarm(60);
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    char path[256];
    assert_int_equal(mkfifo(sample_path(state, names[i], path), 0600), 0);
    expect_refused(path, NULL, SUPINE_ERROR_READ, "not a regular file");
    assert_int_equal(unlink(path), 0);
  }
  (void)alarm(0);
}

TEST(test_load_in_several_threads_same_results) {
  enum { THREADS = 4 };
  static const char *const names[] = {"0", "1", "2", "3"};
  char paths[THREADS][2][256];
  pthread_t threads[THREADS];
  reader readers[THREADS];
  supine_mesh mesh = sample_tetrahedron();
  for (int t = 0; t < THREADS; ++t) {
    char name[16];
    (void)snprintf(name, sizeof name, "%s.%s", names[t], t % 2 == 0 ? "ply" : "stl");
    assert_int_equal(supine_mesh_save(sample_path(state, name, paths[t][0]), &mesh, NULL, NULL),
                     SUPINE_OK);
    (void)snprintf(name, sizeof name, "%s.obj", names[t]);
    (void)sample_text(state, name, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", paths[t][1]);
    readers[t] = (reader){.good = paths[t][0], .bad = paths[t][1]};
  }
  for (int t = 0; t < THREADS; ++t) {
    assert_int_equal(pthread_create(&threads[t], NULL, read_often, &readers[t]), 0);
  }
  for (int t = 0; t < THREADS; ++t) {
    assert_int_equal(pthread_join(threads[t], NULL), 0);
    assert_int_equal(readers[t].wrong, 0);
    assert_int_equal(unlink(paths[t][0]), 0);
    assert_int_equal(unlink(paths[t][1]), 0);
  }
  supine_mesh_free(&mesh);
}

#define VTP(head, points, polys, data)                                                             \
  "<VTKFile type=\"PolyData\" " head "><PolyData><Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\">" \
  "<Points>" points "</Points><Polys>" polys "</Polys></Piece></PolyData>" data "</VTKFile>"
#define VTP_ASCII(points, connectivity, offsets)                                                   \
  VTP("byte_order=\"LittleEndian\"",                                                               \
      "<DataArray type=\"Float32\" format=\"ascii\">" points "</DataArray>",                       \
      "<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">" connectivity             \
      "</DataArray><DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">" offsets           \
      "</DataArray>",                                                                              \
      "")
#define VTP_POINTS "0 0 0 1 0 0 0 1 0"
#define VTP_BINARY(header, points, encoding, data)                                                 \
  VTP("byte_order=\"LittleEndian\" " header,                                                       \
      "<DataArray type=\"Int8\" format=\"binary\">" points "</DataArray>",                         \
      "<DataArray type=\"Int8\" Name=\"connectivity\" format=\"appended\" offset=\"0\"/>"          \
      "<DataArray type=\"UInt8\" Name=\"offsets\" format=\"appended\" offset=\"12\"/>",            \
      "<AppendedData encoding=\"" encoding "\">_" data "</AppendedData>")

/* The same arrays are read from text and from base64. In base64, a size of 4 or 8 bytes precedes
 * each array. */
TEST(test_load_vtp_each_encoding_same_triangle) {
  static const char *const texts[] = {
      VTP_ASCII(VTP_POINTS, "0 1 2", "3"),
      VTP_BINARY("", "CQAAAAAAAAEAAAABAA==", "base64", "AwAAAAABAg==AQAAAAM="),
      VTP_BINARY("header_type=\"UInt32\"", " CQAA AAAA AAEA\nAAAB AA== ", "base64",
                 "AwAAAAABAg==AQAAAAM="),
  };
  static const double vertices[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  static const uint32_t triangle[3] = {0, 1, 2};
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    char path[256];
    supine_mesh mesh = load(sample_text(state, "a.vtp", texts[i], path), NULL, NULL);
    assert_int_equal(mesh.vertex_count, 3);
    assert_int_equal(mesh.triangle_count, 1);
    assert_memory_equal(mesh.vertices, vertices, sizeof vertices);
    assert_memory_equal(mesh.triangles, triangle, sizeof triangle);
    supine_mesh_free(&mesh);
  }
}

TEST(test_load_vtp_bad_files_refused) {
  static const char *const texts[][2] = {
      {"<VTKFile type=\"ImageData\"></VTKFile>", "no VTKFile of type PolyData"},
      {VTP("byte_order=\"BigEndian\"", "", "", ""), "big-endian"},
      {"<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"4\" NumberOfStrips=\"1\">",
       "strips"},
      {VTP("compressor=\"vtkLZ4DataCompressor\"", "", "", ""), "compressor is not zlib"},
      {"<VTKFile type=\"PolyData\"></VTKFile>", "no element Piece"},
      {"<VTKFile type=\"PolyData\"><Piece ></Piece><Piece ></Piece></VTKFile>",
       "several Piece elements"},
      {"<VTKFile type=\"PolyData\"><Piece NumberOfPoints=\"-3\"></Piece></VTKFile>", "invalid"},
      {VTP("", "", "", ""), "no array of points"},
      {VTP_ASCII("0 0 0 1 0 0 0 1", "0 1 2", "3"), "truncated or damaged"},
      {VTP_ASCII(VTP_POINTS, "0 1 2", "-3"), "offsets of its polygons are invalid"},
      {VTP_ASCII(VTP_POINTS, "0 1", "3"), "truncated or damaged"},
      {VTP_ASCII(VTP_POINTS, "0 1 2 0 2 1", "3 6"), "longer than its counts"},
      {VTP_BINARY("", "CAAAAAAAAAEAAAABAA==", "base64", "AwAAAAABAg==AQAAAAM="), "damaged"},
      {VTP_BINARY("header_type=\"UInt64\"", "CQAAAAAAAAEAAAABAA==", "base64", ""), "damaged"},
      {VTP_BINARY("", "CQAAAAAAAAEAAAABAA==", "base64", "AwAAAAABAg=="), "damaged"},
      {VTP_BINARY("", "CQAAAAAAAAEAAAABAA==", "raw", "AwAAAAABAg==AQAAAAM="), "damaged"},
  };
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    refuse_text(state, "a.vtp", texts[i][0], SUPINE_ERROR_FORMAT, texts[i][1]);
  }
}

TEST_GROUP(sample_folder_create, sample_folder_remove)
