//! What a scene is made of, for `inspect` and the head of a log: counts, areas, lamps in lumens, albedos.
//!
//! Albedo is `Y(reflectance under D65)`, a mean over the area where paint is textured or coloured by vertices.
//! Flux of a surface is `pi L A` (twice where both sides emit), of a point light `4 pi I`, of a spot the integral of
//! KHR_lights_punctual's fall-off, `2 pi I ((1 - cos inner) + (cos inner - cos outer) / 3)`. A parallel light has lux.
//! Holes are not subtracted.

use super::profile::Profile;
use super::sets::{join, root};
use super::{LightKind, Material, Projection, PunctualLight, Scene, Sides, Surface, Texture};
use crate::color::{KM, Observer, Upsampler};
use crate::data::Spectrum;
use glam::DVec3;
use serde::Serialize;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Vertices closer than this share of the room's size count as one when edges are matched.
const WELD: f64 = 1e-6;

/// The facts of a scene. Lengths are in the file's units (metres in glTF).
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Facts {
    /// The file.
    pub room: String,
    /// Primitives at nodes, instances counted.
    pub surfaces: usize,
    /// Triangles, instances counted.
    pub triangles: usize,
    /// Area of all triangles, one side, m2.
    pub area_m2: f64,
    /// Lowest and highest corner of the bounds, m.
    pub bounds_m: [[f64; 3]; 2],
    /// Does the geometry enclose?
    pub closed: ClosedHint,
    /// First and last wavelength of the grid, nm.
    pub range_nm: [f64; 2],
    /// Names of the distinct light spectra.
    pub light_spectra: Vec<String>,
    /// Lamps: emissive materials, then punctual lights.
    pub lights: Vec<LightFact>,
    /// Materials, also unused ones.
    pub materials: Vec<MaterialFact>,
    /// Names of the cameras.
    pub cameras: Vec<String>,
    /// Images in use, pixels across and down.
    pub images: Vec<ImageFact>,
}

/// A hint whether the room is closed: edges that no second triangle meets, after welding. Walls that only touch (a
/// T-vertex, a block on a floor) have open edges and may be tight all the same.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ClosedHint {
    /// Parts that hang together by vertices.
    pub parts: usize,
    /// Parts without an open edge.
    pub closed_parts: usize,
    /// Open edges of all parts.
    pub open_edges: usize,
    /// Is the part with the largest bounds closed?
    pub largest_is_closed: bool,
}

/// A lamp.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LightFact {
    /// Name of the material or light.
    pub name: String,
    /// `surface`, `point`, `spot`, `measured`, `directional`, `sun`, `sky`, `ground`.
    pub kind: &'static str,
    /// Luminous flux, lm; none for parallel light.
    pub flux_lm: Option<f64>,
    /// Luminance of an untextured surface, cd/m2.
    pub luminance_cd_m2: Option<f64>,
    /// Luminous intensity of a point or spot, greatest one of a measured lamp, cd.
    pub intensity_cd: Option<f64>,
    /// Illuminance of parallel light on a plane across it, of a sky on open level ground, lx; exitance of the ground.
    pub illuminance_lx: Option<f64>,
    /// Where its spectrum comes from.
    pub spectrum: String,
    /// How its light is spread, if a file says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub profile: Option<ProfileFact>,
}

/// A file of photometric data.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ProfileFact {
    /// Name of the luminaire in the file.
    pub luminaire: String,
    /// `LM-63-2002`, `EULUMDAT`.
    pub format: String,
    /// Type of the goniometer: A, B or C.
    pub angles: char,
    /// Flux of the file, lm: what its intensities integrate to.
    pub flux_lm: f64,
    /// Greatest intensity, cd.
    pub peak_cd: f64,
    /// Flux of the lamps in it, lm; none in absolute photometry.
    pub lamps_lm: Option<f64>,
    /// Luminous opening along C0, along C90, and its height, m.
    pub opening_m: [f64; 3],
}

