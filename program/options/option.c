/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Reads a command line as the command's table says, and runs the command. */
#include <getopt.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "sh/base/output.h"

#include "program/options/command.h"

enum { ROWS_MAX = 64, HELP_ALL = 256, FIRST_LONG }; /* long options are FIRST_LONG + row */

typedef struct row {
  const supine_option *option;
  char *begin; /* its struct within the request */
  bool given;
  const char *value;
} row;

typedef struct reading {
  const supine_command *command;
  char *request;
  size_t count;
  row rows[ROWS_MAX];
  char standard[16]; /* "-" and the first ending of an output */
} reading;

static void collect(void *context, const supine_option *option, size_t base) {
  reading *r = context;
  if (option->name != NULL && r->count < ROWS_MAX) {
    r->rows[r->count++] = (row){.option = option, .begin = r->request + base};
  }
}

static bool within(const supine_option *option, double number) {
  const double low = option->range[0];
  const double high = option->range[1];
  if (low == 0.0 && high == 0.0) {
    return true;
  }
  return option->open ? number > low && number < high : number >= low && number <= high;
}

static int read_choice(const supine_option *option, const char *text, unsigned *choice) {
  for (unsigned i = 0; option->choices[i] != NULL; ++i) {
    if (strcasecmp(option->choices[i], text) == 0) {
      *choice = i;
      return SUPINE_EXIT_OK;
    }
  }
  return SUPINE_OPTION_MISFIT;
}

/* Reads by kind: SUPINE_EXIT_OK, SUPINE_OPTION_MISFIT or an exit code after a message. */
static int read_value(const char *command, const supine_option *option, const char *text,
                      void *field) {
  bool good = false;
  if (option->read != NULL) {
    return option->read(command, text, field);
  }
  switch (option->kind) {
  case SUPINE_OPTION_FLAG:
    *(bool *)field = good = true;
    break;
  case SUPINE_OPTION_NUMBER:
    good = supine_options_parse_number(text, field) && within(option, *(double *)field);
    break;
  case SUPINE_OPTION_NUMBERS:
    good = supine_options_parse_numbers(text, option->size / sizeof(double), field);
    break;
  case SUPINE_OPTION_COUNT:
    good = supine_options_parse_count(text, field) && within(option, (double)*(size_t *)field);
    break;
  case SUPINE_OPTION_TEXT:
    *(const char **)field = text;
    good = true;
    break;
  case SUPINE_OPTION_CHOICE:
    return read_choice(option, text, field);
  case SUPINE_OPTION_OWN:
    break;
  }
  return good ? SUPINE_EXIT_OK : SUPINE_OPTION_MISFIT;
}

/* Describe the values that the option takes. */
static void say_wanted(const supine_option *option, char *text, size_t size) {
  if (option->wants != NULL) {
    (void)snprintf(text, size, "%s", option->wants);
  } else if (option->choices != NULL) {
    size_t used = 0;
    for (size_t i = 0; option->choices[i] != NULL && used < size; ++i) {
      const char *before = i == 0 ? "" : option->choices[i + 1] == NULL ? " or " : ", ";
      used += (size_t)snprintf(text + used, size - used, "%s%s", before, option->choices[i]);
    }
  } else if (option->range[1] > 0.0 && !option->open) {
    (void)snprintf(text, size, "%g to %g", option->range[0], option->range[1]);
  } else {
    (void)snprintf(text, size, "%s",
                   option->kind == SUPINE_OPTION_COUNT     ? "a whole number"
                   : option->kind == SUPINE_OPTION_NUMBERS ? "numbers separated by commas"
                   : option->open                          ? "a number above 0"
                                                           : "a number");
  }
}

static int take(const reading *r, row *taken, const char *text) {
  const supine_option *option = taken->option;
  const int result = read_value(r->command->name, option, text, taken->begin + option->offset);
  if (result == SUPINE_OPTION_MISFIT) {
    char wanted[512];
    say_wanted(option, wanted, sizeof wanted);
    return supine_options_usage(r->command->name, "--%s takes %s, not '%s'", option->name, wanted,
                                text);
  }
  return result;
}

/* "give --volume or --scale, not both", "give one of --posture, --gravity and --quaternion" */
static int say_rivals(const reading *r, const char *rivals) {
  size_t total = 0;
  char text[512];
  size_t used = 0;
  for (size_t i = 0; i < r->count; ++i) {
    const char *word = r->rows[i].option->rivals;
    total += word != NULL && strcmp(word, rivals) == 0;
  }
  for (size_t i = 0, seen = 0; i < r->count && used < sizeof text; ++i) {
    const char *word = r->rows[i].option->rivals;
    if (word != NULL && strcmp(word, rivals) == 0) {
      const char *between = seen == 0          ? ""
                            : seen + 1 < total ? ", "
                            : total == 2       ? " or "
                                               : " and ";
      used += (size_t)snprintf(text + used, sizeof text - used, "%s--%s", between,
                               r->rows[i].option->name);
      ++seen;
    }
  }
  return supine_options_usage(r->command->name, total == 2 ? "give %s, not both" : "give one of %s",
                              text);
}

