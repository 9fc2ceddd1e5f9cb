/* SPDX-License-Identifier: MIT */
/* Parse and print numbers in the same way in every locale. */
#include <float.h>
#ifdef _WIN32
#include <locale.h>
#elif !defined __wasm__
#include <langinfo.h>
#endif
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/ascii.h"
#include "base/number.h"

/* ---- Parse ---- */

enum {
  DIGITS_MAX = 770,   /* more digits than a double and its neighbours need to be told apart: 767 */
  EXPONENT_MAX = 9999 /* limit of exponents; all beyond give 0 or infinity */
};

/* A decimal number: `digits`, as an integer, x 10^exponent. */
typedef struct decimal {
  char digits[DIGITS_MAX + 32]; /* without leading zeros; room for a digit and an exponent */
  size_t count;
  long exponent;
} decimal;

/* Read digits with at most one point. Return the end, or NULL if there is no digit. */
static const char *read_digits(const char *at, decimal *number) {
  bool any = false;
  bool after_point = false;
  bool rest = false; /* whether a digit that is not kept is not 0 */
  for (; supine_ascii_is_digit(*at) || (*at == '.' && !after_point); ++at) {
    if (*at == '.') {
      after_point = true;
      continue;
    }
    any = true;
    if (number->count == DIGITS_MAX) {
      rest = rest || *at != '0';
      number->exponent += after_point ? 0 : 1;
      continue;
    }
    if (number->count > 0 || *at != '0') {
      number->digits[number->count++] = *at;
    }
    number->exponent -= after_point ? 1 : 0;
  }
  if (rest) { /* a last digit decides between two neighbours as all further digits would */
    number->digits[number->count++] = '1';
    --number->exponent;
  }
  return any ? at : NULL;
}

/* Read an exponent such as "e-5", if there is one; return its end. */
static const char *read_exponent(const char *at, decimal *number) {
  if (*at != 'e' && *at != 'E') {
    return at;
  }
  const char *digit = at + 1;
  const bool negative = *digit == '-';
  digit += *digit == '-' || *digit == '+' ? 1 : 0;
  if (!supine_ascii_is_digit(*digit)) {
    return at;
  }
  long exponent = 0;
  for (; supine_ascii_is_digit(*digit); ++digit) {
    exponent = exponent < EXPONENT_MAX ? 10 * exponent + (*digit - '0') : exponent;
  }
  number->exponent += negative ? -exponent : exponent;
  return digit;
}

static double value_of(decimal *number) {
  static const double powers[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                  1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                  1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
  const long most = (long)(sizeof powers / sizeof *powers) - 1;
  /* Integer and power are exact, so that one operation rounds correctly (Clinger 1990). */
  if (FLT_EVAL_METHOD == 0 && number->count <= DBL_DIG && labs(number->exponent) <= most) {
    int64_t integer = 0;
    for (size_t i = 0; i < number->count; ++i) {
      integer = 10 * integer + (number->digits[i] - '0');
    }
    return number->exponent < 0 ? (double)integer / powers[-number->exponent]
                                : (double)integer * powers[number->exponent];
  }
  if (number->count == 0) {
    return 0.0;
  }
  /* An integer with an exponent is the same text in every locale. */
  (void)snprintf(number->digits + number->count, sizeof number->digits - number->count, "e%ld",
                 number->exponent);
  return strtod(number->digits, NULL);
}

double supine_number_parse(const char *text, char **end) {
  const char *at = text + strspn(text, " \t\n\v\f\r");
  const bool negative = *at == '-';
  at += *at == '-' || *at == '+' ? 1 : 0;
  if (*at != '\0' && strchr("iInN", *at) != NULL) { /* inf or nan */
    return strtod(text, end);
  }
  decimal number;
  number.count = 0;
  number.exponent = 0;
  at = read_digits(at, &number);
  if (at == NULL) {
    if (end != NULL) {
      *end = (char *)(uintptr_t)text;
    }
    return 0.0;
  }
  at = read_exponent(at, &number);
  if (end != NULL) {
    *end = (char *)(uintptr_t)at;
  }
  const double value = value_of(&number);
  return negative ? -value : value;
}

/* ---- Print ----
 *
 * Where the locale's decimal mark is a point, printf prints. Elsewhere the format is split into its
 * conversions, because commas of the text around a number must stay. */

static bool mark_is_point(void) {
#ifdef _WIN32
  return strcmp(localeconv()->decimal_point, ".") == 0; /* of the calling thread */
#elif defined __wasm__
  return true; /* there is no other locale; the code for others is left out */
#else
  return strcmp(nl_langinfo(RADIXCHAR), ".") == 0;
#endif
}

/* Where text goes: to `file`, or else to `text`, cut off at `size` bytes. */
typedef struct sink {
  FILE *file;
  char *text;
  size_t size;
  size_t length; /* of the whole text */
} sink;

/* A conversion of a format, such as "%-8.3f". */
typedef struct conversion {
  bool left, zeros;
  char flags[4]; /* of "+ #" */
  int width;
  int precision; /* negative if there is none */
  char length;   /* 'l', 'L' for ll, 'z', 't', 'j', or 0 */
  char kind;
} conversion;

typedef struct arguments {
  va_list list;
} arguments;

static void put(sink *out, const char *bytes, size_t count) {
  if (out->file != NULL) {
    (void)fwrite(bytes, 1, count, out->file);
  } else if (out->length < out->size) {
    const size_t room = out->size - out->length;
    memcpy(out->text + out->length, bytes, count < room ? count : room);
  }
  out->length += count;
}

static void pad(sink *out, char with, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    put(out, &with, 1);
  }
}

