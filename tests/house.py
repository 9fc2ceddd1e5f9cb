# SPDX-License-Identifier: GPL-3.0-or-later
"""Check ARCHITECTURE.md's table of folders against the sources.

    python3 house.py SOURCE_FOLDER BUILD_FOLDER

Each row of the table names a folder, says what it contains, and lists folders of earlier rows. The files of a folder
may include headers of the listed folders, and headers that those folders may include. Check also that files do not
depend on each other in cycles, that external names have the prefix of their folder, that functions (also those of
JavaScript and Python) and lines of JavaScript are short and parameters few, that the licences name files that exist,
that examples have a README and a test, that Python files define the names that they use, that nothing depends on the
locale of the host program, that distances are printed without digits below rounding, and that tests do not wait for a
time."""
import builtins
import glob
import os
import re
import subprocess
import symtable
import sys

import house_scripts

source, build = sys.argv[1:3]
faults = []

PUBLIC = ("runtime/include/supine", "precompute/include/supine")
# The folders of the public library name functions supine_<object>_<verb>, as installed headers do: there is one object,
# the library. In every other folder, a function's prefix is supine_<folder>_, for the folder whose header declares it.
LIBRARY = ("base", "runtime") + PUBLIC


def read(file):
    """Return the text of a file, by its path in the sources."""
    with open(os.path.join(source, file), encoding="utf-8") as opened:
        return opened.read()


def read_table():
    folders = {}
    table = re.findall(r"^\| `(?:base|sh|mesh|precompute|runtime|program)[a-z/]*`.*$", read("ARCHITECTURE.md"), re.M)
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


def tracked_python():
    listed = subprocess.run(["git", "-C", source, "ls-files", "*.py"], capture_output=True, text=True,
                            check=False).stdout.split()
    return [file for file in listed if os.path.exists(os.path.join(source, file))]


def tracked():
    listed = subprocess.run(["git", "-C", source, "ls-files", "*.c", "*.h"], capture_output=True,
                            text=True, check=False).stdout.split()
    found = [os.path.relpath(os.path.join(folder, name), source)
             for top in ("base", "sh", "mesh", "precompute", "runtime", "program")
             for folder, _, names in os.walk(os.path.join(source, top))
             for name in names if name.endswith((".c", ".h"))]
    files = [f for f in (listed or found)
             if f.split("/")[0] in ("base", "sh", "mesh", "precompute", "runtime", "program")]
    return [f for f in files if os.path.exists(os.path.join(source, f))]


def scripts():
    """Return the files of JavaScript and Python, without those of other packages."""
    kinds = (".js", ".mjs", ".py")
    listed = subprocess.run(["git", "-C", source, "ls-files", *("*" + kind for kind in kinds)], capture_output=True,
                            text=True, check=False).stdout.split()
    found = [os.path.relpath(os.path.join(folder, name), source) for folder, _, names in os.walk(source)
             for name in names if name.endswith(kinds)] if not listed else []
    return [f for f in listed + found if os.path.exists(os.path.join(source, f))
            and not {"build", "node_modules"} & set(f.split("/"))]


def included(file):
    """Yield the folder and the name of each file of the project that `file` includes."""
    for name in re.findall(r'^#\s*include\s+[<"]([^>"]+)[>"]', read(file), re.M):
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
            for name in re.findall(r"^#\s*include\s+<((?:sys/|unistd|fcntl|dirent|pthread|strings|windows).*?)>",
                                   read(file), re.M):
                faults.append(f"{file} includes {name}: only posix.c and windows.c may include system headers")


def in_cycles(graph):
    """Return the nodes of a graph {node: nodes that it uses} that lie on or between cycles."""
    while leaves := {f for f, out in graph.items() if not out & set(graph)}:
        graph = {f: out for f, out in graph.items() if f not in leaves}
    while roots := set(graph) - {f for out in graph.values() for f in out}:
        graph = {f: out for f, out in graph.items() if f not in roots}
    return sorted(graph)


def check_include_cycles(files):
    """Check that files do not include each other in cycles."""
    graph = {f: set() for f in files}
    for file in files:
        for used, name in included(file):
            target = os.path.join(used, os.path.basename(name))
            if target in graph and target != file:
                graph[file].add(target)
    if cycles := in_cycles(graph):
        faults.append(f"files that include each other in cycles: {cycles}")


