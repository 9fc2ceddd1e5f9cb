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

typedef void option_writer(const char *command, const supine_option *option, FILE *file);

typedef struct context {
  const char *command;
  option_writer *write;
  FILE *file;
} context;

static void write_option(void *given, const supine_option *option, size_t base) {
  const context *c = given;
  (void)base;
  if (option->name != NULL) { /* else it is a heading */
    c->write(c->command, option, c->file);
  }
}

/* Write the options of a command, also those that no table has. */
static void write_options(const supine_command *command, option_writer *write, FILE *file) {
  static const supine_option help = {"help", .help = "explain the command"};
  static const supine_option help_all = {"help-all", .help = "explain every option"};
  context c = {command->name, write, file};
  supine_options_visit(command, write_option, &c);
  write(command->name, &help, file);
  write(command->name, &help_all, file);
}

/* Write what the program takes as its first word, with a summary. */
static void write_commands(void (*write)(const char *name, const char *summary, FILE *file),
                           FILE *file) {
  write("help", "list the commands", file);
  write("--version", "print the version", file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    write(supine_command_list[i]->name, supine_command_list[i]->summary, file);
  }
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

/* Write the bash case that completes the value of an option by its choices, by names of files, or
 * not at all. */
static void bash_value(const char *command, const supine_option *option, FILE *file) {
  if (option->argument == NULL) {
    return;
  }
  (void)fprintf(file, "  %s:--%s", command, option->name);
  if (option->letter != 0) {
    (void)fprintf(file, " | %s:-%c", command, option->letter);
  }
  if (option->choices != NULL) {
    (void)fputs(") COMPREPLY=($(compgen -W '", file);
    write_choices(option, file);
    (void)fputs("' -- \"$cur\")); return ;;\n", file);
  } else if (option->file != SUPINE_FILE_NONE) {
    (void)fputs(") COMPREPLY=($(compgen -f -- \"$cur\")); return ;;\n", file);
  } else {
    (void)fputs(") return ;;\n", file);
  }
}

static void bash_option(const char *command, const supine_option *option, FILE *file) {
  (void)command;
  (void)fprintf(file, "--%s ", option->name);
}

static void bash_command(const char *name, const char *summary, FILE *file) {
  (void)summary;
  (void)fprintf(file, "%s ", name);
}

static void write_bash(FILE *file) {
  (void)fputs("# bash completion for supine, generated from its tables of options\n"
              "_supine() {\n"
              "  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD-1]} words=\n"
              "  if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
              "    COMPREPLY=($(compgen -W '",
              file);
  write_commands(bash_command, file);
  (void)fputs("' -- \"$cur\"))\n    return\n  fi\n  case \"${COMP_WORDS[1]}:$prev\" in\n", file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    write_options(supine_command_list[i], bash_value, file);
  }
  (void)fputs("  esac\n  case \"${COMP_WORDS[1]}\" in\n", file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    (void)fprintf(file, "  %s) words='", supine_command_list[i]->name);
    write_options(supine_command_list[i], bash_option, file);
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
static void zsh_option(const char *command, const supine_option *option, FILE *file) {
  (void)command;
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
  write_commands(zsh_command, file);
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
    write_options(supine_command_list[i], zsh_option, file);
    (void)fputs(" \\\n    '*:file:_files'\n  ;;\n", file);
  }
  (void)fputs("esac\n", file);
}

static void fish_text(const char *text, FILE *file) {
  (void)fputs(" -d '", file);
  write_text(text, "\\'", "\\", file);
  (void)fputs("'\n", file);
}

static void fish_option(const char *command, const supine_option *option, FILE *file) {
  (void)fprintf(file, "complete -c supine -n '__supine_command %s' -l %s", command, option->name);
  if (option->letter != 0) {
    (void)fprintf(file, " -s %c", option->letter);
  }
  if (option->argument != NULL && option->choices != NULL) {
    (void)fputs(" -x -a '", file);
    write_choices(option, file);
    (void)fputc('\'', file);
  } else if (option->argument != NULL) {
    (void)fputs(option->file != SUPINE_FILE_NONE ? " -r" : " -x", file);
  }
  fish_text(option->help, file);
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
  write_commands(fish_command, file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    write_options(supine_command_list[i], fish_option, file);
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
