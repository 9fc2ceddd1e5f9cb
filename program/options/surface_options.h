/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Declare the options for axes, units and landmarks, for commands that read surfaces. */
#ifndef SUPINE_SURFACE_OPTIONS_H
#define SUPINE_SURFACE_OPTIONS_H

#include <supine/findings.h>

#include "mesh/mesh.h"

#include "precompute/patient/patient.h"
#include "program/options/command.h"

/* Option table of --axes and --units, which fill a supine_mesh_load_options. */
extern const supine_option supine_options_surface_frame[];

/* Matched points in two scans of one person, and the kind of motion to fit between the scans. */
typedef struct supine_landmark_options {
  const char *path; /* CSV file; NULL if there are no landmarks */
  bool reverse, translation, rigid;
} supine_landmark_options;

/* Option table of --landmarks, --reverse, --translation and --rigid, which fill a
 * supine_landmark_options. */
extern const supine_option supine_options_landmarks[];

/* Return the motion between the scans that the options name. */
supine_patient_scan_motion supine_options_scan_motion(const supine_landmark_options *landmarks);

/* Print the findings about an input to stderr, one per line. */
void supine_options_say_findings(const char *command, const supine_findings *findings);

#endif
