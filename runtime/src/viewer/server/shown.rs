//! What a page is about, a robot or a stage: what it shows, and whom it asks.

use crate::viewer::songs::Songs;
use axum::body::Bytes;
use axum::http::StatusCode;
use serde_json::Value;

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    Taken,
    /// It said that the page is there, no more.
    Alive,
    /// A stop, and the control loop says that torque is off since.
    Stopped,
}

/// A request that was not taken: the status and the reason, one line.
pub type RequestRefusal = (StatusCode, String);

/// What the server itself knows, told in each frame.
#[derive(Clone, Copy, Debug)]
pub struct ServerNow {
    /// The server's clock, seconds.
    pub clock_s: f64,
    /// Pages that are open.
    pub viewers: usize,
}

/// The content of a page. All is called by the viewer thread.
pub trait Shown: Send + Sync {
    /// The name of the page's first file.
    fn index(&self) -> &'static str;
    /// What does not change.
    fn scene(&self) -> Value;
    /// Whether something has come that no frame has shown.
    fn has_news(&self) -> bool;
    /// The newest frame, as JSON.
    fn frame(&self, now: ServerNow) -> String;
    /// Does what an operator's page asks for.
    fn ask(&self, json: &str) -> Result<Answer, RequestRefusal>;
    /// The songs that the page plays, and adds to where it is allowed to.
    fn songs(&self) -> &Songs;
    fn takes_songs(&self) -> bool;
    /// The corners of a mesh of the scene.
    fn mesh(&self, _part: usize) -> Option<Bytes> {
        None
    }
    /// A part of the scene that changes seldom, as JSON.
    fn part(&self, _name: &str) -> Option<String> {
        None
    }
    /// A file that an operator may take along: its name and text.
    fn document(&self) -> Option<(&'static str, String)> {
        None
    }
    /// Whether a page waits to see its stop confirmed.
    fn is_stop_awaited(&self) -> bool {
        false
    }
    /// The page of an operator has fallen silent.
    fn operator_lost(&self) {}
}
