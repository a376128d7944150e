//! A hand in another program: `yawara haptic SCENE --udp PORT`, spoken to over loopback.

use std::io::{BufRead, BufReader, Read};
use std::net::{SocketAddr, UdpSocket};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use yawara::haptic::{Device, Felt, ForcePacket, PosePacket, UdpDevice};

/// `yawara haptic` on a coarse scene in which a ball starts above a block.
struct Session {
    child: Child,
    out: BufReader<ChildStdout>,
    address: SocketAddr,
}

impl Session {
    fn start(seconds: &str, more: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_yawara"))
            .args(["haptic", "indent", "--udp", "0", "--seconds", seconds])
            .args(["--set", "mesh.max_level=0"])
            .args(more)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        out.read_line(&mut line).unwrap();
        let address = line.split_whitespace().nth(2).unwrap().parse().unwrap();
        Self { child, out, address }
    }

    fn end(mut self) -> String {
        let mut text = String::new();
        self.out.read_to_string(&mut text).unwrap();
        assert!(self.child.wait().unwrap().success(), "{text}");
        text
    }
}

fn client(address: SocketAddr) -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.connect(address).unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
    socket
}

fn send(socket: &UdpSocket, sequence: u64, down_m: f64) {
    let pose = PosePacket { sequence, position_m: [0.3, -0.2, 0.1 - down_m] };
    socket.send(&pose.to_bytes()).unwrap();
}

fn receive(socket: &UdpSocket) -> Option<ForcePacket> {
    let mut bytes = [0; 256];
    let size = socket.recv(&mut bytes).ok()?;
    Some(ForcePacket::read(&bytes[..size]).unwrap())
}

#[test]
fn a_program_presses_and_feels_the_body() {
    let out = std::env::temp_dir().join(format!("yawara_udp_{}.json", std::process::id()));
    let more = ["--most-force-n", "0.03", "--out", out.to_str().unwrap()];
    let session = Session::start("4", &more);
    assert!(session.address.ip().is_loopback());
    let socket = client(session.address);
    socket.set_nonblocking(true).unwrap();
    let (mut forces, begin, mut sequence) = (Vec::new(), Instant::now(), 0);
    while begin.elapsed() < Duration::from_secs(3) {
        sequence += 1;
        let share = (begin.elapsed().as_secs_f64() / 2.0).min(1.0);
        send(&socket, sequence, 0.01 * share);
        std::thread::sleep(Duration::from_millis(1));
        forces.extend(std::iter::from_fn(|| receive(&socket)));
    }
    assert!(forces.len() > 500, "{}", forces.len());
    assert!(forces.windows(2).all(|pair| pair[0].sequence < pair[1].sequence));
    assert!(forces.iter().all(|force| force.answers <= sequence));
    let last = forces.last().unwrap();
    assert!(last.answers + 100 > sequence, "{last:?} of {sequence}");
    // The tool goes as far as the body lets it. It pushes back upwards, no harder than allowed.
    // By the first force a pose or two after the first may have come.
    assert!(forces[0].tool_m[2].abs() < 1e-3, "{:?}", forces[0]);
    assert!((-0.01..-0.001).contains(&last.tool_m[2]), "{last:?}");
    let size = |force: &ForcePacket| force.force_n.iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!(last.force_n[2] > 0.0 && (size(last) - 0.03).abs() < 1e-12, "{last:?}");
    assert!(forces.iter().all(|force| size(force) <= 0.03 + 1e-12));
    let text = session.end();
    assert!(text.contains("of 1 program(s)"), "{text}");
    let summary: Value = serde_json::from_slice(&std::fs::read(&out).unwrap()).unwrap();
    std::fs::remove_file(&out).unwrap();
    assert_eq!(summary["udp"]["hands"], 1);
    assert_eq!(summary["udp"]["refused"], 0);
    assert!(summary["udp"]["cut"].as_u64().unwrap() > 0, "{summary}");
    assert!(summary["force_max_n"].as_f64().unwrap() > 0.03, "{summary}");
}

/// A device without a simulation, whose ticks are made by hand.
fn device() -> UdpDevice {
    UdpDevice::listen(SocketAddr::from(([127, 0, 0, 1], 0)), [0.0, 0.0, 0.04], 10.0).unwrap()
}

fn tick(device: &mut UdpDevice) -> [f64; 3] {
    std::thread::sleep(Duration::from_millis(20));
    device.position(0.0)
}

