//! Numbers, lists and texts as bytes: little-endian, lists with their length (u64) in front.
//!
//! Reading trusts nothing: a length is compared with the bytes that are there before anything is set aside for it, and
//! every failure is a [`Broken`], never a panic.

use super::hash::Hasher;
use std::io::{self, Write};
use std::ops::Range;
use std::sync::Arc;

/// What is wrong with bytes that were to be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Broken(pub String);

impl Broken {
    /// Broken in this way.
    pub fn new(what: impl Into<String>) -> Self {
        Self(what.into())
    }
}

/// The result of reading.
pub type Read<T> = Result<T, Broken>;

/// A number, or an array of them, with a fixed number of bytes.
pub trait Plain: Copy {
    /// Bytes it takes.
    const SIZE: usize;
    /// Puts it into exactly [`Plain::SIZE`] bytes.
    fn store(self, to: &mut [u8]);
    /// Takes it out of exactly [`Plain::SIZE`] bytes.
    fn load(from: &[u8]) -> Self;
}

macro_rules! plain {
    ($($number:ty),*) => {$(
        impl Plain for $number {
            const SIZE: usize = size_of::<Self>();

            fn store(self, to: &mut [u8]) {
                to.copy_from_slice(&self.to_le_bytes());
            }

            fn load(from: &[u8]) -> Self {
                let mut bytes = [0; size_of::<Self>()];
                bytes.copy_from_slice(from);
                Self::from_le_bytes(bytes)
            }
        }
    )*};
}
plain!(u8, u16, u32, u64, f32, f64);

impl<T: Plain, const N: usize> Plain for [T; N] {
    const SIZE: usize = T::SIZE * N;

    fn store(self, to: &mut [u8]) {
        for (x, to) in self.into_iter().zip(to.chunks_exact_mut(T::SIZE)) {
            x.store(to);
        }
    }

    fn load(from: &[u8]) -> Self {
        std::array::from_fn(|k| T::load(&from[k * T::SIZE..(k + 1) * T::SIZE]))
    }
}

/// Bytes turned into a list at a time.
const BUFFER: usize = 1 << 16;

/// Writes, and hashes what it writes.
pub struct Encoder<'a> {
    out: &'a mut dyn Write,
    hash: Hasher,
    /// Bytes so far.
    written: u64,
}

impl<'a> Encoder<'a> {
    /// Writes to `out`.
    pub fn new(out: &'a mut dyn Write) -> Self {
        Self {
            out,
            hash: Hasher::default(),
            written: 0,
        }
    }

    /// Bytes as they are.
    ///
    /// # Errors
    /// Those of the writer, here and below.
    pub fn raw(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.hash.update(bytes);
        self.written += bytes.len() as u64;
        self.out.write_all(bytes)
    }

    /// One number.
    ///
    /// # Errors
    /// As [`Encoder::raw`].
    pub fn put<T: Plain>(&mut self, x: T) -> io::Result<()> {
        self.put_each(std::iter::once(x))
    }

    /// A list.
    ///
    /// # Errors
    /// As [`Encoder::raw`].
    pub fn put_all<T: Plain>(&mut self, list: &[T]) -> io::Result<()> {
        self.put_list(list.len(), list.iter().copied())
    }

    /// A list that is made on the way; `length` must be its length.
    ///
    /// # Errors
    /// As [`Encoder::raw`]; another length than the one that was told.
    pub fn put_list<T: Plain>(
        &mut self,
        length: usize,
        list: impl Iterator<Item = T>,
    ) -> io::Result<()> {
        self.put(length as u64)?;
        let before = self.written;
        self.put_each(list)?;
        if self.written - before == (length * T::SIZE) as u64 {
            Ok(())
        } else {
            Err(io::Error::other("a list of another length than was told"))
        }
    }

    fn put_each<T: Plain>(&mut self, list: impl Iterator<Item = T>) -> io::Result<()> {
        let mut buffer = [0; BUFFER];
        let mut held = 0;
        for x in list {
            if held + T::SIZE > BUFFER {
                self.raw(&buffer[..held])?;
                held = 0;
            }
            x.store(&mut buffer[held..held + T::SIZE]);
            held += T::SIZE;
        }
        self.raw(&buffer[..held])
    }

    /// A text.
    ///
    /// # Errors
    /// As [`Encoder::raw`].
    pub fn put_text(&mut self, text: &str) -> io::Result<()> {
        self.put_all(text.as_bytes())
    }

    /// Ends with the checksum of everything; how many bytes there are.
    ///
    /// # Errors
    /// As [`Encoder::raw`].
    pub fn finish(mut self) -> io::Result<u64> {
        let sum = self.hash.finish();
        self.put(sum)?;
        Ok(self.written)
    }
}

/// Reads what an [`Encoder`] wrote.
#[derive(Debug, Clone)]
pub struct Decoder<'a> {
    bytes: &'a [u8],
    /// Where reading has come to.
    at: usize,
    /// The owner of `bytes` and of what follows them.
    owner: Option<Arc<Vec<u8>>>,
}

