//! A comparison as tables for a terminal.

use athermal_analysis::diagnosis::comparison::{BLOCKS, Column, Comparison};
use athermal_run::score::Mode;

use athermal_analysis::figures::{count, counted, digits, matrix, number, or_dash, stated};

/// A difference of fewer standard errors may be chance.
const SURE: f64 = 2.0;

/// A table, with the names of graphs where there are several.
pub(super) fn describe(comparison: &Comparison, mode: Mode, several: bool, spans: bool) -> String {
    let columns: Vec<String> = comparison.truths.iter().map(|of| of.name.clone()).collect();
    let all = |of: fn(&Column) -> String| comparison.truths.iter().map(of).collect();
    let mut rows: Vec<(String, Vec<String>)> = vec![
        (
            no_model(comparison),
            all(|truth| or_dash(truth.baseline_zero)),
        ),
        ("persistence".to_owned(), all(persistence)),
    ];
    let mut graph = None;
    for (nth, row) in comparison.rows.iter().enumerate() {
        if several && graph.replace(&row.graph) != Some(&row.graph) {
            rows.push((row.graph.clone(), vec![String::new(); columns.len()]));
        }
        let truths = comparison.truths.iter().enumerate();
        let cells = truths.map(|(column, truth)| cell(comparison, nth, column, truth));
        let indent = if several { "  " } else { "" };
        let label = format!("{indent}{} ({})", row.label(), row.kind);
        rows.push((label, cells.collect()));
    }
    heading(comparison, mode, spans) + &matrix("", &columns, &rows)
}

/// What no model is called: of levels it is their mean.
fn no_model(comparison: &Comparison) -> String {
    let mut remarks = comparison.truths.iter().map(|of| of.no_model_is.remark());
    let first = remarks.next().unwrap_or_default();
    let remark = if remarks.all(|remark| remark == first) {
        first
    } else {
        ""
    };
    format!("no model{remark}")
}

/// The error of persistence, with the number of instants where these are few.
fn persistence(truth: &Column) -> String {
    let error = or_dash(truth.baseline_persistence);
    match truth.persistence_on_few() {
        Some(few) => format!("{error} @{}", count(few as u64)),
        None => error,
    }
}

/// Whether another table is of the same unit and horizon, and so of truths over another span.
pub(super) fn is_one_of_several(comparison: &Comparison, all: &[Comparison]) -> bool {
    let heads = |of: &Comparison| of.unit == comparison.unit && of.ahead_s == comparison.ahead_s;
    all.iter().filter(|of| heads(of)).count() > 1
}

/// What stands above a table; the span of the truths where other tables differ in nothing else.
fn heading(comparison: &Comparison, mode: Mode, spans: bool) -> String {
    let counts = comparison.truths.iter().map(|truth| truth.n as u64);
    let (fewest, most) = (counts.clone().min(), counts.max());
    let instants = match (fewest, most) {
        (Some(fewest), Some(most)) if fewest != most => {
            format!("{} to {}", count(fewest), counted(most, "instant"))
        }
        (_, most) => counted(most.unwrap_or(0), "instant"),
    };
    let few = 2 * BLOCKS;
    let few = match fewest {
        Some(fewest) if fewest < few as u64 => {
            format!("fewer than {few} instants give no ±: which is best may be chance\n")
        }
        _ => String::new(),
    };
    let mut own = comparison.rows.iter().flat_map(|row| &row.own);
    let lasting = |truth: &Column| truth.persistence_on_few().is_some();
    let own = if own.any(Option::is_some) || comparison.truths.iter().any(lasting) {
        "@ valid at so few instants that it is scored on these alone, and compared with none\n"
    } else {
        ""
    };
    let ahead = stated(comparison.ahead_s);
    // In other modes it is not how far ahead of measured truths was predicted.
    let (ahead, then) = match mode {
        Mode::OneStep => (format!(", {ahead} ahead"), ' '),
        Mode::Steps(_) | Mode::FreeRun => (format!(" of what looks {ahead} ahead"), '\n'),
    };
    let (span, then) = match comparison.span_s {
        _ if !spans => (String::new(), then),
        0.0 => (" of truths at an instant".to_owned(), '\n'),
        span_s => (format!(" of truths over {}", stated(span_s)), '\n'),
    };
    format!(
        "RMSE in {}{span}{ahead}, {instants};{then}* best, ! worse than no model\n\
         ± standard error of the difference to the best; ~ that may be chance\n{few}{own}",
        comparison.unit
    )
}

