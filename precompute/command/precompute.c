/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine precompute: lung surfaces in, basis file out. */
#include <stdlib.h>
#include <string.h>

#include <supine/sh.h>

#include "precompute/command/model_options.h"

static const char name[] = "precompute";

static const char help[] =
    "Usage: supine precompute MESH... -o FILE [OPTIONS]\n"
    "\n"
    "Solves the physics of one or two lungs for every direction of gravity at once and writes a\n"
    "basis file, which 'supine deform' and the run-time library turn into deformed lungs in real\n"
    "time. Both lungs may be in one file or in two; any surface that assimp reads will do (PLY,\n"
    "OBJ, STL, OFF, ...). Closed surfaces can be asked for exact volumes later.\n"
    "\n"
    "  -o, --output FILE    basis file (safetensors)\n"
    "  --band L             highest spherical-harmonic band, 0 to 64; default 23\n"
    "  --modes K|harmonics  functions of orientation, and so multiplications per vertex, at run\n"
    "                       time: the best K of the band (default 16, fewer where fewer do), or\n"
    "                       the (L+1)^2 harmonics themselves. The paper's form is\n"
    "                       --band 3 --modes harmonics\n"
    "  --route ROUTE        linear: a few solves for all directions, exact while --soften is 0\n"
    "                       (default there); sampled: a solve for each direction of a grid\n"
    "  --held-out N         directions that the error is measured on; default 100 to 1000\n"
    "\n"
    "Instead of the built-in physics, fields that another simulator computed:\n"
    "  --fields LIST        CSV with the columns gx,gy,gz,file: directions of gravity and the "
    "same\n"
    "                       surface deformed; or a safetensors file with gravity [M,3] and\n"
    "                       displacement [M,N,3]. MESH is the rest surface. The highest band that\n"
    "                       the directions determine and cross-validation favours is taken,\n"
    "                       unless --band names one\n"
    "  --kind vector|scalar keep three components (default), or magnitude x best direction, a "
    "third\n"
    "                       of the size, with the loss stated\n"
    "\n";

static const char examples[] =
    "\n"
    "Examples:\n"
    "  supine precompute left.ply right.ply -o lungs.safetensors\n"
    "  supine precompute lungs.stl --axes RAS --units cm -o lungs.safetensors\n";

/* Share of turned triangles that is worth a word. */
static const double turned_over_limit = 0.01;

static void report_result(const char *path, const supine_lungs *lungs,
                          const supine_precompute_options *options,
                          const supine_precompute_report *report) {
  const supine_accuracy *accuracy = &report->accuracy;
  (void)printf("%s: %s, %zu vertices, band %zu, %zu %s\n", path,
               lungs->lung_count == 2 ? "two lungs" : "one lung", lungs->mesh.vertex_count,
               options->band, report->mode_count, options->modes == 0 ? "harmonics" : "modes");
  (void)printf("error against the full solve, on %zu directions that no grid used:\n"
               "  %.3g %% RMS, %.3g %% 95th percentile, %.3g %% largest, of the RMS displacement\n",
               accuracy->direction_count, 100.0 * accuracy->relative_rms,
               100.0 * accuracy->relative_p95, 100.0 * accuracy->relative_max);
  if (accuracy->volume > 0.0) {
    (void)printf("  %.3g mm RMS, %.3g mm 95th percentile, %.3g mm largest, at %g mL\n",
                 accuracy->rms_mm, accuracy->p95_mm, accuracy->max_mm, accuracy->volume);
  }
  if (report->turned_over > turned_over_limit) {
    (void)printf(
        "the surface looks torn: %.3g %% of its triangles turn over at %g mL in the worst of "
        "six\npostures. %s\n",
        100.0 * report->turned_over, accuracy->volume,
        lungs->reach == 0.0
            ? "The paper's forces spread over a few links, however short they are;\n"
              "--reach 10 spreads them over 10 mm and leaves next to none"
            : "A longer --reach spreads forces further");
  }
}

/* What the directions of a fit can and cannot carry. */
static void report_fit(const char *path, const supine_fields *fields, const supine_fit_report *fit,
                       size_t mode_count, bool scalar) {
  const size_t highest = fit->band_highest;
  (void)printf("%s: %s field of %zu vertices from %zu %s directions, band %zu, %zu modes\n", path,
               scalar ? "scalar" : "vector", fields->vertex_count, fields->direction_count,
               fit->grid ? "gridded" : "scattered", fit->band, mode_count);
  (void)printf("the directions determine bands up to %zu (%zu harmonics); leave-one-out error:\n",
               highest, (highest + 1) * (highest + 1));
  for (size_t band = 0; band <= highest; ++band) {
    (void)printf("  band %-2zu  %8.3g %%%s\n", band, 100.0 * fit->error[band],
                 band == fit->band ? "  <- taken" : "");
  }
  (void)printf("condition of the harmonics at these directions: %.3g\n", fit->condition);
  if (fit->band == highest && highest < SUPINE_FIT_BAND_MAX) {
    (void)printf("the error still falls there: detail beyond band %zu is not carried; some %zu\n"
                 "directions, evenly spread, would reach band %zu\n",
                 highest, 2 * (highest + 2) * (highest + 2), highest + 1);
  }
  if (scalar) {
    (void)printf("one direction a vertex loses %.3g %% RMS of the displacement\n",
                 100.0 * fit->scalar_loss);
  }
  (void)printf("error of the basis, each direction predicted from the others:\n"
               "  %.3g %% RMS, %.3g %% 95th percentile, %.3g %% largest, of the RMS displacement\n"
               "  %.3g mm RMS, %.3g mm 95th percentile, %.3g mm largest\n",
               100.0 * fit->accuracy.relative_rms, 100.0 * fit->accuracy.relative_p95,
               100.0 * fit->accuracy.relative_max, fit->accuracy.rms_mm, fit->accuracy.p95_mm,
               fit->accuracy.max_mm);
}

