// SPDX-License-Identifier: GPL-3.0-or-later
// The headers of the run-time library, from C++.
#include <supine/posture.h>
#include <supine/runtime.h>
#include <supine/safetensors.h>
#include <supine/sh.h>

int main() {
  double gravity[3];
  supine_basis *basis = nullptr;
  supine_error error;
  const supine_status status = supine_basis_open("/nonexistent", &basis, &error);
  return supine_posture_gravity("prone", gravity) == SUPINE_OK && gravity[1] == -1 &&
                 status == SUPINE_ERROR_READ
             ? 0
             : 1;
}
