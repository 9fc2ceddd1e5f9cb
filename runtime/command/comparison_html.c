/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "comparison.h"
void supine_comparison_html(const supine_comparison *comparison, FILE *file) {
  (void)comparison;
  (void)file;
}
