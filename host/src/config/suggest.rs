//! The key that was probably meant.

/// Longest name that is compared, in bytes.
const LONGEST_NAME: usize = 64;

/// The candidate that is nearest to a misspelt name, if one is near enough.
pub(super) fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Nobody mistypes a key into a page of text.
    if name.len() > LONGEST_NAME {
        return None;
    }
    let name: Vec<char> = name.to_lowercase().chars().collect();
    let most_changes = (name.len() / 3).max(1);
    candidates
        .into_iter()
        .map(|candidate| (changes(&name, &candidate.chars().collect::<Vec<_>>()), candidate))
        .filter(|(changes, _)| *changes <= most_changes)
        .min_by_key(|(changes, _)| *changes)
        .map(|(_, candidate)| candidate)
}

/// Levenshtein distance: letters to insert, remove or replace.
fn changes(a: &[char], b: &[char]) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_misspelt_key_and_nothing_far_fetched() {
        let keys = ["horizon", "sampling_time_s", "law"];
        assert_eq!(nearest("horizn", keys), Some("horizon"));
        assert_eq!(nearest("Horizon", keys), Some("horizon"));
        assert_eq!(nearest("sampling_time", keys), Some("sampling_time_s"));
        assert_eq!(nearest("priority", keys), None);
        assert_eq!(nearest("", keys), None);
    }

    #[test]
    fn counts_changed_letters() {
        let count = |a: &str, b: &str| changes(&a.chars().collect::<Vec<_>>(), &b.chars().collect::<Vec<_>>());
        assert_eq!(count("kitten", "sitting"), 3);
        assert_eq!(count("", "abc"), 3);
        assert_eq!(count("abc", "abc"), 0);
    }
}
