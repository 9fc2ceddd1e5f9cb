/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Where the frames of a breath go: one VTP file over time or a series of them, or safetensors. */
#ifndef SUPINE_BREATH_OUTPUT_H
#define SUPINE_BREATH_OUTPUT_H

#include "mesh/mesh.h"

#include "program/breath/breath_course.h"

typedef struct breath_output breath_output;

/* What goes in. All of it must stay until the output is closed. */
typedef struct breath_content {
  const supine_basis *basis;
  const supine_mesh *rest;               /* the basis' surface */
  const double *origin;                  /* [N, 3] where displacement counts from */
  const char *origin_name;               /* "the scan" */
  const supine_mesh_save_options *frame; /* axes and units of VTP files */
  const breath_course *course;
  const double *volumes; /* [T, G] mL, gas and tissue */
  const char *made_by;   /* command line, for the metadata */
} breath_content;

/* Begins an output; nothing shows under its name before supine_command_breath_output_commit.
 *
 *     NAME.vtp           one file over time, the triangles once
 *     NAME.pvd           that file, and a folder NAME with a VTP file a frame
 *     NAME.safetensors   positions F32 [T, N, 3], triangles U32 [M, 3], time F64 [T],
 *                        volume F64 [T, G], gravity F64 [T, 3]
 *     NAME               a folder with breath.pvd and a VTP file a frame
 *
 * A folder must not be there yet, or be empty. VTP files have positions and displacements to 1/256
 * mm, normals, each vertex's lung, and as field data time, gravity and volumes.
 * SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_command_breath_output_open(const char *path, const breath_content *content,
                                                breath_output **output, supine_error *error);

/* About how many bytes an output of that name will have. */
double supine_command_breath_output_size(const char *path, const breath_content *content);

/* Adds the next frame, [N, 3]. */
supine_status supine_command_breath_output_add(breath_output *output, const float *xyz,
                                               supine_error *error);

/* Gives the output its name. */
supine_status supine_command_breath_output_commit(breath_output *output, supine_error *error);

/* Release the output and remove what was not committed. NULL is legal. */
void supine_command_breath_output_close(breath_output *output);

#endif
