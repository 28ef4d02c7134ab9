//! What is refused, and how it is named.

use super::super::xml::LARGEST_URDF;
use super::{ARM, arm_with_a_finger, import, origin, printed};

/// What is said of the arm with one thing replaced.
fn said(from: &str, to: &str) -> String {
    assert!(ARM.contains(from), "{from}");
    import(&ARM.replacen(from, to, 1), false).expect_err(to)
}

#[test]
fn what_is_wrong_is_named_with_its_line_and_what_to_do() {
    let shoulder = "joint \"shoulder\": ";
    let cases: &[(&str, &str, &[&str])] = &[
        ("name=\"shoulder\" type=\"revolute\"", "name=\"shoulder\" type=\"planar\"", &[shoulder, "planar", "accepted"]),
        (
            "name=\"shoulder\" type=\"revolute\"",
            "name=\"shoulder\" type=\"floating\"",
            &[shoulder, "floating", "accepted"],
        ),
        (
            "name=\"shoulder\" type=\"revolute\"",
            "name=\"shoulder\" type=\"screw\"",
            &[shoulder, "type = \"screw\"", "revolute"],
        ),
        ("name=\"shoulder\" type=\"revolute\"", "name=\"shoulder\"", &[shoulder, "type = \"\"", "revolute"]),
        ("<dynamics damping", "<mimic joint=\"elbow\"/><dynamics damping", &[shoulder, "mimic"]),
        ("<limit lower=\"-2\" upper=\"2.5\"", "<limit upper=\"2.5\"", &[shoulder, "lacks lower", "continuous"]),
        ("lower=\"-2\" upper=\"2.5\"", "lower=\"2.5\" upper=\"2.5\"", &[shoulder, "lower = 2.5", "below upper"]),
        ("upper=\"2.5\" velocity=\"2\"", "upper=\"2.5\" velocity=\"-2\"", &[shoulder, "velocity = -2", "above 0"]),
        ("velocity=\"2\" effort=\"150\"", "velocity=\"2\"", &[":15: ", shoulder, "lacks effort"]),
        ("velocity=\"2\" effort=\"150\"", "effort=\"150\"", &[":15: ", shoulder, "lacks velocity"]),
        ("velocity=\"2\" effort=\"150\"", "", &[":15: ", shoulder, "lacks velocity, effort"]),
        (
            "lower=\"-2\" upper=\"2.5\"",
            "lower=\"-180\" upper=\"180\"",
            &[":15: ", shoulder, "upper = 180", "25.1 rad", "degrees"],
        ),
        ("lower=\"-2\" upper=\"2.5\"", "lower=\"-2\" upper=\"90\"", &[shoulder, "upper = 90", "degrees"]),
        ("damping=\"3\"", "damping=\"-3\"", &[":15: ", shoulder, "damping = -3", "at least 0"]),
        ("friction=\"1.5\"", "friction=\"-1e300\"", &[shoulder, "friction = -1e300", "at least 0"]),
        ("<dynamics damping", "<mimic/><dynamics damping", &[shoulder, "lacks <mimic joint"]),
        (
            "<dynamics damping",
            "<safety_controller soft_lower_limit=\"x\"/><dynamics damping",
            &[shoulder, "soft_lower_limit = \"x\"", "a finite number"],
        ),
        (
            "<dynamics damping",
            "<safety_controller soft_lower_limit=\"3\"/><dynamics damping",
            &[shoulder, "soft_lower_limit = 3", "soft_upper_limit = not said", "lower = -2", "accepted"],
        ),
        ("made-up &quot;six&quot;", "a # FILL IN: b", &["robot \"a # FILL IN: b\"", "accepted: a name"]),
        (
            "<joint name=\"finger\"",
            "<joint name=\"# FILL IN: b; such as 1\"",
            &[":54: ", "joint \"# FILL IN: b; such as 1\""],
        ),
        ("<mass value=\"4\"/>", "<mass value=\"-1e308\"/>", &["link \"upper\": ", "-1e308 kg"]),
        ("<axis xyz=\"0 0 2\"/>", "<axis xyz=\"0 0 0\"/>", &["joint \"turn\": ", "axis", "not zero"]),
        ("<axis xyz=\"0 0 2\"/>", "<axis xyz=\"0 0 nan\"/>", &["joint \"turn\": ", "\"0 0 nan\"", "3 finite numbers"]),
        ("<axis xyz=\"0 0 2\"/>", "<axis/>", &["joint \"turn\": ", "lacks xyz"]),
        ("xyz=\"0 0.1 0.1\"", "xyz=\"0 0.1\"", &[shoulder, "xyz = \"0 0.1\"", "3 finite numbers"]),
        ("xyz=\"0 0.1 0.1\"", "xyz=\"0 0.1 1e999\"", &[shoulder, "3 finite numbers"]),
        ("xyz=\"0 0.1 0.1\"", "xyz=\"0 50 0.1\"", &[shoulder, "origin_m", "-10 to 10"]),
        ("<child link=\"upper\"/>", "<child link=\"uper\"/>", &[shoulder, "\"uper\" is no link"]),
        ("<child link=\"upper\"/>", "", &[shoulder, "lacks <child link"]),
        (
            "<child link=\"upper\"/>",
            "<child link=\"fore\"/>",
            &["link \"fore\" is a loop", "\"shoulder\"", "\"elbow\""],
        ),
        (
            "<parent link=\"column\"/><child link=\"upper\"/>",
            "<parent link=\"tcp\"/><child link=\"upper\"/>",
            &["loop of joints"],
        ),
        ("<link name=\"fore\">", "<link name=\"upper\">", &["link \"upper\"", "line 19", "its own"]),
        ("<joint name=\"elbow\"", "<joint name=\"shoulder\"", &[shoulder, "line 15", "its own"]),
        ("<link name=\"wrist\"/>", "<link/>", &["a <link> without a name"]),
        ("<mass value=\"4\"/>", "<mass value=\"-4\"/>", &["link \"upper\": ", "-4 kg", "above 0"]),
        ("<mass value=\"4\"/>", "<mass value=\"0\"/>", &["link \"upper\": ", "0 kg", "above 0"]),
        ("<mass value=\"4\"/>", "<mass value=\"4\"/><mass value=\"4\"/>", &["link \"upper\": ", "a second <mass>"]),
        ("iyy=\"0.1\" iyz", "iyy=\"-0.1\" iyz", &["link \"upper\": ", "principal moments", "above 0"]),
        ("iyy=\"0.1\" iyz", "iyz", &["link \"upper\": ", "iyy"]),
        (
            "<mass value=\"2\"/><inertia ixx=\"0\"",
            "<mass value=\"2\"/><inertia ixx=\"-1\"",
            &["link \"finger\": ", "principal"],
        ),
        ("<mass value=\"0\"/><inertia ixx=\"0\"", "<mass value=\"0\"/><inertia ixx=\"1\"", &["link \"tcp\": ", "0 kg"]),
        ("<link name=\"wrist\"/>", "<xacro:link name=\"wrist\"/>", &["xacro", "expanded"]),
        // By its prefix, whatever namespace that is said to be.
        (
            "http://www.ros.org/wiki/xacro\">",
            "http://nobody/\"><xacro:include filename=\"column.xacro\"/>",
            &["xacro", "expanded"],
        ),
        ("value=\"4\"", "value=\"${mass}\"", &["xacro", "expanded"]),
        ("<link name=\"wrist\"/>", "<link name=\"${prefix}wrist\"/>", &["xacro", "expanded"]),
        ("name=\"wrist\"", "name=\"wrist\" o:p=\"1\"", &["it is not XML"]),
        ("<link name=\"wrist\"/>", "<link name=\"wrist\">", &["it is not XML"]),
    ];
    for (from, to, expected) in cases {
        let message = said(from, to);
        assert!(message.starts_with("arm.urdf:") && !message.contains('\n'), "{message}");
        for part in *expected {
            assert!(message.contains(part), "{part}: {message}");
        }
    }
    let line = said("<mass value=\"4\"/>", "<mass value=\"x\"/>");
    assert!(line.starts_with("arm.urdf:20: link \"upper\": value = \"x\" of its <mass>"), "{line}");
}

