/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write moved points, or the structures that they belong to, as CSV or markups of 3D Slicer. */
#include "base/csv.h"
#include "base/output.h"
#include "program/command/deform_content.h"
#include "program/options/inside.h"
#include "program/options/markups.h"

/* Convert a vector from LPS and mm to other axes and another unit. */
static void in_frame(supine_axes axes, double unit, const double lps[3], double out[3]) {
  double matrix[3][3];
  supine_mesh_axes_matrix(axes, matrix);
  for (int i = 0; i < 3; ++i) {
    out[i] = (matrix[0][i] * lps[0] + matrix[1][i] * lps[1] + matrix[2][i] * lps[2]) / unit;
  }
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

supine_status supine_command_deform_points(const char *path, const supine_basis *basis,
                                           const supine_deformation *moved, bool each,
                                           supine_error *error) {
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
    char meaning[SUPINE_MARKUPS_DESCRIPTION];
    supine_options_markups_describe(basis, moved->from.name, meaning);
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
