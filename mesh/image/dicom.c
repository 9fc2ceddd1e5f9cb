/* SPDX-License-Identifier: MIT */
/* Read a DICOM segmentation (PS3.3 A.51) as a label map. DCMTK's program dcm2json parses the file
 * in a process of its own, with a limit of memory and time, so that a corrupt file ends only that
 * one.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <jansson.h>

#include "base/arena.h"
#include "base/locale.h"
#include "base/text.h"
#include "base/vec3.h"

#include "mesh/image/image_formats.h"

/* Limits of the process, far above what a segmentation of the chest needs. */
enum { GIGABYTES_MOST = 8, SECONDS_MOST = 300 };

/* Tags, as dcm2json writes them. */
#define CLASS "00080016"
#define CODE_VALUE "00080100"
#define ROWS "00280010"
#define COLUMNS "00280011"
#define PIXELS "7FE00010"
#define TYPE "00620001"
#define SEGMENTS "00620002"
#define SEGMENT_NUMBER "00620004"
#define SEGMENT_CODE "0062000F"
#define CODE_MODIFIER "00620011"
#define FRACTION_MOST "0062000E"
#define SHARED "52009229"
#define FRAMES "52009230"

typedef struct segmentation {
  const char *path;
  json_t *root;
  size_t rows, columns, frames;
  bool fractional;
  double fraction; /* least number of a voxel that is at least half in the segment */
  unsigned char *pixels;
  size_t size; /* of `pixels`, bytes */
  double spacing[3];
  double normal[3];
  supine_error *error;
} segmentation;

static void release(segmentation *s) {
  json_decref(s->root);
  free(s->pixels);
}

/* Return item `index` of the value of an attribute, or NULL. */
static const json_t *item(const json_t *of, const char *tag, size_t index) {
  return json_array_get(json_object_get(json_object_get(of, tag), "Value"), index);
}

static double number(const json_t *of, const char *tag, size_t index) {
  const json_t *value = item(of, tag, index);
  return json_is_number(value) ? json_number_value(value) : (double)NAN;
}

static const char *text(const json_t *of, const char *tag) {
  const char *value = json_string_value(item(of, tag, 0));
  return value != NULL ? value : "";
}

/* Return a functional group of a frame: its own, or that of all frames. */
static const json_t *group(const segmentation *s, size_t frame, const char *tag) {
  const json_t *own = item(item(s->root, FRAMES, frame), tag, 0);
  return own != NULL ? own : item(item(s->root, SHARED, 0), tag, 0);
}

static _Noreturn void be_dcm2json(const char *path, int pipe_end) {
  const struct rlimit time = {SECONDS_MOST, SECONDS_MOST};
  const struct rlimit memory = {(rlim_t)GIGABYTES_MOST << 30, (rlim_t)GIGABYTES_MOST << 30};
  (void)setrlimit(RLIMIT_CPU, &time);
  (void)setrlimit(RLIMIT_AS, &memory);
  (void)dup2(pipe_end, STDOUT_FILENO);
  (void)freopen("/dev/null", "w", stderr);
  (void)execlp("dcm2json", "dcm2json", "-q", "-fc", path, (char *)NULL);
  _exit(127); /* as shells tell that there is no such program */
}

/* Parse the file by dcm2json. */
static supine_status parse(segmentation *s) {
  SUPINE_C_LOCALE;
  int ends[2] = {-1, -1};
  FILE *stream = pipe(ends) == 0 ? fdopen(ends[0], "rb") : NULL;
  if (stream == NULL) {
    (void)close(ends[0]);
    (void)close(ends[1]);
    return supine_error_memory(s->error, "%s", s->path);
  }
  const pid_t child = fork();
  if (child == 0) {
    be_dcm2json(s->path, ends[1]);
  }
  (void)close(ends[1]);
  int ended = 1;
  s->root = json_loadf(stream, 0, NULL);
  (void)fclose(stream); /* before the wait: a child that still writes ends */
  while (child > 0 && waitpid(child, &ended, 0) < 0 && errno == EINTR) {
  }
  const bool missing = WIFEXITED(ended) && WEXITSTATUS(ended) == 127;
  SUPINE_REFUSE_IF(missing, s->error, SUPINE_ERROR_UNSUPPORTED,
                   "%s: DICOM is read by dcm2json, which is missing: install DCMTK (in Debian the "
                   "package dcmtk), or convert the file to NIfTI",
                   s->path);
  SUPINE_REFUSE_IF(s->root == NULL, s->error, SUPINE_ERROR_FORMAT,
                   "%s: DCMTK cannot read it as DICOM: write it again, or convert it to NIfTI",
                   s->path);
  return SUPINE_OK;
}

