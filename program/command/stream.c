/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine stream: receive the poses of a tracked patient, and send the lungs in each pose. */
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "program/command/list.h"
#include "program/command/stream_session.h"
#include "program/options/basis_input.h"

typedef struct request {
  supine_stream_session session;
  double world_down[3], body_from_tracker[4];
  int space; /* axes of the points, as an index in `spaces` */
} request;

static const char *const spaces[] = {"lps", "ras", NULL};

static const supine_option table[] = {
    {"listen", 0, "[ADDRESS:]PORT",
     "address at which to wait for peers. A port without an address can be reached from this "
     "machine only; port 0 is any free port. Default 18944, the port of OpenIGTLink, unless "
     "--connect is given",
     SUPINE_FILLS(request, session.options.listen)},
    {"connect", 0, "HOST:PORT",
     "connect to a peer that listens, such as a tracker server or 3D Slicer",
     SUPINE_FILLS(request, session.options.connect)},
    {"device", 0, "NAME", "device whose poses are followed; default any",
     SUPINE_FILLS(request, session.options.device)},
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
     SUPINE_FILLS(request, session.points), .file = SUPINE_FILE_IN},
    {"noise", 0, "MM", "standard deviation of an observed coordinate",
     SUPINE_FILLS(request, session.noise), .standard = "2", SUPINE_ABOVE_ZERO,
     SUPINE_MEASURES(LENGTH), .more = true},
    {.help = "Volume and breathing:"},
    {"volume", 0, "VOLUME",
     "fixed volume, instead of breathing: " SUPINE_VOLUME_HELP
     ". A message of device VOLUME also fixes it: a STRING with a value of this option, or an "
     "NDARRAY of one number, in mL above rest",
     SUPINE_FILLS(request, session.volume), .read = supine_options_read_volume,
     SUPINE_SAYS_GIVEN(request, session.has_volume)},
    {"tidal", 0, "VOLUME", "tidal volume; default 500mL",
     SUPINE_FILLS(request, session.breath.tidal), SUPINE_BREATH,
     SUPINE_SAYS_GIVEN(request, session.has_breath)},
    {"rate", 0, "N", "breaths per minute; default 12", SUPINE_FILLS(request, session.breath.rate),
     SUPINE_ABOVE_ZERO, SUPINE_MEASURES(RATE), SUPINE_SAYS_GIVEN(request, session.has_breath)},
    {"pv", 0, "FILE", "pressure-volume relation made by 'supine pv fit'; default a normal adult's",
     SUPINE_FILLS(request, session.pv), .file = SUPINE_FILE_IN,
     SUPINE_SAYS_GIVEN(request, session.has_breath), .more = true},
    {.table = supine_options_folds, SUPINE_FILLS(request, session.allow_folds)},
    {.help = "Output:"},
    {"send", 0, "WHAT",
     "what a peer receives\nweights: an NDARRAY with a weight for each mode, then three factors "
     "for each lung, which multiply its displacement along x, y and z. The peer computes the "
     "surface from these numbers and the basis\n"
     "surface: a POLYDATA of points and triangle strips\npoints: a POLYDATA whose triangles are "
     "sent once\nA peer can change this by a STRING of device SEND with one of these words",
     SUPINE_FILLS(request, session.options.content), .choices = supine_stream_content_names,
     .standard = "weights"},
    {"space", 0, "NAME", "axes of the points: lps (left, back, head), or ras as in 3D Slicer",
     SUPINE_FILLS(request, space), .choices = spaces, .standard = "lps"},
    {"name", 0, "NAME", "device name in the messages sent",
     SUPINE_FILLS(request, session.options.name), .standard = "SUPINE", .more = true},
    {"fps", 0, "N", "largest number of frames per second",
     SUPINE_FILLS(request, session.options.rate), .range = {1.0, 1000.0}, .standard = "200",
     .more = true},
    {.help = "A live page:"},
    {"web", 0, "[ADDRESS:]PORT",
     "serve a page that shows the lungs live. A phone on which the page is open can send its own "
     "tilt. A port without an address can be reached from this machine only. There is no access "
     "control: whoever can reach the address sees the lungs and can send a pose",
     SUPINE_FILLS(request, session.web)},
    {"web-host", 0, "NAME[,NAME...]",
     "host names by which browsers may open the page, besides numeric addresses and localhost. "
     "Other names are refused, because a web site could make them point to this machine",
     SUPINE_FILLS(request, session.web_host), .more = true},
    {.table = supine_options_from, SUPINE_FILLS(request, session.from)},
    {"certificate", 0, "PEM",
     "certificate, with --key, to serve the page encrypted. Without encryption, browsers do not "
     "send a phone's tilt to another machine",
     SUPINE_FILLS(request, session.certificate), .file = SUPINE_FILE_IN, .more = true},
    {"key", 0, "PEM", "the certificate's private key", SUPINE_FILLS(request, session.key),
     .file = SUPINE_FILE_IN, .more = true},
    {"seconds", 0, "S", "duration of the run; default until interrupted",
     SUPINE_FILLS(request, session.options.seconds), SUPINE_ABOVE_ZERO, SUPINE_MEASURES(TIME),
     .more = true},
    {.name = NULL}};

