/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Check and repair surfaces, and join them into lungs. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/remedy.h"
#include "base/vec3.h"

#include "mesh/repair.h"
#include "precompute/lungs/gate.h"
#include "precompute/lungs/surface.h"

/* Connected components with less than this share of the volume of a surface are dropped. */
static const double speck_share = 0.01;
/* Depth to which a surface may reach into another one, mm. */
static const double most_overlap = 5.0;
/* Number of vertices, about, whose depth in another surface is computed. */
enum { SAMPLES = 2000 };
/* Share of a lung's volume that forms its tip in a direction. */
static const double tip_share = 0.003;
/* A tip longer than this many cube roots of the lung's volume is refused. */
static const double longest_tip = 0.5;

/* A direction, and the least and largest length of a lung's tip there, in cube roots of its volume.
 * In 32 surfaces of lungs of nine people and in two synthetic lungs, tips were 0.05 to 0.10 long at
 * the head, 0.06 to 0.17 at the feet, and 0.02 to 0.15 elsewhere. */
typedef struct tip_limits {
  const char *towards;
  int axis;
  double sign; /* of the axis, in this direction */
  double least, most;
} tip_limits;

static const tip_limits tips[] = {{"right", 0, -1.0, 0.0, 0.25}, {"left", 0, 1.0, 0.0, 0.25},
                                  {"front", 1, -1.0, 0.0, 0.25}, {"back", 1, 1.0, 0.0, 0.25},
                                  {"feet", 2, -1.0, 0.03, 0.25}, {"head", 2, 1.0, 0.03, 0.135}};

static const char *plural(size_t count) {
  return count == 1 ? "" : "s";
}

/* If a surface is open, join vertices that differ only by rounding, and note it. */
static supine_status join_vertices(supine_mesh *mesh, const char *name, supine_findings *findings) {
  static const double rounding = 1e-4; /* mm; single precision resolves 3e-5 mm at 500 mm */
  SUPINE_FREED_BY(supine_mesh_topology_free) supine_topology topology = {0};
  size_t joined = 0;
  SUPINE_TRY(supine_mesh_topology_create(mesh, &topology));
  if (topology.closed) {
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_mesh_join_close(mesh, rounding, &joined));
  if (joined > 0) {
    supine_findings_note(findings, "%s: joined %zu %s within 0.0001 mm of another", name, joined,
                         joined == 1 ? "vertex" : "vertices");
  }
  return SUPINE_OK;
}

/* Repair one surface, drop its small pieces, and note what was changed. */
static supine_status mend(supine_mesh *mesh, const char *name, supine_findings *findings,
                          supine_error *error) {
  supine_mesh_repair_report report;
  size_t pieces;
  size_t specks;
  if (join_vertices(mesh, name, findings) != SUPINE_OK ||
      supine_mesh_repair(mesh, &report) != SUPINE_OK ||
      supine_mesh_drop_specks(mesh, speck_share, &pieces, &specks) != SUPINE_OK) {
    return supine_error_memory(error, "checking %s", name);
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
      supine_findings_note(findings, "%s: %s %zu %s%s%s", name, notes[i].done, notes[i].count,
                           notes[i].noun, plural(notes[i].count), notes[i].more);
    }
  }
  if (specks > 0) {
    supine_findings_note(
        findings,
        "%s: dropped %zu small component%s, each below %g %% of the volume; %zu component%s", name,
        specks, plural(specks), 100.0 * speck_share, pieces, pieces == 1 ? " remains" : "s remain");
  }
  if (pieces > 6) { /* five lobes and one other piece are plausible */
    supine_findings_warn(findings, "%s: %zu components; remove those that are not lung", name,
                         pieces);
  }
  return SUPINE_OK;
}

/* The checks of one input. After one has failed, the others are left out. */
typedef struct checks {
  const supine_lungs_source *source;
  supine_findings *findings;
  supine_error *error;
  supine_status status;
} checks;

/* Unless a condition holds, refuse the input with a status, or only warn if it is SUPINE_OK.
 * @param advice  [SUPINE_REMEDIES_MAX], or NULL for none */
