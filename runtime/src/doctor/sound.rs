//! Where sound can come from.

use super::Finding;
use crate::pipeline::microphone::input_table;

pub fn inputs() -> Finding {
    match input_table() {
        Ok(table) => match table.lines().filter(|line| !line.starts_with("* the")).count() {
            0 | 1 if table.starts_with("no inputs") => Finding::warning(
                "sound",
                "no microphone",
                "plug one in, or pipe raw PCM into `servodance dance -`",
            ),
            count => Finding::good("sound", format!("{count} inputs (`servodance devices`)")),
        },
        Err(error) => Finding::warning(
            "sound",
            format!("{error:#}"),
            "recordings and raw PCM on standard input work without",
        ),
    }
}
