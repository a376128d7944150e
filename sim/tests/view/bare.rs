//! What the server does for a page that draws in no time: a bare WebSocket in place of a browser.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::{ALONE, View, number};

/// What a page has: a socket that pictures come from and requests go to.
struct Bare {
    from: BufReader<TcpStream>,
    to: Arc<Mutex<TcpStream>>,
}

impl Bare {
    fn open(view: &View) -> Self {
        let (host, path) = view.parts();
        let socket = format!("/{}", path.replace('?', "ws?"));
        let mut to = TcpStream::connect(host).unwrap();
        to.set_nodelay(true).unwrap();
        let request = format!(
            "GET {socket} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nUpgrade: websocket\r\n\
             Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
             Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        );
        to.write_all(request.as_bytes()).unwrap();
        let mut from = BufReader::new(to.try_clone().unwrap());
        let mut line = String::new();
        from.read_line(&mut line).unwrap();
        assert!(line.starts_with("HTTP/1.1 101"), "{line}");
        while line.trim() != "" {
            line.clear();
            from.read_line(&mut line).unwrap();
        }
        Self { from, to: Arc::new(Mutex::new(to)) }
    }

    /// The text of the next picture, once it is there.
    fn picture(&mut self) -> Value {
        loop {
            let mut head = [0; 2];
            self.from.read_exact(&mut head).unwrap();
            let length = match head[1] {
                126 => {
                    let mut bytes = [0; 2];
                    self.from.read_exact(&mut bytes).unwrap();
                    u64::from(u16::from_be_bytes(bytes))
                }
                127 => {
                    let mut bytes = [0; 8];
                    self.from.read_exact(&mut bytes).unwrap();
                    u64::from_be_bytes(bytes)
                }
                length => u64::from(length),
            };
            let mut bytes = vec![0; length as usize];
            self.from.read_exact(&mut bytes).unwrap();
            match head[0] {
                0x82 => {
                    let words = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
                    return serde_json::from_slice(&bytes[8..8 + words]).unwrap();
                }
                0x89 => frame(&self.to, 0x8a, &bytes),
                _ => {}
            }
        }
    }
}

/// Sends a frame, masked by nothing.
fn frame(to: &Mutex<TcpStream>, kind: u8, bytes: &[u8]) {
    assert!(bytes.len() < 126);
    let mut all = vec![kind, 0x80 | bytes.len() as u8, 0, 0, 0, 0];
    all.extend(bytes);
    to.lock().unwrap().write_all(&all).unwrap();
}

/// Figures for `docs/view.md`.
#[test]
#[ignore = "measures, and proves nothing"]
fn how_fast_the_server_is() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let begin = Instant::now();
    let view = View::start(&["liver"]);
    let mut page = Bare::open(&view);
    page.picture();
    println!("first picture sent after {:.2} s", begin.elapsed().as_secs_f64());
    let say = |to: &Mutex<TcpStream>, what: Value| frame(to, 0x81, what.to_string().as_bytes());
    let drawn = json!({ "do": "drawn", "count": 1 });
    say(&page.to, drawn.clone());
    let rest = [-60.0, 45.0, 25.0];
    say(&page.to, json!({ "do": "grab", "hand": 0, "rest_mm": rest, "radius_mm": 14.0 }));
    for (what, takes_pictures) in [("without pictures", false), ("with pictures", true)] {
        // Six seconds to and fro, 120 moves a second; a stamp is the time of its move, ms.
        let to = Arc::clone(&page.to);
        let start = Instant::now();
        let ms = move || begin.elapsed().as_secs_f64() * 1e3;
        let hand = thread::spawn(move || {
            for i in 0..720 {
                let due = start + Duration::from_secs_f64(f64::from(i) / 120.0);
                thread::sleep(due.saturating_duration_since(Instant::now()));
                let turn = f64::from(i) / 720.0 * 2.0 * std::f64::consts::TAU;
                let at = [8.0 * turn.sin(), 0.0, 8.0 * (1.0 - turn.cos())];
                let stamp = (ms() as u32).max(1);
                say(&to, json!({ "do": "move", "hand": 0, "move_mm": at, "stamp": stamp }));
            }
        });
        let (mut first, mut last, mut pictures) = (None, (0.0, 0.0), 0.0);
        let (mut latencies, mut seen, mut vertices) = (Vec::new(), 0.0, 0.0_f64);
        while !hand.is_finished() {
            if !takes_pictures {
                thread::sleep(Duration::from_millis(50));
                continue;
            }
            let text = page.picture();
            let now = ms();
            say(&page.to, drawn.clone());
            pictures += 1.0;
            last = (now, number(&text["step"]));
            first.get_or_insert(last);
            vertices = vertices.max(number(&text["vertices"]));
            let stamp = text["tools"][0]["stamp"].as_f64().unwrap_or(0.0);
            if stamp > seen {
                seen = stamp;
                latencies.push(now - stamp);
            }
        }
        hand.join().unwrap();
        if !takes_pictures {
            // Of the steps that were made the pictures tell that come once the others are drawn.
            let end = start.elapsed().as_secs_f64();
            let mut before = None;
            for _ in 0..4 {
                say(&page.to, drawn.clone());
                let step = number(&page.picture()["step"]);
                before.get_or_insert(step);
                last.1 = step;
            }
            let made = last.1 - before.unwrap_or_default();
            println!("{what}: {:.0} steps a second", made / end);
            continue;
        }
        latencies.sort_by(f64::total_cmp);
        let first = first.unwrap_or_default();
        let seconds = (last.0 - first.0) * 1e-3;
        println!(
            "{what}: {:.0} steps and {:.0} pictures a second, hand to picture {:.0} ms at p50, {:.0} at p90, at most {vertices} vertices",
            (last.1 - first.1) / seconds,
            pictures / seconds,
            latencies[latencies.len() / 2],
            latencies[latencies.len() * 9 / 10],
        );
    }
}
