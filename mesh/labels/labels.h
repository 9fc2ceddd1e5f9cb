/* SPDX-License-Identifier: MIT */
/** @file
 * From a label map, as segmenters write them, to the closed surface of each lung. */
#ifndef SUPINE_LABELS_H
#define SUPINE_LABELS_H

#include <stdbool.h>
#include <stddef.h>

#include "mesh/mesh.h"

/** Vertices are this far apart where nobody says otherwise, mm: some 100,000 of two adult lungs. */
#define SUPINE_LABELS_EDGE 2.0

typedef struct supine_labels_options {
  /** Which labels are lungs. NULL: by the labels that are there. "one": all that is not 0, parted
   * into two lungs; "lungmask", "lobes", "totalsegmentator", "totalsegmentator-v1"; or one's own,
   * "left=10+11,right=12+13+14", of which either may be missing. */
  const char *labels;
  supine_axes axes; /**< of the header's coordinates, in place of what it says; AUTO: as it says */
  double edge;      /**< mm, about, between vertices; 0: SUPINE_LABELS_EDGE */
  double close;     /**< mm: gaps and channels narrower than twice this are closed first */
  /** 0 to 1; false stops. Optional. */
  bool (*progress)(void *context, double fraction);
  void *progress_context;
} supine_labels_options;

/** One lung, from its voxels to its surface. Volumes in mL. */
typedef struct supine_labels_lung {
  int side;        /**< +1 left, -1 right */
  double mask;     /**< volume of the voxels that the surface is made of */
  double closed;   /**< of them, what closing added */
  size_t islands;  /**< parts dropped, */
  double dropped;  /**< and their volume */
  size_t cavities; /**< filled, */
  double filled;   /**< and their volume */
  double surface;  /**< volume of the surface */
  double farthest; /**< mm from the mask's surface to a vertex, at most */
  double held;     /**< mm: half a voxel, which smoothing was kept within */
  long tunnels;    /**< through the lung, that stay: the surface's genus */
  size_t cut;      /**< voxels at the image's border: the lung goes on outside */
} supine_labels_lung;

/** What a map was taken for. */
typedef struct supine_labels_report {
  size_t size[3];
  double spacing[3];  /**< mm */
  char axes[64];      /**< "i to the left, j to the back, k to the head" */
  const char *source; /**< "sform", "qform" or "space directions", a literal */
  bool frames_differ; /**< sform and qform are both there and do not agree */
  char taken[256];    /**< "labels 1 right, 2 left" */
  double parted; /**< two lungs in one piece were parted at necks up to this wide, mm; 0: not */
  size_t lung_count;
  supine_labels_lung lung[2]; /**< the left first, where both are there */
  supine_axes coordinates;    /**< that the header's were taken to be in */
} supine_labels_report;

/** Makes the surfaces of the lungs of a label map (.nrrd, .nii, .nii.gz), or of several of one
 * frame, each then one part whose voxels are not 0.
 *
 * The largest piece of each lung is kept and its cavities are filled. The map is averaged over
 * cubes of `edge`, in steps along its own axes; where half a cube is lung is inside, made so that
 * no two cubes meet in an edge or corner alone, which makes the surface net [Gibson1998] a closed
 * manifold. It is smoothed without shrinking [Taubin1995], each vertex within its cell of the net
 * and within half a voxel (the larger of the map's and `edge`) of the mask.
 *
 * @param surfaces  [2] zero-initialised; report->lung_count are written, in its order, outwards
 * @retval SUPINE_ERROR_ARGUMENT  an edge, closing distance or list of labels that is none
 * @retval SUPINE_ERROR_MESH      no lungs, one where two are told of, labels that are not two
 *         lungs', a lung that the header puts on the wrong side, less than a few cubes
 * @retval SUPINE_ERROR_FORMAT    voxels that are no labels; images that differ in size or frame
 * @retval SUPINE_ERROR_INTERRUPTED, SUPINE_ERROR_MEMORY, and those of supine_image_read
 * Memory: the map and 1 byte a voxel; 9 more a voxel of its lungs' box where touching lungs are
 * parted or gaps closed. */
supine_status supine_labels_surfaces(const char *const *paths, size_t count,
                                     const supine_labels_options *options, supine_mesh *surfaces,
                                     supine_labels_report *report, supine_error *error);

#endif
