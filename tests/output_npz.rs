//! The NumPy archive, read back through its own directory as a ZIP reader would.

use crate::output_room;

use haarlight::gather::refined;
use haarlight::output::npz;
use haarlight::spectrum::BANDS;
use std::collections::BTreeMap;

fn u16_at(bytes: &[u8], at: usize) -> usize {
    usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]))
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// Entry name to stored bytes, by the central directory.
fn entries(zip: &[u8]) -> BTreeMap<String, &[u8]> {
    let end = zip.len() - 22;
    assert_eq!(&zip[end..end + 4], b"PK\x05\x06");
    let (count, mut at) = (u16_at(zip, end + 10), u32_at(zip, end + 16));
    assert_eq!(at + u32_at(zip, end + 12), end);
    let mut entries = BTreeMap::new();
    for _ in 0..count {
        assert_eq!(&zip[at..at + 4], b"PK\x01\x02");
        let (size, name_length, local) = (
            u32_at(zip, at + 24),
            u16_at(zip, at + 28),
            u32_at(zip, at + 42),
        );
        let name = String::from_utf8(zip[at + 46..at + 46 + name_length].to_vec()).unwrap();
        assert_eq!(&zip[local..local + 4], b"PK\x03\x04");
        assert_eq!(&zip[local + 30..local + 30 + name_length], name.as_bytes());
        let data = local + 30 + u16_at(zip, local + 26) + u16_at(zip, local + 28);
        entries.insert(name, &zip[data..data + size]);
        at += 46 + name_length;
    }
    assert_eq!(at, end);
    entries
}

/// (header text, data)
fn npy(entry: &[u8]) -> (&str, &[u8]) {
    assert_eq!(&entry[..8], b"\x93NUMPY\x01\x00");
    let end = 10 + u16_at(entry, 8);
    (std::str::from_utf8(&entry[10..end]).unwrap(), &entry[end..])
}

#[test]
fn arrays_come_back() {
    let scene = output_room::room();
    let surfaces = output_room::refined(&scene, 2);
    let mut number = 0.0f32;
    let mut next = || {
        number += 0.5;
        number
    };
    let spectra: Vec<Vec<[f32; BANDS]>> = surfaces
        .iter()
        .map(|s| {
            s.vertices
                .iter()
                .map(|_| std::array::from_fn(|_| next()))
                .collect()
        })
        .collect();
    let mut zip = Vec::new();
    npz::write_baked(&mut zip, &scene, &surfaces, &spectra).unwrap();
    // For a look with NumPy itself.
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("output_room.npz");
    haarlight::store::file::write_atomic(&path, None, |w| w.write_all(&zip)).unwrap();

    let entries = entries(&zip);
    let count = 6 * 9;
    let floats = |name: &str, shape: &str| -> Vec<f32> {
        let (header, data) = npy(entries[name]);
        assert!(
            header.contains("'<f4'") && header.contains(shape),
            "{header}"
        );
        data.chunks(4)
            .map(|c| f32::from_le_bytes(c.try_into().unwrap()))
            .collect()
    };
    let radiosity = floats("radiosity.npy", &format!("({count}, 64,)"));
    let wanted: Vec<f32> = spectra.iter().flatten().flatten().copied().collect();
    assert_eq!(radiosity, wanted);
    let xyz = floats("xyz.npy", &format!("({count}, 3,)"));
    let wanted: Vec<f32> = surfaces
        .iter()
        .flat_map(|s| s.vertices.iter().flat_map(|v| v.radiosity))
        .collect();
    assert_eq!(xyz, wanted);

    let doubles = |name: &str| -> Vec<f64> {
        let (header, data) = npy(entries[name]);
        assert!(header.contains("'<f8'"), "{header}");
        data.chunks(8)
            .map(|c| f64::from_le_bytes(c.try_into().unwrap()))
            .collect()
    };
    let edges = doubles("wavelengths.npy");
    assert_eq!(
        (edges[0], edges[BANDS], edges.len()),
        (380.0, 780.0, BANDS + 1)
    );
    let positions = doubles("positions.npy");
    let wanted: Vec<f64> = surfaces
        .iter()
        .flat_map(|baked| {
            let surface = &scene.surfaces[baked.surface];
            baked
                .vertices
                .iter()
                .flat_map(|v| refined::position(surface, v).to_array())
        })
        .collect();
    assert_eq!(positions, wanted);
    let (header, data) = npy(entries["triangles.npy"]);
    assert!(
        header.contains("'<u4'") && header.contains("(48, 3,)"),
        "{header}"
    );
    let largest = data
        .chunks(4)
        .map(|c| u32::from_le_bytes(c.try_into().unwrap()))
        .max();
    assert_eq!(largest, Some(count - 1));
}

#[test]
fn spectra_that_do_not_match_are_a_fault() {
    let scene = output_room::room();
    let surfaces = output_room::refined(&scene, 2);
    let mut zip = Vec::new();
    assert_eq!(
        npz::write_baked(&mut zip, &scene, &surfaces, &[])
            .unwrap_err()
            .exit_code(),
        3
    );
    assert!(zip.is_empty());
}
