//! The spectrum of the light at points of a picture, and how wrong it may be there.

use crate::light::lanes::Lanes;
use crate::spectrum::{BANDS, Spectrum};

/// Irradiance of the vertices of a picture by lanes.
#[derive(Debug)]
pub(super) struct VertexSpectra {
    lanes: Lanes,
    rows: VertexRows,
    error: Option<ColourError>,
}

/// Whose rows they are.
#[derive(Debug)]
enum VertexRows {
    /// One for each vertex of each part.
    Own(Vec<Vec<[f32; BANDS]>>),
    /// Vertices that lie together share one: for each part, which.
    Shared(Vec<[f32; BANDS]>, Vec<Vec<u32>>),
}

/// Mean colour difference, an estimate.
#[derive(Debug, Clone)]
pub(super) struct ColourError {
    /// Of the room, CIEDE2000.
    pub(super) mean: f64,
    /// At each vertex of each part over the mean; empty where only that is known.
    pub(super) share: std::sync::Arc<[Vec<f32>]>,
}

/// The light at a point.
#[derive(Debug)]
pub(super) struct PointReading {
    /// Irradiance, W/m2/nm.
    pub(super) spectrum: Spectrum,
    /// Tristimulus irradiance; Y is illuminance, lx.
    pub(super) xyz: [f64; 3],
    /// Colour difference (CIEDE2000), an estimate; at this very point, or in the mean of the room?
    pub(super) error: Option<(f64, bool)>,
}

impl VertexSpectra {
    /// Rows of each vertex of the parts.
    pub(super) fn own(
        lanes: &Lanes,
        parts: Vec<Vec<[f32; BANDS]>>,
        error: Option<ColourError>,
    ) -> Self {
        let (lanes, rows) = (lanes.clone(), VertexRows::Own(parts));
        Self { lanes, rows, error }
    }

    /// Rows that vertices share; `of`: which of them each vertex of the parts has.
    pub(super) fn shared(lanes: &Lanes, rows: Vec<[f32; BANDS]>, of: Vec<Vec<u32>>) -> Self {
        Self {
            lanes: lanes.clone(),
            rows: VertexRows::Shared(rows, of),
            error: None,
        }
    }

    /// The same with an error that is known for the room as a whole.
    pub(super) fn with_mean(self, mean: Option<f64>) -> Self {
        let error = mean.map(|mean| ColourError {
            mean,
            share: [].into(),
        });
        Self { error, ..self }
    }

    /// The light between vertices of a part; none where there are no such vertices.
    pub(super) fn at(
        &self,
        part: usize,
        vertices: [usize; 3],
        weights: [f64; 3],
    ) -> Option<PointReading> {
        let row = |vertex: usize| match &self.rows {
            VertexRows::Own(parts) => parts.get(part)?.get(vertex),
            VertexRows::Shared(rows, of) => rows.get(*of.get(part)?.get(vertex)? as usize),
        };
        let mut mixed = [0.0; BANDS];
        for (vertex, weight) in vertices.into_iter().zip(weights) {
            let row = row(vertex)?;
            let pairs = mixed.iter_mut().zip(row);
            pairs.for_each(|(sum, x)| *sum += weight as f32 * x);
        }
        let error = self
            .error
            .as_ref()
            .map(|error| match error.share.get(part) {
                Some(share) => {
                    let pairs = vertices.into_iter().zip(weights);
                    let own = pairs.map(|(v, w)| w * share.get(v).copied().map_or(1.0, f64::from));
                    (error.mean * own.sum::<f64>(), true)
                }
                None => (error.mean, false),
            });
        Some(PointReading {
            spectrum: self.lanes.spectrum(&mixed),
            xyz: self.lanes.tristimulus(&mixed),
            error,
        })
    }
}
