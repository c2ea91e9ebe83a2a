//! Bakes light into glTF rooms in full spectrum, by progressive hierarchical radiosity.
//!
//! ```
//! use haarlight::scene::{Options, Scene};
//! use haarlight::solve::{Bake, Settings, Verdict};
//! use glam::DVec3;
//!
//! let room = Scene::load("scenes/convex.glb", &Options::default())?;
//! let mut bake = Bake::new(room, Settings { error: 2.0, ..Settings::default() });
//! // Every step leaves a whole solution and a record of what it cost and how wrong it still is.
//! assert_eq!(bake.run(), Verdict::Reached);
//! let centre = bake.mesh().centre;
//! let lux = bake.probe(&[(centre, DVec3::Y)])[0].xyz[1];
//! assert!(lux > 0.0);
//! # Ok::<(), haarlight::Error>(())
//! ```
//!
//! The chain: [`data`] -> [`color`] -> [`spectrum`] -> [`scene`] -> [`geometry`] -> [`hierarchy`] -> [`team`] -> [`link`] -> [`light`] ->
//! [`transport`] -> [`solve`] -> [`gather`] -> [`mesh`], [`lightmap`] -> [`keep`] -> [`output`] and [`report`], with [`audit`] beside it and
//! [`cost`] and [`serve`] behind; [`survey`] looks at a room before [`solve`]. A module uses what stands to its left.
//!
//! | Rougeron and Peroche 1997 | module |
//! |---|---|
//! | 2 other methods | [`spectrum::methods`] |
//! | 3.1 trees, source | [`spectrum`]: `tree`, `source` |
//! | 3.2 product, refine, merge | [`spectrum`]: `product`, `control` |
//! | 4 tests | [`cli::paper`] |
//! | 5 the neglected term | [`spectrum`]: `bound`, `sum` |

pub mod audit;
#[cfg(feature = "cli")]
pub mod cli;
pub mod color;
#[cfg(feature = "paper")]
pub mod cost;
pub mod data;
pub mod error;
pub mod gather;
pub mod geometry;
pub mod hierarchy;
pub mod keep;
pub mod light;
pub mod lightmap;
pub mod link;
pub mod mesh;
pub mod output;
pub mod report;
pub mod scene;
#[cfg(feature = "cli")]
pub mod serve;
pub mod solve;
pub mod spectrum;
pub mod store;
pub mod survey;
pub mod team;
pub mod transport;

pub use error::{Error, Problem, Result};
pub use glam;

/// Name and version of the program.
pub const PROGRAM: &str = concat!("haarlight ", env!("CARGO_PKG_VERSION"));
