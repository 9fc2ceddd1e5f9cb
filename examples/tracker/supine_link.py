# SPDX-License-Identifier: MIT
"""A peer of 'supine stream' in plain Python: exchange OpenIGTLink messages, and deform lungs by a basis file.

    link = Link("localhost", 18944)
    link.send_pose(rotation)               # rows of the 3 x 3 rotation from body axes to world axes
    stamp, frame = link.newest(timeout=1)  # numbers for Basis.deform; positions after ask_for("points")
"""
import array as arrays
import json
import select
import socket
import struct
import sys
import time

HEADER = struct.Struct(">H12s20sQQQ")
EXTENSION = struct.Struct(">HHII")  # extension size, metadata index size, metadata size, message number


def _crc_table():
    table = []
    for byte in range(256):
        value = byte << 56
        for _ in range(8):
            value = (value << 1) ^ (0x42F0E1EBA9EA3693 if value >> 63 else 0)
            value &= 0xFFFFFFFFFFFFFFFF
        table.append(value)
    return table


_TABLE = _crc_table()


def crc64(data, crc=0):
    """Extend the checksum `crc`, a CRC-64 (ECMA-182, most significant bit first), by the bytes of `data`."""
    for byte in data:
        crc = ((crc << 8) & 0xFFFFFFFFFFFFFFFF) ^ _TABLE[(crc >> 56) ^ byte]
    return crc


def pack(kind, device, content, stamp=0, version=1, number=0):
    """Return an OpenIGTLink message of type `kind`. Version 2 has an extension before the content, metadata after
    it."""
    if version == 2:
        content = EXTENSION.pack(12, 2, 0, number) + content + b"\0\0"
    return HEADER.pack(version, kind.encode(), device.encode(), stamp, len(content),
                       crc64(content)) + content


def transform(rotation, position=(0, 0, 0)):
    """Return the content of an OpenIGTLink TRANSFORM message: the columns of the matrix, then the position."""
    columns = [rotation[row][column] for column in range(3) for row in range(3)]
    return struct.pack(">12f", *columns, *position)


def quaternion(wxyz, position=(0, 0, 0)):
    """Return the content of an OpenIGTLink POSITION message: the position, then the quaternion as x, y, z, w."""
    w, x, y, z = wxyz
    return struct.pack(">7f", *position, x, y, z, w)


def instruments(poses):
    """Return the content of an OpenIGTLink QTDATA message for {name of instrument: quaternion (w, x, y, z)}."""
    return b"".join(struct.pack(">20sBB", name.encode(), 2, 0) + quaternion(wxyz)
                    for name, wxyz in poses.items())


def array(values):
    """Return the content of an OpenIGTLink NDARRAY message with one dimension of 64-bit floats."""
    return struct.pack(f">BBH{len(values)}d", 11, 1, len(values), *values)


def string(text):
    """Return the content of an OpenIGTLink STRING message with a US-ASCII text."""
    return struct.pack(">HH", 3, len(text)) + text.encode("ascii")


def _numbers(kind, content):
    """Convert big-endian numbers to an array in this machine's byte order."""
    numbers = arrays.array(kind, content)
    if sys.byteorder == "little":
        numbers.byteswap()
    return numbers


def corners(words):
    """Yield three vertex indices for each triangle. `words` has the length of each strip, then its vertices."""
    begin = 0
    while begin < len(words):
        strip = words[begin + 1:begin + 1 + words[begin]]
        begin += 1 + len(strip)
        for i in range(len(strip) - 2):  # swap two corners of every second triangle
            triangle = (strip[i], strip[i + 1 + i % 2], strip[i + 2 - i % 2])
            if len(set(triangle)) == 3:  # triangles with equal corners only connect others in a strip
                yield from triangle


def unpack(kind, content):
    """Decode the content of a message of type `kind`. For NDARRAY return a tuple of floats, for STRING the text, and
    for POLYDATA a tuple of two flat arrays: positions x, y, z, and triangle strips in the form that corners() takes.
    Return the bytes of other types unchanged."""
    if kind == "NDARRAY":
        scalar, dimension = content[0], content[1]
        count = 1
        for size in struct.unpack_from(f">{dimension}H", content, 2):
            count *= size
        return struct.unpack_from(f">{count}{'f' if scalar == 10 else 'd'}", content, 2 + 2 * dimension)
    if kind == "POLYDATA":
        points, _, vertices, _, lines, _, polygons, _, size, _ = struct.unpack_from(">10I", content)
        strips = 40 + 12 * points + vertices + lines + polygons
        return (_numbers("f", content[40:40 + 12 * points]),
                _numbers("I", content[strips:strips + size]))
    if kind == "STRING":
        return content[4:].decode()
    return content


