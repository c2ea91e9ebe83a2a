"""Reading rooms and judging errors; without Mitsuba. `python -m pytest tools/peers`."""

import json
import struct

import numpy as np
import pytest

import gltf
import grey
import places
import room as rooms
import spectra
from drawn import Baked
from metrics import Truth, de2000

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], dtype="<f4")
INDICES = np.array([0, 2, 1, 0, 3, 2], dtype="<u2")


def document():
    """A floor, scaled by two and mirrored at a second node, and a spot."""
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 2]}],
        "nodes": [
            {"mesh": 0, "scale": [2, 2, 2], "children": [1]},
            {"mesh": 0, "translation": [0, 1, 0], "scale": [1, -1, 1]},
            {"rotation": [-np.sqrt(0.5), 0, 0, np.sqrt(0.5)], "translation": [0, 3, 0],
             "extensions": {"KHR_lights_punctual": {"light": 0}}},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{
            "name": "floor", "emissiveFactor": [0, 1, 0], "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 1.2, 1]},
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 10}},
        }],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "spot", "color": [1, 0, 0], "intensity": 7, "name": "spot", "spot": {"outerConeAngle": 0.5}}]}},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength"],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "buffers": [{"byteLength": 60}],
    }


@pytest.fixture
def written(tmp_path):
    def write(changed):
        path = str(tmp_path / "room.glb")
        gltf.write_glb(path, changed, [QUAD.tobytes() + INDICES.tobytes()])
        return path

    return write


def up(part):
    corners = part.corners
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1]


def test_nodes_place_and_turn_what_they_hold(written):
    first, second = rooms.read(written(document())).parts
    assert np.ptp(first.corners[..., 0]) == 2
    assert np.all(second.corners[..., 1] == 2)
    # The mirrored node looks down: glTF turns its triangles so that fronts stay fronts.
    assert np.all(up(first) > 0) and np.all(up(second) < 0)


def test_materials_and_lamps_have_glTFs_units(written):
    room = rooms.read(written(document()))
    assert np.allclose(room.materials[0].emission, [0, 10, 0])
    assert np.allclose(room.materials[0].base_color, [0.2, 0.4, 1.0])
    [lamp] = room.lamps
    assert np.allclose(lamp.intensity, [7, 0, 0]) and np.allclose(lamp.position, [0, 3, 0])
    assert np.allclose(lamp.direction, [0, -1, 0], atol=1e-12)


def test_strips_and_fans():
    indices = np.array([4, 5, 6, 7])
    assert rooms.triangles(5, indices).tolist() == [[4, 5, 6], [5, 7, 6]]
    assert rooms.triangles(6, indices).tolist() == [[5, 6, 4], [6, 7, 4]]
    assert len(rooms.triangles(1, indices)) == 0


def test_triangles_without_area_are_left_out():
    line = np.array([[[0, 0, 0], [1, 1, 1], [3, 3, 3.0]]])
    assert not rooms.has_area(line)[0] and rooms.has_area(line + np.eye(3))[0]


def test_what_cannot_be_read_is_refused(written):
    draco = document() | {"extensionsUsed": ["KHR_draco_mesh_compression"]}
    masked = document()
    masked["materials"][0]["alphaMode"] = "MASK"
    for changed in (draco, masked):
        with pytest.raises(gltf.Unreadable):
            rooms.read(written(changed))


def test_grey_keeps_luminance_and_drops_colour(written, tmp_path):
    changed = document()
    changed["materials"][0]["doubleSided"] = True
    changed["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    changed["materials"][0]["extras"] = {"reflectance": {"name": "cornell/red"}}
    out = str(tmp_path / "grey.glb")
    grey.write_grey(written(changed), out)
    room = rooms.read(out)
    assert room.is_grey()
    floor = room.materials[0]
    assert np.allclose(floor.base_color, 0.5) and floor.two_sided and floor.paint is None and not floor.spectra
    assert np.allclose(floor.emission, 7.151686788) and np.allclose(room.lamps[0].intensity, 7 * 0.2126390059)
    with open(out, "rb") as file:
        data = file.read()
    assert struct.unpack("<I", data[8:12])[0] == len(data)
    assert json.dumps(gltf.chunks(data)[0]).count("Texture") == 0


def test_places_are_on_dark_surfaces_and_free_of_others():
    floor = rooms.Material("floor", np.full(3, 0.5), None, False, np.zeros(3), None)
    lamp = rooms.Material("lamp", np.full(3, 0.5), None, False, np.ones(3), None)
    quad = QUAD.astype(float)[INDICES.reshape(2, 3)]
    # A lid stands a tenth of a millimetre above one half of the floor.
    lid = quad[:1] + [0, 0.0001, 0]
    room = rooms.Room([floor, lamp], [rooms.Part(0, quad), rooms.Part(1, lid)])
    found = places.scattered(room, 400, 7)
    assert np.all(found.normals == [0, 1, 0]) and np.allclose(found.points[:, 1], places.NEAR * places.OFFSET)
    kept = places.free(room, found)
    inside = found.points[:, 0] > found.points[:, 2]
    near_edge = np.abs(found.points[:, 0] - found.points[:, 2]) < 1e-3
    assert np.all((kept == ~inside) | near_edge)


def test_a_distance_is_to_the_nearest_of_plane_edge_and_corner():
    triangle = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]])
    for point, wanted in [((0.2, 0.2, 3), 3), ((0.5, -2, 0), 2), ((-3, -4, 0), 5)]:
        assert np.isclose(places.distance(np.array(point, dtype=float), triangle)[0], wanted)


