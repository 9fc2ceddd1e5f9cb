/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the displacement field of a grid, and images and label maps moved by it. */
#include "base/text.h"
#include "precompute/warp/check_image.h"
#include "program/command/deform_content.h"
#include "program/options/surface_options.h"

static supine_status write_field(const supine_deform_content *wanted, const char *from,
                                 const supine_field *forward, const supine_field *inverse,
                                 supine_error *error) {
  char note[256];
  const supine_image *nodes = wanted->inverse ? &inverse->nodes : &forward->nodes;
  (void)snprintf(note, sizeof note,
                 wanted->inverse
                     ? "displacement v(y), mm, LPS: the tissue at y in the deformed lungs was at y "
                       "+ v(y) in %s"
                     : "displacement u(x), mm, LPS: the tissue at x, in %s, goes to x + u(x)",
                 from);
  SUPINE_TRY(supine_image_write(wanted->field, nodes, note, error));
  supine_options_line("%s: %s field of %zu x %zu x %zu nodes\n", wanted->field,
                      wanted->inverse ? "inverse" : "forward", nodes->size[0], nodes->size[1],
                      nodes->size[2]);
  SUPINE_ADD_RESULT(json_pack("{s:{s:o, s:[I, I, I], s:b}}", "field", "file",
                              supine_options_json_text(wanted->field), "nodes",
                              (json_int_t)nodes->size[0], (json_int_t)nodes->size[1],
                              (json_int_t)nodes->size[2], "inverse", (int)wanted->inverse));
  return SUPINE_OK;
}

/* Move an image to the file `path`. Unless `tissue` is NULL, scale its densities. */
static supine_status write_image(const char *path, const supine_image *source, bool labels,
                                 const supine_tissue *tissue, const supine_field *inverse,
                                 supine_error *error) {
  SUPINE_FREED_BY(supine_image_free) supine_image moved = {0};
  SUPINE_TRY(supine_warp_resample(inverse, tissue, labels, source, &moved, error));
  SUPINE_TRY(supine_image_write(
      path, &moved,
      tissue != NULL ? "HU + 1000 of aerated lung scaled by the change of volume: mass is kept"
                     : NULL,
      error));
  const size_t *size = source->size;
  supine_options_line("%s: %zu x %zu x %zu voxels%s\n", path, size[0], size[1], size[2],
                      tissue != NULL ? ", densities scaled inside the lungs" : "");
  SUPINE_ADD_RESULT(json_pack("{s:{s:o, s:[I, I, I], s:b}}", labels ? "labels" : "image", "file",
                              supine_options_json_text(path), "voxels", (json_int_t)size[0],
                              (json_int_t)size[1], (json_int_t)size[2], "densities_scaled",
                              (int)(tissue != NULL)));
  return SUPINE_OK;
}

/* Return an amount for each lung, by its name. */
static json_t *list_amounts(const supine_basis_info *info, const double *amount) {
  json_t *lungs = json_object();
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    (void)json_object_set_new(lungs, info->lung_names[lung],
                              supine_options_json_number(amount[lung]));
  }
  return lungs;
}

/* Print an amount for each lung, mL; `key` is its name in JSON. */
static void print_lungs(const supine_basis *basis, const double *amount, const char *format,
                        const char *key) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    supine_options_line("%s%s ", lung == 0 ? "" : ", ", info->lung_names[lung]);
    supine_options_line(format, amount[lung]);
  }
  SUPINE_ADD_RESULT(json_pack("{s:o}", key, list_amounts(info, amount)));
}

/* Return the rigid parts: the volume and the centre of each. */
static json_t *list_parts(const supine_tissue *soft) {
  json_t *parts = json_array();
  for (size_t i = 0; i < soft->part_count; ++i) {
    const double *at = soft->parts[i].centre;
    (void)json_array_append_new(parts, json_pack("{s:f, s:o}", "volume_ml", soft->parts[i].volume,
                                                 "centre", supine_options_json_numbers(3, at)));
  }
  return parts;
}

/* Find the soft tissue of the image, and the parts that --rigid names, unless that is done. */
static supine_status find_tissue(const supine_deform_content *wanted, const supine_basis *basis,
                                 const supine_field *forward, supine_error *error) {
  supine_tissue *soft = &wanted->tissue->soft;
  if (wanted->tissue->found) {
    return SUPINE_OK;
  }
  if (wanted->density) {
    SUPINE_TRY(supine_warp_tissue_find(forward, &wanted->source, soft, error));
    supine_options_line("%s: soft tissue in the lungs: ", wanted->image);
    print_lungs(basis, soft->soft, "%.1f mL", "soft_tissue_ml");
    supine_options_line("\n");
    supine_findings findings = {.count = 0};
    supine_warp_check_soft(soft, wanted->image, &findings);
    supine_options_say_findings("deform", &findings);
  } else if (wanted->labels != NULL) {
    SUPINE_TRY(supine_warp_tissue_find_labels(forward, &wanted->label_source, soft, error));
    if (soft->part_count > 0) {
      supine_options_line("%s: without a CT, the shape of labels tells which parts are rigid\n",
                          wanted->labels);
    }
  }
  SUPINE_TRY(supine_warp_tissue_add_labels(&wanted->label_source, wanted->rigid.value,
                                           wanted->rigid.count, soft, error));
  for (size_t i = 0; i < soft->part_count; ++i) {
    const double *at = soft->parts[i].centre;
    supine_options_line("rigid part of %.1f mL at %.0f, %.0f, %.0f mm (LPS)\n",
                        soft->parts[i].volume, at[0], at[1], at[2]);
  }
  SUPINE_ADD_RESULT(json_pack("{s:o}", "rigid_parts", list_parts(soft)));
  wanted->tissue->found = true;
  return SUPINE_OK;
}

