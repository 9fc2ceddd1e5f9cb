/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print what a basis assumes and was given (supine/facts.h). */
#ifndef SUPINE_OPTIONS_FACTS_H
#define SUPINE_OPTIONS_FACTS_H

#include <jansson.h>

#include <supine/facts.h>

enum { SUPINE_CAVEATS_SIZE = 1200 }; /* bytes that hold supine_basis_caveats */

/* Return all facts as a list of objects: the members of supine_fact, with `line`, value and source
 * in words, and `caveat`; or, `as_text`, {name, value} with the line as value. */
json_t *supine_options_facts(const supine_basis *basis, bool as_text);

/* Print a line for each fact to standard output, each after two blanks. */
void supine_options_facts_print(const supine_basis *basis);

/* Return the volume of a lung (supine_basis_lung_volume) as {value, low, high, source}, or, as
 * text, "1626 (1411 to 1881, assumed)". */
json_t *supine_options_volume_json(const supine_fact *volume, bool as_text);

#endif