def test_noise_is_taken_off_and_errors_have_signs():
    random = np.random.default_rng(1)
    true = random.uniform(50, 150, 4000)
    runs = np.stack([true * (1 + 0.08 * random.standard_normal(4000)) for _ in range(16)])
    truth = Truth(np.repeat(runs[..., None], 3, 2))
    assert abs(truth.rms_noise() - 0.02) < 0.001
    errors = truth.errors(np.repeat(0.97 * true[:, None], 3, 1))
    assert abs(errors["rel"] - 3) < 0.2 and abs(errors["bias"] + 3) < 0.1 and abs(errors["median"] + 3) < 0.15


def test_dark_points_do_not_count():
    xyz = np.array([[100.0] * 3, [100.0] * 3, [1.0] * 3])
    truth = Truth([xyz, xyz])
    far = truth.errors(xyz * [[1.0], [1.2], [9.0]])
    assert far["points"] == 2 and far["far"] == 50 and np.isclose(far["bias"], 10)


def test_a_colour_difference_of_the_published_table():
    """G. Sharma, W. Wu, E. Dalal, 2005, pairs 1 and 17, put in as XYZ under white 1."""

    def xyz(l, a, b):
        fy = (l + 16) / 116
        f = np.array([fy + a / 500, fy, fy - b / 200])
        return np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))[None]

    white = np.ones(3)
    assert np.isclose(de2000(xyz(50, 2.6772, -79.7751), xyz(50, 0, -82.7485), white)[0], 2.0425, atol=1e-4)
    assert np.isclose(de2000(xyz(50, 2.5, 0), xyz(73, 25, -18), white)[0], 27.1492, atol=1e-4)
    same = np.full((1, 3), 0.2)
    assert de2000(same, same, white)[0] == 0


def test_upsampled_reflectances_have_their_colour():
    s = spectra.Spectra()
    weights = spectra.KM * s.weights * s.d65
    for rgb in [(0.73, 0.41, 0.78), (0.5, 0, 0), (1, 0.34, 0.13), (0.0002, 0.0001, 0)]:
        found = s.reflectance(rgb)
        assert np.all((found >= 0) & (found <= 1))
        assert np.allclose(np.linalg.solve(s.to_xyz, weights @ found), rgb, atol=1e-5)
    assert np.all(s.reflectance((0.3, 0.3, 0.3)) == 0.3)


def test_a_lamp_has_the_luminance_of_its_colour():
    s = spectra.Spectra()
    for rgb in [(3000, 3000, 3000), (20000, 10000, 3200)]:
        assert np.isclose(s.size(s.lamp(rgb)), s.to_xyz[1] @ rgb, rtol=1e-6)


def test_means_of_a_table():
    ramp = (np.array([380.0, 780.0]), np.array([0.0, 400.0]))
    assert np.allclose(spectra.means(ramp, False), spectra.WIDTH * (np.arange(64) + 0.5))
    short = (np.array([480.0, 580.0]), np.array([2.0, 2.0]))
    assert np.isclose(spectra.means(short, False).sum() * spectra.WIDTH, 200)
    assert np.isclose(spectra.means(short, True).sum() * spectra.WIDTH, 800)
    with pytest.raises(spectra.Unknown):
        spectra.named("cie/nothing")


def test_a_baked_file_is_drawn_between_its_vertices(written):
    # Radiosity that rises along x: at a quarter of the floor, twice as wide as its quad, and seen from below on its mirror image.
    changed = document()
    changed["meshes"][0]["primitives"][0]["attributes"]["_XYZ"] = 0
    light = Baked(written(changed))
    points = np.array([[0.5, 1e-4, 0.7], [0.5, 2 - 1e-4, 1.6]])
    found = light.irradiance(points, np.array([[0, 1, 0], [0, -1, 0]]))
    assert np.allclose(found[:, 0], 2 * 0.25) and np.allclose(found[:, 1], 0)
    assert np.allclose(found[:, 2], 2 * points[:, 2] / 2)


def test_light_of_another_direction_is_not_compared(written):
    changed = document()
    attributes = changed["meshes"][0]["primitives"][0]["attributes"]
    # Normals that lie in the floor.
    attributes["_XYZ"] = attributes["NORMAL"] = 0
    point, up = np.array([[0.5, 1e-4, 0.7]]), np.array([[0, 1, 0]])
    assert np.isnan(Baked(written(changed)).irradiance(point, up)).all()
