//! Why a joint does not go where the dance would have it.

/// What holds a joint back, weakest first; [`Ord::max`] keeps the strongest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum HeldBack {
    /// The joint goes where the dance would have it.
    #[default]
    Nothing,
    /// The end of its range.
    Limit,
    /// Its highest speed or acceleration.
    Speed,
    /// The robot would tip over.
    Balance,
    /// Two parts of the body would touch.
    Collision,
    /// Its motor would need more torque, or current, than it may give.
    Torque,
    /// Its motor is warm, or would become too warm.
    Heat,
    /// The supply voltage is low.
    Supply,
}

crate::named!(HeldBack {
    Nothing "nothing", Limit "limit", Speed "speed", Balance "balance", Collision "collision",
    Torque "torque", Heat "heat", Supply "supply",
});
