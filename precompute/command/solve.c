/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine solve: the full physics for one direction of gravity. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/tissue/disease.h"
#include "sh/base/output.h"
#include <supine/volume.h>

#include "precompute/command/model_options.h"
#include "runtime/options/orientation.h"

static const char name[] = "solve";

static const char help[] =
    "Usage: supine solve MESH... --posture NAME -o FILE [OPTIONS]\n"
    "\n"
    "Runs the full physics for one direction of gravity, without any harmonics, and writes the\n"
    "deformed surface: the reference that a basis is measured against.\n"
    "\n"
    "  -o, --output FILE    .ply, .obj, .stl or .vtp; PLY and VTP carry the displacement\n"
    "  --volume ML          air above the resting volume, both lungs together; may be negative\n"
    "  --scale MM           largest displacement instead, mm; negative: the other way. Default:\n"
    "                       F d as it is, F what a vertex catches of the force, d in mm\n"
    "  --unit-force VERTEX  instead of a posture: the response of every vertex to a unit force on\n"
    "                       this one (from 0), a column of the transfer matrix T, as CSV\n"
    "\n";

static const char examples[] =
    "\n"
    "Examples:\n"
    "  supine solve left.ply right.ply --posture prone --volume 500 -o prone.vtp\n"
    "  supine solve lungs.ply --unit-force 0 -o column.csv\n";

typedef struct request {
  supine_model_options model;
  supine_orientation orientation;
  const char *path;
  bool has_volume, has_scale, has_vertex;
  double volume, scale;
  size_t vertex;
} request;

/* Writes one column of T as CSV. */
static supine_status write_column(const supine_lungs *lungs, const request *wanted,
                                  supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  supine_network *network = NULL;
  supine_equilibrium *equilibrium = NULL;
  supine_output output = {0};
  double *column = malloc(n * sizeof *column);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (column == NULL || supine_physics_lungs_network(lungs, &network) != SUPINE_OK ||
      supine_physics_equilibrium_create(network, 1, 0, &equilibrium) != SUPINE_OK) {
    (void)supine_error_set(error, status, "no memory for %zu vertices", n);
    goto cleanup;
  }
  status =
      supine_physics_equilibrium_set_stiffness(equilibrium, wanted->model.model.stiffness, error);
  if (status == SUPINE_OK) {
    status = supine_physics_transfer_column(equilibrium, wanted->vertex, column, error);
  }
  if (status == SUPINE_OK) {
    status = supine_output_open(wanted->path, &output, error);
  }
  if (status == SUPINE_OK) {
    (void)fputs("vertex,x_mm,y_mm,z_mm,response\n", output.file);
    for (size_t i = 0; i < n; ++i) {
      const double *p = lungs->mesh.vertices + 3 * i;
      (void)fprintf(output.file, "%zu,%.9g,%.9g,%.9g,%.17g\n", i, p[0], p[1], p[2], column[i]);
    }
    status = supine_output_commit(&output, error);
  }
cleanup:
  supine_physics_equilibrium_destroy(equilibrium);
  supine_physics_network_destroy(network);
  free(column);
  return status;
}

static supine_status write_solution(const supine_lungs *lungs, const request *wanted,
                                    const double g[3], supine_error *error) {
  supine_solution solution = {0};
  supine_mesh deformed = lungs->mesh;
  supine_mesh rest = lungs->mesh;
  double scale = 1.0;
  deformed.vertices = NULL;
  rest.vertices = NULL;
  supine_status status = supine_physics_solve(lungs, &wanted->model.model, g, &solution, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  if (wanted->has_volume) {
    if (!solution.has_volume) {
      status = supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                                "--volume needs a closed surface: close it, or give --scale");
      goto cleanup;
    }
    status = supine_volume_scale(solution.cubic, wanted->volume, &scale, error);
    if (status != SUPINE_OK) {
      goto cleanup;
    }
  }
  const double largest = supine_physics_solution_largest(&solution);
  if (wanted->has_scale && !(largest > 0.0)) {
    status = supine_error_set(error, SUPINE_ERROR_NUMERICAL, "nothing moves in this direction");
    goto cleanup;
  }
  scale = wanted->has_scale ? wanted->scale / largest : scale;
  deformed.vertices = malloc(3 * deformed.vertex_count * sizeof(double));
  rest.vertices = malloc(3 * rest.vertex_count * sizeof(double));
  if (deformed.vertices == NULL || rest.vertices == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices",
                              deformed.vertex_count);
    goto cleanup;
  }
  supine_tissue_rest(lungs, rest.vertices);
  supine_physics_solution_apply(&solution, &rest, scale, deformed.vertices);
  const supine_mesh_save_options save = {.rest = rest.vertices};
  status = supine_mesh_save(wanted->path, &deformed, &save, error);
  if (status == SUPINE_OK) {
    (void)printf("%s: gravity %.4g,%.4g,%.4g, scale %.6g, largest displacement %.3f mm",
                 wanted->path, g[0], g[1], g[2], scale, fabs(scale) * largest);
    if (solution.has_volume) {
      (void)printf(", %+.2f mL",
                   1e-3 * (supine_mesh_volume(&deformed) - supine_mesh_volume(&rest)));
    }
    (void)printf("; %zu steps to residual %.1e\n", solution.report.iterations,
                 solution.report.residual);
  }
