//! A point that receives light, and the light it receives.

use super::trace::Trace;
use crate::store::Decoder;
use crate::store::codec::Read;
use crate::team::Packed;
use glam::DVec3;

/// A vertex of whose rays more than this share meet black backs lies inside something.
pub const MOSTLY: f64 = 0.75;

/// Where light is received.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// The point, recentred.
    pub point: DVec3,
    /// Unit normal for the cosine.
    pub normal: DVec3,
    /// Plane of the face that the point lies on; [`NO_PLANE`](crate::geometry::NO_PLANE) for a point in the air.
    pub plane: u32,
    /// Leaf of the hierarchy whose links are used; none: the whole room is searched.
    pub leaf: Option<u32>,
    /// Distinguishes sampling patterns.
    pub seed: u64,
}

impl Receiver {
    /// The same point on the other side of a sheet, whose leaf there is `behind`.
    pub(crate) fn turned(self, behind: u32) -> Self {
        Self {
            normal: -self.normal,
            leaf: Some(behind),
            ..self
        }
    }
}

/// Light at a point.
#[derive(Debug, Clone)]
pub struct Gathered {
    /// Irradiance by lane.
    pub irradiance: [f32; 64],
    /// Its part straight from lamps.
    pub direct: [f32; 64],
    /// Sum of visible factors: 1 in a closed room.
    pub seen: f64,
    /// Share of the rays over the hemisphere that met a black back; 0 where light is gathered by links.
    pub backs: f64,
    /// Visibility rays cast for this point.
    pub rays: u64,
    /// Where the light comes from, if kept; packed in the end.
    pub(crate) trace: Option<Trace>,
    pub(crate) packed: Option<Box<[u8]>>,
}

impl Gathered {
    /// No light, nothing seen.
    pub(crate) fn dark() -> Self {
        Self {
            irradiance: [0.0; 64],
            direct: [0.0; 64],
            seen: 0.0,
            backs: 0.0,
            rays: 0,
            trace: None,
            packed: None,
        }
    }

    /// Packs the trace.
    pub(crate) fn pack(mut self) -> Self {
        self.packed = self.trace.take().map(Trace::pack);
        self
    }
}

/// Only a trace that is packed already is packed.
impl Packed for Gathered {
    fn pack(&self, to: &mut Vec<u8>) {
        self.irradiance.pack(to);
        self.direct.pack(to);
        [self.seen, self.backs].pack(to);
        self.rays.pack(to);
        self.packed.pack(to);
    }

    fn unpack(from: &mut Decoder) -> Read<Self> {
        let (irradiance, direct) = (from.get()?, from.get()?);
        let [seen, backs] = from.get()?;
        Ok(Self {
            irradiance,
            direct,
            seen,
            backs,
            rays: from.get()?,
            trace: None,
            packed: Packed::unpack(from)?,
        })
    }
}
