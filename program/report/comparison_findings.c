/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the first sentences and the first table of the report, and the titles of its charts, whose
 * vertical axis is height. */
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/report/comparison_parts.h"

/* Published values for the postures' table rows; report.html names the sources. */
static const struct {
  const char *posture, *words;
} published[] = {
    {"supine", "1.75"},
    {"left", "0 and +25 %"},
};

/* Compute the change of each lung's volume between the reference pose and a posture, % and mL. */
static void find_changes(const supine_comparison *c, size_t posture, double *percent, double *ml) {
  double held[SUPINE_LUNGS_MAX];
  (void)supine_basis_volumes(c->basis, &c->reference.pose, held);
  for (size_t lung = 0; lung < supine_basis_get_info(c->basis)->lung_count; ++lung) {
    ml[lung] = c->posture[posture].volume[lung] - held[lung];
    percent[lung] = 100 * ml[lung] / held[lung];
  }
}

/* Return the ratio of the regional expansion of the three lowest slabs to that of the three
 * uppermost slabs. */
static double lowest_over_uppermost(const supine_comparison *c, size_t posture) {
  double gain[2] = {0, 0};
  double volume[2] = {0, 0};
  for (size_t s = 0; s < 3; ++s) {
    for (int end = 0; end < 2; ++end) {
      const supine_slab *slab =
          &c->posture[posture].slab[end == 0 ? s : SUPINE_COMPARISON_SLABS - 1 - s];
      gain[end] += slab->gain;
      volume[end] += slab->volume;
    }
  }
  return gain[1] / volume[1] / (gain[0] / volume[0]);
}

static void print_where(const char *name, FILE *to) {
  const char *label = supine_options_posture_label(name);
  if (label != name) {
    (void)fprintf(to, "On the %s", label);
  } else if (isalpha((unsigned char)name[0])) {
    (void)fprintf(to, "%c%s,", toupper((unsigned char)name[0]), name + 1);
  } else {
    (void)fprintf(to, "With gravity along %s,", name);
  }
}

/* Print a sentence on a posture: the change of volume of each lung, beginning with the largest
 * change, and the mean and the largest displacement. */
static void print_finding(const supine_comparison *c, size_t posture, FILE *to) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  double percent[SUPINE_LUNGS_MAX];
  double ml[SUPINE_LUNGS_MAX];
  bool done[SUPINE_LUNGS_MAX] = {false};
  print_where(c->postures.item[posture].name, to);
  find_changes(c, posture, percent, ml);
  for (size_t i = 0; i < info->lung_count; ++i) {
    size_t most = info->lung_count;
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      if (!done[lung] && (most == info->lung_count || fabs(ml[lung]) > fabs(ml[most]))) {
        most = lung;
      }
    }
    done[most] = true;
    (void)fprintf(to, "%s the %s lung ", i > 0 ? ";" : "", info->lung_names[most]);
    if (fabs(percent[most]) < 1.5) {
      (void)fprintf(to, "keeps its volume (%+.0f %%)", percent[most]);
    } else {
      (void)fprintf(to, "%s %.0f mL (%+.0f %%)", ml[most] < 0 ? "loses" : "gains", fabs(ml[most]),
                    percent[most]);
    }
  }
  (void)fprintf(to, "; the surface moves %.1f mm on average, %.1f mm at most.",
                c->posture[posture].displacement.mean, c->posture[posture].displacement.max);
}

static json_t *printed(const supine_comparison *c, size_t posture,
                       void (*print)(const supine_comparison *c, size_t posture, FILE *to)) {
  char *text = NULL;
  size_t size = 0;
  FILE *to = open_memstream(&text, &size);
  if (to == NULL) {
    return json_null();
  }
  print(c, posture, to);
  json_t *made = fclose(to) == 0 ? json_string(text) : json_null();
  free(text);
  return made;
}

json_t *supine_report_findings(const supine_comparison *c) {
  enum { SENTENCES = 3 };
  json_t *list = json_array();
  for (size_t i = 0; i < c->postures.count && json_array_size(list) < SENTENCES; ++i) {
    if (c->posture[i].displacement.max >= 0.05) { /* this posture is not the reference */
      (void)json_array_append_new(list, printed(c, i, print_finding));
    }
  }
  return list;
}

/* Print the title of a chart: a heading, then the name and value of each posture up to index
 * `last`. If `share` is true, the value is the fraction of the inhaled volume that enters the lower
 * half of the lungs. Otherwise it is the ratio of the expansions of the lowest and uppermost three
 * slabs. */
static void print_profile(const supine_comparison *c, size_t last, bool share, FILE *to) {
  (void)fputs(share ? "Share of a breath that goes to the lower half:"
                    : "Expansion, lowest 30 % of the height divided by uppermost 30 %:",
              to);
  for (size_t i = 0; i <= last; ++i) {
    if (!c->posture[i].has_breath) {
      continue;
    }
    double gain = 0;
    for (size_t s = SUPINE_COMPARISON_SLABS / 2; s < SUPINE_COMPARISON_SLABS; ++s) {
      gain += c->posture[i].slab[s].gain;
    }
    (void)fprintf(to, share ? "%s %s %.0f %%" : "%s %s %.1f", i > 0 ? "," : "",
                  supine_options_posture_label(c->postures.item[i].name),
                  share ? 100 * gain / c->breath : lowest_over_uppermost(c, i));
  }
}

static void print_ratios(const supine_comparison *c, size_t last, FILE *to) {
  print_profile(c, last, false, to);
}

static void print_shares(const supine_comparison *c, size_t last, FILE *to) {
  print_profile(c, last, true, to);
}

json_t *supine_report_profile_finding(const supine_comparison *c, bool share) {
  const size_t last = (c->postures.count < 4 ? c->postures.count : 4) - 1;
  return printed(c, last, share ? print_shares : print_ratios);
}

json_t *supine_report_postures(const supine_comparison *c) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  json_t *list = json_array();
  for (size_t i = 0; i < c->postures.count; ++i) {
    json_t *lungs = json_array();
    double percent[SUPINE_LUNGS_MAX] = {0};
    double ml[SUPINE_LUNGS_MAX] = {0};
    const char *words = "";
    const double ratio = lowest_over_uppermost(c, i); /* NaN if no breath is computed */
    find_changes(c, i, percent, ml);
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      (void)json_array_append_new(
          lungs, json_pack("{s:o, s:o, s:o}", "range", supine_report_held(c, i, lung, true), "ml",
                           json_sprintf("%.0f", c->posture[i].volume[lung]), "percent",
                           json_sprintf(fabs(percent[lung]) < 0.5 ? "0" : "%+.0f", percent[lung])));
    }
    for (size_t j = 0; j < sizeof published / sizeof *published; ++j) {
      if (strcmp(published[j].posture, c->postures.item[i].name) == 0) {
        words = published[j].words;
      }
    }
    (void)json_array_append_new(
        list, json_pack("{s:s, s:s, s:o, s:o, s:o, s:s, s:o}", "name",
                        supine_options_posture_label(c->postures.item[i].name), "line",
                        supine_report_line(i), "held", lungs, "mean",
                        json_sprintf("%.1f", c->posture[i].displacement.mean), "max",
                        json_sprintf("%.1f", c->posture[i].displacement.max), "published", words,
                        "ratio", json_sprintf(isnan(ratio) ? "" : "%.2f", ratio)));
  }
  return list;
}
