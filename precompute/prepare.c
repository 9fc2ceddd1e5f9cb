/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Select the displacement law, stiffness, lesions and reference volumes of a model. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "base/vec3.h"

#include "precompute/prepare.h"

supine_model_choice supine_precompute_choice_default(void) {
  supine_model_choice choice = {.law = SUPINE_LAW_COUNT,
                                .model = supine_physics_model(SUPINE_LAW_PAPER),
                                .resting = supine_reference_resting_default()};
  choice.model.reach = choice.model.force.base = choice.model.force.gain = NAN;
  choice.model.force.box[0] = choice.model.direction.c[0] = NAN;
  choice.model.direction.shear = NAN;
  return choice;
}

/* Select the displacement law. Constants that the user gives override its constants. */
static supine_model choose_law(const supine_model_choice *choice) {
  const bool none = choice->has_scan && !choice->scan.known;
  const supine_model law = supine_physics_model(choice->law != SUPINE_LAW_COUNT
                                                    ? (supine_law)choice->law
                                                    : (none ? SUPINE_LAW_PAPER : SUPINE_LAW_DEEP));
  supine_model model = choice->model;
  if (choice->patient_law != NULL) {
    return model;
  }
  model.law = law.law;
  model.force.pair = law.force.pair;
  memcpy(model.bend, law.bend, sizeof law.bend);
  model.reach = isnan(model.reach) ? law.reach : model.reach;
  model.force.base = isnan(model.force.base) ? law.force.base : model.force.base;
  model.force.gain = isnan(model.force.gain) ? law.force.gain : model.force.gain;
  model.direction.shear =
      isnan(model.direction.shear) ? law.direction.shear : model.direction.shear;
  if (isnan(model.force.box[0])) {
    memcpy(model.force.box, law.force.box, sizeof law.force.box);
  }
  if (isnan(model.direction.c[0])) {
    memcpy(model.direction.c, law.direction.c, sizeof law.direction.c);
  }
  return model;
}

static double *allocate(size_t count, supine_status *status, supine_error *error) {
  double *values = malloc(count * sizeof *values);
  if (values == NULL) {
    *status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu numbers", count);
  }
  return values;
}

static supine_status set_expandability(const supine_lungs *lungs, const supine_model_choice *choice,
                                       supine_prepared *p, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  supine_status status = SUPINE_OK;
  const bool given = choice->expandability != NULL ||
                     choice->expandability_law.shape != SUPINE_EXPANDABILITY_UNIFORM;
  if (choice->stiffness != NULL && given) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the file of --patient sets the stiffness: leave --expandability out");
  }
  if (choice->stiffness == NULL && !given) {
    return SUPINE_OK;
  }
  double *a = p->stiffness = allocate(n, &status, error);
  p->model.stiffness = a;
  if (a != NULL && choice->stiffness != NULL) {
    memcpy(a, choice->stiffness, n * sizeof *a);
    return SUPINE_OK;
  }
  if (a != NULL && choice->expandability != NULL) {
    status = supine_tissue_expandability_load(choice->expandability, n, a, error);
  } else if (a != NULL) {
    supine_tissue_expandability_regional(lungs, &choice->expandability_law, a);
  }
  for (size_t i = 0; i < n && status == SUPINE_OK; ++i) {
    a[i] = 1.0 / a[i];
  }
  return status;
}

/* Warn of a lesion that contains no vertex and therefore changes no stiffness. */
static void warn_of_lesion(const supine_lungs *lungs, const supine_lesion *lesion,
                           supine_findings *findings) {
  const double *c = lesion->centre;
  double nearest = INFINITY;
  for (size_t i = 0; i < 3 * lungs->mesh.vertex_count; i += 3) {
    nearest = fmin(nearest, supine_distance(lungs->mesh.vertices + i, c));
  }
  supine_findings_add(
      findings,
      "warning: the lesion at %g,%g,%g is %.0f mm from the nearest vertex of the "
      "surface: with a radius of %g mm it changes nothing: correct its centre or radius",
      c[0], c[1], c[2], nearest, lesion->radius);
}

