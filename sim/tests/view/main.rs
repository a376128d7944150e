//! The page of `yawara view`: who is let in, and in a real browser what a hand does.

mod bare;
mod beside;
mod blade;
mod browser;
mod cut;
mod export;
mod playback;
mod screenshot;

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use browser::Browser;
use screenshot::stage;
use serde_json::Value;

/// One browser at a time: each keeps all cores busy.
static ALONE: Mutex<()> = Mutex::new(());

/// A running `yawara view`; it ends with this.
struct View {
    child: Child,
    url: String,
}

impl View {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_yawara"))
            .arg("view")
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut url = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut url).unwrap();
        assert!(url.starts_with("http://127.0.0.1:"), "{url}");
        Self { child, url: url.trim().into() }
    }

    /// Host with port, and path with token.
    fn parts(&self) -> (&str, &str) {
        self.url["http://".len()..].split_once('/').unwrap()
    }

    /// The first line and the headers of an answer, and its body.
    fn get(&self, path: &str, headers: &str) -> (String, String) {
        let mut stream = TcpStream::connect(self.parts().0).unwrap();
        let request = format!("GET {path} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        (head.into(), body.into())
    }
}

impl Drop for View {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

const SMALL: [&str; 6] =
    ["beam", "--set", "mesh.max_level=3", "--set", "image.voxel_mm=2.0", "--play"];

#[test]
fn only_who_knows_the_token_and_comes_by_this_machines_name_is_let_in() {
    let view = View::start(&["beam"]);
    let (host, path) = view.parts();
    let path = format!("/{path}");
    let by = |host: &str| format!("Host: {host}\r\n");
    let status = |path: &str, headers: &str| view.get(path, headers).0[9..12].to_owned();
    let (head, body) = view.get(&path, &by(host));
    assert!(head.starts_with("HTTP/1.1 200") && body.contains("<title>yawara view"), "{head}");
    assert!(head.contains("content-security-policy: default-src 'none'"), "{head}");
    // Through a tunnel.
    assert_eq!(status(&path, &by("localhost:9000")), "200");
    assert_eq!(status("/", &by(host)), "403");
    assert_eq!(status("/?token=0123456789abcdef0123456789abcdef", &by(host)), "403");
    for stranger in ["evil.example", "127.0.0.1.evil.example:80", "192.168.1.1"] {
        assert_eq!(status(&path, &by(stranger)), "421", "{stranger}");
        assert_eq!(status("/main.js", &by(stranger)), "421", "{stranger}");
    }
    assert_eq!(status("/../Cargo.toml", &by(host)), "404");
    let upgrade = |host: &str, origin: &str| {
        format!(
            "Host: {host}\r\nOrigin: {origin}\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
             Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nConnection: Upgrade\r\n"
        )
    };
    let socket = path.replace("/?", "/ws?");
    let line = |path: &str, headers: &str| {
        let mut stream = TcpStream::connect(host).unwrap();
        stream.write_all(format!("GET {path} HTTP/1.1\r\n{headers}\r\n").as_bytes()).unwrap();
        let mut line = String::new();
        BufReader::new(stream).read_line(&mut line).unwrap();
        line[9..12].to_owned()
    };
    assert_eq!(line(&socket, &upgrade(host, &format!("http://{host}"))), "101");
    assert_eq!(line(&socket, &upgrade(host, "http://evil.example")), "403");
    assert_eq!(line(&socket, &upgrade("evil.example", "http://evil.example")), "421");
    assert_eq!(line("/ws?token=1", &upgrade(host, &format!("http://{host}"))), "403");
}

#[test]
fn what_can_not_be_shown_is_refused_before_it_is_served() {
    let refused = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_yawara"))
            .arg("view")
            .args(arguments)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(output.stdout.is_empty());
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(refused(&["livr"]).contains("livr"));
    assert!(refused(&["beam", "--set", "materials.0.poisson_ratio=2.0"]).contains("poisson_ratio"));
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    assert!(refused(&["beam", "--port", &port]).contains(&format!("127.0.0.1:{port}")));
}

/// Shares of a picture: what is not ground, and what has about the colour of each label.
const COLOURS: &str = "
    const view = document.getElementById('view');
    const copy = document.createElement('canvas');
    copy.width = view.width; copy.height = view.height;
    const pen = copy.getContext('2d');
    pen.drawImage(view, 0, 0);
    const { data } = pen.getImageData(0, 0, copy.width, copy.height);
    const ground = data.slice(0, 3);
    const n = { body: 0, blue: 0, green: 0, yellow: 0 };
    for (let i = 0; i < data.length; i += 4) {
      const [r, g, b] = data.slice(i, i + 3);
      if (Math.abs(r - ground[0]) + Math.abs(g - ground[1]) + Math.abs(b - ground[2]) > 24) n.body += 1;
      if (b > r + 25 && b > 60) n.blue += 1;
      if (g > r + 25 && g > b) n.green += 1;
      if (r > b + 70 && g > b + 50) n.yellow += 1;
    }
    return n;";

/// Pixels of a place of the liver's left lobe, where nothing holds it.
const LOBE: &str = "
    const [x, y] = yawara.body.project([-60, 45, 25]);
    const place = document.getElementById('view').getBoundingClientRect();
    return [place.left + x, place.top + y];";

const READY: &str = "window.yawara && yawara.last && yawara.state && yawara.body.is_framed \
    && yawara.body.was_sized && !yawara.body.is_stale";

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn pair(value: &Value) -> [f64; 2] {
    [number(&value[0]), number(&value[1])]
}

#[test]
fn a_hand_pulls_the_liver_and_what_it_did_is_run_again() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1100, 760) else { return };
    let folder = tempfile::tempdir().unwrap();
    let kept = folder.path().join("kept");
    let view = View::start(&["liver", "--out", kept.to_str().unwrap()]);
    page.go(&view.url);
    page.wait(READY);
    page.wait("yawara.body.surfaces.length === 4");
    let colours = page.run(COLOURS);
    for of in ["body", "blue", "green", "yellow"] {
        assert!(number(&colours[of]) > 100.0, "{of}: {colours}");
    }
    // The same in the window, where a label that is left out takes its colour along.
    let at_rest = stage(&page, "view");
    let ground = at_rest.pixels[at_rest.width / 2];
    let is_body = |pixel: [i32; 3]| (0..3).map(|k| (pixel[k] - ground[k]).abs()).sum::<i32>() > 24;
    let share = at_rest.count(is_body) as f64 / at_rest.pixels.len() as f64;
    assert!((0.1..0.9).contains(&share), "{share} of the picture is body");
    let of_labels: [fn([i32; 3]) -> bool; 3] = [
        |[r, g, b]| b > r + 25 && b > g + 10,
        |[r, g, b]| g > r + 25 && g > b,
        |[r, g, b]| r > b + 70 && g > b + 50,
    ];
    let show = |label: usize| {
        page.run(&format!("document.querySelectorAll('#legend input')[{label}].click()"));
    };
    for (label, is_it) in of_labels.into_iter().enumerate() {
        show(label + 1);
        let without = stage(&page, "view").count(is_it);
        show(label + 1);
        let with = at_rest.count(is_it);
        assert!(
            with > 100 && 5 * without < with,
            "label {label}: {with} pixels, {without} without"
        );
    }
    assert_eq!(stage(&page, "view").changes(&at_rest).len(), 0);
    assert_eq!(page.run("return yawara.last.vertices"), 736);
    page.run(
        "window.felt = {}; setInterval(() => { felt[yawara.last.step] = yawara.last.force_n; }, 4)",
    );
    let from = pair(&page.run(LOBE));
    // Three centimetres in the plane of the screen.
    let per_mm = page.run(
        "const [a, b] = [[-60, 45, 25], [-60, 45, 26]].map((at) => yawara.body.project(at));
         return Math.hypot(a[0] - b[0], a[1] - b[1]);",
    );
    let along = 30.0 * number(&per_mm) / 10.0;
    let way: Vec<[f64; 2]> = (1..=10)
        .map(|i| [from[0] + 0.3 * along * f64::from(i), from[1] - 0.95 * along * f64::from(i)])
        .collect();
    page.drag(from, &way);
    let moved = "yawara.last.tools.length === 1 && yawara.last.tools[0].force_n[2] > 0.3";
    page.wait(moved);
    page.wait("yawara.last.vertices > 760");
    page.wait("document.getElementById('n_latency').textContent.endsWith(' ms')");
    assert_eq!(page.run("return yawara.last.converged"), true);
    // The lobe has moved, and what is held has not.
    page.wait("yawara.last.steps_per_s > 0 && Math.hypot(...yawara.last.force_n) > 1.0");
    page.run("document.getElementById('pause').click()");
    page.wait("yawara.state.paused");
    let pulled = stage(&page, "view").changes(&at_rest);
    let spot = [0, 1].map(|k| from[k] as usize);
    let near = |far: usize| {
        let is_near = |at: &&[usize; 2]| (0..2).all(|k| at[k].abs_diff(spot[k]) < far);
        pulled.iter().filter(is_near).count()
    };
    assert!(near(100) > 2000 && 2 * near(150) > pulled.len(), "{} of {}", near(150), pulled.len());
    page.run("document.getElementById('pause').click()");
    page.let_go();
    page.wait("yawara.last.at_rest && yawara.last.vertices === 736");
    assert_eq!(stage(&page, "view").changes(&at_rest).len(), 0);
    assert_eq!(page.run("return Math.hypot(...yawara.last.force_n)"), 0);
    // Back at the start to the last bit of what is sent.
    assert_eq!(
        page.run("return yawara.body.surfaces.every((one) => one.moved.every((x) => x === 0))"),
        true
    );

    page.run("document.getElementById('save').click()");
    page.wait("document.getElementById('command').textContent.includes('001')");
    let felt = page.run("return felt");
    let run = kept.join("001/run");
    runs_again(&run, &felt);
    // The line that the page shows.
    let again = folder.path().join("again");
    let status = Command::new(env!("CARGO_BIN_EXE_yawara"))
        .args(["run", kept.join("001/scene.toml").to_str().unwrap(), "--out"])
        .arg(&again)
        .stdout(Stdio::null())
        .status();
    assert!(status.unwrap().success());
    same_frames(&run, &again);
}