/* Refuse other objects than segmentations, with what can be done. */
static supine_status check_class(const segmentation *s) {
  const char *class = text(s->root, CLASS);
  SUPINE_REFUSE_IF(strcmp(class, "1.2.840.10008.5.1.4.1.1.481.3") == 0, s->error,
                   SUPINE_ERROR_UNSUPPORTED,
                   "%s: contours (RTSTRUCT): make masks of them, for example with plastimatch "
                   "convert",
                   s->path);
  SUPINE_REFUSE_IF(strcmp(class, "1.2.840.10008.5.1.4.1.1.66.4") != 0, s->error,
                   SUPINE_ERROR_UNSUPPORTED,
                   "%s: no DICOM segmentation (SEG): convert images to NIfTI, for example with "
                   "dcm2niix",
                   s->path);
  return SUPINE_OK;
}

/* Read the numbers of the voxels, and check that there are enough of them. */
static supine_status read_pixels(segmentation *s) {
  const json_t *binary = json_object_get(json_object_get(s->root, PIXELS), "InlineBinary");
  const char *code = json_string_value(binary);
  const double voxels = (double)s->rows * (double)s->columns * (double)s->frames;
  SUPINE_REFUSE_IF(code == NULL, s->error, SUPINE_ERROR_UNSUPPORTED,
                   "%s: its pixels are compressed or missing: write them uncompressed, for example "
                   "by DCMTK's dcmdrle, or convert the file to NIfTI",
                   s->path);
  const size_t length = json_string_length(binary);
  s->pixels = malloc(length + 1);
  if (s->pixels == NULL) {
    return supine_error_memory(s->error, "%zu bytes of %s", length, s->path);
  }
  s->size = supine_text_decode_base64(code, code + length, s->pixels);
  SUPINE_REFUSE_IF(
      !(voxels >= 1.0) || (s->fractional ? voxels : voxels / 8.0) > (double)s->size, s->error,
      SUPINE_ERROR_FORMAT,
      "%s: %zu bytes of pixels, fewer than %zu frames of %zu x %zu need: write it again", s->path,
      s->size, s->frames, s->columns, s->rows);
  return SUPINE_OK;
}

static supine_status describe(segmentation *s) {
  const double rows = number(s->root, ROWS, 0);
  const double columns = number(s->root, COLUMNS, 0);
  const json_t *frames = json_object_get(json_object_get(s->root, FRAMES), "Value");
  SUPINE_REFUSE_IF(!(rows >= 1.0) || !(columns >= 1.0) || json_array_size(frames) == 0, s->error,
                   SUPINE_ERROR_FORMAT, "%s: it lacks rows, columns or frames: write it again",
                   s->path);
  s->rows = (size_t)rows;
  s->columns = (size_t)columns;
  s->frames = json_array_size(frames);
  s->fractional = strcmp(text(s->root, TYPE), "FRACTIONAL") == 0;
  s->fraction = 0.5 * number(s->root, FRACTION_MOST, 0);
  SUPINE_REFUSE_IF(s->fractional && !(s->fraction > 0.0), s->error, SUPINE_ERROR_FORMAT,
                   "%s: a fractional segmentation without its largest value: write it again",
                   s->path);
  return read_pixels(s);
}

/* Codes of lungs and lobes in SNOMED CT. Those of DICOM's own lists (CID 7155) name no side, which
 * is then in a modifier, as TotalSegmentator and 3D Slicer write it. */
enum { LEFT, RIGHT, BY_MODIFIER };
static const struct {
  const char *code;
  int side;
} lungs[] = {
    {"39607008", BY_MODIFIER}, /* lung */
    {"45653009", BY_MODIFIER}, /* upper lobe of lung */
    {"90572001", BY_MODIFIER}, /* lower lobe of lung */
    {"40020002", RIGHT},       /* middle lobe of lung */
    {"72481006", RIGHT},       /* middle lobe of right lung */
    {"44029006", LEFT},        /* left lung */
    {"44714003", LEFT},        /* upper lobe of left lung */
    {"41224006", LEFT},        /* lower lobe of left lung */
    {"3341006", RIGHT},        /* right lung */
    {"42400003", RIGHT},       /* upper lobe of right lung */
    {"266005", RIGHT},         /* lower lobe of right lung */
};

