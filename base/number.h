/* SPDX-License-Identifier: MIT */
/** @file
 * Parse and print numbers with a decimal point, whatever the locale of the host program.
 *
 * strtod and printf use the decimal mark of the locale that the host has set. These functions call
 * them in the C locale of the calling thread, and are thread-safe. tests/house.py refuses the
 * others. base/locale.h is for libraries that parse or print numbers themselves. */
#ifndef SUPINE_NUMBER_H
#define SUPINE_NUMBER_H

#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>

#include <supine/status.h>

/** Parse a number as strtod does in the C locale, but no hexadecimal one: of 0x10, only the 0.
 * @param end  set to the first character after the number; to `text` if there is no number
 * @return the number; 0 if there is none */
double supine_number_parse(const char *text, char **end);

/** Shorten each run of more than 20 digits in a text, such as those of 1e308 printed by %.0f, to a
 * power of ten: 1.79e+308. */
void supine_number_shorten(char *text);

/** Print like snprintf in the C locale. */
SUPINE_PRINTF(3, 4)
int supine_print_text(char *text, size_t size, const char *format, ...);

/** As supine_print_text, like vsnprintf. */
SUPINE_PRINTF(3, 0)
int supine_print_text_list(char *text, size_t size, const char *format, va_list arguments);

/** A text that is written in parts: what does not fit into `size` bytes is cut off. */
typedef struct supine_writer {
  char *text;
  size_t size;
  size_t length; /**< of the whole text */
} supine_writer;

/** Append to a text, as supine_print_text. */
SUPINE_PRINTF(2, 3)
void supine_writer_add(supine_writer *writer, const char *format, ...);

/** As supine_print_text, to a file, like fprintf; ferror tells whether writing failed. */
SUPINE_PRINTF(2, 3) int supine_print(FILE *file, const char *format, ...);

/** As supine_print, like vfprintf. */
SUPINE_PRINTF(2, 0) int supine_print_list(FILE *file, const char *format, va_list arguments);

#endif
