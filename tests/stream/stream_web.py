# SPDX-License-Identifier: GPL-3.0-or-later
"""The live page answers only requests that name its server, and leaves no file.

    stream_web.py PROGRAM"""
import glob
import os
import re
import socket
import subprocess
import sys
import tempfile

supine = sys.argv[1]
SOCKET = ("Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
          "Sec-WebSocket-Protocol: supine\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n")
LEFT_FILES = "/tmp/supine-page-*"


def ask(port, headers, path="/"):
    """Send a request. Return the code of the answer, 0 if there is none, and its body; of a WebSocket, which stays
    open, an empty body."""
    with socket.create_connection(("127.0.0.1", port), timeout=60) as link:
        link.sendall(f"GET {path} HTTP/1.1\r\n{headers}\r\n".encode())
        got = b""
        size = None
        while size is None or len(got) < size:
            more = link.recv(1 << 16)
            if not more:
                break
            got += more
            if size is None and b"\r\n\r\n" in got:
                head = got.split(b"\r\n\r\n")[0]
                length = re.search(rb"(?i)\r\ncontent-length: *(\d+)", head)
                size = len(head) + 4 + (int(length[1]) if length else 0)
    code = re.match(rb"HTTP/1.1 (\d+)", got)
    return int(code[1]) if code else 0, got.partition(b"\r\n\r\n")[2]


def check(port):
    here = f"127.0.0.1:{port}"
    good = [here, "127.0.0.1", "127.0.0.1:9000", f"localhost:{port}", "LocalHost", "[::1]:9000", "192.168.1.7",
            f"lungs.example:{port}", "LUNGS.example", "other.example"]
    evil = ["evil.example", f"evil.example:{port}", "127.0.0.1.evil.example", "localhost.evil.example",
            "evil.lungs.example", "lungs.example.evil", "lungs", "[::1", "[evil]", "127.1", "",
            "127.0.0.1@evil.example", "lungs.example,other.example", "x" * 300]
    pages = set()
    for host in good:
        code, page = ask(port, f"Host: {host}\r\n")
        assert code == 200, (host, code)
        pages.add(page)
        assert ask(port, f"Host: {host}\r\nOrigin: http://{host}\r\n" + SOCKET)[0] == 101, host
        assert ask(port, f"Host: {host}\r\n" + SOCKET)[0] == 101, host
        assert ask(port, f"Host: {host}\r\nOrigin: http://evil.example\r\n" + SOCKET)[0] != 101, host
        assert ask(port, f"Host: {host}\r\nOrigin: null\r\n" + SOCKET)[0] != 101, host
    assert len(pages) == 1 and b"</html>" in pages.pop()[-20:]
    for host in evil:
        code, body = ask(port, f"Host: {host}\r\n")
        assert code != 200 and b"<canvas" not in body, (host, code)
        assert ask(port, f"Host: {host}\r\nOrigin: http://{host}\r\n" + SOCKET)[0] != 101, host
        assert ask(port, f"Host: {host}\r\n" + SOCKET)[0] != 101, host
    assert b"--web-host" in ask(port, "Host: evil.example\r\n")[1]
    assert ask(port, "")[0] != 200 and ask(port, SOCKET)[0] != 101  # no Host at all
    assert ask(port, f"Host: {here}\r\n", "/other")[0] == 404


def files(folder):
    return sorted(os.listdir(folder)), sorted(glob.glob(LEFT_FILES))


with tempfile.TemporaryDirectory(prefix="supine-stream-") as folder:
    mesh, basis, temporary = (os.path.join(folder, name) for name in ("lungs.ply", "lungs.safetensors", "temporary"))
    os.mkdir(temporary)
    for words in (["phantom", "-o", mesh, "--vertices", "300"], ["precompute", mesh, "--band", "2", "-o", basis]):
        subprocess.run([supine, *words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    refused = subprocess.run([supine, "stream", basis, "--web", "0", "--web-host", "http://lungs.example"],
                             capture_output=True, text=True, check=False)
    if refused.returncode == 3:
        print("skipped: libwebsockets is not installed")
        sys.exit(77)
    before = files(temporary)
    server = subprocess.Popen([supine, "stream", basis, "--listen", "0", "--web", "0", "--volume", "rest", "--seconds",
                               "300", "--web-host", "lungs.example,other.example"],
                              stdout=subprocess.PIPE, text=True, env=dict(os.environ, TMPDIR=temporary))
    try:
        site = re.match(r"page at http://127.0.0.1:(\d+)/", server.stdout.readline())
        assert server.stdout.readline().startswith("listening on port ")
        # The page needs no file, so that none is left, whenever and however the program ends.
        assert files(temporary) == before, files(temporary)
        check(int(site[1]))
    finally:
        server.terminate()
        server.communicate(timeout=60)
    assert server.returncode == 0
    assert refused.returncode == 1 and "--web-host" in refused.stderr, refused
print("the page answers its own names only")
