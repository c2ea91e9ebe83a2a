//! The live page in a browser.

use super::program::Program;
use crate::report::browser::{Browser, CANVAS};

fn differ(a: &[f64], b: &[f64]) -> usize {
    let pairs = a.iter().zip(b);
    pairs.filter(|(a, b)| (*a - *b).abs() > 2.0).count()
}

fn mean(pixels: &[f64]) -> f64 {
    pixels.iter().sum::<f64>() / pixels.len() as f64
}

/// Waits until the page shows the light that the program has now.
fn caught_up(browser: &mut Browser, program: &Program) {
    let state = program.events().next().unwrap();
    let light = &state["picture"][2];
    browser.wait_for(&format!(
        "document.documentElement.dataset.light >= {light}"
    ));
}

#[test]
fn the_page_shows_rounds_the_file_and_changes() {
    let Some(mut browser) = Browser::start() else {
        eprintln!("SKIPPED: no chromium here, the page was not opened (apt-get install chromium)");
        return;
    };
    // An error that takes rounds, so that a stop comes before the end.
    let program = Program::serve("cornell", &["--error", "0.15"]);
    program.wait("a round", |s| s["picture"].is_array());
    program.post("/stop", "");
    program.wait("stop", |s| s["doing"] == "stopped");
    browser.visit(&program.address());
    browser.wait_for("document.documentElement?.dataset.ready === 'yes'");
    caught_up(&mut browser, &program);
    let first = browser.pixels();
    browser.screen("round.b64");
    assert!(
        mean(&first) > 30.0,
        "the first round is dark: {}",
        mean(&first)
    );
    assert!(
        browser.text("status").contains("Round"),
        "{}",
        browser.text("status")
    );

    browser.run("document.getElementById('go').click()");
    browser.wait_for("document.documentElement.dataset.doing === 'done'");
    caught_up(&mut browser, &program);
    let last = browser.pixels();
    browser.screen("file.b64");
    assert!(differ(&first, &last) > 200, "the file looks like the round");
    // Both are pictures of the same room.
    assert!((mean(&last) - mean(&first)).abs() < 0.15 * mean(&last));

    // A lamp dimmed by its slider.
    let slide = |value: u32| {
        format!(
            "(() => {{ const s = document.querySelector('#lamps input[type=range]'); s.value = {value};
               s.dispatchEvent(new Event('input')); }})()"
        )
    };
    browser.run(&slide(25));
    program.wait("relit", |s| s["relit"].is_object() && s["doing"] == "done");
    caught_up(&mut browser, &program);
    let dim = browser.pixels();
    browser.screen("dim.b64");
    assert!(
        mean(&dim) < 0.8 * mean(&last),
        "{} {}",
        mean(&dim),
        mean(&last)
    );
    assert!(
        browser.text("status").contains("Relit in"),
        "{}",
        browser.text("status")
    );

    // A paint by name; a name that is none is told, with the nearest.
    let paint = |name: &str| {
        format!(
            "(() => {{ const i = document.querySelector('#paints input'); i.value = '{name}';
               i.dispatchEvent(new Event('change')); }})()"
        )
    };
    browser.run(&paint("macbeth/blu"));
    browser.wait_for("!document.getElementById('note').hidden");
    assert!(
        browser.text("note").contains("macbeth/blue"),
        "{}",
        browser.text("note")
    );
    browser.expect_fault("400");
    browser.run(&paint("macbeth/blue"));
    program.wait("painted", |s| {
        s["changes"]["materials"].is_object() && s["doing"] == "done"
    });
    caught_up(&mut browser, &program);
    let blue = browser.pixels();
    assert!(differ(&dim, &blue) > 500, "the paint is not seen");
    assert_eq!(
        browser.run("document.getElementById('note').hidden"),
        "true"
    );

    // All of it undone is the file again.
    browser.run("document.getElementById('undo').click()");
    program.wait("undone", |s| {
        s["changes"] == serde_json::json!({}) && s["doing"] == "done"
    });
    caught_up(&mut browser, &program);
    assert!(
        differ(&last, &browser.pixels()) < 20,
        "what is undone differs"
    );

    // By keys: illuminance, a reading, turning.
    browser.run(&format!("{CANVAS}.focus()"));
    browser.press("Enter", "Enter", 13);
    assert!(
        browser.text("point").contains(" lx"),
        "{}",
        browser.text("point")
    );
    // The rest comes from the program: colour, temperature, error and a plot.
    browser.wait_for("document.querySelector('#point svg') !== null");
    let point = browser.text("point");
    for part in ["x, y", "CCT", " K ", "ΔE00", "Surface", "mW/m²/nm"] {
        assert!(point.contains(part), "{part}: {point}");
    }
    browser.screen("point.b64");
    browser.press("2", "Digit2", 50);
    let lux = browser.pixels();
    assert!(differ(&last, &lux) > 500);
    assert!(browser.text("legends").contains("lux"));
    browser.press("ArrowRight", "ArrowRight", 39);
    assert!(differ(&lux, &browser.pixels()) > 200);
    browser.prefer_dark();
    browser.screen("dark.b64");
    // A reading follows the light.
    let before = browser.text("point");
    browser.run(&slide(10));
    browser.wait_for(&format!(
        "document.getElementById('point').textContent !== {before:?}"
    ));

    browser.run("document.getElementById('save').click()");
    program.wait("saved", |s| s["saved"].is_array());
    assert!(program.folder.path().join("cornell.baked.glb").exists());
    assert!(browser.faults().is_empty(), "{:#?}", browser.faults());
}
