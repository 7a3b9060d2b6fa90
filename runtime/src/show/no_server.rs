//! In place of the server, where it is not built in.

use super::link::ViewerEnd;
use super::scene::Scene;
use anyhow::bail;
use std::convert::Infallible;
use std::net::SocketAddr;

/// There is none.
pub struct Server(Infallible);

impl Server {
    /// Says that there is none.
    ///
    /// # Errors
    /// Always.
    pub fn start(_: SocketAddr, _: Scene, _: ViewerEnd) -> anyhow::Result<Self> {
        bail!("--view: this program was built without its page; build with --features view")
    }

    /// Where the page would be.
    pub fn address(&self) -> &str {
        match self.0 {}
    }
}
