"""What is exported: lumens, matrices, names, and nothing left behind."""

import math
import warnings

import bpy
import haarlight
import pytest
import scenes
from haarlight_blender import bake
from haarlight_blender.export import NothingToBake, chosen, export
from haarlight_blender.glb import Glb
from mathutils import Matrix

warnings.simplefilter("ignore", haarlight.RoomWarning)


@pytest.fixture
def out(tmp_path):
    def made(selected=False, lumens_per_watt=683.0, use_world=True):
        bpy.context.view_layer.update()
        return export(
            bpy.context,
            tmp_path,
            only=chosen(bpy.context) if selected else None,
            use_world=use_world,
            lumens_per_watt=lumens_per_watt,
        )

    return made


def lamps(exported):
    return {lamp["name"]: lamp for lamp in bake.room(exported, {}).facts["lights"]}


def test_every_kind_of_lamp_keeps_its_power(out):
    scenes.empty()
    scenes.room()
    scenes.lamp("point", "POINT", 10.0)
    scenes.lamp("spot", "SPOT", 10.0, (0, 0, 1), spot_size=math.radians(60), spot_blend=0.0)
    for shape in ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"):
        lamp = scenes.lamp(shape, "AREA", 10.0, (1, 0, 0), shape=shape, size=0.5, size_y=0.25)
        lamp.scale = (1.0, 2.0, 1.0)
    found = lamps(out())
    for name in ("point", "SQUARE", "RECTANGLE", "DISK", "ELLIPSE"):
        assert found[name]["flux_lm"] == pytest.approx(6830.0, rel=1e-5), name
    # A cone of 30 degrees from its axis cuts what goes past it.
    assert found["spot"]["intensity_cd"] == pytest.approx(6830.0 / (4.0 * math.pi), rel=1e-5)
    assert found["spot"]["flux_lm"] == pytest.approx(6830.0 * 0.5 * (1.0 - math.cos(math.radians(30))), rel=0.02)


@pytest.mark.skipif(bpy.app.version < (4, 5, 0), reason="lamps have these dials from Blender 4.5 on")
def test_dials_of_a_lamp_multiply(out):
    scenes.empty()
    scenes.room()
    lamp = scenes.lamp("dials", "POINT", 3.0, exposure=1.0, normalize=False, shadow_soft_size=0.5, color=(0.25, 0.5, 0.5))
    lamp.data.use_temperature, lamp.data.temperature = True, 3000.0
    found = Glb(out().path).document["extensions"]["KHR_lights_punctual"]["lights"][0]
    red, green, blue = (c * t for c, t in zip((0.25, 0.5, 0.5), lamp.data.temperature_color))
    brightest = max(red, green, blue)
    assert found["intensity"] == pytest.approx(683 * 3 * 2 * (math.pi * 4 * 0.25) * brightest / (4 * math.pi), rel=1e-5)
    assert found["color"] == pytest.approx([red / brightest, green / brightest, blue / brightest], rel=1e-5)
    assert lamp.data.color[:] == pytest.approx((0.25, 0.5, 0.5)), "the user's lamp is as it was"


def test_a_sun_and_emission_keep_their_proportions(out):
    scenes.empty()
    scenes.room()
    scenes.lamp("sun", "SUN", 3.0)
    scenes.add("panel", scenes.plane("panel", 1.0, scenes.material("shines", emission=2.0)))
    exported = out(lumens_per_watt=100.0)
    found = lamps(exported)
    assert found["sun"]["illuminance_lx"] == pytest.approx(300.0)
    assert found["shines"]["luminance_cd_m2"] == pytest.approx(200.0)


@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_power_does_not_depend_on_the_unit(out, unit):
    scenes.empty(unit)
    scenes.room(4.0 / unit)
    scenes.lamp("area", "AREA", 10.0, (0, 0, 1.0 / unit), size=0.5 / unit)
    scenes.lamp("point", "POINT", 10.0)
    exported = out()
    assert exported.scale == pytest.approx(unit)
    room = bake.room(exported, {})
    assert room.facts["area_m2"] == pytest.approx(6 * 16 + 0.25, rel=1e-4)
    for lamp in room.facts["lights"]:
        assert lamp["flux_lm"] == pytest.approx(6830.0, rel=1e-4), lamp["name"]


