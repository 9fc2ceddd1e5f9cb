/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Run supine.glsl without a window, in GLSL ES 3.00 and GLSL 3.30 core. Assert that positions and
 * normals, read back by transform feedback, equal those of the C library except for rounding. One
 * draw call contains both lungs, each with its own factors on the displacement. The tests are
 * skipped if EGL has no context without a surface. */
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl3.h>

#include "tests/helpers/test.h"

#include <supine/runtime.h>

#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

enum { VERTICES = 1003, LUNGS = 2, NORMALS = 8, WORDS = 3 };
enum { DIRECTION_AT = 5, NORMALS_AT = 13 }; /* locations of attributes */

/* Type and name of each OpenGL function that is loaded at run time. */
#define GL_FUNCTIONS(F)                                                                            \
  F(PFNGLATTACHSHADERPROC, AttachShader)                                                           \
  F(PFNGLBEGINTRANSFORMFEEDBACKPROC, BeginTransformFeedback)                                       \
  F(PFNGLBINDATTRIBLOCATIONPROC, BindAttribLocation)                                               \
  F(PFNGLBINDBUFFERPROC, BindBuffer)                                                               \
  F(PFNGLBINDBUFFERBASEPROC, BindBufferBase)                                                       \
  F(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)                                                     \
  F(PFNGLBINDRENDERBUFFERPROC, BindRenderbuffer)                                                   \
  F(PFNGLBINDTEXTUREPROC, BindTexture)                                                             \
  F(PFNGLBINDVERTEXARRAYPROC, BindVertexArray)                                                     \
  F(PFNGLBUFFERDATAPROC, BufferData)                                                               \
  F(PFNGLCOMPILESHADERPROC, CompileShader)                                                         \
  F(PFNGLCREATEPROGRAMPROC, CreateProgram)                                                         \
  F(PFNGLCREATESHADERPROC, CreateShader)                                                           \
  F(PFNGLDRAWARRAYSPROC, DrawArrays)                                                               \
  F(PFNGLENABLEPROC, Enable)                                                                       \
  F(PFNGLENABLEVERTEXATTRIBARRAYPROC, EnableVertexAttribArray)                                     \
  F(PFNGLENDTRANSFORMFEEDBACKPROC, EndTransformFeedback)                                           \
  F(PFNGLFINISHPROC, Finish)                                                                       \
  F(PFNGLFRAMEBUFFERRENDERBUFFERPROC, FramebufferRenderbuffer)                                     \
  F(PFNGLGENBUFFERSPROC, GenBuffers)                                                               \
  F(PFNGLGENFRAMEBUFFERSPROC, GenFramebuffers)                                                     \
  F(PFNGLGENRENDERBUFFERSPROC, GenRenderbuffers)                                                   \
  F(PFNGLGENTEXTURESPROC, GenTextures)                                                             \
  F(PFNGLGENVERTEXARRAYSPROC, GenVertexArrays)                                                     \
  F(PFNGLGETERRORPROC, GetError)                                                                   \
  F(PFNGLGETPROGRAMINFOLOGPROC, GetProgramInfoLog)                                                 \
  F(PFNGLGETPROGRAMIVPROC, GetProgramiv)                                                           \
  F(PFNGLGETSHADERINFOLOGPROC, GetShaderInfoLog)                                                   \
  F(PFNGLGETSHADERIVPROC, GetShaderiv)                                                             \
  F(PFNGLGETSTRINGPROC, GetString)                                                                 \
  F(PFNGLGETUNIFORMLOCATIONPROC, GetUniformLocation)                                               \
  F(PFNGLLINKPROGRAMPROC, LinkProgram)                                                             \
  F(PFNGLREADPIXELSPROC, ReadPixels)                                                               \
  F(PFNGLMAPBUFFERRANGEPROC, MapBufferRange)                                                       \
  F(PFNGLRENDERBUFFERSTORAGEPROC, RenderbufferStorage)                                             \
  F(PFNGLSHADERSOURCEPROC, ShaderSource)                                                           \
  F(PFNGLTEXIMAGE2DPROC, TexImage2D)                                                               \
  F(PFNGLTEXPARAMETERIPROC, TexParameteri)                                                         \
  F(PFNGLTRANSFORMFEEDBACKVARYINGSPROC, TransformFeedbackVaryings)                                 \
  F(PFNGLUNIFORM1IPROC, Uniform1i)                                                                 \
  F(PFNGLUNIFORM3FVPROC, Uniform3fv)                                                               \
  F(PFNGLUNIFORM4FVPROC, Uniform4fv)                                                               \
  F(PFNGLUSEPROGRAMPROC, UseProgram)                                                               \
  F(PFNGLVERTEXATTRIBIPOINTERPROC, VertexAttribIPointer)                                           \
  F(PFNGLVERTEXATTRIBPOINTERPROC, VertexAttribPointer)                                             \
  F(PFNGLVIEWPORTPROC, Viewport)

