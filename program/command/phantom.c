/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine phantom: make synthetic lungs. */
#include "precompute/lungs/phantom.h"
#include "base/arena.h"

#include "program/command/list.h"
#include "program/options/command.h"

typedef struct request {
  const char *path;
  size_t vertices;
  double volume;
} request;

static const supine_option table[] = {
    {"output", 'o', "FILE", "surface to write: " SUPINE_MESH_ENDINGS, SUPINE_FILLS(request, path),
     .required = true, .file = SUPINE_FILE_OUT, .endings = SUPINE_MESH_ENDINGS},
    {"vertices", 0, "N", "approximate number of vertices of both lungs, up to 20 million",
     SUPINE_FILLS(request, vertices), .standard = "20000"},
    {"volume", 0, "VOLUME", "volume of both lungs at full inflation", SUPINE_FILLS(request, volume),
     .standard = "6000mL", SUPINE_MEASURES(VOLUME)},
    {.name = NULL}};

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  const request *wanted = chosen;
  const supine_mesh_save_options save = {.comment =
                                             "synthetic lungs, mm; shape after Chaste's lung test "
                                             "data (BSD-3-Clause, University of Oxford)"};
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh mesh = {0};
  (void)given;
  SUPINE_TRY(supine_lungs_phantom_create(wanted->vertices, wanted->volume, &mesh, error));
  SUPINE_TRY(supine_mesh_save(wanted->path, &mesh, &save, error));
  const double volume = 1e-3 * supine_mesh_volume(&mesh);
  supine_options_line("%s: two lungs, %zu vertices, %zu triangles, %.1f mL\n", wanted->path,
                      mesh.vertex_count, mesh.triangle_count, volume);
  SUPINE_ADD_RESULT(json_pack("{s:o, s:I, s:I, s:f}", "file",
                              supine_options_json_text(wanted->path), "vertices",
                              (json_int_t)mesh.vertex_count, "triangles",
                              (json_int_t)mesh.triangle_count, "volume_ml", volume));
  return SUPINE_OK;
}

const supine_command supine_command_phantom = {
    "phantom",
    "make a synthetic pair of lungs",
    .usage = "-o FILE [OPTIONS]",
    .about = "Makes synthetic lungs for trials without a scan: two closed, smooth surfaces shaped "
             "like an adult's lungs.",
    .options = table,
    .notes = "Example:\n  supine phantom -o lungs.ply --vertices 100000",
    .request_size = sizeof(request),
    .run = run};