SUPINE_PRINTF(5, 6)
static void check(checks *c, bool holds, supine_status refuse, const supine_remedy *advice,
                  const char *format, ...) {
  static const supine_remedy none[SUPINE_REMEDIES_MAX];
  char text[512];
  va_list arguments;
  if (holds || c->status != SUPINE_OK) {
    return;
  }
  va_start(arguments, format);
  (void)supine_print_text_list(text, sizeof text, format, arguments);
  va_end(arguments);
  if (refuse != SUPINE_OK) {
    c->status = supine_error_set(c->error, refuse, "%s: %s", c->source->name, text);
    supine_error_advise(c->error, advice != NULL ? advice : none);
  } else {
    supine_findings_warn(c->findings, "%s: %s", c->source->name, text);
    supine_findings_advise(c->findings, advice != NULL ? advice : none);
  }
}

static supine_remedy accept_size(void) {
  return supine_remedy_give("units", "mm", "to use this size all the same");
}

/* Check the length, proportions and volume of the lungs. A given unit turns refusals into warnings,
 * up to a tenth of the volume that a basis file may have (runtime/plausible.c). */
static void check_size(checks *c, const supine_lungs *lungs, bool likely) {
  const supine_status refuse = c->source->units_given ? SUPINE_OK : SUPINE_ERROR_MESH;
  const supine_remedy use_it[SUPINE_REMEDIES_MAX] = {accept_size()};
  const double ml = lungs->volume[0] + lungs->volume[1];
  const double most = lungs->lung_count == 2 ? 1.0 : 0.6; /* largest share of a pair's volume */
  const double height = lungs->maximum[2] - lungs->minimum[2];
  const bool can_accept = refuse != SUPINE_OK && height > SUPINE_MESH_ANIMAL_LEAST;
  const supine_remedy *accept = can_accept ? use_it : NULL;
  const double ratio = height / (lungs->maximum[0] - lungs->minimum[0]);
  static const double most_ml = 1e8;
  check(c, ml <= most_ml, SUPINE_ERROR_MESH, NULL,
        "the lungs hold %.3g mL, more than the %g mL that a basis may have: correct the unit", ml,
        most_ml);
  check(c, lungs->lung_count < 2 || (ratio >= 0.55 && ratio <= 1.8), refuse, accept,
        "the lungs are %.2f times as high as wide, which is impossible: correct the distance of "
        "the slices (the voxel spacing) in the header",
        ratio);
  check(c, likely && ml >= 100.0 * most && ml <= 12000.0 * most, refuse, accept,
        "the lungs are %.0f mm high and hold %.0f mL, which is impossible: correct the voxel "
        "spacing in the header, or the unit",
        height, ml);
}

/* Check that no lung is hollow: that its surface is not too large for the volume that it encloses,
 * relative to a sphere. */
static void check_solid(checks *c, const supine_lungs *lungs, size_t lung) {
  static const double pi = 3.14159265358979323846;
  const supine_mesh part = supine_lungs_part(lungs, lung);
  const double volume = 1e3 * lungs->volume[lung];
  double area = 0.0;
  for (size_t t = 0; t < part.triangle_count; ++t) {
    const uint32_t *corner = part.triangles + 3 * t;
    double normal[3];
    supine_normal(part.vertices + 3 * (size_t)corner[0], part.vertices + 3 * (size_t)corner[1],
                  part.vertices + 3 * (size_t)corner[2], normal);
    area += 0.5 * supine_length(normal);
  }
  const double compactness = cbrt(36.0 * pi * volume * volume) / area;
  const supine_input_verdict verdict = supine_input_judge(SUPINE_INPUT_LUNG_HOLLOW, compactness);
  check(c, verdict != SUPINE_INPUT_REFUSED, SUPINE_ERROR_MESH, NULL,
        "the %s lung holds %.0f mL within a surface of %.0f cm2, as a hollow shell does: fill the "
        "mask, or remove the surface inside the lung",
        supine_lungs_name(lungs, lung), lungs->volume[lung], 0.01 * area);
}

/* Return the volume of a surface beyond `from` on an axis, on the side of `sign`, mm^3: the
 * integral of max(0, h) n over the surface, with the height h beyond `from` and the normal n. */
