//! In place of the server, where it is not built in.

#![allow(missing_docs)] // as in `mod.rs`

use super::link::ViewerEnd;
use super::scene::Scene;
use super::songs::Songs;
#[cfg(feature = "stage")]
use super::stage_link::StageEnd;
use anyhow::bail;
use std::convert::Infallible;
use std::net::SocketAddr;

const ABSENT: &str =
    "--view: this program was built without its page; build without --no-default-features";

pub struct Server(Infallible);

impl Server {
    pub fn start(_: SocketAddr, _: Scene, _: ViewerEnd, _: Songs) -> anyhow::Result<Self> {
        bail!(ABSENT)
    }

    #[cfg(feature = "stage")]
    pub fn start_stage(_: SocketAddr, _: StageEnd) -> anyhow::Result<Self> {
        bail!(ABSENT)
    }

    pub fn address(&self) -> &str {
        match self.0 {}
    }

    pub fn audience_address(&self) -> &str {
        match self.0 {}
    }

    pub fn address_for_once(&self) -> String {
        match self.0 {}
    }

    pub fn codes(&self) -> String {
        match self.0 {}
    }
}
