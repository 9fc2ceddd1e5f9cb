/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Export the lungs of a basis file as an HTML page, or as a glTF or OpenUSD file with morph
 * targets. */
#ifndef SUPINE_EXPORT_H
#define SUPINE_EXPORT_H

#include <stdio.h>

#include <jansson.h>

#include "program/options/basis_input.h"
#include "program/options/inside.h"
#include "program/options/state_options.h"

typedef struct export_glb_options {
  bool plain;    /**< If true, store floats, and keep the basis's order of vertices. If false, store
                    compressed integers (KHR_mesh_quantization, EXT_meshopt_compression). This rounds
                    positions to 0.045 mm (more coarsely in lungs longer than 1.47 m). Up to 500 mL
                    above rest, positions then err by at most 0.1 mm */
  bool animate;  /**< true: add five animations of breathing: one while the patient turns, and four
                    in the lying postures */
  double breath; /**< tidal volume, mL; during the breath, weights of morph targets stay between
                    0 and 1, to which viewers clamp them */
  size_t simplify; /**< approximate number of vertices to keep; 0 to keep all */
} export_glb_options;

/** What was written. */
typedef struct export_written {
  size_t bytes;    /**< size of the .glb file */
  size_t vertices; /**< number of vertices in the file */
  double rms; /**< RMS distance of the basis' vertices from the surface in the file, mm; 0 unless
                 it is simplified */
  double largest; /**< largest such distance, mm */
} export_written;

/** Write a glTF 2.0 binary file. Each lung is a mesh whose morph targets j move vertex i to
 *
 *     position_i = base_i + sum over j of weight_j target_ij     0 <= weight_j <= 1
 *
 * base_i is the stored position, target_ij the displacement stored in target j. The `extras` of the
 * file and of each lung's mesh say how to compute the weights from gravity and volume. Targets also
 * change normals. The node "patient" lies on a table and rotates about the centre of the lungs; an
 * arrow shows gravity. Units are metres, y points up.
 * @param written  output */
supine_status supine_export_glb_write(const char *path, const supine_basis *basis,
                                      const export_glb_options *options, export_written *written,
                                      supine_error *error);

/** Write an OpenUSD text file (.usda). Each lung is a mesh whose blend shapes are the morph targets
 * above; weights outside 0 to 1 are allowed. Time samples of the weights and of the patient's roll
 * show breaths of `breath` mL during a full turn. Units are millimetres, y points up. Names of
 * lungs are made identifiers; metadata keep them, and what the basis assumes.
 * @param simplify  approximate number of vertices to keep; 0 for 5000, as the file is text
 * @param written   output; bytes is 0 if the output is a pipe */
supine_status supine_export_usd_write(const char *path, const supine_basis *basis, double breath,
                                      size_t simplify, export_written *written,
                                      supine_error *error);

/** Options of the exported HTML page. */
typedef struct export_page {
  double breath;                             /**< tidal volume, mL */
  size_t simplify;                           /**< approximate number of vertices; 0 to keep all */
  const supine_options_reference_pose *from; /**< [from_count] states from which displacements can
                                        be measured; the first is shown */
  size_t from_count;                         /**< at least 1 */
  const char *title;                         /**< title of the page, UTF-8 */
  /** Basis of the structures inside the lungs, made by 'supine embed'; NULL to show none. */
  const supine_basis *inside;
  const supine_options_names *names; /**< names of the structures; unused if `inside` is NULL */
  json_t *still; /**< what is shown where no script may run: the members of {{#still}} in
                          page.html; NULL for nothing */
  bool live;     /**< true to show also the states that 'supine stream' sends */
} export_page;

/** Print one self-contained HTML page that shows the lungs in a browser (WebGL 2) without a
 * network. Vertices, displacements and triangles are compressed by meshoptimizer. In lungs up to
 * 650 mm long, positions err by at most 0.02 mm. A write error sets the error indicator of `file`.
 * @param written  output */
supine_status supine_export_html_print(FILE *file, const supine_basis *basis,
                                       const export_page *shown, export_written *written,
                                       supine_error *error);

#endif
