"""Relights by itself when a lamp changes: the handler notes it, a timer waits until the user's hand rests."""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from . import operators, session, show

# Seconds without a change after which light is worked out: a slider that is dragged sends some thirty changes a second.
RESTS = 0.4


# Dials of lamps that give light or colour.
DIALS = ("energy", "color", "exposure", "normalize", "use_temperature", "temperature")
_figures: dict[int, tuple] = {}


def figures(scene) -> dict[int, tuple]:
    """What the lamps of a scene are set to. Blender tells of a lamp in other cases too: when it is shown, or selected."""
    lamps = {o.data.session_uid: o.data for o in scene.objects if o.type == "LIGHT"}
    return {uid: tuple(str(getattr(lamp, dial, None)) for dial in DIALS) for uid, lamp in lamps.items()}


@persistent
def changed(scene, depsgraph) -> None:
    """Notes that a lamp changed."""
    global _figures
    if not scene.haarlight.live or show.of_scene(scene) is None:
        return
    if not _figures or any(isinstance(update.id, bpy.types.Light) for update in depsgraph.updates):
        before, _figures = _figures, figures(scene)
        if before and before != _figures:
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
    # A timer has no window of its own.
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        if bpy.ops.haarlight.relight.poll():
            bpy.ops.haarlight.relight("INVOKE_DEFAULT")
    return None


@persistent
def opened(_file) -> None:
    """Another file: its bakes are not ours."""
    session.forget()
    _figures.clear()


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
