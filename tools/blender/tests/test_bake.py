"""Bakes in scenes: light by name and number, relighting, undo, cancel, messages."""

import bpy
import haarlight
import numpy as np
import pytest
import scenes
from haarlight_blender import bake, operators, relight, session, show
from haarlight_blender.export import INDEX
from mathutils import Matrix


def grey_room(unit=1.0, **settings):
    """A grey room with a mirrored box and two instances of another; 20 W from a point and an area lamp."""
    scene = scenes.empty(unit)
    scenes.room(4.0 / unit)
    place = Matrix.Scale(1.0 / unit, 4)
    mesh = scenes.box("box", 0.8, scenes.material("box", (0.6, 0.6, 0.6)))
    mesh.vertices[7].co.x += 0.2
    scenes.add("Mirrored", mesh, place @ scenes.turned((-0.9, 0.7, -1.4), 25, (-1, 1, 1)))
    for name, x in (("One", 1.2), ("Other", -0.3)):
        scenes.add(name, mesh, place @ scenes.turned((x, -0.8, -1.3), 40))
    scenes.lamp("Point", "POINT", 10.0, (0.3 / unit, 0.2 / unit, 1.0 / unit))
    scenes.lamp("Area", "AREA", 10.0, (-0.8 / unit, 0.0, 1.999 / unit), size=0.6 / unit)
    scene.haarlight.error = 1.0
    for name, value in settings.items():
        setattr(scene.haarlight, name, value)
    bpy.context.view_layer.update()
    return scene


def colours(made, name=show.IRRADIANCE):
    out = np.empty(4 * len(made.data.vertices), np.float32)
    made.data.attributes[name].data.foreach_get("color", out)
    return out.reshape(-1, 4)[:, :3]


def luminance(rgb):
    return rgb @ np.array([0.21263901, 0.71516868, 0.07219232])


def by_name(scene):
    return {made["haarlight_name"]: made for made in show.of_scene(scene).objects}


def faces(made):
    """Midpoints of triangles and their normals in the world, and the mean illuminance of their corners."""
    made.data.calc_loop_triangles()
    lux, out = luminance(colours(made)), []
    for triangle in made.data.loop_triangles:
        corners = [made.matrix_world @ made.data.vertices[v].co for v in triangle.vertices]
        normal = (corners[1] - corners[0]).cross(corners[2] - corners[0])
        if made.matrix_world.determinant() < 0.0:
            normal.negate()
        out.append((sum(corners, corners[0] * 0) / 3, normal, np.mean(lux[list(triangle.vertices)])))
    return out


def mean_light(made, name=show.IRRADIANCE):
    """Mean colour over the area of an object; meshes of two bakes have other vertices."""
    made.data.calc_loop_triangles()
    rgb, area = colours(made, name), np.array([t.area for t in made.data.loop_triangles])
    return np.average([rgb[list(t.vertices)].mean(axis=0) for t in made.data.loop_triangles], axis=0, weights=area)


def y_up(vectors):
    return np.array([(v.x, v.z, -v.y) for v in vectors])


def test_the_attribute_equals_probe():
    scene = grey_room()
    assert bpy.ops.haarlight.bake() == {"FINISHED"}
    light = session.baked(show.of_scene(scene), show.KEY).light
    made = by_name(scene)
    assert set(made) == {"Room", "Mirrored", "One", "Other"}
    for name, lit in made.items():
        assert lit["haarlight_of"].name == name and lit[INDEX] >= 0
        places = faces(lit)
        area = np.array([0.5 * normal.length for _, normal, _ in places])
        # Looked at a little before the face: below a box there is a box.
        points = [place + 1e-3 * normal.normalized() for place, normal, _ in places]
        bright = light.places(y_up(points), y_up([n for _, n, _ in places]))
        open_to_room = np.array([b == "room" for b in bright])
        probed = light.probe(y_up(points)[open_to_room], y_up([n for _, n, _ in places])[open_to_room])
        found = np.array([lux for _, _, lux in places])[open_to_room]
        # Straight lines between vertices have an error of their own, as large as the light's (docs/decisions.md).
        error = np.sqrt(np.average((found - probed.lux) ** 2, weights=area[open_to_room]))
        stated = np.sqrt(np.average(probed.plus_minus**2, weights=area[open_to_room]))
        mean = np.average(found, weights=area[open_to_room]) / np.average(probed.lux, weights=area[open_to_room])
        assert abs(mean - 1.0) < 0.03, (name, mean)
        assert error < 3.0 * stated, (name, error, stated)


