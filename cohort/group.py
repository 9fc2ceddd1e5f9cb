# SPDX-License-Identifier: GPL-3.0-or-later
"""Write one table and one page of all subjects: volumes, displacements, outliers, failures.

    python3 group.py GROUP.csv GROUP.html RESULT.json...

An outlier differs from the median of the cohort by more than 3.5 times 1.4826 median absolute deviations
(rule of Iglewicz and Hoaglin)."""
import csv
import html
import json
import statistics
import sys

LIMIT = 3.5
TO_SIGMA = 1.4826  # standard deviation / median absolute deviation of a normal distribution


def numbers(result):
    """Return the numbers of one subject as a dict from the name of a column to its value."""
    info, comparison = result["info"], result["comparison"]
    found = {"vertices": info["vertices"], "error_rms_percent": info["error"].get("rms_percent")}
    lungs = info["lungs"].split(",")
    for lung, volume in zip(lungs, str(info.get("reference_volume_ml", "")).split(",")):
        found[f"{lung}_lung_ml"] = float(volume) if volume else None
    for posture in comparison["postures"]:
        found[f"rms_in_{posture['name']}_mm"] = posture["displacement_mm"]["rms"]
        for lung, volume in posture.get("volume_ml", {}).items():
            found[f"{lung}_lung_in_{posture['name']}_ml"] = volume["value"]
        for lung, gain in (posture.get("gain_ml") or {}).items():
            found[f"gain_of_{lung}_lung_in_{posture['name']}_ml"] = gain
    return found


def outliers(column):
    """Return whether each number of a column is an outlier."""
    known = [x for x in column if x is not None]
    if len(known) < 5:
        return [False] * len(column)
    middle = statistics.median(known)
    spread = TO_SIGMA * statistics.median(abs(x - middle) for x in known)
    return [x is not None and abs(x - middle) > LIMIT * spread + 1e-9 * abs(middle) for x in column]


def page(names, subjects, table, apart, warnings, failures):
    def cell(name, i):
        value = table[name][i]
        text = "" if value is None else f"{value:.4g}"
        return f'<td class="apart">{text}</td>' if apart[name][i] else f"<td>{text}</td>"

    def said(i):
        return '<td class="said">' + '<br>'.join(html.escape(line) for line in warnings[i])

    head = "".join(f"<th>{html.escape(name.replace('_', ' '))}</th>" for name in names)
    body = "".join(f"<tr><th>{html.escape(s)}</th>{''.join(cell(n, i) for n in names)}{said(i)}</td></tr>\n"
                   for i, s in enumerate(subjects))
    failed = "".join(f"<li><b>{html.escape(s)}</b>: {html.escape(why)}</li>\n" for s, why in failures)
    warned = sum(bool(lines) for lines in warnings)
    strange = sum(any(apart[n][i] for n in names) for i in range(len(subjects)))
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Cohort</title><style>
body {{ font: 15px/1.5 system-ui, sans-serif; margin: 2rem; color: #222; background: #fff; }}
div {{ overflow-x: auto; }} table {{ border-collapse: collapse; font-variant-numeric: tabular-nums; }}
th, td {{ padding: .2rem .6rem; text-align: right; border-bottom: 1px solid #ddd; }}
thead th {{ vertical-align: bottom; }} tbody th {{ text-align: left; white-space: nowrap; }}
.said {{ text-align: left; min-width: 20rem; }}
.apart {{ background: #fde3c8; font-weight: bold; }}
</style></head><body>
<h1>{len(subjects) + len(failures)} subjects: {len(subjects)} done, {len(failures)} failed</h1>
{'<h2>Failed</h2><ul>' + failed + '</ul>' if failures else ''}
<h2>Results</h2>
<p>Subjects with an outlier: {strange} (shaded: differs from the median by more than {LIMIT} times
{TO_SIGMA} median absolute deviations). Subjects with a warning (the last column): {warned}.</p>
<div><table><thead><tr><th></th>{head}<th>warnings</th></tr></thead><tbody>
{body}</tbody></table></div></body></html>
"""


def main(table_path, page_path, *paths):
    results = []
    for path in paths:
        with open(path, encoding="utf-8") as file:
            results.append(json.load(file))
    names = [r["subject"] for r in results]
    if len(set(names)) < len(names):
        sys.exit(f"more than one result for {', '.join(sorted({n for n in names if names.count(n) > 1}))}")
    failures = [(r["subject"], r["failure"]) for r in results if "failure" in r]
    done = [r for r in results if "failure" not in r]
    rows = [numbers(r) for r in done]
    names = list(dict.fromkeys(name for row in rows for name in row))
    table = {name: [row.get(name) for row in rows] for name in names}
    apart = {name: outliers(table[name]) for name in names}
    subjects = [r["subject"] for r in done]
    warnings = [r.get("warnings", []) for r in done]
    with open(table_path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["subject", *names, "stands_apart_in", "warnings", "failure"])
        for i, subject in enumerate(subjects):
            strange = " ".join(name for name in names if apart[name][i])
            writer.writerow([subject, *(table[name][i] for name in names), strange,
                             "; ".join(warnings[i]), ""])
        for subject, why in failures:
            writer.writerow([subject, *("" for _ in names), "", "", why])
    with open(page_path, "w", encoding="utf-8") as file:
        file.write(page(names, subjects, table, apart, warnings, failures))


main(*sys.argv[1:])
