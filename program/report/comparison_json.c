/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print a comparison as JSON. */
#include <jansson.h>
#include <limits.h>

#include "sh/base/text.h"

#include "program/options/basis_input.h"
#include "program/report/comparison.h"

static json_t *statistics(const supine_distance_statistics *d) {
  return json_pack("{s:f, s:f, s:f, s:f}", "mean", d->mean, "rms", d->rms, "p95", d->p95, "max",
                   d->max);
}

static json_t *direction(const double g[3]) {
  return json_pack("[f, f, f]", g[0], g[1], g[2]);
}

static json_t *by_lung(const supine_comparison *c, const double *values) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  json_t *list = json_object();
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    (void)json_object_set_new(list, info->lung_names[lung], json_real(values[lung]));
  }
  return list;
}

static json_t *slabs(const supine_comparison *c, size_t posture) {
  json_t *list = json_array();
  const double total = supine_report_gain(c, posture);
  for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
    const supine_slab *slab = &c->posture[posture].slab[s];
    const double thickness = 1.0 / SUPINE_COMPARISON_SLABS;
    (void)json_array_append_new(
        list,
        json_pack("{s:[f, f], s:f, s:f, s:f, s:f}", "height", 1.0 - thickness * (double)(s + 1),
                  1.0 - thickness * (double)s, "volume_ml", slab->volume, "gain_ml", slab->gain,
                  "expansion", slab->volume > 0.0 ? slab->gain / slab->volume : 0.0, "share",
                  total != 0.0 ? slab->gain / total : 0.0));
  }
  return list;
}

static json_t *postures(const supine_comparison *c) {
  json_t *list = json_array();
  for (size_t i = 0; i < c->postures.count; ++i) {
    const supine_posture_item *item = &c->postures.item[i];
    json_t *posture =
        json_pack("{s:s, s:o, s:o}", "name", item->name, "gravity", direction(item->gravity),
                  "displacement_mm", statistics(&c->posture[i].displacement));
    if (supine_report_has_errors(c)) {
      (void)json_object_set_new(posture, "expected_error_mm",
                                json_real(c->posture[i].expected_error));
    }
    (void)json_object_set_new(posture, "volume_ml", by_lung(c, c->posture[i].volume));
    (void)json_object_set_new(posture, "gain_ml", by_lung(c, c->posture[i].gain));
    (void)json_object_set_new(posture, "slabs", slabs(c, i));
    (void)json_array_append_new(list, posture);
  }
  return list;
}

bool supine_report_json(const supine_comparison *c, FILE *file) {
  char volume[160];
  char file_name[PATH_MAX] = "";
  supine_text_add(file_name, sizeof file_name, "%s", c->path);
  (void)supine_text_make_utf8(file_name);
  supine_report_volume(c, volume, sizeof volume);
  json_t *root =
      json_pack("{s:s, s:s, s:s, s:I, s:f, s:o, "
                "s:{s:I, s:{s:o, s:f}}}",
                "file", file_name, "volume", volume, "displacement_from", c->reference.name,
                "vertices", (json_int_t)supine_basis_get_info(c->basis)->vertex_count, "area_mm2",
                supine_compare_area(c->compare), "postures", postures(c), "sphere", "directions",
                (json_int_t)c->directions, "farthest_from_supine", "gravity",
                direction(c->farthest), "rms_mm", c->farthest_rms);
  const bool good =
      root != NULL && json_dumpf(root, file, JSON_INDENT(2) | JSON_REAL_PRECISION(9)) == 0;
  (void)fputc('\n', file);
  json_decref(root);
  return good;
}
