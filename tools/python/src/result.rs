//! The light of a room: arrays of its mesh, probes, audits, files.

use crate::arrays::{self, line, points, rows, sealed};
use crate::data::Room;
use crate::errors::{raised, warn, wrong};
use crate::light::{Light, Solved};
use crate::maps;
use crate::records::{flat, plain};
use crate::relight::Change;
use crate::work::done;
use haarlight::Error;
use haarlight::gather::{Baked, BakedSurface, BakedVertex, refined};
use haarlight::output::{Exposure, Writing, baked_glb, camera, npz};
use haarlight::scene::Surface;
use haarlight::spectrum::BANDS;
use haarlight::store::file;
use haarlight::survey;
use numpy::Element;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use std::path::PathBuf;
use std::sync::Arc;

/// Arrays that were asked for: every caller gets the same ones.
struct Arrays {
    positions: PyOnceLock<Py<PyAny>>,
    normals: PyOnceLock<Py<PyAny>>,
    triangles: PyOnceLock<Py<PyAny>>,
    surface: PyOnceLock<Py<PyAny>>,
    xyz: PyOnceLock<Py<PyAny>>,
    irradiance: PyOnceLock<Py<PyAny>>,
    spectra: PyOnceLock<Py<PyAny>>,
}

impl Arrays {
    fn none() -> Self {
        Self {
            positions: PyOnceLock::new(),
            normals: PyOnceLock::new(),
            triangles: PyOnceLock::new(),
            surface: PyOnceLock::new(),
            xyz: PyOnceLock::new(),
            irradiance: PyOnceLock::new(),
            spectra: PyOnceLock::new(),
        }
    }
}

/// The light of a room. Made by `Room.bake` and `Result.relight`.
///
/// Arrays are those that were computed, not copies, and cannot be written to. Positions are in the units of the file.
#[pyclass(frozen, name = "Result", module = "haarlight")]
pub(crate) struct Lit {
    light: Arc<Light>,
    arrays: Arrays,
}

impl Lit {
    pub(crate) fn new(solved: Solved) -> Self {
        Self::of(Light {
            solved: Arc::new(solved),
            other: None,
        })
    }

    fn of(light: Light) -> Self {
        Self {
            light: Arc::new(light),
            arrays: Arrays::none(),
        }
    }

    /// The mesh with its light.
    fn baked(&self, py: Python<'_>) -> PyResult<&Baked> {
        let next = "bake with mesh=True";
        let none = || wrong(py, "mesh", "light was not gathered at vertices", next);
        self.light.baked().ok_or_else(none)
    }

    /// Numbers of every vertex, in order.
    fn vertices<T: Element, const N: usize>(
        &self,
        py: Python<'_>,
        place: &PyOnceLock<Py<PyAny>>,
        of: impl Fn(&Surface, &BakedSurface, &BakedVertex) -> [T; N] + Send + Sync,
    ) -> PyResult<Py<PyAny>> {
        let baked = self.baked(py)?;
        let made = place.get_or_try_init(py, || {
            let scene = self.light.scene();
            let values: Vec<T> = py.detach(|| {
                let all = baked.surfaces.iter().flat_map(|baked| {
                    let surface = &scene.surfaces[baked.surface];
                    let of = &of;
                    baked
                        .vertices
                        .iter()
                        .flat_map(move |v| of(surface, baked, v))
                });
                all.collect()
            });
            rows(py, values, N)
        })?;
        Ok(made.clone_ref(py))
    }
}

#[pymethods]
impl Lit {
    /// The room as it is lit here.
    #[getter]
    fn room(&self) -> Room {
        Room {
            data: Arc::clone(self.light.data()),
        }
    }

    /// How the bake ended: `reached`, `out_of_time`, `interrupted`, `out_of_rounds` or `exhausted`.
    #[getter]
    fn verdict(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        plain(py, &self.light.solved.verdict)
    }

    /// Mean colour difference (CIEDE2000) of the light, an estimate: at vertices and between them, or at points where there
    /// is no mesh. None before there are two rounds.
    #[getter]
    fn error(&self) -> Option<f64> {
        self.light.error()
    }

