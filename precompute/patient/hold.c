/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Correct a patient's displacement so that the lungs hold the volume that a scan has shown. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/number.h"
#include "precompute/patient/patient_file.h"

/* Distance from which a correction is doubtful, mm: 0.4 to 3.5 were needed in real lungs. */
static const double doubtful = 3.0;

typedef struct surface {
  supine_lungs lungs;  /* the displaced surface; its vertices are those of the work space */
  double *normals;     /* [vertices, 3] smoothed normals of the displaced surface */
  double change[2][3]; /* [lung] volume gained, mm^3 (supine_mesh_volume_along) */
} surface;

/* Copy the displaced surface, and find how its volume changes along its smoothed normals. */
static supine_status find_surface(const supine_lungs *fuller, const double *displacement,
                                  bool displaced, supine_arena *arena, surface *of,
                                  supine_error *error) {
  const size_t size = 3 * fuller->mesh.vertex_count;
  double *positions = supine_arena_take(arena, size, sizeof *positions);
  double *space = supine_arena_take(arena, size, sizeof *space);
  of->lungs = *fuller;
  of->lungs.mesh.vertices = positions;
  of->normals = supine_arena_take(arena, size, sizeof *of->normals);
  SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices", size / 3));
  for (size_t i = 0; i < size; ++i) {
    positions[i] = fuller->mesh.vertices[i] + (displaced ? displacement[i] : 0.0);
  }
  supine_lungs_measure_volumes(&of->lungs);
  supine_mesh_smooth_normals(&of->lungs.mesh, &of->lungs.topology, of->normals, space);
  for (size_t lung = 0; lung < fuller->lung_count; ++lung) {
    const supine_mesh part = supine_lungs_part(&of->lungs, lung);
    supine_mesh_volume_along(&part, of->normals, of->change[lung]);
  }
  return SUPINE_OK;
}

/* Find the distance by which each lung moves: its own if the volume of each lung was measured, else
 * the same for both. Return false if no volume of these lungs was measured. */
static bool find_offsets(const supine_patient_record *record, const surface *of, double h[2],
                         bool *converged) {
  static const double mm3 = 1e3; /* 1 mL */
  const supine_lungs *lungs = &of->lungs;
  const size_t other = 1 - record->shown;
  const int only_side = lungs->lung_count == 1 ? lungs->side[0] : 0;
  bool each = true;
  double missing = record->volume[other];
  double sum[3] = {0.0, 0.0, 0.0};
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    each = each && record->measured_lung[other][lungs->side[lung] > 0 ? 0 : 1] > 0.0;
    missing -= lungs->volume[lung];
    for (size_t k = 0; k < 3; ++k) {
      sum[k] += of->change[lung][k];
    }
  }
  if (each) {
    *converged = true;
    for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
      const double own = record->measured_lung[other][lungs->side[lung] > 0 ? 0 : 1];
      *converged =
          supine_mesh_offset_to(of->change[lung], mm3 * (own - lungs->volume[lung]), &h[lung]) &&
          *converged;
    }
    return true;
  }
  if (record->volume[other] <= 0.0 || only_side != record->patient.frame.only_side) {
    return false;
  }
  *converged = supine_mesh_offset_to(sum, mm3 * missing, &h[0]);
  h[1] = h[0];
  return true;
}

supine_status supine_patient_hold_volume(supine_patient_record *record, supine_lungs *fuller,
                                         double *displacement, supine_error *error) {
  const bool shows_emptier = record->shown == 1;
  SUPINE_ARENA arena = {0};
  surface of = {.normals = NULL};
  double h[2] = {0.0, 0.0};
  bool converged = false;
  record->offset[0] = record->offset[1] = 0.0;
  SUPINE_TRY(find_surface(fuller, displacement, !shows_emptier, &arena, &of, error));
  record->holds_measured = find_offsets(record, &of, h, &converged);
  if (!record->holds_measured) {
    return SUPINE_OK;
  }
  SUPINE_REFUSE_IF(!converged, error, SUPINE_ERROR_NUMERICAL,
                   "the displaced surface cannot hold the %.0f mL that were measured: check the "
                   "volumes of the fit, and that this surface shows the same lungs",
                   record->volume[1 - record->shown]);
  for (size_t lung = 0; lung < fuller->lung_count; ++lung) {
    record->offset[fuller->side[lung] > 0 ? 0 : 1] = h[lung];
    for (size_t i = 3 * fuller->lung_begin[lung]; i < 3 * fuller->lung_begin[lung + 1]; ++i) {
      /* The scan stays in place: a fuller surface that moves outwards is displaced farther. */
      const double move = h[lung] * of.normals[i];
      displacement[i] += shows_emptier ? -move : move;
      fuller->mesh.vertices[i] += shows_emptier ? move : 0.0;
    }
  }
  supine_lungs_measure(fuller);
  return SUPINE_OK;
}

bool supine_patient_describe_volume(const supine_patient_record *record, char *text, size_t size) {
  const size_t other = 1 - record->shown;
  const double *lung = record->lung_volume[other];
  const double *h = record->offset;
  const bool doubted = fmax(fabs(h[0]), fabs(h[1])) > doubtful;
  char state[160];
  char moved[160] = "";
  (void)supine_state_describe(&record->state[other], state, sizeof state);
  if (record->holds_measured && h[0] != h[1] && lung[0] > 0.0 && lung[1] > 0.0) {
    (void)supine_print_text(moved, sizeof moved,
                            ", as measured: the surface was moved along its outward normals, by "
                            "%.2f mm (left) and %.2f mm (right)",
                            h[0], h[1]);
  } else if (record->holds_measured) {
    (void)supine_print_text(moved, sizeof moved,
                            ", as measured: the surface was moved along its outward normals, by "
                            "%.2f mm",
                            lung[0] > 0.0 ? h[0] : h[1]);
  }
  (void)supine_print_text(text, size, "by the fitted law, the lungs hold %.0f mL %s%s%s",
                          lung[0] + lung[1], state, moved,
                          doubted ? ". That is far: check that the volumes and the scans show the "
                                    "same lungs"
                                  : "");
  return doubted;
}
