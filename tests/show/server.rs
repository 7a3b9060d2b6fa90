//! The page's server, asked by plain TCP and by WebSocket as strangers would.

use servodance_runtime::control::idle::IdleStyle;
use servodance_runtime::pipeline::audio_input::AudioChoice;
use servodance_runtime::robot::{Meshes, Robot};
use servodance_runtime::viewer::{
    Activity, RobotEnd, Scene, Server, Songs, ViewerRequest, ViewerSettings, link,
};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// A page about a robot that somebody else moves.
struct Page {
    server: Server,
    robot: RobotEnd,
}

fn page() -> Page {
    let robot = Robot::load("op3").expect("the built-in robot");
    let settings =
        ViewerSettings { amplitude: 1.0, mirror: false, idle: IdleStyle::Sway, style: 0, seed: 1 };
    let scene = Scene {
        robot: robot.name.clone(),
        model: robot.retargeter().expect("a retargeter").model().clone(),
        meshes: Meshes::default(),
        joints: robot.joint_limits(),
        styles: vec!["hype".into(), "salsa".into()],
        control_hz: robot.control_hz,
        takes_songs: true,
        speaker: false,
        waits: false,
        recording_s: None,
    };
    let (mut end, viewers) = link(robot.servos.len(), settings);
    end.publish(|snapshot| snapshot.now.activity = Activity::Dancing);
    let bind = "127.0.0.1:0".parse().expect("an address");
    let server =
        Server::start(bind, scene, viewers, Songs::new(&AudioChoice::BuiltIn)).expect("a server");
    Page { server, robot: end }
}

impl Page {
    fn at(&self) -> SocketAddr {
        let host = self.server.address().split('/').nth(2).expect("a host");
        host.parse().expect("an address")
    }

    fn token(&self) -> &str {
        self.server.address().split('/').nth(3).expect("a token")
    }

    /// Status and body of one request.
    fn ask(&self, method: &str, path: &str, headers: &str, body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(self.at()).expect("a connection");
        let host = match headers.contains("Host:") {
            true => String::new(),
            false => format!("Host: {}\r\n", self.at()),
        };
        let length = body.len();
        let request = format!(
            "{method} {path} HTTP/1.1\r\n{host}{headers}Content-Length: {length}\r\n\r\n{body}"
        );
        // The answer may come, and the door close, before all is written.
        let _ = stream.write_all(request.as_bytes());
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let status = answer.get(9..12).and_then(|s| s.parse().ok()).unwrap_or(0);
        let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        (status, body.to_owned())
    }

    fn get(&self, path: &str) -> (u16, String) {
        self.ask("GET", &format!("/{}/{path}", self.token()), "", "")
    }

    fn command(&self, headers: &str, body: &str) -> (u16, String) {
        let path = format!("/{}/api/command", self.token());
        self.ask("POST", &path, headers, body)
    }

    fn socket(&self, origin: Option<&str>) -> Result<WebSocket<TcpStream>, String> {
        let address = format!("ws://{}/{}/api/live", self.at(), self.token());
        let mut request = address.into_client_request().expect("a request");
        if let Some(origin) = origin {
            let origin = origin.parse().expect("a header");
            request.headers_mut().insert("Origin", origin);
        }
        let stream = TcpStream::connect(self.at()).map_err(|e| e.to_string())?;
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
        let connected = tungstenite::client(request, stream);
        connected.map(|(socket, _)| socket).map_err(|e| e.to_string())
    }

