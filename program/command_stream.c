/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine stream: receive the poses of a tracked patient, and send the lungs in each pose. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/output.h"
#include "base/vec3.h"
#include "program/options/basis_input.h"
#include "program/options/command.h"
#include "program/options/inside.h"
#include "program/options/pv.h"
#include "program/options/state_options.h"
#include "program/stream/peer.h"
#include "program/stream/server.h"
#include "program/stream/tracked_patient.h"
#include "program/view/export/export.h"

static const char name[] = "stream";

typedef struct request {
  supine_stream_options options;
  double world_down[3], body_from_tracker[4];
  int space; /* axes of the points, as an index in `spaces` */
  supine_state volume;
  bool has_volume, has_breath;
  const char *pv;
  supine_pv_breath breath;
  const char *web, *certificate, *key;
  supine_from from;
  const char *points;
  double noise;
} request;

static const char *const spaces[] = {"lps", "ras", NULL};

static const supine_option table[] = {
    {"listen", 0, "[ADDRESS:]PORT",
     "address at which to wait for peers. A port without an address can be reached from this "
     "machine only; port 0 is any free port. Default 18944, the port of OpenIGTLink, unless "
     "--connect is given",
     SUPINE_FILLS(request, options.listen)},
    {"connect", 0, "HOST:PORT",
     "connect to a peer that listens, such as a tracker server or 3D Slicer",
     SUPINE_FILLS(request, options.connect)},
    {"device", 0, "NAME", "device whose poses are followed; default any",
     SUPINE_FILLS(request, options.device)},
    {.help = "Direction of gravity:"},
    {"world-down", 0, "X,Y,Z", "direction of gravity in the tracker's world",
     SUPINE_FILLS(request, world_down), .standard = "0,0,-1", .more = true},
    {"body-from-tracker", 0, "W,X,Y,Z",
     "rotation from the marker's axes to the body's (left, back, head), as a quaternion; 0,0,0,1 "
     "if the marker's axes are right, front, head",
     SUPINE_FILLS(request, body_from_tracker), .standard = "1,0,0,0", .more = true},
    {.help = "Observed points inside the lungs, as in 'supine locate':"},
    {"points", 0, "FILE",
     "positions of the points in the scan, made by 'supine embed BASIS'. Their observed positions "
     "are received as a TRANSFORM whose device is the point's name, or as a POINT list, in the "
     "axes of --space. Surfaces are then sent in the frame of the observations, with the attribute "
     "expected_error_mm. The volume is fitted to the points, unless --volume or a message fixes it",
     SUPINE_FILLS(request, points), .file = SUPINE_FILE_IN},
    {"noise", 0, "MM", "standard deviation of an observed coordinate", SUPINE_FILLS(request, noise),
     .standard = "2", SUPINE_ABOVE_ZERO, .wants = "millimetres", .more = true},
    {.help = "Volume and breathing:"},
    {"volume", 0, "VOLUME",
     "fixed volume, instead of breathing: " SUPINE_VOLUME_HELP
     ". A message of device VOLUME also fixes it: a STRING with a value of this option, or an "
     "NDARRAY of one number, in mL above rest",
     SUPINE_FILLS(request, volume), .read = supine_options_read_volume,
     SUPINE_SAYS_GIVEN(request, has_volume)},
    {"tidal", 0, "ML", "tidal volume; default 500", SUPINE_FILLS(request, breath.tidal),
     SUPINE_ABOVE_ZERO, SUPINE_SAYS_GIVEN(request, has_breath)},
    {"rate", 0, "N", "breaths per minute; default 12", SUPINE_FILLS(request, breath.rate),
     SUPINE_ABOVE_ZERO, SUPINE_SAYS_GIVEN(request, has_breath)},
    {"pv", 0, "FILE", "pressure-volume relation made by 'supine pv fit'; default a normal adult's",
     SUPINE_FILLS(request, pv), .file = SUPINE_FILE_IN, SUPINE_SAYS_GIVEN(request, has_breath),
     .more = true},
    {.help = "Output:"},
    {"send", 0, "WHAT",
     "what a peer receives\nweights: an NDARRAY with a weight for each mode, then three factors "
     "for each lung, which multiply its displacement along x, y and z. The peer computes the "
     "surface from these numbers and the basis\n"
     "surface: a POLYDATA of points and triangle strips\npoints: a POLYDATA whose triangles are "
     "sent once\nA peer can change this by a STRING of device SEND with one of these words",
     SUPINE_FILLS(request, options.content), .choices = supine_stream_content_names,
     .standard = "weights"},
    {"space", 0, "NAME", "axes of the points: lps (left, back, head), or ras as in 3D Slicer",
     SUPINE_FILLS(request, space), .choices = spaces, .standard = "lps"},
    {"name", 0, "NAME", "device name in the messages sent", SUPINE_FILLS(request, options.name),
     .standard = "SUPINE", .more = true},
    {"fps", 0, "N", "largest number of frames per second", SUPINE_FILLS(request, options.rate),
     .range = {1.0, 1000.0}, .standard = "200", .more = true},
    {.help = "A live page:"},
    {"web", 0, "[ADDRESS:]PORT",
     "serve a page that shows the lungs live. A phone on which the page is open can send its own "
     "tilt. A port without an address can be reached from this machine only",
     SUPINE_FILLS(request, web)},
    {.table = supine_options_from, SUPINE_FILLS(request, from)},
    {"certificate", 0, "PEM",
     "certificate, with --key, to serve the page encrypted. Without encryption, browsers do not "
     "send a phone's tilt to another machine",
     SUPINE_FILLS(request, certificate), .file = SUPINE_FILE_IN, .more = true},
    {"key", 0, "PEM", "the certificate's private key", SUPINE_FILLS(request, key),
     .file = SUPINE_FILE_IN, .more = true},
    {"seconds", 0, "S", "duration of the run in s; default until interrupted",
     SUPINE_FILLS(request, options.seconds), SUPINE_ABOVE_ZERO, .more = true},
    {.name = NULL}};