def test_vertices_inside_faces_equal_probe_within_the_stated_error():
    scene = grey_room()
    bpy.ops.haarlight.bake()
    light = session.baked(show.of_scene(scene), show.KEY).light
    room = by_name(scene)["Room"]
    # Not on the floor, where boxes stand, nor behind the lamp: what something lies upon has the light of its neighbours.
    behind = lambda at: at.z > 1.99 and max(abs(at.x + 0.8), abs(at.y)) < 0.31  # noqa: E731
    inside = [
        v
        for v in room.data.vertices
        if sum(abs(abs(c) - 2.0) < 1e-4 for c in v.co) == 1 and v.co.z > -1.9 and not behind(v.co)
    ]
    assert len(inside) > 20
    normals = []
    for vertex in inside:
        axis = max(range(3), key=lambda k: abs(vertex.co[k]))
        normal = vertex.co * 0.0
        normal[axis] = -np.sign(vertex.co[axis])
        normals.append(normal)
    probed = light.probe(y_up([v.co for v in inside]), y_up(normals))
    found = luminance(colours(room))[[v.index for v in inside]]
    difference = np.sqrt(np.mean((found - probed.lux) ** 2))
    assert difference < np.sqrt(np.mean(probed.plus_minus**2)), difference
    # Radiosity is half of it in a room of grey .5.
    sent = luminance(colours(room, show.RADIOSITY))[[v.index for v in inside]]
    assert sent == pytest.approx(0.5 * found, rel=1e-3)


def test_a_scaled_scene_has_the_same_light():
    scene = grey_room()
    bpy.ops.haarlight.bake()
    metres = {name: luminance(mean_light(made)) for name, made in by_name(scene).items()}
    scene = grey_room(unit=0.01)
    bpy.ops.haarlight.bake()
    made = by_name(scene)
    assert {name: luminance(mean_light(m)) for name, m in made.items()} == pytest.approx(metres, rel=0.01)
    assert max(v.co.z for v in made["Room"].data.vertices) == pytest.approx(200.0, rel=1e-5)


def test_light_maps_equal_probe():
    scene = grey_room(medium="MAPS", error=0.5)
    assert bpy.ops.haarlight.bake() == {"FINISHED"}
    lit = session.baked(show.of_scene(scene), show.KEY)
    image = bpy.data.images[[name for name in bpy.data.images.keys() if "map-0" in name][0]]
    width, height = image.size
    texels = np.array(image.pixels[:], np.float32).reshape(height, width, 4)[..., :3]
    made = by_name(scene)
    assert set(made) == {"Room", "Mirrored", "One", "Other"}
    for name in ("Room", "Mirrored"):
        mesh = made[name].data
        mesh.calc_loop_triangles()
        layer = mesh.uv_layers[show.MAP].data
        points, normals, found = [], [], []
        for triangle in mesh.loop_triangles:
            corners = [made[name].matrix_world @ mesh.vertices[v].co for v in triangle.vertices]
            normal = (corners[1] - corners[0]).cross(corners[2] - corners[0])
            if made[name].matrix_world.determinant() < 0.0:
                normal.negate()
            middle = sum(corners, corners[0] * 0) / 3
            u, v = sum((np.array(layer[k].uv) for k in triangle.loops), np.zeros(2)) / 3
            x, y = u * width - 0.5, v * height - 0.5
            i, j = int(x), int(y)
            a, b = x - i, y - j
            cells = texels[j : j + 2, i : i + 2]
            found.append(
                luminance((1 - b) * ((1 - a) * cells[0, 0] + a * cells[0, 1]) + b * ((1 - a) * cells[1, 0] + a * cells[1, 1]))
            )
            points.append(middle + 1e-3 * normal.normalized())
            normals.append(normal)
        room = np.array([p == "room" for p in lit.light.places(y_up(points), y_up(normals))])
        lux = lit.light.probe(y_up(points)[room], y_up(normals)[room]).lux
        found = np.array(found)[room] * lit.pages.lux_per_unit
        # A share of the mean: one place of the floor is in the gap below a box, where it is dark.
        assert np.sqrt(np.mean((found - lux) ** 2)) < 0.03 * lux.mean(), name
        assert found.mean() == pytest.approx(lux.mean(), rel=0.02), name


