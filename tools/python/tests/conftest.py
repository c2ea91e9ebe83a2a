"""Rooms of the repository, and the command to compare with."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

import haarlight

TOP = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def scenes() -> Path:
    return TOP / "scenes"


@pytest.fixture(scope="session")
def cornell(scenes: Path) -> haarlight.Room:
    with pytest.warns(haarlight.RoomWarning, match="open to a sky"):
        return haarlight.load(scenes / "cornell.glb")


@pytest.fixture(scope="session")
def lit(cornell: haarlight.Room) -> haarlight.Result:
    """The Cornell box at the default's error, with its mesh."""
    return cornell.bake(error=0.5)


@pytest.fixture(scope="session")
def grid() -> list[list[float]]:
    """Points on the floor of the Cornell box, beside its blocks."""
    return [[x, 0.0, z] for x in (0.04, 0.35, 0.52) for z in (0.05, 0.15, 0.52)]


@pytest.fixture(scope="session")
def command() -> list[str]:
    """`haarlight` of the same sources: HAARLIGHT, or what cargo builds at the top."""
    given = os.environ.get("HAARLIGHT")
    if given:
        return [given]
    if shutil.which("cargo") is None:
        pytest.skip("no cargo to build the command with, and HAARLIGHT names none")
    subprocess.run(["cargo", "build", "--release", "--bin", "haarlight", "--quiet"], cwd=TOP, check=True)
    built = Path(os.environ.get("CARGO_TARGET_DIR", TOP / "target")) / "release" / "haarlight"
    return [str(built)]
