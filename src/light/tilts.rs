//! How bright the corners of leaves are beside the leaf as a whole.

/// For each node, if it is a leaf, by how much its corners are brighter than its mean, as shares of the mean; they sum to 0. Nodes
/// beyond the end are even.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Tilts(pub(crate) Vec<[f32; 3]>);

/// A place on a leaf: the weights of its second and third corner, in 1/255.
pub(crate) type Place = [u8; 2];

/// The place of barycentric weights.
pub(crate) fn place(weights: [f64; 3]) -> Place {
    [weights[1], weights[2]].map(|w| (255.0 * w + 0.5) as u8)
}

impl Tilts {
    /// Brightness at a place of a leaf, as a share of the leaf's mean: 0 to 3.
    pub(crate) fn at(&self, leaf: u32, place: Place) -> f32 {
        let Some([a, b, c]) = self.0.get(leaf as usize) else {
            return 1.0;
        };
        let [v, w] = place.map(|x| f32::from(x) / 255.0);
        (1.0 + a + (b - a) * v + (c - a) * w).max(0.0)
    }
}
