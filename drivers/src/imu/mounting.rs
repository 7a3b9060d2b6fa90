//! How a board is turned in the link that carries it.

/// A rotation from the board's axes to the link's: about x, then y, then z of the link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    rows: [[f64; 3]; 3],
}

impl Mounting {
    /// From three angles in degrees.
    pub fn from_deg(turns_deg: [f64; 3]) -> Self {
        let [(sx, cx), (sy, cy), (sz, cz)] = turns_deg.map(|turn| turn.to_radians().sin_cos());
        Self {
            rows: [
                [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
                [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
                [-sy, cy * sx, cy * cx],
            ],
        }
    }

    /// A vector of the board in the link's axes.
    pub fn to_link(&self, board: [f64; 3]) -> [f64; 3] {
        self.rows.map(|row| row.iter().zip(board).map(|(part, value)| part * value).sum())
    }

    /// A vector of the link in the board's axes.
    pub fn to_board(&self, link: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.rows.iter().zip(link).map(|(row, value)| row[axis] * value).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_turned_about_z_has_its_x_where_the_links_y_is() {
        let quarter = Mounting::from_deg([0.0, 0.0, 90.0]);
        let [x, y, z] = quarter.to_link([1.0, 0.0, 0.5]);
        assert!(x.abs() < 1e-12 && (y - 1.0).abs() < 1e-12 && z == 0.5);
        let turned = Mounting::from_deg([20.0, -30.0, 170.0]);
        let back = turned.to_board(turned.to_link([0.3, -0.2, 0.9]));
        assert!(back.iter().zip([0.3, -0.2, 0.9]).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