impl ProfileFact {
    fn of(profile: &Profile) -> Self {
        Self {
            luminaire: profile.luminaire.clone(),
            format: profile.format.clone(),
            angles: profile.angles.letter(),
            flux_lm: profile.flux(),
            peak_cd: profile.peak(),
            lamps_lm: profile.lamps_lm,
            opening_m: profile.opening_m,
        }
    }
}

/// A material.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct MaterialFact {
    /// Name.
    pub name: String,
    /// Index in the document; none for the default material.
    pub index: Option<usize>,
    /// Triangles painted with it.
    pub triangles: usize,
    /// Their area, m2.
    pub area_m2: f64,
    /// Y under D65, in [0, 1].
    pub albedo_y: f64,
    /// Where the reflectance comes from.
    pub reflectance: String,
    /// Is it textured?
    pub textured: bool,
    /// `front` or `both`.
    pub sides: &'static str,
    /// What it lets through diffusely; none of what is no sheet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sheet: Option<SheetFact>,
    /// What it fluoresces, in words; none of what does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fluorescence: Option<String>,
}

/// A diffuse sheet.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SheetFact {
    /// Y of the transmittance under D65, in [0, 1], where textures are white.
    pub transmittance_y: f64,
    /// Y of the reflectance of the back, if it is not that of the front.
    pub back_albedo_y: Option<f64>,
    /// Where the transmittance comes from.
    pub transmission: String,
}

/// An image.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ImageFact {
    /// Name.
    pub name: String,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
}

/// Sums over the triangles of a material.
#[derive(Clone, Copy, Default)]
struct Sums {
    triangles: usize,
    area: f64,
    /// Area times albedo.
    albedo: f64,
    /// Area times luminance, cd.
    luminance: f64,
}

impl Facts {
    /// The facts of a scene.
    pub fn of(scene: &Scene) -> Self {
        let meter = SceneMeter::new(scene);
        let mut sums = vec![Sums::default(); scene.materials.len()];
        for surface in &scene.surfaces {
            if let Some(material) = scene.materials.get(surface.material) {
                meter.add(surface, material, &mut sums[surface.material]);
            }
        }
        let bounds = bounds(scene);
        let each = || scene.materials.iter().zip(&sums);
        let shining = each().filter(|(_, sums)| sums.triangles > 0);
        // A surface that shines by a profile was named with its material.
        let alone = scene.lights.iter().filter(|l| l.kind != LightKind::Surface);
        let surfaces = shining.filter_map(|(material, sums)| meter.lamp(material, sums));
        let lights = surfaces.chain(alone.map(|light| meter.light(light)));
        let images = scene.images.iter().map(|image| ImageFact {
            name: image.name.clone(),
            width: image.width,
            height: image.height,
        });
        Self {
            room: scene.source.path.display().to_string(),
            surfaces: scene.surfaces.len(),
            triangles: scene.surfaces.iter().map(|s| s.triangles.len()).sum(),
            area_m2: sums.iter().map(|s| s.area).sum(),
            bounds_m: bounds.map(|p| p.to_array()),
            closed: closed(&scene.surfaces, WELD * (bounds[1] - bounds[0]).length()),
            range_nm: [scene.grid.start(), scene.grid.end()],
            light_spectra: scene.spectra.iter().map(|s| s.name.clone()).collect(),
            lights: lights.collect(),
            materials: each().map(|(m, sums)| meter.material(m, sums)).collect(),
            cameras: scene
                .cameras
                .iter()
                .map(|c| camera(&c.name, c.projection))
                .collect(),
            images: images.collect(),
        }
    }
}

/// Lowest and highest corner.
fn bounds(scene: &Scene) -> [DVec3; 2] {
    let positions = || scene.surfaces.iter().flat_map(|s| s.positions.iter());
    positions().next().map_or([DVec3::ZERO; 2], |first| {
        [DVec3::min, DVec3::max].map(|end| positions().copied().fold(*first, end))
    })
}

