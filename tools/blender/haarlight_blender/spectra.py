"""Spectra of materials and lamps: the names that haarlight knows, and what was chosen as a file of spectra would say it."""

from __future__ import annotations

import json
import shutil
from functools import lru_cache
from pathlib import Path

import bpy
import haarlight

from .export import by_uid


@lru_cache
def names(kind: str) -> tuple[str, ...]:
    """Names of spectra of a kind, `light` or `reflectance`."""
    return tuple(name for name, spectrum in haarlight.spectra("").items() if spectrum.kind == kind)


def search(kind: str):
    """Offers the names that hold what was typed, for a text property."""

    def found(_owner, _context, text: str):
        return [name for name in names(kind) if text.lower() in name.lower()]

    return found


def chosen(exported, path: str) -> dict:
    """What the file says, and over it what was chosen for materials and lamps, by their names in the exported room."""
    said = _of_file(Path(path), exported.path.parent) if path else {}
    materials, lights = said.setdefault("materials", {}), said.setdefault("lights", {})
    paints, objects = by_uid(bpy.data.materials), by_uid(bpy.data.objects)
    for name, uid in zip(exported.materials, exported.originals):
        entry = _of_material(paints[uid].haarlight) if uid in paints else {}
        if entry:
            materials[name] = {**materials.get(name, {}), **entry}
    for piece in exported.pieces:
        wanted = objects[piece.uid].data.haarlight.spectrum if piece.kind != "mesh" else ""
        if wanted and piece.kind == "lamp":
            lights[piece.name] = {**lights.get(piece.name, {}), "name": wanted}
        elif wanted:
            materials[piece.name] = {"emission": {"name": wanted}}
    return {key: value for key, value in said.items() if value}


def _of_material(wanted) -> dict:
    entry: dict = {}
    if wanted.reflectance:
        entry["reflectance"] = {"name": wanted.reflectance}
    if wanted.emission:
        entry["emission"] = {"name": wanted.emission}
        if wanted.luminance > 0.0:
            entry["emission"]["luminance_cd_m2"] = wanted.luminance
    return entry


def _of_file(path: Path, folder: Path) -> dict:
    """A file of spectra; the tables and profiles that it names are laid into the folder, beside the exported room."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as problem:
        raise ValueError(f"{path}: cannot be read as a file of spectra ({problem}); choose another") from problem
    if not isinstance(said, dict):
        raise ValueError(f'{path}: is no file of spectra; it is an object with "materials" and "lights"')
    _laid(said, path.parent, folder)
    return said


def _laid(said, beside: Path, folder: Path) -> None:
    if isinstance(said, list):
        for value in said:
            _laid(value, beside, folder)
    if not isinstance(said, dict):
        return
    for key, value in said.items():
        named = key in ("csv", "profile") and isinstance(value, str) and "\n" not in value
        # What is not there is left for haarlight to name.
        if named and (beside / value).is_file():
            copy = folder / f"{len(list(folder.iterdir()))}-{Path(value).name}"
            shutil.copyfile(beside / value, copy)
            said[key] = copy.name
        elif not named:
            _laid(value, beside, folder)