#[test]
fn a_joint_that_slides_too_far_is_likely_in_millimetres() {
    let text = arm_with_a_finger().replacen("lower=\"0.01\" upper=\"0.05\"", "lower=\"10\" upper=\"150\"", 1);
    let refused = printed(text.as_bytes(), &origin("world", "finger"), false).expect_err("too far").of("arm.urdf");
    for part in ["joint \"finger\": ", "upper = 150", "in m", "millimetres"] {
        assert!(refused.contains(part), "{refused}");
    }
}

#[test]
fn base_and_tip_are_links_one_above_the_other() {
    let said = |base, tip| printed(ARM.as_bytes(), &origin(base, tip), false).expect_err("no arm").of("arm.urdf");
    assert!(said("wrld", "tcp").contains("--base \"wrld\": no link of this name; links: \"base\", "));
    assert!(said("world", "tip").contains("--tip \"tip\": no link"));
    assert!(said("tcp", "world").contains("--tip \"world\" is not below --base \"tcp\""));
    assert!(said("flange", "tcp").contains("0 joints move"));
    let one = said("world", "column");
    for part in ["1 joints move", ": \"turn\"; accepted: 2 joints with 2 or 6 axes, 3 to 8 joints with 6"] {
        assert!(one.contains(part), "{one}");
    }
}

