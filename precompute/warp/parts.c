/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the compact parts of soft tissue in an image, by an opening and by their shape. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "precompute/warp/tissue.h"

/* Radius of the ball that must fit into a part, mm. Vessels beyond the hila have radii below 3 mm,
 * and slivers of the chest wall within the lungs' surface are thinner than 6 mm. */
static const double opening = 3.0;
/* Limits of a part's volume, mL. A ball of 1 mL has a radius of 6 mm: smaller ones span hardly more
 * than a cell of the field, and their loss of volume is below its error. Over 30 mL (a radius of 19
 * mm) are consolidation and collapse, which follow the lung around them. */
static const double volume_least = 1.0;
static const double volume_most = 30.0;
/* Least ratio of the smallest and the largest SD along the principal axes, and the least share of
 * the ellipsoid of these SDs that a part fills. In trials with synthetic trees of vessels, these
 * filled 0.15 to 0.55; a solid ellipsoid fills 1. */
static const double slender = 1.0 / 3.0;
static const double filled = 0.7;

/* Largest number of points that stand for the surface of a part: 1.5 mm apart at 30 mL. */
enum { OUTLINE = 2000 };

typedef struct search {
  const supine_image *frame; /* size and frame of the voxels */
  unsigned char *stage;      /* [voxels] stage of the search in the upper bits */
  bool named;                /* whether every component is a part, whatever its shape */
  size_t *list;              /* the voxels of the component */
  size_t count, room;
  supine_tissue *tissue;
} search;

double supine_warp_tissue_voxel(const supine_image *image) {
  return 1e-3 * fabs(supine_triple(image->step[0], image->step[1], image->step[2]));
}

static void set_stage(unsigned char *voxel, unsigned stage) {
  *voxel = (unsigned char)((*voxel & ~(unsigned)SUPINE_TISSUE_STAGE) | stage);
}

static bool has_stage(unsigned char voxel, unsigned stage) {
  return (voxel & SUPINE_TISSUE_STAGE) == stage;
}

/* The offsets from a voxel to those within a distance of it. */
typedef struct ball {
  size_t count;
  int (*by)[3];
  size_t reach[3]; /* largest offset along each axis */
} ball;

static bool ball_create(const supine_image *frame, double radius, supine_arena *arena, ball *made) {
  size_t most = 1;
  for (size_t a = 0; a < 3; ++a) {
    made->reach[a] = (size_t)floor(radius / supine_image_plane_distance(frame, a));
    most *= 2 * made->reach[a] + 1;
  }
  made->by = supine_arena_take(arena, most, sizeof *made->by);
  made->count = 0;
  for (size_t code = 0; code < most && made->by != NULL; ++code) {
    size_t rest = code;
    double step[3] = {0.0, 0.0, 0.0};
    int by[3];
    for (size_t a = 0; a < 3; ++a) {
      by[a] = (int)(rest % (2 * made->reach[a] + 1)) - (int)made->reach[a];
      rest /= 2 * made->reach[a] + 1;
      for (size_t k = 0; k < 3; ++k) {
        step[k] += by[a] * frame->step[a][k];
      }
    }
    if (supine_length(step) <= radius) {
      memcpy(made->by[made->count++], by, sizeof by);
    }
  }
  return made->by != NULL;
}

/* Mark the voxels `at` around which a ball is soft; with `open`, mark the soft voxels of the ball.
 * Outside the image, nothing is soft. */
static bool ball_visit(const search *s, const ball *b, const size_t at[3], bool open) {
  const size_t *size = s->frame->size;
  for (size_t a = 0; a < 3; ++a) {
    if (at[a] < b->reach[a] || at[a] + b->reach[a] >= size[a]) {
      return false;
    }
  }
  const ptrdiff_t row = (ptrdiff_t)size[0];
  const ptrdiff_t slice = row * (ptrdiff_t)size[1];
  unsigned char *here = s->stage + at[0] + size[0] * (at[1] + size[1] * at[2]);
  for (size_t i = 0; i < b->count; ++i) {
    unsigned char *other = here + b->by[i][0] + row * b->by[i][1] + slice * b->by[i][2];
    if (!open && has_stage(*other, 0)) {
      return false;
    }
    if (open && has_stage(*other, SUPINE_TISSUE_SOFT)) {
      set_stage(other, SUPINE_TISSUE_OPEN);
    }
  }
  return true;
}

