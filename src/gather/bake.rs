//! The light of a vertex of the output.

use super::refined as refined_mesh;
use super::{BakedSurface, BakedVertex};
use crate::color::{LinearSrgb, Upsampler};
use crate::light::Fluorescent;
use crate::light::lanes::Lanes;
use crate::scene::{Material, Surface};
use crate::solve::Bake;
use crate::spectrum::{BANDS, Spectrum};
use crate::transport::Receiver;
use glam::DVec3;
use std::f64::consts::PI;

/// Vertices are moved this far into the triangle they belong to: a point on an edge also lies on the neighbouring wall.
const INSET: f64 = 2e-3;
/// Texels nearer to an edge than this share of the room's half diagonal (1 mm in a room of 20 m), or than vertices would be, are
/// moved that far into the triangle.
const TEXEL_INSET: f64 = 1e-4;
/// The baked mesh, and what it took.
#[derive(Debug, Default)]
pub struct Baked {
    /// One entry for each side of a surface.
    pub surfaces: Vec<BakedSurface>,
    /// Irradiance rows of all vertices, surface by surface, in order.
    pub irradiance: Vec<Vec<[f32; 64]>>,
    /// The vertices in the same order, with where their light comes from, if kept.
    pub(crate) kept: Vec<Vec<KeptVertex>>,
    /// Vertices that something solid covers: they have their neighbours' light.
    pub covered: usize,
    /// Triangles that were to be divided further when the limits were reached.
    pub capped: usize,
    /// Triangle of [`Mesh`](crate::hierarchy::Mesh) that each triangle lies in, at least in part: where a triangle of the input was cut, others of it
    /// may hold the rest. Empty after relighting.
    pub of: Vec<Vec<u32>>,
    /// How far light between vertices is from what gathering there finds; none in a sketch and after relighting.
    pub interpolation: Option<Interpolation>,
    /// `interpolation` for each layer by itself, under the adaptation white of the whole; empty without layers, and for
    /// maps.
    pub layers: Vec<Interpolation>,
    /// Visibility rays cast.
    pub rays: u64,
}

/// How far light between the vertices of a file is from what gathering there finds: colour differences (CIEDE2000 of a
/// white surface's light under the adaptation white) at random points by area, covered points left out. What light at the vertices differs by
/// by chance is a part of it; what gathering at the points does is not.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Interpolation {
    /// Root of the mean square.
    pub rms: f64,
    /// Mean.
    pub mean: f64,
    /// By how much light bends between vertices: the mean without what chance alone may make of it. Low where gathered light has much of that.
    pub bends: f64,
    /// Value that 95 % of the points do not exceed.
    pub p95: f64,
    /// Root of the mean variance of gathered light at the points, which is not counted.
    pub noise: f64,
    /// Points.
    pub points: usize,
    /// What the mean may be: what light at points leaves of the error asked for, which is also a mean.
    pub allowed: f64,
    /// By how much light may bend: its share of that error.
    pub may_bend: f64,
    /// The number of vertices allowed, if the mesh has reached it.
    pub capped: Option<usize>,
}

impl Interpolation {
    /// Is the mean within what is allowed, and what light bends by?
    pub fn is_met(&self) -> bool {
        self.mean <= self.allowed && self.bends <= self.may_bend
    }

    /// How many times what is allowed the error is.
    pub(crate) fn excess(&self) -> f64 {
        (self.mean / self.allowed).max(self.bends / self.may_bend)
    }
}

/// A vertex of the output on the mesh, with where its light comes from; none if something covers the vertex.
#[derive(Debug)]
pub(crate) struct KeptVertex {
    pub(crate) triangle: u32,
    pub(crate) weights: [f64; 3],
    /// Factor of the vertex's light, so that lines to its neighbours are right on average.
    pub(crate) factor: f32,
    pub(crate) trace: Option<Box<[u8]>>,
}

/// A vertex on the mesh.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vertex {
    /// Triangle of the mesh that the vertex is described on, and weights of its corners.
    pub(crate) triangle: u32,
    pub(crate) weights: [f64; 3],
    /// Entry of the face in the hierarchy.
    pub(crate) entry: u32,
}

