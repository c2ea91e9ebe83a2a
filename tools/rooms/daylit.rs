//! A room with a window and nothing else that shines: sky and sun come from its side file.

use super::cells::Cells;
use super::glb::{Glb, Mesh};
use super::shapes::block;
use super::simple::within;
use glam::dvec3;
use serde_json::{Value, json};

/// 5 x 4 m, 2.8 m high; a window of 2 x 1.3 m in the south wall (+Z), .3 m thick; a table.
pub(crate) fn room() -> Glb {
    let mut glb = Glb::default();
    let walls = glb.paint("walls", [0.75, 0.74, 0.7]);
    let ceiling = glb.paint("ceiling", [0.86; 3]);
    let floor = glb.paint("floor", [0.35, 0.22, 0.12]);
    let red = glb.paint("red wall", [0.55, 0.09, 0.07]);
    let sill = glb.paint("window reveal", [0.8; 3]);
    let wood = glb.paint("table", [0.5, 0.34, 0.18]);
    // What closes the window in the grid is not drawn.
    let nothing = usize::MAX;
    let (width, height, depth) = (5.0, 2.8, 4.0);
    let cells = Cells {
        cuts: [
            &[0.0, 1.6, 3.6, width],
            &[0.0, 0.9, 2.2, height],
            &[0.0, depth, depth + 0.3],
        ],
        hollow: &|p| p.z < depth || within(p, [1.6, 0.9, depth], [3.6, 2.2, depth + 0.3]),
        paint: &|p, n| match () {
            () if p.z > depth + 0.29 => nothing,
            () if p.z > depth => sill,
            () if p.y == 0.0 => floor,
            () if p.y == height => ceiling,
            () if n.x < -0.5 && p.z < depth => red,
            () => walls,
        },
    };
    let mut meshes = cells.meshes();
    meshes.remove(&nothing);
    meshes.values_mut().for_each(|mesh| mesh.uvs.clear());
    let parts: Vec<(&Mesh, usize)> = meshes.iter().map(|(paint, mesh)| (mesh, *paint)).collect();
    glb.draw("room", &parts);
    let mut table = block([3.2, 0.7, 0.4], [4.6, 0.75, 1.2]);
    for (x, z) in [(3.25, 0.45), (4.49, 0.45), (3.25, 1.09), (4.49, 1.09)] {
        table.append(&block([x, 0.0, z], [x + 0.06, 0.7, z + 0.06]));
    }
    table.uvs.clear();
    glb.draw("table", &[(&table, wood)]);
    glb.camera(
        "door",
        dvec3(0.35, 1.6, 0.3),
        dvec3(3.3, 0.75, 2.7),
        1.2,
        4.0 / 3.0,
    );
    glb
}

/// A clear sky, the sun in the south-west.
pub(crate) fn spectra() -> Value {
    json!({
        "sky": {
            "type": "clear",
            "sun": {"elevation_deg": 38.0, "azimuth_deg": 212.0},
        }
    })
}
