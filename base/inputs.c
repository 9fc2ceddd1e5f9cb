/* SPDX-License-Identifier: MIT */
/* Hold the table of checks of every input, and judge a measured number by it. */
#include <math.h>

#include <supine/inputs.h>

/* clang-format off */
#define ALL (SUPINE_INPUT_BY_COMMAND | SUPINE_INPUT_BY_C | SUPINE_INPUT_BY_PYTHON | SUPINE_INPUT_BY_JAVASCRIPT)
#define COMMAND SUPINE_INPUT_BY_COMMAND
#define OFFLINE (SUPINE_INPUT_BY_COMMAND | SUPINE_INPUT_BY_C | SUPINE_INPUT_BY_PYTHON)

/* The module for JavaScript has no function that returns the rows of the table, and is smaller without
 * their texts. */
#ifdef __wasm__
#define TEXT(text) ""
#else
#define TEXT(text) text
#endif

/* Rows in the order of the enumeration. To add one, add its name there, a row here, a right and a
 * wrong case to tests/inputs.py, and write docs/inputs.md anew (its first lines say how). */
static const supine_input inputs[] = {
  [SUPINE_INPUT_VOLUMES_OF_A_STATE] = {
    .name = TEXT("volumes-of-a-state"), .group = TEXT("State"),
    .input = TEXT("a posture with a volume, such as prone:rest, and another volume"),
    .against = TEXT("each other"), .measured = TEXT("volumes of one state"), .told = NAN, .refused = 1,
    .evidence = TEXT("definition"), .interfaces = ALL},
  [SUPINE_INPUT_TILT] = {
    .name = TEXT("tilt"), .group = TEXT("State"), .input = TEXT("a tilted posture, such as supine+15"),
    .against = TEXT("a body that turns by a quarter at most"), .measured = TEXT("tilt, degrees"),
    .told = NAN, .refused = 90, .evidence = TEXT("definition: another posture is nearer"),
    .interfaces = ALL},
  [SUPINE_INPUT_ROLL] = {
    .name = TEXT("roll"), .group = TEXT("State"), .input = TEXT("a rolled posture, such as supine@30"),
    .against = TEXT("half a turn"), .measured = TEXT("roll, degrees"), .told = NAN, .refused = 180,
    .evidence = TEXT("definition"), .interfaces = ALL},
  [SUPINE_INPUT_VOLUME_FINITE] = {
    .name = TEXT("volume-finite"), .group = TEXT("State"), .input = TEXT("a volume"), .against = TEXT("finite numbers"),
    .measured = TEXT("number, mL; NaN counts as beyond"), .told = NAN, .refused = 1e15, .evidence = TEXT("definition; no lung holds 1e15 mL"),
    .interfaces = ALL},
  [SUPINE_INPUT_VOLUME_LEAST] = {
    .name = TEXT("volume-least"), .group = TEXT("State"), .input = TEXT("a volume of the lungs"),
    .against = TEXT("full inflation"), .measured = TEXT("share of full inflation"), .below = true,
    .told = NAN, .refused = 0.1, .evidence = TEXT("assumed: tissue alone fills about 0.1"),
    .interfaces = ALL},
  [SUPINE_INPUT_VOLUME_MOST] = {
    .name = TEXT("volume-most"), .group = TEXT("State"), .input = TEXT("a volume of the lungs"),
    .against = TEXT("full inflation"), .measured = TEXT("share of full inflation"),
    .told = NAN, .refused = 1.2, .evidence = TEXT("assumed: definition of full inflation, and a margin for the error of a scan's volume"),
    .interfaces = ALL},
  [SUPINE_INPUT_FOLDS] = {
    .name = TEXT("folds"), .group = TEXT("State"), .input = TEXT("a state of the lungs"),
    .against = TEXT("the reference surface"), .measured = TEXT("share of triangles that turn over"),
    .told = NAN, .refused = 0.01, .evidence = TEXT("six postures at rest and at full inflation: no triangle; the margin is assumed"),
    .people = 7, .n = 144,
    .interfaces = ALL},
  [SUPINE_INPUT_GAIN] = {
    .name = TEXT("gain"), .group = TEXT("State"), .input = TEXT("a gain of lungs whose range of volumes is unknown"),
    .against = TEXT("1, which reproduces another simulator's displacements"), .measured = TEXT("gain, without its sign"),
    .told = NAN, .refused = 5, .evidence = TEXT("assumed: gravity in m/s^2 instead of a gain is refused"),
    .interfaces = SUPINE_INPUT_BY_C | SUPINE_INPUT_BY_PYTHON | SUPINE_INPUT_BY_JAVASCRIPT},
  [SUPINE_INPUT_FIELD_FOLDS] = {
    .name = TEXT("field-folds"), .group = TEXT("State"), .input = TEXT("a displacement field of a state"),
    .against = TEXT("the cells inside the lungs"), .measured = TEXT("share of cells that fold"),
    .told = NAN, .refused = 0.01, .evidence = TEXT("assumed: as for the surface"),
    .interfaces = COMMAND},
  [SUPINE_INPUT_BREATH] = {
    .name = TEXT("breath"), .group = TEXT("State"), .input = TEXT("a breath from a state"),
    .against = TEXT("full inflation"), .measured = TEXT("share of full inflation at the breath's end"),
    .told = 1, .refused = 1.2, .evidence = TEXT("told: definition of full inflation; refused: assumed, as for volumes"),
    .interfaces = COMMAND},
  [SUPINE_INPUT_BREATH_LEAST] = {
    .name = TEXT("breath-least"), .group = TEXT("State"), .input = TEXT("the tidal volume of a breath"),
    .against = TEXT("litres instead of mL"), .measured = TEXT("tidal volume, mL"), .below = true,
    .told = NAN, .refused = 20, .evidence = TEXT("assumed: a newborn breathes about 20 mL"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_STATE_MEMBERS] = {
    .name = TEXT("state-members"), .group = TEXT("State"), .input = TEXT("a state as an object or an array"),
    .against = TEXT("the members that a state has"), .measured = TEXT("members that are unknown"),
    .told = NAN, .refused = 0, .evidence = TEXT("definition"),
    .interfaces = SUPINE_INPUT_BY_JAVASCRIPT | SUPINE_INPUT_BY_PYTHON},
  [SUPINE_INPUT_POINT_OUTSIDE] = {
    .name = TEXT("point-outside"), .group = TEXT("Points"), .input = TEXT("a point, such as a nodule, or the nearest vertex of a mesh; one far vertex is told"),
    .against = TEXT("the surface of the lungs"), .measured = TEXT("distance outside, mm"),
    .told = NAN, .refused = 60, .evidence = TEXT("assumed: beyond ribs and chest wall"),
    .interfaces = SUPINE_INPUT_BY_COMMAND | SUPINE_INPUT_BY_PYTHON},
  [SUPINE_INPUT_CONTENT_OUTSIDE] = {
    .name = TEXT("content-outside"), .group = TEXT("Points"), .input = TEXT("points, or a mesh or label that moves with the lungs"),
    .against = TEXT("the surface of the lungs"), .measured = TEXT("share of the vertices more than 5 mm and an edge outside, and not between the lungs"),
    .told = 0.02, .refused = NAN,
    .evidence = TEXT("tests/evidence/belongs.py: own lungs and lobes, surfaces of 6 and 12 mm edge, at most 0.008; another person's lungs 0.038 to 0.33 of 20, lobes 0.68 and 0.85"),
    .people = 7, .n = 52,
    .interfaces = SUPINE_INPUT_BY_COMMAND | SUPINE_INPUT_BY_PYTHON},
  [SUPINE_INPUT_DEVICE_NAME] = {
    .name = TEXT("device-name"), .group = TEXT("Points"), .input = TEXT("the name of a tracker's device"),
    .against = TEXT("OpenIGTLink"), .measured = TEXT("characters"), .told = NAN, .refused = 20,
    .evidence = TEXT("OpenIGTLink: 20 bytes"), .interfaces = COMMAND},
  [SUPINE_INPUT_TRACKER_INVALID] = {
    .name = TEXT("tracker-invalid"), .group = TEXT("Points"), .input = TEXT("a pose of a tracker"),
    .against = TEXT("what its message says of it"), .measured = TEXT("poses marked as invalid"),
    .told = 0, .refused = NAN, .evidence = TEXT("PLUS: TransformValid, TransformStatus"),
    .interfaces = COMMAND},
  [SUPINE_INPUT_FRAME_LINE] = {
    .name = "frame-line", .group = TEXT("Points"), .input = TEXT("points at which the lungs are registered"),
    .against = TEXT("the line that fits them best"), .measured = TEXT("RMS distance from the line, mm"), .below = true,
    .told = NAN, .refused = 10, .evidence = TEXT("assumed: the turn about the line is open, and two points are on one"),
    .interfaces = ALL},
  [SUPINE_INPUT_HEIGHT_LEAST] = {
    .name = TEXT("height-least"), .group = TEXT("Patient"), .input = TEXT("the patient's height"),
    .against = TEXT("the adults of the equations"), .measured = TEXT("height / least of these adults"),
    .below = true, .told = 1, .refused = NAN, .evidence = TEXT("heights of the equations: women 145 to 180 cm, men 155 to 195 cm (Quanjer et al. 1993)"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_HEIGHT_MOST] = {
    .name = TEXT("height-most"), .group = TEXT("Patient"), .input = TEXT("the patient's height"),
    .against = TEXT("the adults of the equations"), .measured = TEXT("height / greatest of these adults"),
    .told = 1, .refused = NAN, .evidence = TEXT("heights of the equations: women 145 to 180 cm, men 155 to 195 cm (Quanjer et al. 1993)"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_REST_SHARE] = {
    .name = TEXT("rest-share"), .group = TEXT("Patient"), .input = TEXT("a volume at rest computed from the height"),
    .against = TEXT("the scan's volume at full inflation"), .measured = TEXT("share of full inflation"),
    .told = NAN, .refused = 0.9, .evidence = TEXT("assumed: breaths need more than a tenth"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LUNG_SHARE] = {
    .name = TEXT("lung-share"), .group = TEXT("Patient"), .input = TEXT("the share of its volume that a collapsed lung holds"),
    .against = TEXT("the tissue alone"), .measured = TEXT("share of the lung's volume"), .below = true,
    .told = NAN, .refused = 0.1, .evidence = TEXT("assumed: tissue alone fills about 0.1 of full inflation"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LUNGS_SMALL] = {
    .name = TEXT("lungs-small"), .group = TEXT("Patient"), .input = TEXT("lungs at full inflation, and the patient's height"),
    .against = TEXT("adults of this height, of either sex if it is unknown"), .measured = TEXT("volume / least mean volume"), .below = true,
    .told = 0.75, .refused = NAN,
    .evidence = TEXT("equations: 2.0 to 3.4 SD below the mean, supine, with the tissue; without a height nothing is told, because a child's lungs hold what an adult's hold at rest"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LABEL_VALUE] = {
    .name = TEXT("label-value"), .group = TEXT("Label maps"), .input = TEXT("a voxel of a label map, unless all are probabilities from 0 to 1"),
    .against = TEXT("whole numbers from 0 to 65535"), .measured = TEXT("distance from the nearest label"),
    .told = NAN, .refused = 1e-3, .evidence = TEXT("definition; rounding of scaled integers is smaller"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LABELS_RATIO] = {
    .name = TEXT("labels-ratio"), .group = TEXT("Label maps"), .input = TEXT("two labels that nobody named"),
    .against = TEXT("each other"), .measured = TEXT("ratio of their volumes"),
    .told = NAN, .refused = 3, .evidence = TEXT("two lungs: at most 1.31"),
    .people = 7, .n = 12,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LABELS_PIECES] = {
    .name = TEXT("labels-pieces"), .group = TEXT("Label maps"), .input = TEXT("two labels that nobody named"),
    .against = TEXT("the largest piece of each"), .measured = TEXT("share of the other pieces"),
    .told = NAN, .refused = 0.1, .evidence = TEXT("two lungs: at most 0.00005"),
    .people = 7, .n = 12,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LABELS_SIDES] = {
    .name = TEXT("labels-sides"), .group = TEXT("Label maps"), .input = TEXT("two labels that nobody named"),
    .against = TEXT("each other"), .measured = TEXT("reach beyond the middle of the other, mm"),
    .told = NAN, .refused = 0, .evidence = TEXT("two lungs: -49 or less"),
    .people = 7, .n = 12,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LABELS_ORDER] = {
    .name = TEXT("labels-order"), .group = TEXT("Label maps"), .input = TEXT("five lobes numbered from 1"),
    .against = TEXT("the order of LTRCLobes, from the left"), .measured = TEXT("lobes of the right lung among those numbered as left"),
    .told = NAN, .refused = 0, .evidence = TEXT("definition"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LUNG_PIECES] = {
    .name = TEXT("lung-pieces"), .group = TEXT("Label maps"), .input = TEXT("the labels of a lung"),
    .against = TEXT("the largest piece"), .measured = TEXT("share of the other pieces"),
    .told = 0.1, .refused = NAN, .evidence = TEXT("lungs: at most 0.00005"),
    .people = 7, .n = 24,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LUNG_CUT] = {
    .name = TEXT("lung-cut"), .group = TEXT("Label maps"), .input = TEXT("a lung at the border of the image"),
    .against = TEXT("a half ball on its section there"), .measured = TEXT("half ball / volume of the lung"),
    .told = 0.005, .refused = NAN,
    .evidence = TEXT("tests/evidence/belongs.py, COPD: without the last 0.5 % of its volume towards the head or the feet 0.006 to 0.020, without 0.05 % 0.0006 to 0.007; a scan that begins at the apex 0.0007"),
    .people = 5, .n = 80,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LUNG_HOLLOW] = {
    .name = TEXT("lung-hollow"), .group = TEXT("Label maps"), .input = TEXT("the surface of a lung, also of a mesh"),
    .against = TEXT("a sphere of its volume"), .measured = TEXT("area of the sphere / area"), .below = true,
    .told = NAN, .refused = 0.1, .evidence = TEXT("lungs: 0.61 to 0.77; a shell of 3 mm: 0.07"),
    .people = 10, .n = 38,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LUNGS_LEVEL] = {
    .name = TEXT("lungs-level"), .group = TEXT("Label maps"), .input = TEXT("a left and a right lung, also of meshes"),
    .against = TEXT("each other"), .measured = TEXT("distance of their backs / depth, or of both bases and apices / height"),
    .told = 0.16, .refused = NAN, .evidence = TEXT("own lungs at most 0.04, a body turned by 10 degrees 0.15; six pairs of lungs of two people 0.14 to 0.38"),
    .people = 10, .n = 20,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_VOXELS_BEGIN] = {
    .name = TEXT("voxels-begin"), .group = TEXT("Label maps"), .input = TEXT("vox_offset of a NIfTI header"),
    .against = TEXT("the least that the format allows"), .measured = TEXT("offset / least offset"), .below = true,
    .told = NAN, .refused = 1, .evidence = TEXT("definition of NIfTI"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_IMAGE_FRAME] = {
    .name = TEXT("image-frame"), .group = TEXT("Images"), .input = TEXT("an image or labels that move with the lungs"),
    .against = TEXT("the lungs of the basis"), .measured = TEXT("share of the lungs in the image"), .below = true,
    .told = 0.9, .refused = NAN, .evidence = TEXT("assumed: the edge of an image may cut a part of the lungs off"),
    .interfaces = COMMAND},
  [SUPINE_INPUT_CT_FRAME] = {
    .name = TEXT("ct-frame"), .group = TEXT("Images"), .input = TEXT("a CT whose densities are scaled"),
    .against = TEXT("the lungs of the basis"), .measured = TEXT("share of the lungs in the image"), .below = true,
    .told = NAN, .refused = 0.9, .evidence = TEXT("assumed: the edge of an image may cut a part of the lungs off"),
    .interfaces = COMMAND},
  [SUPINE_INPUT_IMAGE_LABELS] = {
    .name = TEXT("image-labels"), .group = TEXT("Images"), .input = TEXT("an image of whole numbers, none of them negative"),
    .against = TEXT("label maps, between whose labels no values lie"), .measured = TEXT("different values"), .below = true,
    .told = 128, .refused = NAN, .evidence = TEXT("tests/evidence/belongs.py: label maps 2 to 6 values, slices of CT and MR 1,128 to 4,742, of scintigraphy 274; TotalSegmentator has 118 labels"),
    .interfaces = COMMAND},
  [SUPINE_INPUT_LABELS_LUNGS] = {
    .name = TEXT("labels-lungs"), .group = TEXT("Images"), .input = TEXT("labels that move with the lungs and fill 0.4 to 0.96 of them"),
    .against = TEXT("the surface of the lungs"), .measured = TEXT("share of the voxels more than 10 mm outside, and not between the lungs"),
    .told = 0.004, .refused = NAN,
    .evidence = TEXT("tests/evidence/belongs.py, surfaces of 6 and 12 mm edge, told by this row or content-outside: own lungs none of 14, one lung alone none of 28, with the wall of the chest and an organ below none of 14, lungs of others 84 of 84. Outside, own: at most 0.0029; mirrored left and right: 0.0053 to 0.064; the limits were chosen on these. Whether labels of a part of the lungs, such as one nodule, are mirrored, they do not show"),
    .people = 7, .n = 140,
    .interfaces = COMMAND},
  [SUPINE_INPUT_CT_AIR] = {
    .name = TEXT("ct-air"), .group = TEXT("Images"), .input = TEXT("a CT"),
    .against = TEXT("air inside the lungs of the basis"), .measured = TEXT("share of the lungs without air, above -300 HU"),
    .told = 0.15, .refused = 0.5, .evidence = TEXT("tests/evidence/belongs.py, CTs made from label maps: own 0.00, 12 mm off at most 0.13, 30 mm off 0.17 to 0.30, of another person 0.05 to 0.43, 15 of 20 at 0.15 and more; refused: assumed, as half of the lungs may be consolidated"),
    .people = 5, .n = 40,
    .interfaces = COMMAND},
  [SUPINE_INPUT_CT_SOFT] = {
    .name = TEXT("ct-soft"), .group = TEXT("Images"), .input = TEXT("a CT"),
    .against = TEXT("soft tissue that lungs hold"), .measured = TEXT("soft tissue / volume of a lung"),
    .told = 0.05, .refused = NAN, .evidence = TEXT("CTs made from one label map: own 0.006, 12 mm off 0.07, 30 mm off 0.08 and more; that vessels hold less is assumed"),
    .people = 1, .n = 6,
    .interfaces = COMMAND},
  [SUPINE_INPUT_ONE_PERSON] = {
    .name = TEXT("one-person"), .group = TEXT("Two scans"), .input = TEXT("two scans of one posture, also without a lobe or of one lung"),
    .against = TEXT("lines of the width, depth and height of each lung and the left share over the logarithm of the volume ratio"), .measured = TEXT("largest deviation, SD"),
    .told = 3.5, .refused = NAN, .evidence = TEXT("tests/evidence/person.py, leaving people out: five full breaths with COPD and five quiet breaths at most 2.6; of pairs of two people 51 of 61 above 3.5; the limit was chosen on these"),
    .people = 12, .n = 71,
    .interfaces = COMMAND},
  [SUPINE_INPUT_REST_LEAST] = {
    .name = TEXT("rest-least"), .group = TEXT("Two scans"), .input = TEXT("a scan whose state is named from rest"),
    .against = TEXT("the other scan"), .measured = TEXT("volume at rest / at full inflation, as if supine"), .below = true,
    .told = 0.32, .refused = NAN, .evidence = TEXT("healthy people: 0.48 less two SD of 0.08; COPD: from 0.49"),
    .people = 10, .n = 10,
    .interfaces = COMMAND},
  [SUPINE_INPUT_REST_MOST] = {
    .name = TEXT("rest-most"), .group = TEXT("Two scans"), .input = TEXT("a scan whose state is named from rest"),
    .against = TEXT("the other scan"), .measured = TEXT("volume at rest / at full inflation, as if supine"),
    .told = 0.85, .refused = NAN, .evidence = TEXT("COPD: 0.49 to 0.81, and a margin of 0.04"),
    .people = 10, .n = 10,
    .interfaces = COMMAND},
  [SUPINE_INPUT_SCANS_APART] = {
    .name = TEXT("scans-apart"), .group = TEXT("Two scans"), .input = TEXT("the surfaces of two states"),
    .against = TEXT("each other"), .measured = TEXT("RMS distance, mm"), .below = true,
    .told = 0.7, .refused = 0.02,
    .evidence = TEXT("tests/evidence/person.py: one scan, with surfaces of 3 and 6 mm edge, 0.54 to 1.02; states 3 % of full inflation apart, which the model displaced, 1.06 to 1.44; refused: assumed, the same surface"),
    .people = 7, .n = 21,
    .interfaces = COMMAND},
  [SUPINE_INPUT_LANDMARKS_OUTSIDE] = {
    .name = TEXT("landmarks-outside"), .group = TEXT("Landmarks"), .input = TEXT("landmarks and the lungs that they were set in"),
    .against = TEXT("the surface of the lungs"), .measured = TEXT("share of the points more than 5 mm outside"),
    .told = 0.005, .refused = NAN, .evidence = TEXT("tests/evidence/person.py, COPD: own points none in ten scans; of another person 0 to 0.64, above 0.005 in 39 of 40"),
    .people = 5, .n = 50,
    .interfaces = COMMAND},
  [SUPINE_INPUT_LANDMARKS_ORDER] = {
    .name = TEXT("landmarks-order"), .group = TEXT("Landmarks"), .input = TEXT("landmarks from one state to another"),
    .against = TEXT("the growth of the lungs"), .measured = TEXT("growth the other way, standard errors beyond 0.02"),
    .told = NAN, .refused = 2.5, .evidence = TEXT("right sets: none grows the other way; reversed: 6 and more, with 12 pairs three of four are refused"),
    .people = 15, .n = 30,
    .interfaces = COMMAND},
  [SUPINE_INPUT_LANDMARKS_MATCH] = {
    .name = TEXT("landmarks-match"), .group = TEXT("Landmarks"), .input = TEXT("a pair of landmarks"),
    .against = TEXT("the median of its eight neighbours"), .measured = TEXT("difference / median difference, if above 20 mm"),
    .told = 15, .refused = NAN, .evidence = TEXT("right pairs: at most 12.7; of 5 % mismatched ones, 97 % are above"),
    .people = 15, .n = 4277,
    .interfaces = COMMAND},
  [SUPINE_INPUT_PATIENT_BOX] = {
    .name = TEXT("patient-box"), .group = TEXT("Landmarks"), .input = TEXT("a patient's file and lungs"),
    .against = TEXT("the scan that was fitted"), .measured = TEXT("ratio of width, depth or height"),
    .told = 1.05, .refused = NAN, .evidence = TEXT("the same scan, surfaces of 3 and 8 mm edge: at most 1.043"),
    .people = 7, .n = 12,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_PATIENT_VOLUME] = {
    .name = TEXT("patient-volume"), .group = TEXT("Landmarks"), .input = TEXT("a patient's file and lungs, or their given state, or a scan and a state with a volume in mL"),
    .against = TEXT("the scan that was fitted, or that of the state"), .measured = TEXT("ratio of volumes, of a given state at full inflation"),
    .told = 1.1, .refused = NAN, .evidence = TEXT("the same scan, surfaces of 3 and 8 mm edge: 1.000; the margin is assumed"),
    .people = 7, .n = 12,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_SURFACE_TURNED] = {
    .name = TEXT("surface-turned"), .group = TEXT("Surfaces"), .input = TEXT("a file in a format that states which axis is up"),
    .against = TEXT("unchanged coordinates"), .measured = TEXT("turns by the importer"),
    .told = NAN, .refused = 0, .evidence = TEXT("definition"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LOCATE_RESIDUALS] = {
    .name = TEXT("locate-residuals"), .group = TEXT("Observed points"), .input = TEXT("observed points and a volume"),
    .against = TEXT("the error that is expected"), .measured = TEXT("RMS residual / RMS expected error"),
    .told = 1.5, .refused = NAN, .evidence = TEXT("full breaths, 6 to 20 points: told in 1 of 60 fits with the volume unknown, in 50 of 60 with a wrong one"),
    .people = 5, .n = 120, .interfaces = OFFLINE},
  [SUPINE_INPUT_LOCATE_TURNED] = {
    .name = TEXT("locate-turned"), .group = TEXT("Observed points"), .input = TEXT("observed points without a rigid motion"),
    .against = TEXT("the lungs in the state"), .measured = TEXT("turn that fits best, degrees"),
    .told = 10, .refused = NAN,
    .evidence = TEXT("assumed; the residuals must fall to a quarter, and a fitted rotation has an SD of 3 degrees"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_LOCATE_STRETCHED] = {
    .name = TEXT("locate-stretched"), .group = TEXT("Observed points"), .input = TEXT("ten observed points and more"),
    .against = TEXT("the same points in the located lungs"), .measured = TEXT("logarithm of the ratio of width, depth or height, beyond two standard errors"),
    .told = 0.13, .refused = NAN,
    .evidence = TEXT("tests/evidence/lines.py, COPD, 10, 20 and 60 points, the volume known or not: own points at most 0.11, none of 300 fits is told; of other people's points 87 of 240. The limit was chosen on these"),
    .people = 5, .n = 540, .interfaces = OFFLINE},
  [SUPINE_INPUT_SUGGESTION] = {
    .name = TEXT("suggestion"), .group = TEXT("Words"), .input = TEXT("a word that is unknown"),
    .against = TEXT("the words that are known"), .measured = TEXT("share of the characters that differ"),
    .told = 0.4, .refused = NAN, .evidence = TEXT("assumed"),
    .interfaces = ALL},
  [SUPINE_INPUT_FIELDS_DIRECTIONS] = {
    .name = TEXT("fields-directions"), .group = TEXT("Fields"), .input = TEXT("the directions of gravity of another simulator's runs"),
    .against = TEXT("the harmonics to degree 1"), .measured = TEXT("condition number of these four harmonics"),
    .told = NAN, .refused = 7,
    .evidence = TEXT("displacements of the model: even directions 1.0 to 1.2, half of the sphere 3.5 to 4.2, an empty cap of 110 degrees 6.8 to 7.8, where fits err by 31 % of the displacement (at most 68 %) and 9 times as much as stated; a circle, three axes: infinite"),
    .people = 7, .n = 56,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_GAP] = {
    .name = TEXT("fields-gap"), .group = TEXT("Fields"), .input = TEXT("the directions of gravity of another simulator's runs"),
    .against = TEXT("the whole sphere"), .measured = TEXT("angle from the direction farthest from all runs to the nearest, degrees"),
    .told = 75, .refused = NAN,
    .evidence = TEXT("displacements of the model: found / stated error, median, with an empty cap of 50 degrees 1.0, of 80 degrees 4.1, of half of the sphere 7.9 (at most 23); six even directions have a gap of 62, the six axes 54"),
    .people = 7, .n = 728,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_POSITIONS] = {
    .name = TEXT("fields-positions"), .group = TEXT("Fields"), .input = TEXT("the displacements of another simulator"),
    .against = TEXT("the positions of the vertices"), .measured = TEXT("SD of the displacements between vertices / SD of the positions"),
    .told = NAN, .refused = 0.5, .evidence = TEXT("displacements of the model: at most 0.20; positions: about 1"),
    .people = 7, .n = 294,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_GRAVITY] = {
    .name = TEXT("fields-gravity"), .group = TEXT("Fields"), .input = TEXT("the gravity of another simulator's runs"),
    .against = TEXT("one strength of gravity"), .measured = TEXT("largest / smallest length of a row"),
    .told = NAN, .refused = 1.05, .evidence = TEXT("unit vectors rounded to two decimals: at most 1.02; two load steps: 1.5 and more"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_REPEATED] = {
    .name = TEXT("fields-repeated"), .group = TEXT("Fields"), .input = TEXT("directions of gravity that are given again, with other volumes"),
    .against = TEXT("directions with several volumes"), .measured = TEXT("share of the directions that are given once"),
    .told = NAN, .refused = 0.5, .evidence = TEXT("assumed: plans have each direction at all volumes, less what failed"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_COPY] = {
    .name = TEXT("fields-copy"), .group = TEXT("Fields"), .input = TEXT("a run of another simulator"),
    .against = TEXT("all other runs"), .measured = TEXT("runs with exactly the same displacements"),
    .told = 0, .refused = NAN, .evidence = TEXT("definition; tests/evidence/fields.py: two right runs differ by 0.034 of the RMS displacement and more"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_ZERO] = {
    .name = TEXT("fields-zero"), .group = TEXT("Fields"), .input = TEXT("a run of another simulator without any displacement"),
    .against = TEXT("its prediction from the other runs"), .measured = TEXT("RMS of the prediction / median error of all runs, if above 0.3 of the RMS displacement"),
    .told = 2.5, .refused = NAN, .evidence = TEXT("assumed; tests/evidence/fields.py: no right run is of zeros, the smallest 0.22 of the RMS displacement; a run of zeros 11 to 42"),
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_NODE] = {
    .name = TEXT("fields-node"), .group = TEXT("Fields"), .input = TEXT("a displaced point of another simulator"),
    .against = TEXT("its neighbours on the surface"), .measured = TEXT("distance from the neighbours' mean displacement / largest such distance of a neighbour, if above a tenth of the RMS displacement"),
    .told = 3, .refused = NAN, .evidence = TEXT("tests/evidence/fields.py: the model, formulas and CalculiX at most 1.0; a point 60 mm off: 21 and more"),
    .people = 3, .n = 504,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_UNIT] = {
    .name = TEXT("fields-unit"), .group = TEXT("Fields"), .input = TEXT("the displacements of another simulator"),
    .against = TEXT("lungs in gravity"), .measured = TEXT("RMS of what gravity changes, mm"), .below = true,
    .told = 1.5, .refused = NAN, .evidence = TEXT("tests/evidence/fields.py: the model 3.8 to 5.9, formulas 4.0 to 5.5, CalculiX 5.1 to 5.9; in centimetres a tenth"),
    .people = 3, .n = 504,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_LARGE] = {
    .name = TEXT("fields-large"), .group = TEXT("Fields"), .input = TEXT("the displacements of another simulator"),
    .against = TEXT("lungs in gravity"), .measured = TEXT("RMS of what gravity changes, mm"),
    .told = 25, .refused = NAN, .evidence = TEXT("tests/evidence/fields.py: the model, formulas and CalculiX at most 5.9; tenfold: 38 and more"),
    .people = 3, .n = 504,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_FRAME] = {
    .name = TEXT("fields-frame"), .group = TEXT("Fields"), .input = TEXT("gravity and displacements of another simulator"),
    .against = TEXT("lungs that sag along gravity"), .measured = TEXT("what other axes of gravity gain along it, summed over three directions / RMS of what gravity changes"),
    .told = 1.2, .refused = NAN, .evidence = TEXT("tests/evidence/fields.py: CalculiX and formulas that sag 0.00, the model, which hardly sags, at most 0.76; of CalculiX and formulas, gravity in RAS 2.7 and more, negated 4.4, y and z exchanged 1.7; one mirrored axis 0.9 to 2.0: it may pass"),
    .people = 3, .n = 504,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_RUN_SIZE] = {
    .name = TEXT("fields-run-size"), .group = TEXT("Fields"), .input = TEXT("a run of another simulator"),
    .against = TEXT("all other runs"), .measured = TEXT("RMS displacement / largest of the other runs"),
    .told = 5, .refused = NAN, .evidence = TEXT("displacements of the model: at most 1.2; ten times a run of usual size: 8 and more"),
    .people = 7, .n = 294,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_RUN_ERROR] = {
    .name = TEXT("fields-run-error"), .group = TEXT("Fields"), .input = TEXT("a run of another simulator"),
    .against = TEXT("its prediction from the other runs"), .measured = TEXT("RMS error / upper quartile of the other runs, each divided by the norm of the weights of its prediction, if above a twentieth of the RMS displacement"),
    .told = 8, .refused = NAN, .evidence = TEXT("the model, formulas and CalculiX, also without each fifth of the directions, at most 5.5; a run of zeros 46 and more, two exchanged 11.2 and more; the limit was chosen on these sets"),
    .people = 3, .n = 504,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_LEFT_OUT] = {
    .name = TEXT("fields-left-out"), .group = TEXT("Fields"), .input = TEXT("the fields of another simulator"),
    .against = TEXT("runs that are left out"), .measured = TEXT("leave-one-out error / what depends on gravity"),
    .told = 0.8, .refused = 0.95,
    .evidence = TEXT("displacements of the model: 8 even directions and more at most 0.34, the six axes 0.77; rows of 12 directions and more in a random order 0.90 (in further draws 0.84) and more"),
    .people = 7, .n = 294,
    .interfaces = OFFLINE},
  [SUPINE_INPUT_FIELDS_VOLUME] = {
    .name = TEXT("fields-volume"), .group = TEXT("Fields"), .input = TEXT("a volume of lungs whose volumes another simulator computed"),
    .against = TEXT("the simulated volumes in this direction of gravity"), .measured = TEXT("distance outside their range, mL"),
    .told = NAN, .refused = 0, .evidence = TEXT("definition"),
    .interfaces = ALL},
  [SUPINE_INPUT_BASIS_ERROR] = {
    .name = TEXT("basis-error"), .group = TEXT("Bases"), .input = TEXT("the displacements of a basis that was made"),
    .against = TEXT("held-out directions, or runs left out"), .measured = TEXT("RMS error / RMS displacement"),
    .told = NAN, .refused = 0.5, .evidence = TEXT("assumed: half; synthetic lungs with one mode, or with band 0: 0.10, with one mode of the law paper 0.41; a formula's fields with band 0: 1.03"),
    .interfaces = OFFLINE},
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
