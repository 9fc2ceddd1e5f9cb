/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the first sentences and the first tables of the report. */
#include <math.h>
#include <string.h>

#include "base/ascii.h"
#include "base/locale.h"
#include "base/text.h"
#include "program/report/comparison.h"

/* Published values, mean (SD), as footnotes of the table of postures. */
static const struct {
  const char *posture;
  const char *of; /* value that has the mark: "percent", or "ratio" of the breath */
  const char *mark;
  const char *text;
} published[] = {
    {"left", "percent", "a",
     "Published on the left side: left lung 0 % (SD 44), right lung +25 % (SD 11) of the supine "
     "volume (Little 2021, n 10)."},
    {"supine", "ratio", "b",
     "Published supine: 1.75, specific ventilation of the dependent third 0.42 (SD 0.14) over the "
     "nondependent 0.24 (SD 0.08) (Sa 2010, n 8)."}};

/* Compute the change of each lung's volume between the reference pose and a posture, %. */
static void find_changes(const supine_comparison *c, size_t posture, double *percent) {
  double held[SUPINE_LUNGS_MAX];
  (void)supine_basis_volumes(c->basis, &c->reference.pose, held);
  for (size_t lung = 0; lung < supine_basis_get_info(c->basis)->lung_count; ++lung) {
    percent[lung] = 100 * (c->posture[posture].volume[lung] / held[lung] - 1);
  }
}

/* Return the ratio of the regional expansion of the lowest third of the height to that of the
 * uppermost third. The slab at the edge of a third counts in part. */
static double lowest_over_uppermost(const supine_comparison *c, size_t posture) {
  double gain[2] = {0, 0};
  double volume[2] = {0, 0};
  for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
    const double part = fmax(0, fmin(1, SUPINE_COMPARISON_SLABS / 3.0 - (double)s));
    for (int end = 0; end < 2; ++end) {
      const supine_slab *slab =
          &c->posture[posture].slab[end == 0 ? s : SUPINE_COMPARISON_SLABS - 1 - s];
      gain[end] += part * slab->gain;
      volume[end] += part * slab->volume;
    }
  }
  return gain[1] / volume[1] / (gain[0] / volume[0]);
}

/* Return the target of which a posture's headline tells: that which moves farthest in multiples of
 * its error. Return NULL if there is none, as anatomy is not a target. */
static const supine_target *find_first(const supine_comparison *c,
                                       const supine_compared_posture *p) {
  if (p->targets == NULL) {
    return NULL;
  }
  const supine_target *first =
      &p->targets[supine_options_targets_first(p->targets, c->names.count)];
  return first->anatomy ? NULL : first;
}

/* Return a sentence on a posture: how far its first target or, without targets, the surface
 * moves. */
static json_t *finding(const supine_comparison *c, size_t posture) {
  const supine_compared_posture *p = &c->posture[posture];
  const supine_target *t = find_first(c, p);
  const double moved = t != NULL ? t->moved : p->displacement.mean;
  const double error = t != NULL ? t->moved_error : p->moved_error;
  const char *name = p->item->name;
  char way[96];
  char text[512] = "";
  const bool on_side = p->label != name; /* the label of others is the name itself */
  if (on_side) {
    supine_text_add(text, sizeof text, "Lying on the %s,", p->label);
  } else if (supine_ascii_is_letter(name[0])) {
    supine_text_add(text, sizeof text, "%c%s,", supine_ascii_upper(name[0]), name + 1);
  } else {
    supine_text_add(text, sizeof text, "With gravity along %s,", name);
  }
  supine_text_add(text, sizeof text, " %s", t != NULL ? t->name : "the surface");
  supine_text_add(text, sizeof text, " moves %.1f mm%s", moved, t == NULL ? " on average" : "");
  if (moved <= error) {
    supine_text_add(text, sizeof text, ", within its error of %.1f.", error);
    return supine_options_json_text(text);
  }
  if (t != NULL) {
    supine_text_add(text, sizeof text, ": %s", supine_options_target_way(t, 2, way));
  } else {
    supine_text_add(text, sizeof text, ", %.1f mm at most", p->displacement.max);
  }
  if (error > 0) {
    supine_text_add(text, sizeof text, "; expected error %.1f mm", error);
  }
  supine_text_add(text, sizeof text, ".");
  return supine_options_json_text(text);
}

