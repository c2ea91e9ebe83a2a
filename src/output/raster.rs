//! A software rasteriser with perspective-correct weights and no clipping: Olano and Greer, Triangle scan conversion
//! using 2D homogeneous coordinates (Graphics Hardware 1997).
//!
//! With the corners p_i in homogeneous pixel coordinates and a sample s = (x, y, 1), e_0 = s . (p_1 x p_2) and so on:
//! the sample is inside where all e_i have the sign of det(p_0, p_1, p_2); the corner weights are e_i / sum(e), which is
//! perspective-correct; what is behind the eye drops out by sign. Samples exactly on an edge follow the top-left rule
//! (e_i of neighbours are exact negatives), so triangles that share an edge neither overlap nor leave a gap.
//!
//! Back faces are not drawn: the back of a two-sided surface is a sheet of its own, with its own light. The nearest sample wins, the first triangle of equals.
//! Strips of rows are drawn in parallel; the result does not depend on their order.

use super::camera::View;
use crate::gather::refined;
use crate::gather::{BakedSurface, BakedVertex};
use crate::scene::{Alpha, Material, Scene, Sides, Surface};
use glam::DVec3;
use rayon::prelude::*;

/// Rows of pixels in a strip.
const STRIP: usize = 16;

/// What a sample shows: a triangle and the weights of its corners.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fragment {
    pub(super) mesh: u32,
    pub(super) triangle: u32,
    pub(super) weights: [f64; 3],
}

/// Triangles to draw. `corner` must give equal points for equal vertices.
pub(super) trait RasterMeshes: Sync {
    /// Number of triangles of each mesh.
    fn sizes(&self) -> Vec<usize>;
    /// World positions, counter-clockwise from the front.
    fn corners(&self, mesh: usize, triangle: usize) -> [DVec3; 3];
    /// Are back faces drawn?
    fn two_sided(&self, mesh: usize) -> bool;
    /// Does this mesh have holes at all?
    fn has_holes(&self, mesh: usize) -> bool;
    /// Is this point of a mesh with holes a hole?
    fn is_hole(&self, hit: &Fragment) -> bool;
}

/// Draws into strips of `STRIP` pixel rows with `grid` by `grid` samples a pixel; `finish` turns each row of samples
/// (`grid` rows of `width * grid`, from the top) into pixels. Rows come back in order.
pub(super) fn draw<T: Send>(
    meshes: &impl RasterMeshes,
    view: &View,
    [width, height]: [usize; 2],
    grid: usize,
    finish: impl Fn(&[Option<Fragment>]) -> Vec<T> + Sync,
) -> Vec<T> {
    let strips = bins(meshes, view, [width, height]);
    let rows = strips.par_iter().enumerate().map(|(strip, triangles)| {
        let first = strip * STRIP;
        let count = STRIP.min(height - first);
        let samples = draw_band(meshes, view, triangles, width, first, count, grid);
        samples
            .chunks(width * grid * grid)
            .flat_map(&finish)
            .collect::<Vec<T>>()
    });
    rows.collect::<Vec<_>>().into_iter().flatten().collect()
}

/// A triangle ready to be sampled.
struct Setup {
    /// Edge functions, turned so that inside is positive.
    edges: [DVec3; 3],
    depths: [f64; 3],
    /// Pixel box: x from, to, y from, to.
    bounds: [f64; 4],
}

impl Setup {
    /// None: faces away, has no area, or lies out of sight.
    fn new(
        meshes: &impl RasterMeshes,
        view: &View,
        mesh: usize,
        triangle: usize,
        size: [usize; 2],
    ) -> Option<Self> {
        let corners = meshes.corners(mesh, triangle).map(|p| view.project(p));
        let [a, b, c] = corners.map(|c| c.pixel);
        let edges = [b.cross(c), c.cross(a), a.cross(b)];
        let determinant = a.dot(edges[0]);
        // Counter-clockwise turns negative with y down.
        let front = determinant < 0.0;
        if determinant == 0.0 || !determinant.is_finite() || (!front && !meshes.two_sided(mesh)) {
            return None;
        }
        let edges = if front { edges.map(|e| -e) } else { edges };
        let bounds = bounds(&corners, view.near(), size)?;
        Some(Self {
            edges,
            depths: corners.map(|c| c.depth),
            bounds,
        })
    }

