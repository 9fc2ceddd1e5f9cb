/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write deformed surfaces, displacement fields, moved images and moved points. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/csv.h"
#include "base/number.h"
#include "base/output.h"
#include "base/text.h"
#include "base/vec3.h"

#include "mesh/mesh.h"
#include "precompute/warp/check_image.h"
#include "precompute/warp/field.h"
#include "program/command/deform_content.h"
#include "program/command/deform_ventilation.h"
#include "program/options/facts.h"
#include "program/options/inside.h"
#include "program/options/markups.h"
#include "program/options/surface_options.h"

/* Parse a list of labels, such as "7" or "7,8". */
static supine_status read_rigid(const char *text, void *field, supine_error *error) {
  supine_deform_rigid *list = field;
  (void)error;
  char item[24];
  list->count = 0;
  for (const char *at = text; supine_options_next_item(&at, item, sizeof item);) {
    char *end = NULL;
    const double value = supine_number_parse(item, &end);
    if (list->count == SUPINE_DEFORM_RIGID_MOST || end == item || *end != '\0') {
      return SUPINE_ERROR_ARGUMENT;
    }
    list->value[list->count++] = value;
  }
  return list->count > 0 ? SUPINE_OK : SUPINE_ERROR_ARGUMENT;
}

const supine_option supine_command_deform_content_options[] = {
    {.help = "For structures made by 'supine embed', -o FILE.csv writes a row for each named "
             "structure: the mean position of its vertices, its displacement and expected error; "
             "-o FILE" SUPINE_MARKUPS_ENDING " writes these as control points of 3D Slicer, in mm "
             "and LPS, with the errors as measurements:"},
    {"vertices", 0, NULL, "write a row or a control point for each vertex instead",
     SUPINE_FILLS(supine_deform_content, vertices)},
    {.help = "For an embedded grid:"},
    {"field-out", 0, "FILE",
     "displacement field to write (.nrrd, .nii, .nii.gz or .mha): the displacement of the tissue "
     "that is at each node in the scan, or in the state of --from. It is in mm and LPS, also in "
     "NIfTI, as ITK and ANTs expect; for NiftyReg, negate x and y. Outside the lungs it falls to 0 "
     "within 60 mm, or 1.5 times the largest displacement if that is more, and it is 0 at the "
     "border "
     "of the grid and beyond",
     SUPINE_FILLS(supine_deform_content, field), .file = SUPINE_FILE_OUT,
     .endings = ".nrrd, .nii, .nii.gz or .mha"},
    {"inverse", 0, NULL,
     "write the inverse field to --field-out: the vector from each node in the moved lungs to "
     "where its tissue was. Resampling of an image needs the inverse",
     SUPINE_FILLS(supine_deform_content, inverse)},
    {"ventilation", 0, "FILE",
     "image to write (.nrrd, .nii, .nii.gz or .mha): the air that each voxel takes in from the "
     "state of --from, which the image shows, to the state, as a share of the volume there; NaN "
     "outside the lungs. It has the voxels of --image, or else of --labels; with --labels, such as "
     "lobes, the sums of each label are printed. Sums of a lung differ from what its surface takes "
     "in by the error of the grid. How far single voxels err was not measured in patients",
     SUPINE_FILLS(supine_deform_content, ventilation), .file = SUPINE_FILE_OUT,
     .endings = ".nrrd, .nii, .nii.gz or .mha"},
    {"image", 0, "FILE",
     "image to move and write to -o (.nrrd, .nii, .nii.gz or .mha), interpolated linearly. The "
     "output "
     "has the voxels of FILE in the same order, even if their axes are left-handed (as dcm2niix's "
     "often are), so that the two can be compared voxel by voxel; fields are always right-handed",
     SUPINE_FILLS(supine_deform_content, image), .file = SUPINE_FILE_IN},
    {"density", 0, NULL,
     "with --image, if it is a CT in Hounsfield units: scale the density of aerated tissue in the "
     "lungs by the local change of volume, so that each lung keeps its mass; soft tissue keeps its "
     "density. Compact parts of soft tissue of 1 to 30 mL, such as nodules and tumours, also keep "
     "their size and shape, in all outputs for this state; the header of the output says so",
     SUPINE_FILLS(supine_deform_content, density)},
    {"labels", 0, "FILE",
     "label map to move and write to -o, or to --labels-out if --image is given, too; each voxel "
     "takes the label of the nearest voxel. Compact parts keep their size and shape: those that "
     "the CT of --image with --density shows, or else compact labels of 1 to 30 mL",
     SUPINE_FILLS(supine_deform_content, labels), .file = SUPINE_FILE_IN},
    {"labels-out", 0, "FILE",
     "label map to write if --image and --labels are given (.nrrd, .nii, .nii.gz or .mha)",
     SUPINE_FILLS(supine_deform_content, labels_path), .file = SUPINE_FILE_OUT,
     .endings = ".nrrd, .nii, .nii.gz or .mha"},
    {"rigid", 0, "VALUE,...",
     "values in the label map of --labels of parts that keep their size and shape, such as "
     "tumours, "
     "whatever their size",
     SUPINE_FILLS(supine_deform_content, rigid), .read = read_rigid,
     .wants = "at most 64 values of labels, such as 7,8"},
    {.name = NULL}};