json_t *supine_report_findings(const supine_comparison *c) {
  json_t *list = json_array();
  for (size_t i = 0; i < c->postures.count; ++i) {
    if (!supine_report_is_reference(c, i)) {
      (void)json_array_append_new(list, finding(c, i));
    }
  }
  return list;
}

/* Return the mark of the footnote on a value of a posture, or NULL. */
static const char *mark_of(const supine_comparison *c, size_t posture, const char *of) {
  if (strcmp(of, "ratio") == 0 && !c->posture[posture].has_breath) {
    return NULL;
  }
  for (size_t lung = 0; lung < supine_basis_get_info(c->basis)->lung_count; ++lung) {
    if (supine_report_held(c, posture, lung).source == SUPINE_SOURCE_COLLAPSED) {
      return NULL; /* they are of lungs that are not collapsed */
    }
  }
  for (size_t j = 0; j < sizeof published / sizeof *published; ++j) {
    if (strcmp(published[j].of, of) == 0 &&
        strcmp(published[j].posture, c->posture[posture].item->name) == 0) {
      return published[j].mark;
    }
  }
  return NULL;
}

json_t *supine_report_footnotes(const supine_comparison *c) {
  json_t *list = json_array();
  for (size_t j = 0; j < sizeof published / sizeof *published; ++j) {
    bool used = false;
    for (size_t i = 0; i < c->postures.count; ++i) {
      const char *mark = mark_of(c, i, published[j].of);
      used = used || (mark != NULL && strcmp(mark, published[j].mark) == 0);
    }
    if (used) {
      (void)json_array_append_new(
          list, json_pack("{s:s, s:s}", "mark", published[j].mark, "text", published[j].text));
    }
  }
  return list;
}

/* Return the cells with the volume of each lung in a posture, its range and its change. */
static json_t *make_lungs(const supine_comparison *c, size_t posture) {
  SUPINE_C_LOCALE;
  const supine_compared_posture *p = &c->posture[posture];
  double percent[SUPINE_LUNGS_MAX] = {0};
  json_t *lungs = json_array();
  find_changes(c, posture, percent);
  for (size_t lung = 0; lung < supine_basis_get_info(c->basis)->lung_count; ++lung) {
    const supine_fact held = supine_report_held(c, posture, lung);
    json_t *range = isfinite(held.low) ? json_sprintf("%.0f to %.0f", held.low, held.high)
                                       : json_string(supine_fact_source_name(held.source));
    (void)json_array_append_new(lungs,
                                json_pack("{s:o, s:o, s:o, s:s*}", "range", range, "ml",
                                          json_sprintf("%.0f", p->volume[lung]), "percent",
                                          json_string(supine_text_change(percent[lung]).text),
                                          "mark", mark_of(c, posture, "percent")));
  }
  return lungs;
}

json_t *supine_report_postures(const supine_comparison *c) {
  SUPINE_C_LOCALE;
  json_t *list = json_array();
  for (size_t i = 0; i < c->postures.count; ++i) {
    const supine_compared_posture *p = &c->posture[i];
    const double ratio = lowest_over_uppermost(c, i); /* NaN if no breath is computed */
    json_t *row = json_pack(
        "{s:o, s:o, s:o, s:o, s:o, s:o, s:s*, s:o}", "held", make_lungs(c, i), "mean",
        json_sprintf("%.1f", p->displacement.mean), "max",
        json_sprintf("%.1f", p->displacement.max), "error",
        p->moved_error > 0 ? json_sprintf("%.1f", p->moved_error) : json_string(""), "place",
        c->has_errors ? json_sprintf("%.1f", p->expected_error) : json_string(""), "another",
        c->has_errors ? json_sprintf("%.1f", p->another_error) : json_string(""), "ratio_mark",
        mark_of(c, i, "ratio"), "ratio",
        isnan(ratio) ? json_string("") : json_sprintf("%.2f", ratio));
    (void)json_object_update_new(row, supine_report_line(c, i));
    (void)json_array_append_new(list, row);
  }
  return list;
}
