# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a program with a real server on a free port of this machine:

    with_server.py SUPINE VERTICES "SERVER OPTIONS" PROGRAM [ARGUMENTS]

In the arguments, {port} is replaced by the server's port, {page} by the address of its page, and {basis} by the path of
its basis, which is made in a temporary folder. The server ends after ten minutes at the latest."""
import os
import re
import shlex
import subprocess
import sys
import tempfile

supine, vertices, options, *program = sys.argv[1:]
with tempfile.TemporaryDirectory(prefix="supine-stream-") as folder:
    mesh, basis = os.path.join(folder, "lungs.ply"), os.path.join(folder, "lungs.safetensors")
    for words in (["phantom", "-o", mesh, "--vertices", vertices], ["precompute", mesh, "-o", basis]):
        subprocess.run([supine, *words], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)
    server = subprocess.Popen([supine, "stream", basis, "--listen", "0", "--seconds", "600",
                               *shlex.split(options)], stdout=subprocess.PIPE, text=True)
    try:
        places = {"basis": basis, "page": ""}
        for line in server.stdout:
            if line.startswith("page at "):
                places["page"] = line.split()[-1]
            found = re.match(r"listening on port (\d+)", line)
            if found:
                places["port"] = found[1]
                break
        else:
            sys.exit("the server does not listen")
        result = subprocess.run([word.format(**places) if "{" in word else word for word in program],
                                timeout=600, check=False).returncode
        alive = server.poll() is None
    finally:
        server.terminate()
        try:
            rest = server.communicate(timeout=100)[0]
        except subprocess.TimeoutExpired:
            server.kill()
            raise
    print(rest, end="")
    if result == 77:  # the program was skipped
        sys.exit(result)
    # Every program sends poses, so the server must report their latency.
    if not re.search(r"pose received to \w+ sent: \d+ of \d+ frames within 15 ms, "
                     r"worst [\d.]+ ms\n", rest):
        sys.exit("the server does not report its latency")
    if not alive or server.returncode != 0:
        sys.exit(f"the server ended with {server.returncode}")
    sys.exit(result)
