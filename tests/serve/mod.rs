//! `haarlight serve` over plain TCP: who is answered, what is refused, and what becomes of the light.

mod glass;
mod page;
mod points;
mod program;

use program::{Program, answer, command, folder_with};
use serde_json::{Value, json};
use std::io::Write;
use std::time::{Duration, Instant};

const QUICK: [&str; 2] = ["--error", "2"];

#[test]
fn only_who_has_the_token_from_here_is_answered() {
    let program = Program::serve("two-rooms", &QUICK);
    let Program { port, token, .. } = &program;
    let good = program.get("/");
    assert_eq!(good.status, 200);
    for header in [
        "Cache-Control: no-store",
        "default-src 'none'",
        "frame-ancestors 'none'",
        "nosniff",
        "no-referrer",
    ] {
        assert!(good.head.contains(header), "{header}: {}", good.head);
    }
    let page = good.text();
    assert!(page.contains(token) && !page.contains("{{") && !page.contains("<script>"));
    assert_eq!(token.len(), 32);

    // Without the token, with half of it, with another.
    let other = token.chars().rev().collect::<String>();
    for path in [
        "/",
        "/viewer.js",
        "/page.css",
        "/room",
        "/events",
        "/mesh",
        "/light?mesh=1&had=0",
        "/point?mesh=1&part=0&vertices=0,0,0&weights=1,0,0",
        "/nothing",
    ] {
        let sign = if path.contains('?') { '&' } else { '?' };
        for query in [
            String::new(),
            format!("{sign}token="),
            format!("{sign}token={}", &token[..31]),
            format!("{sign}token={other}"),
        ] {
            let answer = program.with(&format!("GET {path}{query}"), "", "");
            assert_eq!(answer.status, 403, "{path}{query}");
            assert!(!answer.text().contains(token));
        }
    }
    for path in ["/stop", "/go", "/save", "/expose", "/change"] {
        assert_eq!(
            program.with(&format!("POST {path}"), "", "{}").status,
            403,
            "{path}"
        );
    }
    // By another name of this machine: a page elsewhere whose name was made to mean it.
    let line = format!("GET /?token={token} HTTP/1.1\r\n");
    for (headers, status) in [
        (format!("Host: 127.0.0.1:{port}"), 200),
        (format!("host:LOCALHOST:{port}"), 200),
        (
            format!("Host: localhost:{port}\r\nOrigin: http://localhost:{port}"),
            200,
        ),
        (format!("Host: evil.example:{port}"), 403),
        ("Host: 127.0.0.1".into(), 403),
        (format!("Host: 127.0.0.1:{port}.evil.example"), 403),
        (format!("Host: [::1]:{port}"), 403),
        ("X: y".into(), 403),
        (
            format!("Host: 127.0.0.1:{port}\r\nHost: 127.0.0.1:{port}"),
            400,
        ),
        // From a page elsewhere.
        (
            format!("Host: 127.0.0.1:{port}\r\nOrigin: http://evil.example"),
            403,
        ),
        (format!("Host: 127.0.0.1:{port}\r\nOrigin: null"), 403),
        (
            format!("Host: 127.0.0.1:{port}\r\nOrigin: https://127.0.0.1:{port}"),
            403,
        ),
        (
            format!("Host: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:1"),
            403,
        ),
    ] {
        let answer = program
            .raw(format!("{line}{headers}\r\n\r\n").as_bytes())
            .unwrap();
        assert_eq!(answer.status, status, "{headers}");
    }
}