#[test]
fn what_is_no_urdf_or_far_too_much_is_refused() {
    let said = |text: &str| import(text, false).expect_err("no URDF");
    for (text, expected) in [
        ("", "it is not XML"),
        ("<sdf version=\"1.6\"/>", "it begins with <sdf>"),
        ("<robot name=\"empty\"/>", "it has no <link>"),
        ("<!DOCTYPE r [<!ENTITY a \"ha\"><!ENTITY b \"&a;&a;\">]><robot name=\"&b;\"/>", "it has a <!DOCTYPE>"),
        ("<robot>&lol;</robot>", "it is not XML"),
    ] {
        assert!(said(text).contains(expected), "{text}: {}", said(text));
    }
    let deep = format!("<robot>{}{}</robot>", "<a>".repeat(40_000), "</a>".repeat(40_000));
    assert!(said(&deep).contains("nested more than 64 deep"));
    let wide = format!("<robot>{}</robot>", "<a/>".repeat(200_000));
    assert!(said(&wide).contains("more than 100000 elements"));
    let links: String = (0..2_001).map(|link| format!("<link name=\"l{link}\"/>")).collect();
    assert!(said(&format!("<robot>{links}</robot>")).contains("2001 links"));
    let name = format!("<robot><link name=\"a\"/><joint name=\"{}\"/></robot>", "n".repeat(LARGEST_URDF as usize));
    assert!(said(&name).contains("arm.urdf:1: a tag of more than 4096 bytes"));
    let long = |length: usize| {
        format!("<robot>\n<!-- {} -->\n<link name=\"{}>\"/></robot>", "<".repeat(9000), "n".repeat(length))
    };
    assert!(said(&long(5000)).contains("arm.urdf:3: a tag of more than 4096 bytes"), "{}", said(&long(5000)));
    assert!(said(&long(3000)).contains("--base \"world\": no link") && said(&long(3000)).len() < 300);
    let spaces: String = (0..65).map(|space| format!("<a xmlns:s{space}=\"u\"/>")).collect();
    assert!(said(&format!("<robot>{spaces}</robot>")).contains("more than 64 namespaces"));
    // As many links as there may be are read, with their lines.
    let link = |link: usize| format!("<link name=\"l{link}\"/>\n{}", " ".repeat(300));
    let many: String = (0..2_000).map(link).collect();
    assert!(said(&format!("<robot>{many}</robot>")).contains("no link of this name"));
    let refused = printed(b"<robot name=\"\xff\"/>", &origin("a", "b"), false).expect_err("no text");
    assert!(refused.of("x.urdf").contains("x.urdf: it is not UTF-8"));
    let control = said("<robot><link name=\"a&#x1b;[2J\u{202e}\"/></robot>");
    assert!(!control.contains(['\u{1b}', '\u{202e}']), "{control:?}");
}
