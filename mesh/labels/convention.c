/* SPDX-License-Identifier: MIT */
/* Choose the side of each label: left lung, right lung, both (split later), or none. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/remedy.h"
#include "base/text.h"

#include "mesh/labels/mask.h"

/* Labels of the lungs by segmentation programs: lungmask's models R231 and LTRCLobes, and
 * TotalSegmentator's task `total` in versions 2.0 and later and in version 1. */
static const struct {
  const char *name, *labels;
} conventions[] = {{"lungmask", "left=2,right=1"},
                   {"lobes", "left=1+2,right=3+4+5"},
                   {"totalsegmentator", "left=10+11,right=12+13+14"},
                   {"totalsegmentator-v1", "left=13+14,right=15+16+17"}};

enum { CONVENTIONS = sizeof conventions / sizeof *conventions };

/* Find the centre of all voxels of the side `wanted`, mm. Return false if no voxel has that
 * side. */
static bool centre_of(const supine_image *image, const labels_tally *tally, const uint8_t *side,
                      uint8_t wanted, double centre[3]) {
  double count = 0.0;
  double voxel[3] = {0.0, 0.0, 0.0};
  for (size_t label = 1; label < LABELS_MAX; ++label) {
    if (side[label] == wanted) {
      for (int a = 0; a < 3; ++a) {
        voxel[a] += (double)tally[label].sum[a];
      }
      count += (double)tally[label].count;
    }
  }
  for (int k = 0; k < 3; ++k) {
    centre[k] = image->origin[k];
    for (int a = 0; a < 3; ++a) {
      centre[k] += voxel[a] / count * image->step[a][k];
    }
  }
  return count > 0.0;
}

/* List the labels present, such as "1, 2 and 17 more". If `side` is not NULL, list only the labels
 * of the side `wanted`. */
static void list_labels(const labels_tally *tally, const uint8_t *side, uint8_t wanted, char *text,
                        size_t size) {
  enum { SHOWN = 12 };
  size_t shown = 0;
  size_t more = 0;
  text[0] = '\0';
  for (size_t label = 1; label < LABELS_MAX; ++label) {
    if (tally[label].count == 0 || (side != NULL && side[label] != wanted)) {
      continue;
    }
    if (shown < SHOWN) {
      supine_text_add(text, size, "%s%zu", shown == 0 ? "" : ", ", label);
      ++shown;
    } else {
      ++more;
    }
  }
  if (more > 0) {
    supine_text_add(text, size, " and %zu more", more);
  }
}

/* Parse labels such as "10+11", and set the side of each. Return the end of the text parsed; NULL
 * if it is invalid. */
static const char *read_sum(const char *at, uint8_t value, uint8_t *side) {
  for (;; ++at) {
    char *end;
    const unsigned long label = strtoul(at, &end, 10);
    if (*at < '0' || *at > '9' || label == 0 || label >= LABELS_MAX || side[label] != 0) {
      return NULL;
    }
    side[label] = value;
    at = end;
    if (*at != '+') {
      return *at == ',' || *at == '\0' ? at : NULL;
    }
  }
}

/* Parse a list such as "left=10+11,right=12": set side[label] for each label in it. The caller has
 * set all elements to 0. Return false if the list is invalid. */
static bool read_sides(const char *wanted, uint8_t *side) {
  const char *at = wanted;
  bool seen[2] = {false, false};
  for (;;) {
    const bool left = strncmp(at, "left=", 5) == 0;
    if ((!left && strncmp(at, "right=", 6) != 0) || seen[left]) {
      return false;
    }
    seen[left] = true;
    at = read_sum(at + (left ? 5 : 6), left ? LABELS_LEFT : LABELS_RIGHT, side);
    if (at == NULL || *at == '\0') {
      return at != NULL;
    }
    ++at;
  }
}

/* Choose the side of each label by the labels that are present. A single label holds both lungs.
 * Two labels hold one lung each. Three or more must be exactly the labels of a known convention.
 * Return false if they are not. */
