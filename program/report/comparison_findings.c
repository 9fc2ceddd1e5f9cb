/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the first sentences and the first tables of the report. */
#include <math.h>
#include <string.h>

#include "base/ascii.h"
#include "base/locale.h"
#include "base/text.h"
#include "program/report/comparison.h"

/* Published values, mean (SD), for the postures' table rows; report.html names the sources. */
static const struct {
  const char *posture, *percent, *ratio;
} published[] = {{"supine", "", "1.75"}, {"left", "0 (44), +25 (11)", ""}};

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

/* Return the first structure in a posture that is a target; NULL if there is none. */
static const supine_target *first_target(const supine_comparison *c,
                                         const supine_compared_posture *p) {
  for (size_t k = 0; k < c->names.count; ++k) {
    if (!p->targets[k].anatomy) {
      return &p->targets[k];
    }
  }
  return NULL;
}

/* Return a sentence on a posture: how far the first target or, without targets, the surface moves.
 * A displacement below its expected error is no change that the model can tell. */
static json_t *finding(const supine_comparison *c, size_t posture) {
  const supine_compared_posture *p = &c->posture[posture];
  const supine_target *t = p->targets != NULL ? first_target(c, p) : NULL;
  const double moved = t != NULL ? t->moved : p->displacement.mean;
  const double error = t != NULL ? t->expected : p->expected_error;
  const char *name = p->item->name;
  char way[96];
  char text[512] = "";
  if (p->label != name) {
    supine_text_add(text, sizeof text, "Lying on the %s,", p->label);
  } else if (supine_ascii_is_letter(name[0])) {
    supine_text_add(text, sizeof text, "%c%s,", supine_ascii_upper(name[0]), name + 1);
  } else {
    supine_text_add(text, sizeof text, "With gravity along %s,", name);
  }
  supine_text_add(text, sizeof text, " %s", t != NULL ? t->name : "the surface");
  if (moved <= error) {
    supine_text_add(text, sizeof text, ": " SUPINE_TARGET_UNTOLD " (%.1f mm", moved);
  } else if (t != NULL) {
    supine_text_add(text, sizeof text, " moves %.1f mm: %s", moved,
                    supine_options_target_way(t, 2, way));
  } else {
    supine_text_add(text, sizeof text, " moves %.1f mm on average, %.1f mm at most", moved,
                    p->displacement.max);
  }
  if (error > 0) {
    supine_text_add(text, sizeof text, "; expected error %.1f mm", error);
  }
  supine_text_add(text, sizeof text, moved <= error ? ")." : ".");
  return supine_options_json_text(text);
}

json_t *supine_report_findings(const supine_comparison *c) {
  enum { SENTENCES = 3 };
  json_t *list = json_array();
  for (size_t i = 0; i < c->postures.count && json_array_size(list) < SENTENCES; ++i) {
    if (c->posture[i].displacement.max >= 0.05) { /* this posture is not the reference */
      (void)json_array_append_new(list, finding(c, i));
    }
  }
  return list;
}

/* Return a volume as text, mL; "open" for surfaces that enclose none, "" for points. */
static json_t *volume_text(double volume) {
  SUPINE_C_LOCALE;
  if (isnan(volume)) {
    return json_string("open");
  }
  return volume != 0.0 ? json_sprintf("%.1f", volume) : json_string("");
}

/* Return the row of a structure in a posture. */
static json_t *target_row(const char *name, const supine_compared_posture *p,
                          const supine_target *t) {
  SUPINE_C_LOCALE;
  char way[96];
  return json_pack("{s:s, s:s, s:o, s:o, s:o, s:s, s:o}", "name", name, "posture", p->label,
                   "before", volume_text(t->volume[0]), "after", volume_text(t->volume[1]), "moved",
                   json_sprintf("%.1f", t->moved), "way", supine_options_target_way(t, 3, way),
                   "error",
                   isnan(t->expected) ? json_string("unknown") : json_sprintf("%.1f", t->expected));
}

json_t *supine_report_targets(const supine_comparison *c, bool anatomy) {
  json_t *list = json_array();
  for (size_t k = 0; c->inside != NULL && k < c->names.count; ++k) {
    const char *name = c->names.text[k];
    for (size_t i = 0; i < c->postures.count; ++i) {
      const supine_target *t = &c->posture[i].targets[k];
      const bool is_reference = c->posture[i].displacement.max < 0.05;
      if (!is_reference && t->anatomy == anatomy) {
        (void)json_array_append_new(list, target_row(name, &c->posture[i], t));
        name = "";
      }
    }
  }
  if (json_array_size(list) > 0) {
    return json_pack("{s:o}", anatomy ? "parts" : "targets", list);
  }
  json_decref(list);
  return NULL;
}

json_t *supine_report_postures(const supine_comparison *c) {
  SUPINE_C_LOCALE;
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  json_t *list = json_array();
  for (size_t i = 0; i < c->postures.count; ++i) {
    const supine_compared_posture *p = &c->posture[i];
    json_t *lungs = json_array();
    double percent[SUPINE_LUNGS_MAX] = {0};
    const char *words[2] = {"", ""};
    const double ratio = lowest_over_uppermost(c, i); /* NaN if no breath is computed */
    find_changes(c, i, percent);
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      (void)json_array_append_new(
          lungs, json_pack("{s:o, s:o, s:o}", "range", supine_report_held(c, i, lung, true), "ml",
                           json_sprintf("%.0f", p->volume[lung]), "percent",
                           json_sprintf(fabs(percent[lung]) < 0.5 ? "0" : "%+.0f", percent[lung])));
    }
    for (size_t j = 0; j < sizeof published / sizeof *published; ++j) {
      if (strcmp(published[j].posture, p->item->name) == 0) {
        words[0] = published[j].percent;
        words[1] = published[j].ratio;
      }
    }
    (void)json_array_append_new(
        list, json_pack("{s:s, s:s, s:o, s:o, s:o, s:o, s:s, s:s, s:o}", "name", p->label, "line",
                        supine_report_line(i), "held", lungs, "mean",
                        json_sprintf("%.1f", p->displacement.mean), "max",
                        json_sprintf("%.1f", p->displacement.max), "error",
                        json_sprintf(p->expected_error > 0 ? "%.1f" : "", p->expected_error),
                        "published_percent", words[0], "published_ratio", words[1], "ratio",
                        json_sprintf(isnan(ratio) ? "" : "%.2f", ratio)));
  }
  return list;
}
