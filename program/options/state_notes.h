/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Say what a volume means where the model has to assume something or does not hold. */
#ifndef SUPINE_STATE_NOTES_H
#define SUPINE_STATE_NOTES_H

#include "program/options/state_options.h"

/* Print a note if a state gives a volume in mL, of all lungs or of one, while the volume at rest is
 * assumed: the state's volume relative to rest. Print another if a lung holds less than a full
 * expiration leaves. Print nothing if the volume at rest is unknown. */
void supine_options_tell_state(const char *command, const supine_basis *basis,
                               const supine_state *state, const supine_pose *pose);

#endif
