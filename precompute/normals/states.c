/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Sample states: gravity on a golden-angle spiral, volumes by multiples of an irrational number. */
#include <math.h>

#include "base/vec3.h"
#include <supine/sh.h>
#include <supine/volume.h>

#include "precompute/normals/polynomial.h"

/* Range of the displacement of the vertex that moves most, mm, in the sampled states if the resting
 * volume (FRC) is unknown. Negative values reverse all displacements. */
static const double lowest_mm = -15.0;
static const double highest_mm = 60.0;

/* Find the largest displacement, mm, of evenly chosen vertices at mode weights w, unscaled. */
static double largest(const supine_normals_surface *s, const double *w) {
  enum { SOME = 4096 };
  const size_t modes = s->field->mode_count;
  const size_t axes = supine_rows_per_vertex(s->kind);
  double top = 0.0;
  for (size_t i = 0; i < s->lungs->mesh.vertex_count; i += 1 + s->lungs->mesh.vertex_count / SOME) {
    double square = 0.0;
    for (size_t axis = 0; axis < axes; ++axis) {
      double amount = 0.0;
      for (size_t k = 0; k < modes; ++k) {
        amount += w[k] * (double)s->field->coefficients[(axes * i + axis) * modes + k];
      }
      square += amount * amount;
    }
    if (s->kind == SUPINE_ROWS_SCALAR) {
      const float *d = s->directions + 3 * i;
      square *=
          (double)d[0] * (double)d[0] + (double)d[1] * (double)d[1] + (double)d[2] * (double)d[2];
    }
    top = fmax(top, square);
  }
  return sqrt(top);
}

/* Find the gains of each lung (factors on the displacement along the axes) at which its volume lies
 * at `share` between rest (0) and the reference surface (1). Write the volume of all lungs minus
 * that of the reference surface, mL, to `amount`. y [9] holds the spherical harmonics at the
 * direction of gravity, w the weights of the modes. Return false if the surface of a lung folds
 * before it reaches this volume. */
static bool gains_from_rest(const supine_normals_surface *s, const double *y, const double *w,
                            double share, double (*gains)[3], double *amount) {
  *amount = 0.0;
  for (size_t lung = 0; lung < s->lungs->lung_count; ++lung) {
    supine_volume_form form;
    double rest = 0.0;
    supine_physics_volume_forms_contract_lung(s->forms, lung, w, &form);
    for (size_t i = 0; i < 9; ++i) {
      rest += s->resting[9 * lung + i] * y[i];
    }
    *amount += (1.0 - share) * rest;
    if (supine_volume_form_gains(&form, s->bend, rest, (1.0 - share) * rest, gains[lung], NULL) !=
        SUPINE_OK) {
      return false;
    }
  }
  return true;
}

/* Find the gain, equal for all axes and lungs, at which the displacement of the vertex that moves
 * most is lowest_mm + share (highest_mm - lowest_mm). Write this displacement to `amount`. Return
 * false if no vertex moves. */
static bool common_gain(const supine_normals_surface *s, const double *w, double share,
                        double (*gains)[3], double *amount) {
  const double size = largest(s, w);
  *amount = lowest_mm + share * (highest_mm - lowest_mm);
  for (size_t i = 0; i < 3 * s->lungs->lung_count; ++i) {
    gains[i / 3][i % 3] = size > 0.0 ? *amount / size : 0.0;
  }
  return size > 0.0;
}

supine_status supine_normals_states_create(const supine_normals_surface *surface, size_t count,
                                           double shift, supine_arena *arena,
                                           supine_normals_states *states) {
  static const double share_step = 0.4142135623730950488;
  const size_t terms = 3 * supine_normals_terms(surface->field->mode_count);
  double low[9];
  double w[SUPINE_MODES_MAX];
  *states = (supine_normals_states){.room = count, .range = {INFINITY, -INFINITY}};
  states->phi =
      supine_arena_take(arena, surface->lungs->lung_count * count * terms, sizeof *states->phi);
  SUPINE_TRY(supine_arena_status(arena));
  for (size_t i = 0; i < count; ++i) {
    const double at = (double)i + shift;
    const double share = fmod(at * share_step, 1.0);
    double g[3];
    supine_spiral(at, (double)count, 0.0, g);
    double gains[SUPINE_LUNGS_MAX][3];
    double amount = 0.0;
    (void)supine_sh_evaluate(2, g, low);
    supine_sh_compression_weights(surface->field, g, w);
    if (surface->resting != NULL ? gains_from_rest(surface, low, w, share, gains, &amount)
                                 : common_gain(surface, w, share, gains, &amount)) {
      for (size_t lung = 0; lung < surface->lungs->lung_count; ++lung) {
        supine_normals_monomials(surface->field->mode_count, w, gains[lung],
                                 states->phi + (lung * count + states->count) * terms);
      }
      states->range[0] = fmin(states->range[0], amount);
      states->range[1] = fmax(states->range[1], amount);
      ++states->count;
    }
  }
  return SUPINE_OK;
}
