"""A bake on a thread of its own: what it is to do, how far it is, how it ends. Nothing here touches Blender's data."""

from __future__ import annotations

import shutil
import tempfile
import threading
from dataclasses import dataclass
from pathlib import Path

import haarlight

from .export import Exported
from .read import Pages, Shape, at_vertices, in_maps


@dataclass(frozen=True)
class Wanted:
    """What is asked for."""

    error: float
    time: float | None
    medium: str
    """`VERTICES` or `MAPS`."""
    map_size: int
    vertices: int | None
    spectra: dict


@dataclass(repr=False)
class Lit:
    """What a bake gives."""

    exported: Exported
    wanted: Wanted
    light: haarlight.Result
    shapes: dict[int, Shape]
    pages: Pages | None
    error: float | None
    """Mean colour difference (CIEDE2000), an estimate."""
    warnings: list[str]

    def summary(self) -> str:
        """One line for the status bar."""
        ends = {
            "reached": "done",
            "out_of_time": "the time was over",
            "interrupted": "stopped; what is there is whole",
            "out_of_rounds": "the rounds were over",
            "exhausted": "further rounds no longer pay",
        }
        error = "error not known" if self.error is None else f"dE00 {self.error:.2f} (estimate)"
        return f"haarlight: {ends[self.light.verdict]}, {error}"


def folder() -> Path:
    """A new folder for a room and its light; the caller, or `remove`, takes it away."""
    return Path(tempfile.mkdtemp(prefix="haarlight-"))


def remove(path: Path) -> None:
    """Takes a folder away, with what is in it."""
    shutil.rmtree(path, ignore_errors=True)


def room(exported: Exported, spectra: dict) -> haarlight.Room:
    """The exported room as haarlight reads it. Its warnings are in `.warnings`, for the user's status bar."""
    return haarlight.load(exported.path, spectra, sky=exported.sky, scale=exported.scale)


def _shown_otherwise(spectra: dict) -> list[str]:
    """A map holds irradiance: what it is multiplied with is Blender's colour, not a spectrum's."""
    named = [name for name, entry in spectra.get("materials", {}).items() if entry]
    return [
        f"material '{name}': its spectra count for the light, but in light maps it is shown in Blender's colour and emission"
        for name in named
    ]


class Job:
    """Work that a panel can follow. `begin()` starts a thread; `run()` works in the calling one."""

    def __init__(self, exported: Exported, wanted: Wanted, relit: haarlight.Result | None = None) -> None:
        """`relit`: the bake whose light is worked out anew under the exported lamps, in place of a new bake."""
        self.exported, self.wanted, self.relit = exported, wanted, relit
        self.stop = threading.Event()
        self.text = "reading the room"
        self.share = 0.0
        self.lit: Lit | None = None
        self.problem: BaseException | None = None
        self._thread: threading.Thread | None = None

    def begin(self) -> None:
        """Starts."""
        self._thread = threading.Thread(target=self.run, name="haarlight", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Is it still at work?"""
        return self._thread is not None and self._thread.is_alive()

    def run(self) -> None:
        """Works; at the end there is `lit` or a `problem`."""
        try:
            self.lit = self._lit()
        except BaseException as problem:  # noqa: BLE001 - it is raised where the user is told
            self.problem = problem

    def _lit(self) -> Lit:
        wanted, exported = self.wanted, self.exported
        read = room(exported, wanted.spectra)
        said = [*exported.warnings, *read.warnings]
        maps = wanted.medium == "MAPS"
        if self.relit is not None:
            self.text = "relighting"
            light = self.relit.relight(read)
        else:
            light = read.bake(
                wanted.error,
                time=wanted.time,
                on_round=self._hear,
                stop=self.stop,
                mesh=not maps,
                vertices=wanted.vertices,
            )
        path = exported.path.with_name("lit.glb")
        self.text, self.share = "writing", 1.0
        if maps:
            said += _shown_otherwise(wanted.spectra)
            written = light.save_maps(path, size=wanted.map_size, on_progress=self._look, stop=self.stop)
            shapes, pages = in_maps(path, exported)
            return Lit(exported, wanted, light, shapes, pages, written["error"], said)
        light.save(path, xyz=True)
        return Lit(exported, wanted, light, at_vertices(path, light, exported), None, light.error, said)

    def _hear(self, record: dict) -> bool:
        error = record["error.total_de2000"]
        known = error is not None
        said = f"dE00 {error:.2f} (estimate), {self.wanted.error:g} wanted" if known else "first light"
        self.text = f"round {record['round']}: {said}"
        # The error falls about as the root of the work: what is done of it is the square of the share reached.
        self.share = min(1.0, self.wanted.error / error) ** 2 if known and error > 0.0 else 0.05
        return not self.stop.is_set()

    def _look(self, done: int, of: int) -> None:
        self.text, self.share = f"light map: {done} of {of} looks", done / max(of, 1)
