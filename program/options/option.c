/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read the command line with the table of a command's options, and run the command. */
#include <getopt.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <supine/version.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/blas.h"
#include "base/number.h"
#include "base/output.h"
#include "base/parallel.h"
#include "base/text.h"

#include "program/options/command.h"

/* getopt() returns FIRST_LONG + i for the long option of rows[i]. */
enum { ROWS_MAX = 64, HELP_ALL = 256, FIRST_LONG };

typedef struct row {
  const supine_option *option;
  char *filled; /* struct that receives the value of the option */
  bool given;
  const char *value;
} row;

typedef struct reading {
  const supine_command *command;
  char *request;
  size_t count;
  row rows[ROWS_MAX];
  char standard_output[16]; /* the output name "-" with an ending, such as "-.ply" */
  int help;                 /* 'h' or HELP_ALL to print help; 0 to run the command */
} reading;

static void collect(void *context, const supine_option *option, size_t base) {
  reading *r = context;
  if (option->name != NULL && r->count < ROWS_MAX) {
    r->rows[r->count++] = (row){.option = option, .filled = r->request + base};
  }
}

/* Return whether a number is in the range of an option; 0 to 0 stands for any. */
static bool within(const supine_option *option, double number) {
  const double low = option->range[0];
  const double high = option->range[1];
  if (low == 0.0 && high == 0.0) {
    return true;
  }
  return option->open ? number > low && number < high : number >= low && number <= high;
}

static supine_status read_choice(const supine_option *option, const char *text, unsigned *choice) {
  for (unsigned i = 0; option->choices[i] != NULL; ++i) {
    if (supine_ascii_same(option->choices[i], text)) {
      *choice = i;
      return SUPINE_OK;
    }
  }
  return SUPINE_ERROR_ARGUMENT;
}

/* Read the value of an option into `field`. Statuses as supine_option_reader. */
static supine_status read_value(const supine_option *option, const char *text, void *field,
                                supine_error *error) {
  if (option->read != NULL) {
    return option->read(text, field, error);
  }
  switch (option->kind) {
  case SUPINE_OPTION_FLAG:
    *(bool *)field = true;
    return SUPINE_OK;
  case SUPINE_OPTION_NUMBER:
    SUPINE_TRY(supine_quantity_parse(text, option->quantity, 1, field, error));
    return supine_options_fits(within(option, *(double *)field));
  case SUPINE_OPTION_NUMBERS:
    return supine_quantity_parse(text, option->quantity, option->size / sizeof(double), field,
                                 error);
  case SUPINE_OPTION_COUNT:
    return supine_options_fits(supine_options_parse_count(text, field) &&
                               within(option, (double)*(size_t *)field));
  case SUPINE_OPTION_TEXT:
    *(const char **)field = text;
    return SUPINE_OK;
  case SUPINE_OPTION_CHOICE:
    return read_choice(option, text, field);
  case SUPINE_OPTION_OWN:
    break;
  }
  return SUPINE_ERROR_ARGUMENT;
}

static void describe_valid_values(const supine_option *option, char *text, size_t size) {
  if (option->wants != NULL) {
    (void)snprintf(text, size, "%s", option->wants);
  } else if (option->choices != NULL) {
    (void)snprintf(text, size, "%s", option->choices[0]);
    for (size_t i = 1; option->choices[i] != NULL; ++i) {
      const char *before = option->choices[i + 1] == NULL ? " or " : ", ";
      supine_text_add(text, size, "%s%s", before, option->choices[i]);
    }
  } else if (option->range[1] > 0.0 && !option->open) {
    const char *units = supine_quantity_units(option->quantity);
    (void)supine_print_text(text, size, "%g to %g%s%.*s", option->range[0], option->range[1],
                            units[0] != '\0' ? " " : "", (int)strcspn(units, ", "), units);
  } else if (option->quantity != SUPINE_QUANTITY_NUMBER) {
    (void)snprintf(text, size, "a number%s, in %s", option->open ? " above 0" : "",
                   supine_quantity_units(option->quantity));
  } else {
    const char *wants = option->open ? "a number above 0" : "a number";
    if (option->kind == SUPINE_OPTION_COUNT) {
      wants = "a whole number";
    } else if (option->kind == SUPINE_OPTION_NUMBERS) {
      wants = "numbers separated by commas";
    }
    (void)snprintf(text, size, "%s", wants);
  }
}

