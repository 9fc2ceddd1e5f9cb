/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Export a basis in formats that other programs play: a browser page, and glTF morph targets. */
#ifndef SUPINE_EXPORT_H
#define SUPINE_EXPORT_H

#include <stdio.h>

#include <supine/runtime.h>

enum { EXPORT_RESTING_TERMS = 9 }; /* spherical harmonics of bands 0 to 2 */

/** An open basis to export. */
typedef struct export_source {
  supine_basis *basis;
  const supine_basis_info *info;
  size_t terms;          /**< number of spherical harmonics of bands 0 to info->band */
  const double *resting; /**< [resting_rows, EXPORT_RESTING_TERMS] coefficients of the harmonics
                            whose sum is the volume at rest minus the volume of the reference
                            surface, mL; NULL if rest is unknown */
  size_t resting_rows;   /**< number of lungs, or 1 if the volume is that of all lungs together */
} export_source;

/** Open a basis file.
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT, SUPINE_ERROR_MEMORY  as supine_basis_open */
supine_status supine_export_source_open(const char *path, export_source *source,
                                        supine_error *error);

/** Close a source; a source of zeros is legal. */
void supine_export_source_close(export_source *source);

/** Extend the box from `low` to `high`, mm, to contain all vertices of the reference surface. */
void supine_export_box(const export_source *source, double low[3], double high[3]);

/** Compute the displacement `u` of a vertex, mm, by one mode at weight 1 and gain 1. */
void supine_export_field(const export_source *source, size_t vertex, size_t mode, double u[3]);

/** Compute the pose at a fraction of a breath of `breath` mL for gravity along the unit vector `g`.
 * Fraction 0 is rest, or the scan if rest is unknown; 1 is the end of inspiration.
 * @retval SUPINE_ERROR_NUMERICAL  the surface folds before it reaches that volume */
supine_status supine_export_breath_pose(const export_source *source, double breath,
                                        const double g[3], double fraction, supine_pose *pose,
                                        supine_error *error);

/** Names of the parts inside the lungs, from 'supine embed'. */
typedef struct export_parts {
  size_t count;       /**< number of names, > 0 */
  char *const *name;  /**< [count] names */
  const uint32_t *of; /**< [N] index of the part that each vertex belongs to */
} export_parts;

/** Options of a glTF file. */
typedef struct export_glb_options {
  bool plain;    /**< true: positions, normals and weights as float32, vertices in the basis' order.
                    false: positions as 16-bit multiples of 0.045 mm (more for lungs beyond 1.4 m),
                    within 0.1 mm of the library's up to 500 mL above rest, normals as bytes
                    (KHR_mesh_quantization), arrays compressed (EXT_meshopt_compression) */
  bool animate;  /**< add an animation of breathing while the patient turns, and one of breathing in
                    each of the four lying postures */
  double breath; /**< tidal volume, mL; weights stay within 0 and 1 during a breath */
} export_glb_options;

/** Write glTF 2.0 binary. Each lung is a mesh of its own, with morph targets that any engine plays:
 *
 *     position_i = base_i + sum over j of weight_j target_ij     0 <= weight_j <= 1
 *
 * The `extras` of the file and of each lung's mesh say how weights follow from gravity and volume.
 * Targets deform normals too. The colour of a vertex shows its largest displacement from supine in
 * the other lying postures before the breath. The node "patient" lies on a table and rotates about
 * the centre of the lungs; an arrow shows gravity. Units are metres, and y points up.
 * @param bytes  size of the file; output
 * @retval SUPINE_ERROR_MESH         the basis has no triangles
 * @retval SUPINE_ERROR_ARGUMENT     the file would exceed 4 GiB, the limit of the format
 * @retval SUPINE_ERROR_UNSUPPORTED  meshoptimizer is not installed
 * @retval SUPINE_ERROR_NUMERICAL    the surface folds before the end of the breath
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_export_glb_write(const char *path, const export_source *source,
                                      const export_glb_options *options, size_t *bytes,
                                      supine_error *error);

/** Largest number of modes on the page: four vertex attributes with four coefficients each. */
enum { EXPORT_PAGE_MODES_MAX = 16 };

/** What a page shows besides the lungs. */
typedef struct export_page {
  double breath;           /**< tidal volume, mL */
  const supine_pose *from; /**< pose from which displacements are measured */
  const char *from_name;   /**< name of `from`, for example "supine at rest" */
  const char *title;       /**< title of the page, UTF-8 */
  const export_source
      *inside; /**< content of the same lungs, a vector basis with the same modes; NULL: none */
  const export_parts *parts; /**< names of the parts of `inside`; unused if that is NULL */
  bool live;                 /**< also show the states that the server 'supine stream' sends */
} export_page;

/** Print one self-contained HTML page that shows the lungs in a browser (WebGL 2) without a
 * network. Vertices, displacements and triangles are compressed by meshoptimizer; positions differ
 * by at most 0.02 mm from the library's for lungs of up to 650 mm. Write errors stay in the
 * stream.
 * @retval SUPINE_ERROR_UNSUPPORTED  a vector basis, more than EXPORT_PAGE_MODES_MAX modes, or
 *                                   meshoptimizer is not installed
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_export_html_print(FILE *file, const export_source *source,
                                       const export_page *shown, supine_error *error);

/** Write the page of supine_export_html_print to a file.
 * @retval SUPINE_ERROR_UNSUPPORTED  as supine_export_html_print
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_export_html_write(const char *path, const export_source *source,
                                       const export_page *shown, supine_error *error);

#endif