    /// About where a row enters and leaves the triangle.
    fn span(&self, y: f64, [mut from, mut to]: [f64; 2]) -> [f64; 2] {
        for edge in &self.edges {
            let zero = -(edge.y * y + edge.z) / edge.x;
            if edge.x > 0.0 {
                from = from.max(zero);
            } else if edge.x < 0.0 {
                to = to.min(zero);
            }
        }
        [from, to]
    }

    /// Corner weights and depth at a sample inside the triangle.
    fn sample(&self, x: f64, y: f64) -> Option<([f64; 3], f64)> {
        let at = self.edges.map(|e| e.x * x + e.y * y + e.z);
        for (value, edge) in at.iter().zip(&self.edges) {
            let owned = edge.x > 0.0 || (edge.x == 0.0 && edge.y > 0.0);
            if *value < 0.0 || (*value == 0.0 && !owned) {
                return None;
            }
        }
        let sum = at[0] + at[1] + at[2];
        if sum <= 0.0 {
            return None;
        }
        let weights = at.map(|e| e / sum);
        let depth =
            weights[0] * self.depths[0] + weights[1] * self.depths[1] + weights[2] * self.depths[2];
        Some((weights, depth))
    }
}

/// Pixel box of the part beyond the near plane, clipped to the picture.
fn bounds(
    corners: &[super::camera::Projected; 3],
    near: f64,
    [width, height]: [usize; 2],
) -> Option<[f64; 4]> {
    let mut bounds = [
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
    ];
    let mut include = |p: DVec3| {
        let (x, y) = (p.x / p.z, p.y / p.z);
        bounds = [
            bounds[0].min(x),
            bounds[1].max(x),
            bounds[2].min(y),
            bounds[3].max(y),
        ];
    };
    for i in 0..3 {
        let (a, b) = (&corners[i], &corners[(i + 1) % 3]);
        if a.depth >= near {
            include(a.pixel);
        }
        if (a.depth >= near) != (b.depth >= near) {
            include(
                a.pixel
                    .lerp(b.pixel, (near - a.depth) / (b.depth - a.depth)),
            );
        }
    }
    let clipped = [
        bounds[0].max(0.0),
        bounds[1].min(width as f64),
        bounds[2].max(0.0),
        bounds[3].min(height as f64),
    ];
    (clipped[0] <= clipped[1] && clipped[2] <= clipped[3]).then_some(clipped)
}

/// For each strip the (mesh, triangle) that touch it, in order.
fn bins(meshes: &impl RasterMeshes, view: &View, size: [usize; 2]) -> Vec<Vec<[u32; 2]>> {
    let mut strips = vec![Vec::new(); size[1].div_ceil(STRIP)];
    let last = strips.len().saturating_sub(1);
    for (mesh, triangles) in meshes.sizes().into_iter().enumerate() {
        let touched: Vec<(u32, usize, usize)> = (0..triangles)
            .into_par_iter()
            .filter_map(|triangle| {
                let setup = Setup::new(meshes, view, mesh, triangle, size)?;
                let strip = |y: f64| ((y / STRIP as f64) as usize).min(last);
                Some((
                    triangle as u32,
                    strip(setup.bounds[2]),
                    strip(setup.bounds[3]),
                ))
            })
            .collect();
        for (triangle, from, to) in touched {
            strips[from..=to]
                .iter_mut()
                .for_each(|strip| strip.push([mesh as u32, triangle]));
        }
    }
    strips
}

fn draw_band(
    meshes: &impl RasterMeshes,
    view: &View,
    triangles: &[[u32; 2]],
    width: usize,
    first: usize,
    count: usize,
    grid: usize,
) -> Vec<Option<Fragment>> {
    let across = width * grid;
    let down = count * grid;
    let step = 1.0 / grid as f64;
    // Sample numbers from pixel coordinates; samples lie in the middle of their cells.
    let number = |pixel: f64, most: usize| ((pixel / step).max(0.0) as usize).min(most);
    let top = first as f64;
    let mut depths = vec![f64::INFINITY; across * down];
    let mut hits = vec![None; depths.len()];
    let size = [width, first + count];
    for &[mesh, triangle] in triangles {
        let Some(setup) = Setup::new(meshes, view, mesh as usize, triangle as usize, size) else {
            continue;
        };
        let holes = meshes.has_holes(mesh as usize);
        let [x0, x1, y0, y1] = setup.bounds;
        for row in number(y0 - top, down)..(number(y1 - top, down) + 1).min(down) {
            let y = top + (row as f64 + 0.5) * step;
            let [from, to] = setup.span(y, [x0, x1]);
            // A sample more on both sides: the span is rounded, the test below is exact.
            for column in number(from - step, across)..(number(to + step, across) + 1).min(across) {
                let Some((weights, depth)) = setup.sample((column as f64 + 0.5) * step, y) else {
                    continue;
                };
                let at = row * across + column;
                let hit = Fragment {
                    mesh,
                    triangle,
                    weights,
                };
                if depth >= view.near() && depth < depths[at] && !(holes && meshes.is_hole(&hit)) {
                    depths[at] = depth;
                    hits[at] = Some(hit);
                }
            }
        }
    }
    hits
}

