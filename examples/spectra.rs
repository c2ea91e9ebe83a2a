//! Adaptive spectra by themselves: light of a fluorescent tube on orange paint, in as few intervals as the eye allows.
//!
//! `cargo run --release --example spectra`

use haarlight::color::{Observer, de_luv, luv_jacobian, normalization, tristimulus};
use haarlight::data::{Outside, named};
use haarlight::spectrum::{
    CmfTree, Control, Grid, List, Metric, Path, SpectralTree, control, represent,
};

fn main() {
    let grid = Grid::default();
    let cmf = CmfTree::new(Observer::cie1931().weights(&grid));
    let table = |name: &str| named(name).expect("a built-in spectrum").table;
    let light = grid.means(&table("cie/F11"), Outside::Zero);
    let k = normalization(&light, cmf.weights());
    let light = light.map(|s| k * s);
    let white = tristimulus(&light, cmf.weights());
    let paint = grid.means(&table("macbeth/orange"), Outside::Hold);
    let (source, material) = (
        SpectralTree::new(&light, &cmf),
        SpectralTree::new(&paint, &cmf),
    );
    let path = Path {
        source: &source,
        reflections: &[&material],
    };
    let exact = tristimulus(&path.spectrum(), cmf.weights());
    println!("asked for  intervals  dE*uv");
    for asked in [4.0, 2.0, 1.0, 0.5, 0.25] {
        let list = represent(
            &source,
            &cmf,
            &Metric::Luv(luv_jacobian(white, white)),
            asked,
        );
        let mut reflected = List::black();
        list.reflect(&material, &cmf, &mut reflected);
        let metric = Metric::Luv(luv_jacobian(reflected.corrected_xyz(&cmf), white));
        control(
            &mut reflected,
            &path,
            &cmf,
            &metric,
            &Control::within(asked),
        );
        let error = de_luv(exact, reflected.corrected_xyz(&cmf), white);
        println!(
            "{asked:9.2}  {:9}  {error:.3}",
            reflected.partition().count()
        );
    }
}
