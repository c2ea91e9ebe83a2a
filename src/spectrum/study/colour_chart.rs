//! The data of the paper's tests (4.1): lights C, D65 and F2, and the 24 patches of the ColorChecker.
//!
//! Paper grid, bands take the value at their left edge, K = 1 / sum(S y_bar) is multiplied into the source.
//! The reflectances that the paper used are not published; two measured charts stand in for them.

use crate::color::{Observer, Xyz, normalization, tristimulus};
use crate::data::{Outside, Table, named};
use crate::spectrum::{CmfTree, Grid, Spectrum};

/// Which measurement of the chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Reflectances {
    /// Mean of 30 charts, 10 nm.
    #[default]
    Babelcolor,
    /// N. Ohta's, 5 nm.
    Ohta,
}

/// Names of the patches in chart order.
const PATCHES: [&str; 24] = [
    "dark_skin",
    "light_skin",
    "blue_sky",
    "foliage",
    "blue_flower",
    "bluish_green",
    "orange",
    "purplish_blue",
    "moderate_red",
    "purple",
    "yellow_green",
    "orange_yellow",
    "blue",
    "green",
    "red",
    "yellow",
    "magenta",
    "cyan",
    "white",
    "neutral_8",
    "neutral_6.5",
    "neutral_5",
    "neutral_3.5",
    "black",
];

/// Colour matching functions and reflectances.
#[derive(Debug, Clone)]
pub struct ColourChart {
    /// Colour matching functions on the paper's grid.
    pub cmf: CmfTree,
    /// The patches, in chart order.
    pub reflectances: Vec<Spectrum>,
}

/// A light whose Y is 1.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitLight {
    /// As in the tables.
    pub name: &'static str,
    /// K S on the bands.
    pub power: Spectrum,
    /// Its tristimulus values: the adaptation white of the tests.
    pub white: Xyz,
}

impl ColourChart {
    /// The chart as measured by `source`.
    pub fn new(source: Reflectances) -> Self {
        let grid = Grid::paper();
        let folder = match source {
            Reflectances::Babelcolor => "babelcolor",
            Reflectances::Ohta => "macbeth",
        };
        let patch =
            |name: &&str| grid.left_edges(&table(&format!("{folder}/{name}")), Outside::Hold);
        Self {
            cmf: CmfTree::new(Observer::cie1931().samples(&grid)),
            reflectances: PATCHES.iter().map(patch).collect(),
        }
    }

    /// One of the paper's lights, scaled so that its Y is 1.
    pub fn light(&self, name: &'static str) -> UnitLight {
        let power = Grid::paper().left_edges(&table(&format!("cie/{name}")), Outside::Zero);
        let k = normalization(&power, self.cmf.weights());
        let power = power.map(|s| k * s);
        UnitLight {
            name,
            power,
            white: tristimulus(&power, self.cmf.weights()),
        }
    }

    /// The three lights of Table 1.
    pub fn lights(&self) -> [UnitLight; 3] {
        ["C", "D65", "F2"].map(|name| self.light(name))
    }
}

fn table(name: &str) -> Table {
    named(name)
        .expect("the tables of the paper's tests are built in")
        .table
}
