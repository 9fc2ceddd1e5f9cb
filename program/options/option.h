/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Declare a command and the table of its options. Parsing, --help, suggestions, manual pages and
 * completions all use the table. command_phantom.c is a short example. A new command is declared in
 * command.h and listed in list.c. */
#ifndef SUPINE_OPTION_H
#define SUPINE_OPTION_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <supine/status.h>

#include "base/quantity.h"

/* Type of an option's value; SUPINE_FILLS derives it from the C type of the member that the option
 * sets. */
typedef enum supine_option_kind {
  SUPINE_OPTION_OWN,     /* any other type, for which the option must set `read` */
  SUPINE_OPTION_FLAG,    /* bool, without a value: true if the option is given */
  SUPINE_OPTION_NUMBER,  /* double: a finite number within the option's `range`, with a unit */
  SUPINE_OPTION_NUMBERS, /* double[n]: n numbers separated by commas */
  SUPINE_OPTION_COUNT,   /* size_t: a whole number within the option's `range` */
  SUPINE_OPTION_TEXT,    /* const char *: the argument itself, which lives as long as argv */
  SUPINE_OPTION_CHOICE   /* enum: the index of the word among the choices */
} supine_option_kind;

/* Role of a file that an option names. Before the command runs, each output is checked: it must be
 * writable and must not be an input. */
typedef enum supine_option_file {
  SUPINE_FILE_NONE,
  SUPINE_FILE_IN,
  SUPINE_FILE_OUT
} supine_option_file;

/* Read `text` into `field`. This is the member named by SUPINE_FILLS or, if the option names no
 * member, the whole struct that receives the option values of its table.
 * @retval SUPINE_ERROR_ARGUMENT  the text is invalid. The user sees "--NAME: MESSAGE" or, if the
 *   message is empty, "--NAME takes WANTS, not 'TEXT'", where WANTS describes valid values */
typedef supine_status supine_option_reader(const char *text, void *field, supine_error *error);
static inline supine_status supine_options_fits(bool fits) {
  return fits ? SUPINE_OK : SUPINE_ERROR_ARGUMENT;
}

/* Row of an option table: an option, a heading, or another table to include. A row of zeros ends
 * the table. */
typedef struct supine_option {
  const char *name;     /* long name; NULL in a row that is a heading or includes another table */
  char letter;          /* short name, or 0 */
  const char *argument; /* name of the value in the help; NULL if there is no value */
  const char *help;     /* description of the option, or text of the heading; "\n" begins a line */
  supine_option_kind kind;
  size_t offset, size; /* offset and size of the struct member that the option sets, bytes */
  size_t given;        /* 1 + offset of a bool member that is set if the option is given; 0: none */
  supine_option_reader *read;
  const char *standard;     /* default, as the user would write it; NULL if none */
  double range[2];          /* limits of numbers and counts; {0, 0} if there are none */
  bool open;                /* true if values equal to a limit are invalid */
  supine_quantity quantity; /* what a number measures; its unit is that of the quantity */
  const char *wants;        /* description of valid values; NULL to derive it from kind and range */
  const char *const *choices; /* valid words, then NULL; if `read` is set, for completion only */
  const char *rivals;         /* name of a group of which the user may give one option, once */
  const char *partners; /* names of the only options that may be given with this one; NULL: any */
  bool alone;           /* given without operands and without required options */
  bool repeats;         /* may be given several times; any other option with a value only once */
  bool required;
  bool more; /* shown by --help-all only */
  supine_option_file file;
  const char *endings; /* valid endings of the file name, such as ".ply, .obj or .stl" */
  /* A table whose options this row includes. They fill the struct at `offset`. */
  const struct supine_option *table;
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
#define SUPINE_MEASURES(quantity_) .quantity = SUPINE_QUANTITY_##quantity_

/* Operands of a command, and the command line. */
typedef struct supine_arguments {
  char **operand; /* [count] in the order given */
  size_t count;
  const char *made_by; /* the command line, for the metadata of a file */
} supine_arguments;

typedef struct supine_command {
  const char *name;
  const char *summary; /* a few words, for the list of commands */
  const char *usage;   /* text after "supine NAME "; one usage per line */
  const char *about;   /* purpose; lines are wrapped unless they begin with a space */
  const supine_option *options;
  const char *notes; /* text below the options, examples last; wrapped like `about` */
  size_t operands_least, operands_most;
  const char *operands_missing; /* message if the number of operands is wrong */
  size_t request_size;
  bool uses_blas;               /* the command calls OpenBLAS, in as many threads as it starts */
  void (*begin)(void *request); /* sets defaults other than supine_option.standard; may be NULL */
  supine_status (*run)(void *request, const supine_arguments *given, supine_error *error);
} supine_command;

/* Operands of commands that read surfaces, and of commands that read one basis. */
#define SUPINE_SURFACES                                                                            \
  .operands_least = 1, .operands_most = SIZE_MAX, .operands_missing = "name one or more mesh files"
#define SUPINE_ONE_BASIS                                                                           \
  .operands_least = 1, .operands_most = 1,                                                         \
  .operands_missing = "name one basis file (made by 'supine precompute')"

/* Read the options and run the command; return an exit code. argv[0] names the command. */
int supine_options_run(const supine_command *command, int argc, char **argv);

/* Return SUPINE_ERROR_ARGUMENT if an output is the same file as an input. Commands call this for
 * inputs that are named in a list file or inside an option's value. All other inputs are checked
 * before the command runs. */
supine_status supine_options_check_output(const char *output, const char *input,
                                          supine_error *error);

/* Receive one option or heading of a table. The table fills a struct inside the command's struct of
 * all options, or the struct of the options of all commands behind it; `base` is its offset there,
 * bytes. */
typedef void supine_option_visit(void *context, const supine_option *option, size_t base);
/* Call `each` for the options and headings of a command, and of the tables that these include, and
 * for the options that all commands have. */
void supine_options_visit(const supine_command *command, supine_option_visit *each, void *context);

/* Print the help of a command. Unless `all` is true, omit options whose field `more` is true. */
void supine_options_print_help(const supine_command *command, bool all, FILE *file);

#endif