fn camera(name: &str, projection: Projection) -> String {
    match projection {
        Projection::Perspective(angle) => format!("{name} ({:.0} degrees)", angle.to_degrees()),
        Projection::Orthographic(half) => format!("{name} (orthographic, {:.3} high)", 2.0 * half),
    }
}

/// Flux of a spot of `intensity` candela, lm.
fn spot_flux(intensity: f64, inner: f64, outer: f64) -> f64 {
    let (inner, outer) = (inner.cos(), outer.cos());
    2.0 * PI * intensity * ((1.0 - inner) + (inner - outer) / 3.0)
}

/// Photometry of a scene.
struct SceneMeter<'a> {
    scene: &'a Scene,
    upsampler: Upsampler,
    /// KM times the nm-integrals of y_bar.
    luminous: Spectrum,
}

impl<'a> SceneMeter<'a> {
    fn new(scene: &'a Scene) -> Self {
        let luminous = Observer::cie1931().weights(&scene.grid)[1].map(|y| KM * y);
        Self {
            scene,
            upsampler: Upsampler::new(&scene.grid),
            luminous,
        }
    }

    /// Luminous size of a lamp: cd/m2, cd or lx.
    fn size(&self, light: usize, shape: &Spectrum) -> f64 {
        let power = &self.scene.spectra[light].power;
        power
            .iter()
            .zip(shape)
            .zip(&self.luminous)
            .map(|((p, s), y)| p * s * y)
            .sum()
    }

    fn albedo(&self, material: &Material) -> f64 {
        self.upsampler.xyz(&material.reflectance)[1]
    }

