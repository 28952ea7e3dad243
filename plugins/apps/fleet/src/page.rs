//! What stands on the page about a fleet, and in which order.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use athermal_analysis::chart::{COLOURS, Chart, Layer, Mark, STYLE};
use athermal_analysis::figures::{count, counted, number, or_dash};
use athermal_analysis::markup::escaped;
use athermal_run::model::{Card, Model};

use crate::doubts::Doubt;
use crate::figure::{Relative, Standing};
use crate::unlike::{Comparison, Member, picture};

/// So many machines are among the worst.
const WORST: usize = 10;
/// So many machines have all that is known of them on the page.
const DETAILED: usize = 1000;
/// So many departures of a machine are shown.
const DEPARTURES: usize = 8;

const LAYOUT: &str = "\
body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);max-width:1100px;margin:0 auto;padding:1rem}\
h1{font-size:1.6rem;margin:.2rem 0}h2{font-size:1.2rem;margin:2rem 0 .4rem;border-bottom:1px solid var(--grid)}\
p,ul{margin:.4rem 0}ul{padding-left:1.2rem}.muted{color:var(--muted);font-size:.9rem}.bad{color:var(--bad)}\
.wide{overflow-x:auto}.wide svg.chart{min-width:620px;width:100%;display:block}a{color:var(--c2)}\
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9rem}th,td{padding:.15rem .6rem;text-align:right;border-bottom:1px solid var(--grid);white-space:nowrap}\
th:first-child,td:first-child,.left{text-align:left}summary{cursor:pointer;font-weight:600;padding:.2rem 0}pre{white-space:pre-wrap;font-size:.85rem}";

/// What is known of the model of a machine.
#[derive(Debug, Clone)]
pub struct Known {
    /// Its card.
    pub card: Card,
    /// What may be wrong with its data.
    pub doubts: Vec<Doubt>,
}

impl Known {
    /// That of a model.
    #[must_use]
    pub fn of(model: &Model) -> Self {
        Self {
            card: model.card.clone().unwrap_or_default(),
            doubts: Vec::new(),
        }
    }
}

/// What the page shows.
#[derive(Debug)]
pub struct Facts<'a> {
    /// Its heading.
    pub title: String,
    /// Whether errors are on other rows than those of the fit.
    pub on_other_rows: bool,
    /// The machines, the worst first.
    pub standings: Vec<Standing>,
    /// Machines that could not be fitted or scored, and why.
    pub failed: &'a BTreeMap<String, String>,
    /// The machines beside each other; none of a few.
    pub comparison: Option<&'a Comparison>,
    /// What is known of each.
    pub known: &'a BTreeMap<String, Known>,
}

/// One self-contained page: no request leaves it, and it follows the reader's light or dark.
#[must_use]
pub fn page(facts: &Facts<'_>) -> String {
    let title = escaped(&facts.title);
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>{title}</title><link rel=\"icon\" href=\"data:,\"><style>:root{{color-scheme:light dark}}{COLOURS}{STYLE}{LAYOUT}</style></head><body><h1>{title}</h1>"
    );
    summary(&mut html, facts);
    distribution(&mut html, facts);
    worst(&mut html, facts);
    unlike(&mut html, facts);
    details(&mut html, facts);
    html.push_str("</body></html>");
    html
}

fn summary(html: &mut String, facts: &Facts<'_>) {
    let machines = counted(facts.standings.len() as u64, "machine");
    let rows = match facts.on_other_rows {
        true => "rows beside those of the fit",
        false => "the rows of the fit",
    };
    let _ = write!(html, "<p>{machines}; errors are on {rows}.</p>");
    if facts.failed.is_empty() {
        return;
    }
    let failed = counted(facts.failed.len() as u64, "machine");
    let _ = write!(html, "<p class=\"bad\">{failed} failed:</p><ul>");
    for (machine, error) in facts.failed {
        let (machine, error) = (escaped(machine), escaped(error));
        let _ = write!(html, "<li><b>{machine}</b><pre>{error}</pre></li>");
    }
    html.push_str("</ul>");
}

