"""A glTF room as haarlight reads it: triangles in world space, paint, emission, lamps.

The front of a triangle is where its corners turn counter-clockwise, mirrored nodes included. Backs are black unless the
material is doubleSided. Normals of the file are shading only and are not read. Blended materials are opaque, metals are
matt, `range` of lamps is passed over. What the reader cannot do right it refuses with Unreadable.
"""

from dataclasses import dataclass, field

import numpy as np

from gltf import File, Unreadable

LUMINANCE = np.array([0.2126390059, 0.7151686788, 0.0721923154])  # Y of linear sRGB
GREATEST_ALBEDO = 0.999


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
    reflectance: np.ndarray | None = None  # on the bands, once spectra.give was there
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

    def box(self):
        """The least and the greatest coordinates."""
        corners = np.concatenate([part.corners.reshape(-1, 3) for part in self.parts])
        return corners.min(axis=0), corners.max(axis=0)

    def size(self):
        """Greatest extent."""
        low, high = self.box()
        return float((high - low).max())


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
