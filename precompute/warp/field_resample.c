/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Move an image by a displacement field: each voxel takes the value from where its tissue was. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/clones.h"
#include "base/parallel.h"
#include "base/vec3.h"

#include "precompute/warp/field.h"

/* Number of voxels of a row that are processed together, with vector instructions. */
enum { RUN = 128 };

/* Kinds of voxels when densities are scaled: 0 and 1 outside the lungs, LUNG and LUNG + 1 inside
 * them; odd ones are aerated. */
enum { LUNG = 2 };

#define INLINE static inline __attribute__((always_inline))

typedef struct resampling resampling;

struct resampling {
  const supine_field *inverse;
  const supine_image *depth; /* depth below the lungs' surface, mm; NULL: densities not scaled */
  supine_image kind;         /* kind of each voxel of `from`; for scaling densities */
  const supine_image *from;
  supine_image *to;
  bool labels;
  double axes[3][3]; /* [k] a displacement of 1 mm along x, y or z, in voxels of `from` */
  void (*run)(const resampling *work, size_t row, size_t begin); /* process RUN voxels of a row */
};

/* For each of RUN points, the cell of an image that contains it. */
typedef struct cells {
  size_t first[RUN];    /* index of the first channel of the voxel at the cell's lowest corner */
  double share[3][RUN]; /* position of each point in its cell, 0 to 1 along each axis */
} cells;

/* The x, y and z of a vector, and an unused number; `narrow` as fields store it. */
typedef double vector __attribute__((vector_size(4 * sizeof(double))));
typedef float narrow __attribute__((vector_size(4 * sizeof(float))));

/* Find the cells that contain points, given in voxels. */
INLINE void find_cells(const supine_image *image, double (*at)[RUN], cells *found) {
  const supine_image frame = *image; /* a local copy, so that stores cannot alias it */
  for (size_t a = 0; a < 3; ++a) {
    const double last = (double)frame.size[a] - 1.0;
    const double top = last > 1.0 ? last - 1.0 : 0.0;
    for (size_t i = 0; i < RUN; ++i) {
      const double above = at[a][i] > 0.0 ? at[a][i] : 0.0; /* NaN becomes 0 */
      const double voxel = above < last ? above : last;
      const double below = floor(voxel);
      at[a][i] = below < top ? below : top;
      found->share[a][i] = voxel - at[a][i];
    }
  }
  const double row = (double)frame.size[0];
  const double slice = row * (double)frame.size[1];
  for (size_t i = 0; i < RUN; ++i) {
    /* The sum is exact, as its terms are whole numbers. */
    found->first[i] = frame.channels * (size_t)(at[0][i] + row * at[1][i] + slice * at[2][i]);
  }
}

/* Find the nodes around RUN voxels of a row of `from`, which are evenly spaced. */
INLINE void find_nodes(const supine_image *from, size_t row, size_t begin,
                       const supine_image *nodes, cells *found) {
  double at[3][RUN];
  double point[3];
  double start[3];
  double next[3];
  supine_image_place(from, row * from->size[0] + begin, point);
  supine_image_locate(nodes, point, start);
  for (size_t k = 0; k < 3; ++k) {
    point[k] += from->step[0][k];
  }
  supine_image_locate(nodes, point, next);
  for (size_t a = 0; a < 3; ++a) {
    for (size_t i = 0; i < RUN; ++i) {
      at[a][i] = start[a] + (double)i * (next[a] - start[a]);
    }
  }
  find_cells(nodes, at, found);
}

/* Compute the weights of the corners of each cell, and the offset of each corner's value from the
 * value of the lowest corner. On an axis of one voxel, the upper corner has weight 0. */
INLINE void weigh_corners(const supine_image *image, const cells *in, double (*weight)[RUN],
                          size_t *offset) {
  for (size_t corner = 0; corner < 8; ++corner) {
    size_t stride = image->channels;
    offset[corner] = 0;
    for (size_t a = 0; a < 3; ++a) {
      offset[corner] += (corner >> a & 1U) != 0 && image->size[a] > 1 ? stride : 0;
      stride *= image->size[a];
    }
    for (size_t i = 0; i < RUN; ++i) {
      weight[corner][i] = 1.0;
      for (size_t a = 0; a < 3; ++a) {
        weight[corner][i] *= (corner >> a & 1U) != 0 ? in->share[a][i] : 1.0 - in->share[a][i];
      }
    }
  }
}

