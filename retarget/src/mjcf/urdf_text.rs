//! The tree as a URDF text.

use std::fmt::Write;

use k::nalgebra::{Isometry3, Point3};

use super::bodies::{Bodies, Geom, GeomShape, Joint, Kind, Link};

pub(super) fn urdf_text(name: &str, bodies: &Bodies) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "<?xml version=\"1.0\"?>\n<!-- Converted from MJCF by `servodance robot new`. -->\n\
         <robot name=\"{}\">",
        escaped(name)
    );
    for link in &bodies.links {
        write_link(link, &mut out);
    }
    for joint in &bodies.joints {
        write_joint(joint, bodies, &mut out);
    }
    out.push_str("</robot>\n");
    out
}

fn escaped(text: &str) -> String {
    let mut out = String::new();
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            letter if letter.is_control() => out.push(' '),
            letter => out.push(letter),
        }
    }
    out
}

fn origin(pose: &Isometry3<f64>) -> String {
    let at = pose.translation.vector;
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    format!(
        "<origin xyz=\"{:.9} {:.9} {:.9}\" rpy=\"{roll:.9} {pitch:.9} {yaw:.9}\"/>",
        at.x, at.y, at.z
    )
}

fn write_link(link: &Link, out: &mut String) {
    let _ = writeln!(out, "  <link name=\"{}\">", escaped(&link.name));
    if link.mass_kg != 0.0 {
        let Point3 { coords } = link.com;
        let [ixx, iyy, izz] = link.moments;
        let _ = writeln!(
            out,
            "    <inertial><origin xyz=\"{:.9} {:.9} {:.9}\"/><mass value=\"{}\"/><inertia \
             ixx=\"{ixx:.6e}\" ixy=\"0\" ixz=\"0\" iyy=\"{iyy:.6e}\" iyz=\"0\" izz=\"{izz:.6e}\"/>\
             </inertial>",
            coords.x, coords.y, coords.z, link.mass_kg
        );
    }
    for geom in &link.geoms {
        write_geom(geom, out);
    }
    out.push_str("  </link>\n");
}

fn write_geom(geom: &Geom, out: &mut String) {
    let shape = match &geom.shape {
        GeomShape::Box([x, y, z]) => format!("<box size=\"{x} {y} {z}\"/>"),
        GeomShape::Cylinder { radius, length } => {
            format!("<cylinder radius=\"{radius}\" length=\"{length}\"/>")
        }
        GeomShape::Sphere { radius } => format!("<sphere radius=\"{radius}\"/>"),
    };
    let [r, g, b, a] = geom.rgba;
    let _ = writeln!(
        out,
        "    <visual>{}<geometry>{shape}</geometry><material name=\"\"><color rgba=\"{r} {g} {b} {a}\"/>\
         </material></visual>",
        origin(&geom.pose)
    );
}

fn write_joint(joint: &Joint, bodies: &Bodies, out: &mut String) {
    let kind = match (joint.kind, joint.range) {
        (Kind::Fixed, _) => "fixed",
        (Kind::Slide, _) => "prismatic",
        (Kind::Hinge, Some(_)) => "revolute",
        (Kind::Hinge, None) => "continuous",
    };
    let _ = write!(
        out,
        "  <joint name=\"{}\" type=\"{kind}\">{}<parent link=\"{}\"/><child link=\"{}\"/>",
        escaped(&joint.name),
        origin(&joint.origin),
        escaped(&bodies.links[joint.parent].name),
        escaped(&bodies.links[joint.child].name)
    );
    if joint.kind != Kind::Fixed {
        let [x, y, z] = joint.axis;
        let [lower, upper] = joint.range.unwrap_or_default();
        let effort = joint.effort;
        let _ = write!(
            out,
            "<axis xyz=\"{x} {y} {z}\"/><limit lower=\"{lower}\" upper=\"{upper}\" \
             effort=\"{effort}\" velocity=\"0\"/>"
        );
    }
    if let Some((leader, multiplier, offset)) = &joint.mimic {
        let leader = escaped(leader);
        let _ = write!(
            out,
            "<mimic joint=\"{leader}\" multiplier=\"{multiplier}\" offset=\"{offset}\"/>"
        );
    }
    out.push_str("</joint>\n");
}
