//! What a bake knows, or the same room under other lamps.

use crate::data::Data;
use glam::DVec3;
use haarlight::audit::{self, PathReference};
use haarlight::gather::{Baked, BakedSurface, Probed};
use haarlight::keep::{self, Relighter};
use haarlight::scene::Scene;
use haarlight::solve::{Bake, Verdict};
use haarlight::spectrum::BANDS;
use haarlight::{Error, Result};
use std::sync::{Arc, Mutex, PoisonError};
use tempfile::TempPath;

/// Distinguishes the audit's random numbers from the solver's, as the command does.
const AUDIT_SEED: u64 = 0x5eed_a0d1;
/// Paths a point of an audit at the most, as of the command.
const AUDIT_PATHS: usize = 65_536;

/// A bake that has ended.
pub(crate) struct Solved {
    pub(crate) data: Arc<Data>,
    pub(crate) bake: Bake,
    /// None where no mesh was asked for.
    pub(crate) baked: Option<Baked>,
    pub(crate) verdict: Verdict,
    /// What relighting needs, once it was asked for.
    pub(crate) cache: Mutex<Option<TempPath>>,
}

/// The same room under other lamps.
pub(crate) struct Other {
    pub(crate) data: Arc<Data>,
    pub(crate) relighter: Relighter,
    pub(crate) relit: keep::Relit,
}

/// The light of a room.
pub(crate) struct Light {
    pub(crate) solved: Arc<Solved>,
    pub(crate) other: Option<Other>,
}

impl Light {
    pub(crate) fn data(&self) -> &Arc<Data> {
        self.other.as_ref().map_or(&self.solved.data, |o| &o.data)
    }

    pub(crate) fn scene(&self) -> &Scene {
        let solved = self.solved.bake.scene();
        self.other.as_ref().map_or(solved, |o| o.relighter.scene())
    }

    /// The mesh with its light.
    pub(crate) fn baked(&self) -> Option<&Baked> {
        let solved = self.solved.baked.as_ref()?;
        Some(self.other.as_ref().map_or(solved, |o| &o.relit.baked))
    }

    pub(crate) fn surfaces(&self) -> &[BakedSurface] {
        self.baked().map_or(&[], |baked| &baked.surfaces)
    }

    /// Tristimulus irradiance of the adaptation white, lm/m2.
    pub(crate) fn white(&self) -> [f64; 3] {
        let solved = self.solved.bake.light();
        self.other
            .as_ref()
            .map_or(solved, |o| o.relighter.light())
            .white
    }

    /// Radiosity of all vertices on the bands, W/m2/nm.
    pub(crate) fn radiosity(&self) -> Vec<Vec<[f32; BANDS]>> {
        match (&self.other, self.baked()) {
            (_, None) => Vec::new(),
            (None, Some(baked)) => self.solved.bake.radiosity_spectra(baked),
            (Some(other), Some(baked)) => other.relighter.radiosity_spectra(baked),
        }
    }

    /// Mean colour difference (CIEDE2000), an estimate.
    pub(crate) fn error(&self) -> Option<f64> {
        let bake = &self.solved.bake;
        match (&self.other, self.baked()) {
            (Some(other), _) => other.relit.record.error_de2000.value,
            (None, Some(baked)) => bake.error_of(baked),
            (None, None) => bake.rounds().last()?.error.total_de2000.value,
        }
    }

    /// Root mean square relative error of illuminance at points, an estimate: of the last round; after relighting as much
    /// more (or less) as the colour difference is.
    pub(crate) fn relative_error(&self) -> Option<f64> {
        let last = &self.solved.bake.rounds().last()?.error;
        let relative = last.total_relative.value?;
        let Some(other) = &self.other else {
            return Some(relative);
        };
        let before = last.total_de2000.value.filter(|before| *before > 0.0)?;
        Some(relative * other.relit.record.error_de2000.value? / before)
    }

    /// Light at points, in the file's units.
    pub(crate) fn probe(&self, points: &[(DVec3, DVec3)]) -> Result<Vec<Probed>> {
        let points = self.metres(points);
        match &self.other {
            None => Ok(self.solved.bake.probe(&points)),
            Some(other) => other.relighter.probe(&self.solved.bake, &points),
        }
    }

    /// Points in metres.
    pub(crate) fn metres(&self, points: &[(DVec3, DVec3)]) -> Vec<(DVec3, DVec3)> {
        let scale = self.scene().changes.scale;
        points.iter().map(|&(p, n)| (scale * p, n)).collect()
    }

    /// The measured error.
    pub(crate) fn audit(&self, points: usize, seed: u64) -> Result<audit::Report> {
        if self.other.is_some() {
            return Err(Error::input(
                "audit",
                "a relit room has no rays to be audited with",
                "bake it: result.room.bake(...).audit(...)",
            ));
        }
        let bake = &self.solved.bake;
        let reference = PathReference::new(bake, points, AUDIT_PATHS, seed ^ AUDIT_SEED);
        Ok(match self.baked() {
            Some(baked) => audit::Report::of_file(bake, baked, &reference),
            None => audit::Report::against(bake, &reference),
        })
    }

    /// The same room under other lamps and paints.
    pub(crate) fn relight(&self, data: Arc<Data>) -> Result<Other> {
        let solved = &self.solved;
        if !solved.bake.keeps() {
            return Err(Error::input(
                "relight",
                "the bake kept nothing of where light comes from",
                "bake with keep=True",
            ));
        }
        let mut cache = solved.cache.lock().unwrap_or_else(PoisonError::into_inner);
        if cache.is_none() {
            let none = Baked::default();
            let baked = solved.baked.as_ref().unwrap_or(&none);
            let file = tempfile::Builder::new()
                .prefix("haarlight-")
                .suffix(".cache")
                .tempfile()
                .map_err(|problem| Error::io(&std::env::temp_dir(), problem))?;
            let path = file.into_temp_path();
            solved.bake.write_cache(baked, &path, u64::MAX)?;
            *cache = Some(path);
        }
        let Some(path) = &*cache else {
            return Err(Error::Internal("a cache that is not there".into()));
        };
        let mut relighter = Relighter::open(path, solved.data.scene.clone())?;
        relighter.change(data.scene.clone())?;
        let relit = relighter.relight()?;
        Ok(Other {
            data,
            relighter,
            relit,
        })
    }
}
