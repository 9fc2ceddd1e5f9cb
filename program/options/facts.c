/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print what a basis assumes and was given. */
#include <math.h>
#include <stdio.h>

#include "base/locale.h"

#include "program/options/command.h"
#include "program/options/facts.h"

enum { FACT_SIZE = 320 }; /* bytes that hold supine_fact_print */

/* Return a number, or null if it is not finite. */
static json_t *number(double value) {
  return isfinite(value) ? json_real(value) : json_null();
}

json_t *supine_options_facts(const supine_basis *basis, bool as_text) {
  supine_fact facts[SUPINE_FACTS_MAX];
  const size_t count = supine_basis_facts(basis, facts);
  json_t *list = json_array();
  for (size_t i = 0; i < count; ++i) {
    const supine_fact *f = &facts[i];
    char text[FACT_SIZE];
    (void)supine_fact_print(f, text, sizeof text);
    (void)json_array_append_new(
        list, as_text ? json_pack("{s:s, s:s}", "name", f->name, "value", text)
                      : json_pack("{s:s, s:s, s:o, s:o, s:o, s:s, s:s, s:s, s:s, s:b}", "name",
                                  f->name, "text", f->text, "value", number(f->value), "low",
                                  number(f->low), "high", number(f->high), "unit", f->unit,
                                  "source", supine_fact_source_name(f->source), "origin", f->origin,
                                  "line", text, "caveat", (int)supine_fact_is_caveat(f)));
  }
  return list;
}

void supine_options_facts_print(const supine_basis *basis) {
  supine_fact facts[SUPINE_FACTS_MAX];
  const size_t count = supine_basis_facts(basis, facts);
  for (size_t i = 0; i < count; ++i) {
    char text[FACT_SIZE];
    (void)supine_fact_print(&facts[i], text, sizeof text);
    supine_options_line("  %s: %s\n", facts[i].name, text);
  }
  const char *expected = supine_basis_metadata(basis, "full_expected");
  if (expected != NULL) {
    supine_options_line("  full inflation by size: %s\n", expected);
  }
}

json_t *supine_options_volume_json(const supine_fact *volume, bool as_text) {
  SUPINE_C_LOCALE;
  const bool range = isfinite(volume->low);
  const char *source = supine_fact_source_name(volume->source);
  if (!as_text) {
    return json_pack("{s:f, s:f, s:f, s:s}", "value", volume->value, "low",
                     range ? volume->low : volume->value, "high",
                     range ? volume->high : volume->value, "source", source);
  }
  if (range) {
    return json_sprintf("%.0f (%.0f to %.0f, %s)", volume->value, volume->low, volume->high,
                        source);
  }
  return json_sprintf("%.0f (%s)", volume->value, source);
}
