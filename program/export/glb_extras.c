/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What a reader of the glTF file needs to set the weights itself. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "program/export/glb.h"

enum { FORMS_MAX = 32 }; /* targets: beyond this their volume forms would outgrow the mesh */

/* "Y_1_-1" where the modes are the harmonics themselves, else "mode_3". */
static json_t *target_names(const export_source *source, const export_targets *targets) {
  const char *modes = supine_basis_metadata(source->basis, "modes");
  const bool harmonics = modes != NULL && strcmp(modes, "harmonics") == 0 && !targets->mixed;
  json_t *names = json_array();
  long l = 0;
  for (size_t j = 0; j < targets->count; ++j) {
    char text[48];
    while ((size_t)((l + 1) * (l + 1)) <= j) {
      ++l;
    }
    if (harmonics) {
      (void)snprintf(text, sizeof text, "Y_%ld_%ld", l, (long)j - l * l - l);
    } else {
      (void)snprintf(text, sizeof text, "mode_%zu", j);
    }
    (void)json_array_append_new(names, json_string(text));
  }
  return names;
}

/* One axis of a form goes from modes to targets: [rows, K, columns] -> [rows, J, columns]. */
static void mix_axis(const export_targets *targets, size_t k, size_t rows, size_t columns,
                     const double *from, double *to) {
  memset(to, 0, rows * targets->count * columns * sizeof *to);
  for (size_t r = 0; r < rows; ++r) {
    for (size_t a = 0; a < k; ++a) {
      for (size_t j = 0; j < targets->count; ++j) {
        const double amount = targets->mix[a * targets->count + j];
        for (size_t c = 0; c < columns; ++c) {
          to[(r * targets->count + j) * columns + c] += amount * from[(r * k + a) * columns + c];
        }
      }
    }
  }
}

/* A form of `rank` axes [G, K, ...] as numbers [G, J, ...]; NULL when memory is short. */
static json_t *form(const export_source *source, const export_targets *targets, size_t rank,
                    const double *values) {
  const size_t k = source->info->mode_count;
  size_t size = source->info->lung_count;
  for (size_t i = 0; i < rank; ++i) {
    size *= k;
  }
  double *from = malloc((size + 1) * sizeof *from);
  double *to = malloc((size + 1) * sizeof *to);
  json_t *numbers = NULL;
  if (from != NULL && to != NULL) {
    memcpy(from, values, size * sizeof *from);
    size_t rows = source->info->lung_count;
    size_t columns = size / rows / k;
    for (size_t i = 0; i < rank; ++i) {
      mix_axis(targets, k, rows, columns, from, to);
      memcpy(from, to, rows * targets->count * columns * sizeof *from);
      rows *= targets->count;
      columns /= i + 1 < rank ? k : 1;
    }
    numbers = supine_export_glb_numbers(from, rows * columns);
  }
  free(from);
  free(to);
  return numbers;
}

static const char weights_text[] =
    "weight[k] = (s * sum over i of modes[k][i] * Y[i](g) - offset[k]) / unit[k]. g: unit vector "
    "of gravity in the patient's axes (x left, y back, z head; supine 0,1,0). Y: real spherical "
    "harmonics, orthonormal, no Condon-Shortley phase, index l*l+l+m, m < 0 the sine terms: "
    "Y[0] = 0.28209479, Y[1..3] = 0.48860251 * (y, z, x). s: breath scale, 0 for the vertices as "
    "they are.";
static const char volume_text[] =
    "mL gained by lung j at breath scale s: c1 s + c2 s^2 + c3 s^3, c1 = sum linear[j][k] v[k], "
    "c2 = sum quadratic[j][k][l] v[k] v[l], c3 = sum cubic[j][k][l][m] v[k] v[l] v[m], with v[k] "
    "= sum over i of modes[k][i] * Y[i](g); arrays are flat, last index fastest. For a volume: "
    "the root s that grows out of 0.";

static const char resting_text[] =
    "mL that all lungs hold at rest beyond the vertices as they are, which are full inflation: the "
    "sum over l <= 2 and m of harmonics[l*l+l+m] * Y[l*l+l+m](g), negative.";

static json_t *lungs(const export_source *source) {
  json_t *array = json_array();
  for (size_t j = 0; j <= source->info->lung_count; ++j) {
    (void)json_array_append_new(array, json_integer((json_int_t)source->info->lung_begin[j]));
  }
  return array;
}

/* All lungs' resting volume over Y_lm. */
static json_t *resting_harmonics(const export_source *source) {
  double sum[EXPORT_RESTING_TERMS] = {0};
  for (size_t i = 0; i < source->resting_rows * EXPORT_RESTING_TERMS; ++i) {
    sum[i % EXPORT_RESTING_TERMS] += source->resting[i];
  }
  return supine_export_glb_numbers(sum, EXPORT_RESTING_TERMS);
}

/* Keys of the basis' metadata that go along. */
static json_t *origin(const export_source *source) {
  static const char *const keys[] = {
      "lungs",       "made_by",          "force", "direction", "direction_constants", "stiffness",
      "attribution", "error_rms_percent"};
  json_t *object = json_object();
  for (size_t i = 0; i < sizeof keys / sizeof *keys; ++i) {
    const char *value = supine_basis_metadata(source->basis, keys[i]);
    if (value != NULL) {
      (void)json_object_set_new(object, keys[i], json_string(value));
    }
  }
  return object;
}

json_t *supine_export_glb_extras(const export_source *source, const export_glb_options *options,
                                 const export_targets *targets) {
  const size_t count = targets->count;
  json_t *modes = json_array();
  for (size_t j = 0; j < count; ++j) {
    (void)json_array_append_new(
        modes, supine_export_glb_numbers(targets->modes + j * source->terms, source->terms));
  }
  json_t *supine = json_pack(
      "{s:s, s:i, s:o, s:o, s:o, s:o, s:o, s:f, s:f, s:s}", "weights", weights_text, "band",
      (int)source->info->band, "modes", modes, "offset",
      supine_export_glb_numbers(targets->offset, count), "unit",
      supine_export_glb_numbers(targets->unit, count), "lungBegin", lungs(source), "basis",
      origin(source), "millimetresPerUnit", targets->count_mm, "lossPercent", targets->loss_percent,
      "frame",
      "vertices are in the patient's axes, LPS; the node 'lungs' turns and scales them to metres, "
      "y to the head, z to the front");
  if (source->info->has_volume) {
    (void)json_object_set_new(supine, "breathVolume", json_real(options->breath.volume));
  } else {
    (void)json_object_set_new(supine, "breathScale", json_real(options->breath.scale));
  }
  if (source->info->has_rest) {
    (void)json_object_set_new(
        supine, "restingVolume",
        json_pack("{s:s, s:o}", "text", resting_text, "harmonics", resting_harmonics(source)));
  }
  if (source->info->has_volume && count <= FORMS_MAX &&
      json_object_set_new(supine, "volume",
                          json_pack("{s:s, s:o, s:o, s:o}", "text", volume_text, "linear",
                                    form(source, targets, 1, source->linear), "quadratic",
                                    form(source, targets, 2, source->quadratic), "cubic",
                                    form(source, targets, 3, source->cubic))) != 0) {
    json_decref(supine);
    return NULL;
  }
  return json_pack("{s:o, s:o}", "targetNames", target_names(source, targets), "supine", supine);
}
