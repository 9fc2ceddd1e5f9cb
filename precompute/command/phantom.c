/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine phantom: a made pair of lungs. */
#include <string.h>

#include "precompute/phantom/phantom.h"

#include "runtime/options/command.h"

static const char name[] = "phantom";

static const char help[] =
    "Usage: supine phantom -o FILE [OPTIONS]\n"
    "\n"
    "Makes a pair of lungs to try things with: two closed surfaces, smooth, of the shape of one\n"
    "adult's, so that no scan is needed.\n"
    "\n"
    "  -o, --output FILE    .ply, .obj, .stl or .vtp\n"
    "  --vertices N         about so many in all; default 20000, up to 20 million\n"
    "  --volume ML          volume of both lungs together; default 2500, a supine adult's at rest\n"
    "\n"
    "Example:\n"
    "  supine phantom -o lungs.ply --vertices 100000\n";

int supine_command_phantom(int argc, char **argv) {
  static const struct option options[] = {{"output", required_argument, NULL, 'o'},
                                          {"vertices", required_argument, NULL, 'n'},
                                          {"volume", required_argument, NULL, 'v'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
  const char *path = NULL;
  size_t vertices = 20000;
  double volume = 2500.0;
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":o:h", options, NULL)) != -1) {
    switch (option) {
    case 'o':
      path = optarg;
      break;
    case 'n':
      if (!supine_options_parse_count(optarg, &vertices)) {
        return supine_options_usage(name, "--vertices takes a whole number, not '%s'", optarg);
      }
      break;
    case 'v':
      if (!supine_options_parse_number(optarg, &volume)) {
        return supine_options_usage(name, "--volume takes millilitres, not '%s'", optarg);
      }
      break;
    case 'h':
      (void)fputs(help, stdout);
      return supine_options_finish(name);
    default:
      return supine_options_bad_option(name, options, option, argv);
    }
  }
  if (optind < argc) {
    return supine_options_usage(name, "no argument '%s' is expected", argv[optind]);
  }
  if (path == NULL) {
    return supine_options_usage(name, "-o FILE is missing");
  }
  if (!supine_mesh_save_supports(path)) {
    return supine_options_usage(name, "%s: the name must end in .ply, .obj, .stl or .vtp", path);
  }
  supine_mesh mesh = {0};
  supine_error error;
  int result = SUPINE_EXIT_OK;
  const supine_mesh_save_options save = {.comment =
                                             "made lungs, mm; shape after Chaste's lung test "
                                             "data (BSD-3-Clause, University of Oxford)"};
  if (supine_phantom_create(vertices, volume, &mesh, &error) != SUPINE_OK ||
      supine_mesh_save(path, &mesh, &save, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
  } else {
    (void)printf("%s: two lungs, %zu vertices, %zu triangles, %.1f mL\n", path, mesh.vertex_count,
                 mesh.triangle_count, 1e-3 * supine_mesh_volume(&mesh));
    result = supine_options_finish(name);
  }
  supine_mesh_free(&mesh);
  return result;
}
