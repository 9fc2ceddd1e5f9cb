/* SPDX-License-Identifier: MIT */
/* VTK XML PolyData: its arrays compressed and appended, for one surface or a series of one
 * topology. */
#ifndef SUPINE_MESH_VTP_H
#define SUPINE_MESH_VTP_H

#include "mesh/io/save.h"

enum { VTP_ARRAYS = 8, VTP_FIRST_OF_POINTS = 3 };

typedef struct vtp vtp;

/* Put the bytes of item `i` of an array at *at, and move *at past them. */
typedef void vtp_put(const vtp *file, size_t i, unsigned char **at);

/* One array of every frame. */
typedef struct vtp_array {
  const char *type;
  const char *name;
  unsigned components;
  size_t item; /* bytes of a point or triangle: 1, 4 or 12 */
  size_t count;
  bool still; /* the same in every frame: written once */
  vtp_put *put;
} vtp_array;

struct vtp {
  mesh_writer writer;
  vtp_array arrays[VTP_ARRAYS]; /* points, connectivity, offsets, then what points carry */
  size_t array_count;
  size_t frames;
  const double *times; /* [frames] s; NULL: one surface, without a time */
  uint64_t *offsets;   /* [frames, array_count] */
  size_t next;         /* frame */
  uint64_t written;    /* bytes of the arrays so far */
  size_t threads;
  unsigned char *raw;    /* a block for each thread */
  unsigned char *packed; /* room for any array's blocks */
  uint64_t *sizes;       /* of its blocks */
  const vtp_array *packing;
};

/* Which arrays there are, and room for them; SUPINE_ERROR_MEMORY. */
supine_status supine_mesh_vtp_begin(vtp *file);
void supine_mesh_vtp_end(vtp *file);

/* Everything before the arrays; as long as before whatever their offsets are. */
void supine_mesh_vtp_head(const vtp *file, FILE *out);
/* The arrays of the next frame; SUPINE_ERROR_MEMORY. */
supine_status supine_mesh_vtp_frame(vtp *file, FILE *out);
/* Everything after them. */
void supine_mesh_vtp_foot(FILE *out);

#endif