static void begin(void *chosen) {
  ((request *)chosen)->session.breath = supine_breath_default();
}

/* Refuse the name of a device that is too long for the messages. */
static supine_status check_device(const char *device, supine_error *error) {
  const double length = device != NULL ? (double)strlen(device) : 0.0;
  const supine_input_verdict verdict = supine_input_judge(SUPINE_INPUT_DEVICE_NAME, length);
  SUPINE_REFUSE_IF(verdict == SUPINE_INPUT_REFUSED, error, SUPINE_ERROR_ARGUMENT,
                   "'%s' has %.0f characters: names of devices have at most %.0f", device, length,
                   supine_input_get(SUPINE_INPUT_DEVICE_NAME)->refused);
  return SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  supine_stream_session *session = &wanted->session;
  supine_stream_options *options = &session->options;
  double unit[3];
  SUPINE_TRY(check_device(options->device, error));
  SUPINE_TRY(check_device(options->name, error));
  options->ras = wanted->space == 1;
  if (options->listen == NULL && options->connect == NULL) {
    options->listen = "18944";
  }
  SUPINE_REFUSE_IF((session->certificate == NULL) != (session->key == NULL), error,
                   SUPINE_ERROR_ARGUMENT, "give --certificate and --key together");
  supine_quaternion_matrix(wanted->body_from_tracker, options->setup.body); /* 0 if it is zero */
  const bool directed = supine_normalise(options->setup.body, unit) &&
                        supine_normalise(wanted->world_down, options->setup.down);
  SUPINE_REFUSE_IF(!directed, error, SUPINE_ERROR_ARGUMENT,
                   "--world-down or --body-from-tracker is zero: give a direction, such as 0,0,-1, "
                   "and a quaternion, such as 1,0,0,0");
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *basis = NULL;
  SUPINE_TRY(supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, session->allow_folds,
                                       &basis, error));
  return supine_command_stream_run(session, basis, error);
}

const supine_command supine_command_stream = {
    "stream",
    "follow a tracked patient live, over OpenIGTLink",
    .usage = "BASIS [--listen PORT | --connect HOST:PORT] [OPTIONS]",
    .about =
        "Receives the pose of a tracked patient by OpenIGTLink (headers of version 1 and 2) and "
        "sends the lungs in that pose to every connected peer. A pose is a TRANSFORM, QTDATA or "
        "POSITION message, or an NDARRAY of three numbers, the direction of gravity in the "
        "marker's axes, as a tilt sensor measures it. Only the newest pose counts: a slow peer "
        "misses frames without delaying the others. A peer that sends no message and takes no "
        "frame for a minute is disconnected. At the end the command prints how many frames were "
        "sent within 15 ms of receiving their pose.",
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
