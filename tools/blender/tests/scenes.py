"""Scenes of the tests, made with bpy."""

from __future__ import annotations

import math

import bpy
from mathutils import Matrix


def empty(unit: float = 1.0) -> bpy.types.Scene:
    """A new file: no objects, no world."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.unit_settings.scale_length = unit
    scene.world = None
    return scene


def tree(block) -> bpy.types.NodeTree:
    """The nodes of a material or world; up to Blender 4.5 they are asked for."""
    if block.node_tree is None:
        block.use_nodes = True
    return block.node_tree


def material(name: str, color=(0.5, 0.5, 0.5), emission: float = 0.0) -> bpy.types.Material:
    """A matt Principled BSDF that shows its front only."""
    made = bpy.data.materials.new(name)
    made.use_backface_culling = True
    shader = tree(made).nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Emission Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    shader.inputs["Emission Strength"].default_value = emission
    return made


def add(name: str, data, matrix: Matrix | None = None) -> bpy.types.Object:
    """An object of the scene."""
    made = bpy.data.objects.new(name, data)
    made.matrix_world = matrix or Matrix.Identity(4)
    bpy.context.scene.collection.objects.link(made)
    return made


def plane(name: str, size: float, paint, *, uv: bool = True) -> bpy.types.Mesh:
    """A square about the origin that looks along +Z."""
    h = 0.5 * size
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-h, -h, 0), (h, -h, 0), (h, h, 0), (-h, h, 0)], [], [(0, 1, 2, 3)])
    if uv:
        layer = mesh.uv_layers.new(name="UVMap")
        for loop, at in zip(layer.data, [(0, 0), (1, 0), (1, 1), (0, 1)]):
            loop.uv = at
    mesh.materials.append(paint)
    return mesh


def box(name: str, size: float, paint, *, inward: bool = False) -> bpy.types.Mesh:
    """A cube about the origin; inward: a room."""
    h = 0.5 * size
    corners = [(x, y, z) for z in (-h, h) for y in (-h, h) for x in (-h, h)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [f[::-1] if inward else f for f in faces])
    mesh.materials.append(paint)
    return mesh


def lamp(name: str, kind: str, watts: float, at=(0.0, 0.0, 0.0), **dials) -> bpy.types.Object:
    """A lamp that shines down."""
    data = bpy.data.lights.new(name, kind)
    data.energy = watts
    for dial, value in dials.items():
        setattr(data, dial, value)
    return add(name, data, Matrix.Translation(at))


def room(size: float = 4.0, grey: float = 0.5) -> bpy.types.Object:
    """A closed grey room about the origin."""
    return add("Room", box("room", size, material("wall", (grey,) * 3), inward=True))


def turned(at, degrees: float = 0.0, scale=(1.0, 1.0, 1.0)) -> Matrix:
    """A place, a turn about Z and a scale."""
    return Matrix.LocRotScale(at, Matrix.Rotation(math.radians(degrees), 3, "Z").to_quaternion(), scale)
