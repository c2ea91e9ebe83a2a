"""What is shown of a bake: a collection of new objects beside the user's, whose materials a node group lights.

Why new objects: a mesh with light at its vertices is another mesh (finer where light changes, cut at edges of shadows), and a
light map needs texture coordinates of its own for every instance. The user's objects keep their meshes, modifiers and links; they
are hidden while the light is shown, and come back as they were (`Show Originals`).
"""

from __future__ import annotations

import json
import uuid

import bpy
import numpy as np

from . import paint
from .bake import Lit
from .export import INDEX, by_uid
from .read import Shape

IRRADIANCE, RADIOSITY, MAP = "haarlight_irradiance", "haarlight_radiosity", "haarlight_map"
GROUP = "haarlight light"
KEY = "haarlight_light"
HIDDEN = "haarlight_hidden"
OF, OWNER = "haarlight_of", "haarlight_owner"


def show(context, lit: Lit, hide: bool) -> bpy.types.Collection:
    """Puts the light into the scene, in the place of what an earlier bake put there."""
    scene = context.scene
    clear(context)
    collection = bpy.data.collections.new(f"Light of {scene.name}")
    collection[KEY] = uuid.uuid4().hex
    scene.collection.children.link(collection)
    images = [_page(page) for page in lit.pages.files] if lit.pages else []
    materials: dict[tuple, bpy.types.Material] = {}
    paints, objects = by_uid(bpy.data.materials), by_uid(bpy.data.objects)
    originals = [paints.get(uid) for uid in lit.exported.originals]
    for number, shape in lit.shapes.items():
        piece = lit.exported.pieces[number]
        # An area lamp cannot be seen in Blender.
        if piece.kind != "mesh":
            continue
        mesh = _mesh(f"{piece.name} lit", shape, piece.uvs)
        if shape.paint is not None and piece.paint:
            _colours(mesh, piece.paint, shape.paint)
        _paint(mesh, shape, lit, originals, images, materials)
        made = bpy.data.objects.new(f"{piece.name} lit", mesh)
        made[INDEX], made["haarlight_name"] = number, piece.name
        for key, uid in ((OF, piece.uid), (OWNER, piece.owner)):
            if uid in objects:
                made[key] = objects[uid]
        collection.objects.link(made)
        made.matrix_world = piece.matrix
    if hide:
        _hide(context, collection)
    context.view_layer.update()
    return collection


def of_scene(scene) -> bpy.types.Collection | None:
    """The collection with the light of a scene."""
    return next((c for c in scene.collection.children if KEY in c), None)


def update(collection: bpy.types.Collection, lit: Lit) -> None:
    """Other light on the same meshes, after relighting."""
    for made in collection.objects:
        shape = lit.shapes.get(made.get(INDEX, -1))
        if shape is None or len(shape.positions) != len(made.data.vertices):
            raise ValueError(f"'{made.name}' is not the mesh that was baked any more; bake again")
        _light(made.data, shape)
        made.data.update()


def clear(context) -> None:
    """Takes the light of a scene out again, and brings the originals back."""
    collection = of_scene(context.scene)
    if collection is None:
        return
    show_originals(context, collection)
    meshes = [made.data for made in collection.objects]
    materials = {m for mesh in meshes for m in mesh.materials if m is not None and m.get(KEY)}
    bpy.data.batch_remove([*collection.objects, *meshes, *materials, collection])


def _hide(context, collection) -> None:
    """Hides what was baked, and notes how it was: names with (hidden in the viewport, hidden in renders)."""
    owners = {made[OWNER] for made in collection.objects if made.get(OWNER)}
    present = [s for s in owners if s.name in context.view_layer.objects]
    collection[HIDDEN] = json.dumps({s.name: (s.hide_get(), s.hide_render) for s in present})
    for source in present:
        source.hide_set(True)
        source.hide_render = True


def show_originals(context, collection) -> None:
    """Brings the originals back as they were."""
    for name, (hidden, hidden_in_renders) in json.loads(collection.get(HIDDEN, "{}")).items():
        source = context.view_layer.objects.get(name)
        if source is not None:
            source.hide_set(hidden)
            source.hide_render = hidden_in_renders
    collection[HIDDEN] = "{}"


