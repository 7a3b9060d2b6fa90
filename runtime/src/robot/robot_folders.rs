//! The folders whose files a robot file and its description may name.
//!
//! Both files may be untrusted. Only files inside the robot's folders are read,
//! wherever `..` and links lead; devices, pipes and folders are refused. Only a
//! path that the user gives may lie elsewhere.

use std::path::{Path, PathBuf};

/// How far above a description its package may begin.
const PACKAGE_DEPTH: usize = 4;
/// Folders of meshes beside the description's own, where there is no package.
const MESHES_BESIDE: [&str; 2] = ["../meshes", "../assets"];

#[derive(Debug, thiserror::Error)]
pub enum FileRefused {
    #[error("{0}")]
    Missing(std::io::Error),
    #[error("it lies outside the robot's folder")]
    Outside,
    #[error("it is no file")]
    NoFile,
}

#[derive(Clone, Debug)]
pub struct RobotFolders {
    beside: PathBuf,
    /// All, without links, the robot file's first.
    all: Vec<PathBuf>,
}

impl RobotFolders {
    pub fn of_file(folder: &Path) -> Self {
        Self { beside: folder.to_owned(), all: real(&folder.join(".")).into_iter().collect() }
    }

    /// The robot file's folder, the description's, the folder of meshes beside that, and
    /// that of the ROS package around the description, if there is a `package.xml`.
    pub fn of_robot(folder: &Path, urdf: &Path) -> Self {
        let urdf = folder.join(urdf);
        let beside = urdf.parent().unwrap_or(folder).to_owned();
        let mut all = Self::of_file(folder).all;
        all.extend(real(&beside.join(".")));
        let mut above = all.last().into_iter().flat_map(|beside| beside.ancestors());
        let package =
            above.by_ref().take(PACKAGE_DEPTH).find(|at| at.join("package.xml").is_file());
        let package = package.map(Path::to_owned);
        all.extend(package.into_iter().chain(meshes_beside(&beside)));
        Self { beside, all }
    }

    /// Where a path leads, if that is a file of the robot.
    pub fn find(&self, path: &Path) -> Result<PathBuf, FileRefused> {
        let path = std::fs::canonicalize(path).map_err(FileRefused::Missing)?;
        if !self.all.iter().any(|folder| path.starts_with(folder)) {
            return Err(FileRefused::Outside);
        }
        match path.is_file() {
            true => Ok(path),
            false => Err(FileRefused::NoFile),
        }
    }

    /// A file's way from the first of the folders, if it is in there.
    pub fn relative(&self, path: &Path) -> Option<String> {
        let path = self.find(path).ok()?;
        let inner = path.strip_prefix(self.all.first()?).ok()?;
        Some(inner.to_str()?.to_owned())
    }

    /// The mesh of this name in the description; the error says why it is not read.
    pub fn mesh(&self, name: &str) -> Result<PathBuf, String> {
        let candidates: Vec<PathBuf> = if let Some(path) = name.strip_prefix("package://") {
            // A package is called as its folder, or as something else.
            let inner = path.split_once('/').map_or("", |(_, rest)| rest);
            let places = [path, inner].into_iter();
            let from = |place| self.all.iter().map(move |folder| folder.join(place));
            places.flat_map(from).collect()
        } else if let Some(path) = name.strip_prefix("file://") {
            vec![path.into()]
        } else if name.contains("://") {
            return Err("it is not a file of the robot".into());
        } else {
            vec![self.beside.join(name)]
        };
        let mut why = None;
        for candidate in candidates {
            match self.find(&candidate) {
                Ok(path) => return Ok(path),
                Err(FileRefused::Missing(_)) => {}
                Err(refused) => why = why.or(Some(refused)),
            }
        }
        Err(why.map_or("there is no such file".into(), |refused| refused.to_string()))
    }
}

/// Folders of meshes next to a description's folder, if they are no links to elsewhere.
fn meshes_beside(beside: &Path) -> impl Iterator<Item = PathBuf> {
    let parent = real(&beside.join(".."));
    let folders = MESHES_BESIDE.iter().filter_map(move |meshes| real(&beside.join(meshes)));
    folders.filter(move |folder| folder.parent() == parent.as_deref())
}

/// Where a path leads, through `..` and links; nowhere if nothing is there.
fn real(path: &Path) -> Option<PathBuf> {
    std::fs::canonicalize(path).ok()
}