supine_status supine_command_deform_content_check(const supine_deform_content *wanted,
                                                  supine_error *error) {
  const bool image = wanted->image != NULL || wanted->labels != NULL;
  const bool air = wanted->ventilation != NULL;
  SUPINE_REFUSE_IF(air && !image, error, SUPINE_ERROR_ARGUMENT,
                   "--ventilation needs --image FILE or --labels FILE, whose voxels it has");
  SUPINE_REFUSE_IF(wanted->path == NULL && !air && (image || wanted->field == NULL), error,
                   SUPINE_ERROR_ARGUMENT, "-o FILE is missing; its name must end in %s",
                   image ? ".nrrd, .nii, .nii.gz or .mha" : SUPINE_MESH_ENDINGS);
  SUPINE_REFUSE_IF(
      wanted->path != NULL && image != supine_image_supports(wanted->path), error,
      SUPINE_ERROR_ARGUMENT,
      image ? "%s: with --image or --labels, the name must end in .nrrd, .nii, .nii.gz or .mha"
            : "%s: no image to write: give --image FILE or --labels FILE",
      wanted->path);
  SUPINE_REFUSE_IF((wanted->image != NULL && wanted->labels != NULL && wanted->path != NULL) !=
                       (wanted->labels_path != NULL),
                   error, SUPINE_ERROR_ARGUMENT,
                   "--image with --labels needs --labels-out FILE, or with --states the column "
                   "labels, and these need both: give all three");
  SUPINE_REFUSE_IF(wanted->labels_path != NULL && !supine_image_supports(wanted->labels_path),
                   error, SUPINE_ERROR_ARGUMENT,
                   "%s: the name must end in .nrrd, .nii, .nii.gz or .mha", wanted->labels_path);
  SUPINE_REFUSE_IF(wanted->inverse && wanted->field == NULL, error, SUPINE_ERROR_ARGUMENT,
                   "--inverse needs --field-out FILE: give both");
  SUPINE_REFUSE_IF(wanted->rigid.count > 0 && wanted->labels == NULL, error, SUPINE_ERROR_ARGUMENT,
                   "--rigid needs --labels FILE: give both");
  return wanted->density && wanted->image == NULL
             ? supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                "--density needs --image FILE: give both")
             : SUPINE_OK;
}

