//! The page of a bake: whole, small, true to the log, and alive in a browser.

pub(crate) mod browser;
pub(crate) mod three;

use browser::{Browser, CANVAS};
use flate2::read::GzDecoder;
use serde_json::Value;
use std::io::Read;
use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

/// A Cornell box may take this much, bytes.
const MOST: usize = 1_500_000;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The page of a bake, its log, and the file.
struct Reported {
    html: String,
    log: String,
    glb: Vec<u8>,
}

/// Of the Cornell box at the default error, once for all tests.
static CORNELL: LazyLock<Reported> = LazyLock::new(|| Reported::new("cornell", "0.5"));

impl Reported {
    fn new(room: &str, error: &str) -> Self {
        Self::with(room, error, &[])
    }

    /// With further options.
    fn with(room: &str, error: &str, more: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for end in ["glb", "spectra.json"] {
            let name = format!("{room}.{end}");
            let from = root().join("scenes").join(&name);
            if from.exists() {
                std::fs::copy(from, folder.path().join(name)).unwrap();
            }
        }
        let file = format!("{room}.glb");
        let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
            .args([
                "report",
                &file,
                "--error",
                error,
                "--log",
                "log.jsonl",
                "-q",
                "--xyz",
            ])
            .args(more)
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        let text = |name: &str| String::from_utf8(read(name)).unwrap();
        Self {
            html: text(&format!("{room}.report.html")),
            log: text("log.jsonl"),
            glb: read(&format!("{room}.baked.glb")),
        }
    }

    /// Opens the page; the folder that it lies in.
    fn open(&self, browser: &mut Browser) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("report.html");
        std::fs::write(&page, &self.html).unwrap();
        browser.open(&page);
        browser.wait_for("document.documentElement?.dataset.ready === 'yes'");
        folder
    }

    /// The text of a script element.
    fn part(&self, id: &str) -> &str {
        let start = self.html.find(&format!("id=\"{id}\">")).unwrap() + id.len() + 6;
        let rest = &self.html[start..];
        &rest[..rest.find("</script>").unwrap()]
    }

    fn data(&self) -> Value {
        serde_json::from_str(self.part("data")).unwrap()
    }

    fn opened(&self, id: &str) -> Vec<u8> {
        let mut out = Vec::new();
        let bytes = base64(self.part(id));
        GzDecoder::new(&bytes[..]).read_to_end(&mut out).unwrap();
        out
    }
}

fn base64(text: &str) -> Vec<u8> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let (mut out, mut bits, mut held) = (Vec::new(), 0_u32, 0);
    for letter in text.trim_end_matches('=').bytes() {
        let six = LETTERS.iter().position(|&l| l == letter).unwrap() as u32;
        (bits, held) = (bits << 6 | six, held + 6);
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
            bits &= (1 << held) - 1;
        }
    }
    out
}

#[test]
fn the_page_is_whole_small_and_says_what_the_log_says() {
    let reported = &*CORNELL;
    let html = &reported.html;
    assert!(html.len() < MOST, "{} bytes", html.len());
    // Nothing is asked for from anywhere; the policy forbids what anyone might add.
    assert!(html.contains("default-src 'none'"));
    for attribute in ["src=\"", "href=\"", "url(", "@import", "srcset=", "action="] {
        for (at, _) in html.match_indices(attribute) {
            let value = &html[at + attribute.len()..];
            let local =
                attribute.ends_with('"') && (value.starts_with('#') || value.starts_with("data:"));
            assert!(local, "{}", &html[at..at + 60]);
        }
    }

    let records: Vec<Value> = (reported.log)
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    let data = reported.data();
    let rounds: Vec<&Value> = records.iter().filter(|r| r["record"] == "round").collect();
    assert_eq!(data["log"]["plan"], records[0]);
    assert_eq!(data["log"]["verdict"], records[records.len() - 1]);
    assert_eq!(
        data["log"]["rounds"]
            .as_array()
            .unwrap()
            .iter()
            .collect::<Vec<_>>(),
        rounds
    );
    assert!(
        data["log"]["verdict"]["outputs"]["report"]
            .as_str()
            .unwrap()
            .ends_with(".html")
    );

    assert!(
        reported.opened("glb") == reported.glb,
        "the room in the page is not the file"
    );
    let light = &data["light"];
    assert_eq!(light["vertices"], data["log"]["verdict"]["vertices"]);
    let stated = rounds[rounds.len() - 1]["error"]["total_de2000"]["value"].as_f64();
    assert_eq!(light["error_mean_de2000"].as_f64(), stated);
    assert_eq!(light["rounds"].as_array().unwrap().len(), rounds.len());
}

