"""The baked .glb as arrays in Blender's terms, by the number each piece was exported with.

haarlight keeps the nodes and their `extras`; meshes are other ones: finer (vertices), or with texture coordinates of a light
map. Positions are in the space of the piece, +Z up; light is linear sRGB whose luminance is lm/m2.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .export import INDEX, Exported
from .glb import Glb

# XYZ of linear sRGB (IEC 61966-2-1, D65 white of 0.3127, 0.3290); its inverse brings XYZ to linear sRGB.
SRGB = np.array(
    [
        [0.41239080, 0.35758434, 0.18048079],
        [0.21263901, 0.71516868, 0.07219232],
        [0.01933082, 0.11919478, 0.95053215],
    ]
)
FROM_XYZ = np.linalg.inv(SRGB)


@dataclass(repr=False)
class Shape:
    """What one piece looks like, lit."""

    positions: np.ndarray
    """(N, 3)."""
    triangles: np.ndarray
    """(M, 3)."""
    material: np.ndarray
    """Number of the material in `Exported.materials`, (M,); -1 for none."""
    lit: np.ndarray
    """Has the triangle light, (M,)? Panes have none and stay as they came."""
    page: np.ndarray
    """Page of the light map, (M,); -1 for none."""
    uvs: list[np.ndarray] = field(default_factory=list)
    """Texture coordinates of the user's maps, (N, 2) each."""
    map_uv: np.ndarray | None = None
    """Those of the light map."""
    irradiance: np.ndarray | None = None
    """(N, 3), or none where the light is in maps."""
    radiosity: np.ndarray | None = None
    paint: np.ndarray | None = None
    """Colours of vertices, (N, 4), where the light is in maps."""


@dataclass
class Pages:
    """The pages of a light map."""

    files: list[Path]
    lux_per_unit: float


class Strange(RuntimeError):
    """A baked file that is not what was exported: a fault of the program."""


def at_vertices(path: Path, light, exported: Exported) -> dict[int, Shape]:
    """Pieces with light at their vertices. `path`: what `light.save(path, xyz=True)` wrote."""
    glb = Glb(path)
    irradiance = _in_order(glb, light)
    shapes = {}
    for node, number, primitives in _pieces(glb):
        shape = _shape(glb, primitives, lambda p: "_XYZ" in p["attributes"], exported.pieces[number].uvs)
        radiosity, received, at = np.zeros_like(shape.positions), np.zeros_like(shape.positions), 0
        for primitive in primitives:
            count = len(glb.array(primitive["attributes"]["POSITION"]))
            if "_XYZ" in primitive["attributes"]:
                radiosity[at : at + count] = glb.array(primitive["attributes"]["_XYZ"]) @ FROM_XYZ.T
            at += count
        if node in irradiance:
            lit = np.concatenate(
                [
                    np.full(len(glb.array(p["attributes"]["POSITION"])), "_XYZ" in p["attributes"])
                    for p in primitives
                ]
            )
            received[lit] = irradiance[node] @ FROM_XYZ.T
        shape.radiosity, shape.irradiance = radiosity, received
        shapes[number] = shape
    return shapes


def in_maps(path: Path, exported: Exported) -> tuple[dict[int, Shape], Pages]:
    """Pieces with light in maps. `path`: what `light.save_maps(path)` wrote, with its index beside it."""
    glb = Glb(path)
    index = json.loads(path.with_suffix(".maps.json").read_text(encoding="utf-8"))
    entries = {(entry["mesh"], entry["primitive"]): entry for entry in index["meshes"]}
    shapes = {}
    for node, number, primitives in _pieces(glb):
        mesh = glb.document["nodes"][node]["mesh"]
        parts = [entries.get((mesh, k)) for k in range(len(primitives))]
        lit = {id(p): part is not None for p, part in zip(primitives, parts)}
        shape = _shape(glb, primitives, lambda p: lit[id(p)], exported.pieces[number].uvs)
        coordinates, pages, paints = [], [], []
        for primitive, part in zip(primitives, parts):
            count = len(glb.array(primitive["attributes"]["POSITION"]))
            uv = np.zeros((count, 2), np.float32)
            if part is not None:
                rect = np.array(part["uv_rect"], np.float32)
                uv = rect[:2] + glb.array(primitive["attributes"][f"TEXCOORD_{part['texcoord']}"]) * (rect[2:] - rect[:2])
            coordinates.append(_flipped(uv))
            rgba = np.ones((count, 4), np.float32)
            if "COLOR_0" in primitive["attributes"]:
                given = glb.array(primitive["attributes"]["COLOR_0"])
                rgba[:, : given.shape[1]] = given
            paints.append(rgba)
            faces = len(_triangles(glb, primitive))
            pages.append(np.full(faces, -1 if part is None else part["page"]))
        shape.map_uv, shape.page, shape.paint = map(np.concatenate, (coordinates, pages, paints))
        shapes[number] = shape
    pages = Pages([path.parent / page["exr"] for page in index["pages"]], index["lux_per_unit"])
    return shapes, pages


