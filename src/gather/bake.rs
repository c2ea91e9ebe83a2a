//! The light at the vertices of the refined mesh.

use super::point::{Gathered, Receiver};
use super::refined::{Refined, Sheet, Vertex};
use super::relit::KeptVertex;
use super::{BakedSurface, BakedVertex};
use crate::color::{LinearSrgb, Upsampler, de2000};
use crate::output::refined as refined_mesh;
use crate::scene::{Material, Surface};
use crate::solve::{Bake, Care};
use crate::spectrum::Leaves;
use glam::DVec3;

/// Faces are quartered this often for the output at the most.
const DEEPEST: u8 = 7;
/// Corners closer in colour than this (CIEDE2000) are taken to have nothing between them; as a multiple of the asked-for error.
const ALIKE: f64 = 4.0;
/// A triangle is quartered where the middle of an edge is further from the mean of its ends than this multiple of the
/// asked-for error.
const BENT: f64 = 1.5;
/// Rounds of looking and quartering at the most.
const PASSES: usize = 4;
/// Vertices are drawn this far into the triangle they belong to: a point on an edge lies on the neighbouring wall too.
const INSET: f64 = 2e-3;
/// Probes nearer to an edge than this share of a triangle's height are drawn that far into it, for the same reason.
const PROBE_INSET: f64 = 1e-5;
/// A vertex that sees more black backs than this, share of its rays, lies inside something.
pub const MOSTLY: f64 = 0.75;
/// Vertices at the most; a pass that would exceed this is not begun.
const MOST_VERTICES: usize = 2_000_000;
/// Triangles with edges below this share of the room's half diagonal are not quartered for the output.
const SHORTEST: f64 = 0.008;

/// The baked mesh and what it took.
#[derive(Debug, Default)]
pub struct Baked {
    /// One entry a side of a surface.
    pub surfaces: Vec<BakedSurface>,
    /// Irradiance rows of all vertices, surface by surface, in order.
    pub irradiance: Vec<Vec<[f32; 64]>>,
    /// The vertices in the same order with where their light comes from, if that is kept.
    pub(crate) kept: Vec<Vec<KeptVertex>>,
    /// Vertices that something solid covers: they got their neighbours' light.
    pub covered: usize,
    /// Vertices right below something that got the light of a neighbour in the open.
    pub borrowed: usize,
    /// Triangles that wanted quartering when the limits were met.
    pub capped: usize,
    /// Visibility rays cast.
    pub rays: u64,
}

/// What a vertex is known to get; none if it is covered.
type Known = Option<Option<Seen>>;

/// What a vertex gets, and where it comes from, if that is kept.
#[derive(Clone)]
struct Seen {
    row: Box<[f32; 64]>,
    trace: Option<Box<[u8]>>,
}

impl Bake {
    /// Gathers at the vertices of the refined mesh. `progress` is told (done, of) in vertices of the present pass.
    pub fn baked(&self, progress: &dyn Fn(usize, usize)) -> Baked {
        let mut refined = self.elements();
        let mut known: Vec<Vec<Known>> = Vec::new();
        let mut out = Baked::default();
        out.rays += self.complete(&refined, &mut known, Care::Full, progress);
        for _ in 0..PASSES {
            if refined
                .sheets
                .iter()
                .map(|s| s.vertices.len())
                .sum::<usize>()
                > MOST_VERTICES
            {
                out.capped += 1;
                break;
            }
            // Where corners differ, look at the middles of the edges.
            let suspects: Vec<(u32, u32)> = refined
                .leaves()
                .into_iter()
                .filter(|&id| {
                    let c = refined
                        .corners(id)
                        .map(|c| refined.points[c.point as usize]);
                    let longest = (0..3)
                        .map(|k| c[k].distance(c[(k + 1) % 3]))
                        .fold(0.0, f64::max);
                    longest > SHORTEST * self.mesh().half_size && refined.depth(id) < DEEPEST
                })
                .filter(|&id| {
                    self.differ(&known[id.0 as usize], refined.corners(id).map(|c| c.vertex))
                })
                .collect();
            let looks: Vec<[u32; 3]> = suspects
                .iter()
                .map(|&id| {
                    let c = refined.corners(id);
                    [0, 1, 2].map(|k| refined.look(id, c[k], c[(k + 1) % 3]))
                })
                .collect();
            out.rays += self.complete(&refined, &mut known, Care::Full, progress);
            let mut any = false;
            for (&id, looks) in suspects.iter().zip(&looks) {
                if self.bent(
                    &known[id.0 as usize],
                    refined.corners(id).map(|c| c.vertex),
                    looks,
                ) {
                    refined.split(id);
                    any = true;
                }
            }
            refined.level();
            out.rays += self.complete(&refined, &mut known, Care::Full, progress);
            if !any {
                break;
            }
        }
        let triangles: Vec<Vec<[u32; 3]>> = (0..refined.sheets.len() as u32)
            .map(|s| refined.triangles(s))
            .collect();
        out.rays += self.complete(&refined, &mut known, Care::Full, progress);
        self.write_down(&refined, triangles, known, out)
    }

