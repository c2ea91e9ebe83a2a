"""Mitsuba 3's side: the room as its scene, and irradiance at places by paths through it.

The light at a place is found in two ways, weighted against each other (Veach's balance heuristic): a lamp is picked and
looked at, and a ray goes out by the cosine to the next surface, where the same is done again. No reflectance of the place
is needed for that. Mitsuba's own `path` passes over the last .9 thousandth of a ray to a lamp: bars 4 mm before a lamp
that is 5 m away hide nothing from it, and a garage came out .9 % too bright. So lamps are looked at by whole rays here.

Mitsuba's rays begin .09 thousandth of the largest coordinate before a surface. So the room's middle is the origin, and the rays
of a place, which stands before its surface already, begin at the place: in a slit of a centimetre, 20 m from the origin of a
restaurant, 1.7 mm decided whether lamps are seen.
"""

import time

import numpy as np

import spectra
from gltf import Unreadable
from room import GREATEST_ALBEDO, Part

MOST_RAYS = 1 << 20  # at once
SPOT_PIXELS = 1024  # of the picture with a spot's fall-off
NEAR = 1e-5  # of its distance, within which a lamp is what a ray met
SHEET = 1e-5  # of the room's size, between the two sides of a lamp that shines from both


class Peer:
    """The room in Mitsuba: one number for light where all is grey, the same spectra as haarlight where nothing is painted
    with pictures, else linear colours."""

    def __init__(self, room, path):
        import drjit as dr
        import mitsuba as mi

        grey = room.is_grey() and not spectra.side_file(path)
        self.kind = "mono" if grey else "rgb" if room.is_painted() else "spectral"
        mi.set_variant(f"llvm_ad_{self.kind}")
        self.dr, self.mi, self.room, self.size = dr, mi, room, room.size()
        self.middle = sum(room.box()) / 2
        self.spectra = spectra.Spectra() if self.kind != "spectral" else spectra.give(room, path)
        scene = {"type": "scene"}
        for k, part in enumerate(merged(room)):
            for name, shape in self.shapes(part):
                scene[f"part{k}{name}"] = shape
        for k, lamp in enumerate(room.lamps):
            scene[f"lamp{k}"] = self.lamp(lamp)
        self.scene = mi.load_dict(scene)

    # The scene

    def value(self, rgb, bands):
        """A reflectance or a power in the way that this variant has it."""
        if self.kind == "mono":
            return {"type": "uniform", "value": float(self.spectra.to_xyz[1] @ rgb)}
        if self.kind == "rgb":
            return {"type": "rgb", "value": [float(c) for c in rgb]}
        if not np.any(bands):
            return {"type": "uniform", "value": 0.0}
        left = spectra.START + spectra.WIDTH * np.arange(spectra.BANDS)
        nm = np.stack([left + 1e-3, left + spectra.WIDTH - 1e-3], 1).ravel()
        join = lambda numbers: ", ".join(f"{x:.9g}" for x in numbers)
        return {"type": "irregular", "wavelengths": join(nm), "values": join(np.repeat(bands, 2))}

    def bitmap(self, texture, factor, most=None):
        if texture.wrap[0] != texture.wrap[1]:
            raise Unreadable("a picture that goes on differently in u and v")
        pixels = texture.pixels[..., :3] * factor
        if most is not None:
            pixels = np.minimum(pixels, most)
        return {
            "type": "bitmap", "bitmap": self.mi.Bitmap(pixels.astype(np.float32)), "raw": True,
            "filter_type": "bilinear", "wrap_mode": texture.wrap[0],
        }

    def paint(self, material, colors):
        if material.paint is not None:
            return self.bitmap(material.paint, material.base_color, GREATEST_ALBEDO)
        if colors:
            return {"type": "mesh_attribute", "name": "vertex_color"}
        return self.value(np.minimum(material.base_color, GREATEST_ALBEDO), material.reflectance)

    def shapes(self, part):
        """One, or two back to back where a lamp shines from both sides: Mitsuba's lamps have one."""
        material = self.room.materials[part.material]
        shines = material.shines()
        if not (shines and material.two_sided):
            return [("", self.mesh(part, material, material.two_sided, shines, part.corners))]
        normal = np.cross(part.corners[:, 1] - part.corners[:, 0], part.corners[:, 2] - part.corners[:, 0])
        normal *= SHEET * self.size / np.linalg.norm(normal, axis=1)[:, None]
        back = part.turned((part.corners - normal[:, None])[:, ::-1])
        return [("front", self.mesh(part, material, False, True, part.corners)),
                ("back", self.mesh(back, material, False, True, back.corners))]

    def mesh(self, part, material, two_sided, shines, corners):
        mi = self.mi
        properties = mi.Properties()
        paint = {"type": "diffuse", "reflectance": self.paint(material, part.colors is not None)}
        properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": paint} if two_sided else paint)
        if shines:
            if material.emission_texture is not None and part.emission_uv is not None:
                if material.paint is not None and not np.array_equal(part.uv, part.emission_uv):
                    raise Unreadable(f"material '{material.name}': pictures of paint and of light lie differently")
                radiance = self.bitmap(material.emission_texture, material.emission)
            else:
                radiance = self.value(material.emission, material.power)
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
        uv = part.emission_uv if part.uv is None else part.uv
        n = len(corners)
        mesh = mi.Mesh("part", 3 * n, n, props=properties, has_vertex_texcoords=uv is not None)
        if part.colors is not None and material.paint is None:
            mesh.add_attribute("vertex_color", 3, (part.colors * material.base_color).ravel().astype(np.float32))
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = (corners - self.middle).ravel().astype(np.float32)
        parameters["faces"] = np.arange(3 * n, dtype=np.uint32)
        if uv is not None:
            # A picture given as an array begins at v = 0, as in glTF.
            parameters["vertex_texcoords"] = uv.ravel().astype(np.float32)
        parameters.update()
        return mesh

    def lamp(self, lamp):
        mi = self.mi
        position = lamp.position - self.middle
        if lamp.kind == "point":
            return {"type": "point", "position": list(position), "intensity": self.value(lamp.intensity, lamp.power)}
        if lamp.kind == "directional":
            return {"type": "directional", "direction": list(lamp.direction), "irradiance": self.value(lamp.intensity, lamp.power)}
        up = [0, 1, 0] if abs(lamp.direction[1]) < 0.9 else [1, 0, 0]
        target = list(position + lamp.direction)
        degrees = float(np.degrees(lamp.outer))
        return {
            "type": "spot", "to_world": mi.ScalarTransform4f().look_at(list(position), target, up),
            # The picture does the fall-off, which is not the one that Mitsuba has.
            "cutoff_angle": degrees, "beam_width": degrees * (1 - 1e-6),
            "intensity": self.value(lamp.intensity, lamp.power), "texture": self.fall_off(lamp),
        }

    def fall_off(self, lamp):
        """glTF's fall-off between the two cones of a spot, on the square that the outer one fills."""
        axis = (np.arange(SPOT_PIXELS) + 0.5) / SPOT_PIXELS * 2 - 1
        radius = np.hypot(*np.meshgrid(axis, axis)) * np.tan(lamp.outer)
        scale = 1 / max(0.001, np.cos(lamp.inner) - np.cos(lamp.outer))
        share = np.clip((1 / np.sqrt(1 + radius**2) - np.cos(lamp.outer)) * scale, 0, 1) ** 2
        return {"type": "bitmap", "bitmap": self.mi.Bitmap(share[..., None].astype(np.float32)),
                "raw": True, "filter_type": "bilinear", "wrap_mode": "clamp"}

    # Measuring

    def tables(self, places):
        mi = self.mi
        rows = lambda values: np.ascontiguousarray(values.T).astype(np.float32)
        return mi.Point3f(rows(places.points - self.middle)), mi.Vector3f(rows(places.normals))

    def backs(self, places, looks, seed):
        """The share of directions, by the cosine, in which the nearest thing is a black back."""
        dr, mi = self.dr, self.mi
        points, normals = self.tables(places)
        index = dr.arange(mi.UInt32, len(places) * looks) // looks
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, len(places) * looks)
        frame = mi.Frame3f(dr.gather(mi.Vector3f, normals, index))
        to = frame.to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
        hit = self.scene.ray_intersect(mi.Ray3f(dr.gather(mi.Point3f, points, index), to))
        one_sided = ~mi.has_flag(hit.bsdf().flags(), mi.BSDFFlags.BackSide)
        back = hit.is_valid() & one_sided & (dr.dot(hit.n, to) > 0)
        share = dr.block_sum(dr.select(back, mi.Float(1), 0), looks) / looks
        return np.array(share)

    def irradiance(self, places, samples, seed):
        """Tristimulus irradiance (lx for Y) with about `samples` paths from each place."""
        most = max(1, MOST_RAYS // len(places))
        runs = -(-samples // most)
        side = max(1, int(np.sqrt(samples / runs)))
        return np.mean([self.run(places, side, (seed + 7919 * k) % 2**31) for k in range(runs)], axis=0)

    def run(self, places, side, seed):
        """side x side paths from each place, their first directions one to a cell of a grid."""
        dr, mi = self.dr, self.mi
        samples = side * side
        points, normals = self.tables(places)
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, len(places) * samples)
        number = dr.arange(mi.UInt32, len(places) * samples)
        index, cell = number // samples, number % samples
        corner = mi.Point2f(mi.Float(cell % side), mi.Float(cell // side))
        stratified = lambda: (corner + sampler.next_2d()) / side
        here = dr.zeros(mi.SurfaceInteraction3f, len(places) * samples)
        here.p, here.n = dr.gather(mi.Point3f, points, index), mi.Normal3f(dr.gather(mi.Vector3f, normals, index))
        here.sh_frame = mi.Frame3f(here.n)
        per_wave = None
        if self.kind == "spectral":
            here.wavelengths, per_wave = mi.sample_rgb_spectrum(mi.sample_shifted(sampler.next_1d()))

        light = self.paths(here, stratified(), stratified(), sampler)
        light = self.tristimulus(light, here.wavelengths, per_wave)
        means = [dr.block_sum(x, samples) / samples for x in light]
        dr.eval(means)
        means = np.stack([np.array(x, dtype=np.float64) for x in means], 1)
        return means * self.spectra.white if self.kind == "mono" else means

    def paths(self, here, to_lamp, onwards, sampler):
        """Irradiance at `here` by one path each, first directions from numbers given."""
        dr, mi, scene = self.dr, self.mi, self.scene
        lamp, radiance = self.look(here, to_lamp, at_place=True)
        cosine = dr.maximum(dr.dot(here.n, lamp.d), 0)
        light = radiance * (cosine * dr.select(lamp.delta, 1, lamp.pdf / (lamp.pdf + cosine / dr.pi)))

        to = here.sh_frame.to_world(mi.warp.square_to_cosine_hemisphere(onwards))
        ray = mi.Ray3f(here.p, to, 0.0, here.wavelengths)
        state = {
            "light": light, "share": mi.Spectrum(dr.pi), "ray": ray, "last": mi.Interaction3f(here), "bounce": mi.UInt32(0),
            "density": dr.maximum(dr.dot(here.n, to), 0) / dr.pi, "sampler": sampler, "on": mi.Bool(True),
        }
        return dr.while_loop((state,), lambda s: s["on"], lambda s: (self.bounce(s),), label="paths")[0]["light"]

    def bounce(self, s):
        """The path goes on to the next surface: what shines there, what lamps bring there, and where to next."""
        dr, mi, scene, sampler = self.dr, self.mi, self.scene, s["sampler"]
        hit = scene.ray_intersect(s["ray"], s["on"])
        emitter = hit.emitter(scene)
        seen = hit.is_valid() & (emitter != None)  # noqa: E711, RUF100 (an array)
        other = scene.pdf_emitter_direction(s["last"], mi.DirectionSample3f(scene, hit, s["last"]), seen)
        twice = dr.select(seen, s["density"] / dr.maximum(s["density"] + other, 1e-30), 0)
        s["light"] += s["share"] * dr.select(seen, emitter.eval(hit, seen), 0) * twice

        on = s["on"] & hit.is_valid()
        paint, context = hit.bsdf(s["ray"]), mi.BSDFContext()
        lamp, radiance = self.look(hit, sampler.next_2d(), on)
        value, density = paint.eval_pdf(context, hit, hit.to_local(lamp.d), on)
        s["light"] += s["share"] * radiance * value * dr.select(lamp.delta, 1, lamp.pdf / dr.maximum(lamp.pdf + density, 1e-30))

        sample, weight = paint.sample(context, hit, sampler.next_1d(), sampler.next_2d(), on)
        s["share"] *= weight
        s["bounce"] += 1
        # Russian roulette from the eighth bounce on.
        stay = dr.select(s["bounce"] < 8, 1, dr.minimum(dr.max(s["share"]) / dr.pi, 0.95))
        on &= (sampler.next_1d() < stay) & (dr.max(s["share"]) > 0)
        s["share"] /= dr.select(on, stay, 1)
        s["ray"], s["last"], s["density"], s["on"] = hit.spawn_ray(hit.to_world(sample.wo)), mi.Interaction3f(hit), sample.pdf, on
        return s

    def look(self, here, number, active=True, at_place=False):
        """A lamp picked by chance, and what it sends here past all that stands between."""
        dr, scene = self.dr, self.scene
        lamp, radiance = scene.sample_emitter_direction(here, number, False, active)
        ray = self.mi.Ray3f(here.p, lamp.p - here.p) if at_place else here.spawn_ray_to(lamp.p)
        far = dr.norm(lamp.p - ray.o)
        ray.d, ray.maxt = (lamp.p - ray.o) / far, dr.inf
        first = scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        return lamp, dr.select(active & (lamp.pdf > 0) & (first.t > far * (1 - NEAR)), radiance, 0)

    def tristimulus(self, light, wavelengths, per_wave):
        """X, Y and Z; one number where all light is white."""
        dr, mi = self.dr, self.mi
        if self.kind == "mono":
            return [light[0]]
        if self.kind == "rgb":
            return [sum(float(row[c]) * light[c] for c in range(3)) for row in self.spectra.to_xyz]
        matching = [mi.Float((spectra.KM * row / spectra.WIDTH).astype(np.float32)) for row in self.spectra.weights]
        sums = [mi.Float(0), mi.Float(0), mi.Float(0)]
        for k in range(len(wavelengths)):
            place = (wavelengths[k] - spectra.START) / spectra.WIDTH
            band = mi.UInt32(dr.clip(place, 0, spectra.BANDS - 1))
            density = dr.select((place >= 0) & (place < spectra.BANDS), light[k] * per_wave[k], 0) / len(wavelengths)
            for c in range(3):
                sums[c] += density * dr.gather(mi.Float, matching[c], band)
        return sums


def merged(room):
    """One part for each material and each set of what its triangles carry."""
    sets = {}
    for part in room.parts:
        carried = part.uv is not None, part.emission_uv is not None, part.colors is not None
        sets.setdefault((part.material, carried), []).append(part)
    return [Part.joined(parts) for _, parts in sorted(sets.items())]


def runs_more(peer, places, count, done, seed):
    """`count` further independent runs after `done` earlier ones: (runs, CPU seconds, paths a point and run). Kernels
    are compiled before time is taken."""
    samples = max(1, MOST_RAYS // len(places))
    peer.irradiance(places, samples, seed)
    start = time.process_time()
    runs = [peer.irradiance(places, samples, seed + 15_485_863 * (done + k + 1)) for k in range(count)]
    return np.array(runs), time.process_time() - start, int(np.sqrt(samples)) ** 2
