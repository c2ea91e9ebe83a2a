use haarlight::scene::*;
use haarlight::solve::*;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let error: f64 = std::env::args().nth(2).and_then(|x| x.parse().ok()).unwrap_or(0.5);
    let t = std::time::Instant::now();
    let scene = Scene::load(&path, &Options::default()).unwrap();
    println!("load {:?} lights {} spectra {}", t.elapsed(), scene.lights.len(), scene.spectra.len());
    let mut bake = Bake::new(scene, Settings { error, ..Settings::default() });
    println!("new {:?} {:?} faces {} nodes {}", t.elapsed(), bake.closed(), bake.tree().faces.len(), bake.tree().nodes.len());
    while bake.verdict().is_none() {
        let r = bake.step().clone();
        println!("{} el {} ln {} clear {} lanes {} it {} de {:.3?} rel {:.4?} sp {:.3?} defect {:.4?} flux {:?} t {:.3} {} rays {} mem {}", r.round, r.elements, r.links, r.links_clear, r.intervals_working, r.iterations, r.error.total_de2000.value, r.error.total_relative.value, r.error.spectrum_de_luv.value, r.row_sum_defect, r.flux, r.elapsed_s, serde_json::to_string(&r.phases_s).unwrap(), r.rays, r.memory_bytes / 1000000);
    }
    println!("{:?}", bake.verdict());
    let t = std::time::Instant::now();
    let baked = bake.baked(&|_, _| {});
    println!("mesh {:?} vertices {} triangles {} covered {} capped {}", t.elapsed(), baked.surfaces.iter().map(|s| s.vertices.len()).sum::<usize>(), baked.surfaces.iter().map(|s| s.triangles.len()).sum::<usize>(), baked.covered, baked.capped);
    let look = haarlight::output::Exposure::auto(bake.scene(), &baked.surfaces);
    for c in haarlight::output::camera::cameras(bake.scene()) {
        let p = haarlight::output::Picture::draw(bake.scene(), &baked.surfaces, &c, &look, Default::default()).unwrap();
        std::fs::write(format!("/tmp/pic_{}.png", c.name.replace(' ', "_").replace('/', "_")), p.to_png().unwrap()).unwrap();
        println!("camera {}", c.name);
    }
}