static supine_status set_lesions(const supine_lungs *lungs, const supine_model_choice *choice,
                                 supine_prepared *p, supine_findings *findings,
                                 supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  supine_status status = SUPINE_OK;
  if (choice->lesion_count == 0) {
    return SUPINE_OK;
  }
  p->lesions = allocate(n, &status, error);
  p->model.lesions = p->lesions;
  for (size_t i = 0; i < n && status == SUPINE_OK; ++i) {
    p->lesions[i] = 1.0;
  }
  for (size_t l = 0; l < choice->lesion_count && status == SUPINE_OK; ++l) {
    size_t reached = 0;
    status = supine_tissue_add_lesion(lungs, &choice->lesions[l], p->lesions, &reached, error);
    if (status == SUPINE_OK && reached == 0) {
      warn_of_lesion(lungs, &choice->lesions[l], findings);
    }
  }
  return status;
}

static supine_status set_shares(const supine_lungs *lungs, const supine_model_choice *choice,
                                supine_prepared *p, supine_error *error) {
  static const char *const names[] = {"left", "right"};
  supine_status status = SUPINE_OK;
  for (size_t side = 0; side < 2 && status == SUPINE_OK; ++side) {
    size_t lung = 0;
    while (lung < lungs->lung_count && lungs->side[lung] != (side == 0 ? 1 : -1)) {
      ++lung;
    }
    if (choice->share[side] > 0.0 && lung == lungs->lung_count) {
      status = supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                "--lung %s: the model has no %s lung: leave it out", names[side],
                                names[side]);
    } else if (choice->share[side] > 0.0) {
      p->model.share[lung] = choice->share[side];
    }
  }
  return status;
}

/* Whether the expandability differs between vertices. */
static bool varies(const supine_prepared *p, size_t count) {
  bool same = true;
  for (size_t i = 0; i < count && same; ++i) {
    same = (p->stiffness == NULL || p->stiffness[i] == p->stiffness[0]) &&
           (p->lesions == NULL || p->lesions[i] == 1.0);
  }
  return !same;
}

static void summarize(const supine_model_choice *choice, bool predicted, supine_prepared *p) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  const supine_reference *reference = &p->reference;
  const size_t size = sizeof p->summary;
  char state[160];
  double ml[2];
  supine_text_add(p->summary, size, "%s law; scan ",
                  choice->patient_law != NULL ? choice->patient_law
                                              : supine_physics_law_names[p->model.law]);
  if (!reference->known) {
    supine_text_add(p->summary, size, "taken as the reference of every posture");
    return;
  }
  (void)supine_state_describe(&reference->scan.state, state, sizeof state);
  const double full = reference->full_volume[0] + reference->full_volume[1];
  const double held = full + reference->scan_volume[0] + reference->scan_volume[1];
  const bool known = supine_reference_resting_given(&choice->resting);
  const bool at_rest = reference->scan.state.volume.kind == SUPINE_VOLUME_REST;
  if (held != full) {
    supine_text_add(p->summary, size, "%s, %.0f mL; ", state, held);
  }
  supine_text_add(p->summary, size, "%sfull inflation %.0f mL (%s", held != full ? "" : "at ", full,
                  reference->scan.full > 0.0 ? "given, "
                  : !at_rest                 ? ""
                  : known                    ? "from rest, "
                                             : "assumed from rest, ");
  supine_reference_compare(reference, &choice->person, p->summary, size);
  const double rest = supine_reference_rest(reference, supine, ml);
  const double ratio = exp(choice->resting.spread / choice->resting.assumed);
  supine_text_add(p->summary, size, "); rest supine %.0f mL (", rest);
  if (!at_rest && !known) {
    supine_text_add(p->summary, size, "%.0f to %.0f ", rest / ratio, rest * ratio);
  }
  supine_text_add(p->summary, size, "by %s)",
                  at_rest                                        ? "the scan"
                  : choice->patient_law != NULL                  ? "the fit"
                  : known                                        ? "--resting"
                  : predicted                                    ? "height and sex"
                  : choice->resting.assumed == SUPINE_REST_SHARE ? "healthy people's share"
                                                                 : "the share in COPD");
  double collapsed = 0.0; /* volume in the scan as the basis holds it, mL */
  for (size_t lung = 0; lung < reference->lung_count; ++lung) {
    collapsed +=
        p->model.share[lung] * (reference->full_volume[lung] + reference->scan_volume[lung]);
  }
  if (p->model.share[0] != 1.0 || p->model.share[1] != 1.0) {
    supine_text_add(p->summary, size,
                    "; collapsed in every state by --lung, also in the scan, which then holds %.0f "
                    "mL: no displacement contains the collapse",
                    collapsed);
  }
}

