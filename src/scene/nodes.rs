//! Walks the node hierarchy (glTF 2.0, section 3.5.3): which nodes are in the scene, and where they stand.
//!
//! The stack is our own, so depth costs no call stack. Every node is visited once: a second way to a node is a cycle or
//! a second parent, both against the standard, and a problem.

use crate::scene::check::Check;
use crate::scene::json::{self, Item};
use glam::{DMat4, DQuat, DVec3};
use gltf::json::{Node, Scene};
use serde::Deserialize;
use serde_json::Value;

const AGAIN: &str = "mend the node hierarchy and export again";

/// A node of the scene.
#[derive(Debug, Clone)]
pub(crate) struct PlacedNode {
    /// Index in the document.
    pub(crate) node: usize,
    /// Node to world.
    pub(crate) to_world: DMat4,
}

/// The nodes of the document's scene, parents before children, in the order of the file.
pub(crate) fn walk(json: &Value, check: &mut Check) -> Vec<PlacedNode> {
    let count = json::len(json, "nodes");
    let mut seen = vec![false; count];
    let mut stack: Vec<(usize, DMat4, Option<usize>)> = Vec::new();
    for root in roots(json, check).into_iter().rev() {
        stack.push((root, DMat4::IDENTITY, None));
    }
    let mut placed = Vec::new();
    while let Some((node, parent_to_world, parent)) = stack.pop() {
        let from = parent.map_or_else(|| "the scene".into(), |parent| place(json, parent));
        let Some(item) = json::referred(json, "nodes", "node", node, &from, check) else {
            continue;
        };
        if seen[node] {
            let what = format!("is reached a second time, from {from}: a cycle or a second parent");
            check.problem(&item.place, what, AGAIN);
            continue;
        }
        seen[node] = true;
        let to_world = parent_to_world * local(&item, check);
        if !to_world.is_finite() {
            // Its children would all say the same.
            check.problem(&item.place, "has a transform that is not finite", AGAIN);
            continue;
        }
        placed.push(PlacedNode { node, to_world });
        let children = item.read::<Node>(check).and_then(|node| node.children);
        for child in children.into_iter().flatten().rev() {
            stack.push((child.value(), to_world, Some(node)));
        }
    }
    left_out(json, &seen, check);
    placed
}

/// `node 4 'Chair'`.
pub(crate) fn place(json: &Value, node: usize) -> String {
    json::item(json, "nodes", "node", node).map_or_else(|| format!("node {node}"), |n| n.place)
}

/// The root nodes of the default scene, else of the first scene, else all nodes that are nobody's child.
fn roots(json: &Value, check: &mut Check) -> Vec<usize> {
    let scenes = json::len(json, "scenes");
    let chosen = json::root(json, check).scene.map(|scene| scene.value());
    if scenes == 0 && chosen.is_none() {
        return orphans(json);
    }
    let Some(item) = json::item(json, "scenes", "scene", chosen.unwrap_or(0)) else {
        let what = format!("'scene' is not the index of one of the {scenes} scenes");
        check.problem("", what, "export the file again");
        return Vec::new();
    };
    if scenes > 1 {
        let place = &item.place;
        check.warn(format!(
            "{place} of {scenes} is read, the other scenes are not"
        ));
    }
    if !item.has("nodes") {
        return Vec::new();
    }
    let scene = item.read::<Scene>(check);
    let nodes = scene.into_iter().flat_map(|scene| scene.nodes);
    nodes.map(|node| node.value()).collect()
}

fn orphans(json: &Value) -> Vec<usize> {
    let count = json::len(json, "nodes");
    let mut is_child = vec![false; count];
    for node in 0..count {
        // What is wrong is told when the node is walked to.
        let item = json::item(json, "nodes", "node", node);
        let read = item.and_then(|item| item.read::<Node>(&mut Check::new("")));
        for child in read.and_then(|node| node.children).into_iter().flatten() {
            if let Some(flag) = is_child.get_mut(child.value()) {
                *flag = true;
            }
        }
    }
    (0..count).filter(|&node| !is_child[node]).collect()
}

/// Without scenes every node counts, so one that no root leads to is on a cycle; with scenes it is only said how many
/// nodes with a mesh stay out.
fn left_out(json: &Value, seen: &[bool], check: &mut Check) {
    let unseen = (0..seen.len()).filter(|&node| !seen[node]);
    if json::len(json, "scenes") == 0 {
        if let (Some(node), false) = (unseen.into_iter().next(), check.has_problems()) {
            check.problem(&place(json, node), "is on a cycle of nodes", AGAIN);
        }
        return;
    }
    let item = |node| json::item(json, "nodes", "node", node);
    let with_mesh = unseen.filter(|&n| item(n).is_some_and(|i| i.has("mesh")));
    let count = with_mesh.count();
    if count > 0 && !check.has_problems() {
        check.warn(format!(
            "{count} nodes with a mesh are not in the scene and are left out"
        ));
    }
}

