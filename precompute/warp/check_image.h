/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Check that an image shows the lungs that it is to be moved with. */
#ifndef SUPINE_FIELD_CHECK_IMAGE_H
#define SUPINE_FIELD_CHECK_IMAGE_H

#include <supine/findings.h>

#include "precompute/warp/tissue.h"

typedef enum supine_warp_image_kind {
  SUPINE_FIELD_CT = 0, /**< a CT whose densities are scaled: refused if it does not fit */
  SUPINE_FIELD_IMAGE,  /**< another image; in Hounsfield units if a voxel is below
                         supine_warp_aerated */
  SUPINE_FIELD_LABELS
} supine_warp_image_kind;

/** Compare an image with the lungs of a basis: do the lungs lie in the image, does a CT show air in
 * them, and do labels that lie in the lungs mostly lie in them wholly? A CT that does not fit is
 * refused; of other images a warning tells.
 * @param path     names the image in the message */
supine_status supine_warp_check_image(const supine_field *field, const supine_image *image,
                                      const char *path, supine_warp_image_kind kind,
                                      supine_findings *findings, supine_error *error);

/** Warn if lungs hold more soft tissue in a CT than vessels and nodules do: the CT may show other
 * lungs, or another state.
 * @param path  names the CT in the message */
void supine_warp_check_soft(const supine_tissue *tissue, const char *path,
                            supine_findings *findings);

#endif
