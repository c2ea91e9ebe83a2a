#!/usr/bin/env python3
"""CPU time to error: haarlight against Mitsuba 3, same room, same points, same spectra, same cores. See README.md."""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time

import numpy as np

from metrics import DARK, de2000

ILLUMINANCE = [5, 2, 1, 0.5]  # RMS error of illuminance, per cent of the mean illuminance
COLOUR = [2, 1, 0.5]  # mean CIEDE2000
SETTINGS = [2, 0.5, 0.25, 0.1, 0.05]  # haarlight's --error


class Mitsuba:
    """The room in Mitsuba, and irradiance at its points by the `path` integrator.

    Each path comes from just above a point down onto the surface there, so that the integrator samples lamps and
    directions at the point itself; the radiance it finds, times pi over the reflectance, is the irradiance.
    """

    def __init__(self, room):
        import drjit as dr
        import mitsuba as mi

        mi.set_variant("llvm_ad_spectral")
        self.dr, self.mi, self.room = dr, mi, room
        scene = {"type": "scene"}
        positions = np.array(room["positions"])
        triangles, owners = np.array(room["triangles"]), np.array(room["material"])
        for m, material in enumerate(room["materials"]):
            mine = triangles[owners == m]
            if len(mine) == 0:
                continue
            shape = mi.Mesh(f"m{m}", 3 * len(mine), len(mine), props=self.properties(material))
            parameters = mi.traverse(shape)
            parameters["vertex_positions"] = positions[mine].ravel()
            parameters["faces"] = np.arange(3 * len(mine))
            parameters.update()
            scene[f"m{m}"] = shape
        self.scene = mi.load_dict(scene)
        self.integrator = mi.load_dict({"type": "path", "max_depth": -1})
        normals = np.array(room["normals"])
        size = np.ptp(positions, axis=0).max()
        points = np.array(room["points"]) + 1e-4 * size * normals
        vectors = lambda rows: mi.Point3f(np.ascontiguousarray(rows.T).astype(np.float32))
        numbers = lambda values: mi.Float(np.asarray(values, dtype=np.float32).ravel())
        self.origins, self.directions = vectors(points), vectors(-normals)
        self.count = len(points)
        self.owner = mi.UInt32(np.array(room["point_material"], dtype=np.uint32))
        self.reflectance = numbers([material["reflectance"] for material in room["materials"]])
        self.matching = [numbers(np.array(w) / room["width_nm"]) for w in room["weights"]]

    def properties(self, material):
        mi = self.mi
        properties = mi.Properties()
        reflectance = mi.load_dict({"type": "diffuse", "reflectance": self.spectrum(material["reflectance"])})
        if material["two_sided"]:
            reflectance = mi.load_dict({"type": "twosided", "bsdf": reflectance})
        properties["bsdf"] = reflectance
        if material["emission"]:
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": self.spectrum(material["emission"])})
        return properties

    def spectrum(self, bands):
        """Constant on each band, zero outside."""
        start, width = self.room["start_nm"], self.room["width_nm"]
        left = start + width * np.arange(len(bands))
        nm = np.stack([left + 1e-3, left + width - 1e-3], 1).ravel()
        values = np.repeat(bands, 2)
        join = lambda list: ", ".join(f"{x:.9g}" for x in list)
        return {"type": "irregular", "wavelengths": join(nm), "values": join(values)}

    def irradiance(self, samples, seed, most_rays=1 << 22):
        """Tristimulus irradiance with `samples` paths a point (a power of four)."""
        part = max(1, min(samples, most_rays // self.count))
        part = 4 ** ((part.bit_length() - 1) // 2)
        sums = np.zeros((self.count, 3))
        for k in range(samples // part):
            sums += self.part(part, seed + k) * (part / samples)
        return sums

    def part(self, samples, seed):
        dr, mi, room = self.dr, self.mi, self.room
        sampler = mi.load_dict({"type": "multijitter", "sample_count": samples})
        samples = sampler.sample_count()
        sampler.set_samples_per_wavefront(samples)
        sampler.seed(seed, self.count * samples)
        index = dr.arange(mi.UInt32, self.count * samples) // samples
        pick = lambda table: dr.gather(mi.Point3f, table, index)
        wavelengths, weight = mi.sample_rgb_spectrum(mi.sample_shifted(sampler.next_1d()))
        ray = mi.RayDifferential3f(pick(self.origins), mi.Vector3f(pick(self.directions)), 0.0, wavelengths)
        radiance, _, _ = self.integrator.sample(self.scene, sampler, ray, None, True)
        owner = dr.gather(mi.UInt32, self.owner, index)
        sums = [mi.Float(0), mi.Float(0), mi.Float(0)]
        for k in range(len(wavelengths)):
            place = (wavelengths[k] - room["start_nm"]) / room["width_nm"]
            band = mi.UInt32(dr.clip(place, 0, 63))
            reflectance = dr.gather(mi.Float, self.reflectance, band + 64 * owner)
            density = radiance[k] * weight[k] * dr.pi / dr.maximum(reflectance, 1e-6)
            density = dr.select((place >= 0) & (place < 64), density, 0)
            for c in range(3):
                sums[c] += density * dr.gather(mi.Float, self.matching[c], band) / len(wavelengths)
        xyz = [dr.block_sum(x, samples) / samples for x in sums]
        dr.eval(xyz)
        return np.stack([np.array(x, dtype=np.float64) for x in xyz], 1)


class Truth:
    """Two independent halves of a reference; their mean is the reference, their difference its noise."""

    def __init__(self, halves):
        self.xyz = (halves[0] + halves[1]) / 2
        self.white = 2 * self.xyz.mean(axis=0)
        self.lit = self.xyz[:, 1] > DARK * self.xyz[:, 1].mean()
        apart = (halves[0] - halves[1])[self.lit, 1]
        self.noise = 100 * np.sqrt(np.mean(apart**2)) / 2 / self.xyz[self.lit, 1].mean()

    def errors(self, xyz):
        """(RMS illuminance error in per cent of the mean, the reference's own noise taken off; mean dE00)"""
        a, b = xyz[self.lit], self.xyz[self.lit]
        rms = 100 * np.sqrt(np.mean((a[:, 1] - b[:, 1]) ** 2)) / b[:, 1].mean()
        return np.sqrt(max(rms**2 - self.noise**2, 1e-12)), de2000(a, b, self.white).mean()


def haarlight(program, room, count, error):
    """Per round: (CPU seconds, tristimulus irradiance)."""
    out = subprocess.run([program, room, str(count), "run", str(error)], check=True, capture_output=True, text=True)
    rounds = [json.loads(line) for line in out.stdout.splitlines()]
    return [(r["cpu_s"], np.array(r["xyz"]), f"--error {error}, round {r['round']}") for r in rounds]


def mitsuba(renderer, most_seconds, seed):
    """Four times the samples each time (squares suit the sampler): (CPU seconds, tristimulus irradiance)."""
    out, samples = [], 4
    while True:
        start = time.process_time()
        xyz = renderer.irradiance(samples, seed)
        out.append((time.process_time() - start, xyz, f"{samples} paths"))
        if out[-1][0] > most_seconds / 4:
            return out
        samples, seed = samples * 4, seed + 1_000_003


def first(curve, column, target):
    """Least CPU seconds of a run at or below the target."""
    good = [row for row in curve if row[1][column] <= target]
    return min(good, key=lambda row: row[0]) if good else None


def between(curve, column, target):
    """CPU seconds to the target on the line through the runs (log-log, least squares): fair to a program that can stop
    anywhere. None beyond the longest run."""
    x = np.log([row[0] for row in curve])
    y = np.log([row[1][column] for row in curve])
    slope, offset = np.polyfit(x[1:], y[1:], 1)
    seconds = np.exp((np.log(target) - offset) / slope)
    return seconds if slope < 0 and seconds <= 1.5 * np.exp(x.max()) else None


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("room")
    parser.add_argument("--program", default="target/release/examples/points")
    parser.add_argument("--points", type=int, default=200)
    parser.add_argument("--repeat", type=int, default=3, help="runs of each, in turn")
    parser.add_argument("--seconds", type=float, default=20, help="CPU seconds of Mitsuba's longest run")
    parser.add_argument("--reference", type=int, default=1 << 17, help="Mitsuba's paths a point for the reference: twice a power of four")
    parser.add_argument("--cores", default="", help="pin both to these, for example 0,1")
    arguments = parser.parse_args()
    if arguments.cores:
        os.sched_setaffinity(0, [int(core) for core in arguments.cores.split(",")])
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "room.json")
        subprocess.run([arguments.program, arguments.room, str(arguments.points), "scene", path], check=True)
        with open(path) as file:
            room = json.load(file)
    renderer = Mitsuba(room)
    start = time.process_time()
    truth = Truth([renderer.irradiance(arguments.reference // 2, seed) for seed in (77_000_000, 99_000_000)])
    print(f"{arguments.room}: {truth.lit.sum()} of {arguments.points} points; reference: Mitsuba, {arguments.reference} "
          f"paths a point, {time.process_time() - start:.0f} CPU s, noise {truth.noise:.3f} % RMS", flush=True)
    audit = np.array(room["audit_xyz"])
    print("  haarlight's audit differs by %.3f %% RMS, dE00 %.3f," % truth.errors(audit))
    ratio = audit[truth.lit, 1].sum() / truth.xyz[truth.lit, 1].sum()
    print(f"  {100 * (ratio - 1):+.3f} % in the mean", flush=True)

    ours, theirs = [], []
    for run in range(arguments.repeat):
        for error in SETTINGS:
            ours += [(s, truth.errors(x), how) for s, x, how in haarlight(arguments.program, arguments.room, arguments.points, error)]
        if run == 0:
            # Kernels are compiled on first use, and that does not count.
            mitsuba(renderer, arguments.seconds, 1)
        theirs.append([(s, truth.errors(x), how) for s, x, how in mitsuba(renderer, arguments.seconds, 1000 * (run + 2))])
    for name, curve in [("haarlight", sorted(ours)), ("Mitsuba", theirs[0])]:
        for seconds, (rms, de), how in curve:
            print(f"    {name:9} {seconds:8.3f} s  {rms:7.3f} %  dE00 {de:6.3f}  {how}", file=sys.stderr)

    print(f"\n| to | haarlight, CPU s | Mitsuba, CPU s | ratio |\n|---|---|---|---|")
    for column, targets, name in [(0, ILLUMINANCE, "RMS {} %"), (1, COLOUR, "mean dE00 {}")]:
        for target in targets:
            mine = first(ours, column, target)
            other = [between(curve, column, target) for curve in theirs]
            other = None if None in other else float(np.median(other))
            text = lambda x, none: f"{x:.2f}" if x is not None else none
            best = "not by %.3g" % min(row[1][column] for row in ours)
            ratio = f"{other / mine[0]:.1f}" if mine and other else ("" if not mine else f"> {max(c[-1][0] for c in theirs) / mine[0]:.0f}")
            print(f"| {name.format(target)} | {text(mine and mine[0], best)} | {text(other, 'not in %.0f s' % arguments.seconds)} | {ratio} |")
    print(f"\n{platform.machine()}, {os.cpu_count()} cores, Mitsuba {renderer.mi.__version__}, {time.strftime('%Y-%m-%d')}")


if __name__ == "__main__":
    main()
