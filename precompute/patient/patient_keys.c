/* SPDX-License-Identifier: GPL-3.0-or-later */
/* List the keys of patient.json. */
#include <stddef.h>

#include "precompute/patient/patient_keys.h"

static const char *const lungs_words[] = {"right", "both", "left"};
static const char *const frame_words[] = {"landmarks", "surface"};
static const char *const scan_words[] = {"fuller", "emptier"};
static const char *const applied_words[] = {"surfaces, unreliable in real people", "landmarks"};

/* clang-format off */
#define AT(member) .offset = offsetof(RECORD, member)
#define NUMBER(member) NUMBERS(1, member)
#define NUMBERS(n, member) .kind = SUPINE_PATIENT_NUMBERS, .count = n, AT(member)
#define SIZE(member) .kind = SUPINE_PATIENT_SIZE, AT(member)
#define STATE(member) .kind = SUPINE_PATIENT_STATE, AT(member)
#define WORD(type, member, list)                                                                   \
  .kind = SUPINE_PATIENT_##type##_WORD, AT(member), .count = sizeof(list) / sizeof *(list), .words = list
#define LIST(type, member, most, counter, list)                                                    \
  .kind = SUPINE_PATIENT_LIST, AT(member), .count = most, .length = offsetof(RECORD, counter),     \
  .size = sizeof(type), .members = &list
#define OBJECT .kind = SUPINE_PATIENT_OBJECT
#define OPTIONAL .presence = SUPINE_PATIENT_OPTIONAL
#define WRITTEN .presence = SUPINE_PATIENT_WRITTEN
#define IF_POSITIVE .presence = SUPINE_PATIENT_IF_POSITIVE
#define IF_FLAG(member) .presence = SUPINE_PATIENT_IF_FLAG, .flag = offsetof(RECORD, member)
#define IF_COUNTED(member) .presence = SUPINE_PATIENT_IF_COUNTED, .length = offsetof(RECORD, member)
#define KEYS(list) {sizeof(list) / sizeof *(list), list}

#define RECORD supine_patient_centre
static const supine_patient_key centre_list[] = {
    {"", "lung", WORD(LUNGS, side, lungs_words)},
    {"", "offset_mm", NUMBERS(3, offset)},
    {"", "displacement_mm", NUMBER(size)},
    {"", "weight_per_mm", NUMBERS(3, weight)}};
static const supine_patient_keys centre_keys = KEYS(centre_list);
#undef RECORD

#define RECORD supine_patient_landmark
static const supine_patient_key landmark_list[] = {
    {"", "lung", WORD(LUNGS, side, lungs_words)},
    {"", "offset_mm", NUMBERS(3, offset)}};
static const supine_patient_keys landmark_keys = KEYS(landmark_list);
#undef RECORD

#define RECORD supine_patient_further
static const supine_patient_key further_list[] = {
    {"", "state", STATE(state)},
    {"", "scale", NUMBERS(2, scale)},
    {"", "left_rms_mm", NUMBER(residual)},
    {"", "left_without_gain_mm", NUMBER(residual_without_gain)}};
static const supine_patient_keys further_keys = KEYS(further_list);
#undef RECORD

#define RECORD supine_patient_region
static const supine_patient_key region_list[] = {
    {"", "lung", WORD(LUNGS, side, lungs_words)},
    {"", "expandability", NUMBER(expandability)},
    {"", "centre_mm", NUMBERS(3, centre)},
    {"", "radius_mm", NUMBER(radius)},
    {"", "determined", NUMBER(determined)}};
static const supine_patient_keys region_keys = KEYS(region_list);
#undef RECORD

#define RECORD supine_patient_record
#define SCAN(name, k)                                                                              \
  {"", name, OBJECT}, {name, "state", STATE(state[k])},                                            \
  {name, "volume_ml", NUMBER(volume[k]), IF_POSITIVE},                                             \
  {name, "left_right_ml", NUMBERS(2, measured_lung[k]), IF_POSITIVE}

static const supine_patient_key law_list[] = {
    {"", "name", .kind = SUPINE_PATIENT_STRING, AT(name)},
    {"", "law", .kind = SUPINE_PATIENT_LAW_WORD, AT(patient.law), .count = SUPINE_PATIENT_LAW_COUNT,
     .words = supine_patient_law_names},
    {"", "frame", OBJECT},
    {"frame", "lungs", WORD(LUNGS, patient.frame.only_side, lungs_words)},
    {"frame", "of", WORD(BOOL, from_surface, frame_words)},
    {"frame", "minimum_mm", NUMBERS(3, patient.frame.minimum)},
    {"frame", "maximum_mm", NUMBERS(3, patient.frame.maximum)},
    {"frame", "midline_mm", NUMBER(patient.frame.midline)},
    SCAN("fuller", 0),
    SCAN("emptier", 1),
    {"", "correction", OBJECT},
    {"correction", "centres", LIST(supine_patient_centre, patient.centre, SUPINE_PATIENT_CENTRES_MAX,
                                   patient.centre_count, centre_keys)},
    {"correction", "landmarks", LIST(supine_patient_landmark, patient.landmark,
                                     SUPINE_PATIENT_CENTRES_MAX, patient.landmark_count,
                                     landmark_keys), .presence = SUPINE_PATIENT_IF_COUNTED},
    {"", "further_states", LIST(supine_patient_further, further, SUPINE_PATIENT_OTHERS_MAX,
                                further_count, further_keys), WRITTEN}};
