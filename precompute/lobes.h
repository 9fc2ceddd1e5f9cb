/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Find the masks of the lobes of the lungs in a folder made by TotalSegmentator. */
#ifndef SUPINE_LOBES_H
#define SUPINE_LOBES_H

#include <limits.h>
#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

enum { SUPINE_LOBES_MAX = 5 };

/** Masks of the lobes. */
typedef struct supine_lobe_files {
  char path[SUPINE_LOBES_MAX][PATH_MAX]; /**< those of the left lung first */
  size_t left, right;                    /**< number of masks of each lung */
} supine_lobe_files;

bool supine_precompute_is_folder(const char *path);

/** Find the masks lung_upper_lobe_left.nii.gz and so on.
 * @retval SUPINE_ERROR_READ  the folder has none */
supine_status supine_precompute_lobes_find(const char *folder, supine_lobe_files *found,
                                           supine_error *error);

#endif