/// The error of a row, and how sure it is that it differs from the best.
fn cell(comparison: &Comparison, row: usize, column: usize, truth: &Column) -> String {
    let of = |row: usize| comparison.rows[row].rmse[column];
    let Some(rmse) = of(row) else {
        return "-".to_owned();
    };
    let own = comparison.rows[row].own[column];
    let no_model = own.map_or(truth.baseline_zero, |own| own.baseline_zero);
    let worse = no_model.is_some_and(|zero| rmse > zero);
    let worse = if worse { "!" } else { "" };
    if let Some(own) = own {
        return format!("{worse}{} @{}", number(rmse), count(own.n as u64));
    }
    if truth.best == Some(row) {
        return format!("*{worse}{}", number(rmse));
    }
    let best = truth.best.and_then(of).unwrap_or(rmse);
    match comparison.rows[row].difference_error[column] {
        Some(error) => {
            let chance = if rmse - best <= SURE * error { "~" } else { "" };
            format!("{chance}{worse}{} ±{}", number(rmse), digits(error, 2))
        }
        None => format!("{worse}{}", number(rmse)),
    }
}

#[cfg(test)]
mod tests {
    use athermal_analysis::diagnosis::comparison::Row;

    use super::*;

    fn one_row(count: usize, rmse: f64) -> Comparison {
        Comparison {
            ahead_s: 0.0,
            span_s: 0.0,
            unit: "nm".to_owned(),
            truths: vec![Column {
                truth: "drift.Z".to_owned(),
                name: "Z".to_owned(),
                n: count,
                left_out: None,
                no_model: Some(0.0),
                no_model_is: athermal_run::score::NoModel::Zero,
                baseline_zero: Some(2.39),
                baseline_persistence: None,
                persistence_n: 0,
                best: Some(0),
                otherwise: Vec::new(),
            }],
            rows: vec![Row {
                channel: None,
                graph: "a".to_owned(),
                node: "vote".to_owned(),
                kind: "mean",
                rmse: vec![Some(rmse)],
                own: vec![None],
                difference_error: vec![None],
                valid: vec![Some(1.0)],
            }],
        }
    }

    #[test]
    fn the_best_row_may_be_worse_than_no_model() {
        assert!(describe(&one_row(100, 8.49), Mode::OneStep, false, false).contains(" *!8.49"));
        assert!(describe(&one_row(100, 2.0), Mode::OneStep, false, false).contains(" *2.00"));
    }

    #[test]
    fn with_few_instants_it_is_said_that_the_best_may_be_chance() {
        assert!(
            describe(&one_row(19, 2.0), Mode::OneStep, false, false).contains("best may be chance")
        );
        assert!(
            !describe(&one_row(20, 2.0), Mode::OneStep, false, false)
                .contains("best may be chance")
        );
    }

    #[test]
    fn what_is_scored_on_instants_of_its_own_is_neither_best_nor_set_against_those_of_others() {
        let mut seldom = one_row(100, 2.5);
        seldom.truths[0].best = None;
        seldom.rows[0].own[0] = Some(athermal_analysis::diagnosis::comparison::Own {
            n: 40,
            baseline_zero: Some(2.6),
        });
        let text = describe(&seldom, Mode::OneStep, false, false);
        assert!(text.contains(" 2.50 @40"), "{text}");
        assert!(text.contains("@ valid at so few instants"), "{text}");
    }

    #[test]
    fn persistence_that_is_there_at_few_instants_is_told_with_their_number() {
        let persistence = |n: usize| {
            let mut of = one_row(100, 2.0);
            of.truths[0].baseline_persistence = Some(1.5);
            of.truths[0].persistence_n = n;
            describe(&of, Mode::OneStep, false, false)
        };
        let (few, all) = (persistence(40), persistence(99));
        assert!(
            few.contains(" 1.50 @40") && few.contains("@ valid at so few"),
            "{few}"
        );
        assert!(all.contains(" 1.50\n") && !all.contains('@'), "{all}");
    }

    #[test]
    fn of_several_graphs_each_row_stands_below_the_name_of_its_own() {
        let text = describe(&one_row(100, 2.0), Mode::OneStep, true, false);
        let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
        let at = lines.iter().position(|line| *line == "  a").unwrap();
        assert!(lines[at + 1].starts_with("    vote (mean)"), "{text}");
    }

    #[test]
    fn tables_that_differ_in_the_span_of_their_truths_alone_tell_it() {
        let table = |span_s: f64, ahead_s: f64| Comparison {
            span_s,
            ahead_s,
            ..one_row(100, 2.0)
        };
        let all = [table(300.0, 60.0), table(1800.0, 60.0), table(0.0, 120.0)];
        let text = all.each_ref().map(|of| {
            let text = describe(of, Mode::OneStep, false, is_one_of_several(of, &all));
            text.lines().next().unwrap().to_owned()
        });
        let expected = [
            "RMSE in nm of truths over 5min, 1min ahead, 100 instants;",
            "RMSE in nm of truths over 30min, 1min ahead, 100 instants;",
            "RMSE in nm, 2min ahead, 100 instants; * best, ! worse than no model",
        ];
        assert_eq!(text, expected);
    }

    #[test]
    fn a_single_instant_is_no_plural() {
        assert!(
            describe(&one_row(1, 2.0), Mode::OneStep, false, false).contains("ahead, 1 instant; *")
        );
        assert!(
            describe(&one_row(2, 2.0), Mode::OneStep, false, false)
                .contains("ahead, 2 instants; *")
        );
    }
}
