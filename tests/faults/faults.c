/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Preload this library to make one allocation of a program fail, or one call that opens, reads,
 * writes or renames a file. Only calls by the program's own code and by the libraries in
 * FAULT_ALSO are counted.
 *
 *     FAULT_KIND    "memory" or "file"
 *     FAULT_NTH     number of the call that fails, from 0; if unset, no call fails
 *     FAULT_ALSO    libraries, each by a part of the file name, such as gsl,jansson
 *     FAULT_REPORT  file to write at exit, with three numbers: counted calls, failed calls, and
 *                   blocks allocated by counted calls but not freed */
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

enum { RANGES = 64, BLOCKS = 1 << 21, STATIC_MEMORY = 1 << 16 };

typedef enum { NOTHING, MEMORY, FILES } fault_kind;

static struct { uintptr_t begin, end; } ranges[RANGES];
static size_t range_count;
static fault_kind kind;
static long nth = -1;
static long seen, failed;
static pid_t process;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

/* Addresses of blocks that counted calls allocated and that are not freed. This is a hash table
 * with open addressing; 1 marks a freed entry. */
static uintptr_t blocks[BLOCKS];
static long live;

/* Functions of the C library, looked up once by dlsym. dlsym itself may allocate memory; it gets a
 * part of `static_memory`, which is never freed. */
static void *(*next_malloc)(size_t);
static void *(*next_calloc)(size_t, size_t);
static void *(*next_realloc)(void *, size_t);
static void *(*next_aligned_alloc)(size_t, size_t);
static int (*next_posix_memalign)(void **, size_t, size_t);
static void (*next_free)(void *);
static _Alignas(64) char static_memory[STATIC_MEMORY];
static size_t static_memory_used;

static void *static_memory_take(size_t size) {
  void *taken = static_memory + static_memory_used;
  static_memory_used += (size + 63) / 64 * 64;
  return static_memory_used <= STATIC_MEMORY ? taken : NULL;
}

static bool is_static_memory(const void *pointer) {
  return (const char *)pointer >= static_memory &&
         (const char *)pointer < static_memory + STATIC_MEMORY;
}

static int note_object(struct dl_phdr_info *info, size_t size, void *context) {
  (void)size;
  const char *also = context;
  bool counts = info->dlpi_name[0] == '\0'; /* only the program itself has an empty name */
  for (const char *at = also; !counts && at != NULL && *at != '\0';) {
    char part[64] = "";
    const size_t length = strcspn(at, ",");
    (void)snprintf(part, sizeof part, "%.*s", (int)length, at);
    counts = length > 0 && strstr(info->dlpi_name, part) != NULL;
    at += length + (at[length] == ',' ? 1 : 0);
  }
  for (int i = 0; counts && i < info->dlpi_phnum && range_count < RANGES; ++i) {
    const ElfW(Phdr) *part = &info->dlpi_phdr[i];
    if (part->p_type == PT_LOAD && (part->p_flags & PF_X) != 0) {
      ranges[range_count].begin = info->dlpi_addr + part->p_vaddr;
      ranges[range_count++].end = info->dlpi_addr + part->p_vaddr + part->p_memsz;
    }
  }
  return 0;
}

static bool is_own(const void *caller) {
  for (size_t i = 0; i < range_count; ++i) {
    if ((uintptr_t)caller >= ranges[i].begin && (uintptr_t)caller < ranges[i].end) {
      return true;
    }
  }
  return false;
}

static bool fails(fault_kind what, const void *caller, int code) {
  if (kind != what || getpid() != process || !is_own(caller)) {
    return false;
  }
  const bool now = __atomic_fetch_add(&seen, 1, __ATOMIC_SEQ_CST) == nth;
  if (now) {
    ++failed;
    errno = code;
  }
  return now;
}

static size_t slot_of(uintptr_t key) {
  return (size_t)((key >> 4) * 0x9E3779B97F4A7C15u >> 32) % BLOCKS;
}

static void *taken(void *pointer, const void *caller) {
  if (pointer != NULL && kind != NOTHING && is_own(caller)) {
    (void)pthread_mutex_lock(&lock);
    size_t at = slot_of((uintptr_t)pointer);
    while (blocks[at] > 1) {
      at = (at + 1) % BLOCKS;
    }
    blocks[at] = (uintptr_t)pointer;
    ++live;
    (void)pthread_mutex_unlock(&lock);
  }
  return pointer;
}

static void given(const void *pointer) {
  if (pointer == NULL || kind == NOTHING) {
    return;
  }
  (void)pthread_mutex_lock(&lock);
  for (size_t at = slot_of((uintptr_t)pointer); blocks[at] != 0; at = (at + 1) % BLOCKS) {
    if (blocks[at] == (uintptr_t)pointer) {
      blocks[at] = 1;
      --live;
      break;
    }
  }
  (void)pthread_mutex_unlock(&lock);
}

