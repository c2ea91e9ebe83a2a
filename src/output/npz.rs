//! Arrays for NumPy: a ZIP archive of `.npy` files (numpy.lib.format version 1.0), stored without compression.
//!
//! `numpy.load("room.npz")` gives the arrays of [`write_baked`]:
//! `positions` (N, 3) f64, world space, the file's units; `normals` (N, 3) f32, unit; `surface` (N,) u32, index of the
//! surface; `triangles` (T, 3) u32, rows of `positions`; `radiosity` (N, 64) f32, W/m2/nm on the leaves;
//! `wavelengths` (65,) f64, the leaves' edges in nm; `xyz` (N, 3) f32, tristimulus radiosity, Y in lm/m2.

use crate::error::{Error, Result};
use crate::gather::BakedSurface;
use crate::gather::refined;
use crate::scene::Scene;
use crate::spectrum::LEAVES;
use std::io::{self, Write};

/// Polynomial of CRC-32 as ZIP uses it (reflected; APPNOTE.TXT, section 4.4.7).
const POLYNOMIAL: u32 = 0xedb8_8320;
/// 1 January 1980, the first date of the format: the bytes must not depend on the clock.
const DATE: u16 = 0x21;
/// ZIP 2.0.
const VERSION: u16 = 20;
/// The length of a `.npy` header is a multiple of this, so that the data is aligned.
const ALIGNMENT: usize = 64;

/// Values of an array, row by row.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// `<f4`
    F32(&'a [f32]),
    /// `<f8`
    F64(&'a [f64]),
    /// `<u4`
    U32(&'a [u32]),
}

impl Values<'_> {
    fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
            Self::U32(v) => v.len(),
        }
    }

    fn kind(&self) -> (&'static str, usize) {
        match self {
            Self::F32(_) => ("<f4", 4),
            Self::F64(_) => ("<f8", 8),
            Self::U32(_) => ("<u4", 4),
        }
    }

    /// Hands the little-endian bytes over in pieces.
    fn for_each(&self, mut take: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
        const PIECE: usize = 4096;
        let mut bytes = Vec::with_capacity(8 * PIECE);
        let mut flush = |bytes: &mut Vec<u8>| {
            let result = take(bytes);
            bytes.clear();
            result
        };
        macro_rules! pieces {
            ($values:expr) => {
                for piece in $values.chunks(PIECE) {
                    piece.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
                    flush(&mut bytes)?;
                }
            };
        }
        match self {
            Self::F32(values) => pieces!(values),
            Self::F64(values) => pieces!(values),
            Self::U32(values) => pieces!(values),
        }
        Ok(())
    }
}

/// A named array.
#[derive(Debug, Clone, Copy)]
pub struct Array<'a> {
    /// Key in NumPy.
    pub name: &'a str,
    /// Lengths of the dimensions; their product is the number of values.
    pub shape: &'a [usize],
    /// The values.
    pub values: Values<'a>,
}

