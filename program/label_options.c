/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Label maps in place of meshes. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sh/base/text.h"

#include "mesh/image/image.h"
#include "mesh/labels/labels.h"

#include "program/label_options.h"

#define FILLS(member) SUPINE_FILLS(supine_label_options, member)

const supine_option supine_command_label_options[] = {
    {.help = "Label maps (.nrrd, .nii, .nii.gz, .mha) in place of surfaces: one map, a mask a "
             "file, or the "
             "folder of masks that TotalSegmentator writes:"},
    {"labels", 0, "WHICH",
     "which labels are lungs; default: by those that are there, where they leave no doubt. "
     "lungmask (1 right, 2 left), lobes (1, 2 left, 3 to 5 right), totalsegmentator (10 to 14), "
     "totalsegmentator-v1 (13 to 17), one (all but 0; both lungs, parted), or any, as "
     "left=10+11,right=12+13+14; one lung alone: left=2",
     FILLS(labels)},
    {"edge", 0, "MM", "about this far from vertex to vertex; default 2", FILLS(edge),
     .range = {0.2, 20.0}, .wants = "0.2 to 20 mm"},
    {"close", 0, "MM",
     "first close gaps and channels narrower than twice this, as vessels leave them; default 0",
     FILLS(close), .range = {0.0, 20.0}, .wants = "0 to 20 mm"},
    {"surfaces-out", 0, "FILE", "keep the surfaces: " SUPINE_MESH_ENDINGS, FILLS(surfaces),
     .file = SUPINE_FILE_OUT, .endings = SUPINE_MESH_ENDINGS},
    {.name = NULL}};

static bool is_folder(const char *path) {
  struct stat about;
  return stat(path, &about) == 0 && S_ISDIR(about.st_mode);
}

int supine_command_labels_check(const supine_label_options *options, const char *command,
                                char **paths, size_t count, bool *maps) {
  size_t images = 0;
  for (size_t i = 0; i < count; ++i) {
    images += supine_image_is_named(paths[i]) || (count == 1 && is_folder(paths[i]));
  }
  *maps = images == count;
  if (images > 0 && images < count) {
    return supine_options_usage(command, "label maps or surfaces, not both");
  }
  if (images == 0 && (options->labels != NULL || options->edge > 0.0 || options->close > 0.0 ||
                      options->surfaces != NULL)) {
    return supine_options_usage(command, "--labels, --edge, --close and --surfaces-out are of "
                                         "label maps (.nrrd, .nii, .nii.gz, .mha)");
  }
  return SUPINE_EXIT_OK;
}

enum { LOBES = 5, LEFT_LOBES = 2 };

/* The lobes of a folder of TotalSegmentator's masks. */
typedef struct lobe_files {
  char path[LOBES][PATH_MAX];
  char *list[LOBES];
  size_t count;
  char labels[64]; /* which of them are left and right */
} lobe_files;

static supine_status find_lobes(const char *folder, lobe_files *found, supine_error *error) {
  static const char *const names[LOBES] = {"upper_lobe_left", "lower_lobe_left", "upper_lobe_right",
                                           "middle_lobe_right", "lower_lobe_right"};
  static const char *const endings[] = {".nii.gz", ".nii", ".nrrd", ".mha"};
  const char *before = "left=";
  found->count = 0;
  found->labels[0] = '\0';
  for (size_t lobe = 0; lobe < LOBES; ++lobe) {
    before = lobe == LEFT_LOBES ? found->count > 0 ? ",right=" : "right=" : before;
    for (size_t e = 0; e < sizeof endings / sizeof *endings; ++e) {
      char *path = found->path[found->count];
      const int length = snprintf(path, PATH_MAX, "%s/lung_%s%s", folder, names[lobe], endings[e]);
      if (length < PATH_MAX && access(path, F_OK) == 0) {
        found->list[found->count++] = path;
        supine_text_add(found->labels, sizeof found->labels, "%s%zu", before, found->count);
        before = "+";
        break;
      }
    }
  }
  return found->count > 0
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_READ,
                                "%s: no lung_upper_lobe_left.nii.gz or other lobe of "
                                "TotalSegmentator in this folder; name the files themselves",
                                folder);
}

static const char *side_name(const supine_labels_lung *lung) {
  return lung->side > 0 ? "left" : "right";
}

