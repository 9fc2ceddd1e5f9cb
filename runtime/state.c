/* SPDX-License-Identifier: MIT */
/* Parse and print states. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/inputs.h>
#include <supine/state.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/quantity.h"
#include "base/vec3.h"
#include "runtime/internal.h"
#include "runtime/words.h"

static const char *const kinds[] = {[SUPINE_VOLUME_DEFAULT] = "",
                                    [SUPINE_VOLUME_REST] = "rest",
                                    [SUPINE_VOLUME_FULL] = "full",
                                    [SUPINE_VOLUME_SCAN] = "scan",
                                    [SUPINE_VOLUME_ABSOLUTE] = ""};
_Static_assert(sizeof kinds / sizeof *kinds == SUPINE_VOLUME_KIND_COUNT,
               "each kind of volume needs a name");

static const struct {
  const char *word;
  supine_volume_kind kind;
} words[] = {{"rest", SUPINE_VOLUME_REST},
             {"FRC", SUPINE_VOLUME_REST},
             {"full", SUPINE_VOLUME_FULL},
             {"TLC", SUPINE_VOLUME_FULL},
             {"scan", SUPINE_VOLUME_SCAN}};

enum { PIECE = 64 }; /* size of a posture or volume as text, in bytes with its NUL */

/* Read a volume, with or without a unit; the value is in mL. */
static bool read_number(const char *text, double *value, bool *has_unit) {
  const char *end = supine_quantity_read(text, SUPINE_QUANTITY_VOLUME, value, has_unit);
  return end != NULL && *end == '\0';
}

static supine_status read_volume(const char *text, supine_volume *volume, supine_error *error) {
  bool has_unit = false;
  double value = 0;
  for (int i = 0; i < (int)(sizeof words / sizeof *words); ++i) {
    const size_t length = strlen(words[i].word);
    char front[PIECE];
    (void)snprintf(front, sizeof front, "%.*s", (int)length, text);
    if (!supine_words_same(front, words[i].word)) {
      continue;
    }
    const char *offset = text + length;
    if (*offset == '\0' ||
        ((*offset == '+' || *offset == '-') && read_number(offset, &value, &has_unit))) {
      *volume = (supine_volume){words[i].kind, value};
      return SUPINE_OK;
    }
  }
  if (read_number(text, &value, &has_unit)) {
    if (has_unit && value > 0) {
      *volume = (supine_volume){SUPINE_VOLUME_ABSOLUTE, value};
      return SUPINE_OK;
    }
    if (!has_unit) {
      return supine_error_set(
          error, SUPINE_ERROR_ARGUMENT,
          "'%s' needs a reference: rest%+g (from the end of a quiet expiration), full%+g "
          "(from full inflation), scan%+g (from the volume scanned), or %gmL (as measured in a CT)",
          text, value, -fabs(value), value, fabs(value));
    }
  }
  return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                          "no volume '%s': give rest, full or scan, with +ML or -ML (rest+500), "
                          "or an absolute volume (2600mL, 2.6L)",
                          text);
}

/* Read the volume of each lung from text such as "left=rest,right=rest+300". */
static supine_status read_lungs(const char *text, supine_state *state, supine_error *error) {
  supine_state read = *state;
  read.lung_count = 0;
  read.volume = (supine_volume){0};
  for (const char *at = text;;) {
    const size_t length = strcspn(at, "=,:");
    const char *value = at + length + (at[length] == '=');
    const size_t size = strcspn(value, ",");
    if (at[length] != '=' || length == 0 || length >= SUPINE_STATE_NAME_SIZE || size >= PIECE) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "'%s': give the volume of each lung as left=VOLUME,right=VOLUME",
                              text);
    }
    if (read.lung_count == SUPINE_STATE_LUNGS_MAX) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "'%s' names more than %d lungs: name each once", text,
                              SUPINE_STATE_LUNGS_MAX);
    }
    char piece[PIECE];
    (void)snprintf(piece, sizeof piece, "%.*s", (int)size, value);
    (void)snprintf(read.lungs[read.lung_count].name, SUPINE_STATE_NAME_SIZE, "%.*s", (int)length,
                   at);
    SUPINE_TRY(read_volume(piece, &read.lungs[read.lung_count].volume, error));
    ++read.lung_count;
    if (value[size] == '\0') {
      *state = read;
      return SUPINE_OK;
    }
    at = value + size + 1;
  }
}

