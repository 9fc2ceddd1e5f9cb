/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Embed points and meshes in the lungs, and write a basis that moves them with the lungs. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <supine/inputs.h>
#include <supine/safetensors.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/parallel.h"
#include "base/remedy.h"
#include "base/text.h"
#include "base/vec3.h"
#include "runtime/expected.h"
#include "runtime/rigid.h"

#include "precompute/inside/anatomy.h"
#include "precompute/inside/biharmonic.h"
#include "precompute/inside/embed.h"
#include "precompute/lungs/belong.h"

enum { BLOCK = 1024 };

/* The embedded points, sorted by lung, and their displacements. */
typedef struct embedding {
  const supine_inside_shells *shells;
  const supine_inside_content *content;
  const supine_inside_options *options;
  size_t columns;             /* number of coefficients of a point: 3 for each mode */
  supine_inside_place *place; /* [points] position in the lung, ordered like content->points */
  unsigned char *lung; /* [points] index of the lung of each point, ordered like content->points */
  size_t *order;       /* [points] indices of content->points, sorted by lung */
  float *vertices;     /* [points, 3] at full inflation, mm; this and later arrays follow `order` */
  float *coefficients; /* [points, 3, modes] displacement by each mode, mm */
  float *depth;        /* [points] mm below the surface; negative outside */
  uint32_t *part;      /* [points] index of the named point, mesh or grid node of each point */
  unsigned char *group; /* [points] index of the lung of each point */
  uint32_t *triangles;  /* [triangles, 3] indices of vertices */
  uint32_t *rigid;      /* [rigid_count, 2] begin and end of the vertices of each rigid piece */
  size_t rigid_count;
  unsigned char *anatomy; /* [parts] the tensor anatomy */
  double *squares;        /* [lungs, 3, modes, modes] the tensor lungs_squares */
  double *hilum;          /* [lungs, 3, modes] the tensor lungs_hilum */
  float *error_share;     /* [points] the tensor error_share; NULL without a fit of landmarks */
} embedding;

static void find_places(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const embedding *e = context;
  supine_inside_walk walk = {0};
  for (size_t i = begin; i < end; ++i) {
    const size_t lung =
        supine_inside_shells_find(e->shells, e->content->points + 3 * i, INFINITY, &walk);
    e->lung[i] = (unsigned char)lung;
    e->place[i] = walk.place[lung];
  }
}

/* Return the end of the range of points that belong to the part of point `begin`. A grid is one
 * part. */
static size_t end_of_part(const supine_inside_content *content, size_t begin) {
  size_t end = begin + 1;
  if (content->part_count == 0) {
    return content->count;
  }
  while (end < content->count && content->part[end] == content->part[begin]) {
    ++end;
  }
  return end;
}

/* Assign the points of each rigid piece to the lung that holds most of them. */
static void gather_pieces(embedding *e) {
  const supine_inside_content *content = e->content;
  if (content->rigid_count == 0) {
    return;
  }
  for (size_t begin = 0, end = 0; begin < content->count; begin = end) {
    size_t count[SUPINE_LUNGS_MAX] = {0};
    size_t most = 0;
    while (end < content->count && content->rigid[end] == content->rigid[begin]) {
      const size_t lung = e->lung[end++];
      most = ++count[lung] > count[most] ? lung : most;
    }
    if (content->rigid[begin] > 0) {
      for (size_t i = begin; i < end; ++i) {
        e->lung[i] = (unsigned char)most;
        e->place[i] = supine_lungs_surface_find(e->shells->shell[most].surface,
                                                content->points + 3 * i, NULL);
      }
    }
  }
}

/* Append the name of a part to `text`, if there is room. */
static void add_name(const char *names, size_t part, char *text, size_t size) {
  for (size_t i = 0; i < part; ++i) {
    names += strcspn(names, "\n");
    if (*names == '\n') {
      ++names;
    }
  }
  const size_t length = strlen(text);
  supine_text_add(text, size, "%s'%.*s'", length > 0 && text[length - 1] == '\'' ? ", " : "",
                  (int)strcspn(names, "\n"), names);
}

