# SPDX-License-Identifier: GPL-3.0-or-later
"""Check ARCHITECTURE.md's table of folders against the sources.

    python3 house.py SOURCE_FOLDER BUILD_FOLDER

Each row of the table names a folder, says what it contains, and lists folders of earlier rows. The files of a folder may
include headers of the listed folders, and headers that those folders may include. Check also that files do not depend on
each other in cycles, that external names have the prefix of their folder, that functions have few lines and few
parameters, that the licences name files that exist, that nothing depends on the locale of the host program, that
distances are printed without digits below rounding, and that tests do not wait for a time."""
import glob
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


def check_licences():
    """Check that LICENSE and .reuse/dep5 name no file and no folder that does not exist."""
    with open(os.path.join(source, "LICENSE"), encoding="utf-8") as opened:
        named = [("LICENSE", path) for path in re.findall(r"[\w.-]+/[\w./-]*\w", opened.read())]
    dep5 = os.path.join(source, ".reuse", "dep5")
    if os.path.exists(dep5):
        with open(dep5, encoding="utf-8") as opened:
            named += [(".reuse/dep5", path) for line in re.findall(r"^Files:(.*)$", opened.read(), re.M) for path in line.split()]
    for file, path in named:
        if not glob.glob(os.path.join(source, path)):
            faults.append(f"{file}: {path} does not exist")


# Sources that open files. All others call supine_input_open for a file that the user names, and
# supine_input_open_beside for a file that another file names. Those after the first line read CSV and JSON, which may
# come from a pipe, from the path that the user gives.
OPENING = ("base/input.c", "base/output.c", "runtime/safetensors/posix.c", "runtime/safetensors/windows.c",
           "base/csv.c", "mesh/io/points.c", "precompute/patient/patient_decode.c", "program/options/pv_file.c")


def check_opening(files):
    """Check that only the sources in OPENING open files, so that what a file names is never opened by its bare name."""
    opening = re.compile(r"\b(fopen|freopen|open|openat|gzopen|json_load_file)\((?!\s*\")")
    for file in files:
        if file.endswith(".c") and file not in OPENING:
            with open(os.path.join(source, file), encoding="utf-8") as text:
                for name in opening.findall(text.read()):
                    faults.append(f"{file} calls {name}: call supine_input_open, or supine_input_open_beside for a name from a file")


LOCALE_FILES = ("base/number.c", "base/locale.c", "base/locale.h")
CALL = re.compile(r"\b((?:v|f|s|vf|vs|sn|vsn|d|as)?printf|(?:f|s)?scanf|strto[dfl]|strtold|ato[fil]|\w*locale\w*|is(?:alnum|alpha|blank|cntrl|digit|"
                  r"graph|lower|print|punct|space|upper|xdigit)|to(?:lower|upper)|strn?casecmp|strcoll|json_\w+)\s*\(")
REAL = re.compile(r"%[-+ #0]*(?:\*|\d+)?(?:\.(?:\*|\d+)?)?[lL]?[aAeEfFgG]")
LITERAL = re.compile(r'"((?:\\.|[^"\\])*)"')


def without_comments(text):
    """Replace comments by blanks, so that positions stay."""
    return re.sub(r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|/\*.*?\*/|//[^\n]*',
                  lambda found: found[0] if found[0][0] in "\"'" else re.sub(r"[^\n]", " ", found[0]), text, flags=re.S)


def arguments(text, begin):
    """Return the arguments of a call, of which the first begins at `begin`."""
    parts, depth, at = [""], 0, begin
    while depth > 0 or text[at] != ")":
        literal = re.compile(r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'').match(text, at)
        token = literal[0] if literal else text[at]
        depth += (token in "([{") - (token in ")]}")
        if token == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += token
        at += len(token)
    return parts


def locale_fault(name, parts, function):
    """Return what is wrong about a call, or None."""
    literals = "".join(LITERAL.findall("".join(parts)))
    if name.startswith("json_"):
        prints = name in ("json_sprintf", "json_vsprintf") and REAL.search(literals)
        if (prints or name.startswith(("json_load", "json_dump"))) and "SUPINE_C_LOCALE" not in function:
            return "jansson uses the host's locale: begin the function with SUPINE_C_LOCALE (base/locale.h)"
    elif name.startswith(("supine_", "is", "to", "strcase", "strncase", "strcoll")):
        if not name.startswith("supine_"):
            return "the result depends on the host's locale: use base/ascii.h"
    elif name.endswith("printf"):
        position = 2 if name == "snprintf" else 0 if name == "printf" else 1
        if name[0] == "v" or REAL.search(literals) or (len(parts) > position and '"' not in parts[position]):
            return "reals depend on the host's locale: use supine_print or supine_print_text (base/number.h)"
    elif name.endswith("scanf"):
        if REAL.search(literals):
            return "reals depend on the host's locale: use supine_number_parse (base/number.h)"
    elif name not in ("strtol", "atoi", "atol"):
        return "the result depends on the host's locale: use base/number.h"
    return None


def check_locale(files):
    """Check that numbers are parsed and printed, and letters compared, only by functions that ignore the locale of the host."""
    for file in files:
        with open(os.path.join(source, file), encoding="utf-8") as opened:
            text = without_comments(opened.read())
        for call in CALL.finditer(text if file not in LOCALE_FILES else ""):
            function = text[text.rfind("\n}", 0, call.start()) + 1:call.start()]
            fault = locale_fault(call[1], arguments(text, call.end()), function)
            if fault is not None:
                line = text.count("\n", 0, call.start()) + 1
                faults.append(f"{file}:{line}: {call[1]}: {fault}")


def check_distances(files):
    """Check that distances in mm which may be rounding errors are printed by supine_text_distance."""
    for file in files:
        with open(os.path.join(source, file), encoding="utf-8") as opened:
            for digits in re.findall(r"%\.\dg mm (?:RMS|at most|largest|apart|95th)|(?:residual|displacement|distance) %\.\dg mm", opened.read()):
                faults.append(f"{file}: '{digits}': digits below rounding depend on the processor: use supine_text_distance")


def check_waits():
    """Check that tests wait for events, not for a time."""
    for folder, below, names in os.walk(os.path.join(source, "tests")):
        below[:] = [name for name in below if name not in ("node_modules", "bench")]
        for name in (name for name in names if name.endswith((".c", ".cpp", ".py", ".mjs", ".sh")) and name != "house.py"):
            with open(os.path.join(folder, name), encoding="utf-8") as opened:
                for wait in re.findall(r"\bwaitForTimeout\(|\btime\.sleep\(|\bu?sleep\(|^ *sleep [\d$].*", opened.read(), re.M):
                    faults.append(f"{os.path.join(folder, name)}: '{wait}': wait for an event or for the answer to a later message")


folders = read_table()
files = tracked()
check_licences()
check_locale(files)
check_sizes(files)
check_distances(files)
check_waits()
check_includes(folders, files)
check_system_headers(files)
check_opening(files)
check_include_cycles(files)
check_names(folders)
for fault in faults:
    print(fault)
print(f"{len(folders)} folders, {len(files)} files, {len(faults)} faults")
sys.exit(1 if faults else 0)
