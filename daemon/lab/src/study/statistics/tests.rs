use super::*;
use crate::study::closed_loop::FirstActive;

/// A case with this attainable share of the limit and the same run for every variant, which
/// `change` makes.
fn case(attainable_share: f64, change: impl Fn(&mut Seen, f64)) -> Case {
    let draw = Draw::new(1, 0).unwrap();
    let limit = draw.normal_force_limit_n();
    let first = FirstActive {
        joint_position: draw.contact_position.clone(),
        joint_velocity: vec![0.0; 2],
        normal_force_n: 0.1 * limit,
    };
    let mut seen = Seen {
        first_active: Some(first),
        samples_in_contact: 50,
        first_verdict_feasible: Some(true),
        peak_n: 0.9 * limit,
        peak_while_feasible_n: 0.9 * limit,
        ..Seen::default()
    };
    change(&mut seen, limit);
    let peak = attainable_share * limit;
    let runs = Variant::ALL.map(|_| Ok(seen.clone())).to_vec();
    let attainable_peak_n = Some(Ok(peak));
    Case { arm: None, draw, attainable_peak_n, later_peak_n: None, optimum_n: peak, peak_in_contact_n: None, runs }
}

/// What no controller can do later is said, and is withdrawn all the same.
#[test]
fn a_verdict_that_the_command_outpaced_is_counted_among_the_withdrawn() {
    let withdrawn = |later_share: Option<Result<f64, String>>| {
        let case = case(0.8, |seen, _| seen.infeasible_cycles = 1);
        let limit = case.limit_n();
        Case { later_peak_n: later_share.map(|share| share.map(|share| share * limit)), ..case }
    };
    let unknown = || Some(Err("unsolved".to_owned()));
    let cases = [None, Some(Ok(0.9)), unknown(), Some(Ok(1.1)), Some(Ok(f64::INFINITY))].map(withdrawn);
    let column = figures(1, &cases).nominal;
    assert_eq!((column.counted, column.attainable, column.timid_runs), (5, 5, 5));
    assert_eq!((column.withdrawn, column.outpaced), (5, 2));
}

#[test]
fn each_figure_counts_what_it_says() {
    let stopped = |seen: &mut Seen, limit: f64| {
        (seen.infeasible_cycles, seen.stop_reason, seen.peak_n) = (1, 1, 1.2 * limit);
    };
    let cases = [
        case(0.8, |_, _| ()),
        case(0.8, |seen, limit| seen.peak_while_feasible_n = 1.004 * limit),
        case(0.8, |seen, limit| seen.peak_while_feasible_n = 1.05 * limit),
        case(0.8, |seen, limit| {
            stopped(seen, limit);
            seen.first_verdict_feasible = Some(false);
        }),
        case(1.2, stopped),
        case(1.2, |seen, limit| {
            stopped(seen, limit);
            seen.resting_force_n = 1.1 * limit;
        }),
        case(0.8, |seen, _| seen.contact_losses = 3),
        case(0.8, |seen, limit| seen.peak_without_verdict_n = 2.0 * limit),
    ];
    let figures = figures(1, &cases);
    let column = &figures.nominal;
    assert_eq!((column.counted, column.attainable, column.feasible), (8, 6, 5));
    assert_eq!((column.unsound, column.over_limit_without_verdict), (1, 1));
    assert_eq!((column.timid_runs, column.timid), (1, Some(1.0 / 6.0)));
    assert_eq!((column.withdrawn, column.contact_losses, column.runs_with_contact_losses), (2, 3, 1));
    assert_eq!((column.stops, column.other_stops, column.resting_over_limit), (3, 0, 1));
    let ratio = column.stop_peak_ratio.unwrap();
    assert!((ratio.median - 1.0).abs() < 1e-12 && (ratio.max - 1.5).abs() < 1e-12);
    assert_eq!(figures.variants.len(), Variant::ALL.len() - 1);
    assert_eq!(figures.stiffness_decades.iter().map(|d| d.attainable + d.unattainable).sum::<u32>(), 8);
}

#[test]
fn runs_that_say_nothing_about_a_verdict_are_reported_apart() {
    let over = |seen: &mut Seen, limit: f64| {
        if let Some(first) = &mut seen.first_active {
            first.normal_force_n = 1.01 * limit;
        }
    };
    let mut failed = case(0.8, |_, _| ());
    failed.attainable_peak_n = Some(Err("unsolved".to_owned()));
    let cases = [
        case(2.0, over),
        case(0.8, |seen, _| seen.samples_in_contact = 2),
        case(0.8, |seen, _| seen.first_active = None),
        failed,
    ];
    let column = figures(1, &cases).nominal;
    assert_eq!((column.already_over_limit, column.brief, column.no_contact, column.failed), (1, 1, 1, 1));
    assert_eq!((column.counted, column.timid, column.stop_peak_ratio), (0, None, None));
}

#[test]
fn ranks_are_the_nearest() {
    let values: Vec<f64> = (1..=200).map(f64::from).rev().collect();
    assert_eq!(Distribution::of(values), Some(Distribution { median: 100.0, p99: 198.0, max: 200.0 }));
    assert_eq!(Distribution::of(Vec::new()), None);
}

#[test]
fn json_has_the_keys_of_the_nominal_variant_at_its_top() {
    let json = serde_json::to_value(figures(4, &[case(0.8, |_, _| ())])).unwrap();
    for key in ["runs", "attainable", "unsound", "timid", "withdrawn", "contact_losses", "stop_peak_ratio"] {
        assert!(json.get(key).is_some(), "{key}");
    }
    assert_eq!((json["runs"].as_u64(), json["seed"].as_u64()), (Some(1), Some(4)));
    assert!(json["variants"]["stiffness_times_5"]["resting_over_limit"].is_u64());
}
