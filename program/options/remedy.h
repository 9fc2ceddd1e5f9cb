/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The program's words for the remedies of errors and findings, which name its options. */
#ifndef SUPINE_OPTIONS_REMEDY_H
#define SUPINE_OPTIONS_REMEDY_H

#include <supine/status.h>

enum { SUPINE_REMEDY_WORDS = 256 };

/* An error's message, followed by the words of its remedy. */
typedef struct supine_explained {
  char text[512 + SUPINE_REMEDY_WORDS];
} supine_explained;

/* Write the words of a remedy, with the punctuation that joins them to a message; "" for none. */
void supine_options_remedy_words(supine_remedy remedy, const char *value,
                                 char words[SUPINE_REMEDY_WORDS]);

supine_explained supine_options_explain(const supine_error *error);

#endif
