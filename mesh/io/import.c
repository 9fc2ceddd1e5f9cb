/* SPDX-License-Identifier: MIT */
/* Run the import library assimp in a process of its own. On a corrupt file, an importer may crash,
 * leak memory, or exceed its limits of time and memory. Then only that process ends. */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <assimp/cfileio.h>
#include <assimp/cimport.h>
#include <assimp/config.h>
#include <assimp/scene.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/input.h"
#include "base/library.h"
#include "base/locale.h"
#include "base/text.h"
#include "base/vec3.h"
#include "mesh/io/read.h"

/* clang-format off */
#define FUNCTIONS(EACH)                                                                            \
  EACH(ai, CreatePropertyStore) EACH(ai, SetImportPropertyInteger) EACH(ai, ReleasePropertyStore)  \
  EACH(ai, ImportFileExWithProperties) EACH(ai, GetErrorString) EACH(ai, IsExtensionSupported)     \
  EACH(ai, IdentityMatrix4) EACH(ai, MultiplyMatrix4) EACH(ai, Matrix4Determinant)
/* clang-format on */

/* Functions of assimp, loaded only when needed, as loading takes longer than most commands. */
typedef struct assimp {
  FUNCTIONS(SUPINE_LIBRARY_MEMBER)
} assimp;

/* Limits of one import, far above what a lung needs; the time grows with the file's size. */
enum { SECONDS_LEAST = 8, SECONDS_PER_MEGABYTE = 1, GIGABYTES_MOST = 4 };

/* What the child process that imports a file sends before the vertices and triangles. */
typedef struct outcome {
  supine_error error;
  size_t dropped, vertex_count, triangle_count;
  bool turned; /* whether the importer turned the axes of the file */
} outcome;

typedef struct gathering {
  assimp ai;
  const struct aiScene *scene;
  supine_mesh mesh;
  mesh_faces faces;
  bool turned;
  supine_error *error;
} gathering;

static supine_status import_fail(const char *path, const char *words, supine_error *error) {
  char line[256];
  size_t length = 0;
  for (; *words != '\0' && length < sizeof line - 1; ++words) {
    const bool blank = (unsigned char)*words <= ' ';
    if (!blank || (length > 0 && line[length - 1] != ' ')) {
      line[length++] = (char)(blank ? ' ' : *words);
    }
  }
  line[length] = '\0';
  return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: malformed: %s; save the mesh as PLY",
                          path, length == 0 ? "assimp gives no reason" : line);
}

/* What assimp may open: the file to import, and the files that it names. */
typedef struct sources {
  const mesh_file *file;
  bool alone;           /* whether the files that it names are not needed */
  supine_error refused; /* why one of them was not opened; SUPINE_OK if all were */
} sources;

/* A file that assimp reads, in memory. */
typedef struct source {
  struct aiFile calls;
  const unsigned char *bytes;
  unsigned char *owned; /* the bytes, if they are freed with the file */
  size_t size, at;
} source;

static size_t source_read(struct aiFile *file, char *to, size_t size, size_t count) {
  source *s = (source *)(void *)file->UserData;
  const size_t left = size == 0 ? 0 : (s->size - s->at) / size;
  const size_t taken = count < left ? count : left;
  if (taken > 0) {
    memcpy(to, s->bytes + s->at, taken * size);
  }
  s->at += taken * size;
  return taken;
}

static size_t source_write(struct aiFile *file, const char *from, size_t size, size_t count) {
  (void)file;
  (void)from;
  (void)size;
  (void)count;
  return 0;
}

static size_t source_tell(struct aiFile *file) {
  return ((source *)(void *)file->UserData)->at;
}

static size_t source_size(struct aiFile *file) {
  return ((source *)(void *)file->UserData)->size;
}

/* Move to a position, as fseek does. A negative offset wraps around zero, and so does the sum. */
static enum aiReturn source_seek(struct aiFile *file, size_t offset, enum aiOrigin origin) {
  source *s = (source *)(void *)file->UserData;
  size_t from = 0;
  if (origin == aiOrigin_CUR) {
    from = s->at;
  } else if (origin == aiOrigin_END) {
    from = s->size;
  }
  if (from + offset > s->size) {
    return aiReturn_FAILURE;
  }
  s->at = from + offset;
  return aiReturn_SUCCESS;
}

