/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw the outlines of the lungs in slices, for outline.html: in three planes through each target,
 * or in four slices if there are no targets. */
#include <math.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/locale.h"
#include "base/number.h"
#include "base/text.h"

#include "program/report/comparison.h"
#include "program/view/render/render.h"

enum { TARGETS_MAX = 30 }; /* targets whose outlines are drawn */

/* A slice as it is drawn. */
typedef struct slice {
  const char *name;
  size_t axis;      /* axis normal to the slice */
  double share;     /* position along `axis`, as a fraction of the lungs' extent */
  size_t across;    /* axis that points to the right in the picture */
  size_t vertical;  /* axis that is vertical in the picture */
  double sign;      /* 1 if `vertical` points down, -1 if it points up */
  const char *ends; /* letters at the right, left, top and bottom */
} slice;

/* Slices without a target. */
static const slice slices[] = {{"Axial, upper third", 2, 2.0 / 3, 0, 1, 1, "LRAP"},
                               {"Axial, lower third", 2, 1.0 / 3, 0, 1, 1, "LRAP"},
                               {"Coronal, front third", 1, 1.0 / 3, 0, 2, -1, "LRHF"},
                               {"Coronal, back third", 1, 2.0 / 3, 0, 2, -1, "LRHF"}};

/* Planes through a target. */
static const slice planes[] = {{"axial, from the feet", 2, 0, 0, 1, 1, "LRAP"},
                               {"coronal, from the front", 1, 0, 0, 2, -1, "LRHF"},
                               {"sagittal, from the left", 0, 0, 1, 2, -1, "PAHF"}};

/* A triangle that a slice crosses. Its boundary rises through the plane on one edge and falls on
 * another, on which that of the next triangle of the outline rises. */
typedef struct crossing {
  uint64_t rising, falling; /* edges: the smaller index of a vertex times 2^32, plus the larger */
  double from[2], to[2];    /* points of the rising and of the falling edge */
  bool drawn;
} crossing;

/* The lungs in the reference pose and in each posture. */
typedef struct shapes {
  const supine_comparison *c;
  const supine_basis_info *info;
  float *before; /* [N, 3] mm */
  float **now;   /* [postures.count][N, 3] mm */
  crossing *met; /* [triangles] memory of trace */
  double *area;  /* [postures.count] inside the outlines of a chart, mm^2 */
  bool failed;   /* whether memory for an outline was refused */
  double low[3]; /* box of the lungs in all postures, mm */
  double high[3];
  supine_arena arena;
} shapes;

static void free_shapes(shapes *s) {
  supine_arena_free(&s->arena);
}

/* Compute the positions of all vertices. */
static supine_status find_shapes(const supine_comparison *c, shapes *s, supine_error *error) {
  s->c = c;
  s->info = supine_basis_get_info(c->basis);
  const size_t n = s->info->vertex_count;
  s->now = supine_arena_zeros(&s->arena, c->postures.count, sizeof *s->now);
  s->met = supine_arena_take(&s->arena, s->info->triangle_count, sizeof *s->met);
  s->before = supine_arena_take(&s->arena, n, 3 * sizeof *s->before);
  s->area = supine_arena_zeros(&s->arena, c->postures.count, sizeof *s->area);
  for (size_t i = 0; i < c->postures.count && !s->arena.failed; ++i) {
    s->now[i] = supine_arena_take(&s->arena, n, 3 * sizeof *s->now[i]);
  }
  SUPINE_TRY(supine_arena_check(&s->arena, error, "outlines of %zu vertices", n));
  for (size_t axis = 0; axis < 3; ++axis) {
    s->low[axis] = INFINITY;
    s->high[axis] = -INFINITY;
  }
  (void)supine_deform(c->basis, &c->reference.pose, s->before);
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)supine_deform(c->basis, &c->posture[i].pose, s->now[i]);
    supine_render_box(s->now[i], n, s->low, s->high);
  }
  return SUPINE_OK;
}

/* Convert a point, mm, to coordinates of the picture. */
static void project(const slice *s, const double xyz[3], double point[2]) {
  point[0] = xyz[s->across];
  point[1] = s->sign * xyz[s->vertical];
}

