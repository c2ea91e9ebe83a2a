//! Pages of layers as a program reads them: what is in the files adds up.

use super::{LACK, haarlight, scenes};
use crate::lightmaps::file::{Texels, listed};
use serde_json::Value;
use std::path::Path;

/// The KTX2 pages of a list: size, then linear sRGB, lx.
fn ktx2(folder: &Path, pages: &Value, unit: f64) -> Vec<Texels> {
    let read = |page: &Value| {
        let file = std::fs::read(folder.join(page["ktx2"].as_str().unwrap())).unwrap();
        let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap());
        // R32G32B32A32_SFLOAT, the one format of 32 bits a number that three.js' loader reads with these channels.
        assert_eq!([word(12), word(16)], [109, 4]);
        let (width, height) = (word(20) as usize, word(24) as usize);
        let (level, length) = (word(80) as usize, word(88) as usize);
        assert_eq!((level % 16, level + length), (0, file.len()));
        assert_eq!(length, 16 * width * height);
        // The descriptor: 16 bytes a texel, then four samples of 32 bits.
        let descriptor = word(48) as usize;
        assert_eq!(word(descriptor + 20), 16);
        for (k, channel) in [0, 1, 2, 15].into_iter().enumerate() {
            let sample = word(descriptor + 28 + 16 * k);
            let offset = 32 * k as u32;
            assert_eq!(sample, offset | (31 << 16) | ((channel | 0xc0) << 24));
        }
        let float = |at: usize| f64::from(f32::from_bits(word(at)));
        let texel = |t: usize| [0, 1, 2].map(|c| unit * float(level + 16 * t + 4 * c));
        Texels {
            width,
            height,
            rgb: (0..width * height).map(texel).collect(),
        }
    };
    pages.as_array().unwrap().iter().map(read).collect()
}

#[test]
fn pages_add_up_as_they_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let (room, out) = (scenes().join("two-rooms.glb"), folder.path().join("r.glb"));
    let [room, out] = [&room, &out].map(|p| p.to_str().unwrap());
    let maps = ["--light", "maps", "--texels", "20000", "--ktx2"];
    let bake = ["bake", room, "-o", out, "--error", "3", "--layers"];
    let done = haarlight(&[&bake[..], &maps].concat());
    assert!(done.status.code().unwrap() < 2, "{done:?}");
    let index = std::fs::read(folder.path().join("r.maps.json")).unwrap();
    let index: Value = serde_json::from_slice(&index).unwrap();
    let unit = index["lux_per_unit"].as_f64().unwrap();
    let layers = index["layers"].as_array().unwrap();
    assert_eq!(layers.len(), 2);
    for read in [listed, ktx2] {
        let whole = read(folder.path(), &index["pages"], unit);
        let mut sums: Vec<Vec<[f64; 3]>> = whole
            .iter()
            .map(|page| vec![[0.0; 3]; page.rgb.len()])
            .collect();
        for layer in layers {
            let pages = read(folder.path(), &layer["pages"], unit);
            for (sum, page) in sums
                .iter_mut()
                .flatten()
                .zip(pages.iter().flat_map(|p| &p.rgb))
            {
                *sum = [0, 1, 2].map(|c| sum[c] + page[c]);
            }
        }
        let (mut worst, mut brightest) = (0.0_f64, 0.0_f64);
        for (sum, all) in sums.iter().flatten().zip(whole.iter().flat_map(|p| &p.rgb)) {
            for c in 0..3 {
                worst = worst.max((sum[c] - all[c]).abs());
                brightest = brightest.max(all[c]);
            }
        }
        assert!(
            brightest > 0.0 && worst <= LACK * brightest,
            "{worst} of {brightest}"
        );
    }
}
