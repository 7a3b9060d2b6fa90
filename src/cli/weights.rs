//! `servodance weights`.

use crate::cli::prelude::*;
use servodance_model::weights::{Dtype, Keep, Weights, with_stage_one};
use servodance_training::weights::{self, WeightsInfo};

const EXAMPLES: &str = include_str!("examples/weights.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    pub what: What,
}

/// A part of a weights file.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum Part {
    Everything,
    Dance,
    Encoders,
}

/// What can be done with a weights file.
#[derive(Debug, clap::Subcommand)]
pub enum What {
    /// Check every tensor and say what the file holds.
    Info {
        /// The file; the built-in weights if left out.
        #[arg(value_name = "FILE.safetensors")]
        file: Option<PathBuf>,
        /// Refuse any other preset.
        #[arg(long, value_name = "NAME")]
        preset: Option<String>,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Write the weights in another number format.
    Convert {
        /// The file to read.
        #[arg(value_name = "FILE.safetensors")]
        file: PathBuf,
        /// f32, f16, q8_0, q6 or q4_0.
        #[arg(long, value_name = "FORMAT")]
        dtype: Dtype,
        /// The file to write.
        #[arg(long, value_name = "FILE.safetensors")]
        out: PathBuf,
        /// What to keep. `dance` leaves out what only reads recorded motion: a smaller file
        /// that dances the same, but cannot go on from a motion (`generate --start`).
        #[arg(long, value_enum, default_value = "everything", value_name = "WHAT")]
        keep: Part,
    },
    /// Write the weights with stage 1 of another file: codes that were trained further
    /// (`train vqvae --stage-one`).
    Join {
        /// The file to read stage 2 from.
        #[arg(value_name = "FILE.safetensors")]
        file: PathBuf,
        /// The file to read stage 1 from, in the same number format.
        #[arg(long, value_name = "FILE.safetensors")]
        stage_one: PathBuf,
        /// The file to write.
        #[arg(long, value_name = "FILE.safetensors")]
        out: PathBuf,
    },
    /// Score each number format on held-out motion: error of stage 1,
    /// likelihood of stage 2.
    Compare {
        /// The file, with encoders, in f16 or f32.
        #[arg(value_name = "FILE.safetensors")]
        file: PathBuf,
        /// A training file with held-out dance (`servodance dataset build`).
        #[arg(long, value_name = "FILE.safetensors")]
        data: PathBuf,
        /// Most clips of each kind.
        #[arg(long, default_value_t = 24, value_name = "N")]
        clips: usize,
        /// Print one JSON array.
        #[arg(long)]
        json: bool,
    },
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.what {
        What::Info { file, preset, json } => {
            let info = WeightsInfo::of(file.as_deref(), preset.as_deref())?;
            match json {
                true => stdout_line!("{}", serde_json::to_string(&info)?),
                false => stdout_line!("{info}"),
            }
        }
        What::Convert { file, dtype, out, keep } => {
            let keep = match keep {
                Part::Everything => Keep::Everything,
                Part::Dance => Keep::Dance,
                Part::Encoders => Keep::Encoders,
            };
            let bytes = servodance_model::weights::convert_file(&file, dtype, keep)?;
            write_whole(&out, &bytes)?;
            stdout_line!("{}: {dtype}, {:.1} MB", out.display(), bytes.len() as f64 / 1e6);
        }
        What::Join { file, stage_one, out } => {
            let [two, one] = [&file, &stage_one].map(|path| Weights::read(path));
            let names = [&file, &stage_one].map(|path| path.display().to_string());
            let bytes = with_stage_one((&two?, &names[0]), (&one?, &names[1]))?;
            write_whole(&out, &bytes)?;
            stdout_line!("{}: {:.1} MB", out.display(), bytes.len() as f64 / 1e6);
        }
        What::Compare { file, data, clips, json } => {
            let rows = weights::compare(&file, &data, clips)?;
            if json {
                stdout_line!("{}", serde_json::to_string(&rows)?);
            } else {
                rows.iter().for_each(|row| stdout_line!("{row}"));
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}