typedef struct gl_api {
#define MEMBER(type, name) type name;
  GL_FUNCTIONS(MEMBER)
#undef MEMBER
} gl_api;

/* Create an OpenGL context without a surface. Return false if that is not possible. */
static bool make_context(EGLenum api, EGLDisplay *display, EGLContext *context, gl_api *gl) {
  const EGLint renderable = api == EGL_OPENGL_API ? EGL_OPENGL_BIT : EGL_OPENGL_ES3_BIT;
  const EGLint wanted[] = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE, renderable, EGL_NONE};
  const EGLint core[] = {EGL_CONTEXT_MAJOR_VERSION,
                         3,
                         EGL_CONTEXT_MINOR_VERSION,
                         3,
                         EGL_CONTEXT_OPENGL_PROFILE_MASK,
                         EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                         EGL_NONE};
  const EGLint es[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_NONE};
  EGLConfig config = NULL;
  EGLint count = 0;
  *context = EGL_NO_CONTEXT;
  *display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
  if (*display == EGL_NO_DISPLAY || !eglInitialize(*display, NULL, NULL)) {
    return false;
  }
  if (!eglBindAPI(api) || !eglChooseConfig(*display, wanted, &config, 1, &count) || count < 1) {
    return false;
  }
  *context = eglCreateContext(*display, config, EGL_NO_CONTEXT, api == EGL_OPENGL_API ? core : es);
  if (*context == EGL_NO_CONTEXT ||
      !eglMakeCurrent(*display, EGL_NO_SURFACE, EGL_NO_SURFACE, *context)) {
    return false;
  }
#define LOAD(type, name)                                                                           \
  gl->name = (type)eglGetProcAddress("gl" #name);                                                  \
  if (gl->name == NULL) {                                                                          \
    return false;                                                                                  \
  }
  GL_FUNCTIONS(LOAD)
#undef LOAD
  return true;
}

static GLuint make_shader(const gl_api *gl, GLenum kind, const char *version, const char *defines,
                          const char *library, const char *text) {
  const char *const parts[] = {version, defines, library, text};
  const GLuint shader = gl->CreateShader(kind);
  gl->ShaderSource(shader, 4, parts, NULL);
  gl->CompileShader(shader);
  GLint good = 0;
  gl->GetShaderiv(shader, GL_COMPILE_STATUS, &good);
  if (!good) {
    char log[2048] = "";
    gl->GetShaderInfoLog(shader, sizeof log, NULL, log);
    fail_msg("%s", log);
  }
  return shader;
}

/* Link an OpenGL program with the vertex shader `vertex`, whose attributes have the names [16] by
 * location. OpenGL has at least 16. An empty name is not used. */
static GLuint link_program(const gl_api *gl, const char *version, const char *defines,
                           const char *library, const char *vertex, const char *const *names) {
  static const char fragment[] = "out vec4 colour; void main() { colour = vec4(1.0); }\n";
  static const char *const varyings[] = {"position", "normal"};
  const GLuint program = gl->CreateProgram();
  gl->AttachShader(program, make_shader(gl, GL_VERTEX_SHADER, version, defines, library, vertex));
  gl->AttachShader(program, make_shader(gl, GL_FRAGMENT_SHADER, version, "", "", fragment));
  for (GLuint i = 0; i < NORMALS_AT + WORDS; ++i) {
    if (names[i][0] != '\0') {
      gl->BindAttribLocation(program, i, names[i]);
    }
  }
  gl->TransformFeedbackVaryings(program, 2, varyings, GL_INTERLEAVED_ATTRIBS);
  gl->LinkProgram(program);
  GLint good = 0;
  gl->GetProgramiv(program, GL_LINK_STATUS, &good);
  if (!good) {
    char log[2048] = "";
    gl->GetProgramInfoLog(program, sizeof log, NULL, log);
    fail_msg("%s", log);
  }
  return program;
}