/// Writes an `.npz`.
///
/// # Errors
/// The writer fails, a shape does not fit its values, or an array or the archive passes 4 GiB.
pub fn write(out: &mut dyn Write, arrays: &[Array]) -> io::Result<()> {
    let mut directory = Vec::new();
    let mut offset = 0u64;
    for array in arrays {
        let header = header(array)?;
        let (_, width) = array.values.kind();
        let size = small((header.len() + array.values.len() * width) as u64)?;
        let mut crc = Crc::new();
        crc.update(&header);
        array.values.for_each(|bytes| {
            crc.update(bytes);
            Ok(())
        })?;
        let name = format!("{}.npy", array.name);
        // The fields that a local header (section 4.3.7) and a directory entry (4.3.12) share.
        let mut fields = Vec::new();
        for field in [VERSION, 0, 0, 0, DATE] {
            fields.extend(field.to_le_bytes());
        }
        for field in [crc.value(), size, size, name.len() as u32] {
            fields.extend(field.to_le_bytes());
        }
        let place = small(offset)?;
        out.write_all(b"PK\x03\x04")?;
        out.write_all(&fields)?;
        out.write_all(name.as_bytes())?;
        out.write_all(&header)?;
        array.values.for_each(|bytes| out.write_all(bytes))?;
        offset += 4 + fields.len() as u64 + name.len() as u64 + u64::from(size);

        directory.extend(b"PK\x01\x02");
        directory.extend(VERSION.to_le_bytes());
        directory.extend(&fields);
        // Comment length, disk, internal attributes (2 bytes each), external attributes (4): none.
        directory.extend([0; 10]);
        directory.extend(place.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    out.write_all(&directory)?;
    out.write_all(b"PK\x05\x06\0\0\0\0")?;
    let count = u16::try_from(arrays.len()).map_err(|_| too_large())?;
    out.write_all(&count.to_le_bytes())?;
    out.write_all(&count.to_le_bytes())?;
    out.write_all(&small(directory.len() as u64)?.to_le_bytes())?;
    out.write_all(&small(offset)?.to_le_bytes())?;
    out.write_all(&[0; 2])
}

/// Writes the refined mesh with its spectra: see the module's words.
///
/// `spectra` holds, for each surface of `surfaces`, the radiosity of its vertices on the leaves, W/m2/nm.
///
/// # Errors
/// The spectra do not match the mesh (internal fault), or the writer fails.
pub fn write_baked(
    out: &mut dyn Write,
    scene: &Scene,
    surfaces: &[BakedSurface],
    spectra: &[Vec<[f32; LEAVES]>],
) -> Result<()> {
    refined::check(scene, surfaces)?;
    let fits = surfaces.len() == spectra.len()
        && surfaces
            .iter()
            .zip(spectra)
            .all(|(surface, spectra)| surface.vertices.len() == spectra.len());
    if !fits {
        return Err(Error::Internal(
            "spectra do not match the refined mesh".into(),
        ));
    }
    let (mut positions, mut normals, mut xyz) = (Vec::new(), Vec::new(), Vec::new());
    let (mut owners, mut triangles) = (Vec::new(), Vec::new());
    for baked in surfaces {
        let surface = &scene.surfaces[baked.surface];
        let first = owners.len() as u32;
        for vertex in &baked.vertices {
            let place = refined::position(surface, vertex) / scene.changes.scale;
            positions.extend(place.to_array());
            normals.extend(refined::normal(surface, baked, vertex).as_vec3().to_array());
            xyz.extend(vertex.radiosity);
            owners.push(baked.surface as u32);
        }
        triangles.extend(baked.triangles.iter().flatten().map(|v| first + v));
    }
    let radiosity: Vec<f32> = spectra.iter().flatten().flatten().copied().collect();
    let width = scene.grid.width();
    let mut edges: Vec<f64> = (0..LEAVES).map(|leaf| scene.grid.left(leaf)).collect();
    edges.push(scene.grid.left(LEAVES - 1) + width);
    let count = owners.len();
    write(
        out,
        &[
            Array {
                name: "positions",
                shape: &[count, 3],
                values: Values::F64(&positions),
            },
            Array {
                name: "normals",
                shape: &[count, 3],
                values: Values::F32(&normals),
            },
            Array {
                name: "surface",
                shape: &[count],
                values: Values::U32(&owners),
            },
            Array {
                name: "triangles",
                shape: &[triangles.len() / 3, 3],
                values: Values::U32(&triangles),
            },
            Array {
                name: "radiosity",
                shape: &[count, LEAVES],
                values: Values::F32(&radiosity),
            },
            Array {
                name: "wavelengths",
                shape: &[LEAVES + 1],
                values: Values::F64(&edges),
            },
            Array {
                name: "xyz",
                shape: &[count, 3],
                values: Values::F32(&xyz),
            },
        ],
    )
    .map_err(|problem| Error::Io {
        path: "npz".into(),
        source: problem,
    })
}

/// Magic, version, length and the dictionary that describes the array.
fn header(array: &Array) -> io::Result<Vec<u8>> {
    if array.shape.iter().product::<usize>() != array.values.len() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!("shape of array '{}'", array.name),
        ));
    }
    let (kind, _) = array.values.kind();
    let shape: String = array.shape.iter().map(|n| format!("{n}, ")).collect();
    let mut text = format!(
        "{{'descr': '{kind}', 'fortran_order': False, 'shape': ({}), }}",
        shape.trim_end()
    );
    // Ten bytes before the text, one line feed after it.
    let fill = (10 + text.len() + 1).next_multiple_of(ALIGNMENT) - (10 + text.len() + 1);
    text.extend(std::iter::repeat_n(' ', fill));
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    // A shape of a few numbers is far below 64 kB.
    header.extend((text.len() as u16).to_le_bytes());
    header.extend(text.as_bytes());
    Ok(header)
}

fn small(size: u64) -> io::Result<u32> {
    u32::try_from(size).map_err(|_| too_large())
}

fn too_large() -> io::Error {
    io::Error::new(
        io::ErrorKind::FileTooLarge,
        "an .npz of more than 4 GiB is not written; ask for a larger --error",
    )
}

/// CRC-32, byte by byte from a table.
struct Crc {
    table: [u32; 256],
    state: u32,
}

impl Crc {
    fn new() -> Self {
        let entry = |byte: usize| {
            (0..8).fold(byte as u32, |crc, _| {
                if crc & 1 == 1 {
                    (crc >> 1) ^ POLYNOMIAL
                } else {
                    crc >> 1
                }
            })
        };
        Self {
            table: std::array::from_fn(entry),
            state: u32::MAX,
        }
    }

    fn update(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let low = (self.state ^ u32::from(byte)) & 0xff;
            self.state = self.table[low as usize] ^ (self.state >> 8);
        }
    }

    fn value(&self) -> u32 {
        !self.state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crc_of_the_check_string() {
        // The check value that every catalogue of CRCs gives for CRC-32/ISO-HDLC.
        let mut crc = Crc::new();
        crc.update(b"123456789");
        assert_eq!(crc.value(), 0xcbf4_3926);
    }

    #[test]
    fn headers_are_aligned_and_python_reads_one_tuple() {
        let header = header(&Array {
            name: "a",
            shape: &[2],
            values: Values::F32(&[1.0, 2.0]),
        })
        .unwrap();
        assert_eq!(header.len() % ALIGNMENT, 0);
        let text = std::str::from_utf8(&header[10..]).unwrap();
        assert!(
            text.starts_with("{'descr': '<f4', 'fortran_order': False, 'shape': (2,), }"),
            "{text}"
        );
        assert!(text.ends_with('\n'));
        assert!(
            super::header(&Array {
                name: "a",
                shape: &[3],
                values: Values::F32(&[1.0])
            })
            .is_err()
        );
    }
}