    /// A record of every round as a dictionary without dictionaries in it, as `pandas.DataFrame` takes them: `round`,
    /// `round_s`, `links`, `error.total_de2000`, `error.total_de2000.kind` (`bound`, `estimate` or `measured`) ...
    #[getter]
    fn rounds(&self, py: Python<'_>) -> PyResult<Vec<Py<PyAny>>> {
        let rounds = self.light.solved.bake.rounds().iter();
        rounds.map(|round| flat(py, round)).collect()
    }

    /// What relighting took, a dictionary like those of `rounds`; None for a bake.
    #[getter]
    fn relit(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        let other = self.light.other.as_ref();
        other.map(|other| flat(py, &other.relit.record)).transpose()
    }

    /// Tristimulus irradiance of the adaptation white, lm/m2.
    #[getter]
    fn white(&self) -> [f64; 3] {
        self.light.white()
    }

    /// Edges of the 64 bands that spectra are held on, (65,) float64, nm.
    #[getter]
    fn edges(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let grid = &self.light.scene().grid;
        let edges: Vec<f64> = (0..=BANDS).map(|band| grid.left(band)).collect();
        line(py, edges)
    }

    /// Places of the vertices, (N, 3) float64, world space, units of the file.
    #[getter]
    fn positions(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let scale = self.light.scene().changes.scale;
        self.vertices(py, &self.arrays.positions, |surface, _, vertex| {
            (refined::position(surface, vertex) / scale).to_array()
        })
    }

    /// Unit normals of the vertices, (N, 3) float32.
    #[getter]
    fn normals(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.vertices(py, &self.arrays.normals, |surface, baked, vertex| {
            refined::normal(surface, baked, vertex).as_vec3().to_array()
        })
    }

    /// Tristimulus radiosity that leaves the vertices, own emission included, (N, 3) float32, lm/m2: X, Y, Z.
    #[getter]
    fn xyz(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.vertices(py, &self.arrays.xyz, |_, _, vertex| vertex.radiosity)
    }

    /// Tristimulus irradiance of the vertices, (N, 3) float32, lm/m2: X, Y, Z; Y is lux.
    #[getter]
    fn irradiance(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.vertices(py, &self.arrays.irradiance, |_, _, vertex| {
            vertex.irradiance
        })
    }

    /// Triangles of the mesh, (M, 3) uint32, indices of vertices, counter-clockwise from the front.
    #[getter]
    fn triangles(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let baked = self.baked(py)?;
        let made = self.arrays.triangles.get_or_try_init(py, || {
            let mut first = 0;
            let mut all: Vec<u32> = Vec::new();
            for surface in &baked.surfaces {
                all.extend(surface.triangles.iter().flatten().map(|v| first + v));
                first += surface.vertices.len() as u32;
            }
            rows(py, all, 3)
        })?;
        Ok(made.clone_ref(py))
    }

    /// Which of `Room.surfaces` each vertex belongs to, (N,) uint32.
    #[getter]
    fn surface(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let baked = self.baked(py)?;
        let made = self.arrays.surface.get_or_try_init(py, || {
            let surfaces = baked.surfaces.iter();
            let owners =
                surfaces.flat_map(|s| std::iter::repeat_n(s.surface as u32, s.vertices.len()));
            line(py, owners.collect::<Vec<u32>>())
        })?;
        Ok(made.clone_ref(py))
    }

    /// Spectral radiosity of the vertices, W/m2/nm.
    ///
    /// Args:
    ///     wavelengths: (K,), nm. Light is held as means over 64 bands, see `edges`; a wavelength gets that of its band.
    ///
    /// Returns:
    ///     (N, K) float32; without wavelengths all bands, (N, 64), not copied.
    ///
    /// Raises:
    ///     InputError: a wavelength lies outside the range of the room.
    #[pyo3(signature = (wavelengths = None))]
    fn spectra(
        &self,
        py: Python<'_>,
        wavelengths: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        self.baked(py)?;
        let bands = match wavelengths {
            None => None,
            Some(given) => Some(self.bands(py, &arrays::wavelengths(given)?)?),
        };
        let all = self.arrays.spectra.get_or_try_init(py, || {
            let light = Arc::clone(&self.light);
            let flat = done(py, move || Ok(light.radiosity().concat().into_flattened()))?;
            rows(py, flat, BANDS)
        })?;
        match bands {
            None => Ok(all.clone_ref(py)),
            Some(bands) => {
                let taken = all.bind(py).call_method1("take", (bands, 1))?;
                sealed(&taken)
            }
        }
    }