/* Put a converted value into its width; zeros go after the sign. */
static void put_field(sink *out, const conversion *c, const char *bytes, size_t count) {
  const size_t width = c->width > 0 ? (size_t)c->width : 0;
  const size_t missing = width > count ? width - count : 0;
  const size_t sign = c->zeros && count > 0 && strchr("+- ", bytes[0]) != NULL ? 1 : 0;
  if (!c->left && !c->zeros) {
    pad(out, ' ', missing);
  }
  put(out, bytes, sign);
  if (!c->left && c->zeros) {
    pad(out, '0', missing);
  }
  put(out, bytes + sign, count - sign);
  if (c->left) {
    pad(out, ' ', missing);
  }
}

/* Read a width or precision, a number or '*'; return its end. */
static const char *read_size(const char *at, arguments *from, int *value) {
  if (*at == '*') {
    *value = va_arg(from->list, int);
    return at + 1;
  }
  for (*value = 0; supine_ascii_is_digit(*at); ++at) {
    *value = 10 * *value + (*at - '0');
  }
  return at;
}

/* Read the conversion after a '%'; return its end. */
static const char *read_conversion(const char *at, arguments *from, conversion *c) {
  *c = (conversion){.precision = -1};
  size_t flags = 0;
  for (; *at != '\0' && strchr("-0+ #", *at) != NULL; ++at) {
    c->left = c->left || *at == '-';
    c->zeros = c->zeros || *at == '0';
    if (*at != '-' && *at != '0' && flags + 1 < sizeof c->flags) {
      c->flags[flags++] = *at;
    }
  }
  at = read_size(at, from, &c->width);
  if (c->width < 0) { /* '*' with a negative width */
    c->left = true;
    c->width = -c->width;
  }
  if (*at == '.') {
    at = read_size(at + 1, from, &c->precision);
  }
  if (*at != '\0' && strchr("lztj", *at) != NULL) {
    c->length = *at++;
    if (c->length == 'l' && *at == 'l') {
      c->length = 'L';
      ++at;
    }
  }
  c->kind = *at;
  return *at != '\0' ? at + 1 : at;
}

static intmax_t take_signed(arguments *from, char length) {
  switch (length) {
  case 'l':
    return va_arg(from->list, long);
  case 'L':
    return va_arg(from->list, long long);
  case 'z':
  case 't':
    return va_arg(from->list, ptrdiff_t);
  case 'j':
    return va_arg(from->list, intmax_t);
  default:
    return va_arg(from->list, int);
  }
}

static uintmax_t take_unsigned(arguments *from, char length) {
  switch (length) {
  case 'l':
    return va_arg(from->list, unsigned long);
  case 'L':
    return va_arg(from->list, unsigned long long);
  case 'z':
  case 't':
    return va_arg(from->list, size_t);
  case 'j':
    return va_arg(from->list, uintmax_t);
  default:
    return va_arg(from->list, unsigned);
  }
}

