/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Load lungs from surfaces or label maps. */
#ifndef SUPINE_SOURCE_H
#define SUPINE_SOURCE_H

#include <supine/precompute.h>

#include <supine/findings.h>

#include "mesh/labels/labels.h"
#include "precompute/lungs/lungs.h"
#include "precompute/physics/reference.h"

typedef struct supine_source_options {
  supine_mesh_load_options load;
  /** A surface for each path, which is then only a name; or NULL. */
  const supine_precompute_surface *surfaces;
  supine_labels_options labels; /**< options for label maps; load.axes replaces labels.axes */
  const char *surfaces_out;     /**< path to save the surfaces of a label map to, or NULL */
  bool has_midline;
  double midline; /**< x of the plane between the lungs, mm */
} supine_source_options;

typedef struct supine_source {
  supine_lungs lungs;
  supine_scan_frame frame;
  bool is_map;    /**< whether lungs were read from label maps; if so, `report` is set */
  bool axes_hold; /**< whether the shape of the lungs clearly confirms the axes */
  supine_labels_report report;
  char summary[256];        /**< for the user: bounding boxes of the lungs */
  const char *axes_from;    /**< "given", "file" or "default" */
  supine_findings findings; /**< notes and warnings, also after a failure */
} supine_source;

/** Load surfaces (in parallel) or label maps, check them and join them into lungs.
 * @param source  zeroed; release source->lungs with supine_lungs_free, also after a failure */
supine_status supine_precompute_source_load(const supine_source_options *options,
                                            const char *const *paths, size_t count,
                                            supine_source *source, supine_error *error);

/** Do the same with options->lungs, which may be arrays. */
supine_status supine_precompute_source_load_lungs(const supine_precompute_options *options,
                                                  supine_source *source, supine_error *error);

/** Report progress to the caller of the library, and return whether to go on.
 * @param context  supine_precompute_options */
bool supine_precompute_go_on(void *context, double fraction);

#endif