/* Link an OpenGL program that displaces vertices by coefficients in `vectors` vec4s along the
 * vertex's direction or, if `axes` is 3, along each axis, by the weights of all lungs or of each.
 */
static GLuint make_program(const gl_api *gl, const char *version, const char *library,
                           size_t vectors, size_t axes, bool by_lung) {
  static const char own[] = "vec3(supine_amount(supine_first(rest), c0),\n"
                            "     supine_amount(supine_first(rest), y0),\n"
                            "     supine_amount(supine_first(rest), z0))";
  static const char *const arguments[][4] = {
      {"direction, c0", "direction, c0, c1", "direction, c0, c1, c2", "direction, c0, c1, c2, c3"},
      {"vec3(supine_amount(c0), supine_amount(y0), supine_amount(z0))",
       "vec3(supine_amount(c0, c1), supine_amount(y0, y1), supine_amount(z0, z1))",
       "vec3(supine_amount(c0, c1, c2), supine_amount(y0, y1, y2), supine_amount(z0, z1, z2))",
       "vec3(supine_amount(c0, c1, c2, c3), supine_amount(y0, y1, y2, y3),\n"
       "     supine_amount(z0, z1, z2, z3))"}};
  static const char *const scalar[] = {"rest", "c0", "c1", "c2", "c3", "direction", "",   "",
                                       "",     "",   "",   "",   "",   "n0",        "n1", "n2"};
  static const char *const vector[] = {"rest", "c0", "c1", "c2", "c3", "y0", "y1", "y2",
                                       "y3",   "z0", "z1", "z2", "z3", "n0", "n1", "n2"};
  char vertex[2048];
  char defines[256];
  (void)snprintf(defines, sizeof defines,
                 "#define SUPINE_LUNGS %d\n#define SUPINE_VECTORS %zu\n#define SUPINE_WORDS %d\n"
                 "#define SUPINE_BY_LUNG %d\n",
                 LUNGS, vectors, WORDS, by_lung ? 1 : 0);
  (void)snprintf(vertex, sizeof vertex,
                 "in vec4 rest; in vec4 c0; in vec4 c1; in vec4 c2; in vec4 c3; %s\n"
                 "in uvec3 n0; in uvec3 n1; in uvec3 n2;\n"
                 "out vec3 position;\n"
                 "out vec3 normal;\n"
                 "void main() {\n"
                 "  position = supine_displace(rest, %s);\n"
                 "  normal = normalize(supine_normal(rest, 0, n0) + supine_normal(rest, 1, n1) +\n"
                 "                     supine_normal(rest, 2, n2));\n"
                 "  gl_Position = vec4(position, 1.0);\n"
                 "}\n",
                 axes == 3 ? "in vec4 y0; in vec4 y1; in vec4 y2; in vec4 y3;\n"
                             "in vec4 z0; in vec4 z1; in vec4 z2; in vec4 z3;"
                           : "in vec3 direction;",
                 by_lung ? own : arguments[axes / 2][vectors - 1]);
  return link_program(gl, version, defines, library, vertex, axes == 3 ? vector : scalar);
}

/* Link an OpenGL program that displaces the vertices of a basis of clusters. */
static GLuint make_clustered_program(const gl_api *gl, const char *version, const char *library) {
  static const char *const names[] = {"rest", "scalars", "cluster", "lung", "", "",   "",   "",
                                      "",     "",        "",        "",     "", "n0", "n1", "n2"};
  static const char vertex[] =
      "in vec3 rest; in vec2 scalars; in uint cluster; in uint lung;\n"
      "in uvec3 n0; in uvec3 n1; in uvec3 n2;\n"
      "out vec3 position;\n"
      "out vec3 normal;\n"
      "void main() {\n"
      "  vec4 at = vec4(rest, float(lung));\n"
      "  position = supine_displace(rest, scalars, cluster);\n"
      "  normal = normalize(supine_normal(at, 0, n0) + supine_normal(at, 1, n1) +\n"
      "                     supine_normal(at, 2, n2));\n"
      "  gl_Position = vec4(position, 1.0);\n"
      "}\n";
  char defines[128];
  (void)snprintf(defines, sizeof defines, "#define SUPINE_LUNGS %d\n#define SUPINE_WORDS %d\n",
                 LUNGS, WORDS);
  return link_program(gl, version, defines, library, vertex, names);
}

