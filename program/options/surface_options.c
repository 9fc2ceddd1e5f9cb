/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Declare the options for axes, units and landmarks, for commands that read surfaces. */
#include <string.h>

#include "base/ascii.h"
#include "base/quantity.h"
#include "program/options/command.h"
#include "program/options/surface_options.h"

static supine_status read_axes(const char *text, void *field, supine_error *error) {
  char letters[4] = "";
  (void)error;
  if (strlen(text) == 3) {
    for (size_t k = 0; k < 3; ++k) {
      letters[k] = supine_ascii_upper(text[k]);
    }
  }
  return supine_options_fits(supine_mesh_axes_parse(letters, field));
}

static supine_status read_units(const char *text, void *field, supine_error *error) {
  double *millimetres = field;
  (void)error;
  return supine_options_fits(
      supine_quantity_find_unit(SUPINE_QUANTITY_LENGTH, text, millimetres) ||
      (supine_options_parse_number(text, millimetres) && *millimetres > 0.0));
}

const supine_option supine_options_surface_frame[] = {
    {"axes", 0, "ABC",
     "axes of the files' coordinates: three letters, the directions in which x, y and z grow (L or "
     "R, P or A, S or I): LPS in DICOM, RAS in 3D Slicer and nibabel. ITK names the opposite "
     "directions: its RAI is LPS here. Default the axes that the file states, else LPS",
     SUPINE_FILLS(supine_mesh_load_options, axes), .read = read_axes,
     .wants = "three letters, one each of L or R, P or A, S or I, such as LPS"},
    {"units", 0, "UNIT",
     "unit of the coordinates: mm, cm, m, um, in, or the length of the unit in mm, such as 25.4; "
     "default mm. If given, also for a label map (mm), lungs of a size impossible for a person are "
     "accepted, such as an animal's or a phantom",
     SUPINE_FILLS(supine_mesh_load_options, millimetres_per_unit), .read = read_units,
     .wants = "mm, cm, m, um, in, or a number of millimetres"},
    {.name = NULL}};

#define FILLS(member) SUPINE_FILLS(supine_landmark_options, member)

const supine_option supine_options_landmarks[] = {
    {"landmarks", 0, "FILE",
     "matched points, in mm and LPS: CSV with the columns x,y,z (a point in the first state) and "
     "to_x,to_y,to_z (the same point in the second state); or with im2_x,im2_y,im2_z (exhaled, the "
     "first state) and im1_x,im1_y,im1_z (inhaled, the second state)",
     FILLS(path), .file = SUPINE_FILE_IN},
    {"reverse", 0, NULL, "exchange the two states of the landmarks", FILLS(reverse)},
    {"translation", 0, NULL, "also fit a translation between the frames of the scans",
     FILLS(translation), .rivals = "motion"},
    {"rigid", 0, NULL,
     "also fit a translation and a small rotation between the frames of the scans", FILLS(rigid),
     .rivals = "motion"},
    {.name = NULL}};

void supine_options_say_findings(const char *command, const supine_findings *findings) {
  for (size_t i = 0; i < findings->count; ++i) {
    const supine_finding *found = &findings->list[i];
    char text[1024];
    (void)snprintf(text, sizeof text, "%s", found->text);
    supine_remedies_add(found->remedies, SUPINE_WORDS_COMMAND, text, sizeof text);
    if (found->is_warning) {
      supine_options_say(command, "warning: %s", text);
    } else {
      supine_options_note(command, "%s", text);
    }
  }
  if (findings->dropped > 0) {
    supine_options_say(command, "warning: and %zu more", findings->dropped);
  }
}

supine_patient_scan_motion supine_options_scan_motion(const supine_landmark_options *landmarks) {
  if (landmarks->rigid) {
    return SUPINE_PATIENT_RIGID;
  }
  return landmarks->translation ? SUPINE_PATIENT_TRANSLATION : SUPINE_PATIENT_STILL;
}
