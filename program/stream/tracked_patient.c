/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Store posture, volume and observed points from messages, and compute the state of the lungs. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "base/arena.h"
#include "base/number.h"
#include "program/options/basis_input.h"
#include "program/options/command.h"
#include "program/stream/tracked_patient.h"

supine_status supine_stream_volume_breathe(supine_stream_volume *volume, const supine_pv *pv,
                                           const supine_pv_breath *breath, supine_error *error) {
  const double start = 0.0;
  double above = 0.0;
  /* Evaluate the breath once to check the arguments. */
  SUPINE_TRY(supine_breath_evaluate(pv, breath, 1, &start, &above, NULL, error));
  *volume = (supine_stream_volume){.breathes = true, .pv = *pv, .breath = *breath};
  return SUPINE_OK;
}

static supine_status judge_state(const supine_basis *basis, const supine_state *state,
                                 supine_findings *findings, supine_error *error) {
  supine_pose pose;
  SUPINE_TRY(supine_basis_pose(basis, state, &pose, error));
  if (findings != NULL) {
    supine_basis_tell(basis, state, &pose, findings);
  }
  return SUPINE_OK;
}

supine_status supine_stream_volume_judge(const supine_stream_volume *volume,
                                         const supine_basis *basis, const double gravity[3],
                                         supine_findings *findings, supine_error *error) {
  const supine_state *fixed = &volume->fixed;
  SUPINE_REFUSE_IF(!volume->breathes && supine_basis_get_info(basis)->hilum != NULL &&
                       fixed->lung_count == 0 && fixed->volume.kind == SUPINE_VOLUME_SCAN &&
                       fixed->volume.ml == 0.0,
                   error, SUPINE_ERROR_UNSUPPORTED,
                   "the volume scan is that of the lungs before their collapse: give another");
  if (volume->breathes) {
    const supine_state rest = supine_options_breath_state(basis, gravity, 0.0);
    const supine_state full = supine_options_breath_state(basis, gravity, volume->breath.tidal);
    SUPINE_TRY(judge_state(basis, &rest, findings, error));
    return judge_state(basis, &full, findings, error);
  }
  supine_state state = *fixed;
  memcpy(state.gravity, gravity, sizeof state.gravity);
  return judge_state(basis, &state, findings, error);
}

supine_state supine_stream_volume_at(const supine_stream_volume *volume, const supine_basis *basis,
                                     const double gravity[3], double time) {
  double above = 0.0;
  if (volume->breathes) {
    /* This cannot fail: supine_stream_volume_breathe has checked the arguments. */
    (void)supine_breath_evaluate(&volume->pv, &volume->breath, 1, &time, &above, NULL, NULL);
    return supine_options_breath_state(basis, gravity, above);
  }
  supine_state state = volume->fixed;
  memcpy(state.gravity, gravity, sizeof state.gravity);
  return state;
}

supine_stream_patient supine_stream_patient_begin(const supine_basis *basis,
                                                  const supine_stream_options *options,
                                                  supine_stream_counts *counts, double now) {
  return (supine_stream_patient){.basis = basis,
                                 .options = options,
                                 .counts = counts,
                                 .breath_begun = now,
                                 .gravity = {0, 1, 0},
                                 .pose_received = -1.0,
                                 .received = -1.0,
                                 .warned_at = now - 1.0};
}

void supine_stream_patient_warn(supine_stream_patient *patient, double now, const char *format,
                                ...) {
  if (now - patient->warned_at < 1.0) {
    return;
  }
  char text[512];
  va_list arguments;
  va_start(arguments, format);
  (void)supine_print_text_list(text, sizeof text, format, arguments);
  va_end(arguments);
  patient->warned_at = now;
  patient->options->warn(patient->options->context, text);
}

/* Note when a message was received, and that the next frame must show it. */
static void note_message(supine_stream_patient *p, double received) {
  p->pending = true;
  p->received = received;
}

/* Note a message with a pose or an observed point. */
static void note_pose(supine_stream_patient *p, double received, uint64_t stamp) {
  note_message(p, received);
  p->pose_received = received;
  p->stamp = stamp;
}

static void warn_of(supine_stream_patient *p, const supine_findings *findings, double received) {
  for (size_t i = 0; i < findings->count; ++i) {
    supine_stream_patient_warn(p, received, "warning: %s", findings->list[i].text);
  }
}

/* Store a pose, unless `verdict` refuses it or the lungs cannot hold their volume in it. Warn if
 * the pose is repaired. */