__attribute__((constructor)) static void begin(void) {
  const char *what = getenv("FAULT_KIND");
  const char *number = getenv("FAULT_NTH");
  (void)dl_iterate_phdr(note_object, getenv("FAULT_ALSO"));
  process = getpid();
  nth = number != NULL ? strtol(number, NULL, 10) : -1;
  kind = what == NULL ? NOTHING : strcmp(what, "memory") == 0 ? MEMORY : FILES;
}

__attribute__((destructor)) static void end(void) {
  const char *path = getenv("FAULT_REPORT");
  if (path == NULL || getpid() != process) {
    return;
  }
  kind = NOTHING;
  char text[96];
  const int length = snprintf(text, sizeof text, "%ld %ld %ld\n", seen, failed, live);
  const int file = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (file >= 0) {
    (void)!write(file, text, (size_t)length);
    (void)close(file);
  }
}

/* ISO C cannot cast the result of dlsym to a function pointer. */
#define FIND(function, name) *(void **)&(function) = dlsym(RTLD_NEXT, name)
#define CALLER __builtin_return_address(0)

static void find_memory(void) {
  static bool finding;
  if (next_free == NULL && !finding) {
    finding = true;
    FIND(next_malloc, "malloc");
    FIND(next_calloc, "calloc");
    FIND(next_realloc, "realloc");
    FIND(next_aligned_alloc, "aligned_alloc");
    FIND(next_posix_memalign, "posix_memalign");
    FIND(next_free, "free");
  }
}

void *malloc(size_t size) {
  find_memory();
  if (next_malloc == NULL) {
    return static_memory_take(size);
  }
  return fails(MEMORY, CALLER, ENOMEM) ? NULL : taken(next_malloc(size), CALLER);
}

void *calloc(size_t count, size_t size) {
  find_memory();
  if (next_calloc == NULL) {
    return static_memory_take(count * size); /* static memory is zero */
  }
  return fails(MEMORY, CALLER, ENOMEM) ? NULL : taken(next_calloc(count, size), CALLER);
}

void *realloc(void *old, size_t size) {
  find_memory();
  if (fails(MEMORY, CALLER, ENOMEM)) {
    return NULL;
  }
  given(old);
  return taken(next_realloc(old, size), CALLER);
}

void *aligned_alloc(size_t alignment, size_t size) {
  find_memory();
  return fails(MEMORY, CALLER, ENOMEM) ? NULL : taken(next_aligned_alloc(alignment, size), CALLER);
}

void *reallocarray(void *old, size_t count, size_t size) {
  size_t bytes = 0;
  find_memory();
  if (__builtin_mul_overflow(count, size, &bytes) || fails(MEMORY, CALLER, ENOMEM)) {
    errno = ENOMEM;
    return NULL;
  }
  given(old);
  return taken(next_realloc(old, bytes), CALLER);
}

int posix_memalign(void **pointer, size_t alignment, size_t size) {
  find_memory();
  if (fails(MEMORY, CALLER, ENOMEM)) {
    return ENOMEM;
  }
  const int code = next_posix_memalign(pointer, alignment, size);
  if (code == 0) {
    (void)taken(*pointer, CALLER);
  }
  return code;
}

void free(void *pointer) {
  find_memory();
  if (is_static_memory(pointer)) {
    return;
  }
  given(pointer);
  next_free(pointer);
}

/* Replace functions of the C library that return newly allocated memory. */
char *strdup(const char *text) {
  const size_t size = strlen(text) + 1;
  find_memory();
  char *copy = fails(MEMORY, CALLER, ENOMEM) ? NULL : taken(next_malloc(size), CALLER);
  return copy != NULL ? memcpy(copy, text, size) : NULL;
}

char *strndup(const char *text, size_t most) {
  const size_t length = strnlen(text, most);
  find_memory();
  char *copy = fails(MEMORY, CALLER, ENOMEM) ? NULL : taken(next_malloc(length + 1), CALLER);
  if (copy != NULL) {
    memcpy(copy, text, length);
    copy[length] = '\0';
  }
  return copy;
}

int vasprintf(char **text, const char *format, va_list values) {
  va_list again;
  va_copy(again, values);
  const int length = vsnprintf(NULL, 0, format, again);
  va_end(again);
  find_memory();
  *text = length < 0 || fails(MEMORY, CALLER, ENOMEM)
              ? NULL
              : taken(next_malloc((size_t)length + 1), CALLER);
  return *text != NULL ? vsnprintf(*text, (size_t)length + 1, format, values) : -1;
}

int asprintf(char **text, const char *format, ...) {
  va_list values;
  va_start(values, format);
  const int length = vsnprintf(NULL, 0, format, values);
  va_end(values);
  find_memory();
  *text = length < 0 || fails(MEMORY, CALLER, ENOMEM)
              ? NULL
              : taken(next_malloc((size_t)length + 1), CALLER);
  va_start(values, format);
  const int made = *text != NULL ? vsnprintf(*text, (size_t)length + 1, format, values) : -1;
  va_end(values);
  return made;
}

