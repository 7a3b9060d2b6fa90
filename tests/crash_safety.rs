//! What breaks, and how long until the robot is safe. The judge is a simulated
//! bus of the test's own, in real time; the program opens it as a serial port.
//! The table goes to `crash-safety.md` in the tests' output folder, and from
//! there to docs/crash-safety.md.

use crate::program::Program;
use crate::torque_off::{alone, signal};
use servodance_audio::song::SongSpec;
use servodance_runtime::robot::Robot;
use servodance_sim::{SimBus, SimOptions, SimServoSpec};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Said of a thread that panicked, and of a machine that let no thread run.
const BROKE_DOWN: &str = "broke down";
const STALLED: &str = "the machine was busy";
const PATIENCE: Duration = Duration::from_secs(60);
/// Dances beside each other: more would starve each other.
const BESIDE: usize = 3;
/// How long a dance that goes on is watched.
const WATCHED: Duration = Duration::from_secs(2);

/// A dance on a bus that the test looks at.
pub struct Stage {
    /// Its folder.
    _program: Program,
    pub bus: SimBus,
    pub child: Child,
    said: Arc<Mutex<Said>>,
}

/// What the program said on standard error.
#[derive(Default)]
struct Said {
    lines: Vec<(Instant, String)>,
    /// The program has ended, or closed its standard error.
    is_all: bool,
}

impl Said {
    fn line_with(&self, word: &str) -> Option<&(Instant, String)> {
        self.lines.iter().find(|(_, line)| line.contains(word))
    }
}

/// What came of a breakdown.
struct Row {
    what: &'static str,
    safe: String,
    said: String,
    status: String,
    violations: u64,
}

impl Stage {
    /// Starts `dance` with these arguments on a neck, and waits for torque.
    /// `prepare` may change the command.
    pub fn new(arguments: &[&str], prepare: impl FnOnce(&mut Command)) -> Self {
        let stage = Self::start(Program::unhurried_robot, arguments, prepare);
        stage.wait("torque", || stage.powered() == 2);
        stage
    }

    /// The same with another robot file, without waiting.
    pub fn start(
        robot_file: fn(&Program, &str) -> String,
        arguments: &[&str],
        prepare: impl FnOnce(&mut Command),
    ) -> Self {
        let robot = Robot::load("neck").expect("the built-in robot");
        let specs: Vec<SimServoSpec> = robot.servos.iter().map(SimServoSpec::from).collect();
        let options = SimOptions::realtime(robot.buses[0].config.baud, robot.control_hz);
        let bus = SimBus::start(&specs, options).expect("a simulated bus");
        let program = Program::new();
        let file = robot_file(&program, "neck");
        let port = format!("serial:{}", bus.port_path());
        let basics = ["dance", "--robot", &file, "--bus", &port, "--no-picture"];
        let mut command = program.command(&[&basics[..], arguments].concat());
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        prepare(&mut command);
        let mut child = command.spawn().expect("it starts");
        let said: Arc<Mutex<Said>> = Arc::default();
        let heard = Arc::clone(&said);
        let stderr = BufReader::new(child.stderr.take().expect("its errors"));
        std::thread::spawn(move || {
            let heard = || heard.lock().unwrap_or_else(PoisonError::into_inner);
            for line in stderr.lines().map_while(Result::ok) {
                heard().lines.push((Instant::now(), line));
            }
            heard().is_all = true;
        });
        Self { _program: program, bus, child, said }
    }

    /// The same with a drill, until it strikes. A machine that stalls for longer than
    /// the servos' watchdogs allow ends the dance before: then once more.
    fn drill(drill: &str, arguments: &[&str]) -> Self {
        loop {
            let stage = Self::new(arguments, |command| {
                command.env("SERVODANCE_FAILPOINT", drill);
            });
            let strikes = || stage.said().line_with(BROKE_DOWN).is_some();
            stage.wait("drill", || strikes() || stage.said().is_all);
            if strikes() || stage.said().line_with(STALLED).is_none() {
                return stage;
            }
        }
    }

    fn states(&self) -> [servodance_sim::SimServoState; 2] {
        [0, 1].map(|index| self.bus.servo(index).expect("a servo"))
    }

