//! Files to write whose ending says what they hold.

use clap::builder::{PathBufValueParser, TypedValueParser, ValueParser};
use std::path::PathBuf;

/// A path that ends in `.ENDING`, or in nothing; another ending would lie.
pub fn file_of(ending: &'static str) -> ValueParser {
    PathBufValueParser::new().try_map(move |path| checked(path, ending)).into()
}

fn checked(path: PathBuf, ending: &str) -> Result<PathBuf, String> {
    match path.extension() {
        Some(own) if !own.eq_ignore_ascii_case(ending) => Err(format!(
            "what is written is .{ending}: call it {}",
            path.with_extension(ending).display()
        )),
        _ => Ok(path),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ending_that_would_lie_is_refused() {
        let told = checked("x.jpg".into(), "png").unwrap_err();
        assert!(told.contains("x.png"), "{told}");
        for good in ["x.png", "x.PNG", "/dev/stdout", "plain"] {
            assert_eq!(checked(good.into(), "png"), Ok(good.into()));
        }
    }
}
