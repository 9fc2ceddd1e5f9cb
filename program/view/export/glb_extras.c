/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the extras of a glTF file: formulas and constants for the weights of morph targets. */
#include <math.h>
#include <stdlib.h>

#include <supine/sh.h>

#include "base/number.h"
#include "program/options/facts.h"
#include "program/view/export/glb.h"

/* With more morph targets, the extras omit the volume formula: it has too many constants then. */
enum { VOLUME_TARGETS_MAX = 32 };

enum { RESTING_TERMS = 9 }; /* number of spherical harmonics of bands 0 to 2 */

/* Return whether the lungs breathe. Another simulator's fields of gravity alone do not. */
static bool breathes(const glb *g) {
  return !g->info->is_fields || g->info->order > 0;
}

/* Return whether the extras have the volume formula. */
static bool has_volume(const glb *g) {
  return g->targets.count <= VOLUME_TARGETS_MAX && breathes(g);
}

static const char frame_text[] =
    "Vertices of a lung's mesh are in the patient's axes, LPS (x left, y back, z head), from "
    "'middle', mm: position = middle + millimetresPerUnit * vertex. The mesh's node converts them "
    "to glTF's metres (y head, z front); the node 'patient' lays the patient down.";
static const char weights_text[] =
    "weight[j] = (amount[j] - offset[j]) / unit[j], with the lung's offset and unit. With K modes, "
    "amount[j] = s v[j] for j < K and amount[K + k] = t v[k]. v[k] = modeUnit * sum over i of "
    "modes[k][i] * Y[i](g), where g is the unit vector of gravity in the patient's axes (supine "
    "0,1,0). Y: real orthonormal spherical harmonics, index l*l+l+m, sine terms at m < 0, no "
    "Condon-Shortley phase: Y[0] = 0.28209479, Y[1..3] = 0.48860251 * (y, z, x). The gain along "
    "axis a is A[a] = s + t * bend[a]; s = t = 0 is the reference surface.";
static const char fields_text[] =
    "s = 1 and t = 0: another simulator's fields of gravity, without volumes and breaths";
static const char simulated_text[] =
    "s = 1 and t = 0: another simulator's fields of gravity and volume. Each lung has its own v[k] "
    "= "
    "modeUnit * sum over i and n of modes[k][i * (order + 1) + n] * Y[i](g) * T[n](x), where T[0] "
    "= "
    "1, T[1] = x, T[n] = 2 x T[n-1] - T[n-2]. A lung that holds V mL more than its referenceVolume "
    "has nearly x = 2 (V - range[0]) / (range[1] - range[0]) - 1; solve for the x at which "
    "'volume' "
    "gives V. In the direction g, the simulations held V from low to high, with low = sum over i "
    "of "
    "limits[i] * Y[i](g) and high = sum over i of limits[n + i] * Y[i](g), where n is half the "
    "length of limits";
static const char simulated_rest_text[] =
    "volume of a lung at rest minus referenceVolume, mL: sum over l <= 2 and m of resting[l*l+l+m] "
    "* Y[l*l+l+m](g)";
static const char volume_text[] =
    "volume of a lung minus its referenceVolume, mL: sum over axes a of L[a] A[a], plus Q[0] A[1] "
    "A[2] + Q[1] A[0] A[2] + Q[2] A[0] A[1] + C A[0] A[1] A[2], where L[a] = sum linear[a][k] "
    "v[k], Q[a] = sum quadratic[a][k][l] v[k] v[l], C = sum cubic[k][l][m] v[k] v[l] v[m]. Arrays "
    "are flat, last index fastest. If linear has only K numbers, all gains are s and the volume is "
    "L s + Q s^2 + C s^3. To reach a volume if bend is 0, solve for s on the branch through s = 0. "
    "With bend, first find r, the s of the volume at rest with t = 0; then find the q at which s = "
    "r q, t = 2 r e(q) give the volume, where e = (q^3 - q) / 2 for q <= 1, else (q - 1) / q^6.";
static const char resting_text[] =
    "volume of a lung at rest minus referenceVolume, mL: sum over l <= 2 and m of resting[l*l+l+m] "
    "* Y[l*l+l+m](g); of all lungs together if byLung is false. Full inflation minus "
    "referenceVolume is max(0, -g_z)^2 * fullUprightGain * referenceVolume. Above rest, all lungs "
    "have covered the same fraction of the way from rest to full inflation.";

/* Return the names of the morph targets, such as "mode_3" and "bend_3". */
static json_t *target_names(const glb *g) {
  const size_t k = g->info->mode_count;
  json_t *names = json_array();
  for (size_t j = 0; j < g->targets.count; ++j) {
    (void)json_array_append_new(names, json_sprintf("%s_%zu", j < k ? "mode" : "bend", j % k));
  }
  return names;
}

