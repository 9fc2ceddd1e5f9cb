# SPDX-License-Identifier: GPL-3.0-or-later
"""Find each assumed, simulated or collapsed fact of a basis in each view: info, the report, the caption of render, the
headers of deform, breathe and locate, glTF, Python. The page and JavaScript: tests/export/page_facts.mjs.

    test_views.py SUPINE SOURCE LIBRARY"""
import html
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

supine, source, library = sys.argv[1:4]


def pattern(letters):
    """Number the letters of a text in the order of their first occurrence, so that texts of other glyphs compare."""
    numbers = {}
    return tuple(numbers.setdefault(letter, len(numbers)) for letter in letters)


def drawn(word, glyphs):
    """Tell whether a word of letters that repeat is among glyphs, which have numbers of their own."""
    wanted = pattern(word)
    return any(pattern(glyphs[i:i + len(word)]) == wanted for i in range(len(glyphs) - len(word) + 1))


def text_of(page):
    return " ".join(html.unescape(re.sub("<[^>]*>", " ", page)).split())


with tempfile.TemporaryDirectory() as folder:
    def run(*arguments):
        done = subprocess.run([supine, *arguments], cwd=folder, text=True, capture_output=True, check=False)
        assert done.returncode == 0, f"{' '.join(arguments)}: {done.stderr}"
        return done.stdout

    def read(name):
        with open(os.path.join(folder, name), encoding="utf-8", errors="replace") as file:
            return file.read()

    with open(os.path.join(folder, "points.csv"), "w", encoding="utf-8") as file:
        file.write("name,x,y,z\nnodule,60,-150,-120\n")
    run("phantom", "--vertices", "600", "-o", "lungs.ply")
    kinds = {"healthy": (), "collapsed": ("--lung", "left:0.4"), "rest": ("--scanned", "prone:rest"),
             "given": ("--scanned", "full", "--resting", "supine=2700mL", "--axes", "LPS")}
    counts = {}
    for kind, options in kinds.items():
        run("precompute", "lungs.ply", "--band", "3", "--held-out", "10", *options, "-o", "b.safetensors")
        run("embed", "b.safetensors", "points.csv", "-o", "i.safetensors")
        facts = json.loads(run("info", "b.safetensors", "--json"))["facts"]
        caveats = [fact for fact in facts if fact["caveat"]]
        assert all((fact["source"] in ("assumed", "simulated", "collapsed")) == fact["caveat"] for fact in facts), facts
        counts[kind] = {fact["name"]: fact["source"] for fact in facts}
        run("compare", "b.safetensors", "--inside", "i.safetensors", "-o", "r.html")
        run("render", "b.safetensors", "--posture", "prone", "-o", "r.svg")
        run("deform", "i.safetensors", "--posture", "prone", "-o", "o.csv")
        run("deform", "b.safetensors", "--posture", "prone", "-o", "o.ply")
        run("breathe", "b.safetensors", "--posture", "prone", "--fps", "1", "-o", "t.vtp")
        run("breathe", "b.safetensors", "--posture", "prone", "--fps", "1", "-o", "t.safetensors")
        run("locate", "b.safetensors", "points.csv", "--points", "i.safetensors", "--posture", "supine", "-o", "l.csv")
        run("locate", "b.safetensors", "points.csv", "--points", "i.safetensors", "--posture", "supine", "-o", "l.ply")
        run("export", "b.safetensors", "-o", "m.glb")
        code = ("import supine, json; b = supine.open('b.safetensors'); "
                "print(json.dumps([[f._asdict() for f in b.facts], b.caveats]))")
        package = os.path.join(folder, "python", "supine")
        if not os.path.isdir(package):
            shutil.copytree(os.path.join(source, "runtime/python/supine"), package)
            shutil.copy(library, os.path.join(package, "libsupine_runtime.so"))
        beside = {**os.environ, "PYTHONPATH": os.path.join(folder, "python")}
        python = subprocess.run([sys.executable, "-c", code], cwd=folder, env=beside, text=True, capture_output=True,
                                check=False)
        assert python.returncode == 0, python.stderr
        listed, line = json.loads(python.stdout)
        assert [fact["name"] + fact["line"] for fact in listed] == [fact["name"] + fact["line"] for fact in facts]
        views = {"info": " ".join(run("info", "b.safetensors").split()), "report": text_of(read("r.html")),
                 "points": read("o.csv").split("\nname,")[0],
                 "surface": read("o.ply").split("end_header")[0], "python": line,
                 "breath": read("t.vtp").split("<VTKFile")[0], "frames": read("t.safetensors")[:4096],
                 "located points": read("l.csv").split("\nname,")[0],
                 "located surface": read("l.ply").split("end_header")[0], "glTF": read("m.glb")}
        glyphs = re.findall('href="#glyph([^"]*)"', read("r.svg"))
        for fact, (view, shown) in itertools.product(caveats, views.items()):
            assert fact["name"] in shown, (kind, fact["name"], view)
        for fact in caveats:
            words = [word for word in re.findall("[a-z]+", f"{fact['name']} {fact['source']}")
                     # which are one glyph in some fonts
                     if len(set(word)) < len(word) > 4 and not re.search("f[fil]", word)]
            for word in words:
                assert drawn(word, glyphs), (kind, word, "render")
    assert counts["healthy"]["volume at rest, supine"] == "assumed"
    assert counts["given"]["volume at rest, supine"] == "given"
    assert counts["collapsed"]["left lung"] == "collapsed" and "left lung" not in counts["healthy"]
    assert counts["rest"]["full inflation, supine"] == "assumed" and counts["rest"]["state in the scan"] == "given"
    assert counts["given"]["axes of the scan"] == "given" and counts["given"]["full inflation, supine"] == "measured"
print("every caveat is in every view")