static void warn(void *context, const char *text) {
  (void)context;
  supine_options_say(name, "%s", text);
}

static bool stop(void *context) {
  (void)context;
  return supine_options_interrupted();
}

static void report(const supine_stream_results *results, const request *wanted) {
  const supine_stream_counts *n = &results->counts;
  if (wanted->points != NULL) {
    (void)printf("received positions of observed points: %llu\n", (unsigned long long)n->positions);
  }
  (void)printf(
      "poses: %llu (repaired: %llu; refused: %llu); frames: %llu (sent: %llu); peers: %llu\n",
      (unsigned long long)n->poses, (unsigned long long)n->repaired, (unsigned long long)n->refused,
      (unsigned long long)n->frames, (unsigned long long)n->sent, (unsigned long long)n->peers);
  if (n->malformed + n->skipped + n->lost + n->turned_away + n->unreachable > 0) {
    (void)printf("malformed messages: %llu; messages not used: %llu; peers disconnected: %llu; "
                 "peers refused: %llu; frames whose volume is out of reach: %llu\n",
                 (unsigned long long)n->malformed, (unsigned long long)n->skipped,
                 (unsigned long long)n->lost, (unsigned long long)n->turned_away,
                 (unsigned long long)n->unreachable);
  }
  for (int surfaces = 0; surfaces < 2; ++surfaces) {
    const supine_stream_latency *latency = &results->latency[surfaces];
    if (latency->count > 0) {
      (void)printf("pose received to %s sent: %llu of %llu frames within %.0f ms, worst %.3f ms\n",
                   surfaces != 0 ? "surface" : "weights",
                   (unsigned long long)(latency->count - latency->late),
                   (unsigned long long)latency->count, 1e3 * SUPINE_STREAM_BUDGET,
                   1e3 * latency->worst);
    }
  }
}

/* The observed points, and the file made by 'supine embed' that names them. */
typedef struct observed_points {
  supine_basis *inside;
  supine_command_names names;
  supine_stream_observed observed;
} observed_points;

/* Open the file of --points. Each structure with a single vertex becomes a point, marked as not yet
 * observed. */
