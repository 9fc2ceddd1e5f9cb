/* SPDX-License-Identifier: MIT */
/* The GPU's part: displacement, projection, light and colour. */
#include "runtime/render/gl.h"
#include "supine_glsl.h" /* supine.glsl as a string, made by the build */

static const char version[] = "#version 300 es\n"
                              "precision highp float;\n";

static const char vertex_main[] =
    "layout(location = 0) in vec3 rest;\n"
    "layout(location = 1) in vec3 direction;\n"
    "layout(location = 2) in vec4 c0;\n"
    "layout(location = 3) in vec4 c1;\n"
    "layout(location = 4) in vec4 c2;\n"
    "layout(location = 5) in vec4 c3;\n"
    "layout(location = 6) in vec3 normal;\n"
    "layout(location = 7) in float value;\n"
    "uniform mat3 view;\n"   /* body axes to right, up, towards the viewer */
    "uniform vec3 centre;\n" /* of the lungs, mm */
    "uniform vec4 frame;\n"  /* x, y: middle of the projected lungs, mm; z, w: mm to the edges */
    "uniform vec2 depth;\n"  /* distance of the viewer; half the depth that is drawn, mm */
    "out vec3 v_normal;\n"
    "out vec3 v_eye;\n"
    "out float v_value;\n"
    "void main() {\n"
    "  vec3 p = view * (supine_displace(rest, direction, c0, c1, c2, c3) - centre);\n"
    "  float w = depth.x - p.z;\n"
    "  float near = depth.x - depth.y;\n"
    "  float far = depth.x + depth.y;\n"
    "  gl_Position = vec4((p.xy * depth.x - frame.xy * w) * frame.zw,\n"
    "                     (w * (far + near) - 2.0 * far * near) / (far - near), w);\n"
    "  v_normal = view * normal;\n"
    "  v_eye = vec3(0.0, 0.0, depth.x) - p;\n"
    "  v_value = value;\n"
    "}\n";

static const char fragment_main[] =
    "in vec3 v_normal;\n"
    "in vec3 v_eye;\n"
    "in float v_value;\n"
    "uniform sampler2D colours;\n"
    "uniform float largest;\n"
    "uniform float line_step;\n"
    "uniform float dark;\n"
    "out vec4 colour;\n"
    "float lambert(vec3 n, vec3 to_light) { return max(dot(n, normalize(to_light)), 0.0); }\n"
    "void main() {\n"
    "  float t = clamp(v_value / largest, 0.0, 1.0);\n"
    "  vec3 base = pow(texture(colours, vec2((t * 255.0 + 0.5) / 256.0, 0.5)).rgb, vec3(2.2));\n"
    "  vec3 n = normalize(v_normal) * (gl_FrontFacing ? 1.0 : -1.0);\n"
    "  vec3 eye = normalize(v_eye);\n"
    "  vec3 key = vec3(-0.55, 0.75, 0.8);\n"
    "  float facing = max(dot(n, eye), 0.0);\n"
    "  float light = 0.46 + 0.14 * n.y + 0.58 * lambert(n, key) +\n"
    "                0.16 * lambert(n, vec3(0.9, -0.1, 0.5));\n"
    "  light *= mix(0.72, 1.0, smoothstep(0.0, 0.45, facing));\n" /* darker towards the outline */
    "  vec3 lit = base * light;\n"
    "  if (line_step > 0.0) {\n"
    "    float steps = v_value / line_step;\n"
    "    float away = abs(fract(steps - 0.5) - 0.5) / max(fwidth(steps), 1e-6);\n"
    "    float line = (1.0 - smoothstep(0.5, 1.7, away)) * step(0.5, steps);\n"
    "    lit = mix(lit, lit * 0.45, 0.4 * line);\n"
    "  }\n"
    "  float shine = pow(lambert(n, normalize(key) + eye), 48.0);\n"
    "  lit += vec3(0.08 * shine);\n"
    "  lit += dark * vec3(0.10, 0.14, 0.20) * pow(1.0 - facing, 3.0);\n"
    "  colour = vec4(pow(clamp(lit, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);\n"
    "}\n";

static GLuint compile(GLenum kind, const char *first, const char *second, supine_error *error) {
  const char *text[3] = {version, first, second};
  GLint good = GL_FALSE;
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 3, text, NULL);
  glCompileShader(shader);
  glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
  if (good != GL_TRUE) {
    char log[256] = "";
    glGetShaderInfoLog(shader, sizeof log, NULL, log);
    (void)supine_error_set(error, SUPINE_ERROR_UNSUPPORTED, "the OpenGL driver refuses: %s", log);
    glDeleteShader(shader);
    return 0;
  }
  return shader;
}

GLuint supine_render_gl_program(supine_error *error) {
  GLint good = GL_FALSE;
  GLuint program = 0;
  const GLuint vertex = compile(GL_VERTEX_SHADER, supine_glsl, vertex_main, error);
  const GLuint fragment = vertex != 0 ? compile(GL_FRAGMENT_SHADER, "", fragment_main, error) : 0;
  if (fragment != 0) {
    program = glCreateProgram();
    glAttachShader(program, vertex);
    glAttachShader(program, fragment);
    glLinkProgram(program);
    glGetProgramiv(program, GL_LINK_STATUS, &good);
    if (good != GL_TRUE) {
      (void)supine_error_set(error, SUPINE_ERROR_UNSUPPORTED, "the OpenGL driver cannot link");
      glDeleteProgram(program);
      program = 0;
    }
  }
  glDeleteShader(vertex); /* 0 is legal; kept while attached */
  glDeleteShader(fragment);
  return program;
}