def objects():
    """For each object file, yield the source file without its ending, and lists of the external names that it defines
    and uses."""
    sources = {}
    for folder, _, names in os.walk(build):
        match = re.search(r"(.*)/CMakeFiles/supine_[a-z_]+\.dir(.*)$", os.path.relpath(folder, build))
        for name in names if match else []:
            file = os.path.normpath(f"{match[1]}{match[2]}/{name[:-len('.o')]}".replace("/__/", "/../"))
            if name.endswith(".c.o") and os.path.exists(os.path.join(source, file)):
                sources[os.path.join(folder, name)] = file[:-len(".c")]
    listed = subprocess.run(["nm", "--extern-only", *sources], capture_output=True, text=True, check=True).stdout
    for part in re.split(r"^\n(?=/)", listed, flags=re.M)[1:]:
        path, names = part.split(":\n", 1)
        yield (sources[path], re.findall(r" [A-TV-Z] (\w+)$", names, re.M), re.findall(r" U (\w+)$", names, re.M))


def declaring_folders(files):
    """Return the folder of the header that declares each function or variable. Names that a macro makes are missing."""
    folder_of = {}
    for file in files:
        if file.endswith(".h"):
            text = without_comments(read(file))
            for name in re.findall(r"\b(supine_\w+)\(", text) + [
                    name for names in re.findall(r"^extern ([^;]*);", text, re.M)
                    for name in re.findall(r"\bsupine_\w+", names)]:
                folder_of.setdefault(name, os.path.dirname(file))
    return folder_of


def check_names(folders, files):
    """Check that external names begin with the prefix of their folder, and that files do not use each other in
    cycles."""
    listed = list(objects())
    home = {name: file for file, defined, _ in listed for name in defined}
    folder_of = declaring_folders(files)
    for file, defined, _ in listed:
        for symbol in defined:
            folder = folder_of.get(symbol, os.path.dirname(file))
            prefix = "supine_" if folder in LIBRARY else f"supine_{os.path.basename(folder)}_"
            if not symbol.startswith((prefix, "__")) and symbol + "_" != prefix:
                faults.append(f"{file}.c defines {symbol}, which does not begin with {prefix}")
    graph = {file: {home[name] for name in used if name in home} - {file} for file, _, used in listed}
    if cycles := in_cycles(graph):
        faults.append(f"files that use each other in cycles: {cycles}")
    if len(listed) < len(folders):
        faults.append(f"only {len(listed)} object files in {build}: build first")


def check_sizes(files):
    """Check that functions have at most 60 lines and 7 parameters, unless the comment above gives a reason with the
    word "lines" or "parameters"."""
    begin = re.compile(r"^(?!(?:typedef|struct|enum|union)\b)"
                       r"(?:\w[\w ]*\n)?[A-Za-z_][^\n;:{}=#]*(?:\n +[^\n;{}=#]*)*\) \{$", re.M)
    head = re.compile(r"\b(\w+)\(([^;{}]*)\) \{$")
    for file in files:
        if not file.endswith(".c"):
            continue
        text = read(file)
        for found in begin.finditer(text):
            name, parameters = head.search(found.group()).groups()
            lines = text.count("\n", found.start(), text.index("\n}", found.end())) + 2
            before = text[:found.start()].rstrip()
            comment = before[before.rfind("/*"):] if before.endswith("*/") else ""
            if parameters.count(",") + 1 > 7 and "parameters" not in comment:
                faults.append(f"{file}: {name} has {parameters.count(',') + 1} parameters: at most 7, or give the "
                              f"reason above it")
            if lines > 60 and "lines" not in comment:
                faults.append(f"{file}: {name} has {lines} lines: at most 60, or give the reason above it")


def check_licences():
    """Check that LICENSE and .reuse/dep5 name no file and no folder that does not exist."""
    named = [("LICENSE", path) for path in re.findall(r"[\w.-]+/[\w./-]*\w", read("LICENSE"))]
    if os.path.exists(os.path.join(source, ".reuse/dep5")):
        named += [(".reuse/dep5", path) for line in re.findall(r"^Files:(.*)$", read(".reuse/dep5"), re.M)
                  for path in line.split()]
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
            for name in opening.findall(read(file)):
                faults.append(f"{file} calls {name}: call supine_input_open, or supine_input_open_beside for a "
                              f"name from a file")


