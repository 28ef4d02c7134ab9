//! Which stiffness a person is told of, where only a range of it is known.

use ipc_types::RecordSample;

/// The likeliest stiffness in N/m after a record, where a range of it is `told`. While f̂ fades after a contact the law supposes the softest surface of the range, and keeps it
/// until the next touch: nobody believes in that one. What is believed then is what was learned, as
/// long as it is remembered, the band being about it, and after that what was told.
pub(crate) fn likeliest_stiffness(record: &RecordSample, told: Option<[f64; 2]>) -> f64 {
    let (band, stiffness) = (record.believed_stiffness_band_n_m, record.believed_stiffness_n_m);
    let [least, most] = band;
    match told {
        _ if record.command.active_axes != 0 || least >= most => stiffness,
        Some(told) if band == told => record.normal_stiffness_n_m,
        Some([softest, hardest]) if softest <= least && most <= hardest => 0.5 * (least + most),
        // Harder than any that was told: it was learned as it is.
        Some(_) | None => stiffness,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn out_of_contact_the_stiffness_is_not_the_softest_of_the_range() {
        let told = [1e4, 5e5];
        let shown = |active_axes, stiffness, band, told| {
            let mut record = RecordSample::default();
            (record.believed_stiffness_n_m, record.believed_stiffness_band_n_m) = (stiffness, band);
            (record.command.active_axes, record.normal_stiffness_n_m) = (active_axes, 8e4);
            likeliest_stiffness(&record, told)
        };
        assert_eq!(shown(0, 1e4, told, Some(told)), 8e4, "forgotten: what was told");
        assert_eq!(shown(0, 1e4, [0.9e5, 1.1e5], Some(told)), 1e5, "remembered for a second");
        assert_eq!(shown(2, 1e4, told, Some(told)), 1e4, "in contact: what the law goes by");
        assert_eq!(shown(0, 2e6, [1e4, 5e7], Some(told)), 2e6, "harder than told");
        assert_eq!(shown(0, 1e5, [1e5; 2], None), 1e5, "no range");
    }
}