/// Bytes of a file that is kept in memory whole: nothing is copied.
#[derive(Debug, Clone)]
pub struct Piece {
    owner: Arc<Vec<u8>>,
    range: Range<usize>,
}

impl Piece {
    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.owner[self.range.clone()]
    }
}

impl<'a> Decoder<'a> {
    /// Reads from `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            owner: None,
        }
    }

    /// Remembers who owns the bytes; they must be its first.
    pub(super) fn owned_by(mut self, owner: &Arc<Vec<u8>>) -> Self {
        self.owner = Some(Arc::clone(owner));
        self
    }

    /// The next bytes.
    ///
    /// # Errors
    /// There are fewer, here and below.
    pub fn raw(&mut self, count: usize) -> Read<&'a [u8]> {
        let rest = self.bytes.get(self.at..).unwrap_or(&[]);
        let taken = rest
            .get(..count)
            .ok_or_else(|| Broken::new("ends too early"))?;
        self.at += count;
        Ok(taken)
    }

    /// A list of bytes, not copied where the owner is known.
    ///
    /// # Errors
    /// As [`Decoder::raw`].
    pub fn get_piece(&mut self) -> Read<Piece> {
        let bytes = self.bytes_of_list(1)?;
        Ok(match &self.owner {
            Some(owner) => Piece {
                owner: Arc::clone(owner),
                range: self.at - bytes.len()..self.at,
            },
            None => Piece {
                owner: Arc::new(bytes.to_vec()),
                range: 0..bytes.len(),
            },
        })
    }

    /// One number.
    ///
    /// # Errors
    /// As [`Decoder::raw`].
    pub fn get<T: Plain>(&mut self) -> Read<T> {
        Ok(T::load(self.raw(T::SIZE)?))
    }

    /// A list.
    ///
    /// # Errors
    /// As [`Decoder::raw`].
    pub fn get_all<T: Plain>(&mut self) -> Read<Vec<T>> {
        Ok(self.get_list()?.collect())
    }

    /// A list that is not put into memory.
    ///
    /// # Errors
    /// As [`Decoder::raw`].
    pub fn get_list<T: Plain>(&mut self) -> Read<impl ExactSizeIterator<Item = T> + use<'a, T>> {
        let bytes = self.bytes_of_list(T::SIZE)?;
        Ok(bytes.chunks_exact(T::SIZE).map(T::load))
    }

    /// A list that must have this length.
    ///
    /// # Errors
    /// As [`Decoder::raw`]; another length.
    pub fn get_exactly<T: Plain>(&mut self, length: usize) -> Read<Vec<T>> {
        let list = self.get_all()?;
        if list.len() == length {
            Ok(list)
        } else {
            Err(Broken::new("a list has the wrong length"))
        }
    }

    fn bytes_of_list(&mut self, size: usize) -> Read<&'a [u8]> {
        let length = usize::try_from(self.get::<u64>()?).ok();
        match length.and_then(|n| n.checked_mul(size)) {
            Some(bytes) => self.raw(bytes),
            None => Err(Broken::new("a list is longer than any memory")),
        }
    }

    /// A text.
    ///
    /// # Errors
    /// As [`Decoder::raw`]; bytes that are no UTF-8.
    pub fn get_text(&mut self) -> Read<String> {
        let bytes = self.bytes_of_list(1)?;
        String::from_utf8(bytes.to_vec()).map_err(|_| Broken::new("a text is not UTF-8"))
    }

    /// Leaves the rest unread.
    pub fn skip(&mut self) {
        self.at = self.bytes.len();
    }

    /// Nothing may be left.
    ///
    /// # Errors
    /// Something is.
    pub fn end(&self) -> Read<()> {
        if self.at == self.bytes.len() {
            Ok(())
        } else {
            Err(Broken::new("has bytes after its end"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_written_is_read(
            numbers in prop::collection::vec(any::<u64>(), 0..50),
            pairs in prop::collection::vec(any::<[u32; 3]>(), 0..10_000),
            text in "\\PC*",
        ) {
            let mut bytes = Vec::new();
            let mut out = Encoder::new(&mut bytes);
            out.put_all(&numbers).unwrap();
            out.put_text(&text).unwrap();
            out.put(-1.5_f32).unwrap();
            out.put_all(&pairs).unwrap();
            let length = out.finish().unwrap();
            prop_assert_eq!(length, bytes.len() as u64);
            let mut back = Decoder::new(&bytes);
            prop_assert_eq!(back.get_all::<u64>().unwrap(), numbers);
            prop_assert_eq!(back.get_text().unwrap(), text);
            prop_assert_eq!(back.get::<f32>().unwrap(), -1.5);
            prop_assert_eq!(back.get_all::<[u32; 3]>().unwrap(), pairs);
            back.get::<u64>().unwrap();
            back.end().unwrap();
        }
    }

    #[test]
    fn lengths_are_checked_before_memory_is_taken() {
        for length in [1, u64::MAX / 8, u64::MAX] {
            let bytes = length.to_le_bytes();
            assert!(Decoder::new(&bytes).get_all::<f64>().is_err());
            assert!(Decoder::new(&bytes).get_text().is_err());
        }
    }
}