/* Return the side of the lung that a segment shows: LEFT, RIGHT, or -1 if it shows none. */
static int side_of(const json_t *segment) {
  const json_t *type = item(segment, SEGMENT_CODE, 0);
  const char *code = text(type, CODE_VALUE);
  const char *modifier = text(item(type, CODE_MODIFIER, 0), CODE_VALUE);
  int stated = strcmp(modifier, "7771000") == 0 ? LEFT : -1;
  stated = strcmp(modifier, "24028007") == 0 ? RIGHT : stated;
  for (size_t i = 0; i < sizeof lungs / sizeof *lungs; ++i) {
    if (strcmp(code, lungs[i].code) == 0) {
      return lungs[i].side == BY_MODIFIER ? stated : lungs[i].side;
    }
  }
  return -1;
}

/* List the segments that show lungs by their codes, as labels: "left=1+2,right=3". */
static void list_lungs(const segmentation *s, char *list, size_t size) {
  static const char *const names[] = {"left=", "right="};
  const json_t *segments = json_object_get(json_object_get(s->root, SEGMENTS), "Value");
  list[0] = '\0';
  for (int side = 0; side < 2; ++side) {
    const char *before = names[side];
    for (size_t i = 0; i < json_array_size(segments); ++i) {
      const json_t *segment = json_array_get(segments, i);
      if (side_of(segment) == side) {
        supine_text_add(list, size, "%s%s%.0f", side == 1 && before == names[1] && *list ? "," : "",
                        before, number(segment, SEGMENT_NUMBER, 0));
        before = "+";
      }
    }
  }
}

/* Return the number of the segment that a frame shows; 0 if it is to be skipped, as other segments
 * are where codes name lungs. */
static size_t segment_of(const segmentation *s, size_t frame, bool only_lungs) {
  const json_t *segments = json_object_get(json_object_get(s->root, SEGMENTS), "Value");
  const double shown = number(group(s, frame, "0062000A"), "0062000B", 0);
  for (size_t i = 0; i < json_array_size(segments); ++i) {
    const json_t *segment = json_array_get(segments, i);
    if (number(segment, SEGMENT_NUMBER, 0) == shown && shown >= 1.0 && shown <= UINT16_MAX) {
      return only_lungs && side_of(segment) < 0 ? 0 : (size_t)shown;
    }
  }
  return 0;
}

static bool read_numbers(const json_t *of, const char *tag, size_t count, double *values) {
  bool good = true;
  for (size_t k = 0; k < count; ++k) {
    values[k] = number(of, tag, k);
    good = good && isfinite(values[k]);
  }
  return good;
}

/* Find the axes of the voxels: along a row, along a column, and across the frames. */
static supine_status find_axes(segmentation *s, supine_image *image) {
  const json_t *measures = group(s, 0, "00289110");
  double cosines[6];
  double spacing[2];
  const bool good = read_numbers(group(s, 0, "00209116"), "00200037", 6, cosines) &&
                    read_numbers(measures, "00280030", 2, spacing);
  const double slices = number(measures, "00180088", 0);
  s->spacing[2] = slices > 0.0 ? slices : number(measures, "00180050", 0);
  SUPINE_REFUSE_IF(!good || !(s->spacing[2] > 0.0), s->error, SUPINE_ERROR_FORMAT,
                   "%s: it lacks the orientation or the spacing of its frames: write it again",
                   s->path);
  for (size_t f = 1; f < s->frames; ++f) {
    double other[6];
    double turned = 0.0;
    const bool read = read_numbers(group(s, f, "00209116"), "00200037", 6, other);
    for (size_t k = 0; k < 6; ++k) {
      turned = fmax(turned, fabs(other[k] - cosines[k]));
    }
    SUPINE_REFUSE_IF(!read || turned > 1e-4, s->error, SUPINE_ERROR_UNSUPPORTED,
                     "%s: frames 1 and %zu are not parallel: resample it to one grid", s->path,
                     f + 1);
  }
  supine_cross(cosines, cosines + 3, s->normal);
  for (size_t k = 0; k < 3; ++k) {
    image->step[0][k] = spacing[1] * cosines[k]; /* along a row, the column increases */
    image->step[1][k] = spacing[0] * cosines[3 + k];
    image->step[2][k] = s->spacing[2] * s->normal[k];
  }
  return SUPINE_OK;
}