# Sources of functions that the JavaScript package calls and that have remedies.
JAVASCRIPT = ("runtime/basis.c", "runtime/pose.c", "runtime/checks.c", "runtime/state.c", "runtime/expected.c")
LOCALE_FILES = ("base/number.c", "base/locale.c", "base/locale.h")
CALL = re.compile(r"\b((?:v|f|s|vf|vs|sn|vsn|d|as)?printf|"
                  r"(?:f|s)?scanf|strto[dfl]|strtold|ato[fil]|\w*locale\w*|is(?:alnum|alpha|blank|cntrl|digit|"
                  r"graph|lower|print|punct|space|upper|xdigit)|to(?:lower|upper)|strn?casecmp|strcoll|json_\w+)\s*\(")
REAL = re.compile(r"%[-+ #0]*(?:\*|\d+)?(?:\.(?:\*|\d+)?)?[lL]?[aAeEfFgG]")
LITERAL = re.compile(r'"((?:\\.|[^"\\])*)"')
ADJACENT = re.compile(r'"(?:\\.|[^"\\])*"(?:\s*"(?:\\.|[^"\\])*")*')  # literals that are one text


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
        position = {"snprintf": 2, "printf": 0}.get(name, 1)
        if name[0] == "v" or REAL.search(literals) or (len(parts) > position and '"' not in parts[position]):
            return "reals depend on the host's locale: use supine_print or supine_print_text (base/number.h)"
    elif name.endswith("scanf"):
        if REAL.search(literals):
            return "reals depend on the host's locale: use supine_number_parse (base/number.h)"
    elif name not in ("strtol", "atoi", "atol"):
        return "the result depends on the host's locale: use base/number.h"
    return None


def check_locale(files):
    """Check that numbers are parsed and printed, and letters compared, only by functions that ignore the locale of the
    host."""
    for file in files:
        text = without_comments(read(file))
        for call in CALL.finditer(text if file not in LOCALE_FILES else ""):
            function = text[text.rfind("\n}", 0, call.start()) + 1:call.start()]
            fault = locale_fault(call[1], arguments(text, call.end()), function)
            if fault is not None:
                line = text.count("\n", 0, call.start()) + 1
                faults.append(f"{file}:{line}: {call[1]}: {fault}")


def check_distances(files):
    """Check that distances in mm which may be rounding errors are printed by supine_text_distance."""
    for file in files:
        for digits in re.findall(r"%\.\dg mm (?:RMS|at most|largest|apart|95th)|"
                                 r"(?:residual|displacement|distance) %\.\dg mm", read(file)):
            faults.append(f"{file}: '{digits}': digits below rounding depend on the processor: use "
                          f"supine_text_distance")


def check_remedies(files):
    """Check that only the program names commands and options, that remedies name arguments that commands have as
    options, and that no error is set to the message of another without its remedies. Comments may name options, as an
    option is the shortest name of what it sets."""
    options, advised = set(), []
    commands = re.findall(r"^  COMMAND\((\w+)\)", read("program/command/list.h"), re.M)
    command = re.compile(r"\bsupine (?:%s)\b" % "|".join(commands))
    for file in files:
        text = without_comments(read(file))
        options |= set(re.findall(r'\{"([a-z][a-z-]*)", (?:0|\'.\'),', text) if file.startswith("program/") else ())
        for literal in LITERAL.finditer(text if not file.startswith("program/") else ""):
            for name in re.findall(r"--[a-z][a-z-]*", literal[1]):
                line = text.count("\n", 0, literal.start()) + 1
                faults.append(f"{file}:{line}: {name}: a library's message names the argument, and has a remedy "
                              f"(supine/status.h)")
        for literal in ADJACENT.finditer(text if not file.startswith("program/") else ""):
            if command.search("".join(LITERAL.findall(literal[0]))):
                faults.append(f"{file}:{text.count(chr(10), 0, literal.start()) + 1}: a library's message says what to "
                              f"do, and names no command")
        for call in re.finditer(r"\b(?:supine_error_set|SUPINE_REFUSE_IF|SUPINE_REFUSE_ADVISE)\(", text):
            if file != "base/status.c" and re.search(r"(?:\.|->)message\b(?!\[)", "".join(arguments(text, call.end()))):
                line = text.count("\n", 0, call.start()) + 1
                faults.append(f"{file}:{line}: the remedy of the other error is lost: use supine_error_wrap")
        for name in re.findall(r'\bsupine_remedy_(?:give|such_as|set|change|omit)\("(\w+)"', text):
            advised.append((file, name.replace("_", "-")))
    for file, name in advised:
        if name not in options:
            faults.append(f"{file}: a remedy names the argument {name}, but no command has the option --{name}")