supine_status supine_precompute_prepare(supine_lungs *lungs, const supine_model_choice *choice,
                                        supine_prepared *prepared, supine_findings *findings,
                                        supine_error *error) {
  supine_prepared *p = prepared;
  supine_scan scan = choice->scan;
  char doubt[512];
  p->model = choose_law(choice);
  if (!choice->has_scan && p->model.law != SUPINE_LAW_PAPER) {
    (void)supine_reference_scan_parse("full", &scan, NULL);
  }
  if (p->model.law == SUPINE_LAW_PAPER && scan.known) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "--law paper takes the scan as the reference: leave --scanned out, or "
                            "use --law deep");
  }
  if (scan.known && scan.state.volume.kind == SUPINE_VOLUME_DEFAULT) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "--scanned: a posture alone is only for --fields: add the volume, as "
                            "in supine:rest, or give full or none");
  }
  const supine_volume *full = &choice->full.volume;
  scan.full = full->ml;
  if (full->kind != SUPINE_VOLUME_DEFAULT &&
      (full->kind != SUPINE_VOLUME_ABSOLUTE || scan.state.volume.kind != SUPINE_VOLUME_REST)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "--full is for a scan at rest: give a volume such as 4200mL, and "
                            "--scanned supine:rest too");
  }
  supine_status status = set_expandability(lungs, choice, p, error);
  status = status == SUPINE_OK ? set_lesions(lungs, choice, p, findings, error) : status;
  status = status == SUPINE_OK ? set_shares(lungs, choice, p, error) : status;
  const supine_reference scanned = {
      .scan = scan, .lung_count = lungs->lung_count, .side = {lungs->side[0], lungs->side[1]}};
  supine_resting resting = choice->resting;
  supine_reference_predict_rest(&scanned, &choice->person, &resting);
  if (status == SUPINE_OK && p->model.reach > 0.0 && varies(p, lungs->mesh.vertex_count)) {
    status = supine_physics_strain_create(lungs, p->stiffness, p->lesions, &p->strain, error);
    p->model.strain = p->strain;
  }
  status = status == SUPINE_OK
               ? supine_reference_find(lungs, &p->model, &scan, &resting, &p->reference, error)
               : status;
  if (status == SUPINE_OK) {
    summarize(choice, resting.ml[2] != choice->resting.ml[2], p);
  }
  if (status == SUPINE_OK && p->reference.known) {
    supine_reference_doubt(&p->reference, &choice->person, &choice->resting, doubt, sizeof doubt);
    if (doubt[0] != '\0') {
      supine_findings_add(findings, "warning: %s", doubt);
    }
  }
  return status;
}

void supine_precompute_prepared_free(supine_prepared *prepared) {
  free(prepared->stiffness);
  free(prepared->lesions);
  supine_physics_strain_destroy(prepared->strain);
  *prepared = (supine_prepared){0};
}
