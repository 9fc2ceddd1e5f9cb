# SPDX-License-Identifier: GPL-3.0-or-later
"""Make a basis and a comparison for one subject, and record the results or the failure.

    python3 subject.py FOLDER/result.json VOLUME yes|no 'PRECOMPUTE OPTIONS' MESH...

Write basis.safetensors, report.html (if yes) and result.json into the folder. VOLUME is
the volume of the lungs for the comparison, such as rest. If the program fails for these meshes and options, write its
message to result.json as the failure. If an output cannot be written or a signal ends the program, exit with 1, so that
the next run computes the subject again. The program is $SUPINE (default: supine)."""
import json
import os
import re
import shlex
import subprocess
import sys

from names import fault

OUTPUT_FAILED = 4  # exit code of supine


def run(*arguments):
    done = subprocess.run([os.environ.get("SUPINE", "supine"), *arguments], capture_output=True,
                          text=True, check=False)
    if done.returncode == OUTPUT_FAILED or done.returncode < 0:
        sys.exit(f"{done.stderr.strip()} (exit status {done.returncode})")
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or ["the program failed without a message"]
        errors = [line for line in lines if not line.startswith("Try ") and " note: " not in line]
        raise ValueError((errors or lines)[-1])
    return done.stdout


def work(folder, volume, report, options, meshes):
    basis = os.path.join(folder, "basis.safetensors")
    page = ["-o", os.path.join(folder, "report.html")] if report == "yes" else []
    run("precompute", *meshes, *options, "-o", basis)
    comparison = run("compare", basis, "--volume", volume, "--json", *page)
    info = json.loads(run("info", basis, "--json"))
    return {"warnings": info.get("warnings", []), "info": info, "comparison": json.loads(comparison)}


def main(output, volume, report, options, *meshes):
    folder = os.path.dirname(output)
    if re.search(r"[^./]/+\.\./", output) or fault(os.path.basename(folder)):
        sys.exit(f"{output}: name the subject by letters, digits and - . _ +, as this names its folder")
    os.makedirs(folder, exist_ok=True)
    result = {"subject": os.path.basename(folder)}
    for stale in ("basis.safetensors", "report.html"):
        if os.path.exists(os.path.join(folder, stale)):
            os.unlink(os.path.join(folder, stale))
    try:
        result.update(work(folder, volume, report, shlex.split(options), meshes))
    except ValueError as error:
        result["failure"] = str(error)
    with open(output + ".part", "w", encoding="utf-8") as file:
        json.dump(result, file, indent=1)
    os.replace(output + ".part", output)


main(*sys.argv[1:])