/* Open the soft voxels by a ball: keep those that are in a ball of soft voxels. */
static supine_status open_by_ball(const search *s, supine_error *error) {
  SUPINE_ARENA arena = {0};
  ball b = {0};
  if (!ball_create(s->frame, opening, &arena, &b)) {
    return supine_error_memory(error, "a ball of voxels");
  }
  const size_t *size = s->frame->size;
  const size_t count = size[0] * size[1] * size[2];
  for (int open = 0; open < 2; ++open) {
    const unsigned wanted = open == 0 ? SUPINE_TISSUE_SOFT : SUPINE_TISSUE_CORE;
    for (size_t i = 0; i < count; ++i) {
      if (has_stage(s->stage[i], wanted)) {
        const size_t at[3] = {i % size[0], i / size[0] % size[1], i / size[0] / size[1]};
        if (ball_visit(s, &b, at, open != 0) && open == 0) {
          set_stage(&s->stage[i], SUPINE_TISSUE_CORE);
        }
      }
    }
  }
  return SUPINE_OK;
}

/* Append a voxel to the component if it is open, and mark it as seen. */
static bool take(search *s, size_t voxel) {
  if (!has_stage(s->stage[voxel], SUPINE_TISSUE_CORE) &&
      !has_stage(s->stage[voxel], SUPINE_TISSUE_OPEN)) {
    return true;
  }
  if (s->count == s->room) {
    size_t *grown = realloc(s->list, (2 * s->room + 1024) * sizeof *grown);
    if (grown == NULL) {
      return false;
    }
    s->list = grown;
    s->room = 2 * s->room + 1024;
  }
  set_stage(&s->stage[voxel], SUPINE_TISSUE_SEEN);
  s->list[s->count++] = voxel;
  return true;
}

/* Find the component of open voxels that contains a voxel; neighbours share a face. */
static bool find_component(search *s, size_t voxel) {
  const size_t *size = s->frame->size;
  s->count = 0;
  bool good = take(s, voxel);
  for (size_t n = 0; n < s->count && good; ++n) {
    size_t stride = 1;
    size_t rest = s->list[n];
    for (size_t a = 0; a < 3; ++a) {
      if (rest % size[a] > 0) {
        good = good && take(s, s->list[n] - stride);
      }
      if (rest % size[a] + 1 < size[a]) {
        good = good && take(s, s->list[n] + stride);
      }
      rest /= size[a];
      stride *= size[a];
    }
  }
  return good;
}

/* Compute the eigenvalues of a symmetric matrix [Smith 1961, Commun ACM 4(4), 168], largest first.
 */
static void eigenvalues(const double m[3][3], double value[3]) {
  const double mean = (m[0][0] + m[1][1] + m[2][2]) / 3.0;
  double square = 0.0;
  double rest[3][3];
  for (size_t k = 0; k < 9; ++k) {
    rest[k / 3][k % 3] = m[k / 3][k % 3] - (k / 3 == k % 3 ? mean : 0.0);
    square += rest[k / 3][k % 3] * rest[k / 3][k % 3];
  }
  const double p = sqrt(square / 6.0);
  double cosine = 1.0;
  if (p > 0.0) {
    cosine = 0.5 * supine_triple(rest[0], rest[1], rest[2]) / (p * p * p);
  }
  const double angle = acos(fmin(fmax(cosine, -1.0), 1.0)) / 3.0;
  for (size_t k = 0; k < 3; ++k) {
    value[k] = mean + 2.0 * p * cos(angle - 2.0943951023931953 * (double)k); /* 2 pi / 3 */
  }
}