supine_status supine_command_deform_content_read(supine_deform_content *wanted, const char *command,
                                                 supine_error *error) {
  if (wanted->labels != NULL) {
    SUPINE_TRY(supine_image_read(wanted->labels, &wanted->label_source, error));
  }
  if (wanted->image == NULL) {
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_image_read(wanted->image, &wanted->source, error));
  SUPINE_REFUSE_IF(wanted->ventilation != NULL && wanted->labels != NULL &&
                       !supine_image_same_grid(&wanted->source, &wanted->label_source),
                   error, SUPINE_ERROR_ARGUMENT,
                   "%s: its voxels are not those of %s: for --ventilation, resample it to them",
                   wanted->labels, wanted->image);
  if (!wanted->density) {
    supine_options_note(command, "densities are not scaled by the change of volume; for a CT, give "
                                 "--density to keep the tissue's mass");
    return SUPINE_OK;
  }
  return supine_warp_check_hounsfield(&wanted->source, wanted->image, error);
}

/* Convert a vector from LPS and mm to other axes and another unit. */
static void in_frame(supine_axes axes, double unit, const double lps[3], double out[3]) {
  double matrix[3][3];
  supine_mesh_axes_matrix(axes, matrix);
  for (int i = 0; i < 3; ++i) {
    out[i] = (matrix[0][i] * lps[0] + matrix[1][i] * lps[1] + matrix[2][i] * lps[2]) / unit;
  }
}

/* Write what the numbers of markups mean, and what the basis assumes. */
static void print_meaning(const supine_deformation *moved, const supine_basis *basis, char *text,
                          size_t size) {
  char caveats[SUPINE_CAVEATS_SIZE];
  (void)supine_basis_caveats(basis, caveats, sizeof caveats);
  (void)supine_print_text(text, size, "displacement from %s; errors: %s; %s", moved->from.name,
                          SUPINE_EXPECTED_MEANING, caveats);
}

/* Write a CSV file with a row for each target: name, lung, position, displacement and expected
 * error. */
static supine_status write_rows(const char *path, const supine_deformation *moved,
                                const supine_basis *basis, const supine_target *rows, size_t count,
                                supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_mesh_save_options *frame = &moved->save;
  const double unit = frame->millimetres_per_unit > 0.0 ? frame->millimetres_per_unit : 1.0;
  const bool known = moved->errors.position.sigma != NULL;
  char axes[4];
  char unit_name[24];
  char caveats[SUPINE_CAVEATS_SIZE];
  supine_output output;
  SUPINE_TRY(supine_output_open(path, &output, error));
  supine_mesh_unit_name(unit, unit_name);
  supine_mesh_axes_letters(frame->axes, axes);
  (void)supine_basis_caveats(basis, caveats, sizeof caveats);
  (void)fprintf(
      output.file,
      "# x,y,z,dx,dy,dz: position and displacement from %s, %s, %s; moved_mm: length of "
      "the displacement%s; %s\nname,lung,x,y,z,dx,dy,dz,moved_mm%s\n",
      moved->from.name, axes, unit_name,
      known ? "; moved_error_mm: its expected error; expected_error_mm: that of the position "
              "in the session of the scan; another_day_error_mm: on another day; "
              "each: " SUPINE_EXPECTED_MEANING
            : "",
      caveats, known ? ",moved_error_mm,expected_error_mm,another_day_error_mm" : "");
  for (const supine_target *row = rows; row < rows + count; ++row) {
    double at[3];
    double move[3];
    in_frame(frame->axes, unit, row->at, at);
    in_frame(frame->axes, unit, row->move, move);
    supine_csv_row line = {.file = output.file};
    supine_csv_add_text(&line, row->name);
    supine_csv_add_text(&line, info->lung_names[row->lung]);
    supine_csv_add(&line, "%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f", at[0], at[1], at[2], move[0],
                   move[1], move[2], row->moved);
    if (known) {
      supine_csv_add(&line, "%.3f,%.3f,%.3f", row->moved_error, row->error, row->another_error);
    }
    supine_csv_end_row(&line);
  }
  return supine_output_commit(&output, error);
}

