/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Ventilation voxel by voxel: how much air the tissue takes in between two states. */
#ifndef SUPINE_VENTILATION_H
#define SUPINE_VENTILATION_H

#include "precompute/warp/field.h"

/** What a part of the lungs holds before a breath, and what it takes in. */
typedef struct supine_ventilated {
  double label; /**< value in the label map, or index of a lung */
  double held;  /**< volume of air and tissue before the breath, mL */
  double taken; /**< gain of volume in the breath, mL */
} supine_ventilated;

/** Largest number of labels that supine_warp_ventilated_labels counts. */
enum { SUPINE_VENTILATED_MOST = 256 };

/** Compute det(I + du/dx) - 1 of a field u at the voxels x of an image that lie in the lungs: the
 * gain of volume of the tissue there, divided by its volume before. Tissue gains and loses volume
 * only as air. Voxels outside the lungs are NaN.
 * @param field  from the state of the image to the end of the breath
 * @param frame  gives the voxels
 * @param made   F32; release with supine_image_free
 * @param lungs  [SUPINE_LUNGS_MAX] sums over the voxels of each lung, written */
supine_status supine_warp_ventilation(const supine_field *field, const supine_image *frame,
                                      supine_image *made, supine_ventilated *lungs,
                                      supine_error *error);

/** Sum ventilation over the voxels of each label, in the order of the labels; voxels of label 0 and
 * outside the lungs are left out.
 * @param ventilation  of supine_warp_ventilation, on the voxels of `labels`
 * @param parts        [SUPINE_VENTILATED_MOST] written
 * @param count        written
 * Return SUPINE_ERROR_ARGUMENT if there are more than SUPINE_VENTILATED_MOST labels. */
supine_status supine_warp_ventilated_labels(const supine_image *ventilation,
                                            const supine_image *labels, supine_ventilated *parts,
                                            size_t *count, supine_error *error);

#endif
