# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the wheel of the Python package, install it without network access into a clean environment, and test it.

    test_python.py SOURCE_FOLDER LIBRARY OFFLINE_LIBRARY SUPINE CC [quick]

With `quick`, bases are made by the program alone, not by the offline library too."""
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile

source, library, offline, supine, cc = sys.argv[1:6]
for wanted in ("pip", "setuptools", "wheel", "numpy"):
    if importlib.util.find_spec(wanted) is None:
        print(f"skipped: this python has no {wanted}")
        sys.exit(77)

with tempfile.TemporaryDirectory() as folder:
    # The user's own Python modules must not replace Debian's.
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "PIP_", "SUPINE_"))}
    clean.update(HOME=folder, PIP_CONFIG_FILE=os.devnull, PIP_NO_CACHE_DIR="1",
                 PIP_DISABLE_PIP_VERSION_CHECK="1", PIP_NO_INDEX="1", LD_LIBRARY_PATH=os.path.dirname(library),
                 PATH=os.path.dirname(supine) + os.pathsep + os.environ["PATH"])

    def run(*arguments, **keywords):
        done = subprocess.run(arguments, cwd=folder, env=clean, text=True, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, check=False, **keywords)
        assert done.returncode == 0, f"{' '.join(arguments)}\n{done.stdout}"
        return done.stdout

    # Build in a copy of the sources, as the build leaves files beside them.
    for name in ("CMakeLists.txt", "base", "runtime"):
        path = os.path.join(source, name)
        target = os.path.join(folder, "source", name)
        if os.path.isdir(path):
            shutil.copytree(path, target)
        else:
            os.makedirs(os.path.dirname(target))
            shutil.copy(path, target)
    # Build as runtime/python/README.md says.
    with open(f"{source}/runtime/python/README.md", encoding="utf-8") as readme:
        command = re.search(r"^    python3 (-m pip wheel .*? runtime/python) ", readme.read(), re.M)[1]
    run(sys.executable, *command.replace("runtime/python", "source/runtime/python").split(), "--wheel-dir", "wheels")
    wheel, = os.listdir(os.path.join(folder, "wheels"))
    # The platform tag states the newest version of glibc that the symbols of the library need.
    wanted = re.findall(r"GLIBC_2\.(\d+)", run("objdump", "-T", library))
    assert f"-py3-none-manylinux_2_{max(map(int, wanted))}_" in wheel, wheel
    with zipfile.ZipFile(os.path.join(folder, "wheels", wheel)) as opened:
        about = opened.read(next(name for name in opened.namelist() if name.endswith("METADATA"))).decode()
    for line in ("Author: The Supine authors", "Project-URL: Method", "Classifier: License :: OSI Approved :: MIT"):
        assert line in about, about
    run(sys.executable, "-m", "venv", "--without-pip", "--system-site-packages", "clean")
    python = os.path.join(folder, "clean/bin/python")
    run(sys.executable, "-m", "pip", "--python", python, "install", os.path.join("wheels", wheel))
    run(f"{source}/tests/scripts/test_search_path.sh", "clean/lib")

    run(cc, "-std=c17", "-O2", "-Wall", "-Wextra", "-Werror", f"-I{source}/runtime/include",
        f"{source}/tests/python/reference.c", library, "-lm", "-o", "reference")
    run(supine, "phantom", "-o", "lungs.ply", "--vertices", "5000")
    run(supine, "precompute", "lungs.ply", "-o", "lungs.safetensors", "--band", "3")
    run(supine, "precompute", "lungs.ply", "-o", "other.safetensors", "--band", "2")
    run(supine, "embed", "lungs.safetensors", "--grid", "12", "-o", "grid.safetensors")
    for name in ("clusters", "simulated"):
        shutil.copy(f"{source}/tests/golden/basis_{name}.safetensors", os.path.join(folder, f"{name}.safetensors"))
    print(wheel, run(python, f"{source}/tests/python/inside.py", "./reference", "lungs.safetensors", "program"))
    if sys.argv[6:] != ["quick"]:
        # With the offline library beside the package, the same results are made in process.
        package = os.path.dirname(run(python, "-c", "import supine; print(supine.__file__)"))
        os.remove(os.path.join(package, "supine"))
        shutil.copy(offline, os.path.join(package, "libsupine_precompute.so"))
        print("offline library:",
              run(python, f"{source}/tests/python/inside.py", "./reference", "lungs.safetensors", "library"))

    # Run the examples of runtime/python/README.md; the one with VTK needs VTK.
    with open(f"{source}/runtime/python/README.md", encoding="utf-8") as readme:
        text = readme.read()
    if importlib.util.find_spec("vtk") is None:
        text = text[:text.index("## VTK")]
    with open(os.path.join(folder, "examples.txt"), "w", encoding="utf-8") as examples:
        examples.write(text)
    print(run(python, "-m", "doctest", "examples.txt"), "examples run")
    with open(f"{source}/README.md", encoding="utf-8") as readme:
        lines = re.search(r"```python\n(.*?)```", readme.read(), re.S)[1]
    with open(os.path.join(folder, "readme.py"), "w", encoding="utf-8") as program:
        program.write("import supine\n_ = supine.open('lungs.safetensors')\n"
                      "vertices, faces = _.vertices, _.triangles\n" + lines)
    print(run(python, "readme.py"))
    # Run the example.
    told = run(python, f"{source}/examples/python/lungs.py", "lungs.safetensors", "supine:rest", "left:rest+300")
    assert re.search(r"left lung: moves by \d.*\nright lung: moves by \d.*\nnodule: moves by \d.*expected error \d",
                     told), told
    run(supine, "phantom", "-o", "small.ply", "--vertices", "500")
    run(supine, "precompute", "small.ply", "-o", "small.safetensors", "--band", "3")
    print(run(python, f"{source}/tests/bench/bench_python.py", "./reference", "small.safetensors", "2"))