/* Compute the point where the edge from `a` to `b` crosses the slice at the coordinate `at`, mm. */
static void cross(const slice *s, double at, const float *a, const float *b, double point[2]) {
  const double t = (at - (double)a[s->axis]) / ((double)b[s->axis] - (double)a[s->axis]);
  double xyz[3];
  for (size_t axis = 0; axis < 3; ++axis) {
    xyz[axis] = (double)a[axis] + t * ((double)b[axis] - (double)a[axis]);
  }
  project(s, xyz, point);
}

/* Set `met` if a slice crosses triangle `t`, and return whether it does. */
static bool cross_triangle(const supine_basis_info *info, const slice *s, double at,
                           const float *xyz, size_t t, crossing *met) {
  bool crossed = false;
  for (size_t i = 0; i < 3; ++i) {
    const uint32_t v[2] = {info->triangles[3 * t + i], info->triangles[3 * t + (i + 1) % 3]};
    const bool swapped = v[0] > v[1];
    const uint64_t edge = (uint64_t)v[swapped] << 32 | v[!swapped];
    const float *a = xyz + 3 * (size_t)v[swapped]; /* the same in both triangles of the edge */
    const float *b = xyz + 3 * (size_t)v[!swapped];
    const bool above[2] = {(double)xyz[3 * (size_t)v[0] + s->axis] > at,
                           (double)xyz[3 * (size_t)v[1] + s->axis] > at};
    if (above[1] && !above[0]) {
      cross(s, at, a, b, met->from);
      met->rising = edge;
      crossed = true;
    } else if (above[0] && !above[1]) {
      cross(s, at, a, b, met->to);
      met->falling = edge;
    }
  }
  return crossed;
}

static int by_rising(const void *a, const void *b) {
  const uint64_t p = ((const crossing *)a)->rising;
  const uint64_t q = ((const crossing *)b)->rising;
  return (p > q) - (p < q);
}

/* Print the outline as an SVG path of closed lines. Return the area inside, mm^2.
 * @param met  memory for a crossing of each triangle */
static double trace(const supine_basis_info *info, const slice *s, double at, const float *xyz,
                    crossing *met, FILE *path) {
  double twice = 0.0;
  size_t count = 0;
  for (size_t t = 0; t < info->triangle_count; ++t) {
    met[count] = (crossing){.drawn = false};
    count += cross_triangle(info, s, at, xyz, t, &met[count]);
  }
  qsort(met, count, sizeof *met, by_rising);
  for (size_t i = 0; i < count; ++i) {
    crossing *next = &met[i];
    if (!next->drawn) {
      (void)supine_print(path, "M%.1f %.1f", next->from[0], next->from[1]);
    }
    while (next != NULL && !next->drawn) {
      const crossing key = {.rising = next->falling};
      next->drawn = true;
      twice += next->from[0] * next->to[1] - next->to[0] * next->from[1];
      (void)supine_print(path, "L%.1f %.1f", next->to[0], next->to[1]);
      next = bsearch(&key, met, count, sizeof *met, by_rising);
    }
  }
  return fabs(twice) / 2;
}

/* Return the outline of positions as an SVG path; set `area` to the area inside, mm^2. */
static json_t *outline(shapes *of, const slice *s, double at, const float *xyz, double *area) {
  char *text = NULL;
  size_t size = 0;
  FILE *path = open_memstream(&text, &size);
  if (path == NULL) {
    of->failed = true;
    return json_string("");
  }
  *area = trace(of->info, s, at, xyz, of->met, path);
  const bool whole = fclose(path) == 0;
  of->failed = of->failed || !whole;
  json_t *made = json_string(whole ? text : "");
  free(text);
  return made;
}

static json_t *letter(double x, double y, char name) {
  SUPINE_C_LOCALE;
  return json_pack("{s:o, s:o, s:o}", "x", json_sprintf("%.0f", x), "y", json_sprintf("%.0f", y),
                   "letter", json_sprintf("%c", name));
}

