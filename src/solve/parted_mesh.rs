//! Which faces share a space, found by rays before the first round, and the mesh cut where triangles belong to several.

use crate::geometry::RayIndex;
use crate::hierarchy::{Mesh, cuts, spaces};
use crate::link::is_small;
use crate::scene::Scene;
use crate::scene::effects::{EffectKind, Plan};

/// A mesh whose triangles end where spaces end.
pub(super) struct PartedMesh {
    pub(super) mesh: Mesh,
    /// Empty where known cuts are repeated.
    pub(super) rays: RayIndex,
    /// Space of each face.
    pub(super) spaces: Vec<u32>,
    /// Which of the cuts were made.
    pub(super) parted: Vec<u32>,
}

impl PartedMesh {
    /// Casts rays to find the spaces, and cuts what parts them. Without occlusion all is one space.
    pub(super) fn find(scene: &Scene, mesh: Mesh, plan: &Plan, seed: u64) -> Self {
        let rays = mesh.index(scene);
        if !plan.runs(EffectKind::Occlusion) {
            return Self {
                spaces: vec![0; mesh.faces.len()],
                parted: Vec::new(),
                mesh,
                rays,
            };
        }
        let cuts = cuts(&mesh, &rays, is_small(&mesh));
        let found = spaces(&mesh, &rays, &cuts, seed);
        let parted = if is_small(&mesh) {
            // Cut them all, not only those that part spaces: a patch that something stands on shows its uncovered part as
            // one, dark wedges along the contact; one close behind a lamp shows the light of the gap to the room.
            (0..cuts.len()).collect()
        } else {
            found.parted
        };
        if parted.is_empty() {
            return Self {
                spaces: found.of_face,
                parted: Vec::new(),
                mesh,
                rays,
            };
        }
        let some: Vec<_> = parted.iter().map(|&k| cuts[k].clone()).collect();
        let mesh = mesh.cut(&some);
        let rays = mesh.index(scene);
        Self {
            spaces: spaces(&mesh, &rays, &[], seed).of_face,
            parted: parted.iter().map(|&k| k as u32).collect(),
            mesh,
            rays,
        }
    }

    /// Repeats the cuts made to a mesh before: no ray is cast, and no index is kept.
    pub(super) fn again(scene: &Scene, mesh: Mesh, spaces: Vec<u32>, parted: Vec<u32>) -> Self {
        let mesh = if parted.is_empty() {
            mesh
        } else {
            let cuts = cuts(&mesh, &mesh.index(scene), is_small(&mesh));
            let some: Vec<_> = parted
                .iter()
                .filter_map(|&k| cuts.get(k as usize).cloned())
                .collect();
            mesh.cut(&some)
        };
        let mut spaces = spaces;
        spaces.resize(mesh.faces.len(), 0);
        Self {
            mesh,
            rays: RayIndex::build(&[], &[], &[], &[]),
            spaces,
            parted,
        }
    }
}
