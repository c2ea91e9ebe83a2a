#!/usr/bin/env python3
"""A coloured pane, a diffuse sheet and a plane mirror: haarlight against Mitsuba 3. See README.md.

    effects.py [pane] [sheet] [mirror] [--haarlight target/release/haarlight] [--variant llvm_ad_rgb] [--paths 262144] [--runs 4]
"""

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

from courtyard import TO_XYZ
from gltf import write_quads

EFFECTS = ("pane", "sheet", "mirror")
LUMINANCE = 1000.0  # of the lamp, cd/m2
GREY = 0.5  # walls
COLOUR, ALPHA = (0.9, 0.5, 0.2), 0.8  # of the pane
RHO, TAU = 0.3, 0.4  # of the sheet
NORMAL = 0.85  # reflectance of the mirror at normal incidence


def quads(effect):
    """Corner, two sides, material; fronts where the first side times the second points. Two halves of 2 m x 3 m, 2.5 m high, a wall between
    them with a window of 1.4 m x 1.4 m or a gap of .8 m, and a lamp below the first half's ceiling."""
    x, y, z = np.eye(3)
    o = 0 * x
    for k, paint in enumerate(("wall", "beyond" if effect == "pane" else "wall")):
        at = 2 * k * x
        yield at, 3 * z, 2 * x, paint
        yield at + 2.5 * y, 2 * x, 3 * z, paint
        yield at, 2 * x, 2.5 * y, paint
        yield at + 3 * z, 2.5 * y, 2 * x, paint
    yield o, 2.5 * y, 3 * z, "wall"
    yield 4 * x, 3 * z, 2.5 * y, "beyond" if effect == "pane" else "wall"
    yield 0.5 * x + 2.4 * y + 1 * z, 1 * x, 1 * z, "lamp"
    if effect == "mirror":
        yield 2 * x, 2.5 * y, 2.2 * z, "parting"
        yield 1.1 * x + 0.5 * y + 2.98 * z, 1.5 * y, 1.8 * x, "mirror"
        return
    yield 2 * x, 0.6 * y, 3 * z, "parting"
    yield 2 * x + 2.0 * y, 0.5 * y, 3 * z, "parting"
    yield 2 * x + 0.6 * y, 1.4 * y, 0.8 * z, "parting"
    yield 2 * x + 0.6 * y + 2.2 * z, 1.4 * y, 0.8 * z, "parting"
    yield 2 * x + 0.6 * y + 0.8 * z, 1.4 * y, 1.4 * z, effect


def places():
    """Points with normals: floor and walls of both halves."""
    for i in range(4):
        for k in range(3):
            yield (0.4 + 1.1 * i, 0, 0.5 + 0.95 * k), (0, 1, 0)
    for y in (0.5, 1.2, 2.1):
        yield (4, y, 1.5), (-1, 0, 0)
        yield (3.1, y, 0), (0, 0, 1)
        yield (0, y, 1.2), (1, 0, 0)
    yield (3.0, 2.5, 1.4), (0, -1, 0)
    yield (3.0, 2.5, 2.5), (0, -1, 0)


def materials():
    def grey(name, rho, **more):
        return {"name": name, "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": 3 * [rho] + [1]}} | more

    lamp = {"emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": LUMINANCE}}}
    pane = {"name": "pane", "alphaMode": "BLEND",
            "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": [*COLOUR, ALPHA]}}
    return [grey("wall", GREY), grey("beyond", 0), grey("parting", GREY, doubleSided=True), grey("lamp", 0, **lamp), pane,
            grey("sheet", RHO, doubleSided=True), grey("mirror", NORMAL)]


SIDE = {"materials": {"sheet": {"reflectance": RHO, "transmission": TAU}, "mirror": {"reflectance": NORMAL, "mirror": True}}}


def write(folder, effect):
    """Room, side file and points."""
    write_quads(os.path.join(folder, "room.glb"), quads(effect), materials(), extensionsUsed=["KHR_materials_emissive_strength"])
    used = {paint for *_, paint in quads(effect)}
    side = {"materials": {name: said for name, said in SIDE["materials"].items() if name in used}}
    with open(os.path.join(folder, "room.spectra.json"), "w") as out:
        json.dump(side, out)
    with open(os.path.join(folder, "points.csv"), "w") as out:
        out.write("x,y,z,nx,ny,nz\n" + "".join(",".join(map(str, p + n)) + "\n" for p, n in places()))


def ours(program, folder):
    words = [program, "probe", os.path.join(folder, "room.glb"), "--points", os.path.join(folder, "points.csv"), "-q"]
    run = subprocess.run(words, capture_output=True, text=True)
    if run.returncode not in (0, 1):
        sys.exit(run.stderr)
    rows = csv.DictReader(run.stdout.splitlines())
    return np.array([[float(row[key]) for key in ("E_X", "E_Y", "E_Z")] for row in rows])