static supine_status accept_pose(supine_stream_patient *p, supine_stream_verdict verdict,
                                 const char *why, const double gravity[3], double received,
                                 uint64_t stamp, supine_error *error) {
  supine_findings findings = {.count = 0};
  supine_error wrong;
  if (verdict == SUPINE_STREAM_REFUSED) {
    ++p->counts->refused;
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "a pose is refused: %s", why);
  }
  if (supine_stream_volume_judge(p->options->volume, p->basis, gravity, &findings, &wrong) !=
      SUPINE_OK) {
    ++p->counts->refused;
    return supine_error_wrap(error, &wrong, "a pose is refused: ");
  }
  if (verdict == SUPINE_STREAM_REPAIRED) {
    ++p->counts->repaired;
    supine_stream_patient_warn(p, received, "a pose is repaired: %s; send a rotation", why);
  }
  warn_of(p, &findings, received);
  memcpy(p->gravity, gravity, sizeof p->gravity);
  note_pose(p, received, stamp);
  ++p->counts->poses;
  return SUPINE_OK;
}

/* Store a fixed volume, unless the lungs cannot hold it in the present posture. */
static supine_status accept_volume(supine_stream_patient *p, const supine_state *fixed,
                                   double received, supine_error *error) {
  const supine_stream_volume volume = {.fixed = *fixed};
  supine_findings findings = {.count = 0};
  supine_error wrong;
  if (supine_stream_volume_judge(&volume, p->basis, p->gravity, &findings, &wrong) != SUPINE_OK) {
    ++p->counts->unreachable;
    return supine_error_wrap(error, &wrong, "a volume is refused: ");
  }
  warn_of(p, &findings, received);
  *p->options->volume = volume;
  note_message(p, received);
  return SUPINE_OK;
}

/* Store the position of an observed point; a not-a-number position means that the point is not
 * seen. Return false if no point has that name. */
static bool store_position(supine_stream_patient *p, const char *name, const double position[3],
                           double received, uint64_t stamp) {
  supine_stream_observed *observed = p->options->observed;
  size_t at = 0;
  if (observed == NULL) {
    return false;
  }
  while (at < observed->count && strcmp(observed->name[at], name) != 0) {
    ++at;
  }
  if (at == observed->count) {
    return false;
  }
  for (size_t i = 0; i < 3; ++i) {
    observed->last[at].position[i] = observed->ras && i < 2 ? -position[i] : position[i];
  }
  note_pose(p, received, stamp);
  ++p->counts->positions;
  return true;
}

static void store_positions(supine_stream_patient *p, const supine_stream_message *message,
                            double received, uint64_t stamp) {
  for (size_t i = 0; i < message->point_count; ++i) {
    char name[65];
    double position[3];
    supine_stream_message_point(message, i, name, position);
    if (!store_position(p, name, position, received, stamp) && p->options->observed != NULL) {
      supine_stream_patient_warn(p, received,
                                 "the file of --points has no point '%s': rename the sensor", name);
    }
  }
}

/* Store the rotation of a tracker, or its position if an observed point has its name. */
static supine_status receive_rotation(supine_stream_patient *p,
                                      const supine_stream_message *message, double received,
                                      uint64_t stamp, supine_error *error) {
  double gravity[3];
  const char *why = NULL;
  if (store_position(p, message->text, message->number + 9, received, stamp)) {
    return SUPINE_OK;
  }
  const supine_stream_verdict verdict =
      supine_stream_gravity_rotation(&p->options->setup, message->number, gravity, &why);
  return accept_pose(p, verdict, why, gravity, received, stamp, error);
}

/* Store a volume that a message gives as text. */
static supine_status receive_volume(supine_stream_patient *p, const char *text, double received,
                                    supine_error *error) {
  supine_state state = {.lung_count = 0};
  supine_error wrong;
  if (supine_state_parse_volume(text, &state, &wrong) != SUPINE_OK) {
    ++p->counts->unreachable;
    return supine_error_wrap(error, &wrong, "a volume is refused: ");
  }
  return accept_volume(p, &state, received, error);
}

supine_status supine_stream_patient_receive(supine_stream_patient *patient,
                                            const supine_stream_message *message, double received,
                                            uint64_t stamp, supine_error *error) {
  const supine_state above_rest = {.volume = {SUPINE_VOLUME_REST, message->number[0]}};
  supine_stream_verdict verdict = SUPINE_STREAM_EXACT;
  double gravity[3];
  const char *why = NULL;
  switch (message->kind) {
  case SUPINE_STREAM_POSITION:
    (void)store_position(patient, message->text, message->number + 9, received, stamp);
    break;
  case SUPINE_STREAM_POINT_LIST:
    store_positions(patient, message, received, stamp);
    break;
  case SUPINE_STREAM_ROTATION:
    return receive_rotation(patient, message, received, stamp, error);
  case SUPINE_STREAM_DOWN:
    verdict = supine_stream_gravity_down(&patient->options->setup, message->number, gravity, &why);
    return accept_pose(patient, verdict, why, gravity, received, stamp, error);
  case SUPINE_STREAM_VOLUME:
    return accept_volume(patient, &above_rest, received, error);
  case SUPINE_STREAM_VOLUME_TEXT:
    return receive_volume(patient, message->text, received, error);
  case SUPINE_STREAM_NOTHING:
  case SUPINE_STREAM_REQUEST:
  case SUPINE_STREAM_INVALID:
    ++patient->counts->skipped;
    break;
  }
  return SUPINE_OK;
}

