//! The colours and lines of all charts, light and dark.

/// Lines and areas by class.
pub const STYLE: &str = "\
svg.chart{font:13px system-ui,sans-serif;fill:var(--ink)}\
.chart .frame{fill:none;stroke:var(--line)}.chart .grid{stroke:var(--grid);stroke-width:1;vector-effect:non-scaling-stroke}\
.chart path{fill:none;stroke-width:1.3;vector-effect:non-scaling-stroke;stroke-linejoin:round}\
.chart .dots{stroke-linecap:round;stroke-width:3;opacity:.55}.chart .bars{stroke:none;opacity:.8}\
.c1{stroke:var(--c1)}.c2{stroke:var(--c2)}.c3{stroke:var(--c3)}.c4{stroke:var(--c4)}.c5{stroke:var(--c5)}.c6{stroke:var(--c6)}\
.bars.c1{fill:var(--c1)}.bars.c2{fill:var(--c2)}.bars.c3{fill:var(--c3)}.bars.c4{fill:var(--c4)}.bars.c5{fill:var(--c5)}.bars.c6{fill:var(--c6)}\
.chart .limit{stroke:var(--bad);stroke-dasharray:5 4;vector-effect:non-scaling-stroke}.chart .paper{fill:var(--paper)}\
.chart .s1{fill:var(--s1)}.chart .s2{fill:var(--s2)}";

/// Widths of lines that are drawn in tenths of a unit, where they are scaled with what they belong to.
pub(super) const UNSCALED: &str = "\
.chart path[transform]{stroke-width:13;vector-effect:none}.chart path.dots[transform]{stroke-width:30}";

/// The colours by name, for the root of a page.
pub const COLOURS: &str = "\
:root{--ink:#1b2430;--paper:#ffffff;--line:#9aa5b1;--grid:#e4e8ec;--muted:#5d6975;--bad:#b3261e;--good:#1b7f4b;\
--c1:#5d6975;--c2:#0b62a8;--c3:#c2410c;--c4:#1b7f4b;--c5:#7b3fa0;--c6:#8a6d00;--s1:#fff3d6;--s2:#fbdcd8}\
@media(prefers-color-scheme:dark){:root{--ink:#e6eaee;--paper:#14181d;--line:#5b6672;--grid:#2a313a;--muted:#9aa5b1;--bad:#ff8a80;--good:#6fd39b;\
--c1:#a9b4bf;--c2:#6cb4f0;--c3:#ff9d66;--c4:#6fd39b;--c5:#c79be6;--c6:#e0c24d;--s1:#3a3218;--s2:#43211f}}\
@media print{:root{--ink:#000000;--paper:#ffffff;--line:#777777;--grid:#dddddd;--muted:#444444;--bad:#b3261e;--good:#1b7f4b;\
--c1:#5d6975;--c2:#0b62a8;--c3:#c2410c;--c4:#1b7f4b;--c5:#7b3fa0;--c6:#8a6d00;--s1:#fff3d6;--s2:#fbdcd8}}";

/// The classes of several lines of one picture, in the order in which they are taken.
pub(crate) const LINES: [&str; 6] = ["c2", "c3", "c4", "c5", "c6", "c1"];

/// The light colour of a name such as `c2`, as six hexadecimal digits.
fn code(name: &str) -> Option<&'static str> {
    let (_, after) = COLOURS.split_once(&format!("--{name}:#"))?;
    after.get(..6)
}

/// A style with the light colours in place of their names.
pub(super) fn in_light(style: &str) -> String {
    let mut parts = style.split("var(--");
    let mut light = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, after) = part.split_once(')').unwrap_or((part, ""));
        light.push('#');
        light.push_str(code(name).unwrap_or("000000"));
        light.push_str(after);
    }
    light
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_style_in_light_names_every_colour_by_its_digits() {
        assert_eq!(
            in_light("a{fill:var(--ink)}b{stroke:var(--c2);x:1}"),
            "a{fill:#1b2430}b{stroke:#0b62a8;x:1}"
        );
        let style = in_light(STYLE);
        assert!(
            !style.contains("var(") && !style.contains("#000000"),
            "{style}"
        );
    }
}
