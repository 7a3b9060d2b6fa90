//! Viewers: what they see of the robot, and what they can request.
//!
//! ```text
//! control loop --Snapshot--> latest-value slot --> viewer thread --> browsers, terminal
//!      ^                                                |
//!      +--- once a cycle --- queue <--- ViewerRequest --+<--- page, API, keys
//! ```
//!
//! The control loop never waits for a viewer: `link.rs` says how the two are held
//! apart. The page and its API are built with the feature `view`, the terminal always.

#[cfg(feature = "view")]
mod frame;
mod link;
pub(crate) mod music_track;
mod operator_watch;
mod player;
#[cfg_attr(not(feature = "view"), allow(dead_code))] // requests as text are the page's
mod request;
mod scene;
#[cfg(feature = "view")]
mod server;
#[cfg(not(feature = "view"))]
#[path = "server/absent.rs"]
mod server;
pub(crate) mod snapshot;
#[cfg(feature = "view")]
mod song_wav;
#[cfg_attr(not(feature = "view"), allow(dead_code))] // songs are added on the page
mod songs;
#[cfg(feature = "stage")]
#[cfg_attr(not(feature = "view"), allow(dead_code))] // only the page reads it
pub(crate) mod stage_link;
mod terminal;

pub use link::{RobotEnd, ViewerEnd, link};
pub use player::Player;
pub use request::ViewerRequest;
pub use scene::Scene;
pub use server::Server;
pub use snapshot::{Activity, ViewerSettings};
pub use songs::Songs;
pub use terminal::TerminalView;
