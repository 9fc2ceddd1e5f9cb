#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutation testing: change the code in one place, build it, and check that a test fails.

    mutate.py named [PATTERN]          the mutants in named.txt, or those whose title matches PATTERN
    mutate.py random [COUNT] [SEED]    COUNT (default 100) random mutants of the code in FOLDERS

A mutant is the code of the last commit with one change, made in a copy in build/mutation. The mutant is killed if a
test fails or exceeds its time limit. A mutant that does not compile does not count. For a random mutant, only tests
that reach the changed line are run, quick ones first, until one fails or they have taken ENOUGH seconds. To find the
tests that reach a line, each test runs once alone in an instrumented build; the results are kept for other seeds of the
same commit. Tests that fail in the instrumented build, take longer than SLOW seconds there or are listed in LEFT_OUT
are not used. Because some tests are not used, the number of survivors is an upper bound. The environment variable
SUPINE_CMAKE_OPTIONS adds options for cmake, such as -DSUPINE_LUNGS=FOLDER.
"""
import json
import os
import random
import re
import shlex
import subprocess
import sys
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from itertools import accumulate
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
FOLDER = SOURCE / "build" / "mutation"
COPY = FOLDER / "source"
BUILD = FOLDER / "build"
COMMIT = subprocess.run(["git", "-C", str(SOURCE), "rev-parse", "HEAD"], check=True, text=True,
                        stdout=subprocess.PIPE).stdout.strip()
FOLDERS = ("base", "sh", "mesh", "precompute", "runtime", "program")
QUICK, SLOW = 2.0, 320.0  # time in the instrumented build, s, up to which a test runs first, and is used at all
ENOUGH = 240.0  # longest total time of the tests of one mutant, s
JOBS = str(len(os.sched_getaffinity(0)))  # number of processors
# tests that read the sources, rebuild the project, or accept any input
LEFT_OUT = r"house|readme_example|install|windows|fuzz_.*"


def run(*command, cwd=BUILD, **environment):
    done = subprocess.run(command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True, errors="replace", check=False, env={**os.environ, **environment})
    return done.returncode, done.stdout


def prepare():
    subprocess.run(["rm", "-rf", str(COPY)], check=True)
    COPY.mkdir(parents=True)
    archive = subprocess.run(["git", "-C", str(SOURCE), "archive", COMMIT], check=True,
                             stdout=subprocess.PIPE).stdout
    subprocess.run(["tar", "-x", "-C", str(COPY)], input=archive, check=True)
    configure(BUILD, "-DCMAKE_BUILD_TYPE=Release")
    if not build():
        sys.exit("the unchanged code does not build")


def configure(folder, *options):
    code, said = run("cmake", "-S", str(COPY), "-B", str(folder), "-G", "Ninja", *options,
                     *shlex.split(os.environ.get("SUPINE_CMAKE_OPTIONS", "")), cwd=FOLDER)
    if code != 0:
        sys.exit("the unchanged code is not configured: " + said[-2000:])


def build(folder=BUILD):
    return run("cmake", "--build", str(folder), "-j", JOBS)[0] == 0


def failed_tests(names):
    """Run these tests in parallel until one fails or exceeds its time limit. Return the names of those that failed."""
    _, said = run("ctest", "-R", f"^({'|'.join(names)})$", "-j", JOBS, "--stop-on-failure") if names else (0, "")
    return re.findall(r"Test +#\d+: (\S+) \.*\*\*\*(?!Skipped)", said)


def tries(path, changed, groups):
    """Replace the text of a file by `changed` and run groups of tests, each a list of names. Return the first test that
    fails, '' if none fails, or None if the change does not compile."""
    file = COPY / path
    before = file.read_text()
    file.write_text(changed)
    try:
        if not build():
            return None
        for names in groups:
            failed = failed_tests(names)
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
    failed = failed_tests(sorted({m["~"] for m in mutants}))
    if failed:
        sys.exit(f"tests fail without a mutant: {failed}")
    for m in mutants:
        text = (COPY / m["@"]).read_text()
        if text.count(m["-"]) != 1:
            print(f"STALE     {m['#']}: not once but {text.count(m['-'])} times in {m['@']}: {m['-']}")
            survived += 1
            continue
        line = text[:text.index(m["-"])].count("\n") + 1
        by = tries(m["@"], text.replace(m["-"], m["+"]), [[m["~"]]])
        survived += not by
        verdict = "killed   " if by else "SURVIVED "
        if by is None:
            verdict = "no build "
        print(f"{verdict} {m['#']}, {m['@']}:{line}: {by}", flush=True)
    print(f"{len(mutants) - survived} of {len(mutants)} named mutants killed")
    return survived == 0


OPERATORS = [  # pattern, and replacements, one of which is chosen at random
    (r" < ", [" <= ", " > "]), (r" > ", [" >= ", " < "]), (r" <= ", [" < "]), (r" >= ", [" > "]),
    (r" == ", [" != "]), (r" != ", [" == "]), (r" && ", [" || "]), (r" \|\| ", [" && "]),
    (r" \+ ", [" - "]), (r" - ", [" + "]), (r" \* (?=[\w(])", [" / "]), (r" / ", [" * "]),
    (r" \+= ", [" -= "]), (r" -= ", [" += "]), (r"\b0\b(?!\.)", ["1"]), (r"\b1\b(?!\.)", ["0", "2"]),
    (r"\b\d+\.\d+\b", ["(1.3 * \\g<0>)", "(0.5 + \\g<0>)"]), (r"(?<=if \()(?=.)", ["!"]),
    (r"\btrue\b", ["false"]), (r"\bfalse\b", ["true"]), (r"\bfmax\b", ["fmin"]),
    (r"\bfmin\b", ["fmax"]),
    (r"^ +[a-z][\w>.\[\]-]*(\([^()]*\))?( [+-]?= [^;{}]*)?;$", [";"]),  # deletes a statement
]


def places():
    found = []
    for folder in FOLDERS:
        for file in sorted((COPY / folder).rglob("*.c")):
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
    took, reached = measured()
    for file in BUILD.rglob("CTestTestfile.cmake"):  # shorten the time limits, because some mutants never end
        file.write_text(re.sub(r'(set_tests_properties\(\[=\[(\S+)\]=\].* TIMEOUT )"\d+"',
                               lambda m: f'{m[1]}"{20 + took.get(m[2], 0):.0f}"', file.read_text()))
    every = places()
    print(f"{len(every)} places in {len({p[0] for p in every})} files; seed {seed}", flush=True)
    chosen.shuffle(every)
    killed = survived = 0
    for file, number, match, instead in every:
        if killed + survived == count:
            break
        lines = file.read_text().splitlines(keepends=True)
        line = lines[number]
        lines[number] = line[:match.start()] + match.expand(chosen.choice(instead)) + line[match.end():]
        path = str(file.relative_to(COPY))
        # If gcov does not count this line, use the tests that reach the file. If gcov does not count the file, use all
        # tests.
        tests = reached.get((path, number + 1), reached.get((path, 0), sorted(took, key=took.get)))
        used = list(accumulate(took[t] for t in tests))
        tests = [t for t, so_far in zip(tests, used) if so_far <= ENOUGH] or tests[:1]
        groups = [t for t in tests if took[t] <= QUICK], [t for t in tests if took[t] > QUICK]
        by = tries(path, "".join(lines), groups)
        if by is None:
            continue
        killed += bool(by)
        survived += not by
        print(f"{'killed  ' if by else 'SURVIVED'} {path}:{number + 1}: {lines[number].strip()}"
              f"  [was {line.strip()}] {by or f'of {len(tests)} tests'}", flush=True)
    print(f"{killed} of {killed + survived} random mutants killed, seed {seed}")
    return killed >= 0.9 * (killed + survived)


def measured():
    """Return the time of each test, s, and for each (file, line) the tests that reach it. Line 0 stands for any line of
    the file."""
    covered = FOLDER / "covered"
    configure(covered, "-DCMAKE_BUILD_TYPE=Debug", "-DCMAKE_C_FLAGS_DEBUG=-Og", "-DSUPINE_COVERAGE=ON")
    if not build(covered):
        sys.exit("the instrumented code does not build")
    kept = FOLDER / "reached" / COMMIT
    kept.mkdir(parents=True, exist_ok=True)
    names = [name for name in re.findall(r"Test +#\d+: (\S+)", run("ctest", "-N", cwd=covered)[1])
             if not re.fullmatch(LEFT_OUT, name)]
    with ThreadPoolExecutor(int(JOBS)) as pool:
        each = dict(zip(names, pool.map(lambda name: lines_reached(name, covered, kept), names)))
    took = {name: seconds for name, (seconds, _, _) in each.items() if seconds <= SLOW}
    print(f"{len(took)} tests, without {' '.join(sorted(set(names) - set(took)))}", flush=True)
    reached = defaultdict(list)
    for name in sorted(took, key=took.get):
        _, counted, run_by_it = each[name]
        for place in counted:
            reached[tuple(place)] += []
        for place in run_by_it:
            reached[tuple(place)].append(name)
    return took, dict(reached)


def lines_reached(name, covered, kept):
    """Run a test of the instrumented build, or read its result from `kept` if it has run before. Return three things:
    its time, s (infinite if it fails), the list of (file, line) that gcov counts, and the list of those that the test
    reached. Line 0 stands for any line of the file."""
    kept, counts = kept / f"{name}.json", FOLDER / "counts" / name
    if kept.exists():
        return json.loads(kept.read_text())
    subprocess.run(["rm", "-rf", str(counts)], check=True)
    counts.mkdir(parents=True)
    _, said = run("ctest", "-R", f"^{name}$", cwd=covered, GCOV_PREFIX=str(counts))
    passed = re.search(r"(?:Passed|\*Skipped) +([\d.]+) sec", said)
    files = [str(file) for file in counts.rglob("*.gcda")] if passed else []
    for file in files:  # put .gcno files beside the .gcda files, where gcov looks for them
        notes = file.removesuffix("gcda") + "gcno"
        os.symlink(notes.removeprefix(str(counts)), notes)
    counted, found = set(), set()
    said = subprocess.run(["gcov", "--json-format", "--stdout", *files], cwd=counts, stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, check=False).stdout if files else b""
    for report in said.splitlines():
        for file in json.loads(report)["files"]:
            path = os.path.relpath(os.path.join(covered, file["file"]), COPY)
            counted.update((path, line["line_number"]) for line in file["lines"])
            found.update((path, line["line_number"]) for line in file["lines"] if line["count"] > 0)
            found.add((path, 0))
    answer = float(passed[1]) if passed else float("inf"), sorted(counted), sorted(found)
    kept.write_text(json.dumps(answer))
    return answer


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
