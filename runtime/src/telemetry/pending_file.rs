//! Files that appear whole or not at all.
//!
//! Everything is written to a neighbour with a temporary name and renamed at
//! the end, so that a refused run or a full disk leaves no half file behind.

use anyhow::Context;
use std::fs::{File, Permissions};
use std::io::{BufWriter, Read, copy};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// A file under construction. Dropped without [`PendingFile::finish`], no file appears.
#[derive(Debug)]
pub struct PendingFile {
    target: PathBuf,
    file: NamedTempFile,
}

impl PendingFile {
    /// Starts `target`; its folder must exist and be writable.
    pub fn create(target: &Path) -> anyhow::Result<Self> {
        let folder = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        if target.is_dir() {
            anyhow::bail!("cannot write {}: it is a folder", target.display());
        }
        let file = tempfile::Builder::new()
            .prefix(".servodance-")
            .permissions(Permissions::from_mode(0o644)) // a temporary file is private
            .tempfile_in(folder)
            .with_context(|| format!("cannot write {}", target.display()))?;
        Ok(Self { target: target.to_owned(), file })
    }

    /// A buffered writer into the file, from its beginning; it can seek.
    pub fn writer(&self) -> anyhow::Result<BufWriter<File>> {
        let file = self.file.as_file().try_clone();
        let file = file.with_context(|| format!("cannot write {}", self.target.display()))?;
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
        let target = self.target;
        self.file
            .persist(&target)
            .map_err(|e| e.error)
            .with_context(|| format!("cannot write {}", target.display()))?;
        Ok(())
    }
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
    fn a_missing_folder_is_named() {
        let error = write_whole(Path::new("/no/such/folder/out.json"), b"").unwrap_err();
        assert!(error.to_string().contains("/no/such/folder/out.json"));
    }
}
