"""Bakes of this session, which relighting starts from. They are gone when Blender ends; the collections they made stay."""

from __future__ import annotations

from .bake import Lit

# The bake at hand, and the one before it, which an undo may bring back: each may hold hundreds of megabytes.
KEPT = 2
_baked: dict[str, Lit] = {}


def keep(collection, key: str, lit: Lit) -> None:
    """Keeps the bake of a collection, and lets go of the oldest."""
    _baked[collection[key]] = lit
    while len(_baked) > KEPT:
        del _baked[next(iter(_baked))]


def baked(collection, key: str) -> Lit | None:
    """The bake of a collection, if this session made it."""
    return _baked.get(collection[key]) if collection else None


def forget() -> None:
    """Lets go of all, when another file is opened."""
    _baked.clear()