/* Create a framebuffer to draw into, as a context without a surface has none. */
static void make_framebuffer(const gl_api *gl) {
  GLuint framebuffer = 0;
  GLuint renderbuffer = 0;
  gl->GenFramebuffers(1, &framebuffer);
  gl->BindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  gl->GenRenderbuffers(1, &renderbuffer);
  gl->BindRenderbuffer(GL_RENDERBUFFER, renderbuffer);
  gl->RenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, 1, 1);
  gl->FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, renderbuffer);
}

/* Inputs of the vertex shader. */
typedef struct model {
  size_t modes;
  size_t axes;       /* 3 for a basis with three coefficients for each mode, otherwise 1 */
  size_t head;       /* floats of a vertex before its coefficients */
  float *attributes; /* [VERTICES, head + axes * modes] vertex attributes from supine_gl_pack */
  uint32_t *words;   /* [VERTICES, WORDS, 3] packed normals from supine_gl_pack_normals */
  size_t clusters;   /* 0, or number of clusters; then without attributes, weights and gains */
  supine_gl_clustered_vertex *vertices; /* [VERTICES] from supine_gl_pack_clusters */
  float *frames;      /* [clusters, SUPINE_GL_FRAME_FLOATS] from supine_gl_frames */
  size_t weight_rows; /* LUNGS if each lung has weights of its own, otherwise 1 */
  float weights[LUNGS * SUPINE_GL_MODES];
  float gains[3 * LUNGS];
  float normal_weights[LUNGS * WORDS * 3];
} model;

/* Create the vertex arrays of modes. */
static void load_modes(const gl_api *gl, const model *m) {
  const GLsizei stride = (GLsizei)((m->head + m->axes * m->modes) * sizeof(float));
  gl->BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)VERTICES * stride, m->attributes, GL_STATIC_DRAW);
  gl->EnableVertexAttribArray(0);
  gl->VertexAttribPointer(0, 4, GL_FLOAT, GL_FALSE, stride, NULL);
  if (m->axes == 1) {
    gl->EnableVertexAttribArray(DIRECTION_AT);
    gl->VertexAttribPointer(DIRECTION_AT, 3, GL_FLOAT, GL_FALSE, stride,
                            (const void *)(4 * sizeof(float)));
  }
  for (size_t axis = 0; axis < m->axes; ++axis) {
    for (size_t k = 0; k < m->modes; k += 4) {
      const uintptr_t offset = (m->head + axis * m->modes + k) * sizeof(float);
      const GLuint location = (GLuint)(1 + 4 * axis + k / 4);
      gl->EnableVertexAttribArray(location);
      gl->VertexAttribPointer(location, m->modes - k < 4 ? (GLint)(m->modes - k) : 4, GL_FLOAT,
                              GL_FALSE, stride, (const void *)offset);
    }
  }
}

/* Create the vertex arrays and the texture of clusters. */
static void load_clusters(const gl_api *gl, const model *m) {
  const GLsizei stride = (GLsizei)sizeof *m->vertices;
  GLuint texture = 0;
  gl->BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)VERTICES * stride, m->vertices, GL_STATIC_DRAW);
  for (GLuint location = 0; location < 4; ++location) {
    gl->EnableVertexAttribArray(location);
  }
  gl->VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, stride, NULL);
  gl->VertexAttribPointer(1, 2, GL_SHORT, GL_FALSE, stride, (const void *)12);
  gl->VertexAttribIPointer(2, 1, GL_UNSIGNED_SHORT, stride, (const void *)16);
  gl->VertexAttribIPointer(3, 1, GL_UNSIGNED_SHORT, stride, (const void *)18);
  gl->GenTextures(1, &texture);
  gl->BindTexture(GL_TEXTURE_2D, texture);
  gl->TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA32F, SUPINE_GL_FRAME_FLOATS / 4, (GLsizei)m->clusters, 0,
                 GL_RGBA, GL_FLOAT, m->frames);
  gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
}