/// The planes as the viewer reads them: illuminance within its coding, spectra that add up to it, errors with their mean.
#[test]
fn light_comes_back_out_of_its_bytes() {
    let reported = Reported::new("cornell-f2", "1");
    let (data, planes) = (reported.data(), reported.opened("planes"));
    let light = &data["light"];
    let number = |v: &Value| v.as_f64().unwrap();
    let count = light["vertices"].as_u64().unwrap() as usize;
    let steps = light["rounds"].as_array().unwrap().len() + 1;
    let components = light["spectrum"]["components"].as_array().unwrap().len();
    assert_eq!(planes.len(), count * (4 * steps + 1 + 2 * components));
    let plane = |k: usize| &planes[k * count..][..count];
    let [low, high] = [0, 1].map(|k| number(&light["lux_log10"][k]));
    let last = 4 * (steps - 1);
    let lux = |v: usize| {
        let code = f64::from(plane(last)[v]) * 256.0 + f64::from(plane(last + 1)[v]);
        if code == 0.0 {
            0.0
        } else {
            10f64.powf(low + (high - low) * (code - 1.0) / 65534.0)
        }
    };

    // What is kept is the spectrum of one lux: its luminous sum is one.
    let y_bar: Vec<f64> = data["room"]["observer"][1]
        .as_array()
        .unwrap()
        .iter()
        .map(number)
        .collect();
    let mean: Vec<f64> = light["spectrum"]["mean"]
        .as_array()
        .unwrap()
        .iter()
        .map(number)
        .collect();
    let mut worst: f64 = 0.0;
    for v in (0..count).filter(|&v| lux(v) > 1.0) {
        let mut sum: f64 = mean.iter().zip(&y_bar).map(|(s, y)| s * y).sum();
        for c in 0..components {
            let range = &light["spectrum"]["ranges"][c];
            let [low, high] = [0, 1].map(|k| number(&range[k]));
            let at = 4 * steps + 1 + 2 * c;
            let code = f64::from(plane(at)[v]) * 256.0 + f64::from(plane(at + 1)[v]);
            let axis = light["spectrum"]["components"][c].as_array().unwrap();
            let lumens: f64 = axis
                .iter()
                .map(number)
                .zip(&y_bar)
                .map(|(s, y)| s * y)
                .sum();
            sum += (low + (high - low) * code / 65535.0) * lumens;
        }
        worst = worst.max((sum - 1.0).abs());
    }
    assert!(worst < 0.01, "a lux of spectrum is off by {worst}");
    let most = number(&light["error_most_de2000"]);
    let errors = plane(4 * steps)
        .iter()
        .map(|&c| most * (f64::from(c) / 255.0).powi(2));
    assert!((errors.fold(0.0, f64::max) - most).abs() < 1e-12);
}