static int compress_fields(const supine_lungs *lungs, const char *list,
                           const supine_mesh_load_options *load, const supine_fit_options *options,
                           const char *made_by, const char *path) {
  supine_fields fields = {0};
  supine_fit_report report;
  size_t mode_count = 0;
  supine_error error;
  int result = SUPINE_EXIT_OK;
  if (supine_fields_load(list, lungs, load, &fields, &error) != SUPINE_OK ||
      supine_precompute_fields(lungs, &fields, options, made_by, path, &report, &mode_count,
                               &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
  } else {
    report_fit(path, &fields, &report, mode_count, options->scalar);
    result = supine_options_finish(name);
  }
  supine_fields_free(&fields);
  return result;
}

int supine_command_precompute(int argc, char **argv) {
  enum { BAND = OPTION_MODEL_END, MODES, ROUTE, HELD_OUT, FIELDS, KIND };
  static const struct option options[] = {{"output", required_argument, NULL, 'o'},
                                          {"band", required_argument, NULL, BAND},
                                          {"modes", required_argument, NULL, MODES},
                                          {"route", required_argument, NULL, ROUTE},
                                          {"held-out", required_argument, NULL, HELD_OUT},
                                          {"fields", required_argument, NULL, FIELDS},
                                          {"kind", required_argument, NULL, KIND},
                                          SUPINE_MODEL_OPTIONS,
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
  supine_model_options model = supine_command_model_options_default();
  supine_precompute_options wanted = {.band = 23, .modes = 16};
  supine_fit_options fit = {.band = -1};
  const char *path = NULL;
  const char *fields = NULL;
  char made_by[512];
  supine_options_describe(argc, argv, made_by, sizeof made_by);
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":o:h", options, NULL)) != -1) {
    int result = SUPINE_EXIT_OK;
    switch (option) {
    case 'o':
      path = optarg;
      break;
    case BAND:
      if (!supine_options_parse_count(optarg, &wanted.band) || wanted.band > SUPINE_SH_BAND_MAX) {
        result = supine_options_usage(name, "--band takes 0 to %d, not '%s'", SUPINE_SH_BAND_MAX,
                                      optarg);
      }
      fit.band = (int)wanted.band;
      break;
    case MODES:
      if (strcmp(optarg, "harmonics") == 0) {
        wanted.modes = 0;
      } else if (!supine_options_parse_count(optarg, &wanted.modes) || wanted.modes < 1 ||
                 wanted.modes > SUPINE_MODES_MADE_MAX) {
        result = supine_options_usage(name, "--modes takes 1 to %d or 'harmonics', not '%s'",
                                      SUPINE_MODES_MADE_MAX, optarg);
      }
      break;
    case FIELDS:
      fields = optarg;
      break;
    case KIND:
      if (strcmp(optarg, "vector") == 0 || strcmp(optarg, "scalar") == 0) {
        fit.scalar = optarg[0] == 's';
      } else {
        result = supine_options_usage(name, "--kind takes vector or scalar, not '%s'", optarg);
      }
      break;
    case ROUTE:
      if (strcmp(optarg, "linear") == 0 || strcmp(optarg, "sampled") == 0) {
        wanted.route = optarg[0] == 'l' ? SUPINE_ROUTE_LINEAR : SUPINE_ROUTE_SAMPLED;
      } else {
        result = supine_options_usage(name, "--route takes linear or sampled, not '%s'", optarg);
      }
      break;
    case HELD_OUT:
      if (!supine_options_parse_count(optarg, &wanted.held_out) || wanted.held_out < 1 ||
          wanted.held_out > 100000) {
        result = supine_options_usage(name, "--held-out takes 1 to 100000, not '%s'", optarg);
      }
      break;
    case 'h':
      (void)fputs(help, stdout);
      (void)fputs(supine_command_model_options_help, stdout);
      (void)fputs(examples, stdout);
      return supine_options_finish(name);
    case '?':
    case ':':
      return supine_options_bad_option(name, options, option, argv);
    default:
      result = supine_command_model_options_take(&model, name, option, optarg);
    }
    if (result != SUPINE_EXIT_OK) {
      return result;
    }
  }
  if (optind == argc) {
    return supine_options_usage(name, "which surface? Name one or more mesh files");
  }
  if (path == NULL) {
    return supine_options_usage(name, "-o FILE is missing");
  }
  supine_lungs lungs = {0};
  int result =
      supine_command_model_load(&model, name, argv + optind, (size_t)(argc - optind), &lungs);
  if (result == SUPINE_EXIT_OK && fields != NULL) {
    fit.modes = wanted.modes;
    result = compress_fields(&lungs, fields, &model.load, &fit, made_by, path);
  } else if (result == SUPINE_EXIT_OK) {
    supine_progress progress = supine_options_progress_begin("precompute");
    supine_precompute_report report;
    supine_error error;
    wanted.model = model.model;
    wanted.made_by = made_by;
    wanted.progress = supine_options_progress_step;
    wanted.progress_context = &progress;
    supine_options_interrupts_catch();
    const supine_status status = supine_precompute(&lungs, &wanted, path, &report, &error);
    supine_options_progress_end(&progress);
    if (status != SUPINE_OK) {
      result = supine_options_fail(name, &error);
    } else {
      report_result(path, &lungs, &wanted, &report);
      result = supine_options_finish(name);
    }
  }
  supine_lungs_free(&lungs);
  supine_command_model_options_free(&model);
  return result;
}