/* Create the vertex arrays of the model. */
static void load_model(const gl_api *gl, const model *m) {
  GLuint array = 0;
  GLuint buffers[2] = {0, 0};
  gl->GenVertexArrays(1, &array);
  gl->BindVertexArray(array);
  gl->GenBuffers(2, buffers);
  gl->BindBuffer(GL_ARRAY_BUFFER, buffers[0]);
  if (m->clusters > 0) {
    load_clusters(gl, m);
  } else {
    load_modes(gl, m);
  }
  gl->BindBuffer(GL_ARRAY_BUFFER, buffers[1]);
  gl->BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(VERTICES * WORDS * 3 * sizeof *m->words), m->words,
                 GL_STATIC_DRAW);
  for (GLuint j = 0; j < WORDS; ++j) {
    gl->EnableVertexAttribArray(NORMALS_AT + j);
    gl->VertexAttribIPointer(NORMALS_AT + j, 3, GL_UNSIGNED_INT,
                             (GLsizei)(WORDS * 3 * sizeof *m->words),
                             (const void *)((uintptr_t)j * 3 * sizeof *m->words));
  }
}

/* Set captured [VERTICES, 6] to the position and normal of each vertex after one draw. */
static void run_shader(const gl_api *gl, GLuint program, const model *m, float *captured) {
  const GLsizeiptr output = (GLsizeiptr)(6 * VERTICES * sizeof(float));
  const GLsizei vectors = (GLsizei)((m->modes + 3) / 4);
  GLuint buffer = 0;
  load_model(gl, m);
  gl->GenBuffers(1, &buffer);
  gl->BindBuffer(GL_TRANSFORM_FEEDBACK_BUFFER, buffer);
  gl->BufferData(GL_TRANSFORM_FEEDBACK_BUFFER, output, NULL, GL_DYNAMIC_READ);
  gl->BindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, buffer);
  gl->UseProgram(program);
  if (m->clusters == 0) {
    gl->Uniform4fv(gl->GetUniformLocation(program, "supine_weights"),
                   vectors * (GLsizei)m->weight_rows, m->weights);
    gl->Uniform3fv(gl->GetUniformLocation(program, "supine_gains"), LUNGS, m->gains);
  } else {
    gl->Uniform1i(gl->GetUniformLocation(program, "supine_frames"), 0);
  }
  gl->Uniform3fv(gl->GetUniformLocation(program, "supine_normal_weights"), LUNGS * WORDS,
                 m->normal_weights);
  gl->Enable(GL_RASTERIZER_DISCARD);
  gl->BeginTransformFeedback(GL_POINTS);
  gl->DrawArrays(GL_POINTS, 0, VERTICES);
  gl->EndTransformFeedback();
  gl->Finish();
  assert_int_equal(gl->GetError(), GL_NO_ERROR);
  const void *mapped = gl->MapBufferRange(GL_TRANSFORM_FEEDBACK_BUFFER, 0, output, GL_MAP_READ_BIT);
  assert_non_null(mapped);
  memcpy(captured, mapped, (size_t)output);
}

/* Tolerance for normals. The shader uses the same packed numbers as the C library but rounds
 * differently. The random modes nearly cancel in some sums, which loses a digit. */
static const double normal_rounding = 1e-4;

