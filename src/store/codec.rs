//! Numbers, lists and texts as bytes: little-endian, lists with their length (u64) in front.
//!
//! Reading trusts nothing: a length is compared with the bytes that are there before anything is set aside for it, and
//! every failure is a [`Broken`], never a panic. What is large and read piece by piece stands *aside*: bytes of the file that
//! neither the reader holds nor the checksum covers.

use std::fs::File;
use std::io::{self, Write};
use std::sync::Arc;
use xxhash_rust::xxh64::Xxh64;

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
    hash: Xxh64,
    /// Bytes so far.
    written: u64,
    /// Start and length of what stands aside.
    asides: Vec<[u64; 2]>,
}

impl<'a> Encoder<'a> {
    /// Writes to `out`.
    pub fn new(out: &'a mut dyn Write) -> Self {
        Self {
            out,
            hash: Xxh64::new(0),
            written: 0,
            asides: Vec::new(),
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

    /// Bytes that stand aside: `write` writes them and says how many they are.
    ///
    /// # Errors
    /// As [`Encoder::raw`].
    pub fn aside(
        &mut self,
        write: impl FnOnce(&mut dyn Write) -> io::Result<u64>,
    ) -> io::Result<()> {
        let length = write(self.out)?;
        self.asides.push([self.written, length]);
        self.written += length;
        Ok(())
    }

    /// Ends with what stands aside and the checksum of everything else; how many bytes there are.
    ///
    /// # Errors
    /// As [`Encoder::raw`].
    pub fn finish(mut self) -> io::Result<u64> {
        let asides = std::mem::take(&mut self.asides);
        self.put_each(asides.iter().copied())?;
        self.put(asides.len() as u64)?;
        let sum = self.hash.digest();
        self.put(sum)?;
        Ok(self.written)
    }
}

/// Reads what an [`Encoder`] wrote.
#[derive(Debug)]
pub struct Decoder<'a> {
    bytes: &'a [u8],
    /// Where reading has come to.
    at: usize,
    /// The file, and what stands aside in it and was not asked for.
    file: Option<Arc<File>>,
    asides: std::vec::IntoIter<[u64; 2]>,
}

/// Bytes that stay in the file.
#[derive(Debug)]
pub struct Aside {
    file: Arc<File>,
    start: u64,
    length: u64,
}

impl Aside {
    /// How many bytes.
    #[expect(clippy::len_without_is_empty, reason = "a length in bytes")]
    pub fn len(&self) -> u64 {
        self.length
    }

    /// Reads bytes from `start` on.
    ///
    /// # Errors
    /// [`Broken`]: there are fewer, or the file cannot be read.
    pub fn read(&self, start: u64, to: &mut [u8]) -> Read<()> {
        if start
            .checked_add(to.len() as u64)
            .is_none_or(|end| end > self.length)
        {
            return Err(Broken::new("ends too early"));
        }
        read_at(&self.file, self.start + start, to)
            .map_err(|problem| Broken::new(format!("cannot be read: {problem}")))
    }
}

/// Reads without moving the file's place: several threads may.
#[cfg(unix)]
fn read_at(file: &File, start: u64, to: &mut [u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, to, start)
}

/// Reads at a place of its own: several threads may.
#[cfg(windows)]
fn read_at(file: &File, mut start: u64, mut to: &mut [u8]) -> io::Result<()> {
    while !to.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, to, start)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            n => {
                start += n as u64;
                to = &mut to[n..];
            }
        }
    }
    Ok(())
}

impl<'a> Decoder<'a> {
    /// Reads from `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            file: None,
            asides: Vec::new().into_iter(),
        }
    }

    /// Reads from `bytes` that stood in a file beside others.
    pub(super) fn beside(mut self, file: Arc<File>, asides: Vec<[u64; 2]>) -> Self {
        self.file = Some(file);
        self.asides = asides.into_iter();
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

    /// The next bytes that stand aside.
    ///
    /// # Errors
    /// There are no more.
    pub fn get_aside(&mut self) -> Read<Aside> {
        match (&self.file, self.asides.next()) {
            (Some(file), Some([start, length])) => Ok(Aside {
                file: Arc::clone(file),
                start,
                length,
            }),
            _ => Err(Broken::new("ends too early")),
        }
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
        self.asides = Vec::new().into_iter();
    }

    /// Nothing may be left.
    ///
    /// # Errors
    /// Something is.
    pub fn end(&self) -> Read<()> {
        if self.at == self.bytes.len() && self.asides.len() == 0 {
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
            // Nothing stands aside, and the checksum.
            prop_assert_eq!(back.get::<[u64; 2]>().unwrap()[0], 0);
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
