/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Volumes on the command line. */
#include <stdlib.h>
#include <string.h>

#include "program/options/basis_input.h"
#include "program/options/volume.h"

static const double unknown_rest_breath = 500.0; /* mL above a surface of which nothing is known */
static const double least_of_full = 0.1;         /* tissue alone: nothing is emptier */
static const double most_of_full = 1.2;
static const double folded_limit = 0.01; /* of the triangles: the surface is no lung's any more */

const supine_option supine_options_folds[] = {
    {"allow-folds", 0, NULL,
     "also volumes below a tenth or above 1.2 of full inflation, and surfaces of which more than 1 "
     "% of the triangles turn over",
     .kind = SUPINE_OPTION_FLAG, .size = sizeof(bool)},
    {.name = NULL}};

const supine_option supine_options_volume[] = {
    {"volume", 0, "VOLUME",
     SUPINE_VOLUME_HELP "\nleft=VOLUME,right=VOLUME: lung by lung, all named",
     SUPINE_FILLS(supine_volume_options, text), .rivals = "breath"},
    {.table = supine_options_folds, SUPINE_FILLS(supine_volume_options, allow_folds)},
    {.name = NULL}};

bool supine_options_volume_parse(const char *text, supine_volume *volume) {
  static const struct {
    const char *name;
    supine_volume_kind from;
  } states[] = {{"rest", SUPINE_VOLUME_REST}, {"full", SUPINE_VOLUME_FULL}};
  for (size_t i = 0; i < sizeof states / sizeof *states; ++i) {
    const size_t length = strlen(states[i].name);
    if (strncmp(text, states[i].name, length) == 0) {
      const char *offset = text + length;
      *volume = (supine_volume){.kind = states[i].from};
      return *offset == '\0' || ((*offset == '+' || *offset == '-') &&
                                 supine_options_parse_number(offset, &volume->ml));
    }
  }
  volume->kind = SUPINE_VOLUME_SCAN;
  return supine_options_parse_number(text, &volume->ml);
}

supine_volume supine_options_volume_default(const supine_basis *basis) {
  return supine_basis_get_info(basis)->resting_volume != NULL
             ? (supine_volume){SUPINE_VOLUME_REST, 0.0}
             : (supine_volume){SUPINE_VOLUME_SCAN, unknown_rest_breath};
}

double supine_options_volume_of(const supine_basis *basis, const supine_volume *volume,
                                const double gravity[3]) {
  double state = 0.0; /* full, or the surface of a file that knows no rest */
  if (volume->kind == SUPINE_VOLUME_REST) {
    (void)supine_basis_resting_volume(basis, gravity, &state);
  } else if (volume->kind == SUPINE_VOLUME_SCAN) {
    state = supine_basis_get_info(basis)->scan_volume;
  }
  return state + volume->ml;
}

void supine_options_volume_reference(const supine_basis *basis, double *volumes) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  memset(volumes, 0, info->lung_count * sizeof *volumes);
  const char *stated = supine_basis_metadata(basis, "reference_volume_ml");
  if (supine_basis_metadata(basis, "content") != NULL && stated != NULL &&
      supine_options_parse_numbers(stated, info->lung_count, volumes)) {
    return; /* what is inside has not the lungs' surface */
  }
  for (size_t t = 0; t < info->triangle_count; ++t) {
    const uint32_t *corner = info->triangles + 3 * t;
    size_t lung = 0;
    while (corner[0] >= info->lung_begin[lung + 1]) {
      ++lung;
    }
    const float *origin = info->vertices + 3 * info->lung_begin[lung];
    double p[3][3];
    for (size_t i = 0; i < 9; ++i) {
      p[i / 3][i % 3] =
          (double)info->vertices[3 * (size_t)corner[i / 3] + i % 3] - (double)origin[i % 3];
    }
    for (size_t i = 0; i < 3; ++i) {
      const size_t j = (i + 1) % 3;
      const size_t k = (i + 2) % 3;
      volumes[lung] += 1e-3 / 6.0 * p[0][i] * (p[1][j] * p[2][k] - p[1][k] * p[2][j]);
    }
  }
}

/* The lung that a piece "NAME=..." names, or lung_count. */
static size_t named_lung(const supine_basis_info *info, const char *piece, size_t length) {
  size_t lung = 0;
  while (lung < info->lung_count && (strlen(info->lung_names[lung]) != length ||
                                     strncmp(piece, info->lung_names[lung], length) != 0)) {
    ++lung;
  }
  return lung;
}

/* "left=rest,right=rest+300" into wishes for every lung; false where it is anything else, or a lung
 * is not named. */
static bool parse_lungs(const supine_basis_info *info, const char *text, supine_volume *wishes) {
  bool named[SUPINE_LUNGS_MAX] = {false};
  for (const char *at = text;;) {
    const size_t length = strcspn(at, "=,");
    const size_t lung = named_lung(info, at, length);
    if (at[length] != '=' || lung == info->lung_count) {
      return false;
    }
    const char *value = at + length + 1;
    const size_t size = strcspn(value, ",");
    char one[64];
    (void)snprintf(one, sizeof one, "%.*s", (int)size, value);
    if (size >= sizeof one || !supine_options_volume_parse(one, &wishes[lung])) {
      return false;
    }
    named[lung] = true;
    if (value[size] == '\0') {
      break;
    }
    at = value + size + 1;
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    if (!named[lung]) {
      return false;
    }
  }
  return true;
}

