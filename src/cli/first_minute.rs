//! The program without a command: the built-in humanoid dances the built-in song on a page.

use super::dance;
use crate::cli::prelude::*;
use clap::Parser;
use servodance_runtime::session::dance_session::Session;
use servodance_runtime::viewer::{Server, ViewerEnd, ViewerRequest};
use std::time::Duration;

/// How often it is looked whether the page is open.
const POLL: Duration = Duration::from_millis(50);

/// What is danced: as if it had been asked for.
#[derive(Debug, Parser)]
struct BuiltInShow {
    #[command(flatten)]
    dance: dance::Args,
}

/// Simulated whatever the environment says: nobody asked for a real robot to move.
const ARGUMENTS: [&str; 7] =
    ["servodance", "--view", "--wait-for-start", "--no-picture", "--quiet", "--bus", "sim"];

/// Serves the page, opens it in a browser if there is one, and dances once it is open; then
/// again whenever the page says start.
pub fn run() -> anyhow::Result<ExitCode> {
    let config = dance::configuration(BuiltInShow::parse_from(ARGUMENTS).dance)?;
    let Some(bind) = config.view else { bail!("no address for the page") };
    let stop = stop_signal()?;
    let mut session = Session::new(config)?;
    let server = Server::start(bind, session.scene()?, session.add_viewer(), session.songs())?;
    stdout_line!("{}", server.address());
    stdout_line!(
        "{}",
        match open_browser(&server) {
            true => "The page opens in the browser; there the built-in humanoid dances, simulated.",
            false => "Open this page in a browser: there the built-in humanoid dances, simulated.",
        }
    );
    stdout_line!(
        "Your own music: servodance dance song.ogg --view. All commands: servodance --help"
    );
    stdout_line!("Ctrl-C ends it.");
    start_when_watched(session.add_viewer())?;
    session.run(&stop, |_, outcome| {
        if let Err(error) = outcome {
            stderr_line!("error: {error:#}");
        }
    })?;
    Ok(ExitCode::from(INTERRUPTED))
}

/// The link in its command line is good once: other users of this machine can read it there.
fn open_browser(server: &Server) -> bool {
    let has_screen = ["DISPLAY", "WAYLAND_DISPLAY"]
        .iter()
        .any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty()));
    let has_screen = has_screen || cfg!(any(target_os = "macos", windows));
    has_screen && open::that_detached(server.address_for_once()).is_ok()
}

/// Says start when somebody has the page open.
fn start_when_watched(mut end: ViewerEnd) -> std::io::Result<()> {
    let thread = std::thread::Builder::new().name("first start".into());
    thread.spawn(move || {
        while !end.operators.was_heard() {
            std::thread::sleep(POLL);
        }
        end.ask(&[ViewerRequest::Start])
    })?;
    Ok(())
}
