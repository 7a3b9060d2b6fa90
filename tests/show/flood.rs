//! A flood of the page while the robot dances: a thousand connections, giant
//! and malformed messages. The judge is a simulated bus of the test's own.

use crate::crash_safety::Stage;
use crate::torque_off::alone;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::Stdio;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

const CONNECTIONS: usize = 1000;
/// How long it is watched without and with the flood.
const WATCHED: Duration = Duration::from_secs(4);
/// A pause of whoever floods: the machine is also that of the judge.
const PAUSE: Duration = Duration::from_millis(2);
/// Half a control cycle.
const LATE_MS: f64 = 5.0;
const DANCES: usize = 3;

/// Where the page is, and its token.
#[derive(Clone, Debug)]
struct Page {
    at: SocketAddr,
    token: String,
}

impl Page {
    fn of(stage: &mut Stage) -> Self {
        let mut address = String::new();
        let stdout = stage.child.stdout.take().expect("its output");
        let read = BufReader::new(stdout).read_line(&mut address);
        read.expect("the address");
        let parts: Vec<&str> = address.trim().split('/').collect();
        Self { at: parts[2].parse().expect("an address"), token: parts[3].to_owned() }
    }

    fn socket(&self) -> Option<WebSocket<TcpStream>> {
        let address = format!("ws://{}/{}/api/live", self.at, self.token);
        let stream = TcpStream::connect(self.at).ok()?;
        stream.set_read_timeout(Some(Duration::from_secs(20))).ok()?;
        Some(tungstenite::client(address, stream).ok()?.0)
    }

    /// Throws bytes at the server and takes what comes back.
    fn throw(&self, bytes: &[u8]) {
        let Ok(mut stream) = TcpStream::connect(self.at) else {
            return;
        };
        let _ = stream.set_read_timeout(Some(Duration::from_secs(1)));
        let _ = stream.write_all(bytes); // the door may close meanwhile
        let _ = stream.read(&mut [0; 256]);
    }

    fn post(&self, token: &str, body: &[u8]) -> Vec<u8> {
        let head = format!(
            "POST /{token}/api/command HTTP/1.1\r\nHost: {}\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\n\r\n",
            self.at,
            body.len()
        );
        [head.as_bytes(), body].concat()
    }
}

/// Everything at once, until it is over; how many messages that were.
fn flood(page: &Page, over: &AtomicBool) -> u64 {
    let thrown = AtomicU64::new(0);
    let giant = vec![b'x'; 4 << 20];
    let wrong = "0".repeat(32);
    std::thread::scope(|scope| {
        let again = |throw: Box<dyn Fn() + Send>| {
            let thrown = &thrown;
            scope.spawn(move || {
                // Real ones have machines of their own.
                servodance_runtime::process::realtime::yield_to_others();
                while !over.load(Ordering::Relaxed) {
                    throw();
                    thrown.fetch_add(1, Ordering::Relaxed);
                    std::thread::sleep(PAUSE);
                }
            });
        };
        for bytes in [
            page.post(&page.token, &giant),
            page.post(&page.token, b"{\"set\":{\"amplitude\":9}}"),
            page.post(&page.token, &b"[".repeat(4000)),
            page.post(&wrong, b"{\"do\":\"estop\"}"),
            b"\x00\xff\r\n\r\nGET / HTTP/9.9\r\n\r\n".to_vec(),
            [&b"GET / HTTP/1.1\r\nX: "[..], &giant].concat(),
        ] {
            let page = page.clone();
            again(Box::new(move || page.throw(&bytes)));
        }
        for message in [
            Message::binary(giant.clone()),
            Message::text("{".repeat(100_000)),
            Message::text("{\"do\":\"jump\"}"),
        ] {
            let page = page.clone();
            again(Box::new(move || {
                if let Some(mut socket) = page.socket() {
                    let _ = socket.send(message.clone());
                }
            }));
        }
        let held: Vec<_> = (0..CONNECTIONS)
            .filter_map(|i| {
                let mut stream = TcpStream::connect(page.at).ok()?;
                let half = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Half:";
                let _ = stream.write_all(&half[..i % half.len()]);
                Some(stream)
            })
            .collect();
        assert!(held.len() > CONNECTIONS / 2, "{}", held.len());
        while !over.load(Ordering::Relaxed) {
            std::thread::sleep(PAUSE);
        }
    });
    thrown.into_inner()
}

