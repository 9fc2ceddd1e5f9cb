/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine bench: what an evaluation costs on this machine, beside the memory it must move. */
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "runtime/bench/bench.h"

#include "runtime/options/command.h"

static const char name[] = "bench";

static const char help[] =
    "Usage: supine bench BASIS [OPTIONS]\n"
    "\n"
    "Measures the evaluation of a basis on this machine: its field, repeated to each number of\n"
    "vertices, in every form of storage, beside a plain loop that a compiler makes fast and "
    "beside\n"
    "what the memory can do. All are run in turn, many times over, and the fastest run of each is\n"
    "given: compare rows of one run.\n"
    "\n"
    "  --vertices N,N,...   sizes; default 10000,100000,1000000\n"
    "  --threads N          measure one thread and this many; default 2\n"
    "  --repeats N          runs of each; default 9\n"
    "  --json               {\"rows\": [{\"what\", \"vertices\", \"threads\", \"storage\",\n"
    "                       \"ns_per_vertex\", ...}]}\n"
    "\n"
    "Rows: supine (AoS output by storage, and others named in full), plain_loop (-O3, float32),\n"
    "traffic (the same loads and stores without arithmetic: with AVX-512, memory's bound), copy\n"
    "and triad (the memory's own speed, with stores past the caches), arithmetic (what threads\n"
    "gain where memory plays no part). triad is the share of the triad's bandwidth that is "
    "reached.\n"
    "A tracked head-worn display allows 15 ms a frame: 15 ns a vertex for a million vertices.\n";

enum { SIZES_MAX = 32 };

/* "10000,100000" into sizes; how many, or 0 where it is anything else. */
static size_t parse_sizes(const char *text, size_t *sizes) {
  size_t count = 0;
  for (const char *at = text; count < SIZES_MAX; ++at) {
    char number[32];
    const size_t digits = strcspn(at, ",");
    if (digits >= sizeof number) {
      return 0;
    }
    memcpy(number, at, digits);
    number[digits] = '\0';
    if (!supine_options_parse_count(number, &sizes[count]) || sizes[count] == 0) {
      return 0;
    }
    ++count;
    at += digits;
    if (*at == '\0') {
      return count;
    }
  }
  return 0;
}

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

int supine_command_bench(int argc, char **argv) {
  static const struct option options[] = {
      {"vertices", required_argument, NULL, 'v'}, {"threads", required_argument, NULL, 't'},
      {"repeats", required_argument, NULL, 'r'},  {"json", no_argument, NULL, 'j'},
      {"help", no_argument, NULL, 'h'},           {NULL, 0, NULL, 0}};
  size_t sizes[SIZES_MAX];
  supine_bench_options wanted = {0};
  bool json = false;
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
    switch (option) {
    case 'v':
      wanted.vertices_count = parse_sizes(optarg, sizes);
      wanted.vertices = sizes;
      if (wanted.vertices_count == 0) {
        return supine_options_usage(name, "--vertices takes numbers, N,N,...; not '%s'", optarg);
      }
      break;
    case 't':
      if (!supine_options_parse_count(optarg, &wanted.threads) || wanted.threads == 0) {
        return supine_options_usage(name, "--threads takes a number from 1, not '%s'", optarg);
      }
      break;
    case 'r':
      if (!supine_options_parse_count(optarg, &wanted.repeats) || wanted.repeats == 0) {
        return supine_options_usage(name, "--repeats takes a number from 1, not '%s'", optarg);
      }
      break;
    case 'j':
      json = true;
      break;
    case 'h':
      (void)fputs(help, stdout);
      return supine_options_finish(name);
    default:
      return supine_options_bad_option(name, options, option, argv);
    }
  }
  if (argc - optind != 1) {
    return supine_options_usage(name, "name one basis file (made by 'supine precompute')");
  }
  supine_basis *basis = NULL;
  supine_error error;
  if (supine_basis_open(argv[optind], &basis, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  wanted.like = basis;
  const int result = measure(&wanted, json);
  supine_basis_close(basis);
  return result;
}
