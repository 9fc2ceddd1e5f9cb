/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write a small synthetic basis to the given path. */
#include "tests/helpers/runtime_fixture.h"

int main(int argc, char **argv) {
  if (argc != 2) {
    return 1;
  }
  fixture *f = fixture_create(100, 5, 2, 2, false, true, 5, 2008);
  fixture_write(f, argv[1]);
  fixture_destroy(f);
  return 0;
}
