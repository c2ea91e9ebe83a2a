"""Materials as glTF's exporter can read them: copies with a Principled BSDF where the original is made another way."""

from __future__ import annotations

import bpy

# What Blender shows where there is no material.
GREY = (0.8, 0.8, 0.8, 1.0)
# Shaders whose "Color" is a diffuse one, or near it.
PAINTS = {"BSDF_DIFFUSE", "BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_SHEEN", "BSDF_TOON", "SUBSURFACE_SCATTERING"}

# Nodes that bring an image, and those that bring colours of vertices.
IMAGES = {"TEX_IMAGE"}
PAINTED = {"VERTEX_COLOR", "ATTRIBUTE"}


def has_nodes(block) -> bool:
    """Does a material or world count by its nodes? From Blender 5.0 on all do."""
    return block.node_tree is not None and (bpy.app.version >= (5, 0, 0) or block.use_nodes)


def surface_of(tree: bpy.types.NodeTree):
    """The output node of a material's surface, and the shader that is linked to it."""
    output = tree.get_output_node("ALL")
    links = output.inputs["Surface"].links if output else ()
    return output, links[0].from_node if links else None


def readable(material: bpy.types.Material | None, warn) -> bpy.types.Material:
    """A copy of a material whose surface glTF's exporter understands."""
    if material is None:
        copy = bpy.data.materials.new("no material")
        _principled(copy).inputs["Base Color"].default_value = GREY
        return copy
    copy = material.copy()
    if not has_nodes(material):
        _principled(copy).inputs["Base Color"].default_value = material.diffuse_color
        return copy
    _, shader = surface_of(copy.node_tree)
    if shader is None:
        warn(f"material '{material.name}' has no surface: it is taken as black")
        _principled(copy).inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    elif shader.type in PAINTS:
        color = shader.inputs["Color"]
        source = color.links[0].from_socket if color.is_linked else None
        value = tuple(color.default_value)
        base = _principled(copy).inputs["Base Color"]
        base.default_value = value
        if source is not None:
            copy.node_tree.links.new(source, base)
    elif any(node.type in ("BSDF_PRINCIPLED", "EMISSION") for node in _all(copy.node_tree)):
        _without_patterns(copy, material.name, warn)
    else:
        warn(f"material '{material.name}': {shader.bl_label} is not read; give it a Principled BSDF")
    return copy


def kinds_before(socket: bpy.types.NodeSocket) -> set[str]:
    """Types of the nodes that an input depends on."""
    found, ahead = set(), [link.from_node for link in socket.links]
    seen = set()
    while ahead:
        node = ahead.pop()
        if node.as_pointer() in seen:
            continue
        seen.add(node.as_pointer())
        found.add(node.type)
        inner = node.node_tree.nodes if node.type == "GROUP" and node.node_tree else ()
        found.update(within.type for within in inner)
        ahead += [link.from_node for given in node.inputs for link in given.links]
    return found


def _without_patterns(copy, name: str, warn) -> None:
    """glTF has images and colours of vertices. What is worked out by nodes it would take as white: the value beside counts."""
    for node in copy.node_tree.nodes:
        for wanted in ("Base Color", "Emission Color"):
            given = node.inputs.get(wanted) if node.type == "BSDF_PRINCIPLED" else None
            if given is None or not given.is_linked or kinds_before(given) & {*IMAGES, *PAINTED, "RGB"}:
                continue
            copy.node_tree.links.remove(given.links[0])
            warn(f"material '{name}': a pattern of nodes is not read, its {wanted.lower()} counts as if unlinked; bake it into an image")


def emitter(name: str, color, radiance: float) -> bpy.types.Material:
    """A black surface that shines from its front."""
    material = bpy.data.materials.new(name)
    shader = _principled(material)
    shader.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    shader.inputs["Emission Color"].default_value = (*color, 1.0)
    shader.inputs["Emission Strength"].default_value = radiance
    material.use_backface_culling = True
    return material


def _principled(material) -> bpy.types.Node:
    """Gives a material a Principled BSDF of its own as its surface."""
    if not has_nodes(material):
        material.use_nodes = True
    tree = material.node_tree
    output, _ = surface_of(tree)
    for node in [n for n in tree.nodes if n.type in ("BSDF_PRINCIPLED", "EMISSION")]:
        tree.nodes.remove(node)
    output = output or tree.nodes.new("ShaderNodeOutputMaterial")
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    shader.inputs["Metallic"].default_value = 0.0
    shader.inputs["Roughness"].default_value = 1.0
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return shader


def _all(tree):
    for node in tree.nodes:
        yield node
        if node.type == "GROUP" and node.node_tree:
            yield from _all(node.node_tree)
