/* SPDX-License-Identifier: GPL-3.0-or-later */
/* How a command is described: one table of its options, from which come parsing, --help,
 * suggestions, manual pages and completions. A whole command:
 *
 *     typedef struct request { const char *output; size_t vertices; } request;
 *
 *     static const supine_option table[] = {
 *         {"output", 'o', "FILE", "where to write", SUPINE_FILLS(request, output),
 *          .file = SUPINE_FILE_OUT, .required = true},
 *         {"vertices", 0, "N", "about so many", SUPINE_FILLS(request, vertices),
 *          .standard = "20000"},
 *         {.name = NULL}};
 *
 *     static supine_status run(void *request_, const supine_arguments *given, supine_error *error)
 *
 *     const supine_command supine_command_phantom = {
 *         "phantom", "make a pair of lungs", .usage = "-o FILE [OPTIONS]", .about = "Makes ...",
 *         .options = table, .notes = "Example:\n  supine phantom -o lungs.ply\n",
 *         .request_size = sizeof(request), .run = run};
 *
 * Then declare it in command.h and list it in list.c. */
#ifndef SUPINE_OPTION_H
#define SUPINE_OPTION_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <supine/status.h>

/* How a value is read; SUPINE_FILLS takes it from the type of the field. */
typedef enum supine_option_kind {
  SUPINE_OPTION_OWN,     /* by the option's own reader */
  SUPINE_OPTION_FLAG,    /* bool: no value; true where given */
  SUPINE_OPTION_NUMBER,  /* double: a finite number, within the range */
  SUPINE_OPTION_NUMBERS, /* double[n]: as many, separated by commas */
  SUPINE_OPTION_COUNT,   /* size_t: a whole number, within the range */
  SUPINE_OPTION_TEXT,    /* const char *: as it stands; it lives as long as argv */
  SUPINE_OPTION_CHOICE   /* an enum: the position of the word among the choices */
} supine_option_kind;

/* What a file that an option names is to the command. An output is never an input, and is tried
 * before the work begins. */
typedef enum supine_option_file {
  SUPINE_FILE_NONE,
  SUPINE_FILE_IN,
  SUPINE_FILE_OUT
} supine_option_file;

/* Read `text` into `field`, the option's field; for an option without one, the struct that its
 * table fills.
 * @retval SUPINE_ERROR_ARGUMENT  without a message for "--NAME takes WANTS, not 'TEXT'"; with one
 *                                for "--NAME: MESSAGE" */
typedef supine_status supine_option_reader(const char *text, void *field, supine_error *error);
static inline supine_status supine_options_fits(bool fits) {
  return fits ? SUPINE_OK : SUPINE_ERROR_ARGUMENT;
}

/* One row: an option, words between options, or another table. The last row is all zero. */
typedef struct supine_option {
  const char *name;     /* long name; NULL: words or a table */
  char letter;          /* short name, or 0 */
  const char *argument; /* its value's name in the help; NULL: none follows */
  const char *help;     /* wrapped to the terminal; "\n" begins a line. Without a name: words */
  supine_option_kind kind;
  size_t offset, size; /* of the field */
  size_t given;        /* 1 + offset of a bool that says whether it was given; 0: none */
  supine_option_reader *read;
  const char *standard; /* default, read like a value, told in the help; NULL: the field's zero */
  double range[2];      /* range of numbers and counts; both 0: any */
  bool open;            /* the range's ends are outside it */
  const char *wants;    /* "millilitres": for messages; NULL: from the kind and the range */
  const char *const *choices; /* ends with NULL; for completion where there is a reader */
  const char *alias;          /* another long name, not shown */
  const char *rivals;         /* at most one of the options with the same word may be given, once */
  bool required;
  bool more; /* shown by --help-all, not by --help */
  supine_option_file file;
  const char *endings;               /* that a file's name must have one of: ".ply, .obj or .stl" */
  const struct supine_option *table; /* a shared table; its fields count from `offset` */
} supine_option;

#define SUPINE_FILLS(type, member)                                                                 \
  .kind = _Generic(((type *)0)->member, bool                                                       \
                   : SUPINE_OPTION_FLAG, double                                                    \
                   : SUPINE_OPTION_NUMBER, double *                                                \
                   : SUPINE_OPTION_NUMBERS, size_t                                                 \
                   : SUPINE_OPTION_COUNT, const char *                                             \
                   : SUPINE_OPTION_TEXT, int                                                       \
                   : SUPINE_OPTION_CHOICE, unsigned                                                \
                   : SUPINE_OPTION_CHOICE, default                                                 \
                   : SUPINE_OPTION_OWN),                                                           \
  .offset = offsetof(type, member), .size = sizeof(((type *)0)->member)
#define SUPINE_SAYS_GIVEN(type, member) .given = (1 + offsetof(type, member))
#define SUPINE_ABOVE_ZERO .range = {0.0, INFINITY}, .open = true

/* What a command runs on, beside its request. */
typedef struct supine_arguments {
  char **operand; /* operands, in order */
  size_t count;
  const char *made_by; /* the command line, for the metadata of a file */
} supine_arguments;

typedef struct supine_command {
  const char *name;
  const char *summary; /* a few words, for the list of commands */
  const char *usage;   /* what follows "supine NAME "; further lines after "\n" */
  const char *about;   /* what it does; wrapped, lines that begin with a space are kept */
  const supine_option *options;
  const char *notes; /* after the options, examples last; as `about` */
  size_t operands_least, operands_most;
  const char *operands_missing; /* the message where there are fewer or more */
  size_t request_size;
  void (*begin)(void *request); /* sets what defaults cannot say; NULL: all zero */
  supine_status (*run)(void *request, const supine_arguments *given, supine_error *error);
} supine_command;

/* For commands that read surfaces, and those that read one basis. */
#define SUPINE_SURFACES                                                                            \
  .operands_least = 1, .operands_most = SIZE_MAX,                                                  \
  .operands_missing = "which surface? Name one or more mesh files"
#define SUPINE_ONE_BASIS                                                                           \
  .operands_least = 1, .operands_most = 1,                                                         \
  .operands_missing = "name one basis file (made by 'supine precompute')"

/* Read the options into a request and run the command on it; return an exit code. argv[0] is the
 * command's name. */
int supine_options_run(const supine_command *command, int argc, char **argv);

/* Refuse an output that is an input, also by link (SUPINE_ERROR_ARGUMENT). For inputs that other
 * inputs name: those of the command line are checked already. */
supine_status supine_options_check_output(const char *output, const char *input,
                                          supine_error *error);

/* Call `each` for every row of a table and of the tables in it, in order; `base` is the offset of
 * the row's struct in the request. */
typedef void supine_option_visit(void *context, const supine_option *option, size_t base);
void supine_options_visit(const supine_option *options, size_t base, supine_option_visit *each,
                          void *context);

/* Print the help of a command: every option for --help-all, else those without `more`. */
void supine_options_print_help(const supine_command *command, bool all, FILE *file);

#endif
