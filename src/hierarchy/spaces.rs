//! Which faces share a space: light can pass between them, straight or over other faces.
//!
//! Random rays join the face that they leave with the face that they meet. A closed room and its surroundings turn out to
//! be two spaces; a cluster with faces of both would take light from one into the other. Rays join nothing between which
//! light cannot pass. They may fail to join all parts of a space, which only makes the cluster tree a little worse.
//! Triangles that lie in two spaces were cut before ([`super::cut`]).

use super::NONE;
use super::mesh::{Face, Mesh};
use crate::geometry::sampling::{cosine_direction, hash, on_triangle, sequence02};
use crate::geometry::{Hit, RayIndex};
use crate::scene::sets::{join, root};
use rayon::prelude::*;

/// Rays of a face in one pass.
const RAYS: u32 = 8;
/// Rays of the first pass, for all faces together: a fraction of a second.
const FIRST_PASS: usize = 1_000_000;
/// Passes over the faces that are not yet in the largest space.
const PASSES: u64 = 4;
/// Rays tell nothing that start or end nearer than this share of the scene's half size to an edge of a triangle: single precision might
/// take them through a wall that stands there.
const CLEAR_OF_BORDER: f64 = 1e-5;

/// Finds the space of each face of a mesh, numbered in order of the first face. Faces that no ray joins to anything are added to
/// the largest space: they see nothing whose light could be taken elsewhere.
pub fn spaces(mesh: &Mesh, rays: &RayIndex, seed: u64) -> Vec<u32> {
    let count = mesh.faces.len();
    let mut sides = vec![[NONE; 2]; mesh.triangles.len()];
    for (face, k) in mesh.faces.iter().zip(0_u32..) {
        sides[face.triangle as usize][usize::from(face.back)] = k;
    }
    let mut above: Vec<u32> = (0..count as u32).collect();
    let mut open = above.clone();
    for pass in 0..PASSES {
        let wanted = match pass {
            0 => (FIRST_PASS / count.max(1)).clamp(1, RAYS as usize) as u32,
            _ => RAYS,
        };
        let met: Vec<(u32, u32)> = open
            .par_iter()
            .flat_map_iter(|&id| {
                let (seed, sides) = (hash(hash(seed, pass), u64::from(id)), &sides);
                (0..wanted).filter_map(move |k| {
                    let face = mesh.faces[id as usize];
                    let hit = meet(mesh, rays, face, k, seed)?;
                    let other = sides[hit.triangle as usize][usize::from(hit.from_behind)];
                    (other != NONE).then_some((id, other))
                })
            })
            .collect();
        for (a, b) in met {
            join(&mut above, a, b);
        }
        let largest = largest(&mut above);
        open.retain(|&k| root(&mut above, k) != largest);
        if open.is_empty() {
            break;
        }
    }
    numbered(above)
}

/// What ray `k` of a face meets, if that tells anything.
fn meet(mesh: &Mesh, rays: &RayIndex, face: Face, k: u32, seed: u64) -> Option<Hit> {
    let from = on_triangle(&mesh.corners(face), sequence02(k, seed));
    let direction = cosine_direction(mesh.face_normal(face), sequence02(k, !seed));
    let reach = (4.0 * mesh.reach) as f32;
    let plane = mesh.plane[face.triangle as usize];
    let hit = rays.closest(from.as_vec3(), direction.as_vec3(), reach, plane)?;
    let clear = CLEAR_OF_BORDER * mesh.half_size;
    let end = from + direction * f64::from(hit.t);
    let is_clear = |triangle: u32, at| mesh.distance_to_border(triangle as usize, at) > clear;
    (is_clear(face.triangle, from) && is_clear(hit.triangle, end)).then_some(hit)
}

/// Representative of the set of most faces; the lowest of equals.
fn largest(above: &mut [u32]) -> u32 {
    let mut sizes = vec![0_u32; above.len()];
    for k in 0..above.len() as u32 {
        sizes[root(above, k) as usize] += 1;
    }
    (0..sizes.len())
        .max_by_key(|&k| (sizes[k], std::cmp::Reverse(k)))
        .unwrap_or(0) as u32
}

/// Sets numbered in order of their first faces; sets of one face are added to the largest.
fn numbered(mut above: Vec<u32>) -> Vec<u32> {
    let count = above.len();
    let main = largest(&mut above);
    let mut sizes = vec![0_u32; count];
    let roots: Vec<u32> = (0..count as u32).map(|k| root(&mut above, k)).collect();
    for &root in &roots {
        sizes[root as usize] += 1;
    }
    let mut number = vec![NONE; count];
    let mut next = 0;
    roots
        .into_iter()
        .map(|root| {
            let root = if sizes[root as usize] == 1 {
                main
            } else {
                root
            } as usize;
            if number[root] == NONE {
                number[root] = next;
                next += 1;
            }
            number[root]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_joined_and_numbered() {
        let mut above: Vec<u32> = (0..7).collect();
        for (a, b) in [(5, 2), (2, 6), (1, 4)] {
            join(&mut above, a, b);
        }
        assert_eq!(largest(&mut above), 2);
        // 0 and 3 are single and go with 2, 5, 6.
        assert_eq!(numbered(above), [0, 1, 0, 0, 1, 0, 0]);
        assert_eq!(numbered(Vec::new()), Vec::<u32>::new());
    }
}
