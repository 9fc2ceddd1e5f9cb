/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read and check the options on what 'supine deform' writes; write it, and print its expected
 * errors and its frame. */
#include <math.h>

#include "base/number.h"
#include "base/text.h"
#include "base/vec3.h"
#include "mesh/mesh.h"
#include "precompute/warp/check_image.h"
#include "program/command/deform_content.h"
#include "program/options/markups.h"

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
     "border of the grid and beyond",
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
     "output has the voxels of FILE in the same order, even if their axes are left-handed (as "
     "dcm2niix's often are), so that the two can be compared voxel by voxel; fields are always "
     "right-handed",
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
     "tumours, whatever their size",
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
    SUPINE_TRY(supine_command_deform_images(wanted, basis, moved, error));
  }
  if (!image && wanted->path != NULL) {
    if (supine_text_ends_in(wanted->path, ".csv") || supine_options_markups_named(wanted->path)) {
      SUPINE_TRY(supine_command_deform_points(wanted->path, basis, moved, wanted->vertices, error));
    } else {
      SUPINE_TRY(supine_command_deform_surface(wanted->path, basis, moved, error));
    }
  }
  print_errors(moved);
  print_frame(moved);
  return SUPINE_OK;
}
