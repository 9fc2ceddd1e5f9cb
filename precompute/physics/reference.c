/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the volumes at full inflation from the state of a scan, and inflate the lungs to them. */
#include <math.h>
#include <string.h>

#include <supine/volume.h>

#include "base/arena.h"
#include "base/remedy.h"
#include "precompute/physics/reference.h"

static const double tissue_share = 0.1; /* volume of the tissue as a share of the full volume */

supine_status supine_physics_reference_scan_parse(const char *text, supine_scan *scan,
                                                  supine_error *error) {
  supine_scan read = {.known = true, .state = {.gravity = {0.0, 1.0, 0.0}}};
  if (strcmp(text, "none") == 0) {
    *scan = (supine_scan){0};
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_state_parse(text, &read.state, error));
  const supine_volume_kind kind = read.state.volume.kind;
  SUPINE_REFUSE_IF(read.state.lung_count > 0 ||
                       (kind != SUPINE_VOLUME_REST && kind != SUPINE_VOLUME_FULL),
                   error, SUPINE_ERROR_ARGUMENT,
                   "'%s' is not the state of a scan: give full or POSTURE:rest, either with +ML or "
                   "-ML for both lungs together, or none",
                   text);
  *scan = read;
  return SUPINE_OK;
}

/* Compute the volume of a lung at degree of filling t, from its volumes at rest (t = 0) and at full
 * inflation (t = 1). For t < 0, the volume is (1 + t) times that at rest. */
static double volume_at(double rest, double full, double t) {
  return t < 0.0 ? rest * (1.0 + t) : rest * (1.0 - t) + full * t;
}

double supine_physics_reference_rest(const supine_reference *reference, const double g[3],
                                     double *ml) {
  double sum = 0.0;
  for (size_t lung = 0; lung < reference->lung_count; ++lung) {
    ml[lung] = reference->full_volume[lung] *
               supine_physics_resting_share(&reference->resting, reference->side[lung], g);
    sum += ml[lung];
  }
  return sum;
}

double supine_physics_reference_full(const supine_reference *reference, const double g[3],
                                     double *ml) {
  double sum = 0.0;
  for (size_t lung = 0; lung < reference->lung_count; ++lung) {
    ml[lung] = reference->full_volume[lung] * supine_physics_resting_full_share(g);
    sum += ml[lung];
  }
  return sum;
}

void supine_physics_reference_share_out(const supine_reference *reference, const double g[3],
                                        double total, double *ml) {
  double full[2];
  double rest[2];
  const double at_full = supine_physics_reference_full(reference, g, full);
  const double at_rest = supine_physics_reference_rest(reference, g, rest);
  const double t =
      total < at_rest ? total / at_rest - 1.0 : (total - at_rest) / (at_full - at_rest);
  for (size_t lung = 0; lung < reference->lung_count; ++lung) {
    ml[lung] = volume_at(rest[lung], full[lung], t);
  }
}

/* Find the volume of each lung's reference surface, found->full_volume.
 *
 * If t is the degree of filling of the scan (0 at rest, 1 at full inflation), this volume is the
 * lung's volume in the scan divided by volume_at(t). The user gives the state of the scan as rest
 * plus some mL, or as full inflation plus some mL. Bisect t until these mL result.
 * @param volume  [lung_count] volume of each lung in the scan, mL */
