//! Which faces share a space: light can pass between them, straight or over other faces.
//!
//! Random rays join the face that they leave with the face that they meet. A closed room and what lies around it come out
//! as two spaces; a cluster that held faces of both would take light from the one into the other. Rays join nothing that
//! light cannot pass between. They may leave a space in parts, which only makes the cluster tree a little worse.

use super::mesh::Mesh;
use crate::geometry::RayIndex;
use crate::geometry::sampling::{cosine_direction, hash, on_triangle, sequence02};
use rayon::prelude::*;

/// Rays of a face in a pass.
const RAYS: u32 = 8;
/// Rays of the first pass, all faces together: a fraction of a second.
const FIRST_PASS: usize = 1_000_000;
/// Passes over the faces that are not in the largest space yet.
const PASSES: u64 = 4;
/// No face.
const NONE: u32 = u32::MAX;

/// Space of each face of `mesh`: numbers count up in order of the first face. Faces that no ray joins to anything are put
/// to the largest space: they see nothing that could be taken elsewhere.
pub fn spaces(mesh: &Mesh, rays: &RayIndex, seed: u64) -> Vec<u32> {
    let count = mesh.faces.len();
    let mut sides = vec![[NONE; 2]; mesh.triangles.len()];
    for (k, face) in mesh.faces.iter().enumerate() {
        sides[face.triangle as usize][usize::from(face.back)] = k as u32;
    }
    let sides = &sides;
    let mut above: Vec<u32> = (0..count as u32).collect();
    let mut open: Vec<u32> = above.clone();
    for pass in 0..PASSES {
        let wanted = if pass == 0 {
            (FIRST_PASS / count.max(1)).clamp(1, RAYS as usize) as u32
        } else {
            RAYS
        };
        let met: Vec<(u32, u32)> = open
            .par_iter()
            .flat_map_iter(|&face| {
                let seed = hash(hash(seed, pass), u64::from(face));
                (0..wanted)
                    .filter_map(move |k| Some((face, meet(mesh, rays, sides, face, k, seed)?)))
            })
            .collect();
        for (a, b) in met {
            join(&mut above, a, b);
        }
        let largest = largest(&mut above);
        open = (0..count as u32)
            .filter(|&k| find(&mut above, k) != largest)
            .collect();
        if open.is_empty() {
            break;
        }
    }
    numbered(above)
}

/// The face that ray `k` of a face meets.
fn meet(
    mesh: &Mesh,
    rays: &RayIndex,
    sides: &[[u32; 2]],
    face: u32,
    k: u32,
    seed: u64,
) -> Option<u32> {
    let face = mesh.faces[face as usize];
    let from = on_triangle(&mesh.corners(face), sequence02(k, seed));
    let direction = cosine_direction(mesh.face_normal(face), sequence02(k, !seed));
    let reach = (4.0 * mesh.half_size) as f32;
    let plane = mesh.plane[face.triangle as usize];
    let hit = rays.closest(from.as_vec3(), direction.as_vec3(), reach, plane)?;
    let other = sides[hit.triangle as usize][usize::from(hit.from_behind)];
    (other != NONE).then_some(other)
}

/// The representative of a face's set; the way there is halved (Tarjan and van Leeuwen 1984).
fn find(above: &mut [u32], mut k: u32) -> u32 {
    while above[k as usize] != k {
        let next = above[above[k as usize] as usize];
        above[k as usize] = next;
        k = next;
    }
    k
}

/// Joins two sets; the lower number represents both, so that the outcome does not depend on the order.
fn join(above: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(above, a), find(above, b));
    above[a.max(b) as usize] = a.min(b);
}

/// Representative of the set of most faces; the lowest of equals.
fn largest(above: &mut [u32]) -> u32 {
    let mut sizes = vec![0_u32; above.len()];
    for k in 0..above.len() as u32 {
        sizes[find(above, k) as usize] += 1;
    }
    (0..sizes.len())
        .max_by_key(|&k| (sizes[k], std::cmp::Reverse(k)))
        .unwrap_or(0) as u32
}

/// Sets as numbers in order of their first faces; sets of one face go to the largest.
fn numbered(mut above: Vec<u32>) -> Vec<u32> {
    let count = above.len();
    let main = largest(&mut above);
    let mut sizes = vec![0_u32; count];
    let roots: Vec<u32> = (0..count as u32).map(|k| find(&mut above, k)).collect();
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
        // 0 and 3 stand alone and go with 2, 5, 6.
        assert_eq!(numbered(above), [0, 1, 0, 0, 1, 0, 0]);
        assert_eq!(numbered(Vec::new()), Vec::<u32>::new());
    }
}