static int take_given(reading *r, row *taken, const char *text) {
  const supine_option *option = taken->option;
  if (option->file == SUPINE_FILE_OUT && option->endings != NULL && strcmp(text, "-") == 0) {
    (void)snprintf(r->standard, sizeof r->standard, "-%.*s", (int)strcspn(option->endings, ", "),
                   option->endings);
    text = r->standard;
  }
  const char *rivals = taken->option->rivals;
  for (size_t i = 0; rivals != NULL && i < r->count; ++i) {
    const char *word = r->rows[i].option->rivals;
    if (r->rows[i].given && word != NULL && strcmp(word, rivals) == 0) {
      return say_rivals(r, rivals);
    }
  }
  taken->given = true;
  taken->value = text;
  if (taken->option->given != 0) {
    *(bool *)(taken->begin + taken->option->given - 1) = true;
  }
  return take(r, taken, text);
}

/* Report an unknown option, or one without its value. */
static int say_unknown(const reading *r, int result, const char *given) {
  const char *names[ROWS_MAX + 1];
  for (size_t i = 0; i < r->count; ++i) {
    names[i] = r->rows[i].option->name;
  }
  names[r->count] = "help";
  if (result == ':') {
    return supine_options_usage(r->command->name, "option '%s' needs a value", given);
  }
  const char *nearest =
      strncmp(given, "--", 2) == 0 ? supine_options_suggest(given + 2, names, r->count + 1) : NULL;
  return nearest != NULL
             ? supine_options_usage(r->command->name, "no option '%s'; did you mean '--%s'?", given,
                                    nearest)
             : supine_options_usage(r->command->name, "no option '%s'", given);
}

enum { HELP_WANTED = -2, HELP_ALL_WANTED = -3 };

/* Reads argv into the request; SUPINE_EXIT_OK, HELP_WANTED, HELP_ALL_WANTED or an exit code
 * after a message. */
static int read_options(reading *r, int argc, char **argv) {
  struct option names[2 * ROWS_MAX + 3] = {{0}};
  char letters[2 * ROWS_MAX + 4] = ":h";
  size_t n = 0;
  for (size_t i = 0; i < r->count; ++i) {
    const supine_option *option = r->rows[i].option;
    const int follows = option->argument != NULL ? required_argument : no_argument;
    names[n++] = (struct option){option->name, follows, NULL, FIRST_LONG + (int)i};
    if (option->alias != NULL) {
      names[n++] = (struct option){option->alias, follows, NULL, FIRST_LONG + (int)i};
    }
    if (option->letter != 0) {
      const char letter[] = {option->letter, follows == required_argument ? ':' : '\0', '\0'};
      (void)strcat(letters, letter);
    }
  }
  names[n++] = (struct option){"help", no_argument, NULL, 'h'};
  names[n] = (struct option){"help-all", no_argument, NULL, HELP_ALL};
  optind = 0; /* begin anew; options and operands in any order */
  opterr = 0;
  for (int got; (got = getopt_long(argc, argv, letters, names, NULL)) != -1;) {
    size_t i = got >= FIRST_LONG ? (size_t)(got - FIRST_LONG) : 0;
    if (got == 'h' || got == HELP_ALL) {
      return got == 'h' ? HELP_WANTED : HELP_ALL_WANTED;
    }
    if (got == '?' || got == ':') {
      return say_unknown(r, got, argv[optind - 1]);
    }
    while (got < FIRST_LONG && r->rows[i].option->letter != got) {
      ++i;
    }
    const int result = take_given(r, &r->rows[i], optarg);
    if (result != SUPINE_EXIT_OK) {
      return result;
    }
  }
  return SUPINE_EXIT_OK;
}

/* Check that a name ends in one of ".ply, .obj or .stl", in any case. */
static bool has_ending(const char *path, const char *endings) {
  const char *dot = strrchr(path, '.');
  if (dot == NULL || dot == path || dot[-1] == '/') {
    return false;
  }
  const size_t length = strlen(dot);
  for (const char *at = endings; (at = strchr(at, '.')) != NULL; ++at) {
    if (strncasecmp(at, dot, length) == 0 && strchr(", ", at[length]) != NULL) {
      return true;
    }
  }
  return false;
}

