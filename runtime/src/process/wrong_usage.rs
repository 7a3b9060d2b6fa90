//! What was asked for cannot be meant: exit code 2, as for what the command line itself
//! refuses.

use servodance_model::ModelError;

/// Wrong usage, in one line for the user.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct WrongUsage(pub String);

impl WrongUsage {
    /// Whether an error, or what it stems from, is wrong usage.
    pub fn is_in(error: &anyhow::Error) -> bool {
        error.chain().any(|cause| {
            let in_options = matches!(
                cause.downcast_ref(),
                Some(ModelError::Option { .. } | ModelError::UnknownStyle { .. })
            );
            cause.is::<Self>() || in_options
        })
    }
}

/// Returns from a function with wrong usage, worded as `format!` does it.
macro_rules! misused {
    ($($words:tt)*) => {
        return Err($crate::process::wrong_usage::WrongUsage(format!($($words)*)).into())
    };
}

pub(crate) use misused;

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;

    #[test]
    fn it_is_found_under_what_was_said_around_it() {
        let misuse = || -> anyhow::Result<()> { misused!("no {}", "such") };
        let error = misuse().context("scan").unwrap_err();
        assert!(WrongUsage::is_in(&error) && format!("{error:#}") == "scan: no such");
        assert!(!WrongUsage::is_in(&anyhow::anyhow!("no such file")));
    }
}
