/* SPDX-License-Identifier: MIT */
/** @file
 * Parse numbers with units: volumes, lengths, times, angles, pressures and rates. */
#ifndef SUPINE_QUANTITY_H
#define SUPINE_QUANTITY_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

/** What a number measures, and the unit of the parsed value. */
typedef enum supine_quantity {
  SUPINE_QUANTITY_NUMBER = 0, /**< a number without a unit */
  SUPINE_QUANTITY_VOLUME,     /**< mL; texts must name the unit */
  SUPINE_QUANTITY_LENGTH,     /**< mm */
  SUPINE_QUANTITY_HEIGHT,     /**< cm */
  SUPINE_QUANTITY_TIME,       /**< s */
  SUPINE_QUANTITY_ANGLE,      /**< degrees */
  SUPINE_QUANTITY_PRESSURE,   /**< cmH2O */
  SUPINE_QUANTITY_RATE,       /**< times a minute */
  SUPINE_QUANTITY_COUNT
} supine_quantity;

/** A unit, in the first unit of its quantity. */
typedef struct supine_unit {
  const char *name;
  double factor;
} supine_unit;

/** Return the units of a quantity, its own first, ended by a name that is NULL. */
const supine_unit *supine_quantity_list(supine_quantity quantity);

/** Find a unit of a quantity by its name, in any letter case. Return false for any other name.
 * @param factor  the unit, in the first unit of the quantity */
bool supine_quantity_find_unit(supine_quantity quantity, const char *name, double *factor);

/** Return the units of a quantity in words, its own first, such as "mm, cm or m"; "" for numbers.
 */
const char *supine_quantity_units(supine_quantity quantity);

/** Parse a finite number, and a unit of the quantity if one follows, in any letter case.
 * @param value     the number in the unit of the quantity; written, if there is one
 * @param has_unit  written: whether a unit follows the number
 * @return the first character after the number and its unit; NULL if `text` does not begin with a
 *         finite decimal number */
const char *supine_quantity_read(const char *text, supine_quantity quantity, double *value,
                                 bool *has_unit);

/** Parse numbers of a quantity that are separated by commas.
 * @param values  [count] written
 * @retval SUPINE_ERROR_ARGUMENT  the text has another form. If a volume lacks its unit, or a number
 *                                has an unknown one, `error` says so; otherwise it is unchanged */
supine_status supine_quantity_parse(const char *text, supine_quantity quantity, size_t count,
                                    double *values, supine_error *error);

#endif
