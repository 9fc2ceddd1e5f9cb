/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the comparison as CSV; docs/compare.md describes the columns. */
#include <math.h>
#include <string.h>

#include "base/csv.h"
#include "base/vec3.h"
#include "program/report/comparison.h"

static const char header[] = "schema,from,posture,gx,gy,gz,kind,name,mm,dx,dy,dz,max_mm,"
                             "moved_error_mm,expected_error_mm,another_day_error_mm,"
                             "volume_before_ml,volume_ml\n";

/* A row of the table. Numbers that it lacks are NAN, which become empty fields. */
typedef struct row {
  const char *kind;
  const char *name;
  double mm, move[3], max, moved_error, error, another_error, before, volume;
} row;

static const row none = {.mm = NAN,
                         .move = {NAN, NAN, NAN},
                         .max = NAN,
                         .moved_error = NAN,
                         .error = NAN,
                         .another_error = NAN,
                         .before = NAN,
                         .volume = NAN};

static void add_number(supine_csv_row *line, double value) {
  if (isnan(value)) {
    supine_csv_add_text(line, "");
  } else {
    supine_csv_add(line, "%.3f", value);
  }
}

static void add_row(const supine_comparison *c, size_t posture, const row *of, FILE *file) {
  const supine_posture_item *item = c->posture[posture].item;
  const double numbers[] = {of->mm,     of->move[0],     of->move[1], of->move[2],
                            of->max,    of->moved_error, of->error,   of->another_error,
                            of->before, of->volume};
  supine_csv_row line = {.file = file};
  supine_csv_add(&line, "%d", SUPINE_COMPARISON_SCHEMA);
  supine_csv_add_text(&line, c->reference.name);
  supine_csv_add_text(&line, item->name);
  supine_csv_add(&line, "%.6f,%.6f,%.6f", item->state.gravity[0], item->state.gravity[1],
                 item->state.gravity[2]);
  supine_csv_add_text(&line, of->kind);
  supine_csv_add_text(&line, of->name);
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; ++i) {
    add_number(&line, numbers[i]);
  }
  supine_csv_end_row(&line);
}

/* Write the rows of the surface, the hilum and the lungs. */
static void add_lungs(const supine_comparison *c, size_t posture, FILE *file) {
  const supine_compared_posture *p = &c->posture[posture];
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  double before[SUPINE_LUNGS_MAX];
  row surface = none;
  surface.kind = "surface";
  surface.name = "";
  surface.mm = p->displacement.mean;
  surface.max = p->displacement.max;
  if (c->has_errors) {
    surface.moved_error = p->moved_error;
    surface.error = p->expected_error;
    surface.another_error = p->another_error;
  }
  add_row(c, posture, &surface, file);
  if (supine_length(p->hilum.move) > 0.0) { /* else the basis does not say how the hilum moves */
    row hilum = none;
    hilum.kind = "hilum";
    hilum.name = "";
    hilum.mm = supine_length(p->hilum.move);
    memcpy(hilum.move, p->hilum.move, sizeof hilum.move);
    hilum.moved_error = p->hilum.expected;
    add_row(c, posture, &hilum, file);
  }
  if (info->is_fields) { /* they have no volumes */
    return;
  }
  (void)supine_basis_volumes(c->basis, &c->reference.pose, before);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    row of = none;
    of.kind = "lung";
    of.name = info->lung_names[lung];
    of.before = before[lung];
    of.volume = p->volume[lung];
    add_row(c, posture, &of, file);
  }
}

/* Write the rows of the structures inside the lungs. */
static void add_targets(const supine_comparison *c, size_t posture, FILE *file) {
  for (size_t k = 0; k < c->names.count; ++k) {
    const supine_target *t = &c->posture[posture].targets[k];
    row of = none;
    of.kind = t->anatomy ? "anatomy" : "target";
    of.name = t->name;
    of.mm = t->moved;
    memcpy(of.move, t->move, sizeof of.move);
    of.moved_error = t->moved_error;
    of.error = t->error;
    of.another_error = t->another_error;
    of.before = t->volume[0] != 0.0 ? t->volume[0] : (double)NAN;
    of.volume = t->volume[0] != 0.0 ? t->volume[1] : (double)NAN;
    add_row(c, posture, &of, file);
  }
}

void supine_report_table(const supine_comparison *c, FILE *file) {
  (void)fputs(header, file);
  for (size_t i = 0; i < c->postures.count; ++i) {
    add_lungs(c, i, file);
    if (c->inside != NULL) {
      add_targets(c, i, file);
    }
  }
}
