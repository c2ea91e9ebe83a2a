//! The real program in a folder of its own: exit codes, files, what it says.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A folder with copies of rooms of `scenes/`, spectra included.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new(rooms: &[&str]) -> Self {
        let desk = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        for room in rooms {
            for end in ["glb", "spectra.json"] {
                let name = format!("{room}.{end}");
                let from = root().join("scenes").join(&name);
                if from.exists() {
                    std::fs::copy(from, desk.at(&name)).unwrap();
                }
            }
        }
        desk
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_haarlight"));
        command.args(args).current_dir(self.folder.path());
        command.env_remove("RUST_BACKTRACE");
        command
    }

    /// Runs the program; its output once it has ended with `code`.
    fn run(&self, args: &[&str], code: i32) -> Output {
        let output = self.command(args).output().unwrap();
        assert_eq!(
            output.status.code(),
            Some(code),
            "{args:?}\n{}",
            said(&output)
        );
        output
    }

    fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.at(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Names of all files, hidden ones too.
    fn files(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.at(folder)).unwrap();
        let name =
            |e: std::io::Result<std::fs::DirEntry>| e.unwrap().file_name().into_string().unwrap();
        let mut names: Vec<String> = entries.map(name).collect();
        names.sort();
        names
    }
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn printed(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn records(log: &[u8]) -> Vec<Value> {
    let text = std::str::from_utf8(log).unwrap();
    assert!(text.ends_with('\n'));
    text.lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect()
}

/// Every field of a record stands in the documentation of the log, or is a documented field of a type there.
fn documented(record: &Value) {
    let sources = ["src/cli/log.rs", "src/audit/report.rs"]
        .map(|p| std::fs::read_to_string(root().join(p)).unwrap());
    let text = sources.concat();
    for (key, value) in record.as_object().unwrap() {
        let known = |key: &str| {
            text.contains(&format!("`{key}`")) || text.contains(&format!("pub {key}: "))
        };
        if let (Value::Object(parts), "error" | "flux" | "phases_s") = (value, key.as_str()) {
            for part in parts.keys() {
                let dotted = format!("`{key}.{part}`");
                assert!(
                    known(part) || known(&format!(".{part}")) || text.contains(&dotted),
                    "{key}.{part}"
                );
            }
        } else {
            assert!(
                key == "record" || known(key),
                "{key} of {}",
                record["record"]
            );
        }
    }
}

#[test]
fn a_bake_writes_everything_that_was_asked_for_and_nothing_else() {
    let desk = Desk::new(&["cornell"]);
    let before = desk.read("cornell.glb");
    let output = desk.run(
        &[
            "bake",
            "cornell.glb",
            "--error",
            "2",
            // Pictures may take a tenth of that, however busy the machine is.
            "--time",
            "10000",
            "--log",
            "bake.jsonl",
            "--snapshots",
            "pictures",
            "--npz",
            "light.npz",
            "--audit",
            "8",
            "--json",
        ],
        0,
    );
    let all = [
        "bake.jsonl",
        "cornell.baked.glb",
        "cornell.glb",
        "cornell.spectra.json",
        "light.npz",
        "pictures",
    ];
    assert_eq!(desk.files("."), all);
    assert_eq!(desk.read("cornell.glb"), before);

    let records = records(&desk.read("bake.jsonl"));
    let names: Vec<&str> = records
        .iter()
        .map(|r| r["record"].as_str().unwrap())
        .collect();
    let rounds = names.iter().filter(|n| **n == "round").count();
    let mut wanted = vec!["plan"];
    for _ in 0..rounds {
        wanted.extend(["round", "snapshots"]);
    }
    wanted.extend(["audit", "verdict"]);
    assert_eq!(names, wanted);
    let mut pictures: Vec<String> = (1..=rounds)
        .map(|k| format!("round-{k:02}-cornell.png"))
        .collect();
    pictures.insert(0, "final-cornell.exr".into());
    pictures.insert(1, "final-cornell.png".into());
    assert_eq!(desk.files("pictures"), pictures);

    for record in &records {
        documented(record);
    }
    let (plan, verdict) = (&records[0], records.last().unwrap());
    assert_eq!(plan["version"], 1);
    assert_eq!(plan["effects"][0]["name"], "interreflection");
    assert_eq!(plan["facts"]["triangles"], 38);
    assert_eq!(plan["settings"]["error_de2000"], 2.0);
    assert_eq!(
        plan["settings"]["range_nm"],
        serde_json::json!([380.0, 780.0])
    );
    let round = &records[2 * rounds - 1];
    assert_eq!(round["round"], rounds);
    assert_eq!(round["error"]["total_de2000"]["kind"], "estimate");
    assert_eq!(round["error"]["convergence"]["kind"], "bound");
    assert!(round["error"]["total_de2000"]["value"].as_f64().unwrap() <= 2.0);
    assert!(round["phases_s"]["links"].as_f64().unwrap() >= 0.0);
    let audit = &records[2 * rounds + 1];
    assert_eq!(
        audit["points"].as_u64().unwrap() + audit["covered"].as_u64().unwrap(),
        8
    );
    let [low, high] = ["low", "high"].map(|k| audit["bias"][k].as_f64().unwrap());
    let mean = &audit["de2000"]["mean"];
    assert!(mean["low"].as_f64().unwrap() <= mean["high"].as_f64().unwrap());
    assert_eq!(audit["estimate_de2000"], verdict["error_de2000"]["value"]);
    assert_eq!(
        verdict["light_de2000"]["value"],
        round["error"]["total_de2000"]["value"]
    );
    assert_eq!(verdict["interpolation_de2000"]["kind"], "measured");
    assert!(["honest", "too_low", "too_high"].contains(&audit["honesty"].as_str().unwrap()));
    assert!(low < high && high < 0.3 && low > -0.3, "{audit}");
    assert_eq!(verdict["verdict"], "reached");
    assert_eq!(verdict["exit_code"], 0);
    assert_eq!(verdict["outputs"]["glb"], "cornell.baked.glb");
    assert_eq!(
        verdict["outputs"]["pictures"].as_array().unwrap().len(),
        rounds + 1
    );
    assert!(verdict["vertices"].as_u64().unwrap() > 100);
    assert!(
        verdict["covered"].is_u64() && verdict["clipped"].is_u64() && verdict["capped"].is_u64()
    );
    assert!(verdict["seconds"]["total"].as_f64().unwrap() > 0.0);
    let json: Value = serde_json::from_str(&printed(&output)).unwrap();
    assert_eq!(&json, verdict);

    for text in [
        "round 1:",
        "(estimate)",
        "elements",
        "measured error at 8 points",
        "cornell.baked.glb",
    ] {
        assert!(said(&output).contains(text), "{text}\n{}", said(&output));
    }
    assert!(desk.read("light.npz").starts_with(b"PK"));
    // What was written is a room again.
    let again = printed(&desk.run(&["inspect", "cornell.baked.glb", "--json"], 0));
    let again: Value = serde_json::from_str(&again).unwrap();
    assert_eq!(again["facts"]["triangles"], verdict["triangles"]);
}

#[test]
fn quiet_says_nothing_and_threads_change_nothing() {
    let desk = Desk::new(&["convex"]);
    let one = desk.run(
        &[
            "bake",
            "convex.glb",
            "-q",
            "--error",
            "4",
            "--threads",
            "1",
            "-o",
            "one.glb",
        ],
        0,
    );
    let two = desk.run(
        &[
            "--threads",
            "2",
            "bake",
            "convex.glb",
            "--error",
            "4",
            "--snapshots",
            "pictures",
            "-o",
            "two.glb",
        ],
        0,
    );
    assert_eq!((said(&one), printed(&one)), (String::new(), String::new()));
    assert!(printed(&two).is_empty());
    assert!(desk.read("one.glb") == desk.read("two.glb"));
}

#[test]
fn time_that_is_up_leaves_a_whole_result_and_code_1() {
    let desk = Desk::new(&["cornell"]);
    let args = [
        "bake",
        "cornell.glb",
        "--time",
        "1e-6",
        "--json",
        "--log",
        "log",
        "--report",
        "page.html",
        "--cache",
    ];
    let output = desk.run(&args, 1);
    let verdict: Value = serde_json::from_str(&printed(&output)).unwrap();
    assert_eq!(verdict["verdict"], "out_of_time");
    assert!(said(&output).contains("no cache"), "{}", said(&output));
    assert!(verdict["outputs"]["cache"].is_null(), "{verdict}");
    // Not even the first round was done: there is light, and nothing is known of its error.
    assert_eq!(
        (&verdict["exit_code"], &verdict["rounds"]),
        (&Value::from(1), &Value::from(0))
    );
    assert!(verdict["taken_back_s"].as_f64().is_some());
    assert!(verdict["error_de2000"]["value"].is_null());
    assert_eq!(records(&desk.read("log")).len(), 2);
    desk.run(&["inspect", "cornell.baked.glb"], 0);
}

/// The verdict of a bake that was asked for it.
fn verdict(desk: &Desk, more: &[&str], code: i32) -> Value {
    let args = [&["bake", "cornell.glb", "--json"], more].concat();
    serde_json::from_str(&printed(&desk.run(&args, code))).unwrap()
}

#[test]
fn a_budget_is_kept_and_its_error_told() {
    let desk = Desk::new(&["cornell"]);
    let few = verdict(&desk, &["--vertices", "600"], 1);
    assert!(few["vertices"].as_u64().unwrap() <= 600, "{few}");
    assert!(few["vertices"].as_u64().unwrap() > 500, "{few}");
    assert_eq!(few["verdict"], "exhausted");
    assert!(few["interpolation_de2000"]["value"].as_f64().unwrap() > 0.5);
    let small = verdict(&desk, &["--megabytes", "0.025"], 1);
    let size = desk.read("cornell.baked.glb").len();
    assert!((15_000..=25_000).contains(&size), "{size}");
    assert_eq!(small["verdict"], "exhausted");
    // Less than the room itself is said, and not done.
    let output = desk.run(
        &["bake", "cornell.glb", "--error", "4", "--vertices", "9"],
        1,
    );
    assert!(said(&output).contains("not 9"), "{}", said(&output));
}

#[test]
fn file_and_pictures_are_shown_alike() {
    let desk = Desk::new(&["cornell"]);
    let quick = ["--error", "4", "--log", "log", "--snapshots", "p"];
    let auto = verdict(&desk, &quick, 0);
    let glb = gltf::Glb::from_slice(&desk.read("cornell.baked.glb"))
        .unwrap()
        .json
        .into_owned();
    let json: Value = serde_json::from_slice(&glb).unwrap();
    let stated = &json["asset"]["extras"]["haarlight"]["exposure"];
    assert_eq!(stated["scale"], auto["exposure"]["scale"]);
    let fixed = verdict(&desk, &[&quick[..], &["--exposure", "-2.5"]].concat(), 0);
    assert!((fixed["ev100"].as_f64().unwrap() + 2.5).abs() < 1e-9);
    for record in records(&desk.read("log")) {
        if record["record"] == "snapshots" {
            assert_eq!(record["exposure"]["scale"], fixed["exposure"]["scale"]);
        }
    }
    let brighter = verdict(&desk, &["--error", "4", "--exposure", "auto+1"], 0);
    let scale = |v: &Value| v["exposure"]["scale"].as_f64().unwrap();
    assert!((scale(&brighter) / scale(&auto) - 2.0).abs() < 1e-9);
    let warm = verdict(&desk, &["--error", "4", "--white-balance", "3000"], 0);
    assert!(
        warm["exposure"]["balance"][2][2].as_f64().unwrap() > 1.5,
        "{warm}"
    );
    desk.run(&["bake", "cornell.glb", "--exposure", "bright"], 2);
    desk.run(&["bake", "cornell.glb", "--white-balance", "-5"], 2);
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_after_the_round_with_everything_written() {
    let desk = Desk::new(&["cornell"]);
    // An error that takes long to reach: were it deaf to the signal, the verdict would be another.
    let args = [
        "bake",
        "cornell.glb",
        "--error",
        "0.05",
        "--log",
        "log",
        "--json",
    ];
    let child = desk
        .command(&args)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The first round in the log: the handler is in place.
    while !std::fs::read_to_string(desk.at("log")).is_ok_and(|log| log.contains("\"round\"")) {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let verdict: Value = serde_json::from_str(&printed(&output)).unwrap();
    assert_eq!(verdict["verdict"], "interrupted");
    assert_eq!(
        desk.files("."),
        [
            "cornell.baked.glb",
            "cornell.glb",
            "cornell.spectra.json",
            "log"
        ]
    );
    desk.run(&["inspect", "cornell.baked.glb"], 0);
}

/// Every broken file of the corpus: code 2, its name in the message, and nothing written. Those that only warn bake,
/// black as they are, unless there is nothing in them.
#[test]
fn broken_rooms_are_refused_by_name() {
    let desk = Desk::new(&[]);
    let corpus = root().join("tests/corpus");
    let table = std::fs::read_to_string(corpus.join("expected.tsv")).unwrap();
    let mut seen = 0;
    for line in table.lines().filter(|l| !l.starts_with('#')) {
        let cells: Vec<&str> = line.split('\t').collect();
        let [file, outcome, part] = cells[..] else {
            panic!("{line}")
        };
        if !cfg!(feature = "draco") && file == "draco_broken.glb" {
            continue;
        }
        let room = corpus.join(file);
        let refused = outcome == "refused" || file == "points_only.glb";
        let code = if refused { 2 } else { 0 };
        let room = room.to_str().unwrap();
        let output = desk.run(&["bake", room, "-o", "out.glb", "--allow-dark"], code);
        assert!(said(&output).contains(part), "{file}: {}", said(&output));
        if code == 2 {
            assert!(said(&output).contains(file), "{file}: {}", said(&output));
            assert!(desk.files(".").is_empty(), "{file}: {:?}", desk.files("."));
        } else {
            assert_eq!(desk.files("."), ["out.glb"], "{file}");
            std::fs::remove_file(desk.at("out.glb")).unwrap();
        }
        seen += 1;
    }
    assert!(seen > 60, "{seen}");
}

#[test]
fn all_that_is_wrong_is_said_together_before_anything_is_done() {
    let desk = Desk::new(&["cornell"]);
    std::fs::write(
        desk.at("spectra.json"),
        r#"{"materials": {"whitte": {"reflectance": {"name": "macbeth/white"}}}}"#,
    )
    .unwrap();
    let output = desk.run(
        &[
            "bake",
            "cornell.glb",
            "-o",
            "cornell.glb",
            "--spectra",
            "spectra.json",
            "--npz",
            "no/where.npz",
            "--log",
            "spectra.json",
        ],
        2,
    );
    for part in [
        "whitte",
        "nearest names are white",
        "-o cornell.glb: would overwrite an input",
        "--npz no/where.npz",
        "--log spectra.json",
    ] {
        assert!(said(&output).contains(part), "{part}\n{}", said(&output));
    }
    assert_eq!(
        desk.files("."),
        ["cornell.glb", "cornell.spectra.json", "spectra.json"]
    );
    assert_eq!(
        desk.read("cornell.glb"),
        std::fs::read(root().join("scenes/cornell.glb")).unwrap()
    );

    let output = desk.run(&["bake", "nothing.glb"], 2);
    assert!(said(&output).contains("nothing.glb"), "{}", said(&output));
}

#[test]
fn a_wrong_command_line_is_code_2_and_help_is_code_0() {
    let desk = Desk::new(&["convex"]);
    for args in [
        &["bake"][..],
        &["bake", "convex.glb", "--error", "-1"],
        &["bake", "convex.glb", "--range", "700..400"],
        &["bake", "convex.glb", "--time", "soon"],
        &["bake", "convex.glb", "--threads", "0"],
        &["probe", "convex.glb"],
        &["bakes", "convex.glb"],
        &["bake", "convex.glb", "-o", "out.gltf"],
    ] {
        let output = desk.run(args, 2);
        assert!(
            !said(&output).is_empty() && printed(&output).is_empty(),
            "{args:?}"
        );
    }
    let help = printed(&desk.run(&["--help"], 0));
    assert!(
        help.contains("Examples:") && help.contains("Exit codes:"),
        "{help}"
    );
    for command in ["bake", "inspect", "probe", "paper"] {
        assert!(help.contains(command), "{command}\n{help}");
        let page = printed(&desk.run(&[command, "--help"], 0));
        assert!(
            page.contains("--json") && page.contains("--threads"),
            "{page}"
        );
    }
    assert_eq!(desk.files("."), ["convex.glb"]);
}

/// CIE 171:2006, 5.2 with an isotropic source: E = I h / r^3, I = 10 000 lm / 4 pi, h = 3 m.
#[test]
fn a_probe_is_a_lux_meter() {
    let desk = Desk::new(&["cie171-5.2-isotropic"]);
    let scene = haarlight::scene::Scene::load(
        root().join("scenes/cie171-5.2-isotropic.glb"),
        &haarlight::scene::Options::default(),
    )
    .unwrap();
    let lamp = scene.lights[0].position;
    let points: Vec<[f64; 2]> = vec![[0.0, 0.0], [0.5, 0.0], [1.0, 1.0], [-1.5, 0.5]];
    let mut csv = String::from("nx,ny,nz,x,y,z\n");
    for [x, z] in &points {
        csv += &format!("0,7,0,{},{},{}\n", lamp.x + x, lamp.y - 3.0, lamp.z + z);
    }
    std::fs::write(desk.at("points.csv"), csv).unwrap();
    let room = "cie171-5.2-isotropic.glb";
    let output = printed(&desk.run(&["probe", room, "--points", "points.csv"], 0));
    let rows: Vec<Vec<f64>> = output
        .lines()
        .skip(1)
        .map(|l| l.split(',').map_while(|c| c.parse().ok()).collect())
        .collect();
    assert_eq!(
        output.lines().next(),
        Some("x,y,z,nx,ny,nz,E_X,E_Y,E_Z,lux,place")
    );
    assert_eq!(rows.len(), points.len());
    for (row, [x, z]) in rows.iter().zip(&points) {
        let r = (x * x + z * z + 9.0).sqrt();
        let lux = 10_000.0 / (4.0 * std::f64::consts::PI) * 3.0 / r.powi(3);
        assert_eq!(row[3..6], [0.0, 1.0, 0.0]);
        assert!((row[7] / lux - 1.0).abs() < 1e-3, "{row:?} {lux}");
    }

    // With bands: the tristimulus values are sums of the bands.
    let args = [
        "probe",
        room,
        "--points",
        "points.csv",
        "--bands",
        "--range",
        "380..700",
        "-o",
        "out.csv",
        "--json",
    ];
    let json: Value = serde_json::from_str(&printed(&desk.run(&args, 0))).unwrap();
    let table = String::from_utf8(desk.read("out.csv")).unwrap();
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    assert_eq!(
        (header.len(), header[9], header[72], header[73]),
        (75, "E_380", "E_695", "lux")
    );
    assert_eq!(json["columns"][72], "E_695");
    assert_eq!(json["verdict"], "reached");
    let weights =
        haarlight::color::Observer::cie1931().weights(&haarlight::spectrum::Grid::paper());
    for (k, line) in table.lines().skip(1).enumerate() {
        let row: Vec<f64> = line.split(',').map_while(|c| c.parse().ok()).collect();
        assert_eq!(row.len(), 74);
        assert_eq!(json["rows"][k].as_array().unwrap().len(), 74);
        for (c, w) in weights.iter().enumerate() {
            let sum: f64 = row[9..].iter().zip(w).map(|(e, w)| 683.0 * e * w).sum();
            assert!((sum / row[6 + c] - 1.0).abs() < 1e-5, "{line}");
        }
        assert!(
            (row[7] / rows[k][7] - 1.0).abs() < 2e-3,
            "{} {}",
            row[7],
            rows[k][7]
        );
    }
}

#[test]
fn wrong_points_are_listed_with_what_is_wrong_with_the_room() {
    let desk = Desk::new(&["convex"]);
    std::fs::write(
        desk.at("points.csv"),
        "x,y,z,nx,ny,nz\n0,1,0,0,0,0\n0,1,0,0,NaN,0\n0,1,0,0,1\n",
    )
    .unwrap();
    std::fs::write(desk.at("bad.glb"), b"").unwrap();
    let output = desk.run(
        &[
            "probe",
            "convex.glb",
            "--points",
            "points.csv",
            "-o",
            "convex.glb",
        ],
        2,
    );
    for part in [
        "points.csv: line 2",
        "points.csv: line 3",
        "points.csv: line 4",
        "would overwrite an input",
    ] {
        assert!(said(&output).contains(part), "{part}\n{}", said(&output));
    }
    let output = desk.run(&["probe", "bad.glb", "--points", "points.csv"], 2);
    assert!(
        said(&output).contains("bad.glb") && said(&output).contains("line 4"),
        "{}",
        said(&output)
    );
    let output = desk.run(&["probe", "convex.glb", "--points", "none.csv"], 2);
    assert!(said(&output).contains("none.csv"));
    std::fs::write(desk.at("empty.csv"), "").unwrap();
    assert!(
        said(&desk.run(&["probe", "convex.glb", "--points", "empty.csv"], 2))
            .contains("empty.csv: is empty")
    );
    assert_eq!(
        desk.read("convex.glb"),
        std::fs::read(root().join("scenes/convex.glb")).unwrap()
    );
}

#[test]
fn a_sky_is_typed_or_written_beside_the_room() {
    let desk = Desk::new(&["daylit", "cornell-closed"]);
    let plan = printed(&desk.run(&["inspect", "daylit.glb"], 0));
    for said in ["CIE 12 (clear)", "38.0 deg high, azimuth 212.0 deg"] {
        assert!(plan.contains(said), "{said}\n-- in --\n{plan}");
    }
    // What is typed wins, point by point.
    let typed = [
        "inspect",
        "daylit.glb",
        "--sky",
        "overcast",
        "--sky-lux",
        "5000",
    ];
    let plan = printed(&desk.run(&typed, 0));
    assert!(plan.contains("CIE 1 (overcast), 5000 lx"), "{plan}");
    let cloudy = desk.run(&["inspect", "daylit.glb", "--sky", "cloudy"], 2);
    assert!(
        said(&cloudy).contains("cie:1 to cie:16"),
        "{}",
        said(&cloudy)
    );

    let beside = desk.at("daylit.spectra.json");
    let wrong = r#"{"sky": {"typ": "clear", "illuminance_lx": -1, "sun": {"elevation_deg": 30}}}"#;
    std::fs::write(&beside, wrong).unwrap();
    let all = said(&desk.run(&["inspect", "daylit.glb"], 2));
    for text in [
        "unknown key \"typ\"; the nearest names are type",
        "illuminance_lx is -1",
        "does not say where the sun stands",
    ] {
        assert!(all.contains(text), "{text}\n-- in --\n{all}");
    }
    std::fs::write(&beside, r#"{"sky": {"type": "clear", "sun": "sun"}}"#).unwrap();
    let all = said(&desk.run(&["inspect", "daylit.glb"], 2));
    assert!(all.contains("no directional light is named 'sun'"), "{all}");

    // Nobody describes a sky: it is said, and none is invented.
    std::fs::remove_file(&beside).unwrap();
    let all = said(&desk.run(&["bake", "daylit.glb", "--allow-dark"], 0));
    assert!(all.contains("--sky overcast lights it"), "{all}");
    // A closed room is none the brighter for one.
    let bake = |name: &str, more: &[&str]| {
        let args = [
            &["bake", "cornell-closed.glb", "--error", "2", "-o", name],
            more,
        ]
        .concat();
        desk.run(&args, 0);
        desk.read(name)
    };
    assert!(bake("a.glb", &[]) == bake("b.glb", &["--sky", "overcast"]));
}