static supine_status find_full(supine_reference *found, const double *volume, supine_error *error) {
  const supine_state *state = &found->scan.state;
  const bool from_rest = state->volume.kind == SUPINE_VOLUME_REST;
  const double full = supine_physics_resting_full_share(state->gravity);
  double low = -1.0;
  double high = 1.0;
  double t = from_rest ? 0.0 : 1.0;
  for (int halving = 0; halving < 60; ++halving) {
    double beyond = 0.0; /* mL by which the scan exceeds rest (if from_rest) or full inflation */
    for (size_t lung = 0; lung < found->lung_count; ++lung) {
      const double rest =
          supine_physics_resting_share(&found->resting, found->side[lung], state->gravity);
      found->full_volume[lung] = volume[lung] / volume_at(rest, full, t);
      beyond += volume[lung] - found->full_volume[lung] * (from_rest ? rest : full);
    }
    if (state->volume.ml == 0.0) {
      break;
    }
    if (beyond < state->volume.ml) {
      low = t;
    } else {
      high = t;
    }
    t = 0.5 * (low + high);
  }
  double held = 0.0;
  double whole = 0.0;
  for (size_t lung = 0; lung < found->lung_count; ++lung) {
    held += volume[lung];
    whole += found->full_volume[lung];
    found->scan_volume[lung] = volume[lung] - found->full_volume[lung];
  }
  const bool beyond_full = state->volume.ml > 0.0 && high == 1.0;
  if (beyond_full || held < tissue_share * whole) {
    char text[160];
    (void)supine_state_print(state, text, sizeof text);
    (void)supine_error_set(error, SUPINE_ERROR_ARGUMENT, "a scan of %.0f mL cannot be '%s': %s",
                           held, text,
                           beyond_full ? "it is beyond full inflation"
                                       : "it is less than the tissue, 10 % of full inflation");
    const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_change("scanned", "")};
    supine_error_advise(error, advice);
    return SUPINE_ERROR_ARGUMENT;
  }
  return SUPINE_OK;
}

/* Find the share at rest at which full inflation has the known volume found->scan.full, to which it
 * is inversely proportional (nearly, if the scan was not exactly at rest). */
static supine_status find_rest(supine_reference *found, const double *volume, supine_error *error) {
  supine_status status = find_full(found, volume, error);
  double off = INFINITY;
  for (int step = 0; step < 30 && status == SUPINE_OK && fabs(off - 1.0) > 1e-9; ++step) {
    off = (found->full_volume[0] + found->full_volume[1]) / found->scan.full;
    found->resting.assumed = fmin(1.0, found->resting.assumed * off);
    (void)supine_physics_resting_settle(&found->resting, 0, NULL, NULL, NULL);
    status = find_full(found, volume, error);
  }
  SUPINE_TRY(status);
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_change("full", ""),
                                                     supine_remedy_change("scanned", ""),
                                                     supine_remedy_change("resting", "")};
  SUPINE_REFUSE_ADVISE(!(fabs(off - 1.0) <= 1e-9), error, advice, SUPINE_ERROR_ARGUMENT,
                       "a scan of %.0f mL at rest does not belong to lungs of %.0f mL at full "
                       "inflation",
                       volume[0] + volume[1], found->scan.full);
  return SUPINE_OK;
}

supine_status supine_physics_reference_find(supine_lungs *lungs, const supine_model *model,
                                            const supine_scan *scan, const supine_resting *resting,
                                            supine_reference *reference, supine_error *error) {
  supine_reference found = {.scan = *scan,
                            .resting = *resting,
                            .lung_count = lungs->lung_count,
                            .side = {lungs->side[0], lungs->side[1]}};
  *reference = found;
  if (!scan->known) {
    return SUPINE_OK;
  }
  if (scan->full > 0.0) {
    SUPINE_TRY(find_rest(&found, lungs->volume, error));
  } else {
    SUPINE_TRY(find_full(&found, lungs->volume, error));
  }
  SUPINE_TRY(supine_physics_resting_settle(&found.resting, found.lung_count, found.side,
                                           found.full_volume, error));
  if (found.scan_volume[0] != 0.0 || found.scan_volume[1] != 0.0) {
    (void)supine_physics_reference_rest(&found, scan->state.gravity, found.scan_rest);
    SUPINE_TRY(supine_physics_reference_inflate(lungs, model, &found, error));
  }
  found.known = true;
  *reference = found;
  return SUPINE_OK;
}
