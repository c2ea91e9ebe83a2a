"""A glTF room as haarlight reads it: triangles in world space, paint, emission, lamps.

The front of a triangle is where its corners turn counter-clockwise, mirrored nodes included. Backs are black unless the
material is doubleSided. Normals of the file are shading only and are not read. Blended materials are opaque, metals are
matt, `range` of lamps is passed over. What the reader cannot do right it refuses with Unreadable.
"""

import base64
import copy
import io
import json
import os
import struct
from dataclasses import dataclass, field
from urllib.parse import unquote

import numpy as np

LUMINANCE = np.array([0.2126390059, 0.7151686788, 0.0721923154])  # Y of linear sRGB
GREATEST_ALBEDO = 0.999
GREY = 0.5  # the one reflectance of a grey room
KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
REFUSED = {
    "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression",
    "EXT_mesh_gpu_instancing", "KHR_texture_basisu",
}


class Unreadable(Exception):
    """The file has something that this reader does not know."""


@dataclass
class Texture:
    """A picture in linear light (height, width, 4), rows from the top, and its wrapping in u and v."""

    pixels: np.ndarray
    wrap: tuple


@dataclass
class Material:
    name: str
    base_color: np.ndarray
    paint: Texture | None
    two_sided: bool
    emission: np.ndarray  # nits by linear colour
    emission_texture: Texture | None
    spectra: dict = field(default_factory=dict)  # measured ones, by the file's extras
    reflectance: np.ndarray | None = None  # on the leaves, once spectra.give was there
    power: np.ndarray | None = None

    def shines(self):
        return bool(np.any(self.emission > 0)) or self.power is not None


@dataclass
class Lamp:
    name: str
    kind: str  # point, spot, directional
    position: np.ndarray
    direction: np.ndarray
    intensity: np.ndarray  # candela or lux by linear colour
    inner: float = 0.0
    outer: float = np.pi / 4
    spectra: dict = field(default_factory=dict)
    power: np.ndarray | None = None


@dataclass
class Part:
    """All triangles of one primitive at one node: corners (n, 3, 3), and per corner paint and texture coordinates."""

    material: int
    corners: np.ndarray
    uv: np.ndarray | None = None
    emission_uv: np.ndarray | None = None
    colors: np.ndarray | None = None

    def turned(self, corners):
        """The same with its corners in the other order, at other places."""
        back = lambda values: None if values is None else values[:, ::-1]
        return Part(self.material, corners, back(self.uv), back(self.emission_uv), back(self.colors))

    @staticmethod
    def joined(parts):
        """One part of several of the same material that carry the same."""
        join = lambda name: None if getattr(parts[0], name) is None else np.concatenate([getattr(p, name) for p in parts])
        return Part(parts[0].material, join("corners"), join("uv"), join("emission_uv"), join("colors"))


@dataclass
class Room:
    materials: list
    parts: list = field(default_factory=list)
    lamps: list = field(default_factory=list)

    def is_painted(self):
        """Is there a picture or a colour of vertices in it?"""
        pictures = any(m.paint or m.emission_texture for m in self.materials)
        return pictures or any(part.colors is not None for part in self.parts)

    def is_grey(self):
        """Is there no colour in it?"""
        flat = lambda rgb: np.ptp(rgb) <= 1e-6 * np.max(rgb, initial=0)
        materials = all(flat(m.base_color) and flat(m.emission) and not m.spectra for m in self.materials)
        return materials and all(flat(lamp.intensity) for lamp in self.lamps) and not self.is_painted()

    def size(self):
        """Greatest extent."""
        corners = np.concatenate([part.corners.reshape(-1, 3) for part in self.parts])
        return float(np.ptp(corners, axis=0).max())


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


