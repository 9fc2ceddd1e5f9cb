/* SPDX-License-Identifier: GPL-3.0-or-later */
/* From a scan to the same lungs at full inflation. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/vec3.h"
#include <supine/volume.h>

#include "precompute/physics/reference.h"
#include "precompute/physics/solve.h"
#include "precompute/physics/volume_forms.h"

enum { STEPS_MAX = 100 };

static const double settled = 1e-4;      /* mm between steps: a fiftieth of what is promised */
static const double tissue_share = 0.1;  /* of the full volume: nothing is emptier */
static const double folded_share = 0.01; /* of the triangles: the surface is no lung's any more */

/* Refuses a way up on which the surface folds, with the volume at which it does. */
static supine_status check_folds(const supine_lungs *lungs, const supine_mesh *scan, double gain,
                                 supine_error *error) {
  const double share = supine_mesh_turned_over(scan, lungs->mesh.vertices);
  if (share <= folded_share) {
    return SUPINE_OK;
  }
  const size_t count = 3 * scan->vertex_count;
  double *between = malloc(count * sizeof *between);
  if (between == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to look for folds");
  }
  double whole = 0.0;
  double folded = 1.0;
  while (folded - whole > 1e-3) {
    const double part = 0.5 * (whole + folded);
    for (size_t i = 0; i < count; ++i) {
      between[i] = scan->vertices[i] + part * (lungs->mesh.vertices[i] - scan->vertices[i]);
    }
    *(supine_mesh_turned_over(scan, between) > folded_share ? &folded : &whole) = part;
  }
  free(between);
  return supine_error_set(
      error, SUPINE_ERROR_NUMERICAL,
      "the scan folds on its way up to full inflation: %.3g %% of its triangles "
      "turn over, the first %g %% some %.0f of the %.0f mL above the scan. Is "
      "it fuller than was said? Give its state, or take it as it is",
      100.0 * share, 100.0 * folded_share, folded * gain, gain);
}

/* One step of the fixed point: the field of the full surface so far, laid on the scan. Eight
 * parameters: what is known of the scan, and what the step changes. */
static supine_status step(supine_lungs *lungs, const supine_lungs *scan, const supine_model *model,
                          const double g[3], double gain, double *scale, double *change,
                          supine_error *error) {
  supine_solution field = {0};
  supine_volume_forms forms = {0};
  const double one = 1.0;
  double cubic[3];
  *change = 0.0;
  supine_status status = supine_physics_solve(lungs, model, g, &field, error);
  if (status == SUPINE_OK) {
    status = supine_physics_volume_forms_create(scan, NULL, field.directions, field.catch_, 1,
                                                &forms, error);
  }
  if (status == SUPINE_OK) {
    supine_physics_volume_forms_contract(&forms, &one, cubic);
    status = supine_volume_scale(cubic, gain, scale, error);
  }
  for (size_t i = 0; status == SUPINE_OK && i < 3 * lungs->mesh.vertex_count; ++i) {
    const double full = scan->mesh.vertices[i] + *scale * field.catch_[i / 3] * field.directions[i];
    *change = fmax(*change, fabs(full - lungs->mesh.vertices[i]));
    lungs->mesh.vertices[i] = full;
  }
  supine_mesh_box(&lungs->mesh, lungs->minimum, lungs->maximum);
  supine_physics_volume_forms_free(&forms);
  supine_physics_solution_free(&field);
  return status;
}

/* Takes the lungs up by `gain` mL; `found` gets its steps and how far they went. */
static supine_status inflate(supine_lungs *lungs, const supine_model *model, const double g[3],
                             double gain, supine_reference *found, supine_error *error) {
  const size_t count = 3 * lungs->mesh.vertex_count;
  supine_model healthy = *model; /* shares are taken after the field was found */
  healthy.share[0] = healthy.share[1] = 1.0;
  supine_lungs scan = *lungs;
  double change = INFINITY;
  supine_status status = SUPINE_OK;
  scan.mesh.vertices = malloc(count * sizeof(double));
  if (scan.mesh.vertices == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", count / 3);
  }
  memcpy(scan.mesh.vertices, lungs->mesh.vertices, count * sizeof(double));
  while (status == SUPINE_OK && change > settled && found->steps < STEPS_MAX) {
    double scale = 0.0;
    status = step(lungs, &scan, &healthy, g, gain, &scale, &change, error);
    found->scan_scale = -scale;
    ++found->steps;
  }
  if (status == SUPINE_OK) {
    status = check_folds(lungs, &scan.mesh, gain, error);
  }
  if (status == SUPINE_OK && change > settled) {
    status = supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                              "no full surface %.0f mL above the scan: after %d steps it still "
                              "moves by %.3g mm. Is the scan fuller than was said?",
                              gain, STEPS_MAX, change);
  }
  for (size_t i = 0; i < count; i += 3) {
    const double *p = lungs->mesh.vertices + i;
    const double *q = scan.mesh.vertices + i;
    found->moved = fmax(found->moved, supine_distance(p, q));
  }
  free(scan.mesh.vertices);
  return status;
}

supine_status supine_reference_find(supine_lungs *lungs, const supine_model *model,
                                    const supine_scan *scan, const supine_resting *resting,
                                    supine_reference *reference, supine_error *error) {
  supine_reference found = {.scan = *scan, .resting = *resting};
  *reference = found;
  if (!lungs->topology.closed && scan->kind > SUPINE_SCAN_FULL) {
    return supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                            "an open surface has no volume to take up to full inflation: close it, "
                            "or say that it is full");
  }
  if (!lungs->topology.closed || scan->kind == SUPINE_SCAN_NONE) {
    return SUPINE_OK;
  }
  const double volume = 1e-3 * supine_mesh_volume(&lungs->mesh);
  found.known = true;
  found.full_volume = volume;
  if (scan->kind == SUPINE_SCAN_REST) {
    found.full_volume = volume / supine_reference_along_axes(resting->share, scan->gravity);
  } else if (scan->kind == SUPINE_SCAN_VOLUME) {
    found.full_volume = volume - scan->volume;
  }
  if (!(found.full_volume >= volume) || volume < tissue_share * found.full_volume) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a scan of %.0f mL cannot be %+.0f mL from full: full is no less, and "
                            "tissue alone is %g %% of it",
                            volume, volume - found.full_volume, 100.0 * tissue_share);
  }
  found.scan_volume = volume - found.full_volume;
  supine_status status = SUPINE_OK;
  if (found.scan_volume < 0.0) {
    status = inflate(lungs, model, scan->gravity, -found.scan_volume, &found, error);
  }
  if (status == SUPINE_OK) {
    *reference = found;
  }
  return status;
}
