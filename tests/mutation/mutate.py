#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutation testing: the code with one thing wrong, built and tested; a test must fail.

    mutate.py named [PATTERN]          those of named.txt whose title has the pattern
    mutate.py random [COUNT] [SEED]    a random COUNT (100) of places in the rooms below

Works on a copy of what is committed, in build/mutation. A mutant is killed where a test fails or runs
beyond its time; one that does not compile does not count. Random mutants meet the tests in groups, those
of the mutant's room first, then the quick, then the slower, until one fails; tests that fail without any
mutant are left out, and so are those that take longer than SLOW and those of real lungs, so that what
survives is an upper bound. CMake's further options come from SUPINE_CMAKE_OPTIONS.
"""
import os
import random
import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
FOLDER = SOURCE / "build" / "mutation"
COPY = FOLDER / "source"
BUILD = FOLDER / "build"
ROOMS = ("sh", "mesh", "precompute", "runtime")
QUICK, SLOW = 2.0, 40.0  # s, without a mutant
JOBS = str(len(os.sched_getaffinity(0)))  # as many as it may use
# What reads the sources rather than the program, or asks more of the machine than it has at hand.
LEFT_OUT = (r"house|readme_example|install|python|windows|stream_(link|slicer|page|igtl)|export_.*_node|"
            r"cohort|bids|manual|fuzz_.*")
# Where a mutant most probably dies, by the beginning of its path; the longest that fits is taken.
NEAR = {
    "sh": "base|sh_basis|sh_grid|transform|aliasing", "mesh": "mesh_.*|labels|image",
    "mesh/image": "image|labels", "mesh/labels": "labels", "mesh/read": "mesh_load|mesh_hostile",
    "mesh/save": "mesh_save", "precompute": "command_output|equilibrium|projection|fields",
    "precompute/physics": "equilibrium|inverse|force|reach|torture|disease",
    "precompute/patient": "patient|patient_surface|patient_command", "precompute/fields": "fields",
    "precompute/lungs": "lungs|mesh_lungs", "precompute/inside": "inside|command_output",
    "precompute/command": "command_output|program|patient_command|tissue_command",
    "runtime": "deform|runtime_basis|volume|posture|runtime_quiet|deform_lit",
    "runtime/breath": "pv_.*", "runtime/compare": "compare", "runtime/command": "command_output|program",
    "runtime/export": "export_glb|export_html|export_command|command_output", "runtime/field": "field|inside",
    "runtime/options": "command_output|program", "runtime/render": "render|pictures_command",
    "runtime/report": "pictures_command|command_output", "runtime/safetensors": "safetensors|golden",
    "runtime/stream": "stream_gravity|stream_poses|stream_wire|stream_igtl|stream_server",
}


def run(*command, cwd=BUILD):
    done = subprocess.run(command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True, errors="replace", check=False)
    return done.returncode, done.stdout


def prepare():
    subprocess.run(["rm", "-rf", str(COPY)], check=True)
    COPY.mkdir(parents=True)
    archive = subprocess.run(["git", "-C", str(SOURCE), "archive", "HEAD"], check=True,
                             stdout=subprocess.PIPE).stdout
    subprocess.run(["tar", "-x", "-C", str(COPY)], input=archive, check=True)
    options = shlex.split(os.environ.get("SUPINE_CMAKE_OPTIONS", ""))
    code, said = run("cmake", "-S", str(COPY), "-B", str(BUILD), "-G", "Ninja",
                     "-DCMAKE_BUILD_TYPE=Release", "-DSUPINE_LUNGS=none", *options, cwd=FOLDER)
    if code != 0 or not build():
        sys.exit("the unchanged code does not build: " + said[-2000:])


def build(targets=()):
    wanted = [word for target in targets for word in ("--target", target)]
    return run("cmake", "--build", str(BUILD), "-j", JOBS, *wanted)[0] == 0


def failed_tests(regex, limit=3600):
    """Names of the tests among those of the pattern that fail, at most a few; none may take limit seconds."""
    code, said = run("timeout", "-k", "9", str(limit), "ctest", "-R", regex, "-j", JOBS, "--stop-on-failure",
                     "--timeout", str(4 * SLOW))
    if code == 124:
        return [f"longer than {limit} s"]
    return re.findall(r"Test +#\d+: (\S+) \.*\*\*\*(?!Skipped)", said)


def programs(names):
    """Targets of these tests."""
    return ["supine", *(f"test_{name}" for name in names if (COPY / "tests" / f"test_{name}.c").exists())]


def tries(path, changed, groups, limit=3600):
    """The test that reports the change, '' where none does, None where it does not compile. A group is
    tests' names."""
    file = COPY / path
    before = file.read_text()
    file.write_text(changed)
    try:
        for names in groups:
            if not build(programs(names)):
                return None
            failed = failed_tests("^(" + "|".join(names) + ")$", limit)
            if failed:
                return failed[0]
        return ""
    finally:
        file.write_text(before)