/// Where a node stands: in double precision, which gltf's `Node` has not.
#[derive(Debug, Default, Deserialize)]
struct Transform {
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

/// A node's own transform: its matrix (column by column), or translation, rotation and scale.
fn local(item: &Item<'_>, check: &mut Check) -> DMat4 {
    let own = item.read::<Transform>(check).unwrap_or_default();
    if item.has("matrix") {
        return own
            .matrix
            .map_or(DMat4::IDENTITY, |m| DMat4::from_cols_array(&m));
    }
    DMat4::from_scale_rotation_translation(
        own.scale.map_or(DVec3::ONE, DVec3::from),
        own.rotation.map_or(DQuat::IDENTITY, rotation),
        own.translation.map_or(DVec3::ZERO, DVec3::from),
    )
}

/// A rotation from its four numbers, brought to unit length; without length: none.
pub(crate) fn rotation(xyzw: [f64; 4]) -> DQuat {
    let length = xyzw.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() {
        DQuat::from_array(xyzw.map(|x| x / length))
    } else {
        DQuat::IDENTITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn walked(json: &Value) -> (Vec<PlacedNode>, Vec<String>, Vec<String>) {
        let mut check = Check::new("f");
        let placed = walk(json, &mut check);
        let (problems, warnings) = check.into_parts();
        (
            placed,
            problems.iter().map(ToString::to_string).collect(),
            warnings,
        )
    }

    fn order(placed: &[PlacedNode]) -> Vec<usize> {
        placed.iter().map(|p| p.node).collect()
    }

    #[test]
    fn parents_come_before_children_and_transforms_multiply() {
        let json = json!({"scene": 1, "scenes": [{"nodes": [0]}, {"nodes": [3, 1]}], "nodes": [
            {"mesh": 0}, {"translation": [1, 2, 3], "children": [2, 0]}, {"scale": [2, 2, -2], "translation": [1, 0, 0]},
            {"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1]}]});
        let (placed, problems, warnings) = walked(&json);
        assert!(problems.is_empty());
        assert_eq!(order(&placed), [3, 1, 2, 0]);
        assert_eq!(
            placed[0].to_world.transform_point3(DVec3::ZERO),
            DVec3::new(5.0, 6.0, 7.0)
        );
        assert_eq!(
            placed[2].to_world.transform_point3(DVec3::ONE),
            DVec3::new(4.0, 4.0, 1.0)
        );
        assert_eq!(warnings, ["scene 1 of 2 is read, the other scenes are not"]);
    }

    #[test]
    fn the_scene_is_chosen_as_the_standard_says() {
        let nodes = json!([{}, {"children": [0]}, {"mesh": 0}]);
        assert_eq!(order(&walked(&json!({"nodes": nodes})).0), [1, 0, 2]);
        let (placed, _, warnings) = walked(&json!({"nodes": nodes, "scenes": [{"nodes": [1]}]}));
        assert_eq!(order(&placed), [1, 0]);
        assert!(warnings[0].starts_with("1 nodes with a mesh"));
        let (placed, problems, _) = walked(&json!({"nodes": nodes, "scene": 2, "scenes": [{}]}));
        assert!(placed.is_empty() && problems[0].contains("'scene'"));
        assert_eq!(walked(&json!({"nodes": nodes, "scene": 0})).1.len(), 1);
        assert!(walked(&json!({})).0.is_empty());
    }

    #[test]
    fn cycles_and_second_parents_are_problems() {
        let cases = [
            json!({"scenes": [{"nodes": [0]}], "nodes": [{"children": [0]}]}),
            json!({"scenes": [{"nodes": [0]}], "nodes": [{"children": [1]}, {"children": [0]}]}),
            json!({"scenes": [{"nodes": [0, 0]}], "nodes": [{}]}),
            json!({"scenes": [{"nodes": [0]}], "nodes": [{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {"name": "d"}]}),
            json!({"nodes": [{"children": [1]}, {"children": [0]}]}),
        ];
        for json in cases {
            let (_, problems, _) = walked(&json);
            assert_eq!(problems.len(), 1, "{json}");
            assert!(problems[0].contains("cycle"), "{problems:?}");
        }
    }

    #[test]
    fn bad_references_and_transforms_are_all_reported() {
        let json = json!({"scenes": [{"nodes": [0, 9, "x"]}], "nodes": [
            {"children": [7, -1, 1, 2], "name": "top"}, {"scale": [1e300, 1e300, 1e300], "children": [3]},
            {"matrix": [1]}, {"scale": [1e300, 1, 1]}]});
        let (_, problems, _) = walked(&json);
        assert_eq!(problems.len(), 6, "{problems:#?}");
        assert!(
            problems
                .iter()
                .any(|p| p.contains("node 0 'top'") && p.contains("node 7"))
        );
        assert!(
            problems
                .iter()
                .any(|p| p.contains("node 3: has a transform"))
        );
    }

    #[test]
    fn depth_does_not_matter() {
        let count = 100_000;
        let nodes: Vec<Value> = (0..count)
            .map(|i| {
                if i + 1 < count {
                    json!({"children": [i + 1]})
                } else {
                    json!({})
                }
            })
            .collect();
        let (placed, problems, _) = walked(&json!({"nodes": nodes}));
        assert_eq!((placed.len(), problems.len()), (count, 0));
    }
}
