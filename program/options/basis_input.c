/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Open a basis, and find the axes of its scan and the displacement of its hilum. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/text.h"
#include "precompute/inside/shells.h"

#include "program/options/basis_input.h"
#include "runtime/expected.h"

const supine_option supine_options_as_scanned[] = {
    {"as-scanned", 0, NULL, "write in the axes and units of the scan instead of LPS and mm",
     .kind = SUPINE_OPTION_FLAG, .size = sizeof(bool)},
    {.name = NULL}};

void supine_options_basis_close(supine_basis **basis) {
  supine_basis_close(*basis);
}

supine_status supine_options_basis_open(const char *path, supine_storage storage,
                                        supine_basis **basis, supine_error *error) {
  const supine_basis_options options = {sizeof options, .storage = storage, .without_normals = true,
                                        .allow_folds = true}; /* commands check states themselves */
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

/* The number b of the expected error (supine/locate.h) in the middle of the hilum, whose box
 * coordinates are 0.175, 0.5 and 0.5 (supine_inside_hilum). */
static const double hilum_beside_heart = 0.43;

static const char *const frames[] = {"body", "hilum", NULL};

const supine_option supine_options_hilum_frame[] = {
    {"frame", 0, "body|hilum",
     "what stays in place: the body (spine, apex and back wall), or the hilum, whose displacement "
     "is then subtracted, as bronchoscopy registers the airways there",
     .kind = SUPINE_OPTION_CHOICE, .size = sizeof(int), .choices = frames, .standard = "body"},
    {.name = NULL}};

/* Add to u the mean displacement of the hila from pose[1] to pose[0], mm.
 * @param mean  [lungs, 3, modes] mean displacement by each mode at weight and gain 1, mm */
static void add_motion(const supine_basis_info *info, const double *mean, const supine_pose pose[2],
                       double u[3]) {
  const size_t modes = info->mode_count;
  for (size_t i = 0; i < info->lung_count * 3 * modes; ++i) {
    const size_t axis = i / modes % 3;
    const size_t lung = i / modes / 3;
    u[axis] += mean[i] / (double)info->lung_count *
               (pose[0].gains[lung][axis] * pose[0].weights[i % modes] -
                pose[1].gains[lung][axis] * pose[1].weights[i % modes]);
  }
}

supine_status supine_options_hilum(const supine_basis *basis, const supine_state *state,
                                   const supine_state *from, bool needed, supine_hilum *hilum,
                                   supine_error *error) {
  enum { PAIRS = EXPECTED_POSES / 2 };
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t modes = info->mode_count;
  supine_expected_model model;
  double u[PAIRS][3] = {{0.0}};
  double square[SUPINE_EXPECTED_TERMS];
  double sum = 0.0;
  SUPINE_ARENA arena = {0};
  double *mean = supine_arena_take(&arena, info->lung_count * 3 * modes, sizeof *mean);
  *hilum = (supine_hilum){.expected = (double)NAN};
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu modes", modes));
  if (!supine_inside_hilum(basis, mean)) {
    SUPINE_REFUSE_IF(needed, error, SUPINE_ERROR_UNSUPPORTED,
                     "--frame hilum: the file does not say how the hilum moves: make it again with "
                     "'supine embed'");
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_expected_prepare(basis, state, from, 0.0, 0.0, &model, error));
  for (size_t pair = 0; pair < PAIRS; ++pair) {
    add_motion(info, mean, &model.pose[2 * pair], u[pair]);
  }
  memcpy(hilum->move, u[0], sizeof hilum->move);
  supine_expected_squares(&model, u, hilum_beside_heart, square);
  for (size_t k = 0; k < SUPINE_EXPECTED_TERMS; ++k) {
    sum += square[k];
  }
  hilum->expected = info->is_fields ? (double)NAN : sqrt(sum);
  return SUPINE_OK;
}