static supine_status open_points(const supine_basis *basis, const request *wanted,
                                 observed_points *points, supine_arena *arena,
                                 supine_error *error) {
  const supine_command_names *names = &points->names;
  supine_stream_observed *observed = &points->observed;
  SUPINE_TRY(
      supine_command_inside_open(basis, wanted->points, &points->inside, &points->names, error));
  size_t count = 0;
  for (size_t part = 0; part < names->count; ++part) {
    const bool single = names->begin[part + 1] - names->begin[part] == 1;
    if (single && count++ < SUPINE_LOCATE_POINTS_MAX) {
      observed->name[count - 1] = names->text[part];
      observed->last[count - 1] = (supine_observation){.vertex = names->order[names->begin[part]],
                                                       .position = {(double)NAN},
                                                       .noise = wanted->noise};
    }
  }
  if (count == 0 || count > SUPINE_LOCATE_POINTS_MAX) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s holds %zu points: give a file with 1 to %d", wanted->points, count,
                            (int)SUPINE_LOCATE_POINTS_MAX);
  }
  observed->ras = wanted->space == 1;
  observed->inside = points->inside;
  observed->count = count;
  observed->space = supine_arena_zeros(arena, supine_locate_space(count), sizeof *observed->space);
  return observed->space != NULL ? SUPINE_OK : supine_error_memory(error, "%s", wanted->points);
}

#define PAGE P_tmpdir "/supine-page-XXXXXX" /* template of the name of a temporary file */

/* If --web is given, serve the page that shows the lungs of the basis file `path` live, from a
 * temporary file. The caller destroys *web, then removes the file `page`. */
static supine_status open_page(const request *wanted, const supine_basis *basis, const char *path,
                               char *page, supine_stream_web **web, supine_error *error) {
  supine_stream_address address;
  supine_reference_pose from;
  SUPINE_FREED_BY(supine_export_source_close) export_source source = {0};
  SUPINE_FREED_BY(supine_file_close) FILE *file = NULL;
  supine_stream_site site = {.certificate = wanted->certificate, .key = wanted->key};
  if (wanted->web == NULL) {
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_stream_address_read(wanted->web, true, &address, error));
  SUPINE_TRY(supine_options_reference(basis, &wanted->from, true, &from, error));
  const export_reference reference = {&from.pose, from.name, from.state.gravity,
                                      supine_options_above_rest(&from.state)};
  const export_page shown = {.breath = wanted->breath.tidal,
                             .from = &reference,
                             .from_count = 1,
                             .title = "Lungs, live",
                             .live = true};
  SUPINE_TRY(supine_export_source_open(path, &source, error));
  (void)strcpy(page, PAGE);
  const int descriptor = mkstemp(page);
  file = descriptor < 0 ? NULL : fdopen(descriptor, "w");
  if (file != NULL) {
    SUPINE_TRY(supine_export_html_print(file, &source, &shown, error));
  }
  if (file == NULL || fflush(file) != 0) {
    return supine_error_set(error, SUPINE_ERROR_WRITE, "%s: %s", page, strerror(errno));
  }
  site.address = address.host;
  site.port = address.port;
  site.page = page;
  SUPINE_TRY(supine_stream_web_create(&site, web, error));
  const bool ipv6 = strchr(address.host, ':') != NULL;
  (void)printf("page at http%s://%s%s%s:%d/\n", site.certificate != NULL ? "s" : "",
               ipv6 ? "[" : "", address.host, ipv6 ? "]" : "", site.port);
  return SUPINE_OK;
}

/* Choose a breath, or a fixed volume. Fields of gravity have no breaths. */
static supine_status set_volume(const supine_basis *basis, const request *wanted,
                                supine_stream_volume *volume, supine_error *error) {
  supine_pv pv = *supine_breath_normal();
  if (supine_basis_get_info(basis)->is_fields) {
    supine_pose pose;
    if (wanted->has_breath) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "the basis was made with --fields and has no breaths: leave out "
                              "--tidal, --rate and --pv");
    }
    volume->fixed = wanted->volume;
    volume->fixed.gravity[1] = 1.0;
    return supine_basis_pose(basis, &volume->fixed, &pose, error);
  }
  if (wanted->has_volume) {
    volume->fixed = wanted->volume;
    return SUPINE_OK;
  }
  if (wanted->pv != NULL) {
    SUPINE_TRY(supine_breath_load(wanted->pv, &pv, error));
  }
  return supine_stream_volume_breathe(volume, &pv, &wanted->breath, error);
}

