//! A robot as a URDF text, for `robot new` to write beside the robot file.
//!
//! `urdf_rs::write_to_string` would print other digits and order than the files
//! that are there.

use std::fmt::Write;

use urdf_rs::{Geometry, Joint, JointType, Link, Pose, Visual};

pub(super) fn urdf_text(robot: &urdf_rs::Robot) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "<?xml version=\"1.0\"?>\n<!-- Converted from MJCF by `servodance robot new`. -->\n\
         <robot name=\"{}\">",
        escaped(&robot.name)
    );
    for link in &robot.links {
        write_link(link, &mut out);
    }
    for joint in &robot.joints {
        write_joint(joint, &mut out);
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

fn origin(pose: &Pose) -> String {
    let ([x, y, z], [roll, pitch, yaw]) = (*pose.xyz, *pose.rpy);
    format!("<origin xyz=\"{x:.9} {y:.9} {z:.9}\" rpy=\"{roll:.9} {pitch:.9} {yaw:.9}\"/>")
}

fn write_link(link: &Link, out: &mut String) {
    let _ = writeln!(out, "  <link name=\"{}\">", escaped(&link.name));
    let inertial = &link.inertial;
    if inertial.mass.value != 0.0 {
        let [x, y, z] = *inertial.origin.xyz;
        let moments = &inertial.inertia;
        let _ = writeln!(
            out,
            "    <inertial><origin xyz=\"{x:.9} {y:.9} {z:.9}\"/><mass value=\"{}\"/><inertia \
             ixx=\"{:.6e}\" ixy=\"0\" ixz=\"0\" iyy=\"{:.6e}\" iyz=\"0\" izz=\"{:.6e}\"/>\
             </inertial>",
            inertial.mass.value, moments.ixx, moments.iyy, moments.izz
        );
    }
    for visual in &link.visual {
        write_visual(visual, out);
    }
    for solid in &link.collision {
        let (origin, shape) = (origin(&solid.origin), shape_text(&solid.geometry));
        let _ = writeln!(out, "    <collision>{origin}<geometry>{shape}</geometry></collision>");
    }
    out.push_str("  </link>\n");
}

fn write_visual(visual: &Visual, out: &mut String) {
    let shape = shape_text(&visual.geometry);
    let color = visual.material.as_ref().and_then(|m| m.color.as_ref());
    let [r, g, b, a] = color.map_or([0.0; 4], |color| *color.rgba);
    let _ = writeln!(
        out,
        "    <visual>{}<geometry>{shape}</geometry><material name=\"\"><color rgba=\"{r} {g} {b} {a}\"/>\
         </material></visual>",
        origin(&visual.origin)
    );
}

fn shape_text(geometry: &Geometry) -> String {
    match geometry {
        Geometry::Box { size } => format!("<box size=\"{} {} {}\"/>", size[0], size[1], size[2]),
        Geometry::Cylinder { radius, length } | Geometry::Capsule { radius, length } => {
            format!("<cylinder radius=\"{radius}\" length=\"{length}\"/>")
        }
        Geometry::Sphere { radius } => format!("<sphere radius=\"{radius}\"/>"),
        Geometry::Mesh { filename, scale } => {
            let [x, y, z] = scale.as_deref().copied().unwrap_or([1.0; 3]);
            format!("<mesh filename=\"{}\" scale=\"{x} {y} {z}\"/>", escaped(filename))
        }
    }
}

fn write_joint(joint: &Joint, out: &mut String) {
    let kind = match joint.joint_type {
        JointType::Prismatic => "prismatic",
        JointType::Revolute => "revolute",
        JointType::Continuous => "continuous",
        _ => "fixed",
    };
    let _ = write!(
        out,
        "  <joint name=\"{}\" type=\"{kind}\">{}<parent link=\"{}\"/><child link=\"{}\"/>",
        escaped(&joint.name),
        origin(&joint.origin),
        escaped(&joint.parent.link),
        escaped(&joint.child.link)
    );
    if joint.joint_type != JointType::Fixed {
        let [x, y, z] = *joint.axis.xyz;
        let limit = &joint.limit;
        let _ = write!(
            out,
            "<axis xyz=\"{x} {y} {z}\"/><limit lower=\"{}\" upper=\"{}\" \
             effort=\"{}\" velocity=\"0\"/>",
            limit.lower, limit.upper, limit.effort
        );
    }
    if let Some(mimic) = &joint.mimic {
        let _ = write!(
            out,
            "<mimic joint=\"{}\" multiplier=\"{}\" offset=\"{}\"/>",
            escaped(&mimic.joint),
            mimic.multiplier.unwrap_or(1.0),
            mimic.offset.unwrap_or(0.0)
        );
    }
    out.push_str("</joint>\n");
}