/* One scale for all lungs. */
static supine_status common_scale(const supine_basis *basis, const supine_volume *wish,
                                  const double gravity[3], const double *weights, double *scales,
                                  supine_error *error) {
  const double volume = supine_options_volume_of(basis, wish, gravity);
  const supine_status status = supine_basis_scale(basis, weights, volume, &scales[0], error);
  for (size_t lung = 1; lung < supine_basis_get_info(basis)->lung_count; ++lung) {
    scales[lung] = scales[0];
  }
  return status;
}

/* Lung by lung. What one lung holds at rest is what it holds when all rest together; its part of
 * the scan likewise. */
static supine_status lung_scales(const supine_basis *basis, const supine_volume *wishes,
                                 const double gravity[3], const double *weights, double *scales,
                                 supine_error *error) {
  supine_status status = SUPINE_OK;
  for (size_t lung = 0; lung < supine_basis_get_info(basis)->lung_count && status == SUPINE_OK;
       ++lung) {
    const supine_volume state = {wishes[lung].kind, 0.0};
    double together[SUPINE_LUNGS_MAX];
    status = common_scale(basis, &state, gravity, weights, together, error);
    if (status == SUPINE_OK) {
      const double volume =
          supine_basis_lung_volume(basis, lung, weights, together[lung]) + wishes[lung].ml;
      status = supine_basis_lung_scale(basis, lung, weights, volume, &scales[lung], error);
    }
  }
  return status;
}

/* Fails with what is wrong where that is `strict`; else says it. */
static supine_status say_or_fail(const supine_error *wrong, const char *command, bool strict,
                                 supine_error *error) {
  if (strict) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL, "%s; --allow-folds does it all the same",
                            wrong->message);
  }
  supine_options_say(command, "%s", wrong->message);
  return SUPINE_OK;
}

static supine_status check_folds(const supine_basis *basis, const char *command, bool strict,
                                 const double *weights, const double *scales, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_mesh mesh = {0};
  float *xyz = malloc(3 * info->vertex_count * sizeof *xyz);
  double *moved = malloc(3 * info->vertex_count * sizeof *moved);
  supine_status status = SUPINE_OK;
  if (xyz == NULL || moved == NULL || supine_options_basis_rest_mesh(basis, &mesh) != SUPINE_OK) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  } else {
    supine_deform(basis, weights, scales, xyz);
    for (size_t i = 0; i < 3 * info->vertex_count; ++i) {
      moved[i] = (double)xyz[i];
    }
    const double turned = supine_mesh_turned_over(&mesh, moved);
    if (turned > folded_limit) {
      supine_error wrong;
      (void)supine_error_set(&wrong, SUPINE_ERROR_NUMERICAL,
                             "the surface folds: %.3g %% of its triangles turn over",
                             100.0 * turned);
      status = say_or_fail(&wrong, command, strict, error);
    }
  }
  supine_mesh_free(&mesh);
  free(xyz);
  free(moved);
  return status;
}

supine_status supine_options_volume_check(const supine_basis *basis, const char *command,
                                          bool allow_folds, const double *weights,
                                          const double *scales, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const bool known = info->resting_volume != NULL;
  const bool strict = known && !allow_folds;
  double reference[SUPINE_LUNGS_MAX];
  double full = 0.0;
  double volume = 0.0;
  supine_options_volume_reference(basis, reference);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    full += reference[lung];
    volume += supine_basis_lung_volume(basis, lung, weights, scales[lung]);
  }
  const double share = 1.0 + volume / full;
  supine_status status = SUPINE_OK;
  if (known && !(share >= least_of_full && share <= most_of_full)) {
    supine_error wrong;
    (void)supine_error_set(
        &wrong, SUPINE_ERROR_NUMERICAL,
        "%.0f mL are %.0f %% of full inflation (%.0f mL): lungs hold %.0f to %.0f %%",
        full + volume, 100.0 * share, full, 100.0 * least_of_full, 100.0 * most_of_full);
    status = say_or_fail(&wrong, command, strict, error);
  }
  return status != SUPINE_OK ? status : check_folds(basis, command, strict, weights, scales, error);
}

int supine_options_volume_scales(const supine_basis *basis, const char *command,
                                 const supine_volume_options *wanted, const double gravity[3],
                                 const double *weights, double *scales) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_volume wishes[SUPINE_LUNGS_MAX] = {supine_options_volume_default(basis)};
  supine_error error = {SUPINE_ERROR_OPEN_SURFACE,
                        "the surface is open and encloses no volume: close the mesh before "
                        "'supine precompute', or give --scale MM instead of a volume"};
  if (!info->has_volume) {
    return supine_options_fail(command, &error);
  }
  const bool one = wanted->text == NULL || supine_options_volume_parse(wanted->text, wishes);
  if (!one && !parse_lungs(info, wanted->text, wishes)) {
    return supine_options_usage(
        command,
        "--volume takes rest, full, rest+ML, or mL relative to the scan, or "
        "LUNG=VOLUME,... for every lung of the file (%s); not '%s'",
        supine_basis_metadata(basis, "lungs") != NULL ? supine_basis_metadata(basis, "lungs")
                                                      : "numbered from 0",
        wanted->text);
  }
  supine_status status = one ? common_scale(basis, wishes, gravity, weights, scales, &error)
                             : lung_scales(basis, wishes, gravity, weights, scales, &error);
  if (status == SUPINE_OK) {
    status =
        supine_options_volume_check(basis, command, wanted->allow_folds, weights, scales, &error);
  }
  return status != SUPINE_OK ? supine_options_fail(command, &error) : SUPINE_EXIT_OK;
}