/* Shift a row by the mean deviation of a sample at the vertices `order` [count]. */
static void deviate(const float *deviation, const size_t *order, size_t count, supine_target *row) {
  double back[3] = {0.0, 0.0, 0.0};
  for (size_t i = 0; i < 3 * count; ++i) {
    back[i % 3] -= (double)deviation[3 * order[i / 3] + i % 3] / (double)count;
  }
  supine_options_target_shift(row, back);
}

/* Write where each structure is, or each vertex if `each` is true, as CSV or markups. */
static supine_status write_points(const char *path, const supine_basis *basis,
                                  const supine_deformation *moved, bool each, supine_error *error) {
  const supine_pose *const pose[2] = {&moved->from.pose, &moved->pose};
  SUPINE_FREED_BY(supine_options_names_close) supine_options_names names = {0};
  SUPINE_FREED_BY(supine_options_targets_free) supine_target *rows = NULL;
  SUPINE_TRY(supine_options_names_open(basis, &names, error));
  const size_t count = each ? supine_basis_get_info(basis)->vertex_count : names.count;
  SUPINE_TRY(supine_options_targets_find(basis, &names, pose, &moved->errors, each, &rows, error));
  if (moved->subtract_hilum) {
    for (size_t i = 0; i < count; ++i) {
      supine_options_target_shift(&rows[i], moved->hilum.move);
    }
  }
  if (moved->registered) {
    for (size_t i = 0; i < count; ++i) {
      supine_options_fiducials_target(moved->motion, &rows[i]);
    }
  }
  if (moved->deviation != NULL) {
    for (size_t i = 0; i < count; ++i) {
      const size_t first = each ? i : names.begin[i];
      const size_t last = each ? i + 1 : names.begin[i + 1];
      deviate(moved->deviation, names.order + first, last - first, &rows[i]);
    }
  }
  char state[160];
  (void)supine_state_describe(&moved->state, state, sizeof state);
  if (supine_options_markups_named(path)) {
    json_t *lists = json_array();
    char meaning[256 + SUPINE_CAVEATS_SIZE];
    print_meaning(moved, basis, meaning, sizeof meaning);
    (void)json_array_append_new(lists, supine_options_markup(state, meaning, rows, count));
    SUPINE_TRY(supine_options_markups_write(path, lists, error));
  } else {
    SUPINE_TRY(write_rows(path, moved, basis, rows, count, error));
  }
  supine_options_line("%s: %zu %s%s, %s, displacement from %s\n", path, count,
                      each ? "point" : "structure", count == 1 ? "" : "s", state, moved->from.name);
  SUPINE_ADD_RESULT(json_pack("{s:o, s:I, s:s, s:s}", "file", supine_options_json_text(path),
                              each ? "points" : "structures", (json_int_t)count, "state", state,
                              "displacement_from", moved->from.name));
  return SUPINE_OK;
}

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
  SUPINE_TRY(supine_warp_between(basis, moved->from_given ? &moved->from.pose : NULL, &moved->pose,
                                 moved->deviation, field, error));
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

/* Check that the image and the labels to move show the lungs of the field. */
static supine_status check_images(const supine_deform_content *wanted, const supine_field *field,
                                  supine_error *error) {
  const struct {
    const char *path;
    const supine_image *image;
    supine_warp_image_kind kind;
  } images[] = {
      {wanted->image, &wanted->source, wanted->density ? SUPINE_FIELD_CT : SUPINE_FIELD_IMAGE},
      {wanted->labels, &wanted->label_source, SUPINE_FIELD_LABELS}};
  supine_findings findings = {.count = 0};
  supine_status status = SUPINE_OK;
  for (size_t i = 0; i < sizeof images / sizeof *images && status == SUPINE_OK; ++i) {
    if (images[i].path != NULL) {
      status = supine_warp_check_image(field, images[i].image, images[i].path, images[i].kind,
                                       &findings, error);
    }
  }
  supine_options_say_findings("deform", &findings);
  return status;
}