/// Whether the steps of a run have the forces that a page has `felt`, by step, to the last bit.
fn runs_again(run: &Path, felt: &Value) {
    let steps = fs::read_to_string(run.join("steps.csv")).unwrap();
    let mut lines = steps.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = names.iter().position(|name| *name == "force_x_n").unwrap();
    let mut compared = 0;
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let Some(seen) = felt.get(cells[0]) else { continue };
        for axis in 0..3 {
            let again: f64 = cells[at + axis].parse().unwrap();
            assert_eq!(
                again.abs().to_bits(),
                number(&seen[axis]).abs().to_bits(),
                "step {}",
                cells[0]
            );
        }
        compared += usize::from(seen[2] != 0);
    }
    assert!(compared > 3, "only {compared} steps of the pull were seen");
}

fn same_frames(a: &Path, b: &Path) {
    let mut count = 0;
    for entry in fs::read_dir(a.join("frames")).unwrap() {
        let name = entry.unwrap().file_name();
        let read = |run: &Path| fs::read(run.join("frames").join(&name)).unwrap();
        assert!(read(a) == read(b), "{name:?}");
        count += 1;
    }
    assert!(count > 5);
}

#[test]
fn a_ball_is_pressed_in_and_a_stage_is_changed() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1100, 760) else { return };
    let folder = tempfile::tempdir().unwrap();
    let view = View::start(&["liver", "--out", folder.path().to_str().unwrap()]);
    page.go(&view.url);
    page.wait(READY);
    page.run("document.querySelector('input[value=press]').click()");
    let at = pair(&page.run(LOBE));
    page.drag(at, &[]);
    page.wait("yawara.last.tools.length === 1 && Math.hypot(...yawara.last.force_n) > 0.05");
    assert_eq!(page.run("return yawara.last.tools[0].kind"), "probe");
    page.let_go();
    page.wait("yawara.last.at_rest");
    assert_eq!(page.run("return yawara.last.tools.length"), 0);
    page.run(
        "const select = document.querySelector('[data-key=\"stages.corotation\"]');
         select.value = 'row';
         document.getElementById('apply').click();",
    );
    page.wait("yawara.state.generation === 2 && yawara.last.generation === 2");
    let choice = "return yawara.state.plan.find((row) => row.stage === 'corotation').choice";
    assert_eq!(page.run(choice), "row");
    assert!(
        page.run("return yawara.state.command")
            .as_str()
            .unwrap()
            .contains("--set stages.corotation=row")
    );
    // What makes no sense is refused, and the simulation goes on as it was.
    page.run("yawara.socket.send(JSON.stringify({ do: 'set', changes: ['stages.corotation=sideways'] }))");
    page.wait("document.getElementById('notices').textContent.includes('sideways')");
    assert_eq!(page.run("return yawara.state.generation"), 2);
    // Screens that are narrow.
    let wide = page.run("return document.documentElement.scrollWidth <= innerWidth");
    assert_eq!(wide, true);
}