#[test]
fn bad_requests_are_refused_and_harm_nobody() {
    let program = Program::serve("two-rooms", &QUICK);
    let Program { port, token, .. } = &program;
    let host = format!("Host: 127.0.0.1:{port}");
    let post = format!("POST /change?token={token} HTTP/1.1\r\n{host}\r\n");
    let long = "x".repeat(20_000);
    for (bytes, status) in [
        ("nothing\r\n\r\n".to_owned(), 400),
        ("GET / HTTP/1.1 x\r\n\r\n".into(), 400),
        ("GET / HTTP/3.0\r\n\r\n".into(), 505),
        (
            format!("GET /?token={token} HTTP/1.1\r\n{host}\r\n folded\r\n\r\n"),
            400,
        ),
        (format!("GET /{long} HTTP/1.1\r\n{host}\r\n\r\n"), 431),
        (format!("GET / HTTP/1.1\r\nA: {long}"), 431),
        (format!("{post}Content-Length: 2000000\r\n\r\n"), 413),
        (
            format!("{post}Content-Length: 99999999999999999999\r\n\r\n"),
            413,
        ),
        (
            format!("{post}Content-Length: 2\r\nContent-Length: 3\r\n\r\n{{}}"),
            400,
        ),
        (format!("{post}Content-Length: x\r\n\r\n"), 400),
        (
            format!("{post}Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"),
            411,
        ),
    ] {
        let answer = program.raw(bytes.as_bytes()).unwrap();
        assert_eq!(answer.status, status, "{bytes:.60}");
    }
    // A body that is larger than it may be, and is sent all the same.
    let mut large = format!("{post}Content-Length: 3000000\r\n\r\n").into_bytes();
    large.resize(large.len() + 3_000_000, b' ');
    assert_eq!(program.raw(&large).unwrap().status, 413);
    assert_eq!(
        program.raw(&[0xff; 300]).map(|a| a.status),
        None.or(Some(408))
    );
    for (method, target, status) in [
        ("GET", "/nothing", 404),
        ("GET", "/../Cargo.toml", 404),
        ("POST", "/", 405),
        ("DELETE", "/events", 405),
        ("GET", "/save", 405),
        ("HEAD", "/", 405),
    ] {
        assert_eq!(
            program.ask(method, target, "").status,
            status,
            "{method} {target}"
        );
    }
    program.wait_done();
    for target in [
        "/light",
        "/light?mesh=1",
        "/light?mesh=x&had=0",
        "/light?mesh=-1&had=0",
    ] {
        assert_eq!(program.get(target).status, 400, "{target}");
    }
    for target in ["/light?mesh=77&had=0", "/light?mesh=1&had=4000000000"] {
        assert_eq!(program.get(target).status, 204, "{target}");
    }
    for (body, word) in [
        ("", "JSON"),
        ("{", "JSON"),
        ("[]", "object"),
        ("{\"sky\":{}}", "sky"),
        ("{\"lights\":{\"none\":{\"name\":\"cie/A\"}}}", "none"),
        ("{\"dim\":{\"materials\":{\"none\":0.5}}}", "no lamp"),
        ("{\"dim\":{\"materials\":{\"lamp\":-1}}}", "no factor"),
        ("{\"dim\":{\"materials\":{\"lamp\":1e9}}}", "no factor"),
        ("{\"dim\":{\"rooms\":{}}}", "rooms"),
        ("{\"materials\":{\"wall\":7}}", "object"),
    ] {
        let answer = program.post("/change", body);
        assert_eq!(answer.status, 400, "{body}: {}", answer.text());
        assert!(answer.text().contains(word), "{body}: {}", answer.text());
    }
    // None of it left a trace.
    let state = program.events().next().unwrap();
    assert_eq!(
        (&state["doing"], &state["changes"]),
        (&json!("done"), &json!({}))
    );
}

#[test]
fn second_closed_and_slow_clients_behave() {
    let program = Program::serve("cornell", &["--error", "1"]);
    // Those who say nothing are told so in the end, and hold up nobody meanwhile.
    let mut silent = program.connect();
    silent.write_all(b"GET / HTT").unwrap();
    let started = Instant::now();
    // Tabs that are closed, and tabs that never read.
    for _ in 0..3 {
        drop(program.events());
    }
    let deaf = program.events();
    let (mut first, mut second) = (program.events(), program.events());
    let done = |events: &mut program::Events| events.find(|s| s["doing"] == "done").unwrap();
    let (a, b) = (done(&mut first), done(&mut second));
    assert_eq!(a["picture"], b["picture"]);
    assert_eq!(a["rounds"], b["rounds"]);
    drop((first, second));
    // What one changes all see.
    let mut other = program.events();
    assert_eq!(
        program
            .post("/change", r#"{"dim":{"materials":{"light":0.5}}}"#)
            .status,
        202
    );
    let seen = other.find(|s| !s["relit"].is_null()).unwrap();
    assert_eq!(seen["changes"]["dim"]["materials"]["light"], 0.5);
    drop(other);
    // So many windows and no more; those that were closed are noticed.
    let many: Vec<_> = (0..15).map(|_| program.events()).collect();
    std::thread::sleep(Duration::from_millis(300));
    let all: Vec<Option<Value>> = many.into_iter().map(|mut e| e.next()).collect();
    assert!(all.iter().filter(|s| s.is_some()).count() >= 10);
    drop(all);
    // Connections that ask for nothing run out of their time; the room is there for others.
    let idle: Vec<_> = (0..100).map(|_| program.connect()).collect();
    let answer = answer(&mut silent).unwrap();
    assert_eq!(answer.status, 408);
    assert!(started.elapsed() < Duration::from_secs(120));
    drop((idle, deaf));
    let end = Instant::now() + Duration::from_secs(60);
    while program.raw(b"GET / HTTP/1.1\r\n\r\n").is_none() {
        assert!(Instant::now() < end, "nobody is answered any more");
        std::thread::sleep(Duration::from_millis(100));
    }
    assert_eq!(program.get("/room").status, 200);
}

#[test]
fn an_occupied_port_is_told() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let folder = folder_with("two-rooms");
    let output = command(
        folder.path(),
        &["serve", "two-rooms.glb", "--no-open", "--port", &port],
    )
    .output()
    .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains(&format!("--port {port}")) && said.contains("another port"),
        "{said}"
    );
    assert!(output.stdout.is_empty());
}

