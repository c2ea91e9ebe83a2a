"""Spectra as haarlight has them: constant on 64 bands from 380 to 780 nm, measured, or upsampled from a linear colour
after Jakob and Hanika (2019). Written anew from the description, so that the two programs check each other; the tables
are haarlight's own (src/data)."""

import csv
import json
import os

import numpy as np

BANDS, START, END = 64, 380.0, 780.0
WIDTH = (END - START) / BANDS
KM = 683.0  # lm/W
LAMP_BRIGHTNESS = 0.5  # greatest component of a lamp's colour where it is upsampled
GREATEST_ALBEDO = 0.999
DARKEST = 1 / 1024  # darker colours are upsampled at this brightness and scaled
DATA = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "src", "data")
FILES = [
    ("cie", "illuminants"), ("cie", "fluorescent"), ("cie", "fluorescent_fl3"), ("cie", "discharge"), ("cie", "led"),
    ("macbeth", "colorchecker_ohta"), ("babelcolor", "colorchecker_babelcolor"), ("cornell", "cornell_walls"),
    ("cornell", "cornell_light"),
]
PRIMARIES = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]])  # of sRGB, x and y


class Unknown(Exception):
    """A spectrum that is not there."""


def columns(path):
    """Tables of a CSV by the names in its head: (wavelengths, values) where there is a value."""
    with open(path, newline="") as file:
        rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    try:
        float(rows[0][0])
        names = ["wavelength_nm", "value"]
    except ValueError:
        names, rows = rows[0], rows[1:]
    out = {}
    for k, name in enumerate(names[1:], 1):
        pairs = [(float(row[0]), float(row[k])) for row in rows if k < len(row) and row[k].strip()]
        out[name.strip()] = tuple(np.array(pairs).T)
    return out


def means(table, hold):
    """Mean over each band of a table that is linear between its rows, and beyond them held or zero."""
    nm, values = table
    edges = START + WIDTH * np.arange(BANDS + 1)
    outside = {} if hold else {"left": 0.0, "right": 0.0}
    knots = np.unique(np.concatenate([edges, nm[(nm > START) & (nm < END)]]))
    if not hold:
        # Where the table ends its value falls to zero at once.
        ends = [end for end in (nm[0] - 1e-9, nm[-1] + 1e-9) if START < end < END]
        knots = np.unique(np.concatenate([knots, ends]))
    at = np.interp(knots, nm, values, **outside)
    areas = np.concatenate([[0], np.cumsum((at[1:] + at[:-1]) / 2 * np.diff(knots))])
    return np.diff(areas[np.searchsorted(knots, edges)]) / WIDTH


class Spectra:
    """The observer, D65, and what follows from them."""

    def __init__(self):
        observer = columns(os.path.join(DATA, "cmf_1931.csv"))
        # Integrals of the matching functions over each band, nm.
        self.weights = np.array([means(table, False) * WIDTH for table in observer.values()])
        d65 = means(named("cie/D65")[0], True)
        self.d65 = d65 / (KM * self.weights[1] @ d65)
        self.white = KM * self.weights @ self.d65
        unscaled = np.array([[x / y, 1.0, (1 - x - y) / y] for x, y in PRIMARIES]).T
        self.to_xyz = unscaled * np.linalg.solve(unscaled, self.white)

    def reflectance(self, rgb):
        """A smooth reflectance that has this linear colour under D65."""
        rgb = np.clip(np.asarray(rgb, dtype=np.float64), 0, 1)
        if np.ptp(rgb) == 0:
            return np.full(BANDS, rgb[0])
        if rgb.max() < DARKEST:
            return self.reflectance(rgb / rgb.max() * DARKEST) * rgb.max() / DARKEST
        t = (2 * np.arange(BANDS) + 1) / BANDS - 1
        powers = np.stack([t * t, t, np.ones(BANDS)])
        weights = KM * self.weights * self.d65
        curve = lambda c: 0.5 + (x := c @ powers) / (2 * np.sqrt(1 + x * x))
        target = self.lab(self.to_xyz @ rgb)
        residual = lambda c: self.lab(weights @ curve(c)) - target
        grey = np.clip(self.to_xyz[1] @ rgb, 1e-6, 1 - 1e-6)
        best = np.array([0, 0, (grey - 0.5) / np.sqrt(grey * (1 - grey))])
        return curve(least_squares(residual, best))

    def lab(self, xyz):
        t = xyz / self.white
        f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
        return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])

    def lamp(self, rgb):
        """D65 shaped by a colour: power on the bands, its luminous size the luminance of the colour."""
        rgb = np.asarray(rgb, dtype=np.float64)
        scale = rgb.max() / LAMP_BRIGHTNESS
        return self.reflectance(rgb / scale) * scale * self.d65

    def size(self, power):
        """Luminous size of a power."""
        return KM * self.weights[1] @ power


