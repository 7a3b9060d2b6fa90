//! Names that somebody may have meant who typed another one.

/// So many close names are listed at most.
const MOST: usize = 6;

/// The names that hold `typed`, or differ from it by a few letters, as words for the user.
pub(super) fn close_names(typed: &str, names: &[String]) -> String {
    let typed = typed.to_lowercase().replace([' ', '-'], "_");
    let mut close: Vec<(usize, &String)> = names
        .iter()
        .filter_map(|name| {
            let holds =
                !typed.is_empty() && (name.contains(&typed) || typed.contains(name.as_str()));
            let apart = distance(&typed, name);
            (holds || apart <= 1 + typed.len() / 3).then_some((apart, name))
        })
        .collect();
    close.sort();
    let close: Vec<&str> = close.iter().take(MOST).map(|(_, name)| name.as_str()).collect();
    match close.is_empty() {
        true => "`servos read` without a name lists them".into(),
        false => format!("close to it: {}", close.join(", ")),
    }
}

/// How many letters must be put in, taken out or replaced (Levenshtein, 1966).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut before = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let replaced = before + usize::from(from != *to);
            before = row[j + 1];
            row[j + 1] = replaced.min(before + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_apart_are_counted() {
        for (a, b, apart) in [("", "abc", 3), ("abc", "abc", 0), ("kitten", "sitting", 3)] {
            assert_eq!(distance(a, b), apart);
        }
    }
}