supine_status supine_state_parse_volume(const char *text, supine_state *state,
                                        supine_error *error) {
  if (strchr(text, '=') != NULL) {
    return read_lungs(text, state, error);
  }
  supine_volume volume;
  SUPINE_TRY(read_volume(text, &volume, error));
  state->volume = volume;
  state->lung_count = 0;
  return SUPINE_OK;
}

/* Read gravity as "X:Y:Z", a vector of any length but 0, and normalise it. */
static bool read_gravity(const char *text, double gravity[3]) {
  double g[3];
  for (int i = 0; i < 3; ++i) {
    char *end = NULL;
    g[i] = supine_number_parse(text, &end);
    if (end == text || *end != (i < 2 ? ':' : '\0')) {
      return false;
    }
    text = end + 1;
  }
  return supine_normalise(g, gravity);
}

/* Read an angle in degrees that follows a sign, up to the end or to `stop`. */
static bool read_angle(const char *text, char stop, double *degrees, const char **after) {
  bool has_unit = false;
  *after = supine_quantity_read(text, SUPINE_QUANTITY_ANGLE, degrees, &has_unit);
  return *after != NULL && (**after == '\0' || (stop != '\0' && **after == stop));
}

/* A posture that is turned: "supine+15" (tilted), "supine@30" (rolled), "supine@30+15" (both). */
typedef struct turned {
  double level[3]; /* gravity in the posture that is named */
  bool is_rolled, is_tilted;
  double roll, tilt; /* degrees */
} turned;

/* Read a posture that is turned. Return false if it is not turned, or is wrong. */
static bool read_turned(const char *text, turned *read) {
  const size_t length = strcspn(text, "+-@>");
  const char *at = text + length;
  char front[PIECE];
  *read = (turned){.is_rolled = *at == '@' || *at == '>'};
  if (length >= sizeof front || *at == '\0') {
    return false;
  }
  (void)snprintf(front, sizeof front, "%.*s", (int)length, text);
  if (supine_posture_gravity(front, read->level) != SUPINE_OK) {
    return false;
  }
  if (read->is_rolled) {
    const size_t sign = at[1] == '+' || at[1] == '-' ? 1 : 0;
    const size_t digits = strspn(at + 1 + sign, "0123456789.");
    const char stop = at[1 + sign + digits];
    if (!read_angle(at + 1, stop == '-' ? '-' : '+', &read->roll, &at)) {
      return false;
    }
  }
  read->is_tilted = *at != '\0';
  return !read->is_tilted || read_angle(at, '\0', &read->tilt, &at);
}

/* Find gravity in a turned posture. */
static supine_status turn(const char *text, const turned *read, double gravity[3],
                          supine_error *error) {
  const bool lies = read->level[0] != 0 || read->level[1] != 0;
  if (read->is_rolled && !lies) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "'%s': a roll about the long axis changes nothing in an upright body: "
                            "roll a lying posture, as in supine@30",
                            text);
  }
  if (supine_posture_roll(read->level, read->roll, gravity) != SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "'%s' is rolled by %g degrees: give -180 to 180; + turns to the left",
                            text, read->roll);
  }
  if (supine_posture_tilt(gravity, read->tilt, gravity) != SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "'%s' is tilted by %g degrees, and a body by at most 90: for a volume, "
                            "write supine:rest%+g",
                            text, read->tilt, read->tilt);
  }
  return SUPINE_OK;
}

