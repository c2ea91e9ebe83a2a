"""A .glb in NumPy: its document, and the numbers of its accessors (glTF 2.0, sections 3.6 and 4)."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np

MAGIC = 0x46546C67
JSON_CHUNK = 0x4E4F534A
BIN_CHUNK = 0x004E4942
TYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Glb:
    """`document` as dictionaries, and `array(accessor)`."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        magic, _, length = struct.unpack_from("<III", data)
        if magic != MAGIC or length > len(data):
            raise ValueError(f"{path} is no whole .glb")
        self.path = path
        self.binary = b""
        at = 12
        while at + 8 <= length:
            size, kind = struct.unpack_from("<II", data, at)
            chunk = data[at + 8 : at + 8 + size]
            if kind == JSON_CHUNK:
                self.document = json.loads(chunk)
            elif kind == BIN_CHUNK:
                self.binary = chunk
            at += 8 + size

    def array(self, accessor: int) -> np.ndarray:
        """Numbers of an accessor, (count,) or (count, width); normalized integers as floats."""
        entry = self.document["accessors"][accessor]
        kind, width = np.dtype(TYPES[entry["componentType"]]).newbyteorder("<"), WIDTHS[entry["type"]]
        if "bufferView" not in entry:
            return np.zeros((entry["count"], width), kind).squeeze(1) if width == 1 else np.zeros((entry["count"], width), kind)
        view = self.document["bufferViews"][entry["bufferView"]]
        start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
        row = kind.itemsize * width
        stride = view.get("byteStride", row)
        out = np.ndarray((entry["count"], width), kind, self.binary, start, (stride, kind.itemsize))
        if entry.get("normalized") and kind.kind in "iu":
            out = np.maximum(out / np.float32(np.iinfo(kind).max), -1.0)
        return out[:, 0] if width == 1 else out

    def write(self, path: Path) -> None:
        """Writes the document as it is now with the same numbers."""
        text = json.dumps(self.document, ensure_ascii=False).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        length = 12 + 8 + len(text) + 8 + len(binary)
        with path.open("wb") as out:
            out.write(struct.pack("<III", MAGIC, 2, length))
            out.write(struct.pack("<II", len(text), JSON_CHUNK) + text)
            out.write(struct.pack("<II", len(binary), BIN_CHUNK) + binary)
