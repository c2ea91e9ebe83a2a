//! A program that serves a room, and plain TCP to it.

use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Whatever is waited for comes within this time, on a busy machine too.
const PATIENCE: Duration = Duration::from_secs(240);

/// The program with its room in a folder of its own.
pub(crate) struct Program {
    child: Child,
    _stdout: BufReader<ChildStdout>,
    pub(crate) folder: tempfile::TempDir,
    pub(crate) port: u16,
    pub(crate) token: String,
}

/// An answer.
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) head: String,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    pub(crate) fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }
}

/// A folder with a room of `scenes`, and a folder `tmp` in it for the system's use.
pub(crate) fn folder_with(room: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for end in ["glb", "spectra.json"] {
        let name = format!("{room}.{end}");
        let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
        if scenes.join(&name).exists() {
            std::fs::copy(scenes.join(&name), folder.path().join(name)).unwrap();
        }
    }
    std::fs::create_dir(folder.path().join("tmp")).unwrap();
    folder
}

/// The command in a folder.
pub(crate) fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_haarlight"));
    command
        .args(args)
        .current_dir(folder)
        .env("TMPDIR", folder.join("tmp"));
    command
}

impl Program {
    pub(crate) fn serve(room: &str, args: &[&str]) -> Self {
        Self::serve_in(folder_with(room), room, args)
    }

    pub(crate) fn serve_in(folder: tempfile::TempDir, room: &str, args: &[&str]) -> Self {
        let mut child = command(
            folder.path(),
            &["serve", &format!("{room}.glb"), "--no-open", "-q"],
        )
        .args(args)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        stdout.read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("http://127.0.0.1:").unwrap();
        let (port, token) = address.split_once("/?token=").unwrap();
        Self {
            port: port.parse().unwrap(),
            token: token.to_owned(),
            child,
            _stdout: stdout,
            folder,
        }
    }