/// The illuminance of a vertex stands where the file's primitives have that vertex: what a plain wall sends back is its albedo
/// times what it gets, at all of its vertices.
#[test]
fn vertices_stand_in_the_order_of_the_file() {
    let reported = Reported::new("two-rooms", "2");
    let (data, planes, glb) = (
        reported.data(),
        reported.opened("planes"),
        reported.opened("glb"),
    );
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let json: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    let bin = &glb[28 + length..];
    let number = |v: &Value| v.as_u64().unwrap_or(0) as usize;
    let light = &data["light"];
    let count = number(&light["vertices"]);
    let last = 4 * light["rounds"].as_array().unwrap().len() * count;
    let [low, high] = [0, 1].map(|k| light["lux_log10"][k].as_f64().unwrap());
    let lux = |v: usize| {
        let code = f64::from(planes[last + v]) * 256.0 + f64::from(planes[last + count + v]);
        10f64.powf(low + (high - low) * (code - 1.0) / 65534.0)
    };
    let mut first = 0;
    let mut primitives = 0;
    for mesh in json["meshes"].as_array().unwrap() {
        for primitive in mesh["primitives"].as_array().unwrap() {
            let accessor = &json["accessors"][number(&primitive["attributes"]["_XYZ"])];
            let view = &json["bufferViews"][number(&accessor["bufferView"])];
            let start = number(&view["byteOffset"]) + number(&accessor["byteOffset"]);
            let n = number(&accessor["count"]);
            let sent = |v: usize| {
                let at = start + 12 * v + 4;
                f64::from(f32::from_le_bytes(bin[at..at + 4].try_into().unwrap()))
            };
            let mut albedo: Vec<f64> = (0..n)
                .filter(|v| lux(first + v) > 1.0)
                .map(|v| sent(v) / lux(first + v))
                .collect();
            albedo.sort_by(f64::total_cmp);
            let glows = light["glows"][primitives].as_bool().unwrap();
            if let (false, Some(&median)) = (glows, albedo.get(albedo.len() / 2)) {
                let off = |a: &&f64| **a > 1.5 * median || **a < median / 1.5;
                let odd = albedo.iter().filter(off).count();
                assert!(
                    median < 1.0 && 20 * odd <= albedo.len(),
                    "{odd} of {}",
                    albedo.len()
                );
            }
            first += n;
            primitives += 1;
        }
    }
    assert_eq!(
        (first, primitives),
        (count, light["glows"].as_array().unwrap().len())
    );
}

/// What layers bring adds up to the illuminance of the file; sliders dim them in the picture and at the measured point.
#[test]
fn lamps_are_dimmed_in_the_page() {
    let reported = Reported::with("two-rooms", "3", &["--layers"]);
    let (data, planes) = (reported.data(), reported.opened("planes"));
    let light = &data["light"];
    let names = light["layers"].as_array().unwrap();
    assert!(names.len() > 1, "{names:?}");
    let count = light["vertices"].as_u64().unwrap() as usize;
    let shares = &planes[planes.len() - 2 * names.len() * count..];
    let share = |k: usize, v: usize| {
        let code = |half: usize| f64::from(shares[(2 * k + half) * count + v]);
        (256.0 * code(0) + code(1)) / 65535.0
    };
    let mut lit = 0;
    for v in 0..count {
        let sum: f64 = (0..names.len()).map(|k| share(k, v)).sum();
        // Where there is no light nothing has a share of it.
        assert!(sum == 0.0 || (sum - 1.0).abs() < 1e-4, "{v}: {sum}");
        lit += usize::from(sum > 0.0);
    }
    assert!(2 * lit > count, "{lit} of {count}");
    // Without layers there is neither byte nor slider.
    assert_eq!(CORNELL.data()["light"]["layers"], serde_json::json!([]));

    let Some(mut browser) = Browser::start() else {
        eprintln!("SKIPPED: no chromium here, the page was not opened (apt-get install chromium)");
        return;
    };
    let _folder = reported.open(&mut browser);
    let first = browser.pixels();
    browser.run(&format!("{CANVAS}.focus()"));
    browser.press("Enter", "Enter", 13);
    let before = browser.text("point");
    assert!(!before.contains("as the lamps are set"), "{before}");
    let set = |browser: &mut Browser, value: &str| {
        for k in 0..names.len() {
            browser.run(&format!(
                "(() => {{ const s = document.getElementById('layer-{k}'); s.value = {value}; s.dispatchEvent(new Event('input')); \
                 return ''; }})()"
            ));
        }
        browser.drawn();
    };
    set(&mut browser, "0");
    let mean = |pixels: &[f64]| pixels.iter().sum::<f64>() / pixels.len() as f64;
    let dark = browser.pixels();
    assert!(
        mean(&dark) < 0.7 * mean(&first),
        "{} {}",
        mean(&dark),
        mean(&first)
    );
    let out = browser.text("point");
    assert!(
        out.contains("as the lamps are set") && out.contains("0 lx"),
        "{out}"
    );
    set(&mut browser, "200");
    assert!(mean(&browser.pixels()) > mean(&first));
    browser.run("document.querySelector('#layers button').click()");
    browser.drawn();
    assert_eq!(
        browser.pixels(),
        first,
        "the light of the file does not come back"
    );
    assert_eq!(browser.text("point"), before);
    assert!(browser.faults().is_empty(), "{:#?}", browser.faults());
}

