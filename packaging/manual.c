/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Manual pages and completions for bash and zsh, from the commands' tables: manual FOLDER writes
 * FOLDER/supine.1, FOLDER/supine-COMMAND.1, FOLDER/supine.bash and FOLDER/_supine. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/output.h"
#include <supine/version.h>

#include "program/options/command.h"

/* One file written by `write`; ends the program where that fails. */
typedef void writer(const supine_command *command, FILE *file);

SUPINE_PRINTF(4, 5)
static void write_file(writer *write, const supine_command *command, const char *folder,
                       const char *format, ...) {
  char name[128];
  char path[4096];
  supine_output output;
  supine_error error;
  va_list list;
  va_start(list, format);
  (void)vsnprintf(name, sizeof name, format, list);
  va_end(list);
  (void)snprintf(path, sizeof path, "%s/%s", folder, name);
  if (supine_output_open(path, &output, &error) == SUPINE_OK) {
    write(command, output.file);
    if (supine_output_commit(&output, &error) == SUPINE_OK) {
      return;
    }
  }
  (void)fprintf(stderr, "manual: %s\n", error.message);
  exit(SUPINE_EXIT_OUTPUT); /* NOLINT(concurrency-mt-unsafe) */
}

/* One line of text as roff has it. */
static void roff_line(const char *text, size_t length, FILE *file) {
  if (length > 0 && (text[0] == '.' || text[0] == '\'')) {
    (void)fputs("\\&", file); /* else a request */
  }
  for (size_t i = 0; i < length; ++i) {
    const char *shown = text[i] == '-'    ? "\\-"
                        : text[i] == '\\' ? "\\e"
                        : text[i] == '~'  ? "\\(ti"
                        : text[i] == '^'  ? "\\(ha"
                        : text[i] == '`'  ? "\\(ga"
                        : text[i] == '\'' ? "\\(aq"
                                          : NULL;
    if (shown != NULL) {
      (void)fputs(shown, file);
    } else {
      (void)fputc(text[i], file);
    }
  }
}

/* Lines filled to the page; those that begin with a space as they are; "\n" breaks a line, an empty
 * line begins a paragraph. "Example:" or "Examples:" alone begins a section. */
static void roff_text(const char *text, FILE *file) {
  bool kept = false;
  for (bool first = true; *text != '\0'; first = false) {
    const size_t length = strcspn(text, "\n");
    const bool keep = text[0] == ' ';
    if (kept && !keep) {
      (void)fputs(".EE\n", file);
    }
    if (strncmp(text, "Example", 7) == 0 && text[length - 1] == ':') {
      (void)fputs(".SH EXAMPLES\n", file);
    } else if (length == 0) {
      (void)fputs(".PP\n", file);
    } else {
      (void)fputs(keep && !kept ? ".EX\n" : !first && !keep ? ".br\n" : "", file);
      roff_line(text, length, file);
      (void)fputc('\n', file);
    }
    kept = keep;
    text += length + (text[length] == '\n' ? 1 : 0);
  }
  (void)fputs(kept ? ".EE\n" : "", file);
}

static void roff_option(void *context, const supine_option *option, size_t base) {
  FILE *file = context;
  char text[2048];
  (void)base;
  if (option->name == NULL) {
    (void)fputs(".PP\n", file);
    roff_text(option->help, file);
    return;
  }
  (void)fputs(".TP\n", file);
  if (option->letter != 0) {
    (void)fprintf(file, "\\fB\\-%c\\fR, ", option->letter);
  }
  (void)fputs("\\fB\\-\\-", file);
  roff_line(option->name, strlen(option->name), file);
  (void)fputs("\\fR", file);
  if (option->argument != NULL) {
    (void)fputs(" \\fI", file);
    roff_line(option->argument, strlen(option->argument), file);
    (void)fputs("\\fR", file);
  }
  (void)fputc('\n', file);
  supine_options_help_text(option, text, sizeof text);
  roff_text(text, file);
}

static void roff_ending(FILE *file) {
  (void)fputs(".SH EXIT STATUS\n0 done, 1 usage, 2 input, 3 not in this build, 4 output, 5 "
              "numerical.\n.SH SEE ALSO\n.BR supine (1)",
              file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    (void)fprintf(file, ",\n.BR supine\\-%s (1)", supine_command_list[i]->name);
  }
  (void)fputc('\n', file);
}

static void write_page(const supine_command *command, FILE *file) {
  (void)fprintf(file,
                ".TH supine\\-%s 1 \"\" \"supine " SUPINE_VERSION "\" \"User Commands\"\n"
                ".SH NAME\nsupine\\-%s \\- ",
                command->name, command->name);
  roff_line(command->summary, strlen(command->summary), file);
  (void)fputs("\n.SH SYNOPSIS\n", file);
  for (const char *usage = command->usage; *usage != '\0';) {
    const size_t length = strcspn(usage, "\n");
    (void)fprintf(file, "\\fBsupine %s\\fR ", command->name);
    roff_line(usage, length, file);
    (void)fputs("\n.br\n", file);
    usage += length + (usage[length] == '\n' ? 1 : 0);
  }
  (void)fputs(".SH DESCRIPTION\n", file);
  roff_text(command->about, file);
  (void)fputs(".SH OPTIONS\n", file);
  supine_options_visit(command->options, 0, roff_option, file);
  (void)fputs(".TP\n\\fB\\-h\\fR, \\fB\\-\\-help\\fR\nprints all this\n", file);
  if (command->notes != NULL) {
    (void)fputs(strncmp(command->notes, "Example", 7) == 0 ? "" : ".SH NOTES\n", file);
    roff_text(command->notes, file);
  }
  roff_ending(file);
}