def sheet(mi, dr):
    """Mitsuba has no surface that sends a part of the light evenly out of its other side."""

    class Sheet(mi.BSDF):
        def __init__(self, properties):
            super().__init__(properties)
            both = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [mi.BSDFFlags.DiffuseReflection | both, mi.BSDFFlags.DiffuseTransmission | both]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def share(self, si, wo):
            here = si.wi.z * wo.z > 0
            return dr.select(here, RHO, TAU) / dr.pi * dr.abs(wo.z)

        def sample(self, context, si, one, two, active=True):
            wo = mi.warp.square_to_cosine_hemisphere(two)
            back = (one >= RHO / (RHO + TAU)) != (si.wi.z < 0)
            wo.z = dr.select(back, -wo.z, wo.z)
            found = mi.BSDFSample3f()
            found.wo, found.eta = wo, 1.0
            found.pdf = self.share(si, wo) / (RHO + TAU)
            found.sampled_type = dr.select(si.wi.z * wo.z > 0, mi.UInt32(int(mi.BSDFFlags.DiffuseReflection)),
                                           mi.UInt32(int(mi.BSDFFlags.DiffuseTransmission)))
            found.sampled_component = 0
            return found, mi.Spectrum(RHO + TAU) & (active & (si.wi.z != 0))

        def eval(self, context, si, wo, active=True):
            return mi.Spectrum(self.share(si, wo)) & active

        def pdf(self, context, si, wo, active=True):
            return dr.select(active, self.share(si, wo) / (RHO + TAU), 0)

        def eval_pdf(self, context, si, wo, active=True):
            return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

        def to_string(self):
            return "Sheet[]"

    mi.register_bsdf("sheet", Sheet)


def surface(paint):
    """A material in Mitsuba's words."""
    def diffuse(rho):
        return {"type": "diffuse", "reflectance": {"type": "rgb", "value": 3 * [rho]}}

    if paint == "pane":
        # Without a step of the index nothing is reflected.
        passes = [(1 - ALPHA) * (1 - ALPHA * (1 - c)) for c in COLOUR]
        return {"type": "thindielectric", "int_ior": 1.0, "ext_ior": 1.0, "specular_transmittance": {"type": "rgb", "value": passes}}
    if paint == "sheet":
        return {"type": "sheet"}
    if paint == "mirror":
        # Its metals have Schlick's form.
        return {"type": "principled", "metallic": 1.0, "roughness": 0.01, "base_color": {"type": "rgb", "value": 3 * [NORMAL]}}
    if paint == "parting":
        return {"type": "twosided", "bsdf": diffuse(GREY)}
    return diffuse({"wall": GREY, "beyond": 0.0, "lamp": 0.0}[paint])


def scene(mi, effect):
    parts = {"type": "scene", "integrator": {"type": "path", "max_depth": -1, "rr_depth": 20}}
    for k, (o, u, v, paint) in enumerate(quads(effect)):
        matrix = np.eye(4)
        matrix[:3] = np.stack([u / 2, v / 2, np.cross(u, v) / np.linalg.norm(np.cross(u, v)), o + (u + v) / 2], 1)
        parts[f"quad{k}"] = {"type": "rectangle", "to_world": mi.ScalarTransform4f(matrix), "bsdf": surface(paint)}
        if paint == "lamp":
            parts[f"quad{k}"]["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": 3 * [LUMINANCE]}}
    return mi.load_dict(parts)


def theirs(mi, dr, room, paths, seed):
    """Irradiance from directions by the cosine."""
    integrator, sampler = room.integrator(), mi.load_dict({"type": "independent"})
    found = []
    for k, (point, normal) in enumerate(places()):
        sampler.seed(seed + k, paths)
        to = mi.Frame3f(mi.Vector3f(*normal)).to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
        start = mi.Point3f(*(p + 1e-5 * n for p, n in zip(point, normal)))
        light, _, _ = integrator.sample(room, sampler, mi.RayDifferential3f(mi.Ray3f(start, to)))
        found.append([float(dr.mean(light[c])[0]) * np.pi for c in range(3)])
    return np.array(found) @ TO_XYZ.T


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("effects", nargs="*", choices=[*EFFECTS, []], help="which; all of them")
    parser.add_argument("--haarlight", default="target/release/haarlight")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--paths", type=int, default=1 << 18)
    parser.add_argument("--runs", type=int, default=4)
    args = parser.parse_args()
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(args.variant)
    sheet(mi, dr)
    for effect in args.effects or EFFECTS:
        with tempfile.TemporaryDirectory() as folder:
            write(folder, effect)
            a = ours(os.path.abspath(args.haarlight), folder)
        room = scene(mi, effect)
        runs = [theirs(mi, dr, room, args.paths, 1 + 1000 * k) for k in range(args.runs)]
        b, noise = np.mean(runs, 0), np.std(runs, 0, ddof=1) / np.sqrt(args.runs)
        for (point, _), x, y, e in zip(places(), a, b, noise):
            ratio = x / y
            print(f"{effect} {str(tuple(round(c, 2) for c in point)):18} {x[1]:8.2f} lx, {y[1]:8.2f} +- {e[1]:5.2f}, ratio "
                  f"X {ratio[0]:.4f} Y {ratio[1]:.4f} Z {ratio[2]:.4f}")
        off = a / b - 1
        print(json.dumps({"effect": effect, "rms_percent": (100 * np.sqrt(np.mean(off**2, 0))).round(3).tolist(),
                          "bias_percent": (100 * (a.sum(0) / b.sum(0) - 1)).round(3).tolist(),
                          "worst_percent": (100 * np.abs(off).max(0)).round(3).tolist(),
                          "noise_percent": (100 * np.sqrt(np.mean((noise / b) ** 2, 0))).round(3).tolist()}), flush=True)


if __name__ == "__main__":
    main()
