//! The page around the figures: for screens and phones, in light and in the dark.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::Path;

use plotters::style::RGBColor;

use super::chart::{Chart, GRID, INK, escape};
use super::figures::{COLORS, MATERIAL, MATERIAL_INK};

/// Widths of a figure in px: of its own file and on a screen, and on a phone.
const WIDE_PX: u32 = 860;
const NARROW_PX: u32 = 360;

pub(crate) const TAIL: &str = "</body>\n</html>\n";

/// A figure for screens is not drawn smaller than its letters bear: narrower pages have their own.
const STYLE: &str = "\
:root{color-scheme:light dark;--page:#fff;--ink:#222;--line:#bbb;--link:#0b5cad}
*{box-sizing:border-box}
body{font-family:Helvetica,Arial,'Liberation Sans',sans-serif;line-height:1.45;max-width:56rem;margin:2rem auto;padding:0 15px;\
background:var(--page);color:var(--ink);overflow-wrap:anywhere}
h1{font-size:1.6rem;line-height:1.2}
a{color:var(--link)}
table{border-collapse:collapse;width:100%;overflow-wrap:normal}
td,th{border:1px solid var(--line);padding:.3rem .5rem;text-align:right}
td:first-child,th:first-child{text-align:left}
figure{margin:2rem 0}
figcaption{margin-top:.3rem}
svg{display:block;max-width:100%;height:auto}
pre{white-space:pre-wrap}
.lead{font-size:1.15rem}
.narrow{display:none}
@media (max-width:760px){
.wide{display:none}
.narrow{display:block}
.rows thead{display:none}
.rows tr{display:block;margin-bottom:1rem;border:1px solid var(--line)}
.rows td{display:flex;justify-content:space-between;gap:1rem;border:0;white-space:nowrap}
.rows td:first-child{font-weight:bold}
.rows td:not(:first-child)::before{content:attr(data-name);text-align:left;white-space:normal}
}
";

/// Colours of the figures in the dark.
const DARK: [(RGBColor, &str); 4] =
    [(INK, "#E4E4E4"), (GRID, "#33393F"), (MATERIAL, "#2B2A26"), (MATERIAL_INK, "#A9A192")];

/// The beginning of a page up to its first element.
pub(crate) fn head(title: &str) -> String {
    let title = escape(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>\n{STYLE}{}</style>\n</head>\n<body>\n",
        dark()
    )
}

/// The figures have light colours of their own: what replaces them in the dark.
fn dark() -> String {
    let mut rules =
        "@media (prefers-color-scheme:dark){\n:root{--page:#15181c;--ink:#e4e4e4;--line:#4a5057;--link:#7db8f0}\n\
                     svg rect[fill=\"#FFFFFF\"]{fill:var(--page)}\nsvg[fill=\"#222222\"]{fill:#E4E4E4}\n"
            .to_owned();
    let mut replace = |attribute: &str, RGBColor(r, g, b): RGBColor, dark: &str| {
        let _ = writeln!(rules, "svg [{attribute}=\"#{r:02X}{g:02X}{b:02X}\"]{{{attribute}:{dark}}}");
    };
    for (light, dark) in DARK {
        replace("fill", light, dark);
        replace("stroke", light, dark);
    }
    // Bands of a timeline have the same colours, and light letters on them.
    COLORS.into_iter().for_each(|(light, dark)| replace("stroke", light, dark));
    rules + "}\n"
}

/// Writes a figure of its own, and returns it for the page.
pub(crate) fn figure(directory: &Path, name: &str, caption: &str, chart: &Chart) -> io::Result<String> {
    let draw = |width_px| chart.of_width(width_px).svg().map_err(io::Error::other);
    figure_of(directory, name, caption, draw)
}

/// The same for what `draw` draws in a width in px.
pub(super) fn figure_of(
    directory: &Path,
    name: &str,
    caption: &str,
    draw: impl Fn(u32) -> io::Result<String>,
) -> io::Result<String> {
    let wide = draw(WIDE_PX)?;
    fs::write(directory.join(format!("{name}.svg")), &wide)?;
    Ok(format!(
        "<figure>\n<div class=\"wide\">{wide}</div>\n<div class=\"narrow\">{}</div>\n<figcaption>{}</figcaption>\n</figure>\n",
        draw(NARROW_PX)?,
        escape(caption)
    ))
}

/// A row of cells.
pub(super) fn table_row(cells: &[String], tag: &str) -> String {
    let cells: String = cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect();
    format!("<tr>{cells}</tr>\n")
}

/// A table that a phone shows as a list for each of its rows.
pub(crate) fn table(names: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let head = table_row(&names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>(), "th");
    let row = |cells: Vec<String>| {
        let cell = |(name, cell): (&&str, &String)| format!("<td data-name=\"{}\">{}</td>", escape(name), escape(cell));
        format!("<tr>{}</tr>\n", names.iter().zip(&cells).map(cell).collect::<String>())
    };
    format!(
        "<table class=\"rows\">\n<thead>{head}</thead>\n<tbody>{}</tbody></table>\n",
        rows.map(row).collect::<String>()
    )
}
