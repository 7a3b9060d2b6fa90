//! The links of the page, said to whoever started it.

use servodance_runtime::process::console::{stderr, stdout_line};
use servodance_runtime::viewer::Server;
use std::io::IsTerminal;

/// The operator's link, the first line on standard output, then the audience's; both as QR
/// codes, if others can reach them and a terminal shows them.
pub fn say_links(server: &Server, reachable: bool) {
    stdout_line!("{}", server.address());
    stdout_line!("only to watch: {}", server.audience_address());
    if reachable && std::io::stderr().is_terminal() {
        stderr(format_args!("{}", server.codes()));
    }
}
