/* SPDX-License-Identifier: MIT */
/** @file Make closed surfaces from a segmenter's label map: of each lung, or of each label
 * (nodules, airways, lobes). */
#ifndef SUPINE_LABELS_H
#define SUPINE_LABELS_H

#include <stdbool.h>
#include <stddef.h>

#include "mesh/mesh.h"

/** Default distance between vertices, mm, which gives some 100,000 vertices in two adult lungs. */
#define SUPINE_LABELS_EDGE 2.0

typedef struct supine_labels_options {
  /** Labels of the lungs, one of:
   * - NULL: chosen by the labels that are present
   * - "one": all labels but 0, split into two lungs
   * - "lungmask", "lobes", "totalsegmentator" or "totalsegmentator-v1": labels of that segmenter
   * - a list such as "left=10+11,right=12+13+14", for one or both sides */
  const char *labels;
  /** If `labels` is NULL, and one is not 0: the first `left_masks` files are masks of parts of the
   * left lung, and the next `right_masks` files of the right lung. */
  size_t left_masks, right_masks;
  supine_axes axes; /**< axes of the header's coordinates; AUTO: as the header states */
  double edge;      /**< approximate distance between vertices, mm; 0 means SUPINE_LABELS_EDGE */
  double close;  /**< gaps in a lung are closed if not wider than twice this, mm; 0 closes none */
  bool any_size; /**< whether lungs may be smaller and longer than those of people */
  /** Receive the fraction done, 0 to 1; return false to stop. Optional. */
  bool (*progress)(void *context, double fraction);
  void *progress_context;
} supine_labels_options;

/** Voxels and surface of one lung. */
typedef struct supine_labels_lung {
  int side;        /**< +1 left, -1 right */
  double mask;     /**< volume of the voxels that the surface is made from, mL */
  double closed;   /**< volume added by closing gaps, mL */
  size_t islands;  /**< number of pieces dropped that were not connected to the lung */
  double dropped;  /**< volume of the pieces dropped, mL */
  size_t cavities; /**< number of cavities filled */
  double filled;   /**< volume of the cavities filled, mL */
  double surface;  /**< volume that the surface encloses, mL */
  long tunnels;    /**< genus of the surface: number of tunnels through the lung */
  double cut;      /**< about the volume that the image's border cuts off: a half ball on the lung's
                        section there, mL; 0 if the lung does not reach it */
} supine_labels_lung;

/** Geometry and labels of a label map, and how touching lungs were split. */
typedef struct supine_labels_report {
  size_t size[3];
  double spacing[3]; /**< distances between voxels, mm */
  char axes[64];     /**< the image's axes, such as "i to the left, j to the back, k to the head" */
  const char *source; /**< header field that gives origin and steps, such as "sform" */
  bool frames_differ; /**< whether qform and sform of a NIfTI header differ */
  char taken[256];    /**< labels of each side, such as "2 left; 1 right (convention lungmask)" */
  double neck; /**< width of the bridge cut between touching lungs, mm; 0 if they did not touch */
  size_t lung_count;
  supine_labels_lung lung[2]; /**< the left lung first if there are two */
  supine_axes coordinates;    /**< axes assumed for the header's coordinates */
} supine_labels_report;

/** Make the surfaces of the lungs from a label map (.nrrd, .nii, .nii.gz, .mha), or from several
 * masks of one scan: nonzero voxels of the first get the label 1, of the second 2, and so on.
 *
 * If the labels do not tell left from right, the lungs are split. Gaps up to 2 `close` wide are
 * closed. The largest piece of each lung is kept, and its cavities are filled. The voxels are
 * averaged over a grid of cubes with edges of `edge` mm along the image's axes. A cube is inside if
 * at least half of it is filled. More cubes are filled until no two cubes inside, and no two
 * outside, meet only in an edge or a corner: then the surface net [Gibson1998] is a closed
 * manifold. It is smoothed without shrinking [Taubin1995]; no vertex moves by more than a cube.
 * Then it moves along its smoothed normals until it encloses the volume of the voxels.
 *
 * @param surfaces  [2] zero-initialised; surface i is that of report->lung[i] and faces outwards
 * Memory: the image, 1 byte per voxel, and up to 18 bytes for each voxel of the lungs' box. */
supine_status supine_labels_surfaces(const char *const *paths, size_t count,
                                     const supine_labels_options *options, supine_mesh *surfaces,
                                     supine_labels_report *report, supine_error *error);

typedef struct supine_labels_shape {
  unsigned label;
  double mask; /**< volume of the label's voxels, mL */
  supine_mesh surface;
} supine_labels_shape;

/** Make the surface of each wanted label of a map (.nrrd, .nii, .nii.gz, .mha), as
 * supine_labels_surfaces does, but keep all connected pieces and cavities. The distance between
 * vertices is about one voxel or, if that is larger, 1/50 of the cube root of the label's volume.
 * @param wanted  [wanted_count] labels, 1 to 65535; all labels present if the count is 0
 * @param parts   [*count] output in the order of `wanted`, or by ascending label; release with
 *             supine_labels_shapes_free */
supine_status supine_labels_shapes(const char *path, const unsigned *wanted, size_t wanted_count,
                                   supine_labels_shape **parts, size_t *count, supine_error *error);
void supine_labels_shapes_free(supine_labels_shape *parts, size_t count);

#endif
