# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the code blocks of the guide and of the README files of examples:

    test_guide.py SOURCE_FOLDER PROGRAM LIBRARY CC [PAGE | examples]...

The blocks `sh`, `python` and `js` of each page run in order, in a folder with the programs of the guide, or in a copy
of the example. A block `sh not-run` may not call supine. A page may have no other blocks. Links to files must work, and
each page of the guide must show a picture, and make it. With GUIDE_PICTURES set, these replace the pictures in
docs/guide.

Blocks of JavaScript need node and the package (target npm), those of C# Mono: without these they do not run, which is
said. Exit with 77 if numpy or nibabel is missing."""
import glob
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile

try:
    import nibabel
    import numpy
    assert nibabel and numpy
except ImportError:
    print("skipped: no numpy or no nibabel")
    sys.exit(77)

source, program, library, compiler = (os.path.abspath(path) for path in sys.argv[1:5])
build = os.path.dirname(program)
guide, examples = os.path.join(source, "docs/guide"), os.path.join(source, "examples")
faults = []
# What a command in a block needs beside the program, and which examples need the installed libraries.
NEEDS = {"mcs": "mcs", "mono": "mono", "cmake": "cmake", "pkg-config": "pkg-config"}
INSTALLED = {"deform": ("runtime",), "precompute": ("runtime", "precompute")}


def prepare(folder):
    """Make a folder with the program, the Python package and, if it was built, the JavaScript package; return the
    environment of commands."""
    os.mkdir(os.path.join(folder, "bin"))
    os.symlink(program, os.path.join(folder, "bin", "supine"))
    os.symlink(sys.executable, os.path.join(folder, "bin", "python3"))
    shutil.copytree(os.path.join(source, "runtime/python/supine"), os.path.join(folder, "python/supine"))
    shutil.copy(library, os.path.join(folder, "python/supine/libsupine_runtime.so"))
    for path in glob.glob(os.path.join(build, "runtime/js/supine-*.tgz")):
        with tarfile.open(path) as packed:
            packed.extractall(os.path.join(folder, "package"))
        os.makedirs(os.path.join(folder, "node_modules"), exist_ok=True)
        os.rename(os.path.join(folder, "package/package"), os.path.join(folder, "node_modules/supine"))
    return {**os.environ, "PATH": f"{folder}/bin:{os.environ['PATH']}", "PYTHONPATH": f"{folder}/python",
            "CC": compiler, "LIBRARY": library, "SOURCE": source}


def install(folder, environment, components):
    """Install the libraries, and return the environment in which CMake, pkg-config and programs find them."""
    prefix = os.path.join(folder, "prefix")
    for component in components:
        subprocess.run(["cmake", "--install", build, "--prefix", prefix, "--component", component], check=True,
                       capture_output=True)
    folders = {os.path.dirname(path) for path in glob.glob(f"{prefix}/lib/**/libsupine_*.so", recursive=True)}
    libraries = ":".join(sorted(folders))
    return {**environment, "CMAKE_PREFIX_PATH": prefix, "LD_LIBRARY_PATH": libraries,
            "PKG_CONFIG_PATH": ":".join(f"{folder}/pkgconfig" for folder in sorted(folders))}


def missing(language, code, folder):
    """Return what a block needs and this machine lacks, or None."""
    if language == "js" and not (shutil.which("node") and os.path.exists(os.path.join(folder, "node_modules"))):
        return "node, or the target npm"
    words = set(re.findall(r"(?:^|&& |\$\()([\w-]+)", code, re.M))
    return next((tool for tool in NEEDS if tool in words and not shutil.which(tool)), None)


def run_block(name, language, code, here, environment):
    """Run a block; return whether it ended well."""
    if language == "js":
        with open(os.path.join(here, "block.mjs"), "w", encoding="utf-8") as file:
            file.write(code)
    command = {"sh": ["sh", "-ec", code], "python": [sys.executable, "-c", code], "js": ["node", "block.mjs"]}[language]
    done = subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, check=False, timeout=600)
    if done.returncode != 0:
        faults.append(f"{name}: exit status {done.returncode} of\n{code}{done.stdout}{done.stderr}")
    return done.returncode == 0


def run_blocks(name, text, folder, here, environment):
    """Run the blocks of a page, and print how many ran."""
    blocks = re.findall(r"^```([^\n]*)\n(.*?)^```$", text, re.M | re.S)
    if re.search(r"\n\n    \S", re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)):
        faults.append(f"{name}: an indented block: write it between fences, so that it runs")
    ran = 0
    for language, code in blocks:
        if language == "sh not-run":
            if re.search(r"^\s*supine\s", code, re.M):
                faults.append(f"{name}: a block '{language}' calls supine, but is not run:\n{code}")
        elif language not in ("sh", "python", "js"):
            faults.append(f"{name}: a block '{language}': tag it sh, python or js, which run, or sh not-run")
        elif missing(language, code, folder):
            print(f"{name}: a block does not run without {missing(language, code, folder)}")
        else:
            ran += 1
            if not run_block(name, language, code, here, environment):
                break
    tagged = sum(language == "sh not-run" for language, _ in blocks)
    print(f"{name}: {ran} of {len(blocks)} blocks run, {tagged} tagged as not run", flush=True)


def check_links(name, text, folder):
    for link in re.findall(r"\]\(([^)#:]+)[^):]*\)", text):
        if not os.path.exists(os.path.join(folder, link)):
            faults.append(f"{name}: no file {link}")


def check_page(page):
    """Run a page of the guide in a folder of its own, and check its pictures."""
    name = os.path.basename(page)
    with open(page, encoding="utf-8") as file:
        text = file.read()
    check_links(name, text, guide)
    with tempfile.TemporaryDirectory() as folder:
        environment = prepare(folder)
        here = os.path.join(folder, "here")
        os.mkdir(here)
        for path in glob.glob(os.path.join(guide, "*.py")):
            shutil.copy(path, here)
        run_blocks(name, text, folder, here, environment)
        pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", text)
        if not pictures and name != "README.md":
            faults.append(f"{name}: no picture")
        for picture in pictures:
            made = os.path.join(here, picture)
            if not os.path.exists(made):
                faults.append(f"{name}: no block makes {picture}")
            elif os.environ.get("GUIDE_PICTURES"):
                shutil.copy(made, guide)


def check_examples():
    """Run the README files of all examples, which read the basis that the first of them makes, in a copy of them."""
    with tempfile.TemporaryDirectory() as folder:
        environment = prepare(folder)
        copy = os.path.join(folder, "examples")
        shutil.copytree(examples, copy)
        for page in [os.path.join(copy, "README.md"), *sorted(glob.glob(os.path.join(copy, "*/README.md")))]:
            here = os.path.dirname(page)
            example = os.path.basename(here) if here != copy else ""
            with open(page, encoding="utf-8") as file:
                text = file.read()
            check_links(f"examples/{example}", text, os.path.join(examples, example))
            own = {**environment, "LD_LIBRARY_PATH": os.path.dirname(library)}
            if example:
                shutil.copy(os.path.join(copy, "lungs.safetensors"), here)
            if example in INSTALLED:
                own = install(folder, environment, INSTALLED[example])
            run_blocks(f"examples/{example}", text, folder, here, own)


def main():
    named = sys.argv[5:]
    for page in [os.path.join(guide, page) for page in named] or sorted(glob.glob(os.path.join(guide, "*.md"))):
        if os.path.basename(page) != "examples":
            check_page(page)
    if not named or "examples" in named:
        check_examples()
    print("\n".join(faults))
    return bool(faults)


sys.exit(main())
