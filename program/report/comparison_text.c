/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print a comparison as text for the terminal. */
#include <math.h>
#include <string.h>

#include "program/options/basis_input.h"
#include "program/report/comparison.h"

static int widest_name(const supine_comparison *c) {
  size_t width = strlen("posture");
  for (size_t i = 0; i < c->postures.count; ++i) {
    const size_t length = strlen(supine_options_posture_label(c->postures.item[i].name));
    width = length > width ? length : width;
  }
  return (int)width;
}

static void print_statistics(const supine_distance_statistics *d, FILE *file) {
  (void)fprintf(file, "%9.3f %9.3f %9.3f %9.3f", d->mean, d->rms, d->p95, d->max);
}

/* Print the heading of the column of expected errors, if they are known. */
static void print_error_head(const supine_comparison *c, FILE *file) {
  if (supine_report_has_errors(c)) {
    (void)fprintf(file, " %9s", "error");
  }
}

static void print_error(const supine_comparison *c, double rms, FILE *file) {
  if (supine_report_has_errors(c)) {
    (void)fprintf(file, " %9.3f", rms);
  }
}

static void print_postures(const supine_comparison *c, int width, FILE *file) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  (void)fprintf(file,
                "\nDisplacement from %s, mm, and what each lung holds, mL\n%-*s %9s %9s %9s %9s",
                c->reference.name, width, "posture", "mean", "RMS", "95 %", "largest");
  print_error_head(c, file);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    (void)fprintf(file, " %6s lung", info->lung_names[lung]);
  }
  (void)fputc('\n', file);
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)fprintf(file, "%-*s ", width, supine_options_posture_label(c->postures.item[i].name));
    print_statistics(&c->posture[i].displacement, file);
    print_error(c, c->posture[i].expected_error, file);
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      (void)fprintf(file, " %11.2f", c->posture[i].volume[lung]);
    }
    (void)fputc('\n', file);
  }
}

/* Print the share of each lung in the breath, mL. */
static void print_gains(const supine_comparison *c, int width, FILE *file) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  (void)fprintf(file, "\nShare of each lung in a breath of %.4g mL, mL\n%-*s",
                supine_report_gain(c, 0), width, "posture");
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    (void)fprintf(file, " %6s lung", info->lung_names[lung]);
  }
  (void)fputc('\n', file);
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)fprintf(file, "%-*s", width, supine_options_posture_label(c->postures.item[i].name));
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      (void)fprintf(file, " %11.2f", c->posture[i].gain[lung]);
    }
    (void)fputc('\n', file);
  }
}

static void print_slabs(const supine_comparison *c, FILE *file) {
  (void)fputs("\nVentilation by height along gravity: regional expansion, % of the volume before "
              "the\nbreath, and share of the breath, %\n  height  ",
              file);
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)fprintf(file, " %15.15s", supine_options_posture_label(c->postures.item[i].name));
  }
  (void)fputc('\n', file);
  for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
    (void)fprintf(file, "%3zu-%-3zu %% ", 100 - 10 * (s + 1), 100 - 10 * s);
    for (size_t i = 0; i < c->postures.count; ++i) {
      const supine_slab *slab = &c->posture[i].slab[s];
      const double total = supine_report_gain(c, i);
      (void)fprintf(file, "  %7.2f %6.2f",
                    slab->volume > 0.0 ? 100.0 * slab->gain / slab->volume : 0.0,
                    total != 0.0 ? 100.0 * slab->gain / total : 0.0);
    }
    (void)fputs(s == 0                             ? "  uppermost\n"
                : s + 1 == SUPINE_COMPARISON_SLABS ? "  lowermost\n"
                                                   : "\n",
                file);
  }
}

void supine_report_text(const supine_comparison *c, FILE *file) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  const int width = widest_name(c);
  char volume[160];
  supine_report_volume(c, volume, sizeof volume);
  (void)fprintf(file, "%s, %s: %zu vertices, %.0f cm2\n", c->path, volume, info->vertex_count,
                supine_compare_area(c->compare) / 100.0);
  print_postures(c, width, file);
  if (supine_report_has_errors(c)) {
    (void)fputs("error: the expected error, " SUPINE_EXPECTED_MEANING ".\n" SUPINE_EXPECTED_SUPPORT
                "\n",
                file);
  }
  print_gains(c, width, file);
  print_slabs(c, file);
  (void)fprintf(file,
                "\nOver all directions of gravity (%zu sampled)\n"
                "  farthest from supine  %6.3f,%6.3f,%6.3f %9.3f mm RMS\n",
                c->directions, c->farthest[0], c->farthest[1], c->farthest[2], c->farthest_rms);
}
