"""What functions return, and what they take as the words of a file of spectra."""

from __future__ import annotations

import json
from collections.abc import Mapping
from os import PathLike, fspath
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Probe(NamedTuple):
    """Light at N points."""

    lux: NDArray[np.float64]
    """Illuminance, (N,), lx."""
    xyz: NDArray[np.float64]
    """Tristimulus irradiance, (N, 3), lm/m2."""
    bands: NDArray[np.float64]
    """Spectral irradiance on the bands, (N, 64), W/m2/nm."""
    plus_minus: NDArray[np.float64]
    """Stated error of lux, (N,), lx: an estimate of its root mean square; NaN while it is not known."""


class Spectrum(NamedTuple):
    """A spectrum that rooms may name."""

    kind: str
    """`light` or `reflectance`."""
    wavelengths: NDArray[np.float64]
    """(N,), nm."""
    values: NDArray[np.float64]
    """(N,), relative power, or reflectance in [0, 1]."""


def _json(given: Any) -> str:
    return json.dumps(_plain(given), allow_nan=False)


def _plain(given: Any) -> Any:
    if isinstance(given, Mapping):
        if {"wavelengths", "values"} <= given.keys():
            others = {key: given[key] for key in given if key not in ("wavelengths", "values")}
            return _plain(others) | {"csv": _rows(given["wavelengths"], given["values"])}
        return {str(key): _plain(value) for key, value in given.items()}
    if isinstance(given, Spectrum):
        return {"csv": _rows(given.wavelengths, given.values)}
    if isinstance(given, (list, tuple)):
        return [_plain(value) for value in given]
    if isinstance(given, (np.ndarray, np.generic)):
        return given.tolist()
    return fspath(given) if isinstance(given, PathLike) else given


def _rows(wavelengths: Any, values: Any) -> str:
    pair = [np.asarray(numbers, dtype=np.float64) for numbers in (wavelengths, values)]
    if pair[0].ndim != 1 or pair[0].shape != pair[1].shape:
        raise ValueError(f"wavelengths of shape {pair[0].shape} and values of shape {pair[1].shape} are no pair of rows")
    return "".join(f"{float(nm)!r},{float(value)!r}\n" for nm, value in zip(*pair))
