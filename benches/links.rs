//! What does a link cost? Links a second while a room is refined, one thread, beside what the bare ray index answers on
//! segments between random points of the same room.
//!
//! `cargo bench --bench links`

use haarlight::geometry::Segment;
use haarlight::geometry::sampling::{Pcg, triangle_weights};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use std::path::Path;
use std::time::Instant;

/// Rooms, and rounds of each.
const ROOMS: [(&str, usize); 3] = [("cornell-f2", 4), ("two-rooms", 3), ("furnished", 2)];
/// Segments for the bare index.
const RAYS: usize = 1 << 18;

/// Segments between random points of faces, by area.
fn segments(bake: &Bake) -> Vec<Segment> {
    let tree = bake.tree();
    let mut rng = Pcg::new(5);
    let total = tree.face_area.last().copied().unwrap_or(0.0);
    let mut end = || {
        let target = rng.f64() * total;
        let entry = tree.face_area.partition_point(|&a| a <= target).max(1) - 1;
        let entry = entry.min(tree.faces.len() - 1);
        let element = &tree.elements[tree.node(tree.face_node[entry]).element as usize];
        let weights = triangle_weights([rng.f64(), rng.f64()]);
        (element.at(weights).as_vec3(), tree.face_plane[entry])
    };
    (0..RAYS)
        .map(|_| {
            let ((from, a), (to, b)) = (end(), end());
            Segment {
                from,
                to,
                planes: [a, b],
            }
        })
        .collect()
}

fn measure(room: &str, rounds: usize) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(format!("{room}.glb"));
    let scene = match Scene::load(&path, &Options::default()) {
        Ok(scene) => scene,
        Err(problem) => return eprintln!("{room}: {problem}"),
    };
    let mut bake = Bake::new(scene, Settings::default());
    let (mut seconds, mut evaluated) = (0.0, 0);
    for _ in 0..rounds {
        let round = bake.step();
        seconds += round
            .phases_s
            .get("links")
            .and_then(serde_json::Value::as_f64)
            .unwrap_or(0.0);
        evaluated += round.links_evaluated;
    }
    let links = bake.rounds().last().map_or(0, |r| r.links);
    let clear = bake.rounds().last().map_or(0, |r| r.links_clear);
    let wild = segments(&bake);
    let mut out = vec![false; wild.len()];
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        bake.rays().occluded_many(&wild, &mut out);
        best = best.min(start.elapsed().as_secs_f64());
    }
    let (link_us, ray_us) = (
        1e6 * seconds / evaluated as f64,
        1e6 * best / wild.len() as f64,
    );
    println!(
        "{room:<12} {links:>8} {:>5.0} % {:>11.0} {link_us:>9.2} {:>10.2} {ray_us:>9.3} {:>14.1}",
        100.0 * clear as f64 / links.max(1) as f64,
        evaluated as f64 / seconds,
        1e-6 / (1e-6 * ray_us),
        link_us / ray_us
    );
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let Ok(pool) = pool else { return };
    println!(
        "one thread; a link is evaluated with its visibility, a ray is an occlusion query of the bare index"
    );
    println!(
        "room            links  clear   links/s   us a link    Mrays/s  us a ray  rays for a link"
    );
    let short = std::env::args().any(|a| a == "--test" || a == "test");
    for (room, rounds) in ROOMS {
        pool.install(|| measure(room, if short { 1 } else { rounds }));
    }
}
