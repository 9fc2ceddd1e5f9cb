/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What commands that read a basis share. */
#include <stdlib.h>
#include <string.h>

#include "runtime/options/basis_input.h"

static const double default_volume = 500.0; /* mL */

supine_status supine_options_basis_rest_mesh(const supine_basis *basis, supine_mesh *mesh) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const float *vertices = supine_basis_vertices(basis);
  supine_mesh made = {.vertex_count = info->vertex_count, .triangle_count = info->triangle_count};
  made.vertices = malloc(3 * info->vertex_count * sizeof *made.vertices);
  made.triangles = malloc(3 * info->triangle_count * sizeof *made.triangles);
  if (made.vertices == NULL || made.triangles == NULL) {
    supine_mesh_free(&made);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t i = 0; i < 3 * info->vertex_count; ++i) {
    made.vertices[i] = (double)vertices[i];
  }
  memcpy(made.triangles, supine_basis_triangles(basis),
         3 * info->triangle_count * sizeof *made.triangles);
  *mesh = made;
  return SUPINE_OK;
}

void supine_options_basis_lung_name(const supine_basis *basis, size_t lung, char *text,
                                    size_t size) {
  (void)snprintf(text, size, "%s", supine_basis_get_info(basis)->lung_names[lung]);
}

/* The lung that a piece "NAME=ML" names, or lung_count. */
static size_t named_lung(const supine_basis *basis, const char *piece, size_t length) {
  const size_t count = supine_basis_get_info(basis)->lung_count;
  for (size_t lung = 0; lung < count; ++lung) {
    const char *text = supine_basis_get_info(basis)->lung_names[lung];
    if (strlen(text) == length && strncmp(piece, text, length) == 0) {
      return lung;
    }
  }
  return count;
}

/* "left=200,right=300" into volumes; false where it is anything else. */
static bool parse_lung_volumes(const supine_basis *basis, const char *text, double *volumes) {
  for (const char *at = text;; ++at) {
    char number[64];
    const size_t name = strcspn(at, "=,");
    const size_t lung = named_lung(basis, at, name);
    const size_t digits = at[name] == '=' ? strcspn(at + name + 1, ",") : 0;
    (void)snprintf(number, sizeof number, "%.*s", (int)digits, at + name + 1);
    if (digits == 0 || digits >= sizeof number ||
        lung == supine_basis_get_info(basis)->lung_count ||
        !supine_options_parse_number(number, &volumes[lung])) {
      return false;
    }
    at += name + 1 + digits;
    if (*at == '\0') {
      return true;
    }
  }
}

int supine_options_basis_volume_scales(const supine_basis *basis, const char *command,
                                       const double *weights, const char *volume, double *scales) {
  const size_t count = supine_basis_get_info(basis)->lung_count;
  double volumes[SUPINE_LUNGS_MAX] = {0.0};
  supine_error error = {SUPINE_ERROR_OPEN_SURFACE,
                        "the surface is open and encloses no volume: close the mesh before "
                        "'supine precompute', or give --scale MM instead of a volume"};
  if (!supine_basis_get_info(basis)->has_volume) {
    return supine_options_fail(command, &error);
  }
  double total = default_volume;
  if (volume == NULL || supine_options_parse_number(volume, &total)) {
    if (supine_basis_scale(basis, weights, total, &scales[0], &error) != SUPINE_OK) {
      return supine_options_fail(command, &error);
    }
    for (size_t lung = 1; lung < count; ++lung) {
      scales[lung] = scales[0];
    }
    return SUPINE_EXIT_OK;
  }
  if (!parse_lung_volumes(basis, volume, volumes)) {
    return supine_options_usage(command,
                                "--volume takes millilitres, or LUNG=ML,LUNG=ML with the lungs of "
                                "the file (%s); not '%s'",
                                supine_basis_metadata(basis, "lungs") != NULL
                                    ? supine_basis_metadata(basis, "lungs")
                                    : "numbered from 0",
                                volume);
  }
  for (size_t lung = 0; lung < count; ++lung) {
    if (supine_basis_lung_scale(basis, lung, weights, volumes[lung], &scales[lung], &error) !=
        SUPINE_OK) {
      return supine_options_fail(command, &error);
    }
  }
  return SUPINE_EXIT_OK;
}
