"""Light at points equals what the command says, from any kind of numbers."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path

import numpy as np
import pytest

import haarlight


def probed(command, room: Path, points, folder: Path, *options: str) -> list[dict[str, str]]:
    table = folder / "points.csv"
    with table.open("w") as out:
        out.write("x,y,z,nx,ny,nz\n")
        for point in points:
            out.write(",".join(map(repr, point)) + ",0,1,0\n")
    run = [*command, "probe", str(room), "--points", str(table), "-q", *options]
    text = subprocess.run(run, check=False, capture_output=True, text=True)
    assert text.returncode in (0, 1), text.stderr
    return list(csv.DictReader(text.stdout.splitlines()))


def test_values_are_those_of_the_command(command, lit, scenes, grid, tmp_path):
    rows = probed(command, scenes / "cornell.glb", grid, tmp_path)
    lux, xyz, bands, plus_minus = lit.probe(grid, [0, 1, 0])
    assert lux.shape == (9,) and xyz.shape == (9, 3) and bands.shape == (9, 64) and plus_minus.shape == (9,)
    said = np.array([[float(row[key]) for key in ("E_X", "E_Y", "E_Z")] for row in rows])
    # One source, but the command is compiled for the machine at hand: sums may be rounded otherwise.
    np.testing.assert_allclose(xyz, said, rtol=1e-5)
    np.testing.assert_allclose(lux, [float(row["lux"]) for row in rows], rtol=1e-5)
    assert lux.min() > 10
    assert ((plus_minus > 0) & (plus_minus < 0.05 * lux)).all()


def test_bands_of_a_dense_bake_are_those_of_the_command(command, cornell, scenes, grid, tmp_path):
    rows = probed(command, scenes / "cornell.glb", grid, tmp_path, "--bands", "--error", "2")
    names = [name for name in rows[0] if name.startswith("E_") and name[2:3].isdigit()]
    said = np.array([[float(row[name]) for name in names] for row in rows])
    light = cornell.bake(error=2, mesh=False, spectrum="dense")
    bands = light.probe(grid, [0, 1, 0]).bands
    np.testing.assert_allclose(bands, said, rtol=1e-5, atol=1e-12)
    np.testing.assert_array_equal(light.edges[:-1], [float(name[2:]) for name in names])


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64, np.longdouble, np.int64, list, tuple])
def test_points_of_any_kind(lit, kind):
    whole = [[0, 3, 0], [1, 0, -1]]
    numbers = {list: whole, tuple: tuple(map(tuple, whole))}.get(kind)
    points = np.array(whole, dtype=kind) if numbers is None else numbers
    with pytest.warns(haarlight.RoomWarning, match="of 2 points lie"):
        lux = lit.probe(points, (0, 2, 0)).lux
    with pytest.warns(haarlight.RoomWarning):
        np.testing.assert_array_equal(lux, lit.probe(np.array(whole, float), [[0, 1, 0]] * 2).lux)


def test_columns_of_a_larger_array_are_read_as_they_are(lit, grid):
    wide = np.zeros((9, 7), np.float32, order="F")
    wide[:, 1::2] = grid
    np.testing.assert_array_equal(lit.probe(wide[:, 1::2], [0, 1, 0]).lux, lit.probe(np.float32(grid), [0, 1, 0]).lux)


def test_no_points_are_no_light(lit):
    lux, xyz, bands, plus_minus = lit.probe([], [0, 1, 0])
    assert (lux.shape, xyz.shape, bands.shape, plus_minus.shape) == ((0,), (0, 3), (0, 64), (0,))


UP = [0, 1, 0]


@pytest.mark.parametrize(
    ("points", "normals", "place", "what"),
    [
        ([1, 2, 3], UP, "points", r"shape \(3,\), not \(N, 3\); write one point as \[\[x, y, z\]\]"),
        ([[1, 2]], UP, "points", r"shape \(1, 2\), not \(N, 3\)"),
        (np.zeros((2, 2, 3)), UP, "points", r"shape \(2, 2, 3\)"),
        ([[1, 2, 3], [1, 2]], UP, "points", "no array of numbers"),
        ([["a", "b", "c"]], UP, "points", "not numbers"),
        (np.zeros((1, 3), complex), UP, "points", "complex128"),
        ([[1, 2, float("nan")]], UP, "points", "1 rows hold values that are not finite: 0"),
        ([[1, 2, 3]] * 2, [UP] * 3, "normals", "are 3, and there are 2 points"),
        ([[1, 2, 3]] * 5, [0, 0, 0], "normals", r"5 rows have no length: 0, 1, 2 \.\.\."),
        ([[1, 2, 3]], [0, 1], "normals", r"shape \(2,\)"),
        (None, UP, "points", "not numbers"),
    ],
)
def test_wrong_points_are_named(lit, points, normals, place, what):
    with pytest.raises(haarlight.InputError, match=what) as caught:
        lit.probe(points, normals)
    assert isinstance(caught.value, ValueError)
    assert caught.value.problems[0].place == place


def test_places(lit):
    assert lit.places([[0.4, 0.4, 0.1], [9.0, 9.0, 9.0]], UP) == ["room", "outside"]
