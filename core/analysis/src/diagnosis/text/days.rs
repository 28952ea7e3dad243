//! Fits on some days, scored on others, as tables for a terminal.

use crate::diagnosis::day::{CurvePoint, DayScore, Days, ENOUGH};
use crate::figures::{counted, matrix, number, rounded};

/// On how many days a fit comes near those on all others, of all predictions shown; none where on all of them only.
#[must_use]
pub fn enough(days: &Days, shown: &[&str]) -> Option<usize> {
    let near = |point: &CurvePoint| {
        let scores = point.scores.iter();
        let mut of_shown = scores.filter(|score| shown.contains(&score.prediction.as_str()));
        of_shown.all(|score| score.ratio().is_none_or(|ratio| ratio <= ENOUGH))
    };
    let last_far = days.curve.iter().rposition(|point| !near(point));
    let first_near = days.curve.get(last_far.map_or(0, |last| last + 1))?;
    (first_near.days < days.count - 1).then_some(first_near.days)
}

/// The error of a fit on all other days, marked where it is above that of no model.
fn left_by_others(score: &DayScore) -> Option<String> {
    let rmse = score.rmse?;
    let worse = score.zero.is_some_and(|zero| rmse > zero);
    Some(format!("{}{}", if worse { "!" } else { "" }, number(rmse)))
}

/// The tables of predictions of one unit.
#[must_use]
pub fn days(of: &Days, unit: &str, shown: &[&str]) -> String {
    let enough = enough(of, shown);
    let shown: Vec<String> = shown.iter().map(|&name| name.to_owned()).collect();
    let cells = |scores: &[DayScore], cell: fn(&DayScore) -> Option<String>| -> Vec<String> {
        let score_of = |name: &String| scores.iter().find(|score| score.prediction == *name);
        let texts = shown.iter().map(|name| score_of(name).and_then(cell));
        texts
            .map(|text| text.unwrap_or_else(|| "-".to_owned()))
            .collect()
    };
    let left_out = of.left_out.iter().flat_map(|left_out| {
        let no_model = cells(&left_out.scores, |score| score.zero.map(number));
        [
            (
                format!("day {}", left_out.day),
                cells(&left_out.scores, left_by_others),
            ),
            ("  no model".to_owned(), no_model),
        ]
    });
    let scores = of.curve.iter().flat_map(|point| &point.scores);
    let mut of_shown = scores.filter(|score| shown.contains(&score.prediction));
    let compares = of_shown.any(|score| score.ratio().is_some());
    let curve = of.curve.iter().map(|point| {
        let (days, fits) = (point.days as u64, point.fits as u64);
        let label = format!("{} ({})", counted(days, "day"), counted(fits, "fit"));
        (
            label,
            cells(&point.scores, |score| score.ratio().map(number)),
        )
    });
    let (left_out, curve): (Vec<_>, Vec<_>) = (left_out.collect(), curve.collect());
    let most = of.count - 1;
    let verdict = match enough {
        _ if most == 1 => "two are too few",
        _ if !compares => "nothing to compare",
        Some(enough) => {
            let days = counted(enough as u64, "day");
            let verb = if enough == 1 { "is" } else { "are" };
            &format!("{days} {verb} enough to come within 5 % of {most}")
        }
        None => "more days may still make it better",
    };
    let of_day = if of.day_s == 86_400.0 {
        String::new()
    } else {
        format!(" of {}", rounded(of.day_s))
    };
    let curve = match most {
        1 => String::new(),
        _ => format!(
            "RMSE of fits on so many days in a row, 1 being that of fits on {most} days, on the\n\
             same days, which no fit has seen\n{}",
            matrix("fitted on", &shown, &curve)
        ),
    };
    format!(
        "RMSE in {unit} of each day{of_day}, predicted by a fit on all others;\n\
         ! worse than no model\n{}\
         how many days are needed: {verdict}\n{curve}",
        matrix("left out", &shown, &left_out)
    )
}

#[cfg(test)]
mod tests {
    use crate::diagnosis::day::LeftOut;

    use super::*;

    #[test]
    fn a_day_that_is_predicted_worse_than_by_no_model_is_marked_and_no_model_stands_below() {
        let score = |rmse: f64| DayScore {
            prediction: "vote.Z".to_owned(),
            n: 100,
            rmse: Some(rmse),
            all_others: Some(rmse),
            zero: Some(4.0),
        };
        let day = |day: usize, rmse: f64| LeftOut {
            day,
            from_s: 0.0,
            scores: vec![score(rmse)],
            dropped: Vec::new(),
        };
        let days = Days {
            day_s: 86_400.0,
            count: 2,
            left_out: vec![day(1, 3.0), day(2, 5.0)],
            curve: Vec::new(),
        };
        let table = super::days(&days, "nm/min", &["vote.Z"]);
        let cells = table.lines().map(|line| line.split_whitespace().last());
        let cells: Vec<&str> = cells.flatten().collect();
        assert_eq!(
            cells[2..7],
            ["vote.Z", "3.00", "4.00", "!5.00", "4.00"],
            "{table}"
        );
        assert!(table.contains("! worse than no"), "{table}");
    }
}
