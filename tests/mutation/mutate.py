#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutation testing: the code with one thing wrong, built and tested; a test must fail.

    mutate.py named [PATTERN]          those of named.txt whose title has the pattern
    mutate.py random [COUNT] [SEED]    a random COUNT (100) of places in the rooms below

Works on a copy of what is committed, in build/mutation. A mutant is killed where a test fails or runs
beyond its time; one that does not compile does not count. Random mutants meet the tests in two groups,
the quick first, until one fails; tests that fail without any mutant are left out, and so are those
that take longer than SLOW, so that what survives is an upper bound. CMake's further options come from
SUPINE_CMAKE_OPTIONS.
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
QUICK, SLOW = 2.0, 15.0  # s, without a mutant
JOBS = str(len(os.sched_getaffinity(0)))  # as many as it may use
# What reads the sources rather than the program, or asks more of the machine than it has at hand.
LEFT_OUT = r"house|readme_example|install|stream_|export_.*_node|cohort|manual"


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
                     "-DCMAKE_BUILD_TYPE=Release", *options, cwd=FOLDER)
    if code != 0 or not build():
        sys.exit("the unchanged code does not build: " + said[-2000:])


def build(targets=()):
    wanted = [word for target in targets for word in ("--target", target)]
    return run("cmake", "--build", str(BUILD), "-j", JOBS, *wanted)[0] == 0


def failed_tests(regex, limit=300):
    """Names of the tests among those of the pattern that fail, at most a few."""
    _, said = run("ctest", "-R", regex, "-j", JOBS, "--timeout", str(limit),
                  "--stop-on-failure")
    return re.findall(r"Test +#\d+: (\S+) \.*\*\*\*", said)


def tries(path, changed, groups, targets=()):
    """The test that reports the change, '' where none does, None where it does not compile."""
    file = COPY / path
    before = file.read_text()
    file.write_text(changed)
    try:
        if not build(targets):
            return None
        for regex in groups:
            failed = failed_tests(regex)
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
    for m in mutants:
        text = (COPY / m["@"]).read_text()
        if text.count(m["-"]) != 1:
            print(f"STALE     {m['#']}: {m['@']} has {text.count(m['-'])} times: {m['-']}")
            survived += 1
            continue
        line = text[:text.index(m["-"])].count("\n") + 1
        programs = [f"test_{name}" for name in m["~"].split("|")
                    if (COPY / "tests" / f"test_{name}.c").exists()]
        by = tries(m["@"], text.replace(m["-"], m["+"]), [f"^({m['~']})$"], ["supine", *programs])
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
                if not (comment or starts) and not re.search(r'"|_Alignas|for \(.*\+\+', line):
                    code = line.split("/*")[0]
                    for pattern, instead in OPERATORS:
                        for match in re.finditer(pattern, code):
                            found.append((file, number, match.span(), pattern, instead))
                comment = comment and "*/" not in line
    return found


def random_ones(count, seed):
    chosen = random.Random(seed)
    regexes = measured_groups()
    every = places()
    print(f"{len(every)} places in {len({p[0] for p in every})} files; seed {seed}")
    chosen.shuffle(every)
    killed = survived = 0
    for file, number, (begin, end), pattern, instead in every:
        if killed + survived == count:
            break
        lines = file.read_text().splitlines(keepends=True)
        line = lines[number]
        new = re.sub(pattern, chosen.choice(instead), line[begin:end]) if end > begin else instead[0]
        lines[number] = line[:begin] + new + line[end:]
        path = str(file.relative_to(COPY))
        by = tries(path, "".join(lines), regexes)
        if by is None:
            continue
        killed += bool(by)
        survived += not by
        print(f"{'killed  ' if by else 'SURVIVED'} {path}:{number + 1}: {lines[number].strip()}"
              f"  [was {line.strip()}] {by}", flush=True)
    print(f"{killed} of {killed + survived} random mutants killed, seed {seed}")
    return killed >= 0.9 * (killed + survived)


def measured_groups():
    """Patterns of the quick and the slower tests that pass unchanged."""
    _, said = run("ctest", "-E", LEFT_OUT, "-j", JOBS, "--timeout", "60")
    passed = re.findall(r"Test +#\d+: (\S+) \.+ +Passed +([\d.]+) sec", said)
    quick = [name for name, took in passed if float(took) <= QUICK]
    slower = [name for name, took in passed if QUICK < float(took) <= SLOW]
    print(f"tests: {len(quick)} quick, {len(slower)} slower, "
          f"{len(passed) - len(quick) - len(slower)} too slow for this")
    return ["^(" + "|".join(names) + ")$" for names in (quick, slower) if names]


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
