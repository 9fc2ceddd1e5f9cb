/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * A basis in forms that other programs play: a page for the browser, and glTF morph targets. */
#ifndef SUPINE_EXPORT_H
#define SUPINE_EXPORT_H

#include <stdio.h>

#include <supine/runtime.h>

enum { EXPORT_RESTING_TERMS = 9 }; /* Y_lm of bands 0 to 2 */

/** An open basis and its tensors. */
typedef struct export_source {
  supine_basis *basis;
  const supine_basis_info *info;
  size_t terms;              /**< (L+1)^2 */
  const float *vertices;     /**< [N, 3] */
  const uint32_t *triangles; /**< [M, 3] */
  const float *direction;    /**< [N, 3]; NULL where the kind is vector */
  const float *coefficients; /**< [N, K] or [N, 3, K] */
  const double *modes;       /**< [K, (L+1)^2] */
  const double *resting;     /**< [resting_rows, EXPORT_RESTING_TERMS], mL at rest beyond the
                                reference surface; where info->has_rest */
  size_t resting_rows;       /**< G, or 1 for all lungs together */
} export_source;

/** Open a basis file.
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT, SUPINE_ERROR_MEMORY  as supine_basis_open */
supine_status supine_export_source_open(const char *path, export_source *source,
                                        supine_error *error);

/** Close it; a zeroed one is legal. */
void supine_export_source_close(export_source *source);

/** Widen a box, mm, to the source's vertices. */
void supine_export_box(const export_source *source, double low[3], double high[3]);

/** Compute the displacement of a vertex for a weight of 1 of a mode, mm. */
void supine_export_field(const export_source *source, size_t vertex, size_t mode, double u[3]);

/** Depth of a breath. */
typedef struct export_breath {
  double volume;  /**< mL above rest, for a closed surface */
  double largest; /**< largest displacement when supine, mm, for an open surface */
  double scale;   /**< the gain that gives `largest` */
} export_breath;

/** Set a breath of `volume` mL; on an open surface one whose largest displacement, supine, is
 * `largest` mm.
 * @retval SUPINE_ERROR_NUMERICAL  nothing moves */
supine_status supine_export_breath_set(const export_source *source, double volume, double largest,
                                       export_breath *breath, supine_error *error);

/** Compute the pose at a fraction of the breath: 0 at rest, or at the scan where no rest is known;
 * 1 at its end.
 * @retval SUPINE_ERROR_NUMERICAL  the surface folds before */
supine_status supine_export_breath_pose(const export_source *source, const export_breath *breath,
                                        const double g[3], double fraction, supine_pose *pose,
                                        supine_error *error);

/** Names of what is inside the lungs, as 'supine embed' wrote them. */
typedef struct export_parts {
  size_t count;       /**< names, > 0 */
  char *const *name;  /**< [count] */
  const uint32_t *of; /**< [N] index of each vertex' name */
} export_parts;

/** How to write glTF. */
typedef struct export_glb_options {
  bool plain;   /**< float32 throughout; else positions as counts of 0.02 mm and normals as bytes
                   (KHR_mesh_quantization), compressed (EXT_meshopt_compression) */
  bool animate; /**< add an animation that breathes and turns the patient, and one that breathes in
                   each lying posture */
  export_breath breath;
  const export_source *inside; /**< content of the same lungs, of kind vector, with their modes:
                                  drawn inside them, seen through; NULL: none */
  const export_parts *parts;   /**< with it */
} export_glb_options;

/** Write glTF 2.0 binary. Each lung is a mesh of its own, with morph targets that any engine plays:
 *
 *     position_i = base_i + sum over j of weight_j target_ij     0 <= weight_j <= 1
 *
 * The file's `extras` say how each lung's weights follow from gravity and volume. Targets hold
 * normals too. Vertices keep the basis' order; their colour is the largest move in a lying posture,
 * counted from supine, at rest. What is inside a lung is a mesh beside it with the same weights,
 * each part a primitive of a material of its name; points are balls of 4 mm. The node "patient"
 * lies on a table, turned about the lungs' middle, and an arrow shows gravity: glTF's metres, y up.
 * @param bytes  of the file; written
 * @retval SUPINE_ERROR_ARGUMENT     larger than the format's 4 GiB
 * @retval SUPINE_ERROR_UNSUPPORTED  meshoptimizer is not installed
 * @retval SUPINE_ERROR_NUMERICAL    the surface folds before the breath's volume
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_export_glb_write(const char *path, const export_source *source,
                                      const export_glb_options *options, size_t *bytes,
                                      supine_error *error);

/** Most modes that the page carries: four vertex attributes of four. */
enum { EXPORT_PAGE_MODES_MAX = 16 };

/** Contents of a page besides the lungs. */
typedef struct export_page {
  export_breath breath;
  const supine_pose *from; /**< displacements are measured from this pose */
  const char *from_name;   /**< "supine at rest" */
  const char *title;
  const export_source
      *inside;               /**< content of the same lungs, as in export_glb_options; NULL: none */
  const export_parts *parts; /**< with it */
} export_page;

/** Print one self-contained page that shows the lungs in a browser (WebGL 2), without a network.
 * Vertices, their motion and triangles are compressed by meshoptimizer; positions are within 0.02
 * mm of the library's for lungs of up to 650 mm. Write errors stay in the stream.
 * @retval SUPINE_ERROR_UNSUPPORTED  a vector basis, more than EXPORT_PAGE_MODES_MAX modes, or
 * meshoptimizer is not installed
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_export_html_print(FILE *file, const export_source *source,
                                       const export_page *shown, supine_error *error);

/** Write that page to a file.
 * @retval SUPINE_ERROR_UNSUPPORTED  as supine_export_html_print
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_export_html_write(const char *path, const export_source *source,
                                       const export_page *shown, supine_error *error);

#endif
