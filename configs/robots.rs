//! The robots that come with servodance, as text: TOML and URDF of each, and the JSON Schema
//! of robot files. What they mean: `servodance-runtime` (`robot`).
//!
//! To add a robot, put `NAME.toml` and `NAME.urdf` into this folder and `NAME` into
//! [`BUILT_IN`].
//!
//! ```
//! let neck = servodance_robots::built_in("neck").expect("a robot");
//! assert!(neck.toml.contains("[[joint]]") && neck.urdf.contains("<robot"));
//! ```

/// A robot that comes with servodance.
#[derive(Clone, Copy, Debug)]
pub struct BuiltIn {
    /// The name for `--robot`.
    pub name: &'static str,
    /// Where the robot file lies in the source tree.
    pub file: &'static str,
    /// The robot file.
    pub toml: &'static str,
    /// The description.
    pub urdf: &'static str,
}

macro_rules! built_in {
    ($name:literal) => {
        BuiltIn {
            name: $name,
            file: concat!("configs/", $name, ".toml"),
            toml: include_str!(concat!($name, ".toml")),
            urdf: include_str!(concat!($name, ".urdf")),
        }
    };
}

/// The built-in robots, in the order of `servodance robots`.
pub const BUILT_IN: &[BuiltIn] = &[
    built_in!("op3"),
    built_in!("torso13"),
    built_in!("neck"),
    built_in!("lite22"),
    built_in!("so101"),
    built_in!("quad12"),
    built_in!("microduck"),
    built_in!("reachy_mini"),
    built_in!("g1"),
];

/// The text of `robot.schema.json`.
pub const ROBOT_SCHEMA: &str = include_str!("robot.schema.json");

/// The built-in robot of this name.
pub fn built_in(name: &str) -> Option<&'static BuiltIn> {
    BUILT_IN.iter().find(|robot| robot.name == name)
}

/// The names, for errors and help.
pub fn names() -> Vec<&'static str> {
    BUILT_IN.iter().map(|robot| robot.name).collect()
}
