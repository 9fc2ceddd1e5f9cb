/* SPDX-License-Identifier: GPL-3.0-or-later */
/* How expected errors are told. */
#ifndef SUPINE_OPTIONS_EXPECTED_H
#define SUPINE_OPTIONS_EXPECTED_H

#define SUPINE_EXPECTED_MEANING                                                                    \
  "3-D RMS; half of all points lie within 0.9 times theirs, 95 % within 1.8"
#define SUPINE_EXPECTED_SUPPORT                                                                    \
  "It was measured on full breaths in one posture; for a change of posture it is an "              \
  "extrapolation."

#endif
