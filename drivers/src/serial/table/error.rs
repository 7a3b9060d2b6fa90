//! Why a register cannot be written so, or is not there: what the user typed, not what a
//! servo did.

/// What is wrong with a name or a value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // each field stands in the message above it
pub enum TableError {
    #[error("{model} has no register \"{name}\"; {close}")]
    Unknown { name: String, model: &'static str, close: String },
    #[error("{register}: \"{text}\" is no value of it; give {wanted}")]
    NoValue { register: String, text: String, wanted: String },
    #[error("{register}: {value} is out of range: {wanted}")]
    OutOfRange { register: String, value: i64, wanted: String },
    #[error(
        "{register}: {value} would turn torque on; `dance` and `jog` do that after their checks"
    )]
    Torque { register: String, value: i64 },
    #[error("{register} can only be read")]
    ReadOnly { register: String },
    #[error("{register} is a goal; `jog` and `dance` give goals, inside the limits of the joint")]
    Goal { register: String },
    #[error(
        "{register} is changed with `set-id` or `set-baud`, which look where the servo answers then"
    )]
    Address { register: String },
}