/// What a viewer saw for a while.
#[derive(Debug, Default)]
struct Seen {
    frames: u64,
    late_frames: u64,
    latest_ms: f64,
}

fn watch(viewer: &mut WebSocket<TcpStream>, stage: &Stage) -> Seen {
    let (mut seen, mut moved) = (Seen::default(), false);
    let mut began_with = None;
    let began = Instant::now();
    while began.elapsed() < WATCHED {
        let text = viewer.read().expect("a frame").into_text().expect("text");
        let frame: Value = serde_json::from_str(&text).expect("JSON");
        let late = frame["late_frames"].as_u64().expect("a number");
        seen.frames += 1;
        seen.late_frames = late - *began_with.get_or_insert(late);
        seen.latest_ms = seen.latest_ms.max(frame["late_ms"].as_f64().unwrap_or(0.0));
        assert_eq!(frame["activity"], "dancing", "{frame}");
        assert_eq!(stage.powered(), 2);
        moved |= stage.moves();
    }
    assert!(moved, "the dance does not go on");
    seen
}

/// One dance with a flood, to its emergency stop.
struct FloodedDance {
    violations: u64,
    notes: Vec<String>,
    /// The latest control cycle.
    latest_ms: f64,
}

fn flooded_dance() -> FloodedDance {
    let mut stage = Stage::new(&["--view", "--quiet"], |command| {
        command.stdout(Stdio::piped());
    });
    let page = Page::of(&mut stage);
    let mut viewer = page.socket().expect("a socket");
    let dancing = |viewer: &mut WebSocket<TcpStream>| {
        let frame = viewer.read().expect("a frame").into_text().expect("text");
        frame.contains("\"activity\":\"dancing\"")
    };
    while !dancing(&mut viewer) {}
    let calm = watch(&mut viewer, &stage);
    let mut latest_ms = calm.latest_ms;
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let flood = scope.spawn(|| flood(&page, &over));
        let flooded = watch(&mut viewer, &stage);
        let asked = Instant::now();
        let stop = Message::text(r#"{"do":"estop"}"#);
        viewer.send(stop).expect("a viewer can still stop");
        let off = stage.wait("torque off", || stage.powered() == 0);
        over.store(true, Ordering::Relaxed);
        let thrown = flood.join().expect("the flood ends");
        println!(
            "| flood of the page: {CONNECTIONS} connections, {thrown} giant and malformed \
             messages in {} s | danced on ({} frames seen, {} late motion frames, latest cycle \
             {:.1} ms; before the flood {}, {}, {:.1} ms); STOP on the page: torque off after \
             {} ms |",
            WATCHED.as_secs(),
            flooded.frames,
            flooded.late_frames,
            flooded.latest_ms,
            calm.frames,
            calm.late_frames,
            calm.latest_ms,
            (off - asked).as_millis()
        );
        latest_ms = f64::max(latest_ms, flooded.latest_ms);
        assert!(thrown > 50, "{thrown}");
        assert!(flooded.frames > 10, "{flooded:?}");
    });
    let status = stage.child.wait().expect("it ends");
    assert_eq!(status.code(), Some(1));
    stage.hears("emergency stop (the page)");
    let (violations, notes) = (stage.bus.violations().total(), stage.bus.violation_notes());
    FloodedDance { violations, notes, latest_ms }
}

/// A servo whose goal is late slows down by itself, harder than its limit: where the machine
/// stood still for half a control cycle, the dance is danced again.
#[test]
fn a_flood_of_the_page_does_not_disturb_the_dance() {
    let _alone = alone();
    let mut broken = Vec::new();
    while broken.len() < DANCES {
        let dance = flooded_dance();
        if dance.violations == 0 {
            return;
        }
        assert!(dance.latest_ms > LATE_MS, "{:?}", dance.notes);
        broken.push(dance.notes);
    }
    panic!("limits broken in each dance: {broken:?}");
}