/* Refuse parts whose nearest point is too far outside the lungs. */
static supine_status check_distance(const embedding *e, supine_error *error) {
  const supine_inside_content *content = e->content;
  char far[160] = "";
  size_t far_count = 0;
  double farthest = 0.0;
  size_t parts = 0;
  for (size_t begin = 0, end = 0; begin < content->count; begin = end) {
    double nearest = INFINITY;
    end = end_of_part(content, begin);
    for (size_t i = begin; i < end; ++i) {
      nearest = fmin(nearest, -e->place[i].depth);
    }
    ++parts;
    if (supine_input_judge(SUPINE_INPUT_POINT_OUTSIDE, nearest) == SUPINE_INPUT_REFUSED) {
      ++far_count;
      farthest = fmax(farthest, nearest);
      if (content->part_count > 0 && far_count <= 3) {
        add_name(content->names, content->part[begin], far, sizeof far);
      }
    }
  }
  const char *more = far_count > 3 ? " and others" : "";
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
      supine_remedy_set("clamp", "to move them like the nearest point of the surface")};
  SUPINE_REFUSE_ADVISE(
      far_count > 0 && !e->options->clamp, error, advice, SUPINE_ERROR_MESH,
      "%zu of %zu (%s%s) are outside the lungs, by up to %.0f mm, where the motion "
      "of the lungs says nothing: leave them out, or check their axes and unit",
      far_count, parts, far, more, farthest);
  return SUPINE_OK;
}

/* Find the box of the lungs in the scan. */
static void find_box(const supine_inside_shells *shells, double low[3], double high[3]) {
  supine_box_begin(low, high);
  for (size_t lung = 0; lung < shells->count; ++lung) {
    for (size_t i = 0; i < shells->shell[lung].vertex_count; ++i) {
      supine_box_add(shells->shell[lung].vertices + 3 * i, low, high);
    }
  }
}

/* Return whether a point lies between the lungs. */
static bool is_between(const embedding *e, const double low[3], const double high[3],
                       const double point[3]) {
  const char *name = supine_basis_get_info(e->shells->basis)->lung_names[0];
  const int single = name[0] == 'l' ? 1 : -1;
  return supine_lungs_is_between(low, high, e->shells->count == 2 ? 0 : single, point);
}

/* Warn of the vertex of a mesh that is farthest outside the lungs, if it is as far as points must
 * not be. Airways go on so far between the lungs, but in short steps. */
static void check_strays(const embedding *e, const double low[3], const double high[3],
                         supine_findings *findings) {
  const supine_inside_content *content = e->content;
  double most = 0.0;
  double farthest = 0.0;
  size_t part = 0;
  for (size_t i = 0; i < 3 * content->triangle_count; ++i) {
    const size_t first = i - i % 3;
    const size_t vertex = content->triangles[i];
    const double *point = content->points + 3 * vertex;
    double step = INFINITY;
    for (size_t k = 1; k < 3; ++k) {
      const size_t next = content->triangles[first + (i + k) % 3];
      step = fmin(step, supine_distance(point, content->points + 3 * next));
    }
    const double outside = -e->place[vertex].depth;
    const double counted = is_between(e, low, high, point) ? fmin(step, outside) : outside;
    if (counted > most) {
      most = counted;
      farthest = outside;
      part = content->part[vertex];
    }
  }
  if (supine_input_judge(SUPINE_INPUT_POINT_OUTSIDE, most) != SUPINE_INPUT_TAKEN) {
    char text[96] = "";
    add_name(content->names, part, text, sizeof text);
    supine_findings_warn(findings,
                         "a vertex of %s is %.0f mm outside the lungs of the basis: check the mesh "
                         "for stray vertices and pieces",
                         text, farthest);
  }
}

/* Warn of parts that lie outside the lungs and not between them, as those of another person do. A
 * coarse surface cuts corners off the lungs, by up to about its edge length. */