/* Measure the component: volume, centre, and whether its shape is compact. */
static bool measure(const search *s, supine_warp_part *part) {
  double square[3][3] = {{0.0}};
  double value[3];
  double at[3];
  const double n = (double)s->count;
  for (size_t i = 0; i < s->count; ++i) {
    supine_image_place(s->frame, s->list[i], at);
    for (size_t k = 0; k < 3; ++k) {
      part->centre[k] += at[k] / n;
    }
  }
  for (size_t i = 0; i < s->count; ++i) {
    supine_image_place(s->frame, s->list[i], at);
    supine_subtract(at, part->centre, at);
    for (size_t k = 0; k < 9; ++k) {
      square[k / 3][k % 3] += at[k / 3] * at[k % 3] / n;
    }
    part->reach = fmax(part->reach, supine_length(at));
  }
  part->count = s->count;
  part->volume = n * supine_warp_tissue_voxel(s->frame);
  part->radius = cbrt(1e3 * part->volume * 0.2387324146378430); /* 3 / (4 pi) */
  eigenvalues((const double(*)[3])square, value);
  /* A solid ellipsoid has the semi-axes sqrt(5) SD. */
  const double sd[3] = {sqrt(value[0]), sqrt(fmax(value[1], 0.0)), sqrt(fmax(value[2], 0.0))};
  const double least = fmin(sd[1], sd[2]);
  const double ellipsoid = 4.1887902047863905e-3 * pow(5.0, 1.5) * sd[0] * sd[1] * sd[2];
  return s->named || (part->volume <= volume_most && least >= slender * sd[0] &&
                      part->volume >= filled * ellipsoid);
}

/* Store the component as a mask on the voxels around it. */
static bool make_mask(const search *s, supine_image *mask) {
  const size_t *size = s->frame->size;
  size_t low[3] = {SIZE_MAX, SIZE_MAX, SIZE_MAX};
  size_t high[3] = {0, 0, 0};
  for (size_t i = 0; i < s->count; ++i) {
    size_t rest = s->list[i];
    for (size_t a = 0; a < 3; ++a) {
      low[a] = rest % size[a] < low[a] ? rest % size[a] : low[a];
      high[a] = rest % size[a] > high[a] ? rest % size[a] : high[a];
      rest /= size[a];
    }
  }
  *mask = *s->frame;
  mask->voxel = SUPINE_VOXEL_U8;
  mask->channels = 1;
  supine_image_place(s->frame, low[0] + size[0] * (low[1] + size[1] * low[2]), mask->origin);
  for (size_t a = 0; a < 3; ++a) {
    mask->size[a] = high[a] - low[a] + 1;
  }
  unsigned char *in = calloc(mask->size[0] * mask->size[1] * mask->size[2], 1);
  mask->values = in;
  if (in == NULL) {
    return false;
  }
  for (size_t i = 0; i < s->count; ++i) {
    const size_t voxel = s->list[i];
    in[voxel % size[0] - low[0] +
       mask->size[0] * (voxel / size[0] % size[1] - low[1] +
                        mask->size[1] * (voxel / size[0] / size[1] - low[2]))] = 1;
  }
  return true;
}

/* Return whether a voxel of a mask has a neighbour outside the part. */
static bool is_outline(const supine_image *mask, size_t voxel) {
  const unsigned char *in = mask->values;
  size_t stride = 1;
  size_t rest = voxel;
  for (size_t a = 0; a < 3; ++a) {
    const size_t at = rest % mask->size[a];
    if (at == 0 || at + 1 == mask->size[a] || in[voxel - stride] == 0 || in[voxel + stride] == 0) {
      return true;
    }
    rest /= mask->size[a];
    stride *= mask->size[a];
  }
  return false;
}

