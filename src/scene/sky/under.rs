//! The same room under another sky.

use super::SkyWish;
use super::lamps::join;
use crate::error::{Error, Result};
use crate::scene::check::Check;
use crate::scene::{LightKind, Material, Scene};

impl Scene {
    /// The same room under a sky, instead of the one it had; names of nodes are not known here, those of lights are.
    ///
    /// # Errors
    /// [`Error::Input`]: what is said of sky and sun does not go together.
    pub fn under(mut self, wish: &SkyWish) -> Result<Self> {
        self.shut_out_sky();
        let mut check = Check::new(self.source.path.display().to_string());
        let (lights, spectra) = (&mut self.lights, &mut self.spectra);
        let sky = join(wish, &[], &self.grid, lights, spectra, &mut check);
        let (problems, warnings) = check.into_parts();
        if !problems.is_empty() {
            return Err(Error::Input(problems));
        }
        self.sky = sky;
        self.warnings.extend(warnings);
        Ok(self)
    }

    /// Takes the sky out again, with its sun if that is none of the file's lights: no ray of this room gets there.
    pub(crate) fn shut_out_sky(&mut self) {
        let Some(sky) = self.sky.take() else { return };
        self.lights.retain(|light| {
            !light.kind.is_dome() && (sky.sun_of_file || light.kind != LightKind::Sun)
        });
        // Their spectra stand last.
        while let Some(last) = self.spectra.len().checked_sub(1) {
            let given = self.materials.iter().flat_map(Material::lights);
            let mut used = given.chain(self.lights.iter().map(|l| l.light));
            if used.any(|light| light == last) {
                break;
            }
            self.spectra.pop();
        }
    }
}
