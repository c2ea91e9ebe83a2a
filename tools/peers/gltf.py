"""A .glb or .gltf file: its JSON, accessors and pictures; and writing a .glb."""

import base64
import io
import json
import os
import struct
from urllib.parse import unquote

import numpy as np

KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
REFUSED = {
    "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression",
    "EXT_mesh_gpu_instancing", "KHR_texture_basisu",
}


class Unreadable(Exception):
    """The file has something that this reader does not know."""


class File:
    """A .glb or .gltf: its JSON, and what is in its buffers."""

    def __init__(self, path):
        self.folder = os.path.dirname(path)
        with open(path, "rb") as file:
            data = file.read()
        self.binary = None
        if data[:4] == b"glTF":
            self.json, self.binary = chunks(data)
        else:
            self.json = json.loads(data)
        refused = sorted(REFUSED & set(self.json.get("extensionsUsed", [])))
        if refused:
            raise Unreadable(", ".join(refused))
        self.buffers = {}

    def buffer(self, index):
        if index not in self.buffers:
            uri = self.json["buffers"][index].get("uri")
            self.buffers[index] = self.binary if uri is None else self.fetch(uri)
        return self.buffers[index]

    def fetch(self, uri):
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        with open(os.path.join(self.folder, unquote(uri)), "rb") as file:
            return file.read()

    def view(self, index):
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.buffer(view["buffer"])[start : start + view["byteLength"]]

    def accessor(self, index):
        """Values, one row an element; integers that stand for fractions are divided."""
        accessor = self.json["accessors"][index]
        kind, width, count = np.dtype(KINDS[accessor["componentType"]]), WIDTHS[accessor["type"]], accessor["count"]
        values = np.zeros((count, width), dtype=kind)
        if "bufferView" in accessor:
            stride = self.json["bufferViews"][accessor["bufferView"]].get("byteStride", kind.itemsize * width)
            values = elements(self.view(accessor["bufferView"]), accessor.get("byteOffset", 0), stride, kind, width, count)
        if "sparse" in accessor:
            values = self.replaced(values.copy(), accessor["sparse"])
        if accessor.get("normalized") and kind.kind in "iu":
            values = np.maximum(values / float(np.iinfo(kind).max), -1.0)
        return values

    def replaced(self, values, sparse):
        indices, new = sparse["indices"], sparse["values"]
        kind = np.dtype(KINDS[indices["componentType"]])
        where = elements(self.view(indices["bufferView"]), indices.get("byteOffset", 0), kind.itemsize, kind, 1, sparse["count"])
        stride = values.dtype.itemsize * values.shape[1]
        values[where[:, 0]] = elements(self.view(new["bufferView"]), new.get("byteOffset", 0), stride, values.dtype, values.shape[1], sparse["count"])
        return values

    def picture(self, index):
        """Linear light by rows from the top, alpha as it is."""
        from PIL import Image

        image = self.json["images"][index]
        data = self.view(image["bufferView"]) if "bufferView" in image else self.fetch(image["uri"])
        values = np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"), dtype=np.float64) / 255
        values[..., :3] = linear(values[..., :3])
        return values


def chunks(data):
    """JSON and binary chunk of a GLB."""
    at, document, binary = 12, None, b""
    while at + 8 <= len(data):
        length, kind = struct.unpack("<II", data[at : at + 8])
        chunk = data[at + 8 : at + 8 + length]
        if kind == 0x4E4F534A:
            document = json.loads(chunk)
        elif kind == 0x004E4942:
            binary = chunk
        at += 8 + length
    return document, binary


def elements(data, start, stride, kind, width, count):
    raw = np.frombuffer(data, dtype=np.uint8)
    rows = start + stride * np.arange(count)[:, None] + np.arange(kind.itemsize * width)[None, :]
    return np.ascontiguousarray(raw[rows]).view(kind).reshape(count, width)


def linear(values):
    """sRGB's transfer function undone."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def write_quads(path, quads, materials, **more):
    """A .glb of quads: corner, two sides, name of the material; fronts where the first side times the second points."""
    names = [material["name"] for material in materials]
    document = {"asset": {"version": "2.0"}, "scene": 0, "accessors": [], "bufferViews": [], "meshes": [], "nodes": [],
                "materials": materials} | more
    buffers = []
    for k, (o, u, v, paint) in enumerate(quads):
        corners = np.array([o, o + u, o + u + v, o + v], dtype="<f4")
        for data, kind, component in ((corners, "VEC3", 5126), (np.array([0, 1, 2, 0, 2, 3], dtype="<u2"), "SCALAR", 5123)):
            document["bufferViews"].append({"buffer": len(buffers), "byteLength": data.nbytes})
            accessor = {"bufferView": len(buffers), "componentType": component, "type": kind, "count": len(data)}
            if kind == "VEC3":
                accessor |= {"min": corners.min(0).tolist(), "max": corners.max(0).tolist()}
            document["accessors"].append(accessor)
            buffers.append(data.tobytes())
        primitive = {"attributes": {"POSITION": 2 * k}, "indices": 2 * k + 1, "material": names.index(paint)}
        document["meshes"].append({"primitives": [primitive]})
        document["nodes"].append({"mesh": k})
    document["scenes"] = [{"nodes": list(range(len(document["nodes"])))}]
    write_glb(path, document, buffers)


def write_glb(path, document, buffers):
    """One GLB with all buffers in its binary chunk."""
    binary, starts = b"", []
    for data in buffers:
        starts.append(len(binary))
        binary += data + bytes(-len(data) % 4)
    for view in document.get("bufferViews", []):
        view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
        view["buffer"] = 0
    document["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(binary)
    with open(path, "wb") as file:
        file.write(struct.pack("<4sIIII", b"glTF", 2, total, len(text), 0x4E4F534A) + text)
        file.write(struct.pack("<II", len(binary), 0x004E4942) + binary)
