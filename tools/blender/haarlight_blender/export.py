"""The scene as a .glb for haarlight, by Blender's own exporter, from a scene of copies; the user's is not touched.

Everything that can be seen is copied as it is evaluated: modifiers applied, instances as objects that share a mesh, lamps with
one plain figure for their power, area lamps (which glTF does not know) as quads that shine. Each copy carries its number in
`pieces` as a custom property, which the exporter writes as `extras` and haarlight keeps: names need not be unique.
"""

from __future__ import annotations

import math
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import bpy
from mathutils import Matrix

from . import lamps, paint, world
from .glb import Glb

INDEX = "haarlight_index"
SOLID = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
# A matrix that scale, rotation and place give back to this share of its greatest number has no shear (float32).
NO_SHEAR = 1e-5
# glTF knows no cone without a rim (inner < outer); so much of it cannot be seen.
SHARP = 1e-3
# Watts of a lamp that was turned off: 1e-7 lm.
OFF = 1e-10


@dataclass
class Piece:
    """Something that was exported."""

    name: str
    kind: str
    """`mesh`, `lamp`, or `quad` for an area lamp."""
    uid: int
    """`session_uid` of the object that it shows: an undo while a bake runs makes Blender's objects anew."""
    owner: int
    """The same of the object in the scene: what instances it, or itself."""
    matrix: Matrix
    uvs: list[str] = field(default_factory=list)
    paint: str = ""
    """Name of the colours of vertices that materials see, if there are any."""


@dataclass
class Exported:
    """A .glb and what is in it, by number."""

    path: Path
    pieces: list[Piece]
    materials: list[str]
    """Names of materials in the file, unique; those of the user's materials where these are."""
    originals: list[int | None]
    """`session_uid` of the user's materials."""
    scale: float
    """Metres for each unit of the scene."""
    only: frozenset[int] | None
    """`session_uid` of the objects that were wanted; None: all."""
    sky: dict | None
    lumens_per_watt: float
    warnings: list[str]

    @property
    def lamps(self) -> frozenset[tuple[int, int]]:
        """The lamps, by `uid` and `owner`."""
        return frozenset((piece.uid, piece.owner) for piece in self.pieces if piece.kind != "mesh")


def by_uid(blocks) -> dict:
    """Objects or materials of the file by `session_uid`."""
    return {block.session_uid: block for block in blocks}


class NothingToBake(ValueError):
    """There is no surface to bake."""


def chosen(context) -> frozenset[int]:
    """What is selected, as `only` of `export`."""
    return frozenset(owner.session_uid for owner in context.view_layer.objects if owner.select_get())


def export(
    context,
    folder: Path,
    *,
    only: frozenset[int] | None,
    use_world: bool,
    lumens_per_watt: float,
    lamps: frozenset[tuple[int, int]] = frozenset(),
) -> Exported:
    """Writes `room.glb` into the folder: all that can be seen, or of that only these. Lamps without power are left out, but for
    `lamps`, the `Exported.lamps` of a bake that is relit."""
    warnings: list[str] = []

    def warn(text: str) -> None:
        if text not in warnings:
            warnings.append(text)

    scene = context.scene
    with _copies(scene) as copies:
        copies.warn, copies.kept = warn, lamps
        copies.scale = scene.unit_settings.scale_length
        copies.collect(context, only)
        if not any(piece.kind == "mesh" for piece in copies.pieces):
            what = "can be seen" if only is None else "is selected"
            raise NothingToBake(f"no surface {what}; select objects with faces, or show them")
        path = folder / "room.glb"
        _write(context, copies.scene, path)
        sky = world.sky(scene.world, lumens_per_watt, warn) if use_world else None
        _finish(path, copies, lumens_per_watt)
        return Exported(
            path, copies.pieces, copies.names, copies.originals, copies.scale, only, sky, lumens_per_watt, warnings
        )