/// The committed bundle is that of the committed sources and lock file.
#[test]
fn the_bundle_is_not_stale() {
    let sums = std::fs::read_to_string(root().join("src/report/page/bundle.json")).unwrap();
    let sums: serde_json::Map<String, Value> = serde_json::from_str(&sums).unwrap();
    for (file, sum) in &sums {
        let mut crc = flate2::Crc::new();
        crc.update(&std::fs::read(root().join(file)).unwrap_or_else(|e| panic!("{file}: {e}")));
        let hint = "run `npm ci && npm run build` in tools/web and commit what it writes";
        assert_eq!(
            sum.as_u64(),
            Some(u64::from(crc.sum())),
            "{file} has changed: {hint}"
        );
    }
    for file in [
        "tools/web/package-lock.json",
        "tools/web/src/main.js",
        "src/report/page/viewer.js.gz",
    ] {
        assert!(sums.contains_key(file), "{file}");
    }
    let sources = std::fs::read_dir(root().join("tools/web/src"))
        .unwrap()
        .count();
    let known = sums
        .keys()
        .filter(|k| k.starts_with("tools/web/src/"))
        .count();
    assert_eq!(known, sources);
    let notices = include_str!("../../src/report/page/NOTICES.txt");
    assert!(notices.contains("three.js") && notices.contains("MIT License"));
}

/// A bake that stopped after a round, and one that went on from there.
#[test]
fn short_and_resumed_bakes_have_pages() {
    let folder = tempfile::tempdir().unwrap();
    let room = root().join("scenes/two-rooms.glb");
    let room = room.to_str().unwrap();
    let run = |args: &[&str], code: i32| {
        let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
            .args(args)
            .args([
                room,
                "-o",
                "a.glb",
                "-q",
                "--checkpoint",
                "state",
                "--error",
                "2",
            ])
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(code), "{output:?}");
        std::fs::read_to_string(folder.path().join("b.html")).unwrap()
    };
    // One round: no error is known, none is drawn.
    let html = run(&["bake", "--report=b.html", "--time", "1e-9"], 1);
    assert!(html.contains("\"error_most_de2000\":null") && html.contains("\"rounds\":[1]"));
    // Rounds before the checkpoint was taken up again are in the log; light is there from the last of them on.
    let html = run(&["report", "--report=b.html"], 0);
    assert!(html.contains("\"rounds\":[1,2"));
}

