//! How a set-up speaks with whoever connects the servos.

/// How the next servo comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NextServo {
    /// Somebody is asked for it, and presses Enter.
    Asked,
    /// It is taken as soon as it answers; what does not fit ends the set-up.
    Awaited,
}

/// What is said on the way.
pub(super) struct Voice<'a> {
    /// What was done, a line each.
    pub say: &'a dyn Fn(&str),
    /// What is asked for, and what does not fit.
    pub note: &'a dyn Fn(&str),
}
