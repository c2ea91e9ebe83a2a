//! From triangles to the tree that links attach to: faces at the bottom of a cluster tree, elements below them.

pub mod alpha;
mod build;
mod counted;
mod cut;
mod halves;
mod mesh;
mod mirrors;
mod panes;
mod raised;
mod spaces;
mod tree;
mod validate;

pub(crate) use counted::{Counted, LandingPoint, median};
pub use cut::{Cut, cuts};
pub use halves::{Blocker, Outline};
pub(crate) use mesh::Frame;
pub use mesh::{Face, Mesh, Raised};
pub use mirrors::{BOUNCES, MirrorImage, Mirrors, Route};
pub use panes::{Crossing, Glazing, Panes};
pub use spaces::spaces;
pub use tree::{Element, NONE, Node, Sample, Tree, TreeSize};
pub(crate) use tree::{place_below, quarter, stratified};