def matrix(node):
    """The node's own transform, 4 x 4 on columns."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])
    out = np.eye(4)
    out[:3, :3] = turn * np.array(node.get("scale", [1, 1, 1]), dtype=np.float64)
    out[:3, 3] = node.get("translation", [0, 0, 0])
    return out


def triangles(mode, indices):
    """Index triples of a triangle list, strip or fan; nothing of points and lines."""
    n = len(indices)
    if mode == 4:
        return indices[: n - n % 3].reshape(-1, 3)
    k = np.arange(max(n - 2, 0))
    if mode == 5:
        return np.stack([indices[k], indices[k + 1 + k % 2], indices[k + 2 - k % 2]], 1)
    if mode == 6:
        return np.stack([indices[k + 1], indices[k + 2], np.broadcast_to(indices[:1], k.shape)], 1)
    return np.zeros((0, 3), dtype=np.int64)


class Reader:
    """Walks the default scene of a file and collects its parts and lamps."""

    def __init__(self, path):
        self.file = File(path)
        self.json = self.file.json
        self.pictures = {}
        sources = self.json.get("materials", [])
        # The default material comes last: white, as glTF has it.
        self.room = Room([self.material(source) for source in [*sources, {"name": "default"}]])
        scene = self.json["scenes"][self.json.get("scene", 0)]
        for node in scene.get("nodes", []):
            self.node(node, np.eye(4))

    def material(self, source):
        pbr = source.get("pbrMetallicRoughness", {})
        if source.get("alphaMode") == "MASK":
            raise Unreadable("alphaMode MASK")
        strength = source.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        return Material(
            source.get("name", ""),
            np.minimum(pbr.get("baseColorFactor", [1, 1, 1, 1])[:3], 1.0),
            self.texture(pbr.get("baseColorTexture")),
            source.get("doubleSided", False),
            strength * np.array(source.get("emissiveFactor", [0, 0, 0]), dtype=np.float64),
            self.texture(source.get("emissiveTexture")),
            {key: value for key, value in (source.get("extras") or {}).items() if key in ("reflectance", "emission")},
        )

    def texture(self, info):
        if info is None:
            return None
        texture = self.json["textures"][info["index"]]
        if "source" not in texture:
            raise Unreadable("a texture in a format of an extension")
        sampler = self.json["samplers"][texture["sampler"]] if "sampler" in texture else {}
        name = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
        wrap = tuple(name[sampler.get(key, 10497)] for key in ("wrapS", "wrapT"))
        source = texture["source"]
        if source not in self.pictures:
            self.pictures[source] = self.file.picture(source)
        return Texture(self.pictures[source], wrap)

    def node(self, index, above):
        node = self.json["nodes"][index]
        to_world = above @ matrix(node)
        if "mesh" in node:
            for primitive in self.json["meshes"][node["mesh"]]["primitives"]:
                self.primitive(primitive, to_world)
        light = node.get("extensions", {}).get("KHR_lights_punctual")
        if light is not None:
            self.lamp(self.json["extensions"]["KHR_lights_punctual"]["lights"][light["light"]], to_world)
        for child in node.get("children", []):
            self.node(child, to_world)

    def primitive(self, primitive, to_world):
        attributes = primitive["attributes"]
        if "POSITION" not in attributes:
            return
        positions = self.file.accessor(attributes["POSITION"]).astype(np.float64)
        if "indices" in primitive:
            indices = self.file.accessor(primitive["indices"])[:, 0].astype(np.int64)
        else:
            indices = np.arange(len(positions))
        faces = triangles(primitive.get("mode", 4), indices)
        if np.linalg.det(to_world[:3, :3]) < 0:
            faces = faces[:, [0, 2, 1]]
        corners = (positions @ to_world[:3, :3].T + to_world[:3, 3])[faces]
        faces = faces[has_area(corners)]
        if len(faces) == 0:
            return
        at = primitive.get("material", len(self.room.materials) - 1)
        source = self.json["materials"][at] if "material" in primitive else {}
        part = Part(at, corners[has_area(corners)])
        part.uv = self.coordinates(attributes, source.get("pbrMetallicRoughness", {}).get("baseColorTexture"), faces)
        part.emission_uv = self.coordinates(attributes, source.get("emissiveTexture"), faces)
        if "COLOR_0" in attributes:
            colors = self.file.accessor(attributes["COLOR_0"])[:, :3].astype(np.float64)[faces]
            part.colors = None if np.all(colors == 1) else colors
        self.room.parts.append(part)

    def coordinates(self, attributes, info, faces):
        """Texture coordinates by corner, KHR_texture_transform applied."""
        if info is None:
            return None
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        name = f"TEXCOORD_{transform.get('texCoord', info.get('texCoord', 0))}"
        if name not in attributes:
            return None
        uv = self.file.accessor(attributes[name]).astype(np.float64)
        uv = uv * transform.get("scale", [1, 1])
        c, s = np.cos(transform.get("rotation", 0)), np.sin(transform.get("rotation", 0))
        return (uv @ np.array([[c, -s], [s, c]]) + transform.get("offset", [0, 0]))[faces]

    def lamp(self, light, to_world):
        spot = light.get("spot", {})
        direction = -to_world[:3, 2]
        lamp = Lamp(
            light.get("name", ""),
            light["type"],
            to_world[:3, 3],
            direction / max(np.linalg.norm(direction), 1e-300),
            light.get("intensity", 1.0) * np.array(light.get("color", [1, 1, 1]), dtype=np.float64),
            spot.get("innerConeAngle", 0.0),
            spot.get("outerConeAngle", np.pi / 4),
            {key: value for key, value in (light.get("extras") or {}).items() if key in ("name", "csv")},
        )
        if lamp.intensity.max() > 0:
            self.room.lamps.append(lamp)


def has_area(corners):
    """Not those that are lines or points, up to a few roundings of their corners."""
    edges = corners[:, [1, 2, 0]] - corners
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    twice = np.linalg.norm(np.cross(edges[:, 0], edges[:, 2]), axis=1)
    farthest = np.abs(corners).max(axis=(1, 2))
    return twice > 16 * np.finfo(float).eps * farthest * longest


def read(path):
    """The room in a file."""
    return Reader(path).room


def write_grey(path, out):
    """The same room with every reflectance .5, lamps without colour, no textures: it means the same to any program."""
    file = File(path)
    document = copy.deepcopy(file.json)
    materials = document.setdefault("materials", [])
    materials[:] = [grey_material(source) for source in [*materials, {}]]
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            primitive.setdefault("material", len(materials) - 1)
            primitive["attributes"] = {k: v for k, v in primitive["attributes"].items() if k in ("POSITION", "NORMAL")}
    for light in document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", []):
        light["color"] = [float(LUMINANCE @ light.get("color", [1, 1, 1]))] * 3
        light.pop("extras", None)
    for unused in ("images", "textures", "samplers"):
        document.pop(unused, None)
    known = {"KHR_lights_punctual", "KHR_materials_emissive_strength"}
    for key in ("extensionsUsed", "extensionsRequired"):
        kept = [name for name in document.pop(key, []) if name in known]
        if kept:
            document[key] = kept
    write_glb(out, document, [file.buffer(i) for i in range(len(document.get("buffers", [])))])


def grey_material(source):
    out = {
        "name": source.get("name", "default"),
        "pbrMetallicRoughness": {"baseColorFactor": [GREY, GREY, GREY, 1.0], "metallicFactor": 0.0},
    }
    if source.get("doubleSided"):
        out["doubleSided"] = True
    luminance = float(LUMINANCE @ source.get("emissiveFactor", [0, 0, 0]))
    if luminance > 0:
        out["emissiveFactor"] = [min(luminance, 1.0)] * 3
        strength = source.get("extensions", {}).get("KHR_materials_emissive_strength")
        if strength is not None:
            out["extensions"] = {"KHR_materials_emissive_strength": strength}
    return out


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
