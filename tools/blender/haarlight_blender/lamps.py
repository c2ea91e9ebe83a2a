"""Blender's lamps in figures that close: how much light each gives, whatever dials it was set with.

Cycles' watts are radiant flux: a point or spot lamp of P watts has P / (4 pi) W/sr (a spot's cone only cuts), an area lamp a
radiance of P / (pi A), a sun P W/m2 (`tests/test_cycles.py` measures all of them). Temperature and exposure multiply,
*normalize* off multiplies by the lamp's area; an emission node multiplies by its colour and strength.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
from mathutils import Matrix, Vector

# glTF's exporter, mode "Standard", has so many lumens for a watt: the luminous efficacy of 555 nm (SI).
LUMENS_PER_WATT = 683.0
# Corners of round area lamps: their area is kept, the outline is off by .2 %.
CORNERS = 48


@dataclass
class Power:
    """What a lamp gives: watts (a sun: W/m2) for a white of 1, and a colour whose greatest part is 1."""

    watts: float
    color: tuple[float, float, float]


def power(lamp: bpy.types.Light, area: float, warn) -> Power:
    """What a lamp gives. `area`: of its surface in scene units squared, for lamps that are not normalized."""
    watts = lamp.energy
    color = [float(c) for c in lamp.color]
    if getattr(lamp, "use_temperature", False):
        color = [c * t for c, t in zip(color, lamp.temperature_color)]
    watts *= 2.0 ** getattr(lamp, "exposure", 0.0)
    if not getattr(lamp, "normalize", True) and lamp.type != "SUN":
        watts *= area
    emission = _emission(lamp, warn)
    if emission:
        watts *= emission[0]
        color = [c * e for c, e in zip(color, emission[1])]
    if watts < 0.0 or min(color) < 0.0:
        warn(f"lamp '{lamp.name}' takes light away: it is left out")
        return Power(0.0, (1.0, 1.0, 1.0))
    brightest = max(color)
    if brightest <= 0.0:
        return Power(0.0, (1.0, 1.0, 1.0))
    return Power(watts * brightest, tuple(c / brightest for c in color))


def _emission(lamp, warn):
    """Strength and colour of a lamp's emission node; none where it has no nodes."""
    if not lamp.node_tree or not lamp.use_nodes:
        return None
    output = lamp.node_tree.get_output_node("ALL")
    links = output.inputs["Surface"].links if output else ()
    node = links[0].from_node if links else None
    if node is None or node.type != "EMISSION":
        warn(f"lamp '{lamp.name}' has nodes other than one emission: its colour and power count without them")
        return None
    for name in ("Color", "Strength"):
        if node.inputs[name].is_linked:
            warn(f"lamp '{lamp.name}': what is linked to {name.lower()} is not read, its value counts")
    return node.inputs["Strength"].default_value, list(node.inputs["Color"].default_value)[:3]


def outline(lamp: bpy.types.Light) -> list[Vector]:
    """Corners of an area lamp in its own space, counter-clockwise seen from where it shines to, -Z."""
    width = lamp.size
    height = lamp.size_y if lamp.shape in ("RECTANGLE", "ELLIPSE") else width
    if lamp.shape in ("SQUARE", "RECTANGLE"):
        half = [(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)]
        return [Vector((x * width, y * height, 0.0)) for x, y in half]
    # A polygon of the ellipse's area: pi / 4 of its box.
    turn = 2.0 * math.pi / CORNERS
    radius = math.sqrt(0.25 * math.pi / (0.5 * CORNERS * math.sin(turn)))
    return [
        Vector((radius * math.cos(-k * turn) * width, radius * math.sin(-k * turn) * height, 0.0)) for k in range(CORNERS)
    ]


def area(corners: list[Vector], matrix: Matrix) -> float:
    """Area of a plane polygon in the world."""
    placed = [matrix @ corner for corner in corners]
    first = placed[0]
    total = Vector((0.0, 0.0, 0.0))
    for a, b in zip(placed[1:], placed[2:]):
        total += (a - first).cross(b - first)
    return 0.5 * total.length


def radius_area(lamp: bpy.types.Light) -> float:
    """Area of the sphere of a point or spot lamp, as *normalize* off multiplies by it."""
    return 4.0 * math.pi * lamp.shadow_soft_size**2