/* What a run needs besides the basis. */
typedef struct session {
  supine_arena arena;
  observed_points points;
  char page[sizeof PAGE];
  supine_stream_web *web;
  supine_stream_server *server;
} session;

static void end(session *s) {
  supine_stream_server_destroy(s->server);
  supine_stream_web_destroy(s->web);
  (void)remove(s->page); /* has no effect if there is no page */
  supine_command_names_close(&s->points.names);
  supine_basis_close(s->points.inside);
  supine_arena_free(&s->arena);
}

static supine_status stream(const supine_basis *basis, const char *path, const request *wanted,
                            supine_error *error) {
  supine_stream_options options = wanted->options;
  supine_stream_volume volume = {0};
  SUPINE_FREED_BY(end) session s = {0};
  SUPINE_TRY(set_volume(basis, wanted, &volume, error));
  options.volume = &volume;
  if (wanted->points != NULL) {
    SUPINE_TRY(open_points(basis, wanted, &s.points, &s.arena, error));
    options.observed = &s.points.observed;
  }
  SUPINE_TRY(open_page(wanted, basis, path, s.page, &s.web, error));
  options.web = s.web;
  SUPINE_TRY(supine_stream_server_create(basis, &options, &s.server, error));
  const supine_stream_results *results = supine_stream_server_results(s.server);
  if (results->port != 0) {
    (void)printf("listening on port %d\n", results->port);
  }
  (void)fflush(stdout);
  supine_options_signals_catch(true);
  const supine_status status = supine_stream_server_run(s.server, error);
  report(results, wanted);
  return status;
}

static void begin(void *chosen) {
  request *wanted = chosen;
  wanted->breath = supine_breath_default();
  wanted->options =
      (supine_stream_options){.setup = supine_stream_setup_default(), .warn = warn, .stop = stop};
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  supine_stream_options *options = &wanted->options;
  double unit[3];
  options->ras = wanted->space == 1;
  if (options->listen == NULL && options->connect == NULL) {
    options->listen = "18944";
  }
  if ((wanted->certificate == NULL) != (wanted->key == NULL)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "give --certificate and --key together");
  }
  supine_stream_rotation(wanted->body_from_tracker, options->setup.body); /* 0 if it is zero */
  if (!supine_normalise(options->setup.body, unit) ||
      !supine_normalise(wanted->world_down, options->setup.down)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "--world-down or --body-from-tracker is zero: give a direction, such "
                            "as 0,0,-1, and a quaternion, such as 1,0,0,0");
  }
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *basis = NULL;
  SUPINE_TRY(supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, &basis, error));
  return stream(basis, given->operand[0], wanted, error);
}

const supine_command supine_command_stream = {
    name,
    "follow a tracked patient live, over OpenIGTLink",
    .usage = "BASIS [--listen PORT | --connect HOST:PORT] [OPTIONS]",
    .about = "Receives the pose of a tracked patient by OpenIGTLink (headers of version 1 and 2) "
             "and sends the lungs in that pose to every connected peer. A pose is a TRANSFORM, "
             "QTDATA or POSITION message, or an NDARRAY of three numbers, the direction of gravity "
             "in the marker's axes, as a tilt sensor measures it. Only the newest pose counts: a "
             "slow peer misses frames without delaying the others. At the end the command prints "
             "how many frames were sent within 15 ms of receiving their pose.",
    .options = table,
    .notes =
        "Examples:\n"
        "  supine stream lungs.safetensors --device Patient\n"
        "  supine stream lungs.safetensors --send surface --space ras --connect localhost:18944\n"
        "  supine stream lungs.safetensors --web 8080",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .begin = begin,
    .run = run};