def test_linked_meshes_are_shared_and_modifiers_applied(out):
    scenes.empty()
    scenes.room()
    mesh = scenes.box("b", 0.5, scenes.material("m"))
    for k in range(3):
        scenes.add(f"box {k}", mesh, scenes.turned((k - 1.0, 0, 0)))
    rounded = scenes.add("modified", mesh, scenes.turned((0, 1, 0)))
    rounded.modifiers.new("array", "ARRAY").count = 2
    document = Glb(out().path).document
    nodes = {node["name"]: node for node in document["nodes"]}
    assert len({nodes[f"box {k}"]["mesh"] for k in range(3)}) == 1
    assert len(document["meshes"]) == 3
    faces = document["accessors"][document["meshes"][nodes["modified"]["mesh"]]["primitives"][0]["indices"]]["count"] / 3
    assert faces == 24, "an array of two boxes"


def test_instances_of_a_collection_are_exported(out):
    scene = scenes.empty()
    scenes.room()
    held = bpy.data.collections.new("held")
    held.objects.link(bpy.data.objects.new("chair", scenes.box("chair", 0.3, scenes.material("m"))))
    held.objects.link(bpy.data.objects.new("bulb", bpy.data.lights.new("bulb", "POINT")))
    for k in range(2):
        instance = bpy.data.objects.new(f"place {k}", None)
        instance.instance_type, instance.instance_collection = "COLLECTION", held
        instance.location = (k, 0, 0)
        scene.collection.objects.link(instance)
    names = {node["name"] for node in Glb(out().path).document["nodes"]}
    assert {"place 0/chair", "place 1/chair", "place 0/bulb", "place 1/bulb"} <= names


def test_a_sheared_and_a_mirrored_object_stand_where_they_stood(out):
    scenes.empty()
    shear = Matrix(((1, 0.7, 0, 1), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)))
    mirrored = Matrix.Diagonal((-1, 1, 1, 1)) @ shear
    scenes.room()
    scenes.lamp("L", "POINT", 1.0, (0, 0, 1.5))
    for name, matrix in (("sheared", shear), ("mirrored", mirrored), ("flipped", scenes.turned((0, 1, 0), 30, (-1, 1, 1)))):
        # Of lengths that differ, so that a mirror image is told from a turn.
        thing = scenes.box(name, 0.5, scenes.material(name))
        thing.vertices[7].co.x += 0.2
        scenes.add(name, thing, matrix)
    bpy.context.view_layer.update()
    exported = out()
    light = bake.room(exported, {}).bake(2.0)
    for number, piece in enumerate(exported.pieces):
        if piece.kind != "mesh" or piece.name == "Room":
            continue
        own = light.surface == next(k for k, s in enumerate(light.room.surfaces) if s["node"] == number)
        source = bpy.data.objects[piece.name]
        corners = [source.matrix_world @ v.co for v in source.data.vertices]
        wanted = {(round(c.x, 4), round(c.z, 4), round(-c.y, 4)) for c in corners}
        found = {tuple(round(float(c), 4) + 0.0 for c in p) for p in light.positions[own]}
        assert {tuple(c + 0.0 for c in p) for p in wanted} <= found, piece.name
        # Normals look out of the body.
        middle = light.positions[own].mean(axis=0)
        outward = ((light.positions[own] - middle) * light.normals[own]).sum(axis=1)
        assert outward.min() > 0.0, piece.name


