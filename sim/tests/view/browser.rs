//! A headless Chromium, driven by WebDriver (W3C), as much of it as the tests need.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Set where a missing browser is a failure.
const REQUIRED: &str = "YAWARA_REQUIRE_BROWSER";

/// How long anything may take that is waited for, on a machine that has other work.
const PATIENCE: Duration = Duration::from_secs(120);

/// A driver with one browser; both end with it.
pub struct Browser {
    driver: Child,
    port: u16,
    session: String,
}

impl Browser {
    /// One of this size in pixels, or none with a printed reason where there is no browser.
    pub fn open(width: u32, height: u32) -> Option<Self> {
        let chromium = ["chromium", "chromium-browser", "google-chrome"]
            .into_iter()
            .find(|name| is_there(name) && is_there("chromedriver"));
        if chromium.is_none() {
            assert!(std::env::var_os(REQUIRED).is_none(), "no chromium with chromedriver");
            println!("SKIP: no chromium with chromedriver on the PATH to open the page in");
            return None;
        }
        let mut driver = Command::new("chromedriver")
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("chromedriver starts");
        let mut lines = BufReader::new(driver.stdout.take().expect("piped")).lines();
        let port = lines.by_ref().map_while(Result::ok).find_map(|line| {
            line.split("successfully on port ").nth(1)?.trim_end_matches('.').parse().ok()
        });
        // Read on, so that the driver does not stop at a full pipe.
        std::thread::spawn(move || lines.for_each(drop));
        let mut browser = Self {
            driver,
            port: port.expect("chromedriver says its port"),
            session: String::new(),
        };
        let arguments = [
            "--headless=new".to_owned(),
            "--no-sandbox".into(),
            "--use-gl=angle".into(),
            "--use-angle=swiftshader".into(),
            "--enable-unsafe-swiftshader".into(),
            "--ignore-gpu-blocklist".into(),
            format!("--window-size={width},{height}"),
        ];
        let options = json!({ "args": arguments });
        let wanted = json!({ "capabilities": { "alwaysMatch": {
            "browserName": "chrome", "goog:chromeOptions": options,
        } } });
        let made = browser.ask("POST", "/session", Some(&wanted));
        browser.session = made["sessionId"].as_str().expect("a session").to_owned();
        Some(browser)
    }

    fn ask(&self, method: &str, path: &str, body: Option<&Value>) -> Value {
        let text = self.send(method, path, body).expect("chromedriver answers");
        let value: Value = serde_json::from_slice(&text).expect("JSON");
        let value = value["value"].clone();
        assert!(value["error"].is_null(), "{path}: {} {}", value["error"], value["message"]);
        value
    }

