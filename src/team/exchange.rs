//! The one message that ranks send: everything from everyone to everyone.

/// Bytes of all ranks that go in one message: MPI counts with 31 bits.
#[cfg(feature = "mpi")]
const MESSAGE: usize = 1 << 30;

/// What every rank has, by rank.
#[cfg(feature = "mpi")]
pub(super) fn all_gather(ranks: usize, own: &[u8]) -> Vec<Vec<u8>> {
    use mpi::datatype::PartitionMut;
    use mpi::traits::CommunicatorCollectives;
    let world = mpi::topology::SimpleCommunicator::world();
    let mut sizes = vec![0_u64; ranks];
    world.all_gather_into(&(own.len() as u64), &mut sizes[..]);
    let sizes: Vec<usize> = sizes.iter().map(|&size| size as usize).collect();
    let mut all: Vec<Vec<u8>> = sizes.iter().map(|&size| Vec::with_capacity(size)).collect();
    let piece = MESSAGE / ranks;
    let part = |size: usize, first: usize| size.saturating_sub(first).min(piece);
    let most = sizes.iter().copied().max().unwrap_or(0);
    for first in (0..most).step_by(piece) {
        let own = &own[first.min(own.len())..][..part(own.len(), first)];
        // All together fit 31 bits.
        let counts: Vec<i32> = sizes.iter().map(|&s| part(s, first) as i32).collect();
        let starts: Vec<i32> = (counts.iter())
            .scan(0, |end, count| {
                *end += count;
                Some(*end - count)
            })
            .collect();
        let mut buffer = vec![0_u8; counts.iter().sum::<i32>() as usize];
        let mut parts = PartitionMut::new(&mut buffer[..], &counts[..], &starts[..]);
        world.all_gather_varcount_into(own, &mut parts);
        for ((all, &start), &count) in all.iter_mut().zip(&starts).zip(&counts) {
            all.extend_from_slice(&buffer[start as usize..][..count as usize]);
        }
    }
    all
}

/// What every rank has, by rank: there is only this one.
#[cfg(not(feature = "mpi"))]
pub(super) fn all_gather(_: usize, own: &[u8]) -> Vec<Vec<u8>> {
    vec![own.to_vec()]
}
