//! Other programs lead the robot by a twist.

use admittance_host::clock::monotonic_ns;
use end_to_end::session::with_keys;
use end_to_end::{Child, PATIENCE, undisturbed};

use crate::cell::{Cell, Files};
use crate::network::{Network, Sent, ToEdge, ToRobot};

/// Where the arm stands, and a surface that it does not come to.
const STANDS: [(&str, &str); 3] = [
    ("motion", "[{ duration_s = 2.0, twist = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0] }]"),
    ("start", "{ joint_position_rad = [0.3, 1.2, -1.8, 2.2, 1.57, 0.3] }"),
    ("surface.point_m", "[-0.48934, -0.33388, -0.43]"),
];

fn led_cell() -> Cell {
    let mut files = Files::patient();
    let twist = "{ linear_limit_m_s = 0.03, angular_limit_rad_s = 0.1 }";
    files.edge = with_keys(&files.edge, &[("twist", twist)]);
    Cell::of(&files)
}

/// The fastest joint that the edge asked for, degrees/s.
fn fastest((_, speeds): &Sent) -> f64 {
    speeds.iter().fold(0.0, |most, speed| speed.abs().max(most))
}

#[test]
fn a_robot_that_says_nothing_of_a_planned_path_is_led() {
    undisturbed(|| {
        let mut cell = led_cell();
        let network = Network::before(cell.address());
        network.become_like(ToEdge::Change(|message| message.planned = None), ToRobot::Pass);
        let mut leader = None;
        let (truths, said) = cell.run_by(&STANDS, network.address, |cell, _, truth| {
            if leader.is_none() && truth.scenario_time_s > 0.3 {
                leader = Some(Child::spawn(cell.ctl("move").args(["--twist", "x=0.02", "--for", "0.5"])));
            }
        });
        let mut leader = leader.expect("the scenario lasts longer");
        assert_eq!(leader.wait_for_exit(PATIENCE).code(), Some(0), "{}", leader.report());
        let [first, last] = [truths.first(), truths.last()].map(|truth| truth.expect("truths").tcp_position[0]);
        println!("{:.2} mm", 1e3 * (last - first));
        assert!((0.007..0.013).contains(&(last - first)), "{} m; {said}", last - first);
    });
}

#[test]
fn what_the_daemon_does_not_know_of_leads_no_faster() {
    undisturbed(|| {
        let mut cell = led_cell();
        let network = Network::before(cell.address());
        let (mut leader, mut lost_ns) = (None, 0);
        cell.run_by(&STANDS, network.address, |cell, _, truth| {
            if leader.is_none() && truth.scenario_time_s > 0.3 {
                leader = Some(Child::spawn(cell.ctl("move").args(["--twist", "x=0.03", "--for", "5"])));
            }
            // The ramp to 0.03 m/s takes 60 ms: it is under way.
            if lost_ns == 0 && truth.tcp_twist[0] > 0.004 {
                network.become_like(ToEdge::Lose, ToRobot::Pass);
                lost_ns = monotonic_ns();
            }
        });
        assert!(lost_ns > 0, "the arm was not led");
        // One message may have been under way.
        let (known, later): (Vec<Sent>, Vec<Sent>) =
            network.sent().into_iter().partition(|(sent_ns, _)| *sent_ns < lost_ns + 3_000_000);
        let at = fastest(known.last().expect("answers"));
        let most = later.iter().map(fastest).fold(0.0, f64::max);
        println!(
            "{at:.3} degrees/s when the robot was heard last, then at most {most:.3}, of {} messages",
            later.len()
        );
        assert!(at > 0.1 && later.len() > 4 && most <= at, "{at} degrees/s, then {most}");
        assert!(later.iter().skip(30).all(|sent| fastest(sent) == 0.0), "it does not come to zero");
    });
}