static bool choose_by_presence(const supine_image *image, const labels_tally *tally, uint8_t *side,
                               const char **name) {
  size_t present[2] = {0, 0};
  size_t count = 0;
  for (size_t label = 1; label < LABELS_MAX; ++label) {
    if (tally[label].count > 0) {
      present[count < 2 ? count : 1] = label;
      ++count;
    }
  }
  if (count == 1) {
    side[present[0]] = LABELS_EITHER;
    return true;
  }
  if (count == 2) {
    double centre[2][3];
    side[present[0]] = LABELS_LEFT;
    side[present[1]] = LABELS_RIGHT;
    (void)centre_of(image, tally, side, LABELS_LEFT, centre[0]);
    (void)centre_of(image, tally, side, LABELS_RIGHT, centre[1]);
    if (centre[0][0] < centre[1][0]) {
      side[present[0]] = LABELS_RIGHT;
      side[present[1]] = LABELS_LEFT;
    }
    *name = "their sides";
    return true;
  }
  for (size_t c = 0; c < CONVENTIONS; ++c) {
    bool exact = true;
    memset(side, 0, LABELS_MAX);
    (void)read_sides(conventions[c].labels, side);
    for (size_t label = 1; exact && label < LABELS_MAX; ++label) {
      exact = (tally[label].count > 0) == (side[label] != 0);
    }
    if (exact) {
      *name = conventions[c].name;
      return true;
    }
  }
  return false;
}

/* Refuse five lobes of which 1, 2 and 3 are one lung and lie to the right of 4 and 5: LTRCLobes
 * numbers those of the left lung first, other programs those of the right lung. In a mirrored map
 * of LTRCLobes, 3 lies with 4 and 5. If a lobe is missing, refuse nothing. */
static supine_status check_lobes(const char *path, const supine_image *image,
                                 const labels_tally *tally, supine_error *error) {
  enum { LOBES = 5, THIRD = 2 };
  double x[LOBES]; /* of the lobes' centres */
  for (size_t i = 0; i < LOBES; ++i) {
    const labels_tally *lobe = &tally[i + 1];
    if (lobe->count == 0) {
      return SUPINE_OK;
    }
    x[i] = image->origin[0];
    for (int a = 0; a < 3; ++a) {
      x[i] += (double)lobe->sum[a] / (double)lobe->count * image->step[a][0];
    }
  }
  const double first = 0.5 * (x[0] + x[1]);
  const double last = 0.5 * (x[3] + x[4]);
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
      supine_remedy_give("labels", "left=4+5,right=1+2+3", "")};
  SUPINE_REFUSE_ADVISE(first < last && x[THIRD] < 0.5 * (first + last), error, advice,
                       SUPINE_ERROR_MESH,
                       "%s: its lobes 1, 2 and 3 lie to the right of 4 and 5, so that they are not "
                       "numbered from left to right, as lungmask's are",
                       path);
  return SUPINE_OK;
}

/* Set the left or right side of each label. Set `name` to the labelling convention, such as
 * "lungmask", if one was used. */
static supine_status choose(const char *path, const supine_image *image, const labels_tally *tally,
                            const supine_labels_options *options, uint8_t *side, const char **name,
                            supine_error *error) {
  const char *wanted = options->labels;
  char present[128];
  if (wanted == NULL && options->left_masks + options->right_masks > 0) {
    memset(side + 1, LABELS_LEFT, options->left_masks);
    memset(side + 1 + options->left_masks, LABELS_RIGHT, options->right_masks);
    return SUPINE_OK;
  }
  if (wanted == NULL && image->lungs[0] != '\0') {
    wanted = image->lungs;
    *name = "SNOMED CT";
  }
  if (wanted == NULL && !image->is_segmentation && choose_by_presence(image, tally, side, name)) {
    return SUPINE_OK;
  }
  if (wanted == NULL) {
    list_labels(tally, NULL, 0, present, sizeof present);
    (void)supine_error_set(error, SUPINE_ERROR_MESH, "%s: which of its labels (%s) are lungs?",
                           path, present);
    const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
        supine_remedy_such_as("labels", "left=10+11,right=12+13+14", "")};
    supine_error_advise(error, advice);
    return SUPINE_ERROR_MESH;
  }
  if (strcmp(wanted, "one") == 0) {
    memset(side + 1, LABELS_EITHER, LABELS_MAX - 1);
    return SUPINE_OK;
  }
  const char *labels = wanted;
  for (size_t c = 0; c < CONVENTIONS; ++c) {
    if (strcmp(wanted, conventions[c].name) == 0) {
      labels = conventions[c].labels;
      *name = wanted;
    }
  }
  const bool good = read_sides(labels, side);
  SUPINE_REFUSE_IF(!good, error, SUPINE_ERROR_ARGUMENT,
                   "labels must be 'one', 'lungmask', 'lobes', 'totalsegmentator', "
                   "'totalsegmentator-v1' or left=LABEL+...,right=LABEL+..., not '%s'",
                   wanted);
  return SUPINE_OK;
}

