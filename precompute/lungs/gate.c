/* SPDX-License-Identifier: GPL-3.0-or-later */
/* From surfaces as files have them to lungs that can be computed with. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/text.h"

#include "mesh/anatomy.h"
#include "mesh/repair.h"
#include "precompute/lungs/gate.h"

/* A piece below this share of its file's volume is no part of a lung. */
static const double speck_share = 0.01;
/* Groups of pieces that overlap along an axis by less than this share of the narrower are two
 * lungs; lobes overlap by more. */
static const double most_overlap = 0.5;

static const char *plural(size_t count) {
  return count == 1 ? "" : "s";
}

static supine_status mend(supine_mesh *mesh, const char *name, supine_findings *findings,
                          supine_error *error) {
  supine_mesh_repair_report report;
  size_t pieces;
  size_t specks;
  supine_status status = supine_mesh_repair(mesh, &report);
  if (status == SUPINE_OK) {
    status = supine_mesh_drop_specks(mesh, speck_share, &pieces, &specks);
  }
  if (status != SUPINE_OK) {
    return supine_error_set(error, status, "%s: no memory to check the surface", name);
  }
  if (report.duplicates > 0) {
    supine_findings_add(findings, "%s: note: dropped %zu duplicate triangle%s", name,
                        report.duplicates, plural(report.duplicates));
  }
  if (report.loose > 0) {
    supine_findings_add(findings, "%s: note: dropped %zu loose triangle%s", name, report.loose,
                        plural(report.loose));
  }
  if (report.reversed > 0) {
    supine_findings_add(findings, "%s: note: turned %zu reversed triangle%s", name, report.reversed,
                        plural(report.reversed));
  }
  if (report.parted > 0) {
    supine_findings_add(findings, "%s: note: surfaces touched at %zu point%s: parted there", name,
                        report.parted, report.parted == 1 ? "" : "s");
  }
  if (specks > 0) {
    supine_findings_add(findings,
                        "%s: note: dropped %zu speck%s, each below %g %% of the volume; %zu "
                        "piece%s left",
                        name, specks, plural(specks), 100.0 * speck_share, pieces,
                        pieces == 1 ? " is" : "s are");
  }
  if (pieces > 6) { /* more than lobes */
    supine_findings_add(findings, "%s: warning: %zu pieces; remove what is no lung", name, pieces);
  }
  return SUPINE_OK;
}

static supine_status check_size(const supine_mesh *meshes, size_t count,
                                const supine_lungs_source *source, supine_findings *findings,
                                supine_error *error) {
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  double side = 0.0;
  for (size_t m = 0; m < count; ++m) {
    double least[3];
    double most[3];
    supine_mesh_box(&meshes[m], least, most);
    for (int k = 0; k < 3; ++k) {
      low[k] = fmin(low[k], least[k]);
      high[k] = fmax(high[k], most[k]);
      side = fmax(side, high[k] - low[k]);
    }
  }
  const char *unit = NULL;
  if (supine_mesh_unit_check(side, 1.0, &unit) == 0.0) {
    return SUPINE_OK;
  }
  char advice[96] = "check its units";
  if (unit != NULL) {
    (void)snprintf(advice, sizeof advice, "its unit is likely --units %s", unit);
  }
  if (source->axes_given || source->units_given) {
    supine_findings_add(findings, "%s: warning: %.3g mm long, which no lung is", source->name,
                        side);
    return SUPINE_OK;
  }
  return supine_error_set(error, SUPINE_ERROR_MESH,
                          "%s: %.3g mm long, which no lung is: %s. If it is right as it stands, "
                          "add --units mm",
                          source->name, side, advice);
}

/* Parts connected pieces into two groups along an axis. @return the overlap as a share of the
 * narrower group, or INFINITY where all are on one side
 * @param group  [components] written */