/// The errors of each prediction over all machines.
fn distribution(html: &mut String, facts: &Facts<'_>) {
    let mut names: Vec<&str> = Vec::new();
    let mut all: BTreeMap<&str, (&str, Vec<f64>)> = BTreeMap::new();
    let figures = facts.standings.iter().flat_map(|of| &of.figures);
    for Relative { figure, .. } in figures {
        let Some(rmse) = figure.rmse else {
            continue;
        };
        let of = all.entry(figure.of.as_str()).or_insert_with(|| {
            names.push(&figure.of);
            (figure.unit.as_str(), Vec::new())
        });
        of.1.push(rmse);
    }
    if all.is_empty() {
        return;
    }
    html.push_str("<h2>Errors over the machines</h2>");
    let ratios = facts.standings.iter().rev();
    let ratios: Vec<f64> = ratios.filter_map(|of| Some(of.worst()?.1)).collect();
    let means: Vec<f64> = facts
        .standings
        .iter()
        .rev()
        .map(|of| of.mean_ratio.unwrap_or(f64::NAN))
        .collect();
    let share = |count: usize| -> Vec<f64> {
        (0..count)
            .map(|nth| 100.0 * (nth as f64 + 0.5) / count as f64)
            .collect()
    };
    let (x, of_means) = (share(ratios.len()), share(means.len()));
    let chart = Chart {
        title: "Errors over the machines".to_owned(),
        x_label: "share of the machines, in %, by the largest error".to_owned(),
        y_label: "error over the median of the fleet".to_owned(),
        height: 260.0,
        layers: vec![
            Layer::line(&x, &ratios, "c3", "largest of the machine"),
            Layer {
                x: &of_means,
                y: &means,
                class: "c2",
                label: "geometric mean of the machine".to_owned(),
                mark: Mark::Dots,
            },
        ],
        limits: vec![1.0],
        ..Chart::default()
    };
    let _ = write!(html, "<div class=\"wide\">{}</div>", chart.svg());
    let mut rows = String::new();
    for name in names {
        let Some((unit, errors)) = all.get_mut(name) else {
            continue;
        };
        errors.sort_by(f64::total_cmp);
        let at = |share: f64| errors[((errors.len() - 1) as f64 * share).round() as usize];
        let cells =
            [0.0, 0.25, 0.5, 0.75, 0.9, 1.0].map(|share| format!("<td>{}</td>", number(at(share))));
        let (name, unit, machines) = (escaped(name), escaped(unit), count(errors.len() as u64));
        let _ = write!(
            rows,
            "<tr><td>{name}</td><td>{machines}</td>{}<td class=\"left\">{unit}</td></tr>",
            cells.concat()
        );
    }
    table(
        html,
        &[
            "RMSE of", "machines", "least", "25 %", "median", "75 %", "90 %", "largest", "unit",
        ],
        &rows,
    );
}

fn table(html: &mut String, header: &[&str], rows: &str) {
    let cells = header.iter().map(|cell| format!("<th>{cell}</th>"));
    let header: String = cells.collect();
    let _ = write!(
        html,
        "<div class=\"wide\"><table><tr>{header}</tr>{rows}</table></div>"
    );
}

fn anchor(machine: &str) -> String {
    let letters = machine
        .bytes()
        .map(|byte| match byte.is_ascii_alphanumeric() {
            true => char::from(byte).to_string(),
            false => format!("-{byte:02x}"),
        });
    format!("m-{}", letters.collect::<String>())
}

fn worst(html: &mut String, facts: &Facts<'_>) {
    html.push_str("<h2>The worst</h2>");
    let mut rows = String::new();
    for of in facts.standings.iter().take(WORST) {
        let (name, link) = (escaped(&of.machine), anchor(&of.machine));
        let _ = write!(rows, "<tr><td><a href=\"#{link}\">{name}</a></td>");
        match of.worst() {
            Some((figure, ratio)) => {
                let (channel, unit) = (escaped(&figure.of), escaped(&figure.unit));
                let (rmse, n) = (or_dash(figure.rmse), count(figure.n));
                let no_model = or_dash(figure.no_model);
                let _ = write!(
                    rows,
                    "<td class=\"left\">{channel}</td><td>{n}</td><td>{rmse}</td><td class=\"left\">{unit}</td><td>{} ×</td><td>{no_model}</td>",
                    number(ratio)
                );
            }
            None => rows.push_str("<td class=\"left\">nothing is scored</td><td></td><td></td><td></td><td></td><td></td>"),
        }
        let _ = write!(rows, "<td>{}</td></tr>", or_dash(of.mean_ratio));
    }
    let header = [
        "machine",
        "prediction",
        "on",
        "RMSE",
        "unit",
        "of the fleet’s median",
        "no model",
        "geometric mean",
    ];
    table(html, &header, &rows);
}

fn unlike(html: &mut String, facts: &Facts<'_>) {
    let Some(comparison) = facts.comparison else {
        return;
    };
    html.push_str("<h2>Unlike the others</h2>");
    let limit = number(comparison.limit);
    let _ = write!(
        html,
        "<p class=\"muted\">Coefficients, errors and the ranges of sensors over the rows of the fit: {} of each machine. The score is the distance from what the fleet has in common, \
         in standard deviations: how far machines differ, and how sure the value is. Of a hundred machines that are as they should be about two are beyond {limit}.</p>",
        counted(comparison.traits as u64, "trait")
    );
    let _ = write!(
        html,
        "<div class=\"wide\">{}</div>",
        picture(comparison, |chart| chart.svg())
    );
    let mut any = false;
    for member in comparison.machines.iter().filter(|of| of.unlike) {
        any = true;
        let (name, link) = (escaped(&member.machine), anchor(&member.machine));
        let _ = write!(html, "<p><a href=\"#{link}\"><b>{name}</b></a></p>");
        departures(html, member, Some(comparison.limit));
    }
    if !any {
        html.push_str("<p>No machine is unlike the others.</p>");
    }
}

