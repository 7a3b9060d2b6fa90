//! The page, part of the program: nothing is fetched from anywhere else.

pub const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
     img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'";

pub fn part(name: &str) -> Option<(&'static str, &'static str)> {
    const HTML: &str = "text/html; charset=utf-8";
    const CSS: &str = "text/css; charset=utf-8";
    const SCRIPT: &str = "text/javascript; charset=utf-8";
    Some(match name {
        "index.html" => (HTML, include_str!("../page/index.html")),
        "whole_stage.html" => (HTML, include_str!("../page/whole_stage.html")),
        "whole_stage.css" => (CSS, include_str!("../page/whole_stage.css")),
        "whole_stage.js" => (SCRIPT, include_str!("../page/whole_stage.js")),
        "robots.js" => (SCRIPT, include_str!("../page/robots.js")),
        "cues.js" => (SCRIPT, include_str!("../page/cues.js")),
        "timeline.js" => (SCRIPT, include_str!("../page/timeline.js")),
        "robot.js" => (SCRIPT, include_str!("../page/robot.js")),
        "pixels.js" => (SCRIPT, include_str!("../page/pixels.js")),
        "floor.js" => (SCRIPT, include_str!("../page/floor.js")),
        "view.css" => (CSS, include_str!("../page/view.css")),
        "main.js" => (SCRIPT, include_str!("../page/main.js")),
        "connection.js" => (SCRIPT, include_str!("../page/connection.js")),
        "controls.js" => (SCRIPT, include_str!("../page/controls.js")),
        "stop.js" => (SCRIPT, include_str!("../page/stop.js")),
        "links.js" => (SCRIPT, include_str!("../page/links.js")),
        "songs.js" => (SCRIPT, include_str!("../page/songs.js")),
        "microphone.js" => (SCRIPT, include_str!("../page/microphone.js")),
        "capture.js" => (SCRIPT, include_str!("../page/capture.js")),
        "sound.js" => (SCRIPT, include_str!("../page/sound.js")),
        "music_clock.js" => (SCRIPT, include_str!("../page/music_clock.js")),
        "panels.js" => (SCRIPT, include_str!("../page/panels.js")),
        "stage.js" => (SCRIPT, include_str!("../page/stage.js")),
        "shapes.js" => (SCRIPT, include_str!("../page/shapes.js")),
        "painter.js" => (SCRIPT, include_str!("../page/painter.js")),
        "camera.js" => (SCRIPT, include_str!("../page/camera.js")),
        "matrix.js" => (SCRIPT, include_str!("../page/matrix.js")),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_that_the_page_names_is_there_and_nothing_comes_from_elsewhere() {
        let mut todo = ["index.html", "whole_stage.html"].map(str::to_owned).to_vec();
        let mut seen = Vec::new();
        while let Some(name) = todo.pop() {
            let (_, text) = part(&name).unwrap_or_else(|| panic!("{name} is missing"));
            assert!(!text.contains("http:") && !text.contains("https:"), "{name}");
            for quoted in text.split('"').skip(1).step_by(2) {
                let file = quoted.trim_start_matches("./").to_owned();
                let is_part = file.ends_with(".js") || file.ends_with(".css");
                if is_part && !seen.contains(&file) && !todo.contains(&file) {
                    todo.push(file);
                }
            }
            seen.push(name);
        }
        assert!(seen.len() >= 10, "{seen:?}");
    }
}
