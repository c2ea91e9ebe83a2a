//! From triangles to the tree that links attach to: faces at the bottom of a cluster tree, elements below them.

mod build;
mod cut;
mod halves;
mod mesh;
mod spaces;
mod tree;
mod validate;

pub use cut::{Cut, cuts};
pub use halves::Outline;
pub use mesh::{Face, Mesh};
pub use spaces::{Spaces, spaces};
pub(crate) use tree::stratified;
pub use tree::{Element, NONE, Node, Sample, Tree};