#[test]
fn interrupted_it_leaves_nothing_behind() {
    let room = ["cornell.glb", "cornell.spectra.json", "tmp"];
    // While it solves, and when it has kept what relighting needs.
    for wait in [false, true] {
        let error = if wait { "1" } else { "0.01" };
        let program = Program::serve("cornell", &["--error", error]);
        let state = match wait {
            false => program.wait("light", |s| s["picture"].is_array()),
            true => program.wait_done(),
        };
        assert!(state["saved"].is_null());
        let (status, took, folder) = program.interrupt();
        assert_eq!(status.code(), Some(0));
        assert!(took < Duration::from_secs(10), "{took:?}");
        assert_eq!(Program::files(folder.path()), room);
    }
}

#[test]
fn stopped_saved_and_gone_on_with() {
    let program = Program::serve("cornell", &["--error", "0.1"]);
    assert_eq!(program.post("/stop", "").status, 202);
    let state = program.stopped_after(1);
    let rounds = state["rounds"].as_array().unwrap().len();
    assert_eq!(
        state["fine"], false,
        "a stop came too late to be seen: {state}"
    );
    std::thread::sleep(Duration::from_secs(1));
    let state = program.events().next().unwrap();
    assert_eq!(state["rounds"].as_array().unwrap().len(), rounds);

    // The mesh of patches: what is added to any shape that it had gives the same whole.
    let whole = program.light(1, 0);
    let [_, shape, _] = whole.numbers;
    assert!(shape as usize >= rounds);
    let last = program.light(1, shape);
    assert_eq!(last.values, whole.values);
    assert!(
        last.parts
            .iter()
            .all(|(_, ends, corners)| ends.is_empty() && corners.is_empty())
    );
    for (vertices, ends, corners) in &whole.parts {
        let base = vertices - ends.len() / 2;
        for (k, pair) in ends.chunks(2).enumerate() {
            // Ends are there before their midpoint.
            assert!(pair.iter().all(|&e| (e as usize) < base + k));
        }
        assert!(corners.iter().all(|&c| (c as usize) < *vertices));
        assert!(!corners.is_empty());
    }
    let before = program.light(1, 1);
    for (now, then) in whole.parts.iter().zip(&before.parts) {
        assert_eq!(now.0, then.0);
        assert!(now.1.ends_with(&then.1));
    }
    let rough = whole.mean_lux();
    assert!(rough > 0.0 && whole.values.iter().flatten().all(|x| x.is_finite()));

    // Saved as it stands, which does not end it; a stop ends the looks at vertices.
    assert_eq!(program.post("/save", "").status, 202);
    assert_eq!(program.post("/stop", "").status, 202);
    let state = program.wait("save", |s| !s["saved"].is_null());
    assert_eq!(state["saved"][0], "cornell.baked.glb");
    let saved = program.folder.path().join("cornell.baked.glb");
    assert!(gltf_json(&std::fs::read(&saved).unwrap())["asset"]["extras"]["haarlight"].is_object());
    assert_eq!(program.post("/go", "").status, 202);
    let state = program.wait("more rounds", |s| {
        s["rounds"].as_array().unwrap().len() > rounds
    });
    assert_ne!(state["doing"], "stopped");
    program.post("/stop", "");
    program.wait("stop", |s| s["doing"] == "stopped" || s["doing"] == "done");
}