    /// The same on the solver's own elements, without looking for what lies between and with few rays: for pictures on
    /// the way. Vertices of triangles of the input that no picture shows (`seen[surface][triangle]`) get the light of
    /// their leaves as it is.
    ///
    /// # Panics
    /// If `seen` lacks a triangle of the room.
    pub fn sketch(&self, seen: &[Vec<bool>], progress: &dyn Fn(usize, usize)) -> Baked {
        let mut refined = self.elements();
        let triangles = (0..refined.sheets.len() as u32)
            .map(|s| refined.triangles(s))
            .collect();
        let mut known = self.unseen(&refined, seen);
        let out = Baked {
            rays: self.complete(&refined, &mut known, Care::Sketch, progress),
            ..Baked::default()
        };
        self.write_down(&refined, triangles, known, out)
    }

    /// The light of the leaves at vertices that nobody sees.
    fn unseen(&self, refined: &Refined, seen: &[Vec<bool>]) -> Vec<Vec<Known>> {
        let light = self.light();
        let of_leaf = |leaf: u32| {
            let mut row = Box::new([0.0; 64]);
            let known = light
                .irradiance
                .row(light.leaves.binary_search(&leaf).ok()?);
            row[..known.len()].copy_from_slice(known);
            Some(Some(Seen { row, trace: None }))
        };
        let wanted = |triangle: u32| {
            let (surface, local) = self.mesh().origin[triangle as usize];
            seen[surface as usize][local as usize]
        };
        let sheet = |sheet: &Sheet| {
            let used = refined.used(sheet, wanted);
            let vertices = sheet.vertices.iter().zip(used);
            let known = vertices.map(|(vertex, used)| match used {
                true => None,
                false => of_leaf(self.receiver(vertex, sheet.surface, sheet.back).leaf?),
            });
            known.collect()
        };
        refined.sheets.iter().map(sheet).collect()
    }

    /// The mesh of the solver's elements, crack-free.
    fn elements(&self) -> Refined {
        let scene = self.scene();
        let flat: Vec<bool> = scene.surfaces.iter().map(|s| s.normals.is_none()).collect();
        let sides: Vec<bool> = scene
            .surfaces
            .iter()
            .map(|s| scene.materials[s.material].sides == crate::scene::Sides::Both)
            .collect();
        let corners = |surface: usize, triangle: usize| scene.surfaces[surface].triangles[triangle];
        let mut refined = Refined::new(
            self.mesh(),
            self.tree(),
            &corners,
            &self.spaces(),
            &flat,
            &sides,
            DEEPEST,
        );
        refined.level();
        refined
    }

    /// Gathers at all vertices that are not known yet; returns the rays cast.
    fn complete(
        &self,
        refined: &Refined,
        known: &mut Vec<Vec<Known>>,
        care: Care,
        progress: &dyn Fn(usize, usize),
    ) -> u64 {
        known.resize(refined.sheets.len(), Vec::new());
        let mut wanted = Vec::new();
        for (s, sheet) in refined.sheets.iter().enumerate() {
            known[s].resize(sheet.vertices.len(), None);
            let unknown = (0..sheet.vertices.len()).filter(|&v| known[s][v].is_none());
            wanted.extend(unknown.map(|v| (s, v)));
        }
        // In parts, so that progress shows.
        const PART: usize = 16_384;
        let mut rays = 0;
        for (part, chunk) in wanted.chunks(PART).enumerate() {
            progress(part * PART, wanted.len());
            let receivers: Vec<Receiver> = chunk
                .iter()
                .map(|&(s, v)| {
                    self.receiver(
                        &refined.sheets[s].vertices[v],
                        refined.sheets[s].surface,
                        refined.sheets[s].back,
                    )
                })
                .collect();
            let gathered = self.gather_with(&receivers, care);
            let dark = |g: &Gathered| g.seen < 1e-3 && g.direct.iter().all(|&x| x == 0.0);
            let in_doubt: Vec<Receiver> = receivers
                .into_iter()
                .zip(&gathered)
                .filter_map(|(r, g)| dark(g).then_some(r))
                .collect();
            let mut covered = self.covered(&in_doubt).into_iter();
            for (gathered, &(s, v)) in gathered.into_iter().zip(chunk) {
                rays += gathered.rays;
                let covered = dark(&gathered) && covered.next() == Some(true);
                let hidden = covered || gathered.backs > MOSTLY;
                known[s][v] = Some(if hidden {
                    None
                } else {
                    Some(Seen {
                        row: Box::new(gathered.irradiance),
                        trace: gathered.packed,
                    })
                });
            }
        }
        progress(wanted.len(), wanted.len());
        rays
    }

