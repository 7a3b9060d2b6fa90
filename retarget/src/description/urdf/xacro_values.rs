//! Values that a xacro gives to names: `${width / 2}`, `${prefix}base`, `$(arg prefix)`.
//!
//! Makers leave such in files that need nothing else of xacro. What is a number or a text by
//! the file's own properties and the defaults of its arguments is put in its place; the rest
//! stays, and is refused later where it counts. No macros, files or conditions.

use std::cell::Cell;
use std::collections::HashMap;

use roxmltree::{Document, Node};

/// A longer value is none that a robot needs; keeps files cheap that double theirs.
const LONGEST: usize = 256;
/// Brackets inside of brackets.
const MOST_NESTED: usize = 32;
/// Names that lead to names.
const DEEPEST: usize = 8;
/// Most places that are looked at, those inside of values among them.
const MOST: usize = 50_000;

/// The text of a document with each value put in that the document gives itself; `None` where
/// there is nothing to put in.
pub(super) fn filled(document: &Document) -> Option<String> {
    let text = document.input_text();
    let values = || Values::of(document.root_element());
    (text.contains("${") || text.contains("$(arg ")).then(|| values().put_into(text, 0))
}

struct Values<'a> {
    properties: HashMap<&'a str, &'a str>,
    arguments: HashMap<&'a str, &'a str>,
    places_left: Cell<usize>,
}

impl<'a> Values<'a> {
    /// What stands at the top of the file; of two values of one name none is known.
    fn of(root: Node<'a, 'a>) -> Self {
        let given = |element: &'static str, value: &'static str| {
            let mut found: HashMap<&'a str, &'a str> = HashMap::new();
            let nodes = root.children().filter(move |node| node.has_tag_name_of_xacro(element));
            for node in nodes {
                if let (Some(name), Some(text)) = (node.attribute("name"), node.attribute(value))
                    && found.insert(name, text).is_some_and(|before| before != text)
                {
                    found.insert(name, "${}");
                }
            }
            found
        };
        let (properties, arguments) = (given("property", "value"), given("arg", "default"));
        Self { properties, arguments, places_left: Cell::new(MOST) }
    }

    fn put_into(&self, text: &str, depth: usize) -> String {
        let mut out = String::with_capacity(text.len());
        let mut rest = text;
        while let (Some(at), Some(left)) = (rest.find('$'), self.places_left.get().checked_sub(1)) {
            self.places_left.set(left);
            out.push_str(&rest[..at]);
            rest = &rest[at..];
            let close = if rest.starts_with("$(") { ')' } else { '}' };
            let mut near = rest.char_indices().take(LONGEST);
            let end = near.find(|(_, letter)| [close, '"', '\n'].contains(letter));
            // All of these are one byte long.
            let end = end.map_or(1, |(end, _)| end + 1);
            let place = &rest[..end];
            let value = self.of_place(place, depth).filter(|value| {
                value.len() <= LONGEST && !value.contains(['<', '>', '&', '"', '\'', '$'])
            });
            match value {
                Some(value) => {
                    out.push_str(&value);
                    rest = &rest[end..];
                }
                None => {
                    out.push('$');
                    rest = &rest[1..];
                }
            }
        }
        out.push_str(rest);
        out
    }

    fn of_place(&self, place: &str, depth: usize) -> Option<String> {
        if let Some(argument) = place.strip_prefix("$(arg ").and_then(|p| p.strip_suffix(')')) {
            return Some((*self.arguments.get(argument.trim())?).to_owned());
        }
        let expression = place.strip_prefix("${")?.strip_suffix('}')?.trim();
        if let Some(text) = self.text_of(expression, depth) {
            return Some(text);
        }
        let value = Expression { rest: expression, values: self, depth, nested: 0 }.whole()?;
        value.is_finite().then(|| format!("{value}"))
    }

    fn text_of(&self, name: &str, depth: usize) -> Option<String> {
        let text = self.properties.get(name).filter(|_| depth < DEEPEST)?;
        (text.len() <= LONGEST).then(|| self.put_into(text, depth + 1))
    }
}

trait OfXacro {
    fn has_tag_name_of_xacro(&self, name: &str) -> bool;
}

impl OfXacro for Node<'_, '_> {
    fn has_tag_name_of_xacro(&self, name: &str) -> bool {
        super::is_of_xacro(*self) && self.tag_name().name() == name
    }
}

/// Sums, products, signs and brackets of numbers, `pi` and properties.
struct Expression<'a> {
    rest: &'a str,
    values: &'a Values<'a>,
    depth: usize,
    nested: usize,
}

