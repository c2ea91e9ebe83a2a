//! What must hold of a tree after any change; called by tests and debug builds.

use super::tree::Tree;

impl Tree {
    /// Checks the structure; the message names the node at fault.
    pub fn validate(&self) -> Result<(), String> {
        for (id, node) in self.nodes.iter().enumerate() {
            if !(node.area > 0.0 && node.radius.is_finite() && node.normal.is_finite()) {
                return Err(format!(
                    "node {id}: area {}, radius {}, normal {}",
                    node.area, node.radius, node.normal
                ));
            }
            let mut area = 0.0;
            for child in node.child_range() {
                let c = self.node(child);
                if c.parent as usize != id || child as usize <= id {
                    return Err(format!("node {id}: child {child} out of order"));
                }
                let slack = glam::DVec3::splat(1e-9 * (1.0 + node.radius));
                if c.low.cmplt(node.low - slack).any() || c.high.cmpgt(node.high + slack).any() {
                    return Err(format!("node {id}: child {child} sticks out"));
                }
                area += c.area;
            }
            if !node.is_leaf() && (area - node.area).abs() > 1e-9 * node.area {
                return Err(format!(
                    "node {id}: area {} but children have {area}",
                    node.area
                ));
            }
        }
        Ok(())
    }
}
