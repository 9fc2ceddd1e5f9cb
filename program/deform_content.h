/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the points, fields and images of 'supine deform', for structures made by 'supine embed'. */
#ifndef SUPINE_DEFORM_CONTENT_H
#define SUPINE_DEFORM_CONTENT_H

#include <supine/runtime.h>

#include "mesh/io/image.h"

#include "program/options/basis_input.h"
#include "program/options/state_options.h"

typedef struct supine_deform_content {
  const char *path;   /* file of -o; NULL: none */
  const char *field;  /* file of --field-out; NULL: none */
  const char *image;  /* file of --image; NULL: none */
  const char *labels; /* file of --labels; NULL: none */
  bool inverse, density;
  supine_image source; /* image of --image or --labels, once read */
} supine_deform_content;

extern const supine_option supine_command_deform_content_options[];

/* A state of the lungs, and the state that displacements start from. */
typedef struct supine_deformation {
  supine_state state;
  supine_pose pose;
  supine_reference_pose from; /* state that displacements start from, and that images show */
  bool from_given;            /* --from was given; else `from` is the scan */
  supine_expected expected;
  supine_mesh_save_options save; /* axes and unit of the output, and its comment */
} supine_deformation;

/* Check that the options fit each other; else return SUPINE_ERROR_ARGUMENT. */
supine_status supine_command_deform_content_check(const supine_deform_content *wanted,
                                                  supine_error *error);

/* Read the image of --image or --labels. With --density, check that it is in Hounsfield units; with
 * --image alone, print that densities are not scaled. */
supine_status supine_command_deform_content_read(supine_deform_content *wanted, const char *command,
                                                 supine_error *error);

/* Return whether points, a field or an image are to be written instead of a surface. */
bool supine_command_deform_content_wanted(const supine_deform_content *wanted);

/* Write the points, field or image, and print what was written. */
supine_status supine_command_deform_content(const supine_deform_content *wanted,
                                            const supine_basis *basis,
                                            const supine_deformation *moved, supine_error *error);

#endif