const supine_patient_keys supine_patient_law_keys = KEYS(law_list);

#define SCORES(name, scores)                                                                       \
  {"", name, OBJECT},                                                                              \
  {name, "none", NUMBER(scores[SUPINE_PATIENT_SCORE_NONE])},                                       \
  {name, "translation", NUMBER(scores[SUPINE_PATIENT_SCORE_TRANSLATION])},                         \
  {name, "affine", NUMBER(scores[SUPINE_PATIENT_SCORE_AFFINE])},                                   \
  {name, "law", NUMBER(scores[SUPINE_PATIENT_SCORE_LAW])},                                         \
  {name, "corrected", NUMBER(scores[SUPINE_PATIENT_SCORE_CORRECTED])}

static const supine_patient_key fit_list[] = {
    {"", "points", SIZE(report.points)},
    {"", "blocks", SIZE(report.blocks)},
    SCORES("fitted_rms_mm", report.fitted),
    SCORES("held_out_rms_mm", report.held_out),
    {"held_out_rms_mm", "baseline", NUMBER(report.baseline)},
    {"", "explained_percent", NUMBER(report.explained)},
    {"", "error_in_fuller_scan", NUMBER(report.stretch)},
    {"", "expected_rms_mm", NUMBER(report.expected_point)},
    {"", "expected_constant_mm", NUMBER(report.expected_constant)},
    {"", "expected_from_mm", NUMBER(report.expected_from)},
    {"", "expected_share_held_out", NUMBER(report.expected_share), IF_POSITIVE},
    {"", "band_95_percent_holds", NUMBER(report.band), IF_FLAG(report.has_band)},
    {"", "emptier_frame", OBJECT},
    {"emptier_frame", "minimum_mm", NUMBERS(3, emptier[0])},
    {"emptier_frame", "maximum_mm", NUMBERS(3, emptier[1])},
    {"", "force", OBJECT},
    {"force", "base", NUMBER(force.base)},
    {"force", "gain", NUMBER(force.gain)},
    {"force", "gain_standard_error", NUMBER(gain_error), IF_FLAG(gain_fitted)},
    {"force", "box", NUMBERS(3, force.box)},
    {"", "motion", OBJECT},
    {"motion", "translation_mm", NUMBERS(3, patient.power.motion[0])},
    {"motion", "rotation_rad", NUMBERS(3, patient.power.motion[3])},
    {"", "c1_to_c9", NUMBERS(SUPINE_PATIENT_CONSTANTS, patient.power.c)},
    {"", "standard_errors", NUMBERS(SUPINE_PATIENT_CONSTANTS, report.error), IF_FLAG(report.has_errors)},
    {"", "basis", OBJECT, IF_FLAG(in_basis)},
    {"basis", "scan", WORD(SIZE, shown, scan_words)},
    {"basis", "path_span", NUMBERS(3, path_span)},
    {"", "surface", OBJECT, IF_COUNTED(surface.vertices)},
    {"surface", "vertices", SIZE(surface.vertices)},
    {"surface", "matched_share", NUMBER(surface.matched), OPTIONAL},
    {"surface", "rms_before_mm", NUMBER(surface.before), OPTIONAL},
    {"surface", "rms_after_mm", NUMBER(surface.after), OPTIONAL},
    {"", "expandability", OBJECT, IF_FLAG(expand.tried)},
    {"expandability", "unseen_regions", SIZE(expand.undetermined)},
    {"expandability", "fitted_without_and_with_mm", NUMBERS(2, expand.fitted), OPTIONAL},
    {"expandability", "held_out_without_and_with_mm", NUMBERS(2, expand.held_out), OPTIONAL},
    {"expandability", "regions", LIST(supine_patient_region, stiffness.region, SUPINE_PATIENT_REGIONS_MAX,
                                      stiffness.count, region_keys), .presence = SUPINE_PATIENT_IF_COUNTED},
    {"expandability", "kept", .kind = SUPINE_PATIENT_BOOL, AT(expand.kept)},
    {"", "applied_force", OBJECT, IF_COUNTED(applied.blocks)},
    {"applied_force", "computed_from", WORD(BOOL, applied.from_landmarks, applied_words), OPTIONAL},
    {"applied_force", "blocks", SIZE(applied.blocks)},
    {"applied_force", "correlation_with_height", NUMBER(applied.correlation), OPTIONAL},
    {"applied_force", "c7_to_c9", NUMBERS(3, applied.slopes), OPTIONAL},
    {"applied_force", "left_rms", NUMBER(applied.residual), OPTIONAL},
    {"applied_force", "spread_rms", NUMBER(applied.spread), OPTIONAL}};
const supine_patient_keys supine_patient_fit_keys = KEYS(fit_list);
/* clang-format on */