/* Refuse a text that is no posture, and suggest the posture that may be meant. */
static supine_status refuse_posture(const char *text, supine_error *error) {
  const char *nearest = supine_posture_nearest(text);
  if (strchr(text, ':') != NULL || strchr("+-.0123456789", text[0]) != NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "'%s': gravity is three numbers X:Y:Z, not all 0; supine is 0:1:0",
                            text);
  }
  if (nearest != NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "no posture '%s'; did you mean '%s'?",
                            text, nearest);
  }
  return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                          "no posture '%.64s': give supine, prone, left, right, upright, inverted, "
                          "or gravity X:Y:Z",
                          text);
}

supine_status supine_state_parse_posture(const char *text, supine_state *state,
                                         supine_error *error) {
  double gravity[3];
  turned read;
  if (read_turned(text, &read)) {
    SUPINE_TRY(turn(text, &read, gravity, error));
  } else if (supine_posture_gravity(text, gravity) != SUPINE_OK && !read_gravity(text, gravity)) {
    return refuse_posture(text, error);
  }
  memcpy(state->gravity, gravity, sizeof gravity);
  return SUPINE_OK;
}

/* Refuse a text without a colon that is neither a posture nor a volume.
 * @param volume_error  why it is no volume */
static supine_status refuse_state(const char *text, const supine_error *volume_error,
                                  supine_error *error) {
  const char *nearest = supine_posture_nearest(text);
  turned read;
  if (strchr("+-.0123456789", text[0]) != NULL || strchr(text, '=') != NULL) {
    return supine_error_wrap(error, volume_error, "%s", "");
  }
  if (read_turned(text, &read)) {
    double gravity[3];
    return turn(text, &read, gravity, error);
  }
  if (nearest != NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "'%s' is neither a posture (did you mean '%s'?) nor a volume (rest, "
                            "full or scan, with +ML or -ML, or 2600mL)",
                            text, nearest);
  }
  return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                          "'%.64s' is neither a posture (supine, prone, left, right, upright, "
                          "inverted, X:Y:Z) nor a volume (rest, full or scan, with +ML or -ML, or "
                          "2600mL)",
                          text);
}

static bool has_volume(const supine_state *state) {
  return state->lung_count > 0 || state->volume.kind != SUPINE_VOLUME_DEFAULT;
}

supine_status supine_state_join(const supine_state *posture, const supine_state *volume,
                                supine_state *state, supine_error *error) {
  supine_state joined = has_volume(posture) ? *posture : *volume;
  const int volumes = (int)has_volume(posture) + (int)has_volume(volume);
  if (supine_input_judge(SUPINE_INPUT_VOLUMES_OF_A_STATE, volumes) == SUPINE_INPUT_REFUSED) {
    char text[2][160];
    supine_state second = *volume;
    memcpy(second.gravity, posture->gravity, sizeof second.gravity);
    (void)supine_state_print(posture, text[0], sizeof text[0]);
    (void)supine_state_print(&second, text[1], sizeof text[1]);
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "two volumes are given, by %.100s and by %.100s: give the volume once",
                            text[0], strchr(text[1], ':') + 1);
  }
  memcpy(joined.gravity, posture->gravity, sizeof joined.gravity);
  *state = joined;
  return SUPINE_OK;
}

supine_status supine_state_parse(const char *text, supine_state *state, supine_error *error) {
  supine_state read = *state;
  supine_error volume_error = {0};
  const char *colon = strrchr(text, ':');
  if (supine_state_parse_volume(text, &read, &volume_error) == SUPINE_OK ||
      supine_state_parse_posture(text, &read, NULL) == SUPINE_OK) {
    *state = read;
    return SUPINE_OK;
  }
  const char *equals = strchr(text, '=');
  if (equals != NULL && colon != NULL && colon > equals) { /* LUNG=VOLUME is no posture */
    colon = NULL;
  }
  if (colon == NULL) {
    return refuse_state(text, &volume_error, error);
  }
  char posture[PIECE];
  if ((size_t)(colon - text) >= sizeof posture) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "no posture '%.64s...': give a posture such as supine", text);
  }
  (void)snprintf(posture, sizeof posture, "%.*s", (int)(colon - text), text);
  SUPINE_TRY(supine_state_parse_posture(posture, &read, error));
  SUPINE_TRY(supine_state_parse_volume(colon + 1, &read, error));
  *state = read;
  return SUPINE_OK;
}

