/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The one place that knows assimp: from a file to one list of vertices and triangles. */
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include <assimp/cimport.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "mesh/read/read.h"

enum { NODES_DEEP = 256, VERTICES_MAX = INT32_MAX, TRIANGLES_MAX = UINT32_MAX / 3 };

/* Where an import fails, assimp writes one error string of the whole process, and importers run
 * without a lock otherwise. So files that may fail are read one at a time, and files that a guard
 * found whole at the same time as other such files. */
static pthread_rwlock_t import_lock = PTHREAD_RWLOCK_INITIALIZER;

/* assimp's words as one line. */
static supine_status import_fail(const mesh_file *file, const char *words, supine_error *error) {
  char line[256];
  size_t length = 0;
  for (; words != NULL && *words != '\0' && length < sizeof line - 1; ++words) {
    const bool blank = (unsigned char)*words <= ' ';
    if (!blank || (length > 0 && line[length - 1] != ' ')) {
      line[length] = *words;
      if (blank) {
        line[length] = ' ';
      }
      ++length;
    }
  }
  line[length] = '\0';
  return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: malformed: %s", file->path,
                          length == 0 ? "the importer failed" : line);
}

/* The bytes that a guard has seen; a path where none has. */
static const struct aiScene *import(const mesh_file *file,
                                    const struct aiPropertyStore *properties) {
  static const char *const hints[] = {[MESH_FORMAT_PLY] = "ply",
                                      [MESH_FORMAT_STL] = "stl",
                                      [MESH_FORMAT_OBJ] = "obj",
                                      [MESH_FORMAT_OFF] = "off"};
  if (file->format == MESH_FORMAT_OTHER) {
    return aiImportFileExWithProperties(file->path, 0, NULL, properties);
  }
  return aiImportFileFromMemoryWithProperties((const char *)file->bytes, (unsigned)file->size, 0,
                                              hints[file->format], properties);
}

static supine_status read_scene(mesh_file *file, const struct aiScene **scene,
                                supine_error *error) {
  if (file->size > UINT32_MAX) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: larger than 4 GiB; reduce the mesh first", file->path);
  }
  struct aiPropertyStore *properties = aiCreatePropertyStore();
  if (properties == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", file->path);
  }
  /* Else importers make up a surface for files that hold bones alone. */
  aiSetImportPropertyInteger(properties, AI_CONFIG_IMPORT_NO_SKELETON_MESHES, 1);
  if (file->whole) {
    (void)pthread_rwlock_rdlock(&import_lock);
  } else {
    (void)pthread_rwlock_wrlock(&import_lock);
  }
  supine_status status = SUPINE_OK;
  *scene = import(file, properties);
  if (*scene == NULL) {
    status = import_fail(file, file->whole ? NULL : aiGetErrorString(), error);
  }
  (void)pthread_rwlock_unlock(&import_lock);
  aiReleasePropertyStore(properties);
  free(file->bytes);
  file->bytes = NULL;
  file->size = 0;
  return status;
}

/* Importers check no index; `polygons` tells whether some face has more than three. */
static supine_status check_faces(const mesh_file *file, const struct aiScene *scene, bool *polygons,
                                 supine_error *error) {
  size_t number = 0;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const struct aiMesh *part = scene->mMeshes[m];
    for (unsigned f = 0; f < part->mNumFaces; ++f, ++number) {
      const struct aiFace *face = &part->mFaces[f];
      *polygons = *polygons || face->mNumIndices > 3;
      for (unsigned k = 0; k < face->mNumIndices; ++k) {
        if (face->mIndices[k] >= part->mNumVertices) {
          return supine_error_set(error, SUPINE_ERROR_FORMAT,
                                  "%s: face %zu names vertex %u, but there are %u", file->path,
                                  number, face->mIndices[k], part->mNumVertices);
        }
      }
    }
  }
  if (file->faces != SIZE_MAX && number != file->faces) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: the file promises %zu faces, but %zu could be read", file->path,
                            file->faces, number);
  }
  return SUPINE_OK;
}

static bool node_is_legal(const struct aiScene *scene, const struct aiNode *node) {
  for (unsigned m = 0; m < node->mNumMeshes; ++m) {
    if (node->mMeshes[m] >= scene->mNumMeshes) {
      return false;
    }
  }
  return true;
}