static void source_flush(struct aiFile *file) {
  (void)file;
}

/* Read a file in the folder of the imported one. */
static supine_status read_beside(const sources *from, const char *name, source *s,
                                 supine_error *error) {
  SUPINE_FREED_BY(supine_file_close) FILE *stream = NULL;
  SUPINE_TRY(supine_input_open_beside(from->file->path, name, &stream, &s->size, error));
  s->owned = malloc(s->size + 1);
  if (s->owned == NULL) {
    return supine_error_memory(error, "%zu bytes of %s", s->size, name);
  }
  s->bytes = s->owned;
  s->size = fread(s->owned, 1, s->size, stream);
  return SUPINE_OK;
}

static void source_close(struct aiFileIO *io, struct aiFile *file) {
  (void)io;
  source *s = (source *)(void *)file->UserData;
  free(s->owned);
  free(s);
}

/* Open the imported file, whose bytes are in memory, or one that it names. */
static supine_status make_source(const sources *from, const char *name, bool itself, source **made,
                                 supine_error *error) {
  *made = calloc(1, sizeof **made);
  if (*made == NULL) {
    return supine_error_memory(error, "reading %s", from->file->path);
  }
  (*made)->calls = (struct aiFile){source_read, source_write, source_tell,          source_size,
                                   source_seek, source_flush, (char *)(void *)*made};
  if (!itself) {
    return read_beside(from, name, *made, error);
  }
  (*made)->bytes = from->file->bytes;
  (*made)->size = from->file->size;
  return SUPINE_OK;
}

static struct aiFile *source_open(struct aiFileIO *io, const char *name, const char *mode) {
  (void)mode;
  sources *from = (sources *)(void *)io->UserData;
  const bool itself = strcmp(name, supine_text_file_name(from->file->path)) == 0;
  supine_error error = {.message = ""};
  source *made = NULL;
  if (!itself && from->alone) {
    return NULL;
  }
  if (make_source(from, name, itself, &made, &error) == SUPINE_OK) {
    return &made->calls;
  }
  if (made != NULL) {
    source_close(io, &made->calls);
  }
  /* a missing file may not be needed: another refusal takes its place */
  if (from->refused.status == SUPINE_OK || from->refused.status == SUPINE_ERROR_READ) {
    from->refused = error;
  }
  return NULL;
}

/* Import the file from memory. Files that it names are only opened in its folder. Those that an OBJ
 * file names hold colours, and are never opened. */
static const struct aiScene *import(const assimp *ai, const mesh_file *file, supine_error *error) {
  sources from = {.file = file, .alone = supine_text_ends_in(file->path, ".obj")};
  struct aiFileIO io = {source_open, source_close, (char *)(void *)&from};
  struct aiPropertyStore *properties = ai->CreatePropertyStore();
  /* Without this, importers add a surface to files that hold only a skeleton. */
  ai->SetImportPropertyInteger(properties, AI_CONFIG_IMPORT_NO_SKELETON_MESHES, 1);
  /* without a folder, so that the files are named as they are in the file */
  const struct aiScene *scene =
      ai->ImportFileExWithProperties(supine_text_file_name(file->path), 0, &io, properties);
  ai->ReleasePropertyStore(properties);
  /* some importers look for files that need not exist */
  const bool not_needed = scene != NULL && from.refused.status == SUPINE_ERROR_READ;
  if (from.refused.status != SUPINE_OK && !not_needed) {
    *error = from.refused;
  } else if (scene == NULL) {
    (void)import_fail(file->path, ai->GetErrorString(), error);
  }
  return scene;
}

static bool take_vertices(const struct aiMesh *part, const struct aiMatrix4x4 *to, gathering *out) {
  supine_mesh *mesh = &out->mesh;
  const size_t count = mesh->vertex_count + part->mNumVertices;
  double *grown =
      count > MESH_VERTICES_MAX ? NULL : realloc(mesh->vertices, (3 * count + 1) * sizeof *grown);
  if (grown == NULL) {
    (void)supine_error_memory(out->error, "%zu vertices of %s", count, out->faces.path);
    return false;
  }
  mesh->vertices = grown;
  for (unsigned i = 0; i < part->mNumVertices; ++i) {
    const double x = (double)part->mVertices[i].x;
    const double y = (double)part->mVertices[i].y;
    const double z = (double)part->mVertices[i].z;
    double *row = grown + 3 * mesh->vertex_count++;
    row[0] = (double)to->a1 * x + (double)to->a2 * y + (double)to->a3 * z + (double)to->a4;
    row[1] = (double)to->b1 * x + (double)to->b2 * y + (double)to->b3 * z + (double)to->b4;
    row[2] = (double)to->c1 * x + (double)to->c2 * y + (double)to->c3 * z + (double)to->c4;
  }
  return true;
}