    /// Servos with torque.
    pub fn powered(&self) -> usize {
        self.states().iter().filter(|s| s.torque_enabled).count()
    }

    /// Servos that their own watchdog holds still.
    pub fn tripped(&self) -> usize {
        self.states().iter().filter(|s| s.watchdog_tripped).count()
    }

    /// Whether a servo moves.
    pub fn moves(&self) -> bool {
        self.states().iter().any(|s| s.velocity_rad_s.abs() > 0.01)
    }

    /// Waits until it is so; then what was said belongs to the complaint.
    pub fn wait(&self, what: &str, done: impl Fn() -> bool) -> Instant {
        let start = Instant::now();
        while !done() {
            let waited = start.elapsed();
            assert!(waited < PATIENCE, "no {what}: {:#?}", self.words());
            std::thread::sleep(Duration::from_millis(1));
        }
        Instant::now()
    }

    fn said(&self) -> MutexGuard<'_, Said> {
        self.said.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The lines, but for codes to photograph.
    fn words(&self) -> Vec<String> {
        let lines = self.said().lines.iter().map(|(_, line)| line.clone()).collect::<Vec<_>>();
        lines.into_iter().filter(|line| line.chars().any(char::is_alphanumeric)).collect()
    }

    /// When a line with this word was said.
    pub fn hears(&self, word: &str) -> Instant {
        let at = || self.said().line_with(word).map(|(at, _)| *at);
        self.wait(word, || at().is_some() || self.said().is_all);
        at().unwrap_or_else(|| panic!("it ended without {word:?}: {:#?}", self.words()))
    }

    /// Waits for the end of the program.
    pub fn ends(&mut self) -> ExitStatus {
        self.child.wait().expect("it ends")
    }

    /// It breaks down with `word`, and ends: torque off, not successful.
    fn breaks(mut self, what: &'static str, word: &str) -> Row {
        let broke = self.hears(word);
        let off = self.wait("torque off", || self.powered() == 0);
        let status = self.ends();
        assert!(!status.success(), "{what}: {:#?}", self.words());
        self.row(what, off - broke, "torque off", status)
    }

