//! Rooms with panes and mirrors: relit they are what a bake of the changed room finds.

use super::{Cached, estimate, room, settings, with};
use glam::DVec3;
use haarlight::color::de2000;
use haarlight::gather::Baked;
use haarlight::gather::refined::position;
use haarlight::mesh::Limits;
use haarlight::scene::Scene;
use haarlight::solve::Bake;
use serde_json::{Value, json};

/// Triangles that are compared.
const COMPARED: usize = 300;
/// Where they are read: beside a vertex, where what is drawn between vertices is of no weight.
const BESIDE: [f64; 3] = [0.98, 0.01, 0.01];

/// A triangle of a baked mesh.
struct Drawn {
    area: f64,
    /// Beside its first corner.
    place: DVec3,
    normal: DVec3,
    surface: usize,
    corners: [u32; 3],
}

impl Drawn {
    /// Tristimulus irradiance there.
    fn read(&self, baked: &Baked) -> [f64; 3] {
        let vertices = &baked.surfaces[self.surface].vertices;
        let corners = self.corners.map(|v| vertices[v as usize].irradiance);
        [0, 1, 2].map(|c| (0..3).map(|k| BESIDE[k] * f64::from(corners[k][c])).sum())
    }
}

/// The largest triangles of a mesh.
fn largest(scene: &Scene, baked: &Baked) -> Vec<Drawn> {
    let mut all = Vec::new();
    for (surface, part) in baked.surfaces.iter().enumerate() {
        let input = &scene.surfaces[part.surface];
        all.extend(part.triangles.iter().map(|&corners| {
            let [a, b, c] = corners.map(|v| position(input, &part.vertices[v as usize]));
            let across = (b - a).cross(c - a);
            Drawn {
                area: across.length(),
                place: BESIDE[0] * a + BESIDE[1] * b + BESIDE[2] * c,
                normal: across.normalize_or_zero(),
                surface,
                corners,
            }
        }));
    }
    all.sort_by(|a, b| b.area.total_cmp(&a.area));
    all.truncate(COMPARED);
    all
}

/// Relights a room of which something is `said` and a `lamp` dimmed, and compares vertices with what a bake of the changed room finds beside them.
/// That vertices stand off their light is taken out by the bake of the room as it was. The colours differ by no more than both errors that are
/// stated allow, estimates being at least .7 of what is measured. Returns how far illuminances are apart in the mean.
fn relit_is_baked(name: &str, said: Value, lamp: &str, error: f64) -> f64 {
    // Few vertices have 300 triangles, too.
    let limits = Limits {
        vertices: Some(4000),
        ..Limits::default()
    };
    let cached = Cached::within(&limits, room(name), settings(error, 12));
    let mut scene = with(name, said);
    scene.dim(lamp, 0.3).unwrap();
    let (_, relit) = cached.relit(scene.clone());
    let mut fresh = Bake::new(scene, settings(error, 12));
    fresh.run();
    let places = largest(cached.bake.scene(), &cached.baked);
    let points: Vec<(DVec3, DVec3)> = places.iter().map(|p| (p.place, p.normal)).collect();
    let found = cached
        .bake
        .probe(&points)
        .into_iter()
        .zip(fresh.probe(&points));
    let white = fresh.light().white;
    let [
        mut apart,
        mut moved,
        mut lux,
        mut off,
        mut bias,
        mut compared,
    ] = [0.0; 6];
    for (place, (full, now)) in places.iter().zip(found) {
        let [was, shown] = [&cached.baked, &relit.baked].map(|baked| place.read(baked));
        // Where something covers a vertex it has its neighbours' light.
        if !(0.5..2.0).contains(&(was[1] / full.xyz[1])) {
            continue;
        }
        compared += 1.0;
        let want = [0, 1, 2].map(|c| was[c] * now.xyz[c] / full.xyz[c]);
        apart += de2000(shown, want, white);
        moved += de2000(was, want, white);
        lux += place.area * want[1];
        off += place.area * (shown[1] - want[1]).abs();
        bias += place.area * (shown[1] - want[1]);
    }
    let [apart, moved] = [apart / compared, moved / compared];
    let [off, bias] = [off / lux, bias / lux];
    let stated = [relit.record.error_de2000.value.unwrap(), estimate(&fresh)];
    println!(
        "{name}: {compared} compared, dE00 {apart:.3} apart, {moved:.2} moved, stated {stated:.3?}, off {off:.4}, bias {bias:+.4}"
    );
    assert!(4.0 * compared > 3.0 * COMPARED as f64, "{compared}");
    assert!(moved > 5.0 * apart, "{moved} moved, {apart} apart");
    assert!(
        0.7 * apart < stated[0].hypot(stated[1]),
        "{apart} of {stated:?}"
    );
    // Half a per cent at the default error of .5, as of a bake, and in proportion. All vertices look in the same directions, which err for the
    // light of lamps otherwise than for that of walls: with walls that turn from .7 to .1 the mirrored room is .6 % dark at 1, .5 % at .5, and
    // by points with directions of their own neither bake is off by more than .2 %.
    assert!(bias.abs() < 0.01 * error, "{name}: bias {bias}");
    off
}

#[test]
fn a_room_behind_panes_is_dimmed_as_it_is_baked() {
    // At 1 illuminances are .5 % apart.
    let off = relit_is_baked("glazed.glb", json!({}), "sun", 0.7);
    assert!(off < 0.012, "{off}");
}

/// The bulb stands before a mirror, and the walls are seen in all three.
#[test]
fn a_room_with_mirrors_is_changed_as_it_is_baked() {
    let blue = json!({"materials": {"walls": {"reflectance": {"name": "macbeth/blue"}}}});
    let off = relit_is_baked("mirrored.glb", blue, "bulb", 1.0);
    assert!(off < 0.025, "{off}");
}
