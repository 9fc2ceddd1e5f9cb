# SPDX-License-Identifier: MIT
"""Builds the run-time library, by CMake, and the extension module around it.

SUPINE_LIBRARY names a libsupine_runtime.a that is there already, of these very sources."""
import os
import re
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

here = os.path.dirname(os.path.abspath(__file__))
os.chdir(here)
top = os.path.normpath(os.path.join(here, "..", ".."))


def version():
    with open(os.path.join(top, "runtime/include/supine/version.h"), encoding="utf-8") as header:
        return re.search(r'define SUPINE_VERSION "([0-9.]+)"', header.read())[1]


class Build(build_ext):
    def run(self):
        library = os.environ.get("SUPINE_LIBRARY")
        if not library:
            folder = os.path.abspath(os.path.join(self.build_temp, "runtime"))
            subprocess.run(["cmake", "-S", top, "-B", folder, "-DSUPINE_RUNTIME_ONLY=ON"], check=True)
            subprocess.run(["cmake", "--build", folder, "--parallel", "--target", "supine_runtime"],
                           check=True)
            library = os.path.join(folder, "runtime", "libsupine_runtime.a")
        for extension in self.extensions:
            extension.extra_objects = [library]
            extension.depends = [library]
        super().run()


# Arrays can be asked of objects through Python's stable interface since 3.11: one wheel for all after.
stable = sys.version_info >= (3, 11)
setup(
    version=version(),
    ext_modules=[Extension(
        "supine._supine",
        sources=["module.c", "errors.c", "arguments.c", "block.c", "basis.c"],
        include_dirs=[top, os.path.join(top, "runtime/include"), os.path.join(top, "sh/include")],
        # The library's names stay inside, lest another version's in the same process take their place.
        extra_link_args=["-Wl,--exclude-libs,ALL", "-Wl,-s"] if sys.platform == "linux" else [],
        define_macros=[("Py_LIMITED_API", "0x030B0000")] if stable else [],
        py_limited_api=stable)],
    cmdclass={"build_ext": Build},
    options={"bdist_wheel": {"py_limited_api": "cp311"}} if stable else {})