def test_only_what_is_wanted_is_exported(out):
    scenes.empty()
    room = scenes.room()
    scenes.lamp("lamp", "POINT", 1.0)
    scenes.add("unseen", scenes.box("unseen", 1.0, scenes.material("m"))).hide_render = True
    scenes.add("hidden", scenes.box("hidden", 1.0, scenes.material("m"))).hide_set(True)
    scenes.add("empty", bpy.data.meshes.new("empty"))
    assert [piece.name for piece in out().pieces] == ["Room", "lamp"]
    room.select_set(True)
    assert [piece.name for piece in out(selected=True).pieces] == ["Room"]
    room.select_set(False)
    with pytest.raises(NothingToBake, match="no surface is selected"):
        out(selected=True)


def test_materials_made_otherwise_keep_their_colour(out):
    scenes.empty()
    scenes.room()
    matt = scenes.material("matt")
    tree = matt.node_tree
    tree.nodes.clear()
    diffuse, end = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    tree.links.new(diffuse.outputs[0], end.inputs["Surface"])
    bare = scenes.plane("bare", 1.0, matt)
    bare.materials.clear()
    scenes.add("matt", scenes.plane("p", 1.0, matt))
    scenes.add("bare", bare)
    strange = scenes.material("strange")
    tree = strange.node_tree
    tree.nodes.clear()
    hair, end = tree.nodes.new("ShaderNodeBsdfHair"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(hair.outputs[0], end.inputs["Surface"])
    scenes.add("strange", scenes.plane("s", 1.0, strange))
    exported = out()
    materials = {m["name"]: m for m in Glb(exported.path).document["materials"]}
    assert materials["matt"]["pbrMetallicRoughness"]["baseColorFactor"][:3] == pytest.approx([0.1, 0.2, 0.3])
    assert materials["no material"]["pbrMetallicRoughness"]["baseColorFactor"][:3] == pytest.approx([0.8, 0.8, 0.8])
    assert any("material 'strange'" in text for text in exported.warnings)
    assert [n.type for n in matt.node_tree.nodes] == ["BSDF_DIFFUSE", "OUTPUT_MATERIAL"], "the user's is as it was"


def test_a_pattern_of_nodes_is_not_taken_as_white(out):
    scenes.empty()
    room = scenes.room()
    tree = room.data.materials[0].node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    exported = out()
    found = Glb(exported.path).document["materials"][0]["pbrMetallicRoughness"]
    assert found["baseColorFactor"][:3] == pytest.approx([0.5] * 3)
    assert any("'wall'" in text and "pattern" in text for text in exported.warnings)
    assert tree.nodes["Principled BSDF"].inputs["Base Color"].is_linked


def test_faces_keep_their_own_material(out):
    scenes.empty()
    room = scenes.room()
    room.data.materials.append(scenes.material("red", (0.6, 0.1, 0.1)))
    room.data.polygons[4].material_index = 1
    scenes.lamp("lamp", "POINT", 1.0)
    assert [s["material"] for s in bake.room(out(), {}).surfaces] == ["wall", "red"]


def test_nothing_is_left_behind(out):
    scenes.empty()
    scenes.room()
    scenes.lamp("lamp", "POINT", 1.0)
    scenes.lamp("area", "AREA", 1.0)
    kinds = ("scenes", "objects", "meshes", "lights", "materials", "collections", "node_groups", "images", "worlds")
    before = {kind: sorted(getattr(bpy.data, kind).keys()) for kind in kinds}
    scene = bpy.context.scene
    out()
    assert {kind: sorted(getattr(bpy.data, kind).keys()) for kind in kinds} == before
    assert bpy.context.scene == scene
    with pytest.raises(NothingToBake):
        out(selected=True)
    assert {kind: sorted(getattr(bpy.data, kind).keys()) for kind in kinds} == before


def test_lamps_that_cannot_be_read_are_named(out):
    scenes.empty()
    scenes.room()
    lamp = scenes.lamp("narrow", "AREA", 1.0, spread=1.0)
    scenes.lamp("negative", "POINT", -1.0)
    exported = out()
    assert any("'narrow'" in text and "spread" in text for text in exported.warnings)
    assert any("'negative'" in text and "left out" in text for text in exported.warnings)
    assert lamp.data.spread == 1.0
