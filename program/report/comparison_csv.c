/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print a comparison as CSV, one number per row. */
#include "program/options/basis_input.h"
#include "program/report/comparison.h"

static void row(FILE *file, const char *quantity, const char *posture, const char *other,
                const char *part, double value, const char *unit) {
  (void)fprintf(file, "%s,%s,%s,%s,%.9g,%s\n", quantity, posture, other, part, value, unit);
}

static void statistics(FILE *file, const char *quantity, const char *posture, const char *other,
                       const supine_distance_statistics *d) {
  row(file, quantity, posture, other, "mean", d->mean, "mm");
  row(file, quantity, posture, other, "rms", d->rms, "mm");
  row(file, quantity, posture, other, "p95", d->p95, "mm");
  row(file, quantity, posture, other, "max", d->max, "mm");
}

static void posture_rows(const supine_comparison *c, size_t i, FILE *file) {
  const supine_compared_posture *posture = &c->posture[i];
  const char *name = c->postures.item[i].name;
  const double *g = c->postures.item[i].gravity;
  row(file, "gravity", name, "", "left", g[0] + 0.0, "1");
  row(file, "gravity", name, "", "posterior", g[1] + 0.0, "1");
  row(file, "gravity", name, "", "head", g[2] + 0.0, "1");
  static const char before[] = "before the breath";
  statistics(file, "displacement", name, c->reference.name, &posture->displacement);
  if (supine_report_has_errors(c)) {
    row(file, "expected error", name, c->reference.name, "rms", posture->expected_error, "mm");
  }
  if (!supine_basis_get_info(c->basis)->has_volume) {
    return;
  }
  for (size_t lung = 0; lung < supine_basis_get_info(c->basis)->lung_count; ++lung) {
    const char *lung_name = supine_basis_get_info(c->basis)->lung_names[lung];
    row(file, "volume", name, "", lung_name, posture->volume[lung], "mL");
    row(file, "gain", name, before, lung_name, posture->gain[lung], "mL");
  }
  const double total = supine_report_gain(c, i);
  for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
    char part[32];
    (void)snprintf(part, sizeof part, "height %zu-%zu %%", 100 - 10 * (s + 1), 100 - 10 * s);
    row(file, "slab volume", name, before, part, posture->slab[s].volume, "mL");
    row(file, "slab gain", name, before, part, posture->slab[s].gain, "mL");
    row(file, "slab expansion", name, before, part,
        posture->slab[s].volume > 0.0 ? posture->slab[s].gain / posture->slab[s].volume : 0.0, "1");
    row(file, "slab share", name, before, part, total != 0.0 ? posture->slab[s].gain / total : 0.0,
        "1");
  }
}

/* Print the number of vertices with the path of the basis, quoted by RFC 4180. */
static void vertices_row(const supine_comparison *c, FILE *file) {
  (void)fputs("vertices,rest,,\"", file);
  for (const char *at = c->path; *at != '\0'; ++at) {
    (void)fputs(*at == '"' ? "\"" : "", file);
    (void)fputc(*at, file);
  }
  (void)fprintf(file, "\",%zu,1\n", supine_basis_get_info(c->basis)->vertex_count);
}

void supine_report_csv(const supine_comparison *c, FILE *file) {
  const size_t count = c->postures.count;
  char volume[160];
  supine_report_volume(c, volume, sizeof volume);
  (void)fprintf(file,
                "# postures %s; displacement from %s, mm\n"
                "quantity,posture,other,part,value,unit\n",
                volume, c->reference.name);
  for (size_t i = 0; i < count; ++i) {
    posture_rows(c, i, file);
  }
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = i + 1; j < count; ++j) {
      statistics(file, "distance", c->postures.item[i].name, c->postures.item[j].name,
                 &c->pair[i * count + j]);
      if (supine_report_has_errors(c)) {
        row(file, "expected error", c->postures.item[i].name, c->postures.item[j].name, "rms",
            c->pair_error[i * count + j], "mm");
      }
    }
  }
  row(file, "energy", "all", "", "constant", c->constant, "1");
  row(file, "energy", "all", "", "odd", c->odd, "1");
  row(file, "energy", "all", "", "even", c->even, "1");
  row(file, "farthest", "all", "supine", "left", c->farthest[0] + 0.0, "1");
  row(file, "farthest", "all", "supine", "posterior", c->farthest[1] + 0.0, "1");
  row(file, "farthest", "all", "supine", "head", c->farthest[2] + 0.0, "1");
  row(file, "farthest", "all", "supine", "rms", c->farthest_rms, "mm");
  row(file, "directions", "all", "", "", (double)c->directions, "1");
  row(file, "area", "rest", "", "", supine_compare_area(c->compare), "mm2");
  vertices_row(c, file);
  if (c->rms > 0.0) {
    row(file, "rms displacement", "all", "", "", c->rms, "mm");
  }
}
