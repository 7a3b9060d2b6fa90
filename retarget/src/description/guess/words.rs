//! What the names of links and joints say: side and part of the body.
//!
//! `LShoulderPitch`, `l_sho_pitch`, `arm_left_1_joint`, `RARM_JOINT0` and
//! `leftForeArm` all say it, each in its way.
use crate::kinematics::{ChainLink, RobotModel};

pub(crate) const ELBOW: &[&str] = &["elbow", "el", "elb"];
pub(crate) const FOREARM: &[&str] = &["forearm", "lowerarm", "lower", "fore"];
pub(crate) const HAND: &[&str] =
    &["hand", "wrist", "palm", "gripper", "tip", "fist", "ee", "tool", "endeffector"];
const ARM: &[&str] =
    &["shoulder", "sho", "shld", "shldr", "arm", "upperarm", "humerus", "bicep", "biceps"];
const FINGER: &[&str] =
    &["finger", "fingers", "thumb", "index", "middle", "ring", "pinky", "little"];
pub(crate) const KNEE: &[&str] = &["knee", "kfe"];
pub(crate) const SHANK: &[&str] = &["shank", "calf", "shin", "tibia", "lowerleg"];
const LEG: &[&str] = &["hip", "thigh", "femur", "leg", "upperleg", "upleg", "haa", "hfe"];
/// A movement of a leg, where nothing says that a shoulder or a wrist makes it.
const ABDUCTION: &[&str] = &["abduction"];
pub(crate) const ANKLE: &[&str] = &["ankle", "ank"];
pub(crate) const SOLE: &[&str] = &["sole", "foot", "toe", "toes"];
pub(crate) const TOES: &[&str] = &["toe", "toes"];
pub(crate) const HEAD: &[&str] = &["head", "skull", "neck"];
const TRUNK: &[&str] = &["pelvis", "waist", "hips"];
const ON_HEAD: &[&str] =
    &["eye", "eyes", "camera", "jaw", "mouth", "lid", "ear", "antenna", "lip", "brow"];
const WHEEL: &[&str] = &["wheel", "wheels", "whl", "wh", "caster", "castor", "track", "roller"];
/// Of these no motor turns any.
const CASTER: &[&str] = &["caster", "castor", "roller", "passive", "idler", "free"];

pub(crate) const SIDES: [&str; 2] = ["left", "right"];
/// Corners of a body on four legs, as its makers shorten them.
const CORNERS: [(&str, [&str; 2]); 12] = [
    ("fl", ["front", "left"]),
    ("fr", ["front", "right"]),
    ("lf", ["front", "left"]),
    ("rf", ["front", "right"]),
    ("rl", ["hind", "left"]),
    ("rr", ["hind", "right"]),
    ("hl", ["hind", "left"]),
    ("hr", ["hind", "right"]),
    ("bl", ["hind", "left"]),
    ("br", ["hind", "right"]),
    ("lh", ["hind", "left"]),
    ("rh", ["hind", "right"]),
];

/// Sides in other languages, left and right: German, French, Spanish, Portuguese, Italian,
/// Japanese and Vietnamese. Those are often glued to a part: `duitrai` is a left thigh.
const SIDES_ABROAD: [[&str; 2]; 11] = [
    ["links", "rechts"],
    ["gauche", "droite"],
    ["gauche", "droit"],
    ["izquierda", "derecha"],
    ["izquierdo", "derecho"],
    ["esquerda", "direita"],
    ["esquerdo", "direito"],
    ["sinistra", "destra"],
    ["sinistro", "destro"],
    ["hidari", "migi"],
    ["trai", "phai"],
];

/// Short forms of sides that stand alone, left and right: those of a ship, too.
const SIDES_SHORT: [[&str; 2]; 5] =
    [["lt", "rt"], ["lft", "rgt"], ["sx", "dx"], ["port", "stbd"], ["port", "starboard"]];
/// What every robot has: behind a side that is written out a word of its own.
const PLAIN: &[&str] = &["link", "joint", "motor", "servo"];

#[derive(Clone, Debug, Default)]
pub(crate) struct NameWords(Vec<String>);

impl NameWords {
    /// From the name of the link and of the joint above it.
    pub fn of(model: &RobotModel, link: usize) -> Self {
        Self::of_names(&[&model.link_names()[link], &model.parent_joints[link]])
    }

    /// From the name of the joint above a link alone.
    pub fn of_joint(model: &RobotModel, link: usize) -> Self {
        Self::of_names(&[&model.parent_joints[link]])
    }

