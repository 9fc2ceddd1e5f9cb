/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the frames of a breath: VTP over time, or safetensors. */
#ifndef SUPINE_BREATH_OUTPUT_H
#define SUPINE_BREATH_OUTPUT_H

#include "mesh/mesh.h"

#include "program/options/breath_frames.h"

#define SUPINE_BREATH_ENDINGS ".vtp or .safetensors"

typedef struct breath_output breath_output;

/* Content of an output. All of it must outlive the output. */
typedef struct breath_content {
  const supine_mesh *rest; /* reference surface of the basis */
  const double *origin;    /* [N, 3] positions from which displacement is measured, mm */
  const char *origin_name; /* their name in comments, such as "the scan" */
  const supine_mesh_save_options *frame; /* axes and units of VTP files */
  const breath_frames *frames;
  const char *made_by; /* command line, for the metadata */
} breath_content;

/* Begin an output:
 *
 *     NAME.vtp           one file over time, the triangles once
 *     NAME.safetensors   positions F32 [T, N, 3], triangles U32 [M, 3], time F64 [T],
 *                        volume F64 [T, G], gravity F64 [T, 3]
 *
 * A VTP file has positions and displacements rounded to 1/256 mm, normals, each vertex's lung, and
 * as field data gravity and volumes.
 * @param path  must outlive the output
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_command_breath_output_open(const char *path, const breath_content *content,
                                                breath_output **output, supine_error *error);

/* Add the positions [N, 3] of the next frame, mm. */
supine_status supine_command_breath_output_add(breath_output *output, const float *xyz,
                                               supine_error *error);

/* Complete the output file. */
supine_status supine_command_breath_output_commit(breath_output *output, supine_error *error);

/* Release the output, and remove its file unless it is complete. NULL is legal. */
void supine_command_breath_output_close(breath_output *output);

#endif