/* Add the faces of a part of the scene. The vertices of the part are the last ones in the mesh. */
static bool take_faces(const struct aiMesh *part, bool mirrored, gathering *out) {
  const size_t first = out->mesh.vertex_count - part->mNumVertices;
  bool good = true;
  for (unsigned f = 0; good && f < part->mNumFaces; ++f) {
    const struct aiFace *face = &part->mFaces[f];
    const unsigned count = face->mNumIndices;
    double corner[MESH_CORNERS_MAX];
    for (unsigned k = 0; k < count && k < MESH_CORNERS_MAX; ++k) {
      corner[k] = (double)first + (double)face->mIndices[mirrored ? count - 1 - k : k];
    }
    good = supine_io_faces_add(&out->faces, corner, count, out->error) == SUPINE_OK;
  }
  return good;
}

/* Return whether a map turns vectors by about a right angle or more, as importers do with files
 * whose up axis is not theirs. */
static bool is_turned(const struct aiMatrix4x4 *to) {
  const double column[3][3] = {{(double)to->a1, (double)to->b1, (double)to->c1},
                               {(double)to->a2, (double)to->b2, (double)to->c2},
                               {(double)to->a3, (double)to->b3, (double)to->c3}};
  bool turned = false;
  for (int k = 0; k < 3; ++k) { /* a mirrored axis is not a turn */
    turned = turned || fabs(column[k][k]) < 0.5 * supine_length(column[k]);
  }
  return turned;
}

static bool take_node(const struct aiNode *node, const struct aiMatrix4x4 *above, gathering *out) {
  struct aiMatrix4x4 to = *above;
  out->ai.MultiplyMatrix4(&to, &node->mTransformation);
  const bool mirrored = out->ai.Matrix4Determinant(&to) < 0.0F;
  out->turned = out->turned || (node->mNumMeshes > 0 && is_turned(&to));
  bool good = true;
  for (unsigned m = 0; good && m < node->mNumMeshes; ++m) {
    const struct aiMesh *part = out->scene->mMeshes[node->mMeshes[m]];
    good = take_vertices(part, &to, out) && take_faces(part, mirrored, out);
  }
  for (unsigned c = 0; good && c < node->mNumChildren; ++c) {
    good = take_node(node->mChildren[c], &to, out);
  }
  return good;
}

static void confine(size_t bytes) {
  const rlim_t seconds = SECONDS_LEAST + SECONDS_PER_MEGABYTE * (bytes >> 20);
  const struct rlimit time = {seconds, seconds};
  const struct rlimit none = {0, 0};
  (void)setrlimit(RLIMIT_CPU, &time);
  (void)setrlimit(RLIMIT_CORE, &none);
#ifndef SUPINE_SANITIZED /* sanitizers need terabytes of addresses, so the limit is left out */
  const struct rlimit memory = {(rlim_t)GIGABYTES_MOST << 30, (rlim_t)GIGABYTES_MOST << 30};
  (void)setrlimit(RLIMIT_AS, &memory);
#endif
  static const int signals[] = {SIGINT,  SIGTERM, SIGHUP,  SIGXCPU,
                                SIGXFSZ, SIGALRM, SIGSEGV, SIGABRT};
  for (size_t i = 0; i < sizeof signals / sizeof *signals; ++i) {
    /* An inherited handler would delete the unfinished outputs of the parent. A signal that the
     * parent ignores stays ignored, except those of the limits above. */
    const bool from_outside = signals[i] == SIGINT || signals[i] == SIGTERM || signals[i] == SIGHUP;
    struct sigaction before = {0};
    (void)sigaction(signals[i], NULL, &before);
    if (!from_outside || before.sa_handler != SIG_IGN) {
      (void)signal(signals[i], SIG_DFL);
    }
  }
  (void)alarm(10 * (unsigned)seconds); /* ends the process if it hangs */
  (void)freopen("/dev/null", "w", stderr);
}

