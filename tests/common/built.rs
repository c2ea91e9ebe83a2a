//! Rooms made in code, without a file.
//!
//! All lamps share one light spectrum of equal energy (luminous size 1), so that a figure in lm/m2 is a figure for every
//! band up to one constant.

use glam::{DMat4, DVec3, dvec3};
use haarlight::color::{KM, Observer};
use haarlight::gather::Baked;
use haarlight::mesh::Limits;
use haarlight::scene::fluorescence::{Fluorescence, Term};
use haarlight::scene::mirror::Mirror;
use haarlight::scene::pane::{Pane, PaneKind};
use haarlight::scene::sheet::Sheet;
use haarlight::scene::sky::{Sky, SunPlace, SunWish};
use haarlight::scene::{
    Alpha, Emission, GREATEST_ALBEDO, LightKind, LightSpectrum, Material, PunctualLight, Scene,
    Sides, Source, Surface,
};
use haarlight::solve::{Bake, Settings};
use haarlight::spectrum::{BANDS, Grid, Spectrum};
use std::f64::consts::PI;

/// A sun at an elevation and azimuth, degrees, and its illuminance across its rays, lx.
pub(crate) fn sun([elevation, azimuth]: [f64; 2], illuminance: f64) -> SunWish {
    SunWish {
        place: Some(SunPlace::Angles { elevation, azimuth }),
        illuminance: Some(illuminance),
        kelvin: None,
    }
}

/// A bake with default settings, to its end.
pub(crate) fn baked(scene: Scene) -> Bake {
    run(scene, Settings::default())
}

/// One round: what points see of lamps themselves, in mirrors too, does not depend on it, so that where everything else is black further
/// rounds change no figure.
pub(crate) fn glanced(scene: Scene) -> Bake {
    let settings = Settings {
        rounds: 1,
        ..Settings::default()
    };
    run(scene, settings)
}

/// A bake to an error of the user's.
pub(crate) fn baked_to(error: f64, scene: Scene) -> Bake {
    let settings = Settings {
        error,
        ..Settings::default()
    };
    run(scene, settings)
}

/// A bake to its end.
pub(crate) fn run(scene: Scene, settings: Settings) -> Bake {
    let mut bake = Bake::new(scene, settings);
    bake.run();
    bake
}

/// The mean error of light at points that a bake states after its last round, CIEDE2000.
pub(crate) fn estimate(bake: &Bake) -> f64 {
    let last = bake.rounds().last().unwrap();
    last.error.total_de2000.value.unwrap()
}

/// The mesh of a bake with no more vertices than these, but for those of the input.
pub(crate) fn baked_within(vertices: usize, bake: &Bake) -> Baked {
    let limits = Limits {
        vertices: Some(vertices),
        ..Limits::default()
    };
    bake.baked_within(&limits, &|_, _| {})
}

/// `a` is `b`, but for a share of it. Printed for `tools/effects/closed_forms.py`.
#[track_caller]
pub(crate) fn close(a: f64, b: f64, tolerance: f64, what: &str) {
    println!("{what}: {a} for {b}");
    assert!(
        (a - b).abs() <= tolerance * b.abs(),
        "{what}: {a} for {b}, off by {:e}",
        a / b - 1.0
    );
}

/// A room in the making.
pub(crate) struct Room {
    grid: Grid,
    surfaces: Vec<Surface>,
    materials: Vec<Material>,
    spectra: Vec<LightSpectrum>,
    lights: Vec<PunctualLight>,
    pub(crate) sky: Option<Sky>,
}

impl Room {
    /// Nothing yet, but the spectrum of equal energy.
    pub(crate) fn new() -> Self {
        Self::over(Grid::default())
    }

    /// The same on other wavelengths.
    pub(crate) fn over(grid: Grid) -> Self {
        let mut room = Self {
            grid,
            surfaces: Vec::new(),
            materials: Vec::new(),
            spectra: Vec::new(),
            lights: Vec::new(),
            sky: None,
        };
        room.spectrum("equal energy", [1.0; BANDS]);
        room
    }

    /// A further light spectrum, brought to luminous size 1; returns its index.
    pub(crate) fn spectrum(&mut self, name: &str, power: Spectrum) -> usize {
        let size = luminous(&self.grid, &power);
        self.spectra.push(LightSpectrum {
            name: name.into(),
            power: power.map(|p| p / size),
        });
        self.spectra.len() - 1
    }

