//! Pictures of a bake: after every round a PNG from each camera (`round-03-NAME.png`), at the end one EXR each
//! (`final-NAME.exr`).
//!
//! The exposure is metered in the first round and kept: pictures of a run differ by their light alone. The EXR is not
//! exposed at all (cd/m2).

use super::paths::file_names;
use crate::error::{Error, Result};
use crate::gather::BakedSurface;
use crate::output::{Exposure, Format, Picture, camera, exr, picture};
use crate::scene::{Camera, Scene};
use crate::store::file;
use std::path::{Path, PathBuf};

/// Proportions that pictures may have.
const ASPECTS: [f64; 2] = [0.25, 4.0];

/// Where pictures go and how they look.
pub(super) struct Snapshots {
    folder: PathBuf,
    /// Cameras with their file names.
    cameras: Vec<(String, Camera)>,
    exposure: Option<Exposure>,
}

impl Snapshots {
    /// Makes the folder.
    pub(super) fn new(folder: &Path, scene: &Scene) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|problem| Error::io(folder, problem))?;
        let cameras = camera::cameras(scene);
        let names = file_names(cameras.iter().map(|c| c.name.as_str()));
        Ok(Self {
            folder: folder.to_owned(),
            cameras: names.into_iter().zip(cameras).collect(),
            exposure: None,
        })
    }

    /// What the pictures show of each surface.
    pub(super) fn seen(&self, scene: &Scene) -> Vec<Vec<bool>> {
        let pictures: Vec<_> = self.cameras.iter().map(|(_, c)| (c, format(c))).collect();
        picture::seen(scene, &pictures)
    }

    /// The exposure of all pictures: metered when first asked for.
    pub(super) fn exposure(&mut self, scene: &Scene, surfaces: &[BakedSurface]) -> Exposure {
        *self
            .exposure
            .get_or_insert_with(|| Exposure::auto(scene, surfaces))
    }

    /// Pictures of a round, or of the `final` mesh; the paths.
    pub(super) fn pictures(
        &mut self,
        start: &str,
        scene: &Scene,
        surfaces: &[BakedSurface],
    ) -> Result<Vec<String>> {
        let look = self.exposure(scene, surfaces);
        self.each(start, "png", scene, |camera| {
            Picture::draw(scene, surfaces, camera, &look, format(camera))?.to_png()
        })
    }

    /// The EXRs of the final mesh; the paths.
    pub(super) fn exr(&mut self, scene: &Scene, surfaces: &[BakedSurface]) -> Result<Vec<String>> {
        let look = self.exposure(scene, surfaces);
        self.each("final", "exr", scene, |camera| {
            exr::to_exr(&Picture::draw(
                scene,
                surfaces,
                camera,
                &look,
                format(camera),
            )?)
        })
    }

    fn each(
        &self,
        start: &str,
        end: &str,
        scene: &Scene,
        draw: impl Fn(&Camera) -> Result<Vec<u8>>,
    ) -> Result<Vec<String>> {
        let mut paths = Vec::new();
        for (name, camera) in &self.cameras {
            let path = self.folder.join(format!("{start}-{name}.{end}"));
            let bytes = draw(camera)?;
            file::write_atomic(&path, Some(&scene.source.path), |w| w.write_all(&bytes))?;
            paths.push(path.display().to_string());
        }
        Ok(paths)
    }
}

/// As many pixels as the default format has, in the camera's proportions.
fn format(camera: &Camera) -> Format {
    let default = Format::default();
    let Some(aspect) = camera.aspect.filter(|a| a.is_finite() && *a > 0.0) else {
        return default;
    };
    let aspect = aspect.clamp(ASPECTS[0], ASPECTS[1]);
    let pixels = (default.width * default.height) as f64;
    Format {
        width: (pixels * aspect).sqrt().round() as usize,
        height: (pixels / aspect).sqrt().round() as usize,
        ..default
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Projection;
    use glam::DMat4;

    #[test]
    fn pictures_have_the_proportions_of_their_camera() {
        let camera = |aspect| Camera {
            name: String::new(),
            to_world: DMat4::IDENTITY,
            projection: Projection::Perspective(1.0),
            aspect,
        };
        let size = |aspect| {
            let f = format(&camera(aspect));
            (f.width, f.height)
        };
        assert_eq!(size(None), (960, 720));
        assert_eq!(size(Some(4.0 / 3.0)), (960, 720));
        assert_eq!(size(Some(1.0)), (831, 831));
        assert_eq!(size(Some(f64::NAN)), (960, 720));
        assert_eq!(size(Some(1e9)), size(Some(4.0)));
    }
}
