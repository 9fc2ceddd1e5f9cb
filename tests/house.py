# SPDX-License-Identifier: GPL-3.0-or-later
"""Check ARCHITECTURE.md's table of folders against the sources.

    python3 house.py SOURCE_FOLDER BUILD_FOLDER

Each row of the table names a folder, says what it contains, and lists folders of earlier rows. The files of a folder may
include headers of the listed folders, and headers that those folders may include. Check also that files do not depend on
each other in cycles, that external names have the prefix of their folder, and that functions have few lines and few
parameters."""
import os
import re
import subprocess
import sys

source, build = sys.argv[1:3]
faults = []

# Prefixes of external names, for folders whose prefix is not supine_<folder>_.
PREFIX = {"base": ("supine_",), "runtime": ("supine_",), "runtime/safetensors": ("supine_",),
          "mesh/io": ("supine_mesh_",), "precompute/lungs": ("supine_lungs_", "supine_phantom_", "supine_tissue_", "supine_inside_surface_"),
          "precompute/physics": ("supine_physics_", "supine_reference_"),
          "precompute/projection": ("supine_projection_", "supine_accuracy_"),
          "precompute/warp": ("supine_field_",), "mesh/image": ("supine_image_",), "program/view/render": ("supine_render_",), "program/view/export": ("supine_export_", "supine_template_"), "program/options": ("supine_options_", "supine_breath_", "supine_command_"),
          "program": ("supine_command_",)}
PUBLIC = ("runtime/include/supine", "precompute/include/supine")


def read_table():
    folders = {}
    with open(os.path.join(source, "ARCHITECTURE.md"), encoding="utf-8") as readme:
        table = re.findall(r"^\| `(?:base|sh|mesh|precompute|runtime|program)[a-z/]*`.*$", readme.read(), re.M)
    rows = []
    for line in table:
        row = re.fullmatch(r"\| `([a-z/]+)` \|([^|]*)\|([^|]*)\|", line)
        if row is None:
            faults.append(f"ARCHITECTURE.md: a row needs three cells: {line}")
        else:
            rows.append(row.groups())
    for folder, what, uses in rows:
        if not what.strip():
            faults.append(f"ARCHITECTURE.md: the row of {folder} states no content")
        folders[folder] = set()
        for used in re.findall(r"`([a-z/]+)`", uses):
            if used == folder or used not in folders:
                faults.append(f"ARCHITECTURE.md: {folder} may use only folders of earlier rows, not {used}")
            else:
                folders[folder] |= {used} | folders[used]
    return folders


def tracked():
    listed = subprocess.run(["git", "-C", source, "ls-files", "*.c", "*.h"], capture_output=True,
                            text=True, check=False).stdout.split()
    found = [os.path.relpath(os.path.join(folder, name), source)
             for top in ("base", "sh", "mesh", "precompute", "runtime", "program")
             for folder, _, names in os.walk(os.path.join(source, top))
             for name in names if name.endswith((".c", ".h"))]
    files = [f for f in (listed or found) if f.split("/")[0] in ("base", "sh", "mesh", "precompute", "runtime", "program")]
    return [f for f in files if os.path.exists(os.path.join(source, f))]


def included(file):
    """Yield the folder and the name of each file of the project that `file` includes."""
    with open(os.path.join(source, file), encoding="utf-8") as text:
        for name in re.findall(r'^#\s*include\s+[<"]([^>"]+)[>"]', text.read(), re.M):
            for path in [name] + [f"{folder[:-len('/supine')]}/{name}" for folder in PUBLIC]:
                if os.path.exists(os.path.join(source, path)):
                    yield os.path.dirname(path), name


def check_includes(folders, files):
    for folder in sorted({os.path.dirname(f) for f in files} - set(folders)):
        faults.append(f"ARCHITECTURE.md: add a row for the folder {folder}")
    for file in files:
        folder = os.path.dirname(file)
        for used, name in included(file):
            if folder in folders and used != folder and used not in folders[folder]:
                faults.append(f"{file} includes {name}: {folder} may not use {used}")


def check_system_headers(files):
    """Check that no file of the library includes headers of the operating system, except posix.c and windows.c."""
    library = PUBLIC + ("runtime", "runtime/safetensors", "runtime/kernels", "runtime/compare")
    for file in files:
        if os.path.dirname(file) in library and os.path.basename(file) not in ("posix.c", "windows.c"):
            with open(os.path.join(source, file), encoding="utf-8") as text:
                for name in re.findall(r"^#\s*include\s+<((?:sys/|unistd|fcntl|dirent|pthread|strings|windows).*?)>",
                                       text.read(), re.M):
                    faults.append(f"{file} includes {name}: only posix.c and windows.c may include system headers")