#[test]
fn inspect_draws_plan_and_spectra() {
    let folder = tempfile::tempdir().unwrap();
    let room = root().join("scenes/two-rooms.glb");
    let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
        .args(["inspect", room.to_str().unwrap(), "--pictures", "pictures"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let read =
        |name: &str| std::fs::read_to_string(folder.path().join("pictures").join(name)).unwrap();
    for (name, parts) in [
        ("plan.svg", ["x, m", "z, m", " lm<"]),
        (
            "lamps.svg",
            ["wavelength, nm", "share of its peak", ">400<"],
        ),
        ("materials.svg", ["wavelength, nm", "reflectance", ">400<"]),
    ] {
        let svg = read(name);
        assert!(parts.iter().all(|part| svg.contains(part)), "{name}: {svg}");
        assert!(svg.starts_with("<svg") && !svg.contains("NaN"), "{name}");
    }
}

/// A lamp of a profile has its polar curve drawn, with the figures of its file; a room without one has none.
#[test]
fn inspect_draws_polar_curves() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = |room: &str| -> Vec<String> {
        let room_file = root().join(format!("scenes/{room}.glb"));
        let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
            .args(["inspect", room_file.to_str().unwrap(), "--pictures", room])
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        let files = std::fs::read_dir(folder.path().join(room)).unwrap();
        let paths = files.map(|file| file.unwrap().path());
        let curves = paths.filter(|p| {
            p.file_name()
                .unwrap()
                .to_string_lossy()
                .starts_with("profile")
        });
        curves
            .map(|p| std::fs::read_to_string(p).unwrap())
            .collect()
    };
    let curves = drawn("gallery");
    assert_eq!(curves.len(), 3);
    let spot = curves
        .iter()
        .find(|svg| svg.contains(">spot: Narrow spot with a ring<"));
    for part in [
        "type C: 393 lm, at most 2400 cd",
        ">C90-C270<",
        ">2000<",
        ">30°<",
    ] {
        assert!(spot.unwrap().contains(part), "{part}");
    }
    assert!(drawn("two-rooms").is_empty());
}

#[test]
fn the_page_lives_in_a_browser() {
    let Some(mut browser) = Browser::start() else {
        eprintln!("SKIPPED: no chromium here, the page was not opened (apt-get install chromium)");
        return;
    };
    let _folder = CORNELL.open(&mut browser);

    // The picture is neither black nor of one colour.
    let first = browser.pixels();
    let mean = first.iter().sum::<f64>() / first.len() as f64;
    let spread = first.iter().map(|p| (p - mean).abs()).sum::<f64>() / first.len() as f64;
    assert!(mean > 30.0 && spread > 15.0, "mean {mean}, spread {spread}");
    let differ = |a: &[f64], b: &[f64]| {
        a.iter()
            .zip(b)
            .filter(|(a, b)| (*a - *b).abs() > 2.0)
            .count()
    };

    // The slider, by its keys.
    browser.run("document.getElementById('round').focus()");
    browser.press("Home", "Home", 36);
    let round = browser.pixels();
    assert!(
        differ(&first, &round) > 200,
        "the first round looks like the file"
    );
    assert!(browser.text("round-name").contains("Round 1"));
    browser.press("End", "End", 35);
    assert_eq!(
        differ(&first, &browser.pixels()),
        0,
        "the slider does not come back to the file"
    );

    // The picture, by its keys: turning, measuring, other looks.
    browser.run(&format!("{CANVAS}.focus()"));
    browser.press("Enter", "Enter", 13);
    let read = browser.text("point");
    assert!(
        read.contains(" lx") && read.contains("CCT") && read.contains("ΔE00"),
        "{read}"
    );
    browser.press("ArrowRight", "ArrowRight", 39);
    let turned = browser.pixels();
    assert!(
        differ(&first, &turned) > 200,
        "an arrow key does not turn the room"
    );
    browser.press("2", "Digit2", 50);
    let lux = browser.pixels();
    assert!(
        differ(&turned, &lux) > 500,
        "key 2 does not show illuminance"
    );
    assert!(browser.text("legends").contains("lux"));
    browser.press("4", "Digit4", 52);
    assert!(
        differ(&lux, &browser.pixels()) > 500,
        "key 4 does not show both"
    );

    // Everything is reached by Tab alone, in dark as in light.
    browser.run("document.activeElement.blur()");
    let mut reached = String::new();
    for _ in 0..14 {
        browser.press("Tab", "Tab", 9);
        reached += &browser.run("document.activeElement.id || document.activeElement.name");
        reached += " ";
    }
    for id in ["look", "views", "move", "canvas", "round"] {
        assert!(reached.contains(id), "{id} is not reached: {reached}");
    }
    let paper = "getComputedStyle(document.body).backgroundColor";
    let light = browser.run(paper);
    browser.prefer_dark();
    assert_ne!(light, browser.run(paper));
    assert!(browser.faults().is_empty(), "{:#?}", browser.faults());
}