    /// It breaks down with `word`, and the dance goes on until it is stopped.
    fn goes_on(mut self, what: &'static str, word: &str) -> Row {
        if !word.is_empty() {
            self.hears(word);
        }
        let watched = Instant::now();
        let mut moved = false;
        while watched.elapsed() < WATCHED {
            assert_eq!(self.powered(), 2, "{what}: {:#?}", self.words());
            moved |= self.moves();
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(moved, "{what}: the dance does not go on");
        signal(&self.child, "-INT");
        let asked = Instant::now();
        let off = self.wait("torque off", || self.powered() == 0);
        let status = self.ends();
        self.row(what, off - asked, "danced on; Ctrl-C: torque off", status)
    }

    fn row(&self, what: &'static str, after: Duration, how: &str, status: ExitStatus) -> Row {
        let complaints = [BROKE_DOWN, "error", "no sound", "cannot"];
        let is_one = |line: &String| complaints.iter().any(|word| line.contains(word));
        let said: Vec<String> = self.words().into_iter().filter(is_one).collect();
        let violations = self.bus.violations().total();
        assert_eq!(violations, 0, "{what}: {:?}", self.bus.violation_notes());
        Row {
            what,
            safe: format!("{how} after {} ms", after.as_millis()),
            said: said.join("; ").replace('|', "/"),
            status: match status.code() {
                Some(code) => code.to_string(),
                None => "killed".into(),
            },
            violations,
        }
    }
}

/// A dance on a robot with the watchdog that robots have. A machine that stalls
/// may trip it before its time: then once more.
fn watched_by_watchdogs() -> Stage {
    loop {
        let mut stage = Stage::start(Program::patient_robot, &[], |_| ());
        let tripped = || stage.states().iter().any(|s| s.watchdog_tripped);
        stage.wait("movement", || stage.moves() || tripped());
        if !tripped() {
            return stage;
        }
        stage.child.kill().expect("it can be killed");
        stage.ends();
    }
}

fn killed() -> Row {
    let mut stage = watched_by_watchdogs();
    stage.child.kill().expect("it can be killed");
    let killed = Instant::now();
    let status = stage.ends();
    let held = || {
        let states = stage.states();
        states.iter().all(|s| s.watchdog_tripped) && !stage.moves()
    };
    let still = stage.wait("watchdogs", held);
    let how = "held still by the servos' own watchdogs";
    stage.row("kill -9", still - killed, how, status)
}

fn full_disk() -> Row {
    // Half a megabyte is written in a few seconds.
    let stage = Stage::new(&["--record", "out.mcap"], |command| {
        let script = "trap '' XFSZ; ulimit -f 1000; exec \"$@\"";
        let mut shell = Command::new("sh");
        shell.args(["-c", script, "sh"]).arg(command.get_program());
        shell.args(command.get_args());
        if let Some(folder) = command.get_current_dir() {
            shell.current_dir(folder);
        }
        shell.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        *command = shell;
    });
    stage.goes_on("disk full while recording", "all else goes on")
}

/// Music on standard input, for so long.
fn listening(drill: &str, played_s: f64) -> Stage {
    let live = ["-", "--speed", "realtime", "--pcm-rate", "22050"];
    let mut stage = Stage::start(Program::unhurried_robot, &live, |command| {
        command.stdin(Stdio::piped()).env("SERVODANCE_FAILPOINT", drill);
    });
    let song = SongSpec::random(played_s, 3).and_then(|spec| spec.render());
    let song = song.expect("a song");
    let mut pipe = stage.child.stdin.take().expect("its input");
    std::thread::spawn(move || {
        let began = Instant::now();
        for (i, chunk) in song.samples.chunks(220).enumerate() {
            let due = began + Duration::from_millis(10) * i as u32;
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            let bytes: Vec<u8> =
                chunk.iter().flat_map(|s| ((s * 32_000.0) as i16).to_le_bytes()).collect();
            if pipe.write_all(&bytes).is_err() {
                return;
            }
        }
        // Silent, and yet not at its end, for longer than the test lasts.
        std::thread::sleep(PATIENCE);
    });
    // Half a second of sound comes before torque.
    stage.wait("torque", || stage.powered() == 2);
    stage
}

fn sound_lost() -> Row {
    listening("", 4.0).goes_on("audio device lost (standard input stalls)", "no sound arrives")
}

fn pipe_breaks() -> Row {
    listening("panic:pipe@200", 20.0).breaks("panic: thread that reads live sound", BROKE_DOWN)
}

/// The clock on the wall jumps by a day whenever somebody reads it.
#[cfg(target_os = "linux")]
fn clock_jumps() -> Row {
    const SHIM: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <time.h>
#include <sys/time.h>
static long jump(void) { static long days; return 86400 * ++days * (days % 3 ? 1 : -1); }
int clock_gettime(clockid_t id, struct timespec *t) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(id, t);
    if (id == CLOCK_REALTIME) t->tv_sec += jump();
    return result;
}
int gettimeofday(struct timeval *t, void *zone) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    t->tv_sec = now.tv_sec; t->tv_usec = now.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *t) {
    struct timeval now;
    gettimeofday(&now, 0);
    if (t) *t = now.tv_sec;
    return now.tv_sec;
}
"#;
    let folder = Program::new();
    std::fs::write(folder.path("jump.c"), SHIM).expect("a file");
    let library = folder.path("jump.so");
    // The linker of Rust programs is a C compiler.
    let built = Command::new("cc")
        .args(["-shared", "-fPIC", "-o"])
        .arg(&library)
        .arg(folder.path("jump.c"))
        .arg("-ldl")
        .status();
    assert!(built.expect("a C compiler").success());
    let date = || {
        let said = Command::new("date").arg("+%s").env("LD_PRELOAD", &library).output();
        let text = String::from_utf8(said.expect("date runs").stdout).expect("text");
        text.trim().parse::<u64>().expect("seconds")
    };
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let off_s = date().abs_diff(now.expect("a time").as_secs());
    assert!(off_s > 80_000, "the clock does not jump: {off_s}");
    let stage = Stage::new(&[], |command| {
        command.env("LD_PRELOAD", &library);
    });
    stage.wait("movement", || stage.moves());
    stage.goes_on("wall clock jumps by days at every look", "")
}