/* Interpolate the displacements, mm. Return whether a voxel moves. */
INLINE bool displace(const supine_image *nodes, const cells *in, double (*shift)[RUN]) {
  double weight[8][RUN];
  size_t offset[8];
  vector corners[8] = {{0.0}};
  bool moves = false; /* whether a corner of the cell moves */
  bool any = false;
  weigh_corners(nodes, in, weight, offset);
  for (size_t i = 0; i < RUN; ++i) {
    if (i == 0 || in->first[i] != in->first[i - 1]) {
      vector squares = {0.0};
      for (size_t corner = 0; corner < 8; ++corner) {
        const float *u = (const float *)nodes->values + in->first[i] + offset[corner];
        corners[corner] = __builtin_convertvector((narrow){u[0], u[1], u[2], 0.0F}, vector);
        squares += corners[corner] * corners[corner];
      }
      moves = squares[0] + squares[1] + squares[2] > 0.0;
    }
    vector u = {0.0, 0.0, 0.0, 0.0};
    if (moves) {
      for (size_t corner = 0; corner < 8; ++corner) {
        u += weight[corner][i] * corners[corner];
      }
    }
    for (size_t k = 0; k < 3; ++k) {
      shift[k][i] = u[k];
    }
    any |= moves;
  }
  return any;
}

/* Interpolate an image of one channel at points. */
INLINE void interpolate(const supine_image *image, const cells *in, double *values) {
  double weight[8][RUN];
  double value[RUN];
  size_t offset[8];
  weigh_corners(image, in, weight, offset);
  memset(values, 0, RUN * sizeof *values);
  for (size_t corner = 0; corner < 8; ++corner) {
    supine_image_gather(image, offset[corner], in->first, RUN, value);
    for (size_t i = 0; i < RUN; ++i) {
      values[i] += weight[corner][i] * value[i];
    }
  }
}

/* Take the value of the voxel nearest to each point. */
INLINE void take_nearest(const supine_image *image, cells in, double *values) {
  size_t stride = 1;
  for (size_t a = 0; a < 3; ++a) {
    for (size_t i = 0; i < RUN; ++i) {
      in.first[i] += in.share[a][i] > 0.5 ? stride : 0;
    }
    stride *= image->size[a];
  }
  supine_image_gather(image, 0, in.first, RUN, values);
}

/* Return the volume of the tissue at a voxel y before the motion, divided by its volume after it.
 * This is det(I + dv/dy) for the inverse field v; return 0 if the field folds at y. */
static double volume_ratio(const supine_image *nodes, const cells *in, size_t i) {
  const size_t node = in->first[i] / 3;
  const supine_warp_cell cell = {{node % nodes->size[0], node / nodes->size[0] % nodes->size[1],
                                  node / nodes->size[0] / nodes->size[1]},
                                 {in->share[0][i], in->share[1][i], in->share[2][i]}};
  return fmax(0.0, supine_warp_stretch(nodes, &cell));
}

/* Interpolate densities, and multiply those inside the lungs by volume_ratio(). A point is
 * interpolated only from corners of its cell that are of the same kind as its nearest corner. The
 * chest wall thus adds no mass to the lungs, and vessels none to the tissue around them.
 * @param nodes  cells of the field around the voxels of the moved image */
INLINE void interpolate_density(const resampling *work, const cells *nodes, const cells *in,
                                double *values) {
  double weight[8][RUN];
  double value[RUN];
  unsigned char kind[8][RUN];
  unsigned char nearest[RUN];
  double sum[RUN] = {0.0};
  size_t offset[8];
  weigh_corners(work->from, in, weight, offset);
  for (size_t corner = 0; corner < 8; ++corner) {
    for (size_t i = 0; i < RUN; ++i) {
      kind[corner][i] = ((const unsigned char *)work->kind.values)[in->first[i] + offset[corner]];
    }
  }
  for (size_t i = 0; i < RUN; ++i) {
    nearest[i] = kind[(in->share[0][i] > 0.5) + 2 * (in->share[1][i] > 0.5) +
                      4 * (in->share[2][i] > 0.5)][i];
  }
  memset(values, 0, RUN * sizeof *values);
  for (size_t corner = 0; corner < 8; ++corner) {
    supine_image_gather(work->from, offset[corner], in->first, RUN, value);
    for (size_t i = 0; i < RUN; ++i) {
      const double part = kind[corner][i] == nearest[i] ? weight[corner][i] : 0.0;
      values[i] += part * (value[i] + 1000.0);
      sum[i] += part;
    }
  }
  for (size_t i = 0; i < RUN; ++i) {
    const bool scaled = nearest[i] >= LUNG;
    values[i] =
        values[i] / sum[i] * (scaled ? volume_ratio(&work->inverse->nodes, nodes, i) : 1.0) -
        1000.0;
  }
}

/* Find the kinds of RUN voxels of a row. Smoothing of the surface, and the nodes between which its
 * depth is interpolated, displace it by up to the diagonal of a cell. This close to the surface,
 * the density of a voxel decides whether it belongs to the lungs. */