/// The input mesh without what has holes: for what a camera sees.
struct Bare<'a> {
    scene: &'a Scene,
}

impl Bare<'_> {
    fn material(&self, mesh: usize) -> Option<&Material> {
        let surface = &self.scene.surfaces[mesh];
        self.scene.materials.get(surface.material)
    }
}

impl RasterMeshes for Bare<'_> {
    fn sizes(&self) -> Vec<usize> {
        let surfaces = self.scene.surfaces.iter();
        surfaces.map(|s| s.triangles.len()).collect()
    }

    fn corners(&self, mesh: usize, triangle: usize) -> [DVec3; 3] {
        let surface = &self.scene.surfaces[mesh];
        surface.triangles[triangle].map(|c| surface.positions[c as usize])
    }

    fn two_sided(&self, mesh: usize) -> bool {
        self.scene.sides(mesh) == Sides::Both
    }

    fn has_holes(&self, mesh: usize) -> bool {
        let masked = |m: &Material| matches!(m.alpha, Alpha::Mask { .. });
        self.material(mesh).is_some_and(masked)
    }

    fn is_hole(&self, _: &Fragment) -> bool {
        true
    }
}

/// Which triangles of each surface of the input a picture shows; all of those with holes.
pub(super) fn seen(scene: &Scene, view: &View, size: [usize; 2], grid: usize) -> Vec<Vec<bool>> {
    let meshes = Bare { scene };
    let mut seen: Vec<Vec<bool>> = (scene.surfaces.iter().enumerate())
        .map(|(mesh, surface)| vec![meshes.has_holes(mesh); surface.triangles.len()])
        .collect();
    let hits = draw(&meshes, view, size, grid, |row| {
        let mut hits: Vec<[u32; 2]> = row.iter().flatten().map(|h| [h.mesh, h.triangle]).collect();
        hits.dedup();
        hits
    });
    for [mesh, triangle] in hits {
        seen[mesh as usize][triangle as usize] = true;
    }
    seen
}

/// The refined mesh.
pub(super) struct RefinedMesh<'a> {
    pub(super) scene: &'a Scene,
    pub(super) surfaces: &'a [BakedSurface],
}

impl<'a> RefinedMesh<'a> {
    /// The surface and the corners of a hit.
    pub(super) fn at(&self, hit: &Fragment) -> (&'a Surface, [&'a BakedVertex; 3]) {
        let baked = &self.surfaces[hit.mesh as usize];
        let corners = baked.triangles[hit.triangle as usize].map(|v| &baked.vertices[v as usize]);
        (&self.scene.surfaces[baked.surface], corners)
    }

    /// Does a texture multiply the light of this hit?
    pub(super) fn is_textured(&self, hit: &Fragment) -> bool {
        let surface = &self.scene.surfaces[self.surfaces[hit.mesh as usize].surface];
        self.scene.materials[surface.material].paint.is_some()
    }

    /// Texture coordinates of a set, interpolated.
    pub(super) fn uv(
        &self,
        surface: &Surface,
        corners: [&BakedVertex; 3],
        weights: [f64; 3],
        set: usize,
    ) -> [f32; 2] {
        let Some(coordinates) = surface.texcoords.get(set) else {
            return [0.0; 2];
        };
        let mut uv = [0.0f64; 2];
        for (vertex, weight) in corners.into_iter().zip(weights) {
            for (corner, share) in refined::corners(surface, vertex)
                .into_iter()
                .zip(vertex.weights)
            {
                let [u, v] = coordinates.get(corner).copied().unwrap_or_default();
                uv[0] += weight * share * f64::from(u);
                uv[1] += weight * share * f64::from(v);
            }
        }
        uv.map(|c| c as f32)
    }
}