static void check_modes(const gl_api *gl, const char *version, const char *library, size_t modes,
                        bool vector) {
  model m = {.modes = modes,
             .weight_rows = 1,
             .axes = vector ? 3 : 1,
             .head = vector ? SUPINE_GL_VECTOR_FLOATS : SUPINE_GL_FLOATS};
  const GLuint program = make_program(gl, version, library, (modes + 3) / 4, m.axes, false);
  fixture *f = fixture_create(VERTICES, modes, 3, LUNGS, vector, false, 9, 21);
  fixture_add_normals(f, NORMALS, 5);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_memory_with(bytes, size, &exact, &basis, NULL), SUPINE_OK);
  m.attributes = fixture_allocate(VERTICES * (m.head + m.axes * modes), sizeof *m.attributes);
  m.words = fixture_allocate((size_t)VERTICES * WORDS * 3, sizeof *m.words);
  float *gpu = fixture_allocate(6 * VERTICES, sizeof *gpu);
  float *cpu = fixture_allocate(6 * VERTICES, sizeof *cpu);
  assert_int_equal(supine_gl_pack(basis, 0, VERTICES, m.attributes), SUPINE_OK);
  assert_int_equal(supine_gl_pack_normals(basis, 0, VERTICES, m.words), SUPINE_OK);
  const double gravity[3] = {0.6, -0.3, 0.2};
  const double scales[LUNGS] = {1.7, -0.9};
  double weights[SUPINE_GL_MODES];
  assert_int_equal(supine_basis_weights(basis, gravity, weights), SUPINE_OK);
  assert_int_equal(supine_gl_weights(basis, POSED(basis, weights, scales), m.weights, m.gains),
                   SUPINE_OK);
  assert_int_equal(supine_gl_normal_weights(basis, POSED(basis, weights, scales), m.normal_weights),
                   SUPINE_OK);
  run_shader(gl, program, &m, gpu);
  assert_int_equal(supine_deform_lit(basis, POSED(basis, weights, scales), cpu, cpu + 3 * VERTICES),
                   SUPINE_OK);
  double moved = 0;
  /* The shader and the C library err by at most supine_basis_error each. */
  const double bound = 2 * supine_basis_error(basis, POSED(basis, weights, scales));
  assert_true(bound < 1e-3);
  for (size_t i = 0; i < VERTICES; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const float *normal = cpu + 3 * VERTICES;
      assert_true(fabs((double)gpu[6 * i + axis] - (double)cpu[3 * i + axis]) <= bound);
      assert_true(fabs((double)gpu[6 * i + 3 + axis] - (double)normal[3 * i + axis]) <=
                  normal_rounding);
      moved = fmax(moved, fabs((double)gpu[6 * i + axis] - (double)f->vertex[3 * i + axis]));
    }
  }
  assert_true(moved > 1);
  free(m.attributes);
  free(m.words);
  free(gpu);
  free(cpu);
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

/* Assert that lungs of fields over gravity and volume, at different volumes, have the positions of
 * the C library. */
static void check_simulated(const gl_api *gl, const char *version, const char *library) {
  static const double filled[LUNGS] = {0.85, 1.1};
  model m = {.modes = 2, .weight_rows = LUNGS, .axes = 3, .head = SUPINE_GL_VECTOR_FLOATS};
  const GLuint program = make_program(gl, version, library, 1, 3, true);
  fixture *f = fixture_create_simulated(VERTICES, 21);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_memory_with(bytes, size, &exact, &basis, NULL), SUPINE_OK);
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_state state = {.gravity = {0.6, -0.3, 0.2}, .lung_count = LUNGS};
  supine_pose pose;
  for (size_t lung = 0; lung < LUNGS; ++lung) {
    strcpy(state.lungs[lung].name, info->lung_names[lung]);
    state.lungs[lung].volume =
        (supine_volume){SUPINE_VOLUME_ABSOLUTE, filled[lung] * info->reference_volume[lung]};
  }
  assert_int_equal(supine_basis_pose(basis, &state, &pose, NULL), SUPINE_OK);
  m.attributes = fixture_allocate(VERTICES * (m.head + 3 * m.modes), sizeof *m.attributes);
  m.words = fixture_allocate((size_t)VERTICES * WORDS * 3, sizeof *m.words);
  float *gpu = fixture_allocate(6 * VERTICES, sizeof *gpu);
  float *cpu = fixture_allocate(3 * VERTICES, sizeof *cpu);
  assert_int_equal(supine_gl_pack(basis, 0, VERTICES, m.attributes), SUPINE_OK);
  assert_int_equal(supine_gl_weights(basis, &pose, m.weights, m.gains), SUPINE_OK);
  run_shader(gl, program, &m, gpu);
  assert_int_equal(supine_deform(basis, &pose, cpu), SUPINE_OK);
  for (size_t i = 0; i < 3 * (size_t)VERTICES; ++i) {
    assert_true(fabs((double)gpu[6 * (i / 3) + i % 3] - (double)cpu[i]) <=
                2 * supine_basis_error(basis, &pose));
  }
  free(m.attributes);
  free(m.words);
  free(gpu);
  free(cpu);
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