static _Noreturn void be_child(const mesh_file *file, int pipe_end) {
  FILE *stream = fdopen(pipe_end, "wb");
  outcome result = {.error = {.status = SUPINE_OK}};
  gathering out = {.error = &result.error};
  out.faces = (mesh_faces){.path = file->path, .mesh = &out.mesh};
  confine(file->size);
  (void)supine_locale_enter(); /* a child of a host program inherits its locale */
  if (SUPINE_LIBRARY_LOAD_OWN(SUPINE_ASSIMP, FUNCTIONS, &out.ai, &result.error) == SUPINE_OK) {
    out.scene = import(&out.ai, file, &result.error);
    struct aiMatrix4x4 identity;
    out.ai.IdentityMatrix4(&identity);
    if (result.error.status == SUPINE_OK && out.scene->mRootNode != NULL) {
      (void)take_node(out.scene->mRootNode, &identity, &out);
    }
  }
  result.dropped = out.faces.dropped;
  result.turned = out.turned;
  result.vertex_count = out.mesh.vertex_count;
  result.triangle_count = out.mesh.triangle_count;
  if (stream == NULL) {
    _exit(1);
  }
  (void)fwrite(&result, sizeof result, 1, stream);
  if (out.mesh.vertices != NULL) {
    (void)fwrite(out.mesh.vertices, 3 * sizeof(double), result.vertex_count, stream);
  }
  if (out.mesh.triangles != NULL) {
    (void)fwrite(out.mesh.triangles, 3 * sizeof(uint32_t), result.triangle_count, stream);
  }
  (void)fflush(stream);
  _exit(0); /* the end of the process frees the scene */
}

/* Read the outcome and the surface that the child process wrote. */
static supine_status take_outcome(mesh_file *file, FILE *stream, supine_mesh *mesh, size_t *dropped,
                                  supine_error *error) {
  const char *path = file->path;
  outcome result;
  if (fread(&result, sizeof result, 1, stream) == 1) {
    if (result.error.status != SUPINE_OK) {
      return supine_error_wrap(error, &result.error, "%s", "");
    }
    *dropped = result.dropped;
    file->turned = result.turned;
    const size_t n = result.vertex_count;
    const size_t triangles = result.triangle_count;
    if (supine_mesh_allocate(n, triangles, mesh) != SUPINE_OK) {
      return supine_error_memory(error, "%zu vertices of %s", n, path);
    }
    if (fread(mesh->vertices, 3 * sizeof(double), n, stream) == n &&
        fread(mesh->triangles, 3 * sizeof(uint32_t), triangles, stream) == triangles) {
      return SUPINE_OK;
    }
  }
  return supine_error_set(
      error, SUPINE_ERROR_FORMAT,
      "%s: malformed: assimp crashed, or exceeded its time or memory; save the mesh as PLY or STL",
      path);
}

supine_status supine_io_import(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                               supine_error *error) {
  int ends[2] = {-1, -1};
  FILE *stream = pipe(ends) == 0 ? fdopen(ends[0], "rb") : NULL;
  if (stream == NULL) {
    (void)close(ends[0]);
    (void)close(ends[1]);
    return supine_error_memory(error, "%s", file->path);
  }
  const pid_t child = fork();
  if (child == 0) {
    be_child(file, ends[1]);
  }
  (void)close(ends[1]);
  const supine_status status = take_outcome(file, stream, mesh, dropped, error);
  (void)fclose(stream); /* before the wait: a child that still writes ends */
  while (child > 0 && waitpid(child, NULL, 0) < 0 && errno == EINTR) {
  }
  return status;
}

/* Return whether a comment may follow the words of a line of an OBJ file that begins with `word`.
 * Other words, such as o and usemtl, are followed by names, which may hold the sign. */
static bool may_have_comment(mesh_text word) {
  static const char *const words[] = {"v", "vt", "vn", "vp", "f", "l", "p", "s"};
  bool may = word.at < word.end && *word.at == '#';
  for (size_t i = 0; i < sizeof words / sizeof *words; ++i) {
    may = may || supine_io_text_is(word, words[i]);
  }
  return may;
}