    /// Band values of a light spectrum, luminous size 1.
    pub(crate) fn power(&self, light: usize) -> Spectrum {
        self.spectra[light].power
    }

    /// A grey paint; returns its index.
    pub(crate) fn paint(&mut self, rho: f64) -> usize {
        self.spectral_paint([rho; BANDS])
    }

    /// A paint by its reflectance on the bands.
    pub(crate) fn spectral_paint(&mut self, reflectance: Spectrum) -> usize {
        self.materials.push(Material {
            name: format!("material {}", self.materials.len()),
            index: None,
            sides: Sides::Front,
            reflectance: reflectance.map(|r| r.clamp(0.0, GREATEST_ALBEDO)),
            reflectance_from: "given".into(),
            base_color: [1.0; 3],
            paint: None,
            vertex_paint: false,
            emission: None,
            alpha: Alpha::Opaque,
            pane: None,
            sheet: None,
            mirror: None,
            fluorescence: None,
        });
        self.materials.len() - 1
    }

    /// A grey paint that also gives out `exitance` lm/m2 of equal energy.
    pub(crate) fn lamp(&mut self, rho: f64, exitance: f64) -> usize {
        let paint = self.paint(rho);
        self.glow(paint, 0, exitance);
        paint
    }

    /// Makes a paint give out `exitance` lm/m2 of a light spectrum.
    pub(crate) fn glow(&mut self, paint: usize, light: usize, exitance: f64) {
        self.materials[paint].emission = Some(Emission {
            light,
            shape: [exitance / PI; BANDS],
            texture: None,
            color: [0.5; 3],
            scale: 2.0 * exitance / PI,
            from: "given".into(),
            profile: None,
        });
    }

    /// A pane of an index and of what its inside lets through, band by band; returns its index.
    pub(crate) fn pane(&mut self, ior: f64, inside: Spectrum) -> usize {
        let material = self.paint(0.0);
        self.materials[material].pane = Some(glass(ior, inside));
        material
    }

    /// A diffuse sheet by what its front and its back reflect, and what it lets through; returns its index.
    pub(crate) fn sheet(&mut self, front: Spectrum, back: Spectrum, through: Spectrum) -> usize {
        let material = self.spectral_paint(front);
        self.materials[material].sides = Sides::Both;
        self.materials[material].sheet = Some(Sheet {
            back: Some(back),
            ..paper(through)
        });
        material
    }

    /// A mirror by what it reflects at normal incidence, band by band; returns its index.
    pub(crate) fn mirror(&mut self, reflectance: Spectrum) -> usize {
        let material = self.spectral_paint(reflectance);
        let reflectance = self.materials[material].reflectance;
        self.materials[material].mirror = Some(Mirror {
            reflectance,
            from: "given".into(),
        });
        material
    }

    /// Makes a paint fluoresce: an emission whose bands times their width sum to 1, and the power given out for each that comes.
    pub(crate) fn fluoresces(&mut self, paint: usize, emission: Spectrum, excitation: Spectrum) {
        let light = self.spectra.len();
        self.spectra.push(LightSpectrum {
            name: format!("fluorescence {light}"),
            power: emission,
        });
        let fluorescence = self.materials[paint]
            .fluorescence
            .get_or_insert(Fluorescence {
                terms: Vec::new(),
                from: "given".into(),
            });
        fluorescence.terms.push(Term {
            light,
            excitation,
            layer: None,
        });
    }

    /// Lets the back of a material take part.
    pub(crate) fn two_sided(&mut self, paint: usize) {
        self.materials[paint].sides = Sides::Both;
    }

    /// A convex planar polygon, counter-clockwise seen from its front; a fan of triangles.
    pub(crate) fn polygon(&mut self, corners: &[DVec3], material: usize) {
        let triangles = (1..corners.len() as u32 - 1)
            .map(|k| [0, k, k + 1])
            .collect();
        self.mesh(corners.to_vec(), triangles, material);
    }

