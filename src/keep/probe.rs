//! Light at points of a relit room: the bake that was kept says where it comes from, the relit solution how much there is.

use super::Relighter;
use crate::error::{Error, Result};
use crate::gather::Probed;
use crate::solve::Bake;
use crate::store::codec::Read;
use crate::store::{Broken, FileKind};
use crate::transport::trace::{self, Stains};
use glam::DVec3;

impl Bake {
    /// Irradiance by lane of a packed trace under the present light; dark where there is none.
    pub(super) fn replayed(&self, packed: Option<&[u8]>, stains: &Stains) -> Read<[f32; 64]> {
        let Some(packed) = packed else {
            return Ok([0.0; 64]);
        };
        let (light, lamps) = (self.light(), self.lamps());
        let mut row = [0.0; 64];
        match light.width() {
            4 => row[..4].copy_from_slice(&trace::replay::<4>(packed, light, lamps, stains)?),
            8 => row[..8].copy_from_slice(&trace::replay::<8>(packed, light, lamps, stains)?),
            16 => row[..16].copy_from_slice(&trace::replay::<16>(packed, light, lamps, stains)?),
            32 => row[..32].copy_from_slice(&trace::replay::<32>(packed, light, lamps, stains)?),
            _ => row = trace::replay::<64>(packed, light, lamps, stains)?,
        }
        Ok(row)
    }
}

impl Relighter {
    /// Irradiance at points (world space, unit normals) under the light of the last [`Relighter::relight`]. A cache holds no
    /// rays: `bake` is the bake that it was written of, which looks from the points.
    ///
    /// ```
    /// use glam::DVec3;
    /// use haarlight::keep::Relighter;
    /// use haarlight::scene::{Options, Scene};
    /// use haarlight::solve::{Bake, Settings};
    /// let room = Scene::load("scenes/convex.glb", &Options::default())?;
    /// let mut bake = Bake::new(room.clone(), Settings { error: 2.0, ..Settings::default() });
    /// bake.keep();
    /// bake.run();
    /// let cache = std::env::temp_dir().join(format!("haarlight-probe-{}.cache", std::process::id()));
    /// bake.write_cache(&bake.baked(&|_, _| {}), &cache, u64::MAX)?;
    ///
    /// let mut dimmed = room.clone();
    /// let lamp = haarlight::scene::facts::Facts::of(&room).lights[0].name.clone();
    /// dimmed.dim(&lamp, 0.5)?;
    /// let mut relighter = Relighter::open(&cache, room)?;
    /// relighter.change(dimmed)?;
    /// relighter.relight()?;
    /// let points = [(bake.mesh().centre, DVec3::Y)];
    /// let (half, whole) = (relighter.probe(&bake, &points)?, bake.probe(&points));
    /// assert!((half[0].xyz[1] / whole[0].xyz[1] - 0.5).abs() < 1e-3);
    /// # std::fs::remove_file(&cache).unwrap();
    /// # Ok::<(), haarlight::Error>(())
    /// ```
    ///
    /// # Errors
    /// `bake` kept nothing, or is not the one that the cache was written of.
    pub fn probe(&self, bake: &Bake, points: &[(DVec3, DVec3)]) -> Result<Vec<Probed>> {
        let other = |what: String| {
            let next = "give the bake that wrote the cache, which was told to keep";
            Error::input("the bake of the points", what, next)
        };
        if !bake.keeps() || bake.tree().nodes.len() != self.bake().tree().nodes.len() {
            return Err(other("is not the one that the cache was written of".into()));
        }
        let lit = self.bake();
        let gathered = bake.gather_at(points);
        let stains = Stains::new(&lit.solution.filters);
        let probed = gathered.into_iter().map(|found| {
            let row = lit.replayed(found.packed.as_deref(), &stains)?;
            Ok(Probed {
                xyz: lit.lanes().tristimulus(&row),
                spectrum: lit.lanes().spectrum(&row),
                backs: found.backs,
            })
        });
        let probed: Read<Vec<Probed>> = probed.collect();
        probed.map_err(|Broken(what)| other(format!("{what}: {}", FileKind::Cache.next())))
    }
}