impl Bake {
    /// Where a vertex is, recentred.
    pub(crate) fn place_of(&self, vertex: &Vertex) -> DVec3 {
        self.mesh().at(vertex.triangle as usize, vertex.weights)
    }

    /// The place of a vertex, moved into its triangle, with its shading normal.
    pub(crate) fn receiver(&self, vertex: &Vertex, surface: usize, back: bool) -> Receiver {
        let inner = vertex.weights.map(|w| w * (1.0 - INSET) + INSET / 3.0);
        self.facing(vertex, inner, surface, back)
    }

    /// The place of a texel, moved only where it lies on an edge of its triangle, with its shading normal.
    pub(crate) fn texel(&self, vertex: &Vertex, surface: usize, back: bool) -> Receiver {
        let mesh = self.mesh();
        let [a, b, c] =
            mesh.triangles[vertex.triangle as usize].map(|p| mesh.positions[p as usize]);
        let twice = 2.0 * mesh.area[vertex.triangle as usize];
        let distance = TEXEL_INSET * mesh.half_size;
        // Weight of a corner at that distance from the opposite edge.
        let least = [c - b, a - c, b - a].map(|edge| {
            let share = distance * edge.length() / twice;
            if share < INSET / 3.0 {
                share
            } else {
                INSET / 3.0
            }
        });
        let pushed: [f64; 3] = std::array::from_fn(|k| vertex.weights[k].max(least[k]));
        let sum: f64 = pushed.iter().sum();
        self.facing(vertex, pushed.map(|w| w / sum), surface, back)
    }

    fn facing(&self, vertex: &Vertex, inner: [f64; 3], surface: usize, back: bool) -> Receiver {
        let (mesh, tree) = (self.mesh(), self.tree());
        let surface = &self.scene().surfaces[surface];
        let triangle = vertex.triangle as usize;
        let flat = if back {
            -mesh.normal[triangle]
        } else {
            mesh.normal[triangle]
        };
        let normal = match &surface.normals {
            Some(normals) => {
                let corners = surface.triangles[mesh.origin[triangle].1 as usize];
                let weights = mesh.on_origin(triangle, vertex.weights);
                let sum: DVec3 = (0..3)
                    .map(|k| normals[corners[k] as usize].as_dvec3() * weights[k])
                    .sum();
                let sum = if back { -sum } else { sum };
                let shading = sum.normalize_or(flat);
                // A shading normal that points behind its own triangle is an error of the file.
                if shading.dot(flat) > 0.0 {
                    shading
                } else {
                    flat
                }
            }
            None => flat,
        };
        let leaf = (vertex.entry != crate::hierarchy::NONE).then(|| {
            // The hierarchy's back faces have their corners the other way round.
            let w = if back {
                [inner[0], inner[2], inner[1]]
            } else {
                inner
            };
            tree.leaf_at(vertex.entry, w)
        });
        Receiver {
            point: mesh.at(triangle, inner),
            normal,
            plane: mesh.plane[triangle],
            leaf,
            // One pattern of rays for all, so that neighbours err alike, unless they are told apart, see `mesh::looks`.
            seed: 0,
        }
    }