def named(word):
    mutants = []
    for block in (Path(__file__).parent / "named.txt").read_text().split("\n\n"):
        fields = dict(re.findall(r"^([#@\-+~]) ?(.*)$", block, re.M))
        if "@" in fields and re.search(word, fields["#"]):
            mutants.append(fields)
    survived = 0
    failed = failed_tests("^(" + "|".join(sorted({m["~"] for m in mutants})) + ")$")
    if failed:
        sys.exit(f"without a mutant fails {failed}")
    for m in mutants:
        text = (COPY / m["@"]).read_text()
        if text.count(m["-"]) != 1:
            print(f"STALE     {m['#']}: {m['@']} has {text.count(m['-'])} times: {m['-']}")
            survived += 1
            continue
        line = text[:text.index(m["-"])].count("\n") + 1
        by = tries(m["@"], text.replace(m["-"], m["+"]), [m["~"].split("|")])
        survived += not by
        verdict = "no build " if by is None else "killed   " if by else "SURVIVED "
        print(f"{verdict} {m['#']}, {m['@']}:{line}: {by}", flush=True)
    print(f"{len(mutants) - survived} of {len(mutants)} named mutants killed")
    return survived == 0


OPERATORS = [  # what is looked for, and what may take its place
    (r" < ", [" <= ", " > "]), (r" > ", [" >= ", " < "]), (r" <= ", [" < "]), (r" >= ", [" > "]),
    (r" == ", [" != "]), (r" != ", [" == "]), (r" && ", [" || "]), (r" \|\| ", [" && "]),
    (r" \+ ", [" - "]), (r" - ", [" + "]), (r" \* (?=[\w(])", [" / "]), (r" / ", [" * "]),
    (r" \+= ", [" -= "]), (r" -= ", [" += "]), (r"\b0\b(?!\.)", ["1"]), (r"\b1\b(?!\.)", ["0", "2"]),
    (r"\b\d+\.\d+\b", ["(1.3 * \\g<0>)", "(0.5 + \\g<0>)"]), (r"(?<=if \()(?=.)", ["!"]),
    (r"\btrue\b", ["false"]), (r"\bfalse\b", ["true"]), (r"\bfmax\b", ["fmin"]),
    (r"\bfmin\b", ["fmax"]),
    (r"^ +[a-z][\w>.\[\]-]*(\([^()]*\))?( [+-]?= [^;{}]*)?;$", [";"]),  # a statement less
]


def places():
    found = []
    for room in ROOMS:
        for file in sorted((COPY / room).rglob("*.c")):
            comment = False
            for number, line in enumerate(file.read_text().splitlines()):
                starts = line.lstrip().startswith(("/*", "//", "*", "#", "static_assert", "case "))
                comment = comment or line.lstrip().startswith("/*")
                if not (comment or starts) and not re.search(r'"|_Alignas|memset|for \(.*\+\+', line):
                    code = line.split("/*")[0]
                    for pattern, instead in OPERATORS:
                        for match in re.finditer(pattern, code):
                            found.append((file, number, match, instead))
                comment = comment and "*/" not in line
    return found


def random_ones(count, seed):
    chosen = random.Random(seed)
    quick, slower, limit = measured_groups()
    every = places()
    print(f"{len(every)} places in {len({p[0] for p in every})} files; seed {seed}")
    chosen.shuffle(every)
    killed = survived = 0
    for file, number, match, instead in every:
        if killed + survived == count:
            break
        lines = file.read_text().splitlines(keepends=True)
        line = lines[number]
        lines[number] = line[:match.start()] + match.expand(chosen.choice(instead)) + line[match.end():]
        path = str(file.relative_to(COPY))
        room = max((r for r in NEAR if path.startswith(r)), key=len)
        near = [n for n in quick + slower if re.fullmatch(NEAR[room], n)]
        groups = [near, [n for n in quick if n not in near], [n for n in slower if n not in near]]
        by = tries(path, "".join(lines), [names for names in groups if names], limit)
        if by is None:
            continue
        killed += bool(by)
        survived += not by
        print(f"{'killed  ' if by else 'SURVIVED'} {path}:{number + 1}: {lines[number].strip()}"
              f"  [was {line.strip()}] {by}", flush=True)
    print(f"{killed} of {killed + survived} random mutants killed, seed {seed}")
    return killed >= 0.9 * (killed + survived)


def measured_groups():
    """The quick and the slower tests that pass unchanged, and the seconds that none of the groups needs."""
    _, said = run("ctest", "-E", f"^({LEFT_OUT})$", "-j", JOBS)
    passed = [(name, float(took))
              for name, took in re.findall(r"Test +#\d+: (\S+) \.+ +Passed +([\d.]+) sec", said)]
    quick = [name for name, took in passed if took <= QUICK]
    slower = [name for name, took in passed if QUICK < took <= SLOW]
    print(f"tests: {len(quick)} quick, {len(slower)} slower, "
          f"{len(passed) - len(quick) - len(slower)} too slow for this", flush=True)
    return quick, slower, 60 + 10 * int(sum(took for _, took in passed if took <= SLOW))


def main():
    began = time.time()
    what = sys.argv[1] if len(sys.argv) > 1 else ""
    if what not in ("named", "random"):
        sys.exit(__doc__)
    prepare()
    if what == "named":
        good = named(sys.argv[2] if len(sys.argv) > 2 else "")
    else:
        good = random_ones(int(sys.argv[2]) if len(sys.argv) > 2 else 100,
                           int(sys.argv[3]) if len(sys.argv) > 3 else 1)
    print(f"{(time.time() - began) / 60:.0f} minutes")
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