static void check_belonging(const embedding *e, supine_findings *findings) {
  const double seen = 1.0 - e->content->unseen;
  if (supine_input_judge(SUPINE_INPUT_IMAGE_FRAME, seen) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(findings,
                         "only %.0f %% of the lungs lie in the image of the grid: give an image in "
                         "the frame of the scan",
                         100.0 * seen);
  }
  const supine_inside_content *content = e->content;
  double low[3];
  double high[3];
  find_box(e->shells, low, high);
  if (e->options->clamp || content->part_count == 0) {
    return;
  }
  bool taken = true;
  supine_lungs_belong points = {.rim = SUPINE_LUNGS_RIM + e->shells->shell[0].edge};
  for (size_t begin = 0, end = 0; begin < content->count; begin = end) {
    supine_lungs_belong part = {.rim = points.rim};
    end = end_of_part(content, begin);
    for (size_t i = begin; i < end; ++i) {
      const bool between = is_between(e, low, high, content->points + 3 * i);
      supine_lungs_belong_add(end == begin + 1 ? &points : &part,
                              between ? 0.0 : e->place[i].depth);
    }
    char text[96] = "vertices of ";
    add_name(content->names, content->part[begin], text, sizeof text);
    const supine_input_verdict verdict =
        supine_lungs_belong_judge(&part, SUPINE_INPUT_CONTENT_OUTSIDE, text, "basis", findings);
    taken = taken && verdict == SUPINE_INPUT_TAKEN;
  }
  (void)supine_lungs_belong_judge(&points, SUPINE_INPUT_CONTENT_OUTSIDE, "points", "basis",
                                  findings);
  if (taken) {
    check_strays(e, low, high, findings);
  }
}

/* List the ranges of points that belong to one rigid piece. */
static void list_rigid(embedding *e, size_t n) {
  const uint32_t *rigid = e->content->rigid;
  for (size_t begin = 0, end = 0; begin < n; begin = end) {
    while (end < n && rigid[e->order[end]] == rigid[e->order[begin]]) {
      ++end;
    }
    if (rigid[e->order[begin]] > 0 && end > begin + 1) {
      e->rigid[2 * e->rigid_count] = (uint32_t)begin;
      e->rigid[2 * e->rigid_count++ + 1] = (uint32_t)end;
    }
  }
}

/* Sort the points by lung, in stable order, and renumber the triangles. */
static supine_status sort_points(embedding *e, supine_inside_report *report, supine_error *error) {
  const size_t n = e->content->count;
  SUPINE_ARENA arena = {0};
  uint32_t *position = supine_arena_take(&arena, n, sizeof *position);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu points", n));
  size_t at = 0;
  for (size_t lung = 0; lung < e->shells->count; ++lung) {
    for (size_t i = 0; i < n; ++i) {
      if (e->lung[i] != lung) {
        continue;
      }
      const double depth = e->place[i].depth;
      e->order[at] = i;
      position[i] = (uint32_t)at;
      e->group[at] = (unsigned char)lung;
      e->part[at] = e->content->part[i];
      e->depth[at] = (float)depth;
      ++at;
      ++report->in_lung[lung];
      report->outside += depth < 0.0;
      if (-depth > report->farthest_mm) {
        report->farthest_mm = -depth;
        report->farthest = i;
      }
    }
  }
  for (size_t i = 0; i < 3 * e->content->triangle_count; ++i) {
    e->triangles[i] = position[e->content->triangles[i]];
  }
  if (e->content->rigid_count > 0) {
    list_rigid(e, n);
  }
  report->count = n;
  report->rigid = e->rigid_count;
  return SUPINE_OK;
}

/* Interpolate the displacement by each mode at the surface point place->nearest. */
static void surface_motion(const embedding *e, const supine_inside_shell *shell,
                           const double *displacement, const supine_inside_place *place,
                           double *motion) {
  const uint32_t *corner = shell->triangles + 3 * place->triangle;
  for (size_t r = 0; r < e->columns; ++r) {
    motion[r] = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      motion[r] += place->barycentric[k] * displacement[corner[k] * e->columns + r];
    }
  }
}