    /// How each material of the scene turns irradiance into visible light.
    pub(crate) fn looks<'a>(&self, upsampler: &'a Upsampler) -> Vec<SurfaceResponse<'a>> {
        let materials = self.scene().materials.iter();
        materials
            .map(|m| SurfaceResponse::new(self, m, upsampler))
            .collect()
    }

    /// Emission at a vertex; none on surfaces that do not emit.
    pub(super) fn glow(
        &self,
        vertex: &Vertex,
        back: bool,
        look: &SurfaceResponse,
    ) -> Option<&[f32]> {
        if !look.emits || vertex.entry == crate::hierarchy::NONE {
            return None;
        }
        let w = if back {
            [vertex.weights[0], vertex.weights[2], vertex.weights[1]]
        } else {
            vertex.weights
        };
        let leaf = self.tree().leaf_at(vertex.entry, w);
        Some(self.light().emitted.row(leaf as usize))
    }

    /// The visible light of a vertex.
    pub(crate) fn vertex(
        &self,
        vertex: &Vertex,
        back: bool,
        row: &[f32; 64],
        look: &SurfaceResponse,
    ) -> BakedVertex {
        let glow = match self.glow(vertex, back, look) {
            Some(own) => look.shown.unwrap_or_else(|| self.lanes().tristimulus(own)),
            None => [0.0; 3],
        };
        let reflected = look.reflect(row);
        let display = LinearSrgb::standard();
        let unpainted = look.unpainted.unwrap_or([1.0; 3]);
        let rgb = display.from_xyz(std::array::from_fn(|c| reflected[c] + glow[c]));
        let (surface, triangle) = self.mesh().origin[vertex.triangle as usize];
        let mut out = BakedVertex {
            triangle,
            weights: self
                .mesh()
                .on_origin(vertex.triangle as usize, vertex.weights),
            irradiance: self.lanes().tristimulus(row).map(|x| x as f32),
            radiosity: std::array::from_fn(|c| (reflected[c] + glow[c]) as f32),
            light: std::array::from_fn(|c| (rgb[c] / unpainted[c]) as f32),
        };
        if let Some(paint) = look.painted(&self.scene().surfaces[surface as usize], &out) {
            let reflected = weighed(row, &look.sent(self.lanes(), &paint));
            out.radiosity = std::array::from_fn(|c| (reflected[c] + glow[c]) as f32);
        }
        out
    }
}

/// How a material turns irradiance into visible light.
pub(crate) struct SurfaceResponse<'a> {
    /// Reflectance on the bands, without vertex colours; for diffuse sheets including the transmittance.
    reflectance: Spectrum,
    /// Transmittance, and the share of the base colour that is reflected besides.
    through: Option<(Spectrum, f64)>,
    /// Base colour with the texture's mean, where vertex colours multiply it.
    base: Option<[f32; 3]>,
    upsampler: &'a Upsampler,
    /// Tristimulus radiosity per unit of each lane's irradiance, fluorescence included.
    reflected: Vec<[f64; 3]>,
    /// The fluorescence, and its tristimulus radiosity per unit of each lane's irradiance.
    fluorescent: Option<(Fluorescent, Vec<[f64; 3]>)>,
    /// Greatest reflectance that fluorescence leaves room for.
    room: Option<Spectrum>,
    /// Mean colour of the texture, which the display multiplies again.
    pub(super) unpainted: Option<[f64; 3]>,
    emits: bool,
    /// Light spectrum of the emission.
    pub(super) light: Option<usize>,
    /// Exitance with which a lamp with a profile is shown.
    pub(super) shown: Option<[f64; 3]>,
}

/// Sum of a row's lanes with tristimulus weights.
fn weighed(row: &[f32; 64], weights: &[[f64; 3]]) -> [f64; 3] {
    let mut xyz = [0.0; 3];
    for (x, w) in row.iter().zip(weights) {
        xyz = std::array::from_fn(|c| xyz[c] + f64::from(*x) * w[c]);
    }
    xyz
}

impl<'a> SurfaceResponse<'a> {
    pub(crate) fn new(bake: &Bake, material: &Material, upsampler: &'a Upsampler) -> Self {
        let images = &bake.scene().images;
        let color = material.mean_color(images);
        let sheet = material.sheet_means(images, upsampler);
        let reflectance = match (&sheet, color) {
            (Some(sheet), _) => sheet.shown,
            (None, Some(color)) => upsampler.reflectance(color),
            (None, None) => material.reflectance,
        };
        let fluorescent = material.fluorescence.as_ref().map(|fluorescence| {
            let fluorescent = Fluorescent::new(fluorescence, bake.lanes(), bake.scene());
            let xyz = fluorescent.tristimulus(bake.lanes());
            (fluorescent, xyz)
        });
        let mut look = Self {
            reflected: Vec::new(),
            room: (fluorescent.is_some()).then(|| material.bounded([1.0; BANDS])),
            fluorescent,
            reflectance,
            through: sheet.map(|sheet| (sheet.transmittance, sheet.left)),
            base: (material.vertex_paint).then(|| color.unwrap_or(material.base_color)),
            upsampler,
            unpainted: (material.mean_paint(images)).map(|mean| mean.map(f64::from)),
            emits: material.emission.is_some(),
            light: material.emission.as_ref().map(|e| e.light),
            shown: (material.emission.as_ref())
                .filter(|e| e.profile.is_some())
                .map(|e| bake.lanes().emission(e.light, &e.shape, PI)),
        };
        look.reflectance = look.beside(look.reflectance);
        look.reflected = look.sent(bake.lanes(), &look.reflectance);
        look
    }

