/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print the help of a command from its table of options. */
#include <string.h>

#include "program/options/command.h"

enum { WIDTH = 80, TEXT_COLUMN = 23 };

/* Print the words of one line between the columns `left` and WIDTH, starting at `column`. */
static void print_words(const char *line, size_t length, size_t column, size_t left, FILE *file) {
  for (size_t at = 0; at < length;) {
    const char *word = line + at;
    const char *space = memchr(word, ' ', length - at);
    const size_t letters = space != NULL ? (size_t)(space - word) : length - at;
    const bool first = at == 0 || column == left;
    if (!first && column + 1 + letters > WIDTH) {
      (void)fprintf(file, "\n%*s%.*s", (int)left, "", (int)letters, word);
      column = left + letters;
    } else {
      (void)fprintf(file, "%s%.*s", first ? "" : " ", (int)letters, word);
      column += letters + (first ? 0 : 1);
    }
    at += letters + 1;
  }
}

/* Print text between the columns `left` and WIDTH, starting at `column`; lines that begin with a
 * space are not wrapped. */
static void print_text(const char *text, size_t column, size_t left, FILE *file) {
  for (;;) {
    const size_t length = strcspn(text, "\n");
    if (text[0] == ' ') {
      (void)fprintf(file, "%.*s", (int)length, text);
    } else {
      print_words(text, length, column, left, file);
    }
    (void)fputc('\n', file);
    if (text[length] == '\0' || text[length + 1] == '\0') {
      return;
    }
    text += length + 1;
    (void)fprintf(file, "%*s", text[0] == '\n' ? 0 : (int)left, "");
    column = left;
  }
}

static void visit(const supine_option *options, size_t base, supine_option_visit *each,
                  void *context) {
  for (const supine_option *option = options;
       option->name != NULL || option->help != NULL || option->table != NULL; ++option) {
    if (option->table != NULL) {
      visit(option->table, base + option->offset, each, context);
    } else {
      each(context, option, base);
    }
  }
}

void supine_options_visit(const supine_command *command, supine_option_visit *each, void *context) {
  visit(command->options, 0, each, context);
  visit(supine_options_of_all, command->request_size, each, context);
}

typedef struct printing {
  FILE *file;
  bool all;
  size_t hidden;       /* number of options that only --help-all shows */
  const char *heading; /* heading to print before the next option; NULL if none */
} printing;

static void print_row(void *context, const supine_option *option, size_t base) {
  printing *p = context;
  FILE *file = p->file;
  char text[2048];
  (void)base;
  if (option->name == NULL) {
    p->heading = option->help;
    return;
  }
  if (option->more && !p->all) {
    ++p->hidden;
    return;
  }
  if (p->heading != NULL) {
    (void)fputc('\n', file);
    print_text(p->heading, 0, 0, file);
    p->heading = NULL;
  }
  const char letter[] = {'-', option->letter, ',', ' ', '\0'};
  const int used = fprintf(file, "  %s--%s%s%s", option->letter != 0 ? letter : "", option->name,
                           option->argument != NULL ? " " : "",
                           option->argument != NULL ? option->argument : "");
  const bool beside = used + 2 <= TEXT_COLUMN;
  (void)fprintf(file, "%s%*s", beside ? "" : "\n", beside ? TEXT_COLUMN - used : TEXT_COLUMN, "");
  const char *units = supine_quantity_units(option->quantity);
  (void)snprintf(
      text, sizeof text, "%s%s%s%s%s", option->help, option->standard != NULL ? "; default " : "",
      option->standard != NULL ? option->standard : "", units[0] != '\0' ? ". Units: " : "", units);
  print_text(text, TEXT_COLUMN, TEXT_COLUMN, file);
}

void supine_options_print_help(const supine_command *command, bool all, FILE *file) {
  printing p = {file, all, 0, NULL};
  const char *lead = "Usage:";
  for (const char *usage = command->usage; *usage != '\0'; lead = "      ") {
    const size_t length = strcspn(usage, "\n");
    (void)fprintf(file, "%s supine %s %.*s\n", lead, command->name, (int)length, usage);
    usage += length + (usage[length] == '\n' ? 1 : 0);
  }
  (void)fputc('\n', file);
  print_text(command->about, 0, 0, file);
  (void)fputc('\n', file);
  supine_options_visit(command, print_row, &p);
  if (p.hidden > 0) {
    (void)fprintf(file, "\nMore: %zu further option%s, shown by 'supine %s --help-all'.\n",
                  p.hidden, p.hidden == 1 ? "" : "s", command->name);
  }
  if (command->notes != NULL) {
    (void)fputc('\n', file);
    print_text(command->notes, 0, 0, file);
  }
}
