from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._types import Probe, Spectrum

__version__: str
PROGRAM: str

_Record: TypeAlias = dict[str, Any]
_Words: TypeAlias = Mapping[str, Any]
"""A dictionary in the words of a file of spectra."""

class _Event(Protocol):
    def is_set(self) -> bool: ...

@final
class Room:
    """A room, read and checked. Made by `load`."""

    @property
    def path(self) -> Path:
        """The file."""
    @property
    def plan(self) -> list[_Record]:
        """What will be simulated and why: `name`, `runs`, `lacking`, `reason` of each effect."""
    @property
    def facts(self) -> _Record:
        """What the room holds, as `haarlight inspect --json` has it."""
    @property
    def warnings(self) -> list[str]:
        """What the user should know of the room, sentences."""
    @property
    def surfaces(self) -> list[_Record]:
        """The surfaces, as `Result.surface` counts them: `name`, `node`, `mesh`, `primitive`, `instance`, `material`."""
    def bake(
        self,
        error: float = 0.5,
        *,
        time: float | None = None,
        on_round: Callable[[_Record], object] | None = None,
        stop: _Event | None = None,
        mesh: bool = True,
        keep: bool = True,
        vertices: int | None = None,
        spectrum: str = "perceptual",
        rounds: int = 12,
        seed: int = 0,
    ) -> Result:
        """Bakes light into the room until the mean colour difference `error` (CIEDE2000), `time` (s), Ctrl-C, `stop`, or
        `on_round` returning False; always a whole result."""

@final
class Result:
    """The light of a room. Made by `Room.bake` and `Result.relight`. Arrays are not copies and cannot be written to."""

    @property
    def room(self) -> Room:
        """The room as it is lit here."""
    @property
    def verdict(self) -> Literal["reached", "out_of_time", "interrupted", "out_of_rounds", "exhausted"]:
        """How the bake ended."""
    @property
    def error(self) -> float | None:
        """Mean colour difference (CIEDE2000), an estimate; None before there are two rounds."""
    @property
    def rounds(self) -> list[_Record]:
        """A flat record of every round, as `pandas.DataFrame` takes them."""
    @property
    def relit(self) -> _Record | None:
        """What relighting took; None for a bake."""
    @property
    def white(self) -> list[float]:
        """Tristimulus irradiance of the adaptation white, X, Y, Z, lm/m2."""
    @property
    def edges(self) -> NDArray[np.float64]:
        """Edges of the 64 bands of spectra, (65,), nm."""
    @property
    def positions(self) -> NDArray[np.float64]:
        """Places of the vertices, (N, 3), units of the file."""
    @property
    def normals(self) -> NDArray[np.float32]:
        """Unit normals of the vertices, (N, 3)."""
    @property
    def xyz(self) -> NDArray[np.float32]:
        """Tristimulus radiosity of the vertices, (N, 3), lm/m2."""
    @property
    def irradiance(self) -> NDArray[np.float32]:
        """Tristimulus irradiance of the vertices, (N, 3), lm/m2; Y is lux."""
    @property
    def triangles(self) -> NDArray[np.uint32]:
        """Triangles, (M, 3), indices of vertices, counter-clockwise from the front."""
    @property
    def surface(self) -> NDArray[np.uint32]:
        """Which of `Room.surfaces` each vertex belongs to, (N,)."""
    def spectra(self, wavelengths: ArrayLike | None = None) -> NDArray[np.float32]:
        """Spectral radiosity of the vertices at wavelengths (K,) in nm, or on all bands: (N, K), W/m2/nm."""
    def probe(self, points: ArrayLike, normals: ArrayLike) -> Probe:
        """Light at points (N, 3) with normals (N, 3) or (3,)."""
    def places(self, points: ArrayLike, normals: ArrayLike) -> list[Literal["room", "inside", "outside"]]:
        """Where points (N, 3) with normals (N, 3) or (3,) lie."""
    def relight(self, changes: Mapping[str, float | _Words] | Room) -> Result:
        """The room under other lamps and paints, by name: a factor, or the words of a file of spectra."""
    def audit(self, points: int = 200, *, seed: int = 0) -> _Record:
        """The error measured at random points by Monte Carlo, a flat record."""
    def save(
        self,
        path: str | PathLike[str],
        *,
        exposure: str | float = "auto",
        white_balance: str | float = "none",
        xyz: bool = False,
        compress: Literal["none", "quantize", "meshopt"] = "none",
    ) -> None:
        """Writes the room with its light (.glb), or its arrays (.npz)."""
    def save_maps(
        self,
        path: str | PathLike[str],
        *,
        size: int = 1024,
        texels: int | None = None,
        indirect: bool = False,
        exposure: str | float = "auto",
        white_balance: str | float = "none",
        on_progress: Callable[[int, int], object] | None = None,
        stop: _Event | None = None,
    ) -> _Record:
        """Writes light maps: a .glb with the room's own mesh, pages as .exr and their index beside it; `files`, `error`."""

def load(
    path: str | PathLike[str],
    spectra: str | PathLike[str] | _Words | None = None,
    *,
    sky: str | _Words | None = None,
    range: tuple[float, float] = (380.0, 780.0),
    lenient: bool = False,
    scale: float | None = None,
    flip: bool = False,
    allow_dark: bool = False,
) -> Room:
    """Reads a room, .glb or .gltf, with its spectra: a file, or a dictionary as in such a file."""

def spectra(pattern: str = "") -> dict[str, Spectrum]:
    """The spectra whose names hold `pattern`, and what they are."""

def _panic(text: str) -> None: ...
