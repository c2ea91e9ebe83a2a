//! Arrays for NumPy: a ZIP archive of `.npy` files (numpy.lib.format version 1.0), stored without compression.
//!
//! `numpy.load("room.npz")` gives the arrays of [`write_baked`]:
//! `positions` (N, 3) f64, world space, the file's units; `normals` (N, 3) f32, unit; `surface` (N,) u32, index of the
//! surface; `triangles` (T, 3) u32, rows of `positions`; `radiosity` (N, 64) f32, W/m2/nm on the bands;
//! `wavelengths` (65,) f64, the bands' edges in nm; `xyz` (N, 3) f32, tristimulus radiosity, Y in lm/m2. With layers (see
//! [`scene::layers`](crate::scene::layers)) also `layers` (L,) text, their names, and `radiosity_0`, `radiosity_1`, ... of each by
//! itself, which add up to `radiosity`.

use crate::error::{Error, Result};
use crate::gather::BakedSurface;
use crate::gather::refined;
use crate::scene::Scene;
use crate::spectrum::BANDS;
use std::io::{self, Write};
use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, DateTime, ZipWriter};

/// The length of a `.npy` header is a multiple of this, so that the data is aligned.
const ALIGNMENT: usize = 64;
/// An entry of this many bytes needs the larger fields of ZIP64.
const LARGE: usize = u32::MAX as usize;

