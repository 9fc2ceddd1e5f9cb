/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Open a basis, and find the axes of its scan and the displacement of its hilum. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/text.h"
#include "precompute/inside/shells.h"

#include "program/options/basis_input.h"

const supine_option supine_options_as_scanned[] = {
    {"as-scanned", 0, NULL, "write in the axes and units of the scan instead of LPS and mm",
     .kind = SUPINE_OPTION_FLAG, .size = sizeof(bool)},
    {.name = NULL}};

void supine_options_basis_close(supine_basis **basis) {
  supine_basis_close(*basis);
}

supine_status supine_options_basis_open(const char *path, supine_storage storage,
                                        supine_basis **basis, supine_error *error) {
  const supine_basis_options options = {sizeof options, .storage = storage,
                                        .without_normals = true};
  SUPINE_TRY(supine_basis_open_with(path, &options, basis, error));
  return supine_basis_get_info(*basis)->has_volume
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                                "%s: the surface is open and encloses no volume: close the mesh "
                                "before 'supine precompute'",
                                path);
}

json_t *supine_options_json_metadata(const supine_basis *basis) {
  size_t count = 0;
  const supine_metadata *all = supine_basis_all_metadata(basis, &count);
  json_t *metadata = json_object();
  for (size_t i = 0; i < count; ++i) {
    (void)json_object_set_new(metadata, all[i].key, json_string(all[i].value));
  }
  return metadata;
}

supine_status supine_options_basis_frame(const supine_basis *basis, bool wanted,
                                         supine_mesh_save_options *save, supine_error *error) {
  const char *axes = supine_basis_metadata(basis, "scan_axes");
  const char *unit = supine_basis_metadata(basis, "scan_unit_mm");
  SUPINE_REFUSE_IF(wanted && (axes == NULL || unit == NULL ||
                              !supine_options_parse_number(unit, &save->millimetres_per_unit) ||
                              !(save->millimetres_per_unit > 0.0) ||
                              !supine_mesh_axes_parse(axes, &save->axes)),
                   error, SUPINE_ERROR_FORMAT,
                   "the basis does not state the axes and units of its scan: leave out "
                   "--as-scanned, or make the basis again from the scan");
  return SUPINE_OK;
}

void supine_options_basis_title(const char *path, char *title, size_t size) {
  static const char ending[] = ".safetensors";
  const char *name = supine_text_file_name(path);
  const size_t cut = supine_text_ends_in(name, ending) ? sizeof ending - 1 : 0;
  (void)snprintf(title, size, "%.*s", (int)(strlen(name) - cut), name);
  (void)supine_text_make_utf8(title);
}

static const char *const frames[] = {"body", "hilum", NULL};

const supine_option supine_options_hilum_frame[] = {
    {"frame", 0, "body|hilum",
     "what stays in place: the body (spine, apex and back wall), or the hilum, whose displacement "
     "is then subtracted, as bronchoscopy registers the airways there",
     .kind = SUPINE_OPTION_CHOICE, .size = sizeof(int), .choices = frames, .standard = "body"},
    {.name = NULL}};

supine_status supine_options_hilum(const supine_basis *basis, const supine_pose *pose,
                                   const supine_pose *from, bool needed, double shift[3],
                                   supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t modes = info->mode_count;
  SUPINE_ARENA arena = {0};
  double *mean = supine_arena_take(&arena, info->lung_count * 3 * modes, sizeof *mean);
  memset(shift, 0, 3 * sizeof *shift);
  if (mean == NULL) {
    return supine_error_memory(error, "%zu modes", modes);
  }
  const bool known = supine_inside_hilum(basis, mean);
  for (size_t i = 0; i < info->lung_count * 3 * modes && known; ++i) {
    const size_t axis = i / modes % 3;
    const size_t lung = i / modes / 3;
    shift[axis] += mean[i] / (double)info->lung_count *
                   (pose->gains[lung][axis] * pose->weights[i % modes] -
                    from->gains[lung][axis] * from->weights[i % modes]);
  }
  return known || !needed ? SUPINE_OK
                          : supine_error_set(error, SUPINE_ERROR_UNSUPPORTED,
                                             "--frame hilum: the file does not say how the hilum "
                                             "moves: make it again with 'supine embed'");
}
