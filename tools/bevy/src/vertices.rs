//! Colours of vertices: `Mesh::ATTRIBUTE_COLOR`, and whether the material is drawn without lamps.

use crate::Findings;
use crate::file::{Glb, number};
use crate::load::Assets;
use bevy_gltf::{Gltf, GltfMaterial, GltfMesh, GltfPrimitive};
use bevy_mesh::{Mesh, VertexAttributeValues};

/// A primitive of a loaded file.
pub(crate) fn primitive<'a>(
    assets: &'a Assets,
    gltf: &Gltf,
    mesh: usize,
    primitive: usize,
) -> (&'a Mesh, &'a GltfMaterial) {
    let GltfPrimitive { mesh, material, .. } =
        &assets.get::<GltfMesh>(&gltf.meshes[mesh]).primitives[primitive];
    let material = material.as_ref().expect("a material");
    (assets.get(mesh), assets.get(material))
}

/// Vertices of a mesh by corners of its triangles: Bevy parts vertices where it reckons normals.
pub(crate) fn corners(mesh: &Mesh) -> Vec<usize> {
    match mesh.indices() {
        Some(indices) => indices.iter().collect(),
        None => (0..mesh.count_vertices()).collect(),
    }
}

pub(crate) fn check(file: &Glb, assets: &mut Assets, findings: &mut Findings) {
    let handle = assets.load::<Gltf>(&file.name());
    let gltf = assets.get(&handle);
    let (mut count, mut most, mut unlit, mut more) = (0, 0.0_f32, true, 0);
    for m in 0..gltf.meshes.len() {
        for p in 0..assets.get::<GltfMesh>(&gltf.meshes[m]).primitives.len() {
            let wanted = file.floats(&file.primitive(m, p)["attributes"]["COLOR_0"]);
            let (mesh, material) = primitive(assets, gltf, m, p);
            unlit &= material.unlit;
            let Some(VertexAttributeValues::Float32x4(found)) =
                mesh.attribute(Mesh::ATTRIBUTE_COLOR)
            else {
                findings.say(
                    &file.name(),
                    false,
                    "a mesh has no ATTRIBUTE_COLOR of floats",
                );
                return;
            };
            let pairs = corners(mesh).into_iter().zip(file.corners(m, p));
            for (a, b) in pairs {
                let off = (0..3).map(|c| (found[a][c] - wanted[b][c]).abs());
                most = off.fold(most, f32::max);
                count += 1;
            }
            assert_eq!(corners(mesh).len(), file.corners(m, p).len());
            more += number(&mesh.count_vertices().into()).saturating_sub(wanted.len());
        }
    }
    let text = format!(
        "{count} corners of triangles, greatest difference {most} in ATTRIBUTE_COLOR, {} ({more} vertices more, for flat normals)",
        if unlit { "unlit" } else { "NOT unlit" }
    );
    findings.say("vertices", most == 0.0 && unlit && count > 0, &text);
}