fn cases() -> Vec<fn() -> Row> {
    vec![
        killed,
        full_disk,
        sound_lost,
        pipe_breaks,
        #[cfg(target_os = "linux")]
        clock_jumps,
        || Stage::drill("panic:audio@150", &[]).breaks("panic: reading a recording", BROKE_DOWN),
        || Stage::drill("panic:features@150", &[]).breaks("panic: music features", BROKE_DOWN),
        || Stage::drill("panic:model@60", &[]).breaks("panic: model (motion source)", BROKE_DOWN),
        || Stage::drill("panic:control@500", &[]).breaks("panic: control loop", BROKE_DOWN),
        || {
            let watch = Stage::drill("panic:emergency stop@300", &[]);
            watch.breaks("panic: watch of the emergency stop", BROKE_DOWN)
        },
        || {
            let recorder = Stage::drill("panic:recorder@3000", &["--record", "out.mcap"]);
            recorder.goes_on("panic: recorder", BROKE_DOWN)
        },
        #[cfg(feature = "view")]
        || {
            let page = Stage::drill("panic:viewers@100", &["--view"]);
            page.goes_on("panic: server of the page", "\"viewers\" broke down")
        },
    ]
}

#[test]
fn whatever_breaks_the_robot_is_safe() {
    let _alone = alone();
    let rows = Mutex::new(Vec::new());
    let cases: Vec<(usize, fn() -> Row)> = cases().into_iter().enumerate().collect();
    for beside in cases.chunks(BESIDE) {
        std::thread::scope(|scope| {
            for (place, case) in beside {
                let rows = &rows;
                scope.spawn(move || {
                    let row = case();
                    let mut rows = rows.lock().unwrap_or_else(PoisonError::into_inner);
                    rows.push((*place, row));
                });
            }
        });
    }
    let mut rows = rows.into_inner().unwrap_or_else(PoisonError::into_inner);
    rows.sort_by_key(|(place, _)| *place);
    let mut table = String::from(
        "| what broke | what the robot did, judged at the simulated servos | what was said | exit status | limits broken |\n|---|---|---|---|---|\n",
    );
    for (_, row) in &rows {
        table += &format!(
            "| {} | {} | {} | {} | {} |\n",
            row.what, row.safe, row.said, row.status, row.violations
        );
    }
    println!("{table}");
    let file = concat!(env!("CARGO_TARGET_TMPDIR"), "/crash-safety.md");
    std::fs::write(file, table).expect("the table");
}

/// Every source file of the program, with its text.
fn sources() -> Vec<(std::path::PathBuf, String)> {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders: Vec<std::path::PathBuf> = [
        "src",
        "types/src",
        "audio/src",
        "model/src",
        "training/src",
        "runtime/src",
        "lab/src",
        "retarget/src",
        "drivers/src",
        "sim/src",
    ]
    .map(|folder| root.join(folder))
    .to_vec();
    let mut sources = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(&path).expect("text");
                sources.push((path, text));
            }
        }
    }
    assert!(sources.len() > 100, "{}", sources.len());
    sources
}

/// Nothing in the way of a dance reads the clock on the wall. The stamps of ROS 2
/// messages are times of day, which others read and no robot here.
#[test]
fn only_clocks_that_never_jump_are_used() {
    let of_ros2 = ["runtime/src/stage/ros.rs", "drivers/src/ros2/messages.rs"];
    for (path, text) in sources() {
        if of_ros2.iter().any(|stamps| path.ends_with(stamps)) {
            continue;
        }
        for clock in ["SystemTime", "CLOCK_REALTIME", "UNIX_EPOCH"] {
            assert!(!text.contains(clock), "{} reads {clock}", path.display());
        }
    }
}

/// Nobody who can write to a file or to the page can have a program run.
#[test]
fn no_other_program_is_run() {
    for (path, text) in sources() {
        let runs = text.contains("process::Command") || text.contains("execv");
        assert!(!runs, "{} runs another program", path.display());
    }
}
