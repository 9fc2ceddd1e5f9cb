/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Check and repair surfaces, and join them into lungs. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/anatomy.h"
#include "mesh/repair.h"
#include "precompute/lungs/gate.h"

/* Connected components with less than this share of the volume of a surface are dropped. */
static const double speck_share = 0.01;

static const char *plural(size_t count) {
  return count == 1 ? "" : "s";
}

/* Repair one surface, drop its small pieces, and note what was changed. */
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
  const struct {
    size_t count;
    const char *done, *noun, *more;
  } notes[] = {
      {report.duplicates, "dropped", "duplicate triangle", ""},
      {report.loose, "dropped", "loose triangle", ""},
      {report.reversed, "reversed", "triangle", " that faced the other way"},
      {report.separated, "surfaces touched at", "point", ": separated there"},
  };
  for (size_t i = 0; i < sizeof notes / sizeof *notes; ++i) {
    if (notes[i].count > 0) {
      supine_findings_add(findings, "%s: note: %s %zu %s%s%s", name, notes[i].done, notes[i].count,
                          notes[i].noun, plural(notes[i].count), notes[i].more);
    }
  }
  if (specks > 0) {
    supine_findings_add(
        findings,
        "%s: note: dropped %zu small component%s, each below %g %% of the volume; %zu "
        "component%s",
        name, specks, plural(specks), 100.0 * speck_share, pieces,
        pieces == 1 ? " remains" : "s remain");
  }
  if (pieces > 6) { /* five lobes and one other piece are plausible */
    supine_findings_add(findings, "%s: warning: %zu components; remove those that are not lung",
                        name, pieces);
  }
  return SUPINE_OK;
}

static supine_status check_closed(const supine_lungs *lungs, const char *name,
                                  supine_error *error) {
  const supine_topology *t = &lungs->topology;
  return t->closed
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                                "%s: the surface is open (edges: %zu boundary, %zu non-manifold, "
                                "%zu inconsistent) and encloses no volume: close its holes in a "
                                "mesh editor, or give the label map that it was made from",
                                name, t->boundary_edges, t->non_manifold_edges,
                                t->inconsistent_edges);
}

/* Refuse lungs of an impossible size; only warn if the user gave the axes or units. */
static supine_status check_size(const supine_lungs *lungs, const supine_lungs_source *source,
                                supine_findings *findings, supine_error *error) {
  const char *unit = NULL;
  double side = 0.0;
  for (int k = 0; k < 3; ++k) {
    side = fmax(side, lungs->maximum[k] - lungs->minimum[k]);
  }
  if (supine_mesh_unit_is_likely(side, &unit)) {
    return SUPINE_OK;
  }
  if (source->axes_given || source->units_given) {
    supine_findings_add(
        findings, "%s: warning: the lungs are %.3g mm long, which is impossible: check --units",
        source->name, side);
    return SUPINE_OK;
  }
  return supine_error_set(error, SUPINE_ERROR_MESH,
                          "%s: the lungs are %.3g mm long, which is impossible: %s%s. To use this "
                          "size all the same, add --units mm",
                          source->name, side, unit != NULL ? "add --units " : "check its units",
                          unit != NULL ? unit : "");
}

/* Divide the triangles between two lungs along the axis on which the two overlap least. Return the
 * number of lungs, or 0 if out of memory.
 * @param parts  written; the vertices are those of `lungs`; the caller frees the triangles */
static size_t part_lungs(const supine_lungs *lungs, supine_mesh parts[2]) {
  const supine_mesh *mesh = &lungs->mesh;
  const supine_topology *topology = &lungs->topology;
  uint8_t *group = calloc(topology->component_count, sizeof *group);
  double least = SUPINE_LUNGS_MOST_OVERLAP;
  int along = -1;
  bool failed = false;
  for (size_t g = 0; g < 2; ++g) {
    parts[g] = (supine_mesh){.vertex_count = mesh->vertex_count, .vertices = mesh->vertices};
    parts[g].triangles = malloc((3 * mesh->triangle_count + 1) * sizeof *parts[g].triangles);
  }
  if (group == NULL || parts[0].triangles == NULL || parts[1].triangles == NULL) {
    free(group);
    return 0;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double middle = 0.5 * (lungs->minimum[axis] + lungs->maximum[axis]);
    const double overlap = supine_lungs_sides(mesh, topology, axis, middle, group);
    failed = failed || isnan(overlap);
    along = overlap < least ? axis : along;
    least = fmin(least, overlap);
  }
  const double middle =
      along < 0 ? INFINITY : 0.5 * (lungs->minimum[along] + lungs->maximum[along]);
  failed =
      isnan(supine_lungs_sides(mesh, topology, along < 0 ? 0 : along, middle, group)) || failed;
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    supine_mesh *part = &parts[group[topology->component[corner[0]]]];
    memcpy(part->triangles + 3 * part->triangle_count++, corner, 3 * sizeof *corner);
  }
  free(group);
  return failed ? 0 : along < 0 ? 1 : 2;
}

