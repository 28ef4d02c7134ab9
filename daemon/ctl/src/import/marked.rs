//! Lines of a file that a person has to fill in: what no URDF says.
//!
//! What stands there until then is refused by `validate`: nan, an empty list, a word that is none.

use admittance_host::config::escaped;

pub(super) const MARK: &str = "# FILL IN: ";
const EXAMPLE: &str = "; such as ";

/// A key that is to be filled in, with what it means and a value that would be accepted.
pub(super) fn to_fill_in(key: &str, until_then: &str, meaning: &str, example: &str) -> String {
    format!("{key} = {until_then}   {MARK}{}{EXAMPLE}{example}", escaped(meaning))
}

/// The text with the examples filled in.
pub(super) fn with_examples(text: &str) -> String {
    let filled = |line: &str| {
        let (said, mark) = line.split_once(MARK)?;
        let ((key, _), (_, example)) = (said.split_once(" = ")?, mark.rsplit_once(EXAMPLE)?);
        Some(format!("{key} = {example}\n"))
    };
    text.lines().map(|line| filled(line).unwrap_or_else(|| format!("{line}\n"))).collect()
}

/// A number as a message or a comment has it: huge and tiny ones with an exponent.
pub(super) fn shown(value: f64) -> String {
    match value.abs() {
        size if size == 0.0 || (1e-6..1e9).contains(&size) => format!("{value}"),
        _ => format!("{value:e}"),
    }
}

/// A number as TOML has it; never -0.0, which means nothing here.
pub(super) fn number(value: f64) -> String {
    format!("{:?}", value + 0.0)
}

/// A list of numbers.
pub(super) fn list(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|value| number(*value)).collect();
    format!("[{}]", values.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn examples_take_the_place_of_what_is_refused() {
        let line = to_fill_in("a_s", "nan", "how long; such as it is", "0.5");
        assert_eq!(line, "a_s = nan   # FILL IN: how long; such as it is; such as 0.5");
        assert_eq!(with_examples(&format!("# a\n{line}\nb = 1\n")), "# a\na_s = 0.5\nb = 1\n");
    }

    #[test]
    fn numbers_are_those_of_the_urdf() {
        assert_eq!(list(&[0.1, -0.0, 1e-7, 3.0]), "[0.1, 0.0, 1e-7, 3.0]");
        assert_eq!([-2.5, 0.0, 150.0, 1e308].map(shown), ["-2.5", "0", "150", "1e308"]);
    }
}