    /// Sides that are written out count more than single letters: `r2/left_arm`. Behind such a
    /// letter two more are no corner: `L_rf_1` is the ring finger of the left hand.
    pub fn of_names(names: &[&str]) -> Self {
        let letter = |word: &String| ["l", "r"].contains(&word.as_str());
        // In `R_arm_l1` the second letter is the link's.
        let first_letter = |name: &&str| {
            let mut words = raw_words(name);
            let first = words.iter().find(|word| letter(word)).cloned();
            words.retain(|word| !letter(word) || Some(word) == first.as_ref());
            words
        };
        let raw: Vec<String> = names.iter().flat_map(first_letter).collect();
        let first = raw.iter().find(|word| letter(word) || corner(word).is_some());
        let led = first.is_some_and(letter);
        let parts = |word: &String| match led && corner(word).is_some() {
            true => vec![word.clone()],
            false => unglue(word),
        };
        let plain = Self(raw.iter().filter(|word| !letter(word)).flat_map(parts).collect());
        if plain.side().is_some() {
            return plain;
        }
        Self(raw.iter().flat_map(parts).collect())
    }

    pub fn has(&self, any: &[&str]) -> bool {
        self.0.iter().any(|word| any.contains(&word.as_str()))
    }

    /// How many words the name has.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// 0 left, 1 right: the first in the name, for `right_left_1` is the left finger of the right
    /// hand. What comes before both moves that way: `head_left_right`.
    pub fn side(&self) -> Option<usize> {
        let of = |word: &String| SIDES.iter().position(|side| word == side);
        let (at, side) = self.0.iter().enumerate().find_map(|(at, word)| Some((at, of(word)?)))?;
        let next = self.0.get(at + 1).and_then(of);
        let is_way = at > 0 && next.is_some_and(|next| next != side);
        (!is_way).then_some(side)
    }

    /// The words that say no side.
    pub fn without_side(&self) -> Vec<&str> {
        self.0.iter().map(String::as_str).filter(|word| !SIDES.contains(word)).collect()
    }

    pub fn is_sole(&self) -> bool {
        self.has(&["sole"])
    }

    pub fn is_arm(&self) -> bool {
        self.has_arm() && !self.is_leg()
    }

    fn has_arm(&self) -> bool {
        [ARM, ELBOW, FOREARM, HAND, FINGER].iter().any(|part| self.has(part))
    }

    pub fn is_antenna(&self) -> bool {
        self.has(&["antenna", "antennas", "antennae", "ear", "ears"])
    }

    /// An arm by more than its hand.
    pub fn is_upper_arm(&self) -> bool {
        [ARM, ELBOW, FOREARM].iter().any(|part| self.has(part))
    }

    pub fn is_leg(&self) -> bool {
        let has = [LEG, KNEE, SHANK, ANKLE, SOLE].iter().any(|part| self.has(part));
        has || (self.has(ABDUCTION) && !self.has_arm())
    }

    pub fn is_head(&self) -> bool {
        self.has(HEAD) && !self.has(ON_HEAD)
    }

    pub fn is_on_head(&self) -> bool {
        self.has(ON_HEAD)
    }

    pub fn is_trunk(&self) -> bool {
        self.has(TRUNK)
    }

    pub fn is_wheel(&self) -> bool {
        self.has(WHEEL)
    }

    pub fn is_caster(&self) -> bool {
        self.has(CASTER)
    }

    pub fn is_camera(&self) -> bool {
        self.has(&["camera", "cam"])
    }

    pub fn is_finger(&self) -> bool {
        self.has(FINGER)
    }
}

/// Lower-case words.
fn raw_words(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut raw = vec![String::new()];
    for (index, &letter) in letters.iter().enumerate() {
        let before = index.checked_sub(1).map(|i| letters[i]);
        let after = letters.get(index + 1);
        // aB and ABc: a new word begins at B.
        let begins = letter.is_uppercase()
            && (before.is_some_and(|b| b.is_lowercase())
                || (before.is_some_and(|b| b.is_uppercase())
                    && after.is_some_and(|a| a.is_lowercase())));
        if begins || !letter.is_alphabetic() {
            raw.push(String::new());
        }
        if let (true, Some(word)) = (letter.is_alphabetic(), raw.last_mut()) {
            word.extend(letter.to_lowercase());
        }
    }
    raw.retain(|word| !word.is_empty());
    raw
}

/// The corner of a body on four legs that two letters stand for.
fn corner(word: &str) -> Option<[&'static str; 2]> {
    CORNERS.iter().find(|(short, _)| *short == word).map(|(_, corner)| *corner)
}

/// A side in another language at the end of a word, and what stands before it.
fn side_abroad(word: &str) -> Option<Vec<String>> {
    let pairs = SIDES_ABROAD.iter().flat_map(|pair| pair.iter().zip(SIDES));
    let (before, side) =
        pairs.filter_map(|(abroad, side)| Some((word.strip_suffix(abroad)?, side))).next()?;
    Some([side, before].into_iter().filter(|part| !part.is_empty()).map(str::to_owned).collect())
}

