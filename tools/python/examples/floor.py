"""The illuminance of a floor, and beside it the error that is stated and the one that a second, finer bake shows.

python floor.py ROOM.glb [PICTURE.png]
"""

import sys

import matplotlib
import numpy as np

import haarlight

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

SIDE = 60

room = haarlight.load(sys.argv[1])
picture = sys.argv[2] if len(sys.argv) > 2 else "floor.png"
low, high = np.array(room.facts["bounds_m"])
x, z = (low[k] + (np.arange(SIDE) + 0.5) / SIDE * (high[k] - low[k]) for k in (0, 2))
points = np.stack(np.meshgrid(x, [low[1]], z, indexing="ij"), -1).reshape(-1, 3)

light = room.bake(error=0.5, mesh=False, keep=False)
finer = room.bake(error=0.1, mesh=False, keep=False)
inside = np.array([place == "room" for place in light.places(points, [0, 1, 0])])
lux, _, _, plus_minus = light.probe(points[inside], [0, 1, 0])
off = np.abs(lux - finer.probe(points[inside], [0, 1, 0]).lux)

figure, axes = plt.subplots(1, 3, figsize=(15, 4.5), layout="constrained")
for axis, values, title in zip(
    axes,
    (lux, plus_minus, off),
    ("illuminance, lx", "stated error (estimate), lx", "difference from a bake to 0.1, lx"),
    strict=True,
):
    field = np.full(len(points), np.nan)
    field[inside] = values
    shown = axis.imshow(
        field.reshape(SIDE, SIDE).T,
        extent=(low[0], high[0], high[2], low[2]),
        cmap="magma",
        vmin=0,
        vmax=None if axis is axes[0] else max(plus_minus.max(), off.max()),
    )
    axis.set(title=title, xlabel="x, m", ylabel="z, m")
    figure.colorbar(shown, ax=axis)
figure.suptitle(f"{room.path.name}: mean {lux.mean():.1f} lx, dE00 {light.error:.2f} (estimate)")
figure.savefig(picture, dpi=110)
print(f"{picture}: mean {lux.mean():.1f} lx, stated {plus_minus.mean():.2f} lx, seen {np.sqrt((off**2).mean()):.2f} lx")