/* Return the factor on the lengths of a lung by which it has collapsed; 1 if it has not. */
static double collapse_of(const embedding *e, size_t lung) {
  return 1.0 / (1.0 + e->shells->scan.expansion[lung]);
}

/* Return a coordinate of a point of the scan in its lung as the modes move it: collapsed, if the
 * basis holds it as collapsed. */
static double collapse_point(const embedding *e, size_t lung, const double *point, size_t axis) {
  const double *hilum = supine_basis_get_info(e->shells->basis)->hilum;
  if (hilum == NULL) {
    return point[axis];
  }
  const double fixed = hilum[3 * lung + axis];
  return fixed + collapse_of(e, lung) * (point[axis] - fixed);
}

/* Compute positions at full inflation: positions in the scan, collapsed as in the basis, minus
 * displacements to the scan.
 * @param values  [end - begin, e->columns] displacement by each mode, mm */
static void points_to_full(embedding *e, size_t lung, size_t begin, size_t end,
                           const double *values) {
  const size_t modes = e->columns / 3;
  const double *weights = supine_basis_lung_weights(e->shells->basis, &e->shells->scan, lung);
  for (size_t i = begin; i < end; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const double *row = values + (i - begin) * e->columns + axis * modes;
      double moved = 0.0;
      for (size_t k = 0; k < modes; ++k) {
        moved += e->shells->scan.gains[lung][axis] * weights[k] * row[k];
      }
      const double *point = e->content->points + 3 * e->order[i];
      e->vertices[3 * i + axis] = (float)(collapse_point(e, lung, point, axis) - moved);
    }
  }
}

/* Scale the interpolated displacements b_k by each mode k at `count` positions, so that with the
 * weights w of the scan's posture they add up to the displacement u of options->field:
 *
 *     b_k := u (b_k . B) / (B . B),    B = sum over k of w_k b_k */
static void take_field(const embedding *e, size_t lung, size_t count, const double *positions,
                       double *values) {
  const size_t modes = e->columns / 3;
  const double *weights = supine_basis_lung_weights(e->shells->basis, &e->shells->scan, lung);
  const char *name = supine_basis_get_info(e->shells->basis)->lung_names[lung];
  if (e->options->field != NULL) {
    for (size_t i = 0; i < count; ++i) {
      double *of[3] = {values + 3 * i * modes, values + (3 * i + 1) * modes,
                       values + (3 * i + 2) * modes};
      double sum[3] = {0.0, 0.0, 0.0};
      double u[3];
      for (size_t k = 0; k < 3 * modes; ++k) {
        sum[k / modes] += weights[k % modes] * of[k / modes][k % modes];
      }
      const double square = supine_dot(sum, sum);
      e->options->field(e->options->context, positions + 3 * i, name[0] == 'l' ? 1.0 : -1.0, u);
      if (square > 0.0) {
        for (size_t k = 0; k < modes; ++k) {
          const double factor =
              (of[0][k] * sum[0] + of[1][k] * sum[1] + of[2][k] * sum[2]) / square;
          for (size_t axis = 0; axis < 3; ++axis) {
            of[axis][k] = factor * u[axis];
          }
        }
      }
    }
  }
}

/* Find the displacements of the points order[begin] to order[end - 1], at most BLOCK, of one lung.
 * @param displacement  [vertices of the lung, columns] displacement of the surface by each mode, mm
 * @param reach  distance from the surface, mm, below which the interpolation `fit` is corrected
 * @param space  work space: positions of 2 BLOCK points, displacements of 2 BLOCK + 1 points */
