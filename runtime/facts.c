/* SPDX-License-Identifier: MIT */
/* List what a basis assumes and what it was given. */
#include <math.h>
#include <string.h>

#include <supine/facts.h>
#include <supine/locate.h>

#include "base/number.h"
#include "base/vec3.h"
#include "runtime/expected.h"
#include "runtime/internal.h"

static const char *const source_names[] = {"given",   "measured", "fitted",   "simulated",
                                           "assumed", "computed", "collapsed"};
_Static_assert(sizeof source_names / sizeof *source_names == SUPINE_SOURCE_COUNT,
               "a word for each supine_fact_source");

/* Words of the metadata "sources", which says where facts come from: "axes=file,rest=healthy". */
static const struct {
  const char *word;
  supine_fact_source source;
  const char *origin;
} origins[] = {{"given", SUPINE_SOURCE_GIVEN, ""},
               {"file", SUPINE_SOURCE_GIVEN, "by the file's tag"},
               {"default", SUPINE_SOURCE_ASSUMED, "by default"},
               {"fit", SUPINE_SOURCE_FITTED, "to the patient"},
               {"scan", SUPINE_SOURCE_MEASURED, "in the scan"},
               {"rest", SUPINE_SOURCE_ASSUMED, "from rest"},
               {"given-rest", SUPINE_SOURCE_COMPUTED, "from rest"},
               {"person", SUPINE_SOURCE_ASSUMED, "from height and sex"},
               {"copd", SUPINE_SOURCE_ASSUMED, "from people with COPD"},
               {"healthy", SUPINE_SOURCE_ASSUMED, "from healthy people"}};

const char *supine_fact_source_name(supine_fact_source source) {
  return (unsigned)source < SUPINE_SOURCE_COUNT ? source_names[source] : "unknown";
}

static supine_fact make_fact(const char *name, supine_fact_source source, const char *origin) {
  return (supine_fact){.value = (double)NAN,
                       .low = (double)NAN,
                       .high = (double)NAN,
                       .name = name,
                       .unit = "",
                       .origin = origin,
                       .source = source};
}

/* Set the source of a fact from the metadata "sources", unless they lack the key. */
static void find_source(const supine_basis *basis, const char *key, supine_fact *fact) {
  const char *text = supine_basis_metadata(basis, "sources");
  const size_t length = strlen(key);
  while (text != NULL && !(strncmp(text, key, length) == 0 && text[length] == '=')) {
    text = strchr(text, ',');
    text = text != NULL ? text + 1 : NULL;
  }
  if (text == NULL) {
    return;
  }
  text += length + 1;
  for (size_t i = 0; i < sizeof origins / sizeof *origins; ++i) {
    const size_t word = strlen(origins[i].word);
    if (strncmp(text, origins[i].word, word) == 0 && (text[word] == ',' || text[word] == '\0')) {
      fact->source = origins[i].source;
      fact->origin = origins[i].origin;
    }
  }
}

/* Return the factor e^s to the upper end of the range of an assumed volume. */
static double range_of(const supine_basis *basis) {
  const char *spread = supine_basis_metadata(basis, "resting_spread");
  return exp(spread == NULL ? 0.0 : supine_number_parse(spread, NULL));
}

static void add_range(const supine_basis *basis, supine_fact *fact) {
  const double ratio = range_of(basis);
  if (fact->source == SUPINE_SOURCE_ASSUMED && ratio > 1.0) {
    fact->low = fact->value / ratio;
    fact->high = fact->value * ratio;
  }
}

/* Return the volume of all lungs in a state, mL, or NaN. */
static double volume_of(const supine_basis *basis, const supine_state *state) {
  double volumes[SUPINE_LUNGS_MAX];
  double sum = 0;
  supine_pose pose;
  if (supine_basis_pose_any(basis, state, &pose, NULL) != SUPINE_OK ||
      supine_basis_volumes(basis, &pose, volumes) != SUPINE_OK) {
    return (double)NAN;
  }
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    sum += volumes[lung];
  }
  return sum;
}

static supine_fact axes_of(const supine_basis *basis) {
  supine_fact fact = make_fact("axes of the scan", SUPINE_SOURCE_ASSUMED, "by default");
  const char *axes = supine_basis_metadata(basis, "scan_axes");
  const char *unit = supine_basis_metadata(basis, "scan_unit_mm");
  (void)supine_print_text(fact.text, sizeof fact.text, "%s, %.6g mm a unit",
                          axes != NULL ? axes : "LPS",
                          unit != NULL ? supine_number_parse(unit, NULL) : 1.0);
  find_source(basis, "axes", &fact);
  return fact;
}

