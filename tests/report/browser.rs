//! A headless Chromium on two pipes: the DevTools protocol, messages of JSON that end in a zero byte.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// The picture, as an expression.
pub(crate) const CANVAS: &str = "document.getElementById('canvas')";
/// A page has this long to be ready: drawn in software, beside other tests.
const PATIENCE: Duration = Duration::from_secs(300);
/// The pipes go to descriptors 3 and 4, where the browser looks for them.
const START: &str = "exec \"$0\" --headless=new --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader \
    --remote-debugging-pipe --no-first-run --user-data-dir=\"$1\" 3<&0 4>&1 </dev/null >/dev/null 2>/dev/null";

/// A browser with one page.
pub(crate) struct Browser {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    session: Option<String>,
    sent: u64,
    faults: Vec<String>,
    /// Addresses that may be asked begin with one of these.
    own: Vec<String>,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// The name of a browser that is there.
    pub(crate) fn program() -> Option<&'static str> {
        let there = |name: &&str| {
            let found = Command::new(name).arg("--version").output();
            found.is_ok_and(|output| output.status.success())
        };
        let names = ["chromium", "chromium-browser", "google-chrome"];
        names.into_iter().find(there)
    }

    /// Starts the browser; none if there is none.
    pub(crate) fn start() -> Option<Self> {
        let program = Self::program()?;
        let profile = tempfile::tempdir().unwrap();
        let mut child = Command::new("sh")
            .args(["-c", START, program, profile.path().to_str()?])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .ok()?;
        let (to, from) = (child.stdin.take()?, BufReader::new(child.stdout.take()?));
        let mut browser = Self {
            child,
            to,
            from,
            session: None,
            sent: 0,
            faults: Vec::new(),
            own: ["file:", "data:", "blob:"].map(str::to_owned).to_vec(),
            _profile: profile,
        };
        let target = browser.send("Target.createTarget", &json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let session = browser.send("Target.attachToTarget", &attach);
        browser.session = session["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.send(&format!("{domain}.enable"), &json!({}));
        }
        Some(browser)
    }

    /// Sends a command; its result. What happens meanwhile is looked over for faults.
    fn send(&mut self, method: &str, params: &Value) -> Value {
        self.sent += 1;
        let mut message = json!({ "id": self.sent, "method": method, "params": params });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.to
            .write_all(format!("{message}\0").as_bytes())
            .unwrap();
        loop {
            let mut bytes = Vec::new();
            self.from.read_until(0, &mut bytes).unwrap();
            assert_eq!(bytes.pop(), Some(0), "the browser has gone ({method})");
            let mut answer: Value = serde_json::from_slice(&bytes).unwrap();
            if answer["id"] == json!(self.sent) {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].take();
            }
            self.look(&answer);
        }
    }

    fn look(&mut self, event: &Value) {
        let params = &event["params"];
        let url = params["request"]["url"].as_str().unwrap_or("");
        let own = self.own.iter().any(|own| url.starts_with(own));
        let fault = match event["method"].as_str().unwrap_or("") {
            "Runtime.exceptionThrown" => true,
            "Runtime.consoleAPICalled" => params["type"] == "error" || params["type"] == "warning",
            "Log.entryAdded" => params["entry"]["level"] == "error",
            "Network.requestWillBeSent" => !own,
            _ => false,
        };
        if fault {
            self.faults.push(event.to_string());
        }
    }

    pub(crate) fn open(&mut self, page: &Path) {
        self.go(&format!("file://{}", page.display()));
    }

    /// Opens a page of a server; it may ask that server.
    pub(crate) fn visit(&mut self, address: &str) {
        let server = address.split_inclusive('/').take(3).collect();
        self.own.push(server);
        self.go(address);
    }

    fn go(&mut self, url: &str) {
        self.send("Page.navigate", &json!({ "url": url }));
    }

    /// Writes a PNG of the window where SCREENS names a folder, to be looked at.
    pub(crate) fn screen(&mut self, name: &str) {
        if let Some(folder) = std::env::var_os("SCREENS") {
            let shot = self.send("Page.captureScreenshot", &json!({}));
            let text = shot["data"].as_str().unwrap_or_default();
            std::fs::write(Path::new(&folder).join(name), text).unwrap();
        }
    }

    /// Runs an expression; what it gives, as text.
    pub(crate) fn run(&mut self, expression: &str) -> String {
        let params =
            json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let result = self.send("Runtime.evaluate", &params);
        assert!(
            result["exceptionDetails"].is_null(),
            "{expression}: {result}"
        );
        match &result["result"]["value"] {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        }
    }

    pub(crate) fn text(&mut self, id: &str) -> String {
        self.run(&format!("document.getElementById('{id}').textContent"))
    }

    pub(crate) fn wait_for(&mut self, condition: &str) {
        let start = Instant::now();
        while self.run(condition) != "true" {
            assert!(
                start.elapsed() < PATIENCE,
                "{condition}: {:#?}",
                self.faults
            );
            std::thread::sleep(Duration::from_millis(50));
        }
        self.drawn();
    }

    /// Waits for what was asked for to be drawn.
    pub(crate) fn drawn(&mut self) {
        self.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))");
    }

    /// Presses a key and lets it go.
    pub(crate) fn press(&mut self, key: &str, code: &str, number: u32) {
        for kind in ["rawKeyDown", "keyUp"] {
            let params =
                json!({ "type": kind, "key": key, "code": code, "windowsVirtualKeyCode": number });
            self.send("Input.dispatchKeyEvent", &params);
        }
        self.drawn();
    }

    /// The picture at 64 x 48 pixels: red, green, blue, 0 to 255.
    pub(crate) fn pixels(&mut self) -> Vec<f64> {
        let text = self.run(&format!(
            "(() => {{ const small = document.createElement('canvas'); [small.width, small.height] = [64, 48];
               const pen = small.getContext('2d'); pen.drawImage({CANVAS}, 0, 0, 64, 48);
               return pen.getImageData(0, 0, 64, 48).data.filter((_, k) => k % 4 !== 3).join(' '); }})()"
        ));
        text.split(' ').map(|p| p.parse().unwrap()).collect()
    }

    pub(crate) fn prefer_dark(&mut self) {
        let dark = json!({ "features": [{ "name": "prefers-color-scheme", "value": "dark" }] });
        self.send("Emulation.setEmulatedMedia", &dark);
    }

    /// Takes out the one fault that tells of this, which has to be there.
    pub(crate) fn expect_fault(&mut self, of: &str) {
        let before = self.faults.len();
        self.faults.retain(|fault| !fault.contains(of));
        assert_eq!(self.faults.len() + 1, before, "{of}: {:#?}", self.faults);
    }

    /// Exceptions, errors and warnings on the console, requests to elsewhere.
    pub(crate) fn faults(&self) -> &[String] {
        &self.faults
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // The first process takes the others with it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
