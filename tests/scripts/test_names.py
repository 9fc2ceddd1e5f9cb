# SPDX-License-Identifier: GPL-3.0-or-later
"""Test that names of structures with commas, quotes and umlauts pass through every CSV file and markups of 3D Slicer,
that markups have the numbers of the CSV files, and that names that are not UTF-8 are refused where they are read.

    test_names.py SUPINE"""
import csv
import json
import os
import subprocess
import sys
import tempfile

supine = sys.argv[1]
NAMES = ["nodule, RUL", '5" tube', "Knötchen größer", "#1", "plain"]


def run(*arguments):
    done = subprocess.run([supine, *arguments], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          check=False)
    return done.returncode, done.stdout.decode(errors="replace")


def make(*arguments):
    code, said = run(*arguments)
    assert code == 0, said


def refused(words, *arguments):
    code, said = run(*arguments)
    assert code == 2 and words in said, (code, said)


def rows(name):
    with open(os.path.join(folder, name), encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("# ")))


def write(name, content):
    with open(os.path.join(os.fsencode(folder), name), "wb") as file:
        file.write(content)


SCHEMA = "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/"
MARKUP = {"type": {"Fiducial"}, "coordinateSystem": {"LPS"}, "coordinateUnits": {"mm"}, "locked": {True}}


def markups(name):
    """Return {list: {label: (position, {measurement: value})}} of a file. Check what 3D Slicer's schema 1.0.3 asks."""
    with open(os.path.join(folder, name), encoding="utf-8") as file:
        root = json.load(file)
    assert root.keys() == {"@schema", "markups"} and root["@schema"] == SCHEMA + "markups-schema-v1.0.3.json#", name
    lists = {}
    for markup in root["markups"]:
        assert all(markup[key] in allowed for key, allowed in MARKUP.items()), markup
        points, measures = markup["controlPoints"], markup["measurements"]
        for point in points:
            assert point["positionStatus"] == "defined" and len(point["position"]) == 3, point
            assert all(isinstance(point[key], str) for key in ("id", "label", "description")), point
        for measure in measures:
            assert measure["units"] == "mm" and measure["enabled"] is True, measure
            assert len(measure["controlPointValues"]) == len(points), measure
        lists[markup["name"]] = {
            point["label"]: (point["position"], {m["name"]: m["controlPointValues"][i] for m in measures})
            for i, point in enumerate(points)}
    return lists


def same(points, table, columns):
    assert sorted(points) == sorted(row["name"] for row in table), points
    for row in table:
        at, measured = points[row["name"]]
        assert [float(row[axis]) for axis in "xyz"] == at, (row, at)
        assert {column: float(row[column]) for column in columns} == measured, (row, measured)


with tempfile.TemporaryDirectory() as folder:
    make("phantom", "-o", "lungs.ply", "--vertices", "1000")
    make("precompute", "lungs.ply", "-o", "lungs.safetensors", "--band", "2", "--held-out", "20")
    with open(os.path.join(folder, "points.csv"), "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, quoting=csv.QUOTE_ALL)  # a row that begins with # would be a comment
        writer.writerow(["name", "x", "y", "z"])
        writer.writerows([name, 63 + 5 * i, -157 + 3 * i, -148 + 4 * i] for i, name in enumerate(NAMES))
    make("embed", "lungs.safetensors", "points.csv", "-o", "inside.safetensors")
    make("deform", "inside.safetensors", "--posture", "left", "--from", "supine:rest", "-o", "moved.csv")
    moved = rows("moved.csv")
    assert sorted(row["name"] for row in moved) == sorted(NAMES), moved
    for row in moved:
        length = sum(float(row[axis]) ** 2 for axis in ("dx", "dy", "dz")) ** 0.5
        assert abs(length - float(row["moved_mm"])) < 2e-3, row
    # The program reads its own files, as points and as observations.
    make("embed", "lungs.safetensors", "moved.csv", "-o", "again.safetensors")
    make("deform", "again.safetensors", "--posture", "left", "-o", "again.csv")
    assert sorted(row["name"] for row in rows("again.csv")) == sorted(NAMES)
    make("locate", "lungs.safetensors", "moved.csv", "--points", "inside.safetensors", "--posture", "left", "-o",
         "found.csv")
    assert sorted(row["name"] for row in rows("found.csv")) == sorted(NAMES)

    # Markups have the numbers of the tables, and are read again.
    errors = ["moved_error_mm", "expected_error_mm", "another_day_error_mm"]
    make("deform", "inside.safetensors", "--posture", "left", "--from", "supine:rest", "-o", "moved.mrk.json")
    same(*markups("moved.mrk.json").values(), moved, ["moved_mm", *errors])
    make("embed", "lungs.safetensors", "moved.mrk.json", "-o", "again.safetensors")
    make("locate", "lungs.safetensors", "moved.mrk.json", "--points", "inside.safetensors", "--posture", "left", "-o",
         "found.mrk.json")
    same(markups("found.mrk.json")["located"], rows("found.csv"), ["expected_error_mm"])
    for name in ("table.csv", "table.mrk.json"):
        make("compare", "lungs.safetensors", "--inside", "inside.safetensors", "--postures", "supine,left", "-o", name)
    lists = markups("table.mrk.json")
    assert list(lists) == ["supine", "left"]
    for row in rows("table.csv"):
        if row["kind"] in ("target", "anatomy"):
            measured = lists[row["posture"]][row["name"]][1]
            assert [float(row[key]) for key in ("mm", *errors)] == list(measured.values()), (row, measured)

    # Each place where a name is read names the file and, in a text, the line.
    latin = "Knötchen".encode("latin-1")
    write(b"latin.csv", b"name,x,y,z\na,70,0,0\n" + latin + b",71,0,0\n")
    refused("latin.csv:3: the text is not UTF-8: save the file with the encoding UTF-8",
            "embed", "lungs.safetensors", "latin.csv", "-o", "no.safetensors")
    markup = {"markups": [{"coordinateSystem": "LPS", "controlPoints": [{"label": "LABEL", "position": [70, 0, 0]}]}]}
    write(b"latin.mrk.json", json.dumps(markup, indent=1).encode().replace(b"LABEL", latin))
    refused("the text is not UTF-8", "embed", "lungs.safetensors", "latin.mrk.json", "-o", "no.safetensors")
    make("phantom", "-o", "small.ply", "--vertices", "500")
    os.rename(os.path.join(folder, "small.ply"), os.path.join(os.fsencode(folder), latin + b".ply"))
    refused("the name of this part is not UTF-8: rename the file", "embed", "lungs.safetensors", latin + b".ply",
            "-o", "no.safetensors")
    assert not os.path.exists(os.path.join(folder, "no.safetensors"))
print(len(NAMES), "names pass")
