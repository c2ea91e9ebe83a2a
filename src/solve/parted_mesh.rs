//! The mesh cut where large things meet, and which of its faces share a space, found by rays before the first round.

use crate::geometry::RayIndex;
use crate::hierarchy::{Mesh, cuts, spaces};
use crate::scene::Scene;
use crate::scene::effects::{EffectKind, Plan};
use crate::team::{Interrupt, Interrupted};

/// A mesh whose triangles end where spaces end.
pub(super) struct PartedMesh {
    pub(super) mesh: Mesh,
    /// Empty where spaces are known.
    pub(super) rays: RayIndex,
    /// Space of each face.
    pub(super) spaces: Vec<u32>,
}

impl PartedMesh {
    /// Cuts a mesh, and casts rays to find the spaces unless they are known. Without occlusion nothing is cut, and all is one space.
    pub(super) fn new(
        scene: &Scene,
        mut mesh: Mesh,
        plan: &Plan,
        seed: u64,
        known: Option<Vec<u32>>,
        interrupt: &Interrupt,
    ) -> Result<Self, Interrupted> {
        let mut rays = mesh.index(scene);
        let occlusion = plan.runs(EffectKind::Occlusion);
        if occlusion {
            interrupt.check()?;
            let cuts = cuts(&mesh, &rays);
            interrupt.check()?;
            if !cuts.is_empty() {
                mesh = mesh.cut(&cuts);
                if known.is_none() {
                    rays = mesh.index(scene);
                }
            }
        }
        interrupt.check()?;
        let spaces = match known {
            Some(mut spaces) => {
                rays = RayIndex::build(&[], &[], &[], &[]);
                spaces.resize(mesh.faces.len(), 0);
                spaces
            }
            None if occlusion => spaces(&mesh, &rays, seed),
            None => vec![0; mesh.faces.len()],
        };
        Ok(Self { mesh, rays, spaces })
    }
}