/* Return the chart of a slice at the coordinate `at`, mm, without a title: outlines in the
 * reference and in each posture, letters at the ends, and a bar of 5 cm. */
static json_t *chart(shapes *of, const slice *s, double at, double *before) {
  SUPINE_C_LOCALE;
  enum { MARGIN = 18, SCALE_BAR = 50 }; /* mm */
  const double left = of->low[s->across];
  const double right = of->high[s->across];
  const double top = s->sign > 0 ? of->low[s->vertical] : -of->high[s->vertical];
  const double bottom = s->sign > 0 ? of->high[s->vertical] : -of->low[s->vertical];
  json_t *path = outline(of, s, at, of->before, before);
  json_t *lines = json_array();
  for (size_t i = 0; i < of->c->postures.count; ++i) {
    if (!supine_report_is_reference(of->c, i)) {
      json_t *line = supine_report_line(of->c, i);
      (void)json_object_set_new(line, "path", outline(of, s, at, of->now[i], &of->area[i]));
      (void)json_array_append_new(lines, line);
    }
  }
  return json_pack("{s:f, s:o, s:o, s:o, s:o, s:[o, o, o, o]}", "wide", right - left + 2 * MARGIN,
                   "box",
                   json_sprintf("%.0f %.0f %.0f %.0f", left - MARGIN, top - MARGIN,
                                right - left + 2 * MARGIN, bottom - top + 2 * MARGIN + 10),
                   "before", path, "lines", lines, "mark",
                   json_sprintf("M%.0f %.0fh%d", left - MARGIN + 2, bottom + MARGIN + 6, SCALE_BAR),
                   "letters", letter(right + 10, (top + bottom) / 2, s->ends[0]),
                   letter(left - 10, (top + bottom) / 2, s->ends[1]),
                   letter((left + right) / 2, top - 10, s->ends[2]),
                   letter((left + right) / 2, bottom + 10, s->ends[3]));
}

/* Return the title of a slice, which states how each posture changes the area. */
static json_t *area_title(const supine_comparison *c, const slice *s, double before,
                          const double *area) {
  SUPINE_C_LOCALE;
  const char *separator = "";
  json_t *title = json_sprintf("%s: area", s->name);
  for (size_t i = 0; i < c->postures.count; ++i) {
    if (!supine_report_is_reference(c, i)) {
      json_t *longer =
          json_sprintf("%s%s %s %s %%", json_string_value(title), separator, c->posture[i].label,
                       supine_text_change(100 * (area[i] / before - 1)).text);
      json_decref(title);
      title = longer;
      separator = ",";
    }
  }
  return title;
}

/* Set for each chart the width that it has beside the others, and below them, %: all are drawn at
 * one scale. */
static void set_widths(json_t *charts) {
  SUPINE_C_LOCALE;
  double sum = 0.0;
  double most = 0.0;
  size_t i;
  json_t *made;
  json_array_foreach(charts, i, made) {
    const double wide = json_real_value(json_object_get(made, "wide"));
    sum += wide;
    most = fmax(most, wide);
  }
  json_array_foreach(charts, i, made) {
    const double wide = json_real_value(json_object_get(made, "wide"));
    (void)json_object_set_new(made, "part", json_sprintf("%.2f", 100.0 * wide / sum));
    (void)json_object_set_new(made, "share", json_sprintf("%.2f", 100.0 * wide / most));
  }
}

/* Hand over `list`, unless memory for one of its outlines was refused. */
static supine_status finish(const shapes *of, json_t *list, json_t **made, supine_error *error) {
  if (of->failed) {
    json_decref(list);
    return supine_error_memory(error, "outlines of %zu vertices", of->info->vertex_count);
  }
  *made = list;
  return SUPINE_OK;
}

