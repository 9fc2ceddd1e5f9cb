# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow each recipe of CONTRIBUTING.md on a copy of the sources, build the copy, and see what was added work.

    python3 recipes.py SOURCE_FOLDER

A recipe may only need changes in the files of the program that its text names. The exit status is 77 if numpy is
missing."""
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile

if importlib.util.find_spec("numpy") is None:
    print("skipped: this python has no numpy")
    sys.exit(77)
import numpy as np

SOURCE = os.path.abspath(sys.argv[1])
TESTED = ("tests/", "docs/", "CHANGELOG.md", "ARCHITECTURE.md")  # files that need no build

# Recipe: file -> (text that is there, text that replaces it), or None and the text of a new file.
RECIPES = {
    "a law": {
        "precompute/physics/model.h": ("LAW(PAPER,",
                                       'LAW(EVEN, "even", 1.05, 0, (0, 0, 0), (6, 2.6, 15, 1, 16, 1.3), 0, '
                                       '(0, 0, 0), 12, true, false, "the same force everywhere") LAW(PAPER,'),
        "precompute/include/supine/precompute.h": ("  SUPINE_PRECOMPUTE_LAW_PAPER,", "  SUPINE_PRECOMPUTE_LAW_EVEN,\n"
                                                   "  SUPINE_PRECOMPUTE_LAW_PAPER,")},
    "a surface format": {
        "mesh/io/save_xyz.c": (None, """/* SPDX-License-Identifier: MIT */
/* Write the vertices as text. */
#include "base/number.h"
#include "mesh/io/save.h"

void supine_io_save_xyz(const mesh_writer *writer) {
  for (size_t i = 0; i < writer->mesh->vertex_count; ++i) {
    float p[3];
    supine_io_writer_position(writer, i, p);
    (void)supine_print(writer->out, "%.9g %.9g %.9g\\n", (double)p[0], (double)p[1], (double)p[2]);
  }
}
"""),
        "mesh/io/CMakeLists.txt": (" save_obj.c ", " save_obj.c save_xyz.c "),
        "mesh/mesh.h": (" NEXT(vtp)", " NEXT(vtp) NEXT(xyz)")},
    "a check of an input": {
        "runtime/include/supine/inputs.h": ("  SUPINE_INPUT_COUNT ",
                                            "  SUPINE_INPUT_PHANTOM_SIZE,\n  SUPINE_INPUT_COUNT "),
        "base/inputs.c": ("};\n/* clang-format on */", """  [SUPINE_INPUT_PHANTOM_SIZE] = {
    .name = "phantom-size", .group = "Words", .input = "a number of vertices", .against = "screens",
    .measured = "vertices", .told = NAN, .refused = 40000, .evidence = TEXT("assumed"),
    .interfaces = COMMAND},
};
/* clang-format on */"""),
        "precompute/lungs/gate.c": None},
    "an output": {"program/command/phantom.c": None, "base/output.h": None, "base/csv.h": None, "base/number.h": None},
    "a command": {
        "program/command/sides.c": (None, """/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine sides: print the sides of the body. */
#include "program/command/list.h"
#include "program/options/command.h"

typedef struct request {
  size_t times;
} request;

static const supine_option table[] = {
    {"times", 0, "N", "how often", SUPINE_FILLS(request, times), .standard = "1"}, {.name = NULL}};

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  const request *wanted = chosen;
  (void)given;
  (void)error;
  for (size_t i = 0; i < wanted->times; ++i) {
    (void)puts("left, right");
  }
  return SUPINE_OK;
}

const supine_command supine_command_sides = {"sides",
                                             "print the sides of the body",
                                             .usage = "[OPTIONS]",
                                             .about = "Prints the sides of the body.",
                                             .options = table,
                                             .notes = "Example:\\n  supine sides",
                                             .request_size = sizeof(request),
                                             .run = run};