def originals_shown(collection) -> bool:
    """Are the originals to be seen now?"""
    return collection.get(HIDDEN, "{}") == "{}"


def hide_again(context, collection, hidden: str) -> None:
    """Hides the originals that `hidden`, a note of `_hide`, names."""
    for name in json.loads(hidden):
        source = context.view_layer.objects.get(name)
        if source is not None:
            source.hide_set(True)
            source.hide_render = True
    collection[HIDDEN] = hidden


def swap(context, collection) -> None:
    """Shows the originals in place of the light, or the light in place of them."""
    show_light = originals_shown(collection)
    if show_light:
        _hide(context, collection)
    else:
        show_originals(context, collection)
    for made in collection.objects:
        made.hide_set(not show_light)
        made.hide_render = not show_light


def _mesh(name: str, shape: Shape, uvs: list[str]) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(name)
    corners = np.ascontiguousarray(shape.triangles, np.int32).ravel()
    mesh.vertices.add(len(shape.positions))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(shape.positions, np.float32).ravel())
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.add(len(shape.triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 3, dtype=np.int32))
    layers = list(zip(uvs, shape.uvs)) + ([(MAP, shape.map_uv)] if shape.map_uv is not None else [])
    for title, coordinates in layers:
        layer = mesh.uv_layers.new(name=title, do_init=False)
        layer.data.foreach_set("uv", np.ascontiguousarray(coordinates[corners], np.float32).ravel())
    mesh.update(calc_edges=True)
    _light(mesh, shape)
    return mesh


def _light(mesh, shape: Shape) -> None:
    for name, values in ((IRRADIANCE, shape.irradiance), (RADIOSITY, shape.radiosity)):
        if values is None:
            continue
        rgba = np.ones((len(values), 4), np.float32)
        rgba[:, :3] = values
        _colours(mesh, name, rgba)
    if shape.radiosity is not None:
        mesh.color_attributes.active_color = mesh.color_attributes[RADIOSITY]


def _colours(mesh, name: str, rgba) -> None:
    attribute = mesh.color_attributes.get(name) or mesh.color_attributes.new(name, "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", np.ascontiguousarray(rgba, np.float32).ravel())


def _paint(mesh, shape: Shape, lit: Lit, originals, images, materials) -> None:
    """Gives the mesh its materials: one for each material and page."""
    keys = np.column_stack([shape.material, np.where(shape.lit, shape.page, -2)])
    kinds, slots = np.unique(keys, axis=0, return_inverse=True)
    for number, page in kinds:
        key = (int(number), int(page))
        if key not in materials:
            original = originals[number] if number >= 0 else None
            materials[key] = _material(*key, original, lit, images)
        mesh.materials.append(materials[key])
    mesh.polygons.foreach_set("material_index", np.ascontiguousarray(slots.ravel(), np.int32))