#[test]
fn what_is_no_pose_of_the_one_hand_moves_nothing() {
    let mut device = device();
    let address = device.address().unwrap();
    let [hand, other] = [(); 2].map(|()| client(address));
    assert_eq!(tick(&mut device), [0.0, 0.0, 0.04]);
    send(&hand, 5, 0.0);
    // Wherever the device stands, the tool begins where it is.
    assert_eq!(tick(&mut device), [0.0, 0.0, 0.04]);
    send(&hand, 6, 0.01);
    let there = tick(&mut device);
    assert!((there[2] - 0.03).abs() < 1e-15, "{there:?}");
    for noise in 0..1000_u32 {
        let bytes: Vec<u8> = (0..noise % 90).map(|i| (noise * 31 + i * 7) as u8).collect();
        hand.send(&bytes).unwrap();
        if noise % 40 == 0 {
            send(&hand, 7 + u64::from(noise), 0.01);
            assert_eq!(tick(&mut device), there);
        }
    }
    for place in [f64::NAN, 1e300] {
        let pose = PosePacket { sequence: 99, position_m: [place, 0.0, 0.0] };
        hand.send(&pose.to_bytes()).unwrap();
    }
    send(&hand, 6, 0.02);
    send(&other, 1, 0.02);
    assert_eq!(tick(&mut device), there);
    let seen = device.summary();
    assert_eq!((seen.hands, seen.poses, seen.old, seen.of_others, seen.leaps), (1, 27, 1, 1, 0));
    assert!(seen.refused > 900, "{seen:?}");
    // Only the hand feels.
    send(&hand, 2000, 0.01);
    tick(&mut device);
    device.feel(&Felt { force_n: [0.0, 1.0, 0.0].into(), tool_m: there.into() });
    assert!(receive(&other).is_none());
    let felt = receive(&hand).unwrap();
    assert_eq!((felt.sequence, felt.answers, felt.force_n), (1, 2000, [0.0, 1.0, 0.0]));
    assert!((felt.tool_m[2] + 0.01).abs() < 1e-15, "{felt:?}");
}

#[test]
fn a_leap_and_another_hand_move_nothing_by_themselves() {
    let mut device = device();
    let address = device.address().unwrap();
    let [first, second] = [(); 2].map(|()| client(address));
    send(&first, 1, 0.0);
    tick(&mut device);
    send(&first, 2, 0.3);
    assert_eq!(tick(&mut device), [0.0, 0.0, 0.04]);
    send(&first, 3, 0.301);
    let there = tick(&mut device);
    assert!((there[2] - 0.039).abs() < 1e-15, "{there:?}");
    // The first is silent: the second takes the tool where it stands, and its numbers begin anew.
    std::thread::sleep(Duration::from_millis(600));
    send(&second, 1, 0.02);
    assert_eq!(tick(&mut device), there);
    let seen = device.summary();
    assert_eq!((seen.hands, seen.leaps), (2, 1));
}

#[test]
fn another_version_is_told_which_one_is_spoken() {
    let mut device = device();
    let socket = client(device.address().unwrap());
    let mut bytes = PosePacket { sequence: 1, position_m: [0.0; 3] }.to_bytes();
    bytes[4] = 9;
    socket.send(&bytes).unwrap();
    tick(&mut device);
    let mut answer = [0; 64];
    let size = socket.recv(&mut answer).unwrap();
    assert_eq!(&answer[..size], b"YWHP\x01\x00\x03\x00");
}

#[test]
fn addresses_that_are_none_are_refused() {
    for (value, want) in [("here", "a port"), ("70000", "a port"), ("127.0.0.1", "a port")] {
        let run = Command::new(env!("CARGO_BIN_EXE_yawara"))
            .args(["haptic", "indent", "--udp", value])
            .output()
            .unwrap();
        let text = String::from_utf8(run.stderr).unwrap();
        assert!(run.status.code() == Some(2) && text.contains(want), "{text}");
    }
    let held = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = held.local_addr().unwrap();
    let error = UdpDevice::listen(address, [0.0; 3], 10.0).unwrap_err().to_string();
    assert!(error.contains(&address.to_string()), "{error}");
    assert!(UdpDevice::listen(address, [0.0; 3], f64::NAN).is_err());
}

/// The reference client of the documentation, where there is a Python.
#[test]
fn the_client_of_the_documentation_feels_the_body() {
    let has_python = Command::new("python3").arg("--version").output().is_ok();
    if !has_python {
        assert!(std::env::var_os("CI").is_none(), "python3 is missing");
        eprintln!("skipped: there is no python3 to run docs/clients/haptic_client.py with");
        return;
    }
    let session = Session::start("5", &[]);
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/clients/haptic_client.py");
    let run = Command::new("python3")
        .arg(file)
        .args(["--port", &session.address.port().to_string()])
        .args(["--down-mm", "10", "--seconds", "3"])
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let summary: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert!(summary["forces"].as_u64().unwrap() > 500, "{summary}");
    assert!(summary["strongest_n"][2].as_f64().unwrap() > 0.02, "{summary}");
    assert!(summary["deepest_tool_m"].as_f64().unwrap() < -0.001, "{summary}");
    session.end();
}