static supine_status move_grid(const supine_deform_content *wanted, const supine_basis *basis,
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
    SUPINE_TRY(write_image(image ? wanted->labels_path : wanted->path, &wanted->label_source, true,
                           NULL, &inverse, error));
  }
  return SUPINE_OK;
}

/* Return the volume of each lung with its range and source. */
static json_t *list_volumes(const supine_basis *basis, const supine_deformation *moved) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  json_t *lungs = json_object();
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const supine_fact held = supine_basis_lung_volume(basis, &moved->state, &moved->pose, lung);
    (void)json_object_set_new(lungs, info->lung_names[lung],
                              supine_options_volume_json(&held, false));
  }
  return lungs;
}

/* Print the range of the volume of all lungs if it was assumed from other people. */
static void print_range(const supine_basis *basis, const supine_deformation *moved) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double low = 0.0;
  double high = 0.0;
  bool assumed = false;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const supine_fact held = supine_basis_lung_volume(basis, &moved->state, &moved->pose, lung);
    low += isfinite(held.low) ? held.low : held.value;
    high += isfinite(held.high) ? held.high : held.value;
    assumed = assumed || isfinite(held.low);
  }
  if (assumed) {
    supine_options_line("; assumed from other people: %.0f to %.0f mL", low, high);
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const supine_fact held = supine_basis_lung_volume(basis, &moved->state, &moved->pose, lung);
    if (held.source == SUPINE_SOURCE_COLLAPSED) {
      supine_options_line("; the %s lung is collapsed: %.0f mL", held.name, held.value);
    }
  }
  SUPINE_ADD_RESULT(json_pack("{s:o}", "lungs_ml", list_volumes(basis, moved)));
}

/* Warn of each embedded part whose surface folds between the positions `from` and `to`. */
static supine_status tell_folds(const supine_basis *basis, const supine_mesh *from,
                                const supine_mesh *to, supine_error *error) {
  static const double visible = 0.002; /* share of turned triangles that is seen (mesh.h) */
  SUPINE_FREED_BY(supine_options_names_close) supine_options_names names = {0};
  SUPINE_ARENA arena = {0};
  SUPINE_TRY(supine_options_names_open(basis, &names, error));
  size_t *turned = supine_arena_zeros(&arena, names.count, sizeof *turned);
  size_t *count = supine_arena_zeros(&arena, names.count, sizeof *count);
  SUPINE_TRY(supine_arena_check(&arena, error, "the folds of %zu parts", names.count));
  for (size_t t = 0; t < from->triangle_count; ++t) {
    supine_mesh one = *from;
    one.triangles += 3 * t;
    one.triangle_count = 1;
    const uint32_t part = names.part[one.triangles[0]];
    ++count[part];
    turned[part] += supine_mesh_turned_over(&one, to->vertices) > 0.0;
  }
  for (size_t part = 0; part < names.count; ++part) {
    if ((double)turned[part] > visible * (double)count[part]) {
      supine_options_say("deform",
                         "warning: %s: its surface folds: %zu of its %zu triangles turn over: "
                         "choose a volume nearer to that of the scan",
                         names.text[part], turned[part], count[part]);
    }
  }
  return SUPINE_OK;
}

/* Move two meshes, and the normals of the second one, by the motions of a registration. */
static void register_mesh(const supine_motion motion[2], supine_mesh *from, supine_mesh *mesh,
                          float *normals) {
  supine_motion turn = motion[0];
  memset(turn.translation, 0, sizeof turn.translation);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    double normal[3];
    supine_options_fiducials_move(&motion[0], mesh->vertices + 3 * i);
    supine_options_fiducials_move(&motion[1], from->vertices + 3 * i);
    for (size_t k = 0; k < 3; ++k) {
      normal[k] = (double)normals[3 * i + k];
    }
    supine_options_fiducials_move(&turn, normal);
    for (size_t k = 0; k < 3; ++k) {
      normals[3 * i + k] = (float)normal[k];
    }
  }
}