/* Return what the extras say about the gains of another simulator's fields; NULL for other
 * bases. */
static const char *gains_text(const glb *g) {
  if (g->info->order > 0) {
    return simulated_text;
  }
  return g->info->is_fields ? fields_text : NULL;
}

/* Return the coefficients of the weights, as multiples of `unit`. */
static json_t *describe_modes(const supine_basis_info *info, double unit) {
  const size_t terms = supine_sh_count(info->band) * (info->order + 1);
  json_t *modes = json_array();
  for (size_t k = 0; k < info->mode_count; ++k) {
    json_t *row = json_array();
    for (size_t i = 0; i < terms; ++i) {
      (void)json_array_append_new(row, json_integer(llround(info->modes[k * terms + i] / unit)));
    }
    (void)json_array_append_new(modes, row);
  }
  return modes;
}

json_t *supine_export_glb_extras(const glb *g) {
  const supine_basis_info *info = g->info;
  const char *full = supine_basis_metadata(g->basis, "full_upright_gain");
  const double unit = 1e-8; /* value of one integer step in `modes` */
  const bool rest = info->has_rest;
  const bool shares = rest && info->order == 0; /* how a total is divided among the lungs */
  const char *rest_text = rest ? simulated_rest_text : NULL;
  if (shares) {
    rest_text = resting_text;
  }
  char caveats[SUPINE_CAVEATS_SIZE];
  (void)supine_basis_caveats(g->basis, caveats, sizeof caveats);
  json_t *extras = json_pack(
      "{s:{s:s, s:s, s:s, s:i, s:o, s:f, s:o, s:o, s:f, s:o, s:s*, s:o*, s:s*, s:s*, s:o*, s:o*}}",
      "supine", "caveats", caveats, "frame", frame_text, "weights", weights_text, "band",
      (int)info->band, "modes", describe_modes(info, unit), "modeUnit", unit, "bend",
      supine_options_json_numbers(3, info->bend), "middle",
      supine_options_json_numbers(3, g->targets.middle), "millimetresPerUnit", g->step, "basis",
      supine_options_json_metadata(g->basis), "gains", gains_text(g), "breathVolume",
      breathes(g) ? json_real(g->options->breath) : NULL, "volume",
      has_volume(g) ? volume_text : NULL, "rest", rest_text, "byLung", rest ? json_true() : NULL,
      "fullUprightGain",
      shares ? json_real(full != NULL ? supine_number_parse(full, NULL) : 0) : NULL);
  if (info->order > 0) {
    (void)json_object_set_new(json_object_get(extras, "supine"), "order",
                              json_integer((json_int_t)info->order));
  }
  return extras;
}

json_t *supine_export_glb_lung_extras(const glb *g, size_t lung) {
  const supine_basis_info *info = g->info;
  const size_t k = info->mode_count;
  json_t *supine =
      json_pack("{s:I, s:o, s:o}", "lung", (json_int_t)lung, "offset",
                supine_options_json_numbers(g->targets.count, g->targets.lung[lung].offset), "unit",
                supine_options_json_numbers(g->targets.count, g->targets.lung[lung].unit));
  if (info->has_rest) {
    const double *resting = supine_basis_tensor(g->basis, "resting_volume")->data;
    (void)json_object_set_new(
        supine, "resting",
        supine_options_json_numbers(RESTING_TERMS, resting + lung * RESTING_TERMS));
  }
  if (info->order > 0) {
    const double *range = supine_basis_tensor(g->basis, "simulated_range")->data;
    const supine_tensor *limits = supine_basis_tensor(g->basis, "simulated_limits");
    const size_t numbers = 2 * limits->shape[2]; /* harmonics of the least and the most volume */
    (void)json_object_set_new(supine, "range", supine_options_json_numbers(2, range + 2 * lung));
    (void)json_object_set_new(
        supine, "limits",
        supine_options_json_numbers(numbers, (const double *)limits->data + lung * numbers));
  }
  if (has_volume(g)) {
    (void)json_object_update_new(
        supine,
        json_pack("{s:f, s:o, s:o, s:o}", "referenceVolume", info->reference_volume[lung], "linear",
                  supine_options_json_numbers(3 * k, info->volume_linear + lung * 3 * k),
                  "quadratic",
                  supine_options_json_numbers(3 * k * k, info->volume_quadratic + lung * 3 * k * k),
                  "cubic",
                  supine_options_json_numbers(k * k * k, info->volume_cubic + lung * k * k * k)));
  }
  return json_pack("{s:o, s:o}", "targetNames", target_names(g), "supine", supine);
}
