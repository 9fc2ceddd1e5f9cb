/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * From files to lungs: surfaces, or a label map. */
#ifndef SUPINE_SOURCE_H
#define SUPINE_SOURCE_H

#include "sh/base/findings.h"

#include "mesh/labels/labels.h"
#include "precompute/lungs/lungs.h"
#include "precompute/physics/reference.h"

/** What is said of the files. */
typedef struct supine_source_options {
  supine_mesh_load_options load;
  supine_labels_options labels; /**< of label maps; its axes are those of `load` */
  const char *surfaces_out;     /**< where surfaces made of a label map are kept, or NULL */
  bool has_midline;
  double midline;
} supine_source_options;

/** What was read. */
typedef struct supine_source {
  supine_lungs lungs;
  supine_scan_frame frame;
  bool is_map;    /**< label maps, and what they hold is in `report` */
  bool axes_hold; /**< the shape agrees with the axes (supine_lungs_gate) */
  supine_labels_report report;
  char summary[256]; /**< how the files were read, and where the lungs lie */
} supine_source;

/** Read surfaces (all at once) or label maps, check them and join them into lungs.
 * @param source    zeroed; release with supine_precompute_source_free
 * @param findings  notes and warnings are added, also where it fails
 * @retval SUPINE_ERROR_ARGUMENT  maps beside surfaces; options of the one kind for the other
 * and those of supine_mesh_load, supine_labels_surfaces and supine_lungs_gate */
supine_status supine_precompute_source_load(const supine_source_options *options, char **paths,
                                            size_t count, supine_source *source,
                                            supine_findings *findings, supine_error *error);

void supine_precompute_source_free(supine_source *source);

#endif