/* Add the deviation of a sample, if there is one, to a mesh and to a copy of its vertices. */
static void deviate_surface(const float *deviation, supine_mesh *mesh, float *xyz) {
  if (deviation == NULL) {
    return;
  }
  for (size_t i = 0; i < 3 * mesh->vertex_count; ++i) {
    xyz[i] += deviation[i];
    mesh->vertices[i] += (double)deviation[i];
  }
}

/* Write a surface, and print its largest displacement and its volume. */
static supine_status write_surface(const char *path, const supine_basis *basis,
                                   supine_deformation *moved, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_tensor *lung = supine_basis_tensor(basis, "lung");
  const double *gravity = moved->state.gravity;
  supine_mesh_save_options *save = &moved->save;
  double volumes[SUPINE_LUNGS_MAX];
  const supine_mesh_field fields[] = {{"gravity_LPS", 3, gravity},
                                      {"volume_mL", info->lung_count, volumes}};
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh from = {0};
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh mesh = {0};
  SUPINE_ARENA arena = {0};
  float *normals = supine_arena_take(&arena, info->vertex_count, 3 * sizeof *normals);
  float *xyz = supine_arena_take(&arena, info->vertex_count, 3 * sizeof *xyz);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", info->vertex_count));
  SUPINE_TRY(supine_posed_mesh(basis, &moved->from.pose, &from, error));
  SUPINE_TRY(supine_posed_mesh(basis, &moved->pose, &mesh, error));
  (void)supine_deform(basis, &moved->pose, xyz);
  deviate_surface(moved->deviation, &mesh, xyz);
  supine_normals(basis, xyz, normals);
  if (moved->subtract_hilum) {
    for (size_t i = 0; i < 3 * mesh.vertex_count; ++i) {
      mesh.vertices[i] -= moved->hilum.move[i % 3];
    }
  }
  if (moved->registered) {
    register_mesh(moved->motion, &from, &mesh, normals);
  }
  (void)supine_basis_volumes(basis, &moved->pose, volumes);
  save->from = from.vertices;
  save->normals = mesh.triangle_count > 0 ? normals : NULL;
  save->scalars[0] = (supine_mesh_scalar){"expected_error_mm", moved->errors.position.sigma};
  save->scalars[1] = (supine_mesh_scalar){"moved_error_mm", moved->errors.moved.sigma};
  save->scalars[2] = (supine_mesh_scalar){"another_day_error_mm", moved->errors.position.another};
  save->lung = lung == NULL ? NULL : lung->data;
  save->fields = fields;
  save->field_count = sizeof fields / sizeof *fields;
  SUPINE_TRY(supine_mesh_save(path, &mesh, save, error));
  double largest = 0.0;
  for (size_t i = 0; i < mesh.vertex_count; ++i) {
    largest = fmax(largest, supine_distance(mesh.vertices + 3 * i, from.vertices + 3 * i));
  }
  supine_options_line("%s: gravity %.4g,%.4g,%.4g, largest displacement %s mm from %s", path,
                      gravity[0], gravity[1], gravity[2], supine_text_distance(largest).text,
                      moved->from.name);
  SUPINE_ADD_RESULT(json_pack("{s:o, s:o, s:s, s:f}", "file", supine_options_json_text(path),
                              "gravity", supine_options_json_numbers(3, gravity),
                              "displacement_from", moved->from.name, "largest_displacement_mm",
                              largest));
  const bool content = supine_basis_metadata(basis, "content") != NULL;
  if (!content) {
    const double held = 1e-3 * supine_mesh_volume(&mesh);
    SUPINE_ADD_RESULT(json_pack("{s:f, s:f}", "volume_ml", held, "volume_change_ml",
                                held - 1e-3 * supine_mesh_volume(&from)));
    supine_options_line(", %.2f mL (%+.2f mL)", held, held - 1e-3 * supine_mesh_volume(&from));
    print_range(basis, moved);
  }
  supine_options_line("\n");
  return content && mesh.triangle_count > 0 ? tell_folds(basis, &from, &mesh, error) : SUPINE_OK;
}

