"""The .zip of the extension, and its manifest. Needs no Blender."""

import ast
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import build  # noqa: E402

NAMES = [
    "haarlight-0.1.0-cp311-abi3-manylinux_2_35_x86_64.whl",
    "haarlight-0.1.0-cp311-abi3-macosx_11_0_arm64.whl",
    "haarlight-0.1.0-cp311-abi3-win_amd64.whl",
]


@pytest.fixture
def wheels(tmp_path):
    made = [tmp_path / name for name in NAMES]
    for wheel in made:
        wheel.write_bytes(b"a wheel")
    return made


def test_the_zip_holds_all_and_its_manifest_lists_the_wheels(wheels, tmp_path):
    path = build.pack(wheels, tmp_path / "out")
    first = path.read_bytes()
    assert build.pack(wheels[::-1], tmp_path / "out").read_bytes() == first, "the same bytes each time"
    with zipfile.ZipFile(path) as made:
        names = set(made.namelist())
        manifest = tomllib.loads(made.read("blender_manifest.toml").decode())
    assert {"__init__.py", "panel.py", "LICENSE-MIT"} <= names and not [n for n in names if "test" in n]
    assert {f"./{name}" for name in names if name.startswith("wheels/")} == set(manifest["wheels"])
    assert manifest["platforms"] == ["linux-x64", "macos-arm64", "windows-x64"]
    assert manifest["schema_version"] == "1.0.0" and manifest["blender_version_min"] == "4.2.0"
    assert manifest["type"] == "add-on" and manifest["id"] == "haarlight"
    # Rules of Blender's schema: at most 64 characters, no full stop at the end; licences by SPDX.
    for text in (manifest["tagline"], *manifest["permissions"].values()):
        assert len(text) <= 64 and not text.endswith(".")
    assert all(licence.startswith("SPDX:") for licence in manifest["license"])


def test_wheels_that_are_none_are_refused(tmp_path):
    with pytest.raises(SystemExit, match="is no wheel"):
        build.pack([tmp_path / "none.whl"], tmp_path)
    strange = tmp_path / "haarlight-0.1.0-cp311-abi3-freebsd_14.whl"
    strange.write_bytes(b"")
    with pytest.raises(SystemExit, match="freebsd_14"):
        build.pack([strange], tmp_path)


def test_files_are_short_and_the_package_imports_by_its_own_name():
    for path in build.EXTENSION.glob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert len(text.splitlines()) <= 400, path.name
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                assert node.end_lineno - node.lineno < 80, (path.name, node.name)
            # Blender gives an extension another name than its folder has here.
            if isinstance(node, ast.ImportFrom):
                assert not (node.module or "").startswith("haarlight_blender"), path.name