def test_relighting_equals_a_fresh_bake():
    scene = grey_room(error=0.5)
    bpy.ops.haarlight.bake()
    before = {name: mean_light(made) for name, made in by_name(scene).items()}
    meshes = {name: made.data for name, made in by_name(scene).items()}
    bpy.data.lights["Point"].energy = 30.0
    bpy.data.lights["Area"].color = (1.0, 0.5, 0.25)
    assert bpy.ops.haarlight.relight() == {"FINISHED"}
    relit = {name: mean_light(made) for name, made in by_name(scene).items()}
    assert {name: made.data for name, made in by_name(scene).items()} == meshes
    assert relit["Room"].mean() > 1.5 * before["Room"].mean()
    bpy.ops.haarlight.bake()
    light = session.baked(show.of_scene(scene), show.KEY).light
    for name, made in by_name(scene).items():
        assert relit[name] == pytest.approx(mean_light(made), rel=0.02), name
    assert light.verdict == "reached"


def test_a_change_of_a_lamp_asks_for_relighting():
    scene = grey_room(error=2.0)
    bpy.ops.haarlight.bake()
    bpy.data.lights["Point"].energy = 11.0
    bpy.context.view_layer.update()
    assert not bpy.app.timers.is_registered(relight.now), "switched off"
    scene.haarlight.live = True
    scene.objects["Mirrored"].location.z += 0.0
    bpy.context.view_layer.update()
    assert not bpy.app.timers.is_registered(relight.now), "no lamp changed"
    before = colours(by_name(scene)["Room"]).mean()
    bpy.data.lights["Point"].energy = 20.0
    bpy.context.view_layer.update()
    assert bpy.app.timers.is_registered(relight.now)
    bpy.app.timers.unregister(relight.now)
    assert relight.now() is None
    assert colours(by_name(scene)["Room"]).mean() > 1.3 * before
    bpy.context.view_layer.update()
    assert not bpy.app.timers.is_registered(relight.now), "relighting is no change"


def test_what_was_selected_is_relit_and_instances_are_hidden():
    scene = grey_room(error=2.0, selected=True)
    held = bpy.data.collections.new("held")
    held.objects.link(bpy.data.objects.new("chair", scenes.box("chair", 0.3, scenes.material("m"))))
    place = scenes.add("place", None, Matrix.Translation((-1.0, -1.0, -1.0)))
    place.instance_type, place.instance_collection = "COLLECTION", held
    for made in scene.objects:
        made.select_set(made.name not in ("One", "Area"))
    bpy.context.view_layer.update()
    bpy.ops.haarlight.bake()
    assert set(by_name(scene)) == {"Room", "Mirrored", "Other", "place/chair"}
    assert by_name(scene)["place/chair"]["haarlight_of"].name == "chair"
    assert place.hide_get() and not scene.objects["One"].hide_get()
    before = mean_light(by_name(scene)["Room"])
    scene.objects["Mirrored"].select_set(False)
    bpy.data.lights["Point"].energy = 20.0
    bpy.data.lights["Area"].energy = 1000.0
    assert bpy.ops.haarlight.relight() == {"FINISHED"}
    assert mean_light(by_name(scene)["Room"]) == pytest.approx(2.0 * before, rel=0.01)
    show.clear(bpy.context)
    assert not place.hide_get()


def test_relighting_says_why_it_cannot():
    scene = grey_room(error=2.0)
    assert not bpy.ops.haarlight.relight.poll()
    bpy.ops.haarlight.bake()
    scene.objects["One"].location.x += 0.1
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="haarlight: .*another shape .*'One'.*; bake again$"):
        bpy.ops.haarlight.relight()


def test_lamps_are_turned_off_and_on_again():
    scene = grey_room(error=1.0)
    scene.objects["Area"].data.energy = 0.0
    bpy.ops.haarlight.bake()
    assert {p.name for p in session.baked(show.of_scene(scene), show.KEY).exported.pieces if p.kind != "mesh"} == {"Point"}
    scene.objects["Area"].data.energy = 10.0
    # Its shadows are not known.
    with pytest.raises(RuntimeError, match="'Area'.*; bake again"):
        bpy.ops.haarlight.relight()
    bpy.ops.haarlight.bake()
    both = mean_light(by_name(scene)["Room"])
    shares = []
    for off, on in (("Area", "Point"), ("Point", "Area")):
        bpy.data.lights[off].energy, bpy.data.lights[on].energy = 0.0, 10.0
        assert bpy.ops.haarlight.relight() == {"FINISHED"}
        shares.append(mean_light(by_name(scene)["Room"]))
    assert sum(shares) == pytest.approx(both, rel=0.01) and min(share.min() for share in shares) > 1.0
    bpy.data.lights["Area"].energy = 0.0
    assert bpy.ops.haarlight.relight() == {"FINISHED"}
    assert mean_light(by_name(scene)["Room"]).max() < 1e-6


