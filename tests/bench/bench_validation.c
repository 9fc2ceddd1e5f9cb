/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Repeat the validation experiments of [Santhanam2008]. Write the data of each figure as CSV and,
 * if gnuplot is installed, the figure as PNG.
 *
 *     bench_validation [FOLDER [DATA]]
 *
 * FOLDER (default: validation) is created if it is missing. DATA is the folder of the real lungs
 * (default: the test data). Without them, a synthetic pair at three resolutions is used. */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "precompute/lungs/phantom.h"

#include "tests/helpers/validation.h"

static const char *folder = "validation";
static const char *data = SUPINE_TEST_DATA;

static const double postures[4][3] = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}};
static const char *const posture_names[] = {"supine", "prone", "left", "right"};

static void need(bool good, const char *what) {
  if (!good) {
    (void)fprintf(stderr, "bench_validation: %s\n", what);
    exit(EXIT_FAILURE);
  }
}

static FILE *begin_csv(const char *name, const char *header) {
  char path[1024];
  (void)snprintf(path, sizeof path, "%s/%s.csv", folder, name);
  FILE *file = fopen(path, "wb");
  need(file != NULL, path);
  (void)fprintf(file, "%s\n", header);
  return file;
}

/* Close the CSV file, and draw NAME.png by gnuplot commands, which call that file `csv`. */
static void end_figure(FILE *csv, const char *name, const char *commands) {
  need(fclose(csv) == 0, "cannot write a CSV file");
  FILE *gnuplot = popen("gnuplot 2>/dev/null", "w"); /* NOLINT(cert-env33-c) */
  if (gnuplot == NULL) {
    return;
  }
  (void)fprintf(gnuplot,
                "set terminal png size 900,600\nset output '%s/%s.png'\n"
                "set datafile separator ','\nset key autotitle columnhead outside\nset grid\n"
                "csv = '%s/%s.csv'\n%s\n",
                folder, name, folder, name, commands);
  const int code = pclose(gnuplot);
  (void)printf("%s/%s.csv%s\n", folder, name, code == 0 ? ", .png" : " (no PNG: install gnuplot)");
}

/* Convergence of one method: the error of the displacements against the work, which is the number
 * of times that a mass or spring reads the state of a neighbour. */
typedef struct curve {
  FILE *csv;
  const char *method;
  size_t count;        /* number of displacements */
  const double *exact; /* [count] displacements without error */
  double reads;        /* such reads in one solver step, or in one evaluation of accelerations */
} curve;

static void add_point(const curve *c, double work, const double *found) {
  const double error = relative_rms(c->count, found, c->exact);
  if (error > 1e-13) {
    (void)fprintf(c->csv, "%s,%.6g,%.6g\n", c->method, work * c->reads, error);
  }
}

static void damper_seen(void *context, size_t evaluations, const double *found) {
  add_point(context, (double)evaluations, found);
}

static void count_steps(void *context, size_t steps, double held) {
  (void)held;
  *(size_t *)context = steps;
}

/* Draw Fig. 7 of [Santhanam2008]: error against the number of reads of a neighbour's state. */
static void convergence(void) {
  frame f = frame_plane(21, 10.0);
  const size_t n = f.mesh.vertex_count;
  const double links = 2.0 * (double)f.topology.edge_count;
  double *force = plane_force(&f);
  double *stiffness = ones(n);
  double *exact = calloc(n, sizeof *exact);
  double *found = calloc(n, sizeof *found);
  need(frame_solve(&f, NULL, force, exact) == SUPINE_OK, "no solution");
  FILE *csv = begin_csv("fig7_convergence", "method,link_visits,relative_rms_error");
  /* A step updates one mass or one spring; this is the mean number of neighbours that it reads. */
  const double visits = 2.0 * links / (double)(n + f.topology.edge_count);
  curve c = {csv, "Pitcher/Catcher", n, exact, visits};
  for (int k = 1; k <= 13; ++k) {
    size_t steps = 0;
    need(supine_physics_pitcher_catcher(&f.mesh, &f.topology, NULL, force, pow(10.0, -k), found,
                                        count_steps, &steps, NULL) == SUPINE_OK,
         "no solution");
    add_point(&c, (double)steps, found);
  }
  c.method = "mass-spring-damper";
  c.reads = links;
  mass_spring_damper system = damper_create(&f, stiffness, force);
  need(damper_integrate(&system, stiffness, 40.0, 40, found, damper_seen, &c), "no integration");
  end_figure(csv, "fig7_convergence",
             "set logscale xy\nset format y '10^{%T}'\nset xlabel 'work, link visits'\n"
             "set ylabel 'RMS error, relative'\n"
             "m(name) = sprintf(\"< awk -F, 'NR == 1 || $1 == \\\"%s\\\"' %s\", name, csv)\n"
             "plot for [name in '\"Pitcher/Catcher\" \"mass-spring-damper\"'] m(name) using 2:3 "
             "with linespoints title name");
  damper_free(&system);
  frame_free(&f);
  free(force);
  free(stiffness);
  free(exact);
  free(found);
}

