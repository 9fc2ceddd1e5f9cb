# SPDX-License-Identifier: GPL-3.0-or-later
"""Print the processor time (user and system) of tests, which are run one after another:

    python3 tests/cost.py [BUILD_FOLDER [CTEST_OPTION...]]

By default, run the tests with the label `quick` in build/release, and fail if they exceed the limits that README's
second command keeps. For all tests: python3 tests/cost.py build/release -R . (no limits apply then)."""
import ctypes
import json
import os
import resource
import subprocess
import sys

TOTAL, ONE = 480.0, 60.0  # limits of the label `quick`, seconds
PR_SET_CHILD_SUBREAPER = 36


def listed(build, options):
    """Return the names of tests, those that prepare something for others first."""
    text = subprocess.run(["ctest", "--test-dir", build, *options, "--show-only=json-v1"], capture_output=True,
                          text=True, check=True).stdout
    tests = json.loads(text)["tests"]
    prepares = lambda test: any(p["name"] == "FIXTURES_SETUP" for p in test.get("properties", []))
    return [test["name"] for test in sorted(tests, key=lambda test: not prepares(test))]


def reap():
    """Wait for processes whose parents ended before them, such as those of a browser."""
    try:
        while True:
            os.waitpid(-1, 0)
    except ChildProcessError:
        pass


def cost(build, name):
    """Run one test; return its processor time in seconds, and how it ended."""
    begin = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(["ctest", "--test-dir", build, "-R", f"^{name}$", "-FA", "."], capture_output=True, text=True,
                          check=False)
    reap()
    end = resource.getrusage(resource.RUSAGE_CHILDREN)
    state = "failed" if done.returncode else ""
    if "Skipped" in done.stdout:
        state = "skipped"
    return end.ru_utime - begin.ru_utime + end.ru_stime - begin.ru_stime, state


def main():
    build = sys.argv[1] if len(sys.argv) > 1 else "build/release"
    options = sys.argv[2:] or ["-L", "^quick$"]
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    costs = {}
    for name in listed(build, options):
        costs[name], state = cost(build, name)
        print(f"{costs[name]:8.1f} s  {name:28} {state}", flush=True)
    total = sum(costs.values())
    print(f"{total:8.1f} s  {len(costs)} tests")
    if sys.argv[2:]:
        return 0
    slow = [name for name, seconds in costs.items() if seconds > ONE]
    if slow:
        print(f"above {ONE:g} s: {', '.join(slow)}")
    return 1 if slow or total > TOTAL else 0


sys.exit(main())
