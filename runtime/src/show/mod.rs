//! The show: what whoever watches the robot sees, and what they can ask of it.
//!
//! ```text
//! control loop --Snapshot--> latest-value slot --> viewer thread --> browsers, terminal
//!      ^                                                |
//!      +--- once a cycle --- queue <------ Request -----+<--- page, API, keys
//! ```
//!
//! The control loop never waits for a viewer: see [`mod@link`] for how the two are
//! held apart. The page and its API are built with the feature `view`, the terminal
//! always.

#[cfg(feature = "view")]
mod api;
mod frame;
#[cfg(feature = "view")]
mod guard;
pub mod link;
mod meshes;
#[cfg(feature = "view")]
mod page;
mod player;
pub mod request;
mod scene;
#[cfg(feature = "view")]
mod server;
#[cfg(not(feature = "view"))]
#[path = "no_server.rs"]
mod server;
pub mod snapshot;
#[cfg(feature = "view")]
mod socket;
mod stl;
mod terminal;

pub use frame::frame;
pub use link::{RobotEnd, ViewerEnd, link};
pub use meshes::Meshes;
pub(crate) use meshes::open as open_mesh;
pub use player::Player;
pub use request::{Action, Request, Settings};
pub use scene::{Scene, pose_array};
pub use server::Server;
pub use snapshot::{Activity, Snapshot};
pub use terminal::TerminalView;
