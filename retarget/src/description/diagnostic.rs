//! What is wrong, odd or worth knowing about a robot file or description.
//!
//! Each kind has a code that stays the same between versions, and one
//! severity: a note asks for a look, a repair says what is used in place of
//! what is written, a refusal says why the robot cannot be used.
//! `docs/robots.md` lists them all.

use std::fmt;

use crate::config::RetargetError;
use serde::Serialize;

/// What a finding means for the use of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DiagnosticSeverity {
    /// Usable as it is; worth a look.
    Note,
    /// Usable, because something else is used; the message says what.
    Repaired,
    /// Not usable.
    Refused,
}

impl DiagnosticSeverity {
    /// As it is printed.
    pub fn as_str(self) -> &'static str {
        match self {
            DiagnosticSeverity::Note => "note",
            DiagnosticSeverity::Repaired => "repaired",
            DiagnosticSeverity::Refused => "refused",
        }
    }
}

macro_rules! codes {
    ($($name:ident $code:literal $severity:ident $meaning:literal;)*) => {
        /// The kinds of findings.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum DiagnosticCode {
            $(#[doc = $meaning] $name,)*
        }

        impl DiagnosticCode {
            /// Every code there is.
            pub const ALL: &[DiagnosticCode] = &[$(DiagnosticCode::$name),*];

            /// The stable code, e.g. `velocity-unset`.
            pub fn as_str(self) -> &'static str {
                match self { $(DiagnosticCode::$name => $code),* }
            }

            /// How bad it is.
            pub fn severity(self) -> DiagnosticSeverity {
                match self { $(DiagnosticCode::$name => DiagnosticSeverity::$severity),* }
            }

            /// What it means, in one line.
            pub fn meaning(self) -> &'static str {
                match self { $(DiagnosticCode::$name => $meaning),* }
            }
        }
    };
}

codes! {
    Xacro "xacro" Refused "the file is a xacro that was not expanded";
    Xml "xml" Refused "the text is not well-formed XML, or no robot description";
    Mjcf "mjcf" Refused "an MJCF model that cannot be converted";
    NameMissing "name-missing" Refused "a link or joint has no name";
    NumberUnreadable "number-unreadable" Refused "a place for a number holds something else";
    NumberUnusable "number-unusable" Refused "a number is not finite, or too large for any robot";
    LinksNone "links-none" Refused "there is no link";
    LinksMany "links-many" Refused "there are more links than can be handled";
    LinkTwice "link-twice" Refused "two links have one name";
    JointTwice "joint-twice" Refused "two joints have one name";
    LinkUnknown "link-unknown" Refused "a joint names a link that is not there";
    ParentsTwo "parents-two" Refused "a link has two parents: a closed loop that must be cut";
    RootsMany "roots-many" Refused "the links fall into several trees";
    Loop "loop" Refused "links hang below each other in a circle";
    JointsNone "joints-none" Refused "no joint moves";
    TypeUnknown "type-unknown" Refused "a joint's type is none of URDF's";
    AxisZero "axis-zero" Refused "the axis of a moving joint has no direction";
    RangeUnusable "range-unusable" Refused "inverted position limits with zero outside: which sign is wrong cannot be told";
    MassUnusable "mass-unusable" Refused "a mass is negative or too large";
    MimicUnknown "mimic-unknown" Refused "a joint follows one that is not there";
    MimicCircle "mimic-circle" Refused "joints follow each other in a circle";
    FileUnreadable "file-unreadable" Refused "a file that is needed cannot be read";
    FileOutside "file-outside" Refused "a robot file names a description outside its folder";
    Toml "toml" Refused "the robot file is not readable, or a key is unknown, missing or of another type";
    RobotFile "robot-file" Refused "a value of the robot file is outside its range";
    ServoMap "servo-map" Refused "a joint's table cannot be used: id, model, direction, limits";
    BusRate "bus-rate" Refused "the bus cannot carry so many servos so often";
    Retarget "retarget" Refused "the robot cannot be retargeted to: link or key wrong, or no such joint";
    ElementTwice "element-twice" Repaired "an element that may stand once stands twice: the first is used";
    GeometryTwo "geometry-two" Repaired "one geometry holds two shapes or meshes: the first is used";
    GeometryUnreadable "geometry-unreadable" Repaired "a shape cannot be read: it is left out";
    TextureUnnamed "texture-unnamed" Repaired "a texture names no file: it is left out";
    TextBehind "text-behind" Repaired "something stands behind the robot's end: passed over";
    XmlLoose "xml-loose" Repaired "a comment holds `--`, or blank lines stand before `<?xml`: passed over";
    PrefixUndeclared "prefix-undeclared" Repaired "an XML prefix is not declared: it is passed over";
    XacroInclude "xacro-include" Repaired "a xacro includes colours, motors or a simulator's settings: they are passed over";
    NumberCommas "number-commas" Repaired "commas stand between the numbers of a vector: read as blanks";
    InertialIncomplete "inertial-incomplete" Repaired "mass or inertia is not given: it counts as zero";
    InertiaOversized "inertia-oversized" Repaired "a moment of inertia far beyond a link's mass and size: a usual one is used";
    AxisUnset "axis-unset" Repaired "a moving joint has no axis: x is used, as the format says";
    AxisZeroEnd "axis-zero-end" Repaired "the last joint of a chain has an axis without direction: it is held";
    RangeInverted "range-inverted" Repaired "lower and upper position limit are exchanged: used the other way round";
    MimicOfFixed "mimic-of-fixed" Repaired "a joint follows one that cannot move: held where that leaves it";
    MimicOnFixed "mimic-on-fixed" Repaired "a joint that cannot move is said to follow another: it stays";
    RootFloating "root-floating" Repaired "a floating or planar joint has no position: it is held";
    MjcfBall "mjcf-ball" Repaired "a ball joint of an MJCF model: three hinges stand for it";
    TipMissing "tip-missing" Repaired "a limb ends on its last joint's axis: a tip is put where its shape or mass ends";
    VelocityUnset "velocity-unset" Repaired "no velocity limit (or 0): the servo map's is used";
    VelocityPlaceholder "velocity-placeholder" Repaired "a velocity limit no servo has: the servo map's is used";
    RangeUnset "range-unset" Repaired "both position limits are the same: the servo map's are used";
    ZeroOutside "zero-outside" Repaired "zero is outside the position limits: the nearest limit stands for it";
    RestOutside "rest-outside" Repaired "a rest angle is outside the joint's limits: the nearest limit stands for it";
    VelocitySlow "velocity-slow" Note "a velocity limit below 1 rad/s: the dance is small and late";
    EffortUnset "effort-unset" Note "no effort limit (or 0)";
    EffortPlaceholder "effort-placeholder" Note "an effort limit of 1000 or more: a placeholder";
    RangePlaceholder "range-placeholder" Note "position limits that are a round share of pi both ways: a placeholder";
    RangeWide "range-wide" Note "a range wider than 315 degrees";
    SideMissing "side-missing" Note "a joint of one side has no partner on the other";
    SidesDiffer "sides-differ" Note "left and right allow different angles, counted either way: a sign may be wrong";
    MassMissing "mass-missing" Note "no link weighs anything: balance cannot be judged";
    MassAbsurd "mass-absurd" Note "a mass that a robot of this size or shape cannot have";
    InertiaAbsurd "inertia-absurd" Note "an inertia that no body of this mass can have";
    JointContinuous "joint-continuous" Note "a joint turns without end: the servo map's limits hold, counted through without a jump";
    JointPrismatic "joint-prismatic" Note "a joint slides: it is held at rest";
    JointMimic "joint-mimic" Note "a joint follows another: it moves with it and needs no servo of its own";
    SizeAbsurd "size-absurd" Note "a size that no robot has: more than 10 m, or less than 2 cm; are its lengths in metres?";
    AxisTilted "axis-tilted" Note "an axis is tilted against the body's axes: used as it is";
    LimitExtended "limit-extended" Note "acceleration, deceleration or jerk is given: used for a new robot file";
    ForwardUnusual "forward-unusual" Note "the root link does not look along x with z up";
    ForwardAssumed "forward-assumed" Note "which way is forward cannot be seen: x is assumed, z up";
    PartsNone "parts-none" Refused "no arm, leg, head or driven wheel was found: nothing of it can show a dance";
    MapWider "map-wider" Note "the servo map allows more than the description";
    MapFaster "map-faster" Note "the servo map allows a higher speed than the description";
    MjcfLoop "mjcf-loop" Repaired "a closed loop of an MJCF model: its joints rest";
    MjcfLeftOut "mjcf-left-out" Note "a part of an MJCF model that is not converted";
    JointUnmapped "joint-unmapped" Note "a joint that could move has no servo: it is held at rest";
}

