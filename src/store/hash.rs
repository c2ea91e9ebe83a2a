//! XXH64, the 64-bit hash of Yann Collet's xxHash (specification 0.1.1): for checksums and for "is this the same room?".
//!
//! Bytes go in as they come; the result does not depend on how they were cut. It protects against accidents, not
//! against people.

const P1: u64 = 0x9e37_79b1_85eb_ca87;
const P2: u64 = 0xc2b2_ae3d_27d4_eb4f;
const P3: u64 = 0x1656_67b1_9e37_79f9;
const P4: u64 = 0x85eb_ca77_c2b2_ae63;
const P5: u64 = 0x27d4_eb2f_1656_67c5;
/// Bytes that go through the four lanes together.
const STRIPE: usize = 32;

/// A hash in the making, seed 0.
#[derive(Debug, Clone)]
pub struct Hasher {
    lanes: [u64; 4],
    /// The start of a stripe that is not whole yet.
    rest: [u8; STRIPE],
    held: usize,
    length: u64,
}

impl Default for Hasher {
    fn default() -> Self {
        Self {
            lanes: [P1.wrapping_add(P2), P2, 0, 0_u64.wrapping_sub(P1)],
            rest: [0; STRIPE],
            held: 0,
            length: 0,
        }
    }
}

fn round(lane: u64, input: u64) -> u64 {
    lane.wrapping_add(input.wrapping_mul(P2))
        .rotate_left(31)
        .wrapping_mul(P1)
}

fn word(bytes: &[u8]) -> u64 {
    let mut whole = [0; 8];
    whole[..bytes.len()].copy_from_slice(bytes);
    u64::from_le_bytes(whole)
}

impl Hasher {
    /// Takes more bytes.
    pub fn update(&mut self, mut bytes: &[u8]) {
        self.length += bytes.len() as u64;
        if self.held > 0 {
            let taken = bytes.len().min(STRIPE - self.held);
            self.rest[self.held..self.held + taken].copy_from_slice(&bytes[..taken]);
            self.held += taken;
            bytes = &bytes[taken..];
            if self.held < STRIPE {
                return;
            }
            let whole = self.rest;
            self.stripe(&whole);
            self.held = 0;
        }
        let mut stripes = bytes.chunks_exact(STRIPE);
        for stripe in &mut stripes {
            self.stripe(stripe);
        }
        let left = stripes.remainder();
        self.rest[..left.len()].copy_from_slice(left);
        self.held = left.len();
    }

    fn stripe(&mut self, bytes: &[u8]) {
        for (lane, input) in self.lanes.iter_mut().zip(bytes.chunks_exact(8)) {
            *lane = round(*lane, word(input));
        }
    }

    /// The hash of all bytes so far.
    pub fn finish(&self) -> u64 {
        let [a, b, c, d] = self.lanes;
        let mut hash = if self.length < STRIPE as u64 {
            P5
        } else {
            let sum = a
                .rotate_left(1)
                .wrapping_add(b.rotate_left(7))
                .wrapping_add(c.rotate_left(12))
                .wrapping_add(d.rotate_left(18));
            self.lanes.iter().fold(sum, |hash, &lane| {
                (hash ^ round(0, lane)).wrapping_mul(P1).wrapping_add(P4)
            })
        };
        hash = hash.wrapping_add(self.length);
        let mut words = self.rest[..self.held].chunks_exact(8);
        for bytes in &mut words {
            hash = (hash ^ round(0, word(bytes)))
                .rotate_left(27)
                .wrapping_mul(P1)
                .wrapping_add(P4);
        }
        let mut halves = words.remainder().chunks_exact(4);
        for bytes in &mut halves {
            hash = (hash ^ word(bytes).wrapping_mul(P1))
                .rotate_left(23)
                .wrapping_mul(P2)
                .wrapping_add(P3);
        }
        for &byte in halves.remainder() {
            hash = (hash ^ u64::from(byte).wrapping_mul(P5))
                .rotate_left(11)
                .wrapping_mul(P1);
        }
        hash = (hash ^ hash >> 33).wrapping_mul(P2);
        hash = (hash ^ hash >> 29).wrapping_mul(P3);
        hash ^ hash >> 32
    }
}

/// The hash of some bytes.
pub fn of(bytes: &[u8]) -> u64 {
    let mut hasher = Hasher::default();
    hasher.update(bytes);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Values of the reference program for seed 0.
    #[test]
    fn agrees_with_the_reference_program() {
        assert_eq!(of(b""), 0xef46_db37_51d8_e999);
        assert_eq!(of(b"a"), 0xd24e_c4f1_a98c_6e5b);
        assert_eq!(of(b"abc"), 0x44bc_2cf5_ad77_0999);
        assert_eq!(
            of(b"Nobody inspects the spammish repetition"),
            0xfbce_a83c_8a37_8bf1
        );
    }

    proptest! {
        /// How the bytes are cut changes nothing; one bit changes the hash.
        #[test]
        fn cuts_do_not_matter_and_bits_do(bytes in prop::collection::vec(any::<u8>(), 1..200), cut in 0_usize..200, bit in 0_usize..1600) {
            let mut parts = Hasher::default();
            let cut = cut.min(bytes.len());
            parts.update(&bytes[..cut]);
            parts.update(&bytes[cut..]);
            prop_assert_eq!(parts.finish(), of(&bytes));
            let mut other = bytes.clone();
            let bit = bit % (8 * bytes.len());
            other[bit / 8] ^= 1 << (bit % 8);
            prop_assert_ne!(of(&other), of(&bytes));
        }
    }
}
