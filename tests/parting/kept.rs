//! Layers in files for NumPy and in caches.

use super::{FURNISHED, TWO_LAMPS, glanced, haarlight, layers, scenes, sums_up, two_lamps};
use crate::common::every_effect::small;
use haarlight::gather::{Baked, BakedSurface};
use haarlight::keep::Relighter;
use haarlight::output::npz;
use haarlight::scene::effects::EffectKind;

/// Spectra of the layers add up to those of the whole; they are in the file under the names that it says.
#[test]
fn spectra_of_layers_add_up() {
    // What fluoresces gives out light of every layer.
    let fluorescent = small(&[EffectKind::Sky, EffectKind::Fluorescence]);
    for (name, (bake, baked)) in [
        ("furnished", &*FURNISHED),
        ("fluorescent", &glanced(fluorescent)),
    ] {
        let whole = bake.radiosity_spectra(baked);
        let names = &layers(bake).names;
        let each: Vec<_> = (0..names.len())
            .map(|k| bake.layer_spectra(baked, k))
            .collect();
        let (mut worst, mut most) = (0.0_f64, 0.0_f64);
        for (s, spectra) in whole.iter().enumerate() {
            for (v, spectrum) in spectra.iter().enumerate() {
                for (k, x) in spectrum.iter().enumerate() {
                    let sum: f64 = each.iter().map(|layer| f64::from(layer[s][v][k])).sum();
                    worst = worst.max((sum - f64::from(*x)).abs());
                    most = most.max(f64::from(*x));
                }
            }
        }
        assert!(
            names.len() > 1 && worst <= 1e-6 * most,
            "{name}: {worst} of {most}"
        );
        assert!(bake.layer_spectra(baked, names.len()).is_empty());
        let mut file = Vec::new();
        let layer = |k: usize| each[k].clone();
        let parts: npz::LayerSpectra = (names, &layer);
        npz::write_parted(&mut file, bake.scene(), &baked.surfaces, &whole, parts).unwrap();
        let has = |text: &str| file.windows(text.len()).any(|w| w == text.as_bytes());
        assert!(has("layers.npy") && !has(&format!("radiosity_{}.npy", names.len())));
        for (k, layer) in each.iter().enumerate() {
            assert!(has(&format!("radiosity_{k}.npy")));
            let first: Vec<u8> = layer[0][0].iter().flat_map(|x| x.to_le_bytes()).collect();
            assert!(file.windows(first.len()).any(|w| w == first), "{k}");
        }
    }
}

/// All numbers of a layer.
fn layer(surfaces: &[BakedSurface], k: usize) -> impl Iterator<Item = f64> + '_ {
    let all = surfaces
        .iter()
        .flat_map(move |s| s.layers[k].iter().flatten());
    all.map(|x| f64::from(*x))
}

/// Relit without a change layers are what they were; with one lamp dimmed its layer is dimmed and the others stay; with one out there is
/// one less.
#[test]
fn layers_are_relit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cache");
    let (bake, baked) = &*TWO_LAMPS;
    bake.write_cache(baked, &path, u64::MAX).unwrap();
    let mut relighter = Relighter::open(&path, two_lamps()).unwrap();
    let same = relighter.relight().unwrap();
    assert!(!same.record.changed);
    sums_up(relighter.bake(), &same.baked, "relit");
    let count = layers(bake).names.len();
    for k in 0..count {
        let most = layer(&baked.surfaces, k).fold(0.0, f64::max);
        let both = layer(&baked.surfaces, k).zip(layer(&same.baked.surfaces, k));
        both.for_each(|(a, b)| assert!((a - b).abs() <= 2e-5 * most, "{k}: {a} {b}"));
    }

    let name = layers(bake).names[1].clone();
    let mut dimmed = two_lamps();
    dimmed.dim(&name, 0.5).unwrap();
    relighter.change(dimmed).unwrap();
    let relit = relighter.relight().unwrap();
    assert!(relit.record.changed);
    sums_up(relighter.bake(), &relit.baked, "dimmed");
    for k in 0..count {
        let share = if k == 1 { 0.5 } else { 1.0 };
        let sum = |baked: &Baked| layer(&baked.surfaces, k).sum::<f64>();
        let ratio = sum(&relit.baked) / (share * sum(baked));
        assert!((ratio - 1.0).abs() < 0.01, "{k}: {ratio}");
    }

    let mut out = two_lamps();
    for material in &mut out.materials {
        material.emission = None;
    }
    let mut relighter = Relighter::open(&path, out).unwrap();
    let relit = relighter.relight().unwrap();
    assert_eq!(layers(relighter.bake()).names, ["light 0"]);
    sums_up(relighter.bake(), &relit.baked, "one lamp");
    let before = layer(&baked.surfaces, 2).sum::<f64>();
    let ratio = layer(&relit.baked.surfaces, 0).sum::<f64>() / before;
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
}

#[test]
fn the_command_relights_layers() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let room = scenes().join("two-rooms.glb");
    let room = room.to_str().unwrap();
    let cache = format!("--cache={}", at("cache"));
    let (first, npz) = (at("first.glb"), at("first.npz"));
    let bake = [
        "bake",
        room,
        "-o",
        &first,
        "--error=3",
        "--layers",
        &cache,
        "--npz",
        &npz,
    ];
    let done = haarlight(&bake);
    assert!(done.status.code().unwrap() < 2, "{done:?}");
    let again = at("again.glb");
    let (more, npz_again) = (at("again.npz"), "--npz");
    let done = haarlight(&["relight", room, "-o", &again, &cache, npz_again, &more]);
    assert_eq!(done.status.code(), Some(0), "{done:?}");
    let read = |path: &str| std::fs::read(path).unwrap();
    let (a, b) = (read(&first), read(&again));
    // Errors that are said may have a digit more or less; vertices may not.
    let text = |file: &[u8]| u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
    assert_eq!(a.len() - text(&a), b.len() - text(&b));
    let named = |file: &[u8]| {
        let length = text(file);
        let json: serde_json::Value = serde_json::from_slice(&file[20..20 + length]).unwrap();
        json["asset"]["extras"]["haarlight"]["layers"]["names"].clone()
    };
    assert!(named(&a).is_array() && named(&a) == named(&b));
    // The first vertices' spectra under the last layer, behind its name and a header of 128 bytes.
    let spectra = |path: &str| -> Vec<f32> {
        let file = read(path);
        let name = b"radiosity_1.npy";
        let at = file.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 128;
        let floats = file[at..at + 4 * 64 * 50].chunks(4);
        floats
            .map(|x| f32::from_le_bytes(x.try_into().unwrap()))
            .collect()
    };
    let (a, b) = (spectra(&npz), spectra(&more));
    let most = a.iter().fold(0.0_f32, |m, x| m.max(*x));
    assert!(most > 0.0 && most < 1e3, "{most}");
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-4 * most));
    assert_eq!(read(&npz).len(), read(&more).len());
}