    /// A reflectance, limited to what fluorescence leaves room for.
    fn beside(&self, reflectance: Spectrum) -> Spectrum {
        match &self.room {
            Some(room) => std::array::from_fn(|k| reflectance[k].min(room[k])),
            None => reflectance,
        }
    }

    /// Tristimulus radiosity per unit of each lane's irradiance, for a reflectance and fluorescence.
    fn sent(&self, lanes: &Lanes, reflectance: &Spectrum) -> Vec<[f64; 3]> {
        let mut all = lanes.reflected(reflectance);
        for (all, more) in all
            .iter_mut()
            .zip(self.fluorescent.iter().flat_map(|f| &f.1))
        {
            *all = std::array::from_fn(|c| all[c] + more[c]);
        }
        all
    }

    /// Spectral exitance of fluorescence under a row of irradiance, W/m2/nm; none where nothing fluoresces.
    pub(super) fn fluoresced(&self, lanes: &Lanes, row: &[f32; 64]) -> Option<Spectrum> {
        let (fluorescent, _) = self.fluorescent.as_ref()?;
        Some(fluorescent.spectrum(lanes, row))
    }

    /// Tristimulus radiosity of a row of irradiance, without vertex colours.
    pub(super) fn reflect(&self, row: &[f32; 64]) -> [f64; 3] {
        weighed(row, &self.reflected)
    }

    /// Reflectance on the bands, for a texture its mean; without vertex colours.
    pub(crate) fn reflectance(&self) -> &Spectrum {
        &self.reflectance
    }

    /// Reflectance at a vertex where vertex colours apply; none elsewhere.
    fn painted(&self, surface: &Surface, vertex: &BakedVertex) -> Option<Spectrum> {
        let base = self.base.filter(|_| surface.colors.is_some())?;
        let color = refined_mesh::vertex_color(surface, vertex);
        let color = std::array::from_fn(|c| base[c] * color[c]);
        let painted = self.upsampler.reflectance_fast(color);
        Some(match &self.through {
            // Vertex colours change only what is reflected.
            Some((through, left)) => std::array::from_fn(|k| through[k] + left * painted[k]),
            None => self.beside(painted),
        })
    }

    /// Reflectance at a vertex.
    pub(super) fn reflectance_at(&self, surface: &Surface, vertex: &BakedVertex) -> Spectrum {
        self.painted(surface, vertex).unwrap_or(self.reflectance)
    }
}

/// Gives covered vertices the mean of their neighbours, ring by ring; returns how many there were. A vertex with no light
/// around it stays dark.
pub(crate) fn lend(rows: &mut [Option<[f32; 64]>], triangles: &[[u32; 3]]) -> usize {
    let mut count = None;
    loop {
        let mut sums = std::collections::BTreeMap::<u32, ([f32; 64], f32)>::new();
        for t in triangles {
            for &v in t.iter().filter(|&&v| rows[v as usize].is_none()) {
                let sum = sums.entry(v).or_insert(([0.0; 64], 0.0));
                for row in t.iter().filter_map(|&n| rows[n as usize].as_ref()) {
                    sum.1 += 1.0;
                    for (s, x) in sum.0.iter_mut().zip(row) {
                        *s += x;
                    }
                }
            }
        }
        let count = *count.get_or_insert(sums.len());
        sums.retain(|_, (_, n)| *n > 0.0);
        if sums.is_empty() {
            return count;
        }
        for (v, (sum, n)) in sums {
            rows[v as usize] = Some(sum.map(|x| x / n));
        }
    }
}
