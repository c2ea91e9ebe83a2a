//! The page of a bake (`--report`): what the log says, gathered while it is written.

use super::log::{PlanRecord, RoundRecord, VerdictRecord};
use crate::audit;
use crate::error::{Error, Result};
use crate::gather::Baked;
use crate::output::BakedGlb;
use crate::report::page::{History, Page};
use crate::scene::Camera;
use crate::solve::Bake;
use crate::store::file;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::PathBuf;

/// A page in the making.
pub(super) struct PageBuilder {
    pub(super) path: PathBuf,
    plan: Value,
    rounds: Vec<Value>,
    history: History,
}

impl PageBuilder {
    pub(super) fn new(path: PathBuf, plan: &PlanRecord) -> Result<Self> {
        Ok(Self {
            path,
            plan: value(plan)?,
            rounds: Vec::new(),
            history: History::default(),
        })
    }

    /// A round is done.
    pub(super) fn note(&mut self, record: &RoundRecord) -> Result<()> {
        self.rounds.push(value(record)?);
        Ok(())
    }

    /// This is the light after the last.
    pub(super) fn see(&mut self, bake: &Bake) {
        self.history.note(bake);
    }

    /// The bake is over.
    pub(super) fn write(
        &self,
        verdict: &VerdictRecord,
        audit: Option<&audit::Report>,
        baked: &Baked,
        cameras: &[Camera],
        glb: &BakedGlb,
        bake: &Bake,
    ) -> Result<()> {
        let log = json!({
            "plan": self.plan,
            "rounds": self.rounds,
            "audit": value(&audit)?,
            "verdict": value(verdict)?,
        });
        let page = Page {
            bake,
            baked,
            cameras,
            glb: &glb.bytes,
            history: &self.history,
            log,
        };
        let html = page.html()?;
        let room = Some(bake.scene().source.path.as_path());
        file::write_atomic(&self.path, room, |w| w.write_all(html.as_bytes()))
    }
}

fn value(record: &(impl Serialize + ?Sized)) -> Result<Value> {
    serde_json::to_value(record).map_err(|problem| Error::Internal(format!("report: {problem}")))
}
