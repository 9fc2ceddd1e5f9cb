/* SPDX-License-Identifier: GPL-3.0-or-later */
/* An OpenGL ES 3 context without a window, by EGL. */
#include <string.h>

#include "program/render/gl.h"

enum { DEVICES_MAX = 8 };

/* Makes a context on a display that is not initialised yet. */
static bool try_display(EGLDisplay display, supine_gl_context *context) {
  static const EGLint config_wanted[] = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE,
                                         EGL_OPENGL_ES3_BIT, EGL_NONE};
  static const EGLint context_wanted[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_NONE};
  EGLConfig config;
  EGLint count = 0;
  if (display == EGL_NO_DISPLAY || !eglInitialize(display, NULL, NULL)) {
    return false;
  }
  const supine_gl_context made = {
      .display = display,
      .context = eglBindAPI(EGL_OPENGL_ES_API) &&
                         eglChooseConfig(display, config_wanted, &config, 1, &count) && count > 0
                     ? eglCreateContext(display, config, EGL_NO_CONTEXT, context_wanted)
                     : EGL_NO_CONTEXT};
  if (made.context != EGL_NO_CONTEXT && supine_render_gl_use(&made)) {
    *context = made;
    return true;
  }
  if (made.context != EGL_NO_CONTEXT) {
    (void)eglDestroyContext(display, made.context);
  }
  (void)eglTerminate(display);
  return false;
}

/* Mesa without any display, then each device, then whatever is the default. */
static bool try_all(supine_gl_context *context) {
  const char *extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  const PFNEGLGETPLATFORMDISPLAYEXTPROC get_display =
      (PFNEGLGETPLATFORMDISPLAYEXTPROC)eglGetProcAddress("eglGetPlatformDisplayEXT");
  const PFNEGLQUERYDEVICESEXTPROC query_devices =
      (PFNEGLQUERYDEVICESEXTPROC)eglGetProcAddress("eglQueryDevicesEXT");
  if (extensions != NULL && get_display != NULL) {
    if (strstr(extensions, "EGL_MESA_platform_surfaceless") != NULL &&
        try_display(get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL),
                    context)) {
      return true;
    }
    EGLDeviceEXT device[DEVICES_MAX];
    EGLint count = 0;
    if (strstr(extensions, "EGL_EXT_platform_device") != NULL && query_devices != NULL &&
        query_devices(DEVICES_MAX, device, &count)) {
      for (EGLint i = 0; i < count; ++i) {
        if (try_display(get_display(EGL_PLATFORM_DEVICE_EXT, device[i], NULL), context)) {
          return true;
        }
      }
    }
  }
  return try_display(eglGetDisplay(EGL_DEFAULT_DISPLAY), context);
}

supine_status supine_render_gl_open(supine_gl_context *context, supine_error *error) {
  return try_all(context)
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_UNSUPPORTED,
                                "no OpenGL ES 3 driver works here without a display: install "
                                "Mesa's (Debian: libegl1 libgl1-mesa-dri)");
}

bool supine_render_gl_use(const supine_gl_context *context) {
  return eglMakeCurrent(context->display, EGL_NO_SURFACE, EGL_NO_SURFACE, context->context);
}

void supine_render_gl_close(supine_gl_context *context) {
  if (context->context != EGL_NO_CONTEXT) {
    (void)eglMakeCurrent(context->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    (void)eglDestroyContext(context->display, context->context);
    context->context = EGL_NO_CONTEXT; /* the display is the process's: others may use it */
  }
}
