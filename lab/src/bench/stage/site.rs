//! Where the programs of a trial live: side by side on this machine's loopback,
//! or each in a network namespace of its own, joined by pairs of virtual
//! Ethernet interfaces, where packets can really be lost and links really go
//! down.

use super::relay::{LinkFault, Relay};
use anyhow::{Context, bail};
use std::io::Write;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const PORT: u16 = 7448;
const NAMESPACE: Duration = Duration::from_secs(10);

/// Where the programs of a trial are started.
#[derive(Clone, Copy, Debug)]
pub enum Site {
    Loopback(u16),
    /// Each in a namespace; whether the kernel can lose packets on purpose.
    Namespaces {
        /// Whether `nft` can drop packets there.
        lossy: bool,
    },
}

impl Site {
    /// A site on loopback, or of namespaces.
    /// Fails for: namespaces cannot be made here.
    pub fn new(namespaces: bool) -> anyhow::Result<Self> {
        if !namespaces {
            let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
            return Ok(Self::Loopback(free.local_addr()?.port()));
        }
        run("unshare", &["--net", "--", "true"])
            .context("--namespaces: this needs Linux, root and util-linux")?;
        run("ip", &["link", "set", "lo", "up"]).context("--namespaces: this needs iproute2")?;
        let lossy = run("nft", &["list", "ruleset"]).is_ok();
        Ok(Self::Namespaces { lossy })
    }

    pub fn models_loss(self) -> bool {
        !matches!(self, Self::Namespaces { lossy: true })
    }

    pub fn listen(self) -> String {
        match self {
            Self::Loopback(port) => format!("tcp/127.0.0.1:{port}"),
            Self::Namespaces { .. } => format!("tcp/0.0.0.0:{PORT}"),
        }
    }

    pub fn leader(self) -> SocketAddr {
        match self {
            Self::Loopback(port) => (Ipv4Addr::LOCALHOST, port).into(),
            Self::Namespaces { .. } => (inside(0), PORT).into(),
        }
    }

    /// Starts the program at `place` (0: the leader) with these arguments.
    pub fn start(self, place: u8, loss: f64, arguments: &[String]) -> anyhow::Result<Child> {
        let program = std::env::current_exe()?;
        if matches!(self, Self::Loopback(_)) {
            let mut command = Command::new(program);
            command.args(arguments).stdin(Stdio::null());
            return Ok(command.stdout(Stdio::null()).spawn()?);
        }
        let mut script = format!(
            "read _ && ip link set lo up && ip addr add {}/30 dev sdn{place} && ip link set sdn{place} up",
            inside(place)
        );
        if loss > 0.0 && !self.models_loss() {
            let rule = format!("'numgen random mod 10000 < {} drop'", (loss * 1e4) as u32);
            script += " && nft add table inet lossy";
            for (chain, hook) in [("in", "input"), ("out", "output")] {
                script += &format!(
                    " && nft add chain inet lossy {chain} '{{ type filter hook {hook} priority 0; }}' \
                     && nft add rule inet lossy {chain} {rule}"
                );
            }
        }
        script += " && exec \"$@\"";
        let mut child = Command::new("unshare")
            .args(["--net", "--", "sh", "-c", &script, "sh"])
            .arg(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()?;
        let wired = wire(place, &child);
        if wired.is_err() {
            let _ = child.kill();
        }
        wired?;
        if let Some(mut go) = child.stdin.take() {
            go.write_all(b"\n")?;
        }
        Ok(child)
    }

    /// A relay between the follower at `place` and the leader.
    pub fn relay(self, place: u8, fault: LinkFault, seed: u64) -> anyhow::Result<Relay> {
        // The other end of a pair is there as soon as its program is; until
        // then any address of this side will do.
        let address = match self {
            Self::Loopback(_) => Ipv4Addr::LOCALHOST,
            Self::Namespaces { .. } => Ipv4Addr::UNSPECIFIED,
        };
        let mut relay = Relay::start(address, self.leader(), fault, seed)?;
        if let Self::Namespaces { .. } = self {
            relay.address.set_ip(outside(place).into());
        }
        Ok(relay)
    }

    /// Cuts the follower at `place` off, or not any more.
    pub fn cut(self, place: u8, relay: &Relay, cut: bool) -> anyhow::Result<()> {
        match self {
            Self::Loopback(_) => relay.cut(cut),
            Self::Namespaces { .. } => {
                let name = format!("sdh{place}");
                run("ip", &["link", "set", &name, if cut { "down" } else { "up" }])?;
            }
        }
        Ok(())
    }
}

fn outside(place: u8) -> Ipv4Addr {
    Ipv4Addr::new(10, 77, place, 1)
}

fn inside(place: u8) -> Ipv4Addr {
    Ipv4Addr::new(10, 77, place, 2)
}

/// Lays a pair of interfaces from here into the namespace of a program.
fn wire(place: u8, child: &Child) -> anyhow::Result<()> {
    let pid = child.id().to_string();
    let theirs = format!("/proc/{pid}/ns/net");
    let own = std::fs::read_link("/proc/self/ns/net")?;
    let began = Instant::now();
    while std::fs::read_link(Path::new(&theirs)).is_ok_and(|ns| ns == own) {
        if began.elapsed() > NAMESPACE {
            bail!("--namespaces: a program got no namespace");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    let (here, there) = (format!("sdh{place}"), format!("sdn{place}"));
    let address = format!("{}/30", outside(place));
    // Of a program that was killed; the kernel takes it away in its own time.
    let _ = run("ip", &["link", "del", &here]);
    let pair = ["link", "add", &here, "type", "veth", "peer", "name", &there, "netns", &pid];
    run("ip", &pair)?;
    run("ip", &["addr", "add", &address, "dev", &here])?;
    run("ip", &["link", "set", &here, "up"])
}

fn run(program: &str, arguments: &[&str]) -> anyhow::Result<()> {
    let output = Command::new(program)
        .args(arguments)
        .output()
        .with_context(|| format!("cannot run {program}"))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        bail!("{program} {}: {}", arguments.join(" "), text.trim());
    }
    Ok(())
}
