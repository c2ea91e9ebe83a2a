"""A sensor grid in a grey box against Radiance, through pyradiance."""

from __future__ import annotations

import box
import numpy as np
import pytest

import haarlight

pyradiance = pytest.importorskip(
    "pyradiance", reason="SKIPPED: no comparison with Radiance, as pyradiance is not installed: pip install pyradiance"
)

# Hemispherical samples without interpolation (-aa 0): noise and not bias is left, about 1 % a point.
PARAMETERS = ["-ab", "7", "-ad", "4096", "-aa", "0", "-lw", "1e-5", "-lr", "-10", "-ds", "0.02", "-dt", "0", "-dc", "1", "-dj", "0.9"]


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    path = tmp_path_factory.mktemp("box") / "box.gltf"
    box.gltf(path)
    return haarlight.load(path)


def radiance(points: np.ndarray, folder) -> np.ndarray:
    """Illuminance by Radiance, (N,), lx."""
    (folder / "box.rad").write_text(box.radiance())
    (folder / "box.oct").write_bytes(pyradiance.oconv(str(folder / "box.rad")))
    rays = "".join(f"{x} {y} {z} 0 1 0\n" for x, y, z in points)
    out = pyradiance.rtrace(
        rays.encode(), folder / "box.oct", header=False, irradiance=True, nproc=2, params=PARAMETERS
    )
    rgb = np.array([line.split() for line in out.decode().splitlines() if line.strip()], float)
    return box.EFFICACY * rgb @ [0.265, 0.670, 0.065]


def test_a_grid_agrees_with_radiance(room, tmp_path):
    points = box.sensors()
    lux, _, _, plus_minus = room.bake(error=0.25, mesh=False, keep=False).probe(points, [0, 1, 0])
    peer = radiance(points, tmp_path)
    relative = lux / peer - 1
    print(f"bias {100 * relative.mean():+.2f} %, RMS {100 * np.sqrt((relative**2).mean()):.2f} %, worst {100 * abs(relative).max():.2f} %")
    assert abs(relative.mean()) < 0.01
    assert np.sqrt((relative**2).mean()) < 0.02
    assert lux.min() > 20
