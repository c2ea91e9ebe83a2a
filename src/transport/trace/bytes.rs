//! Numbers and lists of weights as the bytes of a trace.

use crate::store::Broken;
use crate::store::codec::Read;

/// A number in base 128, least digits first; the high bit says that more follow.
pub(super) fn number(mut x: u64, out: &mut Vec<u8>) {
    while x >= 128 {
        out.push(x as u8 | 128);
        x >>= 7;
    }
    out.push(x as u8);
}

/// A packed trace being read.
pub(super) struct TraceReader<'a> {
    pub(super) rest: &'a [u8],
}

impl TraceReader<'_> {
    #[inline]
    pub(super) fn number(&mut self) -> Read<u64> {
        // Nearly all differences take one byte or two.
        match *self.rest {
            [a @ 0..128, ref rest @ ..] => {
                self.rest = rest;
                Ok(a.into())
            }
            [a, b @ 0..128, ref rest @ ..] => {
                self.rest = rest;
                Ok(u64::from(b) << 7 | u64::from(a & 127))
            }
            _ => self.long_number(),
        }
    }

    #[cold]
    fn long_number(&mut self) -> Read<u64> {
        let mut x = 0;
        for (k, &byte) in self.rest.iter().enumerate().take(9) {
            x |= u64::from(byte & 127) << (7 * k);
            if byte < 128 {
                self.rest = &self.rest[k + 1..];
                return Ok(x);
            }
        }
        Err(broken())
    }

    pub(super) fn float(&mut self) -> Read<f32> {
        let (bytes, rest) = self.rest.split_first_chunk::<4>().ok_or_else(broken)?;
        self.rest = rest;
        Ok(f32::from_le_bytes(*bytes))
    }

    /// Calls `each` with the ids (below `end`) and weights of a list.
    pub(super) fn weights(&mut self, end: usize, mut each: impl FnMut(usize, f32)) -> Read<()> {
        let mut id = 0;
        for _ in 0..self.number()? {
            id += self.number()?;
            if id >= end as u64 {
                return Err(broken());
            }
            each(id as usize, self.float()?);
        }
        Ok(())
    }
}

pub(super) fn broken() -> Broken {
    Broken::new("has weights that do not read")
}
