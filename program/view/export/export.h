/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Export the lungs of a basis file as an HTML page or as a glTF file with morph targets. */
#ifndef SUPINE_EXPORT_H
#define SUPINE_EXPORT_H

#include <stdio.h>

#include <jansson.h>

#include <supine/runtime.h>

enum { EXPORT_RESTING_TERMS = 9 }; /* number of spherical harmonics of bands 0 to 2 */

/** An open basis file to export. */
typedef struct export_source {
  supine_basis *basis;
  const supine_basis_info *info;
  size_t terms; /**< number of spherical harmonics of bands 0 to info->band */
  /** [resting_rows, EXPORT_RESTING_TERMS] volume of each lung at rest minus volume of its reference
   * surface, mL, as coefficients of spherical harmonics of the direction of gravity. A single row
   * is the sum over all lungs. NULL if rest is unknown. */
  const double *resting;
  size_t resting_rows; /**< number of lungs, or 1 for the sum over all lungs */
} export_source;

/** Open a basis file. */
supine_status supine_export_source_open(const char *path, export_source *source,
                                        supine_error *error);

/** Close a source. A source that is all zeros is allowed. */
void supine_export_source_close(export_source *source);

/** Enlarge a box, with the corners `low` and `high`, mm, to contain the whole reference surface. */
void supine_export_box(const export_source *source, double low[3], double high[3]);

/** Compute the displacement `u`, mm, of a vertex in one mode, at weight 1 and at gain 1. Gains are
 * the factors that multiply the displacement along each axis. */
void supine_export_field(const export_source *source, size_t vertex, size_t mode, double u[3]);

/** Return the metadata of the basis as a JSON object. */
json_t *supine_export_metadata(const export_source *source);

/** Compute the pose during a breath of `breath` mL, with gravity along the unit vector `g`. The
 * `fraction` is 0 at rest (in the scan if rest is unknown) and 1 at the end of inspiration; another
 * simulator's fields have no breath. */
supine_status supine_export_breath_pose(const export_source *source, double breath,
                                        const double g[3], double fraction, supine_pose *pose,
                                        supine_error *error);

/** Structures inside the lungs, such as airways, with the names that 'supine embed' has stored. */
typedef struct export_parts {
  size_t count;       /**< number of structures, at least 1 */
  char *const *name;  /**< [count] names of the structures */
  const uint32_t *of; /**< [N] structure of each vertex, as an index into `name` */
} export_parts;

typedef struct export_glb_options {
  bool plain;    /**< If true, store floats, and keep the basis's order of vertices. If false, store
                    compressed integers (KHR_mesh_quantization, EXT_meshopt_compression). This rounds
                    positions to 0.045 mm (more coarsely in lungs longer than 1.47 m). Up to 500 mL
                    above rest, positions then err by at most 0.1 mm */
  bool animate;  /**< true: add five animations of breathing: one while the patient turns, and four
                    in the lying postures */
  double breath; /**< tidal volume, mL; during the breath, weights of morph targets stay between
                    0 and 1, to which viewers clamp them */
} export_glb_options;

/** Write a glTF 2.0 binary file. Each lung is a mesh whose morph targets j move vertex i to
 *
 *     position_i = base_i + sum over j of weight_j target_ij     0 <= weight_j <= 1
 *
 * base_i is the stored position, target_ij the displacement stored in target j. The `extras` of the
 * file and of each lung's mesh say how to compute the weights from gravity and volume. Targets also
 * change normals. The node "patient" lies on a table
 * and rotates about the centre of the lungs; an arrow shows gravity. Units are metres, y points up.
 * @param bytes  output: size of the file */
supine_status supine_export_glb_write(const char *path, const export_source *source,
                                      const export_glb_options *options, size_t *bytes,
                                      supine_error *error);

/** Largest number of modes on an HTML page: meshoptimizer compresses rows of up to 256 bytes. */
enum { EXPORT_PAGE_MODES_MAX = 128 };

/** A state from which displacements are measured. */
typedef struct export_reference {
  const supine_pose *pose;
  const char *name;      /**< for example "supine at rest" */
  const double *gravity; /**< [3] direction of gravity */
  double above; /**< volume of the state, mL above rest; NAN if it is not stated relative to rest */
} export_reference;

/** Options of the exported HTML page. */
typedef struct export_page {
  double breath;                /**< tidal volume, mL */
  const export_reference *from; /**< [from_count] states to choose from; the first is shown */
  size_t from_count;            /**< at least 1 */
  const char *title;            /**< title of the page, UTF-8 */
  /** Basis of the structures inside the lungs, made by 'supine embed'; NULL to show none. */
  const export_source *inside;
  const export_parts *parts; /**< names of the structures; unused if `inside` is NULL */
  bool live;                 /**< true to show also the states that 'supine stream' sends */
} export_page;

/** Print one self-contained HTML page that shows the lungs in a browser (WebGL 2) without a
 * network. Vertices, displacements and triangles are compressed by meshoptimizer. In lungs up to
 * 650 mm long, positions err by at most 0.02 mm. A write error sets the error indicator of `file`.
 */
supine_status supine_export_html_print(FILE *file, const export_source *source,
                                       const export_page *shown, supine_error *error);

/** Write the page of supine_export_html_print to a file. */
supine_status supine_export_html_write(const char *path, const export_source *source,
                                       const export_page *shown, supine_error *error);

#endif
