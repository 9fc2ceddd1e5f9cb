/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the image of --ventilation, and print how much air each lung and each label takes in. */
#ifndef SUPINE_DEFORM_VENTILATION_H
#define SUPINE_DEFORM_VENTILATION_H

#include "program/command/deform_content.h"

/* Write the ventilation between the states of a field to wanted->ventilation, on the voxels of the
 * image or else of the labels. Print the sums over the lungs beside what their surfaces take in,
 * and those over the labels. */
supine_status supine_command_deform_ventilation(const supine_deform_content *wanted,
                                                const supine_basis *basis,
                                                const supine_deformation *moved,
                                                const supine_field *field, supine_error *error);

#endif
