//! The XML of a URDF, within bounds: what is too large, too deep or could grow while it is read is
//! refused before anything looks at it.

use std::fmt;

use admittance_host::config;
use roxmltree::{Document, Node, ParsingOptions};

use super::document::is_kept;

/// Largest URDF in bytes: twenty times the largest that is known.
pub(crate) const LARGEST_URDF: u64 = 4 << 20;
/// Most elements, texts and comments: a humanoid with hands has some thousand.
const MOST_NODES: u32 = 100_000;
/// Deepest nesting: a link's mesh is five deep.
const DEEPEST: usize = 64;
/// Longest tag in bytes, with its attributes, each of which is compared with all others.
const LONGEST_TAG: usize = 4096;
/// Most declarations of namespaces, which every element within them has.
const MOST_NAMESPACES: usize = 64;
/// Longest name that a message quotes, in characters.
const LONGEST_SHOWN: usize = 60;

/// Why a URDF is not imported, and in which line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refused {
    line: Option<u32>,
    why: String,
}

impl Refused {
    pub(super) fn new(line: Option<u32>, why: impl Into<String>) -> Self {
        Self { line, why: why.into() }
    }

    /// With the file that it is about.
    pub(super) fn of(&self, file: &str) -> String {
        let line = self.line.map(|line| format!(":{line}")).unwrap_or_default();
        format!("{file}{line}: {}", self.why)
    }
}

/// A name as messages quote it: short, and without what a terminal acts on.
pub(super) struct Shown<'a>(pub(super) &'a str);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let short: String = self.0.chars().take(LONGEST_SHOWN).collect();
        let more = if short.len() < self.0.len() { "…" } else { "" };
        write!(f, "\"{}{more}\"", config::escaped(&short))
    }
}

/// Where an element begins, from 1: for an error, since it is counted from the beginning.
pub(super) fn line_of(node: Node<'_, '_>) -> Option<u32> {
    Some(node.document().text_pos_at(node.range().start).row)
}

/// The elements of a text of [`LARGEST_URDF`] at most.
pub(super) fn parsed(text: &str) -> Result<Document<'_>, Refused> {
    has_no_long_tags(text)?;
    if text.matches("xmlns").nth(MOST_NAMESPACES).is_some() {
        let why = format!("it declares more than {MOST_NAMESPACES} namespaces; accepted: a URDF, which needs none");
        return Err(Refused::new(None, why));
    }
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| refused(&error))?;
    is_not_deep(&document)?;
    is_not_xacro(&document)?;
    Ok(document)
}

/// What the parser would take long for. It says itself what is no XML.
fn has_no_long_tags(text: &str) -> Result<(), Refused> {
    let mut rest = text;
    while let Some(begin) = rest.find('<') {
        rest = &rest[begin..];
        let end = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")]
            .into_iter()
            .find(|(start, _)| rest.starts_with(start));
        let length = match end {
            Some((_, end)) => rest.find(end),
            None => {
                let mut quote = None;
                rest.bytes().position(|byte| {
                    match (quote, byte) {
                        (None, b'"' | b'\'') => quote = Some(byte),
                        (Some(open), byte) if open == byte => quote = None,
                        _ => {}
                    }
                    quote.is_none() && byte == b'>'
                })
            }
        };
        let length = length.unwrap_or(rest.len());
        if end.is_none() && length > LONGEST_TAG {
            let line = text[..text.len() - rest.len()].matches('\n').count() + 1;
            let why = format!("a tag of more than {LONGEST_TAG} bytes; accepted: a URDF");
            return Err(Refused::new(u32::try_from(line).ok(), why));
        }
        // What closes it is ASCII, of one byte at least.
        rest = rest.get(length + 1..).unwrap_or_default();
    }
    Ok(())
}

fn refused(error: &roxmltree::Error) -> Refused {
    use roxmltree::Error;
    let why = match error {
        Error::DtdDetected => {
            "it has a <!DOCTYPE>, whose entities may grow without end; accepted: a URDF without one".to_owned()
        }
        Error::NodesLimitReached => {
            format!("it has more than {MOST_NODES} elements, texts and comments; accepted: the URDF of one robot")
        }
        Error::UnknownNamespace(prefix, _) if prefix.contains("xacro") => return xacro(Some(error.pos().row)),
        // The position is in front already.
        other => format!("it is not XML: {}; accepted: a URDF", config::escaped(&other.to_string())),
    };
    let line = match error {
        Error::DtdDetected | Error::NodesLimitReached => None,
        other => Some(other.pos().row),
    };
    Refused::new(line, why)
}

fn is_not_deep(document: &Document<'_>) -> Result<(), Refused> {
    // A parent comes before its children, and nodes are numbered as they come.
    let mut depths: Vec<usize> = Vec::new();
    for node in document.root().descendants() {
        let above = node.parent().and_then(|parent| depths.get(parent.id().get_usize()).copied());
        let depth = above.map_or(0, |above| above + 1);
        if depth > DEEPEST {
            let why = format!("its elements are nested more than {DEEPEST} deep; accepted: a URDF");
            return Err(Refused::new(line_of(node), why));
        }
        depths.push(depth);
    }
    Ok(())
}

/// The namespace may be declared: what xacro writes keeps the declaration. And what is not looked at may
/// hold anything: a plugin of a simulator has variables of its own.
fn is_not_xacro(document: &Document<'_>) -> Result<(), Refused> {
    let is_of_xacro = |node: &Node<'_, '_>| {
        let names = node.attributes().map(|attribute| attribute.namespace()).chain([node.tag_name().namespace()]);
        let is_xacros = |name: &str| name.contains("xacro") || node.lookup_prefix(name) == Some("xacro");
        names.flatten().any(is_xacros)
            || node.attributes().any(|attribute| attribute.value().contains("${")) && is_kept(*node)
    };
    match document.root().descendants().find(is_of_xacro) {
        Some(node) => Err(xacro(line_of(node))),
        None => Ok(()),
    }
}

fn xacro(line: Option<u32>) -> Refused {
    Refused::new(line, "it is a xacro, which has to be expanded first: xacro FILE >ARM.urdf; accepted: a URDF")
}