    /// The place of a vertex, drawn into its triangle, with its shading normal.
    pub(super) fn receiver(&self, vertex: &Vertex, surface: usize, back: bool) -> Receiver {
        let (mesh, tree) = (self.mesh(), self.tree());
        let surface = &self.scene().surfaces[surface];
        let triangle = vertex.triangle as usize;
        let inner = vertex.weights.map(|w| w * (1.0 - INSET) + INSET / 3.0);
        let [a, b, c] = mesh.triangles[triangle].map(|v| mesh.positions[v as usize]);
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
                // A shading normal that looks behind its own triangle is an error of the file.
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
        let point = a * inner[0] + b * inner[1] + c * inner[2];
        Receiver {
            point,
            normal,
            plane: mesh.plane[triangle],
            leaf,
            // One pattern of rays for all: neighbours err alike, and that does not show.
            seed: 0,
        }
    }

    /// Difference of two irradiances on a white surface.
    fn difference(&self, a: &[f32; 64], b: &[f32; 64]) -> f64 {
        de2000(
            self.lanes().tristimulus(a),
            self.lanes().tristimulus(b),
            self.light().white,
        )
    }

    fn differ(&self, known: &[Known], corners: [u32; 3]) -> bool {
        let rows = corners.map(|v| row(known, v));
        (0..3).any(|k| match (rows[k], rows[(k + 1) % 3]) {
            (Some(a), Some(b)) => self.difference(a, b) > ALIKE * self.settings().error,
            (None, None) => false,
            _ => true,
        })
    }

    fn bent(&self, known: &[Known], corners: [u32; 3], looks: &[u32; 3]) -> bool {
        let row = |v: u32| row(known, v);
        (0..3).any(
            |k| match (row(corners[k]), row(corners[(k + 1) % 3]), row(looks[k])) {
                (Some(a), Some(b), Some(m)) => {
                    let mean: [f32; 64] = std::array::from_fn(|l| 0.5 * (a[l] + b[l]));
                    self.difference(&mean, m) > BENT * self.settings().error
                }
                (None, None, None) => false,
                // The edge of something that stands on the surface runs through.
                _ => true,
            },
        )
    }