impl fmt::Display for DiagnosticCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl Serialize for DiagnosticCode {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

/// One thing found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Diagnostic {
    /// What kind it is.
    pub code: DiagnosticCode,
    /// How bad it is.
    pub severity: DiagnosticSeverity,
    /// Name of the joint, link or file.
    pub subject: String,
    /// What was found, with its value, and what is done about it.
    pub message: String,
}

impl Diagnostic {
    /// A finding about `subject`.
    pub fn new(
        code: DiagnosticCode,
        subject: impl Into<String>,
        message: impl Into<String>,
    ) -> Self {
        Self { code, severity: code.severity(), subject: subject.into(), message: message.into() }
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = self.severity.as_str();
        write!(f, "{severity} {} `{}`: {}", self.code, self.subject, self.message)
    }
}

/// Gathers what is found; the first refusal is kept as the error it is.
#[derive(Debug, Default)]
pub(crate) struct Diagnostics {
    pub list: Vec<Diagnostic>,
    pub refusal: Option<RetargetError>,
}

impl Diagnostics {
    pub fn add(&mut self, code: DiagnosticCode, subject: &str, message: impl Into<String>) {
        self.list.push(Diagnostic::new(code, subject, message));
    }

    pub fn refuse(&mut self, code: DiagnosticCode, error: RetargetError) {
        let (subject, message) = match &error {
            RetargetError::Joint { joint, reason } => (joint.clone(), reason.clone()),
            RetargetError::Link { link, reason } => (link.clone(), reason.clone()),
            other => ("robot".into(), other.to_string()),
        };
        self.list.push(Diagnostic::new(code, subject, message));
        self.refusal.get_or_insert(error);
    }

    pub fn refuse_joint(&mut self, code: DiagnosticCode, joint: &str, reason: impl Into<String>) {
        let error = RetargetError::Joint { joint: joint.into(), reason: reason.into() };
        self.refuse(code, error);
    }

    pub fn refuse_link(&mut self, code: DiagnosticCode, link: &str, reason: impl Into<String>) {
        let error = RetargetError::Link { link: link.into(), reason: reason.into() };
        self.refuse(code, error);
    }

    pub fn refuse_tree(&mut self, code: DiagnosticCode, reason: impl Into<String>) {
        self.refuse(code, RetargetError::Tree(reason.into()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_unique_and_plain() {
        for (index, code) in DiagnosticCode::ALL.iter().enumerate() {
            let text = code.as_str();
            assert!(text.chars().all(|c| c.is_ascii_lowercase() || c == '-'));
            assert!(DiagnosticCode::ALL[..index].iter().all(|c| c.as_str() != text));
        }
    }
}
