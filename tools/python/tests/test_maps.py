"""Light maps of a bake."""

from __future__ import annotations

import json
import threading

import pytest

import haarlight


@pytest.fixture(scope="module")
def solved(cornell) -> haarlight.Result:
    return cornell.bake(error=1.0, mesh=False)


def test_maps_are_written_with_their_index(solved, tmp_path):
    heard = []
    written = solved.save_maps(tmp_path / "lit.glb", size=256, on_progress=lambda done, of: heard.append((done, of)))
    index = json.loads((tmp_path / "lit.maps.json").read_text())
    assert index["quantity"] == "irradiance" and index["meshes"]
    assert {entry["node"] for entry in index["meshes"]} == {surface["node"] for surface in solved.room.surfaces}
    for page in index["pages"]:
        assert max(page["width"], page["height"]) <= 256
        assert (tmp_path / page["exr"]).read_bytes()[:4] == bytes.fromhex("762f3101")
    assert {str(tmp_path / page["exr"]) for page in index["pages"]} < set(written["files"])
    assert 0.0 < written["error"] < 2.0
    assert heard and all(0 <= done <= of for done, of in heard)
    assert (tmp_path / "lit.glb").read_bytes()[:4] == b"glTF"


def test_indirect_light_is_less(solved, tmp_path):
    solved.save_maps(tmp_path / "a.glb", texels=500, indirect=True)
    assert json.loads((tmp_path / "a.maps.json").read_text())["quantity"] == "indirect irradiance"


def test_an_event_ends_the_gather(solved, tmp_path):
    stop = threading.Event()
    stop.set()
    assert solved.save_maps(tmp_path / "a.glb", stop=stop)["files"]


def test_what_cannot_be_is_refused(solved, lit, tmp_path):
    with pytest.raises(haarlight.InputError, match="64 to 16384 texels"):
        solved.save_maps(tmp_path / "a.glb", size=63)
    with pytest.raises(haarlight.InputError, match="end it in .glb"):
        solved.save_maps(tmp_path / "a.npz")
    with pytest.raises(haarlight.InputError, match="at vertices only"):
        lit.relight({lit.room.facts["lights"][0]["name"]: 0.5}).save_maps(tmp_path / "a.glb")
    with pytest.raises(haarlight.InputError):
        solved.save_maps(solved.room.path)
