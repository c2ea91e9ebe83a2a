"""The world as a sky, and light through an opening."""

import math

import bpy
import pytest
import scenes
from haarlight_blender import bake, session, show, world
from haarlight_blender.export import INDEX


def said(made, lumens=683.0):
    notes = []
    return world.sky(made, lumens, notes.append), notes


def background(color=(1.0, 1.0, 1.0), strength=1.0):
    made = bpy.data.worlds.new("World")
    node = scenes.tree(made).nodes["Background"]
    node.inputs["Color"].default_value = (*color, 1.0)
    node.inputs["Strength"].default_value = strength
    return made, node


def test_a_colour_is_an_even_sky():
    scenes.empty()
    made, _ = background((0.5, 0.5, 0.5), 2.0)
    sky, notes = said(made)
    assert sky["type"] == "uniform" and sky["ground_reflectance"] == 1.0
    assert sky["illuminance_lx"] == pytest.approx(math.pi * 683.0)
    assert sky["cct_k"] == pytest.approx(6504.0, rel=0.01) and not notes
    _, notes = said(background((0.9, 0.2, 0.2))[0])
    assert "not one of daylight" in notes[0]
    assert said(background(strength=0.0)[0]) == (None, [])
    assert said(None) == (None, [])


def test_a_sky_texture_is_a_clear_sky_with_its_sun():
    scenes.empty()
    made, node = background(strength=1.0)
    texture = made.node_tree.nodes.new("ShaderNodeTexSky")
    made.node_tree.links.new(texture.outputs[0], node.inputs["Color"])
    texture.sun_elevation, texture.sun_rotation = math.radians(40.0), math.radians(200.0)
    sky, notes = said(made)
    assert sky["type"] == "clear" and not notes
    assert sky["sun"]["elevation_deg"] == pytest.approx(40.0) and sky["sun"]["azimuth_deg"] == pytest.approx(200.0)
    # IES RP-21 at 40 degrees.
    assert sky["illuminance_lx"] == pytest.approx(800 + 15500 * math.sqrt(math.sin(math.radians(40))), rel=1e-6)
    assert sky["sun"]["illuminance_lx"] == pytest.approx(127500 * math.exp(-0.21 / math.sin(math.radians(40))), rel=1e-6)
    texture.sun_disc = False
    assert said(made)[0]["sun"]["illuminance_lx"] == 0.0


def test_what_is_not_read_is_named():
    scenes.empty()
    made, node = background()
    image = made.node_tree.nodes.new("ShaderNodeTexEnvironment")
    made.node_tree.links.new(image.outputs[0], node.inputs["Color"])
    sky, notes = said(made)
    assert sky is None and "Environment Texture is not read" in notes[0]


def open_room():
    """A grey room without a roof's middle: a plate on four walls would do; here the ceiling face is taken away."""
    scene = scenes.empty()
    room = scenes.room(2.0)
    mesh = room.data
    import bmesh

    edit = bmesh.new()
    edit.from_mesh(mesh)
    edit.faces.ensure_lookup_table()
    top = [face for face in edit.faces if all(v.co.z > 0.9 for v in face.verts)]
    bmesh.ops.delete(edit, geom=top, context="FACES_ONLY")
    edit.to_mesh(mesh)
    edit.free()
    scene.haarlight.error = 1.0
    return scene


def test_an_open_room_is_lit_by_the_world_as_by_the_closed_form():
    scene = open_room()
    scene.world, _ = background(strength=1.0)
    # Black walls: the middle of the floor sees the sky alone, through a square of 2 m, 2 m above it.
    bpy.data.materials["wall"].node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0, 0, 0, 1)
    assert bpy.ops.haarlight.bake() == {"FINISHED"}
    light = session.baked(show.of_scene(scene), show.KEY).light
    # Form factor of a quarter of it: a differential element below the corner of a rectangle a x b at height c.
    a = b = 1.0 / 2.0
    quarter = (
        a / math.sqrt(1 + a * a) * math.atan(b / math.sqrt(1 + a * a))
        + b / math.sqrt(1 + b * b) * math.atan(a / math.sqrt(1 + b * b))
    ) / (2.0 * math.pi)
    assert light.probe([[0, -1, 0]], [0, 1, 0]).lux[0] == pytest.approx(4 * quarter * math.pi * 683.0, rel=0.01)


def test_the_sun_of_a_sky_texture_falls_where_it_should():
    scene = open_room()
    made, node = background()
    texture = made.node_tree.nodes.new("ShaderNodeTexSky")
    made.node_tree.links.new(texture.outputs[0], node.inputs["Color"])
    # 60 degrees high in the east, Blender's +X: the patch falls to the west.
    texture.sun_elevation, texture.sun_rotation = math.radians(60.0), math.radians(90.0)
    scene.world = made
    assert bpy.ops.haarlight.bake() == {"FINISHED"}
    light = session.baked(show.of_scene(scene), show.KEY).light
    west, east = light.probe([[-0.5, -1, 0], [0.5, -1, 0]], [0, 1, 0]).lux
    assert west > 5.0 * east
    scene.haarlight.use_world = False
    with pytest.raises(RuntimeError, match="there is no lamp"):
        bpy.ops.haarlight.bake()


def test_a_window_pane_stays_as_it_is():
    scene = open_room()
    scene.world, _ = background()
    glass = scenes.material("glass")
    shader = glass.node_tree.nodes["Principled BSDF"]
    shader.inputs["Transmission Weight"].default_value = 1.0
    shader.inputs["Roughness"].default_value = 0.0
    shader.inputs["Base Color"].default_value = (1, 1, 1, 1)
    pane = scenes.add("Pane", scenes.plane("pane", 2.0, glass))
    pane.location.z = 1.0
    bpy.context.view_layer.update()
    assert bpy.ops.haarlight.bake() == {"FINISHED"}
    lit = {made["haarlight_name"]: made for made in show.of_scene(scene).objects}
    assert lit["Pane"].data.materials[0] is glass or lit["Pane"].data.materials[0] == glass
    assert lit["Room"].data.materials[0].name == "wall lit"
    assert all(INDEX in made for made in lit.values())
    assert bake is not None