def test_originals_are_untouched_and_come_back():
    scene = grey_room(error=2.0)
    scene.objects["Other"].modifiers.new("bevel", "BEVEL")
    bpy.context.view_layer.update()

    def state():
        mine = [o for o in scene.objects if INDEX not in o]
        return {
            o.name: (
                o.data.as_pointer(),
                [tuple(v.co) for v in o.data.vertices] if o.type == "MESH" else None,
                [tuple(row) for row in o.matrix_world],
                [m.name for m in o.modifiers],
                [a.name for a in o.data.attributes] if o.type == "MESH" else None,
                o.hide_get(),
                o.hide_render,
                list(o.keys()),
            )
            for o in mine
        }

    before = state()
    bpy.ops.haarlight.bake()
    assert scene.objects["One"].hide_get() and scene.objects["One"].hide_render
    assert bpy.ops.haarlight.originals() == {"FINISHED"}
    assert state() == before
    assert by_name(scene)["One"].hide_get()
    bpy.ops.haarlight.originals()
    assert scene.objects["One"].hide_get() and not by_name(scene)["One"].hide_get()
    # Hidden originals are baked again all the same.
    bpy.ops.haarlight.bake()
    assert set(by_name(scene)) == {"Room", "Mirrored", "One", "Other"}
    assert len([c for c in scene.collection.children if show.KEY in c]) == 1
    show.clear(bpy.context)
    assert state() == before
    assert not [m for m in bpy.data.materials if m.name.endswith(" lit")]
    assert not [m for m in bpy.data.meshes if m.name.endswith(" lit")]


def test_a_bake_is_one_step_of_undo():
    grey_room(error=2.0)
    bpy.ops.ed.undo_push(message="before")
    names = sorted(bpy.data.objects.keys())
    # Without a window Blender pushes no step by itself for operators called from a script.
    bpy.ops.haarlight.bake()
    bpy.ops.ed.undo_push(message="bake")
    assert sorted(bpy.data.objects.keys()) != names
    bpy.ops.ed.undo()
    assert sorted(bpy.data.objects.keys()) == names
    assert show.of_scene(bpy.context.scene) is None and not bpy.data.objects["Room"].hide_get()
    bpy.ops.ed.redo()
    scene = bpy.context.scene
    assert set(by_name(scene)) == {"Room", "Mirrored", "One", "Other"}
    bpy.data.lights["Point"].energy = 20.0
    assert bpy.ops.haarlight.relight() == {"FINISHED"}, "the bake is still known"
    assert "UNDO" in operators.HAARLIGHT_OT_bake.bl_options


def test_a_bake_that_is_stopped_is_whole():
    scene = grey_room(error=0.05)
    room = operators.exported(bpy.context, None, 683.0)
    job = bake.Job(room, operators.wanted(scene.haarlight, room))
    job.begin()
    while job.running and not job.text.startswith("round"):
        pass
    job.stop.set()
    job._thread.join(60.0)
    assert not job.running and job.problem is None
    assert job.lit.light.verdict == "interrupted"
    assert "whole" in job.lit.summary()
    assert 0.0 <= job.share <= 1.0
    collection = show.show(bpy.context, job.lit, hide=True)
    assert all(np.isfinite(colours(made)).all() and colours(made).mean() > 1.0 for made in collection.objects)
    bake.remove(room.path.parent)


def test_time_bounds_a_bake():
    scene = grey_room(error=0.05, bound_time=True, time=1.0)
    bpy.ops.haarlight.bake()
    assert session.baked(show.of_scene(scene), show.KEY).light.verdict in ("out_of_time", "exhausted")