/* Collect the centres of voxels at the surface of a part, evenly thinned. */
static bool make_outline(supine_warp_part *part) {
  const supine_image *mask = &part->mask;
  const size_t count = mask->size[0] * mask->size[1] * mask->size[2];
  size_t found = 0;
  for (size_t i = 0; i < count; ++i) {
    found += ((const unsigned char *)mask->values)[i] == 1 && is_outline(mask, i) ? 1 : 0;
  }
  const size_t every = found / OUTLINE + 1;
  part->outline = malloc(3 * (found / every + 1) * sizeof *part->outline);
  size_t n = 0;
  if (part->outline == NULL) {
    return false;
  }
  for (size_t i = 0; i < count; ++i) {
    if (((const unsigned char *)mask->values)[i] == 1 && is_outline(mask, i)) {
      if (n % every == 0) {
        supine_image_place(mask, i, part->outline + 3 * part->outline_count++);
      }
      ++n;
    }
  }
  return true;
}

/* Add the component to the parts, unless its shape is not compact. */
static bool add_part(const search *s) {
  supine_tissue *tissue = s->tissue;
  supine_warp_part part = {.count = 0};
  if (!s->named && (double)s->count * supine_warp_tissue_voxel(s->frame) < volume_least) {
    return true;
  }
  if (!measure(s, &part)) {
    return true;
  }
  supine_warp_part *grown =
      realloc(tissue->parts, (tissue->part_count + 1) * sizeof *tissue->parts);
  if (grown == NULL) {
    return false;
  }
  tissue->parts = grown;
  const bool good = make_mask(s, &part.mask) && make_outline(&part);
  tissue->parts[tissue->part_count++] = part;
  for (size_t i = 0; i < s->count && !s->named; ++i) {
    set_stage(&s->stage[s->list[i]], SUPINE_TISSUE_PART);
  }
  return good;
}

static bool find_components(search *s) {
  const size_t *size = s->frame->size;
  bool good = true;
  for (size_t i = 0; i < size[0] * size[1] * size[2] && good; ++i) {
    if (has_stage(s->stage[i], SUPINE_TISSUE_CORE) || has_stage(s->stage[i], SUPINE_TISSUE_OPEN)) {
      good = find_component(s, i) && add_part(s);
    }
  }
  free(s->list);
  return good;
}

supine_status supine_warp_tissue_find_parts(supine_tissue *tissue, supine_error *error) {
  search s = {.frame = &tissue->kind, .stage = tissue->kind.values, .tissue = tissue};
  SUPINE_TRY(open_by_ball(&s, error));
  return find_components(&s) ? supine_warp_tissue_group(tissue, error)
                             : supine_error_memory(error, "parts of soft tissue");
}

supine_status supine_warp_tissue_add_labels(const supine_image *labels, const double *wanted,
                                            size_t count, supine_tissue *tissue,
                                            supine_error *error) {
  const size_t voxels = labels->size[0] * labels->size[1] * labels->size[2];
  SUPINE_ARENA arena = {0};
  unsigned char *stage = supine_arena_zeros(&arena, voxels, 1);
  SUPINE_TRY(supine_arena_check(&arena, error, "a label map of %zu voxels", voxels));
  for (size_t k = 0; k < count; ++k) {
    bool found = false;
    for (size_t i = 0; i < voxels; ++i) {
      const bool same = supine_image_get(labels, i) == wanted[k];
      stage[i] = same ? SUPINE_TISSUE_OPEN : 0;
      found = found || same;
    }
    SUPINE_REFUSE_IF(!found, error, SUPINE_ERROR_ARGUMENT,
                     "no voxel of the label map has the value %g: give a value that it has",
                     wanted[k]);
    search s = {.frame = labels, .stage = stage, .named = true, .tissue = tissue};
    if (!find_components(&s)) {
      return supine_error_memory(error, "parts of a label map");
    }
  }
  return supine_warp_tissue_group(tissue, error);
}

void supine_warp_tissue_free(supine_tissue *tissue) {
  for (size_t i = 0; i < tissue->part_count; ++i) {
    supine_image_free(&tissue->parts[i].mask);
    free(tissue->parts[i].outline);
  }
  free(tissue->parts);
  free(tissue->gap);
  supine_image_free(&tissue->kind);
  supine_image_free(&tissue->air);
  *tissue = (supine_tissue){0};
}
