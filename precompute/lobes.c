/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the masks of the lobes of the lungs in a folder made by TotalSegmentator. */
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/arena.h"
#include "precompute/lobes.h"

enum { LEFT_LOBES = 2 };

bool supine_precompute_is_folder(const char *path) {
  struct stat about;
  return stat(path, &about) == 0 && S_ISDIR(about.st_mode);
}

/* Write the path of the mask of a lobe in the first format of which there is a file. Return whether
 * there is any. */
static bool find_mask(const char *folder, const char *lobe, char path[PATH_MAX]) {
  static const char *const endings[] = {".nii.gz", ".nii", ".nrrd", ".mha"};
  for (size_t e = 0; e < sizeof endings / sizeof *endings; ++e) {
    const int length = snprintf(path, PATH_MAX, "%s/lung_%s%s", folder, lobe, endings[e]);
    if (length < PATH_MAX && access(path, F_OK) == 0) {
      return true;
    }
  }
  return false;
}

supine_status supine_precompute_lobes_find(const char *folder, supine_lobe_files *found,
                                           supine_error *error) {
  static const char *const names[SUPINE_LOBES_MAX] = {"upper_lobe_left", "lower_lobe_left",
                                                      "upper_lobe_right", "middle_lobe_right",
                                                      "lower_lobe_right"};
  found->left = found->right = 0;
  for (size_t lobe = 0; lobe < SUPINE_LOBES_MAX; ++lobe) {
    if (find_mask(folder, names[lobe], found->path[found->left + found->right])) {
      if (lobe < LEFT_LOBES) {
        ++found->left;
      } else {
        ++found->right;
      }
    }
  }
  SUPINE_REFUSE_IF(found->left + found->right == 0, error, SUPINE_ERROR_READ,
                   "%s: no lung_upper_lobe_left.nii.gz or other lobe of TotalSegmentator in this "
                   "folder; give files instead of the folder",
                   folder);
  return SUPINE_OK;
}