/* Assert that a basis of clusters has the positions and normals of the C library. It has more modes
 * than the shader can hold without clusters. */
static void check_clusters(const gl_api *gl, const char *version, const char *library) {
  enum { CLUSTERS = 300 };
  model m = {.clusters = CLUSTERS};
  const GLuint program = make_clustered_program(gl, version, library);
  fixture *f = fixture_create(VERTICES, SUPINE_GL_MODES + 1, 3, LUNGS, true, false, 9, 21);
  fixture_add_clusters(f, CLUSTERS, 9, 22);
  fixture_add_normals(f, NORMALS, 5);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_memory(bytes, size, &basis, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_get_info(basis)->cluster_count, CLUSTERS);
  m.vertices = fixture_allocate(VERTICES, sizeof *m.vertices);
  m.frames = fixture_allocate((size_t)CLUSTERS * SUPINE_GL_FRAME_FLOATS, sizeof *m.frames);
  m.words = fixture_allocate((size_t)VERTICES * WORDS * 3, sizeof *m.words);
  float *gpu = fixture_allocate(6 * VERTICES, sizeof *gpu);
  float *cpu = fixture_allocate(6 * VERTICES, sizeof *cpu);
  const float *normals = cpu + 3 * VERTICES;
  const double gravity[3] = {0.6, -0.3, 0.2};
  const double scales[LUNGS] = {1.7, -0.9};
  double weights[SUPINE_MODES_MAX];
  assert_int_equal(supine_basis_weights(basis, gravity, weights), SUPINE_OK);
  const supine_pose *pose = POSED(basis, weights, scales);
  assert_int_equal(supine_gl_pack_clusters(basis, 0, VERTICES, m.vertices), SUPINE_OK);
  assert_int_equal(supine_gl_frames(basis, pose, m.frames), SUPINE_OK);
  assert_int_equal(supine_gl_pack_normals(basis, 0, VERTICES, m.words), SUPINE_OK);
  assert_int_equal(supine_gl_normal_weights(basis, pose, m.normal_weights), SUPINE_OK);
  run_shader(gl, program, &m, gpu);
  assert_int_equal(supine_deform_lit(basis, pose, cpu, cpu + 3 * VERTICES), SUPINE_OK);
  const double bound = 2 * supine_basis_error(basis, pose);
  double moved = 0;
  assert_true(bound < 2e-3);
  for (size_t i = 0; i < 3 * (size_t)VERTICES; ++i) {
    const float *vertex = gpu + 6 * (i / 3) + i % 3;
    assert_true(fabs((double)vertex[0] - (double)cpu[i]) <= bound);
    assert_true(fabs((double)vertex[3] - (double)normals[i]) <= normal_rounding);
    moved = fmax(moved, fabs((double)vertex[0] - (double)f->vertex[i]));
  }
  assert_true(moved > 1);
  free(m.vertices);
  free(m.frames);
  free(m.words);
  free(gpu);
  free(cpu);
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

/* Link an OpenGL program that paints a whole framebuffer with the normal of a triangle, whose
 * corners have the positions `corner`. */
static GLuint make_painting_program(const gl_api *gl, const char *version, const char *library) {
  static const char vertex[] = "uniform vec3 corner[3];\n"
                               "out vec3 place;\n"
                               "void main() {\n"
                               "  place = corner[gl_VertexID];\n"
                               "  gl_Position = vec4(gl_VertexID == 1 ? 5.0 : -1.0, gl_VertexID == "
                               "2 ? 5.0 : -1.0, 0.0, 1.0);\n"
                               "}\n";
  static const char fragment[] =
      "in vec3 place;\n"
      "out vec4 colour;\n"
      "void main() { colour = vec4(0.5 + 0.5 * supine_triangle_normal(place), 1.0); }\n";
  const GLuint program = gl->CreateProgram();
  gl->AttachShader(program, make_shader(gl, GL_VERTEX_SHADER, version, "", "", vertex));
  gl->AttachShader(program, make_shader(gl, GL_FRAGMENT_SHADER, version,
                                        "#define SUPINE_FRAGMENT\n", library, fragment));
  gl->LinkProgram(program);
  GLint good = 0;
  gl->GetProgramiv(program, GL_LINK_STATUS, &good);
  assert_true(good);
  return program;
}

/* Assert that the fragment shader computes the normals of the triangles of deformed lungs without
 * stored normals. Colours have steps of 1/255. */
static void check_triangle_normals(const gl_api *gl, const char *version, const char *library) {
  static const double step = 2.0 / 255;
  const GLuint program = make_painting_program(gl, version, library);
  fixture *f = fixture_create_simulated(VERTICES, 21);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_memory(bytes, size, &basis, NULL), SUPINE_OK);
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_state state = {.gravity = {0.6, -0.3, 0.2}, .volume = {SUPINE_VOLUME_SCAN, 20}};
  supine_pose pose;
  float xyz[3 * VERTICES];
  assert_int_equal(supine_basis_pose(basis, &state, &pose, NULL), SUPINE_OK);
  assert_int_equal(supine_deform(basis, &pose, xyz), SUPINE_OK);
  GLuint array = 0;
  gl->GenVertexArrays(1, &array);
  gl->BindVertexArray(array);
  gl->Viewport(0, 0, 1, 1);
  gl->UseProgram(program);
  for (size_t t = 0; t < info->triangle_count && t < 60; ++t) {
    float corner[9];
    unsigned char colour[4];
    for (size_t i = 0; i < 9; ++i) {
      corner[i] = xyz[3 * info->triangles[3 * t + i / 3] + i % 3];
    }
    const double a[3] = {(double)(corner[3] - corner[0]), (double)(corner[4] - corner[1]),
                         (double)(corner[5] - corner[2])};
    const double b[3] = {(double)(corner[6] - corner[0]), (double)(corner[7] - corner[1]),
                         (double)(corner[8] - corner[2])};
    const double n[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                         a[0] * b[1] - a[1] * b[0]};
    const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    gl->Uniform3fv(gl->GetUniformLocation(program, "corner"), 3, corner);
    gl->DrawArrays(GL_TRIANGLES, 0, 3);
    gl->ReadPixels(0, 0, 1, 1, GL_RGBA, GL_UNSIGNED_BYTE, colour);
    assert_int_equal(gl->GetError(), GL_NO_ERROR);
    for (size_t axis = 0; axis < 3; ++axis) {
      assert_true(fabs(step * colour[axis] - 1 - n[axis] / length) <= step);
    }
  }
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

static void check_glsl(EGLenum api, const char *version) {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;
  gl_api gl = {0};
  if (!make_context(api, &display, &context, &gl)) {
    print_message("skipped: EGL has no OpenGL context without a surface\n");
    skip();
    return;
  }
  print_message("%s\n", (const char *)gl.GetString(GL_VERSION));
  make_framebuffer(&gl);
  size_t length = 0;
  unsigned char *library = test_read(SUPINE_GLSL, &length);
  check_triangle_normals(&gl, version, (const char *)library); /* before rasterisation is off */
  static const size_t modes[] = {1, 4, 6, 11, 16};
  for (size_t i = 0; i < sizeof modes / sizeof *modes; ++i) {
    check_modes(&gl, version, (const char *)library, modes[i], false);
    check_modes(&gl, version, (const char *)library, modes[i], true);
  }
  check_simulated(&gl, version, (const char *)library);
  check_clusters(&gl, version, (const char *)library);
  free(library);
  (void)eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  (void)eglDestroyContext(display, context);
  (void)eglTerminate(display);
}

TEST(test_glsl_es300_equals_evaluator) {
  check_glsl(EGL_OPENGL_ES_API, "#version 300 es\nprecision highp float;\n");
}

TEST(test_glsl_330_core_equals_evaluator) {
  check_glsl(EGL_OPENGL_API, "#version 330 core\n");
}
