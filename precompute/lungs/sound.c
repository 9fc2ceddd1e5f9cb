/* SPDX-License-Identifier: GPL-3.0-or-later */
/* One lung given twice, crumbs, midlines out of place, lungs turned inside out. */
#include <math.h>

#include "precompute/lungs/sound.h"

/* Boxes whose faces agree to this share of their size are one lung's, scanned once and meshed
 * twice: halving a mesh moves its box by thousandths, and no two lobes or lungs come near. */
static const double same_box_share = 0.01;
/* Lobes, and lungs of one chest, are within a factor of ten of each other; a strip of triangles
 * that was read as one, or a file in other units, is not. */
static const double least_side_share = 0.05;
/* Lungs meet behind the breastbone, where one reaches over a little. */
static const double most_beyond_share = 0.5;

typedef struct box {
  double minimum[3], maximum[3], side;
} box;

static box box_of(const supine_mesh *mesh) {
  box made = {.side = 0.0};
  supine_mesh_box(mesh, made.minimum, made.maximum);
  for (int k = 0; k < 3; ++k) {
    made.side = fmax(made.side, made.maximum[k] - made.minimum[k]);
  }
  return made;
}

static bool same_box(const box *a, const box *b) {
  double apart = 0.0;
  for (int k = 0; k < 3; ++k) {
    apart = fmax(apart, fabs(a->minimum[k] - b->minimum[k]));
    apart = fmax(apart, fabs(a->maximum[k] - b->maximum[k]));
  }
  return apart <= same_box_share * fmax(a->side, b->side);
}

supine_status supine_lungs_check_surfaces(const supine_mesh *meshes, size_t count,
                                          supine_error *error) {
  for (size_t m = 1; m < count; ++m) {
    const box box_m = box_of(&meshes[m]);
    for (size_t i = 0; i < m; ++i) {
      const box box_i = box_of(&meshes[i]);
      if (same_box(&box_i, &box_m)) {
        return supine_error_set(error, SUPINE_ERROR_MESH,
                                "surfaces %zu and %zu fill the same box: give each lung once",
                                i + 1, m + 1);
      }
      const bool first = box_i.side < box_m.side;
      const double less = first ? box_i.side : box_m.side;
      const double more = first ? box_m.side : box_i.side;
      if (less < least_side_share * more) {
        return supine_error_set(
            error, SUPINE_ERROR_MESH,
            "surface %zu is %.3g mm long beside %.3g mm: it was not read whole, is in other units, "
            "or does not belong here",
            first ? i + 1 : m + 1, less, more);
      }
    }
  }
  return SUPINE_OK;
}

supine_status supine_lungs_check_midline(const supine_lungs *lungs, bool two_sided,
                                         supine_error *error) {
  if (two_sided && lungs->lung_count < 2) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "the midline x = %g mm leaves both lungs on its %s side; they are "
                            "parted at about %g",
                            lungs->midline, supine_lungs_name(lungs, 0),
                            0.5 * (lungs->minimum[0] + lungs->maximum[0]));
  }
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    double inner = INFINITY; /* distances to the lung's own side of the midline */
    double outer = -INFINITY;
    for (size_t i = lungs->lung_begin[lung]; i < lungs->lung_begin[lung + 1]; ++i) {
      const double x = lungs->side[lung] * (lungs->mesh.vertices[3 * i] - lungs->midline);
      inner = fmin(inner, x);
      outer = fmax(outer, x);
    }
    if (-inner > most_beyond_share * outer) {
      return supine_error_set(error, SUPINE_ERROR_MESH,
                              "the midline x = %g mm runs through the %s lung, which reaches "
                              "%.3g mm beyond it; give one between the lungs, or none",
                              lungs->midline, supine_lungs_name(lungs, lung), -inner);
    }
  }
  return SUPINE_OK;
}

void supine_lungs_face_outwards(supine_lungs *lungs) {
  for (size_t lung = 0; lungs->topology.closed && lung < lungs->lung_count; ++lung) {
    const supine_mesh part = supine_lungs_part(lungs, lung);
    lungs->turned[lung] = supine_mesh_volume(&part) < 0.0;
    for (size_t t = 0; lungs->turned[lung] && t < part.triangle_count; ++t) {
      const uint32_t second = part.triangles[3 * t + 1];
      part.triangles[3 * t + 1] = part.triangles[3 * t + 2];
      part.triangles[3 * t + 2] = second;
    }
  }
}