    /// Light at points, by the same gather as `haarlight probe`.
    ///
    /// Args:
    ///     points: (N, 3), world space, units of the file.
    ///     normals: (N, 3), or (3,) for all points; of any length.
    ///
    /// Returns:
    ///     Probe(lux, xyz, bands, plus_minus): lux (N,); xyz (N, 3), tristimulus irradiance, lm/m2; bands (N, 64), spectral
    ///     irradiance on the bands between `edges`, W/m2/nm; plus_minus (N,), lx: the light's stated error, an *estimate* of
    ///     its root mean square (NaN while it is not known). All float64. Bands come from the intervals that the bake
    ///     carried: bake with `spectrum="dense"` for all that the bands can tell.
    ///
    /// Warns:
    ///     RoomWarning: points lie inside something solid or outside the room.
    fn probe(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        normals: &Bound<'_, PyAny>,
    ) -> PyResult<Py<PyAny>> {
        let asked = self::points(points, normals)?;
        let light = Arc::clone(&self.light);
        let count = asked.len();
        let (probed, strays) = done(py, move || {
            let places = survey::places(light.scene(), &light.metres(&asked));
            let strays = places
                .iter()
                .filter(|p| **p != survey::PointLocation::Room)
                .count();
            Ok((light.probe(&asked)?, strays))
        })?;
        if strays > 0 {
            let what = format!(
                "{strays} of {count} points lie inside something solid or outside the room"
            );
            warn(py, &[what])?;
        }
        let lux: Vec<f64> = probed.iter().map(|p| p.xyz[1]).collect();
        let relative = self.light.relative_error().unwrap_or(f64::NAN);
        let spread: Vec<f64> = lux.iter().map(|lux| relative * lux).collect();
        let xyz: Vec<f64> = probed.iter().flat_map(|p| p.xyz).collect();
        let bands: Vec<f64> = probed.iter().flat_map(|p| p.spectrum).collect();
        let class = py.import("haarlight._types")?.getattr("Probe")?;
        let probe = class.call1((
            line(py, lux)?,
            rows(py, xyz, 3)?,
            rows(py, bands, BANDS)?,
            line(py, spread)?,
        ))?;
        Ok(probe.unbind())
    }

