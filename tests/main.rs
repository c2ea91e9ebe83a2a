//! All tests of the library and the program, in one program of its own: side by side they keep all cores busy to the end, and it is linked once.
//!
//! `cargo test --release --test all mirrors::` runs those of one file.

mod audit;
mod bake;
mod bispectral;
mod brightness;
mod checkpoint;
mod cie171;
mod cli;
mod common;
mod contact;
mod cost;
mod cut;
mod daylit_files;
mod determinism;
mod dust;
mod edges;
mod effects;
mod facades;
mod fluorescence;
mod flux;
mod form_factors;
mod furnace;
mod fuzz;
#[allow(dead_code, reason = "what starts it as a program")]
#[path = "../tools/rooms/main.rs"]
mod generator;
mod glare;
mod guidance;
mod hard_cases;
mod import;
mod interrupt;
mod lamps;
mod layers;
mod lightmaps;
mod mesh;
mod metrics;
mod mirrors;
mod narrow;
mod openings;
mod output_gltf;
mod output_npz;
mod output_picture;
mod output_room;
mod packing;
mod panes;
mod parting;
mod pictures;
mod probes;
mod reference;
mod relight;
mod report;
mod rooms;
mod scale;
mod scenes;
mod serve;
mod sheets;
mod sky;
mod sky_maps;
mod spectral_sky;
mod spectrum_bounds;
mod spectrum_paper;
mod table1;
