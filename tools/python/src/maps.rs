//! Light maps of a bake: gathered when they are asked for, written as `haarlight bake --light maps` writes them.

use crate::errors::raised;
use crate::light::Light;
use crate::work::{Listener, Tell, told};
use haarlight::Error;
use haarlight::cli::maps;
use haarlight::cli::stop::Stop;
use haarlight::lightmap::MapLimits;
use haarlight::output::{Exposure, ExposureSetting, WhiteBalance, camera, mapped_glb};
use haarlight::store::file;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What is asked for.
pub(crate) struct Asked {
    pub(crate) path: PathBuf,
    /// Texels along an axis of a page at the most.
    pub(crate) page: usize,
    pub(crate) texels: Option<usize>,
    pub(crate) indirect: bool,
    pub(crate) brightness: ExposureSetting,
    pub(crate) balance: WhiteBalance,
}

/// What was written.
pub(crate) struct Written {
    pub(crate) files: Vec<String>,
    /// Mean colour difference (CIEDE2000) of a look-up, an estimate.
    pub(crate) error: Option<f64>,
    pub(crate) warnings: Vec<String>,
}

/// The calling thread meanwhile.
struct Caller {
    on_progress: Option<Py<PyAny>>,
    stop_when: Option<Py<PyAny>>,
    stop: Stop,
}

impl Listener<(usize, usize)> for Caller {
    fn hear(&mut self, py: Python<'_>, (done, of): (usize, usize)) -> PyResult<()> {
        if let Some(on_progress) = &self.on_progress {
            on_progress.call1(py, (done, of))?;
        }
        Ok(())
    }

    fn idle(&mut self, py: Python<'_>) -> PyResult<()> {
        if let Some(event) = &self.stop_when
            && event.call_method0(py, "is_set")?.is_truthy(py)?
        {
            self.stop.interrupt();
        }
        Ok(())
    }
}

/// Gathers and writes.
pub(crate) fn save(
    py: Python<'_>,
    light: Arc<Light>,
    asked: Asked,
    on_progress: Option<Py<PyAny>>,
    stop_when: Option<Py<PyAny>>,
) -> PyResult<Written> {
    if light.other.is_some() {
        let what = "a relit room has its light at vertices only";
        let next = "bake the changed room: result.room.bake(mesh=False).save_maps(...)";
        return Err(raised(py, &Error::input("save_maps", what, next)));
    }
    let stop = Stop::new(None);
    let mut caller = Caller {
        on_progress,
        stop_when,
        stop: stop.clone(),
    };
    let work = move |tell: &Tell<Written, (usize, usize)>| {
        write(&light, &asked, &stop, &|done, of| {
            tell.tell((done, of));
        })
    };
    told(py, work, &mut caller)
}

fn write(
    light: &Light,
    asked: &Asked,
    stop: &Stop,
    progress: &dyn Fn(usize, usize),
) -> haarlight::Result<Written> {
    let bake = &light.solved.bake;
    let late = || stop.is_late(0.0);
    let limits = MapLimits {
        page: asked.page,
        texels: asked.texels,
        indirect: asked.indirect,
        late: &late,
    };
    let made = bake.light_maps(&limits, progress);
    let (scene, room): (_, &Path) = (light.scene(), &light.data().path);
    let metered = maps::metered(bake);
    let cameras = camera::cameras(scene);
    let look = Exposure::metered(
        scene,
        &metered.surfaces,
        &cameras,
        asked.brightness,
        asked.balance,
    );
    let glb = mapped_glb(scene, &made, &look)?;
    file::write_atomic(&asked.path, Some(room), |w| w.write_all(&glb.bytes))?;
    let files = maps::write(&asked.path, room, scene, &made, &glb, &look, false)?;
    Ok(Written {
        files,
        error: bake.error_of(&made.baked),
        warnings: glb.warnings,
    })
}