supine_status supine_stream_patient_pose(supine_stream_patient *patient, const double gravity[3],
                                         double received, supine_error *error) {
  const supine_stream_setup body = supine_stream_setup_default();
  double unit[3];
  const char *why = NULL;
  const supine_stream_verdict verdict = supine_stream_gravity_down(&body, gravity, unit, &why);
  return accept_pose(patient, verdict, why, unit, received, 0, error);
}

static uint64_t stamp_now(void) {
  struct timespec now;
  (void)clock_gettime(CLOCK_REALTIME, &now);
  return ((uint64_t)now.tv_sec << 32) | (((uint64_t)now.tv_nsec << 32) / 1000000000u);
}

/* Compute the pose and the volumes of the present posture and volume, which
 * supine_stream_volume_judge has accepted. */
static void find_pose(const supine_stream_patient *patient, double now,
                      supine_stream_snapshot *snapshot) {
  const supine_basis *basis = patient->basis;
  const supine_state state = supine_stream_volume_at(
      patient->options->volume, basis, snapshot->gravity, now - patient->breath_begun);
  const supine_state rest = supine_options_breath_state(basis, snapshot->gravity, 0.0);
  if (supine_basis_pose(basis, &rest, &snapshot->pose, NULL) == SUPINE_OK) {
    snapshot->above = -supine_posed_volume(basis, &snapshot->pose);
  }
  (void)supine_basis_pose(basis, &state, &snapshot->pose, NULL);
  snapshot->volume = supine_posed_volume(basis, &snapshot->pose);
  snapshot->above += snapshot->volume;
}

/* Fit the lungs to the observed points that are visible, and their volume unless it is fixed. */
static void find_location(supine_stream_patient *patient, double now,
                          supine_stream_snapshot *snapshot) {
  const supine_stream_volume *volume = patient->options->volume;
  supine_stream_observed *observed = patient->options->observed;
  supine_observation seen[SUPINE_LOCATE_POINTS_MAX];
  supine_locate_residual residuals[SUPINE_LOCATE_POINTS_MAX];
  supine_locate_task task = {.inside = observed->inside, .observed = seen};
  supine_pose pose = snapshot->pose;
  const supine_location *found = NULL;
  supine_error error;
  if (!volume->breathes) {
    task.state = volume->fixed;
  }
  memcpy(task.state.gravity, snapshot->gravity, sizeof task.state.gravity);
  for (size_t i = 0; i < observed->count; ++i) {
    const double *p = observed->last[i].position;
    if (isfinite(p[0] + p[1] + p[2])) {
      seen[task.count++] = observed->last[i];
    }
  }
  if (task.count == 0) {
    return;
  }
  supine_status status = supine_locate(&task, residuals, observed->space, &found, &error);
  if (status == SUPINE_OK) {
    status =
        supine_basis_pose(patient->basis, &supine_location_get_info(found)->state, &pose, &error);
  }
  if (status != SUPINE_OK) {
    supine_stream_patient_warn(patient, now,
                               "the lungs cannot be fitted to the observed points: %s",
                               supine_options_explain(&error).text);
  } else {
    const double held = supine_location_get_info(found)->volume;
    snapshot->location = found;
    snapshot->pose = pose;
    snapshot->above += held - snapshot->volume;
    snapshot->volume = held;
  }
}

void supine_stream_patient_snapshot(supine_stream_patient *patient, double now,
                                    supine_stream_snapshot *snapshot) {
  *snapshot = (supine_stream_snapshot){0};
  memcpy(snapshot->gravity, patient->gravity, sizeof snapshot->gravity);
  snapshot->received = patient->pending ? patient->received : -1.0;
  snapshot->pose_received = patient->pose_received;
  snapshot->stamp = patient->stamp != 0 ? patient->stamp : stamp_now();
  find_pose(patient, now, snapshot);
  if (patient->options->observed != NULL) {
    find_location(patient, now, snapshot);
  }
  patient->pending = false;
}
