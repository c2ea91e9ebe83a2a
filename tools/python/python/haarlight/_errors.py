"""What can go wrong, with the place in the file."""

from __future__ import annotations

import errno
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Named:
    """A thing of the room's document, by index, name or both."""

    index: int | None
    name: str | None

    def __str__(self) -> str:
        parts = [str(self.index)] if self.index is not None else []
        parts += [repr(self.name)] if self.name is not None else []
        return " ".join(parts)


class Problem:
    """One thing that is wrong: where, what, and what to do next."""

    __slots__ = ("place", "what", "next", "file", "node", "mesh", "material", "light")

    def __init__(
        self,
        place: str,
        what: str,
        next: str,
        file: str | None = None,
        node: tuple[int | None, str | None] | None = None,
        mesh: tuple[int | None, str | None] | None = None,
        material: tuple[int | None, str | None] | None = None,
        light: tuple[int | None, str | None] | None = None,
    ) -> None:
        self.place = place
        self.what = what
        self.next = next
        self.file = file
        self.node = Named(*node) if node else None
        self.mesh = Named(*mesh) if mesh else None
        self.material = Named(*material) if material else None
        self.light = Named(*light) if light else None

    def __str__(self) -> str:
        return f"{self.place}: {self.what}; {self.next}"

    def __repr__(self) -> str:
        return f"<haarlight.Problem {str(self)!r}>"


class Error(Exception):
    """Anything that haarlight raises. `problems` lists all that is wrong; the other attributes are of the first of them."""

    def __init__(self, message: str, problems: Sequence[Problem] = ()) -> None:
        super().__init__(message)
        self.message = message
        self.problems: tuple[Problem, ...] = tuple(problems)
        first = self.problems[0] if self.problems else None
        self.file: str | None = first.file if first else None
        self.node: Named | None = first.node if first else None
        self.mesh: Named | None = first.mesh if first else None
        self.material: Named | None = first.material if first else None
        self.light: Named | None = first.light if first else None

    def __str__(self) -> str:
        return self.message


class InputError(Error, ValueError):
    """A room, a file of spectra or an argument that cannot be used."""


class FileError(Error, OSError):
    """A file that could not be read or written; `errno` and `filename` as of any OSError."""


class MissingFileError(FileError, FileNotFoundError):
    """There is no such file."""


class InternalError(Error, RuntimeError):
    """A fault of haarlight; please report it with the room."""


class RoomWarning(UserWarning):
    """What the user should know of a room or of points in it."""


def _file_error(message: str, path: str, number: int | None) -> FileError:
    made = (MissingFileError if number == errno.ENOENT else FileError)(message)
    made.errno, made.filename, made.file = number, path, path
    return made
