/* SPDX-License-Identifier: MIT */
/* Hold the table of checks of every input, and judge a measured number by it. */
#include <math.h>

#include <supine/inputs.h>

/* clang-format off */
#define ALL (SUPINE_INPUT_BY_COMMAND | SUPINE_INPUT_BY_C | SUPINE_INPUT_BY_PYTHON | SUPINE_INPUT_BY_JAVASCRIPT)
#define COMMAND SUPINE_INPUT_BY_COMMAND
#define OFFLINE (SUPINE_INPUT_BY_COMMAND | SUPINE_INPUT_BY_C | SUPINE_INPUT_BY_PYTHON)

/* Rows in the order of the enumeration. To add one, add its name there, a row here, a right and a
 * wrong case to tests/inputs.py, and write docs/inputs.md anew (its first lines say how). */
static const supine_input inputs[] = {
  [SUPINE_INPUT_VOLUMES_OF_A_STATE] = {
    .name = "volumes-of-a-state", .group = "State",
    .input = "a posture with a volume, such as prone:rest, and another volume",
    .against = "each other", .measured = "volumes of one state", .told = NAN, .refused = 1,
    .evidence = "definition", .remedy = "give the volume once", .interfaces = ALL},
  [SUPINE_INPUT_TILT] = {
    .name = "tilt", .group = "State", .input = "a tilted posture, such as supine+15",
    .against = "a body that turns by a quarter at most", .measured = "tilt, degrees",
    .told = NAN, .refused = 90, .evidence = "definition: another posture is nearer",
    .remedy = "for a volume, write supine:rest+500; for another posture, its name", .interfaces = ALL},
  [SUPINE_INPUT_ROLL] = {
    .name = "roll", .group = "State", .input = "a rolled posture, such as supine@30",
    .against = "half a turn", .measured = "roll, degrees", .told = NAN, .refused = 180,
    .evidence = "definition", .remedy = "give -180 to 180 degrees; + turns to the left", .interfaces = ALL},
  [SUPINE_INPUT_VOLUME_FINITE] = {
    .name = "volume-finite", .group = "State", .input = "a volume", .against = "finite numbers",
    .measured = "numbers that are not finite", .told = NAN, .refused = 0, .evidence = "definition",
    .remedy = "give a number of mL", .interfaces = ALL},
  [SUPINE_INPUT_VOLUME_LEAST] = {
    .name = "volume-least", .group = "State", .input = "a volume of the lungs",
    .against = "full inflation", .measured = "share of full inflation", .below = true,
    .told = NAN, .refused = 0.1, .evidence = "tissue alone fills about 0.1",
    .remedy = "choose a volume nearer to rest, or allow folds", .interfaces = ALL},
  [SUPINE_INPUT_VOLUME_MOST] = {
    .name = "volume-most", .group = "State", .input = "a volume of the lungs",
    .against = "full inflation", .measured = "share of full inflation",
    .told = NAN, .refused = 1.2, .evidence = "definition of full inflation, and the error of a scan's volume",
    .remedy = "choose a volume nearer to rest, or allow folds", .interfaces = ALL},
  [SUPINE_INPUT_FOLDS] = {
    .name = "folds", .group = "State", .input = "a state of the lungs",
    .against = "the reference surface", .measured = "share of triangles that turn over",
    .told = NAN, .refused = 0.01, .evidence = "single triangles turn over in right states",
    .remedy = "choose a volume nearer to rest, or allow folds", .interfaces = ALL},
  [SUPINE_INPUT_FIELD_FOLDS] = {
    .name = "field-folds", .group = "State", .input = "a displacement field of a state",
    .against = "the cells inside the lungs", .measured = "share of cells that fold",
    .told = NAN, .refused = 0.01, .evidence = "as for the surface",
    .remedy = "choose a volume nearer to rest, or allow folds", .interfaces = COMMAND},
  [SUPINE_INPUT_BREATH] = {
    .name = "breath", .group = "State", .input = "a breath from a state",
    .against = "full inflation", .measured = "share of full inflation at the breath's end",
    .told = 1, .refused = 1.2, .evidence = "definition of full inflation",
    .remedy = "choose a smaller breath", .interfaces = COMMAND},
  [SUPINE_INPUT_STATE_MEMBERS] = {
    .name = "state-members", .group = "State", .input = "a state as an object or an array",
    .against = "the members that a state has", .measured = "members that are unknown",
    .told = NAN, .refused = 0, .evidence = "definition",
    .remedy = "give a text such as prone:rest, or gravity and volume",
    .interfaces = SUPINE_INPUT_BY_JAVASCRIPT | SUPINE_INPUT_BY_PYTHON},
  [SUPINE_INPUT_POINT_OUTSIDE] = {
    .name = "point-outside", .group = "Points", .input = "a point, such as a nodule",
    .against = "the surface of the lungs", .measured = "distance outside, mm",
    .told = NAN, .refused = 60, .evidence = "definition: beyond ribs and chest wall",
    .remedy = "check the axes and the unit of this point, or leave it out", .interfaces = SUPINE_INPUT_BY_COMMAND | SUPINE_INPUT_BY_PYTHON},
  [SUPINE_INPUT_DEVICE_NAME] = {
    .name = "device-name", .group = "Points", .input = "the name of a tracker's device",
    .against = "OpenIGTLink", .measured = "characters", .told = NAN, .refused = 20,
    .evidence = "OpenIGTLink: 20 bytes", .remedy = "give a shorter name", .interfaces = COMMAND},
  [SUPINE_INPUT_TRACKER_INVALID] = {
    .name = "tracker-invalid", .group = "Points", .input = "a pose of a tracker",
    .against = "what its message says of it", .measured = "poses marked as invalid",
    .told = 0, .refused = NAN, .evidence = "PLUS: TransformValid, TransformStatus",
    .remedy = "bring the tool back into view", .interfaces = COMMAND},
  [SUPINE_INPUT_HEIGHT_LEAST] = {
    .name = "height-least", .group = "Patient", .input = "the patient's height",
    .against = "the adults of the equations", .measured = "height / least of these adults",
    .below = true, .told = 1, .refused = NAN, .evidence = "heights of the equations: women 145 to 180 cm, men 155 to 195 cm (Quanjer et al. 1993)",
    .remedy = "give the volume at rest or at full inflation", .interfaces = OFFLINE},
  [SUPINE_INPUT_HEIGHT_MOST] = {
    .name = "height-most", .group = "Patient", .input = "the patient's height",
    .against = "the adults of the equations", .measured = "height / greatest of these adults",
    .told = 1, .refused = NAN, .evidence = "heights of the equations: women 145 to 180 cm, men 155 to 195 cm (Quanjer et al. 1993)",
    .remedy = "give the volume at rest or at full inflation", .interfaces = OFFLINE},
  [SUPINE_INPUT_REST_SHARE] = {
    .name = "rest-share", .group = "Patient", .input = "a volume at rest computed from the height",
    .against = "the scan's volume at full inflation", .measured = "share of full inflation",
    .told = NAN, .refused = 0.9, .evidence = "definition: breaths need more than a tenth",
    .remedy = "check the height and the state of the scan, or give the volume at rest", .interfaces = OFFLINE},
  [SUPINE_INPUT_GAS] = {
    .name = "gas", .group = "Patient", .input = "volumes of the lungs",
    .against = "the volume of tissue", .measured = "gas, mL", .below = true,
    .told = 0, .refused = NAN, .evidence = "definition; the tissue of an adult is 860 mL",
    .remedy = "check the unit and the state of the scan", .interfaces = OFFLINE},
  [SUPINE_INPUT_LUNGS_SMALL] = {
    .name = "lungs-small", .group = "Patient", .input = "lungs at full inflation",
    .against = "an adult's lungs", .measured = "volume of both lungs, mL", .below = true,
    .told = 3500, .refused = NAN,
    .evidence = "equations: women of 145 cm, 1.64 SD below the mean, supine, with the tissue",
    .remedy = "check the state of the scan; all constants are an adult's", .interfaces = OFFLINE},
  [SUPINE_INPUT_LOCATE_RESIDUALS] = {
    .name = "locate-residuals", .group = "Observed points", .input = "observed points and a volume",
    .against = "the error that is expected", .measured = "RMS residual / RMS expected error",
    .told = 1.5, .refused = NAN, .evidence = "full breaths, 6 to 20 points: told in 1 of 60 fits with right volumes, in 45 of 60 with wrong ones",
    .people = 5, .n = 120, .remedy = "check the volume, the names of the points and their unit", .interfaces = OFFLINE},
  [SUPINE_INPUT_LOCATE_TURNED] = {
    .name = "locate-turned", .group = "Observed points", .input = "observed points without a rigid motion",
    .against = "the lungs in the state", .measured = "turn that fits best, degrees",
    .told = 10, .refused = NAN,
    .evidence = "definition; the residuals must fall to a quarter, and a fitted rotation has an SD of 3 degrees",
    .remedy = "let the points' frame turn", .interfaces = OFFLINE},
  [SUPINE_INPUT_SUGGESTION] = {
    .name = "suggestion", .group = "Words", .input = "a word that is unknown",
    .against = "the words that are known", .measured = "share of the characters that differ",
    .told = 0.4, .refused = NAN, .evidence = "definition",
    .remedy = "nearer words are suggested, others are not", .interfaces = ALL},
};
/* clang-format on */
_Static_assert(sizeof inputs / sizeof *inputs == SUPINE_INPUT_COUNT, "each input needs a row");

const supine_input *supine_input_get(supine_input_id id) {
  return (int)id >= 0 && id < SUPINE_INPUT_COUNT ? &inputs[id] : NULL;
}

static bool beyond(const supine_input *input, double measured, double limit) {
  return !isnan(limit) && (input->below ? measured < limit : measured > limit);
}

supine_input_verdict supine_input_judge(supine_input_id id, double measured) {
  const supine_input *input = supine_input_get(id);
  if (input == NULL || isnan(measured) || beyond(input, measured, input->refused)) {
    return SUPINE_INPUT_REFUSED;
  }
  return beyond(input, measured, input->told) ? SUPINE_INPUT_TOLD : SUPINE_INPUT_TAKEN;
}