    /// The body of the answer.
    fn send(&self, method: &str, path: &str, body: Option<&Value>) -> io::Result<Vec<u8>> {
        let body = body.map_or(String::new(), Value::to_string);
        let mut stream = TcpStream::connect(("127.0.0.1", self.port))?;
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: localhost:{}\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\nConnection: close\r\n\r\n",
            self.port,
            body.len()
        );
        stream.write_all((head + &body).as_bytes())?;
        stream.set_read_timeout(Some(PATIENCE))?;
        let mut answer = BufReader::new(stream);
        let mut length = 0;
        loop {
            let mut line = String::new();
            answer.read_line(&mut line)?;
            if let Some((name, value)) = line.split_once(':')
                && name.eq_ignore_ascii_case("content-length")
            {
                length = value.trim().parse().map_err(io::Error::other)?;
            }
            if line.trim().is_empty() {
                break;
            }
        }
        let mut text = vec![0; length];
        answer.read_exact(&mut text)?;
        Ok(text)
    }

    fn command(&self, path: &str, body: &Value) -> Value {
        self.ask("POST", &format!("/session/{}/{path}", self.session), Some(body))
    }

    /// Makes pages as narrow as this many CSS pixels, dark or not.
    pub fn emulate(&self, width: u32, dark: bool) {
        let scheme = if dark { "dark" } else { "light" };
        let features = [json!({ "name": "prefers-color-scheme", "value": scheme })];
        self.devtools("Emulation.setEmulatedMedia", &json!({ "features": features }));
        let size = json!({ "width": width, "height": 700, "deviceScaleFactor": 1, "mobile": true });
        self.devtools("Emulation.setDeviceMetricsOverride", &size);
    }

    /// A command of Chromium's own.
    pub fn devtools(&self, command: &str, parameters: &Value) {
        self.command("goog/cdp/execute", &json!({ "cmd": command, "params": parameters }));
    }

    pub fn go(&self, url: &str) {
        self.command("url", &json!({ "url": url }));
    }

    /// The value of a function's body in the page.
    pub fn run(&self, script: &str) -> Value {
        self.command("execute/sync", &json!({ "script": script, "args": [] }))
    }

    /// Waits until an expression in the page is true.
    pub fn wait(&self, expression: &str) {
        let begin = Instant::now();
        while self.run(&format!("return Boolean({expression})")) != true {
            let state =
                || self.run("return JSON.stringify([yawara.last, document.body.innerText])");
            assert!(begin.elapsed() < PATIENCE, "never true: {expression}\n{}", state());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Presses the pointer at a place (CSS pixels), and moves it through others.
    pub fn drag(&self, from: [f64; 2], through: &[[f64; 2]]) {
        self.pointer(vec![to(from, 0), json!({ "type": "pointerDown", "button": 0 })]);
        self.drag_on(through);
    }

    /// Moves the pointer on, a tenth of a second from place to place.
    pub fn drag_on(&self, through: &[[f64; 2]]) {
        self.pointer(through.iter().map(|&at| to(at, 100)).collect());
    }

    /// A PNG of the window.
    pub fn screenshot(&self) -> Vec<u8> {
        let text = self.ask("GET", &format!("/session/{}/screenshot", self.session), None);
        base64(text.as_str().expect("a text"))
    }

    /// Lets go of the pointer.
    pub fn let_go(&self) {
        self.pointer(vec![json!({ "type": "pointerUp", "button": 0 })]);
    }

    fn pointer(&self, actions: Vec<Value>) {
        let source = json!({ "type": "pointer", "id": "mouse", "actions": actions });
        self.command("actions", &json!({ "actions": [source] }));
    }

    /// Opens another window at an address, which is the current one then; the one before it.
    pub fn open_window(&self, url: &str) -> Value {
        let before = self.ask("GET", &format!("/session/{}/window", self.session), None);
        let new = self.command("window/new", &json!({ "type": "window" }));
        self.switch(&new["handle"]);
        self.go(url);
        before
    }

    pub fn switch(&self, window: &Value) {
        self.command("window", &json!({ "handle": window }));
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        if !self.session.is_empty() {
            // Of a test that fails the browser would live on, and keep the cores busy.
            let _ = self.send("DELETE", &format!("/session/{}", self.session), None);
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}

fn to([x, y]: [f64; 2], ms: u32) -> Value {
    json!({ "type": "pointerMove", "duration": ms, "x": x.round(), "y": y.round() })
}

fn base64(text: &str) -> Vec<u8> {
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let value = |digit: u8| digits.iter().position(|&one| one == digit).map(|at| at as u32);
    let mut bytes = Vec::new();
    let values: Vec<u32> = text.bytes().filter_map(value).collect();
    for four in values.chunks(4) {
        let word = four.iter().fold(0, |word, value| word << 6 | value) << (6 * (4 - four.len()));
        bytes.extend_from_slice(&word.to_be_bytes()[1..four.len()]);
    }
    bytes
}

fn is_there(program: &str) -> bool {
    let mut version = Command::new(program);
    version.arg("--version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    version.status().is_ok_and(|status| status.success())
}
