/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Run a server that follows a tracked patient, and report what it did. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "program/command/stream_session.h"
#include "program/options/basis_input.h"
#include "program/options/inside.h"
#include "program/options/surface_options.h"
#include "program/stream/peer.h"
#include "program/view/export/export.h"

static const char name[] = "stream";

static void warn(void *context, const char *text) {
  (void)context;
  supine_options_say(name, "%s", text);
}

static bool stop(void *context) {
  (void)context;
  return supine_options_interrupted();
}

/* Add what --json prints of the messages and the latencies. */
static void add_counts(const supine_stream_results *results) {
  const supine_stream_counts *n = &results->counts;
  SUPINE_ADD_RESULT(json_pack(
      "{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I}", "positions",
      (json_int_t)n->positions, "poses", (json_int_t)n->poses, "repaired", (json_int_t)n->repaired,
      "refused", (json_int_t)n->refused, "invalid", (json_int_t)n->invalid, "frames",
      (json_int_t)n->frames, "sent", (json_int_t)n->sent, "peers", (json_int_t)n->peers,
      "malformed", (json_int_t)n->malformed, "not_used", (json_int_t)n->skipped, "disconnected",
      (json_int_t)(n->lost + n->idle), "peers_refused", (json_int_t)n->turned_away,
      "volumes_refused", (json_int_t)n->unreachable));
  for (int surfaces = 0; surfaces < 2; ++surfaces) {
    const supine_stream_latency *latency = &results->latency[surfaces];
    SUPINE_ADD_RESULT(json_pack("{s:{s:I, s:I, s:f}}",
                                surfaces != 0 ? "surface_latency" : "weights_latency", "frames",
                                (json_int_t)latency->count, "late", (json_int_t)latency->late,
                                "worst_ms", 1e3 * latency->worst));
  }
}

static void report(const supine_stream_results *results, const supine_stream_session *wanted) {
  const supine_stream_counts *n = &results->counts;
  add_counts(results);
  if (wanted->points != NULL) {
    supine_options_line("received positions of observed points: %zu\n", n->positions);
  }
  supine_options_line(
      "poses: %zu (repaired: %zu; refused: %zu); frames: %zu (sent: %zu); peers: %zu\n", n->poses,
      n->repaired, n->refused, n->frames, n->sent, n->peers);
  if (n->invalid > 0) {
    supine_options_line("poses that the tracker marked as invalid: %zu\n", n->invalid);
  }
  if (n->malformed + n->skipped + n->lost + n->idle + n->turned_away + n->unreachable > 0) {
    supine_options_line(
        "malformed messages: %zu; messages not used: %zu; peers disconnected: %zu; peers "
        "refused: %zu; volumes refused: %zu\n",
        n->malformed, n->skipped, n->lost + n->idle, n->turned_away, n->unreachable);
  }
  for (int surfaces = 0; surfaces < 2; ++surfaces) {
    const supine_stream_latency *latency = &results->latency[surfaces];
    if (latency->count > 0) {
      supine_options_line(
          "pose received to %s sent: %zu of %zu frames within %.0f ms, worst %.3f ms\n",
          surfaces != 0 ? "surface" : "weights", latency->count - latency->late, latency->count,
          1e3 * SUPINE_STREAM_BUDGET, 1e3 * latency->worst);
    }
  }
}

/* The observed points, and the file made by 'supine embed' that names them. */
typedef struct observed_points {
  supine_basis *inside;
  supine_options_names names;
  supine_stream_observed observed;
} observed_points;

/* Open the file of --points. Each structure with a single vertex becomes a point, marked as not yet
 * observed. */
static supine_status open_points(const supine_basis *basis, const supine_stream_session *wanted,
                                 observed_points *points, supine_arena *arena,
                                 supine_error *error) {
  const supine_options_names *names = &points->names;
  supine_stream_observed *observed = &points->observed;
  SUPINE_TRY(
      supine_options_inside_open(basis, wanted->points, &points->inside, &points->names, error));
  size_t count = 0;
  for (size_t part = 0; part < names->count; ++part) {
    if (names->begin[part + 1] - names->begin[part] != 1) {
      continue;
    }
    if (count < SUPINE_LOCATE_POINTS_MAX) {
      observed->name[count] = names->text[part];
      observed->last[count] = (supine_observation){.vertex = names->order[names->begin[part]],
                                                   .position = {(double)NAN},
                                                   .noise = wanted->noise};
    }
    ++count;
  }
  SUPINE_REFUSE_IF(count == 0 || count > SUPINE_LOCATE_POINTS_MAX, error, SUPINE_ERROR_FORMAT,
                   "%s holds %zu points: give a file with 1 to %d", wanted->points, count,
                   (int)SUPINE_LOCATE_POINTS_MAX);
  observed->ras = wanted->options.ras;
  observed->inside = points->inside;
  observed->count = count;
  observed->space = supine_arena_zeros(arena, supine_locate_space(count), sizeof *observed->space);
  return observed->space != NULL ? SUPINE_OK : supine_error_memory(error, "%s", wanted->points);
}

/* The page that shows the lungs of a basis live, and its server. The page is kept in memory, so
 * that nothing is left on the disk however the program ends. */
typedef struct live_page {
  char *html;
  size_t size;
  supine_stream_web *web;
} live_page;

static void page_close(live_page *page) {
  supine_stream_web_destroy(page->web);
  free(page->html);
}

