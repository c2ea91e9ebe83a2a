//! A room that was read: what it holds, and what the program will do with it.

use crate::bake::{self, Wanted};
use crate::data::{Data, Room, json_of};
use crate::errors::{warn, wrong};
use crate::records::plain;
use crate::result::Lit;
use crate::work::done;
use haarlight::cli::options::WavelengthRange;
use haarlight::scene::Options;
use haarlight::scene::effects::Plan;
use haarlight::scene::facts::Facts;
use haarlight::survey::SurveyOptions;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyString};
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;

/// Reads a room, .glb or .gltf.
///
/// Args:
///     path: the file.
///     spectra: spectra of materials and lights: a file, or a dictionary as in such a file, which is laid over
///         `room.spectra.json` beside the room: `{"materials": {"wall": {"reflectance": {"name": "macbeth/white"}}}}`.
///         In place of `{"name": ...}` or `{"csv": ...}` arrays may stand: `{"wavelengths": nm, "values": ...}`.
///     sky: `"overcast"`, `"clear"` ... or a dictionary as under `"sky"` in a file of spectra, with the sun in it.
///     range: first and last wavelength, nm; 64 bands divide them.
///     lenient: only warn of keys and names in `spectra` that mean nothing.
///     scale: metres for each unit of the file.
///     flip: turn the faces that look reversed.
///     allow_dark: go on where no lamp lights the room.
///
/// Raises:
///     InputError: all that is wrong with the room, as `problems`.
///     FileError: a file that cannot be read; `MissingFileError` where there is none.
#[pyfunction]
#[pyo3(signature = (path, spectra = None, *, sky = None, range = (380.0, 780.0), lenient = false, scale = None, flip = false, allow_dark = false), text_signature = "(path, spectra=None, *, sky=None, range=(380.0, 780.0), lenient=False, scale=None, flip=False, allow_dark=False)")]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn load(
    py: Python<'_>,
    path: PathBuf,
    spectra: Option<&Bound<'_, PyAny>>,
    sky: Option<&Bound<'_, PyAny>>,
    range: (f64, f64),
    lenient: bool,
    scale: Option<f64>,
    flip: bool,
    allow_dark: bool,
) -> PyResult<Room> {
    let range: WavelengthRange = format!("{}..{}", range.0, range.1)
        .parse()
        .map_err(|what: String| wrong(py, "range", what, "give (380, 780)"))?;
    if scale.is_some_and(|s| !(s > 0.0 && s.is_finite())) {
        let next = "give metres for each unit of the file, as .01 for centimetres";
        return Err(wrong(py, "scale", "is not a number above zero", next));
    }
    let mut options = Options {
        grid: range.grid(),
        lenient,
        scale,
        ..Options::default()
    };
    match spectra {
        Some(given) if given.cast::<PyMapping>().is_ok() => {
            options.say(json_of(given, "spectra")?);
        }
        Some(given) => options.spectra = Some(given.extract()?),
        None => {}
    }
    if let Some(sky) = sky {
        let sky = match sky.cast::<PyString>() {
            Ok(kind) => json!({ "type": kind.to_str()? }),
            Err(_) => json_of(sky, "sky")?,
        };
        options.say(json!({ "sky": sky }));
    }
    let wishes = SurveyOptions { allow_dark, flip };
    let data = done(py, move || Data::read(path, options, wishes))?;
    warn(py, &data.scene.warnings)?;
    Ok(Room {
        data: Arc::new(data),
    })
}

#[pymethods]
impl Room {
    /// The file.
    #[getter]
    fn path(&self) -> &std::path::Path {
        &self.data.path
    }

    /// What will be simulated and why: a list of `{"name", "runs", "lacking", "reason"}`, one for each effect.
    #[getter]
    fn plan(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        plain(py, &Plan::of(&self.data.scene))
    }

    /// What the room holds: `lights`, `materials`, `area_m2`, `bounds_m` ... as `haarlight inspect --json` has it.
    #[getter]
    fn facts(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        plain(py, &Facts::of(&self.data.scene))
    }

