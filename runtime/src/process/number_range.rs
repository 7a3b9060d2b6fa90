//! Numbers of the command line that must lie in a range.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// A parser for clap that refuses what is no number and what is outside of `range`.
pub fn within<T>(
    range: RangeInclusive<T>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: FromStr + PartialOrd + Display + Clone + Send + Sync + 'static,
{
    move |text| {
        let (low, high) = (range.start(), range.end());
        match text.parse() {
            Ok(number) if range.contains(&number) => Ok(number),
            Ok(_) => Err(format!("it is outside {low} to {high}")),
            Err(_) => Err(format!("a number from {low} to {high} is expected")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_outside_and_words_are_refused() {
        let seconds = within(0.5..=60.0);
        assert_eq!(seconds("60"), Ok(60.0));
        for wrong in ["0.4", "60.1", "nan", "inf", "-1", "x", ""] {
            let told = seconds(wrong).unwrap_err();
            assert!(told.contains("0.5 to 60"), "{wrong}: {told}");
        }
        assert_eq!(within(1..=3)("2"), Ok(2));
        assert!(within(1..=3)("2.5").is_err());
    }
}
