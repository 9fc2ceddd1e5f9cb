/* SPDX-License-Identifier: MIT */
/* Write surfaces, one function for each format. */
#ifndef SUPINE_MESH_SAVE_H
#define SUPINE_MESH_SAVE_H

#include <stdio.h>

#include "mesh/mesh.h"

/** Input of the writers: the mesh and how to write it. */
typedef struct mesh_writer {
  FILE *out;
  const supine_mesh *mesh;
  supine_mesh_save_options options;
  unsigned char source[3]; /**< axis of `mesh`, 0 to 2, that gives each coordinate of the file */
  double factor[3];   /**< for each axis of the file: 1 or -1, divided by the file's unit in mm */
  bool mirrored;      /**< whether the file's axes are left-handed: triangles are then reversed */
  char space[4];      /**< letters of the file's axes: "LPS", "RAS", ... */
  char unit[24];      /**< unit of lengths: "mm", "cm", ... */
  char comment[1536]; /**< one printable line, or "" */
} mesh_writer;

/** Compute the position of vertex i in the file's axes and unit. */
void supine_io_writer_position(const mesh_writer *writer, size_t i, float position[3]);
/** Compute the displacement of vertex i in the file's axes and unit, followed by its length. */
void supine_io_writer_displacement(const mesh_writer *writer, size_t i, float displacement[4]);

/** Find the normal of vertex i in the file's axes. */
void supine_io_writer_normal(const mesh_writer *writer, size_t i, float normal[3]);

/** Find the corners of triangle t, in the order in which the file lists them. */
void supine_io_writer_triangle(const mesh_writer *writer, size_t t, uint32_t corner[3]);

/** Fill a writer, except `out`, from the arguments of supine_mesh_save. */
void supine_io_writer_begin(const supine_mesh *mesh, const supine_mesh_save_options *options,
                            mesh_writer *writer);
/** Check that files can hold a surface of this size, and that its coordinates are finite. */
supine_status supine_io_writer_check(const char *path, const supine_mesh *mesh,
                                     supine_error *error);

/** Write a surface in one format. The caller checks the stream for write errors. */
typedef void save_function(const mesh_writer *writer);
#define SUPINE_MESH_SAVE(name) save_function supine_io_save_##name;
SUPINE_MESH_FORMATS(SUPINE_MESH_SAVE, SUPINE_MESH_SAVE)
#undef SUPINE_MESH_SAVE

#endif