static double volume_beyond(const supine_mesh *mesh, int axis, double sign, double from) {
  double sum = 0.0;
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const double *p[3];
    double h[3];
    double normal[3];
    for (size_t k = 0; k < 3; ++k) {
      p[k] = mesh->vertices + 3 * (size_t)mesh->triangles[3 * t + k];
      h[k] = sign * (p[k][axis] - from);
    }
    if (h[0] <= 0.0 && h[1] <= 0.0 && h[2] <= 0.0) {
      continue;
    }
    double mean = fmax(0.0, (h[0] + h[1] + h[2]) / 3.0); /* of max(0, h) over the triangle */
    for (int k = 0; k < 3; ++k) { /* if corner k lies on the other side than the other two */
      const double a = h[(k + 1) % 3];
      const double b = h[(k + 2) % 3];
      if ((h[k] > 0.0 && a <= 0.0 && b <= 0.0) || (h[k] < 0.0 && a >= 0.0 && b >= 0.0)) {
        const double cut = h[k] * h[k] * h[k] / (3.0 * (h[k] - a) * (h[k] - b));
        mean = h[k] > 0.0 ? cut : (h[k] + a + b) / 3.0 - cut;
      }
    }
    supine_normal(p[0], p[1], p[2], normal);
    sum += 0.5 * mean * sign * normal[axis];
  }
  return sum;
}

/* Return the outermost vertex of a surface in a direction. */
static const double *find_outermost(const supine_mesh *mesh, int axis, double sign) {
  const double *outermost = mesh->vertices + 3 * (size_t)mesh->triangles[0];
  for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
    const double *p = mesh->vertices + 3 * (size_t)mesh->triangles[i];
    if (sign * (p[axis] - outermost[axis]) > 0.0) {
      outermost = p;
    }
  }
  return outermost;
}

/* Return how far the outermost `tip_share` of a lung reaches from the vertex `end`, in cube roots
 * of the lung's volume, mm^3, in steps of 0.01; about `longest_tip` if it is longer. */
static double measure_tip(const supine_mesh *lung, double volume, const tip_limits *tip,
                          const double *end) {
  const double size = cbrt(volume);
  double length = 0.0;
  while (length < longest_tip &&
         volume_beyond(lung, tip->axis, tip->sign, end[tip->axis] - tip->sign * length * size) <
             tip_share * volume) {
    length += 0.01;
  }
  return length;
}

/* Check that a lung has no long, thin tip, as of a stray vertex or a trachea, and no flat end. */
static void check_tip(checks *c, const supine_lungs *lungs, size_t lung, const tip_limits *tip) {
  const supine_mesh part = supine_lungs_part(lungs, lung);
  const double volume = 1e3 * lungs->volume[lung];
  const double *end = find_outermost(&part, tip->axis, tip->sign);
  const double length = measure_tip(&part, volume, tip, end);
  const char *advice = "too thin for a lung: remove the stray vertex, trachea or other part there";
  const char *at_least = "";
  supine_status refuse = SUPINE_OK;
  if (length >= longest_tip) {
    refuse = SUPINE_ERROR_MESH;
    at_least = "more than ";
  } else if (length < tip->least) {
    advice = "if the lung is cut off flat there, give a scan that shows all of it";
  }
  check(c, length >= tip->least && length <= tip->most, refuse, NULL,
        "the outermost %g %% of the %s lung towards the %s are %s%.0f mm long, up to "
        "%.0f,%.0f,%.0f mm (LPS): %s",
        100.0 * tip_share, supine_lungs_name(lungs, lung), tip->towards, at_least,
        length * cbrt(volume), end[0], end[1], end[2], advice);
}

/* Write the corners of the box in which points may be deeper than `most_overlap` inside a
 * component: a point is at least as far from the sides of the box around the component as from its
 * surface. */
static void find_inner_box(const supine_lungs *lungs, size_t component, double low[3],
                           double high[3]) {
  supine_box_begin(low, high);
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    if (lungs->topology.component[i] == component) {
      supine_box_add(lungs->mesh.vertices + 3 * i, low, high);
    }
  }
  for (int k = 0; k < 3; ++k) {
    low[k] += most_overlap;
    high[k] -= most_overlap;
  }
}

/* List every n-th vertex of other components that lies in the box of find_inner_box, so that about
 * SAMPLES vertices are looked at. Return their number.
 * @param samples  [vertex_count] written */
