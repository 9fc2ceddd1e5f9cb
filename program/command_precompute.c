/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine precompute: make a basis file from lung surfaces or a label map. */
#include "base/csv.h"
#include "base/vec3.h"
#include "program/offline/basis.h"
#include "program/options/model_options.h"

static const char name[] = "precompute";

static void print_directions(size_t count) {
  (void)puts("x,y,z");
  for (size_t i = 0; i < count; ++i) {
    double g[3];
    supine_spiral((double)i, (double)count, 0.0, g);
    supine_csv_row row = {.file = stdout};
    supine_csv_add(&row, "%.9g,%.9g,%.9g", g[0], g[1], g[2]);
    supine_csv_end_row(&row);
  }
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  supine_offline_request *wanted = chosen;
  SUPINE_FREED_BY(supine_precompute_prepared_free) supine_prepared prepared = {.fit = ""};
  if (wanted->directions > 0) {
    print_directions(wanted->directions);
    return SUPINE_OK;
  }
  wanted->basis.made_by = given->made_by;
  SUPINE_TRY(supine_offline_check(wanted, error));
  SUPINE_TRY(
      supine_command_prepare(name, &wanted->model, given->operand, given->count, &prepared, error));
  SUPINE_FREED_BY(supine_options_progress_end)
  supine_progress progress = supine_options_progress_begin(name);
  wanted->basis.progress = supine_options_progress_step;
  wanted->basis.progress_context = &progress;
  return supine_offline_write(wanted, &prepared, stdout, error);
}

const supine_command supine_command_precompute = {
    name,
    "solve the physics once, and write a basis file for any posture",
    .usage = "MESH... -o FILE [OPTIONS]\n"
             "LABELS... -o FILE [OPTIONS]\n"
             "--directions N",
    .about = "Solves the physics of one or two lungs for all directions of gravity, and writes a "
             "basis file. From this file, 'supine export' makes a page, and 'supine deform' and "
             "the run-time library compute deformed lungs in real time. MESH is any surface that "
             "assimp reads (PLY, OBJ, STL, "
             "OFF, ...), with both lungs in one file or a file for each; LABELS is the label map "
             "of a segmentation (NRRD, NIfTI, MetaImage). Surfaces must be closed.",
    .options = supine_offline_options,
    .notes = "Examples:\n"
             "  supine precompute left.ply right.ply -o lungs.safetensors\n"
             "  supine precompute lungs.nii.gz -o lungs.safetensors\n"
             "  supine precompute lungs.stl --axes RAS --units cm -o lungs.safetensors",
    SUPINE_SURFACES,
    .request_size = sizeof(supine_offline_request),
    .uses_blas = true,
    .begin = supine_offline_begin,
    .run = run};
