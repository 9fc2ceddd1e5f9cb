/* SPDX-License-Identifier: MIT */
/* Check faces with any number of corners, and cut them into triangles. */
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "mesh/io/read.h"

/* Compute a face's normal, whose length is twice the face's area, as the sum of the normals of all
 * triangles of the fan around corner 0. */
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

/* Return whether all triangles of the fan around corner `start` face to the side of `normal`. */
static bool is_fan(const double *vertices, const uint32_t *corner, size_t count, size_t start,
                   const double normal[3]) {
  bool fan = true;
  for (size_t i = 1; fan && i + 1 < count; ++i) {
    double own[3];
    supine_normal(vertices + 3 * (size_t)corner[start],
                  vertices + 3 * (size_t)corner[(start + i) % count],
                  vertices + 3 * (size_t)corner[(start + i + 1) % count], own);
    fan = supine_dot(normal, own) > 0.0;
  }
  return fan;
}

/* Cut a face into a fan of triangles around the first corner whose fan lies inside the face, or
 * around corner 0 if there is none. Write 3 (count - 2) vertex indices to `out`. */
static void cut(const double *vertices, const uint32_t *corner, size_t count, uint32_t *out) {
  double normal[3];
  size_t start = 0;
  find_normal(vertices, corner, count, normal);
  while (start < count && !is_fan(vertices, corner, count, start, normal)) {
    ++start;
  }
  for (size_t i = 1; i + 1 < count; ++i) {
    *out++ = corner[start % count];
    *out++ = corner[(start + i) % count];
    *out++ = corner[(start + i + 1) % count];
  }
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
    return supine_error_memory(error, "%zu triangles of %s", capacity, faces->path);
  }
  faces->mesh->triangles = grown;
  faces->capacity = capacity;
  return SUPINE_OK;
}

supine_status supine_io_faces_add(mesh_faces *faces, const double *corners, size_t count,
                                  supine_error *error) {
  supine_mesh *mesh = faces->mesh;
  const size_t number = faces->count++;
  SUPINE_REFUSE_IF(count > MESH_CORNERS_MAX, error, SUPINE_ERROR_FORMAT,
                   "%s: face %zu has %zu corners, more than %d; cut it into triangles", faces->path,
                   number, count, MESH_CORNERS_MAX);
  uint32_t corner[MESH_CORNERS_MAX];
  for (size_t k = 0; k < count; ++k) {
    SUPINE_REFUSE_IF(
        !(corners[k] >= 0.0 && corners[k] < (double)mesh->vertex_count), error, SUPINE_ERROR_FORMAT,
        "%s: face %zu names vertex %.0f, but the number of vertices is %zu; save the mesh again",
        faces->path, number, corners[k], mesh->vertex_count);
    corner[k] = (uint32_t)corners[k];
  }
  if (count < 3) {
    ++faces->dropped;
    return SUPINE_OK;
  }
  SUPINE_TRY(make_room(faces, count - 2, error));
  cut(mesh->vertices, corner, count, mesh->triangles + 3 * mesh->triangle_count);
  mesh->triangle_count += count - 2;
  return SUPINE_OK;
}
