# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders that appear whole or not at all, and programs whose failure ends this one."""
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path


def run(*words):
    """Run a program, pass on its messages, and return what it prints. If it fails, exit with its status."""
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    sys.stderr.write(done.stderr)
    if done.returncode != 0:
        sys.exit(done.returncode)
    return done.stdout


def check_new(path):
    """Exit with an error unless a folder can be made there."""
    if path.exists() or not path.absolute().parent.is_dir():
        sys.exit(f"{path}: name a new folder, in one that exists")


@contextmanager
def new_folder(path):
    """Give a folder to fill, which gets its name `path` when that is done."""
    with tempfile.TemporaryDirectory(dir=path.absolute().parent) as part:
        folder = Path(part, "new")
        folder.mkdir()
        yield folder
        folder.rename(path)