static void write_overview(const supine_command *command, FILE *file) {
  (void)command;
  (void)fputs(".TH supine 1 \"\" \"supine " SUPINE_VERSION "\" \"User Commands\"\n"
              ".SH NAME\nsupine \\- lungs that deform with gravity, in real time\n"
              ".SH SYNOPSIS\n\\fBsupine\\fR COMMAND [OPTIONS]\n"
              ".SH DESCRIPTION\nTurns a lung surface into a small basis file, offline, and deforms "
              "that lung for any direction of gravity and any volume, in real time.\n"
              ".SH COMMANDS\n",
              file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    (void)fprintf(file, ".TP\n\\fBsupine %s\\fR\n", supine_command_list[i]->name);
    roff_line(supine_command_list[i]->summary, strlen(supine_command_list[i]->summary), file);
    (void)fputc('\n', file);
  }
  (void)fputs(
      ".SH ENVIRONMENT\n.TP\n\\fBSUPINE_THREADS\\fR\nthreads to use, 1 to 256; default: the "
      "processors that the process may run on\n",
      file);
  (void)fputs(".SH EXAMPLES\n.EX\nsupine phantom \\-o lungs.ply\n"
              "supine precompute lungs.ply \\-o lungs.safetensors\n"
              "supine deform lungs.safetensors \\-\\-posture prone \\-o prone.vtp\n.EE\n",
              file);
  roff_ending(file);
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

/* What follows an option: its choices, a file, or nothing that could be guessed. */
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

static void write_bash(const supine_command *unused, FILE *file) {
  (void)unused;
  (void)fputs("# bash completion for supine; made from its tables of options\n"
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
    supine_options_visit(supine_command_list[i]->options, 0, bash_value, &c);
  }
  (void)fputs("  esac\n  case \"${COMP_WORDS[1]}\" in\n", file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    context c = {supine_command_list[i]->name, file};
    (void)fprintf(file, "  %s) words='", supine_command_list[i]->name);
    supine_options_visit(supine_command_list[i]->options, 0, bash_name, &c);
    (void)fputs("--help' ;;\n", file);
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

/* Text within zsh's '...[...]...': its own signs left out, up to the first end of a thought. */
static void zsh_text(const char *text, FILE *file) {
  const size_t length = strcspn(text, ";:\n.");
  for (size_t i = 0; i < length; ++i) {
    (void)fputc(strchr("'[]\\", text[i]) == NULL ? text[i] : ' ', file);
  }
}

static void zsh_option(void *given, const supine_option *option, size_t base) {
  const context *c = given;
  (void)base;
  if (option->name == NULL) {
    return;
  }
  (void)fprintf(c->file, "      ");
  if (option->letter != 0) {
    (void)fprintf(c->file, "'(-%c --%s)'{-%c,--%s}'[", option->letter, option->name, option->letter,
                  option->name);
  } else {
    (void)fprintf(c->file, "'--%s[", option->name);
  }
  zsh_text(option->help, c->file);
  (void)fputc(']', c->file);
  if (option->argument != NULL) {
    (void)fputc(':', c->file);
    zsh_text(option->argument, c->file);
    (void)fputc(':', c->file);
    if (option->choices != NULL) {
      (void)fputc('(', c->file);
      bash_words(option, c->file);
      (void)fputc(')', c->file);
    } else if (option->file != SUPINE_FILE_NONE) {
      (void)fputs("_files", c->file);
    }
  }
  (void)fputs("' \\\n", c->file);
}

static void write_zsh(const supine_command *unused, FILE *file) {
  (void)unused;
  (void)fputs("#compdef supine\n# made from supine's tables of options\n"
              "if (( CURRENT == 2 )); then\n  local -a commands=(\n",
              file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    (void)fprintf(file, "    '%s:", supine_command_list[i]->name);
    zsh_text(supine_command_list[i]->summary, file);
    (void)fputs("'\n", file);
  }
  (void)fputs("  )\n  _describe command commands\nelse\n  local command=$words[2]\n  shift words\n"
              "  (( CURRENT-- ))\n  case $command in\n",
              file);
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    context c = {supine_command_list[i]->name, file};
    (void)fprintf(file, "  %s)\n    _arguments \\\n", supine_command_list[i]->name);
    supine_options_visit(supine_command_list[i]->options, 0, zsh_option, &c);
    (void)fputs("      '(-h --help)'{-h,--help}'[prints help]' '*:file:_files' ;;\n", file);
  }
  (void)fputs("  esac\nfi\n", file);
}

int main(int argc, char **argv) {
  if (argc != 2) {
    (void)fputs("usage: manual FOLDER\n", stderr);
    return SUPINE_EXIT_USAGE;
  }
  write_file(write_overview, NULL, argv[1], "supine.1");
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    write_file(write_page, supine_command_list[i], argv[1], "supine-%s.1",
               supine_command_list[i]->name);
  }
  write_file(write_bash, NULL, argv[1], "supine.bash");
  write_file(write_zsh, NULL, argv[1], "_supine");
  return SUPINE_EXIT_OK;
}
