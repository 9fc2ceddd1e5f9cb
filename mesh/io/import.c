/* SPDX-License-Identifier: MIT */
/* Run assimp in its own process: on a corrupt file its importers may crash, leak, or use all
 * time and memory, which then ends only that process. */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <assimp/cimport.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "mesh/io/read.h"
#include "sh/base/library.h"

/* clang-format off */
#define FUNCTIONS(EACH)                                                                            \
  EACH(ai, CreatePropertyStore) EACH(ai, SetImportPropertyInteger) EACH(ai, ReleasePropertyStore)  \
  EACH(ai, ImportFileExWithProperties) EACH(ai, ImportFileFromMemoryWithProperties)                \
  EACH(ai, GetErrorString) EACH(ai, IsExtensionSupported) EACH(ai, IdentityMatrix4)                \
  EACH(ai, MultiplyMatrix4) EACH(ai, Matrix4Determinant)
/* clang-format on */

/* Functions of assimp, loaded when needed: loading takes longer than most commands run. */
typedef struct assimp {
  FUNCTIONS(SUPINE_LIBRARY_MEMBER)
} assimp;

/* Limits of an importer, far above what it needs for a lung. */
enum { SECONDS_LEAST = 8, SECONDS_PER_MEGABYTE = 1, GIGABYTES_MOST = 4 };

/* Result of the child process, in memory shared with it. */
typedef struct outcome {
  supine_error error;
  size_t dropped;
} outcome;

/* Output of the child: the scene's surface, node by node. */
typedef struct sink {
  assimp ai;
  const char *path;
  FILE *vertices;
  FILE *triangles;
  size_t vertex_count;
  size_t face_count;
  outcome *outcome;
} sink;

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
  return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: malformed: %s", path,
                          length == 0 ? "the importer failed" : line);
}

/* Import the bytes that a guard has checked, or a path if there is no guard. */
static const struct aiScene *import(const assimp *ai, const mesh_file *file) {
  const unsigned steps = aiProcess_Triangulate;
  struct aiPropertyStore *properties = ai->CreatePropertyStore();
  /* Otherwise importers make up a surface for files that hold only bones. */
  ai->SetImportPropertyInteger(properties, AI_CONFIG_IMPORT_NO_SKELETON_MESHES, 1);
  const struct aiScene *scene =
      file->format == MESH_FORMAT_OTHER
          ? ai->ImportFileExWithProperties(file->path, steps, NULL, properties)
          : ai->ImportFileFromMemoryWithProperties((const char *)file->bytes, (unsigned)file->size,
                                                   steps, "obj", properties);
  ai->ReleasePropertyStore(properties);
  return scene;
}

static void put_vertices(const struct aiMesh *part, const struct aiMatrix4x4 *to, FILE *out) {
  for (unsigned i = 0; i < part->mNumVertices; ++i) {
    const double x = (double)part->mVertices[i].x;
    const double y = (double)part->mVertices[i].y;
    const double z = (double)part->mVertices[i].z;
    const double row[3] = {
        (double)to->a1 * x + (double)to->a2 * y + (double)to->a3 * z + (double)to->a4,
        (double)to->b1 * x + (double)to->b2 * y + (double)to->b3 * z + (double)to->b4,
        (double)to->c1 * x + (double)to->c2 * y + (double)to->c3 * z + (double)to->c4};
    (void)fwrite(row, sizeof row, 1, out);
  }
}

/* Check every index, as importers do not. */
static bool put_triangles(const struct aiMesh *part, bool mirrored, sink *out) {
  for (unsigned f = 0; f < part->mNumFaces; ++f, ++out->face_count) {
    const struct aiFace *face = &part->mFaces[f];
    uint32_t corner[3];
    for (unsigned k = 0; k < face->mNumIndices; ++k) {
      if (face->mIndices[k] >= part->mNumVertices) {
        (void)supine_error_set(&out->outcome->error, SUPINE_ERROR_FORMAT,
                               "%s: face %zu names vertex %u, but there are %u", out->path,
                               out->face_count, face->mIndices[k], part->mNumVertices);
        return false;
      }
      corner[k < 3 ? k : 0] = (uint32_t)out->vertex_count + face->mIndices[k];
    }
    if (face->mNumIndices != 3) {
      ++out->outcome->dropped;
      continue;
    }
    const uint32_t row[3] = {corner[0], corner[mirrored ? 2 : 1], corner[mirrored ? 1 : 2]};
    (void)fwrite(row, sizeof row, 1, out->triangles);
  }
  return true;
}

static bool put_node(const struct aiScene *scene, const struct aiNode *node,
                     const struct aiMatrix4x4 *above, sink *out) {
  struct aiMatrix4x4 to = *above;
  out->ai.MultiplyMatrix4(&to, &node->mTransformation);
  const bool mirrored = out->ai.Matrix4Determinant(&to) < 0.0F;
  bool good = true;
  for (unsigned m = 0; good && m < node->mNumMeshes; ++m) {
    const struct aiMesh *part = scene->mMeshes[node->mMeshes[m]];
    put_vertices(part, &to, out->vertices);
    good = put_triangles(part, mirrored, out);
    out->vertex_count += part->mNumVertices;
  }
  for (unsigned c = 0; good && c < node->mNumChildren; ++c) {
    good = put_node(scene, node->mChildren[c], &to, out);
  }
  return good;
}

