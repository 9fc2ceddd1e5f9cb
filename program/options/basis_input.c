/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Open a basis, and find the axes of its scan. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/text.h"

#include "program/options/basis_input.h"

const supine_option supine_options_as_scanned[] = {
    {"as-scanned", 0, NULL, "write in the axes and units of the scan instead of LPS and mm",
     .kind = SUPINE_OPTION_FLAG, .size = sizeof(bool)},
    {.name = NULL}};

void supine_options_basis_close(supine_basis **basis) {
  supine_basis_close(*basis);
}

supine_status supine_options_basis_open(const char *path, supine_storage storage, bool allow_folds,
                                        supine_basis **basis, supine_error *error) {
  const supine_basis_options options = {sizeof options, .storage = storage, .without_normals = true,
                                        .allow_folds = allow_folds};
  SUPINE_TRY(supine_basis_open_with(path, &options, basis, error));
  SUPINE_REFUSE_IF(
      !supine_basis_get_info(*basis)->has_volume, error, SUPINE_ERROR_OPEN_SURFACE,
      "%s: the surface is open and encloses no volume: close the mesh before 'supine precompute'",
      path);
  return SUPINE_OK;
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
  if (!wanted) {
    return SUPINE_OK;
  }
  const bool known = axes != NULL && unit != NULL &&
                     supine_options_parse_number(unit, &save->millimetres_per_unit) &&
                     save->millimetres_per_unit > 0.0 && supine_mesh_axes_parse(axes, &save->axes);
  SUPINE_REFUSE_IF(!known, error, SUPINE_ERROR_FORMAT,
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