def _pieces(glb: Glb):
    """Nodes with a number and a mesh: node, number, primitives."""
    for node, entry in enumerate(glb.document.get("nodes", [])):
        number = entry.get("extras", {}).get(INDEX)
        if number is not None and "mesh" in entry:
            yield node, number, glb.document["meshes"][entry["mesh"]]["primitives"]


def _shape(glb: Glb, primitives, is_lit, uvs: list[str]) -> Shape:
    positions, triangles, material, lit, first = [], [], [], [], 0
    coordinates: list[list[np.ndarray]] = [[] for _ in uvs]
    for primitive in primitives:
        attributes = primitive["attributes"]
        own, faces = glb.array(attributes["POSITION"]), _triangles(glb, primitive)
        positions.append(own)
        triangles.append(faces + first)
        material.append(np.full(len(faces), _material(glb, primitive)))
        lit.append(np.full(len(faces), is_lit(primitive)))
        for k, into in enumerate(coordinates):
            name = f"TEXCOORD_{k}"
            into.append(_flipped(glb.array(attributes[name])) if name in attributes else np.zeros((len(own), 2), np.float32))
        first += len(own)
    # glTF's (x, y, z) is Blender's (x, -z, y).
    placed = np.concatenate(positions).astype(np.float64)[:, [0, 2, 1]] * (1.0, -1.0, 1.0)
    faces = np.concatenate(triangles)
    none = np.full(len(faces), -1)
    uv = [np.concatenate(k) for k in coordinates]
    return Shape(placed, faces, np.concatenate(material), np.concatenate(lit), none, uv)


def _triangles(glb: Glb, primitive) -> np.ndarray:
    if "indices" in primitive:
        return glb.array(primitive["indices"]).astype(np.int64).reshape(-1, 3)
    return np.arange(len(glb.array(primitive["attributes"]["POSITION"])), dtype=np.int64).reshape(-1, 3)


def _material(glb: Glb, primitive) -> int:
    if "material" not in primitive:
        return -1
    return glb.document["materials"][primitive["material"]].get("extras", {}).get(INDEX, -1)


def _flipped(uv: np.ndarray) -> np.ndarray:
    """glTF's v begins at the top, Blender's at the bottom."""
    return np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])


def _in_order(glb: Glb, light) -> dict[int, np.ndarray]:
    """Irradiance of the vertices of every node, in the order of the file, whose meshes hold radiosity alone.

    The file has a node's surfaces by primitive, each with its vertices as `light` counts them; that both say the same
    radiosity is checked.
    """
    surfaces, owner = light.room.surfaces, light.surface
    of_node: dict[int, list[int]] = {}
    for number, surface in enumerate(surfaces):
        of_node.setdefault(surface["node"], []).append(number)
    order = np.argsort(owner, kind="stable")
    begins = np.searchsorted(owner[order], np.arange(len(surfaces) + 1))
    out = {}
    for node, _, primitives in _pieces(glb):
        own = sorted(of_node.get(node, []), key=lambda s: surfaces[s]["primitive"])
        if not own:
            continue
        vertices = np.concatenate([order[begins[s] : begins[s + 1]] for s in own])
        written = [glb.array(p["attributes"]["_XYZ"]) for p in primitives if "_XYZ" in p["attributes"]]
        if not written:
            continue
        if not np.array_equal(np.concatenate(written), light.xyz[vertices]):
            raise Strange(f"the light of node {node} is not in the order of the file; please report it with the scene")
        out[node] = light.irradiance[vertices]
    return out