static void confine(size_t bytes) {
  const rlim_t seconds = SECONDS_LEAST + SECONDS_PER_MEGABYTE * (bytes >> 20);
  const struct rlimit time = {seconds, seconds};
  const struct rlimit none = {0, 0};
  (void)setrlimit(RLIMIT_CPU, &time);
  (void)setrlimit(RLIMIT_CORE, &none);
#ifndef SUPINE_SANITIZED /* sanitizers reserve terabytes */
  const struct rlimit memory = {(rlim_t)GIGABYTES_MOST << 30, (rlim_t)GIGABYTES_MOST << 30};
  (void)setrlimit(RLIMIT_AS, &memory);
#endif
  static const int signals[] = {SIGINT, SIGTERM, SIGXCPU, SIGXFSZ, SIGALRM, SIGSEGV, SIGABRT};
  for (size_t i = 0; i < sizeof signals / sizeof *signals; ++i) {
    (void)signal(signals[i], SIG_DFL); /* the program's own handlers delete its outputs */
  }
  (void)alarm(10 * (unsigned)seconds); /* ends it if it blocks */
  (void)freopen("/dev/null", "w", stderr);
}

static _Noreturn void be_child(const mesh_file *file, const int streams[2], size_t bytes,
                               outcome *left) {
  confine(bytes);
  sink out = {.path = file->path,
              .vertices = fdopen(streams[0], "wb"),
              .triangles = fdopen(streams[1], "wb"),
              .outcome = left};
  if (SUPINE_LIBRARY_LOAD(SUPINE_ASSIMP, FUNCTIONS, &out.ai, &left->error) != SUPINE_OK) {
    _exit(0);
  }
  const struct aiScene *scene = import(&out.ai, file);
  if (scene == NULL) {
    (void)import_fail(file->path, out.ai.GetErrorString(), &left->error);
    _exit(0);
  }
  struct aiMatrix4x4 identity;
  out.ai.IdentityMatrix4(&identity);
  if (out.vertices != NULL && out.triangles != NULL &&
      (scene->mRootNode == NULL || put_node(scene, scene->mRootNode, &identity, &out)) &&
      fclose(out.vertices) == 0 && fclose(out.triangles) == 0) {
    left->error.status = SUPINE_OK;
  }
  _exit(0); /* also frees the scene */
}

/* Read all that the child wrote, in items of `size` bytes; false if out of memory. */
static bool collect(int stream, size_t size, void **items, size_t *count) {
  const off_t end = lseek(stream, 0, SEEK_END);
  *count = end < 0 ? 0 : (size_t)end / size;
  *items = malloc(*count * size + 1);
  size_t done = 0;
  while (*items != NULL && done < *count * size) {
    const ssize_t got = pread(stream, (char *)*items + done, *count * size - done, (off_t)done);
    if (got <= 0) {
      return false;
    }
    done += (size_t)got;
  }
  return *items != NULL;
}

supine_status supine_mesh_import(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                 supine_error *error) {
  struct stat about = {0};
  supine_status status = SUPINE_ERROR_MEMORY;
  const int streams[2] = {memfd_create("vertices", MFD_CLOEXEC),
                          memfd_create("triangles", MFD_CLOEXEC)};
  outcome *left =
      mmap(NULL, sizeof *left, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (streams[0] < 0 || streams[1] < 0 || left == MAP_FAILED) {
    (void)supine_error_set(error, status, "%s: out of memory", file->path);
    goto cleanup;
  }
  (void)stat(file->path, &about);
  (void)supine_error_set(&left->error, SUPINE_ERROR_FORMAT,
                         "%s: malformed: the importer crashed or exceeded its time or memory; save "
                         "the mesh as PLY or STL",
                         file->path);
  const pid_t child = fork();
  if (child == 0) {
    be_child(file, streams, (size_t)about.st_size, left);
  }
  while (child > 0 && waitpid(child, NULL, 0) < 0 && errno == EINTR) {
  }
  status = left->error.status;
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "%s", left->error.message);
  } else if (!collect(streams[0], 3 * sizeof(double), (void **)&mesh->vertices,
                      &mesh->vertex_count) ||
             !collect(streams[1], 3 * sizeof(uint32_t), (void **)&mesh->triangles,
                      &mesh->triangle_count) ||
             mesh->vertex_count > MESH_VERTICES_MAX) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", file->path);
  }
  *dropped = left->dropped;

cleanup:
  if (left != MAP_FAILED) {
    (void)munmap(left, sizeof *left);
  }
  for (int i = 0; i < 2; ++i) {
    if (streams[i] >= 0) {
      (void)close(streams[i]);
    }
  }
  return status;
}

bool supine_mesh_import_knows(const char *ending) {
  assimp ai;
  return SUPINE_LIBRARY_LOAD(SUPINE_ASSIMP, FUNCTIONS, &ai, NULL) == SUPINE_OK &&
         ai.IsExtensionSupported(ending) == AI_TRUE;
}
