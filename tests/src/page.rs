//! Pages of the project, for tests that do what they say.

/// The commands of a section (its heading's text and a line break) of a page.
///
/// # Panics
/// When the page has no such section.
pub fn commands(page: &str, section: &str) -> Vec<String> {
    let text = page.split("\n## ").find_map(|text| text.strip_prefix(section)).expect("the page has the section");
    let fenced = text.split("```sh\n").skip(1).filter_map(|text| text.split("```").next());
    fenced.flat_map(str::lines).filter(|line| !line.is_empty()).map(str::to_owned).collect()
}