/* What may be wrong with the map. */
static void find(const char *path, const supine_labels_report *report, supine_findings *findings) {
  if (report->frames_differ) {
    supine_findings_add(findings,
                        "%s: warning: its qform and sform do not agree; the sform was taken", path);
  }
  for (size_t i = 0; i < report->lung_count; ++i) {
    const supine_labels_lung *lung = &report->lung[i];
    if (lung->cut > 0) {
      supine_findings_add(findings,
                          "%s: warning: the %s lung is cut off at the image's border (%zu voxel%s)",
                          path, side_name(lung), lung->cut, lung->cut == 1 ? "" : "s");
    }
    if (lung->tunnels > 0) {
      supine_findings_add(findings,
                          "%s: note: %ld %s lead%s through the %s lung, or hollows in it to the "
                          "outside; --close MM closes narrow ones",
                          path, lung->tunnels, lung->tunnels == 1 ? "channel" : "channels",
                          lung->tunnels == 1 ? "s" : "", side_name(lung));
    }
  }
}

static void tell(const char *path, const supine_labels_report *report,
                 const supine_mesh *surfaces) {
  (void)printf("%s: %zu x %zu x %zu voxels of %.3g x %.3g x %.3g mm, %s (%s)\n  labels %s\n", path,
               report->size[0], report->size[1], report->size[2], report->spacing[0],
               report->spacing[1], report->spacing[2], report->axes, report->source, report->taken);
  if (report->parted > 0.0) {
    (void)printf("  the lungs touch: parted at necks up to %.3g mm wide\n", report->parted);
  }
  for (size_t i = 0; i < report->lung_count; ++i) {
    const supine_labels_lung *lung = &report->lung[i];
    (void)printf("%s lung: %.1f mL", side_name(lung), lung->mask);
    if (lung->closed > 0.0) {
      (void)printf("; closed gaps of %.2g mL", lung->closed);
    }
    (void)printf("; dropped %zu %s (%.2g mL), filled %zu %s (%.2g mL)\n", lung->islands,
                 lung->islands == 1 ? "island" : "islands", lung->dropped, lung->cavities,
                 lung->cavities == 1 ? "cavity" : "cavities", lung->filled);
    (void)printf("  surface of %zu vertices: %.1f mL (%+.2g mL), at most %.2g mm from the mask\n",
                 surfaces[i].vertex_count, lung->surface, lung->surface - lung->mask,
                 lung->farthest);
  }
}

/* Both lungs in one file. */
static supine_status save(const char *path, const supine_mesh *surfaces, size_t count,
                          supine_error *error) {
  supine_mesh all = {0};
  for (size_t i = 0; i < count; ++i) {
    all.vertex_count += surfaces[i].vertex_count;
    all.triangle_count += surfaces[i].triangle_count;
  }
  all.vertices = malloc(3 * all.vertex_count * sizeof *all.vertices);
  all.triangles = malloc(3 * all.triangle_count * sizeof *all.triangles);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (all.vertices == NULL || all.triangles == NULL) {
    (void)supine_error_set(error, status, "no memory for %zu vertices", all.vertex_count);
  } else {
    size_t vertices = 0;
    size_t corners = 0;
    for (size_t i = 0; i < count; ++i) {
      memcpy(all.vertices + 3 * vertices, surfaces[i].vertices,
             3 * surfaces[i].vertex_count * sizeof *all.vertices);
      for (size_t c = 0; c < 3 * surfaces[i].triangle_count; ++c) {
        all.triangles[corners++] = surfaces[i].triangles[c] + (uint32_t)vertices;
      }
      vertices += surfaces[i].vertex_count;
    }
    status = supine_mesh_save(path, &all, NULL, error);
  }
  supine_mesh_free(&all);
  return status;
}

int supine_command_labels_load(const supine_label_options *options, const char *command,
                               char **paths, size_t path_count, supine_command_maps *maps) {
  lobe_files lobes;
  supine_error error;
  const bool folder = path_count == 1 && is_folder(paths[0]);
  if (folder && find_lobes(paths[0], &lobes, &error) != SUPINE_OK) {
    return supine_options_fail(command, &error);
  }
  supine_progress progress = supine_options_progress_begin("label map");
  const supine_labels_options wanted = {
      .labels = folder && options->labels == NULL ? lobes.labels : options->labels,
      .axes = maps->axes,
      .edge = options->edge,
      .close = options->close,
      .progress = supine_options_progress_step,
      .progress_context = &progress};
  supine_labels_report report;
  supine_status status = supine_labels_surfaces((const char *const *)(folder ? lobes.list : paths),
                                                folder ? lobes.count : path_count, &wanted,
                                                maps->surfaces, &report, &error);
  supine_options_progress_end(&progress);
  if (status == SUPINE_OK) {
    maps->count = report.lung_count;
    maps->axes = report.coordinates;
    for (size_t i = 0; i < report.lung_count; ++i) {
      maps->sides[i] = report.lung[i].side;
    }
    find(paths[0], &report, maps->findings);
    tell(paths[0], &report, maps->surfaces);
    if (options->surfaces != NULL) {
      status = save(options->surfaces, maps->surfaces, maps->count, &error);
    }
  }
  return status == SUPINE_OK ? SUPINE_EXIT_OK : supine_options_fail(command, &error);
}
