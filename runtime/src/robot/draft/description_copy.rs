//! A description from elsewhere, or one that was converted, copied beside a new robot file
//! with the meshes that the page draws of it.
//!
//! A robot file reads nothing outside its folder ([`RobotFolders`]). In the copy meshes
//! go by the names that they have there; all else stays as it is. Meshes that
//! would not be drawn are left where they are, and named.

use crate::robot::meshes::open_mesh;
use crate::robot::robot_folders::RobotFolders;
use crate::telemetry::pending_file::PendingFile;
use anyhow::Context;
use servodance_retarget::RobotModel;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

#[derive(Debug)]
pub(super) struct DescriptionCopy {
    pub text: String,
    urdf: PathBuf,
    folder: PathBuf,
    /// Of each mesh, where it is and what it is called there.
    meshes: BTreeMap<PathBuf, String>,
    left: Vec<String>,
}

impl DescriptionCopy {
    /// `text`: the description as a URDF; its meshes lie where `description` says.
    pub fn of(description: &Path, text: &str, out: &Path) -> anyhow::Result<Self> {
        let stem = out.file_stem().unwrap_or_default().to_string_lossy();
        let mut copies = Self {
            text: text.to_owned(),
            urdf: out.with_extension("urdf"),
            folder: out.with_file_name(format!("{}.meshes", plain(&stem))),
            meshes: BTreeMap::new(),
            left: Vec::new(),
        };
        let folder = description.parent().unwrap_or(Path::new(""));
        let name = Path::new(description.file_name().unwrap_or_default());
        let folders = RobotFolders::of_robot(folder, name);
        let own = RobotFolders::of_file(out.parent().unwrap_or(Path::new("")));
        let model = RobotModel::new(text, &[])?;
        let mut renamed = BTreeMap::new();
        for mesh in model.meshes() {
            let name = mesh.filename.as_str();
            if renamed.contains_key(name) {
                continue;
            }
            let new = copies.add(name, &folders, &own).unwrap_or_else(|why| {
                copies.left.push(format!("mesh {name}: {why}"));
                name.to_owned()
            });
            renamed.insert(name, new);
        }
        for quote in ["\"", "'"] {
            let parts = copies.text.split(quote);
            let parts = parts.map(|part| renamed.get(part).map_or(part, String::as_str));
            copies.text = parts.collect::<Vec<_>>().join(quote);
        }
        Ok(copies)
    }

    /// Takes a mesh along that is not in the robot file's `own` folder; what the copy of the
    /// description calls it.
    fn add(
        &mut self,
        name: &str,
        folders: &RobotFolders,
        own: &RobotFolders,
    ) -> Result<String, String> {
        let path = folders.mesh(name)?;
        open_mesh(&path)?;
        let mut parts = ['"', '\''].into_iter().flat_map(|q| self.text.split(q));
        if !parts.any(|part| part == name) {
            return Err("it is not written so in the description".into());
        }
        if let Some(relative) = own.relative(&path) {
            return Ok(relative);
        }
        let called = match self.meshes.get(&path) {
            Some(called) => called.clone(),
            None => self.free_name(&path),
        };
        let folder = self.folder.file_name().unwrap_or_default();
        let new = format!("{}/{called}", folder.to_string_lossy());
        self.meshes.insert(path, called);
        Ok(new)
    }

    fn free_name(&self, path: &Path) -> String {
        let name = plain(&path.file_name().unwrap_or_default().to_string_lossy());
        let numbered = (2..).map(|number| format!("{number}-{name}"));
        let mut names = std::iter::once(name.clone()).chain(numbered);
        let is_free = |name: &String| self.meshes.values().all(|taken| taken != name);
        names.find(is_free).unwrap_or(name)
    }

    /// What the robot file calls the copy.
    pub fn urdf_name(&self) -> String {
        self.urdf.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// What will be there: the description, and the folder if there are meshes.
    pub fn places(&self) -> Vec<PathBuf> {
        let folder = (!self.meshes.is_empty()).then(|| self.folder.clone());
        std::iter::once(self.urdf.clone()).chain(folder).collect()
    }

    pub fn lines(&self) -> Vec<String> {
        let left = self.left.iter().map(|line| format!("not copied: {line}"));
        let copied = (!self.meshes.is_empty())
            .then(|| format!("copied: {} meshes to {}", self.meshes.len(), self.folder.display()));
        copied.into_iter().chain(left).collect()
    }

    pub fn write(&self) -> anyhow::Result<()> {
        if !self.meshes.is_empty() && !self.folder.is_dir() {
            std::fs::create_dir(&self.folder)
                .with_context(|| format!("cannot write {}", self.folder.display()))?;
        }
        let pending = self.pending().inspect_err(|_| {
            // Fails where somebody else's files are in it, as it should.
            let _ = std::fs::remove_dir(&self.folder);
        })?;
        pending.into_iter().try_for_each(PendingFile::finish)
    }

    fn pending(&self) -> anyhow::Result<Vec<PendingFile>> {
        let mut all = Vec::new();
        for (path, called) in &self.meshes {
            let cannot = || format!("cannot copy {}", path.display());
            let mut mesh = File::open(path).with_context(cannot)?;
            all.push(PendingFile::filled(&self.folder.join(called), &mut mesh)?);
        }
        all.push(PendingFile::filled(&self.urdf, &mut self.text.as_bytes())?);
        Ok(all)
    }
}

/// A name that stands in XML and in a path as it is.
fn plain(name: &str) -> String {
    let keep = |c: char| c.is_alphanumeric() || "-_.".contains(c);
    name.chars().map(|c| if keep(c) { c } else { '_' }).collect()
}
