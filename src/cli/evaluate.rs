//! `servodance evaluate`.

use crate::cli::prelude::*;
use servodance_training::evaluate::{
    EvaluationRequest, SongArgs, evaluate, evaluate_songs, score_votes, write_blind, write_sheets,
};

const EXAMPLES: &str = include_str!("examples/evaluate.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    request: EvaluationRequest,
}

pub fn run(Args { request }: Args) -> anyhow::Result<ExitCode> {
    let progress = Progress::share("evaluating", request.json);
    let at = |share: f64| progress.at(100.0 * share);
    let asked = &request.by_song;
    let (found, table) = match asked {
        SongArgs { votes: Some(folder), .. } => {
            let found = score_votes(folder)?;
            (serde_json::to_string_pretty(&found)?, found.table())
        }
        SongArgs { blind: Some(folder), .. } => {
            let pairs = write_blind(&request, folder, at)?;
            let page = folder.join("index.html");
            let told = format!("{}: {pairs} pairs to vote on\n", page.display());
            (
                serde_json::to_string_pretty(&serde_json::json!({ "page": page, "pairs": pairs }))?,
                told,
            )
        }
        SongArgs { sheet: Some(out), songs: Some(songs), motion: Some(motion), .. } => {
            let files = write_sheets(&request, [songs, motion, out], at)?;
            let told = files.iter().map(|file| format!("{}\n", file.display())).collect();
            (serde_json::to_string_pretty(&serde_json::json!({ "sheets": files }))?, told)
        }
        SongArgs { songs: Some(folder), .. } => {
            let found = evaluate_songs(&request, folder, at)?;
            (serde_json::to_string_pretty(&found)?, found.table())
        }
        _ => {
            let found = evaluate(&request, at)?;
            (serde_json::to_string_pretty(&found)?, found.table())
        }
    };
    progress.done();
    match request.json {
        true => stdout_line!("{found}"),
        false => stdout(format_args!("{table}")),
    }
    Ok(ExitCode::SUCCESS)
}