static size_t find_samples(const supine_lungs *lungs, size_t component, size_t *samples) {
  const supine_mesh *mesh = &lungs->mesh;
  double low[3];
  double high[3];
  size_t count = 0;
  find_inner_box(lungs, component, low, high);
  for (size_t i = 0; i < mesh->vertex_count; i += mesh->vertex_count / SAMPLES + 1) {
    const double *p = mesh->vertices + 3 * i;
    bool inside = lungs->topology.component[i] != component;
    for (int k = 0; k < 3; ++k) {
      inside = inside && p[k] > low[k] && p[k] < high[k];
    }
    if (inside) {
      samples[count++] = i;
    }
  }
  return count;
}

/* Find the deepest of some vertices inside a component of the surface.
 * @param corners  [triangle_count, 3] work space */
static supine_status find_deepest(const supine_lungs *lungs, size_t component, size_t count,
                                  const size_t *samples, uint32_t *corners,
                                  supine_inside_place *deepest, supine_error *error) {
  const supine_mesh *mesh = &lungs->mesh;
  SUPINE_FREED_BY(supine_lungs_surface_drop) supine_lungs_surface *surface = NULL;
  size_t used = 0;
  for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
    if (lungs->topology.component[mesh->triangles[i]] == component) {
      corners[used++] = mesh->triangles[i];
    }
  }
  SUPINE_TRY(supine_lungs_surface_create(mesh->vertices, used / 3, corners, true, &surface, error));
  for (size_t i = 0; i < count; ++i) {
    const supine_inside_place place =
        supine_lungs_surface_find(surface, mesh->vertices + 3 * samples[i], NULL);
    *deepest = place.depth > deepest->depth ? place : *deepest;
  }
  return SUPINE_OK;
}

/* Check that no component of the surface reaches deep into another one. */
static void check_overlap(checks *c, const supine_lungs *lungs) {
  const supine_mesh *mesh = &lungs->mesh;
  const size_t parts = lungs->topology.component_count;
  SUPINE_ARENA arena = {0};
  uint32_t *corners = supine_arena_take(&arena, 3 * mesh->triangle_count, sizeof *corners);
  size_t *samples = supine_arena_take(&arena, mesh->vertex_count, sizeof *samples);
  check(c, !arena.failed, SUPINE_ERROR_MEMORY, NULL, "no memory for %zu components", parts);
  if (parts > 1) {
    for (size_t of = 0; of < parts && c->status == SUPINE_OK; ++of) {
      supine_inside_place deepest = {.depth = 0.0};
      const size_t count = find_samples(lungs, of, samples);
      if (count > 0) {
        c->status = find_deepest(lungs, of, count, samples, corners, &deepest, c->error);
      }
      check(
          c, deepest.depth <= most_overlap, SUPINE_ERROR_MESH, NULL,
          "one of its surfaces reaches %.0f mm into another one, at %.0f,%.0f,%.0f mm (LPS): give "
          "both lungs in the axes of one scan, and remove surfaces inside a lung",
          deepest.depth, deepest.point[0], deepest.point[1], deepest.point[2]);
    }
  }
}

/* Return by how much of its height the lower of two lungs lies below the other: both its base and
 * its apex do, as a lung may be short after surgery, or above a raised diaphragm. */
static double lower_by(const supine_lungs *lungs) {
  const double base = lungs->low[0][2] - lungs->low[1][2];
  const double apex = lungs->high[0][2] - lungs->high[1][2];
  const double height =
      fmax(lungs->high[0][2] - lungs->low[0][2], lungs->high[1][2] - lungs->low[1][2]);
  return base * apex > 0.0 ? fmin(fabs(base), fabs(apex)) / height : 0.0;
}