static int check_given(const reading *r, size_t operands, char **argv) {
  const supine_command *command = r->command;
  if (operands > command->operands_most && command->operands_most == 0) {
    return supine_options_usage(command->name, "unexpected argument '%s': remove it", argv[optind]);
  }
  if (operands < command->operands_least || operands > command->operands_most) {
    return supine_options_usage(command->name, "%s", command->operands_missing);
  }
  for (size_t i = 0; i < r->count; ++i) {
    const supine_option *option = r->rows[i].option;
    if (option->required && !r->rows[i].given) {
      const char letter[] = {'-', option->letter, '\0'};
      return supine_options_usage(command->name, "%s%s %s is missing%s%s",
                                  option->letter != 0 ? letter : "--",
                                  option->letter != 0 ? "" : option->name, option->argument,
                                  option->endings != NULL ? "; its name must end in " : "",
                                  option->endings != NULL ? option->endings : "");
    }
    if (option->endings != NULL && r->rows[i].given &&
        !has_ending(r->rows[i].value, option->endings)) {
      return supine_options_usage(command->name, "%s: the name must end in %s", r->rows[i].value,
                                  option->endings);
    }
  }
  return SUPINE_EXIT_OK;
}

int supine_options_check_output(const char *command, const char *output, const char *input) {
  struct stat old;
  struct stat read;
  const bool same = stat(output, &old) == 0 && stat(input, &read) == 0 && S_ISREG(old.st_mode) &&
                    old.st_dev == read.st_dev && old.st_ino == read.st_ino;
  return same ? supine_options_usage(command,
                                     "%s: this output is also an input (%s): choose another name",
                                     output, input)
              : SUPINE_EXIT_OK;
}

/* Check that an output is neither an input nor another output and can be written. */
static int check_output(const reading *r, const row *output, const supine_arguments *given) {
  const char *name = r->command->name;
  int result = SUPINE_EXIT_OK;
  for (size_t i = 0; i < given->count && result == SUPINE_EXIT_OK; ++i) {
    result = supine_options_check_output(name, output->value, given->operand[i]);
  }
  for (size_t i = 0; i < r->count && result == SUPINE_EXIT_OK; ++i) {
    const row *other = &r->rows[i];
    if (!other->given || other->option->file == SUPINE_FILE_NONE) {
      continue;
    }
    if (other->option->file == SUPINE_FILE_IN) {
      result = supine_options_check_output(name, output->value, other->value);
    } else if (other < output && strcmp(output->value, other->value) == 0) {
      result =
          supine_options_usage(name, "--%s and --%s name the same file: give them different names",
                               other->option->name, output->option->name);
    }
  }
  supine_error error;
  if (result == SUPINE_EXIT_OK && supine_output_try(output->value, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
  }
  return result;
}

static int check_outputs(const reading *r, const supine_arguments *given) {
  int result = SUPINE_EXIT_OK;
  for (size_t i = 0; i < r->count && result == SUPINE_EXIT_OK; ++i) {
    if (r->rows[i].given && r->rows[i].option->file == SUPINE_FILE_OUT) {
      result = check_output(r, &r->rows[i], given);
    }
  }
  for (size_t i = 0; i < r->count && result == SUPINE_EXIT_OK; ++i) {
    if (r->rows[i].given && r->rows[i].option->file == SUPINE_FILE_OUT &&
        supine_output_is_standard(r->rows[i].value) && !supine_output_take_standard()) {
      result = supine_options_usage(r->command->name,
                                    "standard output is closed: give a file instead of -");
    }
  }
  return result;
}

int supine_options_run(const supine_command *command, int argc, char **argv) {
  reading r = {.command = command, .request = calloc(1, command->request_size)};
  char made_by[512];
  int result = SUPINE_EXIT_OK;
  if (r.request == NULL) {
    supine_options_say(command->name, "out of memory");
    return SUPINE_EXIT_NUMERICAL;
  }
  supine_options_describe(argc, argv, made_by, sizeof made_by);
  if (command->begin != NULL) {
    command->begin(r.request);
  }
  supine_options_visit(command->options, 0, collect, &r);
  for (size_t i = 0; i < r.count && result == SUPINE_EXIT_OK; ++i) {
    if (r.rows[i].option->standard != NULL) {
      result = take(&r, &r.rows[i], r.rows[i].option->standard);
    }
  }
  if (result == SUPINE_EXIT_OK) {
    result = read_options(&r, argc, argv);
  }
  if (result == HELP_WANTED || result == HELP_ALL_WANTED) {
    supine_options_print_help(command, result == HELP_ALL_WANTED, stdout);
    result = supine_options_finish(command->name);
  } else if (result == SUPINE_EXIT_OK) {
    const supine_arguments given = {argv + optind, (size_t)(argc - optind), made_by};
    result = check_given(&r, given.count, argv);
    if (result == SUPINE_EXIT_OK) {
      result = check_outputs(&r, &given);
    }
    if (result == SUPINE_EXIT_OK) {
      result = command->run(r.request, &given);
    }
  }
  free(r.request);
  return result;
}