def check_waits():
    """Check that tests wait for events, not for a time."""
    for folder, below, names in os.walk(os.path.join(source, "tests")):
        below[:] = [name for name in below if name not in ("node_modules", "bench")]
        for name in (name for name in names if name.endswith((".c", ".cpp", ".py", ".mjs", ".sh"))
                     and name != "house.py"):
            for wait in re.findall(r"\bwaitForTimeout\(|\btime\.sleep\(|\bu?sleep\(|^ *sleep [\d$].*",
                                   read(os.path.join(folder, name)), re.M):
                faults.append(f"{os.path.join(folder, name)}: '{wait}': wait for an event or for the answer to a "
                              f"later message")


def check_python_names(files):
    """Check that each name that a Python file uses is defined in it, or is a built-in."""
    def used(scope):
        for symbol in scope.get_symbols():
            if symbol.is_referenced() and symbol.is_global() or scope.get_type() == "module" and symbol.is_referenced():
                yield symbol.get_name()
        for inner in scope.get_children():
            yield from used(inner)

    def unknown(text, name):
        table = symtable.symtable(text, name, "exec")
        own = {symbol.get_name() for symbol in table.get_symbols() if symbol.is_assigned() or symbol.is_imported()
               or symbol.is_namespace()}
        own |= set(re.findall(r"^\s*global (\w+)", text, re.M))
        return sorted(set(used(table)) - own - set(dir(builtins)) - {"__file__", "__path__"})

    if unknown("import os\ndef f(a):\n    return [os.name for b in a if b != c]\n", "") != ["c"]:
        faults.append("house.py does not find a name that is not defined")
    for file in files:
        text = read(file)
        if not re.search(r"^from \S+ import \*", text, re.M):
            faults.extend(f"{file}: the name {name} is not defined" for name in unknown(text, file))


QUOTED = re.compile(r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'')
CHANGED = (r"(?:(?:\+\+|--|&)\s*{0}\b|\b{0}\s*(?:\+\+|--)|"
           r"\b{0}(?:(?:->|\.)\w+|\[[^]]*\])*\s*(?:[-+*/%&|^]|<<|>>)?=(?!=))")
# What a condition of SUPINE_REFUSE_IF may call: functions that answer a question about values, without effects.
QUESTION = re.compile(r"(?:\w+_)?(?:is|has|same|supports|fits|ends_in|allows|starts|positive|known)(?:_\w+)?|"
                      r"is(?:finite|inf|nan)|S_IS\w+|f(?:abs|max|min|error|eof)|"
                      r"str(?:n?cmp|len|chr|str)|memchr|"
                      r"\w*_(?:metadata|info|size|distance|status|stride|code|value|named|text|names|sum)|"
                      r"failed|sizeof")


def code_of(text):
    """Blank comments, the contents of literals and preprocessor lines, so that positions stay."""
    text = QUOTED.sub(lambda found: found[0][0] + " " * (len(found[0]) - 2) + found[0][0], without_comments(text))
    return re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", lambda found: re.sub(r"[^\n]", " ", found[0]), text, flags=re.M)


def end_of(text, begin, pair="()"):
    """Return the position behind the bracket that closes the one at `begin`."""
    depth = 0
    for at in range(begin, len(text)):
        depth += (text[at] == pair[0]) - (text[at] == pair[1])
        if depth == 0:
            return at + 1
    return len(text)


def split_at(text, separator):
    """Split at separators that are outside brackets."""
    parts, depth, at = [""], 0, 0
    while at < len(text):
        depth += (text[at] in "([{") - (text[at] in ")]}")
        if depth == 0 and text.startswith(separator, at):
            parts.append("")
            at += len(separator)
        else:
            parts[-1] += text[at]
            at += 1
    return parts