/// Values of an array, row by row.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// `<f4`
    F32(&'a [f32]),
    /// `<f8`
    F64(&'a [f64]),
    /// `<u4`
    U32(&'a [u32]),
    /// `<U` and the length of the longest, in code points.
    Text(&'a [String]),
}

impl Values<'_> {
    fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
            Self::U32(v) => v.len(),
            Self::Text(v) => v.len(),
        }
    }

    /// Type in NumPy, and bytes of a value.
    fn kind(&self) -> (String, usize) {
        match self {
            Self::F32(_) => ("<f4".into(), 4),
            Self::F64(_) => ("<f8".into(), 8),
            Self::U32(_) => ("<u4".into(), 4),
            Self::Text(v) => {
                let longest = v.iter().map(|text| text.chars().count()).max();
                let longest = longest.unwrap_or(0).max(1);
                (format!("<U{longest}"), 4 * longest)
            }
        }
    }

    /// Writes the little-endian bytes in pieces.
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        const PIECE: usize = 4096;
        let mut bytes = Vec::with_capacity(8 * PIECE);
        macro_rules! pieces {
            ($values:expr) => {
                for piece in $values.chunks(PIECE) {
                    bytes.clear();
                    piece.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
                    out.write_all(&bytes)?;
                }
            };
        }
        match self {
            Self::F32(values) => pieces!(values),
            Self::F64(values) => pieces!(values),
            Self::U32(values) => pieces!(values),
            Self::Text(values) => {
                // UTF-32, each filled up with zeros.
                let (_, width) = self.kind();
                for text in *values {
                    bytes.clear();
                    let letters = text.chars().map(u32::from);
                    letters.for_each(|c| bytes.extend(c.to_le_bytes()));
                    bytes.resize(width, 0);
                    out.write_all(&bytes)?;
                }
            }
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

/// An `.npz` in the making.
struct Archive<W: Write> {
    zip: ZipWriter<StreamWriter<W>>,
}

impl<W: Write> Archive<W> {
    fn new(out: W) -> Self {
        let zip = ZipWriter::new_stream(out);
        Self { zip }
    }

    fn put(&mut self, array: &Array) -> io::Result<()> {
        let header = header(array)?;
        let (_, width) = array.values.kind();
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            // The first date of the format: the bytes must not depend on the clock.
            .last_modified_time(DateTime::default())
            .large_file(header.len() + array.values.len() * width >= LARGE);
        self.zip
            .start_file(format!("{}.npy", array.name), options)?;
        self.zip.write_all(&header)?;
        array.values.write(&mut self.zip)
    }

    fn end(self) -> io::Result<()> {
        self.zip.finish()?;
        Ok(())
    }
}

/// Writes an `.npz`.
///
/// # Errors
/// The writer fails, or a shape does not fit its values.
pub fn write(out: &mut dyn Write, arrays: &[Array]) -> io::Result<()> {
    let mut archive = Archive::new(out);
    arrays.iter().try_for_each(|array| archive.put(array))?;
    archive.end()
}

/// Radiosity of the vertices of each surface, W/m2/nm on the bands.
pub type Spectra = Vec<Vec<[f32; BANDS]>>;

/// Names of layers, and the spectra of each: asked for one after the other, for those of a large room take a gigabyte.
pub type LayerSpectra<'a> = (&'a [String], &'a dyn Fn(usize) -> Spectra);

/// Writes the refined mesh with its spectra: see the module's words.
///
/// `spectra` holds, for each surface of `surfaces`, the radiosity of its vertices on the bands, W/m2/nm.
///
/// # Errors
/// The spectra do not match the mesh (internal fault), or the writer fails.
pub fn write_baked(
    out: &mut dyn Write,
    scene: &Scene,
    surfaces: &[BakedSurface],
    spectra: &[Vec<[f32; BANDS]>],
) -> Result<()> {
    write_parted(out, scene, surfaces, spectra, (&[], &|_| Vec::new()))
}

/// The same with its layers.
///
/// # Errors
/// As [`write_baked`].
pub fn write_parted(
    out: &mut dyn Write,
    scene: &Scene,
    surfaces: &[BakedSurface],
    spectra: &[Vec<[f32; BANDS]>],
    (names, layer): LayerSpectra,
) -> Result<()> {
    refined::check(scene, surfaces)?;
    let radiosity = flat(surfaces, spectra)?;
    let io = |problem| Error::Io {
        path: "npz".into(),
        source: problem,
    };
    let mut archive = Archive::new(out);
    whole(&mut archive, scene, surfaces, &radiosity).map_err(io)?;
    if !names.is_empty() {
        let array = Array {
            name: "layers",
            shape: &[names.len()],
            values: Values::Text(names),
        };
        archive.put(&array).map_err(io)?;
    }
    for k in 0..names.len() {
        let radiosity = flat(surfaces, &layer(k))?;
        let array = Array {
            name: &format!("radiosity_{k}"),
            shape: &[radiosity.len() / BANDS, BANDS],
            values: Values::F32(&radiosity),
        };
        archive.put(&array).map_err(io)?;
    }
    archive.end().map_err(io)
}

/// Spectra of all vertices, one after the other.
fn flat(surfaces: &[BakedSurface], spectra: &[Vec<[f32; BANDS]>]) -> Result<Vec<f32>> {
    let of = |(surface, spectra): (&BakedSurface, &Vec<_>)| surface.vertices.len() == spectra.len();
    if surfaces.len() != spectra.len() || !surfaces.iter().zip(spectra).all(of) {
        return Err(Error::Internal(
            "spectra do not match the refined mesh".into(),
        ));
    }
    Ok(spectra.iter().flatten().flatten().copied().collect())
}

/// The arrays of a mesh under all its light.
fn whole(
    archive: &mut Archive<impl Write>,
    scene: &Scene,
    surfaces: &[BakedSurface],
    radiosity: &[f32],
) -> io::Result<()> {
    let columns = MeshColumns::of(scene, surfaces);
    let mut edges: Vec<f64> = (0..BANDS).map(|band| scene.grid.left(band)).collect();
    edges.push(scene.grid.left(BANDS - 1) + scene.grid.width());
    let count = columns.surface.len();
    let array = |name, shape, values| Array {
        name,
        shape,
        values,
    };
    [
        array("positions", &[count, 3], Values::F64(&columns.positions)),
        array("normals", &[count, 3], Values::F32(&columns.normals)),
        array("surface", &[count], Values::U32(&columns.surface)),
        array(
            "triangles",
            &[columns.triangles.len() / 3, 3],
            Values::U32(&columns.triangles),
        ),
        array("radiosity", &[count, BANDS], Values::F32(radiosity)),
        array("wavelengths", &[BANDS + 1], Values::F64(&edges)),
        array("xyz", &[count, 3], Values::F32(&columns.xyz)),
    ]
    .iter()
    .try_for_each(|array| archive.put(array))
}

/// The refined mesh of all surfaces, column by column: as the arrays of their names.
#[derive(Default)]
struct MeshColumns {
    positions: Vec<f64>,
    normals: Vec<f32>,
    xyz: Vec<f32>,
    surface: Vec<u32>,
    triangles: Vec<u32>,
}

impl MeshColumns {
    fn of(scene: &Scene, surfaces: &[BakedSurface]) -> Self {
        let mut all = Self::default();
        for baked in surfaces {
            let surface = &scene.surfaces[baked.surface];
            let first = all.surface.len() as u32;
            for vertex in &baked.vertices {
                let place = refined::position(surface, vertex) / scene.changes.scale;
                let normal = refined::normal(surface, baked, vertex).as_vec3();
                all.positions.extend(place.to_array());
                all.normals.extend(normal.to_array());
                all.xyz.extend(vertex.radiosity);
                all.surface.push(baked.surface as u32);
            }
            let triangles = baked.triangles.iter().flatten();
            all.triangles.extend(triangles.map(|v| first + v));
        }
        all
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// As NumPy writes `np.array(["ab", "\u00e9\u5f00"])`: UTF-32, two code points each.
    #[test]
    fn texts_are_utf_32() {
        let texts = ["ab".to_owned(), "\u{e9}".to_owned(), String::new()];
        let values = Values::Text(&texts);
        assert_eq!(values.kind(), ("<U2".to_owned(), 8));
        let mut bytes = Vec::new();
        values.write(&mut bytes).unwrap();
        let want = [97, 98, 0xe9, 0, 0, 0_u32].map(u32::to_le_bytes);
        assert_eq!(bytes, want.concat());
        assert_eq!(Values::Text(&[]).kind().0, "<U1");
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