impl RasterMeshes for RefinedMesh<'_> {
    fn sizes(&self) -> Vec<usize> {
        self.surfaces.iter().map(|s| s.triangles.len()).collect()
    }

    fn corners(&self, mesh: usize, triangle: usize) -> [DVec3; 3] {
        let baked = &self.surfaces[mesh];
        let surface = &self.scene.surfaces[baked.surface];
        baked.triangles[triangle].map(|v| refined::position(surface, &baked.vertices[v as usize]))
    }

    fn two_sided(&self, _: usize) -> bool {
        // Each side is a sheet of its own.
        false
    }

    fn has_holes(&self, mesh: usize) -> bool {
        let surface = &self.scene.surfaces[self.surfaces[mesh].surface];
        matches!(
            self.scene.materials[surface.material].alpha,
            Alpha::Mask { .. }
        )
    }

    fn is_hole(&self, hit: &Fragment) -> bool {
        let (surface, corners) = self.at(hit);
        let Alpha::Mask {
            cutoff,
            factor,
            texture,
        } = &self.scene.materials[surface.material].alpha
        else {
            return false;
        };
        let mut alpha = *factor;
        if let Some(texture) = texture {
            let uv = self.uv(surface, corners, hit.weights, texture.texcoord);
            alpha *= texture.sample(&self.scene.images, uv)[3];
        }
        let vertex =
            |k: usize| f64::from(refined::vertex_color(surface, corners[k])[3]) * hit.weights[k];
        alpha *= (vertex(0) + vertex(1) + vertex(2)) as f32;
        alpha < *cutoff
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat4;
    use proptest::prelude::*;

    /// A square of two by two, cut into a fan around an inner point.
    struct Fan(DVec3);

    impl RasterMeshes for Fan {
        fn sizes(&self) -> Vec<usize> {
            vec![4]
        }

        fn corners(&self, _: usize, triangle: usize) -> [DVec3; 3] {
            let rim = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
            let at = |i: usize| DVec3::new(rim[i % 4][0], rim[i % 4][1], 0.0);
            [self.0, at(triangle), at(triangle + 1)]
        }

        fn two_sided(&self, _: usize) -> bool {
            true
        }

        fn has_holes(&self, _: usize) -> bool {
            false
        }

        fn is_hole(&self, _: &Fragment) -> bool {
            false
        }
    }

    proptest! {
        /// Places on the grid of samples make ties at vertices and along edges.
        #[test]
        fn every_sample_belongs_to_one_triangle(i in -7i32..8, j in -7i32..8, turned in any::<bool>()) {
            let fan = Fan(DVec3::new(f64::from(i) / 8.0, f64::from(j) / 8.0, 0.0));
            let scene = Scene {
                panes: Vec::new(),
                source: crate::scene::Source { path: "".into(), json: serde_json::Value::Null, buffers: vec![] },
                grid: crate::spectrum::Grid::default(),
                surfaces: vec![],
                materials: vec![],
                solids: Default::default(),
                images: vec![],
                spectra: vec![],
                lights: vec![],
                sky: None,
                cameras: vec![],
                warnings: vec![],
                changes: Default::default(),
            };
            let turn = if turned { std::f64::consts::PI } else { 0.0 };
            let camera = crate::scene::Camera {
                name: String::new(),
                to_world: DMat4::from_rotation_y(turn) * DMat4::from_translation(DVec3::Z),
                projection: crate::scene::Projection::Orthographic(1.0),
                aspect: None,
            };
            let view = View::new(&scene, &camera, 16, 16);
            let setups: Vec<_> =
                (0..4).filter_map(|t| Setup::new(&fan, &view, 0, t, [16, 16])).collect();
            prop_assert_eq!(setups.len(), 4);
            // Eighths of a pixel, ties and all; the rim is left out.
            for y in 1..128 {
                for x in 1..128 {
                    let (x, y) = (f64::from(x) / 8.0, f64::from(y) / 8.0);
                    let owners = setups.iter().filter(|s| s.sample(x, y).is_some()).count();
                    prop_assert_eq!(owners, 1, "at {} {}", x, y);
                }
            }
        }
    }
}
