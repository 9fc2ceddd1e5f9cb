/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine phantom: synthetic lungs. */
#include "precompute/lungs/phantom.h"

#include "program/options/command.h"

static const char name[] = "phantom";

typedef struct request {
  const char *path;
  size_t vertices;
  double volume;
} request;

static const supine_option table[] = {
    {"output", 'o', "FILE", SUPINE_MESH_ENDINGS, SUPINE_FILLS(request, path), .required = true,
     .file = SUPINE_FILE_OUT, .endings = SUPINE_MESH_ENDINGS},
    {"vertices", 0, "N", "approximate number of vertices of both lungs, up to 20 million",
     SUPINE_FILLS(request, vertices), .standard = "20000"},
    {"volume", 0, "ML", "volume of both lungs; the default is an adult's at full inflation",
     SUPINE_FILLS(request, volume), .standard = "6000", .wants = "millilitres"},
    {.name = NULL}};

static int run(void *chosen, const supine_arguments *given) {
  const request *wanted = chosen;
  supine_mesh mesh = {0};
  supine_error error;
  int result = SUPINE_EXIT_OK;
  const supine_mesh_save_options save = {.comment =
                                             "made lungs, mm; shape after Chaste's lung test "
                                             "data (BSD-3-Clause, University of Oxford)"};
  (void)given;
  if (supine_phantom_create(wanted->vertices, wanted->volume, &mesh, &error) != SUPINE_OK ||
      supine_mesh_save(wanted->path, &mesh, &save, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
  } else {
    (void)printf("%s: two lungs, %zu vertices, %zu triangles, %.1f mL\n", wanted->path,
                 mesh.vertex_count, mesh.triangle_count, 1e-3 * supine_mesh_volume(&mesh));
    result = supine_options_finish(name);
  }
  supine_mesh_free(&mesh);
  return result;
}

const supine_command supine_command_phantom = {
    name,
    "make a pair of lungs, at any resolution",
    .usage = "-o FILE [OPTIONS]",
    .about = "Makes synthetic lungs for trials without a scan: two closed, smooth surfaces of "
             "the shape of an adult's.",
    .options = table,
    .notes = "Example:\n  supine phantom -o lungs.ply --vertices 100000",
    .request_size = sizeof(request),
    .run = run};
