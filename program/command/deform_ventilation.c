/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the image of --ventilation, and print how much air each lung and each label takes in. */
#include <math.h>

#include "base/number.h"
#include "precompute/warp/ventilation.h"
#include "program/command/deform_content.h"

/* A line of the table: a lung or a label. */
typedef struct part {
  char name[40];
  supine_ventilated sum;
  double surface; /* what the lung's surface takes in, mL; NaN if that is not known */
} part;

static void print_parts(const part *parts, size_t count) {
  for (const part *p = parts; p < parts + count; ++p) {
    supine_options_line("  %s: %.1f mL hold %+.1f mL more (%+.1f %%)", p->name, p->sum.held,
                        p->sum.taken, 100.0 * p->sum.taken / p->sum.held);
    if (!isnan(p->surface)) {
      supine_options_line("; its surface: %+.1f mL", p->surface);
    }
    supine_options_line("\n");
  }
}

static json_t *list_parts(const part *parts, size_t count) {
  json_t *list = json_array();
  for (const part *p = parts; p < parts + count; ++p) {
    (void)json_array_append_new(
        list,
        json_pack("{s:s, s:f, s:f, s:o, s:o}", "name", p->name, "held_ml", p->sum.held, "taken_ml",
                  p->sum.taken, "share", supine_options_json_number(p->sum.taken / p->sum.held),
                  "surface_taken_ml", supine_options_json_number(p->surface)));
  }
  return list;
}

static void print_lungs(const supine_basis *basis, const supine_deformation *moved,
                        const supine_ventilated *lungs) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double before[SUPINE_LUNGS_MAX];
  double after[SUPINE_LUNGS_MAX];
  part parts[SUPINE_LUNGS_MAX];
  const bool known = supine_basis_volumes(basis, &moved->from.pose, before) == SUPINE_OK &&
                     supine_basis_volumes(basis, &moved->pose, after) == SUPINE_OK;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    parts[lung] =
        (part){.sum = lungs[lung], .surface = known ? after[lung] - before[lung] : (double)NAN};
    (void)snprintf(parts[lung].name, sizeof parts[lung].name, "%s", info->lung_names[lung]);
  }
  print_parts(parts, info->lung_count);
  SUPINE_ADD_RESULT(
      json_pack("{s:o}", "ventilation_of_lungs", list_parts(parts, info->lung_count)));
}

static void print_labels(const supine_ventilated *labels, size_t count) {
  part parts[SUPINE_VENTILATED_MOST];
  for (size_t i = 0; i < count; ++i) {
    parts[i] = (part){.sum = labels[i], .surface = (double)NAN};
    (void)supine_print_text(parts[i].name, sizeof parts[i].name, "label %.9g", labels[i].label);
  }
  print_parts(parts, count);
  SUPINE_ADD_RESULT(json_pack("{s:o}", "ventilation_of_labels", list_parts(parts, count)));
}

supine_status supine_command_deform_ventilation(const supine_deform_content *wanted,
                                                const supine_basis *basis,
                                                const supine_deformation *moved,
                                                const supine_field *field, supine_error *error) {
  const supine_image *frame = wanted->image != NULL ? &wanted->source : &wanted->label_source;
  SUPINE_FREED_BY(supine_image_free) supine_image made = {0};
  supine_ventilated lungs[SUPINE_LUNGS_MAX];
  supine_ventilated parts[SUPINE_VENTILATED_MOST];
  size_t count = 0;
  SUPINE_TRY(supine_warp_ventilation(field, frame, &made, lungs, error));
  if (wanted->labels != NULL) {
    supine_error reason;
    if (supine_warp_ventilated_labels(&made, &wanted->label_source, parts, &count, &reason) !=
        SUPINE_OK) {
      return supine_error_wrap(error, &reason, "%s: ", wanted->labels);
    }
  }
  SUPINE_TRY(supine_image_write(wanted->ventilation, &made,
                                "gain of volume in a breath, as a share of the volume before it",
                                error));
  supine_options_line("%s: gain of volume from %s, as a share of the volume there\n",
                      wanted->ventilation, moved->from.name);
  SUPINE_ADD_RESULT(
      json_pack("{s:o}", "ventilation", supine_options_json_text(wanted->ventilation)));
  print_lungs(basis, moved, lungs);
  print_labels(parts, count);
  return SUPINE_OK;
}
