//! Keys of a TOML text, changed in place: comments and order stay.

/// The text with a key of a section set; both are added where they are not there.
pub(super) fn with_key(text: &str, section: &str, key: &str, value: &str) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    let header =
        lines.iter().position(|line| line.split('#').next().is_some_and(|line| line.trim() == format!("[{section}]")));
    let Some(header) = header else {
        return format!("{}\n\n[{section}]\n{key} = {value}\n", text.trim_end());
    };
    let new = format!("{key} = {value}");
    let is_key = |line: &str| line.split_once('=').is_some_and(|(name, _)| name.trim() == key);
    // From value to value: a list of lists has lines that begin as sections do.
    let mut at = header + 1;
    while at < lines.len() && !lines[at].trim_start().starts_with('[') {
        let length = length(&lines[at..]);
        if is_key(lines[at]) {
            lines.splice(at..at + length, [new.as_str()]);
            return lines.join("\n") + "\n";
        }
        at += length;
    }
    lines.insert(header + 1, &new);
    lines.join("\n") + "\n"
}

/// How many lines the value takes that begins on the first: a list may take several.
fn length(lines: &[&str]) -> usize {
    let mut open = 0;
    for (number, line) in lines.iter().enumerate() {
        let code = line.split('#').next().unwrap_or_default();
        open += code.matches('[').count();
        open -= code.matches(']').count().min(open);
        if open == 0 {
            return number + 1;
        }
    }
    lines.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_changed_where_it_is_and_added_where_it_is_not() {
        let text = "[a]   # first\nx = 1\nlist = [1,\n  2, # two\n]\n\n[[a.b]]\nx = 2\n";
        assert_eq!(with_key(text, "a", "x", "7"), text.replacen("x = 1", "x = 7", 1));
        assert_eq!(with_key(text, "a", "list", "[3]"), text.replacen("[1,\n  2, # two\n]", "[3]", 1));
        assert_eq!(with_key(text, "a", "y", "4"), text.replacen("x = 1", "y = 4\nx = 1", 1));
        assert_eq!(with_key(text, "a.c", "y", "4"), format!("{text}\n[a.c]\ny = 4\n"));
        let lists = "[a]\nlists = [\n[1, 2],\n[3],\n]\nx = 1\n";
        assert_eq!(with_key(lists, "a", "x", "7"), lists.replacen("x = 1", "x = 7", 1));
    }
}