/* Draw Fig. 8 of [Santhanam2008]: a plane sheet, solved by Supine and by a mass-spring-damper
 * system. */
static void plane(void) {
  enum { SIDE = 31 };
  frame f = frame_plane(SIDE, 10.0);
  const size_t n = f.mesh.vertex_count;
  double *force = plane_force(&f);
  double *stiffness = ones(n);
  double *ours = calloc(n, sizeof *ours);
  double *theirs = calloc(n, sizeof *theirs);
  need(frame_solve(&f, NULL, force, ours) == SUPINE_OK, "no solution");
  mass_spring_damper system = damper_create(&f, stiffness, force);
  need(damper_integrate(&system, stiffness, 40.0, 1, theirs, NULL, NULL), "no integration");
  FILE *csv = begin_csv("fig8_plane", "x_mm,supine,mass-spring-damper");
  for (size_t x = 0; x < SIDE; ++x) {
    const size_t i = SIDE / 2 * SIDE + x;
    (void)fprintf(csv, "%.9g,%.9g,%.9g\n", f.mesh.vertices[3 * i], ours[i], theirs[i]);
  }
  (void)printf("sheet: displacements by supine and by mass-spring-damper differ by %.2e %% RMS\n",
               100.0 * relative_rms(n, ours, theirs));
  end_figure(csv, "fig8_plane",
             "set xlabel 'x, mm'\nset ylabel 'displacement'\n"
             "plot csv using 1:2 with lines lw 2, csv using 1:3 with points");
  damper_free(&system);
  frame_free(&f);
  free(force);
  free(stiffness);
  free(ours);
  free(theirs);
}

/* Draw Fig. 9 of [Santhanam2008]: a ring of uniform stiffness, and rings with one stiffer third. */
static void ring(void) {
  enum { COUNT = 90 };
  static const double factors[] = {1.0, 2.0, 4.0};
  frame f = frame_ring(COUNT, 50.0);
  double *force = ones(COUNT);
  double catch_[3][COUNT];
  for (size_t k = 0; k < 3; ++k) {
    double *stiffness = ring_stiffness(COUNT, factors[k]);
    need(frame_solve(&f, stiffness, force, catch_[k]) == SUPINE_OK, "no solution");
    free(stiffness);
  }
  FILE *csv = begin_csv("fig9_ring", "x0,y0,x1,uniform,x2,one third twice as stiff,x4,one third 4 "
                                     "times as stiff");
  for (size_t i = 0; i <= COUNT; ++i) {
    const double *p = f.mesh.vertices + 3 * (i % COUNT);
    (void)fprintf(csv, "%.9g,%.9g", p[0], p[1]);
    for (size_t k = 0; k < 3; ++k) {
      const double scale = 1.0 + 0.4 * catch_[k][i % COUNT];
      (void)fprintf(csv, ",%.9g,%.9g", scale * p[0], scale * p[1]);
    }
    (void)fputc('\n', csv);
  }
  end_figure(csv, "fig9_ring",
             "set size ratio -1\nset xlabel 'mm'\n"
             "plot csv using 1:2 with lines title 'at rest', csv using 3:4 with lines, "
             "csv using 5:6 with lines, csv using 7:8 with lines");
  frame_free(&f);
  free(force);
}