cleanup:
  free(deformed.vertices);
  free(rest.vertices);
  supine_physics_solution_free(&solution);
  return status;
}

static int run(request *wanted, char **paths, size_t count) {
  double g[3] = {0.0, 0.0, 0.0};
  int result = SUPINE_EXIT_OK;
  if (!wanted->has_vertex) {
    result = supine_options_orientation_finish(&wanted->orientation, name, g);
  }
  supine_lungs lungs = {0};
  if (result == SUPINE_EXIT_OK) {
    result = supine_command_model_load(&wanted->model, name, paths, count, &lungs);
  }
  if (result == SUPINE_EXIT_OK) {
    supine_error error;
    const supine_status status = wanted->has_vertex ? write_column(&lungs, wanted, &error)
                                                    : write_solution(&lungs, wanted, g, &error);
    result = status == SUPINE_OK ? supine_options_finish(name) : supine_options_fail(name, &error);
  }
  supine_lungs_free(&lungs);
  supine_command_model_options_free(&wanted->model);
  return result;
}

int supine_command_solve(int argc, char **argv) {
  enum { VOLUME = OPTION_MODEL_END, SCALE, UNIT_FORCE };
  static const struct option options[] = {{"output", required_argument, NULL, 'o'},
                                          {"volume", required_argument, NULL, VOLUME},
                                          {"scale", required_argument, NULL, SCALE},
                                          {"unit-force", required_argument, NULL, UNIT_FORCE},
                                          SUPINE_ORIENTATION_OPTIONS,
                                          SUPINE_MODEL_OPTIONS,
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
  request wanted = {.model = supine_command_model_options_default()};
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":o:h", options, NULL)) != -1) {
    int result = SUPINE_EXIT_OK;
    switch (option) {
    case 'o':
      wanted.path = optarg;
      break;
    case VOLUME:
      wanted.has_volume = supine_options_parse_number(optarg, &wanted.volume);
      if (!wanted.has_volume) {
        result = supine_options_usage(name, "--volume takes millilitres, not '%s'", optarg);
      }
      break;
    case SCALE:
      wanted.has_scale = supine_options_parse_number(optarg, &wanted.scale);
      if (!wanted.has_scale) {
        result = supine_options_usage(name, "--scale takes millimetres, not '%s'", optarg);
      }
      break;
    case UNIT_FORCE:
      wanted.has_vertex = supine_options_parse_count(optarg, &wanted.vertex);
      if (!wanted.has_vertex) {
        result = supine_options_usage(name, "--unit-force takes a vertex, not '%s'", optarg);
      }
      break;
    case OPTION_POSTURE:
    case OPTION_GRAVITY:
    case OPTION_QUATERNION:
    case OPTION_TILT:
      result = supine_options_orientation_take(&wanted.orientation, name, option, optarg);
      break;
    case 'h':
      (void)fputs(help, stdout);
      (void)fputs(supine_options_orientation_help, stdout);
      (void)fputc('\n', stdout);
      (void)fputs(supine_command_model_options_help, stdout);
      (void)fputs(examples, stdout);
      return supine_options_finish(name);
    case '?':
    case ':':
      return supine_options_bad_option(name, options, option, argv);
    default:
      result = supine_command_model_options_take(&wanted.model, name, option, optarg);
    }
    if (result != SUPINE_EXIT_OK) {
      return result;
    }
  }
  if (optind == argc) {
    return supine_options_usage(name, "which surface? Name one or more mesh files");
  }
  if (wanted.path == NULL) {
    return supine_options_usage(name, "-o FILE is missing");
  }
  if (!wanted.has_vertex && !supine_mesh_save_supports(wanted.path)) {
    return supine_options_usage(name, "%s: the name must end in .ply, .obj, .stl or .vtp",
                                wanted.path);
  }
  if (wanted.has_volume && wanted.has_scale) {
    return supine_options_usage(name, "give --volume or --scale, not both");
  }
  return run(&wanted, argv + optind, (size_t)(argc - optind));
}