/* Find the slice of each frame, and the first position. Frames come in any order, and those without
 * voxels may be missing. */
static supine_status find_slices(const segmentation *s, supine_image *image, size_t *slice) {
  double first = INFINITY;
  double last = -INFINITY;
  for (size_t f = 0; f < s->frames; ++f) {
    double at[3];
    const bool good = read_numbers(group(s, f, "00209113"), "00200032", 3, at);
    SUPINE_REFUSE_IF(!good, s->error, SUPINE_ERROR_FORMAT,
                     "%s: frame %zu has no position: write it again", s->path, f + 1);
    const double along = supine_dot(at, s->normal);
    if (along < first) {
      first = along;
      memcpy(image->origin, at, sizeof at);
    }
    last = fmax(last, along);
  }
  image->size[2] = (size_t)lround(fmin((last - first) / s->spacing[2], 1e5)) + 1;
  for (size_t f = 0; f < s->frames; ++f) {
    double at[3];
    double off[3];
    (void)read_numbers(group(s, f, "00209113"), "00200032", 3, at);
    const double along = (supine_dot(at, s->normal) - first) / s->spacing[2];
    slice[f] = (size_t)lround(fmin(along, 1e5));
    for (size_t k = 0; k < 3; ++k) {
      off[k] = at[k] - image->origin[k] - (double)slice[f] * image->step[2][k];
    }
    const double beside = supine_length(off);
    SUPINE_REFUSE_IF(beside > 0.1 * s->spacing[2], s->error, SUPINE_ERROR_UNSUPPORTED,
                     "%s: frame %zu lies %.2f mm beside the grid of the others: resample it to one "
                     "grid",
                     s->path, f + 1, beside);
  }
  return SUPINE_OK;
}

/* Return whether a voxel is in the segment of its frame. The bits of binary frames are packed
 * without a gap, the lowest first. */
static bool is_set(const segmentation *s, size_t index) {
  return s->fractional ? (double)s->pixels[index] >= s->fraction
                       : (s->pixels[index / 8] >> index % 8 & 1U) != 0;
}

static supine_status fill(const segmentation *s, const size_t *slice, supine_image *image) {
  const size_t plane = s->rows * s->columns;
  uint16_t *labels = calloc(plane * image->size[2], sizeof *labels);
  image->values = labels;
  if (labels == NULL) {
    return supine_error_memory(s->error, "%zu slices of %s", image->size[2], s->path);
  }
  for (size_t f = 0; f < s->frames; ++f) {
    const size_t segment = segment_of(s, f, image->lungs[0] != '\0');
    uint16_t *to = labels + plane * slice[f];
    for (size_t i = 0; i < plane; ++i) {
      if (segment == 0 || !is_set(s, plane * f + i)) {
        continue;
      }
      SUPINE_REFUSE_IF(to[i] != 0 && to[i] != segment, s->error, SUPINE_ERROR_UNSUPPORTED,
                       "%s: segments %u and %zu overlap in frame %zu: write each to a mask of its "
                       "own",
                       s->path, (unsigned)to[i], segment, f + 1);
      to[i] = (uint16_t)segment;
    }
  }
  return SUPINE_OK;
}

supine_status supine_image_read_segmentation(const char *path, supine_image *image,
                                             supine_error *error) {
  SUPINE_FREED_BY(supine_image_free) supine_image read = {.channels = 1};
  SUPINE_FREED_BY(release) segmentation s = {.path = path, .error = error};
  SUPINE_ARENA arena = {0};
  SUPINE_TRY(parse(&s));
  SUPINE_TRY(check_class(&s));
  SUPINE_TRY(describe(&s));
  size_t *slice = supine_arena_take(&arena, s.frames, sizeof *slice);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu frames", s.frames));
  read.size[0] = s.columns;
  read.size[1] = s.rows;
  read.voxel = SUPINE_VOXEL_U16;
  read.axes = SUPINE_AXES_LPS;
  read.frame_source = "ImageOrientationPatient";
  read.is_segmentation = true;
  SUPINE_TRY(find_axes(&s, &read));
  SUPINE_TRY(find_slices(&s, &read, slice));
  list_lungs(&s, read.lungs, sizeof read.lungs);
  SUPINE_TRY(fill(&s, slice, &read));
  *image = read;
  read.values = NULL;
  return SUPINE_OK;
}
