//! Files that appear whole or not at all.
//!
//! Everything is written to a neighbour with a temporary name and renamed at
//! the end, so that a refused run or a full disk leaves no half file behind.
//! Links are followed. A device, FIFO or socket is written to at the end; nothing
//! takes its place.

use anyhow::Context;
use std::fs::{File, Permissions};
use std::io::{self, BufWriter, Read, Seek, copy};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// A file under construction. Dropped without [`PendingFile::finish`], no file appears.
#[derive(Debug)]
pub struct PendingFile {
    /// As the user wrote it.
    named: PathBuf,
    /// Where links lead.
    target: PathBuf,
    is_device: bool,
    file: NamedTempFile,
}

impl PendingFile {
    /// Starts `target`; its folder must exist and be writable.
    pub fn create(target: &Path) -> anyhow::Result<Self> {
        let named = target.to_owned();
        let target = followed(target);
        if target.is_dir() {
            anyhow::bail!("cannot write {}: it is a folder", named.display());
        }
        let is_device = target.metadata().is_ok_and(|found| !found.is_file());
        let folder = match target.parent() {
            _ if is_device => std::env::temp_dir(),
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        let file = tempfile::Builder::new()
            .prefix(".servodance-")
            .permissions(Permissions::from_mode(0o644)) // a temporary file is private
            .tempfile_in(folder)
            .map_err(|error| without_name(&error))
            .with_context(|| format!("cannot write {}", named.display()))?;
        Ok(Self { named, target, is_device, file })
    }

    /// A buffered writer into the file, from its beginning; it can seek.
    pub fn writer(&self) -> anyhow::Result<BufWriter<File>> {
        let file = self.file.as_file().try_clone();
        let file = file.with_context(|| format!("cannot write {}", self.named.display()))?;
        Ok(BufWriter::new(file))
    }

    /// Starts `target` and writes everything into it that can be read.
    pub(crate) fn filled(target: &Path, content: &mut impl Read) -> anyhow::Result<Self> {
        let pending = Self::create(target)?;
        let copied = copy(content, &mut pending.file.as_file());
        copied.with_context(|| format!("cannot write {}", target.display()))?;
        Ok(pending)
    }

    /// Where the file lies until then, for libraries that open it themselves.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Gives the file its name.
    pub fn finish(self) -> anyhow::Result<()> {
        let Self { named, target, is_device, file } = self;
        let done = match is_device {
            true => pour(file.into_file(), &target),
            false => replace(file, &target),
        };
        done.with_context(|| format!("cannot write {}", named.display()))
    }
}

/// Puts a file in the place of `target`, on the disk before it has the name, so that a power
/// cut leaves the old one or the new one; who may read and write the old one may the new one.
fn replace(file: NamedTempFile, target: &Path) -> io::Result<()> {
    if let Ok(old) = target.metadata() {
        file.as_file().set_permissions(old.permissions())?;
    }
    file.as_file().sync_all()?;
    file.persist(target).map(drop).map_err(|error| error.error)
}

/// The same without the temporary name that it carries.
fn without_name(error: &io::Error) -> io::Error {
    let told = error.to_string();
    let cause = told.split(" at path ").next().unwrap_or_default();
    io::Error::new(error.kind(), cause.to_owned())
}

/// Where a path leads through links that exist; a link to nothing leads to its target.
fn followed(path: &Path) -> PathBuf {
    match (path.canonicalize(), path.read_link()) {
        (Ok(found), _) => found,
        (Err(_), Ok(link)) => path.parent().map_or(link.clone(), |folder| folder.join(link)),
        (Err(_), Err(_)) => path.to_owned(),
    }
}

fn pour(mut from: File, target: &Path) -> io::Result<()> {
    from.rewind()?;
    copy(&mut from, &mut File::options().write(true).open(target)?).map(drop)
}

/// Writes `bytes` to `path`, whole or not at all.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    PendingFile::filled(path, &mut &bytes[..])?.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_file_that_is_replaced_keeps_its_permissions() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("robot.toml");
        write_whole(&target, b"old").unwrap();
        std::fs::set_permissions(&target, Permissions::from_mode(0o600)).unwrap();
        write_whole(&target, b"new").unwrap();
        assert_eq!(std::fs::read(&target).unwrap(), b"new");
        assert_eq!(target.metadata().unwrap().permissions().mode() & 0o777, 0o600);
    }

    #[test]
    fn an_abandoned_file_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.json");
        let pending = PendingFile::create(&target).unwrap();
        pending.writer().unwrap().write_all(b"half").unwrap();
        drop(pending);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);

        write_whole(&target, b"whole").unwrap();
        assert_eq!(std::fs::read(&target).unwrap(), b"whole");
    }

    #[test]
    fn what_is_no_regular_file_stays_what_it_is() {
        use std::os::unix::fs::FileTypeExt;
        write_whole(Path::new("/dev/null"), b"gone").unwrap();
        let null = std::fs::metadata("/dev/null").unwrap();
        assert!(null.file_type().is_char_device());

        let folder = tempfile::tempdir().unwrap();
        let (link, target) = (folder.path().join("link"), folder.path().join("target"));
        std::os::unix::fs::symlink("target", &link).unwrap();
        for text in [b"first", b"again"] {
            write_whole(&link, text).unwrap();
            assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
            assert_eq!(std::fs::read(&target).unwrap(), text);
        }
    }

    #[test]
    fn a_missing_folder_is_named() {
        let error = write_whole(Path::new("/no/such/folder/out.json"), b"").unwrap_err();
        assert!(error.to_string().contains("/no/such/folder/out.json"));
    }
}
