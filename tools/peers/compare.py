#!/usr/bin/env python3
"""haarlight's light at random points of any room, beside Mitsuba 3's. See README.md."""

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile

import numpy as np

import grey
import peer
import places
import room as rooms
from drawn import Baked
from gltf import Unreadable
from metrics import Truth
from spectra import Unknown

RUNS = 8  # of the reference between looks at its noise
FEWEST = 16  # runs; fewer do not tell their noise
COLUMNS = "room | `--error` | points | rel % | bias % | median % | off > 5 % | dE00 | 95 % | stated | CPU s | Mitsuba, CPU s"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("room", help=".glb or .gltf")
    parser.add_argument("--grey", action="store_true", help="every reflectance .5, lamps without colour, no textures")
    parser.add_argument("--errors", default="2,1,.5", help="haarlight's --error, one run each; empty: make the reference, or make it better")
    parser.add_argument("--points", type=int, default=300)
    parser.add_argument("--reference", help="keep the reference here (.npz), and take it from here if it is there")
    parser.add_argument("--noise", type=float, default=0.25, help="median standard error of the reference's points, per cent")
    parser.add_argument("--seconds", type=float, default=600, help="CPU seconds that the reference may take")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--program", default="target/release/haarlight")
    parser.add_argument("--file", action="store_true", help="with --grey: the light of the baked file as a viewer draws it, and its size, in place of probe's")
    parser.add_argument("--bare", action="store_true", help="rows of the table without its head")
    wanted = parser.parse_args()
    if wanted.file and not wanted.grey:
        parser.error("--file is for --grey rooms: their irradiance is twice their radiosity")
    return wanted


def say(text):
    print(f"  {text}", file=sys.stderr, flush=True)