/* Adds what the node and those below it hold; false where the scene is not a tree of use. */
static bool count_node(const struct aiScene *scene, const struct aiNode *node, unsigned depth,
                       size_t *vertices, size_t *faces) {
  if (depth > NODES_DEEP || !node_is_legal(scene, node)) {
    return false;
  }
  for (unsigned m = 0; m < node->mNumMeshes; ++m) {
    const struct aiMesh *part = scene->mMeshes[node->mMeshes[m]];
    *vertices += part->mNumVertices;
    *faces += part->mNumFaces;
    if (*vertices > VERTICES_MAX || *faces > TRIANGLES_MAX) {
      return false;
    }
  }
  for (unsigned c = 0; c < node->mNumChildren; ++c) {
    if (!count_node(scene, node->mChildren[c], depth + 1, vertices, faces)) {
      return false;
    }
  }
  return true;
}

static void add_vertices(const struct aiMesh *part, const struct aiMatrix4x4 *to,
                         supine_mesh *mesh) {
  double *out = mesh->vertices + 3 * mesh->vertex_count;
  for (unsigned i = 0; i < part->mNumVertices; ++i, out += 3) {
    const double x = (double)part->mVertices[i].x;
    const double y = (double)part->mVertices[i].y;
    const double z = (double)part->mVertices[i].z;
    out[0] = (double)to->a1 * x + (double)to->a2 * y + (double)to->a3 * z + (double)to->a4;
    out[1] = (double)to->b1 * x + (double)to->b2 * y + (double)to->b3 * z + (double)to->b4;
    out[2] = (double)to->c1 * x + (double)to->c2 * y + (double)to->c3 * z + (double)to->c4;
  }
}

static void add_triangles(const struct aiMesh *part, bool mirrored, supine_mesh *mesh,
                          size_t *dropped) {
  const uint32_t base = (uint32_t)mesh->vertex_count;
  uint32_t *out = mesh->triangles + 3 * mesh->triangle_count;
  for (unsigned f = 0; f < part->mNumFaces; ++f) {
    const struct aiFace *face = &part->mFaces[f];
    if (face->mNumIndices != 3) {
      ++*dropped;
      continue;
    }
    out[0] = base + face->mIndices[0];
    out[1] = base + face->mIndices[mirrored ? 2 : 1];
    out[2] = base + face->mIndices[mirrored ? 1 : 2];
    out += 3;
    ++mesh->triangle_count;
  }
}

static void add_node(const struct aiScene *scene, const struct aiNode *node,
                     const struct aiMatrix4x4 *above, supine_mesh *mesh, size_t *dropped) {
  struct aiMatrix4x4 to = *above;
  aiMultiplyMatrix4(&to, &node->mTransformation);
  const bool mirrored = aiMatrix4Determinant(&to) < 0.0F;
  for (unsigned m = 0; m < node->mNumMeshes; ++m) {
    const struct aiMesh *part = scene->mMeshes[node->mMeshes[m]];
    add_vertices(part, &to, mesh);
    add_triangles(part, mirrored, mesh, dropped);
    mesh->vertex_count += part->mNumVertices;
  }
  for (unsigned c = 0; c < node->mNumChildren; ++c) {
    add_node(scene, node->mChildren[c], &to, mesh, dropped);
  }
}

supine_status supine_mesh_import(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                 supine_error *error) {
  supine_mesh joined = {0};
  const struct aiScene *scene = NULL;
  supine_status status = read_scene(file, &scene, error);
  if (status != SUPINE_OK || scene == NULL) {
    goto cleanup;
  }
  bool polygons = false;
  status = check_faces(file, scene, &polygons, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  if (polygons) {
    scene = aiApplyPostProcessing(scene, aiProcess_Triangulate);
  }
  size_t vertices = 0;
  size_t faces = 0;
  if (scene == NULL ||
      (scene->mRootNode != NULL && !count_node(scene, scene->mRootNode, 0, &vertices, &faces))) {
    status =
        supine_error_set(error, SUPINE_ERROR_FORMAT,
                         "%s: malformed, or more faces and nodes than can be held", file->path);
    goto cleanup;
  }
  joined.vertices = malloc((3 * vertices + 1) * sizeof *joined.vertices);
  joined.triangles = malloc((3 * faces + 1) * sizeof *joined.triangles);
  if (joined.vertices == NULL || joined.triangles == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY,
                              "%s: out of memory for %zu vertices and %zu faces", file->path,
                              vertices, faces);
    goto cleanup;
  }
  if (scene->mRootNode != NULL) {
    struct aiMatrix4x4 identity;
    aiIdentityMatrix4(&identity);
    add_node(scene, scene->mRootNode, &identity, &joined, dropped);
  }
  *mesh = joined;
  joined = (supine_mesh){0};

cleanup:
  supine_mesh_free(&joined);
  if (scene != NULL) {
    aiReleaseImport(scene);
  }
  return status;
}
