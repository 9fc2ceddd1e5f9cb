/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Lists of orientations on the command line. */
#include <math.h>
#include <string.h>

#include <supine/posture.h>

#include "runtime/options/orientation.h"
#include "runtime/options/posture_list.h"

/* "0.6:0:-0.8" */
static int parse_triple(const char *command, const char *name, double gravity[3]) {
  char text[SUPINE_POSTURE_NAME_MAX];
  (void)snprintf(text, sizeof text, "%s", name);
  for (char *c = text; *c != '\0'; ++c) {
    *c = (char)(*c == ':' ? ',' : *c == ',' ? ':' : *c);
  }
  if (!supine_options_parse_numbers(text, 3, gravity)) {
    return supine_options_usage(command, "'%s': gravity is three finite numbers, X:Y:Z", name);
  }
  const double largest = fmax(fabs(gravity[0]), fmax(fabs(gravity[1]), fabs(gravity[2])));
  if (largest == 0.0) {
    return supine_options_usage(command, "gravity 0:0:0 has no direction; supine is 0:1:0");
  }
  double square = 0.0;
  for (int i = 0; i < 3; ++i) {
    gravity[i] /= largest;
    square += gravity[i] * gravity[i];
  }
  for (int i = 0; i < 3; ++i) {
    gravity[i] /= sqrt(square);
  }
  return SUPINE_EXIT_OK;
}

/* "supine+15", "prone-20"; untouched where it is none. */
static bool parse_tilted(const char *name, double gravity[3]) {
  const char *sign = name + strlen(name);
  while (sign > name && *sign != '+' && *sign != '-') {
    --sign;
  }
  char front[SUPINE_POSTURE_NAME_MAX];
  (void)snprintf(front, sizeof front, "%.*s", (int)(sign - name), name);
  double degrees = 0.0;
  double upright[3];
  return sign > name && supine_options_parse_number(sign, &degrees) &&
         supine_posture_gravity(front, upright) == SUPINE_OK &&
         supine_posture_tilt(upright, degrees, gravity) == SUPINE_OK;
}

static int parse_item(const char *command, supine_posture_item *item) {
  if (item->name[0] == '\0') {
    return supine_options_usage(command, "an empty name in the list of postures");
  }
  if (strchr(item->name, ':') != NULL) {
    return parse_triple(command, item->name, item->gravity);
  }
  if (parse_tilted(item->name, item->gravity)) {
    return SUPINE_EXIT_OK;
  }
  return supine_options_orientation_posture(command, item->name, item->gravity);
}

int supine_options_posture_list_parse(const char *command, const char *text,
                                      supine_posture_list *list) {
  list->count = 0;
  for (const char *at = text;;) {
    const size_t length = strcspn(at, ",");
    if (list->count == SUPINE_POSTURE_LIST_MAX) {
      return supine_options_usage(command, "more than %d postures", SUPINE_POSTURE_LIST_MAX);
    }
    supine_posture_item *item = &list->item[list->count];
    if (length >= sizeof item->name) {
      return supine_options_usage(command, "no posture '%.*s'", (int)length, at);
    }
    memcpy(item->name, at, length);
    item->name[length] = '\0';
    const int result = parse_item(command, item);
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