static supine_status print_page(const supine_stream_session *wanted, const supine_basis *basis,
                                live_page *page, supine_error *error) {
  supine_options_reference_pose from;
  SUPINE_TRY(supine_options_reference(basis, "stream", &wanted->from, true, &from, error));
  const export_page shown = {.breath = wanted->breath.tidal,
                             .from = &from,
                             .from_count = 1,
                             .title = "Lungs, live",
                             .live = true};
  FILE *file = open_memstream(&page->html, &page->size);
  if (file == NULL) {
    return supine_error_memory(error, "the page");
  }
  export_written written;
  const supine_status status = supine_export_html_print(file, basis, &shown, &written, error);
  const bool failed = ferror(file) != 0;
  const bool closed = fclose(file) == 0; /* sets html and size */
  if (status == SUPINE_OK && (failed || !closed)) {
    return supine_error_memory(error, "the page");
  }
  return status;
}

/* Check the names of --web-host: letters, digits, '-', '_' and '.', separated by commas. */
static supine_status check_names(const char *names, supine_error *error) {
  static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
  for (const char *at = names; at != NULL; at = *at == ',' ? at + 1 : NULL) {
    const size_t length = strspn(at, letters);
    SUPINE_REFUSE_IF(length == 0 || length > 255 || (at[length] != ',' && at[length] != '\0'),
                     error, SUPINE_ERROR_ARGUMENT,
                     "--web-host '%s': give host names alone, such as lungs.example.org, without "
                     "http:// and without a port",
                     names);
    at += length;
  }
  return SUPINE_OK;
}

/* If --web is given, serve the page that shows the lungs of the basis live. The caller closes the
 * page. */
static supine_status open_page(const supine_stream_session *wanted, const supine_basis *basis,
                               live_page *page, supine_error *error) {
  supine_stream_address address;
  SUPINE_TRY(check_names(wanted->web_host, error));
  if (wanted->web == NULL) {
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_stream_address_read(wanted->web, true, &address, error));
  SUPINE_TRY(print_page(wanted, basis, page, error));
  supine_stream_site site = {.address = address.host,
                             .port = address.port,
                             .names = wanted->web_host,
                             .certificate = wanted->certificate,
                             .key = wanted->key,
                             .page = page->html,
                             .page_size = page->size};
  SUPINE_TRY(supine_stream_web_create(&site, &page->web, error));
  const bool ipv6 = strchr(address.host, ':') != NULL;
  supine_options_line("page at http%s://%s%s%s:%d/\n", site.certificate != NULL ? "s" : "",
                      ipv6 ? "[" : "", address.host, ipv6 ? "]" : "", site.port);
  SUPINE_ADD_RESULT(json_pack("{s:i}", "page_port", (int)site.port));
  return SUPINE_OK;
}

/* Choose a breath, or a fixed volume, and judge it in supine posture. Fields of gravity have no
 * breaths. Fields of gravity and volume breathe if it is asked, or if the volume at rest is known.
 */
static supine_status set_volume(const supine_basis *basis, const supine_stream_session *wanted,
                                supine_stream_volume *volume, supine_error *error) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  supine_pv pv = *supine_breath_normal();
  const supine_basis_info *info = supine_basis_get_info(basis);
  const bool breathes =
      !info->is_fields || (info->order > 0 && (wanted->has_breath || info->has_rest));
  SUPINE_REFUSE_IF(
      wanted->has_breath && !breathes, error, SUPINE_ERROR_ARGUMENT,
      "the basis was made with --fields and has no breaths: leave out --tidal, --rate and --pv");
  if (wanted->has_volume || !breathes) {
    volume->fixed = wanted->volume;
  } else {
    if (wanted->pv != NULL) {
      SUPINE_TRY(supine_options_pv_load(wanted->pv, &pv, error));
    }
    SUPINE_TRY(supine_stream_volume_breathe(volume, &pv, &wanted->breath, error));
  }
  supine_findings findings = {.count = 0};
  const supine_status status = supine_stream_volume_judge(volume, basis, supine, &findings, error);
  supine_options_say_findings(name, &findings);
  return status;
}

/* What a run needs besides the basis. */
typedef struct running {
  supine_arena arena;
  observed_points points;
  live_page page;
  supine_stream_server *server;
} running;

static void end(running *s) {
  supine_stream_server_destroy(s->server);
  page_close(&s->page);
  supine_options_names_close(&s->points.names);
  supine_basis_close(s->points.inside);
  supine_arena_free(&s->arena);
}

supine_status supine_command_stream_run(const supine_stream_session *wanted,
                                        const supine_basis *basis, supine_error *error) {
  supine_stream_options options = wanted->options;
  supine_stream_volume volume = {0};
  SUPINE_FREED_BY(end) running s = {0};
  SUPINE_TRY(set_volume(basis, wanted, &volume, error));
  options.volume = &volume;
  options.warn = warn;
  options.stop = stop;
  if (wanted->points != NULL) {
    SUPINE_TRY(open_points(basis, wanted, &s.points, &s.arena, error));
    options.observed = &s.points.observed;
  }
  SUPINE_TRY(open_page(wanted, basis, &s.page, error));
  options.web = s.page.web;
  SUPINE_TRY(supine_stream_server_create(basis, &options, &s.server, error));
  const supine_stream_results *results = supine_stream_server_results(s.server);
  supine_options_signals_catch(true); /* before the line from which others know that it runs */
  if (results->port != 0) {
    supine_options_line("listening on port %d\n", results->port);
    SUPINE_ADD_RESULT(json_pack("{s:i}", "port", (int)results->port));
  }
  supine_options_print_results(
      true); /* others wait for this; the counts follow in a second object */
  (void)fflush(stdout);
  const supine_status status = supine_stream_server_run(s.server, error);
  report(results, wanted);
  return status;
}
