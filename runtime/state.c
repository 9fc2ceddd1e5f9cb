/* SPDX-License-Identifier: MIT */
/* Parse and print states. */
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/state.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/vec3.h"
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

/* Read a number, with or without the unit "mL" or "L"; the value is then in mL. */
static bool read_number(const char *text, double *value, bool *has_unit) {
  char *end = NULL;
  *value = supine_number_parse(text, &end);
  const bool litres = supine_words_same(end, "L");
  *has_unit = litres || supine_words_same(end, "mL");
  *value *= litres ? 1000 : 1;
  return end != text && (*has_unit || *end == '\0') && isfinite(*value);
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

/* Read a tilted posture, such as "supine+15". */
static bool read_tilted(const char *text, double gravity[3]) {
  const size_t length = strcspn(text, "+-");
  char front[PIECE];
  char *end = NULL;
  double level[3];
  const double degrees = supine_number_parse(text + length, &end);
  if (length >= sizeof front || text[length] == '\0' || *end != '\0') {
    return false;
  }
  (void)snprintf(front, sizeof front, "%.*s", (int)length, text);
  return supine_posture_gravity(front, level) == SUPINE_OK &&
         supine_posture_tilt(level, degrees, gravity) == SUPINE_OK;
}

supine_status supine_state_parse_posture(const char *text, supine_state *state,
                                         supine_error *error) {
  double gravity[3];
  if (supine_posture_gravity(text, gravity) == SUPINE_OK || read_tilted(text, gravity) ||
      read_gravity(text, gravity)) {
    memcpy(state->gravity, gravity, sizeof gravity);
    return SUPINE_OK;
  }
  if (strchr(text, ':') != NULL || strchr("+-.0123456789", text[0]) != NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "'%s': gravity is three numbers X:Y:Z, not all 0; supine is 0:1:0",
                            text);
  }
  return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "no posture '%s'; did you mean '%s'?", text,
                          supine_posture_nearest(text));
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
    const bool number = strchr("+-.0123456789", text[0]) != NULL || equals != NULL;
    return number ? supine_error_set(error, volume_error.status, "%s", volume_error.message)
                  : supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                     "'%s' is neither a posture (did you mean '%s'?) nor a volume "
                                     "(rest, full or scan, with +ML or -ML, or 2600mL)",
                                     text, supine_posture_nearest(text));
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

/* A text being written, cut off at `size` bytes. `length` is the length of the whole text. */
typedef struct writer {
  char *text;
  size_t size;
  size_t length;
} writer;

SUPINE_PRINTF(2, 3)
static void add(writer *out, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  const size_t at = out->length < out->size ? out->length : out->size;
  const int count = supine_print_text_list(out->size > at ? out->text + at : NULL, out->size - at,
                                           format, arguments);
  va_end(arguments);
  out->length += count > 0 ? (size_t)count : 0;
}

static void add_posture(writer *out, const double gravity[3], bool described) {
  enum { PLAIN = 6 }; /* supine, prone, left, right, upright and inverted come first */
  const double *g = gravity;
  for (size_t i = 0; i < PLAIN; ++i) {
    double named[3];
    (void)supine_posture_gravity(supine_posture_name(i), named);
    if (g[0] * named[0] + g[1] * named[1] + g[2] * named[2] > 1 - 1e-14) {
      add(out, "%s%s", supine_posture_name(i), described && named[0] != 0 ? " side" : "");
      return;
    }
  }
  if (g[0] == 0) { /* print gravity without a lateral part as tilted supine or prone */
    const double degrees = atan2(g[2], fabs(g[1])) * (180 / 3.14159265358979323846);
    add(out, "%s%+.9g", g[1] >= 0 ? "supine" : "prone", g[1] >= 0 ? degrees : -degrees);
    return;
  }
  add(out, described ? "gravity %.3g:%.3g:%.3g" : "%.9g:%.9g:%.9g", g[0], g[1], g[2]);
}

static void add_volume(writer *out, const supine_volume *volume, bool described) {
  static const char *const phrases[] = {[SUPINE_VOLUME_DEFAULT] = "",
                                        [SUPINE_VOLUME_REST] = "at rest",
                                        [SUPINE_VOLUME_FULL] = "at full inflation",
                                        [SUPINE_VOLUME_SCAN] = "at the scan's volume"};
  if (volume->kind == SUPINE_VOLUME_ABSOLUTE) {
    add(out, described ? "at %.0f mL" : "%.9gmL", volume->ml);
    return;
  }
  add(out, "%s", (described ? phrases : kinds)[volume->kind]);
  if (volume->ml != 0 && described) {
    add(out, " %c %.9g mL", volume->ml < 0 ? '-' : '+', fabs(volume->ml));
  } else if (volume->ml != 0) {
    add(out, "%+.9g", volume->ml);
  }
}

/* Write a state as text to parse, or as a description. */
static size_t add_state(const supine_state *state, bool described, char *text, size_t size) {
  writer out = {text, size, 0};
  add_posture(&out, state->gravity, described);
  if (state->lung_count == 0 && state->volume.kind != SUPINE_VOLUME_DEFAULT) {
    add(&out, described ? " " : ":");
    add_volume(&out, &state->volume, described);
  }
  for (size_t i = 0; i < state->lung_count; ++i) {
    add(&out, described ? ", %s lung " : i == 0 ? ":%s=" : ",%s=", state->lungs[i].name);
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
