/* SPDX-License-Identifier: MIT */
/* VTK XML PolyData with compressed appended arrays, for one surface or a series with one
 * topology. */
#ifndef SUPINE_MESH_VTP_H
#define SUPINE_MESH_VTP_H

#include "mesh/io/save.h"

enum { VTP_ARRAYS = 8, VTP_FIRST_OF_POINTS = 3 };

typedef struct vtp vtp;

/* Put the bytes of item `i` of an array at *at, and advance *at. */
typedef void vtp_put(const vtp *file, size_t i, unsigned char **at);

/* One array in all frames. */
typedef struct vtp_array {
  const char *type;
  const char *name;
  unsigned components;
  size_t item; /* bytes per point or triangle: 1, 4 or 12 */
  size_t count;
  bool still; /* equal in all frames: written once */
  vtp_put *put;
} vtp_array;

struct vtp {
  mesh_writer writer;
  vtp_array arrays[VTP_ARRAYS]; /* points, connectivity, offsets, then point data */
  size_t array_count;
  size_t frames;
  const double *times; /* [frames] s; NULL: one surface, without a time */
  uint64_t *offsets;   /* [frames, array_count] */
  size_t next;         /* frame to write */
  uint64_t written;    /* bytes of arrays written */
  size_t threads;
  unsigned char *raw;    /* a block for each thread */
  unsigned char *packed; /* room for the blocks of any array */
  uint64_t *sizes;       /* of its blocks */
  const vtp_array *packing;
};

/* List the arrays and allocate room for them; SUPINE_ERROR_MEMORY. */
supine_status supine_mesh_vtp_begin(vtp *file);
void supine_mesh_vtp_end(vtp *file);

/* Write everything before the arrays; its length does not depend on their offsets. */
void supine_mesh_vtp_head(const vtp *file, FILE *out);
/* Write the arrays of the next frame; SUPINE_ERROR_MEMORY. */
supine_status supine_mesh_vtp_frame(vtp *file, FILE *out);
/* Write everything after the arrays. */
void supine_mesh_vtp_foot(FILE *out);

#endif