/* Load lungs at a resolution from 0 (coarse) to 2. If they are missing, make synthetic lungs. */
static bool load_lungs(int resolution, supine_lungs *lungs) {
  static const char *const names[3][2] = {{"chaste_left_5k.obj", "chaste_right_5k.obj"},
                                          {"chaste_left.ply", "chaste_right.ply"},
                                          {"chaste_left_full.ply", "chaste_right_full.ply"}};
  supine_mesh meshes[2] = {0};
  supine_error error = {0};
  char path[1024];
  (void)snprintf(path, sizeof path, "%s/lungs/%s", data, names[resolution][0]);
  size_t count = 2;
  if (access(path, R_OK) == 0) {
    for (size_t m = 0; m < 2; ++m) {
      (void)snprintf(path, sizeof path, "%s/lungs/%s", data, names[resolution][m]);
      need(supine_mesh_load(path, NULL, &meshes[m], NULL, &error) == SUPINE_OK, error.message);
    }
  } else {
    static const size_t vertices[3] = {10000, 40000, 500000};
    count = 1;
    (void)printf("no real lungs in %s: a synthetic pair is used\n", data);
    need(supine_phantom_create(vertices[resolution], 6000.0, &meshes[0], &error) == SUPINE_OK,
         error.message);
  }
  const bool good = supine_lungs_create(meshes, count, NULL, lungs, &error) == SUPINE_OK;
  need(good, error.message);
  supine_mesh_free(&meshes[0]);
  supine_mesh_free(&meshes[1]);
  return good;
}

/* Plot how the largest displacement grows with the volume inhaled ([Santhanam2008] III-C, IV-B). */
static void linearity(const supine_lungs *lungs) {
  const supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  double cubic[4][3];
  double largest[4];
  for (size_t p = 0; p < 4; ++p) {
    supine_solution solution = {0};
    need(supine_physics_solve(lungs, &model, postures[p], &solution, NULL) == SUPINE_OK,
         "no solution");
    memcpy(cubic[p], solution.cubic, sizeof cubic[p]);
    largest[p] = supine_physics_solution_largest(&solution);
    supine_physics_solution_free(&solution);
  }
  FILE *csv = begin_csv("linearity", "volume_mL,supine,prone,left,right");
  double bend = 0.0;
  for (int step = 0; step <= 30; ++step) {
    (void)fprintf(csv, "%d", 50 * step);
    for (size_t p = 0; p < 4; ++p) {
      double scale = 0.0;
      double full = 0.0;
      need(supine_volume_scale(cubic[p], 50.0 * step, &scale, NULL) == SUPINE_OK &&
               supine_volume_scale(cubic[p], 500.0, &full, NULL) == SUPINE_OK,
           "no scale");
      if (step <= 10) {
        bend = fmax(bend, fabs(scale / full - 0.1 * step));
      }
      (void)fprintf(csv, ",%.6f", scale * largest[p]);
    }
    (void)fputc('\n', csv);
  }
  (void)printf(
      "up to 500 mL, displacements deviate from proportionality to the volume by at most %.2f %% "
      "of their value at 500 mL\n",
      100.0 * bend);
  end_figure(csv, "linearity",
             "set xlabel 'volume above rest, mL'\nset ylabel 'largest displacement, mm'\n"
             "plot for [i=2:5] csv using 1:i with lines");
}

static void regional_ventilation(const supine_lungs *lungs) {
  ventilation found[4];
  for (size_t p = 0; p < 4; ++p) {
    need(ventilation_measure(lungs, postures[p], 500.0, &found[p]) == SUPINE_OK, "no ventilation");
    (void)printf("%-6s ventilation index rises by %.2f from top to bottom, %.3f per cm\n",
                 posture_names[p], found[p].slope, 10.0 * found[p].slope / found[p].height);
  }
  FILE *csv =
      begin_csv("ventilation", "height,supine,prone,left,right,supine swept,prone swept,left "
                               "swept,right swept");
  for (size_t z = 0; z < ZONES; ++z) {
    (void)fprintf(csv, "%.3g", ((double)z + 0.5) / ZONES);
    for (size_t p = 0; p < 4; ++p) {
      (void)fprintf(csv, ",%.6f", found[p].index[z]);
    }
    for (size_t p = 0; p < 4; ++p) {
      (void)fprintf(csv, ",%.6f", found[p].swept[z]);
    }
    (void)fputc('\n', csv);
  }
  end_figure(
      csv, "ventilation",
      "set xlabel 'ventilation index, mean 1'\n"
      "set ylabel 'position along gravity: 0 at the top, 1 at the bottom'\nset yrange [1:0]\n"
      "plot for [i=2:5] csv using i:1 with linespoints title columnheader(i)");
}

