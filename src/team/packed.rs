//! Results of receivers as bytes, for the way from rank to rank. Ranks run one program on one kind of machine.

use crate::store::Decoder;
use crate::store::codec::{Plain, Read};

/// What one rank can tell the others.
pub trait Packed: Sized {
    /// Appends it to the bytes.
    fn pack(&self, to: &mut Vec<u8>);
    /// Takes it from bytes that [`Packed::pack`] wrote.
    ///
    /// # Errors
    /// The bytes are those of something else.
    fn unpack(from: &mut Decoder) -> Read<Self>;
}

impl<T: Plain> Packed for T {
    fn pack(&self, to: &mut Vec<u8>) {
        let start = to.len();
        to.resize(start + T::SIZE, 0);
        self.store(&mut to[start..]);
    }

    fn unpack(from: &mut Decoder) -> Read<Self> {
        from.get()
    }
}

impl Packed for bool {
    fn pack(&self, to: &mut Vec<u8>) {
        to.push(u8::from(*self));
    }

    fn unpack(from: &mut Decoder) -> Read<Self> {
        Ok(from.get::<u8>()? == 1)
    }
}

impl<T: Packed> Packed for Vec<T> {
    fn pack(&self, to: &mut Vec<u8>) {
        (self.len() as u64).pack(to);
        self.iter().for_each(|x| x.pack(to));
    }

    fn unpack(from: &mut Decoder) -> Read<Self> {
        let count = from.get::<u64>()?;
        (0..count).map(|_| T::unpack(from)).collect()
    }
}

impl Packed for Option<Box<[u8]>> {
    fn pack(&self, to: &mut Vec<u8>) {
        self.is_some().pack(to);
        if let Some(bytes) = self {
            (bytes.len() as u64).pack(to);
            to.extend_from_slice(bytes);
        }
    }

    fn unpack(from: &mut Decoder) -> Read<Self> {
        Ok(match bool::unpack(from)? {
            true => Some(from.get_all::<u8>()?.into()),
            false => None,
        })
    }
}

impl<A: Packed, B: Packed> Packed for (A, B) {
    fn pack(&self, to: &mut Vec<u8>) {
        self.0.pack(to);
        self.1.pack(to);
    }

    fn unpack(from: &mut Decoder) -> Read<Self> {
        Ok((A::unpack(from)?, B::unpack(from)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn there_and_back<T: Packed + PartialEq + std::fmt::Debug>(x: T) {
        let mut bytes = Vec::new();
        x.pack(&mut bytes);
        let mut from = Decoder::new(&bytes);
        assert_eq!(T::unpack(&mut from).unwrap(), x);
        from.end().unwrap();
    }

    #[test]
    fn what_is_packed_is_unpacked() {
        there_and_back((vec![(7_u32, 0.1_f32), (8, -0.0)], 3_u64));
        there_and_back(vec![Some(Box::from([1, 2, 3])), None, Some(Box::from([]))]);
        there_and_back((true, [1.5_f64, f64::MIN_POSITIVE]));
        there_and_back(Vec::<u64>::new());
    }

    #[test]
    fn bytes_that_end_too_early_are_refused() {
        let mut bytes = Vec::new();
        vec![1_u64, 2].pack(&mut bytes);
        bytes.pop();
        assert!(Vec::<u64>::unpack(&mut Decoder::new(&bytes)).is_err());
    }
}
