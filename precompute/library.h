/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a basis of prepared lungs, as options say: the part of the library that the program shares,
 * as it prints what was found between both steps. */
#ifndef SUPINE_PRECOMPUTE_LIBRARY_H
#define SUPINE_PRECOMPUTE_LIBRARY_H

#include "precompute/precompute.h"

/** Name the state of which a report gives the errors, such as "rest". */
void supine_precompute_report_state(const supine_precompute_report *report, char *text,
                                    size_t size);

/** Make a basis. Of the options, those of the lungs and their model were used before, by
 * supine_precompute_prepare.
 * @param findings  warnings about the fields of another simulator, and about folds, are added
 * @param bytes  release bytes->data with free(), also after an error */
supine_status supine_precompute_make(const supine_precompute_options *options,
                                     const supine_prepared *prepared, supine_findings *findings,
                                     supine_bytes *bytes, supine_precompute_report *report,
                                     supine_error *error);

#endif
