//! Why a simulated bus cannot start.

#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // each field stands in the message above it
pub enum SimError {
    #[error("simulated bus: {key} is {actual}, must be {wanted}")]
    Option { key: &'static str, actual: String, wanted: &'static str },
    #[error("simulated servo {joint} (id {id}): {reason}")]
    Servo { joint: String, id: u8, reason: String },
    #[error("fault \"{line}\": {reason}")]
    Script { line: String, reason: String },
    #[error("simulated world: {0}")]
    World(String),
    #[error("simulated bus: {what}: {reason}")]
    System { what: &'static str, reason: std::io::Error },
}

impl SimError {
    /// Whatever the system refused as an error of ours, with what was being done.
    pub(crate) fn system<E: Into<std::io::Error>>(what: &'static str) -> impl Fn(E) -> Self {
        move |error| Self::System { what, reason: error.into() }
    }

    /// `value` where it is in `range`, which `wanted` says in words.
    pub(crate) fn checked(
        key: &'static str,
        value: f64,
        range: std::ops::RangeInclusive<f64>,
        wanted: &'static str,
    ) -> Result<f64, Self> {
        let actual = value.to_string();
        let refused = Self::Option { key, actual, wanted };
        range.contains(&value).then_some(value).ok_or(refused)
    }
}