static supine_fact scan_of(const supine_basis *basis) {
  static const double supine[3] = {0, 1, 0};
  supine_fact fact = make_fact("state in the scan", SUPINE_SOURCE_ASSUMED, "by default");
  const char *text = supine_basis_metadata(basis, "scan_state");
  supine_state scan = supine_basis_scan(basis);
  supine_state named = {.gravity = {supine[0], supine[1], supine[2]}};
  if (text != NULL && supine_state_parse(text, &named, NULL) == SUPINE_OK) {
    (void)supine_state_describe(&named, fact.text, sizeof fact.text);
  } else if (supine_basis_metadata(basis, "scan_gravity") != NULL) {
    named.gravity[0] = basis->scan_gravity[0];
    named.gravity[1] = basis->scan_gravity[1];
    named.gravity[2] = basis->scan_gravity[2];
    (void)supine_state_describe(&named, fact.text, sizeof fact.text);
  } else {
    (void)supine_print_text(fact.text, sizeof fact.text, "%s",
                            basis->info.is_fields ? "the lungs without gravity"
                                                  : "the reference of every posture");
  }
  fact.value = volume_of(basis, &scan);
  fact.unit = "mL";
  find_source(basis, "scan", &fact);
  return fact;
}

static bool is_collapsed(const supine_basis *basis) {
  bool collapsed = false;
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    collapsed = collapsed || basis->scan_expansion[lung] > 0;
  }
  return collapsed;
}

static supine_fact full_of(const supine_basis *basis) {
  static const supine_state full = {.gravity = {0, 1, 0}, .volume = {SUPINE_VOLUME_FULL, 0}};
  supine_fact fact = make_fact("full inflation, supine", SUPINE_SOURCE_MEASURED, "in the scan");
  fact.value = volume_of(basis, &full);
  fact.unit = "mL";
  find_source(basis, "full", &fact);
  if (fact.source == SUPINE_SOURCE_MEASURED && is_collapsed(basis)) {
    fact.source = SUPINE_SOURCE_COMPUTED;
    fact.origin = "from the scan, with the collapsed lung";
  }
  add_range(basis, &fact);
  return fact;
}

static supine_fact rest_of(const supine_basis *basis) {
  static const supine_state rest = {.gravity = {0, 1, 0}, .volume = {SUPINE_VOLUME_REST, 0}};
  const bool assumed = supine_basis_metadata(basis, "resting_spread") != NULL;
  supine_fact fact =
      make_fact("volume at rest, supine", assumed ? SUPINE_SOURCE_ASSUMED : SUPINE_SOURCE_GIVEN,
                assumed ? "from other people" : "");
  fact.value = volume_of(basis, &rest);
  fact.unit = "mL";
  find_source(basis, "rest", &fact);
  add_range(basis, &fact);
  return fact;
}

/* Return the share of its healthy volume that the file gives a lung; 1 if it is not collapsed. */
static double share_of(const supine_basis *basis, size_t lung) {
  const double length = 1 + basis->scan_expansion[lung];
  return 1 / (length * length * length);
}

static supine_fact collapse_of(const supine_basis *basis, size_t lung) {
  static const char *const names[] = {"left", "right"};
  static const char *const lungs[] = {"left lung", "right lung"};
  supine_fact fact =
      make_fact("lung", SUPINE_SOURCE_COLLAPSED,
                "evenly towards its hilum (assumed), in every state but that of the scan");
  for (size_t i = 0; i < 2; ++i) {
    if (strcmp(basis->info.lung_names[lung], names[i]) == 0) {
      fact.name = lungs[i];
    }
  }
  fact.value = 100 * share_of(basis, lung);
  fact.unit = "% of its healthy volume";
  return fact;
}

static supine_fact law_of(const supine_basis *basis) {
  const bool fitted = supine_basis_metadata(basis, "patient") != NULL;
  const char *law = supine_basis_metadata(basis, "law");
  supine_fact fact = make_fact("law of displacement", SUPINE_SOURCE_ASSUMED, "from other people");
  (void)supine_print_text(fact.text, sizeof fact.text, "%s", law != NULL ? law : "unknown");
  if (fitted) {
    fact.source = SUPINE_SOURCE_FITTED;
    fact.origin = "to the patient";
  } else if (basis->info.is_fields) {
    fact.source = SUPINE_SOURCE_SIMULATED;
    fact.origin = "by another simulator";
    (void)supine_print_text(fact.text, sizeof fact.text, "fields of gravity%s",
                            basis->info.order > 0 ? " and volume" : "");
  }
  return fact;
}