    pub(crate) fn address(&self) -> String {
        format!("http://127.0.0.1:{}/?token={}", self.port, self.token)
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Sends bytes as they are; the answer, if there is one.
    pub(crate) fn raw(&self, bytes: &[u8]) -> Option<Answer> {
        let mut stream = self.connect();
        // Whoever refuses need not read to the end.
        let _ = stream.write_all(bytes);
        answer(&mut stream)
    }

    /// A request with these headers besides the host.
    pub(crate) fn with(&self, line: &str, headers: &str, body: &str) -> Answer {
        let Self { port, .. } = self;
        let length = body.len();
        let text = format!(
            "{line} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: {length}\r\n{headers}\r\n{body}"
        );
        self.raw(text.as_bytes()).unwrap()
    }

    /// A request with the token; `target` may have a query.
    pub(crate) fn ask(&self, method: &str, target: &str, body: &str) -> Answer {
        let sign = if target.contains('?') { '&' } else { '?' };
        let line = format!("{method} {target}{sign}token={}", self.token);
        self.with(&line, "", body)
    }

    pub(crate) fn get(&self, target: &str) -> Answer {
        self.ask("GET", target, "")
    }

    pub(crate) fn post(&self, target: &str, body: &str) -> Answer {
        self.ask("POST", target, body)
    }

    /// The stream of events.
    pub(crate) fn events(&self) -> Events {
        let mut stream = self.connect();
        let Self { port, token, .. } = self;
        write!(
            stream,
            "GET /events?token={token} HTTP/1.1\r\nHost: localhost:{port}\r\n\r\n"
        )
        .unwrap();
        Events(BufReader::new(stream))
    }

    /// Waits for a state.
    pub(crate) fn wait(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        let mut events = self.events();
        loop {
            let state = events.next().expect("a state");
            if wanted(&state) {
                return state;
            }
            assert!(start.elapsed() < PATIENCE, "{what}: {state}");
        }
    }

    pub(crate) fn wait_done(&self) -> Value {
        self.wait("done", |s| s["doing"] == "done")
    }

    /// Stops it after so many rounds, or one or two more.
    pub(crate) fn stopped_after(&self, rounds: usize) -> Value {
        loop {
            self.post("/stop", "");
            let state = self.wait("stop", |s| s["doing"] == "stopped");
            if state["rounds"].as_array().unwrap().len() >= rounds {
                return state;
            }
            self.post("/go", "");
        }
    }

    /// Interrupts it as Ctrl-C does; how it ended, and after how long.
    pub(crate) fn interrupt(mut self) -> (ExitStatus, Duration, tempfile::TempDir) {
        let start = Instant::now();
        let kill = Command::new("kill")
            .args(["-INT", &self.child.id().to_string()])
            .status();
        assert!(kill.unwrap().success());
        let status = self.child.wait().unwrap();
        let folder = std::mem::replace(&mut self.folder, tempfile::tempdir().unwrap());
        (status, start.elapsed(), folder)
    }

    /// The files of a folder, and what lies in its `tmp`.
    pub(crate) fn files(folder: &Path) -> Vec<String> {
        let names = |path: PathBuf| {
            let entries = std::fs::read_dir(path).unwrap();
            let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
            names.collect::<Vec<_>>()
        };
        let mut all = names(folder.to_path_buf());
        all.extend(names(folder.join("tmp")));
        all.sort();
        all
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A stream of states.
pub(crate) struct Events(BufReader<TcpStream>);

impl Iterator for Events {
    type Item = Value;

    fn next(&mut self) -> Option<Value> {
        loop {
            let mut line = String::new();
            if self.0.read_line(&mut line).ok()? == 0 {
                return None;
            }
            if let Some(data) = line.strip_prefix("data: ") {
                return Some(serde_json::from_str(data).unwrap());
            }
        }
    }
}

/// Reads an answer to its end.
pub(crate) fn answer(stream: &mut TcpStream) -> Option<Answer> {
    let mut bytes = Vec::new();
    // What was sent before a reset counts.
    let _ = stream.read_to_end(&mut bytes);
    let at = bytes.windows(4).position(|w| w == b"\r\n\r\n")?;
    let head = String::from_utf8(bytes[..at].to_vec()).ok()?;
    Some(Answer {
        status: head.split(' ').nth(1)?.parse().ok()?,
        head,
        body: bytes[at + 4..].to_vec(),
    })
}

/// What `/light` says of the parts of a mesh.
pub(crate) struct Light {
    /// Mesh, shape, light.
    pub(crate) numbers: [u32; 3],
    /// For each part: vertices, ends of new midpoints, triangles.
    pub(crate) parts: Vec<(usize, Vec<u32>, Vec<u32>)>,
    /// Linear sRGB and lux.
    pub(crate) values: Vec<[f32; 4]>,
}

impl Program {
    /// The light as one sees it that has a shape of a mesh.
    pub(crate) fn light(&self, mesh: u32, had: u32) -> Light {
        let answer = self.get(&format!("/light?mesh={mesh}&had={had}"));
        assert_eq!(answer.status, 200, "{}", answer.text());
        let words: Vec<u32> = (answer.body.as_chunks::<4>().0.iter())
            .map(|b| u32::from_le_bytes(*b))
            .collect();
        let mut rest = &words[..];
        let mut take = |n: usize| {
            let (first, after) = rest.split_at(n);
            rest = after;
            first.to_vec()
        };
        let head = take(4);
        let sizes = take(3 * head[3] as usize);
        let sizes: Vec<&[u32]> = sizes.chunks(3).collect();
        let ends: Vec<_> = sizes.iter().map(|s| take(2 * s[1] as usize)).collect();
        let corners: Vec<_> = sizes.iter().map(|s| take(3 * s[2] as usize)).collect();
        let count = sizes.iter().map(|s| s[0] as usize);
        let counts: Vec<usize> = count.collect();
        let values = take(4 * counts.iter().sum::<usize>());
        assert!(rest.is_empty());
        Light {
            numbers: [head[0], head[1], head[2]],
            parts: (counts.into_iter().zip(ends).zip(corners))
                .map(|((n, e), c)| (n, e, c))
                .collect(),
            values: (values.chunks(4))
                .map(|v| std::array::from_fn(|k| f32::from_bits(v[k])))
                .collect(),
        }
    }

    /// The light that is shown now, with the whole of its mesh.
    pub(crate) fn light_now(&self) -> Light {
        let state = self.events().next().unwrap();
        self.light(state["picture"][0].as_u64().unwrap() as u32, 0)
    }
}

impl Light {
    pub(crate) fn mean_lux(&self) -> f64 {
        let lux = self.values.iter().map(|v| f64::from(v[3]));
        lux.sum::<f64>() / self.values.len() as f64
    }
}
