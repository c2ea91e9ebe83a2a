"""Rooms and spectra: what is read, what is refused and where, what is written."""

from __future__ import annotations

import json
import pickle
import struct

import numpy as np
import pytest

import haarlight
from haarlight import _native


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(haarlight.MissingFileError, match="nowhere.glb") as caught:
        haarlight.load(tmp_path / "nowhere.glb")
    assert isinstance(caught.value, FileNotFoundError)
    assert caught.value.filename == caught.value.file == str(tmp_path / "nowhere.glb")


def test_what_is_no_room_is_refused(tmp_path):
    (tmp_path / "room.glb").write_bytes(b"glass")
    with pytest.raises(haarlight.InputError) as caught:
        haarlight.load(tmp_path / "room.glb")
    assert caught.value.file == str(tmp_path / "room.glb")


def document(path):
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + length]), data[20 + length :]


def written(path, json_part, rest):
    text = json.dumps(json_part).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunk) + len(rest)) + chunk + rest)


def test_problems_name_file_node_and_material(scenes, tmp_path):
    room, rest = document(scenes / "cornell.glb")
    room["nodes"][1]["children"] = [99]
    written(tmp_path / "room.glb", room, rest)
    with pytest.raises(haarlight.InputError) as caught:
        haarlight.load(tmp_path / "room.glb")
    error = caught.value
    assert error.file == str(tmp_path / "room.glb")
    assert error.node.index == 1 and error.node.name == room["nodes"][1]["name"]
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)

    with pytest.raises(haarlight.InputError, match="the nearest names are") as caught:
        haarlight.load(scenes / "cornell.glb", {"materials": {"wall": {"reflectance": {"name": "macbeth/whit"}}}})
    assert "wall" in {problem.material.name for problem in caught.value.problems}


def test_all_problems_come_together(scenes):
    said = {"materials": {"nobody": {}}, "lights": {"nothing": {"name": "cie/A"}}}
    with pytest.raises(haarlight.InputError, match="2 problems") as caught:
        haarlight.load(scenes / "cornell.glb", said)
    assert [problem.what for problem in caught.value.problems] == [
        "the room has no material of that name",
        "the room has no light of that name",
    ]
    with pytest.warns(haarlight.RoomWarning) as warned:
        haarlight.load(scenes / "cornell.glb", said, lenient=True)
    assert any("no material of that name" in str(warning.message) for warning in warned)


def test_spectra_come_as_names_rows_and_arrays(scenes, grid):
    white = haarlight.spectra("macbeth/white")["macbeth/white"]
    floor = next(m["name"] for m in haarlight.load(scenes / "cornell.glb").facts["materials"] if m["area_m2"] > 0.5)

    def light(reflectance):
        room = haarlight.load(scenes / "cornell.glb", {"materials": {floor: {"reflectance": reflectance}}})
        return room.bake(error=2, mesh=False).probe(grid, [0, 1, 0]).xyz

    named = light({"name": "macbeth/white"})
    np.testing.assert_array_equal(light(white), named)
    np.testing.assert_array_equal(light({"wavelengths": white.wavelengths, "values": list(white.values)}), named)
    assert not np.allclose(light({"wavelengths": [400, 700], "values": [0.1, 0.1]}), named, rtol=0.05)


@pytest.mark.parametrize(
    ("said", "what"),
    [
        ({"materials": {"white": {"reflectance": {"wavelengths": [400, 500], "values": [1]}}}}, "no pair of rows"),
        ({"materials": {"white": {"reflectance": {"wavelengths": [500, 400], "values": [1, 1]}}}}, "must increase"),
        ({"materials": {"white": object()}}, "not JSON serializable"),
        ({"sky": float("nan")}, "not JSON compliant"),
        ({"materials": 7}, "is not a JSON object"),
    ],
)
def test_spectra_that_are_none_are_refused(scenes, said, what):
    with pytest.raises(haarlight.InputError, match=what):
        haarlight.load(scenes / "cornell.glb", said)


def test_a_file_of_spectra_that_is_missing_is_named(scenes, tmp_path):
    with pytest.raises(haarlight.InputError, match="nowhere.json"):
        haarlight.load(scenes / "cornell.glb", spectra=tmp_path / "nowhere.json")


def test_a_sky_is_a_word_or_a_dictionary(scenes):
    word = haarlight.load(scenes / "cornell.glb", sky="overcast")
    room = haarlight.load(scenes / "cornell.glb", sky={"type": "overcast", "illuminance_lx": 5000})
    sky = [light for light in room.facts["lights"] if light["kind"] == "sky"]
    assert sky[0]["illuminance_lx"] == pytest.approx(5000)
    assert {"sky", "ground"} <= {light["kind"] for light in word.facts["lights"]}
    with pytest.raises(haarlight.InputError, match="a sky is overcast"):
        haarlight.load(scenes / "cornell.glb", sky="blue")


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ({"range": (780, 380)}, "range: wavelengths lie in 300..830 nm"),
        ({"scale": 0}, "scale: is not a number above zero"),
    ],
)
def test_wrong_wishes_are_named(scenes, arguments, what):
    with pytest.raises(haarlight.InputError, match=what):
        haarlight.load(scenes / "cornell.glb", **arguments)


def test_spectra_by_name():
    found = haarlight.spectra("cie/F2")
    kind, wavelengths, values = found["cie/F2"]
    assert kind == "light" and wavelengths.shape == values.shape
    assert len(haarlight.spectra()) > 50
    assert list(haarlight.spectra("blackbody/2701")) == ["blackbody/2701"]
    assert {spectrum.kind for spectrum in haarlight.spectra("macbeth").values()} == {"reflectance"}
    with pytest.raises(haarlight.InputError, match="the nearest names are"):
        haarlight.spectra("cie/F99")


def test_what_is_saved_is_what_load_reads(lit, tmp_path):
    lit.save(tmp_path / "lit.glb", xyz=True)
    with pytest.warns(haarlight.RoomWarning):
        again = haarlight.load(tmp_path / "lit.glb")
    assert again.facts["triangles"] == len(lit.triangles)
    assert again.facts["area_m2"] == pytest.approx(lit.room.facts["area_m2"], rel=1e-3)
    lit.save(tmp_path / "lit.npz")
    arrays = np.load(tmp_path / "lit.npz")
    np.testing.assert_array_equal(arrays["positions"], lit.positions)
    np.testing.assert_array_equal(arrays["xyz"], lit.xyz)
    np.testing.assert_array_equal(arrays["radiosity"], lit.spectra())
    np.testing.assert_array_equal(arrays["triangles"], lit.triangles)


def test_a_room_is_never_overwritten(lit, scenes, tmp_path):
    with pytest.raises(haarlight.InputError, match="overwrite the room"):
        lit.save(scenes / "cornell.glb")
    with pytest.raises(haarlight.InputError, match="not the name of a .glb"):
        lit.save(tmp_path / "room.obj")
    with pytest.raises(haarlight.FileError):
        lit.save(tmp_path / "nowhere" / "room.glb")
    for wish in ({"exposure": "bright"}, {"white_balance": 5}, {"compress": "zip"}):
        with pytest.raises(haarlight.InputError, match=next(iter(wish))):
            lit.save(tmp_path / "room.glb", **wish)


def test_a_fault_is_an_exception():
    with pytest.raises(haarlight.InternalError, match="internal fault: on purpose; please report it"):
        _native._panic("on purpose")
    assert issubclass(haarlight.InternalError, haarlight.Error)