def least_squares(residual, best):
    """Levenberg and Marquardt's way to where a residual of three numbers is zero."""
    now, damping = residual(best), 1e-3
    for _ in range(500):
        if now @ now < 1e-16 or damping > 1e14:
            break
        step = 1e-6 * np.maximum(1, np.abs(best))
        slopes = np.stack([(residual(best + d) - residual(best - d)) / (2 * d.sum()) for d in np.diag(step)], 1)
        square = slopes.T @ slopes
        move = np.linalg.solve(square + damping * np.diag(np.diag(square) + 1e-30), slopes.T @ now)
        there = np.clip(best - move, -1e4, 1e4)
        new = residual(there)
        if new @ new < now @ now:
            best, now, damping = there, new, max(damping * 0.2, 1e-12)
        else:
            damping *= 5
    return best


def named(name):
    """A table by its name in haarlight's registry, and whether it is a reflectance."""
    prefix, _, rest = name.partition("/")
    for folder, file in FILES:
        if folder == prefix:
            table = columns(os.path.join(DATA, file + ".csv")).get(rest)
            if table is not None:
                return table, file in ("colorchecker_ohta", "colorchecker_babelcolor", "cornell_walls")
    if prefix == "blackbody":
        nm = np.arange(START - 1, END + 2)
        metres = nm * 1e-9
        return (nm, 1e-30 / (metres**5 * np.expm1(0.014387768775 / (metres * float(rest))))), False
    raise Unknown(name)


def sampled(entry, folder, hold):
    """Bands of `{"name": ...}` or `{"csv": ...}`, and whether they carry a unit."""
    if "name" in entry:
        table, _ = named(entry["name"])
        return means(table, True), False
    path = os.path.join(folder, entry["csv"])
    if not os.path.exists(path):
        raise Unknown(path)
    return means(next(iter(columns(path).values())), hold), True


def side_file(path):
    """The file of spectra beside a room, if it is there."""
    beside = os.path.splitext(path)[0] + ".spectra.json"
    if not os.path.exists(beside):
        return {}
    with open(beside) as file:
        return json.load(file)


def give(room, path):
    """Gives every material and lamp of a room its spectra: `reflectance`, `power` on the bands."""
    spectra, file, folder = Spectra(), side_file(path), os.path.dirname(path)
    for material in room.materials:
        own = material.spectra | file.get("materials", {}).get(material.name, {})
        if "reflectance" in own:
            material.reflectance = np.minimum(sampled(own["reflectance"], folder, True)[0], GREATEST_ALBEDO)
        else:
            material.reflectance = np.minimum(spectra.reflectance(material.base_color), GREATEST_ALBEDO)
        nits = float(spectra.to_xyz[1] @ material.emission)
        if "emission" in own:
            power, has_unit = sampled(own["emission"], folder, False)
            size = own["emission"].get("luminance_cd_m2", None if has_unit else nits)
            material.power = power if size is None else power * size / spectra.size(power)
        elif nits > 0:
            material.power = spectra.lamp(material.emission)
    for lamp in room.lamps:
        own = lamp.spectra | file.get("lights", {}).get(lamp.name, {})
        if own:
            power, _ = sampled(own, folder, False)
            lamp.power = power * float(spectra.to_xyz[1] @ lamp.intensity) / spectra.size(power)
        else:
            lamp.power = spectra.lamp(lamp.intensity)
    return spectra