    /// Triangles over shared corners.
    pub(crate) fn mesh(
        &mut self,
        positions: Vec<DVec3>,
        triangles: Vec<[u32; 3]>,
        material: usize,
    ) {
        let k = self.surfaces.len();
        self.surfaces.push(Surface {
            name: format!("surface {k}"),
            node: k,
            mesh: k,
            primitive: 0,
            instance: None,
            material,
            to_world: DMat4::IDENTITY,
            positions,
            normals: None,
            texcoords: Vec::new(),
            colors: None,
            triangles,
        });
    }

    /// A parallelogram `corner + s u + t v`; its front is where `u x v` points.
    pub(crate) fn quad(&mut self, corner: DVec3, u: DVec3, v: DVec3, material: usize) {
        self.polygon(&[corner, corner + u, corner + u + v, corner + v], material);
    }

    /// The six faces of a box in the order -x, +x, -y, +y, -z, +z, looking inwards.
    pub(crate) fn hollow(&mut self, low: DVec3, high: DVec3, materials: [usize; 6]) {
        for (corners, material) in faces(low, high).into_iter().zip(materials) {
            self.polygon(&corners, material);
        }
    }

    /// The six faces of a box, looking outwards.
    pub(crate) fn block(&mut self, low: DVec3, high: DVec3, material: usize) {
        for mut corners in faces(low, high) {
            corners.reverse();
            self.polygon(&corners, material);
        }
    }

    /// An isotropic point light of `flux` lm of equal energy.
    pub(crate) fn point(&mut self, position: DVec3, flux: f64) {
        self.punctual(LightKind::Point, position, DVec3::NEG_Y, flux / (4.0 * PI));
    }

    /// A punctual light of `intensity` cd (lx for parallel light).
    pub(crate) fn punctual(
        &mut self,
        kind: LightKind,
        position: DVec3,
        direction: DVec3,
        intensity: f64,
    ) {
        self.lights.push(PunctualLight {
            name: format!("light {}", self.lights.len()),
            kind,
            node: None,
            position,
            direction: direction.normalize(),
            light: 0,
            shape: [intensity; BANDS],
            luminaire: None,
        });
    }

    /// The room as the solver takes it. Spectra that no lamp uses are left out, as a loader does.
    pub(crate) fn scene(mut self) -> Scene {
        let used = |k: usize| {
            self.lights.iter().any(|l| l.light == k)
                || self
                    .materials
                    .iter()
                    .any(|m| m.emission.as_ref().is_some_and(|e| e.light == k))
                || terms(&self.materials).any(|t| t.light == k)
        };
        let kept: Vec<usize> = (0..self.spectra.len()).filter(|&k| used(k)).collect();
        let place = |old: usize| kept.iter().position(|&k| k == old).unwrap_or(0);
        for light in &mut self.lights {
            light.light = place(light.light);
        }
        for emission in self
            .materials
            .iter_mut()
            .filter_map(|m| m.emission.as_mut())
        {
            emission.light = place(emission.light);
        }
        let fluorescent = self.materials.iter_mut();
        for term in fluorescent
            .filter_map(|m| m.fluorescence.as_mut())
            .flat_map(|f| &mut f.terms)
        {
            term.light = place(term.light);
        }
        let is_pane = |s: &Surface| self.materials[s.material].pane.is_some();
        let (panes, surfaces) = self.surfaces.into_iter().partition(is_pane);
        Scene {
            source: Source {
                path: "built.glb".into(),
                json: serde_json::json!({"asset": {"version": "2.0"}}),
                buffers: Vec::new(),
            },
            grid: self.grid,
            surfaces,
            panes,
            materials: self.materials,
            solids: Default::default(),
            images: Vec::new(),
            spectra: kept.iter().map(|&k| self.spectra[k].clone()).collect(),
            lights: self.lights,
            sky: self.sky,
            cameras: Vec::new(),
            warnings: Vec::new(),
            changes: Default::default(),
        }
    }
}

/// Glass of an index and of what its inside lets through, band by band.
pub(crate) fn glass(ior: f64, inside: Spectrum) -> Pane {
    Pane {
        kind: PaneKind::Glass {
            ior,
            inside,
            unit: None,
            thickness: 1.0,
            share: 1.0,
        },
        texture: None,
        from: "given".into(),
    }
}

/// A diffuse sheet by what it lets through, that reflects as much on both sides.
pub(crate) fn paper(through: Spectrum) -> Sheet {
    Sheet {
        transmittance: through,
        back: None,
        strength: 0.0,
        strength_texture: None,
        color: None,
        color_texture: None,
        shares: false,
        from: "given".into(),
    }
}

