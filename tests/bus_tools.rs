//! The simulated bus as another program sees it.

use crate::program::Program;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

#[test]
fn a_served_bus_is_found_by_scan_and_ends_on_sigterm() {
    let program = Program::new();
    let mut server = program
        .command(&["sim-bus", "--robot", "op3"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the server starts");
    let mut port = String::new();
    BufReader::new(server.stdout.take().expect("its output"))
        .read_line(&mut port)
        .expect("the first line");

    let scan = program.succeed(&["scan", port.trim(), "--baud", "2000000"]);
    let found = String::from_utf8_lossy(&scan.stdout).into_owned();
    assert_eq!(found.lines().count(), 20, "{found}");
    assert!(found.contains("XM430-W350 (1020)"), "{found}");

    let killed = Command::new("kill").arg(server.id().to_string()).status();
    assert!(killed.expect("kill runs").success());
    let ended = server.wait_with_output().expect("it ends");
    assert!(ended.status.success());
    assert!(String::from_utf8_lossy(&ended.stderr).contains("0 bad"));
}
