"""Opens baked rooms in Blender as the README says, and checks that the light arrived:

    pip install bpy==5.0.1        (Python 3.11)
    python tools/viewers/blender.py ROOM.baked.glb...

Every mesh has to have the attribute `Color`, which *Viewport Shading > Solid > Attribute* shows, with the numbers of COLOR_0, as
far as Blender keeps them: it rounds to the 8 bits of sRGB.
"""

import json
import struct
import sys

import bpy
import numpy as np


def colours(path):
    """COLOR_0 of each primitive of a GLB with float vertex colours, in order of its meshes."""
    data = open(path, "rb").read()
    (length,) = struct.unpack_from("<I", data, 12)
    gltf = json.loads(data[20 : 20 + length])
    body = data[28 + length :]
    out = []
    for mesh in gltf["meshes"]:
        for primitive in mesh["primitives"]:
            accessor = gltf["accessors"][primitive["attributes"]["COLOR_0"]]
            assert accessor["componentType"] == 5126, "packed colours: bake without --compress"
            view = gltf["bufferViews"][accessor["bufferView"]]
            at = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            width = {"VEC3": 3, "VEC4": 4}[accessor["type"]]
            values = np.frombuffer(body, "<f4", accessor["count"] * width, at)
            out.append(values.reshape(-1, width)[:, :3])
    return out


def encoded(linear):
    """The sRGB transfer function (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)


def check(path):
    """Imports a room; what differs, as text, or none."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path)
    wanted = np.concatenate(colours(path))
    found = []
    for mesh in bpy.data.meshes:
        attribute = mesh.color_attributes.get("Color")
        if attribute is None:
            return f"mesh {mesh.name} has no attribute Color"
        values = np.zeros(4 * len(attribute.data), np.float32)
        attribute.data.foreach_get("color", values)
        values = values.reshape(-1, 4)[:, :3]
        if attribute.domain == "CORNER":
            index = np.zeros(len(mesh.loops), np.int32)
            mesh.loops.foreach_get("vertex_index", index)
            at_vertices = np.full((len(mesh.vertices), 3), np.nan, np.float32)
            at_vertices[index] = values
            values = at_vertices
        found.append(values)
    found = np.concatenate(found)
    if found.shape != wanted.shape:
        return f"{len(found)} vertices for {len(wanted)}"
    # Meshes come in another order: sorted, the same numbers have to be there.
    apart = np.nanmax(np.abs(encoded(np.sort(found, axis=0)) - encoded(np.sort(wanted, axis=0))))
    # Half a step; its own curve is off by a few hundredths of one.
    if not apart <= 0.6 / 255:
        return f"colours differ by {255 * apart:.2f} of 255"
    return None


def main(arguments):
    """Checks files; the exit code."""
    bad = False
    for path in arguments:
        problem = check(path)
        bad |= problem is not None
        print(f"{path}: {problem or 'the colours are those of the file'} (Blender {bpy.app.version_string})")
    return int(bad)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
