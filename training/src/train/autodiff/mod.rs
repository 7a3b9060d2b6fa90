//! Reverse-mode differentiation: a tape, its operations, parameters, and the
//! arithmetic under them.

pub(crate) mod lanes;
pub(crate) mod matmul;
pub(crate) mod ops;
pub(crate) mod parameters;
pub(crate) mod tape;
