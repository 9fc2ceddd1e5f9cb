/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Describe the remedies of errors and findings by the program's options. */
#include <stdio.h>
#include <string.h>

#include "program/options/remedy.h"

/* Words of each remedy, after the message. The value of the argument stands for "{}". */
static const char *const words_of[] = {
    [SUPINE_REMEDY_NONE] = "",
    [SUPINE_REMEDY_BASIS_WITH_REST] =
        ", or make the basis again, without --scanned none and --law paper",
    [SUPINE_REMEDY_ALLOW_FOLDS] = ", or accept this with --allow-folds",
    [SUPINE_REMEDY_LOCATE_VOLUME] = ", or give --volume",
    [SUPINE_REMEDY_AXES] = "; give the axes, for example --axes {}",
    [SUPINE_REMEDY_AXES_ADD] = ": add --axes {}",
    [SUPINE_REMEDY_AXES_IF_RIGHT] = "; if those are the axes, add --axes {}",
    [SUPINE_REMEDY_UNIT] = ", or give its --units",
    [SUPINE_REMEDY_UNIT_ADD] = ": add --units {}",
    [SUPINE_REMEDY_UNIT_OR_ACCEPT] =
        ": add --units {}. To use this size all the same, add --units mm",
    [SUPINE_REMEDY_SIZE_ACCEPT] = ". To use this size all the same, add --units mm",
    [SUPINE_REMEDY_POINTS_CLAMP] =
        " (--axes, --units), or give --clamp to move them like the nearest point of the surface",
    [SUPINE_REMEDY_LABELS] =
        " Give --labels, such as left=10+11,right=12+13+14 or totalsegmentator",
    [SUPINE_REMEDY_LABELS_ONE_LUNG] =
        ". Correct --labels, or name only one lung, such as --labels {}=1+2",
    [SUPINE_REMEDY_LABELS_CHECK] = ", and --labels",
    [SUPINE_REMEDY_LABELS_SIDE] =
        ". If it is one lung, name the side: --labels left=LABEL or right=LABEL",
    [SUPINE_REMEDY_LABELS_EXCHANGE] =
        ". Exchange the labels, --labels left=...,right=..., or correct the axes with --axes",
    [SUPINE_REMEDY_LABELS_OR_AXES] = ": if the labels are correct, add --axes {}",
    [SUPINE_REMEDY_LABELS_AXES_OR_KEEP] =
        ": if the labels are correct, add --axes {}; if the header is correct, add --axes with its "
        "axes",
    [SUPINE_REMEDY_CLOSE] = ": --close MM closes narrow ones",
    [SUPINE_REMEDY_MAP_UNIT] = ": leave --units out, or give --units mm to accept any size of the "
                               "lungs",
    [SUPINE_REMEDY_MAP_OPTIONS] = ": leave --labels, --edge, --close and --surfaces-out out",
    [SUPINE_REMEDY_EDGE] = ": give another --edge",
    [SUPINE_REMEDY_LUNGS_SEPARATE] =
        " (for a label map by --labels one). If it is a single lung, give --midline",
    [SUPINE_REMEDY_MIDLINE] = "; --midline {} would make it the other lung",
    [SUPINE_REMEDY_FORCE] = ": change --base or --gain",
    [SUPINE_REMEDY_CONSTANTS] = ": change --constants",
    [SUPINE_REMEDY_REACH] = ": give --reach 10, or leave --soften out",
    [SUPINE_REMEDY_SCAN_STATE] = ". Change --scanned",
    [SUPINE_REMEDY_SCAN_OR_REST] = ": change --scanned or --resting",
    [SUPINE_REMEDY_SCAN_FULLER] = ". If the scan is fuller than --scanned says, change --scanned "
                                  "or --resting; --scanned none uses the scan as it is",
    [SUPINE_REMEDY_SCAN_FULL_OR_REST] = ": change --full, --scanned or --resting",
    [SUPINE_REMEDY_SCAN_NOT_FULL] =
        ": give its state with --scanned, such as supine:rest or full-1000",
    [SUPINE_REMEDY_SCAN_OR_REST_GIVE] =
        ": if the scan was not at full inflation, give its state, such as --scanned supine:rest; "
        "otherwise change --resting",
    [SUPINE_REMEDY_SCAN_EMPTIER] = " and --resting; if the scan was emptier than rest, say so, as "
                                   "in --scanned supine:rest-300",
    [SUPINE_REMEDY_SCAN_OVER_REST] = ": if the scan was fuller than rest, give --scanned full or "
                                     "supine:rest+1000, or change --resting",
    [SUPINE_REMEDY_SCAN_GIVE] = ", or give the state of this one, such as --scanned supine:rest",
    [SUPINE_REMEDY_SCAN_ASSUMED] = "; --scanned changes this",
    [SUPINE_REMEDY_REST_OR_AS_IS] =
        "; give --resting, or take the scan as it is with --scanned none",
    [SUPINE_REMEDY_FULL_AND_SCAN] = ": give --full such as 4200mL, and --scanned supine:rest",
    [SUPINE_REMEDY_LAW_OR_SCAN] = ": leave --scanned out, or use --law deep",
    [SUPINE_REMEDY_BAND_OUT] = ", or leave --band out",
    [SUPINE_REMEDY_HARMONICS] = ": give --modes 16, or --band 7 or less",
    [SUPINE_REMEDY_LAW_DEEP] = ", or use --law deep",
    [SUPINE_REMEDY_FIT_LANDMARKS] = "; give --landmarks to 'supine fit'",
    [SUPINE_REMEDY_SCAN_MOTION] = " with --translation or --rigid",
    [SUPINE_REMEDY_SCANS_EXCHANGE] = ": exchange --rest and --other, or give --reverse",
    [SUPINE_REMEDY_SCANS_VOLUMES] = ", such as --rest 2600mL --other 5400mL",
    [SUPINE_REMEDY_REST_CHECK] = ": check --rest",
    [SUPINE_REMEDY_OTHER_STATE] = ": give --to POSTURE:VOLUME",
    [SUPINE_REMEDY_POINTS_REVERSE] = ", or exchange first and second points by --reverse",
    [SUPINE_REMEDY_BASIS_OF_STATE] = ": make a new basis, and state with --scanned how full the "
                                     "lungs were in the scan",
    [SUPINE_REMEDY_GRID] =
        ": make one with 'supine embed BASIS --grid MM' or 'supine embed BASIS IMAGE'",
    [SUPINE_REMEDY_DENSITY] = ", or leave --density out",
    [SUPINE_REMEDY_EXPANDABILITY_OUT] = ": leave --expandability out"};
_Static_assert(sizeof words_of / sizeof *words_of == SUPINE_REMEDY_COUNT,
               "each remedy needs words");

void supine_options_remedy_words(supine_remedy remedy, const char *value,
                                 char words[SUPINE_REMEDY_WORDS]) {
  const char *text = words_of[remedy];
  const char *place = strstr(text, "{}");
  if (place != NULL) {
    (void)snprintf(words, SUPINE_REMEDY_WORDS, "%.*s%s%s", (int)(place - text), text, value,
                   place + 2);
  } else {
    (void)snprintf(words, SUPINE_REMEDY_WORDS, "%s", text);
  }
}

supine_explained supine_options_explain(const supine_error *error) {
  char words[SUPINE_REMEDY_WORDS];
  supine_explained explained;
  supine_options_remedy_words(error->remedy, error->value, words);
  (void)snprintf(explained.text, sizeof explained.text, "%s%s", error->message, words);
  return explained;
}
