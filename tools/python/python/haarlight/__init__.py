"""Light in rooms, in full spectrum.

    import haarlight
    room = haarlight.load("room.glb")
    light = room.bake(error=0.5)
    lux, xyz, bands, plus_minus = light.probe([[1.0, 0.8, 2.0]], [0, 1, 0])

Lengths are in the units of the room's file, wavelengths in nm, spectra in W/m2/nm, tristimulus values in lm/m2 (Y of an
irradiance is lux). Figures of error are estimates unless they say that they are bounds or measured.
"""

from ._errors import (
    Error,
    FileError,
    InputError,
    InternalError,
    MissingFileError,
    Named,
    Problem,
    RoomWarning,
)
from ._native import Result, Room, __version__, load, spectra
from ._types import Probe, Spectrum

__all__ = [
    "Error",
    "FileError",
    "InputError",
    "InternalError",
    "MissingFileError",
    "Named",
    "Probe",
    "Problem",
    "Result",
    "Room",
    "RoomWarning",
    "Spectrum",
    "__version__",
    "load",
    "spectra",
]