static void move_block(embedding *e, const double *displacement,
                       const supine_inside_biharmonic *fit, double reach, size_t begin, size_t end,
                       double *space) {
  const size_t lung = e->group[begin];
  double *positions = space;
  double *values = space + (size_t)6 * BLOCK;
  const size_t count = end - begin;
  size_t near[BLOCK];
  size_t near_count = 0;
  for (size_t i = 0; i < count; ++i) {
    const supine_inside_place *place = &e->place[e->order[begin + i]];
    const bool clamp = e->options->clamp && place->depth < 0.0;
    memcpy(positions + 3 * i, clamp ? place->nearest : place->point, sizeof place->point);
  }
  for (size_t i = 0; i < count; ++i) {
    const supine_inside_place *place = &e->place[e->order[begin + i]];
    if (fabs(place->depth) < reach || (e->options->clamp && place->depth < 0.0)) {
      memcpy(positions + 3 * (count + near_count), place->nearest, sizeof place->nearest);
      near[near_count++] = i;
    }
  }
  supine_inside_biharmonic_evaluate(fit, count + near_count, positions, values);
  take_field(e, lung, count + near_count, positions, values);
  double *motion = values + (size_t)2 * BLOCK * e->columns;
  for (size_t j = 0; j < near_count; ++j) {
    const supine_inside_place *place = &e->place[e->order[begin + near[j]]];
    const bool clamp = e->options->clamp && place->depth < 0.0;
    const double t = clamp ? 0.0 : fabs(place->depth) / reach;
    const double weight = (1.0 - t) * (1.0 - t) * (1.0 + 2.0 * t);
    const double *at_surface = values + (count + j) * e->columns;
    double *value = values + near[j] * e->columns;
    surface_motion(e, &e->shells->shell[lung], displacement, place, motion);
    for (size_t r = 0; r < e->columns; ++r) {
      value[r] += weight * (motion[r] - at_surface[r]);
    }
  }
  for (size_t i = 0; i < count * e->columns; ++i) {
    e->coefficients[begin * e->columns + i] = (float)values[i];
  }
  points_to_full(e, lung, begin, end, values);
}

/* Add the products of the displacements of one lung's vertices by two modes, divided by the number
 * of vertices of all lungs, to e->squares. */
static void add_squares(embedding *e, size_t lung, const double *displacement) {
  const size_t modes = e->columns / 3;
  const double share = 1.0 / (double)supine_basis_get_info(e->shells->basis)->vertex_count;
  for (size_t row = 0; row < 3 * e->shells->shell[lung].vertex_count; ++row) {
    const double *d = displacement + row * modes;
    double *sum = e->squares + (3 * lung + row % 3) * modes * modes;
    for (size_t k = 0; k < modes * modes; ++k) {
      sum[k] += share * d[k / modes] * d[k % modes];
    }
  }
}

static supine_status embed_lung(embedding *e, size_t lung, size_t begin, size_t end,
                                supine_error *error) {
  /* (width of the correction zone) / (spacing of interpolation centres + mean edge length) */
  static const double reach_spacings = 2.0;
  const supine_inside_shell *shell = &e->shells->shell[lung];
  const size_t centres =
      e->options->centres > 0 ? e->options->centres : (size_t)SUPINE_INSIDE_CENTRES;
  SUPINE_ARENA arena = {0};
  SUPINE_FREED_BY(supine_inside_biharmonic_free) supine_inside_biharmonic fit = {0};
  double *displacement =
      supine_arena_take(&arena, shell->vertex_count * e->columns, sizeof *displacement);
  double *space = supine_arena_take(
      &arena, 6 * (size_t)BLOCK + (2 * (size_t)BLOCK + 1) * e->columns, sizeof *space);
  SUPINE_TRY(supine_arena_check(&arena, error, "the motion of %zu vertices", shell->vertex_count));
  supine_inside_shell_displacement(e->shells, lung, displacement);
  add_squares(e, lung, displacement);
  if (begin < end) {
    SUPINE_TRY(supine_inside_biharmonic_fit(shell->vertex_count, shell->vertices, e->columns,
                                            displacement, centres, &fit, error));
  }
  const double reach =
      e->options->field != NULL ? shell->edge : reach_spacings * (fit.spacing + shell->edge);
  for (size_t at = begin; at < end; at += BLOCK) {
    move_block(e, displacement, &fit, reach, at, at + BLOCK < end ? at + BLOCK : end, space);
  }
  return SUPINE_OK;
}

