"""Relights by itself when a lamp changes: the handler notes it, a timer waits until the user's hand rests."""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from . import operators, session, show

# Seconds without a change after which light is worked out: a slider that is dragged sends some thirty changes a second.
RESTS = 0.4


@persistent
def changed(scene, depsgraph) -> None:
    """Notes that a lamp changed."""
    if not scene.haarlight.live or operators.running is not None:
        return
    if any(isinstance(update.id, bpy.types.Light) for update in depsgraph.updates) and show.of_scene(scene) is not None:
        later()


def later() -> None:
    """Relights when the hand rests."""
    if bpy.app.timers.is_registered(now):
        bpy.app.timers.unregister(now)
    bpy.app.timers.register(now, first_interval=RESTS)


def now() -> float | None:
    """Relights; again later while a bake runs."""
    if operators.running is not None:
        return RESTS
    if bpy.ops.haarlight.relight.poll():
        bpy.ops.haarlight.relight("INVOKE_DEFAULT")
    return None


@persistent
def opened(_file) -> None:
    """Another file: its bakes are not ours."""
    session.forget()


def register() -> None:
    """Begins to listen."""
    bpy.app.handlers.depsgraph_update_post.append(changed)
    bpy.app.handlers.load_post.append(opened)


def unregister() -> None:
    """Listens no more."""
    bpy.app.handlers.depsgraph_update_post.remove(changed)
    bpy.app.handlers.load_post.remove(opened)
    if bpy.app.timers.is_registered(now):
        bpy.app.timers.unregister(now)
