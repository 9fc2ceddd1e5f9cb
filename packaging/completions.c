/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the completion for bash from the commands' tables of options, as FOLDER/supine.bash:
 *
 *     write_completions FOLDER */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/output.h"

#include "program/command/list.h"
#include "program/options/command.h"

/* Write FOLDER/NAME by `write`; end the program if that fails. */
static void write_file(void (*write)(FILE *file), const char *folder, const char *name) {
  char path[4096];
  supine_output output;
  supine_error error;
  (void)snprintf(path, sizeof path, "%s/%s", folder, name);
  if (supine_output_open(path, &output, &error) == SUPINE_OK) {
    write(output.file);
    if (supine_output_commit(&output, &error) == SUPINE_OK) {
      return;
    }
  }
  (void)fprintf(stderr, "write_completions: %s\n", error.message);
  exit(SUPINE_EXIT_OUTPUT);
}

typedef struct context {
  const char *command;
  FILE *file;
} context;

static void bash_words(const supine_option *option, FILE *file) {
  for (size_t i = 0; option->choices[i] != NULL; ++i) {
    (void)fprintf(file, "%s%s", i > 0 ? " " : "", option->choices[i]);
  }
}

/* Write the bash case that completes the value of an option by its choices, by names of files, or
 * not at all. */
static void bash_value(void *given, const supine_option *option, size_t base) {
  const context *c = given;
  (void)base;
  if (option->name == NULL || option->argument == NULL) {
    return;
  }
  (void)fprintf(c->file, "  %s:--%s", c->command, option->name);
  if (option->letter != 0) {
    (void)fprintf(c->file, " | %s:-%c", c->command, option->letter);
  }
  if (option->choices != NULL) {
    (void)fputs(") COMPREPLY=($(compgen -W '", c->file);
    bash_words(option, c->file);
    (void)fputs("' -- \"$cur\")); return ;;\n", c->file);
  } else if (option->file != SUPINE_FILE_NONE) {
    (void)fputs(") COMPREPLY=($(compgen -f -- \"$cur\")); return ;;\n", c->file);
  } else {
    (void)fputs(") return ;;\n", c->file);
  }
}

static void bash_name(void *given, const supine_option *option, size_t base) {
  const context *c = given;
  (void)base;
  if (option->name != NULL) {
    (void)fprintf(c->file, "--%s ", option->name);
  }
}

static void write_bash(FILE *file) {
  (void)fputs("# bash completion for supine, generated from its tables of options\n"
              "_supine() {\n"
              "  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD-1]} words=\n"
              "  if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
              "    COMPREPLY=($(compgen -W 'help --version",
              file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    (void)fprintf(file, " %s", supine_command_list[i]->name);
  }
  (void)fputs("' -- \"$cur\"))\n    return\n  fi\n  case \"${COMP_WORDS[1]}:$prev\" in\n", file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    context c = {supine_command_list[i]->name, file};
    supine_options_visit(supine_command_list[i], bash_value, &c);
  }
  (void)fputs("  esac\n  case \"${COMP_WORDS[1]}\" in\n", file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    context c = {supine_command_list[i]->name, file};
    (void)fprintf(file, "  %s) words='", supine_command_list[i]->name);
    supine_options_visit(supine_command_list[i], bash_name, &c);
    (void)fputs("--help --help-all' ;;\n", file);
  }
  (void)fputs("  esac\n"
              "  case \"$cur\" in\n"
              "  -*) COMPREPLY=($(compgen -W \"$words\" -- \"$cur\")) ;;\n"
              "  *) COMPREPLY=($(compgen -f -- \"$cur\")) ;;\n"
              "  esac\n"
              "}\n"
              "complete -o filenames -F _supine supine\n",
              file);
}

int main(int argc, char **argv) {
  if (argc != 2) {
    (void)fputs("usage: write_completions FOLDER\n", stderr);
    return SUPINE_EXIT_USAGE;
  }
  write_file(write_bash, argv[1], "supine.bash");
  return SUPINE_EXIT_OK;
}
