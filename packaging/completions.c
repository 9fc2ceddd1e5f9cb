/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the completions for bash, zsh and fish from the commands' tables of options, as
 * supine.bash, _supine and supine.fish in a folder:
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

/* Call `each` for the options of a command, also for those that no table has. */
static void visit_options(const supine_command *command, supine_option_visit *each, FILE *file) {
  static const supine_option help = {"help", .help = "explain the command"};
  static const supine_option help_all = {"help-all", .help = "explain every option"};
  context c = {command->name, file};
  supine_options_visit(command, each, &c);
  each(&c, &help, 0);
  each(&c, &help_all, 0);
}

/* Write what may follow an option: its choices, between spaces. */
static void write_choices(const supine_option *option, FILE *file) {
  for (size_t i = 0; option->choices[i] != NULL; ++i) {
    (void)fprintf(file, "%s%s", i > 0 ? " " : "", option->choices[i]);
  }
}

/* Write the first sentence or line of `text` for a string between single quotes. `quote` stands for
 * a single quote, and a backslash goes before each character of `special`. */
static void write_text(const char *text, const char *quote, const char *special, FILE *file) {
  for (const char *at = text; *at != '\0' && *at != '\n' && *at != ';'; ++at) {
    if (strncmp(at, ". ", 2) == 0 || strncmp(at, ": ", 2) == 0) {
      return;
    }
    if (*at == '\'') {
      (void)fputs(quote, file);
    } else {
      (void)fprintf(file, "%s%c", strchr(special, *at) != NULL ? "\\" : "", *at);
    }
  }
}

/* What the program takes in place of a command. */
static const char *const others[][2] = {{"help", "list the commands"},
                                        {"--version", "print the version"}};
enum { OTHERS = sizeof others / sizeof others[0] };

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
    write_choices(option, c->file);
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
              "    COMPREPLY=($(compgen -W '",
              file);
  for (size_t i = 0; i < OTHERS; ++i) {
    (void)fprintf(file, "%s%s", i > 0 ? " " : "", others[i][0]);
  }
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    (void)fprintf(file, " %s", supine_command_list[i]->name);
  }
  (void)fputs("' -- \"$cur\"))\n    return\n  fi\n  case \"${COMP_WORDS[1]}:$prev\" in\n", file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    visit_options(supine_command_list[i], bash_value, file);
  }
  (void)fputs("  esac\n  case \"${COMP_WORDS[1]}\" in\n", file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    (void)fprintf(file, "  %s) words='", supine_command_list[i]->name);
    visit_options(supine_command_list[i], bash_name, file);
    (void)fputs("' ;;\n", file);
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

static void zsh_text(const char *text, const char *special, FILE *file) {
  write_text(text, "'\\''", special, file);
}

static void zsh_command(const char *name, const char *summary, FILE *file) {
  (void)fprintf(file, "  '%s:", name);
  zsh_text(summary, ":\\", file);
  (void)fputs("'\n", file);
}

/* Write the specification of an option, '(NAMES)'{NAMES}'[HELP]:ARGUMENT:VALUES', for _arguments.
 */
static void zsh_option(void *given, const supine_option *option, size_t base) {
  FILE *file = ((const context *)given)->file;
  (void)base;
  if (option->name == NULL) {
    return;
  }
  (void)fputs(" \\\n    ", file);
  if (option->repeats) {
    (void)fputs("'*'", file);
  } else if (option->letter != 0) {
    (void)fprintf(file, "'(-%c --%s)'", option->letter, option->name);
  }
  if (option->letter != 0) {
    (void)fprintf(file, "{-%c,--%s}'[", option->letter, option->name);
  } else {
    (void)fprintf(file, "--%s'[", option->name);
  }
  zsh_text(option->help, "[]\\", file);
  (void)fputc(']', file);
  if (option->argument != NULL) {
    (void)fputc(':', file);
    zsh_text(option->argument, ":\\", file);
    if (option->choices != NULL) {
      (void)fputs(":(", file);
      write_choices(option, file);
      (void)fputc(')', file);
    } else {
      (void)fputs(option->file != SUPINE_FILE_NONE ? ":_files" : ": ", file);
    }
  }
  (void)fputc('\'', file);
}

static void write_zsh(FILE *file) {
  (void)fputs("#compdef supine\n"
              "# zsh completion for supine, generated from its tables of options\n"
              "local -a commands=(\n",
              file);
  for (size_t i = 0; i < OTHERS; ++i) {
    zsh_command(others[i][0], others[i][1], file);
  }
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    zsh_command(supine_command_list[i]->name, supine_command_list[i]->summary, file);
  }
  (void)fputs(")\n"
              "if (( CURRENT == 2 )); then\n"
              "  _describe command commands\n"
              "  return\n"
              "fi\n"
              "shift words\n"
              "(( CURRENT-- ))\n"
              "case $words[1] in\n",
              file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    (void)fprintf(file, "%s)\n  _arguments -s", supine_command_list[i]->name);
    visit_options(supine_command_list[i], zsh_option, file);
    (void)fputs(" \\\n    '*:file:_files'\n  ;;\n", file);
  }
  (void)fputs("esac\n", file);
}

static void fish_text(const char *text, FILE *file) {
  (void)fputs(" -d '", file);
  write_text(text, "\\'", "\\", file);
  (void)fputs("'\n", file);
}

static void fish_option(void *given, const supine_option *option, size_t base) {
  const context *c = given;
  (void)base;
  if (option->name == NULL) {
    return;
  }
  (void)fprintf(c->file, "complete -c supine -n '__supine_command %s' -l %s", c->command,
                option->name);
  if (option->letter != 0) {
    (void)fprintf(c->file, " -s %c", option->letter);
  }
  if (option->argument != NULL && option->choices != NULL) {
    (void)fputs(" -x -a '", c->file);
    write_choices(option, c->file);
    (void)fputc('\'', c->file);
  } else if (option->argument != NULL) {
    (void)fputs(option->file != SUPINE_FILE_NONE ? " -r" : " -x", c->file);
  }
  fish_text(option->help, c->file);
}

static void fish_command(const char *name, const char *summary, FILE *file) {
  (void)fprintf(file, "complete -c supine -n '__supine_command \"\"' -f -a '%s'", name);
  fish_text(summary, file);
}

static void write_fish(FILE *file) {
  (void)fputs("# fish completion for supine, generated from its tables of options\n"
              "function __supine_command -d 'Test whether the command on the line is $argv[1]'\n"
              "  set -l words (commandline -opc)\n"
              "  test \"$words[2]\" = \"$argv[1]\"\n"
              "end\n",
              file);
  for (size_t i = 0; i < OTHERS; ++i) {
    fish_command(others[i][0], others[i][1], file);
  }
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    fish_command(supine_command_list[i]->name, supine_command_list[i]->summary, file);
    visit_options(supine_command_list[i], fish_option, file);
  }
}

int main(int argc, char **argv) {
  if (argc != 2) {
    (void)fputs("usage: write_completions FOLDER\n", stderr);
    return SUPINE_EXIT_USAGE;
  }
  write_file(write_bash, argv[1], "supine.bash");
  write_file(write_zsh, argv[1], "_supine");
  write_file(write_fish, argv[1], "supine.fish");
  return SUPINE_EXIT_OK;
}