    fn add(&self, surface: &Surface, material: &Material, sums: &mut Sums) {
        let plain_albedo = self.albedo(material);
        let emission = material.emission.as_ref();
        let plain_luminance = emission.map_or(0.0, |e| self.size(e.light, &e.shape));
        let colors = surface.colors.as_ref().filter(|_| material.vertex_paint);
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|i| surface.positions[i as usize]);
            let area = (b - a).cross(c - a).length() / 2.0;
            let mut albedo = plain_albedo;
            if material.paint.is_some() || colors.is_some() {
                let mut rgb = material.base_color.map(f64::from);
                let mut times = |by: [f64; 3]| rgb.iter_mut().zip(by).for_each(|(c, b)| *c *= b);
                if let Some(texture) = &material.paint {
                    times(self.texel(texture, surface, triangle));
                }
                if let Some(colors) = colors {
                    let mean = |k: usize| {
                        triangle
                            .iter()
                            .map(|i| f64::from(colors[*i as usize][k]))
                            .sum::<f64>()
                    };
                    times(std::array::from_fn(|k| mean(k) / 3.0));
                }
                albedo = self.upsampler.luminance(rgb.map(|c| c.clamp(0.0, 1.0)));
                if let Some(sheet) = material.sheet.as_ref().filter(|sheet| sheet.shares) {
                    albedo *= 1.0 - sheet.strength;
                }
            }
            let mut luminance = plain_luminance;
            if let Some((emission, texture)) = emission.and_then(|e| Some((e, e.texture.as_ref()?)))
            {
                let texel = self.texel(texture, surface, triangle);
                let color =
                    std::array::from_fn(|k| (f64::from(emission.color[k]) * texel[k]) as f32);
                let shape = self
                    .upsampler
                    .reflectance_fast(color)
                    .map(|s| s * emission.scale);
                luminance = self.size(emission.light, &shape);
            }
            sums.triangles += 1;
            sums.area += area;
            sums.albedo += area * albedo;
            sums.luminance += area * luminance;
        }
    }

    /// Mean of a texture over a triangle.
    fn texel(&self, texture: &Texture, surface: &Surface, triangle: &[u32; 3]) -> [f64; 3] {
        let Some(set) = surface.texcoords.get(texture.texcoord) else {
            return [1.0; 3];
        };
        let uv = triangle.map(|i| set.get(i as usize).copied().unwrap_or_default());
        let [r, g, b, _] = texture.average(&self.scene.images, uv);
        [r, g, b].map(f64::from)
    }

    fn lamp(&self, material: &Material, sums: &Sums) -> Option<LightFact> {
        let emission = material.emission.as_ref()?;
        let sides = match material.sides {
            Sides::Front => 1.0,
            Sides::Both => 2.0,
        };
        let plain = emission.texture.is_none();
        Some(LightFact {
            name: material.name.clone(),
            kind: "surface",
            flux_lm: Some(PI * sides * sums.luminance),
            luminance_cd_m2: plain.then(|| self.size(emission.light, &emission.shape)),
            intensity_cd: None,
            illuminance_lx: None,
            spectrum: emission.from.clone(),
            profile: emission.profile.as_deref().map(ProfileFact::of),
        })
    }

    fn light(&self, light: &PunctualLight) -> LightFact {
        let size = self.size(light.light, &light.shape);
        let (kind, flux) = match light.kind {
            LightKind::Point => ("point", Some(4.0 * PI * size)),
            LightKind::Spot { inner, outer } => ("spot", Some(spot_flux(size, inner, outer))),
            LightKind::Profile | LightKind::Surface => ("measured", Some(size)),
            LightKind::Directional => ("directional", None),
            LightKind::Sun => ("sun", None),
            LightKind::Sky(_) => ("sky", None),
            LightKind::Ground(_) => ("ground", None),
        };
        let profile = light.luminaire.as_ref().map(|l| &l.profile);
        LightFact {
            name: light.name.clone(),
            kind,
            flux_lm: flux,
            luminance_cd_m2: None,
            intensity_cd: flux.map(|_| profile.map_or(size, |p| size * p.peak() / p.flux())),
            illuminance_lx: flux.is_none().then_some(size),
            spectrum: self.scene.spectra[light.light].name.clone(),
            profile: profile.map(|profile| ProfileFact::of(profile)),
        }
    }

    fn material(&self, material: &Material, sums: &Sums) -> MaterialFact {
        MaterialFact {
            name: material.name.clone(),
            index: material.index,
            triangles: sums.triangles,
            area_m2: sums.area,
            albedo_y: match sums.area > 0.0 {
                true => sums.albedo / sums.area,
                false => self.albedo(material),
            },
            reflectance: material.reflectance_from.clone(),
            textured: material.paint.is_some(),
            sides: match material.sides {
                Sides::Front => "front",
                Sides::Both => "both",
            },
            sheet: material.sheet.as_ref().map(|sheet| SheetFact {
                transmittance_y: self.upsampler.xyz(&sheet.transmittance)[1],
                back_albedo_y: sheet.back.as_ref().map(|b| self.upsampler.xyz(b)[1]),
                transmission: sheet.from.clone(),
            }),
            fluorescence: material.fluorescence.as_ref().map(|f| f.from.clone()),
        }
    }
}

