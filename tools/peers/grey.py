"""The same room without colour: every reflectance .5, lamps white, no pictures. It means the same to any program."""

import copy

from gltf import File, write_glb
from room import LUMINANCE

GREY = 0.5  # the one reflectance


def write_grey(path, out):
    """Writes the grey room of a file as one .glb."""
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
