# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare docs/model.md and docs/promises.md with the sources: test_pages.py SOURCE_FOLDER

Numbers of the model that stand in a table of the page must be those of the code, each file that the page names must
exist, and each installed header must have the stability that the page promises. Each promise and each row of
docs/inputs.md must have a test."""
import glob
import os
import re
import sys

source = sys.argv[1]
sys.path.insert(0, os.path.join(source, "docs"))
import devices

faults = []


def read(name):
    with open(os.path.join(source, name), encoding="utf-8") as file:
        return file.read()


def numbers(text):
    return [float(n) for n in re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?", text)]


def same(what, page, code):
    if page != code:
        faults.append(f"docs/model.md: {what}: the page has {page}, the code {code}")


def row(text, begin):
    """Return the cells of the table row that begins with a cell."""
    found = re.search(r"^\| %s \|(.*)\|$" % re.escape(begin), text, re.M)
    if found is None:
        faults.append(f"docs/model.md: no row '{begin}'")
        return [""] * 9
    return found[1].split(" | ")


def check_laws(page):
    table = read("precompute/physics/model.h")
    for column, law in enumerate(("DEEP", "PAPER")):
        arguments = re.sub(r"\s+|\\", " ", re.search(r'LAW\(%s, "\w+", ([^"]*)' % law, table)[1])
        base, gain, box, c, shear, bend, reach, _ = re.match(
            r"([^,]*), ([^,]*), \(([^)]*)\), \(([^)]*)\), ([^,]*), \(([^)]*)\), ([^,]*), +(\w+)", arguments).groups()
        for label, values in (("base, gain", f"{base} {gain}"), ("cx, cy, cz", box), ("c1 to c6", c), ("shear", shear),
                              ("bend of x, y, z", bend), ("reach", reach)):
            same(f"{label} of {law}", numbers(row(page, label)[column])[:len(numbers(values))], numbers(values))


def check_resting(page):
    code = read("precompute/physics/resting.c")
    shares = re.search(r"\.share = \{\{([^}]*)\},\s*\{([^}]*)\}\}", code)
    for lung, label in ((1, "left lung"), (2, "right lung")):
        same(f"shares at rest of the {label}", numbers(" ".join(row(page, label))), numbers(shares[lung]))


def constant(name, file):
    text = read(file)
    found = re.search(r"\b%s\b(?: = | )\(?(-?\d[\d.]*)" % re.escape(name), text)
    if found is None:
        faults.append(f"{file}: no {name}")
        return ""
    return f"{float(found[1]):g}"


def check_constants(page):
    """Look for sentences of the page that state a constant of the code."""
    resting = "precompute/physics/resting.h"
    expected = "runtime/expected.h"
    for words, name, file in (("share of the pair is %s with", "SUPINE_REST_SHARE", resting),
                              ("standard deviation of %s between", "SUPINE_REST_SPREAD", resting),
                              ("and %s (SD", "SUPINE_COPD_SHARE", resting),
                              ("(SD %s) in COPD", "SUPINE_COPD_SPREAD", resting),
                              ("1 + %s max(0, -g_z)^2", "SUPINE_FULL_UPRIGHT_GAIN", resting),
                              ("minus %s mL for lying", "SUPINE_LYING_ML", resting),
                              ("plus %s mL of tissue", "SUPINE_TISSUE_ML", resting),
                              ("| c | %s mm", "SUPINE_EXPECTED_ERROR_MM", "runtime/include/supine/locate.h"),
                              ("(%s mm |Dg_xy| b_i)^2", "EXPECTED_HEART", expected),
                              ("(%s mm |Dg_x|)^2", "EXPECTED_SLIDING", expected),
                              ("/ %s mm)", "EXPECTED_FULL_BREATH", expected),
                              ("(%s mm / 3)", ".sill", "runtime/kriging.c"),
                              ("|p_i - p_j| / %s mm", ".length", "runtime/kriging.c")):
        value = constant(name, file) if not name.startswith(".") else re.search(
            r"%s = ([\d]+)" % re.escape(name), read(file))[1]
        if value and re.sub(r"\s+", " ", words % value) not in page:
            faults.append(f"docs/model.md: no '{words % value}', which {file} states")


def check_files(page):
    for name in re.findall(r"`([\w/]+\.(?:c|h|md|py))`", page):
        if not (os.path.exists(os.path.join(source, name)) or
                glob.glob(os.path.join(source, "precompute", "**", name), recursive=True)):
            faults.append(f"docs/model.md: no file {name}")


def check_headers(page):
    stated = {}
    for cells, stability in re.findall(r"^\| (`<supine/[^|]*) \| (stable|growing) \|$", page, re.M):
        for name in re.findall(r"(\w+\.h)", cells):
            stated[name] = stability
    found = {}
    for folder in ("runtime/include/supine", "precompute/include/supine"):
        for path in glob.glob(os.path.join(source, folder, "*.h")):
            said = re.search(r"Stability: (\w+)", read(os.path.relpath(path, source)))
            found[os.path.basename(path)] = said[1] if said else "not stated"
    if stated != found:
        faults.append(f"docs/promises.md: differs from the headers: {sorted(stated.items() ^ found.items())}")


model = read("docs/model.md")
check_laws(model)
check_resting(model)
check_constants(re.sub(r"\s+", " ", model.replace("\\|", "|")))
check_files(model)
check_headers(read("docs/promises.md"))
faults += devices.faults(source)
print("\n".join(faults) or "the pages agree with the sources")
sys.exit(1 if faults else 0)
