/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine bench: what an evaluation costs on this machine, beside the memory it must move. */
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "program/bench/bench.h"

#include "program/options/command.h"

static const char name[] = "bench";

enum { SIZES_MAX = 32 };

typedef struct request {
  supine_bench_options bench;
  size_t sizes[SIZES_MAX];
  bool json;
} request;

/* "10000,100000" into sizes */
static int read_sizes(const char *command, const char *text, void *field) {
  request *wanted = field;
  (void)command;
  size_t count = 0;
  for (const char *at = text; count < SIZES_MAX; ++at) {
    char number[32];
    const size_t digits = strcspn(at, ",");
    (void)snprintf(number, sizeof number, "%.*s", (int)digits, at);
    if (digits >= sizeof number || !supine_options_parse_count(number, &wanted->sizes[count]) ||
        wanted->sizes[count] == 0) {
      break;
    }
    ++count;
    at += digits;
    if (*at == '\0') {
      wanted->bench.vertices = wanted->sizes;
      wanted->bench.vertices_count = count;
      return SUPINE_EXIT_OK;
    }
  }
  return SUPINE_OPTION_MISFIT;
}

static const supine_option table[] = {
    {"vertices", 0, "N,N,...", "sizes", .read = read_sizes, .standard = "10000,100000,1000000",
     .wants = "numbers, N,N,..."},
    {"threads", 0, "N", "measure one thread and this many", SUPINE_FILLS(request, bench.threads),
     .standard = "2", .range = {1.0, 256.0}},
    {"repeats", 0, "N", "runs of each", SUPINE_FILLS(request, bench.repeats), .standard = "9",
     .range = {1.0, INFINITY}, .wants = "a number from 1"},
    {"json", 0, NULL,
     "{\"rows\": [{\"what\", \"vertices\", \"threads\", \"storage\", \"ns_per_vertex\", ...}]}",
     SUPINE_FILLS(request, json)},
    {.name = NULL}};

static void print_row(void *context, const supine_bench_row *row) {
  (void)context;
  (void)printf("%-18s %-8s %-8s %9zu %5zu %7zu %9.3f %8.1f %8.1f %6.2f", row->what, row->storage,
               row->code, row->vertices, row->modes, row->threads, row->ns_per_vertex,
               row->bytes_per_vertex, row->gb_per_second, row->triad_share);
  if (row->multiplications > 0.0) {
    (void)printf("  %g + %g", row->multiplications, row->additions);
  }
  (void)putchar('\n');
  (void)fflush(stdout);
}

static void append_row(void *context, const supine_bench_row *row) {
  json_t *rows = context;
  (void)json_array_append_new(
      rows,
      json_pack("{s:s, s:s, s:s, s:I, s:I, s:I, s:f, s:f, s:f, s:f, s:f, s:f}", "what", row->what,
                "storage", row->storage, "code", row->code, "vertices", (json_int_t)row->vertices,
                "modes", (json_int_t)row->modes, "threads", (json_int_t)row->threads,
                "ns_per_vertex", row->ns_per_vertex, "bytes_per_vertex", row->bytes_per_vertex,
                "gb_per_second", row->gb_per_second, "triad_share", row->triad_share,
                "multiplications", row->multiplications, "additions", row->additions));
}

static int measure(const supine_bench_options *options, bool json) {
  supine_error error;
  json_t *rows = json_array();
  if (!json) {
    (void)printf("%-18s %-8s %-8s %9s %5s %7s %9s %8s %8s %6s  %s\n", "what", "storage", "code",
                 "vertices", "modes", "threads", "ns/vertex", "B/vertex", "GB/s", "triad",
                 "mul + add");
  }
  if (supine_bench_run(options, NULL, json ? append_row : print_row, rows, &error) != SUPINE_OK) {
    json_decref(rows);
    return supine_options_fail(name, &error);
  }
  json_t *root = json_pack("{s:o}", "rows", rows);
  if (json) {
    (void)json_dumpf(root, stdout, JSON_INDENT(1) | JSON_REAL_PRECISION(6));
    (void)putchar('\n');
  }
  json_decref(root);
  return supine_options_finish(name);
}

static int run(void *chosen, const supine_arguments *given) {
  request *wanted = chosen;
  supine_basis *basis = NULL;
  supine_error error;
  if (supine_basis_open(given->operand[0], &basis, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  wanted->bench.like = basis;
  const int result = measure(&wanted->bench, wanted->json);
  supine_basis_close(basis);
  return result;
}

const supine_command supine_command_bench = {
    name,
    "measure what an evaluation costs on this machine",
    .usage = "BASIS [OPTIONS]",
    .about =
        "Measures the evaluation of a basis on this machine: its field, repeated to each number of "
        "vertices, in every form of storage, beside a plain loop that a compiler makes fast and "
        "beside what the memory can do. All are run in turn, many times over, and the fastest run "
        "of each is given: compare rows of one run.",
    .options = table,
    .notes =
        "Rows: supine (AoS output by storage, and others named in full), plain_loop (-O3, "
        "float32), traffic (the same loads and stores without arithmetic: with AVX-512, memory's "
        "bound), normals (by their modes), lit (positions and normals), supine_normals (exactly, "
        "from the triangles), copy and triad (the memory's own speed, with stores past the "
        "caches), arithmetic "
        "(what threads gain where memory plays no part). triad is the share of the triad's "
        "bandwidth that is reached.\n"
        "A tracked head-worn display allows 15 ms a frame: 15 ns a vertex for a million vertices.",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
