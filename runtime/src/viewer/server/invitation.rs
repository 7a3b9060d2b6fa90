//! The two links of a page: one to steer with, one only to watch; as QR codes for phones.

use qrcode::{Color, EcLevel, QrCode};
use serde_json::{Value, json};

/// Light modules around a code, as readers want them.
const QUIET: usize = 2;

/// Where the page is, for operators and for the audience; each with its token.
#[derive(Clone, Debug)]
pub struct Invitation {
    /// May watch and command.
    pub operator: String,
    /// May only watch.
    pub audience: String,
}

impl Invitation {
    /// Both links and the rows of their codes: 1 is dark.
    pub fn json(&self) -> Value {
        let link = |address: &str| {
            let cell = |dark: &bool| if *dark { '1' } else { '0' };
            let rows = code(address);
            let rows: Vec<String> = rows.iter().map(|row| row.iter().map(cell).collect()).collect();
            json!({ "address": address, "code": rows })
        };
        json!({ "operator": link(&self.operator), "audience": link(&self.audience) })
    }

    /// Both codes side by side, for a terminal of any colour: two rows a line.
    pub fn terminal(&self) -> String {
        let (left, right) = (block(&self.operator), block(&self.audience));
        let width = left.first().map_or(0, |line| line.chars().count());
        let mut text = format!("{:width$}   {}\n", "steer and watch", "only watch");
        for (left, right) in left.iter().zip(&right) {
            // Black on white whatever the terminal's colours are.
            text += &format!("\x1b[30;107m{left}\x1b[0m   \x1b[30;107m{right}\x1b[0m\n");
        }
        text
    }
}

/// Dark modules by rows, with the quiet edge; empty if the address is too long for a code.
fn code(address: &str) -> Vec<Vec<bool>> {
    let Ok(code) = QrCode::with_error_correction_level(address, EcLevel::L) else {
        return Vec::new();
    };
    let width = code.width();
    let dark = |x: usize, y: usize| {
        let inside = (QUIET..QUIET + width).contains(&x) && (QUIET..QUIET + width).contains(&y);
        inside && code[(x - QUIET, y - QUIET)] == Color::Dark
    };
    let side = width + 2 * QUIET;
    (0..side).map(|y| (0..side).map(|x| dark(x, y)).collect()).collect()
}

fn block(address: &str) -> Vec<String> {
    let rows = code(address);
    let none = Vec::new();
    let lines = rows.chunks(2).map(|pair| {
        let below = pair.get(1).unwrap_or(&none);
        let cell =
            |(x, top): (usize, &bool)| match (*top, below.get(x).copied().unwrap_or_default()) {
                (true, true) => '█',
                (true, false) => '▀',
                (false, true) => '▄',
                (false, false) => ' ',
            };
        pair[0].iter().enumerate().map(cell).collect()
    });
    lines.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_has_its_three_corners_and_the_terminal_shows_the_same() {
        let rows = code("http://192.168.1.7:8080/0123456789abcdef0123456789abcdef/");
        let side = rows.len();
        assert!(side > 25 && rows.iter().all(|row| row.len() == side));
        let corner = |x: usize, y: usize| {
            let edge = |i: usize| rows[y][x + i] && rows[y + i][x] && rows[y + 6][x + i];
            (0..7).all(edge) && !rows[y + 1][x + 1] && rows[y + 3][x + 3]
        };
        let far = side - QUIET - 7;
        assert!(corner(QUIET, QUIET) && corner(far, QUIET) && corner(QUIET, far));
        let lines = block("http://192.168.1.7:8080/0123456789abcdef0123456789abcdef/");
        assert_eq!(lines.len(), side.div_ceil(2));
        let third: Vec<char> = lines[1].chars().collect();
        assert_eq!((third[QUIET], third[QUIET + 1]), ('█', '▀'));
    }
}
