/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Lists of orientations on the command line. */
#include <string.h>

#include "program/options/posture_list.h"

int supine_options_posture_list_parse(const char *command, const char *text,
                                      supine_posture_list *list) {
  list->count = 0;
  for (const char *at = text;;) {
    const size_t length = strcspn(at, ",");
    if (list->count == SUPINE_POSTURE_LIST_MAX) {
      return supine_options_usage(command, "more than %d postures: name fewer",
                                  SUPINE_POSTURE_LIST_MAX);
    }
    supine_posture_item *item = &list->item[list->count];
    if (length >= sizeof item->name) {
      return supine_options_usage(command,
                                  "no posture '%.*s': give supine, prone, left, right, "
                                  "upright or inverted, or a gravity X:Y:Z",
                                  (int)length, at);
    }
    memcpy(item->name, at, length);
    item->name[length] = '\0';
    const int result =
        length > 0
            ? supine_options_posture(command, item->name, item->gravity)
            : supine_options_usage(command, "the list of postures has an empty name: remove the "
                                            "extra comma");
    if (result != SUPINE_EXIT_OK) {
      return result;
    }
    ++list->count;
    if (at[length] == '\0') {
      return SUPINE_EXIT_OK;
    }
    at += length + 1;
  }
}

const char *supine_options_posture_label(const char *name) {
  return strcmp(name, "left") == 0 ? "left side" : strcmp(name, "right") == 0 ? "right side" : name;
}
