/* SPDX-License-Identifier: MIT */
/* Check faces with any number of corners, and cut them into triangles. */
#include <stdlib.h>
#include <string.h>

#include "sh/base/vec3.h"

#include "mesh/io/read.h"

/* Return twice the area of the triangle abc times the length of `normal`: positive if its corners
 * run counter-clockwise about `normal`. */
static double turn(const double normal[3], const double *a, const double *b, const double *c) {
  double own[3];
  supine_normal(a, b, c, own);
  return supine_dot(normal, own);
}

/* Compute a normal of the face, as long as twice its area: the sum over the triangles at its first
 * corner. */
static void find_normal(const double *vertices, const uint32_t *corner, size_t count,
                        double normal[3]) {
  memset(normal, 0, 3 * sizeof *normal);
  for (size_t i = 1; i + 1 < count; ++i) {
    double part[3];
    supine_normal(vertices + 3 * (size_t)corner[0], vertices + 3 * (size_t)corner[i],
                  vertices + 3 * (size_t)corner[i + 1], part);
    for (int k = 0; k < 3; ++k) {
      normal[k] += part[k];
    }
  }
}

/* Report whether corner i can be cut off: a left turn there, with no other corner inside. */
static bool is_ear(const double *vertices, const uint32_t *corner, size_t count, size_t i,
                   const double normal[3]) {
  const double *a = vertices + 3 * (size_t)corner[(i + count - 1) % count];
  const double *b = vertices + 3 * (size_t)corner[i];
  const double *c = vertices + 3 * (size_t)corner[(i + 1) % count];
  bool ear = turn(normal, a, b, c) > 0.0;
  for (size_t k = 2; ear && k + 1 < count; ++k) {
    const double *p = vertices + 3 * (size_t)corner[(i + k) % count];
    ear = !(turn(normal, a, b, p) > 0.0 && turn(normal, b, c, p) > 0.0 &&
            turn(normal, c, a, p) > 0.0);
  }
  return ear;
}

/* Cut one ear after another into a triangle, starting at corner 1. A face that crosses itself may
 * have no ear; then cut off the next corner. `corner` is overwritten; `out` takes 3 (count - 2)
 * indices. */
static void cut(const double *vertices, uint32_t *corner, size_t count, uint32_t *out) {
  double normal[3];
  find_normal(vertices, corner, count, normal);
  size_t at = 1;
  for (; count > 3; --count) {
    size_t tried = 0;
    while (tried < count && !is_ear(vertices, corner, count, (at + tried) % count, normal)) {
      ++tried;
    }
    at = (at + tried) % count;
    *out++ = corner[(at + count - 1) % count];
    *out++ = corner[at];
    *out++ = corner[(at + 1) % count];
    memmove(corner + at, corner + at + 1, (count - at - 1) * sizeof *corner);
    at = at == count - 1 ? 0 : at;
  }
  memcpy(out, corner, 3 * sizeof *out);
}

static supine_status make_room(mesh_faces *faces, size_t triangles, supine_error *error) {
  if (faces->mesh->triangle_count + triangles <= faces->capacity) {
    return SUPINE_OK;
  }
  const size_t capacity = 2 * faces->capacity + MESH_CORNERS_MAX;
  uint32_t *grown = capacity > MESH_TRIANGLES_MAX
                        ? NULL
                        : realloc(faces->mesh->triangles, 3 * capacity * sizeof *grown);
  if (grown == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory for %zu triangles",
                            faces->path, capacity);
  }
  faces->mesh->triangles = grown;
  faces->capacity = capacity;
  return SUPINE_OK;
}

supine_status supine_mesh_faces_add(mesh_faces *faces, const double *corners, size_t count,
                                    supine_error *error) {
  supine_mesh *mesh = faces->mesh;
  const size_t number = faces->count++;
  if (count > MESH_CORNERS_MAX) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: face %zu has %zu corners, more than %d; cut it into triangles",
                            faces->path, number, count, MESH_CORNERS_MAX);
  }
  uint32_t corner[MESH_CORNERS_MAX];
  for (size_t k = 0; k < count; ++k) {
    if (!(corners[k] >= 0.0 && corners[k] < (double)mesh->vertex_count)) {
      return supine_error_set(
          error, SUPINE_ERROR_FORMAT,
          "%s: face %zu names vertex %.0f, but there are %zu; save the mesh again", faces->path,
          number, corners[k], mesh->vertex_count);
    }
    corner[k] = (uint32_t)corners[k];
  }
  if (count < 3) { /* a point or a line */
    ++faces->dropped;
    return SUPINE_OK;
  }
  const supine_status status = make_room(faces, count - 2, error);
  if (status == SUPINE_OK) {
    cut(mesh->vertices, corner, count, mesh->triangles + 3 * mesh->triangle_count);
    mesh->triangle_count += count - 2;
  }
  return status;
}
