# SPDX-License-Identifier: GPL-3.0-or-later
"""Check the length of lines and functions of JavaScript and Python, for house.py, and that no conditional expression
has another one as a part. Rows of tables in Markdown may be long."""
import ast
import os
import re

LINE_MOST = 120
FUNCTION_MOST = 60
THIRD_PARTY = ("program/view/page/meshopt_decoder.js",)
# The first line of a function whose body has lines of its own: a declaration, a method, or an arrow.
BEGIN = re.compile(r"(\bfunction\b.*|=>|^\s*(static |async |get |set )*[#\w]+\(.*\))\s*\{$")
CONTROL = re.compile(r"\s*(\} )?(if|for|while|switch|else|do|try|catch|class)\b")


def javascript_functions(lines):
    """Yield the number of the first line, and the number of lines in the body, of each function. A body ends where a
    line with the indentation of the first begins with a brace."""
    for first, line in enumerate(lines):
        if BEGIN.search(line) and not CONTROL.match(line):
            end = line[:len(line) - len(line.lstrip())] + "}"
            last = next((i for i in range(first + 1, len(lines)) if lines[i].startswith(end)), len(lines))
            yield first + 1, last - first - 1


def python_functions(text):
    """Yield the number of the first line, and the number of lines without the docstring, of each function."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            about = node.body[0] if ast.get_docstring(node) is not None else None
            yield node.lineno, node.end_lineno - node.lineno - (about.end_lineno - about.lineno + 1 if about else 0)


def nested_python(text):
    """Yield the line of each conditional expression with another one as a part."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.IfExp) and any(isinstance(x, ast.IfExp) for x in (node.body, node.test, node.orelse)):
            yield node.lineno


def nested_javascript(lines):
    """Yield the number of each line with a conditional expression behind the colon of another one, outside texts."""
    for number, line in enumerate(lines, 1):
        found = re.search(r" \? [^?]* : ([^?,]*) \? ", re.sub(r"//.*|'[^']*'|`[^`]*`", "", line))
        if found and found[1].count(")") <= found[1].count("("):
            yield number


def faults_of(source, files):
    """Return what is too long, or nested, in the files of JavaScript and Python."""
    found = []
    for file in files:
        script = file.endswith((".js", ".mjs")) and file not in THIRD_PARTY
        if not script and not file.endswith(".py"):
            continue
        with open(os.path.join(source, file), encoding="utf-8") as opened:
            text = opened.read()
        lines = text.split("\n")
        for number, line in enumerate(lines, 1):
            if len(line) > LINE_MOST and not line.startswith("| "):
                found.append(f"{file}:{number}: a line of {len(line)} characters: at most {LINE_MOST}")
        for number, length in javascript_functions(lines) if script else python_functions(text):
            if length > FUNCTION_MOST:
                found.append(f"{file}:{number}: a function of {length} lines: at most {FUNCTION_MOST}")
        for number in nested_javascript(lines) if script else nested_python(text):
            found.append(f"{file}:{number}: a conditional expression in another one: use if, or a table")
    return found