static double part_along(const supine_lungs *lungs, int axis, uint8_t *group) {
  const size_t n = lungs->mesh.vertex_count;
  const uint32_t *piece = lungs->topology.component;
  const double middle = 0.5 * (lungs->minimum[axis] + lungs->maximum[axis]);
  double range[2][2] = {{INFINITY, -INFINITY}, {INFINITY, -INFINITY}};
  long *votes = calloc(lungs->topology.component_count, sizeof *votes);
  if (votes == NULL) {
    return INFINITY;
  }
  for (size_t i = 0; i < n; ++i) {
    votes[piece[i]] += lungs->mesh.vertices[3 * i + (size_t)axis] > middle ? 1 : -1;
  }
  for (size_t p = 0; p < lungs->topology.component_count; ++p) {
    group[p] = votes[p] > 0;
  }
  for (size_t i = 0; i < n; ++i) {
    const double x = lungs->mesh.vertices[3 * i + (size_t)axis];
    double *of = range[group[piece[i]]];
    of[0] = fmin(of[0], x);
    of[1] = fmax(of[1], x);
  }
  free(votes);
  const double narrower = fmin(range[0][1] - range[0][0], range[1][1] - range[1][0]);
  return narrower > 0.0 ? (range[0][1] - range[1][0]) / narrower : INFINITY;
}

/* Sorts the triangles of the two lungs apart, whatever axes they lie along. @return lungs, 1 or 2
 * @param parts  share the lungs' vertices; their triangles are the caller's to free */
static size_t part_lungs(const supine_lungs *lungs, supine_mesh parts[2]) {
  const supine_mesh *mesh = &lungs->mesh;
  uint8_t *group = calloc(4, lungs->topology.component_count);
  double least = most_overlap;
  int along = -1;
  for (int axis = 0; group != NULL && axis < 3; ++axis) {
    const double overlap =
        part_along(lungs, axis, group + (size_t)axis * lungs->topology.component_count);
    if (overlap < least) {
      least = overlap;
      along = axis;
    }
  }
  const uint8_t *chosen =
      group == NULL ? NULL
                    : group + (size_t)(along < 0 ? 3 : along) * lungs->topology.component_count;
  for (size_t g = 0; g < 2; ++g) {
    parts[g] = (supine_mesh){.vertex_count = mesh->vertex_count, .vertices = mesh->vertices};
    parts[g].triangles = malloc((3 * mesh->triangle_count + 1) * sizeof *parts[g].triangles);
  }
  for (size_t t = 0; parts[0].triangles != NULL && parts[1].triangles != NULL && chosen != NULL &&
                     t < mesh->triangle_count;
       ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    supine_mesh *part = &parts[chosen[lungs->topology.component[corner[0]]]];
    memcpy(part->triangles + 3 * part->triangle_count++, corner, 3 * sizeof *corner);
  }
  free(group);
  return along < 0 ? 1 : 2;
}

/* "left and right, head and feet" */
static void describe(supine_axes axes, char *text, size_t size) {
  static const char *const ends[] = {"left and right", "front and back", "head and feet"};
  double matrix[3][3];
  supine_mesh_axes_matrix(axes, matrix);
  text[0] = '\0';
  for (int k = 0; k < 3; ++k) {
    if (matrix[k][k] == 0.0) {
      (void)snprintf(text, size, "they lie along other axes");
      return;
    }
    if (matrix[k][k] < 0.0) {
      supine_text_add(text, size, "%s%s", text[0] == '\0' ? "" : ", ", ends[k]);
    }
  }
  supine_text_add(text, size, " exchanged");
}

