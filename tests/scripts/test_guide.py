# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the code blocks of the guide: test_guide.py SOURCE_FOLDER PROGRAM LIBRARY CC [PAGE...]

The blocks `sh` and `python` of each page run in order, in a folder with the programs of the guide. A block `sh not-run`
may not call supine. Other blocks are not run, and lines in them may not begin with `supine`. Links to files must work,
and each page must show a picture, and make it. With GUIDE_PICTURES set, these replace the pictures in docs/guide.

Exit with 77 if numpy or nibabel is missing."""
import glob
import os
import re
import shutil
import subprocess
import sys
import tempfile

try:
    import nibabel
    import numpy
    assert nibabel and numpy
except ImportError:
    print("skipped: no numpy or no nibabel")
    sys.exit(77)

source, program, library, compiler = (os.path.abspath(path) for path in sys.argv[1:5])
guide = os.path.join(source, "docs/guide")
faults = []


def check_page(page):
    name = os.path.basename(page)
    with open(page, encoding="utf-8") as file:
        text = file.read()
    blocks = re.findall(r"^```([^\n]*)\n(.*?)^```$", text, re.M | re.S)
    for link in re.findall(r"\]\(([^)#:]+)[^):]*\)", text):
        if not os.path.exists(os.path.join(guide, link)):
            faults.append(f"{name}: no file {link}")
    with tempfile.TemporaryDirectory() as folder:
        os.mkdir(os.path.join(folder, "bin"))
        os.symlink(program, os.path.join(folder, "bin", "supine"))
        os.symlink(sys.executable, os.path.join(folder, "bin", "python3"))
        here = os.path.join(folder, "here")
        os.mkdir(here)
        for path in glob.glob(os.path.join(guide, "*.py")):
            shutil.copy(path, here)
        shutil.copytree(os.path.join(source, "runtime/python/supine"), os.path.join(folder, "python/supine"))
        shutil.copy(library, os.path.join(folder, "python/supine/libsupine_runtime.so"))
        environment = {**os.environ, "PATH": f"{folder}/bin:{os.environ['PATH']}", "PYTHONPATH": f"{folder}/python",
                       "CC": compiler, "LIBRARY": library, "SOURCE": source}
        ran = 0
        for language, code in blocks:
            if language in ("sh", "python"):
                command = ["sh", "-ec", code] if language == "sh" else [sys.executable, "-c", code]
                done = subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, check=False,
                                      timeout=600)
                ran += 1
                if done.returncode != 0:
                    faults.append(f"{name}: exit status {done.returncode} of\n{code}{done.stdout}{done.stderr}")
                    break
            elif re.search(r"^\s*supine\s", code, re.M):
                faults.append(f"{name}: a block '{language}' calls supine, but is not run:\n{code}")
        pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", text)
        if not pictures and name != "README.md":
            faults.append(f"{name}: no picture")
        for picture in pictures:
            made = os.path.join(here, picture)
            if not os.path.exists(made):
                faults.append(f"{name}: no block makes {picture}")
            elif os.environ.get("GUIDE_PICTURES"):
                shutil.copy(made, guide)
    print(f"{name}: {ran} of {len(blocks)} blocks run")


pages = sorted(glob.glob(os.path.join(guide, "*.md")))
if len(sys.argv) > 5:
    pages = [os.path.join(guide, page) for page in sys.argv[5:]]
for page in pages:
    check_page(page)
print("\n".join(faults))
sys.exit(bool(faults))
