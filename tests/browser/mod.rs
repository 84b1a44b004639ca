//! A headless Chromium, driven by its `DevTools` protocol over a pair of pipes.

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

/// What it is called, from distribution to distribution.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "chrome"];

/// A page in a browser of its own, ended when dropped.
pub struct Browser {
    child: Child,
    to: File,
    from: BufReader<File>,
    number: u32,
    session: String,
    /// What the browser told without being asked.
    events: Vec<Value>,
    _profile: TempDir,
}

impl Browser {
    /// Opens a page; `None`, with a message, on a machine without Chromium.
    pub fn open(address: &str) -> Option<Self> {
        let Some(name) = NAMES.into_iter().find(|name| is_installed(name)) else {
            // Written to the stream itself, as the test harness hides what passing tests print.
            let _ = writeln!(
                std::io::stderr(),
                "skipped: missing chromium (Debian, Ubuntu: apt-get install chromium)"
            );
            return None;
        };
        let profile = tempfile::tempdir().expect("a temporary folder");
        let mut browser = Self::start(name, profile);
        let target = browser.call("Target.createTarget", &json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let attached = browser.call("Target.attachToTarget", &attach);
        browser.session = attached["sessionId"]
            .as_str()
            .expect("a session")
            .to_owned();
        for domain in ["Page", "Runtime", "Network", "Log"] {
            browser.call(&format!("{domain}.enable"), &json!({}));
        }
        let size =
            json!({ "width": 1400, "height": 1000, "deviceScaleFactor": 1, "mobile": false });
        browser.call("Emulation.setDeviceMetricsOverride", &size);
        browser.call("Page.navigate", &json!({ "url": address }));
        browser.wait(&format!(
            "location.href === '{address}' && document.readyState === 'complete'"
        ));
        Some(browser)
    }

    /// Chromium reads its commands from descriptor 3 and answers on 4.
    fn start(name: &str, profile: TempDir) -> Self {
        let pipes = ["to", "from"].map(|pipe| profile.path().join(pipe));
        let made = Command::new("mkfifo").args(&pipes).status();
        assert!(made.expect("mkfifo starts").success());
        let line = format!(
            "exec {name} --headless=new --no-sandbox --disable-gpu --no-first-run --disable-background-networking \
             --disable-component-update --disable-dev-shm-usage --remote-debugging-pipe --user-data-dir=\"$1/profile\" 3<\"$1/to\" 4>\"$1/from\""
        );
        let child = Command::new("sh")
            .args(["-c", &line, "sh"])
            .arg(profile.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("a shell starts");
        // Each waits for the other end, in the order of the line.
        let to = File::options().write(true).open(&pipes[0]);
        let from = File::open(&pipes[1]);
        Self {
            child,
            to: to.expect("a pipe"),
            from: BufReader::new(from.expect("a pipe")),
            number: 0,
            session: String::new(),
            events: Vec::new(),
            _profile: profile,
        }
    }

    fn call(&mut self, method: &str, parameters: &Value) -> Value {
        self.number += 1;
        let mut message = json!({ "id": self.number, "method": method, "params": parameters });
        if !self.session.is_empty() {
            message["sessionId"] = json!(self.session);
        }
        let mut bytes = message.to_string().into_bytes();
        bytes.push(0);
        self.to.write_all(&bytes).expect("the browser listens");
        loop {
            let message = self.receive();
            if message["id"] == self.number {
                assert!(message["error"].is_null(), "{method}: {message}");
                return message["result"].clone();
            }
            self.events.push(message);
        }
    }

    fn receive(&mut self) -> Value {
        let mut bytes = Vec::new();
        let read = self
            .from
            .read_until(0, &mut bytes)
            .expect("the browser answers");
        assert!(read > 0, "the browser has ended");
        bytes.pop();
        serde_json::from_slice(&bytes).expect("it answers in JSON")
    }

    /// The value of an expression on the page.
    pub fn value(&mut self, expression: &str) -> Value {
        let what = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let result = self.call("Runtime.evaluate", &what);
        assert!(
            result["exceptionDetails"].is_null(),
            "{expression}: {result}"
        );
        result["result"]["value"].clone()
    }

    /// The text of an element.
    pub fn text(&mut self, id: &str) -> String {
        let text = self.value(&format!(
            "document.getElementById('{id}')?.textContent ?? ''"
        ));
        text.as_str().expect("a text").to_owned()
    }

    /// Waits until an expression is true, and tells how long it took.
    pub fn wait(&mut self, expression: &str) -> Duration {
        let begun = Instant::now();
        while self.value(expression) != true {
            if begun.elapsed() > Duration::from_secs(20) {
                let page = self.value("document.body.innerText");
                panic!("never: {expression}\n{page}");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        begun.elapsed()
    }

    /// Clicks at an element as a mouse does: what lies above it would take the click.
    pub fn click(&mut self, id: &str) {
        let place = self.value(&format!(
            "(() => {{ const e = document.getElementById('{id}'); e.scrollIntoView({{ block: 'nearest' }}); const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; }})()"
        ));
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({ "type": kind, "x": place[0], "y": place[1], "button": "left", "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", &event);
        }
    }

    /// Presses a key.
    pub fn press(&mut self, key: &str, code: &str) {
        for kind in ["keyDown", "keyUp"] {
            let event = json!({ "type": kind, "key": key, "code": code });
            self.call("Input.dispatchKeyEvent", &event);
        }
    }

    /// What the browser has told of a kind so far.
    pub fn events(&mut self, method: &str) -> Vec<Value> {
        // Whatever is still on its way comes before the answer to this.
        self.value("1");
        let all = self.events.iter().filter(|event| event["method"] == method);
        all.map(|event| event["params"].clone()).collect()
    }

    /// Keeps a picture of the page, as PNG.
    pub fn picture(&mut self, path: &Path) {
        let shot = self.call("Page.captureScreenshot", &json!({ "format": "png" }));
        let picture = decoded(shot["data"].as_str().expect("a picture"));
        std::fs::write(path, picture).expect("writes");
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Bytes from base 64 (RFC 4648).
fn decoded(text: &str) -> Vec<u8> {
    let six = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let digits: Vec<u8> = text.bytes().filter(|c| *c != b'=').map(six).collect();
    let word = |four: &[u8]| four.iter().fold(0, |word, six| word << 6 | u32::from(*six));
    let bytes = digits.chunks(4).flat_map(|four| {
        let missing = 4 - four.len();
        let bytes = (word(four) << (6 * missing)).to_be_bytes();
        bytes[1..4 - missing].to_vec()
    });
    bytes.collect()
}

fn is_installed(name: &str) -> bool {
    let asked = Command::new(name)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    asked.is_ok_and(|status| status.success())
}
