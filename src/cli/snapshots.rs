//! Pictures of a bake: after every round a PNG from each camera (`round-03-NAME.png`), at the end one EXR each
//! (`final-NAME.exr`).
//!
//! The pictures of a round are exposed for its light, those of the result as the file. The EXR is not exposed at all (cd/m2).

use super::paths::file_names;
use crate::error::{Error, Result};
use crate::gather::BakedSurface;
use crate::output::{Exposure, Format, Picture, exr, picture};
use crate::scene::{Camera, Scene};
use crate::store::file;
use crate::team::Team;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Proportions that pictures may have.
const ASPECTS: [f64; 2] = [0.25, 4.0];

/// Where pictures go and how they look.
pub(super) struct Snapshots {
    folder: PathBuf,
    /// Cameras with their file names.
    cameras: Vec<(String, Camera)>,
    /// The first rank draws.
    team: Team,
}

impl Snapshots {
    /// Makes the folder.
    pub(super) fn new(folder: &Path, cameras: &[Camera], team: Team) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|problem| Error::io(folder, problem))?;
        let names = file_names(cameras.iter().map(|c| c.name.as_str()));
        Ok(Self {
            folder: folder.to_owned(),
            cameras: names.into_iter().zip(cameras.iter().cloned()).collect(),
            team,
        })
    }

    /// The cameras that this rank draws for.
    fn drawn(&self) -> &[(String, Camera)] {
        match self.team.is_first() {
            true => &self.cameras,
            false => &[],
        }
    }

    /// What the pictures show of each surface.
    pub(super) fn seen(&self, scene: &Scene) -> Vec<Vec<bool>> {
        let pictures: Vec<_> = self.cameras.iter().map(|(_, c)| (c, format(c))).collect();
        picture::seen(scene, &pictures)
    }

    /// Pictures of a round; the paths.
    pub(super) fn pictures(
        &self,
        start: &str,
        scene: &Scene,
        surfaces: &[BakedSurface],
        look: &Exposure,
    ) -> Result<Vec<String>> {
        self.each(|(name, camera)| {
            let picture = Picture::draw(scene, surfaces, camera, look, format(camera))?;
            self.write(&format!("{start}-{name}.png"), scene, &picture.to_png()?)
        })
    }

    /// PNGs and EXRs of the final mesh; their paths.
    pub(super) fn results(
        &self,
        scene: &Scene,
        surfaces: &[BakedSurface],
        look: &Exposure,
    ) -> Result<(Vec<String>, Vec<String>)> {
        let both = self.each(|(name, camera)| {
            let picture = Picture::draw(scene, surfaces, camera, look, format(camera))?;
            let file =
                |end: &str, bytes: &[u8]| self.write(&format!("final-{name}.{end}"), scene, bytes);
            let (shown, measured) = rayon::join(
                || file("png", &picture.to_png()?),
                || file("exr", &exr::to_exr(&picture)?),
            );
            Ok((shown?, measured?))
        })?;
        Ok(both.into_iter().unzip())
    }

    /// Draws for all cameras at once: much of it is packing files, which takes one thread each. What goes wrong with the first counts.
    fn each<T: Send>(
        &self,
        draw: impl Fn(&(String, Camera)) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        let drawn: Vec<_> = self.drawn().par_iter().map(&draw).collect();
        drawn.into_iter().collect()
    }

    fn write(&self, name: &str, scene: &Scene, bytes: &[u8]) -> Result<String> {
        let path = self.folder.join(name);
        file::write_atomic(&path, Some(&scene.source.path), |w| w.write_all(bytes))?;
        Ok(path.display().to_string())
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