/// What is saved in the end is what `bake` writes; after a change it is what `relight` writes.
#[test]
fn saved_rooms_are_those_of_bake_and_relight() {
    let program = Program::serve("cornell", &["--error", "1"]);
    let state = program.wait_done();
    assert_eq!(
        (&state["reached"], &state["fine"]),
        (&json!(true), &json!(true))
    );
    program.post("/save", "");
    program.wait("save", |s| s["saved"][1] == 1);
    let folder = program.folder.path();
    let saved = || std::fs::read(folder.join("cornell.baked.glb")).unwrap();
    let run = |args: &[&str]| {
        let output = command(folder, args).arg("-q").output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        std::fs::read(folder.join("other.glb")).unwrap()
    };
    let baked = run(&[
        "bake",
        "cornell.glb",
        "--error",
        "1",
        "-o",
        "other.glb",
        "--cache",
    ]);
    assert!(saved() == baked, "not what bake writes");

    let change = json!({
        "materials": {
            "white": { "reflectance": { "name": "macbeth/neutral_5" } },
            "light": { "emission": { "name": "cie/F2", "luminance_cd_m2": 3000 } },
        }
    });
    let answer = program.post("/change", &change.to_string());
    assert_eq!(answer.status, 202, "{}", answer.text());
    let state = program.wait("relit", |s| !s["relit"].is_null() && s["doing"] == "done");
    assert_eq!(state["changes"], change);
    program.post("/save", "");
    program.wait("save", |s| s["saved"][1] == 2);
    let file = folder.join("cornell.spectra.json");
    let mut spectra: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    for (name, what) in [("white", "reflectance"), ("light", "emission")] {
        spectra["materials"][name][what] = change["materials"][name][what].clone();
    }
    std::fs::write(folder.join("new.json"), spectra.to_string()).unwrap();
    let relit = run(&[
        "relight",
        "cornell.glb",
        "--spectra",
        "new.json",
        "-o",
        "other.glb",
    ]);
    assert!(relit != baked, "the change changes nothing");
    // A first answer came before, so that the solve ended elsewhere within what it leaves open.
    let (own, other) = (colours(&saved()), colours(&relit));
    assert_eq!(own.len(), other.len());
    let apart = || own.iter().zip(&other).map(|(a, b)| (a - b).abs());
    let mean = apart().sum::<f32>() / own.len() as f32;
    assert!(mean < 1e-3 && apart().fold(0.0, f32::max) < 1e-2, "{mean}");
}

