//! The edge of a shadow in a triangle, as found: where the triangle is split for it.

use crate::store::codec::Read;
use crate::store::{Broken, Decoder};
use crate::team::Packed;

/// A place on the edge of a cell where light ends: edge, share of the edge, weights of the corners of the triangle of the
/// mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EdgeCrossing {
    pub(super) edge: usize,
    pub(super) at: f64,
    pub(super) weights: [f64; 3],
}

/// An end of the edge of a shadow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Mark {
    Crossing(EdgeCrossing),
    Corner(usize),
    Inside([f64; 3]),
}

/// The edge of a shadow in a cell.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ShadowEdge {
    pub(super) inside: Option<[f64; 3]>,
    /// Lines with the lamps whose light ends along them.
    pub(super) lines: Vec<([Mark; 2], u64)>,
}

/// The result of searching a cell.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ShadowFinding {
    /// No light ends in the cell, or only gently.
    Even,
    Edge(ShadowEdge),
    /// Light ends there, but not along a line.
    Other,
}

impl Packed for Mark {
    fn pack(&self, to: &mut Vec<u8>) {
        match *self {
            Self::Crossing(c) => {
                (0_u8, c.edge as u64).pack(to);
                (c.at, c.weights).pack(to);
            }
            Self::Corner(corner) => (1_u8, corner as u64).pack(to),
            Self::Inside(weights) => (2_u8, weights).pack(to),
        }
    }

    fn unpack(from: &mut Decoder) -> Read<Self> {
        Ok(match from.get::<u8>()? {
            0 => Self::Crossing(EdgeCrossing {
                edge: from.get::<u64>()? as usize,
                at: from.get()?,
                weights: from.get()?,
            }),
            1 => Self::Corner(from.get::<u64>()? as usize),
            2 => Self::Inside(from.get()?),
            _ => return Err(Broken::new("is no mark")),
        })
    }
}

impl Packed for ShadowFinding {
    fn pack(&self, to: &mut Vec<u8>) {
        match self {
            Self::Even => 0_u8.pack(to),
            Self::Other => 1_u8.pack(to),
            Self::Edge(plan) => {
                (2_u8, plan.inside.is_some()).pack(to);
                plan.inside.unwrap_or_default().pack(to);
                (plan.lines.len() as u64).pack(to);
                for ([a, b], lamps) in &plan.lines {
                    a.pack(to);
                    b.pack(to);
                    lamps.pack(to);
                }
            }
        }
    }

    fn unpack(from: &mut Decoder) -> Read<Self> {
        Ok(match from.get::<u8>()? {
            0 => Self::Even,
            1 => Self::Other,
            2 => {
                let is_inside = bool::unpack(from)?;
                let inside = from.get()?;
                let count = from.get::<u64>()?;
                let line = |_| Ok(([Mark::unpack(from)?, Mark::unpack(from)?], from.get()?));
                Self::Edge(ShadowEdge {
                    inside: is_inside.then_some(inside),
                    lines: (0..count).map(line).collect::<Read<_>>()?,
                })
            }
            _ => return Err(Broken::new("is nothing that is found")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_found_is_told_whole() {
        let crossing = Mark::Crossing(EdgeCrossing {
            edge: 2,
            at: 0.25,
            weights: [0.75, 0.0, 0.25],
        });
        let inside = [0.2, 0.3, 0.5];
        let lines = vec![
            ([crossing, Mark::Corner(1)], 5),
            ([Mark::Inside(inside), crossing], 1 << 63),
        ];
        let plan = |inside| {
            ShadowFinding::Edge(ShadowEdge {
                inside,
                lines: lines.clone(),
            })
        };
        for found in [
            ShadowFinding::Even,
            ShadowFinding::Other,
            plan(None),
            plan(Some(inside)),
        ] {
            let mut bytes = Vec::new();
            found.pack(&mut bytes);
            let mut from = Decoder::new(&bytes);
            assert_eq!(ShadowFinding::unpack(&mut from).unwrap(), found);
            from.end().unwrap();
        }
    }
}
