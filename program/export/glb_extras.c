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
  const bool harmonics = modes != NULL && strcmp(modes, "harmonics") == 0 && !targets->mixed &&
                         targets->count == targets->mixes;
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
      (void)snprintf(text, sizeof text, "%s_%zu", j < targets->mixes ? "mode" : "bend",
                     j % targets->mixes);
    }
    (void)json_array_append_new(names, json_string(text));
  }
  return names;
}

/* One axis of a form goes from modes to mixes: [rows, K, columns] -> [rows, J, columns]. */
static void mix_axis(const export_targets *targets, size_t k, size_t rows, size_t columns,
                     const double *from, double *to) {
  const size_t count = targets->mixes;
  memset(to, 0, rows * count * columns * sizeof *to);
  for (size_t r = 0; r < rows; ++r) {
    for (size_t a = 0; a < k; ++a) {
      for (size_t j = 0; j < count; ++j) {
        const double amount = targets->mix[a * count + j];
        for (size_t c = 0; c < columns; ++c) {
          to[(r * count + j) * columns + c] += amount * from[(r * k + a) * columns + c];
        }
      }
    }
  }
}

/* A form of `rank` axes [rows, K, ...] as numbers [rows, J, ...]; NULL when memory is short. */
static json_t *form(const export_source *source, const export_targets *targets, size_t rows,
                    size_t rank, const double *values) {
  const size_t k = source->info->mode_count;
  size_t columns = 1;
  for (size_t i = 1; i < rank; ++i) {
    columns *= k;
  }
  const size_t size = rows * k * columns;
  double *from = malloc((size + 1) * sizeof *from);
  double *to = malloc((size + 1) * sizeof *to);
  json_t *numbers = NULL;
  if (from != NULL && to != NULL) {
    memcpy(from, values, size * sizeof *from);
    for (size_t i = 0; i < rank; ++i) {
      mix_axis(targets, k, rows, columns, from, to);
      memcpy(from, to, rows * targets->mixes * columns * sizeof *from);
      rows *= targets->mixes;
      columns /= i + 1 < rank ? k : 1;
    }
    numbers = supine_export_glb_numbers(from, rows * columns);
  }
  free(from);
  free(to);
  return numbers;
}

static const char weights_text[] =
    "weight[k] = (s * v[k] - offset[k]) / unit[k], v[k] = sum over i of modes[k][i] * Y[i](g); if "
    "there are twice as many targets, weight[J + k] = (t * v[k] - offset[J + k]) / unit[J + k]. g: "
    "unit vector of gravity in the patient's axes (x left, y back, z head; supine 0,1,0). Y: real "
    "spherical harmonics, orthonormal, no Condon-Shortley phase, index l*l+l+m, m < 0 the sine "
    "terms: Y[0] = 0.28209479, Y[1..3] = 0.48860251 * (y, z, x). s and t: 0 for the vertices as "
    "they are; the displacement along axis a is that of the modes times A[a] = s + t * bend[a].";
static const char volume_text[] =
    "mL gained by lung j: L[a] A[a] + Q[0] A[1] A[2] + Q[1] A[0] A[2] + Q[2] A[0] A[1] + C A[0] "
    "A[1] A[2], summed over the axes a, L[a] = sum linear[j][a][k] v[k], Q[a] = sum "
    "quadratic[j][a][k][l] v[k] v[l], C = sum cubic[j][k][l][m] v[k] v[l] v[m]; arrays are flat, "
    "last index fastest; if linear has no axis a, all A are s and the terms L s + Q s^2 + C s^3. "
    "For a volume with a bend: r, the root for s at rest, t = 0, then the q at which s = r q, "
    "t = 2 r e(q), e = (q^3 - q) / 2 for q <= 1, 1 - 1 / q above; without: the root s that grows "
    "out of 0.";

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
  const supine_basis_info *info = source->info;
  const size_t count = targets->count;
  const size_t rows = info->lung_count * info->volume_axes;
  json_t *modes = json_array();
  for (size_t j = 0; j < targets->mixes; ++j) {
    (void)json_array_append_new(
        modes, supine_export_glb_numbers(targets->modes + j * source->terms, source->terms));
  }
  json_t *supine = json_pack(
      "{s:s, s:i, s:o, s:o, s:o, s:o, s:o, s:o, s:f, s:f, s:s}", "weights", weights_text, "band",
      (int)source->info->band, "modes", modes, "offset",
      supine_export_glb_numbers(targets->offset, count), "unit",
      supine_export_glb_numbers(targets->unit, count), "bend",
      supine_export_glb_numbers(info->bend, 3), "lungBegin", lungs(source), "basis", origin(source),
      "millimetresPerUnit", targets->count_mm, "lossPercent", targets->loss_percent, "frame",
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
      json_object_set_new(
          supine, "volume",
          json_pack("{s:s, s:o, s:o, s:o}", "text", volume_text, "linear",
                    form(source, targets, rows, 1, info->volume_linear), "quadratic",
                    form(source, targets, rows, 2, info->volume_quadratic), "cubic",
                    form(source, targets, info->lung_count, 3, info->volume_cubic))) != 0) {
    json_decref(supine);
    return NULL;
  }
  return json_pack("{s:o, s:o}", "targetNames", target_names(source, targets), "supine", supine);
}
