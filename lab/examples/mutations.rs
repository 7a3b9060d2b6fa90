//! A hundred thousand broken robot files, URDFs and MJCF models: none may make
//! the program panic, and what is called usable must build.
//!
//! `cargo run --release -p servodance-lab --example mutations [FILES] [SEED]`

#[path = "../../tests/mutate.rs"]
mod mutate;

use mutate::mutated;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use servodance_retarget::{DraftOptions, draft_config, lint, no_meshes, urdf_from_mjcf};
use servodance_runtime::robot::Robot;
use servodance_runtime::robot::check;

const TOMLS: [&str; 2] =
    [include_str!("../../configs/op3.toml"), include_str!("../../configs/neck.toml")];
const URDFS: [(&str, &str); 3] = [
    ("op3.urdf", include_str!("../../configs/op3.urdf")),
    ("neck.urdf", include_str!("../../configs/neck.urdf")),
    ("torso13.urdf", include_str!("../../configs/torso13.urdf")),
];
const MJCF: &str = include_str!("../../tests/figure.xml");

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let files: u64 = arguments.next().map_or(Ok(100_000), |n| n.parse())?;
    let seed: u64 = arguments.next().map_or(Ok(1), |n| n.parse())?;
    let folder = tempfile::tempdir()?;
    for (name, text) in URDFS {
        std::fs::write(folder.path().join(name), text)?;
    }
    let path = folder.path().join("my.toml").display().to_string();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut usable = [0_u64; 3];
    for file in 0..files {
        let kind = (file % 3) as usize;
        let pick = (file / 3) as usize;
        let good = match kind {
            0 => {
                std::fs::write(&path, mutated(&mut rng, TOMLS[pick % TOMLS.len()]))?;
                let loads = Robot::load(&path).is_ok();
                anyhow::ensure!(check(&path).usable == loads, "file {file}");
                loads
            }
            1 => {
                let urdf = mutated(&mut rng, URDFS[pick % URDFS.len()].1);
                let refused = servodance_retarget::DiagnosticSeverity::Refused;
                let clean = lint(&urdf).iter().all(|finding| finding.severity != refused);
                anyhow::ensure!(
                    clean == draft_config(&urdf, DraftOptions::default(), &no_meshes).is_ok(),
                    "file {file}: {urdf}"
                );
                clean
            }
            _ => match urdf_from_mjcf(&mutated(&mut rng, MJCF)) {
                Ok((urdf, _)) => draft_config(&urdf, DraftOptions::default(), &no_meshes).is_ok(),
                Err(_) => false,
            },
        };
        usable[kind] += u64::from(good);
    }
    println!(
        "{files} files, seed {seed}: no panic; usable: {} robot files, {} URDFs, {} MJCF models",
        usable[0], usable[1], usable[2]
    );
    Ok(())
}