#define NEXT(name, result, ...)                                                                    \
  static result (*next)(__VA_ARGS__);                                                              \
  if (next == NULL) {                                                                              \
    FIND(next, name);                                                                              \
  }

FILE *fopen(const char *path, const char *mode) {
  NEXT("fopen", FILE *, const char *, const char *)
  return fails(kind == MEMORY ? MEMORY : FILES, CALLER, kind == MEMORY ? ENOMEM : EMFILE)
             ? NULL
             : next(path, mode);
}

FILE *fdopen(int file, const char *mode) {
  NEXT("fdopen", FILE *, int, const char *)
  return fails(kind == MEMORY ? MEMORY : FILES, CALLER, kind == MEMORY ? ENOMEM : EMFILE)
             ? NULL
             : next(file, mode);
}

FILE *fopencookie(void *cookie, const char *mode, cookie_io_functions_t functions) {
  NEXT("fopencookie", FILE *, void *, const char *, cookie_io_functions_t)
  return fails(MEMORY, CALLER, ENOMEM) ? NULL : next(cookie, mode, functions);
}

FILE *open_memstream(char **text, size_t *size) {
  NEXT("open_memstream", FILE *, char **, size_t *)
  return fails(MEMORY, CALLER, ENOMEM) ? NULL : next(text, size);
}

int open(const char *path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const mode_t mode = va_arg(more, mode_t);
  va_end(more);
  NEXT("open", int, const char *, int, ...)
  return fails(FILES, CALLER, EMFILE) ? -1 : next(path, flags, mode);
}

ssize_t write(int file, const void *bytes, size_t size) {
  NEXT("write", ssize_t, int, const void *, size_t)
  return fails(FILES, CALLER, ENOSPC) ? -1 : next(file, bytes, size);
}

ssize_t read(int file, void *bytes, size_t size) {
  NEXT("read", ssize_t, int, void *, size_t)
  return fails(FILES, CALLER, EIO) ? -1 : next(file, bytes, size);
}

void *mmap(void *at, size_t size, int rights, int flags, int file, off_t offset) {
  NEXT("mmap", void *, void *, size_t, int, int, int, off_t)
  return fails(kind == MEMORY ? MEMORY : FILES, CALLER, ENOMEM)
             ? (void *)-1
             : next(at, size, rights, flags, file, offset);
}

ssize_t pread(int file, void *bytes, size_t size, off_t offset) {
  NEXT("pread", ssize_t, int, void *, size_t, off_t)
  return fails(FILES, CALLER, EIO) ? -1 : next(file, bytes, size, offset);
}

FILE *freopen(const char *path, const char *mode, FILE *stream) {
  NEXT("freopen", FILE *, const char *, const char *, FILE *)
  return fails(FILES, CALLER, EMFILE) ? NULL : next(path, mode, stream);
}

char *mkdtemp(char *pattern) {
  NEXT("mkdtemp", char *, char *)
  return fails(FILES, CALLER, ENOSPC) ? NULL : next(pattern);
}

DIR *opendir(const char *path) {
  NEXT("opendir", DIR *, const char *)
  return fails(kind == MEMORY ? MEMORY : FILES, CALLER, kind == MEMORY ? ENOMEM : EMFILE)
             ? NULL
             : next(path);
}

pid_t fork(void) {
  NEXT("fork", pid_t, void)
  return fails(kind == MEMORY ? MEMORY : FILES, CALLER, kind == MEMORY ? ENOMEM : EAGAIN) ? -1
                                                                                          : next();
}

int fsync(int file) {
  NEXT("fsync", int, int)
  return fails(FILES, CALLER, EIO) ? -1 : next(file);
}

int rename(const char *from, const char *to) {
  NEXT("rename", int, const char *, const char *)
  return fails(FILES, CALLER, ENOSPC) ? -1 : next(from, to);
}

int renameat2(int from_folder, const char *from, int to_folder, const char *to, unsigned flags) {
  NEXT("renameat2", int, int, const char *, int, const char *, unsigned)
  return fails(FILES, CALLER, ENOSPC) ? -1 : next(from_folder, from, to_folder, to, flags);
}

int mkdir(const char *path, mode_t mode) {
  NEXT("mkdir", int, const char *, mode_t)
  return fails(FILES, CALLER, ENOSPC) ? -1 : next(path, mode);
}

int ftruncate(int file, off_t size) {
  NEXT("ftruncate", int, int, off_t)
  return fails(FILES, CALLER, ENOSPC) ? -1 : next(file, size);
}

int fstat(int file, struct stat *found) {
  NEXT("fstat", int, int, struct stat *)
  return fails(FILES, CALLER, EIO) ? -1 : next(file, found);
}
