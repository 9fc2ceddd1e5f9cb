/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Name the values of options. */
#include <stddef.h>
#include <string.h>

#include <supine/precompute.h>

#include "precompute/fields/storage.h"
#include "precompute/names.h"
#include "precompute/physics/model.h"
#include "precompute/physics/reference.h"
#include "precompute/physics/resting.h"

const char *const supine_precompute_sexes[] = {[SUPINE_PRECOMPUTE_SEX_UNKNOWN] = "unknown",
                                               [SUPINE_PRECOMPUTE_FEMALE] = "female",
                                               [SUPINE_PRECOMPUTE_MALE] = "male",
                                               [SUPINE_PRECOMPUTE_SEX_COUNT] = NULL};

const char *const supine_precompute_storages[] = {[SUPINE_PRECOMPUTE_STORAGE_BEST] = "best",
                                                  [SUPINE_PRECOMPUTE_STORAGE_MODES] = "modes",
                                                  [SUPINE_PRECOMPUTE_STORAGE_CLUSTERS] = "clusters",
                                                  [SUPINE_PRECOMPUTE_STORAGE_COUNT] = NULL};

_Static_assert((int)SUPINE_PRECOMPUTE_STORAGE_COUNT == (int)SUPINE_FIELD_STORAGE_COUNT &&
                   (int)SUPINE_PRECOMPUTE_STORAGE_CLUSTERS == (int)SUPINE_FIELD_STORAGE_CLUSTERS,
               "supine_precompute_storage has the values of supine_warp_storage");
_Static_assert((int)SUPINE_PRECOMPUTE_FEMALE == (int)SUPINE_SEX_FEMALE &&
                   (int)SUPINE_PRECOMPUTE_MALE == (int)SUPINE_SEX_MALE,
               "supine_precompute_sex has the values of supine_sex");
_Static_assert((int)SUPINE_REST_COUNT == (int)SUPINE_RESTING_POSTURES, "as many postures");

const char *const *supine_precompute_names(const char *option) {
  if (strcmp(option, "law") == 0) {
    return supine_physics_law_names;
  }
  if (strcmp(option, "resting") == 0) {
    return supine_physics_resting_names;
  }
  if (strcmp(option, "sex") == 0) {
    return supine_precompute_sexes;
  }
  return strcmp(option, "storage") == 0 ? supine_precompute_storages : NULL;
}
