//! Why a port cannot be opened, in words that say what to do about it.

use std::io;
use std::path::Path;

use crate::serial::wire::system_ports::choices;

/// What to do about a port that could not be opened, to stand behind the system's reason.
pub fn remedy(port: &str, error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::PermissionDenied => {
            "; sudo usermod -aG dialout $USER, then log in again".into()
        }
        io::ErrorKind::NotFound | io::ErrorKind::InvalidInput => choices(),
        _ => match holder(Path::new("/proc"), port) {
            Some(holder) => format!("; {holder} has it open"),
            None => choices(),
        },
    }
}

/// Name and process id of a program that has the port open, as far as may be seen.
fn holder(processes: &Path, port: &str) -> Option<String> {
    let port = Path::new(port).canonicalize().ok()?;
    let own = std::process::id().to_string();
    for process in std::fs::read_dir(processes).ok()?.flatten() {
        let id = process.file_name().to_string_lossy().into_owned();
        let is_process = id.bytes().all(|digit| digit.is_ascii_digit());
        let Ok(files) = std::fs::read_dir(process.path().join("fd")) else { continue };
        let is_open = |file: std::fs::DirEntry| {
            std::fs::read_link(file.path()).is_ok_and(|target| target == port)
        };
        if is_process && id != own && files.flatten().any(is_open) {
            let name = std::fs::read_to_string(process.path().join("comm")).unwrap_or_default();
            return Some(format!("{} (process {id})", name.trim()));
        }
    }
    None
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_has_a_port_open_is_named() {
        let folder = std::env::temp_dir().join(format!("holder-{}", std::process::id()));
        let files = folder.join("4000000/fd");
        std::fs::create_dir_all(&files).unwrap();
        let port = folder.join("ttyUSB0");
        std::fs::write(&port, "").unwrap();
        std::os::unix::fs::symlink(port.canonicalize().unwrap(), files.join("3")).unwrap();
        std::fs::write(folder.join("4000000/comm"), "wizard\n").unwrap();
        let named = holder(&folder, port.to_str().unwrap());
        assert_eq!(named.unwrap(), "wizard (process 4000000)");
        assert_eq!(holder(&folder, "/dev/null"), None);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_port_that_may_not_be_opened_says_how_it_may_be() {
        let denied = io::Error::from(io::ErrorKind::PermissionDenied);
        assert!(remedy("/dev/ttyUSB0", &denied).contains("dialout"));
    }
}
