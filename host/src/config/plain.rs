//! Texts that are fit to be shown: without control characters, and with short numbers.

use super::range::Number;

/// The text with what a terminal would act on, or not show, escaped.
pub fn escaped(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '"' | '\'' | '\\' => plain.push(character),
            other => plain.extend(other.escape_debug()),
        }
    }
    plain
}

/// A number with six significant digits at most: 0.01575 for 0.015750000000000003.
pub fn short(value: f64) -> String {
    let rounded = format!("{value:.5e}").parse().unwrap_or(value);
    Number::Float(rounded).to_string()
}

/// A number with so many decimals, for messages. What rounds to zero has no sign: nobody means "-0.0".
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if !rest.contains(|c: char| c != '0' && c != '.') => rest.to_owned(),
        Some(_) | None => text,
    }
}

/// A share in percent with two significant digits: "3.1 %", "0.021 %".
pub fn percent(share: f64) -> String {
    let rounded = format!("{:.1e}", 100.0 * share).parse().unwrap_or(100.0 * share);
    format!("{} %", Number::Float(rounded))
}

/// The text with every fraction in it [`short`]; quoted texts and names stay as they are.
pub(super) fn with_short_numbers(text: &str) -> String {
    let is_part = |character: char| character.is_ascii_alphanumeric() || "._+-".contains(character);
    let mut plain = String::with_capacity(text.len());
    let (mut rest, mut is_quoted) = (text, false);
    while let Some(first) = rest.chars().next() {
        let end = if is_part(first) { rest.find(|c| !is_part(c)).unwrap_or(rest.len()) } else { first.len_utf8() };
        let (word, after) = rest.split_at(end);
        is_quoted ^= first == '"';
        let is_long =
            word.len() > 8 && word.contains(['.', 'e']) && word.starts_with(|c: char| c == '-' || c.is_ascii_digit());
        match word.parse::<f64>() {
            Ok(value) if is_long && !is_quoted && value.is_finite() => plain.push_str(&short(value)),
            _ => plain.push_str(word),
        }
        rest = after;
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_a_percentage() {
        let shares = [0.0, 0.000_213, 0.031_4, 0.997, 1.0].map(percent);
        assert_eq!(shares, ["0 %", "0.021 %", "3.1 %", "100 %", "100 %"]);
    }

    #[test]
    fn numbers_are_short_and_texts_stay() {
        assert_eq!(short(0.015750000000000003), "0.01575");
        assert_eq!(short(200.0), "200");
        assert_eq!(short(1e-300), "1e-300");
        let long = "at most a.b[1] = 0.00000000000000000000012345678 s, [0.42261826174069944, 1.0], \"0.123456789012\" 123456789";
        let plain = "at most a.b[1] = 1.23457e-22 s, [0.422618, 1.0], \"0.123456789012\" 123456789";
        assert_eq!(with_short_numbers(long), plain);
    }

    #[test]
    fn what_rounds_to_zero_has_no_sign() {
        assert_eq!([-0.04, -0.0, 0.04].map(|value| fixed(value, 1)), ["0.0"; 3]);
        assert_eq!(
            (fixed(-0.06, 1), fixed(-0.4, 0), fixed(-10.0, 0)),
            ("-0.1".to_owned(), "0".to_owned(), "-10".to_owned())
        );
    }

    #[test]
    fn a_terminal_is_not_commanded() {
        assert_eq!(escaped("a\u{1b}[2J\u{7}\u{202e}\u{9b}é \"x\""), "a\\u{1b}[2J\\u{7}\\u{202e}\\u{9b}é \"x\"");
    }
}