def _material(number: int, page: int, original, lit: Lit, images) -> bpy.types.Material | None:
    if page == -2:
        return original
    made = paint.readable(original, lambda text: None)
    name = lit.exported.materials[number] if number >= 0 else "no material"
    made.name = f"{name} lit"
    made[KEY] = True
    tree = made.node_tree
    output, shader = paint.surface_of(tree)
    shader = next((n for n in tree.nodes if n.type == "BSDF_PRINCIPLED"), shader)
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = _group()
    group.inputs["Lumens per Watt"].default_value = lit.exported.lumens_per_watt
    # Colours of vertices are in the radiosity; the mesh with light at its vertices has no others.
    before = paint.kinds_before(shader.inputs["Base Color"]) if "Base Color" in shader.inputs else set()
    textured = bool(before & paint.IMAGES) and not before & paint.PAINTED
    if page >= 0:
        light = tree.nodes.new("ShaderNodeTexImage")
        light.image, light.extension = images[page], "EXTEND"
        place = tree.nodes.new("ShaderNodeUVMap")
        place.uv_map = MAP
        tree.links.new(place.outputs[0], light.inputs["Vector"])
        group.inputs["Unit"].default_value = lit.pages.lux_per_unit
    else:
        light = tree.nodes.new("ShaderNodeAttribute")
        light.attribute_name = IRRADIANCE if textured else RADIOSITY
    tree.links.new(light.outputs["Color"], group.inputs["Light"])
    if page >= 0 or textured:
        _take(tree, shader, ("Base Color", "Color"), group.inputs["Colour"], (0.0, 0.0, 0.0, 1.0))
        _take(tree, shader, ("Emission Color",), group.inputs["Emission"], None)
        _take(tree, shader, ("Emission Strength",), group.inputs["Emission Strength"], None)
        if shader.type == "EMISSION":
            _take(tree, shader, ("Color",), group.inputs["Emission"], None)
            _take(tree, shader, ("Strength",), group.inputs["Emission Strength"], None)
            group.inputs["Colour"].default_value = (0.0, 0.0, 0.0, 1.0)
            for link in list(group.inputs["Colour"].links):
                tree.links.remove(link)
    tree.links.new(group.outputs["Surface"], output.inputs["Surface"])
    return made


def _take(tree, shader, names, into, otherwise) -> None:
    """Gives an input of the group what a shader's input has."""
    wanted = next((shader.inputs[name] for name in names if name in shader.inputs), None)
    if wanted is None:
        if otherwise is not None:
            into.default_value = otherwise
    elif wanted.is_linked:
        tree.links.new(wanted.links[0].from_socket, into)
    else:
        into.default_value = wanted.default_value


def _page(path) -> bpy.types.Image:
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = "Linear Rec.709"
    # The file goes with the temporary folder.
    image.pack()
    return image


def _group() -> bpy.types.NodeTree:
    """Surface = Light Unit Colour / (pi Lumens per Watt) + Emission: radiance in Blender's watts, so that exposure and view
    are those of a render."""
    found = bpy.data.node_groups.get(GROUP)
    if found is not None:
        return found
    group = bpy.data.node_groups.new(GROUP, "ShaderNodeTree")
    face = group.interface
    sockets = [
        ("Light", "NodeSocketColor", (0.0, 0.0, 0.0, 1.0)),
        ("Unit", "NodeSocketFloat", 1.0),
        ("Colour", "NodeSocketColor", (1.0, 1.0, 1.0, 1.0)),
        ("Emission", "NodeSocketColor", (0.0, 0.0, 0.0, 1.0)),
        ("Emission Strength", "NodeSocketFloat", 0.0),
        ("Lumens per Watt", "NodeSocketFloat", 683.0),
    ]
    for name, kind, value in sockets:
        face.new_socket(name, in_out="INPUT", socket_type=kind).default_value = value
    face.new_socket("Surface", in_out="OUTPUT", socket_type="NodeSocketShader")
    nodes, links = group.nodes, group.links
    given, out = nodes.new("NodeGroupInput").outputs, nodes.new("NodeGroupOutput").inputs

    def vector(operation, a, b):
        node = nodes.new("ShaderNodeVectorMath")
        node.operation = operation
        links.new(a, node.inputs[0])
        links.new(b, node.inputs["Scale"] if operation == "SCALE" else node.inputs[1])
        return node.outputs[0]

    share = nodes.new("ShaderNodeMath")
    share.operation = "MULTIPLY"
    share.inputs[1].default_value = np.pi
    links.new(given["Lumens per Watt"], share.inputs[0])
    factor = nodes.new("ShaderNodeMath")
    factor.operation = "DIVIDE"
    links.new(given["Unit"], factor.inputs[0])
    links.new(share.outputs[0], factor.inputs[1])
    reflected = vector("SCALE", vector("MULTIPLY", given["Light"], given["Colour"]), factor.outputs[0])
    total = vector("ADD", reflected, vector("SCALE", given["Emission"], given["Emission Strength"]))
    shader = nodes.new("ShaderNodeEmission")
    links.new(total, shader.inputs["Color"])
    links.new(shader.outputs[0], out["Surface"])
    return group