/* Compare the axes with the shape of the lungs. Refuse one component with both lungs. Write whether
 * the shape confirms the axes, and the side of a single lung: +1 left, -1 right, 0 unknown. */
static supine_status check_shape(const supine_lungs *lungs, const supine_lungs_source *source,
                                 int *side, bool *axes_hold, supine_findings *findings,
                                 supine_error *error) {
  supine_mesh parts[2];
  const size_t count = part_lungs(lungs, parts);
  if (count == 0) {
    free(parts[0].triangles);
    free(parts[1].triangles);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for the two lungs");
  }
  const supine_mesh_anatomy found = supine_mesh_anatomy_find(parts, count);
  free(parts[0].triangles);
  free(parts[1].triangles);
  *side = found.side;
  *axes_hold = found.certain && found.axes == SUPINE_AXES_LPS;
  if (found.joined && source->midline == NULL) {
    return supine_error_set(
        error, SUPINE_ERROR_MESH,
        "%s: this surface looks like both lungs in one piece: separate them (for a label map by "
        "--labels one). If it is a single lung, give --midline",
        source->name);
  }
  if (found.axes != SUPINE_AXES_LPS) {
    char letters[4];
    supine_mesh_axes_letters(supine_mesh_axes_after(source->axes, found.axes), letters);
    supine_findings_add(findings,
                        "%s: warning: the axes are doubtful: the shape of the lungs fits %s; if "
                        "those are the axes, add --axes %s",
                        source->name, letters, letters);
  }
  return SUPINE_OK;
}

/* Choose the side of a single lung by its shape or, if that is unclear, by its position. */
static supine_status take_side(const supine_mesh *meshes, size_t count,
                               const supine_lungs_source *source, int side, supine_lungs *lungs,
                               supine_findings *findings, supine_error *error) {
  const double low = lungs->minimum[0];
  const double high = lungs->maximum[0];
  const int taken = side != 0 ? side : lungs->side[0];
  supine_findings_add(findings,
                      "%s: note: one lung, taken for the %s lung by its %s; --midline %.0f would "
                      "make it the %s lung",
                      source->name, taken > 0 ? "left" : "right", side != 0 ? "shape" : "place",
                      taken > 0 ? ceil(high) : floor(low), taken > 0 ? "right" : "left");
  if (taken == lungs->side[0] && lungs->midline == (taken > 0 ? low : high)) {
    return SUPINE_OK;
  }
  const double midline = taken > 0 ? low : high;
  supine_lungs_free(lungs);
  return supine_lungs_create(meshes, count, &midline, lungs, error);
}

static void note_lungs(const supine_lungs *lungs, const char *name, supine_findings *findings) {
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    if (lungs->reversed[lung]) {
      supine_findings_add(findings,
                          "%s: note: the triangles of the %s lung faced inwards: reversed", name,
                          supine_lungs_name(lungs, lung));
    }
  }
}

supine_status supine_lungs_gate(supine_mesh *meshes, size_t count,
                                const supine_lungs_source *source, supine_lungs *lungs,
                                bool *axes_hold, supine_findings *findings, supine_error *error) {
  supine_status status = SUPINE_OK;
  int side = 0;
  *axes_hold = false;
  for (size_t m = 0; m < count && status == SUPINE_OK; ++m) {
    status = mend(&meshes[m], source->name, findings, error);
  }
  if (status == SUPINE_OK) {
    supine_error inner = {0};
    status = supine_lungs_create(meshes, count, source->midline, lungs, &inner);
    if (status != SUPINE_OK) {
      (void)supine_error_set(error, status, "%s: %s", source->name, inner.message);
    }
  }
  if (status != SUPINE_OK) {
    return status;
  }
  status = check_size(lungs, source, findings, error);
  status = status == SUPINE_OK ? check_closed(lungs, source->name, error) : status;
  status =
      status == SUPINE_OK ? check_shape(lungs, source, &side, axes_hold, findings, error) : status;
  if (status == SUPINE_OK && lungs->lung_count == 1 && source->midline == NULL) {
    status = take_side(meshes, count, source, side, lungs, findings, error);
  }
  if (status == SUPINE_OK) {
    note_lungs(lungs, source->name, findings);
  } else {
    supine_lungs_free(lungs);
  }
  return status;
}
