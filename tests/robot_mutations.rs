//! No file makes it panic. `lab/examples/mutations.rs` runs a hundred thousand.

use crate::mutate::mutated;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use servodance_retarget::{DraftOptions, draft_config, no_meshes, urdf_from_mjcf};
use servodance_runtime::robot::Robot;
use servodance_runtime::robot::check;

pub const MJCF: &str = include_str!("figure.xml");
const TOML: &str = include_str!("../configs/torso13.toml");
const URDF: &str = include_str!("../configs/torso13.urdf");

#[test]
fn two_thousand_broken_files_make_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let (mut usable, mut refused) = (0, 0);
    std::fs::write(path("torso13.urdf"), URDF).unwrap();
    for round in 0..700 {
        let toml = mutated(&mut rng, TOML);
        std::fs::write(path("my.toml"), toml).unwrap();
        let loads = Robot::load(&path("my.toml")).is_ok();
        assert_eq!(check(&path("my.toml")).usable, loads, "round {round}");
        let urdf = mutated(&mut rng, URDF);
        std::fs::write(path("my.urdf"), &urdf).unwrap();
        let checked = check(&path("my.urdf"));
        assert_eq!(
            checked.usable,
            draft_config(&urdf, DraftOptions::default(), &no_meshes).is_ok(),
            "round {round}: {checked:#?}"
        );
        match urdf_from_mjcf(&mutated(&mut rng, MJCF)) {
            Ok((urdf, _)) => drop(draft_config(&urdf, DraftOptions::default(), &no_meshes)),
            Err(error) => assert!(!error.to_string().contains('\n')),
        }
        usable += usize::from(checked.usable) + usize::from(loads);
        refused += usize::from(!checked.usable) + usize::from(!loads);
    }
    assert!(usable > 50 && refused > 200, "{usable} usable, {refused} refused");
}