fn departures(html: &mut String, member: &Member, limit: Option<f64>) {
    html.push_str("<ul>");
    let shown = member.departures.iter().take(DEPARTURES);
    for of in shown.take_while(|of| limit.is_none_or(|limit| of.score.abs() > limit)) {
        let _ = write!(html, "<li>{}</li>", escaped(&of.sentence()));
    }
    html.push_str("</ul>");
}

fn details(html: &mut String, facts: &Facts<'_>) {
    html.push_str("<h2>Each machine</h2><p class=\"muted\">The worst first.</p>");
    for of in facts.standings.iter().take(DETAILED) {
        let (name, link) = (escaped(&of.machine), anchor(&of.machine));
        let ratio = of
            .worst()
            .map_or_else(String::new, |(_, ratio)| format!(": {} ×", number(ratio)));
        let _ = write!(
            html,
            "<details id=\"{link}\"><summary>{name}{ratio}</summary>"
        );
        detail(html, of, facts);
        html.push_str("</details>");
    }
    if facts.standings.len() > DETAILED {
        let more = count((facts.standings.len() - DETAILED) as u64);
        let _ = write!(html, "<p>And {more} more, which are better than these.</p>");
    }
}

fn detail(html: &mut String, of: &Standing, facts: &Facts<'_>) {
    let mut rows = String::new();
    for Relative { figure, ratio } in &of.figures {
        let (name, unit) = (escaped(&figure.of), escaped(&figure.unit));
        let valid = figure
            .valid
            .map_or_else(|| "-".to_owned(), |of| format!("{:.1} %", 100.0 * of));
        let cells = [
            figure.rmse,
            *ratio,
            figure.no_model,
            figure.persistence,
            figure.bias,
            figure.max_abs,
        ];
        let cells: String = cells
            .into_iter()
            .map(|of| format!("<td>{}</td>", or_dash(of)))
            .collect();
        let _ = write!(
            rows,
            "<tr><td>{name}</td><td>{}</td>{cells}<td>{valid}</td><td class=\"left\">{unit}</td></tr>",
            count(figure.n)
        );
    }
    let header = [
        "prediction",
        "on",
        "RMSE",
        "of the median",
        "no model",
        "persistence",
        "bias",
        "largest",
        "valid",
        "unit",
    ];
    table(html, &header, &rows);
    if let Some(known) = facts.known.get(&of.machine) {
        about(html, known);
    }
    let members = facts.comparison.iter().flat_map(|of| &of.machines);
    if let Some(member) = members
        .into_iter()
        .find(|member| member.machine == of.machine)
    {
        html.push_str("<p>Where it departs most from the fleet:</p>");
        departures(html, member, None);
    }
}

fn about(html: &mut String, known: &Known) {
    let card = &known.card;
    let period = card.period.map_or_else(String::new, |of| {
        format!(" over {:.1} days", (of.to_s - of.from_s) / 86_400.0)
    });
    let created = card
        .created
        .as_ref()
        .map_or_else(String::new, |at| format!(" on {}", escaped(at)));
    let hashes: Vec<String> = card.data.iter().map(|of| escaped(&of.hash)).collect();
    let _ = write!(
        html,
        "<p class=\"muted\">Fitted{created} on {}{period}, checksum {}.</p>",
        counted(card.ticks, "row"),
        hashes.join(", ")
    );
    if !known.doubts.is_empty() {
        let doubts = known.doubts.iter();
        let doubts: Vec<String> = doubts.map(|of| escaped(&of.to_string())).collect();
        let _ = write!(
            html,
            "<p class=\"bad\">Its data may be wrong: {}.</p>",
            doubts.join(", ")
        );
    }
    let mut rows = String::new();
    for of in card
        .estimators
        .iter()
        .filter(|of| !of.report.selection.is_empty())
    {
        let chosen = of
            .report
            .selection
            .iter()
            .map(|step| format!("{} ({:.3})", escaped(&step.label()), step.score));
        let chosen: Vec<String> = chosen.collect();
        let _ = write!(
            rows,
            "<tr><td>{}</td><td class=\"left\">{}</td></tr>",
            escaped(&of.node),
            chosen.join(", ")
        );
    }
    if !rows.is_empty() {
        table(
            html,
            &[
                "estimator",
                "chosen, with the cross-validated R² after each",
            ],
            &rows,
        );
    }
}
