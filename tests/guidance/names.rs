//! Names: keys of side files, spectra, the cache.

use super::desk::{Desk, lit, says};
use serde_json::json;

#[test]
fn misspelled_keys_are_refused_with_the_nearest_names() {
    let desk = Desk::with(&lit());
    let side = json!({"materals": {}, "materials": {
        "wall": {"reflectence": {"name": "macbeth/white"}},
        "glow": {"emission": {"name": "cie/F2", "luminance": 500}},
        "wal": {"reflectance": {"name": "macbeth/white"}}}});
    desk.put("room.spectra.json", side.to_string().as_bytes());
    let said = desk.refused(&[]);
    let texts = [
        "unknown key \"materals\"; the nearest names are materials",
        "material 'wall': unknown key \"reflectence\"; the nearest names are reflectance",
        "unknown key \"luminance\"; the nearest names are luminance_cd_m2",
        "material 'wal': the room has no material of that name; the nearest names are wall",
    ];
    says(&said, &texts);
    // The others only warn, and what is right counts.
    let said = desk.bake(&["--lenient", "--log", "log.jsonl"]);
    says(&said, &texts);
    let plan = &desk.records("log.jsonl")[0];
    assert_eq!(plan["warnings"].as_array().unwrap().len(), 4);
    assert_eq!(plan["facts"]["light_spectra"], json!(["cie/F2"]));
}

#[test]
fn spectra_are_listed_and_drawn() {
    let desk = Desk::with(&lit());
    let (_, all) = desk.run(&["spectra"], 0);
    for name in haarlight::data::names() {
        says(&all, &[&name]);
    }
    let (_, some) = desk.run(&["spectra", "CIE/F1"], 0);
    says(&some, &["cie/F1 ", "cie/F12", "light"]);
    assert!(!some.contains("cie/F2 "), "{some}");
    let (_, one) = desk.run(&["spectra", "blackbody/3200"], 0);
    says(&one, &["blackbody/3200", "light"]);
    let said = desk.run(&["spectra", "macbet/whit"], 2).0;
    says(&said, &["no name holds", "macbeth/white"]);

    desk.run(&["spectra", "cornell", "--plot", "walls.svg"], 0);
    let svg = std::fs::read_to_string(desk.at("walls.svg")).unwrap();
    says(
        &svg,
        &["<svg", "wavelength, nm", "cornell/red", "reflectance"],
    );
    let said = desk.run(&["spectra", "--plot", "all.svg"], 2).0;
    says(&said, &["a plot tells 8 apart", "more of the name"]);
}

#[test]
fn a_cache_without_a_name_is_found_again() {
    let desk = Desk::with(&lit());
    desk.bake(&["--cache"]);
    assert!(desk.at("room.cache").exists());
    let said = desk.run(&["relight", "room.glb"], 0).0;
    says(&said, &["relit, nothing changed"]);
    // A name is taken as before.
    desk.bake(&["--cache", "other.cache"]);
    desk.run(&["relight", "room.glb", "--cache", "other.cache"], 0);
}
