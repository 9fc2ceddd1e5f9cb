/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the compact parts of soft tissue in an image, by an opening and by their shape. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "mesh/compact.h"
#include "precompute/warp/tissue.h"

/* Radius of the ball that must fit into a part, mm. Vessels beyond the hila have radii below 3 mm,
 * and slivers of the chest wall within the lungs' surface are thinner than 6 mm. */
static const double opening = 3.0;
/* Largest number of points that stand for the surface of a part: 1.5 mm apart at 30 mL. */
enum { OUTLINE = 2000 };

typedef struct search {
  const supine_image *frame;    /* size and frame of the voxels */
  unsigned char *stage;         /* [voxels] stage of the search in the upper bits */
  const supine_warp_span *span; /* [rows] where voxels may be soft */
  bool named;                   /* whether every component is a part, whatever its shape */
  const supine_image *labels; /* a component has voxels of one label; NULL if it has open voxels */
  double label;
  size_t *list; /* the voxels of the component */
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

/* The voxels within a distance of a voxel. */
typedef struct ball {
  size_t count;
  ptrdiff_t *by;   /* [count] from the index of the voxel to theirs */
  size_t reach[3]; /* largest distance along each axis, voxels */
} ball;

static bool ball_create(const supine_image *frame, double radius, supine_arena *arena, ball *made) {
  size_t most = 1;
  for (size_t a = 0; a < 3; ++a) {
    made->reach[a] = (size_t)floor(radius / supine_image_plane_distance(frame, a));
    most *= 2 * made->reach[a] + 1;
  }
  made->by = supine_arena_take(arena, most, sizeof *made->by);
  made->count = 0;
  if (made->by == NULL) {
    return false;
  }
  for (size_t code = 0; code < most; ++code) {
    size_t rest = code;
    double step[3] = {0.0, 0.0, 0.0};
    ptrdiff_t stride = 1;
    ptrdiff_t by = 0;
    for (size_t a = 0; a < 3; ++a) {
      const ptrdiff_t along =
          (ptrdiff_t)(rest % (2 * made->reach[a] + 1)) - (ptrdiff_t)made->reach[a];
      rest /= 2 * made->reach[a] + 1;
      by += stride * along;
      stride *= (ptrdiff_t)frame->size[a];
      for (size_t k = 0; k < 3; ++k) {
        step[k] += (double)along * frame->step[a][k];
      }
    }
    if (supine_length(step) <= radius) {
      made->by[made->count++] = by;
    }
  }
  return true;
}

/* Return whether a ball around the voxel `at` is soft. Outside the image, nothing is. */
static bool is_soft_around(const search *s, const ball *b, const size_t at[3]) {
  const size_t *size = s->frame->size;
  for (size_t a = 0; a < 3; ++a) {
    if (at[a] < b->reach[a] || at[a] + b->reach[a] >= size[a]) {
      return false;
    }
  }
  const unsigned char *here = s->stage + at[0] + size[0] * (at[1] + size[1] * at[2]);
  for (size_t i = 0; i < b->count; ++i) {
    if (has_stage(here[b->by[i]], 0)) {
      return false;
    }
  }
  return true;
}

/* Mark the soft voxels of a ball around the voxel `centre`. */
static void open_ball(const ball *b, unsigned char *centre) {
  for (size_t i = 0; i < b->count; ++i) {
    if (has_stage(centre[b->by[i]], SUPINE_TISSUE_SOFT)) {
      set_stage(centre + b->by[i], SUPINE_TISSUE_OPEN);
    }
  }
}

/* Open the soft voxels by a ball: keep those that are in a ball of soft voxels. */
static supine_status open_by_ball(const search *s, supine_error *error) {
  SUPINE_ARENA arena = {0};
  ball b = {0};
  if (!ball_create(s->frame, opening, &arena, &b)) {
    return supine_error_memory(error, "a ball of voxels");
  }
  const size_t *size = s->frame->size;
  const size_t rows = size[1] * size[2];
  for (size_t row = 0; row < rows; ++row) { /* find the centres of the balls */
    unsigned char *stage = s->stage + size[0] * row;
    for (size_t i = s->span[row].begin; i < s->span[row].end; ++i) {
      const size_t at[3] = {i, row % size[1], row / size[1]};
      if (has_stage(stage[i], SUPINE_TISSUE_SOFT) && is_soft_around(s, &b, at)) {
        set_stage(&stage[i], SUPINE_TISSUE_CORE);
      }
    }
  }
  for (size_t row = 0; row < rows; ++row) { /* mark what is in them */
    unsigned char *stage = s->stage + size[0] * row;
    for (size_t i = s->span[row].begin; i < s->span[row].end; ++i) {
      if (has_stage(stage[i], SUPINE_TISSUE_CORE)) {
        open_ball(&b, stage + i);
      }
    }
  }
  return SUPINE_OK;
}

/* Return whether a voxel belongs to the component, and is not in its list yet. */
static bool belongs(const search *s, size_t voxel) {
  if (s->labels != NULL) {
    return has_stage(s->stage[voxel], 0) && supine_image_get(s->labels, voxel) == s->label;
  }
  return has_stage(s->stage[voxel], SUPINE_TISSUE_CORE) ||
         has_stage(s->stage[voxel], SUPINE_TISSUE_OPEN);
}

/* Append a voxel to the component if it belongs to it, and mark it as seen. */
static bool take(search *s, size_t voxel) {
  if (!belongs(s, voxel)) {
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

/* Find the component that contains a voxel; neighbours share a face. */
static bool find_component(search *s, size_t voxel) {
  const size_t *size = s->frame->size;
  s->count = 0;
  if (!take(s, voxel)) {
    return false;
  }
  for (size_t n = 0; n < s->count; ++n) { /* the list grows meanwhile */
    size_t stride = 1;
    size_t rest = s->list[n];
    for (size_t a = 0; a < 3; ++a) {
      if (rest % size[a] > 0 && !take(s, s->list[n] - stride)) {
        return false;
      }
      if (rest % size[a] + 1 < size[a] && !take(s, s->list[n] + stride)) {
        return false;
      }
      rest /= size[a];
      stride *= size[a];
    }
  }
  return true;
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
  unsigned char *in = calloc(supine_image_count(mask), 1);
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
  const size_t count = supine_image_count(mask);
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

/* Mark with 2 the empty voxels of a mask that are connected to its border. Return false if out of
 * memory. */
static bool mark_outside(const supine_image *mask) {
  unsigned char *in = mask->values;
  const size_t *size = mask->size;
  const size_t count = size[0] * size[1] * size[2];
  SUPINE_ARENA arena = {0};
  size_t *list = supine_arena_take(&arena, count, sizeof *list);
  size_t found = 0;
  if (list == NULL) {
    return false;
  }
  for (size_t i = 0; i < count; ++i) {
    const size_t at[3] = {i % size[0], i / size[0] % size[1], i / size[0] / size[1]};
    bool border = false;
    for (size_t a = 0; a < 3; ++a) {
      border = border || at[a] == 0 || at[a] + 1 == size[a];
    }
    if (border && in[i] == 0) {
      in[i] = 2;
      list[found++] = i;
    }
  }
  for (size_t n = 0; n < found; ++n) {
    size_t stride = 1;
    size_t rest = list[n];
    for (size_t a = 0; a < 3; ++a) {
      const size_t sides[2] = {list[n] - stride, list[n] + stride};
      const bool inside[2] = {rest % size[a] > 0, rest % size[a] + 1 < size[a]};
      for (size_t side = 0; side < 2; ++side) {
        if (inside[side] && in[sides[side]] == 0) {
          in[sides[side]] = 2;
          list[found++] = sides[side];
        }
      }
      rest /= size[a];
      stride *= size[a];
    }
  }
  return true;
}

/* Fill the cavities of a mask: a tumour keeps its cavity. Return false if out of memory. */
static bool fill_cavities(supine_image *mask) {
  unsigned char *in = mask->values;
  if (!mark_outside(mask)) {
    return false;
  }
  for (size_t i = 0; i < supine_image_count(mask); ++i) {
    in[i] = in[i] == 2 ? 0 : 1;
  }
  return true;
}

/* Measure a part from its mask: volume, centre and reach; return whether it is compact. */
static bool measure(supine_warp_part *part) {
  const supine_image *mask = &part->mask;
  const unsigned char *in = mask->values;
  const size_t count = supine_image_count(mask);
  double square[3][3] = {{0.0}};
  double at[3];
  for (size_t i = 0; i < count; ++i) {
    if (in[i] == 1) {
      supine_image_place(mask, i, at);
      ++part->count;
      for (size_t k = 0; k < 3; ++k) {
        part->centre[k] += at[k];
      }
    }
  }
  const double n = (double)part->count;
  for (size_t k = 0; k < 3; ++k) {
    part->centre[k] /= n;
  }
  for (size_t i = 0; i < count; ++i) {
    if (in[i] == 1) {
      supine_image_place(mask, i, at);
      supine_subtract(at, part->centre, at);
      for (size_t k = 0; k < 9; ++k) {
        square[k / 3][k % 3] += at[k / 3] * at[k % 3] / n;
      }
      part->reach = fmax(part->reach, supine_length(at));
    }
  }
  part->volume = n * supine_warp_tissue_voxel(mask);
  part->radius = cbrt(1e3 * part->volume * 0.2387324146378430); /* 3 / (4 pi) */
  return supine_mesh_is_compact(part->volume, (const double(*)[3])square);
}

static void free_part(supine_warp_part *part) {
  supine_image_free(&part->mask);
  free(part->outline);
}

/* Add the component to the parts, unless its shape is not compact. */
static bool add_part(const search *s) {
  supine_tissue *tissue = s->tissue;
  supine_warp_part part = {.count = 0};
  const double volume = (double)s->count * supine_warp_tissue_voxel(s->frame);
  if (!s->named && (volume > SUPINE_COMPACT_MOST_ML || volume < 0.1 * SUPINE_COMPACT_LEAST_ML)) {
    return true;
  }
  bool good = make_mask(s, &part.mask) && (s->named || fill_cavities(&part.mask));
  if (good && !measure(&part) && !s->named) {
    free_part(&part);
    return true;
  }
  supine_warp_part *grown =
      good ? realloc(tissue->parts, (tissue->part_count + 1) * sizeof *tissue->parts) : NULL;
  if (grown == NULL) {
    free_part(&part);
    return false;
  }
  tissue->parts = grown;
  good = make_outline(&part);
  tissue->parts[tissue->part_count++] = part;
  if (!s->named) {
    for (size_t i = 0; i < s->count; ++i) {
      set_stage(&s->stage[s->list[i]], SUPINE_TISSUE_PART);
    }
  }
  return good;
}

static bool find_components(search *s) {
  const size_t *size = s->frame->size;
  for (size_t row = 0; row < size[1] * size[2]; ++row) {
    const size_t first = size[0] * row;
    for (size_t i = first + s->span[row].begin; i < first + s->span[row].end; ++i) {
      const bool soft =
          has_stage(s->stage[i], SUPINE_TISSUE_CORE) || has_stage(s->stage[i], SUPINE_TISSUE_OPEN);
      if (soft && !(find_component(s, i) && add_part(s))) {
        return false;
      }
    }
  }
  return true;
}

/* Return whether most voxels of the component lie in the lungs. */
static bool lies_in_lungs(const search *s, const supine_image *depth) {
  size_t inside = 0;
  for (size_t i = 0; i < s->count; ++i) {
    double x[3];
    double voxel[3];
    size_t at[3];
    bool seen = true;
    supine_image_place(s->frame, s->list[i], x);
    supine_image_locate(depth, x, voxel);
    for (size_t a = 0; a < 3; ++a) {
      const double nearest = rint(voxel[a]);
      seen = seen && nearest >= 0.0 && nearest < (double)depth->size[a];
      at[a] = seen ? (size_t)nearest : 0;
    }
    const size_t node = at[0] + depth->size[0] * (at[1] + depth->size[1] * at[2]);
    inside += seen && supine_image_get(depth, node) > 0.0 ? 1 : 0;
  }
  return 2 * inside > s->count;
}

/* Add the components of each label that are small enough to be compact, and lie in the lungs. */
static bool find_labelled(search *s, const supine_image *depth) {
  const size_t *size = s->frame->size;
  const double most = SUPINE_COMPACT_MOST_ML / supine_warp_tissue_voxel(s->labels);
  for (size_t i = 0; i < size[0] * size[1] * size[2]; ++i) {
    s->label = has_stage(s->stage[i], 0) ? supine_image_get(s->labels, i) : 0.0;
    if (s->label == 0.0) {
      continue;
    }
    if (!find_component(s, i)) {
      return false;
    }
    if ((double)s->count <= most && lies_in_lungs(s, depth) && !add_part(s)) {
      return false;
    }
  }
  return true;
}

supine_status supine_warp_tissue_find_labels(const supine_field *field, const supine_image *labels,
                                             supine_tissue *tissue, supine_error *error) {
  const size_t voxels = supine_image_count(labels);
  SUPINE_ARENA arena = {0};
  unsigned char *stage = supine_arena_zeros(&arena, voxels, 1);
  SUPINE_TRY(supine_arena_check(&arena, error, "a label map of %zu voxels", voxels));
  search s = {.frame = labels, .stage = stage, .labels = labels, .tissue = tissue};
  const bool good = find_labelled(&s, &field->depth);
  free(s.list);
  return good ? supine_warp_tissue_group(tissue, error)
              : supine_error_memory(error, "parts of a label map");
}

supine_status supine_warp_tissue_find_parts(supine_tissue *tissue, supine_error *error) {
  search s = {
      .frame = &tissue->kind, .stage = tissue->kind.values, .span = tissue->span, .tissue = tissue};
  SUPINE_TRY(open_by_ball(&s, error));
  const bool good = find_components(&s);
  free(s.list);
  return good ? supine_warp_tissue_group(tissue, error)
              : supine_error_memory(error, "parts of soft tissue");
}

supine_status supine_warp_tissue_add_labels(const supine_image *labels, const double *wanted,
                                            size_t count, supine_tissue *tissue,
                                            supine_error *error) {
  const size_t rows = labels->size[1] * labels->size[2];
  const size_t voxels = labels->size[0] * rows;
  SUPINE_ARENA arena = {0};
  unsigned char *stage = supine_arena_zeros(&arena, voxels, 1);
  supine_warp_span *span = supine_arena_take(&arena, rows, sizeof *span);
  SUPINE_TRY(supine_arena_check(&arena, error, "a label map of %zu voxels", voxels));
  for (size_t row = 0; row < rows; ++row) {
    span[row] = (supine_warp_span){0, labels->size[0]};
  }
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
    search s = {.frame = labels, .stage = stage, .span = span, .named = true, .tissue = tissue};
    const bool good = find_components(&s);
    free(s.list);
    if (!good) {
      return supine_error_memory(error, "parts of a label map");
    }
  }
  return supine_warp_tissue_group(tissue, error);
}

void supine_warp_tissue_free(supine_tissue *tissue) {
  for (size_t i = 0; i < tissue->part_count; ++i) {
    free_part(&tissue->parts[i]);
  }
  free(tissue->parts);
  free(tissue->gap);
  free(tissue->span);
  supine_image_free(&tissue->kind);
  supine_image_free(&tissue->air);
  *tissue = (supine_tissue){0};
}
