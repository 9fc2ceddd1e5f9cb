# SPDX-License-Identifier: MIT
"""The package's words for what to do about errors and warnings of the C libraries."""
from __future__ import annotations

# Words of each supine_remedy (<supine/status.h>), in its order. They follow the message; the value of the argument
# stands for "{}".
WORDS = {
    "none": "",
    "basis_with_rest": ", or make the basis again, without scanned='none' and law='paper'",
    "allow_folds": ", or open the basis with allow_folds=True",
    "locate_volume": ", or give volume",
    "axes": "; give the axes, for example axes='{}'",
    "axes_add": ": add axes='{}'",
    "axes_if_right": "; if those are the axes, add axes='{}'",
    "unit": ", or give its units",
    "unit_add": ": add units='{}'",
    "unit_or_accept": ": add units='{}'. To use this size all the same, add units='mm'",
    "size_accept": ". To use this size all the same, add units='mm'",
    "points_clamp": " (axes, units), or give clamp=True to move them like the nearest point of the surface",
    "labels": " Give labels, such as {{'left': '10+11', 'right': '12+13+14'}} or 'totalsegmentator'",
    "labels_one_lung": ". Correct labels, or name only one lung, such as labels={{'{}': '1+2'}}",
    "labels_check": ", and labels",
    "labels_side": ". If it is one lung, name the side by labels: {{'left': LABEL}} or {{'right': LABEL}}",
    "labels_exchange": ". Exchange left and right in labels, or correct axes",
    "labels_or_axes": ": if the labels are correct, add axes='{}'",
    "labels_axes_or_keep": ": if the labels are correct, add axes='{}'; if the header is correct, give its axes "
                           "by axes",
    "close": ": close=MM closes narrow ones",
    "map_unit": ": leave units out, or give units='mm' to accept any size of the lungs",
    "map_options": ": leave labels, edge, close and surfaces_out out",
    "edge": ": give another edge",
    "lungs_separate": " (for a label map by labels='one'). If it is a single lung, give midline",
    "midline": "; midline={} would make it the other lung",
    "force": ": change base or gain",
    "constants": ": change constants",
    "reach": ": give reach=10, or leave soften out",
    "scan_state": ". Change scanned",
    "scan_or_rest": ": change scanned or resting",
    "scan_fuller": ". If the scan is fuller than scanned says, change scanned or resting; scanned='none' uses the "
    "scan as "
                   "it is",
    "scan_full_or_rest": ": change full, scanned or resting",
    "scan_not_full": ": give its state by scanned, such as 'supine:rest' or 'full-1000'",
    "scan_or_rest_give": ": if the scan was not at full inflation, give its state, such as scanned='supine:rest'; "
    "otherwise "
                         "change resting",
    "scan_emptier": " and resting; if the scan was emptier than rest, say so, as in scanned='supine:rest-300'",
    "scan_over_rest": ": if the scan was fuller than rest, give scanned='full' or 'supine:rest+1000', or change "
                      "resting",
    "scan_give": ", or give the state of this one, such as scanned='supine:rest'",
    "scan_assumed": "; scanned changes this",
    "rest_or_as_is": "; give resting, or take the scan as it is by scanned='none'",
    "full_and_scan": ": give full, such as '4200mL', and scanned='supine:rest'",
    "law_or_scan": ": leave scanned out, or use law='deep'",
    "band_out": ", or leave band out",
    "harmonics": ": give modes=16, or band=7 or less",
    "law_deep": ", or use the law 'deep' of 'supine fit'",
    "fit_landmarks": "; give --landmarks to 'supine fit'",
    "scan_motion": " by --translation or --rigid of 'supine fit'",
    "scans_exchange": ": exchange --rest and --other of 'supine fit', or give --reverse",
    "scans_volumes": ", such as --rest 2600mL --other 5400mL of 'supine fit'",
    "rest_check": ": check --rest of 'supine fit'",
    "other_state": ": give --to POSTURE:VOLUME of 'supine validate'",
    "points_reverse": ", or exchange first and second points by --reverse of 'supine validate'",
    "basis_of_state": ": make a new basis, and state by scanned how full the lungs were in the scan",
    "grid": ": make one by embed(basis, grid=MM) or embed(basis, IMAGE)",
    "density": ", or leave density out",
    "expandability_out": ": leave expandability out",
}


def words(remedy: int, value: str) -> str:
    """Return the words of a remedy, with the punctuation that joins them to a message."""
    names = list(WORDS)
    return WORDS[names[remedy]].format(value) if 0 <= remedy < len(names) else ""
