//! A form for `--time-format` that fits cells which none of the known forms does.

use athermal_core::time::TimeFormat;

/// Cells that a form is tried on, at most.
const TRIED: usize = 500;
/// Parts of a cell, at most; beyond, it is no date.
const MOST_PARTS: usize = 24;

/// The form of which most of the cells are, and under which their steps are the most alike; none where none reads nine of ten, or
/// where they do not advance.
pub(super) fn fitting(cells: &[String]) -> Option<TimeFormat> {
    let cells = &cells[..cells.len().min(TRIED)];
    let first = cells.first()?;
    let mut forms = Vec::new();
    extend(&parts(first)?, first, &mut String::new(), &mut forms);
    let scored = forms.into_iter().filter(|form| is_usual(form));
    let scored = scored.filter_map(|form| {
        let format: TimeFormat = form.parse().ok()?;
        format.read(first.as_bytes())?;
        Some((alike(&format, cells)?, format))
    });
    let (mut best, mut most) = (None, 0);
    for (score, format) in scored {
        if score > most {
            (best, most) = (Some(format), score);
        }
    }
    best
}

/// Whether nothing stands there twice, minutes behind hours, and seconds behind minutes.
fn is_usual(form: &str) -> bool {
    let letters = form.split('%').skip(1).filter_map(|of| of.chars().next());
    let letters: Vec<char> = letters.collect();
    let place = |of: &[char]| letters.iter().position(|letter| of.contains(letter));
    let [hour, minute, second] = [&['H', 'I'][..], &['M'], &['S']].map(place);
    let follows = |of: Option<usize>, before: Option<usize>| before.map(|at| at + 1) == of;
    let twice = |of: &&str| {
        letters
            .iter()
            .filter(|&&letter| of.contains(letter))
            .count()
            > 1
    };
    let is_once = !["YyG", "mbBV", "du"].iter().any(twice);
    // ISO 8601 writes weeks so.
    let is_week =
        form.contains("W%") == form.contains("%V") && form.contains("W%V") == form.contains("W%");
    is_once && is_week && follows(minute, hour) && (second.is_none() || follows(second, minute))
}

/// How many of the steps between cells are the usual one.
fn alike(format: &TimeFormat, cells: &[String]) -> Option<usize> {
    let read: Vec<i128> = cells
        .iter()
        .filter_map(|of| format.read(of.as_bytes()))
        .collect();
    let mut steps: Vec<i128> = read.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let forward = steps.iter().filter(|step| **step >= 0).count();
    if read.len() * 10 < cells.len() * 9 || forward * 100 < steps.len() * 95 {
        return None;
    }
    steps.retain(|step| *step > 0);
    steps.sort_unstable();
    let usual = *steps.get(steps.len() / 2)?;
    Some(steps.iter().filter(|step| **step == usual).count())
}

/// Runs of digits and of letters, and each other character.
fn parts(cell: &str) -> Option<Vec<&str>> {
    let kind = |of: char| match of {
        of if of.is_ascii_digit() => 0,
        of if of.is_alphabetic() => 1,
        _ => 2,
    };
    let (mut parts, mut from) = (Vec::new(), 0);
    let mut before = None;
    for (at, of) in cell.char_indices() {
        if before.is_some_and(|before| before != kind(of) || before == 2) {
            parts.push(&cell[from..at]);
            from = at;
        }
        before = Some(kind(of));
    }
    parts.push(&cell[from..]);
    (parts.len() <= MOST_PARTS).then_some(parts)
}

