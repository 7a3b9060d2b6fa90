//! A robot description: one parse, one repair, one model in memory.
//!
//! A URDF text ([`urdf`]) or an MJCF model ([`mjcf`]) becomes an
//! [`urdf_rs::Robot`]; [`check`] refuses or repairs it in place; `k` makes the
//! tree of it. Everything that is refused or repaired is a
//! [`diagnostic`] that names joint or link and value; nothing here panics on
//! any text. [`guess`] finds body parts, [`lint`] what is odd, [`draft`] a
//! first configuration.

pub(crate) mod body_guess;
mod check;
pub(crate) mod diagnostic;
pub(crate) mod draft;
pub(crate) mod guess;
mod joints;
pub(crate) mod lint;
pub(crate) mod mjcf;
mod plausible_inertia;
mod urdf;
mod xml;

use crate::config::{JointCoupling, RetargetError};
use diagnostic::{DiagnosticCode, Diagnostics};
use plausible_inertia::repair_inertias;
use urdf::RateLimitsByJoint;
use xml::{check_depth, read_loosely};

use joints::is_passive;
pub(crate) use joints::{held_position, is_driven};

/// Links may stand in comments and plugins, too.
const MOST_TAGS: usize = 4 * check::MOST_LINKS;

pub(crate) struct Description {
    pub robot: urdf_rs::Robot,
    /// `k` orders links into a tree, parents before children: one node a link,
    /// named by the joint above it. Its forward kinematics is the reference for
    /// ours (`kinematics::chain`), which needs neither its locks nor its caches.
    pub chain: k::Chain<f64>,
    pub rates: RateLimitsByJoint,
}

impl Description {
    pub fn from_urdf(xml: &str) -> Result<Self, RetargetError> {
        let mut diagnostics = Diagnostics::default();
        let description = Self::with_diagnostics(xml, &mut diagnostics);
        if let Some(error) = diagnostics.refusal {
            return Err(error);
        }
        description.ok_or_else(|| RetargetError::Xml("nothing in it".into()))
    }

    /// Parses and checks a URDF; `None` if anything was refused.
    pub fn with_diagnostics(xml: &str, diagnostics: &mut Diagnostics) -> Option<Self> {
        let xml = &*read_loosely(xml, diagnostics);
        if let Err(error) = check_depth(xml) {
            diagnostics.refuse(DiagnosticCode::Xml, error);
            return None;
        }
        // Counted before the tree is built: a hostile file is refused at once.
        let links = xml.matches("<link").count();
        if links > MOST_TAGS {
            let reason = format!("{links} links, at most {}", check::MOST_LINKS);
            diagnostics.refuse_tree(DiagnosticCode::LinksMany, reason);
            return None;
        }
        let (robot, rates) = urdf::read(xml, diagnostics)?;
        match diagnostics.refusal {
            Some(_) => None,
            None => Self::checked(robot, rates, diagnostics),
        }
    }

    /// Checks a robot that was read from elsewhere than a URDF.
    fn checked(
        mut robot: urdf_rs::Robot,
        rates: RateLimitsByJoint,
        diagnostics: &mut Diagnostics,
    ) -> Option<Self> {
        check::check(&mut robot, diagnostics);
        repair_inertias(&mut robot, diagnostics);
        diagnostics.refusal.is_none().then(|| Self { chain: k::Chain::from(&robot), robot, rates })
    }

    /// Joints with a position of their own, in the order of the file.
    pub fn drives(&self) -> impl Iterator<Item = &urdf_rs::Joint> {
        let joints = self.robot.joints.iter();
        joints.filter(|joint| is_driven(joint) && joint.mimic.is_none() && !is_passive(joint))
    }

    /// Joints that could move and that others move.
    pub fn passive(&self) -> impl Iterator<Item = &urdf_rs::Joint> {
        self.robot.joints.iter().filter(|joint| is_driven(joint) && is_passive(joint))
    }

    /// Positions of `joints` at zero, or the nearest that the limits allow.
    pub fn zero_positions(&self, joints: &[String]) -> Vec<f64> {
        let held = |name: &String| {
            let mut all = self.robot.joints.iter();
            all.find(|joint| joint.name == *name).map_or(0.0, held_position)
        };
        joints.iter().map(held).collect()
    }

    /// Lets a joint follow another, as a robot file says.
    pub fn couple(&mut self, coupling: &JointCoupling) -> Result<(), RetargetError> {
        let refused =
            |reason: String| RetargetError::Joint { joint: coupling.joint.clone(), reason };
        for name in [&coupling.joint, &coupling.follows] {
            let joint = self.robot.joints.iter().find(|joint| joint.name == *name);
            if !joint.is_some_and(is_driven) {
                return Err(refused(format!("couple: no moving joint `{name}`")));
            }
        }
        if coupling.joint == coupling.follows {
            return Err(refused("couple: a joint cannot follow itself".into()));
        }
        let joints = self.robot.joints.iter_mut();
        for joint in joints.filter(|joint| joint.name == coupling.joint) {
            joint.mimic = Some(urdf_rs::Mimic {
                joint: coupling.follows.clone(),
                multiplier: Some(coupling.multiplier),
                offset: Some(coupling.offset_deg.to_radians()),
            });
        }
        Ok(())
    }
}

/// The description of a URDF or an MJCF model, and all that was found.
fn read_any(text: &str) -> (Option<Description>, Diagnostics) {
    let mut diagnostics = Diagnostics::default();
    let description = match mjcf::is_mjcf(text) {
        false => Description::with_diagnostics(text, &mut diagnostics),
        true => match mjcf::read(text, &mut diagnostics) {
            Ok(robot) => Description::checked(robot, RateLimitsByJoint::new(), &mut diagnostics),
            Err(error) => {
                diagnostics = Diagnostics::default();
                diagnostics.refuse(DiagnosticCode::Mjcf, error);
                None
            }
        },
    };
    (description, diagnostics)
}