def digest(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


class Reference:
    """What the peer measured, and what it took."""

    FIELDS = ("points", "normals", "runs", "seconds", "paths", "digest")

    def __init__(self, points, normals, runs, seconds, paths, digest):
        self.points, self.normals, self.runs = points, normals, runs
        self.seconds, self.paths, self.digest = float(seconds), int(paths), str(digest)

    @staticmethod
    def open(path, wanted):
        """The kept one if it is of this very file, else a new one. Where only the reference is asked for, a kept one is
        made better."""
        kept = wanted.reference and os.path.exists(wanted.reference)
        reference = Reference.load(wanted.reference) if kept else None
        if reference and reference.digest == digest(path) and wanted.errors:
            return reference
        room = rooms.read(path)
        renderer = peer.Peer(room, path)
        if reference is None or reference.digest != digest(path):
            chosen = places.chosen(room, renderer, wanted.points, wanted.seed)
            if len(chosen) == 0:
                sys.exit(f"{wanted.room}: no place that light reaches")
            nothing = np.zeros((0, len(chosen), 3))
            reference = Reference(chosen.points, chosen.normals, nothing, 0, 0, digest(path))
        reference.improve(renderer, wanted)
        return reference

    @staticmethod
    def load(path):
        with np.load(path) as kept:
            return Reference(*(kept[key] for key in Reference.FIELDS))

    def improve(self, renderer, wanted):
        """Adds runs until the noise is as wanted, and keeps what there is after every few."""
        chosen = places.Places(self.points, self.normals, None)
        while len(self.runs) < FEWEST or (
            100 * Truth(self.runs).median_noise() > wanted.noise and self.seconds < wanted.seconds
        ):
            more, seconds, self.paths = peer.runs_more(renderer, chosen, RUNS, len(self.runs), wanted.seed)
            self.runs, self.seconds = np.concatenate([self.runs, more]), self.seconds + seconds
            noise = 100 * Truth(self.runs).median_noise()
            say(f"{len(self.runs)} runs of {self.paths} paths a point, {self.seconds:.0f} CPU s, noise {noise:.2f} %")
            if wanted.reference:
                new = wanted.reference + ".new.npz"
                np.savez(new, **{key: getattr(self, key) for key in self.FIELDS})
                os.replace(new, wanted.reference)

    def seconds_to(self, rel, truth):
        """CPU seconds after which the peer is as right as this: its error falls with the root of its time."""
        whole = 100 * truth.rms_noise()
        return self.seconds * (whole / rel) ** 2 if rel > 0 else float("inf")


def timed(command):
    """(CPU seconds of the whole process, what it printed)."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    out = subprocess.run(command, check=False, stdout=subprocess.PIPE, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if not out.stdout.strip():
        sys.exit(f"{' '.join(command)}: exit code {out.returncode}")
    return after.ru_utime - before.ru_utime, out.stdout


def probed(program, path, reference, error):
    """(CPU seconds, tristimulus irradiance, stated dE00)."""
    with tempfile.TemporaryDirectory() as folder:
        points = os.path.join(folder, "points.csv")
        rows = np.concatenate([reference.points, reference.normals], axis=1)
        np.savetxt(points, rows, delimiter=",", header="x,y,z,nx,ny,nz", comments="", fmt="%.17g")
        seconds, out = timed([program, "probe", path, "--points", points, "--error", str(error), "--json", "-q"])
    found = json.loads(out)
    columns = [found["columns"].index(name) for name in ("E_X", "E_Y", "E_Z")]
    xyz = np.array(found["rows"], dtype=np.float64)[:, columns]
    return seconds, xyz, found["error_de2000"]["value"]


def drawn(program, path, reference, error):
    """The same of what a bake wrote, and says how large that is."""
    with tempfile.TemporaryDirectory() as folder:
        baked = os.path.join(folder, "baked.glb")
        seconds, out = timed([program, "bake", path, "-o", baked, "--xyz", "--error", str(error), "--json", "-q"])
        xyz = Baked(baked).irradiance(reference.points, reference.normals)
        size = os.path.getsize(baked)
    verdict = json.loads(out.strip().splitlines()[-1])
    say(f"--error {error:g}: {verdict['vertices']} vertices, {size / 1e6:.2f} MB with `_XYZ`")
    return seconds, xyz, verdict["error_de2000"]["value"]


def row(name, error, reference, truth, run):
    seconds, xyz, stated = run
    e = truth.errors(xyz)
    stated = "-" if stated is None else f"{stated:.2f}"
    return (f"{name} | {error:g} | {e['points']} | {e['rel']:.2f} | {e['bias']:+.2f} | {e['median']:+.2f} | {e['far']:.1f} | "
            f"{e['de_mean']:.3f} | {e['de_95']:.2f} | {stated} | {seconds:.2f} | {reference.seconds_to(e['rel'], truth):.2f}")


def main():
    wanted = arguments()
    name = os.path.splitext(os.path.basename(wanted.room))[0] + (", grey" if wanted.grey else "")
    with tempfile.TemporaryDirectory() as folder:
        path = wanted.room
        if wanted.grey:
            path = os.path.join(folder, "grey.glb")
            grey.write_grey(wanted.room, path)
        reference = Reference.open(path, wanted)
        truth = Truth(reference.runs)
        say(f"{name}: {truth.lit.sum()} of {len(reference.points)} points; reference: {truth.runs} runs of {reference.paths} "
            f"paths a point, {reference.seconds:.0f} CPU s, standard error of a point {100 * truth.median_noise():.2f} % "
            f"(median), {100 * truth.rms_noise():.2f} % (RMS), dE00 {truth.colour_noise:.3f}")
        light = drawn if wanted.file else probed
        runs = [(e, light(wanted.program, path, reference, e)) for e in map(float, filter(None, wanted.errors.split(",")))]
    if runs and not wanted.bare:
        print(f"| {COLUMNS} |\n|{'---|' * (COLUMNS.count('|') + 1)}")
    for error, run in sorted(runs, key=lambda run: -truth.errors(run[1][1])["rel"]):
        print(f"| {row(name, error, reference, truth, run)} |", flush=True)


if __name__ == "__main__":
    try:
        main()
    except (Unreadable, Unknown) as problem:
        sys.exit(f"cannot be compared: {problem}")
