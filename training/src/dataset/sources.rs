//! Whose motion it is, and on what terms.

use crate::dataset::styles::style_number;
use crate::motion::aist::GENRES;
use crate::motion::format::ImportFormat;

/// Known sources, by the first part of a clip's name, and the words that they ask for.
pub(super) const SOURCES: [(&str, &str); 3] = [
    (
        "cmu_*",
        "The data used in this project was obtained from mocap.cs.cmu.edu. The database was \
         created with funding from NSF EIA-0196217. Free for research and products; the raw \
         data may not be resold, even converted.",
    ),
    ("g1_moves", "G1 Moves by exptech, CC BY 4.0."),
    ("choreography", "Made by servodance's own choreographer."),
];

/// The terms of a source, where they are known: those of the index, or ours.
pub(super) fn terms<'a>(source: &str, licence: &'a str) -> &'a str {
    let known = |(name, _): &&(&str, &str)| match name.strip_suffix('*') {
        Some(start) => source.starts_with(start),
        None => *name == source,
    };
    match (licence, SOURCES.iter().find(known)) {
        ("", Some((_, terms))) => terms,
        ("", None) => "not written",
        (licence, _) => licence,
    }
}

pub(super) fn usual_licence(kind: ImportFormat) -> &'static str {
    match kind {
        ImportFormat::Aist => {
            "AIST++ annotations: CC BY 4.0; dances and music: the AIST Dance Video Database's terms"
        }
        ImportFormat::HumanMl => "HumanML3D: the terms of AMASS and HumanAct12, research only",
        ImportFormat::Smpl => "AMASS: the terms of its sources, most of them research only",
        ImportFormat::Bvh | ImportFormat::Amc | ImportFormat::Npz => "",
    }
}

/// The style in an AIST++ name: `gJB` is ballet jazz.
pub(super) fn aist_style(stem: &str) -> Option<usize> {
    let code = stem.get(..3)?;
    let (_, style) = GENRES.iter().find(|(genre, _)| *genre == code)?;
    style_number(style)
}

/// The song in an AIST++ name: `gBR_sBM_cAll_d04_mBR0_ch01` is to `mBR0`.
pub(super) fn aist_song(stem: &str) -> Option<&str> {
    stem.split('_').find(|part| part.starts_with('m'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_of_aist_tells_style_and_song() {
        let stem = "gJB_sBM_cAll_d04_mJB3_ch01";
        assert_eq!(aist_style(stem), style_number("ballet-jazz"));
        for (code, style) in GENRES {
            let number = aist_style(&format!("{code}_sBM_cAll_d04_mBR0_ch01"));
            assert!(number.is_some() && number == style_number(style), "{code}");
        }
        assert_eq!(aist_song(stem), Some("mJB3"));
        assert_eq!(aist_style("walk"), None);
    }

    #[test]
    fn written_terms_come_before_known_ones() {
        assert!(terms("cmu_salsa", "").contains("mocap.cs.cmu.edu"));
        assert_eq!(terms("cmu_salsa", "CC0"), "CC0");
        assert_eq!(terms("home", ""), "not written");
    }
}