static supine_status read_row(const row *target, const char *text, supine_error *error) {
  const supine_option *option = target->option;
  supine_error reason = {.message = ""};
  const supine_status status = read_value(option, text, target->filled + option->offset, &reason);
  if (status == SUPINE_ERROR_ARGUMENT && reason.message[0] == '\0') {
    char wanted[384];
    describe_valid_values(option, wanted, sizeof wanted);
    return supine_error_set(error, status, "--%s takes %s, not '%s'", option->name, wanted, text);
  }
  if (status == SUPINE_ERROR_ARGUMENT) {
    return supine_error_wrap(error, &reason, "--%s: ", option->name);
  }
  return status != SUPINE_OK ? supine_error_wrap(error, &reason, "%s", "") : SUPINE_OK;
}

static supine_status read_given(reading *r, row *target, const char *text, supine_error *error) {
  const supine_option *option = target->option;
  if (option->file == SUPINE_FILE_OUT && option->endings != NULL && strcmp(text, "-") == 0) {
    (void)snprintf(r->standard_output, sizeof r->standard_output, "-%.*s",
                   (int)strcspn(option->endings, ", "), option->endings);
    text = r->standard_output;
  }
  SUPINE_REFUSE_IF(target->given && option->argument != NULL && !option->repeats, error,
                   SUPINE_ERROR_ARGUMENT, "give --%s once", option->name);
  if (option->rivals != NULL) {
    for (size_t i = 0; i < r->count; ++i) {
      const supine_option *other = r->rows[i].option;
      if (r->rows[i].given && other->rivals != NULL && strcmp(other->rivals, option->rivals) == 0) {
        return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "give --%s or --%s, not both",
                                other->name, option->name);
      }
    }
  }
  target->given = true;
  target->value = text;
  if (option->given != 0) {
    *(bool *)(target->filled + option->given - 1) = true;
  }
  return read_row(target, text, error);
}

static supine_status refuse_unknown(const reading *r, int got, const char *given,
                                    supine_error *error) {
  const char *names[ROWS_MAX + 1];
  for (size_t i = 0; i < r->count; ++i) {
    names[i] = r->rows[i].option->name;
  }
  names[r->count] = "help";
  SUPINE_REFUSE_IF(got == ':', error, SUPINE_ERROR_ARGUMENT, "option '%s' needs a value", given);
  const char *nearest =
      strncmp(given, "--", 2) == 0 ? supine_options_suggest(given + 2, names, r->count + 1) : NULL;
  char suggestion[128];
  supine_text_suggest("--", nearest, suggestion, sizeof suggestion);
  return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "no option '%s'%s", given, suggestion);
}

static supine_status read_options(reading *r, int argc, char **argv, supine_error *error) {
  struct option names[ROWS_MAX + 3] = {{0}};
  char letters[2 * ROWS_MAX + 4] = ":h";
  size_t n = 0;
  for (size_t i = 0; i < r->count; ++i) {
    const supine_option *option = r->rows[i].option;
    const int follows = option->argument != NULL ? required_argument : no_argument;
    names[n++] = (struct option){option->name, follows, NULL, FIRST_LONG + (int)i};
    if (option->letter != 0) {
      const char letter[] = {option->letter, follows == required_argument ? ':' : '\0', '\0'};
      (void)strcat(letters, letter);
    }
  }
  names[n++] = (struct option){"help", no_argument, NULL, 'h'};
  names[n] = (struct option){"help-all", no_argument, NULL, HELP_ALL};
  optind = 0; /* restarts getopt_long() */
  opterr = 0;
  for (int got; (got = getopt_long(argc, argv, letters, names, NULL)) != -1;) {
    size_t i = got >= FIRST_LONG ? (size_t)(got - FIRST_LONG) : 0;
    if (got == 'h' || got == HELP_ALL) {
      r->help = got;
      return SUPINE_OK;
    }
    if (got == '?' || got == ':') {
      return refuse_unknown(r, got, argv[optind - 1], error);
    }
    while (got < FIRST_LONG && r->rows[i].option->letter != got) {
      ++i;
    }
    SUPINE_TRY(read_given(r, &r->rows[i], optarg, error));
  }
  return SUPINE_OK;
}