SUPINE_CLONES static void mark_run(const resampling *work, size_t row, size_t begin) {
  static const double air = -950.0; /* air outside the lungs is below this density, HU */
  const size_t left = work->from->size[0] - begin;
  const size_t first = row * work->from->size[0] + begin;
  double rim = 0.0;
  double depth[RUN];
  double value[RUN] = {0.0};
  size_t index[RUN];
  unsigned char kind[RUN];
  cells in;
  for (size_t k = 0; k < 3; ++k) {
    rim += supine_length(work->depth->step[k]);
  }
  for (size_t i = 0; i < RUN; ++i) {
    index[i] = i;
  }
  find_nodes(work->from, row, begin, work->depth, &in);
  interpolate(work->depth, &in, depth);
  supine_image_gather(work->from, first, index, left < RUN ? left : RUN, value);
  for (size_t i = 0; i < RUN; ++i) {
    const bool aerated = value[i] < supine_warp_aerated;
    const bool near = depth[i] > -rim && aerated && (depth[i] > 0.0 || value[i] > air);
    kind[i] = (unsigned char)((depth[i] > rim || near ? LUNG : 0) + (aerated ? 1 : 0));
  }
  memcpy((unsigned char *)work->kind.values + first, kind, left < RUN ? left : RUN);
}

/* Resample RUN voxels of a row from `begin` on; do not store voxels past the end of the row.
 * Copy voxels that do not move. */
SUPINE_CLONES static void resample_run(const resampling *work, size_t row, size_t begin) {
  const supine_image *from = work->from;
  const double line[2] = {(double)(row % from->size[1]), (double)(row / from->size[1])};
  const size_t first = row * from->size[0] + begin;
  const size_t left = from->size[0] - begin;
  const size_t count = left < RUN ? left : RUN;
  double at[3][RUN];
  double shift[3][RUN];
  double values[RUN];
  cells nodes;
  cells in;
  find_nodes(from, row, begin, &work->inverse->nodes, &nodes);
  if (!displace(&work->inverse->nodes, &nodes, shift)) {
    const size_t size = supine_image_voxel_size(from->voxel);
    memcpy((char *)work->to->values + first * size, (const char *)from->values + first * size,
           count * size);
    return;
  }
  for (size_t a = 0; a < 3; ++a) {
    for (size_t i = 0; i < RUN; ++i) {
      at[a][i] = (a == 0 ? (double)(begin + i) : line[a - 1]) + shift[0][i] * work->axes[0][a] +
                 shift[1][i] * work->axes[1][a] + shift[2][i] * work->axes[2][a];
    }
  }
  find_cells(from, at, &in);
  if (work->labels) {
    take_nearest(from, in, values);
  } else if (work->depth != NULL) {
    interpolate_density(work, &nodes, &in, values);
  } else {
    interpolate(from, &in, values);
  }
  supine_image_put(work->to, first, count, values);
}

static void process_rows(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const resampling *work = context;
  for (size_t row = begin; row < end; ++row) {
    for (size_t i = 0; i < work->from->size[0]; i += RUN) {
      work->run(work, row, i);
    }
  }
}

supine_status supine_warp_resample(const supine_field *inverse, const supine_image *depth,
                                   bool labels, const supine_image *image, supine_image *moved,
                                   supine_error *error) {
  const size_t count = image->size[0] * image->size[1] * image->size[2];
  const size_t rows = image->size[1] * image->size[2];
  resampling work = {inverse, depth, *image, image, moved, labels, {{0.0}}, mark_run};
  supine_image steps = *image;
  memset(steps.origin, 0, sizeof steps.origin);
  for (size_t k = 0; k < 3; ++k) {
    supine_image_locate(&steps, (const double[]){k == 0, k == 1, k == 2}, work.axes[k]);
  }
  work.kind.voxel = SUPINE_VOXEL_U8;
  work.kind.values = depth == NULL ? NULL : malloc(count);
  *moved = *image;
  moved->values = malloc(count * supine_image_voxel_size(image->voxel));
  if (moved->values == NULL || (depth != NULL && work.kind.values == NULL)) {
    supine_image_free(moved);
    supine_image_free(&work.kind);
    return supine_error_memory(error, "an image of %zu voxels", count);
  }
  if (depth != NULL) {
    supine_parallel_for(rows, 1, 0, process_rows, &work);
  }
  work.run = resample_run;
  supine_parallel_for(rows, 1, 0, process_rows, &work);
  supine_image_free(&work.kind);
  return SUPINE_OK;
}

supine_status supine_warp_check_hounsfield(const supine_image *image, const char *path,
                                           supine_error *error) {
  bool aerated = false; /* whether a voxel is; the search stops there */
  for (size_t i = 0; i < image->size[0] * image->size[1] * image->size[2] && !aerated; ++i) {
    aerated = supine_image_get(image, i) < supine_warp_aerated;
  }
  SUPINE_REFUSE_ADVISE(
      !aerated, error, SUPINE_REMEDY_DENSITY, SUPINE_ERROR_FORMAT,
      "%s: no voxel is below %g, so the image is not in Hounsfield units: convert it", path,
      supine_warp_aerated);
  return SUPINE_OK;
}
