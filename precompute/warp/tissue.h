/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Soft tissue in a CT of the lungs. Air leaves the lungs when they empty, but nodules, tumours and
 * vessels hold no air, and keep their density. Compact parts also keep their size and shape: they
 * are found here, and the displacement field is corrected so that it moves each of them rigidly. */
#ifndef SUPINE_TISSUE_H
#define SUPINE_TISSUE_H

#include "precompute/warp/field.h"
#include <math.h>

/** A part of the image that keeps its size and shape. */
typedef struct supine_warp_part {
  supine_image mask; /**< U8, on voxels of the image around the part: 1 in the part */
  size_t count;      /**< number of its voxels */
  double volume;     /**< mL */
  double radius;     /**< radius of the ball of this volume, mm */
  double centre[3];  /**< mean position of its voxels, mm */
  double reach;      /**< largest distance of a voxel from the centre, mm */
  size_t group;      /**< parts of the same group move as one; groups are numbered from 0 */
  size_t outline_count;
  double *outline; /**< [outline_count, 3] some of the voxels at its surface, mm */
} supine_warp_part;

/** What the value of a voxel in `kind` means; 0 if the voxel belongs to no lung and touches none.
 */
enum {
  SUPINE_TISSUE_LUNG_INDEX = 15, /* these bits are the index of the lung */
  SUPINE_TISSUE_LUNG = 16,       /* the voxel belongs to this lung */
  SUPINE_TISSUE_BORDER = 32 /* the eight voxels of the cell that begins here are of two kinds */
};

/** Voxels begin <= i < end of a row of an image. */
typedef struct supine_warp_span {
  size_t begin, end;
} supine_warp_span;

/** Soft tissue in a CT, and what is needed to scale the densities of the lungs around it.
 * Zero-initialise; supine_warp_tissue_free releases it. */
typedef struct supine_tissue {
  supine_image kind;      /**< U8 for each voxel of the image; values NULL if there is no CT */
  supine_warp_span *span; /**< [rows] where voxels of each row may be of the lungs; others are 0 */
  supine_image air;       /**< F32, a channel for each lung: mean of HU + 1000 of the aerated tissue
                             around a point, on a grid of about 4 mm */
  size_t lungs;
  double mass[SUPINE_LUNGS_MAX];   /**< sum of HU + 1000 over the voxels of each lung */
  double soft[SUPINE_LUNGS_MAX];   /**< voxels of each lung that are not aerated, mL */
  double volume[SUPINE_LUNGS_MAX]; /**< all voxels of each lung, mL */
  size_t part_count;
  supine_warp_part *parts;
  size_t group_count;
  double *gap; /**< [group_count] distance to the nearest part of another group, mm; exact only
                  below 40 mm */
} supine_tissue;

/** Find the soft tissue of the lungs in a CT in Hounsfield units, and the parts in it that are
 * compact (supine_mesh_is_compact), with their cavities.
 * @param field   displacement field from the state of the CT
 * @param tissue  zero-initialised
 * Memory: a byte for each voxel. */
supine_status supine_warp_tissue_find(const supine_field *field, const supine_image *ct,
                                      supine_tissue *tissue, supine_error *error);

/** Find the parts of a label map that are compact and lie in the lungs: components of voxels of one
 * label, with their cavities. For maps without a CT, which would show what is soft.
 * @param tissue  zero-initialised */
supine_status supine_warp_tissue_find_labels(const supine_field *field, const supine_image *labels,
                                             supine_tissue *tissue, supine_error *error);

/** Add the voxels with one of the given labels as parts, a part for each connected component. */
supine_status supine_warp_tissue_add_labels(const supine_image *labels, const double *wanted,
                                            size_t count, supine_tissue *tissue,
                                            supine_error *error);

void supine_warp_tissue_free(supine_tissue *tissue);

/** How the correction of a field has changed it. */
typedef struct supine_warp_tissue_held {
  double largest;                  /**< largest correction in a part, mm */
  size_t folded_before, folded;    /**< cells around the parts that fold without and with it */
  double change[SUPINE_LUNGS_MAX]; /**< volume of each lung with the correction less that without
                                      it, mL */
} supine_warp_tissue_held;

/** Correct a field and its inverse so that each part moves rigidly. For the part with the rigid
 * motion R that fits the field best, the inverse field v at a point y becomes
 *
 *     v + phi(d / w) (R^-1 y - y - v),    phi(t) = 1 - t^3 (10 - 15 t + 6 t^2) for 0 <= t <= 1,
 *
 * where d is the distance of R^-1 y from the part, less half the diagonal of a cell of the grid (or
 * a third of the gap to the next part, if that is less), so that most cells around the part are
 * rigid. w is 10 mm, or 4 times the largest |R x - x - u(x)| in the part if that is more: the slope
 * of phi is at most 15 / 8, so that the correction compresses the tissue around by less than a
 * half. With several parts, their corrections have the weights phi / (1 - phi), and the uncorrected
 * field has the weight 1. */
supine_status supine_warp_tissue_hold(const supine_tissue *tissue, supine_field *field,
                                      supine_field *inverse, supine_warp_tissue_held *held,
                                      supine_error *error);

/* Internal: make the voxels soft that are not, but are enclosed by soft ones (cavities.c). */
supine_status supine_warp_tissue_fill(supine_tissue *tissue, supine_error *error);
/* Internal: find the compact parts among the voxels of `kind` that are soft (parts.c). */
supine_status supine_warp_tissue_find_parts(supine_tissue *tissue, supine_error *error);
/* Internal: put parts that are close to each other into groups, and find the gaps between
 * groups. */
supine_status supine_warp_tissue_group(supine_tissue *tissue, supine_error *error);
/* Internal: find the mean density of aerated tissue, masses and amounts of soft tissue (air.c). */
supine_status supine_warp_tissue_find_air(const supine_image *ct, supine_tissue *tissue,
                                          supine_error *error);
/* Internal: return the volume of a voxel, mL. */
double supine_warp_tissue_voxel(const supine_image *image);
/* Internal: return the share of a voxel of density HU + 1000 that is soft tissue. */
static inline double supine_warp_tissue_soft_share(double density, double air);

/* What the upper bits of `kind` hold while parts are sought: how far the search has come. */
enum {
  SUPINE_TISSUE_STAGE = 224, /* mask of the stage */
  SUPINE_TISSUE_SOFT = 32,   /* soft and in the lungs */
  SUPINE_TISSUE_CORE = 64,   /* the centre of a ball of soft voxels */
  SUPINE_TISSUE_OPEN = 96,   /* in such a ball */
  SUPINE_TISSUE_SEEN = 128,  /* in the component that is examined */
  SUPINE_TISSUE_PART = 160   /* in a part */
};

/* Density of soft tissue, HU + 1000: muscle, blood and most tumours have 20 to 60 HU. */
static const double supine_warp_tissue_density = 1040.0;

static inline double supine_warp_tissue_soft_share(double density, double air) {
  /* Aerated tissue has small vessels and noise: it counts as aerated up to 1.25 of its mean. Tried
   * with a synthetic tree of vessels of 3.9 mL: unmixing gives 6.5 mL of voxels above -300 HU in
   * the emptied lung, and a ramp between two fixed densities 10 mL. */
  static const double spread = 1.25;
  const double share = (density - spread * air) / (supine_warp_tissue_density - spread * air);
  const double above = share > 0.0 ? share : 0.0; /* comparisons become vector instructions */
  return above < 1.0 ? above : 1.0;
}

#endif