/* Print the expected errors of positions, and of displacements from another state than the scan. */
static void print_errors(const supine_deformation *moved) {
  const supine_expected *position = &moved->errors.position;
  const supine_expected *displacement = &moved->errors.moved;
  if (position->sigma != NULL) {
    SUPINE_ADD_RESULT(
        json_pack("{s:{s:f, s:f, s:o}, s:{s:f, s:f}}", "expected_error_mm", "rms", position->rms,
                  "largest", position->largest, "another_day",
                  position->another == NULL ? json_null() : json_real(position->another_rms),
                  "moved_error_mm", "rms", displacement->rms, "largest", displacement->largest));
  }
  if (position->another == NULL && position->sigma != NULL) { /* another simulator's fields */
    supine_options_line("error of the fit to the simulator: %s mm (RMS over the points)\n",
                        supine_text_distance(position->rms).text);
  }
  if (position->another != NULL) {
    supine_options_line("expected error of the positions: same session %.1f mm (RMS over the "
                        "points), %.1f mm at most; another day %.1f mm%s\n",
                        position->rms, position->largest, position->another_rms,
                        position->turned ? "; an extrapolation, as the posture changes" : "");
    if (moved->from_given) {
      supine_options_line("expected error of the displacements: %.1f mm (RMS), %.1f mm at most%s\n",
                          displacement->rms, displacement->largest,
                          displacement->turned ? "; an extrapolation, as the posture changes" : "");
    }
  }
}

/* Print in which frame the outputs are, and how the hilum moves. */
static void print_frame(const supine_deformation *moved) {
  if (moved->registered) {
    supine_options_line(
        "registered at the points of --frame: positions, displacements and errors are what is "
        "left after it\n");
    return;
  }
  const supine_hilum *hilum = &moved->hilum;
  SUPINE_ADD_RESULT(json_pack("{s:{s:o, s:o, s:b}}", "hilum", "moved_mm",
                              supine_options_json_numbers(3, hilum->move), "expected_error_mm",
                              supine_options_json_number(hilum->expected), "subtracted",
                              (int)moved->subtract_hilum));
  if (supine_length(hilum->move) > 0.0 && supine_length(hilum->move) < 0.1) {
    supine_options_line("the hilum moves by less than 0.1 mm\n");
  } else if (supine_length(hilum->move) > 0.0) {
    supine_options_line("the hilum moves by %.1f, %.1f, %.1f mm (to the left, back and head)",
                        hilum->move[0], hilum->move[1], hilum->move[2]);
    if (!isnan(hilum->expected)) {
      supine_options_line(", expected error in the body %.1f mm", hilum->expected);
    }
    supine_options_line("%s\n", moved->subtract_hilum
                                    ? "; subtracted from all positions, whose expected "
                                      "errors are those relative to the hilum"
                                    : "");
  }
}

supine_status supine_command_deform_content(const supine_deform_content *wanted,
                                            const supine_basis *basis, supine_deformation *moved,
                                            supine_error *error) {
  const bool image = wanted->image != NULL || wanted->labels != NULL;
  SUPINE_REFUSE_IF(moved->registered && (image || wanted->field != NULL), error,
                   SUPINE_ERROR_UNSUPPORTED,
                   "--frame POINTS moves points and surfaces, no images: write these without it");
  if (image || wanted->field != NULL) {
    SUPINE_TRY(move_grid(wanted, basis, moved, error));
  }
  if (!image && wanted->path != NULL) {
    if (supine_text_ends_in(wanted->path, ".csv") || supine_options_markups_named(wanted->path)) {
      SUPINE_TRY(write_points(wanted->path, basis, moved, wanted->vertices, error));
    } else {
      SUPINE_TRY(write_surface(wanted->path, basis, moved, error));
    }
  }
  print_errors(moved);
  print_frame(moved);
  return SUPINE_OK;
}