static supine_fact stiffness_of(const supine_basis *basis) {
  const char *text = supine_basis_metadata(basis, "stiffness");
  const char *lesions = supine_basis_metadata(basis, "lesions");
  const bool uniform = text == NULL || strcmp(text, "uniform") == 0;
  supine_fact fact =
      make_fact("stiffness of the tissue", uniform ? SUPINE_SOURCE_ASSUMED : SUPINE_SOURCE_GIVEN,
                uniform ? "by default" : "");
  (void)supine_print_text(fact.text, sizeof fact.text, "%s%s%s", uniform ? "uniform" : text,
                          lesions != NULL ? ", lesions given: " : "",
                          lesions != NULL ? lesions : "");
  return fact;
}

static supine_fact error_of(const supine_basis *basis) {
  const char *fit = supine_basis_metadata(basis, "expected_error_source");
  supine_fact fact = make_fact("constant of the expected error", SUPINE_SOURCE_MEASURED,
                               "on landmarks of 15 people");
  fact.value = supine_expected_constant(basis);
  fact.unit = "mm";
  fact.low = EXPECTED_ERROR_LOW;
  fact.high = EXPECTED_ERROR_HIGH;
  if (fit != NULL) {
    fact.low = fact.high = (double)NAN;
    fact.source = SUPINE_SOURCE_FITTED;
    fact.origin = "to the patient";
  }
  return fact;
}

static supine_fact day_of(void) {
  supine_fact fact = make_fact("change of the lungs to another day", SUPINE_SOURCE_MEASURED,
                               "on landmarks of 9 people");
  fact.value = SUPINE_ANOTHER_DAY_MM;
  fact.unit = "mm";
  return fact;
}

static supine_fact simulated_of(const supine_basis *basis) {
  supine_fact fact =
      make_fact("simulated volumes", SUPINE_SOURCE_SIMULATED, "by another simulator");
  const double *total = basis->simulated.total;
  const double surface = supine_expected_reference(basis);
  (void)supine_print_text(fact.text, sizeof fact.text, "%.0f to %.0f mL", surface + total[0],
                          surface + total[1]);
  return fact;
}

size_t supine_basis_facts(const supine_basis *basis, supine_fact facts[SUPINE_FACTS_MAX]) {
  const supine_basis_info *info = &basis->info;
  size_t count = 0;
  facts[count++] = axes_of(basis);
  facts[count++] = scan_of(basis);
  if (info->order > 0) {
    facts[count++] = simulated_of(basis);
  }
  if (info->has_full && info->has_volume) {
    facts[count++] = full_of(basis);
  }
  if (info->has_rest) {
    facts[count++] = rest_of(basis);
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    if (basis->scan_expansion[lung] > 0) {
      facts[count++] = collapse_of(basis, lung);
    }
  }
  facts[count++] = law_of(basis);
  if (!info->is_fields) {
    facts[count++] = stiffness_of(basis);
    facts[count++] = error_of(basis);
    facts[count++] = day_of();
  }
  return count;
}

/* Append the words, the number and the range of a fact. */
static void append_value(supine_writer *to, const supine_fact *fact) {
  const int decimals = strcmp(fact->unit, "mm") == 0 ? 1 : 0;
  supine_writer_add(to, "%s", fact->text);
  if (isfinite(fact->value)) {
    supine_writer_add(to, "%s%.*f %s", fact->text[0] != '\0' ? ", " : "", decimals, fact->value,
                      fact->unit);
  }
  if (isfinite(fact->low)) {
    supine_writer_add(to, " (%.*f to %.*f)", decimals, fact->low, decimals, fact->high);
  }
}

size_t supine_fact_print(const supine_fact *fact, char *text, size_t size) {
  supine_writer to = {.text = text, .size = size};
  append_value(&to, fact);
  supine_writer_add(&to, ", %s%s%s", supine_fact_source_name(fact->source),
                    fact->origin[0] != '\0' ? " " : "", fact->origin);
  return to.length;
}

bool supine_fact_is_caveat(const supine_fact *fact) {
  return fact->source == SUPINE_SOURCE_ASSUMED || fact->source == SUPINE_SOURCE_SIMULATED ||
         fact->source == SUPINE_SOURCE_COLLAPSED;
}

