"""Panels: in the sidebar of the 3D view, and beside the properties of materials and lamps."""

from __future__ import annotations

import bpy

from . import operators, session, show


class HAARLIGHT_PT_bake(bpy.types.Panel):
    bl_label = "haarlight"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "haarlight"

    def draw(self, context):
        layout, settings = self.layout, context.scene.haarlight
        layout.use_property_split = True
        layout.use_property_decorate = False
        job = operators.running
        if job is not None:
            layout.progress(factor=job.share, text=job.text)
            layout.operator("haarlight.stop", icon="CANCEL")
            return
        layout.operator("haarlight.bake", icon="LIGHT")
        layout.prop(settings, "error")
        _bounded(layout, settings, "bound_time", "time")
        layout.prop(settings, "medium")
        if settings.medium == "MAPS":
            layout.prop(settings, "map_size")
        else:
            _bounded(layout, settings, "bound_vertices", "vertices")
        for name in ("selected", "use_world", "lumens_per_watt", "spectra", "hide"):
            layout.prop(settings, name)
        collection = show.of_scene(context.scene)
        if collection is None:
            return
        layout.separator()
        lit = session.baked(collection, show.KEY)
        if lit is not None:
            layout.label(text=context.scene.haarlight_relit or lit.summary())
        layout.operator("haarlight.relight", icon="LIGHT_DATA")
        layout.prop(settings, "live")
        shown = "Show Light" if show.originals_shown(collection) else "Show Originals"
        layout.operator("haarlight.originals", text=shown, icon="HIDE_OFF")


def _bounded(layout, settings, switch: str, value: str) -> None:
    row = layout.row(heading=settings.bl_rna.properties[value].name)
    row.prop(settings, switch, text="")
    bound = row.row()
    bound.active = getattr(settings, switch)
    bound.prop(settings, value, text="")


class _Properties:
    bl_label = "haarlight"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_options = {"DEFAULT_CLOSED"}


class HAARLIGHT_PT_material(_Properties, bpy.types.Panel):
    bl_context = "material"

    @classmethod
    def poll(cls, context):
        return context.material is not None

    def draw(self, context):
        self.layout.use_property_split = True
        for name in ("reflectance", "emission", "luminance"):
            self.layout.prop(context.material.haarlight, name)


class HAARLIGHT_PT_lamp(_Properties, bpy.types.Panel):
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return context.light is not None

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.prop(context.light.haarlight, "spectrum")


CLASSES = (HAARLIGHT_PT_bake, HAARLIGHT_PT_material, HAARLIGHT_PT_lamp)