/// Matches edges: each must be run through as often one way as the other.
fn closed(surfaces: &[Surface], weld: f64) -> ClosedHint {
    let mut ids: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let mut points: Vec<DVec3> = Vec::new();
    let mut above: Vec<u32> = Vec::new();
    let mut edges: BTreeMap<[u32; 2], i64> = BTreeMap::new();
    let weld = weld.max(f64::MIN_POSITIVE);
    for surface in surfaces {
        let local: Vec<u32> = surface
            .positions
            .iter()
            .map(|p| {
                // A float-to-integer cast saturates: far points weld together at worst.
                *ids.entry(p.to_array().map(|x| (x / weld).round() as i64))
                    .or_insert_with(|| {
                        points.push(*p);
                        above.push(above.len() as u32);
                        above.len() as u32 - 1
                    })
            })
            .collect();
        for triangle in &surface.triangles {
            let corners = triangle.map(|i| local[i as usize]);
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                if a != b {
                    *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
                    join(&mut above, a, b);
                }
            }
        }
    }
    // Bounds and open edges of each part that has an edge.
    let mut parts: BTreeMap<u32, (DVec3, DVec3, usize)> = BTreeMap::new();
    for ([a, b], balance) in edges {
        let part = root(&mut above, a);
        let (low, high, open) =
            parts
                .entry(part)
                .or_insert((DVec3::INFINITY, DVec3::NEG_INFINITY, 0));
        for p in [a, b].map(|k| points[k as usize]) {
            (*low, *high) = (low.min(p), high.max(p));
        }
        // At most twice the triangles.
        *open += balance.unsigned_abs() as usize;
    }
    let size = |(low, high, _): &(DVec3, DVec3, usize)| (*high - *low).length();
    let largest = parts.values().max_by(|a, b| size(a).total_cmp(&size(b)));
    ClosedHint {
        parts: parts.len(),
        closed_parts: parts.values().filter(|p| p.2 == 0).count(),
        open_edges: parts.values().map(|p| p.2).sum(),
        largest_is_closed: largest.is_some_and(|p| p.2 == 0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Options;
    use std::path::Path;

    fn facts(name: &str) -> Facts {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("scenes")
            .join(name);
        Facts::of(&Scene::load(path, &Options::default()).unwrap())
    }

    #[test]
    fn cornell_box() {
        let facts = facts("cornell.glb");
        assert_eq!(facts.triangles, 38);
        // The published lamp, 130 x 105 mm, of 10 000 cd/m2.
        let lamp = &facts.lights[0];
        assert!((lamp.luminance_cd_m2.unwrap() - 1e4).abs() < 1e-6);
        assert!((lamp.flux_lm.unwrap() / (PI * 1e4 * 0.130 * 0.105) - 1.0).abs() < 1e-5);
        assert_eq!(lamp.spectrum, "cornell/light");
        assert_eq!(facts.materials[0].reflectance, "cornell/white");
        assert!((0.7..0.75).contains(&facts.materials[0].albedo_y));
        // Each block stands on the floor by four open edges; the front is open.
        let closed = &facts.closed;
        assert_eq!(
            (closed.parts, closed.closed_parts, closed.open_edges),
            (3, 0, 12)
        );
        assert!(!closed.largest_is_closed);
    }

    #[test]
    fn closed_rooms_are_seen_as_closed() {
        for name in [
            "cornell-closed.glb",
            "convex.glb",
            "two-rooms.glb",
            "corridor.glb",
            "furnace.glb",
        ] {
            assert!(facts(name).closed.largest_is_closed, "{name}");
        }
        assert_eq!(facts("corridor.glb").closed.open_edges, 0);
    }

    #[test]
    fn flux_of_isotropic_and_of_grey_rooms() {
        let facts = facts("cie171-5.8.glb");
        assert!((facts.lights[0].flux_lm.unwrap() - 10_000.0).abs() < 0.01);
        assert!((facts.materials[0].albedo_y - 0.5).abs() < 1e-9);
        assert!((facts.area_m2 - 96.0).abs() < 1e-9);
    }

    /// A cone without a soft edge gives the flux of its solid angle; the soft edge by quadrature.
    #[test]
    fn flux_of_spots() {
        let sharp = spot_flux(10.0, 0.5, 0.5);
        assert!((sharp - 10.0 * 2.0 * PI * (1.0 - 0.5f64.cos())).abs() < 1e-12);
        let (inner, outer) = (0.3f64, 0.9f64);
        let n = 100_000;
        let sum: f64 = (0..n)
            .map(|i| {
                let angle = outer * (i as f64 + 0.5) / n as f64;
                let fall =
                    ((angle.cos() - outer.cos()) / (inner.cos() - outer.cos())).clamp(0.0, 1.0);
                fall * fall * 2.0 * PI * angle.sin() * outer / n as f64
            })
            .sum();
        assert!((spot_flux(1.0, inner, outer) - sum).abs() < 1e-8);
    }
}