    /// How each material of the scene turns irradiance into what is seen.
    pub(super) fn looks<'a>(&self, upsampler: &'a Upsampler) -> Vec<Look<'a>> {
        let materials = self.scene().materials.iter();
        materials.map(|m| Look::new(self, m, upsampler)).collect()
    }

    /// Vertices with their colours, as the writers want them.
    fn write_down(
        &self,
        refined: &Refined,
        triangles: Vec<Vec<[u32; 3]>>,
        known: Vec<Vec<Known>>,
        mut out: Baked,
    ) -> Baked {
        let looks = self.looks(self.upsampler());
        for ((sheet, triangles), known) in refined.sheets.iter().zip(triangles).zip(known) {
            let (mut rows, mut traces): (Vec<_>, Vec<_>) = known
                .into_iter()
                .map(|k| match k.flatten() {
                    Some(seen) => (Some(*seen.row), seen.trace),
                    None => (None, None),
                })
                .unzip();
            for (v, like) in self.below(refined, sheet, &triangles, &rows) {
                let (v, like) = (v as usize, like as usize);
                (rows[v], traces[v]) = (rows[like], traces[like].clone());
                out.borrowed += 1;
            }
            out.covered += lend(&mut rows, &triangles);
            // Vertices that were only looked at are left out.
            let mut place = vec![u32::MAX; sheet.vertices.len()];
            let mut surface = BakedSurface {
                surface: sheet.surface,
                back: sheet.back,
                ..BakedSurface::default()
            };
            let (mut spectra, mut kept) = (Vec::new(), Vec::new());
            let look = &looks[self.scene().surfaces[sheet.surface].material];
            for triangle in &triangles {
                surface.triangles.push(triangle.map(|v| {
                    if place[v as usize] == u32::MAX {
                        place[v as usize] = surface.vertices.len() as u32;
                        let row = rows[v as usize].unwrap_or([0.0; 64]);
                        surface.vertices.push(self.vertex(
                            &sheet.vertices[v as usize],
                            sheet.back,
                            &row,
                            look,
                        ));
                        spectra.push(row);
                        if self.keeps() {
                            let Vertex {
                                triangle, weights, ..
                            } = sheet.vertices[v as usize];
                            kept.push(KeptVertex {
                                triangle,
                                weights,
                                trace: traces[v as usize].take(),
                            });
                        }
                    }
                    place[v as usize]
                }));
            }
            out.surfaces.push(surface);
            out.irradiance.push(spectra);
            out.kept.push(kept);
        }
        out
    }

    pub(super) fn vertex(
        &self,
        vertex: &Vertex,
        back: bool,
        row: &[f32; 64],
        look: &Look,
    ) -> BakedVertex {
        let glow = match (look.emits, vertex.entry) {
            (true, entry) if entry != crate::hierarchy::NONE => {
                let w = if back {
                    [vertex.weights[0], vertex.weights[2], vertex.weights[1]]
                } else {
                    vertex.weights
                };
                let leaf = self.tree().leaf_at(entry, w);
                self.lanes()
                    .tristimulus(self.light().emitted.row(leaf as usize))
            }
            _ => [0.0; 3],
        };
        let sum = |weights: &[[f64; 3]]| {
            let mut xyz = [0.0; 3];
            for (x, w) in row.iter().zip(weights) {
                xyz = std::array::from_fn(|c| xyz[c] + f64::from(*x) * w[c]);
            }
            xyz
        };
        let reflected = sum(&look.reflected);
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
            let reflected = sum(&self.lanes().reflected(&paint));
            out.radiosity = std::array::from_fn(|c| (reflected[c] + glow[c]) as f32);
        }
        out
    }
}

fn row(known: &[Known], vertex: u32) -> Option<&[f32; 64]> {
    let seen = known[vertex as usize].as_ref()?.as_ref()?;
    Some(&seen.row)
}

/// How a material turns irradiance into what is seen.
pub(super) struct Look<'a> {
    /// Reflectance on the leaves, vertex colours apart.
    reflectance: Leaves,
    /// Base colour with the texture's mean, where vertex colours multiply it.
    base: Option<[f32; 3]>,
    upsampler: &'a Upsampler,
    /// Tristimulus radiosity for a unit of each lane's irradiance.
    reflected: Vec<[f64; 3]>,
    /// Mean colour of the texture, which the display multiplies again.
    unpainted: Option<[f64; 3]>,
    emits: bool,
}

impl<'a> Look<'a> {
    fn new(bake: &Bake, material: &Material, upsampler: &'a Upsampler) -> Self {
        let mean = material.paint.as_ref().map(|texture| {
            let image = &bake.scene().images[texture.image];
            let n = image.pixels.len().max(1) as f64;
            let sum = image.pixels.iter().fold([0.0; 3], |s: [f64; 3], p| {
                std::array::from_fn(|c| s[c] + f64::from(p[c]))
            });
            sum.map(|x| (x / n).max(1e-3))
        });
        let color: [f32; 3] = std::array::from_fn(|c| {
            material.base_color[c] * mean.map_or(1.0, |mean| mean[c] as f32)
        });
        let reflectance = match mean {
            Some(_) => upsampler.reflectance(color),
            None => material.reflectance,
        };
        Self {
            reflected: bake.lanes().reflected(&reflectance),
            reflectance,
            base: material.vertex_paint.then_some(color),
            upsampler,
            unpainted: mean,
            emits: material.emission.is_some(),
        }
    }

