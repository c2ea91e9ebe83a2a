//! Sets that are joined (union and find): `above[k]` is a member of the set of `k` nearer to the one that represents it, or `k` itself.

/// The representative of a set; the path to it is halved (Tarjan and van Leeuwen 1984).
pub(crate) fn root(above: &mut [u32], mut k: u32) -> u32 {
    while above[k as usize] != k {
        let next = above[above[k as usize] as usize];
        above[k as usize] = next;
        k = next;
    }
    k
}

/// Joins two sets; the lower number represents both, so that the result does not depend on the order.
pub(crate) fn join(above: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(above, a), root(above, b));
    above[a.max(b) as usize] = a.min(b);
}