/* Correct the field so that it moves the parts rigidly, and print what this changes. */
static supine_status hold_parts(const supine_tissue *soft, const supine_basis *basis,
                                supine_field *forward, supine_field *inverse, supine_error *error) {
  supine_warp_tissue_held held;
  SUPINE_TRY(supine_warp_tissue_hold(soft, forward, inverse, &held, error));
  if (soft->part_count == 0) {
    return SUPINE_OK;
  }
  supine_options_line("field corrected by up to %s mm in rigid parts; it changes the volume: ",
                      supine_text_distance(held.largest).text);
  print_lungs(basis, held.change, "%+.1f mL", "volume_change_by_rigid_parts_ml");
  supine_options_line("\n");
  if (held.folded > 0) {
    supine_options_say("deform",
                       "warning: around rigid parts, the field folds at %zu of its nodes, and "
                       "without them at %zu: voxels are wrong there",
                       held.folded, held.folded_before);
  }
  return SUPINE_OK;
}

static supine_status invert(const supine_field *forward, supine_field *inverse,
                            supine_error *error) {
  supine_warp_residual residual = {0};
  SUPINE_TRY(supine_warp_invert(forward, inverse, &residual, error));
  supine_options_line(
      "field followed by inverse: residual %s mm RMS, %s mm at most, inside the lungs\n",
      supine_text_distance(residual.rms).text, supine_text_distance(residual.largest).text);
  SUPINE_ADD_RESULT(json_pack("{s:{s:f, s:f}}", "inverse_residual_mm", "rms", residual.rms,
                              "largest", residual.largest));
  if (residual.lost > 0) {
    supine_options_say("deform",
                       "warning: the field folds and has no inverse at %zu of its nodes inside the "
                       "lungs: voxels are wrong there",
                       residual.lost);
  }
  return SUPINE_OK;
}

/* Compute the displacement field to the pose `moved`, from the scan or the state of --from, and
 * check that it does not fold in the lungs, and hardly in the body around them. There, where the
 * field fades out, five pairs of real lungs at rest had folds of up to 3 % of the lungs' cells. */
static supine_status find_field(const supine_basis *basis, const supine_deformation *moved,
                                supine_field *field, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  static const double told = 0.01;
  static const double allowed = 0.1;
  const supine_pose *from = moved->from_given ? &moved->from.pose : NULL;
  SUPINE_TRY(supine_warp_between(basis, from, &moved->pose, moved->deviation, field, error));
  double folded[2];
  supine_warp_folded(field, folded);
  const double around = folded[1];
  if (around > told && (around <= allowed || moved->allow_folds)) {
    supine_options_say(
        "deform",
        "warning: the field folds in the body around the lungs, in %.2g %% as many cells as the "
        "lungs have: voxels of the body and of the rim of the lungs are wrong there",
        100.0 * around);
  }
  const supine_plausible lungs = {
      .command = "deform",
      .state = &moved->state,
      .folded = around > allowed ? around : folded[0],
      .parts = "the field folds; cells that turn over, relative to those in the lungs",
      .allowed = moved->allow_folds || !info->has_rest || info->is_fields};
  return supine_options_plausible(&lungs, error);
}

/* Check that the image and the label map show the lungs that the field moves. */
static supine_status check_images(const supine_deform_content *wanted, const supine_field *field,
                                  supine_error *error) {
  const supine_warp_image_kind kind = wanted->density ? SUPINE_FIELD_CT : SUPINE_FIELD_IMAGE;
  supine_findings findings = {.count = 0};
  supine_status status = SUPINE_OK;
  if (wanted->image != NULL) {
    status = supine_warp_check_image(field, &wanted->source, wanted->image, kind, &findings, error);
  }
  if (status == SUPINE_OK && wanted->labels != NULL) {
    status = supine_warp_check_image(field, &wanted->label_source, wanted->labels,
                                     SUPINE_FIELD_LABELS, &findings, error);
  }
  supine_options_say_findings("deform", &findings);
  return status;
}

supine_status supine_command_deform_images(const supine_deform_content *wanted,
                                           const supine_basis *basis,
                                           const supine_deformation *moved, supine_error *error) {
  const bool image = wanted->image != NULL;
  const bool labels = wanted->labels != NULL;
  SUPINE_FREED_BY(supine_warp_free) supine_field forward = {0};
  SUPINE_FREED_BY(supine_warp_free) supine_field inverse = {0};
  SUPINE_TRY(find_field(basis, moved, &forward, error));
  SUPINE_TRY(check_images(wanted, &forward, error));
  if (image || labels || wanted->inverse) {
    SUPINE_TRY(invert(&forward, &inverse, error));
    SUPINE_TRY(find_tissue(wanted, basis, &forward, error));
    SUPINE_TRY(hold_parts(&wanted->tissue->soft, basis, &forward, &inverse, error));
  }
  if (wanted->field != NULL) {
    SUPINE_TRY(write_field(wanted, moved->from.name, &forward, &inverse, error));
  }
  if (wanted->ventilation != NULL) {
    SUPINE_TRY(supine_command_deform_ventilation(wanted, basis, moved, &forward, error));
  }
  if (wanted->path == NULL) {
    return SUPINE_OK;
  }
  if (image) {
    SUPINE_TRY(write_image(wanted->path, &wanted->source, false,
                           wanted->density ? &wanted->tissue->soft : NULL, &inverse, error));
  }
  if (labels) {
    const char *path = image ? wanted->labels_path : wanted->path;
    SUPINE_TRY(write_image(path, &wanted->label_source, true, NULL, &inverse, error));
  }
  return SUPINE_OK;
}