impl Expression<'_> {
    fn whole(mut self) -> Option<f64> {
        let value = self.sum()?;
        self.rest.trim().is_empty().then_some(value)
    }

    /// What stands behind a sign or inside of brackets, not nested too deep.
    fn inner(&mut self, read: fn(&mut Self) -> Option<f64>) -> Option<f64> {
        self.nested += 1;
        let value = (self.nested < MOST_NESTED).then(|| read(self))?;
        self.nested -= 1;
        value
    }

    fn takes(&mut self, sign: char) -> bool {
        let rest = self.rest.trim_start();
        let taken = rest.strip_prefix(sign);
        self.rest = taken.unwrap_or(rest);
        taken.is_some()
    }

    fn sum(&mut self) -> Option<f64> {
        let mut value = self.product()?;
        loop {
            if self.takes('+') {
                value += self.product()?;
            } else if self.takes('-') {
                value -= self.product()?;
            } else {
                return Some(value);
            }
        }
    }

    fn product(&mut self) -> Option<f64> {
        let mut value = self.factor()?;
        loop {
            if self.takes('*') {
                value *= self.factor()?;
            } else if self.takes('/') {
                value /= self.factor()?;
            } else {
                return Some(value);
            }
        }
    }

    fn factor(&mut self) -> Option<f64> {
        if self.takes('-') {
            return self.inner(Self::factor).map(|value| -value);
        }
        if self.takes('+') {
            return self.inner(Self::factor);
        }
        if self.takes('(') {
            let value = self.inner(Self::sum)?;
            return self.takes(')').then_some(value);
        }
        let of_name = |letter: char| letter.is_alphanumeric() || letter == '_' || letter == '.';
        let end = self.rest.find(|letter| !of_name(letter)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        // 1e-3 has a sign inside.
        let (word, rest) = match (word.parse::<f64>(), rest.strip_prefix(['-', '+'])) {
            (Err(_), Some(digits))
                if word.starts_with(|l: char| l.is_ascii_digit() || l == '.') =>
            {
                let more = digits.find(|l: char| !l.is_ascii_digit()).unwrap_or(digits.len());
                self.rest.split_at(end + 1 + more)
            }
            _ => (word, rest),
        };
        self.rest = rest;
        if let Ok(number) = word.parse::<f64>() {
            return Some(number);
        }
        match word {
            "pi" | "M_PI" | "math.pi" => Some(std::f64::consts::PI),
            name => self.values.text_of(name, self.depth)?.trim().parse().ok(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;

    fn first_name(attribute: &str) -> String {
        let text = format!(
            "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\
             <xacro:arg name=\"ns\" default=\"r2/\"/><xacro:property name=\"ns\" value=\"$(arg ns)\"/>\
             <xacro:property name=\"half\" value=\"${{width / 2}}\"/>\
             <xacro:property name=\"width\" value=\"0.5\"/><xacro:property name=\"a\" value=\"${{b}}\"/>\
             <xacro:property name=\"b\" value=\"${{a}}${{a}}\"/><link name=\"{attribute}\"/></robot>"
        );
        let filled = filled(&Document::parse(&text).unwrap()).unwrap_or(text.clone());
        filled.rsplit("<link name=\"").next().and_then(|t| t.split('"').next()).unwrap().to_owned()
    }

    #[test]
    fn names_sums_and_defaults_are_put_in() {
        for (written, read) in [
            ("${ns}base", "r2/base"),
            ("${width}", "0.5"),
            ("${-half * 4 + (1 - 0.25)}", "-0.25"),
            ("${1e-3*2} 0 ${pi*0}", "0.002 0 0"),
            // Unknown, a call, a circle, a division by zero: as written.
            ("${reflect*2}", "${reflect*2}"),
            ("${radians(90)}", "${radians(90)}"),
            ("${a}", "${a}"),
            ("${1/0}", "${1/0}"),
            ("$5 ${", "$5 ${"),
            ("${half+half+half+half+half+half+half+half+half+half}", "2.5"),
        ] {
            assert_eq!(first_name(written), read, "{written}");
        }
        let brackets = format!("${{{}1{}}}", "(".repeat(99), ")".repeat(99));
        assert_eq!(first_name(&brackets), brackets);
    }

    #[test]
    fn values_that_double_values_end() {
        let mut text = String::from("<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\">");
        for name in 0..8 {
            let twenty = format!("${{a{}}}", name + 1).repeat(20);
            let _ = write!(text, "<xacro:property name=\"a{name}\" value=\"{twenty}\"/>");
        }
        text += &format!("<link name=\"${{a0}}{}\"/></robot>", "$".repeat(99_999));
        let document = Document::parse(&text).unwrap();
        assert!(filled(&document).is_some_and(|text| text.len() < 1_000_000));
    }
}