size_t supine_basis_caveats(const supine_basis *basis, char *text, size_t size) {
  static const supine_fact_source order[] = {SUPINE_SOURCE_COLLAPSED, SUPINE_SOURCE_SIMULATED,
                                             SUPINE_SOURCE_ASSUMED};
  supine_fact facts[SUPINE_FACTS_MAX];
  const size_t count = supine_basis_facts(basis, facts);
  supine_writer to = {.text = text, .size = size};
  if (size > 0) {
    text[0] = '\0';
  }
  for (size_t k = 0; k < sizeof order / sizeof *order; ++k) {
    bool first = true;
    for (size_t i = 0; i < count; ++i) {
      if (facts[i].source == order[k]) {
        supine_writer_add(&to, "%s", first && to.length > 0 ? "; " : "");
        supine_writer_add(&to, first ? "%s: " : ", ", supine_fact_source_name(order[k]));
        supine_writer_add(&to, "%s ", facts[i].name);
        append_value(&to, &facts[i]);
        first = false;
      }
    }
  }
  return to.length;
}

/* Return the kind of volume relative to which a state gives the volume of a lung, and the number
 * beside it. */
static supine_volume volume_in(const supine_basis *basis, const supine_state *state, size_t lung) {
  supine_volume volume = state->volume;
  for (size_t i = 0; i < state->lung_count; ++i) {
    if (strcmp(state->lungs[i].name, basis->info.lung_names[lung]) == 0) {
      volume = state->lungs[i].volume;
    }
  }
  return volume.kind == SUPINE_VOLUME_DEFAULT ? supine_basis_default_volume(basis) : volume;
}

/* Find the volumes of the lungs in the scan, mL; 0 if they are unknown. */
static void find_scanned(const supine_basis *basis, double volumes[SUPINE_LUNGS_MAX]) {
  supine_pose pose;
  memset(volumes, 0, SUPINE_LUNGS_MAX * sizeof *volumes);
  if (supine_basis_scan_pose(basis, &pose, NULL) == SUPINE_OK) {
    (void)supine_basis_volumes(basis, &pose, volumes);
  }
}

/* Return whether gravity has another direction in a state than in the scan. */
static bool is_turned(const supine_basis *basis, const supine_state *state) {
  double unit[3];
  return !supine_normalise(state->gravity, unit) ||
         supine_distance(unit, basis->scan_gravity) > 1e-6;
}

supine_fact supine_basis_lung_volume(const supine_basis *basis, const supine_state *state,
                                     const supine_pose *pose, size_t lung) {
  static const double same = 0.05; /* volumes that differ by less are one volume, mL */
  const supine_volume volume = volume_in(basis, state, lung);
  const supine_volume_kind assumed = supine_expected_assumed(basis);
  supine_fact fact = make_fact(basis->info.lung_names[lung], SUPINE_SOURCE_COMPUTED, "");
  double held[SUPINE_LUNGS_MAX];
  double scanned[SUPINE_LUNGS_MAX];
  double total = 0;
  if (supine_basis_volumes(basis, pose, held) != SUPINE_OK) {
    return fact;
  }
  for (size_t i = 0; i < basis->info.lung_count; ++i) {
    total += held[i];
  }
  find_scanned(basis, scanned);
  fact.value = held[lung];
  fact.unit = "mL";
  if (fabs(held[lung] - scanned[lung]) < same &&
      !(basis->info.is_fields && is_turned(basis, state))) {
    fact.source = SUPINE_SOURCE_MEASURED;
    fact.origin = "in the scan";
    return fact;
  }
  if (basis->info.is_fields) {
    fact.source = SUPINE_SOURCE_SIMULATED;
    fact.origin = "by another simulator";
  } else if (volume.kind == assumed && assumed != SUPINE_VOLUME_DEFAULT) {
    const double share = state->lung_count > 0 ? 1 : held[lung] / total;
    const double above = share * volume.ml; /* part of the volume that is given */
    const double ratio = range_of(basis);
    fact.source = SUPINE_SOURCE_ASSUMED;
    fact.origin = (assumed == SUPINE_VOLUME_REST ? rest_of(basis) : full_of(basis)).origin;
    fact.low = above + (held[lung] - above) / ratio;
    fact.high = above + (held[lung] - above) * ratio;
  } else if (state->lung_count > 0 && volume.kind == SUPINE_VOLUME_ABSOLUTE) {
    fact.source = SUPINE_SOURCE_GIVEN;
  }
  if (basis->scan_expansion[lung] > 0 && pose->expansion[lung] == 0) {
    fact.source = SUPINE_SOURCE_COLLAPSED;
    fact.origin = "from a healthy lung's volume";
  }
  return fact;
}
