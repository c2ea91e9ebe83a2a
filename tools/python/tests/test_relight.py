"""The same room under other lamps."""

from __future__ import annotations

import gc
import tempfile
from pathlib import Path

import numpy as np
import pytest

import haarlight

UP = [0, 1, 0]


@pytest.fixture(scope="module")
def lamp(cornell) -> str:
    return cornell.facts["lights"][0]["name"]


@pytest.mark.parametrize("factor", [0.25, 3.0])
def test_a_lamp_scaled_scales_the_light(lit, grid, lamp, factor):
    other = lit.relight({lamp: factor})
    np.testing.assert_allclose(other.xyz, factor * lit.xyz, rtol=2e-3, atol=1e-3)
    np.testing.assert_allclose(other.spectra(), factor * lit.spectra(), rtol=2e-3, atol=1e-6)
    before, after = lit.probe(grid, UP), other.probe(grid, UP)
    np.testing.assert_allclose(after.xyz, factor * before.xyz, rtol=2e-3)
    np.testing.assert_allclose(after.plus_minus / after.lux, before.plus_minus / before.lux, rtol=0.1)
    assert other.relit["changed"] and lit.relit is None
    assert other.room.facts["lights"][0]["flux_lm"] == pytest.approx(factor * lit.room.facts["lights"][0]["flux_lm"])


def test_factors_are_of_the_light_at_hand(lit, lamp):
    once = lit.relight({lamp: 0.5})
    np.testing.assert_allclose(once.relight({lamp: 2.0}).xyz, lit.xyz, rtol=2e-3, atol=1e-3)


def test_a_lamp_that_goes_out_leaves_the_dark(lit, grid, lamp):
    dark = lit.relight({lamp: 0})
    assert not dark.xyz.any() and not dark.probe(grid, UP).lux.any()


def test_other_spectra_are_those_of_a_bake(lit, scenes, grid, lamp):
    words = {"emission": {"name": "cie/F7", "luminance_cd_m2": 2000}}
    other = lit.relight({lamp: words}).relight({lamp: 0.5})
    baked = haarlight.load(scenes / "cornell.glb", {"materials": {lamp: words}}).bake(error=0.5, mesh=False)
    xyz = baked.probe(grid, UP).xyz
    np.testing.assert_allclose(2 * other.probe(grid, UP).xyz, xyz, rtol=0.02)
    blue = [light[:, 2] / light[:, 1] for light in (xyz, lit.probe(grid, UP).xyz)]
    assert (blue[0] > 1.5 * blue[1]).all()


def test_a_room_of_the_same_shape_may_be_given(lit, scenes, grid, lamp):
    warm = {"materials": {lamp: {"emission": {"name": "cie/A", "luminance_cd_m2": 2000}}}}
    room = haarlight.load(scenes / "cornell.glb", warm)
    by_room = lit.relight(room).probe(grid, UP).xyz
    by_words = lit.relight({lamp: warm["materials"][lamp]}).probe(grid, UP).xyz
    np.testing.assert_array_equal(by_room, by_words)
    with pytest.raises(haarlight.InputError, match="another shape"):
        lit.relight(haarlight.load(scenes / "convex.glb"))


def test_probes_alone_can_be_relit(cornell, grid, lamp):
    light = cornell.bake(error=1, mesh=False)
    half = light.relight({lamp: 0.5}).probe(grid, UP).lux
    np.testing.assert_allclose(half, 0.5 * light.probe(grid, UP).lux, rtol=2e-3)


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"no lamp": 0.5}, "no lamp of that name; the nearest names are"),
        ({"no lamp": {"name": "cie/A"}}, "no light of that name"),
        (7, "is no dictionary and no room"),
        ({7: 0.5}, "7 is no name"),
        ({"a": "b"}, "relight 'a': is no number and no dictionary"),
    ],
)
def test_wrong_changes_are_named(lit, changes, what):
    with pytest.raises(haarlight.InputError, match=what):
        lit.relight(changes)


@pytest.mark.parametrize("factor", [-1, float("nan"), float("inf"), 1e300])
def test_factors_that_are_none_are_refused(lit, lamp, factor):
    with pytest.raises(haarlight.InputError, match="times as bright"):
        lit.relight({lamp: factor})


def test_what_was_not_kept_is_said(cornell, lamp, lit):
    with pytest.raises(haarlight.InputError, match="bake with keep=True"):
        cornell.bake(error=2, mesh=False, keep=False).relight({lamp: 0.5})
    with pytest.raises(haarlight.InputError, match="result.room.bake"):
        lit.relight({lamp: 0.5}).audit(10)


def test_a_relit_room_is_saved(lit, lamp, tmp_path):
    lit.relight({lamp: 0.5}).save(tmp_path / "half.glb")
    assert (tmp_path / "half.glb").stat().st_size > 10_000


def test_no_cache_is_left_behind(cornell, lamp):
    before = set(Path(tempfile.gettempdir()).glob("haarlight-*.cache"))
    light = cornell.bake(error=2, mesh=False)
    light.relight({lamp: 0.5})
    assert set(Path(tempfile.gettempdir()).glob("haarlight-*.cache")) > before
    del light
    gc.collect()
    assert set(Path(tempfile.gettempdir()).glob("haarlight-*.cache")) <= before