/* Replace the locale's decimal mark, of any number of bytes, by a point. Of what printf writes for
 * a number, only the mark has other characters than letters, digits, signs and blanks. */
static void replace_mark(char *text) {
  static const char others[] = "0123456789+- abcdefinptxyABCDEFINPTXY";
  char *mark = text + strspn(text, others);
  if (*mark != '\0' && strcmp(mark, ".") != 0) {
    const char *rest = mark;
    while (*rest != '\0' && strchr(others, *rest) == NULL) {
      ++rest;
    }
    *mark = '.';
    memmove(mark + 1, rest, strlen(rest) + 1);
  }
}

static void put_number(sink *out, conversion *c, arguments *from) {
  char text[512]; /* a double has at most 310 digits before the point */
  char format[16] = "%";
  const bool real = strchr("efgEFG", c->kind) != NULL;
  char *to = format + 1 + strlen(strcpy(format + 1, c->flags));
  *to++ = '.';
  *to++ = '*';
  if (!real) {
    *to++ = 'j';
  }
  *to = c->kind;
  if (real) {
    const double value = va_arg(from->list, double);
    (void)snprintf(text, sizeof text, format, c->precision, value);
    replace_mark(text);
    c->zeros = c->zeros && value - value == 0.0; /* as printf: no zeros before inf and nan */
  } else {
    if (c->kind == 'd' || c->kind == 'i') {
      (void)snprintf(text, sizeof text, format, c->precision, take_signed(from, c->length));
    } else {
      (void)snprintf(text, sizeof text, format, c->precision, take_unsigned(from, c->length));
    }
    c->zeros = c->zeros && c->precision < 0;
  }
  put_field(out, c, text, strlen(text));
}

static void put_string(sink *out, const conversion *c, const char *text) {
  const char *given = text != NULL ? text : "(null)";
  size_t count = 0;
  while ((c->precision < 0 || count < (size_t)c->precision) && given[count] != '\0') {
    ++count;
  }
  put_field(out, c, given, count);
}

static void put_conversion(sink *out, conversion *c, arguments *from) {
  char text[32];
  switch (c->kind) {
  case 's':
    put_string(out, c, va_arg(from->list, const char *));
    break;
  case 'c':
    text[0] = (char)va_arg(from->list, int);
    put_field(out, c, text, 1);
    break;
  case 'p':
    (void)snprintf(text, sizeof text, "%p", va_arg(from->list, void *));
    put_field(out, c, text, strlen(text));
    break;
  case '%':
    put(out, "%", 1);
    break;
  default:
    put_number(out, c, from);
  }
}

SUPINE_PRINTF(2, 0)
static void print(sink *out, const char *format, va_list list) {
  arguments from;
  va_copy(from.list, list);
  for (const char *at = format; *at != '\0';) {
    const size_t plain = strcspn(at, "%");
    put(out, at, plain);
    at += plain;
    if (*at == '%') {
      conversion c;
      at = read_conversion(at + 1, &from, &c);
      put_conversion(out, &c, &from);
    }
  }
  va_end(from.list);
}

int supine_print_text_list(char *text, size_t size, const char *format, va_list list) {
  if (mark_is_point()) {
    return vsnprintf(text, size, format, list);
  }
  sink out = {.text = text, .size = size};
  print(&out, format, list);
  if (size > 0) {
    text[out.length < size ? out.length : size - 1] = '\0';
  }
  return (int)out.length;
}

int supine_print_list(FILE *file, const char *format, va_list list) {
  if (mark_is_point()) {
    return vfprintf(file, format, list);
  }
  sink out = {.file = file};
  print(&out, format, list);
  return (int)out.length;
}

int supine_print_text(char *text, size_t size, const char *format, ...) {
  va_list list;
  va_start(list, format);
  const int length = supine_print_text_list(text, size, format, list);
  va_end(list);
  return length;
}

int supine_print(FILE *file, const char *format, ...) {
  va_list list;
  va_start(list, format);
  const int length = supine_print_list(file, format, list);
  va_end(list);
  return length;
}
