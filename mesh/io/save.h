/* SPDX-License-Identifier: MIT */
/* Writing surfaces, one function a format. */
#ifndef SUPINE_MESH_SAVE_H
#define SUPINE_MESH_SAVE_H

#include <stdio.h>

#include "mesh/mesh.h"

/** What the writers get: the mesh and how to write it. */
typedef struct mesh_writer {
  FILE *out;
  const supine_mesh *mesh;
  const double *rest;          /**< NULL: no displacement */
  const float *expected_error; /**< NULL: none */
  const float *normals;        /**< NULL: none */
  const unsigned char *lung;   /**< NULL: none */
  const supine_mesh_field *fields;
  size_t field_count;
  unsigned char source[3]; /**< which of x, y, z each coordinate of the file is */
  double factor[3];        /**< and its sign over the file's unit */
  bool mirrored;           /**< left-handed axes: triangles are written in the other sense */
  double quantum;          /**< of lengths in the file's units, a power of two; 0: exact */
  char space[4];           /**< "LPS", "RAS", ... */
  char unit[24];           /**< of lengths: "mm", "cm", ... */
  char comment[256];       /**< one printable line, "" where there is none */
} mesh_writer;

/** Vertex i in the file's axes and units. */
void supine_mesh_writer_position(const mesh_writer *writer, size_t i, float position[3]);
/** Displacement of vertex i in the file's axes and units, and its length. */
void supine_mesh_writer_displacement(const mesh_writer *writer, size_t i, float displacement[4]);

/** Normal of vertex i in the file's axes. */
void supine_mesh_writer_normal(const mesh_writer *writer, size_t i, float normal[3]);

/** Corners of triangle t, in the file's sense. */
void supine_mesh_writer_triangle(const mesh_writer *writer, size_t t, uint32_t corner[3]);

/** Fills a writer, but for `out`, from what supine_mesh_save is given. */
void supine_mesh_writer_begin(const supine_mesh *mesh, const supine_mesh_save_options *options,
                              mesh_writer *writer);
/** Whether a surface fits the formats; statuses as supine_mesh_save. */
supine_status supine_mesh_writer_check(const char *path, const supine_mesh *mesh,
                                       supine_error *error);

/** Little-endian bytes of `count` values; at grows. */
void supine_mesh_put_f32(unsigned char **at, const float *values, size_t count);
void supine_mesh_put_u32(unsigned char **at, const uint32_t *values, size_t count);

/** Write a surface in one format. Write errors stay in the stream, for the caller to find.
 * @retval SUPINE_ERROR_MEMORY */
typedef supine_status save_function(const mesh_writer *writer);
#define SUPINE_MESH_SAVE(name) save_function supine_mesh_save_##name;
SUPINE_MESH_FORMATS(SUPINE_MESH_SAVE, SUPINE_MESH_SAVE)
#undef SUPINE_MESH_SAVE

#endif