"""),
        "program/command/CMakeLists.txt": ("phantom.c ", "phantom.c sides.c "),
        "program/command/list.h": ("  COMMAND(stream)", "  COMMAND(stream) \\\n  COMMAND(sides)"),
        "program/command/phantom.c": None}}

# The recipes of a check and of an output change the same command, `phantom`.
PHANTOM = [
    ("  double volume;\n", "  double volume;\n  const char *corners;\n"),
    ("    {.name = NULL}};", """\
    {"corners", 0, "FILE", "table of the corners to write", SUPINE_FILLS(request, corners),
     .file = SUPINE_FILE_OUT, .endings = ".csv"},
    {.name = NULL}};

/* Write the corners of the box around the lungs. */
static supine_status write_corners(const char *path, const supine_mesh *mesh, supine_error *error) {
  supine_output output;
  double low[3];
  double high[3];
  (void)supine_mesh_box(mesh, low, high);
  SUPINE_TRY(supine_output_open(path, &output, error));
  (void)supine_print(output.file, "x,y,z\\n%.9g,%.9g,%.9g\\n%.9g,%.9g,%.9g\\n", low[0], low[1],
                     low[2], high[0], high[1], high[2]);
  return supine_output_commit(&output, error);
}
"""),
    ("  SUPINE_TRY(supine_lungs_phantom_create(", """\
  SUPINE_REFUSE_IF(supine_input_judge(SUPINE_INPUT_PHANTOM_SIZE, (double)wanted->vertices) ==
                       SUPINE_INPUT_REFUSED,
                   error, SUPINE_ERROR_ARGUMENT, "%zu vertices: give fewer", wanted->vertices);
  SUPINE_TRY(supine_lungs_phantom_create("""),
    ("  supine_options_line(", """  if (wanted->corners != NULL) {
    SUPINE_TRY(write_corners(wanted->corners, &mesh, error));
  }
  supine_options_line("""),
    ('#include "base/arena.h"\n',
     '#include "base/arena.h"\n#include "base/number.h"\n#include "base/output.h"\n\n#include <supine/inputs.h>\n')]


def check(holds, what):
    print("  " + what + ":", "as expected" if holds else "FAILED", flush=True)
    if not holds:
        sys.exit(1)


def replace(path, old, new):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    check(old in text, f"{path} has {old.strip()[:40]!r}")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text.replace(old, new, 1))


def named_files(recipe):
    """Return the files of the program that a recipe's section names; save_NAME.c and NAME.c are new files."""
    with open("CONTRIBUTING.md", encoding="utf-8") as file:
        section = re.search(rf"^### Add {recipe}\n(.*?)(?=^##)", file.read(), re.M | re.S).group(1)
    paths = set(re.findall(r"`([a-z_]+/[\w./]+\.(?:c|h|txt))`", section))
    return {path for path in paths if not path.startswith(TESTED) and "NAME" not in path}, section


def follow(recipe, changes):
    print(f"add {recipe}:", flush=True)
    names, section = named_files(recipe)
    for path, change in changes.items():
        new = change is not None and change[0] is None
        shape = re.sub(r"(save_)?[a-z]+\.c$", lambda found: (found.group(1) or "") + "NAME.c", path)
        check((shape in section) if new else (path in names), f"CONTRIBUTING.md names {path}")
        if new:
            with open(path, "w", encoding="utf-8") as file:
                file.write(change[1])
        elif change is not None:
            replace(path, *change)
    missing = {path for path in names - set(changes) if not path.endswith("save_obj.c")}
    check(not missing, f"every file that the recipe names is used {sorted(missing) or ''}")


def run(*words, status=0):
    result = subprocess.run(words, capture_output=True, text=True, check=False)
    if result.returncode != status:
        print(result.stdout[-4000:], result.stderr[-4000:])
    check(result.returncode == status, f"exit code {status} of {os.path.basename(words[0])} {' '.join(words[1:4])}")
    return result.stdout + result.stderr


def build(*targets):
    run("cmake", "--build", "build/release", "--target", *targets)


def numbers(path):
    with open(path, encoding="ascii") as file:
        return np.array([[float(word) for word in line.split()[-3:]] for line in file if line[0] in "v-0123456789"])


def see(supine):
    print("what was added works:", flush=True)
    lung = "examples/lungs/left.obj"
    text = run(supine, "precompute", lung, "--law", "even", "--band", "5", "--without-normals", "-o",
               "even.safetensors")
    check("law of displacement: even" in text, "precompute names the law")
    run(supine, "precompute", lung, "--band", "5", "--without-normals", "-o", "deep.safetensors")
    text = run(supine, "info", "even.safetensors", "--json")
    check("base=1.05 gain=0 cx=0 cy=0 cz=0" in text and '"even"' in text, "info has the law's constants")
    apart = {}
    for law in ("even", "deep"):
        for posture in ("supine", "prone"):
            run(supine, "deform", f"{law}.safetensors", "--posture", f"{posture}:1500mL", "-o", f"{law}_{posture}.xyz")
        apart[law] = np.abs(numbers(f"{law}_supine.xyz") - numbers(f"{law}_prone.xyz")).max()
    print(f"  from supine to prone at one volume: {apart['even']:.4f} mm with the same force everywhere, "
          f"{apart['deep']:.1f} mm with deep")
    check(apart["even"] < 0.01 < 1 < apart["deep"],
          "the new law computes what its own numbers say: turning moves nothing")
    shutil.copytree("runtime/python/supine", "py/supine")
    for library in ("runtime/libsupine_runtime.so", "precompute/library/libsupine_precompute.so"):
        shutil.copy(os.path.join("build/release", library), "py/supine")
    code = (f"import supine; supine.precompute({lung!r}, law='even', band=5, without_normals=True, "
            f"output='py.safetensors')")
    os.environ["PYTHONPATH"] = os.path.abspath("py")
    run(sys.executable, "-c", code)
    check('"even"' in run(supine, "info", "py.safetensors", "--json"), "Python takes the law by its name")
    run(supine, "phantom", "--vertices", "1000", "-o", "lungs.xyz", "--corners", "corners.csv")
    run(supine, "phantom", "--vertices", "1000", "-o", "lungs.obj")
    points = numbers("lungs.xyz")
    check(points.shape[0] > 500 and np.array_equal(points, numbers("lungs.obj")),
          "the format has the vertices of an OBJ file")
    corners = np.genfromtxt("corners.csv", delimiter=",", skip_header=1)
    check(np.abs(corners - [points.min(0), points.max(0)]).max() < 1e-3, "the output has the corners of the vertices")
    text = run(supine, "phantom", "--corners", "lungs.ply", "-o", "a.ply", status=1)
    check(".csv" in text, "the output has its own ending")
    text = run(supine, "phantom", "--vertices", "50000", "-o", "a.ply", status=1)
    check("50000 vertices: give fewer" in text and not os.path.exists("a.ply"),
          "the check refuses, and nothing is written")
    check("sides" in run(supine, "--help") and "how often" in run(supine, "sides", "--help"), "help has the command")
    check(run(supine, "sides", "--times", "2").count("left, right") == 2, "the command runs")


with tempfile.TemporaryDirectory() as work:
    shutil.copytree(SOURCE, os.path.join(work, "copy"),
                    ignore=shutil.ignore_patterns("build", ".git", "node_modules", "__pycache__"))
    os.chdir(os.path.join(work, "copy"))
    follow("a law", {"precompute/physics/model.h": RECIPES["a law"]["precompute/physics/model.h"],
                     "precompute/include/supine/precompute.h": None})
    launcher = ["-DCMAKE_C_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
    os.environ.update(CCACHE_BASEDIR=os.path.realpath("."), CCACHE_NOHASHDIR="1")
    run("cmake", "--preset", "release", "-DBUILD_TESTING=OFF", *launcher)
    result = subprocess.run(["cmake", "--build", "build/release", "--target", "supine_precompute"], capture_output=True,
                            text=True, check=False)
    check(result.returncode != 0 and "lists the laws in the order of SUPINE_LAWS" in result.stdout,
          "a law that only one of its lists has stops the build")
    replace("precompute/include/supine/precompute.h", *RECIPES["a law"]["precompute/include/supine/precompute.h"])
    for name in list(RECIPES)[1:]:
        follow(name, RECIPES[name])
    for edit in PHANTOM:
        replace("program/command/phantom.c", *edit)
    build("supine", "supine_precompute_shared", "supine_runtime_shared")
    see(os.path.abspath("build/release/supine"))
