//! Where the nodes of a scene put what they carry: 4 x 4 matrices, by columns.

/// Columns of a 4 by 4 matrix.
pub type Matrix = [[f64; 4]; 4];

pub const IDENTITY: Matrix =
    from_rows([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);

/// From its rows, one after the other.
pub const fn from_rows(rows: [f64; 16]) -> Matrix {
    let mut columns = [[0.0; 4]; 4];
    let mut place = 0;
    while place < 16 {
        columns[place % 4][place / 4] = rows[place];
        place += 1;
    }
    columns
}

pub fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|column| {
        std::array::from_fn(|row| (0..4).map(|n| a[n][row] * b[column][n]).sum())
    })
}

pub fn moved(world: &Matrix, corner: &[f32; 3]) -> [f32; 3] {
    let [x, y, z] = corner.map(f64::from);
    std::array::from_fn(|row| {
        (world[0][row] * x + world[1][row] * y + world[2][row] * z + world[3][row]) as f32
    })
}
