# SPDX-License-Identifier: GPL-3.0-or-later
"""Check the workflows without running them: test_workflows.py SOURCE_FOLDER

Each file must be YAML with triggers, least permissions, and jobs in a Debian container with a time limit. Each command
of cmake/debian.sh and each target that a step names must exist, and README's two commands and `platforms` must be run.
Exit with 77 if python3-yaml is missing."""
import glob
import os
import re
import sys

try:
    import yaml
except ImportError:
    print("skipped: no python3-yaml")
    sys.exit(77)

source = sys.argv[1]
faults = []


def read(name):
    with open(os.path.join(source, name), encoding="utf-8") as file:
        return file.read()


script = read("cmake/debian.sh")
modes = set(re.findall(r"^#   sh cmake/debian\.sh (\w+)", script, re.M))
wanted = set(re.findall(r"sh cmake/debian\.sh (\w+)", read("README.md"))) | {"platforms"}
targets = set(re.findall(r"add_custom_target\((\w+)", read("docs/CMakeLists.txt")))


def check_job(name, key, job):
    """Return the commands of one job, with the values of its matrix filled in."""
    for member in ("runs-on", "timeout-minutes", "steps"):
        if member not in job:
            faults.append(f"{name}: job {key} has no {member}")
    if not str(job.get("container", "")).startswith("debian:"):
        faults.append(f"{name}: job {key} does not run in a Debian container")
    matrix = job.get("strategy", {}).get("matrix", {})
    commands = []
    for step in job.get("steps", []):
        if ("run" in step) == ("uses" in step):
            faults.append(f"{name}: a step of job {key} needs either run or uses: {step}")
        texts = [step.get("run", "")]
        for variable, values in matrix.items():
            place = "${{ matrix.%s }}" % variable
            texts = [text.replace(place, str(value)) for text in texts for value in (values if place in text else [""])]
        commands += [text for text in texts if text]
    return commands


paths = sorted(glob.glob(os.path.join(source, ".github/workflows/*.yml")))
run = []
for path in paths:
    name = os.path.basename(path)
    flow = yaml.safe_load(read(path))
    # YAML 1.1 reads the key `on` as true.
    for member in ("name", True, "permissions", "jobs"):
        if member not in flow:
            faults.append(f"{name}: no {'on' if member is True else member}")
    if flow.get("permissions") != {"contents": "read"}:
        faults.append(f"{name}: permissions are not contents: read")
    if "never ran" not in read(path):
        faults.append(f"{name}: does not say that it never ran")
    for key, job in flow.get("jobs", {}).items():
        run += check_job(name, key, job)
used = {mode for text in run for mode in re.findall(r"sh cmake/debian\.sh (\S+)", text)}
faults += [f"cmake/debian.sh has no command {mode}" for mode in sorted(used - modes)]
faults += [f"no workflow runs sh cmake/debian.sh {mode}" for mode in sorted(wanted - used)]
built = {target for text in run for target in re.findall(r"--target (\S+)", text)}
faults += [f"there is no target {target}" for target in sorted(built - targets)]
if "docs" not in built:
    faults.append("no workflow builds the site")
if not paths:
    faults.append("no workflows")
print("\n".join(faults) or f"{len(paths)} workflows, {len(run)} commands")
sys.exit(1 if faults else 0)
