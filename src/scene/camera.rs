//! The cameras of the scene (glTF 2.0, section 3.10). A camera without a view is left out with a warning: nothing is baked
//! through it.

use crate::scene::check::Check;
use crate::scene::json::{self, Item};
use crate::scene::nodes::PlacedNode;
use glam::DMat4;
use gltf::json::Node;
use gltf::json::camera::Type;
use gltf::json::validation::Checked::{self, Invalid, Valid};
use serde::Deserialize;
use serde_json::Value;
use std::f64::consts::PI;

/// A camera of the file in world space; looks along -Z of its own space.
#[derive(Debug, Clone)]
pub struct Camera {
    /// For file names.
    pub name: String,
    /// Camera to world.
    pub to_world: DMat4,
    /// Vertical field of view in radians, or the half height of an orthographic view.
    pub projection: Projection,
    /// Width by height; none: 4 by 3.
    pub aspect: Option<f64>,
}

/// Projection of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Vertical field of view, radians.
    Perspective(f64),
    /// Half of the height, in the file's units.
    Orthographic(f64),
}

/// One entry for each node of the scene that carries a camera.
pub(crate) fn cameras(json: &Value, placed: &[PlacedNode], check: &mut Check) -> Vec<Camera> {
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

/// A camera as far as it says what is seen. gltf's type asks for clipping planes, and nothing here is clipped.
#[derive(Debug, Deserialize)]
struct CameraData {
    #[serde(rename = "type")]
    kind: Option<Checked<Type>>,
    perspective: Option<Lens>,
    orthographic: Option<Lens>,
}

/// A lens of either kind.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Lens {
    yfov: Option<f64>,
    aspect_ratio: Option<f64>,
    xmag: Option<f64>,
    ymag: Option<f64>,
}

fn lens(item: &Item<'_>, check: &mut Check) -> Option<(Projection, Option<f64>)> {
    let view = item.read::<CameraData>(check)?;
    match view.kind? {
        Valid(Type::Perspective) => {
            let lens = view.perspective?;
            let angle = lens.yfov.filter(|&a| a > 0.0 && a < PI)?;
            let aspect = lens.aspect_ratio.filter(|&a| a > 0.0);
            Some((Projection::Perspective(angle), aspect))
        }
        Valid(Type::Orthographic) => {
            let lens = view.orthographic?;
            let (x, y) = (lens.xmag?.abs(), lens.ymag?.abs());
            (x > 0.0 && y > 0.0).then_some((Projection::Orthographic(y), Some(x / y)))
        }
        Invalid => None,
    }
}