    /// Reflectance at a vertex that vertex colours paint; none elsewhere.
    fn painted(&self, surface: &Surface, vertex: &BakedVertex) -> Option<Leaves> {
        let base = self.base.filter(|_| surface.colors.is_some())?;
        let color = refined_mesh::vertex_color(surface, vertex);
        let color = std::array::from_fn(|c| base[c] * color[c]);
        Some(self.upsampler.reflectance_fast(color))
    }

    /// Reflectance at a vertex.
    pub(super) fn reflectance_at(&self, surface: &Surface, vertex: &BakedVertex) -> Leaves {
        self.painted(surface, vertex).unwrap_or(self.reflectance)
    }
}

/// Gives covered vertices the mean of their neighbours, ring by ring; returns how many there were.
pub(super) fn lend(rows: &mut [Option<[f32; 64]>], triangles: &[[u32; 3]]) -> usize {
    let mut used = vec![false; rows.len()];
    for &v in triangles.iter().flatten() {
        used[v as usize] = true;
    }
    let before = (0..rows.len())
        .filter(|&v| used[v] && rows[v].is_none())
        .count();
    let mut left = before;
    while left > 0 {
        let mut sums: std::collections::BTreeMap<u32, ([f32; 64], f32)> =
            std::collections::BTreeMap::new();
        for t in triangles {
            for &v in t {
                if rows[v as usize].is_none() {
                    for &n in t {
                        if let Some(row) = &rows[n as usize] {
                            let sum = sums.entry(v).or_insert(([0.0; 64], 0.0));
                            sum.1 += 1.0;
                            for (s, x) in sum.0.iter_mut().zip(row) {
                                *s += x;
                            }
                        }
                    }
                }
            }
        }
        if sums.is_empty() {
            break;
        }
        left -= sums.len();
        for (v, (sum, n)) in sums {
            rows[v as usize] = Some(sum.map(|x| x / n));
        }
    }
    before
}

/// Light at any point, for probes.
#[derive(Debug, Clone)]
pub struct Probed {
    /// Tristimulus irradiance; Y is lux.
    pub xyz: [f64; 3],
    /// Irradiance on the 64 leaves, W/m2/nm.
    pub leaves: Leaves,
    /// Share of the rays that met a black back, see [`Gathered::backs`]; above [`MOSTLY`] a vertex there counts as covered.
    pub backs: f64,
}

impl Bake {
    /// Irradiance at points in world space with unit normals.
    pub fn probe(&self, points: &[(DVec3, DVec3)]) -> Vec<Probed> {
        let receivers: Vec<Receiver> = points
            .iter()
            .enumerate()
            .map(|(k, &(point, normal))| self.place(point - self.mesh().centre, normal, k as u64))
            .collect();
        self.gather(&receivers)
            .into_iter()
            .map(
                |Gathered {
                     irradiance, backs, ..
                 }| Probed {
                    backs,
                    xyz: self.lanes().tristimulus(&irradiance),
                    leaves: self.lanes().leaves(&irradiance),
                },
            )
            .collect()
    }

    /// Finds the face that a point lies on, if its normal agrees; a point in the air looks at the whole room.
    fn place(&self, point: DVec3, normal: DVec3, seed: u64) -> Receiver {
        let (mesh, tree) = (self.mesh(), self.tree());
        let near = 1e-6 * mesh.half_size;
        for (entry, face) in tree.faces.iter().enumerate() {
            let n = tree.face_normal[entry];
            if n.dot(normal) < 1.0 - 1e-6 {
                continue;
            }
            let [a, b, c] = mesh.corners(*face);
            if n.dot(point - a).abs() > near {
                continue;
            }
            let w = crate::solve::weights_of(point, a, b, c);
            if w.iter().all(|&x| x >= -1e-9) {
                let w = w.map(|x| x.max(0.0));
                // On an edge the point would lie in the neighbouring wall too, and see past it.
                let edge = w.iter().any(|&x| x < PROBE_INSET);
                let (w, point) = if edge {
                    let w = w.map(|x| x * (1.0 - 3.0 * PROBE_INSET) + PROBE_INSET);
                    (w, a * w[0] + b * w[1] + c * w[2])
                } else {
                    (w, point)
                };
                let leaf = tree.leaf_at(entry as u32, w);
                return Receiver {
                    point,
                    normal,
                    plane: tree.face_plane[entry],
                    leaf: Some(leaf),
                    seed,
                };
            }
        }
        Receiver {
            point,
            normal,
            plane: crate::geometry::NO_PLANE,
            leaf: None,
            seed,
        }
    }
}
