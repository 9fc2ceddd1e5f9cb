/* SPDX-License-Identifier: MIT */
/* Parse numbers with units: volumes, lengths, times, angles, pressures and rates. */
#include <math.h>
#include <string.h>

#include "base/ascii.h"
#include "base/number.h"
#include "base/quantity.h"

/* A pressure of 1 kPa in cmH2O, at 4 degrees Celsius [ISO 80000-4]. */
#define CMH2O_PER_KPA 10.19716

enum { UNITS_MAX = 6 };

static const struct {
  supine_unit unit[UNITS_MAX]; /* ended by a name that is NULL */
  const char *words;           /* the units, for messages */
  const char *example;         /* for quantities whose texts must name the unit; otherwise NULL */
} quantities[] = {
    [SUPINE_QUANTITY_NUMBER] = {.words = ""},
    [SUPINE_QUANTITY_VOLUME] = {{{"mL", 1}, {"L", 1000}}, "mL or L", "500mL or 0.5L"},
    [SUPINE_QUANTITY_LENGTH] = {{{"mm", 1}, {"cm", 10}, {"m", 1000}, {"um", 1e-3}, {"in", 25.4}},
                                "mm, cm or m",
                                NULL},
    [SUPINE_QUANTITY_HEIGHT] = {{{"cm", 1}, {"m", 100}, {"mm", 0.1}}, "cm, m or mm", NULL},
    [SUPINE_QUANTITY_TIME] = {{{"s", 1}, {"ms", 1e-3}, {"min", 60}}, "s, ms or min", NULL},
    [SUPINE_QUANTITY_ANGLE] = {{{"deg", 1}, {"\xC2\xB0", 1}}, "deg", NULL},
    [SUPINE_QUANTITY_PRESSURE] = {{{"cmH2O", 1},
                                   {"kPa", CMH2O_PER_KPA},
                                   {"hPa", CMH2O_PER_KPA / 10},
                                   {"mmHg", CMH2O_PER_KPA * 0.133322}},
                                  "cmH2O, kPa, hPa or mmHg",
                                  NULL},
    [SUPINE_QUANTITY_RATE] = {{{"/min", 1}, {"/s", 60}}, "/min or /s", NULL}};
_Static_assert(sizeof quantities / sizeof *quantities == SUPINE_QUANTITY_COUNT,
               "each quantity needs units");

const char *supine_quantity_units(supine_quantity quantity) {
  return quantities[quantity].words;
}

const supine_unit *supine_quantity_list(supine_quantity quantity) {
  return quantities[quantity].unit;
}

bool supine_quantity_find_unit(supine_quantity quantity, const char *name, double *factor) {
  for (const supine_unit *unit = supine_quantity_list(quantity); unit->name != NULL; ++unit) {
    if (supine_ascii_same(name, unit->name)) {
      *factor = unit->factor;
      return true;
    }
  }
  return false;
}

/* Return whether a unit that `text` begins with ends there: no letter or digit follows. */
static bool ends(const char *text) {
  static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789/";
  return *text == '\0' || strchr(letters, *text) == NULL;
}

const char *supine_quantity_read(const char *text, supine_quantity quantity, double *value,
                                 bool *has_unit) {
  char *end = NULL;
  const double number = supine_number_parse(text, &end);
  *has_unit = false;
  if (end == text || !isfinite(number)) {
    return NULL;
  }
  *value = number;
  for (const supine_unit *unit = supine_quantity_list(quantity); unit->name != NULL; ++unit) {
    const size_t length = strlen(unit->name);
    if (supine_ascii_same_begin(end, unit->name, length) && ends(end + length)) {
      *has_unit = true;
      *value = number * unit->factor;
      return isfinite(*value) ? end + length : NULL;
    }
  }
  return end;
}

/* Say that the unit of the number `text` [length] is missing or unknown. */
static supine_status refuse_unit(const char *text, size_t length, supine_quantity quantity,
                                 bool missing, supine_error *error) {
  if (missing) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "'%.*s' has no unit: give a volume such as %s", (int)length, text,
                            quantities[quantity].example);
  }
  return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "'%.*s' has an unknown unit: give %s",
                          (int)length, text, quantities[quantity].words);
}

supine_status supine_quantity_parse(const char *text, supine_quantity quantity, size_t count,
                                    double *values, supine_error *error) {
  const char *at = text;
  for (size_t i = 0; i < count; ++i) {
    bool has_unit = false;
    const size_t length = strcspn(at, ",");
    const char *end = supine_quantity_read(at, quantity, &values[i], &has_unit);
    if (end == NULL) {
      return SUPINE_ERROR_ARGUMENT;
    }
    if (end != at + length) {
      const bool letter = (*end | 32) >= 'a' && (*end | 32) <= 'z';
      return quantity != SUPINE_QUANTITY_NUMBER && letter
                 ? refuse_unit(at, length, quantity, false, error)
                 : SUPINE_ERROR_ARGUMENT;
    }
    if (!has_unit && quantities[quantity].example != NULL) {
      return refuse_unit(at, length, quantity, true, error);
    }
    if (at[length] != (i + 1 < count ? ',' : '\0')) {
      return SUPINE_ERROR_ARGUMENT;
    }
    at = end + 1;
  }
  return SUPINE_OK;
}