def hidden_if(text, begin):
    """Return the part of the condition of a `for` that no turn of the loop can change, or None."""
    after = end_of(text, begin)
    head = split_at(text[begin + 1:after - 1], ";")
    body = after + len(text[after:]) - len(text[after:].lstrip())
    body = text[body:end_of(text, body, "{}")] if text[body] == "{" else text[body:text.index(";", body)]
    turn = f"{head[2]};{body}" if len(head) == 3 else ""
    parts = split_at(head[1], "&&") if len(head) == 3 else []
    for part in parts if len(parts) > 1 else []:
        part = re.sub(r"\bsizeof\s*\(?[\w.>-]+", "", part)
        pointer = re.fullmatch(r"\s*([\w.>-]+) [!=]= NULL\s*", part)
        if pointer and not re.search(r"(?<![\w.>])%s = |&%s\b(?!->|\[|\.)" % ((re.escape(pointer[1]),) * 2), turn):
            return part.strip()
        names = set(re.findall(r"(?<![.\w>])[A-Za-z_]\w*", part)) | set(re.findall(r"->\s*(\w+)", part))
        passed = re.findall(r"\w\(([^;{}]*)\)", turn)
        changes = any(re.search(CHANGED.format(name), turn) for name in names)
        reached = any(re.search(r"(?<!\w)%s\b(?!\s*(?:->|\[|\.))" % name, call)
                      for name in re.findall(r"(\w+)\s*(?:->|\[)|\w\((\w+)\)", part) for name in name if name
                      for call in passed)
        works = [called for called in re.findall(r"(\w+)\(", part) if called != "sizeof"
                 and not QUESTION.fullmatch(called)]
        if not changes and not reached and not works:
            return part.strip()
    return None


def nested_choice(statement):
    """Return whether a branch or the condition of one ?: is another."""
    for first in (at for at, letter in enumerate(statement) if letter == "?"):
        depth = 0
        for letter in statement[first + 1:]:
            depth += (letter in "([") - (letter in ")]")
            if depth < 0 or (letter == "," and depth == 0):
                break
            if letter == "?" and depth == 0:
                return True
    return bool(re.search(r"[?:]\s*\([^()]*(?:\([^()]*\)[^()]*)*\?"
                          r"(?:[^()]|\([^()]*\))*:(?:[^()]|\([^()]*\))*\)\s*[;:,)]", statement))


def forms_of(text):
    """Yield the position of each form that a reader pays for, and how to write it plainly."""
    for found in re.finditer(r"\bfor \(", text):
        part = hidden_if(text, found.end() - 1)
        if part is not None:
            yield found.start(), f"the condition of the loop hides an if ({part}): write the if around the loop"
    for found in re.finditer(r"[^;{}]*[;{}]", text):
        if nested_choice(found[0]):
            yield (found.start() + len(found[0]) - len(found[0].lstrip()),
                   "nested ?: are hard to read: use if, switch or a table")
    for found in re.finditer(r"\bSUPINE_TRY\(", text):
        if len(split_at(text[found.end():end_of(text, found.end() - 1) - 1], "?")) > 1:
            yield found.start(), "SUPINE_TRY(c ? a : b): write if (c) { SUPINE_TRY(a); }"
    for found in re.finditer(r"\*\([^();]*\?[^();]*\)\s*=(?!=)", text):
        yield found.start(), "*(c ? &a : &b) = x: use if and else"
    for found in re.finditer(r"\(void\)\(", text):
        if len(split_at(text[found.end():end_of(text, found.end() - 1) - 1], "&&")) > 1:
            yield found.start(), "(void)(a && f()): write if (a) { (void)f(); }"
    for found in re.finditer(r"\bSUPINE_REFUSE_IF\(", text):
        condition = arguments(text, found.end())[0]
        for called in re.findall(r"\b(\w+)\s*\(", condition):
            if not QUESTION.fullmatch(called):
                yield (found.start(), f"{called} is work inside a condition of SUPINE_REFUSE_IF: call it in a "
                                      f"statement before")
        if re.search(r"!\([^()]*>\s*0\)", condition):
            yield found.start(), "write count == 0 instead of !(count > 0)"