/// What materials fluoresce.
fn terms(materials: &[Material]) -> impl Iterator<Item = &Term> {
    let all = materials.iter().filter_map(|m| m.fluorescence.as_ref());
    all.flat_map(|f| &f.terms)
}

/// `Km sum of power ybar`: lm for W.
pub(crate) fn luminous(grid: &Grid, power: &Spectrum) -> f64 {
    let y = Observer::cie1931().weights(grid)[1];
    power.iter().zip(y).map(|(p, y)| KM * p * y).sum()
}

/// Corners of the six faces of a box, -x, +x, -y, +y, -z, +z, counter-clockwise seen from the inside.
pub(crate) fn faces(l: DVec3, h: DVec3) -> [[DVec3; 4]; 6] {
    let p = |x: u8, y: u8, z: u8| {
        dvec3(
            if x == 0 { l.x } else { h.x },
            if y == 0 { l.y } else { h.y },
            if z == 0 { l.z } else { h.z },
        )
    };
    [
        [p(0, 0, 0), p(0, 1, 0), p(0, 1, 1), p(0, 0, 1)],
        [p(1, 0, 0), p(1, 0, 1), p(1, 1, 1), p(1, 1, 0)],
        [p(0, 0, 0), p(0, 0, 1), p(1, 0, 1), p(1, 0, 0)],
        [p(0, 1, 0), p(1, 1, 0), p(1, 1, 1), p(0, 1, 1)],
        [p(0, 0, 0), p(1, 0, 0), p(1, 1, 0), p(0, 1, 0)],
        [p(0, 0, 1), p(0, 1, 1), p(1, 1, 1), p(1, 0, 1)],
    ]
}

/// A sphere of triangles: the icosahedron quartered `depth` times, corners on the sphere, counter-clockwise from outside.
pub(crate) fn sphere(centre: DVec3, radius: f64, depth: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let phi = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut corners = Vec::new();
    for (a, b) in [(1.0, phi), (1.0, -phi), (-1.0, phi), (-1.0, -phi)] {
        corners.extend([dvec3(0.0, a, b), dvec3(a, b, 0.0), dvec3(b, 0.0, a)]);
    }
    let mut triangles = Vec::new();
    // Faces of the hull: corners of distance 2 from each other.
    let near = |i: usize, j: usize| (corners[i].distance(corners[j]) - 2.0).abs() < 1e-9;
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(i, j) && near(j, k) && near(i, k) {
                    let out = (corners[j] - corners[i])
                        .cross(corners[k] - corners[i])
                        .dot(corners[i]);
                    triangles.push(if out > 0.0 { [i, j, k] } else { [i, k, j] }.map(|c| c as u32));
                }
            }
        }
    }
    for _ in 0..depth {
        let mut middles = std::collections::BTreeMap::new();
        let mut finer = Vec::new();
        for t in triangles {
            let m = [(0, 1), (1, 2), (2, 0)].map(|(a, b)| {
                let key = (t[a].min(t[b]), t[a].max(t[b]));
                *middles.entry(key).or_insert_with(|| {
                    corners.push(
                        0.5 * (corners[t[a] as usize].normalize()
                            + corners[t[b] as usize].normalize()),
                    );
                    corners.len() as u32 - 1
                })
            });
            finer.extend([
                [t[0], m[0], m[2]],
                [m[0], t[1], m[1]],
                [m[2], m[1], t[2]],
                [m[0], m[1], m[2]],
            ]);
        }
        triangles = finer;
    }
    (
        corners
            .into_iter()
            .map(|c| centre + radius * c.normalize())
            .collect(),
        triangles,
    )
}

/// What a dense reference of quartered triangles comes to with its error, of second order, taken out (Richardson 1911): from what it finds with
/// patches, and with patches of half their edges.
pub(crate) fn extrapolated(coarse: &[Spectrum], fine: &[Spectrum]) -> Vec<Spectrum> {
    let pairs = fine.iter().zip(coarse);
    let beyond = |(f, c): (&Spectrum, &Spectrum)| {
        std::array::from_fn(|band| f[band] + (f[band] - c[band]) / 3.0)
    };
    pairs.map(beyond).collect()
}