#[test]
fn lamps_dim_go_out_and_come_back() {
    let program = Program::serve("cornell", &["--error", "1"]);
    program.wait_done();
    let change = |body: &str, light: u32| {
        assert_eq!(program.post("/change", body).status, 202);
        let changes: Value = serde_json::from_str(body).unwrap();
        program.wait("other light", |s| {
            let newer = s["picture"][2].as_u64() > Some(light.into());
            newer && s["changes"] == changes && s["doing"] == "done"
        });
        program.light_now()
    };
    let whole = program.light_now();
    let half = change(r#"{"dim":{"materials":{"light":0.5}}}"#, whole.numbers[2]);
    // Light is linear in its lamps, but for what the solve leaves open: .2 % at this error, of the room's light.
    let open = 2e-3 * whole.mean_lux() as f32;
    for (a, b) in whole.values.iter().zip(&half.values) {
        assert!((b[3] - 0.5 * a[3]).abs() < open, "{a:?} {b:?}");
    }
    let dark = change(r#"{"dim":{"materials":{"light":0}}}"#, half.numbers[2]);
    assert_eq!(dark.mean_lux(), 0.0);
    assert!(dark.values.iter().flatten().all(|x| *x == 0.0));
    // Nothing was solved anew for it, and what is undone is undone.
    let back = change("{}", dark.numbers[2]);
    assert_eq!(back.numbers[0], whole.numbers[0]);
    for (a, b) in whole.values.iter().zip(&back.values) {
        assert!((b[3] - a[3]).abs() < open, "{a:?} {b:?}");
    }
}

/// A room whose lamps are all out is solved, too, and says why its lamps cannot be changed; with light again it is solved anew.
#[test]
fn a_dark_room_is_a_room() {
    let program = Program::serve("cornell", &QUICK);
    program.wait_done();
    program.post("/change", r#"{"dim":{"materials":{"light":0}}}"#);
    program.wait("dark", |s| !s["relit"].is_null() && s["doing"] == "done");
    program.post("/go", "");
    let state = program.wait("solved dark", |s| {
        s["relit"].is_null() && s["fine"] == true && s["doing"] == "done"
    });
    assert!(
        state["note"]
            .as_str()
            .is_some_and(|n| n.contains("without light")),
        "{state}"
    );
    assert_eq!(program.light_now().mean_lux(), 0.0);
    assert_eq!(program.post("/expose", "").status, 202);
    assert_eq!(program.post("/change", "{}").status, 202);
    let state = program.wait("light", |s| {
        s["fine"] == true && s["changes"] == json!({}) && s["doing"] == "done"
    });
    assert!(program.light_now().mean_lux() > 0.0, "{state}");
}

/// A change while the room is solved ends the rounds and is seen on the patches; going on solves the changed room, in which a
/// lamp that was dark can be lit again only by solving anew.
#[test]
fn changes_before_the_end_and_lamps_that_were_dark() {
    let program = Program::serve("two-rooms", &["--error", "0.3"]);
    let state = program.stopped_after(1);
    let room: Value = serde_json::from_slice(&program.get("/room").body).unwrap();
    let lamps = room["room"]["lamps"].as_array().unwrap();
    let names: Vec<&str> = lamps
        .iter()
        .map(|l| l["fact"]["name"].as_str().unwrap())
        .collect();
    let (first, of) = match room["lone_lights"].as_u64().unwrap() == lamps.len() as u64 {
        true => (names[0], "lights"),
        false => (names[0], "materials"),
    };
    assert!(names.iter().any(|n| *n != first), "{names:?}");
    let body = json!({ "dim": { of: { first: 0 } } }).to_string();
    program.post("/go", "");
    assert_eq!(program.post("/change", &body).status, 202);
    let relit = program.wait("relit", |s| !s["relit"].is_null());
    assert_eq!(relit["fine"], false);
    let mesh = state["picture"][0].as_u64();
    assert_eq!(relit["picture"][0].as_u64(), mesh);
    let dim = program.light_now();
    assert!(dim.mean_lux() > 0.0);

    program.post("/go", "");
    program.wait("solved anew", |s| {
        s["picture"][0].as_u64() > mesh && s["relit"].is_null()
    });
    let anew = program.light_now();
    assert!(
        (anew.mean_lux() / dim.mean_lux() - 1.0).abs() < 0.2,
        "{} {}",
        anew.mean_lux(),
        dim.mean_lux()
    );
    assert_eq!(program.post("/change", "{}").status, 202);
    let state = program.wait("solved anew again", |s| {
        s["picture"][0].as_u64() > Some(anew.numbers[0].into())
            && !s["rounds"].as_array().unwrap().is_empty()
    });
    assert_eq!(state["changes"], json!({}));
    assert!(program.light_now().mean_lux() > dim.mean_lux());
}

/// The JSON of a GLB.
fn gltf_json(glb: &[u8]) -> Value {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&glb[20..20 + length]).unwrap()
}

/// All colours of a baked room.
fn colours(glb: &[u8]) -> Vec<f32> {
    let json = gltf_json(glb);
    let number = |v: &Value| v.as_u64().unwrap_or(0) as usize;
    let body = &glb[28 + number(&json!(u32::from_le_bytes(glb[12..16].try_into().unwrap())))..];
    let primitives = json["meshes"].as_array().unwrap().iter();
    let primitives = primitives.flat_map(|m| m["primitives"].as_array().unwrap());
    let mut out = Vec::new();
    for primitive in primitives {
        let accessor = &json["accessors"][number(&primitive["attributes"]["COLOR_0"])];
        let view = &json["bufferViews"][number(&accessor["bufferView"])];
        assert_eq!(
            (&accessor["componentType"], &accessor["type"]),
            (&json!(5126), &json!("VEC3"))
        );
        assert!(view["byteStride"].as_u64().is_none_or(|s| s == 12));
        let at = number(&view["byteOffset"]) + number(&accessor["byteOffset"]);
        let bytes = &body[at..at + 12 * number(&accessor["count"])];
        out.extend(
            bytes
                .as_chunks::<4>()
                .0
                .iter()
                .map(|b| f32::from_le_bytes(*b)),
        );
    }
    out
}