/* Judges axes, and whether it is one lung; @param side  of a single lung, 0: cannot be told */
static supine_status judge(const supine_lungs *lungs, const supine_lungs_source *source, int *side,
                           bool *axes_hold, supine_findings *findings, supine_error *error) {
  supine_mesh parts[2];
  const size_t count = part_lungs(lungs, parts);
  const supine_mesh_anatomy found = supine_mesh_anatomy_find(parts, count);
  free(parts[0].triangles);
  free(parts[1].triangles);
  *side = found.side;
  *axes_hold = found.certain && found.axes == SUPINE_AXES_LPS;
  if (found.joined && source->midline == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "%s: this looks like both lungs in one piece: part them (of a label "
                            "map --labels one does), or give --midline if it is one lung",
                            source->name);
  }
  if (found.axes != SUPINE_AXES_LPS) {
    char what[96];
    char letters[4];
    describe(found.axes, what, sizeof what);
    supine_mesh_axes_letters(supine_mesh_axes_after(source->axes, found.axes), letters);
    supine_findings_add(findings,
                        "%s: warning: the axes are doubtful: by the shape of the lungs, %s; if so, "
                        "add --axes %s",
                        source->name, what, letters);
  }
  return SUPINE_OK;
}

/* Takes a single lung for the side that its shape shows. */
static supine_status take_side(const supine_mesh *meshes, size_t count,
                               const supine_lungs_source *source, int side, supine_lungs *lungs,
                               supine_findings *findings, supine_error *error) {
  const double low = lungs->minimum[0];
  const double high = lungs->maximum[0];
  const int taken = side != 0 ? side : lungs->side[0];
  supine_findings_add(findings,
                      "%s: note: one lung, taken for the %s by its %s; --midline %.0f would make "
                      "it the %s",
                      source->name, taken > 0 ? "left" : "right", side != 0 ? "shape" : "place",
                      taken > 0 ? ceil(high) : floor(low), taken > 0 ? "right" : "left");
  if (taken == lungs->side[0] && lungs->midline == (taken > 0 ? low : high)) {
    return SUPINE_OK;
  }
  const double midline = taken > 0 ? low : high;
  supine_lungs_free(lungs);
  return supine_lungs_create(meshes, count, &midline, lungs, error);
}

/* What is to be known of the lungs as a whole. */
static void note_lungs(const supine_lungs *lungs, const char *name, supine_findings *findings) {
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    if (lungs->turned[lung]) {
      supine_findings_add(findings,
                          "%s: note: the triangles of the %s lung faced inwards: turned round",
                          name, supine_lungs_name(lungs, lung));
    }
  }
  const supine_topology *t = &lungs->topology;
  if (!t->closed) {
    supine_findings_add(findings,
                        "%s: note: the surface is not closed (%zu boundary, %zu non-manifold, %zu "
                        "inconsistent edge%s): no volumes, only --scale",
                        name, t->boundary_edges, t->non_manifold_edges, t->inconsistent_edges,
                        plural(t->inconsistent_edges));
  }
}

supine_status supine_lungs_gate(supine_mesh *meshes, size_t count,
                                const supine_lungs_source *source, supine_lungs *lungs,
                                bool *axes_hold, supine_findings *findings, supine_error *error) {
  supine_status status = SUPINE_OK;
  bool hold = false;
  int side = 0;
  for (size_t m = 0; m < count && status == SUPINE_OK; ++m) {
    status = mend(&meshes[m], source->name, findings, error);
  }
  status = status == SUPINE_OK ? check_size(meshes, count, source, findings, error) : status;
  if (status == SUPINE_OK) {
    status = supine_lungs_create(meshes, count, source->midline, lungs, error);
  }
  if (status != SUPINE_OK) {
    return status;
  }
  status = judge(lungs, source, &side, &hold, findings, error);
  if (status == SUPINE_OK && lungs->lung_count == 1 && source->midline == NULL) {
    status = take_side(meshes, count, source, side, lungs, findings, error);
  }
  if (status == SUPINE_OK) {
    note_lungs(lungs, source->name, findings);
  } else {
    supine_lungs_free(lungs);
  }
  if (axes_hold != NULL) {
    *axes_hold = hold;
  }
  return status;
}
