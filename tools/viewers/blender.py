"""Opens baked rooms in Blender as the README says, and checks that the light arrived:

    pip install bpy==5.0.1        (Python 3.11)
    python tools/viewers/blender.py ROOM.baked.glb...

Every mesh has to have the attribute `Color`, which *Viewport Shading > Solid > Attribute* shows, with the numbers of COLOR_0, as
far as Blender keeps them: it rounds to the 8 bits of sRGB. Where ROOM.baked.maps.json lies beside a room, its second UV map has to
be that of the file (v counts from the bottom there), and the EXR pages, opened in Blender, have to have the texels of the KTX2 ones.
"""

import json
import pathlib
import struct
import sys

import bpy
import numpy as np


def attributes(path, name):
    """An attribute of floats of each primitive of a GLB, in order of its meshes."""
    data = open(path, "rb").read()
    (length,) = struct.unpack_from("<I", data, 12)
    gltf = json.loads(data[20 : 20 + length])
    body = data[28 + length :]
    out = []
    for mesh in gltf["meshes"]:
        for primitive in mesh["primitives"]:
            accessor = gltf["accessors"][primitive["attributes"][name]]
            assert accessor["componentType"] == 5126, "packed: bake without --compress"
            view = gltf["bufferViews"][accessor["bufferView"]]
            at = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            width = {"VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
            values = np.frombuffer(body, "<f4", accessor["count"] * width, at)
            out.append(values.reshape(-1, width)[:, :3])
    return out


def encoded(linear):
    """The sRGB transfer function (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)


def texels(path):
    """Red, green and blue of a page in KTX2, R16G16B16A16_SFLOAT in one level, its bottom row first."""
    data = open(path, "rb").read()
    width, height = struct.unpack_from("<2I", data, 20)
    (start,) = struct.unpack_from("<Q", data, 80)
    rows = np.frombuffer(data, "<f2", 4 * width * height, start).reshape(height, width, 4)
    return rows[::-1, :, :3].astype(np.float32)


def check_maps(path, beside):
    """Light maps of an imported room; what differs, as text, or none."""
    index = json.loads(beside.read_text())
    if any(entry["texcoord"] != 1 for entry in index["meshes"]):
        return "a mesh has its light elsewhere than in the second set"
    places = np.unique(np.concatenate(attributes(path, "TEXCOORD_1")), axis=0)
    found = []
    for mesh in bpy.data.meshes:
        layer = mesh.uv_layers[1]
        values = np.zeros(2 * len(layer.data), np.float32)
        layer.data.foreach_get("uv", values)
        found.append(np.unique(values.reshape(-1, 2), axis=0))
    found = np.unique(np.concatenate(found), axis=0)
    found[:, 1] = 1 - found[:, 1]
    # Vertices that no triangle uses do not arrive.
    nearest = [np.abs(places - place).max(axis=1).min() for place in found]
    if max(nearest) > 1e-6:
        return f"texture coordinates differ by {max(nearest)}"
    for page in filter(lambda page: page["ktx2"], index["pages"]):
        image = bpy.data.images.load(str(beside.parent / page["exr"]))
        pixels = np.zeros(4 * page["width"] * page["height"], np.float32)
        image.pixels.foreach_get(pixels)
        apart = np.abs(pixels.reshape(page["height"], page["width"], 4)[:, :, :3] - texels(beside.parent / page["ktx2"])).max()
        if apart > 0:
            return f"texels of {page['exr']} differ by {apart}"
    return None


def check(path):
    """Imports a room; what differs, as text, or none."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path)
    beside = pathlib.Path(path).with_suffix(".maps.json")
    if beside.exists():
        return check_maps(path, beside)
    wanted = np.concatenate(attributes(path, "COLOR_0"))
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
        print(f"{path}: {problem or 'the light is that of the file'} (Blender {bpy.app.version_string})")
    return int(bad)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
