"""Blender's own path tracer: what its lamps and sky mean, and a room that it renders beside the baked one."""

import math

import bpy
import numpy as np
import pytest
import scenes
from haarlight_blender import show
from mathutils import Matrix


def render(scene, path, width, height, samples):
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 32
    scene.cycles.sample_clamp_indirect = 0.0
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    out = np.array(image.pixels[:], np.float32).reshape(height, width, 4)[..., :3]
    bpy.data.images.remove(image)
    return out


def camera(scene, at, turn, **dials):
    made = scenes.add("Camera", bpy.data.cameras.new("Camera"))
    made.location, made.rotation_euler = at, turn
    for dial, value in dials.items():
        setattr(made.data, dial, value)
    scene.camera = made


def matt(name, color):
    made = scenes.material(name, color)
    # Blender's default: both sides are seen, and lit.
    made.use_backface_culling = False
    tree = made.node_tree
    tree.nodes.clear()
    diffuse, end = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (*color, 1.0)
    tree.links.new(diffuse.outputs[0], end.inputs["Surface"])
    return made


@pytest.mark.parametrize(
    ("kind", "dials", "wanted"),
    [
        ("POINT", {"shadow_soft_size": 0.0}, 1.0 / (4.0 * math.pi)),
        ("SPOT", {"shadow_soft_size": 0.0, "spot_size": 1.0}, 1.0 / (4.0 * math.pi)),
        ("POINT", {"shadow_soft_size": 0.1, "normalize": False}, 4.0 * math.pi * 0.01 / (4.0 * math.pi)),
        ("AREA", {"size": 0.05}, 1.0 / math.pi),
        ("AREA", {"size": 0.05, "shape": "DISK"}, 1.0 / math.pi),
        ("AREA", {"size": 0.05, "normalize": False}, 0.05**2 / math.pi),
        ("SUN", {"angle": 0.0}, 4.0),
        ("POINT", {"shadow_soft_size": 0.0, "exposure": 1.0}, 2.0 / (4.0 * math.pi)),
    ],
)
def test_watts_mean_what_the_export_takes_them_for(tmp_path, kind, dials, wanted):
    """Irradiance times the square of the distance, for a watt (a sun: irradiance alone, times 4)."""
    if bpy.app.version < (4, 5, 0) and {"normalize", "exposure"} & set(dials):
        pytest.skip("lamps have this dial from Blender 4.5 on")
    scene = scenes.empty()
    scenes.add("Floor", scenes.plane("floor", 0.02, matt("white", (1, 1, 1))))
    scenes.lamp("lamp", kind, 100.0, (0, 0, 2), **dials)
    camera(scene, (0, 0, 0.5), (0, 0, 0), type="ORTHO", ortho_scale=0.01)
    found = math.pi * render(scene, tmp_path / "o.exr", 4, 4, 64).mean() * 4.0 / 100.0
    assert found == pytest.approx(wanted, rel=0.005)


def test_the_sun_of_a_sky_texture_stands_in_glTF_terms(tmp_path):
    scene = scenes.empty()
    scene.world = bpy.data.worlds.new("World")
    tree = scenes.tree(scene.world)
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation, sky.sun_rotation, sky.sun_size = math.radians(30), math.radians(40), math.radians(5)
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    camera(scene, (0, 0, 0), (0.5 * math.pi, 0, 0), type="PANO", panorama_type="EQUIRECTANGULAR")
    picture = render(scene, tmp_path / "o.exr", 180, 90, 1)[..., 1]
    y, x = np.unravel_index(picture.argmax(), picture.shape)
    # The middle of the picture looks along +Y, its right is +X: north and east.
    assert 2 * (y + 0.5) - 90 == pytest.approx(30, abs=3.5) and 2 * (x + 0.5) - 180 == pytest.approx(40, abs=3.5)


@pytest.mark.parametrize("medium", ["VERTICES", "MAPS"])
def test_a_baked_room_looks_as_cycles_renders_it(tmp_path, medium):
    """Grey and colours, textures, a mirrored box, two materials in a mesh; absolute, no exposure fitted."""
    scene = scenes.empty()
    room = scenes.add("Room", scenes.box("room", 4.0, matt("wall", (0.6, 0.6, 0.6)), inward=True))
    room.data.materials.append(matt("red", (0.5, 0.2, 0.2)))
    room.data.polygons[4].material_index = 1
    texture = bpy.data.images.new("checks", 32, 32)
    checks = np.ones((32, 32, 4), np.float32)
    checks[..., :3] = np.where(((np.indices((32, 32)) // 8).sum(axis=0) % 2)[..., None], 0.7, 0.2)
    texture.pixels = checks.ravel()
    texture.pack()
    rug = matt("rug", (1, 1, 1))
    node = rug.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = texture
    diffuse = next(n for n in rug.node_tree.nodes if n.type == "BSDF_DIFFUSE")
    rug.node_tree.links.new(node.outputs["Color"], diffuse.inputs["Color"])
    scenes.add("Rug", scenes.plane("rug", 2.0, rug), Matrix.Translation((0, 0.5, -1.95)))
    box = scenes.box("box", 1.0, matt("box", (0.7, 0.7, 0.6)))
    box.vertices[7].co.x += 0.3
    scenes.add("Box", box, scenes.turned((0.9, 0.9, -1.4), -20, (-1, 1, 1)))
    scenes.lamp("Area", "AREA", 60.0, (0, 0.3, 1.98), size=1.2, shape="DISK")
    scenes.lamp("Point", "POINT", 10.0, (-1.4, -1.0, 0.3), shadow_soft_size=0.0)
    camera(scene, (0, -1.95, 0), (math.radians(85), 0, 0), lens=20)
    truth = render(scene, tmp_path / "a.exr", 64, 48, 400)
    scene.haarlight.error, scene.haarlight.medium = 0.5, medium
    assert bpy.ops.haarlight.bake() == {"FINISHED"}
    assert show.of_scene(scene) is not None
    found = render(scene, tmp_path / "b.exr", 64, 48, 16)
    cells = lambda picture: picture.reshape(6, 8, 8, 8, 3).mean(axis=(1, 3))  # noqa: E731
    relative = cells(found) / cells(truth) - 1.0
    # Light of coloured walls is spectral in one and RGB in the other; in grey they agree to the noise of 400 samples.
    assert abs(found.mean() / truth.mean() - 1.0) < 0.02
    assert np.sqrt((relative**2).mean()) < 0.03, np.abs(relative).max()
