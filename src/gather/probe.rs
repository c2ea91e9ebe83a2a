//! The light at any point: on a face, whose links are then used, or in the air.

use crate::hierarchy::Face;
use crate::solve::{Bake, weights_of};
use crate::spectrum::{BANDS, Spectrum};
use crate::transport::{Gathered, Receiver};
use glam::DVec3;

/// Probes nearer to an edge than this share of a triangle's height are moved that far into it: a point on an edge also lies
/// on the neighbouring wall.
const PROBE_INSET: f64 = 1e-5;

/// Points nearer to a face than this share of the room's half diagonal lie on it.
const ON_FACE: f64 = 1e-6;

/// Light at any point, for probes.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Probed {
    /// Tristimulus irradiance; Y is lux.
    pub xyz: [f64; 3],
    /// Irradiance on the 64 bands, W/m2/nm.
    pub spectrum: Spectrum,
    /// Share of the rays that met a black back, see [`Gathered::backs`]; above [`MOSTLY`](super::MOSTLY) a vertex there counts as covered.
    pub backs: f64,
}

/// A point and the faces that it lies on.
pub(super) struct Spot {
    /// Position, recentred.
    point: DVec3,
    /// Entries of the faces, and weights of their corners.
    faces: Vec<(u32, [f64; 3])>,
}

impl Bake {
    /// Irradiance at points in world space with unit normals.
    pub fn probe(&self, points: &[(DVec3, DVec3)]) -> Vec<Probed> {
        let gathered = self.gather_at(points);
        gathered.iter().map(|point| self.probed(point)).collect()
    }

    fn probed(&self, point: &Gathered) -> Probed {
        Probed {
            backs: point.backs,
            xyz: self.lanes().tristimulus(&point.irradiance),
            spectrum: self.lanes().spectrum(&point.irradiance),
        }
    }

    /// [`Self::probe`], and the illuminance by the sky without sun and lamps, lx; none where rows do not separate it from other
    /// light.
    pub fn probe_with_sky(&self, points: &[(DVec3, DVec3)]) -> (Vec<Probed>, Option<Vec<f64>>) {
        let gathered = self.gather_at(points);
        let sky = self.lanes_of_sky().map(|own| {
            let lux = |point: &Gathered| {
                let mut row = point.irradiance;
                for (x, _) in row.iter_mut().zip(own).filter(|(_, own)| !own) {
                    *x = 0.0;
                }
                self.lanes().tristimulus(&row)[1]
            };
            gathered.iter().map(lux).collect()
        });
        let probed = gathered.iter().map(|point| self.probed(point)).collect();
        (probed, sky)
    }

    /// The lanes that hold light of the sky; none where some also hold other light, and without a sky.
    fn lanes_of_sky(&self) -> Option<[bool; BANDS]> {
        let scene = self.scene();
        scene.sky.as_ref()?;
        if !scene.shines_beside_sky() {
            return Some([true; BANDS]);
        }
        let own = scene
            .spectra_of_sky_alone()
            .filter(|_| self.lanes().is_ratio())?;
        let lanes = self.lanes().lanes();
        let light = |lane: usize| lanes.get(lane).and_then(|lane| lane.light);
        Some(std::array::from_fn(|lane| {
            light(lane).is_some_and(|light| own.contains(&light))
        }))
    }

    /// Light at points in world space with unit normals, by lane.
    pub(crate) fn gather_at(&self, points: &[(DVec3, DVec3)]) -> Vec<Gathered> {
        let receivers: Vec<Receiver> = points
            .iter()
            .enumerate()
            .map(|(k, &(point, normal))| {
                let agrees = |face: DVec3| looks_along(face, normal);
                self.receiver_at(&self.spot(point, agrees), normal, k as u64)
            })
            .collect();
        self.gather(&receivers)
    }

    /// Finds the faces that a point in world space lies on, among those whose normals are `wanted`. Where the file has a face that was raised, the
    /// point is moved onto that face: behind it all is dark.
    pub(super) fn spot(&self, point: DVec3, wanted: impl Fn(DVec3) -> bool) -> Spot {
        let (mesh, tree) = (self.mesh(), self.tree());
        let mut point = point - mesh.centre;
        let mut found = self.faces_at(point, &wanted);
        let deepest = found.iter().max_by(|a, b| a.2.total_cmp(&b.2));
        if let Some(&(entry, _, behind)) = deepest
            && behind > ON_FACE * mesh.half_size
        {
            point += behind * tree.face_normal[entry as usize];
            found = self.faces_at(point, &wanted);
        }
        let faces = found.into_iter().map(|(entry, w, _)| (entry, w)).collect();
        Spot { point, faces }
    }

    /// Faces with `wanted` normals that a point lies on, or behind by no more than they were raised: entries, weights of the corners, and how far
    /// behind it lies.
    fn faces_at(&self, point: DVec3, wanted: &impl Fn(DVec3) -> bool) -> Vec<(u32, [f64; 3], f64)> {
        let (mesh, tree) = (self.mesh(), self.tree());
        let near = ON_FACE * mesh.half_size;
        let highest = mesh.raised.iter().map(|raised| raised.height);
        let highest = highest.fold(0.0, f64::max);
        let at = |(entry, face): (usize, &Face)| {
            let n = tree.face_normal[entry];
            if !wanted(n) {
                return None;
            }
            let [a, b, c] = mesh.corners(*face);
            let behind = -n.dot(point - a);
            if behind < -near || behind > near + highest {
                return None;
            }
            let w = weights_of(point, a, b, c);
            (w.iter().all(|&x| x >= -1e-9) && (behind <= near + mesh.raised_by(face.triangle)))
                .then_some((entry as u32, w, behind))
        };
        tree.faces.iter().enumerate().filter_map(at).collect()
    }

    /// A receiver at a spot with a normal: on its face, if that has the same normal; a point in the air receives from the whole
    /// room.
    pub(super) fn receiver_at(&self, spot: &Spot, normal: DVec3, seed: u64) -> Receiver {
        let (mesh, tree) = (self.mesh(), self.tree());
        let agrees =
            |(entry, _): &&(u32, [f64; 3])| looks_along(tree.face_normal[*entry as usize], normal);
        let Some(&(entry, w)) = spot.faces.iter().find(agrees) else {
            return Receiver {
                point: spot.point,
                normal,
                plane: crate::geometry::NO_PLANE,
                leaf: None,
                seed,
            };
        };
        let w = w.map(|x| x.max(0.0));
        // On an edge the point would also lie in the neighbouring wall, and see past it.
        let edge = w.iter().any(|&x| x < PROBE_INSET);
        let (w, point) = if edge {
            let [a, b, c] = mesh.corners(tree.faces[entry as usize]);
            let w = w.map(|x| x * (1.0 - 3.0 * PROBE_INSET) + PROBE_INSET);
            (w, a * w[0] + b * w[1] + c * w[2])
        } else {
            (w, spot.point)
        };
        Receiver {
            point,
            normal,
            plane: tree.face_plane[entry as usize],
            leaf: Some(tree.leaf_at(entry, w)),
            seed,
        }
    }
}

/// Is a face's normal along `normal`?
fn looks_along(face: DVec3, normal: DVec3) -> bool {
    face.dot(normal) >= 1.0 - 1e-6
}
