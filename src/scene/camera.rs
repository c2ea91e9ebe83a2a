//! The cameras of the scene (glTF 2.0, section 3.10). A camera without a view is left out with a warning: nothing is baked
//! through it.

use crate::scene::check::Check;
use crate::scene::json::{self, Item, double};
use crate::scene::nodes::Placed;
use crate::scene::{Camera, Projection};
use gltf::json::Node;
use gltf::json::camera::Type;
use gltf::json::validation::Checked::{Invalid, Valid};
use serde_json::Value;

/// One entry for each node of the scene that carries a camera.
pub(crate) fn cameras(json: &Value, placed: &[Placed], check: &mut Check) -> Vec<Camera> {
    let mut cameras = Vec::new();
    for placed in placed {
        let Some(node) = json::item(json, "nodes", "node", placed.node) else {
            continue;
        };
        let read = node.read::<Node>(check);
        let Some(index) = read.and_then(|node| node.camera) else {
            continue;
        };
        let index = index.value();
        let item = json::referred(json, "cameras", "camera", index, &node.place, check);
        let Some(item) = item else { continue };
        match lens(&item, check) {
            Some((projection, aspect)) => {
                let names = [item.name(), node.name()];
                let name = names.into_iter().find(|name| !name.is_empty());
                cameras.push(Camera {
                    name: name.map_or_else(|| format!("camera {index}"), json::short),
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
    let camera = item.read::<gltf::json::Camera>(check)?;
    match camera.type_ {
        Valid(Type::Perspective) => {
            let lens = camera.perspective?;
            let angle = double(lens.yfov);
            let aspect = lens.aspect_ratio.map(double).filter(|&a| a > 0.0);
            let sound = angle > 0.0 && angle < std::f64::consts::PI;
            sound.then_some((Projection::Perspective(angle), aspect))
        }
        Valid(Type::Orthographic) => {
            let lens = camera.orthographic?;
            let [x, y] = [lens.xmag, lens.ymag].map(|half| double(half).abs());
            let sound = [x, y].iter().all(|&half| half > 0.0 && half.is_finite());
            sound.then_some((Projection::Orthographic(y), Some(x / y)))
        }
        Invalid => None,
    }
}