/* Plot how displacements change with the resolution of the mesh. Print how far a unit force on a
 * vertex spreads. */
static void resolution(void) {
  static const double reaches[] = {0.0, 3.0, 5.0, 10.0, 20.0};
  static const char *const names[] = {"5k", "20k", "250k"};
  supine_lungs lungs[3] = {0};
  double *moves[3];
  size_t vertex[3];
  for (int r = 0; r < 3; ++r) {
    (void)load_lungs(r, &lungs[r]);
    moves[r] = calloc(3 * lungs[r].mesh.vertex_count, sizeof(double));
    need(moves[r] != NULL, "out of memory");
  }
  vertex[0] = lungs[0].mesh.vertex_count / 3;
  for (int r = 1; r < 3; ++r) {
    nearest_grid grid = nearest_create(&lungs[r].mesh, 5.0);
    vertex[r] = nearest_find(&grid, lungs[0].mesh.vertices + 3 * vertex[0]);
    nearest_free(&grid);
    need(vertex[r] != SIZE_MAX,
         "no vertex of the finer mesh is near the vertex that gets the unit force");
  }
  FILE *csv = begin_csv("resolution", "reach_mm,drift 5k to 20k %,drift 20k to 250k %,drift 5k to "
                                      "250k %,spread 5k mm,spread 20k mm,spread 250k mm");
  for (size_t k = 0; k < sizeof reaches / sizeof *reaches; ++k) {
    double spread[3];
    for (int r = 0; r < 3; ++r) {
      need(breathe_at(&lungs[r], reaches[k], postures[0], 500.0, moves[r]) == SUPINE_OK &&
               spread_of(&lungs[r], reaches[k], vertex[r], &spread[r]) == SUPINE_OK,
           "no solution");
    }
    const double drift[3] = {100.0 * drift_of(&lungs[0].mesh, moves[0], &lungs[1].mesh, moves[1]),
                             100.0 * drift_of(&lungs[1].mesh, moves[1], &lungs[2].mesh, moves[2]),
                             100.0 * drift_of(&lungs[0].mesh, moves[0], &lungs[2].mesh, moves[2])};
    (void)printf(
        "reach %2.0f mm: displacements change by %.2f %% RMS from 5k to 20k vertices, %.2f %% from "
        "20k to 250k, %.2f %% from 5k to 250k; a unit force spreads",
        reaches[k], drift[0], drift[1], drift[2]);
    for (int r = 0; r < 3; ++r) {
      (void)printf("%s %.2f mm at %s", r == 0 ? "" : ",", spread[r], names[r]);
    }
    (void)putchar('\n');
    (void)fprintf(csv, "%g,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f\n", reaches[k], drift[0], drift[1],
                  drift[2], spread[0], spread[1], spread[2]);
  }
  end_figure(csv, "resolution",
             "set xlabel 'reach, mm (0: the paper)'\nset ylabel 'change of displacements, % RMS'\n"
             "plot for [i=2:4] csv using 1:i with linespoints");
  for (int r = 0; r < 3; ++r) {
    supine_lungs_free(&lungs[r]);
    free(moves[r]);
  }
}

int main(int argc, char **argv) {
  folder = argc > 1 ? argv[1] : folder;
  data = argc > 2 ? argv[2] : data;
  (void)gsl_set_error_handler_off();
  need(mkdir(folder, 0777) == 0 || errno == EEXIST, "cannot make the folder of the figures");
  convergence();
  plane();
  ring();
  supine_lungs lungs = {0};
  (void)load_lungs(1, &lungs);
  linearity(&lungs);
  regional_ventilation(&lungs);
  supine_lungs_free(&lungs);
  resolution();
  return EXIT_SUCCESS;
}