/* Check that two lungs are level, as one person's are: their backs, and their bases and apices. */
static void check_level(checks *c, const supine_lungs *lungs) {
  const double depth =
      fmax(lungs->high[0][1] - lungs->low[0][1], lungs->high[1][1] - lungs->low[1][1]);
  if (lungs->lung_count < 2) {
    return;
  }
  const double backs = fabs(lungs->high[0][1] - lungs->high[1][1]) / depth;
  const double lower = lower_by(lungs);
  check(c, supine_input_judge(SUPINE_INPUT_LUNGS_LEVEL, fmax(backs, lower)) == SUPINE_INPUT_TAKEN,
        SUPINE_OK, NULL,
        "one lung lies %s of the other by %.0f %% of its %s: check that both lungs are of one "
        "person, in one frame",
        backs > lower ? "in front" : "below the level", 100.0 * fmax(backs, lower),
        backs > lower ? "depth" : "height");
}

/* Divide the triangles between two lungs along the axis on which the two overlap least. Return the
 * number of lungs.
 * @param parts  written; the vertices are those of `lungs`, the triangles are in the arena */
static size_t part_lungs(const supine_lungs *lungs, supine_arena *arena, supine_mesh parts[2]) {
  const supine_mesh *mesh = &lungs->mesh;
  const supine_topology *topology = &lungs->topology;
  uint8_t *group = supine_arena_take(arena, topology->component_count, sizeof *group);
  double least = SUPINE_LUNGS_MOST_OVERLAP;
  int along = -1;
  for (size_t g = 0; g < 2; ++g) {
    parts[g] = (supine_mesh){mesh->vertex_count, mesh->vertices, 0,
                             supine_arena_take(arena, 3 * mesh->triangle_count, sizeof(uint32_t))};
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double middle = 0.5 * (lungs->minimum[axis] + lungs->maximum[axis]);
    const double overlap = supine_lungs_sides(mesh, topology, axis, middle, arena, group);
    along = overlap < least ? axis : along;
    least = fmin(least, overlap);
  }
  const double middle =
      along < 0 ? INFINITY : 0.5 * (lungs->minimum[along] + lungs->maximum[along]);
  (void)supine_lungs_sides(mesh, topology, along < 0 ? 0 : along, middle, arena, group);
  if (arena->failed) {
    return 0;
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    supine_mesh *part = &parts[group[topology->component[corner[0]]]];
    memcpy(part->triangles + 3 * part->triangle_count++, corner, 3 * sizeof *corner);
  }
  return along < 0 ? 1 : 2;
}

/* Check the surface's unit, that it is closed, and that its shape fits the axes, its size, and the
 * tips of lungs. Refuse one component with both lungs. Write whether the shape confirms the axes,
 * and the side of a single lung: +1 left, -1 right, 0 unknown. */
static void check_shape(checks *c, const supine_lungs *lungs, int *side, bool *axes_hold) {
  const supine_topology *t = &lungs->topology;
  supine_mesh_anatomy found = {.axes = SUPINE_AXES_LPS};
  const char *unit = NULL;
  const double *low = lungs->minimum;
  const double *high = lungs->maximum;
  const double length = fmax(high[0] - low[0], fmax(high[1] - low[1], high[2] - low[2]));
  const bool likely = supine_mesh_unit_is_likely(length, &unit);
  const bool given = c->source->units_given;
  char letters[4];
  supine_remedy units[SUPINE_REMEDIES_MAX] = {
      supine_remedy_give("units", unit != NULL ? unit : "", "")};
  if (!given && length > SUPINE_MESH_ANIMAL_LEAST) {
    units[1] = accept_size();
  }
  check(c, likely || unit == NULL, given ? SUPINE_OK : SUPINE_ERROR_MESH, units,
        "the lungs are %.3g mm long, which is impossible", length);
  check(
      c, t->closed, SUPINE_ERROR_OPEN_SURFACE, NULL,
      "the surface is open (edges: %zu boundary, %zu non-manifold, %zu inconsistent) and encloses "
      "no volume: close its holes in a mesh editor, or give the label map that it was made from",
      t->boundary_edges, t->non_manifold_edges, t->inconsistent_edges);
  if (c->status == SUPINE_OK) {
    SUPINE_ARENA arena = {0};
    supine_mesh parts[2];
    const size_t count = part_lungs(lungs, &arena, parts);
    check(c, count > 0, SUPINE_ERROR_MEMORY, NULL, "no memory for the two lungs");
    found = count > 0 ? supine_mesh_anatomy_find(parts, count) : found;
  }
  *side = found.side;
  *axes_hold = found.certain && found.axes == SUPINE_AXES_LPS;
  supine_mesh_axes_letters(supine_mesh_axes_after(c->source->axes, found.axes), letters);
  const supine_remedy axes[SUPINE_REMEDIES_MAX] = {
      supine_remedy_give("axes", letters, "if these are the axes")};
  check(c, found.axes == SUPINE_AXES_LPS, SUPINE_OK, axes,
        "the axes are doubtful: the shape of the lungs fits %s%s", letters,
        supine_mesh_axes_mirrored(found.axes)
            ? " (a scan pitched by more than 25 degrees has such a shape, too: turn it upright)"
            : "");
  for (size_t lung = 0; lung < lungs->lung_count && c->status == SUPINE_OK; ++lung) {
    for (size_t i = 0; i < sizeof tips / sizeof *tips; ++i) {
      check_tip(c, lungs, lung, &tips[i]);
    }
  }
  const supine_remedy divide[SUPINE_REMEDIES_MAX] = {
      supine_remedy_give("labels", "one", "to divide the mask of a label map"),
      supine_remedy_give("midline", "", "if it is a single lung")};
  check(c, !found.joined || c->source->midline != NULL || c->source->side != 0, SUPINE_ERROR_MESH,
        divide, "this surface looks like both lungs in one piece: separate them");
  check_size(c, lungs, likely);
  if (found.axes == SUPINE_AXES_LPS) {
    check_level(c, lungs);
  }
  for (size_t lung = 0; lung < lungs->lung_count && c->status == SUPINE_OK; ++lung) {
    check_solid(c, lungs, lung);
  }
}