/* Find where a rigid part lies at full inflation, so that the mode weights and gains of the scan
 * move it to its scanned position. Iterate, because the rotation of the part by this movement
 * depends on the unknown position. A rigid part of a collapsed lung has moved to the hilum with it,
 * but has not shrunk. */
static void rigid_to_full(embedding *e, size_t begin, size_t end) {
  enum { TURNS = 60 };
  const double count = (double)(end - begin);
  const double collapse = collapse_of(e, e->group[begin]);
  double given[3] = {0.0};
  double full[3] = {0.0};
  double r[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  for (size_t k = 3 * begin; k < 3 * end; ++k) {
    given[k % 3] += e->content->points[3 * e->order[k / 3] + k % 3] / count;
    full[k % 3] += (double)e->vertices[k] / count;
  }
  for (int turn = 0; turn <= TURNS; ++turn) {
    double h[3][3] = {{0.0}};
    for (size_t i = begin; i < end; ++i) {
      const double *scan = e->content->points + 3 * e->order[i];
      double p[3];
      for (size_t a = 0; a < 3; ++a) {
        p[a] = r[a] * (scan[0] - given[0]) + r[3 + a] * (scan[1] - given[1]) +
               r[6 + a] * (scan[2] - given[2]);
      }
      for (size_t k = 0; k < 9; ++k) {
        const size_t b = k % 3;
        const double moved =
            collapse * (scan[b] - given[b]) - ((double)e->vertices[3 * i + b] - full[b]);
        h[k / 3][b] += p[k / 3] * (p[b] + moved);
      }
      if (turn == TURNS) {
        for (size_t a = 0; a < 3; ++a) {
          e->vertices[3 * i + a] = (float)(full[a] + p[a]);
        }
      }
    }
    supine_rigid_rotation((const double(*)[3])h, r);
  }
}

/* Return whether metadata with this key apply to the basis of the lungs' surface only. */
static bool is_of_surface(const char *key) {
  static const char *const keys[] = {"kind", "made_by", "checksum", "turned_over_percent",
                                     "mode_count"};
  for (size_t i = 0; i < sizeof keys / sizeof *keys; ++i) {
    if (strcmp(key, keys[i]) == 0) {
      return true;
    }
  }
  return false;
}

/* Write the basis file. Add the metadata of the points to those copied from the lungs' basis. */
static supine_status write_file(const embedding *e, const char *path, supine_tensor *tensors,
                                size_t tensor_count, supine_error *error) {
  enum { OWN = 5 };
  size_t given = 0;
  const supine_metadata *from = supine_basis_all_metadata(e->shells->basis, &given);
  SUPINE_ARENA arena = {0};
  supine_metadata *metadata = supine_arena_take(&arena, given + OWN, sizeof *metadata);
  SUPINE_TRY(supine_arena_check(&arena, error, "the metadata of %s", path));
  size_t count = 0;
  for (size_t i = 0; i < given; ++i) {
    if (!is_of_surface(from[i].key)) {
      metadata[count++] = from[i];
    }
  }
  char modes[24];
  (void)snprintf(modes, sizeof modes, "%zu", e->columns / 3);
  const supine_inside_content *content = e->content;
  metadata[count++] = (supine_metadata){"kind", "vector"};
  metadata[count++] = (supine_metadata){"mode_count", modes};
  const char *kind = content->triangle_count > 0 ? "mesh" : "points";
  if (content->part_count == 0) {
    kind = "grid";
  }
  metadata[count++] = (supine_metadata){"content", kind};
  metadata[count++] = (supine_metadata){"outside", e->options->clamp ? "clamped" : "extrapolated"};
  metadata[count++] = (supine_metadata){
      "made_by", e->options->made_by != NULL ? e->options->made_by : "supine_inside_embed"};
  return supine_safetensors_write(path, tensors, tensor_count, metadata, count, error);
}

typedef struct sharing {
  const embedding *e;
  supine_kriging fit; /* to the landmarks */
  double *scratch;    /* [threads, landmarks] */
  double held_out;    /* mean share at landmarks that were held out */
} sharing;

static void share_range(void *context, size_t begin, size_t end, size_t thread) {
  const sharing *s = context;
  for (size_t i = begin; i < end; ++i) {
    const float *p = s->e->vertices + 3 * i;
    const double place[3] = {(double)p[0], (double)p[1], (double)p[2]};
    const supine_kriging_point at = supine_kriging_landmark(place, s->e->group[i]);
    const double share = supine_kriging_share(&s->fit, &at, s->scratch + thread * s->fit.count);
    s->e->error_share[i] = (float)(share / s->held_out);
  }
}

/* Find what the landmarks of a fit, if the lungs' basis has any, leave of the error of each
 * point. */
static supine_status share_errors(embedding *e, supine_error *error) {
  enum { GRAIN = 64 };
  const supine_basis *lungs = e->shells->basis;
  const size_t n = supine_expected_landmark_count(lungs);
  if (n == 0) {
    e->error_share = NULL;
    return SUPINE_OK;
  }
  sharing s = {.e = e, .held_out = supine_expected_held_out(lungs)};
  SUPINE_ARENA arena = {0};
  supine_kriging_point *seen = supine_arena_take(&arena, n, sizeof *seen);
  double *space = supine_arena_take(&arena, supine_kriging_space(n), sizeof *space);
  s.scratch = supine_arena_take(&arena, supine_thread_count(), n * sizeof *s.scratch);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu landmarks", n));
  SUPINE_TRY(supine_expected_fit_landmarks(lungs, seen, space, &s.fit, error));
  supine_parallel_for(e->content->count, GRAIN, 0, share_range, &s);
  return SUPINE_OK;
}

/* Tensors of the lungs' basis that the file takes over. */
static const char *const shared[] = {
    "modes",        "volume_linear", "volume_quadratic", "volume_cubic",     "resting_volume",
    "volume_range", "full_volume",   "simulated_range",  "simulated_limits", "simulated_shares",
    "landmarks"};

static supine_status write_content(const embedding *e, const char *path, supine_error *error) {
  const supine_inside_content *content = e->content;
  const supine_image *grid = &content->grid;
  const size_t n = content->count;
  const double frame[4][3] = {{grid->origin[0], grid->origin[1], grid->origin[2]},
                              {grid->step[0][0], grid->step[0][1], grid->step[0][2]},
                              {grid->step[1][0], grid->step[1][1], grid->step[1][2]},
                              {grid->step[2][0], grid->step[2][1], grid->step[2][2]}};
  const uint32_t size[3] = {(uint32_t)grid->size[0], (uint32_t)grid->size[1],
                            (uint32_t)grid->size[2]};
  const supine_basis_info *info = supine_basis_get_info(e->shells->basis);
  double box[2][3];
  for (size_t i = 0; i < 6 * e->shells->count; ++i) {
    double *corner = &box[i / 3 % 2][i % 3];
    const double x = (double)info->bounds[i];
    *corner = i < 6 || (i / 3 % 2 == 0 ? x < *corner : x > *corner) ? x : *corner;
  }
  supine_tensor tensors[24] = {
      {"vertices", SUPINE_F32, 2, {n, 3}, e->vertices},
      {"triangles", SUPINE_U32, 2, {content->triangle_count, 3}, e->triangles},
      {"lung", SUPINE_U8, 1, {n}, e->group},
      {"coefficients", SUPINE_F32, 3, {n, 3, e->columns / 3}, e->coefficients},
      {"part", SUPINE_U32, 1, {n}, e->part},
      {"depth", SUPINE_F32, 1, {n}, e->depth},
      {"lungs_box", SUPINE_F64, 2, {2, 3}, box},
      {"lungs_squares",
       SUPINE_F64,
       4,
       {e->shells->count, 3, e->columns / 3, e->columns / 3},
       e->squares},
  };
  size_t count = 8;
  for (size_t i = 0; i < sizeof shared / sizeof *shared; ++i) {
    const supine_tensor *tensor = supine_basis_tensor(e->shells->basis, shared[i]);
    if (tensor != NULL) {
      tensors[count++] = *tensor;
    }
  }
  if (content->part_count == 0) {
    tensors[count++] = (supine_tensor){"grid", SUPINE_F64, 2, {4, 3}, frame};
    tensors[count++] = (supine_tensor){"grid_size", SUPINE_U32, 1, {3}, size};
  } else {
    tensors[count++] =
        (supine_tensor){"names", SUPINE_U8, 1, {strlen(content->names)}, content->names};
    tensors[count++] = (supine_tensor){"anatomy", SUPINE_U8, 1, {content->part_count}, e->anatomy};
  }
  bool has_hilum;
  SUPINE_TRY(supine_inside_hilum(e->shells->basis, e->hilum, &has_hilum, error));
  if (has_hilum) {
    tensors[count++] = (supine_tensor){
        "lungs_hilum", SUPINE_F64, 3, {e->shells->count, 3, e->columns / 3}, e->hilum};
  }
  if (e->error_share != NULL) {
    tensors[count++] = (supine_tensor){"error_share", SUPINE_F32, 1, {n}, e->error_share};
  }
  if (e->rigid_count > 0) {
    tensors[count++] = (supine_tensor){"rigid", SUPINE_U32, 2, {e->rigid_count, 2}, e->rigid};
  }
  return write_file(e, path, tensors, count, error);
}

supine_status supine_inside_embed(const supine_inside_shells *shells,
                                  const supine_inside_content *content,
                                  const supine_inside_options *options, const char *path,
                                  supine_inside_report *report, supine_error *error) {
  enum { GRAIN = 256 };
  const size_t n = content->count;
  const size_t columns = 3 * supine_basis_get_info(shells->basis)->mode_count;
  *report = (supine_inside_report){0};
  SUPINE_REFUSE_IF(n == 0, error, SUPINE_ERROR_MESH, "nothing to embed: give at least one point");
  SUPINE_ARENA arena = {0};
  embedding e = {
      .shells = shells,
      .content = content,
      .options = options,
      .columns = columns,
      .place = supine_arena_take(&arena, n, sizeof *e.place),
      .lung = supine_arena_take(&arena, n, 1),
      .order = supine_arena_take(&arena, n, sizeof *e.order),
      .vertices = supine_arena_take(&arena, 3 * n, sizeof *e.vertices),
      .coefficients = supine_arena_take(&arena, n * columns, sizeof *e.coefficients),
      .depth = supine_arena_take(&arena, n, sizeof *e.depth),
      .part = supine_arena_take(&arena, n, sizeof *e.part),
      .group = supine_arena_take(&arena, n, 1),
      .error_share = supine_arena_take(&arena, n, sizeof *e.error_share),
      .triangles = supine_arena_take(&arena, 3 * content->triangle_count, sizeof *e.triangles),
      .rigid = supine_arena_take(&arena, 2 * content->rigid_count, sizeof *e.rigid),
      .anatomy = supine_arena_take(&arena, content->part_count, 1),
      .hilum = supine_arena_take(&arena, shells->count * columns, sizeof *e.hilum),
      .squares = supine_arena_zeros(&arena, shells->count * columns * columns, sizeof *e.squares)};
  SUPINE_TRY(
      supine_arena_check(&arena, error, "%zu points, each with %zu coefficients", n, columns));
  supine_parallel_for(n, GRAIN, 0, find_places, &e);
  check_belonging(&e, &report->findings); /* before rigid parts are counted as of one lung */
  gather_pieces(&e);
  SUPINE_TRY(check_distance(&e, error));
  SUPINE_TRY(supine_inside_anatomy(shells, content, e.anatomy, error));
  SUPINE_TRY(sort_points(&e, report, error));
  for (size_t lung = 0, begin = 0; lung < shells->count; begin += report->in_lung[lung++]) {
    SUPINE_TRY(embed_lung(&e, lung, begin, begin + report->in_lung[lung], error));
  }
  for (size_t i = 0; i < e.rigid_count; ++i) {
    rigid_to_full(&e, e.rigid[2 * i], e.rigid[2 * i + 1]);
  }
  SUPINE_TRY(share_errors(&e, error));
  return write_content(&e, path, error);
}