    /// Where points lie: a list of `room`, `inside` (something solid) or `outside`.
    ///
    /// Args:
    ///     points: (N, 3), world space, units of the file.
    ///     normals: (N, 3), or (3,) for all points.
    fn places(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        normals: &Bound<'_, PyAny>,
    ) -> PyResult<Vec<&'static str>> {
        let asked = self::points(points, normals)?;
        let light = Arc::clone(&self.light);
        let places = done(py, move || {
            Ok(survey::places(light.scene(), &light.metres(&asked)))
        })?;
        Ok(places
            .into_iter()
            .map(survey::PointLocation::name)
            .collect())
    }

    /// The room under other lamps and paints; no ray is cast.
    ///
    /// Args:
    ///     changes: by name of a lamp or material: a number multiplies a lamp's light as it is here; a dictionary is as in a
    ///         file of spectra (`{"emission": {"name": "cie/F2", "luminance_cd_m2": 5000}}`, `{"reflectance": ...}`, for a
    ///         light `{"name": "cie/A"}`), and the room's file is read again. Or a Room of the same shape.
    ///
    /// Returns:
    ///     Result: light on the same mesh, with `relit` set. Its probes look from their points through the bake's rays.
    ///
    /// Raises:
    ///     InputError: no lamp of that name; another shape; a surface gives out light that did not; baked with keep=False.
    fn relight(&self, py: Python<'_>, changes: &Bound<'_, PyAny>) -> PyResult<Self> {
        let change = Change::of(changes)?;
        let light = Arc::clone(&self.light);
        let lit = done(py, move || {
            let data = change.apply(light.data())?;
            let other = light.relight(data)?;
            Ok(Light {
                solved: Arc::clone(&light.solved),
                other: Some(other),
            })
        })?;
        Ok(Self::of(lit))
    }

    /// Measures the error at random points by Monte Carlo, of light as a viewer draws it between vertices (at the points
    /// themselves where there is no mesh).
    ///
    /// Args:
    ///     points: how many.
    ///     seed: of points and paths.
    ///
    /// Returns:
    ///     A dictionary: `de2000.mean.value`, `.low`, `.high` (interval of 95 %), `relative.mean.value`, `bias.value` ... as in
    ///     the log's record `audit`.
    #[pyo3(signature = (points = 200, *, seed = 0))]
    fn audit(&self, py: Python<'_>, points: usize, seed: u64) -> PyResult<Py<PyAny>> {
        let light = Arc::clone(&self.light);
        let report = done(py, move || light.audit(points, seed))?;
        flat(py, &report)
    }

    /// Writes the room with its light: a .glb, or arrays for NumPy as .npz.
    ///
    /// Args:
    ///     path: ends in .glb or .npz; not the room that was read.
    ///     exposure: "auto", "auto+1" (a stop brighter) or an exposure value for ISO 100.
    ///     white_balance: "none", "auto" or a colour temperature in K.
    ///     xyz: keep the tristimulus radiosity of every vertex as the attribute `_XYZ`.
    ///     compress: "none", "quantize" or "meshopt".
    ///
    /// Warns:
    ///     RoomWarning: what could not be carried over.
    #[pyo3(signature = (path, *, exposure = "auto".into(), white_balance = "none".into(), xyz = false, compress = "none"), text_signature = "($self, path, *, exposure='auto', white_balance='none', xyz=False, compress='none')")]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        exposure: Text,
        white_balance: Text,
        xyz: bool,
        compress: &str,
    ) -> PyResult<()> {
        self.baked(py)?;
        let brightness = exposure.parse(py, "exposure")?;
        let balance = white_balance.parse(py, "white_balance")?;
        let packing = Text(compress.into()).parse(py, "compress")?;
        let kind = path.extension().map(|e| e.to_ascii_lowercase());
        let as_arrays = match kind.as_ref().and_then(|kind| kind.to_str()) {
            Some("glb") => false,
            Some("npz") => true,
            _ => {
                let what = "is not the name of a .glb or .npz";
                return Err(wrong(
                    py,
                    &path.display().to_string(),
                    what,
                    "end it in .glb",
                ));
            }
        };
        let light = Arc::clone(&self.light);
        let warnings = done(py, move || {
            let (scene, room) = (light.scene(), Some(light.data().path.as_path()));
            if as_arrays {
                let mut bytes = Vec::new();
                npz::write_baked(&mut bytes, scene, light.surfaces(), &light.radiosity())?;
                file::write_atomic(&path, room, |w| w.write_all(&bytes))?;
                return Ok(Vec::new());
            }
            let cameras = camera::cameras(scene);
            let exposure =
                Exposure::metered(scene, light.surfaces(), &cameras, brightness, balance);
            let glb = baked_glb(scene, light.surfaces(), &exposure, Writing { xyz, packing })?;
            file::write_atomic(&path, room, |w| w.write_all(&glb.bytes))?;
            Ok(glb.warnings)
        })?;
        warn(py, &warnings)
    }

    /// Writes light maps: the room's own mesh as .glb, and beside it the pages (`.map-0.exr` ...) and their index
    /// (`.maps.json`), as `haarlight bake --light maps` does. Light at vertices (`mesh=True`) is not needed.
    ///
    /// Args:
    ///     path: ends in .glb; not the room that was read.
    ///     size: texels along an axis of a page at the most, 64 to 16384.
    ///     texels: of all pages at the most, about; None: as many as the error of the bake needs.
    ///     indirect: leave out what comes straight from lamps and the sky.
    ///     exposure, white_balance: of the pages in the .glb, as for `save`; the .exr hold irradiance.
    ///     on_progress: called with how many looks of the present pass are done, and of how many.
    ///     stop: anything with `is_set()`: ends the gather; what was not looked at shows the solved light.
    ///
    /// Returns:
    ///     {"files", "error"}: names of the files beside the .glb; mean colour difference (CIEDE2000) of a look-up, an
    ///     estimate, None where it is not known.
    ///
    /// Raises:
    ///     InputError: the light is a relit one; the size is out of range.
    #[pyo3(signature = (path, *, size = 1024, texels = None, indirect = false, exposure = "auto".into(), white_balance = "none".into(), on_progress = None, stop = None), text_signature = "($self, path, *, size=1024, texels=None, indirect=False, exposure='auto', white_balance='none', on_progress=None, stop=None)")]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn save_maps(
        &self,
        py: Python<'_>,
        path: PathBuf,
        size: usize,
        texels: Option<usize>,
        indirect: bool,
        exposure: Text,
        white_balance: Text,
        on_progress: Option<Py<PyAny>>,
        stop: Option<Py<PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        let [least, most] = haarlight::cli::maps::PAGES;
        if !(least..=most).contains(&size) {
            let next = format!("give {least} to {most} texels along a side");
            return Err(wrong(py, "size", format!("is {size}"), &next));
        }
        if path
            .extension()
            .is_none_or(|e| !e.eq_ignore_ascii_case("glb"))
        {
            let place = path.display().to_string();
            return Err(wrong(
                py,
                &place,
                "is not the name of a .glb",
                "end it in .glb",
            ));
        }
        let asked = maps::Asked {
            path,
            page: size,
            texels,
            indirect,
            brightness: exposure.parse(py, "exposure")?,
            balance: white_balance.parse(py, "white_balance")?,
        };
        let written = maps::save(py, Arc::clone(&self.light), asked, on_progress, stop)?;
        warn(py, &written.warnings)?;
        plain(
            py,
            &serde_json::json!({ "files": written.files, "error": written.error }),
        )
    }

    fn __repr__(&self) -> String {
        let rounds = self.light.solved.bake.rounds().len();
        let error = self
            .light
            .error()
            .map_or("not known".into(), |e| format!("{e:.3} (estimate)"));
        let vertices: usize = self.light.surfaces().iter().map(|s| s.vertices.len()).sum();
        format!("<haarlight.Result: {rounds} rounds, dE00 {error}, {vertices} vertices>")
    }
}

impl Lit {
    /// The bands that wavelengths lie in.
    fn bands(&self, py: Python<'_>, wavelengths: &[f64]) -> PyResult<Vec<usize>> {
        let grid = &self.light.scene().grid;
        let band = |nm: &f64| {
            grid.band_of(*nm).ok_or_else(|| {
                let what = format!(
                    "{nm} nm lies outside of {} to {} nm",
                    grid.start(),
                    grid.end()
                );
                raised(
                    py,
                    &Error::input("wavelengths", what, "load the room with another range"),
                )
            })
        };
        wavelengths.iter().map(band).collect()
    }
}

/// A text, or a number as its text.
struct Text(String);

impl From<&str> for Text {
    fn from(text: &str) -> Self {
        Self(text.into())
    }
}

impl<'a, 'py> FromPyObject<'a, 'py> for Text {
    type Error = PyErr;

    fn extract(given: pyo3::Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        given.str().map(|text| Self(text.to_string()))
    }
}

impl Text {
    /// What it means.
    fn parse<T: std::str::FromStr<Err = String>>(&self, py: Python<'_>, name: &str) -> PyResult<T> {
        let refused = |next: String| wrong(py, name, format!("is '{}'", self.0), &next);
        self.0.parse().map_err(refused)
    }
}
