# SPDX-License-Identifier: MIT
"""Build the run-time library with CMake, and put it into the package.

If the environment variable SUPINE_LIBRARY names a shared library built from the same sources, use
that library."""
import glob
import os
import re
import shutil
import subprocess

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py
from wheel.bdist_wheel import bdist_wheel

here = os.path.dirname(os.path.abspath(__file__))
os.chdir(here)
top = os.path.normpath(os.path.join(here, "..", ".."))


def version():
    with open(os.path.join(top, "runtime/include/supine/version.h"), encoding="utf-8") as header:
        return re.search(r'define SUPINE_VERSION "([0-9.]+)"', header.read())[1]


class Build(build_py):
    def run(self):
        super().run()
        library = os.environ.get("SUPINE_LIBRARY")
        if not library:
            folder = os.path.abspath("build/runtime")
            subprocess.run(["cmake", "-S", top, "-B", folder, "-DSUPINE_RUNTIME_ONLY=ON"], check=True)
            subprocess.run(["cmake", "--build", folder, "--parallel", "--target", "supine_runtime_shared"], check=True)
            # The shortest name is that of the library; others end in a version or are import libraries.
            library = min(glob.glob(os.path.join(folder, "runtime", "*supine_runtime.[sd]*")), key=len)
        shutil.copy(library, os.path.join(self.build_lib, "supine", "libsupine_runtime.so"))


class Wheel(bdist_wheel):
    """Build one wheel for every version of Python, as nothing in it is compiled against Python. On Linux, the tag of
    the wheel states the oldest glibc that has every symbol that the library needs."""
    def get_tag(self):
        platform = super().get_tag()[2]
        with open(os.path.join(self.get_finalized_command("build_py").build_lib, "supine/libsupine_runtime.so"),
                  "rb") as library:
            asked = [int(minor) for minor in re.findall(rb"\0GLIBC_2\.(\d+)", library.read())]
        return "py3", "none", platform.replace("linux_", f"manylinux_2_{max(17, *asked)}_") if asked else platform


class Binary(Distribution):
    def has_ext_modules(self):
        return True


setup(version=version(), cmdclass={"build_py": Build, "bdist_wheel": Wheel}, distclass=Binary)
