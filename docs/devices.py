# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the page for makers of devices, from what other pages and the tests state: devices.py SOURCE_FOLDER

Known anomalies are the paragraphs of docs/guide/limits.md that begin with a name in bold, the mistakes that KNOWN of
tests/doors.py lists, and the rows of docs/inputs.md whose evidence is an assumption. Each promise of docs/promises.md
names its tests in a comment `<!-- tests: ... -->`; a row of docs/inputs.md has its cases in tests/inputs.py. The site
and a release have the page; the test `pages` checks that nothing is without a test, and that the tests exist."""
import ast
import glob
import os
import re
import sys


class Sources:
    """The pages and tests of a folder of sources."""

    def __init__(self, folder):
        self.folder = folder

    def read(self, name):
        with open(os.path.join(self.folder, name), encoding="utf-8") as file:
            return file.read()

    def table(self, name, variable):
        """Return the expression that a Python file assigns to a variable."""
        return next(node.value for node in ast.parse(self.read(name)).body
                    if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", None) == variable)

    def promises(self):
        """Return section, text and tests of each promise."""
        page = self.read("docs/promises.md").split("\n## What is not promised")[0]
        found = []
        for section in page.split("\n## ")[1:]:
            for promise in re.split(r"\n+- ", section)[1:]:
                tests = re.search(r"<!-- tests:\s(.*?) -->", promise, re.S)
                text = re.sub(r"\s+", " ", re.split(r"<!--|\n *\n", promise)[0]).strip(" :")
                found.append((section.split("\n")[0], text, re.findall(r"\w+", tests[1]) if tests else []))
        return found

    def inputs(self):
        """Return the cells of each row of docs/inputs.md, and its tests."""
        cases = {key.value for key in self.table("tests/inputs.py", "CASES").keys}
        doors = ast.literal_eval(self.table("tests/doors.py", "ROWS"))
        found = []
        for line in re.findall(r"^\| ([a-z][a-z-]* \| .*) \|$", self.read("docs/inputs.md"), re.M):
            cells = [cell.strip() for cell in line.split("|")]
            if cells[0] != "check":
                tests = ["inputs_everywhere"] if cells[0] in cases else []
                found.append((cells, tests + (["doors"] if cells[0] in doors.values() else [])))
        return found

    def limits(self):
        """Return name and first sentence of each limit of the model."""
        paragraphs = re.findall(r"^\*\*(.*?)\.\*\* (.*?)(?:\n\n|\Z)", self.read("docs/guide/limits.md"), re.M | re.S)
        return [(name, re.match(r".*?[.:](?= |$)", re.sub(r"\s+", " ", text))[0].rstrip(":.") + ".")
                for name, text in paragraphs]

    def taken(self):
        """Return the input and the kind of each mistake that is known to be taken."""
        return [case for known in ("KNOWN", "DIFFERENT")
                for case in ast.literal_eval(self.table("tests/doors.py", known))]

    def tests(self):
        """Return a pattern of the names of all tests: those of CTest, and the functions in C."""
        functions = r"^TEST(?:_FULL)?\((\w+)\)"
        of_ctest = r"(?:add_test\(NAME |supine_test\((?:\w+/)*)([a-z][\w${}]*)"
        names = set()
        for pattern in ("*.cmake", "CMakeLists.txt", "*/CMakeLists.txt", "*/*.c"):
            for path in glob.glob(os.path.join(glob.escape(self.folder), "tests", pattern)):
                names |= set(re.findall(functions if path.endswith(".c") else of_ctest, self.read(path), re.M))
        return "|".join(re.sub(r"\$\{\w+\}", r"\\w+", name) for name in sorted(names))


def faults(folder):
    """Return what has no test, and tests that do not exist."""
    sources = Sources(folder)
    known, promises, inputs = sources.tests(), sources.promises(), sources.inputs()
    found = [f"docs/promises.md: no test: {text}" for _, text, tests in promises if not tests]
    found += [f"docs/inputs.md: no test: {cells[0]}" for cells, tests in inputs if not tests]
    named = {name for _, _, tests in promises for name in tests} | {name for _, tests in inputs for name in tests}
    found += [f"docs/promises.md: no test is named {name}" for name in sorted(named) if not re.fullmatch(known, name)]
    parts = {"promises": promises, "inputs": inputs, "limits": sources.limits(), "tests": known}
    return found + [f"docs/devices.py finds no {name}" for name, part in parts.items() if not part]


def page(folder):
    """Return the page as Markdown."""
    sources = Sources(folder)
    code = lambda names: ", ".join(f"`{name}`" for name in names)
    plain = lambda text: re.sub(r"\[(.*?)\]\((?!https?:).*?\)", r"\1", text)
    lines = ["# For makers of devices", "",
             "Supine is not a medical device. Who makes one with it needs to know what it consists of, what is known",
             "to be wrong, and how each promise is tested. This page is generated from the pages and tests it names.",
             "", "A release states what its files contain and depend on, with versions and licences, in",
             "`supine-VERSION-binaries.spdx.json` (SPDX 2.3) and `.cdx.json` (CycloneDX 1.5), and the licences of its",
             "sources in `supine-VERSION.spdx`. The library of CycloneDX validates the second; no validator of SPDX",
             "was at hand for the first, of which a test compares every file, version and licence with the release.",
             "",
             "## Known anomalies", "", "### The model", "",
             "[Limits](guide/limits.md) has the measurements.", ""]
    lines += [f"- **{name}.** {plain(text)}" for name, text in sources.limits()]
    lines += ["", "### Mistakes in inputs that are taken without a word", "",
              "`tests/doors.py` gives each input every kind of mistake. "
              + ("All are told or refused, but for these:" if sources.taken() else "All are told or refused.")]
    lines += ["", "| input | mistake |", "|---|---|"] if sources.taken() else []
    lines += [f"| `{door}` | {mistake} |" for door, mistake in sources.taken()]
    lines += ["", "### Limits of inputs that are assumed", "",
              "No measurement supports these limits of [inputs](inputs.md), or a part of them.", "",
              "| check | measured | told | refused | evidence |", "|---|---|---|---|---|"]
    lines += [f"| {' | '.join([cells[0], *cells[3:7]])} |" for cells, _ in sources.inputs() if "assumed" in cells[6]]
    lines += ["", "## Promises and their tests", "",
              "The [promises](promises.md) for version 1.0. `ctest -R` runs a test by its name; names that begin with",
              "`test_` are functions in C, found by `grep -r`.", "", "| promise | tests |", "|---|---|"]
    lines += [f"| {section}: {plain(text)} | {code(tests)} |" for section, text, tests in sources.promises()]
    lines += ["", "## Checks of inputs and their tests", "",
              "`inputs_everywhere` gives a right and a wrong input of the check to each interface that takes it, and",
              "`doors` every kind of mistake to each input.", "", "| check | interfaces | tests |", "|---|---|---|"]
    lines += [f"| {cells[0]} | {cells[8]} | {code(tests)} |" for cells, tests in sources.inputs()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(page(sys.argv[1]))
