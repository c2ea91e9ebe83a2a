"""Bakes of this session, which relighting starts from. They are gone when Blender ends; the collections they made stay."""

from __future__ import annotations

from .bake import Lit

_baked: dict[str, Lit] = {}


def keep(collection, key: str, lit: Lit) -> None:
    """Keeps the bake of a collection; those of collections that an undo may still bring back stay too."""
    _baked[collection[key]] = lit


def baked(collection, key: str) -> Lit | None:
    """The bake of a collection, if this session made it."""
    return _baked.get(collection[key]) if collection else None


def forget() -> None:
    """Lets go of all, when another file is opened."""
    _baked.clear()
