/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Shade the lungs and what is inside them. The page's shader surface.frag.glsl draws the same
 * shell. */
#include <math.h>

#include "program/view/render/canvas.h"

static const float gamma_exponent = 2.2F;

/* Colours, sRGB, 0 to 1. */
static const float pink[3] = {0.92F, 0.66F, 0.62F};        /* of the shell where it faces the eye */
static const float nearly_white[3] = {1.0F, 0.95F, 0.93F}; /* of its rim */
static const float white[3] = {1.0F, 1.0F, 1.0F};
static const float slate[3] = {0.36F, 0.46F, 0.58F};

static float smoothstep(float low, float high, float x) {
  const float t = fminf(1.0F, fmaxf(0.0F, (x - low) / (high - low)));
  return t * t * (3.0F - 2.0F * t);
}

static float dot(const float a[3], const float b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Return the diffuse light, 0 to 1, on a surface with unit normal `n` from the direction `from`, a
 * vector of any length. */
static float lambert(const float n[3], const float from[3]) {
  return fmaxf(0.0F, dot(n, from) / sqrtf(dot(from, from)));
}

/* Return the highlight, 0 to 1, of light from the direction `key`. */
static float highlight(const fragment *at, const float key[3], float sharpness) {
  const float length = sqrtf(dot(key, key));
  float half[3];
  for (int k = 0; k < 3; ++k) {
    half[k] = key[k] / length + at->eye[k];
  }
  return powf(lambert(at->normal, half), sharpness);
}

static void split(uint32_t colour, float rgb[3]) {
  for (int k = 0; k < 3; ++k) {
    rgb[k] = (float)(colour >> (16 - 8 * k) & 255U) / 255.0F;
  }
}

void supine_render_shades(const supine_scene *scene, shades *made) {
  made->largest = (float)scene->largest;
  for (size_t i = 0; i < 2; ++i) {
    split(supine_render_palette(SUPINE_PALETTE_TARGETS, i), made->target[i]);
  }
  for (size_t i = 0; i < SUPINE_RENDER_TINTS; ++i) {
    split(supine_render_palette(SUPINE_PALETTE_ANATOMY, i), made->tint[i]);
  }
  for (int i = 0; i <= SHADES; ++i) {
    const float share = (float)i / SHADES;
    double rgb[3];
    supine_render_colour(scene->colours, (double)share, rgb);
    for (int k = 0; k < 3; ++k) {
      made->colours[i][k] = powf((float)rgb[k], gamma_exponent);
    }
    made->encode[i] = powf(share, 1.0F / gamma_exponent);
  }
}

static void shade_map(const shades *tables, const fragment *at, float rgba[4]) {
  static const float key[3] = {-0.55F, 0.75F, 0.8F};
  static const float fill[3] = {0.9F, -0.1F, 0.5F};
  const float *n = at->normal;
  const float facing = fmaxf(0.0F, dot(n, at->eye));
  float light = 0.46F + 0.14F * n[1] + 0.58F * lambert(n, key) + 0.16F * lambert(n, fill);
  light *= 0.72F + 0.28F * smoothstep(0.0F, 0.45F, facing); /* darken the outline */
  light *= 1.0F - 0.275F * at->contour;
  const float shine = 0.08F * highlight(at, key, 48.0F);
  const float t = fminf(1.0F, fmaxf(0.0F, at->value / tables->largest));
  const float *base = tables->colours[(size_t)lrintf(t * SHADES)];
  for (int k = 0; k < 3; ++k) {
    const float lit = base[k] * light + shine;
    rgba[k] = tables->encode[(size_t)lrintf(fminf(1.0F, fmaxf(0.0F, lit)) * SHADES)];
  }
  rgba[3] = 1.0F;
}

/* The shell is clear where it faces the viewer and bright where it turns away, so that content is
 * seen through it and its folds are seen. It is darker towards gravity, where lungs are denser. */
static void shade_shell(const fragment *at, float rgba[4]) {
  const float f = 1.0F - fminf(1.0F, fmaxf(0.0F, dot(at->normal, at->eye)));
  const float light = 0.55F + 0.45F * at->height;
  rgba[3] = 0.10F + 0.75F * powf(f, 2.2F);
  for (int k = 0; k < 3; ++k) {
    rgba[k] = rgba[3] * light * (pink[k] + f * (nearly_white[k] - pink[k]));
  }
}

/* Draw anatomy as the lungs, but in a colour of its own. */
static void shade_anatomy(const shades *tables, const fragment *at, float rgba[4]) {
  const float *tint = tables->tint[at->tint % SUPINE_RENDER_TINTS];
  const float f = 1.0F - fminf(1.0F, fmaxf(0.0F, dot(at->normal, at->eye)));
  rgba[3] = 0.22F + 0.58F * f * f;
  for (int k = 0; k < 3; ++k) {
    rgba[k] = rgba[3] * (tint[k] + 0.25F * f * (1.0F - tint[k]));
  }
}

static void shade_body(const fragment *at, float rgba[4]) {
  const float f = 1.0F - fminf(1.0F, fmaxf(0.0F, dot(at->normal, at->eye)));
  rgba[3] = 0.14F + 0.34F * f;
  for (int k = 0; k < 3; ++k) {
    rgba[k] = rgba[3] * slate[k];
  }
}

static void shade_ghost(const fragment *at, float rgba[4]) {
  const float f = 1.0F - fminf(1.0F, fmaxf(0.0F, dot(at->normal, at->eye)));
  rgba[3] = 0.30F + 0.60F * f * f;
  for (int k = 0; k < 3; ++k) {
    rgba[k] = rgba[3] * white[k];
  }
}

static void shade_solid(const fragment *at, const float base[3], float rgba[4]) {
  static const float key[3] = {-0.5F, 0.8F, 0.9F};
  const float light = 0.58F + 0.46F * lambert(at->normal, key);
  const float shine = 0.25F * highlight(at, key, 30.0F);
  for (int k = 0; k < 3; ++k) {
    rgba[k] = fminf(1.0F, base[k] * light + shine);
  }
  rgba[3] = 1.0F;
}

void supine_render_shade(const shades *tables, material what, const fragment *at, float rgba[4]) {
  switch (what) {
  case MATERIAL_MAP:
    shade_map(tables, at, rgba);
    break;
  case MATERIAL_SHELL:
    shade_shell(at, rgba);
    break;
  case MATERIAL_GHOST:
    shade_ghost(at, rgba);
    break;
  case MATERIAL_TARGET:
    shade_solid(at, tables->target[0], rgba);
    break;
  case MATERIAL_SELECTED:
    shade_solid(at, tables->target[1], rgba);
    break;
  case MATERIAL_ANATOMY:
    shade_anatomy(tables, at, rgba);
    break;
  case MATERIAL_DOT:
    shade_solid(at, tables->tint[at->tint % SUPINE_RENDER_TINTS], rgba);
    break;
  case MATERIAL_BODY:
    shade_body(at, rgba);
    break;
  }
}