/* Choose the side of a single lung as stated, or by its shape or, if that is unclear, by its
 * position. */
static supine_status take_side(const supine_mesh *meshes, size_t count,
                               const supine_lungs_source *source, int side, supine_lungs *lungs,
                               supine_findings *findings, supine_error *error) {
  const double low = lungs->minimum[0];
  const double high = lungs->maximum[0];
  int taken = lungs->side[0];
  if (source->side != 0) {
    taken = source->side;
  } else if (side != 0) {
    taken = side;
  }
  const double midline = taken > 0 ? low : high;
  if (source->side == 0) {
    char other_midline[SUPINE_REMEDY_VALUE_MAX];
    (void)supine_print_text(other_midline, sizeof other_midline, "%.0f",
                            taken > 0 ? ceil(high) : floor(low));
    supine_findings_note(findings, "%s: one lung, taken for the %s lung by its %s", source->name,
                         taken > 0 ? "left" : "right", side != 0 ? "shape" : "place");
    const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
        supine_remedy_give("midline", other_midline, "if it is the other one")};
    supine_findings_advise(findings, advice);
  }
  if (taken == lungs->side[0] && lungs->midline == midline) {
    return SUPINE_OK;
  }
  supine_lungs_free(lungs);
  return supine_lungs_create(meshes, count, &midline, lungs, error);
}

supine_status supine_lungs_gate(supine_mesh *meshes, size_t count,
                                const supine_lungs_source *source, supine_lungs *lungs,
                                bool *axes_hold, supine_findings *findings, supine_error *error) {
  supine_error inner = {0};
  int side = 0;
  *axes_hold = false;
  for (size_t m = 0; m < count; ++m) {
    SUPINE_TRY(mend(&meshes[m], source->name, findings, error));
  }
  const supine_status status = supine_lungs_create(meshes, count, source->midline, lungs, &inner);
  if (status != SUPINE_OK) {
    return supine_error_wrap(error, &inner, "%s: ", source->name);
  }
  checks c = {source, findings, error, SUPINE_OK};
  check_shape(&c, lungs, &side, axes_hold);
  check_overlap(&c, lungs);
  if (c.status == SUPINE_OK && lungs->lung_count == 1 && source->midline == NULL) {
    c.status = take_side(meshes, count, source, side, lungs, findings, error);
  }
  if (c.status != SUPINE_OK) {
    supine_lungs_free(lungs);
  }
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    if (lungs->reversed[lung]) {
      supine_findings_note(findings, "%s: the triangles of the %s lung faced inwards: reversed",
                           source->name, supine_lungs_name(lungs, lung));
    }
  }
  return c.status;
}
