//! EXT_lights_ies: profiles in the document, and the nodes that carry them.
//!
//! A node gives a profile, a multiplier (1) and a linear colour (white), which take of its light what they are below 1. Where a node
//! carries a light of KHR_lights_punctual as well (some exporters write both), it is one lamp: the colours multiply.

use super::super::Source;
use super::super::check::Check;
use super::super::json::{self, Item};
use super::super::profile::Profile;
use super::wish::checked;
use serde::Deserialize;
use serde_json::Value;
use std::sync::Arc;

const NAME: &str = "EXT_lights_ies";
const TABLE: &str = "/extensions/EXT_lights_ies";

/// The extension on a node.
#[derive(Debug, Deserialize)]
struct Ies {
    light: Option<u32>,
    multiplier: Option<f64>,
    color: Option<[f64; 3]>,
}

/// What a node says.
#[derive(Debug, Clone)]
pub struct IesNode {
    /// Index in the document's list of profiles.
    pub(in crate::scene) light: usize,
    pub(in crate::scene) multiplier: f64,
    pub(in crate::scene) color: [f32; 3],
    /// Name of the profile in the document; empty if it has none.
    pub(in crate::scene) name: String,
}

/// The profile at a node, if there is one.
pub(in crate::scene) fn ies_node(json: &Value, node: &Item, check: &mut Check) -> Option<IesNode> {
    let given = node.extension::<Ies>(NAME, check)?;
    let Some(light) = given.light else {
        let what = format!("{NAME} does not say which light");
        check.problem(&node.place, what, "export the file again");
        return None;
    };
    let light = light as usize;
    let nothing = Value::Null;
    let table = json.pointer(TABLE).unwrap_or(&nothing);
    let item = json::referred(table, "lights", "profile", light, &node.place, check)?;
    let multiplier = given.multiplier.unwrap_or(1.0);
    let color = given.color.unwrap_or([1.0; 3]);
    if multiplier < 0.0 || color.iter().any(|&c| c < 0.0) {
        let what = format!("{NAME} has a negative multiplier or colour");
        check.problem(&node.place, what, "give numbers of at least 0");
    }
    Some(IesNode {
        light,
        multiplier: multiplier.max(0.0),
        color: color.map(|c| c.clamp(0.0, 1.0) as f32),
        name: item.name().to_owned(),
    })
}

/// The profiles of the document, in order; none where one cannot be read, which was said. Those that no node uses are not read.
pub(in crate::scene) fn profiles<'a>(
    source: &Source,
    nodes: impl Iterator<Item = &'a IesNode>,
    check: &mut Check,
) -> Vec<Option<Arc<Profile>>> {
    let nothing = Value::Null;
    let table = source.json.pointer(TABLE).unwrap_or(&nothing);
    let mut used = vec![false; json::len(table, "lights")];
    for node in nodes {
        used[node.light] = true;
    }
    let read = |(index, used): (usize, bool)| {
        let item = json::item(table, "lights", "profile", index).filter(|_| used)?;
        let item = Item {
            place: format!("{NAME}, {}", item.place),
            ..item
        };
        let bytes = source.bytes_of(&item, check)?;
        checked(&bytes, &item.place, check)
    };
    used.into_iter().enumerate().map(read).collect()
}