/// Sides written out, also where they are glued to a part.
fn unglue(word: &str) -> Vec<String> {
    let limbs = [ARM, ELBOW, FOREARM, HAND, LEG, ABDUCTION, KNEE, SHANK, ANKLE, SOLE];
    let parts = || limbs.iter().chain(&[FINGER, WHEEL]);
    let known = |rest: &str| rest.len() > 2 && parts().any(|part| part.contains(&rest));
    let sides = [("left", "left"), ("right", "right"), ("l", "left"), ("r", "right")];
    if parts().any(|part| part.contains(&word)) {
        return vec![word.to_owned()];
    }
    if let Some(corner) = corner(word) {
        return corner.map(str::to_owned).to_vec();
    }
    if let Some(parts) = side_abroad(word) {
        return parts;
    }
    if let Some(side) = SIDES_SHORT.iter().find_map(|pair| pair.iter().position(|s| *s == word)) {
        return vec![SIDES[side].to_owned()];
    }
    // A letter of the maker before a part: zarm, jleg.
    let after_letter = word.char_indices().nth(1).map(|(at, _)| &word[at..]);
    let plain =
        |part: &&str| ["arm", "leg", "hand", "knee", "ankle", "elbow", "head"].contains(part);
    if let Some(part) = after_letter.filter(plain)
        && !word.starts_with(['l', 'r'])
    {
        return vec![part.to_owned()];
    }
    for (mark, side) in sides {
        if word == mark {
            return vec![side.to_owned()];
        }
        let before_plain = word.strip_prefix(side).filter(|rest| PLAIN.contains(rest));
        let rest = word.strip_prefix(mark).or_else(|| word.strip_suffix(mark));
        if let Some(rest) = before_plain.or(rest.filter(|rest| known(rest))) {
            return vec![side.to_owned(), rest.to_owned()];
        }
    }
    vec![word.to_owned()]
}

/// The side of the body on which each link of a model is, by its name or by what carries it:
/// 0 left, 1 right, `None` in the middle.
pub fn link_sides(model: &RobotModel) -> Vec<Option<usize>> {
    let mut sides: Vec<Option<usize>> = Vec::with_capacity(model.links.len());
    for (link, ChainLink { parent, .. }) in model.links.iter().enumerate() {
        let carried = parent.and_then(|parent| sides[parent]);
        sides.push(NameWords::of(model, link).side().or(carried));
    }
    sides
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_and_parts_are_read_from_every_usual_style() {
        for (name, side, arm, leg) in [
            ("LShoulderPitch", Some(0), true, false),
            ("r_sho_roll_link", Some(1), true, false),
            ("arm_left_4_joint", Some(0), true, false),
            ("RARM_JOINT3", Some(1), true, false),
            ("leftForeArm", Some(0), true, false),
            ("rleg_jnt2", Some(1), false, true),
            ("left_hip_yaw_link", Some(0), false, true),
            ("ankle_roll_l", Some(0), false, true),
            ("torso_yaw", None, false, false),
            ("r2/left_arm/joint0", Some(0), true, false),
            ("r2/right_leg/joint3", Some(1), false, true),
            ("wheel_right", Some(1), false, false),
            ("zarm_l1_link", Some(0), true, false),
            ("FL_hip_joint", Some(0), false, true),
            ("rh_kfe", Some(1), false, true),
            ("l_shld_y_joint", Some(0), true, false),
            ("L_rf_j1", Some(0), false, false),
            ("R_arm_lf_2", Some(1), true, false),
            ("R_arm_l1", Some(1), true, false),
            ("FL_R_hip", Some(0), false, true),
            ("brazo_derecho_arm_2", Some(1), true, false),
            ("bras_gauche_elbow", Some(0), true, false),
            ("duitrai", Some(0), false, false),
            ("l_shoulder_abduction_joint", Some(0), true, false),
            ("motor_front_left_abduction", Some(0), false, true),
            ("RBicep", Some(1), true, false),
            ("right_left_1_link", Some(1), false, false),
            ("head_left_right", None, false, false),
            ("leftlink", Some(0), false, false),
            ("arm_lt_2", Some(0), true, false),
            ("Rgt_hip", Some(1), false, true),
            ("spalla_arm_dx", Some(1), true, false),
            ("stbd_wheel", Some(1), false, false),
        ] {
            let words = NameWords::of_names(&[name]);
            let read = (words.side(), words.is_arm(), words.is_leg());
            assert_eq!(read, (side, arm, leg), "{name}: {words:?}");
        }
    }
}