/* Return whether an angle has at most one decimal. Other angles were given as gravity. */
static bool is_round(double degrees) {
  return fabs(10 * degrees - round(10 * degrees)) < 1e-6;
}

static void add_posture(supine_writer *out, const double gravity[3], bool described) {
  enum { PLAIN = 6 }; /* supine, prone, left, right, upright and inverted come first */
  const double degrees = 180 / 3.14159265358979323846;
  const double *g = gravity;
  for (size_t i = 0; i < PLAIN; ++i) {
    double named[3];
    (void)supine_posture_gravity(supine_posture_name(i), named);
    if (g[0] * named[0] + g[1] * named[1] + g[2] * named[2] > 1 - 1e-14) {
      supine_writer_add(out, "%s%s", supine_posture_name(i),
                        described && named[0] != 0 ? " side" : "");
      return;
    }
  }
  const double level = hypot(g[0], g[1]);
  const double tilt = atan2(g[2], level) * degrees;
  const double roll = atan2(g[0], g[1]) * degrees;
  if (g[0] == 0) {
    supine_writer_add(out, "%s%+.9g", supine_posture_name(g[1] >= 0 ? 0U : 1U), tilt);
    return;
  }
  if (g[1] == 0 && is_round(tilt)) {
    supine_writer_add(out, "%s%+.9g", supine_posture_name(g[0] > 0 ? 2U : 3U), tilt);
    return;
  }
  if (g[2] == 0 && is_round(roll)) {
    supine_writer_add(out, "supine@%.9g", roll);
    return;
  }
  supine_writer_add(out, described ? "gravity %.3g:%.3g:%.3g" : "%.9g:%.9g:%.9g", g[0], g[1], g[2]);
}

static void add_volume(supine_writer *out, const supine_volume *volume, bool described) {
  static const char *const phrases[] = {[SUPINE_VOLUME_DEFAULT] = "",
                                        [SUPINE_VOLUME_REST] = "at rest",
                                        [SUPINE_VOLUME_FULL] = "at full inflation",
                                        [SUPINE_VOLUME_SCAN] = "at the scan's volume"};
  if (volume->kind == SUPINE_VOLUME_ABSOLUTE) {
    supine_writer_add(out, described ? "at %.0f mL" : "%.9gmL", volume->ml);
    return;
  }
  supine_writer_add(out, "%s", (described ? phrases : kinds)[volume->kind]);
  if (volume->ml != 0 && described) {
    supine_writer_add(out, " %c %.9g mL", volume->ml < 0 ? '-' : '+', fabs(volume->ml));
  } else if (volume->ml != 0) {
    supine_writer_add(out, "%+.9g", volume->ml);
  }
}

/* Write a state as text to parse, or as a description. */
static size_t add_state(const supine_state *state, bool described, char *text, size_t size) {
  supine_writer out = {text, size, 0};
  add_posture(&out, state->gravity, described);
  if (state->lung_count == 0 && state->volume.kind != SUPINE_VOLUME_DEFAULT) {
    supine_writer_add(&out, described ? " " : ":");
    add_volume(&out, &state->volume, described);
  }
  for (size_t i = 0; i < state->lung_count; ++i) {
    const char *format = i == 0 ? ":%s=" : ",%s=";
    supine_writer_add(&out, described ? ", %s lung " : format, state->lungs[i].name);
    add_volume(&out, &state->lungs[i].volume, described);
  }
  return out.length;
}

size_t supine_state_print(const supine_state *state, char *text, size_t size) {
  return add_state(state, false, text, size);
}

size_t supine_state_describe(const supine_state *state, char *text, size_t size) {
  return add_state(state, true, text, size);
}

supine_status supine_basis_refuse_gravity(supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                          "gravity is zero or not finite: give a vector with a direction");
}

supine_status supine_basis_refuse_kind(supine_volume_kind kind, supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                          "volume kind %d is unknown: use a value of supine_volume_kind",
                          (int)kind);
}
