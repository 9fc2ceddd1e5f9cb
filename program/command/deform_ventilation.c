/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the ventilation of 'supine deform', and print it for lungs and labels. */
#include "program/command/deform_ventilation.h"

#include "base/number.h"
#include "precompute/warp/ventilation.h"

/* Print what a part holds and takes in, and return it as JSON. */
static json_t *print_part(const char *name, const supine_ventilated *part) {
  const double share = part->held > 0.0 ? part->taken / part->held : (double)NAN;
  supine_options_line("  %s: %.1f mL hold %+.1f mL more (%+.1f %%)", name, part->held, part->taken,
                      100.0 * share);
  return json_pack("{s:s, s:f, s:f, s:o}", "name", name, "held_ml", part->held, "taken_ml",
                   part->taken, "share", supine_options_json_number(share));
}

static void print_lungs(const supine_basis *basis, const supine_deformation *moved,
                        const supine_ventilated *lungs) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double before[SUPINE_LUNGS_MAX];
  double after[SUPINE_LUNGS_MAX];
  const bool known = supine_basis_volumes(basis, &moved->from.pose, before) == SUPINE_OK &&
                     supine_basis_volumes(basis, &moved->pose, after) == SUPINE_OK;
  json_t *list = json_array();
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    json_t *row = print_part(info->lung_names[lung], &lungs[lung]);
    if (known) {
      supine_options_line("; its surface: %+.1f mL", after[lung] - before[lung]);
      (void)json_object_set_new(row, "surface_taken_ml", json_real(after[lung] - before[lung]));
    }
    supine_options_line("\n");
    (void)json_array_append_new(list, row);
  }
  supine_options_add(json_pack("{s:o}", "ventilation_of_lungs", list));
}

static void print_labels(const supine_ventilated *parts, size_t count) {
  json_t *list = json_array();
  for (size_t i = 0; i < count; ++i) {
    char name[40];
    (void)supine_print_text(name, sizeof name, "label %.9g", parts[i].label);
    (void)json_array_append_new(list, print_part(name, &parts[i]));
    supine_options_line("\n");
  }
  supine_options_add(json_pack("{s:o}", "ventilation_of_labels", list));
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
  supine_options_add(
      json_pack("{s:o}", "ventilation", supine_options_json_text(wanted->ventilation)));
  print_lungs(basis, moved, lungs);
  print_labels(parts, count);
  return SUPINE_OK;
}