    fn next_request(&mut self) -> Option<ViewerRequest> {
        let until = Instant::now() + Duration::from_secs(10);
        while Instant::now() < until {
            if let Some(request) = self.robot.request() {
                return Some(request);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        None
    }
}

const JSON: &str = "Content-Type: application/json\r\n";

#[test]
fn the_page_its_parts_the_scene_and_the_state_are_served() {
    let page = page();
    let (status, html) = page.get("");
    assert!(status == 200 && html.contains("STOP"), "{status} {html}");
    assert_eq!(page.get("main.js").0, 200);
    assert_eq!(page.get("../Cargo.toml").0, 404);
    assert_eq!(page.get("%2e%2e%2fCargo.toml").0, 404);
    let (_, scene) = page.get("api/scene");
    let scene: serde_json::Value = serde_json::from_str(&scene).expect("JSON");
    assert_eq!(scene["joints"].as_array().map(Vec::len), Some(20));
    let (_, state) = page.get("api/state");
    let state: serde_json::Value = serde_json::from_str(&state).expect("JSON");
    assert_eq!(state["activity"], "dancing");
    assert_eq!(state["temperatures_c"][0], serde_json::Value::Null);
    let links = scene["links"].as_array().map(Vec::len);
    assert_eq!(state["links"].as_array().map(Vec::len), links);
}

#[test]
fn a_command_reaches_the_control_loop_and_a_stop_the_button() {
    let mut page = page();
    assert_eq!(page.command(JSON, r#"{"set":{"style":"salsa"}}"#).0, 202);
    assert_eq!(page.next_request(), Some(ViewerRequest::Style(1)));
    let mut socket = page.socket(None).expect("a socket");
    socket.send(Message::text(r#"{"do":"hold"}"#)).expect("sent");
    assert_eq!(page.next_request(), Some(ViewerRequest::Hold));
    assert_eq!(page.command(JSON, r#"{"do":"start"}"#).0, 409);
    assert!(!page.robot.estop.is_pressed());
    assert_eq!(page.command(JSON, r#"{"do":"estop"}"#).0, 202);
    assert!(page.robot.estop.is_pressed());
    assert_eq!(page.robot.estop.cause(), "the page");
}

#[test]
fn a_wrong_or_missing_token_gets_nothing() {
    let page = page();
    let wrong = "0".repeat(32);
    let nearly = format!("{}x", &page.token()[..31]);
    for token in ["", "index.html", &wrong, &nearly, &page.token()[1..]] {
        for path in ["", "main.js", "api/scene", "api/state", "api/live"] {
            let (status, body) = page.ask("GET", &format!("/{token}/{path}"), "", "");
            assert_eq!((status, body.as_str()), (404, ""), "/{token}/{path}");
        }
        let stop = r#"{"do":"estop"}"#;
        let answer = page.ask("POST", &format!("/{token}/api/command"), JSON, stop);
        assert_eq!(answer, (404, String::new()));
    }
    assert!(!page.robot.estop.is_pressed());
}

#[test]
fn foreign_pages_are_refused() {
    let mut page = page();
    let hold = r#"{"do":"hold"}"#;
    let own = format!("Origin: http://{}\r\n", page.at());
    for foreign in [
        "Origin: http://evil.example\r\n",
        "Origin: null\r\n",
        "Host: evil.example\r\n",
        "Host: evil.example\r\nOrigin: http://evil.example\r\n",
        "Host: 127.0.0.1.evil.example:80\r\n",
    ] {
        let answer = page.command(&format!("{JSON}{foreign}"), hold);
        assert_eq!(answer, (403, String::new()), "{foreign}");
        let path = format!("/{}/", page.token());
        assert_eq!(page.ask("GET", &path, foreign, "").0, 403, "{foreign}");
    }
    // What a form of a foreign page could send without being asked first.
    for kind in ["", "Content-Type: text/plain\r\n"] {
        assert_eq!(page.command(kind, hold).0, 415);
    }
    assert!(page.socket(Some("http://evil.example")).is_err());
    assert_eq!(page.robot.request(), None);
    assert_eq!(page.command(&format!("{JSON}{own}"), hold).0, 202);
    assert!(page.socket(Some(&format!("http://{}", page.at()))).is_ok());
    assert_eq!(page.next_request(), Some(ViewerRequest::Hold));
}

#[test]
fn oversized_and_malformed_requests_are_refused() {
    let mut page = page();
    let large = format!(r#"{{"set":{{"style":"{}"}}}}"#, "x".repeat(5000));
    let (status, why) = page.command(JSON, &large);
    assert!(status == 413 && why.starts_with(r#"{"error":""#), "{why}");
    assert_eq!(page.command(JSON, "{").0, 400);
    assert_eq!(page.command(JSON, r#"{"set":{"amplitude":9}}"#).0, 400);
    let (status, why) = page.command(JSON, r#"{"set":{"style":"polka"}}"#);
    assert!(status == 400 && why.contains("hype, salsa"), "{why}");
    let endless = format!("X-Endless: {}\r\n", "x".repeat(100_000));
    assert!([0, 431].contains(&page.command(&endless, "{}").0));
    for message in [
        Message::text("{"),
        Message::text("[".repeat(4000)),
        Message::text("x".repeat(100_000)),
        Message::binary(vec![0; 16]),
        Message::binary(vec![0; 10_000_000]),
    ] {
        let mut socket = page.socket(None).expect("a socket");
        let _ = socket.send(message); // they may hang up while it is sent
        assert!(is_closed(&mut socket));
    }
    assert_eq!(page.robot.request(), None);
    assert_eq!(page.get("api/state").0, 200, "others are still served");
}

/// Whether the other side closes; frames before that are skipped.
fn is_closed(socket: &mut WebSocket<TcpStream>) -> bool {
    use tungstenite::error::Error;
    let closed = |read| match read {
        // Nothing came for long: that is not closed.
        Err(Error::Io(error)) => error.kind() != std::io::ErrorKind::WouldBlock,
        Err(_) | Ok(Message::Close(_)) => true,
        Ok(_) => false,
    };
    (0..10).any(|_| closed(socket.read()))
}

#[test]
fn a_viewer_who_does_not_read_misses_frames_and_delays_nobody() {
    let mut page = page();
    let mut quick = page.socket(None).expect("a socket");
    let mut slow = page.socket(None).expect("a socket");
    let buffered = socket2::SockRef::from(slow.get_ref()).set_recv_buffer_size(4096);
    buffered.expect("a small buffer");
    let mut latest = 0.0;
    for i in 1..=100 {
        let now = Instant::now();
        page.robot.publish(|s| s.now.music_s = f64::from(i));
        let took = now.elapsed();
        assert!(took < Duration::from_millis(500), "publishing took {took:?}");
        while latest < f64::from(i) {
            latest = time_of(&quick.read().expect("a frame"));
        }
    }
    // What waits for the slow one is little: much was never sent.
    drop(quick);
    let first = time_of(&slow.read().expect("a frame"));
    page.robot.publish(|s| s.now.music_s = 1e6);
    let frames = (0..200).take_while(|_| time_of(&slow.read().expect("a frame")) < 1e6);
    let read = frames.count();
    assert!(first <= 1.0 && read < 90, "{first} {read}");
}

fn time_of(message: &Message) -> f64 {
    let Message::Text(text) = message else {
        return 0.0;
    };
    let frame: serde_json::Value = serde_json::from_str(text).expect("JSON");
    frame["music_s"].as_f64().unwrap_or(0.0)
}

#[test]
fn a_flood_of_connections_leaves_viewers_alone() {
    let mut page = page();
    let mut viewer = page.socket(None).expect("a socket");
    viewer.read().expect("the first frame");
    let flood: Vec<_> = (0..1000)
        .filter_map(|i| {
            let mut stream = TcpStream::connect(page.at()).ok()?;
            let half = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Half:";
            let _ = stream.write_all(&half[..i % half.len()]);
            Some(stream)
        })
        .collect();
    assert!(flood.len() > 900, "{}", flood.len());
    for i in 1..=30 {
        page.robot.publish(|s| s.now.music_s = f64::from(i));
        while time_of(&viewer.read().expect("a frame")) < f64::from(i) {}
    }
    let stop = Message::text(r#"{"do":"estop"}"#);
    viewer.send(stop).expect("a viewer can still stop");
    let until = Instant::now() + Duration::from_secs(10);
    while !page.robot.estop.is_pressed() {
        assert!(Instant::now() < until, "the stop got through");
        std::thread::sleep(Duration::from_millis(2));
    }
    // Strangers of one host wait in front of one another, not of who has a token.
    let late = (0..20).filter(|_| page.get("api/state").0 != 200).count();
    assert!(late <= 2, "{late} of 20 requests found no place");
    let mut newcomer = page.socket(None).expect("a socket in the flood");
    newcomer.read().expect("its first frame");
    drop(flood);
}

#[test]
fn the_song_is_served_whole_to_whoever_holds_a_link() {
    let page = page();
    let audience = page.server.audience_address().to_owned();
    let path = audience.split_once(&page.at().to_string()).expect("a path").1.to_owned();
    let song = servodance_audio::song::Song::demo();
    for path in [path, format!("/{}/", page.token())] {
        let mut stream = TcpStream::connect(page.at()).expect("a connection");
        let request = format!("GET {path}api/song HTTP/1.1\r\nHost: {}\r\n\r\n", page.at());
        stream.write_all(request.as_bytes()).expect("sent");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("the song");
        let body = answer.windows(4).position(|end| end == b"\r\n\r\n").expect("a body") + 4;
        let wav = hound::WavReader::new(&answer[body..]).expect("WAV");
        assert_eq!(wav.len() as usize, song.samples.len());
    }
}

#[test]
fn a_song_that_is_sent_waits_and_what_is_none_is_refused() {
    let page = page();
    let send = |token: &str, name: &str, bytes: &[u8]| {
        let mut stream = TcpStream::connect(page.at()).expect("a connection");
        let (at, length) = (page.at(), bytes.len());
        let request = format!(
            "POST /{token}/api/song/{name} HTTP/1.1\r\nHost: {at}\r\nContent-Length: {length}\r\n\r\n"
        );
        stream.write_all(request.as_bytes()).expect("sent");
        let _ = stream.write_all(bytes); // a refusal may come before all is sent
        let mut answer = String::new();
        let _ = stream.read_to_string(&mut answer);
        answer
    };
    let mut wav = std::io::Cursor::new(Vec::new());
    let format = hound::WavSpec {
        channels: 1,
        sample_rate: 16_000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::new(&mut wav, format).expect("a writer");
    (0..16_000).for_each(|i| writer.write_sample((i % 100) as i16).expect("written"));
    writer.finalize().expect("whole");
    let wav = wav.into_inner();
    let answer = send(page.token(), "my%20song.wav", &wav);
    assert!(answer.starts_with("HTTP/1.1 202"), "{answer}");
    let (_, state) = page.get("api/state");
    let state: serde_json::Value = serde_json::from_str(&state).expect("JSON");
    assert_eq!((&state["song"], &state["queue"][0]), (&0.into(), &"my song.wav".into()));
    let answer = send(page.token(), "notes.txt", b"la la la");
    assert!(answer.starts_with("HTTP/1.1 400") && answer.contains("notes.txt"), "{answer}");
    let audience = page.server.audience_address().split('/').nth(3).expect("a token");
    assert!(send(audience, "song.wav", &wav).starts_with("HTTP/1.1 403"));
    let answer = send(page.token(), "long.wav", &vec![0; 40_000_001]);
    assert!(answer.starts_with("HTTP/1.1 413") && answer.contains("40 MB"), "{answer}");
}

#[test]
fn slow_strangers_are_turned_away_soon() {
    let page = page();
    let mut slow = TcpStream::connect(page.at()).expect("a connection");
    slow.write_all(b"GET /").expect("half a request");
    slow.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
    let began = Instant::now();
    let mut rest = Vec::new();
    let _ = slow.read_to_end(&mut rest); // closed, or reset
    assert!(began.elapsed() < Duration::from_secs(6), "{:?}", began.elapsed());
}

#[test]
fn the_audience_watches_and_commands_nothing() {
    let mut page = page();
    let audience = page.server.audience_address().to_owned();
    let path = audience.split_once(&page.at().to_string()).expect("a path").1.to_owned();
    assert_ne!(path, format!("/{}/", page.token()));
    for part in ["", "main.js", "api/state"] {
        assert_eq!(page.ask("GET", &format!("{path}{part}"), "", "").0, 200, "{part}");
    }
    let scene_of = |path: &str| {
        let (_, scene) = page.ask("GET", &format!("{path}api/scene"), "", "");
        assert!(!scene.contains(page.token()), "it does not learn the other link");
        serde_json::from_str::<serde_json::Value>(&scene).expect("JSON")
    };
    assert_eq!(scene_of(&path)["operator"], false);
    assert_eq!(scene_of(&format!("/{}/", page.token()))["operator"], true);
    assert_eq!(page.ask("GET", &format!("{path}api/links"), "", "").0, 403);
    let (status, links) = page.get("api/links");
    assert!(status == 200 && links.contains(&audience) && links.contains("0111"), "{links}");

    for wish in [r#"{"do":"estop"}"#, r#"{"do":"hold"}"#, r#"{"do":"alive"}"#, "{"] {
        let (status, why) = page.ask("POST", &format!("{path}api/command"), JSON, wish);
        assert!(status == 403 && why.contains("watching"), "{wish}: {status} {why}");
    }
    assert_eq!(page.ask("POST", &format!("{path}api/tap"), JSON, "").0, 403);
    let stream = TcpStream::connect(page.at()).expect("a connection");
    let address = format!("{}api/live", audience.replace("http:", "ws:"));
    let (mut socket, _) = tungstenite::client(address, stream).expect("a socket");
    socket.send(Message::text(r#"{"do":"estop"}"#)).expect("sent");
    let refused = (0..10).any(|_| {
        let text = socket.read().expect("a message").into_text().expect("text");
        text.contains("this link is for watching")
    });
    assert!(refused && !page.robot.estop.is_pressed());
    assert_eq!(page.robot.request(), None);
    assert!(page.robot.operators.silent_s() > 0.0);
}

#[test]
fn a_stop_is_confirmed_by_the_control_loop_and_by_nobody_else() {
    let mut page = page();
    let press = r#"{"do":"estop","press":"p1"}"#;
    let state = |page: &Page| {
        let (_, state) = page.get("api/state");
        serde_json::from_str::<serde_json::Value>(&state).expect("JSON")
    };
    assert_eq!(page.command(JSON, press), (202, "{}".into()));
    assert_eq!(state(&page)["confirmed"], serde_json::json!([]));
    // A control loop that dances on: pressed is not stopped.
    page.robot.publish(|snapshot| snapshot.now.music_s = 1.0);
    page.robot.confirm_stop(false);
    assert_eq!(page.command(JSON, press), (202, "{}".into()));
    assert_eq!((&state(&page)["stopped"], &state(&page)["estop"]), (&false.into(), &true.into()));
    page.robot.confirm_stop(true);
    assert_eq!(state(&page)["confirmed"], serde_json::json!(["p1"]));
    assert_eq!(page.command(JSON, press), (202, r#"{"stopped":true}"#.into()));
    // Released, and dancing again while old news still says stopped: the next press is new.
    page.robot.estop.clear();
    assert_eq!(page.command(JSON, r#"{"do":"estop","press":"p2"}"#), (202, "{}".into()));
    assert_eq!(state(&page)["confirmed"], serde_json::json!(["p1"]));
    page.robot.confirm_stop(true);
    assert_eq!(state(&page)["confirmed"], serde_json::json!(["p2"]));
    for seen in [r#"{"do":"seen","press":"p1"}"#, r#"{"do":"seen","press":"p2"}"#] {
        assert_eq!(page.command(JSON, seen).0, 202);
    }
    let began = Instant::now();
    drop(page.server);
    assert!(began.elapsed() < Duration::from_secs(5), "no page waits for a confirmation");
}

#[test]
fn an_operator_who_falls_silent_is_told_of_and_one_who_leaves_is_not() {
    let mut page = page();
    let alive = || Message::text(r#"{"do":"alive"}"#);
    let mut leaves = page.socket(None).expect("a socket");
    leaves.send(alive()).expect("sent");
    leaves.close(None).expect("a goodbye");
    while leaves.read().is_ok() {}
    let mut silent = page.socket(None).expect("a socket");
    silent.send(alive()).expect("sent");
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(page.robot.request(), None, "not yet");
    assert!(page.robot.operators.silent_s() < 10.0);
    assert_eq!(page.next_request(), Some(ViewerRequest::OperatorLost));
    assert_eq!(page.robot.request(), None, "told once");
    drop(silent);
}
