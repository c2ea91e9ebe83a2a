"""A grey box of a room, 4 x 3 x 5 m, with a lamp below its ceiling and a block on its floor: as glTF and for Radiance.

Every quadrilateral is counter-clockwise from its front.
"""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np

SIZE = np.array([4.0, 3.0, 5.0])
LUMINANCE = 5000.0
"""Of the lamp, cd/m2."""
GREY = 0.5
EFFICACY = 179.0
"""lm/W by which Radiance turns its watts into lumens (its manual's white light)."""


def box(low, high, inward: bool) -> list[np.ndarray]:
    """Six faces."""
    low, high = np.array(low, float), np.array(high, float)
    faces = []
    for axis in range(3):
        u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        size = high - low
        for at, outward in ((low, False), (high, True)):
            start = np.where(np.eye(3)[axis] == 1, at, low)
            corners = [start, start + u * size, start + (u + v) * size, start + v * size]
            faces.append(np.array(corners if outward != inward else corners[::-1]))
    return faces


def surfaces() -> dict[str, list[np.ndarray]]:
    """Quadrilaterals by material."""
    lamp = box([1.6, 2.9, 2.1], [2.4, 2.99, 2.9], inward=False)
    is_lower = [np.ptp(face[:, 1]) == 0 and face[0, 1] == 2.9 for face in lamp]
    return {
        "grey": box([0, 0, 0], SIZE, inward=True)
        + box([0.5, 0, 3.0], [1.5, 0.8, 4.2], inward=False)
        + [face for face, lower in zip(lamp, is_lower) if not lower],
        "lamp": [face for face, lower in zip(lamp, is_lower) if lower],
    }


def gltf(path: Path) -> None:
    """Writes the room."""
    buffer, accessors, primitives = b"", [], []
    for material, faces in enumerate(surfaces().values()):
        corners = np.concatenate(faces).astype("<f4")
        indices = (np.array([0, 1, 2, 0, 2, 3], "<u4") + 4 * np.arange(len(faces), dtype="<u4")[:, None]).ravel()
        primitives.append({"attributes": {"POSITION": len(accessors)}, "indices": len(accessors) + 1, "material": material})
        bounds = {"min": corners.min(0).tolist(), "max": corners.max(0).tolist()}
        for values, kind, more in ((corners, "VEC3", bounds), (indices, "SCALAR", {})):
            component = 5126 if kind == "VEC3" else 5125
            view = {"bufferView": len(accessors), "componentType": component, "count": len(values), "type": kind}
            accessors.append((view | more, len(buffer), values.nbytes))
            buffer += values.tobytes()
    pbr = {"baseColorFactor": [GREY, GREY, GREY, 1], "metallicFactor": 0, "roughnessFactor": 1}
    black = pbr | {"baseColorFactor": [0, 0, 0, 1]}
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": LUMINANCE}}
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "room"}],
        "meshes": [{"primitives": primitives}],
        "materials": [
            {"name": "grey", "pbrMetallicRoughness": pbr},
            {"name": "lamp", "pbrMetallicRoughness": black, "emissiveFactor": [1, 1, 1], "extensions": strength},
        ],
        "accessors": [view for view, _, _ in accessors],
        "bufferViews": [{"buffer": 0, "byteOffset": at, "byteLength": size} for _, at, size in accessors],
        "buffers": [{"byteLength": len(buffer), "uri": "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()}],
    }
    path.write_text(json.dumps(document))


def radiance() -> str:
    """The room in Radiance's words."""
    radiance = LUMINANCE / EFFICACY
    text = [f"void plastic grey\n0\n0\n5 {GREY} {GREY} {GREY} 0 0\n", f"void light lamp\n0\n0\n3 {radiance} {radiance} {radiance}\n"]
    for material, faces in surfaces().items():
        for number, face in enumerate(faces):
            numbers = " ".join(f"{x:.9g}" for x in face.ravel())
            text.append(f"{material} polygon {material}.{number}\n0\n0\n12 {numbers}\n")
    return "\n".join(text)


def sensors() -> np.ndarray:
    """A grid at the height of a desk, (35, 3)."""
    x, z = np.arange(5) * 0.8 + 0.4, np.arange(7) * 0.7 + 0.4
    return np.stack(np.meshgrid(x, [0.85], z, indexing="ij"), -1).reshape(-1, 3)
