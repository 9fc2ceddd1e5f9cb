/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Where the frames of a breath go: a series for ParaView, or one safetensors file. */
#ifndef SUPINE_BREATH_OUTPUT_H
#define SUPINE_BREATH_OUTPUT_H

#include "mesh/mesh.h"

#include "runtime/breath/breath_course.h"

typedef struct breath_output breath_output;

/* Begins an output; nothing shows under its name before supine_command_breath_output_commit.
 *
 *     NAME.safetensors   positions F32 [T, N, 3], triangles U32 [M, 3], time F64 [T],
 *                        volume F64 [T, G], gravity F64 [T, 3]
 *     NAME.pvd           that file, and a folder NAME with a VTP file a frame
 *     NAME               a folder with breath.pvd and a VTP file a frame
 *
 * A folder must not be there yet, or be empty. `rest` is the surface at rest; `frame` says axes and
 * units of the VTP files.
 * SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_command_breath_output_open(const char *path, const supine_mesh *rest,
                                                const supine_mesh_save_options *frame,
                                                const breath_course *course, breath_output **output,
                                                supine_error *error);

/* Adds the next frame, [N, 3]. */
supine_status supine_command_breath_output_add(breath_output *output, const float *xyz,
                                               supine_error *error);

/* Gives the output its name; volumes [T, G] mL; made_by in one line. */
supine_status supine_command_breath_output_commit(breath_output *output, const double *volumes,
                                                  const char *made_by, supine_error *error);

/* Releases; removes what was not committed. NULL is legal. */
void supine_command_breath_output_close(breath_output *output);

#endif
