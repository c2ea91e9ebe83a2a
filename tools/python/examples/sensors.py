"""A grid of sensors over a floor, as people who use pyradiance read it: illuminance in lux, row by row.

python sensors.py ROOM.glb
"""

import sys

import numpy as np

import haarlight

room = haarlight.load(sys.argv[1])
low, high = np.array(room.facts["bounds_m"])
x, z = (np.linspace(low[k], high[k], 12)[1:-1] for k in (0, 2))
points = np.stack(np.meshgrid(x, [low[1] + 0.1 * (high[1] - low[1])], z, indexing="ij"), -1).reshape(-1, 3)
light = room.bake(error=0.5, mesh=False, keep=False)
lux, xyz, bands, plus_minus = light.probe(points, [0, 1, 0])
print(np.array2string(lux.reshape(10, 10).T, precision=1, suppress_small=True))
print(f"mean {lux.mean():.1f} lx, uniformity {lux.min() / lux.mean():.2f}, stated error {100 * np.mean(plus_minus / lux):.2f} %")