# Code that check_forms refuses, and the same written plainly.
FORMS = (("for (i = 0; i < n && wanted; ++i) { f(i); }", "if (wanted) { for (i = 0; i < n; ++i) { f(i); } }"),
         ("for (a = 0; p->kind == X && a < 3; ++a) { s[a] += 1; }", "for (a = 0; good && a < 3; ++a) { good = f(a); }"),
         ("for (i = 0; i < n && p != NULL; ++i) { p[i] = f(&p->x); }",
          "for (i = 0; i < n && p != NULL; ++i) { p = f(p); }"),
         ("for (i = 0; i < n && left > 0; ++i) { f(i); }", "for (i = 0; i < n && left > 0; ++i) { left -= f(i); }"),
         ("for (i = 0; i < n && c->status == 0; ++i) { f(i); }", "for (i = 0; i < n && c->status == 0; ++i) { f(c); }"),
         ("x = a ? b : c ? d : e;", "x = a ? b : c; y = d ? e : f;"),
         ("x = a ? (b ? c : d) : e;", "f(a ? b : c, d ? e : g);"),
         ("for (k = 0; k < 3 && json_array_size(a) == 3; ++k) { f(k); }",
          "for (k = 0; k < 3 && next(a); ++k) { f(k); }"),
         ("(void)(a != NULL && f(a));", "if (a != NULL) { (void)f(a); }"),
         ("SUPINE_TRY(c ? f() : SUPINE_OK);", "SUPINE_TRY(f(c ? a : b));"), ("*(c ? &a : &b) = x;", "*a = c ? x : y;"),
         ('SUPINE_REFUSE_IF(fread(p, 1, n, file) != n, error, X, "short");',
          'SUPINE_REFUSE_IF(got != n, error, X, "short");'),
         ('SUPINE_REFUSE_IF(!(count > 0), error, X, "none");',
          'SUPINE_REFUSE_IF(!(x > 0.0) || !isfinite(x), error, X, "x");'))


def check_forms(files):
    """Check that sources have none of the forms that save lines at the expense of the reader."""
    for refused, plain in FORMS:
        if not list(forms_of(refused)) or list(forms_of(plain)):
            faults.append(f"house.py does not tell '{refused}' from '{plain}'")
    for file in files:
        written = read(file)
        text = code_of(written)
        for position, form in forms_of(text):
            line = text.count("\n", 0, position) + 1
            faults.append(f"{file}:{line}: {form}")
        for found in re.finditer(r"^ */\* .*\n *\*/$", written, re.M):
            line = written.count("\n", 0, found.start()) + 1
            faults.append(f"{file}:{line}: the end of the comment stands alone: put its last word there, too")


def check_examples():
    """Check that each example has a README that names its files and an existing test, and a row in
    examples/README.md."""
    defined = set()
    for path in glob.glob(os.path.join(source, "tests", "*.cmake")) + [os.path.join(source, "tests", "CMakeLists.txt")]:
        rules = read(path).replace("npm_${where}", "npm_node")
        defined |= set(re.findall(r"(?:add_test\(NAME |supine_test\((?:\w+/)?)([\w$\{}]+)", rules))
    table = set(re.findall(r"^\| \[(\w+)\]\(\1/README\.md\) \|", read("examples/README.md"), re.M))
    present = {name for name in os.listdir(os.path.join(source, "examples")) if name != "README.md"}
    faults.extend(f"examples/README.md: no row for {name}" for name in sorted(present - table))
    faults.extend(f"examples/README.md: {name} does not exist" for name in sorted(table - present))
    for name in sorted(present & table):
        text = read(f"examples/{name}/README.md")
        tests = set(re.findall(r"test `(\w+)`", text))
        if not tests or not tests <= defined | {"npm_browser"}:
            faults.append(f"examples/{name}/README.md: name the tests that build or run the example: {sorted(tests)}")
        for _, below, names in os.walk(os.path.join(source, "examples", name)):
            below[:] = [inner for inner in below if inner != "__pycache__"]
            faults.extend(f"examples/{name}/README.md does not name {file}" for file in names if file not in text and
                          os.path.splitext(file)[0] not in text and file not in ("README.md", "CMakeLists.txt"))


folders = read_table()
files = tracked()
check_examples()
check_licences()
check_locale(files)
check_sizes(files)
check_distances(files)
check_forms(files)
check_waits()
check_remedies(files)
check_includes(folders, files)
check_system_headers(files)
check_opening(files)
check_python_names(tracked_python())
check_include_cycles(files)
check_names(folders, files)
faults.extend(house_scripts.faults_of(source, scripts()))
for fault in faults:
    print(fault)
print(f"{len(folders)} folders, {len(files)} files, {len(faults)} faults")
sys.exit(1 if faults else 0)
