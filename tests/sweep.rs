//! A sweep over errors and ways to carry spectra. It measures the CPU time of its process, in which nothing else may run.

use haarlight::cost::{Knob, Sweep, choose};
use haarlight::scene::{Options, Scene};
use haarlight::solve::Representation;
use std::path::Path;

#[test]
fn a_sweep_chooses_the_cheapest_within_the_goal() {
    let sweep = Sweep {
        errors: vec![4.0, 1.0],
        representations: vec![Representation::Adaptive, Representation::Rgb],
        points: 40,
        repeats: 1,
        knob: Knob::LeftOut,
        seed: 0,
    };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-f2.glb");
    let room = Scene::load(path, &Options::default()).unwrap();
    let study = sweep.run(&room, &|_, _, _| {});
    assert_eq!(study.runs.len(), 4);
    for run in &study.runs {
        let phases: f64 = run.phases_s.iter().map(|p| p.1).sum();
        assert!(phases <= run.cpu_s && phases > 0.5 * run.cpu_s, "{run:?}");
    }
    let within = |goal: f64| choose(&study, goal).run.unwrap();
    let least = |goal: f64| {
        study
            .runs
            .iter()
            .filter(|r| r.de2000.value <= goal)
            .map(|r| r.cpu_s)
            .fold(f64::INFINITY, f64::min)
    };
    // Spectra that know their error may cost a little more than those that do not.
    for goal in [1.2, 3.0] {
        assert!(within(goal).cpu_s <= 1.15 * least(goal), "{goal}");
        assert!(within(goal).de2000.value <= goal);
    }
    // Out of reach: the most accurate, and it is said.
    let none = choose(&study, 1e-6);
    assert!(none.why[0].starts_with("No bake came within"), "{none:?}");
}