#[test]
fn two_pages_see_the_same_and_a_thousand_hostile_messages_change_nothing() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(800, 600) else { return };
    let view = View::start(&SMALL);
    page.go(&view.url);
    page.wait(READY);
    page.run("document.getElementById('pause').click()");
    page.wait("yawara.state.paused");
    let first = page.open_window(&view.url);
    page.wait(READY);
    page.wait("yawara.state.paused");
    let before =
        page.run("return [yawara.last.step, yawara.state.generation, yawara.last.force_n]");
    page.run(
        "window.answers = 0;
         yawara.socket.addEventListener('message', ({ data }) => {
           if (typeof data === 'string' && JSON.parse(data).level === 'error') answers += 1;
         });
         const kinds = [
           (i) => 'x'.repeat(i), () => '{', () => '[]', () => 'null', () => '{\"do\":\"fly\"}',
           () => '{\"do\":\"grab\"}', () => '{\"do\":\"grab\",\"hand\":0,\"rest_mm\":[1,2,1e308],\"radius_mm\":5}',
           () => '{\"do\":\"press\",\"hand\":0,\"centre_mm\":[0,0,0],\"radius_mm\":-1}',
           () => '{\"do\":\"set\",\"changes\":[\"image.path=/etc/passwd\"]}', () => new Uint8Array([1, 2, 3]),
         ];
         for (let i = 0; i < 1000; i += 1) yawara.socket.send(kinds[i % 10](i));",
    );
    page.wait("answers === 1000");
    assert_eq!(
        page.run("return [yawara.last.step, yawara.state.generation, yawara.last.force_n]"),
        before
    );
    // One that is too long costs the connection; the page comes back.
    page.run("window.old = yawara.socket; yawara.socket.send('y'.repeat(100000))");
    page.wait("yawara.socket !== old && yawara.socket.readyState === 1");
    page.run("document.getElementById('step').click()");
    page.wait(&format!("yawara.last.step === {} + 1", before[0]));
    page.switch(&first);
    page.wait(&format!("yawara.last.step === {} + 1", before[0]));
}