class Link:
    """A connection to the server 'supine stream'."""

    def __init__(self, host="localhost", port=18944, version=1, check=False):
        self.socket = socket.create_connection((host, port), timeout=10)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.version = version
        self.check = check  # verify checksums, which is slow in plain Python
        self.bytes = bytearray()

    def close(self):
        self.socket.close()

    def send(self, kind, device, content, stamp=None):
        if stamp is None:
            stamp = int(time.time() * 2**32)
        self.socket.sendall(pack(kind, device, content, stamp, self.version))

    def send_pose(self, rotation, device="Patient", stamp=None):
        self.send("TRANSFORM", device, transform(rotation), stamp)

    def ask_for(self, what):
        """Choose what the server sends: "weights", "points", "surface" or "nothing"."""
        self.send("STRING", "SEND", string(what))

    def set_volume(self, text):
        """Set the volume: rest, full or scan, also with +ML or -ML (rest+500), or absolute (2600mL)."""
        self.send("STRING", "VOLUME", string(text))

    def message(self):
        """Return the next complete message, (kind, device, stamp, content); None if there is none yet."""
        if len(self.bytes) < HEADER.size:
            return None
        version, kind, device, stamp, size, crc = HEADER.unpack_from(self.bytes)
        if len(self.bytes) < HEADER.size + size:
            return None
        body = bytes(self.bytes[HEADER.size:HEADER.size + size])
        del self.bytes[:HEADER.size + size]
        if self.check and crc64(body) != crc:
            raise ValueError("a message has a wrong checksum")
        if version == 2:
            extension, index, metadata, _ = EXTENSION.unpack_from(body)
            body = body[extension:len(body) - index - metadata]
        return kind.rstrip(b"\0").decode(), device.rstrip(b"\0").decode(), stamp, body

    def receive(self, timeout=0.0):
        """Receive bytes; return False if none arrive within the timeout."""
        if not select.select([self.socket], [], [], timeout)[0]:
            return False
        data = self.socket.recv(1 << 20)
        if not data:
            raise ConnectionError("the server closed the connection")
        self.bytes += data
        return True

    def newest(self, timeout=1.0):
        """Return (time stamp, unpacked content) of the newest message and drop earlier ones; None after the timeout."""
        end = time.monotonic() + timeout
        last = None
        while True:
            message = self.message()
            if message is not None:
                last = message
                continue
            left = 0.0 if last is not None else max(0.0, end - time.monotonic())
            if not self.receive(left) and (last is not None or time.monotonic() >= end):
                return None if last is None else (last[2], unpack(last[0], last[3]))


class Basis:
    """Reads a basis file, to deform lungs by the weights of the modes and the factors of each lung's displacement along
    x, y and z (gains). The file must store, for each vertex, a direction and a coefficient for each mode."""

    def __init__(self, path):
        with open(path, "rb") as file:
            size, = struct.unpack("<Q", file.read(8))
            header = json.loads(file.read(size))
            data = file.read()
        self.metadata = header.pop("__metadata__", {})
        if self.metadata.get("version") != "4" or "direction" not in header or "coefficients" not in header:
            raise ValueError(path + ": not a basis of format 4 with directions: make it with 'supine precompute'")
        self.header = header
        self._data = data
        self.vertices = self.tensor("vertices")
        self.triangles = self.tensor("triangles")
        self.direction = self.tensor("direction")
        self.coefficients = self.tensor("coefficients")
        self.lung = self.tensor("lung")
        self.modes = header["coefficients"]["shape"][1]

    def tensor(self, name):
        begin, end = self.header[name]["data_offsets"]
        kind = {"F32": "f", "F64": "d", "U32": "I", "U8": "B"}[self.header[name]["dtype"]]
        return memoryview(self._data[begin:end]).cast(kind)

    def deform(self, frame):
        """Return the positions x, y, z of all vertices as a flat list, for a frame with the content "weights": the
        weights of the modes, then the factors of each lung's displacement along x, y and z."""
        weights, gains = frame[:self.modes], frame[self.modes:]
        positions = []
        for i, lung in enumerate(self.lung):
            row = self.coefficients[i * self.modes:(i + 1) * self.modes]
            amount = sum(w * c for w, c in zip(weights, row))
            positions += [self.vertices[3 * i + j]
                          + gains[3 * lung + j] * amount * self.direction[3 * i + j]
                          for j in range(3)]
        return positions
