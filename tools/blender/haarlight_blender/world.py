"""Blender's world as a sky of haarlight: `"sky"` of a file of spectra, or none.

A Sky Texture becomes a clear sky (CIE 12) with the sun where the texture has it; its brightness follows the height of the sun
(IES RP-21), times the strength of the background. A plain colour is a sky of that radiance all around, the ground below the
horizon included.
"""

from __future__ import annotations

import math

import bpy

from .lamps import LUMENS_PER_WATT
from .paint import has_nodes

# Linear sRGB to XYZ (IEC 61966-2-1).
TO_XYZ = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))
# Daylight has these temperatures, K (what haarlight takes).
COLDEST, WARMEST = 25_000.0, 4_000.0
# Distance in u'v' (CIE 1976) from daylight of the same temperature from which a colour is not daylight any more; 1 step of
# MacAdam's is about .001.
COLOURED = 0.02


def sky(world: bpy.types.World | None, lumens_per_watt: float, warn) -> dict | None:
    """What `haarlight.load(sky=...)` takes; None where the world is dark or cannot be read."""
    if world is None:
        return None
    background = _background(world, warn)
    if background is None:
        return None
    strength, color, texture = background
    if strength <= 0.0:
        return None
    if texture is not None:
        return _clear(texture, strength * lumens_per_watt / LUMENS_PER_WATT)
    return _even(color, strength * lumens_per_watt, world.name, warn)


def _background(world, warn):
    """Strength, colour and sky texture of the world's background."""
    if not has_nodes(world):
        return 1.0, list(world.color), None
    output = world.node_tree.get_output_node("ALL")
    links = output.inputs["Surface"].links if output else ()
    if not links:
        return None
    node = links[0].from_node
    if node.type != "BACKGROUND":
        warn(f"world '{world.name}': a {node.bl_label} is not read; give it a Background of a colour or a Sky Texture")
        return None
    if node.inputs["Strength"].is_linked:
        warn(f"world '{world.name}': what is linked to the strength is not read, its value counts")
    strength, color = node.inputs["Strength"].default_value, list(node.inputs["Color"].default_value)[:3]
    linked = node.inputs["Color"].links
    if not linked:
        return strength, color, None
    texture = linked[0].from_node
    if texture.type != "TEX_SKY":
        warn(f"world '{world.name}': {texture.bl_label} is not read and gives no light; use a colour or a Sky Texture")
        return None
    return strength, color, texture


def _clear(texture, factor: float) -> dict | None:
    """A clear sky with its sun. In Blender +Y is glTF's north, and the texture turns the sun clockwise from there."""
    if texture.sky_type in ("PREETHAM", "HOSEK_WILKIE"):
        toward = texture.sun_direction
        elevation = math.degrees(math.asin(max(-1.0, min(1.0, toward.normalized().z))))
        azimuth = math.degrees(math.atan2(toward.x, toward.y))
        disc = False
    else:
        elevation, azimuth = math.degrees(texture.sun_elevation), math.degrees(texture.sun_rotation)
        disc = texture.sun_disc
    if elevation <= 0.0:
        return None
    sine = max(math.sin(math.radians(elevation)), 1e-3)
    # IES RP-21 (1984), clear sky: of open ground by the sky, and across the sun's rays, lx.
    ground = 800.0 + 15_500.0 * math.sqrt(sine)
    direct = 127_500.0 * math.exp(-0.21 / sine) * getattr(texture, "sun_intensity", 1.0) if disc else 0.0
    sun = {"elevation_deg": elevation, "azimuth_deg": azimuth % 360.0, "illuminance_lx": direct * factor}
    return {"type": "clear", "illuminance_lx": ground * factor, "sun": sun}


def _even(color, lumens: float, name: str, warn) -> dict | None:
    """A sky of one radiance; ground that reflects all has it too."""
    xyz = [sum(m * c for m, c in zip(row, color)) for row in TO_XYZ]
    if xyz[1] <= 0.0:
        return None
    kelvin, distance = _temperature(xyz)
    if distance > COLOURED or not WARMEST <= kelvin <= COLDEST:
        kelvin = min(max(kelvin, WARMEST), COLDEST)
        warn(f"world '{name}': its colour is not one of daylight; it is taken as daylight of {kelvin:.0f} K, as bright")
    return {
        "type": "uniform",
        "illuminance_lx": math.pi * xyz[1] * lumens,
        "cct_k": kelvin,
        "ground_reflectance": 1.0,
    }


def _temperature(xyz) -> tuple[float, float]:
    """Correlated colour temperature by McCamy (1992), K, and the distance in u'v' from daylight of that temperature."""
    total = sum(xyz)
    x, y = xyz[0] / total, xyz[1] / total
    n = (x - 0.3320) / (0.1858 - y)
    kelvin = ((449.0 * n + 3525.0) * n + 6823.3) * n + 5520.33
    # CIE 15, daylight: x by the temperature, y by x.
    t = 1e3 / min(max(kelvin, WARMEST), COLDEST)
    if t > 1.0 / 7.0:
        day = ((-4.6070 * t + 2.9678) * t + 0.09911) * t + 0.244063
    else:
        day = ((-2.0064 * t + 1.9018) * t + 0.24748) * t + 0.237040
    near = (day, (-3.0 * day + 2.870) * day - 0.275)
    u, v = _uv(x, y)
    s, t = _uv(*near)
    return kelvin, math.hypot(u - s, v - t)


def _uv(x: float, y: float) -> tuple[float, float]:
    below = -2.0 * x + 12.0 * y + 3.0
    return 4.0 * x / below, 9.0 * y / below