def check_include_cycles(files):
    """Check that files do not include each other in cycles."""
    graph = {f: set() for f in files}
    for file in files:
        for used, name in included(file):
            target = os.path.join(used, os.path.basename(name))
            if target in graph and target != file:
                graph[file].add(target)
    while leaves := {f for f, out in graph.items() if not out & set(graph)}:
        graph = {f: out for f, out in graph.items() if f not in leaves}
    if graph:
        faults.append(f"files that include each other in cycles: {sorted(graph)}")


def objects():
    """For each object file, yield the source file without its ending, and lists of the external names that it defines and
    uses."""
    sources = {}
    for folder, _, names in os.walk(build):
        match = re.search(r"(.*)/CMakeFiles/supine_[a-z_]+\.dir(.*)$", os.path.relpath(folder, build))
        for name in names if match else []:
            file = os.path.normpath(f"{match[1]}{match[2]}/{name[:-len('.o')]}")
            if name.endswith(".c.o") and os.path.exists(os.path.join(source, file)):
                sources[os.path.join(folder, name)] = file[:-len(".c")]
    listed = subprocess.run(["nm", "--extern-only", *sources], capture_output=True, text=True, check=True).stdout
    for part in re.split(r"^\n(?=/)", listed, flags=re.M)[1:]:
        path, names = part.split(":\n", 1)
        yield (sources[path], re.findall(r" [A-TV-Z] (\w+)$", names, re.M), re.findall(r" U (\w+)$", names, re.M))


def check_names(folders):
    """Check that external names begin with the prefix of their folder, and that files do not use each other in cycles."""
    listed = list(objects())
    home = {name: file for file, defined, _ in listed for name in defined}
    for file, defined, _ in listed:
        folder = os.path.dirname(file)
        prefix = PREFIX.get(folder, (f"supine_{os.path.basename(folder)}_",))
        for symbol in defined:
            if not symbol.startswith((*prefix, "__")) and symbol + "_" not in prefix:
                faults.append(f"{file}.c defines {symbol}, which does not begin with {' or '.join(prefix)}")
    graph = {file: {home[name] for name in used if name in home} - {file} for file, _, used in listed}
    while leaves := {f for f, out in graph.items() if not out & set(graph)}:
        graph = {f: out for f, out in graph.items() if f not in leaves}
    while roots := set(graph) - {f for out in graph.values() for f in out}:
        graph = {f: out for f, out in graph.items() if f not in roots}
    if graph:
        faults.append(f"files that use each other in cycles: {sorted(graph)}")
    if len(listed) < len(folders):
        faults.append(f"only {len(listed)} object files in {build}: build first")


def check_sizes(files):
    """Check that functions have at most 60 lines and 7 parameters, unless the comment above gives a reason with the
    word "lines" or "parameters"."""
    begin = re.compile(r"^(?!(?:typedef|struct|enum|union)\b)(?:\w[\w ]*\n)?[A-Za-z_][^\n;:{}=#]*(?:\n +[^\n;{}=#]*)*\) \{$", re.M)
    head = re.compile(r"\b(\w+)\(([^;{}]*)\) \{$")
    for file in files:
        if not file.endswith(".c"):
            continue
        with open(os.path.join(source, file), encoding="utf-8") as opened:
            text = opened.read()
        for found in begin.finditer(text):
            name, parameters = head.search(found.group()).groups()
            lines = text.count("\n", found.start(), text.index("\n}", found.end())) + 2
            before = text[:found.start()].rstrip()
            comment = before[before.rfind("/*"):] if before.endswith("*/") else ""
            if parameters.count(",") + 1 > 7 and "parameters" not in comment:
                faults.append(f"{file}: {name} has {parameters.count(',') + 1} parameters: at most 7, or give the reason above it")
            if lines > 60 and "lines" not in comment:
                faults.append(f"{file}: {name} has {lines} lines: at most 60, or give the reason above it")


folders = read_table()
files = tracked()
check_sizes(files)
check_includes(folders, files)
check_system_headers(files)
check_include_cycles(files)
check_names(folders)
for fault in faults:
    print(fault)
print(f"{len(folders)} folders, {len(files)} files, {len(faults)} faults")
sys.exit(1 if faults else 0)
