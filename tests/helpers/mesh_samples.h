/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Small surfaces with known volume, and a folder for temporary files. */
#ifndef SUPINE_TEST_MESH_SAMPLES_H
#define SUPINE_TEST_MESH_SAMPLES_H

#include "mesh/mesh.h"
#include "tests/helpers/test.h"

/* Return a mesh with copies of the given arrays. Free the mesh by supine_mesh_free. */
static inline supine_mesh sample_make(size_t vertex_count, const double *vertices,
                                      size_t triangle_count, const uint32_t *triangles) {
  supine_mesh mesh = {.vertex_count = vertex_count, .triangle_count = triangle_count};
  mesh.vertices = malloc((3 * vertex_count + 1) * sizeof *vertices);
  mesh.triangles = malloc((3 * triangle_count + 1) * sizeof *triangles);
  assert_non_null(mesh.vertices);
  assert_non_null(mesh.triangles);
  if (vertex_count > 0) {
    memcpy(mesh.vertices, vertices, 3 * vertex_count * sizeof *vertices);
  }
  if (triangle_count > 0) {
    memcpy(mesh.triangles, triangles, 3 * triangle_count * sizeof *triangles);
  }
  return mesh;
}

/* Return the tetrahedron with corners at the origin and at 120 mm on each axis. Its volume is 120^3
 * / 6 = 288000 mm^3. */
static inline supine_mesh sample_tetrahedron(void) {
  static const double vertices[] = {0, 0, 0, 120, 0, 0, 0, 120, 0, 0, 0, 120};
  static const uint32_t triangles[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
  return sample_make(4, vertices, 4, triangles);
}

/* Return a box with its lowest corner at (-30, 10, -50) and sides of 100, 110 and 130 mm. Its
 * volume is 1430000 mm^3. */
static inline supine_mesh sample_box(void) {
  static const double vertices[] = {-30, 10, -50, 70, 10, -50, 70, 120, -50, -30, 120, -50,
                                    -30, 10, 80,  70, 10, 80,  70, 120, 80,  -30, 120, 80};
  static const uint32_t triangles[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                       1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};
  return sample_make(8, vertices, 12, triangles);
}

/* Header of an ASCII PLY file. Append a row "x y z" for each vertex and a row "3 a b c" for each
 * face. */
#define SAMPLE_PLY(vertices, faces)                                                                \
  "ply\nformat ascii 1.0\nelement vertex " #vertices                                               \
  "\nproperty float x\nproperty float y\nproperty float z\nelement face " #faces                   \
  "\nproperty list uint int vertex_indices\nend_header\n"

/* Set `path` to the path of the file `name` in the group's temporary folder, and return `path`. */
static inline const char *sample_path(void **state, const char *name, char path[256]) {
  (void)snprintf(path, 256, "%s/%s", (const char *)*state, name);
  return path;
}

static inline const char *sample_write(void **state, const char *name, const void *bytes,
                                       size_t size, char path[256]) {
  FILE *file = fopen(sample_path(state, name, path), "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(bytes, 1, size, file), size);
  assert_int_equal(fclose(file), 0);
  return path;
}

static inline const char *sample_text(void **state, const char *name, const char *text,
                                      char path[256]) {
  return sample_write(state, name, text, strlen(text), path);
}

/* Make the temporary folder of a group of tests. No test may leave a file in it. */
static inline int sample_folder_create(void **state) {
  static char folder[] = "/tmp/supine-mesh-XXXXXX";
  *state = mkdtemp(folder);
  return *state == NULL ? -1 : 0;
}

static inline int sample_folder_remove(void **state) {
  return rmdir(*state);
}

#endif
