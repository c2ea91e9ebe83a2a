"""Mitsuba's side against closed forms; skipped where Mitsuba is not installed."""

import numpy as np
import pytest

import peer
import places
import room as rooms

pytest.importorskip("mitsuba")

FLOOR = np.array([[[-5, 0, -5], [5, 0, 5], [5, 0, -5]], [[-5, 0, -5], [-5, 0, 5], [5, 0, 5]]], dtype=float)
CORNERS = np.array([[[0, 0], [1, 1], [1, 0]], [[0, 0], [0, 1], [1, 1]]], dtype=float)  # u along x, v along z


def material(emission=(0, 0, 0), picture=None):
    return rooms.Material("m", np.zeros(3), None, False, np.array(emission, dtype=float), picture)


def measured(room, points):
    points = np.array(points, dtype=float)
    on = places.Places(points, np.tile([0, 1.0, 0], (len(points), 1)), None)
    renderer = peer.Peer(room, "no such room.glb")
    return renderer, renderer.irradiance(on, 1 << 16, 1)


def by_hand(lamp, point):
    """Illuminance on a floor for an intensity of 1, by KHR_lights_punctual."""
    if lamp.kind == "directional":
        return -lamp.direction[1]
    to = lamp.position - point
    far = np.linalg.norm(to)
    share = 1.0
    if lamp.kind == "spot":
        inner, outer = np.cos(lamp.inner), np.cos(lamp.outer)
        share = np.clip((-(to / far) @ lamp.direction - outer) / (inner - outer), 0, 1) ** 2
    return share * to[1] / far**3


@pytest.mark.parametrize("color", [(1, 1, 1), (1, 0.5, 0.2)])
def test_lamps_without_extent_have_glTFs_units_and_fall_off(color):
    color = np.array(color, dtype=float)
    down = np.array([0.2, -0.9, 0.1]) / np.linalg.norm([0.2, -0.9, 0.1])
    points = [[0, 1e-3, 0], [0.6, 1e-3, 0.2], [1, 1e-3, -0.3], [1.3, 1e-3, 0.3]]
    lamps = [
        rooms.Lamp("spot", "spot", np.array([0.3, 2, 0.1]), down, 100 * color, 0.3, 0.6),
        rooms.Lamp("sun", "directional", np.zeros(3), np.array([0.6, -0.8, 0]), 7 * color),
        rooms.Lamp("point", "point", np.array([0, 1.0, 0]), np.array([0, 0, -1.0]), 10 * color),
    ]
    renderer, found = measured(rooms.Room([material()], [rooms.Part(0, FLOOR)], lamps), points)
    assert renderer.kind == ("mono" if np.ptp(color) == 0 else "spectral")
    luminous = [lamp.intensity @ renderer.spectra.to_xyz[1] for lamp in lamps]
    wanted = [sum(size * by_hand(lamp, np.array(p)) for size, lamp in zip(luminous, lamps)) for p in points]
    assert np.allclose(found[:, 1], wanted, rtol=2e-3)


def test_pictures_begin_at_the_top_left():
    pixels = np.zeros((2, 2, 4))
    pixels[0, 0, :3], pixels[0, 1, :3], pixels[1, 0, :3] = [1, 0, 0], [0, 1, 0], [0, 0, 1]
    picture = rooms.Texture(pixels, ("clamp", "clamp"))
    # A shining sheet a little above the floor, its front down.
    sheet = rooms.Part(1, FLOOR[:, ::-1] + [0, 0.05, 0], None, CORNERS[:, ::-1])
    room = rooms.Room([material(), material((1, 1, 1), picture)], [rooms.Part(0, FLOOR), sheet])
    renderer, found = measured(room, [[-3, 1e-3, -3], [3, 1e-3, -3], [-3, 1e-3, 3], [3, 1e-3, 3]])
    colors = np.linalg.solve(renderer.spectra.to_xyz, found.T).T / np.pi
    assert renderer.kind == "rgb"
    assert np.allclose(colors, [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]], atol=0.01)


def test_a_sheet_shines_from_both_sides_only_where_it_is_two_sided():
    for both in (False, True):
        lamp = material((1, 1, 1))
        lamp.two_sided = both
        # Its front is up, away from the floor.
        room = rooms.Room([material(), lamp], [rooms.Part(0, FLOOR), rooms.Part(1, FLOOR + [0, 0.05, 0])])
        _, found = measured(room, [[0, 1e-3, 0]])
        assert np.isclose(found[0, 1], np.pi if both else 0, rtol=0.01)


@pytest.mark.parametrize("moved", [(0, 0, 0), (100, 0, -100)])
def test_rays_of_a_place_begin_there_wherever_the_room_lies(moved):
    # The lamp's light passes .2 mm below a plate 17 mm above the floor; from half a millimetre higher it would not.
    plate = FLOOR[:, ::-1] * [0.2, 1, 0.2] + [0, 0.017, 0]
    lamp = rooms.Lamp("lamp", "point", np.array([5, 0.08, 0]) + moved, np.array([0, 0, -1.0]), np.ones(3))
    room = rooms.Room([material()], [rooms.Part(0, FLOOR + moved), rooms.Part(0, plate + moved)], [lamp])
    place = np.array([0, 1e-3, 0]) + moved
    renderer, found = measured(room, [place])
    assert np.isclose(found[0, 1], by_hand(lamp, place) * renderer.spectra.to_xyz[1].sum(), rtol=2e-3)