/* Make the text of an OBJ file one that assimp reads: blank the byte order mark and comments, and
 * join lines that a backslash continues. A comment ends with its line, whatever its last character.
 */
static void tidy_obj(mesh_file *file) {
  unsigned char *bytes = file->bytes;
  if (file->size >= 3 && bytes[0] == 0xEF && bytes[1] == 0xBB && bytes[2] == 0xBF) {
    memset(bytes, '\n', 3);
  }
  mesh_text text = {bytes, bytes + file->size};
  mesh_text line;
  bool continued = false;
  bool commented = false; /* whether the line's first word may be followed by a comment */
  while (supine_io_text_line(&text, &line)) {
    mesh_text rest = line;
    mesh_text word;
    if (!continued) {
      commented = supine_io_text_word(&rest, &word) && may_have_comment(word);
    }
    const size_t length = (size_t)(line.end - line.at);
    const unsigned char *mark = commented && length > 0 ? memchr(line.at, '#', length) : NULL;
    continued = mark == NULL && length > 0 && line.end[-1] == '\\' && text.at > line.end;
    if (mark != NULL) {
      memset(bytes + (mark - bytes), ' ', (size_t)(line.end - mark));
    } else if (continued) {
      memset(bytes + (line.end - 1 - bytes), ' ', (size_t)(text.at - line.end) + 1);
    }
  }
}

/* Make a binary STL file one that assimp reads: drop bytes after the last triangle, and count the
 * triangles if the file says that there are none. Refuse a count that leaves whole triangles out.
 */
static supine_status tidy_binary_stl(mesh_file *file, supine_error *error) {
  enum { HEADER = 84, COUNT = 80, TRIANGLE = 50 };
  if (file->size < HEADER) {
    return SUPINE_OK;
  }
  const size_t room = (file->size - HEADER) / TRIANGLE;
  const uint64_t count = supine_io_little_endian(file->bytes + COUNT, 4);
  if (count == 0 && room * TRIANGLE == file->size - HEADER) {
    for (size_t k = 0; k < 4; ++k) {
      file->bytes[COUNT + k] = (unsigned char)(room >> 8 * k);
    }
    return SUPINE_OK;
  }
  SUPINE_REFUSE_IF(count < room, error, SUPINE_ERROR_FORMAT,
                   "%s: its header counts %zu triangle%s, but it has room for %zu: save it again, "
                   "so that no part of the surface is lost",
                   file->path, (size_t)count, count == 1 ? "" : "s", room);
  if (count > 0 && count == room) {
    file->size = HEADER + TRIANGLE * (size_t)count;
  }
  return SUPINE_OK;
}

static unsigned char lower(char c) {
  return (unsigned char)(supine_ascii_is_letter(c) ? c | 0x20 : c);
}

/* Write the words of an STL text in small letters, as assimp knows only these. Write 0 for the
 * normals of facets, which nobody uses: those of a facet without area are no numbers. */
static void tidy_text_stl(mesh_file *file) {
  static const char normal[] = "facet normal 0 0 0";
  for (size_t i = 0; i < file->size; ++i) {
    file->bytes[i] = lower((char)file->bytes[i]);
  }
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  while (supine_io_text_line(&text, &line)) {
    mesh_text rest = line;
    mesh_text word;
    const bool facet = supine_io_text_word(&rest, &word) && supine_io_text_is(word, "facet");
    unsigned char *at = file->bytes + (word.at - file->bytes);
    if (facet && (size_t)(line.end - at) >= sizeof normal - 1) {
      memset(at, ' ', (size_t)(line.end - at));
      memcpy(at, normal, sizeof normal - 1);
    }
  }
}

/* Check that three numbers follow `keyword` in every line that begins with it, because assimp does
 * not check this. Set `last` to the first word of the last line. */
static supine_status check_lines(const mesh_file *file, const char *keyword, mesh_text *last,
                                 supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  for (size_t number = 1; supine_io_text_line(&text, &line); ++number) {
    mesh_text word;
    double position[3];
    if (!supine_io_text_word(&line, &word)) {
      continue;
    }
    *last = word;
    if (supine_io_text_is(word, keyword) && !supine_io_text_position(&line, position)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: line %zu: a vertex needs three numbers; save the mesh again",
                              file->path, number);
    }
  }
  return SUPINE_OK;
}

