/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Lists of orientations on the command line. */
#include <string.h>

#include "program/options/posture_list.h"

supine_status supine_options_posture_list_parse(const char *text, supine_posture_list *list,
                                                supine_error *error) {
  supine_status status = SUPINE_OK;
  list->count = 0;
  for (const char *at = text; status == SUPINE_OK;) {
    const size_t length = strcspn(at, ",");
    if (list->count == SUPINE_POSTURE_LIST_MAX) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "more than %d postures: name fewer",
                              SUPINE_POSTURE_LIST_MAX);
    }
    supine_posture_item *item = &list->item[list->count++];
    if (length == 0 || length >= sizeof item->name) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "no posture '%.*s': give supine, prone, left, right, upright or "
                              "inverted, or a gravity X:Y:Z",
                              (int)length, at);
    }
    memcpy(item->name, at, length);
    item->name[length] = '\0';
    status = supine_options_posture(item->name, item->gravity, error);
    if (at[length] == '\0') {
      break;
    }
    at += length + 1;
  }
  return status;
}

const char *supine_options_posture_label(const char *name) {
  return strcmp(name, "left") == 0 ? "left side" : strcmp(name, "right") == 0 ? "right side" : name;
}
