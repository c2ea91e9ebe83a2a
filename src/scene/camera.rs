//! The cameras of the scene (glTF 2.0, section 3.10). A camera without a view is left out with a warning: nothing is baked
//! through it.

use crate::scene::check::Check;
use crate::scene::json::{self, Item};
use crate::scene::nodes::Placed;
use crate::scene::{Camera, Projection};
use serde_json::Value;

/// One entry for each node of the scene that carries a camera.
pub(crate) fn cameras(json: &Value, placed: &[Placed], check: &mut Check) -> Vec<Camera> {
    let mut cameras = Vec::new();
    for placed in placed {
        let Some(node) = json::item(json, "nodes", "node", placed.node) else {
            continue;
        };
        let Some(index) = node.index("camera", check) else {
            continue;
        };
        let item = json::referred(json, "cameras", "camera", index, &node.place, check);
        let Some(item) = item else { continue };
        match lens(&item, check) {
            Some((projection, aspect)) => {
                let names = [item.name(), node.name()];
                let name = names.into_iter().find(|name| !name.is_empty());
                cameras.push(Camera {
                    name: name.map_or_else(|| format!("camera {index}"), str::to_owned),
                    to_world: placed.to_world,
                    projection,
                    aspect,
                });
            }
            None => check.warn(format!("{} has no view and is left out", item.place)),
        }
    }
    cameras
}

fn lens(item: &Item<'_>, check: &mut Check) -> Option<(Projection, Option<f64>)> {
    match item.text("type", check)? {
        "perspective" => {
            let lens = item.child("perspective", check)?;
            let angle = lens.number("yfov", check)?;
            let aspect = lens.number("aspectRatio", check).filter(|&a| a > 0.0);
            let sound = angle > 0.0 && angle < std::f64::consts::PI;
            sound.then_some((Projection::Perspective(angle), aspect))
        }
        "orthographic" => {
            let lens = item.child("orthographic", check)?;
            let (x, y) = (
                lens.number("xmag", check)?.abs(),
                lens.number("ymag", check)?.abs(),
            );
            (x > 0.0 && y > 0.0).then_some((Projection::Orthographic(y), Some(x / y)))
        }
        _ => None,
    }
}