/* Return whether `path` has an ending in `endings` (".ply, .obj or .stl"), in any letter case. */
static bool has_ending(const char *path, const char *endings) {
  const char *dot = strrchr(path, '.');
  if (dot == NULL || dot == path || dot[-1] == '/') {
    return false;
  }
  const size_t length = strlen(dot);
  for (const char *at = endings; (at = strchr(at, '.')) != NULL; ++at) {
    if (supine_ascii_same_begin(at, dot, length) && strchr(", ", at[length]) != NULL) {
      return true;
    }
  }
  return false;
}

/* Refuse options that would have no effect, as an option that is given does not list them among its
 * partners. */
static supine_status check_partners(const reading *r, const supine_option *option,
                                    supine_error *error) {
  char listed[160];
  (void)snprintf(listed, sizeof listed, " %s ", option->partners);
  for (size_t i = 0; i < r->count; ++i) {
    const supine_option *other = r->rows[i].option;
    char name[40];
    (void)snprintf(name, sizeof name, " %s ", other->name);
    const bool of_all = r->rows[i].filled == r->request + r->command->request_size;
    SUPINE_REFUSE_IF(r->rows[i].given && !of_all && other != option && strstr(listed, name) == NULL,
                     error, SUPINE_ERROR_ARGUMENT,
                     "--%s has no effect with --%s: leave one of them out", other->name,
                     option->name);
  }
  return SUPINE_OK;
}

static supine_status check_given(const reading *r, size_t operands, char **argv,
                                 supine_error *error) {
  const supine_command *command = r->command;
  size_t most = command->operands_most;
  bool alone = false;
  for (size_t i = 0; i < r->count; ++i) {
    const supine_option *option = r->rows[i].option;
    if (option->partners != NULL && r->rows[i].given) {
      if (check_partners(r, option, error) != SUPINE_OK) {
        return SUPINE_ERROR_ARGUMENT;
      }
    }
    if (option->alone && r->rows[i].given) {
      alone = true;
      most = 0;
    }
  }
  SUPINE_REFUSE_IF(operands > most && most == 0, error, SUPINE_ERROR_ARGUMENT,
                   "unexpected argument '%s': remove it", argv[optind]);
  if (alone) {
    return SUPINE_OK;
  }
  SUPINE_REFUSE_IF(operands < command->operands_least || operands > command->operands_most, error,
                   SUPINE_ERROR_ARGUMENT, "%s", command->operands_missing);
  for (size_t i = 0; i < r->count; ++i) {
    const supine_option *option = r->rows[i].option;
    if (option->required && !r->rows[i].given) {
      const char letter[] = {'-', option->letter, '\0'};
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "%s%s %s is missing%s%s",
                              option->letter != 0 ? letter : "--",
                              option->letter != 0 ? "" : option->name, option->argument,
                              option->endings != NULL ? "; its name must end in " : "",
                              option->endings != NULL ? option->endings : "");
    }
    SUPINE_REFUSE_IF(option->endings != NULL && r->rows[i].given &&
                         !has_ending(r->rows[i].value, option->endings),
                     error, SUPINE_ERROR_ARGUMENT, "%s: the name must end in %s", r->rows[i].value,
                     option->endings);
  }
  return SUPINE_OK;
}

supine_status supine_options_check_output(const char *output, const char *input,
                                          supine_error *error) {
  struct stat old;
  struct stat read;
  const bool same = stat(output, &old) == 0 && stat(input, &read) == 0 && S_ISREG(old.st_mode) &&
                    old.st_dev == read.st_dev && old.st_ino == read.st_ino;
  return same ? supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                 "%s: this output is also an input (%s): choose another name",
                                 output, input)
              : SUPINE_OK;
}

/* Check that an output is neither an input nor another output, and that it can be written. */
static supine_status check_output(const reading *r, const row *output,
                                  const supine_arguments *given, supine_error *error) {
  for (size_t i = 0; i < given->count; ++i) {
    SUPINE_TRY(supine_options_check_output(output->value, given->operand[i], error));
  }
  for (size_t i = 0; i < r->count; ++i) {
    const row *other = &r->rows[i];
    if (other->given && other->option->file == SUPINE_FILE_IN) {
      SUPINE_TRY(supine_options_check_output(output->value, other->value, error));
    } else if (other->given && other->option->file == SUPINE_FILE_OUT && other < output &&
               strcmp(output->value, other->value) == 0) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "--%s and --%s name the same file: give them different names",
                              other->option->name, output->option->name);
    }
  }
  return supine_output_try(output->value, error);
}