supine_status supine_report_outlines(const supine_comparison *c, json_t **made,
                                     supine_error *error) {
  SUPINE_FREED_BY(free_shapes) shapes of = {.c = c};
  SUPINE_TRY(find_shapes(c, &of, error));
  json_t *list = json_array();
  for (size_t i = 0; i < sizeof slices / sizeof *slices; ++i) {
    const slice *s = &slices[i];
    double before = 0.0;
    const double at = of.low[s->axis] + s->share * (of.high[s->axis] - of.low[s->axis]);
    json_t *drawn = chart(&of, s, at, &before);
    (void)json_object_set_new(drawn, "title", area_title(c, s, before, of.area));
    (void)json_array_append_new(list, drawn);
  }
  set_widths(list);
  return finish(&of, list, made, error);
}

/* Add to the chart of a plane where target `k` was, and for each posture a dot where it is and a
 * ring of the expected error of its displacement. Later dots are smaller, so that none hides
 * another. */
static void add_target(const supine_comparison *c, const slice *s, size_t k, const double was[3],
                       json_t *made) {
  SUPINE_C_LOCALE;
  double from[2];
  json_t *dots = json_array();
  double radius = 3.2; /* mm, below most errors, so that their rings are seen */
  project(s, was, from);
  for (size_t i = 0; i < c->postures.count; ++i) {
    if (!supine_report_is_reference(c, i)) {
      double to[2];
      project(s, c->posture[i].targets[k].at, to);
      const double error = c->posture[i].targets[k].moved_error;
      json_t *dot = json_pack("{s:o, s:o, s:o, s:o, s:o}", "x", json_sprintf("%.1f", to[0]), "y",
                              json_sprintf("%.1f", to[1]), "r", json_sprintf("%.1f", radius), "way",
                              json_sprintf("M%.1f %.1fL%.1f %.1f", from[0], from[1], to[0], to[1]),
                              "ring", json_sprintf("%.1f", error > 0.0 ? error : 0.0));
      (void)json_object_update_new(dot, supine_report_line(c, i));
      (void)json_array_append_new(dots, dot);
      radius *= 0.75;
    }
  }
  (void)json_object_set_new(made, "title", json_string(s->name));
  (void)json_object_set_new(made, "target",
                            json_pack("{s:o, s:o, s:o}", "was_x", json_sprintf("%.1f", from[0]),
                                      "was_y", json_sprintf("%.1f", from[1]), "dots", dots));
}

/* Return the charts of the planes through the place where target `k` was. */
static json_t *target_charts(shapes *of, size_t k) {
  const supine_target *t = &of->c->posture[0].targets[k];
  json_t *charts = json_array();
  double was[3];
  for (size_t axis = 0; axis < 3; ++axis) {
    was[axis] = t->at[axis] - t->move[axis];
  }
  for (size_t i = 0; i < sizeof planes / sizeof *planes; ++i) {
    double before = 0.0;
    json_t *made = chart(of, &planes[i], was[planes[i].axis], &before);
    add_target(of->c, &planes[i], k, was, made);
    (void)json_array_append_new(charts, made);
  }
  set_widths(charts);
  return json_pack("{s:s, s:o}", "name", of->c->names.text[k], "outlines", charts);
}

supine_status supine_report_target_outlines(const supine_comparison *c, json_t **made,
                                            supine_error *error) {
  SUPINE_C_LOCALE;
  SUPINE_FREED_BY(free_shapes) shapes of = {.c = c};
  size_t left_out = 0;
  *made = NULL;
  SUPINE_TRY(find_shapes(c, &of, error));
  json_t *list = json_array();
  for (size_t k = 0; k < c->names.count; ++k) {
    const bool drawn =
        !c->posture[0].targets[k].anatomy && c->names.begin[k + 1] > c->names.begin[k];
    if (drawn && json_array_size(list) < TARGETS_MAX) {
      (void)json_array_append_new(list, target_charts(&of, k));
    } else if (drawn) {
      ++left_out;
    }
  }
  if (json_array_size(list) == 0) {
    json_decref(list);
    return SUPINE_OK;
  }
  json_t *left = left_out > 0 ? json_sprintf("%zu further target%s not drawn.", left_out,
                                             left_out == 1 ? " is" : "s are")
                              : NULL;
  return finish(&of, json_pack("{s:o, s:o*}", "traced", list, "left_out", left), made, error);
}