/// Figures for `docs/view.md`, and its picture where `YAWARA_PICTURE` names a file.
#[test]
#[ignore = "measures, and proves nothing"]
fn how_fast() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1280, 900) else { return };
    let begin = Instant::now();
    let view = View::start(&["liver"]);
    let built = begin.elapsed();
    page.go(&view.url);
    page.wait(READY);
    println!(
        "address printed after {:.2} s, first picture after {:.2} s",
        built.as_secs_f64(),
        begin.elapsed().as_secs_f64()
    );
    let from = pair(&page.run(LOBE));
    page.drag(from, &[]);
    page.run(
        "window.pull = [];
         const watch = (t) => { pull.push([t, yawara.last.step, yawara.last.vertices]); requestAnimationFrame(watch); };
         requestAnimationFrame(watch);",
    );
    // Six seconds to and fro.
    let way: Vec<[f64; 2]> = (1..=60)
        .map(|i| {
            let turn = f64::from(i) / 60.0 * 2.0 * std::f64::consts::TAU;
            [from[0] + 40.0 * turn.sin(), from[1] - 40.0 * (1.0 - turn.cos())]
        })
        .collect();
    page.drag_on(&way);
    let measured = page.run(
        "const [first, last] = [pull[0], pull.at(-1)];
         const s = (last[0] - first[0]) / 1000;
         const sorted = yawara.latencies.sort((a, b) => a - b);
         return [(last[1] - first[1]) / s, pull.length / s, sorted[sorted.length >> 1], Math.max(...pull.map((x) => x[2]))];",
    );
    println!(
        "while dragging: {:.0} steps a second, {:.0} frames a second in the browser, hand to picture {:.0} ms at p50, at most {} vertices",
        number(&measured[0]),
        number(&measured[1]),
        number(&measured[2]),
        measured[3]
    );
    if let Some(file) = std::env::var_os("YAWARA_PICTURE") {
        page.drag_on(&[[from[0] + 50.0, from[1] - 60.0]]);
        page.wait("Math.hypot(...yawara.last.force_n) > 1.0");
        page.run("document.getElementById('view').blur()");
        fs::write(file, page.screenshot()).unwrap();
    }
}