class _Copies:
    """The scene of copies while it is there."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        self.scene = scene
        self.scale = 1.0
        self.pieces: list[Piece] = []
        self.names: list[str] = []
        self.originals: list[int | None] = []
        self.materials: list[bpy.types.Material] = []
        self.meshes: dict[tuple, bpy.types.Mesh] = {}
        self.lights: list[bpy.types.Light] = []
        self.numbers: dict[object, int] = {}
        self.kept: frozenset[tuple[int, int]] = frozenset()
        self.warn = lambda text: None

    def collect(self, context, only: frozenset[int] | None) -> None:
        """Copies what can be seen; in an order that hiding and showing do not change, for relighting needs the same one."""
        depsgraph = context.evaluated_depsgraph_get()
        found = []
        for instance in depsgraph.object_instances:
            shown = instance.object
            owner = (instance.parent if instance.is_instance else shown).original
            wanted = instance.show_self and not owner.hide_render and INDEX not in owner
            if not wanted or (only is not None and owner.session_uid not in only):
                continue
            matrix, source = instance.matrix_world.copy(), shown.original
            name = f"{owner.name}/{source.name}" if instance.is_instance else source.name
            uids = (source.session_uid, owner.session_uid)
            key = (owner.session_uid, tuple(instance.persistent_id) if instance.is_instance else (), source.session_uid)
            # What an instance shows may be gone with the next one.
            if shown.type in SOLID and matrix.determinant() != 0.0:
                found.append((key, name, uids, matrix, self._mesh(shown, matrix, depsgraph)))
            elif shown.type == "LIGHT":
                found.append((key, name, uids, matrix, shown.data))
        for _, name, uids, matrix, data in sorted(found, key=lambda one: one[0]):
            make = self._solid if isinstance(data, bpy.types.Mesh) else self._lamp
            make(data, uids, self._name(name), matrix)

    def _name(self, wanted: str) -> str:
        """A name that no other piece has."""
        taken = {piece.name for piece in self.pieces}
        name, number = wanted, 1
        while name in taken:
            number += 1
            name = f"{wanted} [{number}]"
        return name

    def _mesh(self, shown, matrix, depsgraph) -> bpy.types.Mesh:
        """The mesh of something that is shown; objects that share one get the same copy."""
        slots = [slot.material and slot.material.original for slot in shown.material_slots] or [None]
        data = shown.data if shown.type == "MESH" else shown
        shear = tuple(tuple(row) for row in matrix) if _sheared(matrix) else None
        key = (data.as_pointer(), tuple(m and m.as_pointer() for m in slots), shear)
        if key in self.meshes:
            return self.meshes[key]
        mesh = self.meshes[key] = bpy.data.meshes.new_from_object(
            shown, preserve_all_data_layers=True, depsgraph=depsgraph
        )
        # In place: taking a slot away would turn its faces over to the first one.
        for number, slot in enumerate(slots):
            if number == len(mesh.materials):
                mesh.materials.append(None)
            mesh.materials[number] = self.materials[self._material(slot)]
        if shear:
            mesh.transform(matrix)
            if matrix.determinant() < 0.0:
                mesh.flip_normals()
        return mesh

    def _solid(self, mesh, uids, name, matrix) -> None:
        if mesh.polygons:
            placed = Matrix.Identity(4) if _sheared(matrix) else matrix
            uvs, paint = [layer.name for layer in mesh.uv_layers], mesh.color_attributes.active_color
            self._place(Piece(name, "mesh", *uids, placed, uvs, paint.name if paint else ""), mesh)

    def _lamp(self, lamp, uids, name, matrix) -> None:
        if lamp.type == "AREA":
            self._quad(lamp, uids, name, matrix)
            return
        power = lamps.power(lamp, lamps.radius_area(lamp), self.warn)
        watts = self._watts(power, uids)
        if watts <= 0.0:
            return
        copy = bpy.data.lights.new(name, lamp.type)
        copy.energy, copy.color = watts, power.color
        if lamp.type == "SPOT":
            copy.spot_size, copy.spot_blend = lamp.spot_size, max(lamp.spot_blend, SHARP)
        self.lights.append(copy)
        copy[INDEX] = len(self.pieces)
        location, rotation, _ = matrix.decompose()
        # A mirrored lamp shines where it did: down its own -Z.
        if matrix.determinant() < 0.0:
            toward = (matrix.to_3x3() @ -Matrix.Identity(3).col[2]).normalized()
            rotation = toward.to_track_quat("-Z", "Y")
        self._place(Piece(name, "lamp", *uids, Matrix.LocRotScale(location, rotation, None)), copy)

    def _watts(self, power, uids) -> float:
        """A lamp that is relit stays in the file when it is off; haarlight passes over those without any light."""
        return max(power.watts, OFF) if uids in self.kept else power.watts

    def _quad(self, lamp, uids, name, matrix) -> None:
        corners = lamps.outline(lamp)
        surface = lamps.area(corners, matrix)
        power = lamps.power(lamp, surface, self.warn)
        watts = self._watts(power, uids)
        if surface <= 0.0 or watts <= 0.0:
            return
        if lamp.spread < math.pi - 1e-3:
            self.warn(f"lamp '{name}': its spread is not read, it shines to all sides of its front")
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([matrix @ corner for corner in corners], [], [list(range(len(corners)))])
        if matrix.determinant() < 0.0:
            mesh.flip_normals()
        radiance = watts / (math.pi * surface * self.scale**2)
        number = self._add_material(paint.emitter(name, power.color, radiance), name, None)
        mesh.materials.append(self.materials[number])
        self.meshes[("quad", len(self.pieces))] = mesh
        self._place(Piece(name, "quad", *uids, Matrix.Identity(4)), mesh)

    def _place(self, piece: Piece, data) -> None:
        copy = bpy.data.objects.new(piece.name, data)
        copy.matrix_world = piece.matrix
        copy[INDEX] = len(self.pieces)
        self.pieces.append(piece)
        self.scene.collection.objects.link(copy)

    def _material(self, material) -> int:
        key = material and material.as_pointer()
        if key not in self.numbers:
            name = material.name if material else "no material"
            self.numbers[key] = self._add_material(paint.readable(material, self.warn), name, material)
        return self.numbers[key]

    def _add_material(self, copy, name: str, original) -> int:
        unique, number = name, 1
        while unique in self.names:
            number += 1
            unique = f"{name} [{number}]"
        copy[INDEX] = len(self.materials)
        self.materials.append(copy)
        self.names.append(unique)
        self.originals.append(original.session_uid if original else None)
        return len(self.materials) - 1

    def remove(self) -> None:
        objects = list(self.scene.collection.objects)
        bpy.data.batch_remove(
            [*objects, *self.meshes.values(), *self.lights, *self.materials, self.scene],
        )


def _sheared(matrix: Matrix) -> bool:
    again = Matrix.LocRotScale(*matrix.decompose())
    greatest = max(abs(matrix[i][j]) for i in range(3) for j in range(3))
    return max(abs(matrix[i][j] - again[i][j]) for i in range(3) for j in range(3)) > NO_SHEAR * greatest


@contextmanager
def _copies(scene):
    copies = _Copies(bpy.data.scenes.new(f"{scene.name} for haarlight"))
    try:
        yield copies
    finally:
        copies.remove()


def _write(context, scene, path: Path) -> None:
    """Blender's exporter writes the scene that its window shows."""
    window = context.window or context.window_manager.windows[0]
    before = window.scene
    window.scene = scene
    try:
        with context.temp_override(window=window, scene=scene, view_layer=scene.view_layers[0]):
            bpy.ops.export_scene.gltf(
                filepath=str(path),
                export_format="GLB",
                use_active_scene=True,
                export_extras=True,
                export_lights=True,
                export_import_convert_lighting_mode="COMPAT",
                export_cameras=False,
                export_animations=False,
                export_skins=False,
                export_morph=False,
                export_apply=False,
                export_yup=True,
                export_materials="EXPORT",
            )
    finally:
        window.scene = before


def _finish(path: Path, copies: _Copies, lumens_per_watt: float) -> None:
    """Names as the user knows them, watts as lumens; radiance of surfaces too, so that what shines keeps its proportions."""
    glb = Glb(path)
    document = glb.document
    # All nodes are pieces, and none stands below another.
    document["nodes"].sort(key=lambda node: node["extras"][INDEX])
    document["scenes"][0]["nodes"] = list(range(len(document["nodes"])))
    for node in document["nodes"]:
        node["name"] = copies.pieces[node["extras"][INDEX]].name
    for light in document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", []):
        light["name"] = copies.pieces[light["extras"][INDEX]].name
        light["intensity"] = light.get("intensity", 1.0) * lumens_per_watt
    for material in document.get("materials", []):
        material["name"] = copies.names[material["extras"][INDEX]]
        if any(material.get("emissiveFactor", [])):
            extension = material.setdefault("extensions", {}).setdefault("KHR_materials_emissive_strength", {})
            extension["emissiveStrength"] = extension.get("emissiveStrength", 1.0) * lumens_per_watt
            used = document.setdefault("extensionsUsed", [])
            if "KHR_materials_emissive_strength" not in used:
                used.append("KHR_materials_emissive_strength")
    glb.write(path)