    /// What the user should know of the room, sentences; `load` says them as Python warnings too.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.data.scene.warnings.clone()
    }

    /// The surfaces, as `Result.surface` counts them: a list of `{"name", "node", "mesh", "primitive", "instance",
    /// "material"}`, indices in the document and the name of the material.
    #[getter]
    fn surfaces<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let scene = &self.data.scene;
        let surface = |surface: &haarlight::scene::Surface| {
            let out = PyDict::new(py);
            out.set_item("name", &surface.name)?;
            out.set_item("node", surface.node)?;
            out.set_item("mesh", surface.mesh)?;
            out.set_item("primitive", surface.primitive)?;
            out.set_item("instance", surface.instance)?;
            out.set_item("material", &scene.materials[surface.material].name)?;
            Ok(out)
        };
        scene.surfaces.iter().map(surface).collect()
    }

    /// Bakes light into the room, round by round, until the error asked for.
    ///
    /// Ctrl-C takes the present round back, save the first, and ends with a whole, if coarser, result (`verdict` is then `"interrupted"`); a second
    /// Ctrl-C raises `KeyboardInterrupt` at once.
    ///
    /// Args:
    ///     error: mean colour difference (CIEDE2000) at which to stop.
    ///     time: seconds that rounds and mesh may take together; the first round is always done.
    ///     on_round: called with the record of every round, see `Result.rounds`; the bake ends when it returns False.
    ///     stop: anything with `is_set()`, as `threading.Event`: ends the bake like Ctrl-C once it is set.
    ///     mesh: also gather light at vertices (`positions`, `xyz`, `spectra`, `save`): most of the time of a bake.
    ///         Without it there are `probe`, `relight` and `audit`.
    ///     keep: keep where light comes from, which `relight` needs.
    ///     vertices: vertices of the mesh at the most.
    ///     spectrum: how spectra are carried: "perceptual", "guaranteed", "dense" (all 64 bands), "rgb" ...
    ///     rounds: rounds at the most.
    ///     seed: of all sampling patterns; equal seeds give equal results.
    ///
    /// Returns:
    ///     Result: the light.
    #[pyo3(signature = (error = 0.5, *, time = None, on_round = None, stop = None, mesh = true, keep = true, vertices = None, spectrum = "perceptual", rounds = 12, seed = 0))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn bake(
        &self,
        py: Python<'_>,
        error: f64,
        time: Option<f64>,
        on_round: Option<Py<PyAny>>,
        stop: Option<Py<PyAny>>,
        mesh: bool,
        keep: bool,
        vertices: Option<usize>,
        spectrum: &str,
        rounds: usize,
        seed: u64,
    ) -> PyResult<Lit> {
        let next = "give a number above zero";
        for (name, value) in [("error", Some(error)), ("time", time)] {
            if value.is_some_and(|v| !(v > 0.0 && v.is_finite())) {
                return Err(wrong(py, name, "is not a number above zero", next));
            }
        }
        if rounds == 0 {
            return Err(wrong(py, "rounds", "is 0", next));
        }
        let representation = spectrum
            .parse()
            .map_err(|choice: String| wrong(py, "spectrum", format!("is '{spectrum}'"), &choice))?;
        let wanted = Wanted {
            settings: haarlight::solve::Settings {
                error,
                representation,
                seed,
                rounds,
                ..Default::default()
            },
            time,
            mesh,
            keep,
            vertices,
        };
        bake::bake(py, Arc::clone(&self.data), wanted, on_round, stop).map(Lit::new)
    }

    fn __repr__(&self) -> String {
        let scene = &self.data.scene;
        let triangles: usize = scene.surfaces.iter().map(|s| s.triangles.len()).sum();
        format!(
            "<haarlight.Room {:?}: {triangles} triangles, {} materials>",
            self.data.path,
            scene.materials.len()
        )
    }
}
