//! The live view: over HTTP as a page uses it, and in a browser, with the drive on the host and with the firmware in QEMU.
//!
//! `BRISTLE_PICTURE=FILE.png` keeps the picture that the book shows.
//! What needs `qemu-system-arm`, the target `thumbv7em-none-eabihf` or Chromium says so and passes where they are missing.
#![cfg(unix)]

mod browser;
mod cli;
#[allow(
    dead_code,
    unused_imports,
    reason = "the tests of the firmware use all of it"
)]
mod emulator;
mod port;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use browser::Browser;
use cli::Folder;
use emulator::runnable_images;
use port::OnPort;
use serde_json::{Value, json};

const AXIS: &str = "name = \"test axis\"\n[plant]\nmotion = \"rotary\"\ninput = \"torque\"\ngain = 1.0\ninertia = 0.012\n\
    [friction]\ncoulomb = 0.18\nviscous = 0.02\n";
const ON_HOST: &str = "--emulate axis.toml --limit 2 --compensate --on-host";
/// What the monitor promises of a link that is lost.
const A_SECOND: Duration = Duration::from_secs(1);
/// No test waits for longer, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(20);

/// A monitor that serves a page.
struct Running {
    child: Child,
    out: BufReader<ChildStdout>,
    address: String,
}

impl Running {
    fn start(folder: &Folder, options: &str) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_bristle"))
            .arg("monitor")
            .args(options.split_whitespace())
            .current_dir(folder.path(""))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
        let mut line = String::new();
        out.read_line(&mut line).expect("it speaks");
        let address = line.trim_end().strip_prefix("Monitor: ");
        let address = address.unwrap_or_else(|| panic!("{line:?}")).to_owned();
        Self {
            child,
            out,
            address,
        }
    }

    /// `127.0.0.1:PORT`
    fn host(&self) -> &str {
        self.address.split('/').nth(2).expect("a host")
    }

    /// `/TOKEN/`
    fn path(&self) -> String {
        format!("/{}/", self.address.split('/').nth(3).expect("a token"))
    }

    /// Sends a request; the answer's status, head and body.
    fn request(&self, method: &str, path: &str, headers: &str, body: &str) -> Reply {
        let mut stream = TcpStream::connect(self.host()).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a limit");
        let length = body.len();
        let text = format!(
            "{method} {path} HTTP/1.1\r\n{headers}Connection: close\r\nContent-Length: {length}\r\n\r\n{body}"
        );
        stream.write_all(text.as_bytes()).expect("it reads");
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).expect("it answers");
        let text = String::from_utf8_lossy(&bytes);
        let (head, body) = text.split_once("\r\n\r\n").expect("a head");
        let status = head.split(' ').nth(1).and_then(|s| s.parse().ok());
        Reply {
            status: status.expect("a status"),
            head: head.to_owned(),
            body: body.to_owned(),
        }
    }

    fn own_host(&self) -> String {
        format!("Host: {}\r\n", self.host())
    }

    fn post(&self, what: &str, body: &str) -> Reply {
        let path = format!("{}{what}", self.path());
        self.request("POST", &path, &self.own_host(), body)
    }

    /// Asks for something that is taken.
    fn ask(&self, what: &Value) {
        let reply = self.post("do", &what.to_string());
        assert_eq!(reply.status, 204, "{reply:?}");
    }

    fn watch(&self) -> Events {
        let mut stream = TcpStream::connect(self.host()).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a limit");
        let head = format!(
            "GET {}events HTTP/1.1\r\n{}\r\n",
            self.path(),
            self.own_host()
        );
        stream.write_all(head.as_bytes()).expect("it reads");
        Events(BufReader::new(stream))
    }

    fn signal(&self, name: &str) {
        kill(name, self.child.id());
    }

    /// The emulator that it has started.
    fn emulator(&self) -> u32 {
        let id = self.child.id();
        let begun = Instant::now();
        loop {
            let children = Command::new("pgrep").args(["-P", &id.to_string()]).output();
            let children = String::from_utf8(children.expect("pgrep starts").stdout).expect("text");
            if let Some(Ok(child)) = children.lines().next().map(str::parse) {
                return child;
            }
            assert!(begun.elapsed() < PATIENCE, "no emulator");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Ends it by a signal, and tells what it printed.
    fn close(mut self, signal: &str) -> String {
        self.signal(signal);
        let mut said = String::new();
        self.out.read_to_string(&mut said).expect("text");
        let status = self.child.wait().expect("it ends");
        assert!(status.success(), "{status}: {said}");
        said
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn kill(signal: &str, process: u32) {
    let sent = Command::new("kill")
        .args([signal, &process.to_string()])
        .status();
    assert!(sent.expect("kill starts").success());
}

#[derive(Debug)]
struct Reply {
    status: u16,
    head: String,
    body: String,
}

/// What a page is sent.
struct Events(BufReader<TcpStream>);

impl Events {
    /// The next event of a name.
    fn next(&mut self, name: &str) -> Value {
        loop {
            if self.line() == format!("event: {name}") {
                let data = self.line();
                let data = data.strip_prefix("data: ").expect("data");
                return serde_json::from_str(data).expect("JSON");
            }
        }
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        let read = self.0.read_line(&mut line).expect("the monitor goes on");
        assert!(read > 0, "the monitor has closed the line");
        line.trim_end().to_owned()
    }

    /// Waits for an event of which something is true.
    fn until(&mut self, what: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let now = self.next("now");
            if what(&now) {
                return now;
            }
            assert!(begun.elapsed() < PATIENCE, "{now}");
        }
    }

    fn until_state(&mut self, state: &str) -> Value {
        self.until(|now| now["status"]["state"] == state)
    }

    /// Turns the axis on and lets it turn at a velocity.
    fn turn(&mut self, monitor: &Running, velocity: f64) {
        monitor.ask(&json!("enable"));
        self.until(|now| now["status"]["armed"] == true);
        monitor.ask(&json!({ "aim": { "velocity": velocity } }));
        self.until(|now| last(now, "velocity").is_some_and(|v| (v - velocity).abs() < 0.1));
    }
}

/// The last value of a signal in an event.
fn last(now: &Value, signal: &str) -> Option<f64> {
    let names = [
        "input", "position", "velocity", "current", "bus", "error", "friction", "coulomb",
    ];
    let at = names
        .iter()
        .position(|name| *name == signal)
        .expect("a signal");
    now["values"][at].as_array()?.last()?.as_f64()
}

fn has_note(now: &Value, part: &str) -> bool {
    let notes = now["notes"].as_array().expect("notes");
    notes.iter().any(|note| {
        note["text"]
            .as_str()
            .is_some_and(|text| text.contains(part))
    })
}

fn bench() -> Folder {
    let folder = Folder::new();
    folder.write("axis.toml", AXIS);
    folder
}

#[test]
fn only_the_page_of_this_monitor_on_this_machine_is_served() {
    let folder = bench();
    let monitor = Running::start(&folder, ON_HOST);
    let (path, host) = (monitor.path(), monitor.own_host());
    let page = monitor.request("GET", &path, &host, "");
    assert_eq!(page.status, 200);
    for header in [
        "Content-Security-Policy: default-src 'none'; script-src 'nonce-",
        "frame-ancestors 'none'",
        "Cache-Control: no-store",
        "X-Content-Type-Options: nosniff",
        "Referrer-Policy: no-referrer",
    ] {
        assert!(page.head.contains(header), "{header} in {}", page.head);
    }
    assert!(!page.head.contains("unsafe"), "{}", page.head);

    let foreign = "Host: evil.example\r\n";
    let other = format!("{host}Origin: http://evil.example\r\n");
    let wrong = format!("/{}/", "0".repeat(32));
    for (method, path, headers) in [
        ("GET", "/", &*host),
        ("GET", &*wrong, &*host),
        ("GET", &*format!("{wrong}events"), &*host),
        ("POST", "/stop", &*host),
        ("POST", &*format!("{wrong}do"), &*host),
        ("GET", &*path, foreign),
        ("GET", &*path, ""),
        ("POST", &*format!("{path}stop"), &*other),
        ("POST", &*format!("{path}do"), foreign),
    ] {
        let reply = monitor.request(method, path, headers, "");
        assert_eq!(reply.status, 403, "{method} {path} {headers}");
        assert!(!reply.body.contains("script"), "{}", reply.body);
    }
    assert_eq!(
        monitor
            .request("GET", &format!("{path}stop"), &host, "")
            .status,
        405
    );
    assert_eq!(
        monitor
            .request("GET", &format!("{path}none"), &host, "")
            .status,
        404
    );
    for bad in ["", "{}", "\"explode\"", "[", "{\"aim\":\"velocity\"}"] {
        assert_eq!(monitor.post("do", bad).status, 400, "{bad}");
    }
    assert!(monitor.close("-INT").contains("The axis was off."));
}

/// Every address at which this process' socket listens, as the kernel lists them.
#[test]
#[cfg(target_os = "linux")]
fn it_listens_on_the_loopback_interface_alone() {
    let folder = bench();
    let monitor = Running::start(&folder, ON_HOST);
    let port: u16 = monitor
        .host()
        .split(':')
        .nth(1)
        .and_then(|p| p.parse().ok())
        .expect("a port");
    let listening = |table: &str| -> Vec<String> {
        const LISTEN: &str = "0A";
        let table = std::fs::read_to_string(table).unwrap_or_default();
        let rows = table
            .lines()
            .map(|line| line.split_whitespace().collect::<Vec<_>>());
        rows.filter(|row| row.len() > 3 && row[3] == LISTEN)
            .filter(|row| row[1].ends_with(&format!(":{port:04X}")))
            .map(|row| row[1].to_owned())
            .collect()
    };
    assert_eq!(listening("/proc/net/tcp"), [format!("0100007F:{port:04X}")]);
    assert!(listening("/proc/net/tcp6").is_empty());
}

/// Reads three thousand samples of eight signals; each comes once, in order, and none is lost.
fn see_every_period(monitor: &Running) {
    let mut events = monitor.watch();
    let about = events.next("about");
    assert_eq!(about["signals"].as_array().map(Vec::len), Some(8));
    assert!((about["rate"].as_f64().expect("a rate") - 1000.0).abs() < 1e-6);
    assert_eq!(
        (&about["every"], &about["harmless"]),
        (&json!(1), &json!(false))
    );
    let mut periods: Vec<u64> = Vec::new();
    while periods.len() < 3000 {
        let now = events.next("now");
        let new = now["periods"].as_array().expect("periods");
        let values = now["values"].as_array().expect("values");
        assert!(
            values.len() == 8
                && values
                    .iter()
                    .all(|v| v.as_array().map(Vec::len) == Some(new.len()))
        );
        periods.extend(new.iter().filter_map(Value::as_u64));
        let none = json!({ "telemetry": 0, "damaged": 0, "commands": 0 });
        assert_eq!(
            (&now["status"]["losses"], &now["skipped"]),
            (&none, &json!(0))
        );
    }
    assert!(periods.windows(2).all(|pair| pair[1] == pair[0] + 1));
}

#[test]
fn telemetry_of_a_thousand_periods_a_second_comes_without_loss() {
    see_every_period(&Running::start(&bench(), ON_HOST));
    if let Some(images) = runnable_images() {
        let image = images.firmware.display();
        let options = format!("--emulate axis.toml --limit 2 --image {image}");
        see_every_period(&Running::start(&bench(), &options));
    }
}

#[test]
fn the_axis_turns_as_asked_and_stop_stops_it() {
    let folder = bench();
    let monitor = Running::start(&folder, ON_HOST);
    let mut events = monitor.watch();
    events.turn(&monitor, 0.9);
    // What was asked for just before a stop is not carried out after it.
    monitor.ask(&json!({ "aim": { "velocity": -0.9 } }));
    assert_eq!(monitor.post("stop", "").status, 204);
    let off = events.until_state("Off");
    assert_eq!(
        (&off["status"]["armed"], &off["status"]["aim"]),
        (&json!(false), &json!("off"))
    );
    events.until(|now| now["status"]["stopping"] == false && last(now, "velocity") == Some(0.0));
    assert_eq!(last(&events.next("now"), "input"), Some(0.0));

    // An axis that is off takes no wishes.
    monitor.ask(&json!({ "aim": { "velocity": 0.5 } }));
    events.until(|now| has_note(now, "turn the axis on"));
    events.turn(&monitor, -0.5);
    monitor.ask(&json!({ "aim": { "velocity": 50.0 } }));
    events.until(|now| has_note(now, "beyond the limit"));
    monitor.ask(&json!({ "aim": { "position": 0.25 } }));
    let there = |now: &Value| last(now, "position").is_some_and(|q| (q - 0.25).abs() < 2e-3);
    events.until(there);
    assert!(monitor.close("-TERM").contains("confirmed that it is off"));
}

#[test]
fn an_axis_that_nobody_watches_is_turned_off() {
    let folder = bench();
    let monitor = Running::start(&folder, ON_HOST);
    let mut events = monitor.watch();
    events.turn(&monitor, 0.5);
    drop(events);
    std::thread::sleep(2 * A_SECOND);
    let mut events = monitor.watch();
    assert!(has_note(&events.until_state("Off"), "nobody watches"));
}

#[test]
fn a_fault_is_shown_until_it_is_cleared() {
    let folder = bench();
    // So light and strong that the encoder passes more counts in a period than one that is sound.
    folder.write(
        "axis.toml",
        AXIS.replace("inertia = 0.012", "inertia = 0.0001"),
    );
    let monitor = Running::start(
        &folder,
        &ON_HOST.replace("--limit 2", "--limit 90 --bandwidth 1"),
    );
    let mut events = monitor.watch();
    monitor.ask(&json!("enable"));
    events.until(|now| now["status"]["armed"] == true);
    monitor.ask(&json!({ "aim": { "input": 90.0 } }));
    let now = events.until_state("Faulted");
    let faults = now["status"]["faults"].as_array().expect("faults");
    assert!(faults.contains(&json!("encoder-jump")), "{now}");
    assert_eq!(now["status"]["armed"], false);
    monitor.ask(&json!("enable"));
    events.until(|now| has_note(now, "clear them first"));
    // While the axis still turns so fast, the fault comes back.
    let begun = Instant::now();
    loop {
        monitor.ask(&json!("clear"));
        let now = events.next("now");
        if now["status"]["state"] == "Off" && now["status"]["faults"] == json!([]) {
            break;
        }
        assert!(begun.elapsed() < PATIENCE, "{now}");
    }
}

#[test]
fn a_recording_is_one_that_identify_reads() {
    let folder = bench();
    let monitor = Running::start(&folder, ON_HOST);
    let mut events = monitor.watch();
    events.turn(&monitor, 0.2);
    monitor.ask(&json!("record"));
    for velocity in [-0.9, 0.9, -0.3, 0.6, -0.9] {
        monitor.ask(&json!({ "aim": { "velocity": velocity } }));
        let rows = events.next("now")["status"]["recording"]
            .as_u64()
            .unwrap_or(0);
        events.until(|now| now["status"]["recording"].as_u64() > Some(rows + 800));
    }
    monitor.ask(&json!("save"));
    events.until(|now| has_note(now, "monitor-1.csv"));
    monitor.ask(&json!("record"));
    events.until(|now| now["status"]["recording"].as_u64() > Some(250));
    // What is being recorded when it is closed is saved.
    let said = monitor.close("-INT");
    assert!(
        said.contains("monitor-2.csv") && said.contains("without a gap"),
        "{said}"
    );
    let recording = folder.read("monitor-1.csv");
    assert!(
        recording.starts_with("t[s],u[N*m],q[rad]\n0.0,"),
        "{}",
        &recording[..40]
    );
    folder.write(
        "free.toml",
        AXIS.replace("0.012", "\"?\"")
            .replace("0.18", "\"?\"")
            .replace("0.02", "\"?\""),
    );
    folder.done("identify monitor-1.csv --model free.toml --json fit.json");
    let fit = folder.json("fit.json");
    let value = |name: &str| {
        fit["parameters"][name]["value"]
            .as_f64()
            .unwrap_or_else(|| panic!("{fit}"))
    };
    // Nothing disturbs this axis but the encoder's counts: a tenth is far beyond what they do.
    assert!((value("inertia") / 0.012 - 1.0).abs() < 0.1, "{fit}");
    assert!((value("coulomb") / 0.18 - 1.0).abs() < 0.1, "{fit}");
}

#[test]
fn a_lost_link_shows_within_a_second_and_comes_back_by_itself() {
    let Some(images) = runnable_images() else {
        return;
    };
    let folder = bench();
    let image = images.firmware.display();
    let monitor = Running::start(
        &folder,
        &format!("--emulate axis.toml --limit 2 --image {image}"),
    );
    let mut events = monitor.watch();
    // One that hangs, and one that is gone.
    for (blow, cure) in [("-STOP", Some("-CONT")), ("-KILL", None)] {
        events.turn(&monitor, 0.5);
        let emulator = monitor.emulator();
        let begun = Instant::now();
        kill(blow, emulator);
        let lost = events.until(|now| now["status"]["link"] == false);
        assert!(begun.elapsed() < A_SECOND, "{blow}: {:?}", begun.elapsed());
        assert_eq!(lost["status"]["state"], Value::Null);
        cure.into_iter().for_each(|cure| kill(cure, emulator));
        let back =
            events.until(|now| now["status"]["link"] == true && now["status"]["state"] == "Off");
        assert_eq!(back["status"]["armed"], false, "{back}");
    }
    assert!(monitor.close("-INT").contains("The axis was off."));
}

#[test]
fn a_board_on_a_serial_port_is_watched_and_listed() {
    let Some(images) = runnable_images() else {
        return;
    };
    let board = OnPort::start(&images.firmware);
    let folder = bench();
    let listed = folder.done(&format!("ports {} --json ports.json", board.port));
    assert!(listed.contains("an emulated board, firmware"), "{listed}");
    let found = &folder.json("ports.json")["ports"][0];
    assert_eq!(
        (&found["name"], &found["found"]["kind"]),
        (&json!(board.port), &json!("board"))
    );

    let monitor = Running::start(&folder, &board.port);
    let mut events = monitor.watch();
    // A line of 115,200 bits a second carries no thousand frames, and this board has no period before it is set up.
    assert_eq!(events.next("about")["harmless"], true);
    events.until_state("Off");
    let begun = Instant::now();
    drop(board);
    events.until(|now| now["status"]["link"] == false);
    assert!(begun.elapsed() < A_SECOND, "{:?}", begun.elapsed());
    assert!(monitor.close("-INT").contains("The axis was off."));
}

#[test]
fn what_cannot_be_watched_or_listed_says_why() {
    let folder = bench();
    folder.write(
        "unknown.toml",
        AXIS.replace("inertia = 0.012", "inertia = \"?\""),
    );
    for (line, part) in [
        ("monitor no/port", "no/port"),
        ("monitor axis.toml", "axis.toml"),
        ("monitor --emulate axis.toml", "--limit"),
        (
            "monitor --emulate none.toml --limit 2 --on-host",
            "none.toml",
        ),
        (
            "monitor --emulate unknown.toml --limit 2 --on-host",
            "inertia",
        ),
        ("monitor --emulate axis.toml --limit 0 --on-host", "--limit"),
        (
            "monitor --emulate axis.toml --limit 2 --on-host --speed -1",
            "--speed",
        ),
        (
            "monitor --emulate axis.toml --limit 2 --on-host --folder nowhere",
            "nowhere",
        ),
        (
            "monitor --emulate axis.toml --limit 2 --on-host --tui",
            "--tui needs a terminal",
        ),
        (
            "monitor --emulate axis.toml --limit 2 --on-host --image x.elf",
            "--image",
        ),
        ("ports --json nowhere/ports.json", "nowhere"),
    ] {
        let ran = folder.run(line);
        assert!(
            ran.status == 2 && ran.stderr.contains(part),
            "{line}: {ran:?}"
        );
    }
    let nothing = folder.done("ports no/port");
    assert!(nothing.contains("cannot be opened"), "{nothing}");
}

/// As [`Folder`], on a machine with emulator and browser.
fn page(folder: &Folder) -> Option<(Running, Browser)> {
    let image = runnable_images()?.firmware.display().to_string();
    let monitor = Running::start(
        folder,
        &format!("--emulate axis.toml --limit 2 --compensate --image {image}"),
    );
    let browser = Browser::open(&monitor.address)?;
    Some((monitor, browser))
}

const VELOCITY: &str =
    "Number(document.getElementById('v-velocity').textContent.replace('−', '-'))";

fn turn(browser: &mut Browser, velocity: f64) {
    browser.wait("!document.getElementById('enable').disabled");
    browser.click("enable");
    browser.wait("!document.getElementById('value').disabled");
    browser.value(&format!(
        "document.getElementById('value').value = '{velocity}'; document.querySelector('#ask button[type=submit]').click()"
    ));
    browser.wait(&format!("Math.abs({VELOCITY} - {velocity}) < 0.1"));
}

#[test]
fn in_a_browser_values_move_stop_stops_and_nothing_is_fetched_from_elsewhere() {
    let folder = bench();
    let Some((monitor, mut browser)) = page(&folder) else {
        return;
    };
    browser.wait("document.getElementById('link')?.textContent === 'up'");
    assert_eq!(browser.text("axis"), "test axis");
    assert_eq!(browser.text("state"), "off");
    turn(&mut browser, 0.8);
    let before = browser.text("v-position");
    browser.wait(&format!(
        "document.getElementById('v-position').textContent !== '{before}'"
    ));
    // Four plots, each with something drawn on it.
    let drawn = "[...document.querySelectorAll('canvas')].filter((c) => new Uint32Array(c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer).some((p) => p !== 0)).length";
    browser.wait(&format!("{drawn} === 4"));
    if let Some(path) = std::env::var_os("BRISTLE_PICTURE") {
        std::thread::sleep(Duration::from_secs(4));
        browser.picture(Path::new(&path));
    }
    browser.click("stop");
    browser.wait("document.getElementById('state').textContent === 'off'");
    browser.wait(&format!("{VELOCITY} === 0"));
    // The space bar stops as well, wherever the focus is.
    turn(&mut browser, -0.8);
    browser.press(" ", "Space");
    browser.wait("document.getElementById('state').textContent === 'off'");
    assert_eq!(browser.text("lost"), "0");

    for request in browser.events("Network.requestWillBeSent") {
        let url = request["request"]["url"].as_str().expect("an address");
        assert!(
            url.starts_with(&monitor.address) || url.starts_with("data:"),
            "{url}"
        );
    }
    let complaints = ["Runtime.exceptionThrown", "Log.entryAdded"].map(|kind| browser.events(kind));
    assert!(complaints.iter().all(Vec::is_empty), "{complaints:?}");
}

#[test]
fn in_a_browser_a_lost_link_shows_within_a_second_and_comes_back() {
    let folder = bench();
    let Some((monitor, mut browser)) = page(&folder) else {
        return;
    };
    turn(&mut browser, 0.5);
    let emulator = monitor.emulator();
    kill("-STOP", emulator);
    let took = browser.wait("document.getElementById('link').textContent === 'lost'");
    assert!(took < A_SECOND, "{took:?}");
    assert!(
        browser.text("alarm").contains("lost"),
        "{}",
        browser.text("alarm")
    );
    kill("-CONT", emulator);
    browser.wait("document.getElementById('link').textContent === 'up' && document.getElementById('alarm').hidden");
    browser.wait("document.getElementById('state').textContent === 'off'");
    // A closed page leaves the axis off, and so does a closed monitor.
    turn(&mut browser, 0.5);
    assert!(monitor.close("-INT").contains("confirmed that it is off"));
    browser.wait("document.getElementById('link').textContent === 'closed'");
    assert_eq!(
        browser.text("alarm"),
        "The monitor was closed. The axis is off."
    );
}
