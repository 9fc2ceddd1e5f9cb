/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the surfaces, points, fields and images of 'supine deform'. */
#ifndef SUPINE_DEFORM_CONTENT_H
#define SUPINE_DEFORM_CONTENT_H

#include <supine/runtime.h>

#include "mesh/image/image.h"
#include "precompute/warp/field.h"
#include "precompute/warp/tissue.h"

#include "program/options/basis_input.h"
#include "program/options/fiducials.h"
#include "program/options/hilum.h"
#include "program/options/state_options.h"

enum { SUPINE_DEFORM_RIGID_MOST = 64 };

/* The values of --rigid. */
typedef struct supine_deform_rigid {
  size_t count;
  double value[SUPINE_DEFORM_RIGID_MOST];
} supine_deform_rigid;

/* The soft tissue of the image, which is found once for all states. */
typedef struct supine_deform_tissue {
  bool found;
  supine_tissue soft;
} supine_deform_tissue;

typedef struct supine_deform_content {
  /* Files of -o, --field-out, --ventilation, --image and --labels; NULL if not given. */
  const char *path, *field, *ventilation, *image, *labels;
  const char *labels_path; /* output of --labels, if --image is given, too; or NULL */
  bool inverse, density;
  bool vertices; /* whether a CSV file has a row for each vertex */
  supine_deform_rigid rigid;
  supine_image source, label_source; /* the image and the label map to move, once read */
  supine_deform_tissue *tissue;      /* shared by all states */
} supine_deform_content;

extern const supine_option supine_command_deform_content_options[];

/* A state of the lungs to write, and the settings of its output files. */
typedef struct supine_deformation {
  supine_state state;
  supine_pose pose;
  supine_options_reference_pose from; /* state in the input image, where displacements are 0 */
  bool allow_folds;                   /* whether folded fields cause only a warning */
  bool from_given;                    /* whether --from was given; otherwise `from` is the scan */
  float *deviation;     /* [N, 3] of a sample from the pose, mm; NULL for the pose itself */
  supine_errors errors; /* of positions, and of displacements from `from` */
  supine_hilum hilum;
  bool subtract_hilum;           /* whether outputs are in the frame of the hilum */
  bool registered;               /* whether outputs are after a registration at points */
  supine_motion motion[2];       /* of that: for the state, and for `from` */
  supine_mesh_save_options save; /* axes, unit and comment of the output */
} supine_deformation;

/* Return SUPINE_ERROR_ARGUMENT if an option is missing, or does not fit the others. */
supine_status supine_command_deform_content_check(const supine_deform_content *wanted,
                                                  supine_error *error);

/* Read the images of --image and --labels. With --density, check that it is in Hounsfield units;
 * without it, print that the densities of --image are not scaled. */
supine_status supine_command_deform_content_read(supine_deform_content *wanted, const char *command,
                                                 supine_error *error);

/* Write the surface, the points, the field and the images, and print what was written. */
supine_status supine_command_deform_content(const supine_deform_content *wanted,
                                            const supine_basis *basis, supine_deformation *moved,
                                            supine_error *error);

/* Write where each structure is, or each vertex if `each` is true, as CSV or markups. */
supine_status supine_command_deform_points(const char *path, const supine_basis *basis,
                                           const supine_deformation *moved, bool each,
                                           supine_error *error);

/* Write a surface, and print its largest displacement and its volume. */
supine_status supine_command_deform_surface(const char *path, const supine_basis *basis,
                                            supine_deformation *moved, supine_error *error);

/* Write the field, the ventilation, the image and the label map that are wanted. */
supine_status supine_command_deform_images(const supine_deform_content *wanted,
                                           const supine_basis *basis,
                                           const supine_deformation *moved, supine_error *error);

/* Write the file of --ventilation: the air that each voxel of the image, or else of the label map,
 * takes in between the two states that the field joins. Print what each lung takes in by the voxels
 * and by its surface, and what each label takes in. */
supine_status supine_command_deform_ventilation(const supine_deform_content *wanted,
                                                const supine_basis *basis,
                                                const supine_deformation *moved,
                                                const supine_field *field, supine_error *error);

#endif
