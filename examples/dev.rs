use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
fn cpu() -> f64 {
    let mut sum = 0.0;
    for t in std::fs::read_dir("/proc/self/task").unwrap() {
        let s = std::fs::read_to_string(t.unwrap().path().join("schedstat")).unwrap();
        sum += 1e-9 * s.split_whitespace().next().unwrap().parse::<f64>().unwrap();
    }
    sum
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scene = Scene::load(std::path::Path::new(&a[1]), &Options::default()).unwrap();
    let settings = Settings {
        error: a[2].parse().unwrap(),
        rounds: a.get(3).map_or(12, |r| r.parse().unwrap()),
        ..Settings::default()
    };
    let start = cpu();
    let mut bake = Bake::new(scene, settings);
    eprintln!("new {:.2}s closed {:?}", cpu() - start, bake.closed());
    loop {
        if let Some(v) = bake.verdict() {
            eprintln!("{v:?}");
            break;
        }
        let r = bake.step();
        let e = r.error.total_de2000.value;
        let f = &r.flux;
        let p: Vec<String> = r
            .phases_s
            .iter()
            .map(|(k, v)| format!("{k} {:.2}", v.as_f64().unwrap()))
            .collect();
        println!(
            "{} cpu {:.2} leaves {} links {} est {:?} em {:.1} rec {:.4} abs {:.4} esc {:.4} worst {:.4} | {}",
            r.round,
            cpu() - start,
            r.elements,
            r.links,
            e.map(|e| (e * 1000.0).round() / 1000.0),
            f.emitted_lm,
            f.received_lm / f.emitted_lm,
            f.absorbed_lm / f.emitted_lm,
            f.escaped_lm / f.emitted_lm,
            f.worst_band,
            p.join(" ")
        );
        println!("   {:?}", f).to_owned();
    }
}