static supine_status check_outputs(const reading *r, const supine_arguments *given,
                                   supine_error *error) {
  for (size_t i = 0; i < r->count; ++i) {
    if (r->rows[i].given && r->rows[i].option->file == SUPINE_FILE_OUT) {
      SUPINE_TRY(check_output(r, &r->rows[i], given, error));
    }
  }
  for (size_t i = 0; i < r->count; ++i) {
    if (r->rows[i].given && r->rows[i].option->file == SUPINE_FILE_OUT &&
        supine_output_is_standard(r->rows[i].value)) {
      const bool taken = supine_output_take_standard();
      SUPINE_REFUSE_IF(!taken, error, SUPINE_ERROR_ARGUMENT,
                       "standard output is closed: give a file instead of -");
    }
  }
  return SUPINE_OK;
}

/* Write the command line into `text` [size]; shorten paths to the part after the last slash. */
static void describe_command(int argc, char **argv, char *text, size_t size) {
  (void)snprintf(text, size, "supine " SUPINE_VERSION);
  for (int i = 0; i < argc; ++i) {
    supine_text_add(text, size, " %s", supine_text_file_name(argv[i]));
  }
  (void)supine_text_make_utf8(text);
}

static supine_status read_and_run(reading *r, int argc, char **argv, supine_error *error) {
  const supine_command *command = r->command;
  char made_by[512];
  describe_command(argc, argv, made_by, sizeof made_by);
  if (command->begin != NULL) {
    command->begin(r->request);
  }
  supine_options_visit(command, collect, r);
  for (size_t i = 0; i < r->count; ++i) {
    if (r->rows[i].option->standard != NULL) {
      SUPINE_TRY(read_row(&r->rows[i], r->rows[i].option->standard, error));
    }
  }
  SUPINE_TRY(read_options(r, argc, argv, error));
  if (r->help != 0) {
    supine_options_print_help(command, r->help == HELP_ALL, stdout);
    return SUPINE_OK;
  }
  supine_options_speak((const supine_speech *)(r->request + command->request_size));
  const supine_arguments given = {argv + optind, (size_t)(argc - optind), made_by};
  SUPINE_TRY(check_given(r, given.count, argv, error));
  SUPINE_TRY(check_outputs(r, &given, error));
  if (command->uses_blas) {
    SUPINE_TRY(supine_blas_reserve(supine_thread_count(), error));
  }
  return command->run(r->request, &given, error);
}

static int exit_code(supine_status status) {
  static const int codes[SUPINE_STATUS_COUNT] = {
      [SUPINE_ERROR_ARGUMENT] = SUPINE_EXIT_USAGE,
      [SUPINE_ERROR_READ] = SUPINE_EXIT_INPUT,
      [SUPINE_ERROR_FORMAT] = SUPINE_EXIT_INPUT,
      [SUPINE_ERROR_MESH] = SUPINE_EXIT_INPUT,
      [SUPINE_ERROR_OPEN_SURFACE] = SUPINE_EXIT_INPUT,
      [SUPINE_ERROR_UNSUPPORTED] = SUPINE_EXIT_UNSUPPORTED,
      [SUPINE_ERROR_WRITE] = SUPINE_EXIT_OUTPUT,
      [SUPINE_ERROR_INTERRUPTED] = SUPINE_EXIT_OUTPUT}; /* 0: the rest, which are numerical */
  return codes[status] != 0 ? codes[status] : SUPINE_EXIT_NUMERICAL;
}

int supine_options_run(const supine_command *command, int argc, char **argv) {
  supine_error error = {.message = ""};
  reading r = {.command = command,
               .request = calloc(1, command->request_size + sizeof(supine_speech))};
  const supine_status status =
      r.request != NULL ? read_and_run(&r, argc, argv, &error) : SUPINE_ERROR_MEMORY;
  free(r.request);
  supine_options_print_results(status == SUPINE_OK);
  if (status == SUPINE_OK) {
    return supine_options_finish(command->name);
  }
  supine_options_say(command->name, "%s",
                     error.message[0] != '\0' ? supine_options_explain(&error).text
                                              : supine_status_string(status));
  if (status == SUPINE_ERROR_ARGUMENT) {
    (void)fprintf(stderr, "Try 'supine %s --help'.\n", command->name);
  }
  return exit_code(status);
}