/* Check that each lung to which labels are assigned has voxels. If both lungs have voxels, set
 * `doubted` to whether the left lung does not lie mainly to the left of the right lung. */
static supine_status check(const char *path, const supine_image *image, const labels_tally *tally,
                           const uint8_t *side, bool *doubted, supine_error *error) {
  static const char *const names[] = {"left", "right"};
  static const uint8_t sides[] = {LABELS_LEFT, LABELS_RIGHT};
  double centre[2][3];
  bool there[2];
  char present[128];
  for (size_t s = 0; s < 2; ++s) {
    there[s] = centre_of(image, tally, side, sides[s], centre[s]);
    if (!there[s] && memchr(side, sides[s], LABELS_MAX) != NULL) {
      list_labels(tally, NULL, 0, present, sizeof present);
      (void)supine_error_set(
          error, SUPINE_ERROR_MESH,
          "%s: no voxel has a label that was given for the %s lung; the labels present are %s: "
          "name those of both lungs, or of one lung alone",
          path, names[s], present);
      const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_change("labels", "")};
      supine_error_advise(error, advice);
      return SUPINE_ERROR_MESH;
    }
  }
  if (!(there[0] && there[1])) {
    return SUPINE_OK;
  }
  const double apart = centre[0][0] - centre[1][0];
  *doubted = apart < fabs(centre[0][1] - centre[1][1]) || apart < fabs(centre[0][2] - centre[1][2]);
  return SUPINE_OK;
}

supine_status supine_labels_choose(const char *path, const supine_image *image,
                                   const labels_tally *tally, const supine_labels_options *options,
                                   uint8_t *side, labels_choice *choice, supine_error *error) {
  char *taken = choice->taken;
  const char *name = NULL;
  char list[3][96];
  memset(side, 0, LABELS_MAX);
  SUPINE_TRY(choose(path, image, tally, options, side, &name, error));
  if (name != NULL && strcmp(name, "lobes") == 0) {
    SUPINE_TRY(check_lobes(path, image, tally, error));
  }
  SUPINE_TRY(check(path, image, tally, side, &choice->doubted, error));
  for (int value = LABELS_LEFT; value <= LABELS_EITHER; ++value) {
    list_labels(tally, side, (uint8_t)value, list[value - 1], sizeof list[0]);
  }
  choice->guessed = name != NULL && strcmp(name, "their sides") == 0;
  choice->named = list[2][0] == '\0' && !choice->guessed;
  taken[0] = '\0';
  if (list[2][0] != '\0') {
    supine_text_add(taken, 256, "%s both lungs", list[2]);
    return SUPINE_OK;
  }
  supine_text_add(taken, 256, "%s%s%s%s%s", list[0], list[0][0] != '\0' ? " left" : "",
                  list[0][0] != '\0' && list[1][0] != '\0' ? "; " : "", list[1],
                  list[1][0] != '\0' ? " right" : "");
  if (name != NULL) {
    supine_text_add(taken, 256, " (%s%s)", strcmp(name, "their sides") == 0 ? "by " : "convention ",
                    name);
  }
  return SUPINE_OK;
}