@pytest.mark.parametrize("medium", ["VERTICES", "MAPS"])
def test_colours_of_vertices_are_paint(medium):
    scene = grey_room(medium=medium)
    mesh = scenes.plane("sheet", 1.0, scenes.material("painted"))
    colours_of = mesh.color_attributes.new("Paint", "FLOAT_COLOR", "POINT")
    for k, value in enumerate(colours_of.data):
        value.color = (0.8, 0.8, 0.8, 1.0) if k in (0, 3) else (0.1, 0.1, 0.1, 1.0)
    mesh.color_attributes.active_color = colours_of
    tree = mesh.materials[0].node_tree
    node = tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = "Paint"
    tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    scenes.add("Sheet", mesh, Matrix.Translation((0.2, 0.9, -1.0)))
    bpy.context.view_layer.update()
    assert bpy.ops.haarlight.bake() == {"FINISHED"}
    sheet = by_name(scene)["Sheet"]
    left = np.array([v.co.x for v in sheet.data.vertices]) < -0.49
    if medium == "VERTICES":
        found = luminance(colours(sheet, show.RADIOSITY)) / luminance(colours(sheet))
    else:
        found = luminance(colours(sheet, "Paint"))
    assert found[left] == pytest.approx(0.8, rel=0.02) and found[~left].min() == pytest.approx(0.1, rel=0.02)
    kinds = {node.type for node in sheet.data.materials[0].node_tree.nodes}
    assert "GROUP" in kinds


def test_what_is_wrong_is_said_in_words_of_the_scene():
    scene = grey_room()
    for name in ("Point", "Area"):
        bpy.data.objects.remove(scene.objects[name])
    with pytest.raises(RuntimeError, match="there is no lamp.*; add a lamp, give a material an emission strength"):
        bpy.ops.haarlight.bake()
    assert show.of_scene(scene) is None and not scene.objects["One"].hide_get()
    scenes.empty()
    with pytest.raises(RuntimeError, match="no surface can be seen"):
        bpy.ops.haarlight.bake()


def test_spectra_go_by_name(tmp_path):
    scene = grey_room(error=2.0)
    bpy.data.materials["wall"].haarlight.reflectance = "macbeth/white"
    bpy.data.lights["Point"].haarlight.spectrum = "cie/F2"
    bpy.data.lights["Area"].haarlight.spectrum = "cie/A"
    bpy.ops.haarlight.bake()
    lit = session.baked(show.of_scene(scene), show.KEY)
    assert lit.wanted.spectra["materials"]["wall"] == {"reflectance": {"name": "macbeth/white"}}
    found = {lamp["name"]: lamp for lamp in lit.light.room.facts["lights"]}
    assert "cie/F2" in found["Point"]["spectrum"] and "cie/A" in found["Area"]["spectrum"]
    assert found["Area"]["flux_lm"] == pytest.approx(6830.0, rel=1e-4), "its power stays"
    # A file, with a table beside it, and what was chosen laid over it.
    (tmp_path / "grey.csv").write_text("380,.2\n780,.2\n")
    (tmp_path / "s.json").write_text('{"materials": {"box": {"reflectance": {"csv": "grey.csv"}}, "wall": {}}}')
    scene.haarlight.spectra = str(tmp_path / "s.json")
    bpy.ops.haarlight.bake()
    box = by_name(scene)["One"]
    e, m = luminance(colours(box)), luminance(colours(box, show.RADIOSITY))
    assert m[e > 1.0] == pytest.approx(0.2 * e[e > 1.0], rel=1e-3)
    scene.haarlight.medium = "MAPS"
    bpy.ops.haarlight.bake()
    told = session.baked(show.of_scene(scene), show.KEY).warnings
    assert any("'wall'" in text and "shown in Blender's colour" in text for text in told)
    bpy.data.materials["wall"].haarlight.reflectance = "macbeth/wite"
    with pytest.raises(RuntimeError, match=r"(?s)haarlight: .*wall.*macbeth/wite.*macbeth/white"):
        bpy.ops.haarlight.bake()
    scene.haarlight.spectra = str(tmp_path / "none.json")
    with pytest.raises(RuntimeError, match="none.json: cannot be read"):
        bpy.ops.haarlight.bake()


def test_names_can_be_searched():
    from haarlight_blender import spectra

    assert "cie/F2" in spectra.search("light")(None, None, "f2")
    assert "macbeth/white" in spectra.search("reflectance")(None, None, "white")
    assert not set(spectra.names("light")) & set(spectra.names("reflectance"))
    assert set(spectra.names("light")) <= set(haarlight.spectra())
