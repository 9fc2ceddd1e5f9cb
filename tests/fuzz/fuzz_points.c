/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fuzz lists of points in the file format FUZZ_ENDING. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "mesh/io/points.h"

#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
  const char *path = supine_fuzz_file(bytes, size, FUZZ_ENDING);
  supine_io_points points = {0};
  supine_error error = {0};
  const supine_status status = supine_io_points_read(path, NULL, &points, &error);
  if (status == SUPINE_OK) {
    supine_fuzz_expect(points.count > 0, "at least one point");
    for (size_t i = 0; i < points.count; ++i) {
      supine_fuzz_expect(isfinite(points.at[3 * i] + points.at[3 * i + 1] + points.at[3 * i + 2]) ||
                             fabs(points.at[3 * i]) > 1e300,
                         "finite coordinates of each point");
      supine_fuzz_expect(points.names[i] != NULL && strchr(points.names[i], '\n') == NULL,
                         "a name of one line for each point");
    }
  } else {
    supine_fuzz_expect(error.status == status && strstr(error.message, path) != NULL &&
                           points.names == NULL,
                       "no points from a refused file, and a message that names the file");
  }
  supine_io_points_free(&points);
  (void)unlink(path);
  return 0;
}

uint8_t *supine_fuzz_seed(size_t index, size_t *size) {
  static const struct {
    const char *ending;
    const char *text;
  } texts[] = {{".csv", "x,y,z,name\n1,2,3,a\n-4e1,5.5,6,\"b, \"\"c\"\"\"\n"},
               {".csv", "# list\nID;Label;Z;Y;X\n1;n 1;1,5;2;3\n"},
               {".json", "{\"markups\":[{\"coordinateSystem\":\"RAS\",\"coordinateUnits\":\"mm\","
                         "\"controlPoints\":[{\"label\":\"a\",\"position\":[1,-2.5,3e1],"
                         "\"positionStatus\":\"defined\"}]}]}"}};
  size_t seen = 0;
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    if (strcmp(texts[i].ending, FUZZ_ENDING) == 0 && seen++ == index) {
      return supine_fuzz_text(texts[i].text, size);
    }
  }
  return NULL;
}