supine_status supine_io_read_obj(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                 supine_error *error) {
  mesh_text last;
  SUPINE_TRY(supine_io_guard_text(file, error));
  tidy_obj(file);
  SUPINE_TRY(check_lines(file, "v", &last, error));
  return supine_io_import(file, mesh, dropped, error);
}

/* Read STL, as text or binary. A file with a NUL byte is binary, even if it begins with "solid". */
supine_status supine_io_read_stl(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                 supine_error *error) {
  mesh_text last = {0};
  if (memchr(file->bytes, '\0', file->size) == NULL) {
    SUPINE_TRY(check_lines(file, "vertex", &last, error));
    SUPINE_REFUSE_IF(!supine_io_text_is(last, "endsolid"), error, SUPINE_ERROR_FORMAT,
                     "%s: the STL text does not end with endsolid: it is truncated; save it again",
                     file->path);
    tidy_text_stl(file);
  } else {
    SUPINE_TRY(tidy_binary_stl(file, error));
  }
  return supine_io_import(file, mesh, dropped, error);
}

supine_status supine_io_compare_counts(const char *path, uint64_t counted, uint64_t held,
                                       const char *what, supine_error *error) {
  SUPINE_REFUSE_IF(counted != held, error, SUPINE_ERROR_FORMAT,
                   "%s: it counts %" PRIu64 " %s, but it holds %" PRIu64
                   ": save it again, so that no part of the surface is lost",
                   path, counted, what, held);
  return SUPINE_OK;
}

/* Remove the next line from `text` that has words besides a comment; set `line` to it without the
 * comment, or return false at the end. */
static bool next_off_line(mesh_text *text, mesh_text *line) {
  while (supine_io_text_line(text, line)) {
    const size_t length = (size_t)(line->end - line->at);
    const unsigned char *mark = length > 0 ? memchr(line->at, '#', length) : NULL;
    line->end = mark != NULL ? mark : line->end;
    mesh_text rest = *line;
    mesh_text word;
    if (supine_io_text_word(&rest, &word)) {
      return true;
    }
  }
  return false;
}

/* Read OFF: a word that ends in OFF, the numbers of vertices, faces and edges, and a line for each
 * vertex and each face. */
supine_status supine_io_read_off(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                 supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line = {0};
  mesh_text word;
  uint64_t counts[3] = {0};
  uint64_t lines = 0;
  size_t known = 0;
  SUPINE_TRY(supine_io_guard_text(file, error));
  while (known < 3 && next_off_line(&text, &line)) {
    while (known < 3 && supine_io_text_word(&line, &word)) {
      known += supine_io_text_count(word, &counts[known]) ? 1 : 0;
    }
  }
  while (next_off_line(&text, &line)) {
    ++lines;
  }
  SUPINE_TRY(supine_io_compare_counts(file->path, counts[0] + counts[1], lines,
                                      "lines of vertices and faces", error));
  return supine_io_import(file, mesh, dropped, error);
}

/* Read AC3D, in which each object counts its surfaces after the word numsurf, and each surface
 * begins with the word SURF. */
supine_status supine_io_read_ac(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  uint64_t counted = 0;
  uint64_t held = 0;
  while (supine_io_text_line(&text, &line)) {
    mesh_text word;
    uint64_t count = 0;
    if (!supine_io_text_word(&line, &word)) {
      continue;
    }
    held += supine_io_text_is(word, "SURF") ? 1 : 0;
    if (supine_io_text_is(word, "numsurf") && supine_io_text_word(&line, &word) &&
        supine_io_text_count(word, &count)) {
      counted += count;
    }
  }
  SUPINE_TRY(supine_io_compare_counts(file->path, counted, held, "surfaces", error));
  return supine_io_import(file, mesh, dropped, error);
}

bool supine_io_import_knows(const char *ending) {
  assimp ai;
  return SUPINE_LIBRARY_LOAD_OWN(SUPINE_ASSIMP, FUNCTIONS, &ai, NULL) == SUPINE_OK &&
         ai.IsExtensionSupported(ending) == AI_TRUE;
}
