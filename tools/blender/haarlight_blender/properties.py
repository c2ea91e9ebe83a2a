"""What the user sets: of the scene, of materials, of lamps."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from . import spectra
from .lamps import LUMENS_PER_WATT


class HaarlightScene(bpy.types.PropertyGroup):
    """How a scene is baked."""

    error: FloatProperty(
        name="Error", default=0.5, min=0.05, max=20.0, precision=2,
        description="Mean colour difference (CIEDE2000) at which the bake ends: 1 is just visible side by side",
    )  # fmt: skip
    bound_time: BoolProperty(name="Bound the Time", default=False)
    time: FloatProperty(name="Time", default=60.0, min=0.1, unit="NONE", description="Seconds that the bake may take")
    medium: EnumProperty(
        name="Light in",
        items=[
            ("VERTICES", "Vertices", "A mesh that is as fine as the light needs, with float colour attributes"),
            ("MAPS", "Light Maps", "The meshes as they are, with pages of float texels"),
        ],
    )
    map_size: IntProperty(
        name="Page", default=1024, min=64, max=16384, description="Texels along a side of a page at the most"
    )
    bound_vertices: BoolProperty(name="Bound the Vertices", default=False)
    vertices: IntProperty(
        name="Vertices", default=200_000, min=1, description="Vertices of the lit mesh at the most; the error is that of it"
    )
    selected: BoolProperty(name="Selected Only", default=False, description="Bake the selected objects and lamps alone")
    use_world: BoolProperty(
        name="World", default=True, description="Light of the world: a colour, or a Sky Texture with its sun"
    )
    lumens_per_watt: FloatProperty(
        name="Lumens per Watt", default=LUMENS_PER_WATT, min=1e-3,
        description="Of lamps, emission and world alike. 683 as glTF's Standard has it; 1 where lamps were set up in lumens",
    )  # fmt: skip
    spectra: StringProperty(name="Spectra", subtype="FILE_PATH", description="A file of spectra of materials and lamps, JSON")
    hide: BoolProperty(name="Hide Originals", default=True, description="Hide what was baked while its light is shown")
    live: BoolProperty(
        name="Relight by Itself", default=False, description="Relight when the power or colour of a lamp changes"
    )


class HaarlightMaterial(bpy.types.PropertyGroup):
    """The spectra of a material."""

    reflectance: StringProperty(
        name="Reflectance", search=spectra.search("reflectance"), description="A measured reflectance in place of the colour"
    )
    emission: StringProperty(
        name="Emission", search=spectra.search("light"), description="The spectrum of the light that it gives out"
    )
    luminance: FloatProperty(
        name="Luminance", default=0.0, min=0.0, description="Of the emission, cd/m2; 0: as bright as the emission strength says"
    )


class HaarlightLamp(bpy.types.PropertyGroup):
    """The spectrum of a lamp."""

    spectrum: StringProperty(
        name="Spectrum", search=spectra.search("light"), description="In place of the lamp's colour; its power stays"
    )


CLASSES = (HaarlightScene, HaarlightMaterial, HaarlightLamp)
OWNERS = ((bpy.types.Scene, HaarlightScene), (bpy.types.Material, HaarlightMaterial), (bpy.types.Light, HaarlightLamp))


def register() -> None:
    """Gives scenes, materials and lamps their `haarlight`."""
    for owner, group in OWNERS:
        owner.haarlight = PointerProperty(type=group)
    bpy.types.Scene.haarlight_relit = StringProperty(description="How the last relighting ended")


def unregister() -> None:
    """Takes it away."""
    for owner, _ in OWNERS:
        del owner.haarlight
    del bpy.types.Scene.haarlight_relit
