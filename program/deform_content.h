/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The part of 'supine deform' that moves what 'supine embed' made: points, fields, images. */
#ifndef SUPINE_DEFORM_CONTENT_H
#define SUPINE_DEFORM_CONTENT_H

#include <supine/runtime.h>

#include "mesh/image/image.h"

#include "program/options/expected.h"
#include "program/options/state.h"

typedef struct supine_deform_content {
  const char *path;   /* -o */
  const char *field;  /* --field-out */
  const char *image;  /* --image */
  const char *labels; /* --labels */
  bool inverse, density;
  supine_image source; /* image of --image or --labels, once read */
} supine_deform_content;

extern const supine_option supine_command_deform_content_options[];

/* Check that the options fit each other; return an exit code. */
int supine_command_deform_content_check(const supine_deform_content *wanted, const char *command);

/* Reads what --image or --labels names, and says whether densities are scaled; an exit code. */
int supine_command_deform_content_read(supine_deform_content *wanted, const char *command);

/* Is what is wanted none of a surface's files? */
bool supine_command_deform_content_wanted(const supine_deform_content *wanted);

/* Writes what is wanted, and says what it wrote; an exit code.
 * @param from      what displacements count from, and the state that images are in
 * @param other     that is not the scan
 * @param expected  errors, for CSV
 * @param frame     axes and unit of CSV */
int supine_command_deform_content(const supine_deform_content *wanted, const char *command,
                                  const supine_basis *basis, const supine_pose *pose,
                                  const supine_reference_pose *from, bool other,
                                  const supine_expected *expected,
                                  const supine_mesh_save_options *frame);

#endif
