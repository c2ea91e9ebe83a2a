"""Bake, relight, stop, show the originals. With a window work is done beside the user's, by a timer; without, at once."""

from __future__ import annotations

import bpy

from . import messages, session, show, spectra
from .bake import Job, Lit, Wanted, folder, remove
from .export import Exported, chosen, export

# Seconds between two looks at the thread.
LOOKS = 0.2
running: Job | None = None


def exported(context, only: frozenset[int] | None, lumens_per_watt: float, lamps=frozenset()) -> Exported:
    """The scene in a new temporary folder, with what is hidden while light is shown; the rest as for `export`."""
    settings, collection = context.scene.haarlight, show.of_scene(context.scene)
    hidden = collection.get(show.HIDDEN, "{}") if collection else "{}"
    if collection:
        show.show_originals(context, collection)
        context.view_layer.update()
    room = folder()
    try:
        return export(
            context, room, only=only, use_world=settings.use_world, lumens_per_watt=lumens_per_watt, lamps=lamps
        )
    except BaseException:
        remove(room)
        raise
    finally:
        if collection:
            show.hide_again(context, collection, hidden)


def wanted(settings, room: Exported) -> Wanted:
    """What the panel asks for."""
    return Wanted(
        error=settings.error,
        time=settings.time if settings.bound_time else None,
        medium=settings.medium,
        map_size=settings.map_size,
        vertices=settings.vertices if settings.bound_vertices else None,
        spectra=spectra.chosen(room, bpy.path.abspath(settings.spectra) if settings.spectra else ""),
    )


class _Works:
    """An operator with a job."""

    def job(self, context) -> Job:
        raise NotImplementedError

    def take(self, context, lit: Lit) -> None:
        raise NotImplementedError

    def execute(self, context):
        try:
            job = self.job(context)
        except Exception as problem:
            return messages.wrong(self, problem)
        job.run()
        return self._end(context, job)

    def invoke(self, context, event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        return self.begin(context)

    def begin(self, context):
        """Starts the thread, and a timer that looks at it."""
        global running
        try:
            running = self.job(context)
        except Exception as problem:
            return messages.wrong(self, problem)
        running.begin()
        manager = context.window_manager
        self._timer = manager.event_timer_add(LOOKS, window=context.window)
        manager.progress_begin(0.0, 1.0)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        global running
        job = running
        if event.type == "ESC":
            job.stop.set()
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        ending = "ending with what is whole" if job.stop.is_set() else "Esc ends with what is whole"
        messages.status(context, f"haarlight: {job.text}   |   {ending}")
        context.window_manager.progress_update(job.share)
        for area in context.window.screen.areas:
            area.tag_redraw()
        if job.running:
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        messages.status(context, None)
        running = None
        return self._end(context, job)

    def _end(self, context, job: Job):
        room = job.exported.path.parent
        try:
            if job.problem is not None:
                return messages.wrong(self, job.problem)
            try:
                self.take(context, job.lit)
            except ValueError as problem:
                return messages.wrong(self, problem)
            messages.done(self, job.lit)
            return {"FINISHED"}
        finally:
            remove(room)


class HAARLIGHT_OT_bake(_Works, bpy.types.Operator):
    """Bake light into the scene, as new objects beside the originals"""

    bl_idname = "haarlight.bake"
    bl_label = "Bake Light"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return running is None and context.mode == "OBJECT"

    def job(self, context) -> Job:
        settings = context.scene.haarlight
        room = exported(context, chosen(context) if settings.selected else None, settings.lumens_per_watt)
        try:
            return Job(room, wanted(settings, room))
        except BaseException:
            remove(room.path.parent)
            raise

    def take(self, context, lit: Lit) -> None:
        collection = show.show(context, lit, context.scene.haarlight.hide)
        session.keep(collection, show.KEY, lit)


class HAARLIGHT_OT_relight(_Works, bpy.types.Operator):
    """Work out the light under the lamps and paints as they are now, without casting a ray"""

    bl_idname = "haarlight.relight"
    bl_label = "Relight"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        lit = session.baked(show.of_scene(context.scene), show.KEY)
        if lit is None:
            cls.poll_message_set("bake first: light is kept until Blender ends")
            return False
        return running is None and context.mode == "OBJECT"

    def job(self, context) -> Job:
        before = session.baked(show.of_scene(context.scene), show.KEY)
        if before.wanted.medium == "MAPS":
            raise ValueError("light maps are not relit; bake again, or bake into vertices")
        # The same pieces, and lumens as what shows the light takes them.
        room = exported(context, before.exported.only, before.exported.lumens_per_watt, before.exported.lamps)
        try:
            return Job(room, wanted(context.scene.haarlight, room), before.light)
        except BaseException:
            remove(room.path.parent)
            raise

    def take(self, context, lit: Lit) -> None:
        collection = show.of_scene(context.scene)
        if collection is None:
            raise ValueError("the light was taken out of the scene meanwhile; bake again")
        show.update(collection, lit)
        # Relighting always starts from the bake itself.
        context.scene.haarlight_relit = lit.summary()


class HAARLIGHT_OT_stop(bpy.types.Operator):
    """End with what is whole"""

    bl_idname = "haarlight.stop"
    bl_label = "Stop"

    @classmethod
    def poll(cls, context):
        return running is not None

    def execute(self, context):
        running.stop.set()
        return {"FINISHED"}


class HAARLIGHT_OT_originals(bpy.types.Operator):
    """Show the originals and hide their light, or the other way round"""

    bl_idname = "haarlight.originals"
    bl_label = "Show Originals"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return show.of_scene(context.scene) is not None

    def execute(self, context):
        show.swap(context, show.of_scene(context.scene))
        return {"FINISHED"}


CLASSES = (HAARLIGHT_OT_bake, HAARLIGHT_OT_relight, HAARLIGHT_OT_stop, HAARLIGHT_OT_originals)