/// What a part may stand for.
fn meanings(part: &str, has_half: bool) -> Vec<String> {
    let literal = || vec![part.replace('%', "%%")];
    if part.starts_with(|of: char| of.is_ascii_digit()) {
        let all: &[&str] = match part.len() {
            1 | 2 if has_half => &["%d", "%m", "%y", "%I", "%M", "%S"],
            1 | 2 => &["%d", "%m", "%y", "%H", "%M", "%S", "%V", "%u"],
            4 => &["%Y", "%H%M", "%G"],
            6 => &["%y%m%d", "%d%m%y", "%H%M%S"],
            8 => &["%Y%m%d", "%d%m%Y", "%m%d%Y"],
            12 => &["%Y%m%d%H%M", "%y%m%d%H%M%S"],
            14 => &["%Y%m%d%H%M%S"],
            _ => &[],
        };
        return all.iter().map(|&of| of.to_owned()).collect();
    }
    match part.to_ascii_lowercase().as_str() {
        "am" | "pm" => vec!["%p".to_owned()],
        name if is_name(name, &MONTHS) => ["%b", "%B"].map(str::to_owned).to_vec(),
        name if is_name(name, &DAYS) => ["%a", "%A"].map(str::to_owned).to_vec(),
        _ => literal(),
    }
}

const MONTHS: [&str; 12] = [
    "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
];
const DAYS: [&str; 7] = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"];

fn is_name(part: &str, names: &[&str]) -> bool {
    names.iter().any(|name| part.starts_with(name))
}

/// All forms of the rest of a cell behind what stands for its beginning, no part of a time twice.
fn extend(parts: &[&str], cell: &str, begin: &mut String, forms: &mut Vec<String>) {
    let Some((part, rest)) = parts.split_first() else {
        forms.push(begin.clone());
        return;
    };
    let length = begin.len();
    let lower = cell.to_ascii_lowercase();
    let has_half = lower.contains("am") || lower.contains("pm");
    for meaning in meanings(part, has_half) {
        let letters = meaning
            .split('%')
            .skip(1)
            .filter_map(|of| of.chars().next());
        let mut is_new = letters.map(|of| !begin.contains(&format!("%{of}")));
        if is_new.all(|is| is) || !meaning.contains('%') {
            begin.push_str(&meaning);
            extend(rest, cell, begin, forms);
            begin.truncate(length);
        }
    }
    // Fractions of a second.
    let is_fraction = part == &"." && begin.ends_with("%S") && !rest.is_empty();
    if is_fraction && rest[0].starts_with(|of: char| of.is_ascii_digit()) {
        begin.push_str("%.f");
        extend(&rest[1..], cell, begin, forms);
        begin.truncate(length);
    }
}

#[cfg(test)]
mod tests {
    use super::fitting;

    #[test]
    fn a_form_that_fits_is_found_or_there_is_none() {
        for (form, cell) in [
            ("%Y.%m.%d-%H.%M.%S", Some("2026.03.28-06.00.00")),
            ("%m/%d/%Y at %I.%M %p", Some("03/28/2026 at 06.00 AM")),
            ("%d/%m/%y@%H%M", Some("28/03/26@0600")),
            ("D%y%m%dT%H%M%S", Some("D260328T060000")),
            ("%G-W%V-%u %H:%M", Some("2026-W13-6 06:00")),
            ("%Y年%m月%d日 %H:%M", Some("2026年03月28日 06:00")),
            (
                "[%a %d %b %Y|%H:%M:%S%.3f]",
                Some("[Sat 28 Mar 2026|06:00:00.000]"),
            ),
            ("%d mars %Y à %H h %M", None),
            ("%d.III.%Y kl. %H", None),
            ("minute %M of %H", None),
        ] {
            let start = jiff::civil::date(2026, 3, 28).at(6, 0, 0, 0);
            let times = (0..400).map(|minute| start + jiff::Span::new().minutes(minute));
            let cells: Vec<String> = times.map(|at| at.strftime(form).to_string()).collect();
            let found = fitting(&cells).map(|of| of.as_str().to_owned());
            let Some(cell) = cell else {
                assert_eq!(found, None, "{form}");
                continue;
            };
            assert_eq!(cells[0], cell);
            assert_eq!(found.as_deref(), Some(form.replace("%.3f", "%.f").as_str()));
        }
    }
}
