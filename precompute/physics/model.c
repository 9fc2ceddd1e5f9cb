/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Return the constants of a displacement law, and set up the equilibrium of forces with them. */
#include <math.h>

#include "base/arena.h"
#include "base/remedy.h"
#include "base/vec3.h"
#include "precompute/physics/model.h"

#define LIST(...)                                                                                  \
  { __VA_ARGS__ }
#define MODEL(id, name, base_, gain_, box_, constants, shear_, bend_, reach_, pair_, from_scan_,   \
              what)                                                                                \
  {.law = SUPINE_LAW_##id,                                                                         \
   .force = {.base = base_, .gain = gain_, .box = LIST box_, .pair = pair_},                       \
   .direction = {.c = LIST constants, .shear = shear_},                                            \
   .bend = LIST bend_,                                                                             \
   .from_scan = from_scan_,                                                                        \
   .reach = reach_,                                                                                \
   .share = {1.0, 1.0}},
#define NAME(id, name, ...) name,

supine_model supine_physics_model(supine_law law) {
  static const supine_model laws[] = {SUPINE_LAWS(MODEL)};
  return laws[law];
}

const char *const supine_physics_law_names[SUPINE_LAW_COUNT + 1] = {SUPINE_LAWS(NAME) NULL};

supine_status supine_physics_model_equilibrium(const supine_lungs *lungs, const supine_model *model,
                                               supine_equilibrium **equilibrium,
                                               supine_error *error) {
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_give("reach", "10", ""),
                                                     supine_remedy_omit("soften")};
  SUPINE_REFUSE_ADVISE(model->force.soften != 0.0 && !(model->reach > 0.0), error, advice,
                       SUPINE_ERROR_ARGUMENT,
                       "softening needs the distance over which a force spreads");
  /* A longer smoothing length would spread every force evenly and make the matrix singular. */
  const double longest = 0.5 * supine_distance(lungs->minimum, lungs->maximum);
  const double reach = fmin(model->reach, longest);
  if (*equilibrium != NULL) {
    return supine_physics_equilibrium_set_shape(*equilibrium, &lungs->mesh, reach, model->stiffness,
                                                error);
  }
  SUPINE_TRY(supine_physics_equilibrium_create(&lungs->mesh, &lungs->topology, reach,
                                               model->lesions, equilibrium, error));
  if (model->stiffness != NULL) {
    SUPINE_TRY(supine_physics_equilibrium_set_stiffness(*equilibrium, model->stiffness, error));
  }
  return SUPINE_OK;
}
