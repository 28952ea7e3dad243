//! Decides what stands on the page and in which order; how a picture is drawn is decided by [`super::chart`].

use std::fmt::Write as _;

use athermal_core::score::Score;

use super::chart::{COLOURS, Chart, Layer, Mark, STYLE};
use super::{Axis, Facts, Worth, rms};

const COLOUR: [&str; 6] = ["c2", "c3", "c4", "c5", "c6", "c1"];
/// Limits in nm/min of the stability states that are marked (Mandelli, Dankwart and Napoli, section 3.4).
const STABLE: f64 = 30.0;
const TRANSIENT: f64 = 80.0;
/// Lags of the autocorrelation that are shown.
const LAGS: usize = 40;
const HISTOGRAM_BINS: usize = 41;

const PAGE_STYLE: &str = "\
body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);max-width:1100px;margin:0 auto;padding:1rem}\
h1{font-size:1.6rem;margin:.2rem 0}h2{font-size:1.2rem;margin:2rem 0 .4rem;border-bottom:1px solid var(--grid)}h3{font-size:1rem;margin:1rem 0 .2rem}\
p,ul{margin:.4rem 0}.muted{color:var(--muted);font-size:.9rem}.good{color:var(--good)}.bad{color:var(--bad)}\
.wide{overflow-x:auto}.wide svg.chart{min-width:620px;width:100%;display:block}\
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9rem}th,td{padding:.15rem .6rem;text-align:right;border-bottom:1px solid var(--grid);white-space:nowrap}\
th:first-child,td:first-child{text-align:left}summary{cursor:pointer;font-weight:600;padding:.3rem 0}\
.pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,320px),1fr));gap:.6rem}.pair svg.chart{width:100%}\
@media print{body{max-width:none;font-size:11pt}.wide{overflow:visible}.wide svg.chart{min-width:0}table{font-size:7.5pt}th,td{padding:.1rem .3rem}details,svg,tr{break-inside:avoid}h2,h3{break-after:avoid}.screen{display:none}}";

/// Zooming: the wheel about the pointer, dragging, double click for all. All charts of time move together.
const SCRIPT: &str = r#"addEventListener('beforeprint',()=>document.querySelectorAll('details').forEach(d=>{d.open=true}));(()=>{const all=[...document.querySelectorAll('svg.zoom')].map(s=>{const b=s.viewBox.baseVal;
return{s,w:b.width,h:b.height,x0:+s.dataset.x0,x1:+s.dataset.x1,g:s.parentNode.querySelector('g.ticks')}});if(!all.length)return;
let lo=Math.min(...all.map(c=>c.x0)),hi=Math.max(...all.map(c=>c.x1));const full=[lo,hi];
const nice=r=>{const p=10**Math.floor(Math.log10(r));return[1,2,5,10].map(n=>n*p).find(n=>n>=r)};
const draw=()=>all.forEach(c=>{const k=c.w/(c.x1-c.x0),x=(lo-c.x0)*k,w=(hi-lo)*k;c.s.setAttribute('viewBox',`${x} 0 ${w} ${c.h}`);
const st=nice((hi-lo)/3600/8),t=c.g.firstElementChild,y=t?t.getAttribute('y'):0;let o='';
for(let v=Math.ceil(lo/3600/st)*st;v<=hi/3600+1e-9;v+=st)o+=`<text x="${(62+(v*3600-lo)/(hi-lo)*c.w).toFixed(1)}" y="${y}" text-anchor="middle">${+v.toFixed(4)}</text>`;
c.g.innerHTML=o});let due=0;const later=()=>{if(!due){due=1;requestAnimationFrame(()=>{due=0;draw()})}};
const set=(a,b)=>{const w=Math.min(Math.max(b-a,300),full[1]-full[0]);lo=Math.min(Math.max(a,full[0]),full[1]-w);hi=lo+w;later()};
all.forEach(c=>{const at=e=>{const r=c.s.getBoundingClientRect();return lo+(e.clientX-r.left)/r.width*(hi-lo)};
c.s.parentNode.addEventListener('wheel',e=>{if(!e.ctrlKey&&!e.shiftKey)return;e.preventDefault();const m=at(e),f=e.deltaY+e.deltaX>0?1.25:.8;set(m-(m-lo)*f,m+(hi-m)*f)},{passive:false});
let from=null;c.s.parentNode.addEventListener('pointerdown',e=>{from=at(e)});
c.s.parentNode.addEventListener('pointerup',e=>{if(from===null)return;const to=at(e);if(Math.abs(to-from)>(hi-lo)/100)set(Math.min(from,to),Math.max(from,to));from=null});
c.s.parentNode.addEventListener('dblclick',()=>set(...full))})})();"#;

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

fn figure(value: Option<f64>) -> String {
    match value {
        None => "–".to_owned(),
        Some(value) if value.abs() >= 100.0 => format!("{value:.0}"),
        Some(value) if value.abs() >= 10.0 => format!("{value:.1}"),
        Some(value) => format!("{value:.2}"),
    }
}

/// Prediction minus truth of the axis' main voter.
fn errors(axis: &Axis) -> Vec<f64> {
    let main = &axis.voters[axis.main].value;
    main.iter()
        .zip(&axis.truth.value)
        .map(|(p, y)| p - y)
        .collect()
}

/// The verdict on an axis, in a sentence.
fn verdict(axis: &Axis, facts: &Facts) -> (bool, String) {
    let node = &axis.voters[axis.main].node;
    let paired = axis.truth.value.iter().zip(errors(axis));
    let both: Vec<(f64, f64)> = paired
        .map(|(y, e)| (*y, e))
        .filter(|(_, e)| !e.is_nan())
        .collect();
    let (Some(zero), Some(error)) = (rms(both.iter().map(|b| b.0)), rms(both.iter().map(|b| b.1)))
    else {
        return (
            false,
            format!(
                "<b>{}</b>: {node} gave no prediction on these data.",
                escaped(&axis.name)
            ),
        );
    };
    let noise = facts
        .scores
        .iter()
        .find(|s| s.truth.ends_with(&format!(".{}", axis.name)))
        .and_then(|s| s.truth_noise);
    let share = 100.0 * (1.0 - error / zero);
    let mut text = format!(
        "<b>{}</b>: {node} predicts the drift to {} of {} {} RMS",
        escaped(&axis.name),
        figure(Some(error)),
        figure(Some(zero)),
        escaped(&axis.unit)
    );
    let _ = if error < zero {
        write!(text, ", {share:.0} % less than no model")
    } else {
        write!(text, ", worse than no model")
    };
    if let Some(noise) = noise {
        let _ = write!(
            text,
            " (the measurement's own noise is {})",
            figure(Some(noise))
        );
    }
    let worth = facts.worth.as_ref().and_then(|worth| {
        let i = worth.axes.iter().position(|name| *name == axis.name)?;
        let with = rms(worth.drift_with[i].value.iter().copied())?;
        let without = rms(worth.drift_without[i].value.iter().copied())?;
        Some((without, with))
    });
    if let Some((without, with)) = worth {
        let _ = write!(
            text,
            "; corrected, {} of {} remain",
            figure(Some(with)),
            figure(Some(without))
        );
    }
    text.push('.');
    (error < zero, text)
}

fn score_table(scores: &[Score]) -> String {
    let mut rows = String::new();
    for score in scores {
        let worse = if score.is_worse_than_nothing() {
            " class=\"bad\""
        } else {
            ""
        };
        let _ = write!(
            rows,
            "<tr><td>{}</td><td>{}</td><td{worse}>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escaped(&score.output),
            escaped(&score.unit),
            figure(score.rmse),
            figure(score.baseline_zero),
            figure(score.baseline_persistence),
            figure(score.truth_noise),
            figure(score.r2_zero),
            figure(score.bias),
            figure(score.max_abs),
            score
                .valid
                .map_or("–".to_owned(), |valid| format!("{:.1} %", 100.0 * valid)),
        );
    }
    format!(
        "<div class=\"wide\"><table><tr><th>prediction</th><th>unit</th><th>RMSE</th><th>no model</th><th>persistence</th><th>noise of truth</th><th>R²</th><th>bias</th><th>largest</th><th>valid</th></tr>{rows}</table></div>"
    )
}

/// Stretches that are quasi-stable or transient, run together where they follow each other.
fn bands(axis: &Axis) -> Vec<(f64, f64, &'static str)> {
    let mut bands: Vec<(f64, f64, &'static str)> = Vec::new();
    let pairs = axis.truth.time_s.windows(2).zip(&axis.truth.value);
    for (times, y) in pairs {
        let class = match y.abs() {
            size if size >= TRANSIENT => "s2",
            size if size >= STABLE => "s1",
            _ => continue,
        };
        let to = times[1].min(times[0] + 600.0);
        match bands.last_mut() {
            Some(last) if last.2 == class && times[0] - last.1 < 600.0 => last.1 = to,
            _ => bands.push((times[0], to, class)),
        }
    }
    bands
}

fn drift<'a>(axis: &'a Axis, remaining: &'a [f64], facts: &'a Facts) -> Chart<'a> {
    let main = &axis.voters[axis.main];
    let mut layers = vec![
        Layer::line(&axis.truth, "c1", "measured"),
        Layer {
            x: &axis.truth.time_s,
            y: &main.value,
            class: "c2",
            label: format!("predicted ({})", main.node),
            mark: Mark::Line,
        },
    ];
    let worth = facts.worth.as_ref().and_then(|worth| {
        let i = worth.axes.iter().position(|name| *name == axis.name)?;
        Some(&worth.drift_with[i])
    });
    layers.push(match worth {
        Some(with) => Layer::line(with, "c3", "left after correction"),
        None => Layer {
            x: &axis.truth.time_s,
            y: remaining,
            class: "c3",
            label: "residual".into(),
            mark: Mark::Line,
        },
    });
    Chart {
        title: format!("Drift of {}", axis.name),
        x_label: "hours",
        y_label: format!("{} in {}", axis.name, axis.unit),
        height: 260.0,
        layers,
        bands: bands(axis),
        limit: None,
        y_range: None,
        time: true,
    }
}

fn voters(axis: &Axis) -> Chart<'_> {
    let layer = |(nth, voter): (usize, &'_ super::Voter)| Layer {
        x: &axis.truth.time_s,
        // The borrow of the voter is that of the axis.
        y: &axis.voters[nth].value,
        class: COLOUR[nth % COLOUR.len()],
        label: voter.node.clone(),
        mark: Mark::Line,
    };
    Chart {
        title: format!("Predictions of {}", axis.name),
        x_label: "hours",
        y_label: format!("{} in {}", axis.name, axis.unit),
        height: 220.0,
        layers: axis.voters.iter().enumerate().map(layer).collect(),
        bands: Vec::new(),
        limit: None,
        y_range: None,
        time: true,
    }
}

/// Points, histogram and autocorrelation of the errors, ready to be drawn.
struct Spread {
    centres: Vec<f64>,
    counts: Vec<f64>,
    lags: Vec<f64>,
    correlation: Vec<f64>,
}

fn spread(errors: &[f64]) -> Spread {
    let present: Vec<f64> = errors.iter().copied().filter(|e| e.is_finite()).collect();
    let edge = present
        .iter()
        .fold(0.0_f64, |edge, e| edge.max(e.abs()))
        .max(1e-12);
    // Nearly all errors are small; the outermost bins take the rest.
    let edge = edge
        .min(5.0 * rms(present.iter().copied()).unwrap_or(1.0))
        .max(1e-12);
    let width = 2.0 * edge / HISTOGRAM_BINS as f64;
    let mut counts = vec![0.0; HISTOGRAM_BINS];
    for error in &present {
        let bin = ((error + edge) / width)
            .floor()
            .clamp(0.0, HISTOGRAM_BINS as f64 - 1.0);
        counts[bin as usize] += 1.0;
    }
    let mean = present.iter().sum::<f64>() / present.len().max(1) as f64;
    let about = |i: usize| present[i] - mean;
    let total: f64 = (0..present.len()).map(|i| about(i) * about(i)).sum();
    let correlation = (1..=LAGS)
        .map(|lag| {
            let pairs = present.len().saturating_sub(lag);
            (0..pairs).map(|i| about(i) * about(i + lag)).sum::<f64>() / total
        })
        .collect();
    Spread {
        centres: (0..HISTOGRAM_BINS)
            .map(|bin| (bin as f64 + 0.5) * width - edge)
            .collect(),
        counts,
        lags: (1..=LAGS).map(|lag| lag as f64).collect(),
        correlation,
    }
}

fn small<'a>(
    title: String,
    x_label: &'a str,
    y_label: String,
    x: &'a [f64],
    y: &'a [f64],
    mark: Mark,
) -> Chart<'a> {
    Chart {
        title,
        x_label,
        y_label,
        height: 420.0,
        layers: vec![Layer {
            x,
            y,
            class: "c2",
            label: String::new(),
            mark,
        }],
        bands: Vec::new(),
        limit: None,
        y_range: None,
        time: false,
    }
}

/// Errors of an axis as three pictures.
fn error_charts(axis: &Axis) -> Vec<(String, String, String)> {
    let errors = errors(axis);
    let spread = spread(&errors);
    let main = &axis.voters[axis.main].value;
    let name = &axis.name;
    let charts = [
        (
            "scatter",
            small(
                format!("Predicted against measured, {name}"),
                "measured",
                format!("{name} predicted, {}", axis.unit),
                &axis.truth.value,
                main,
                Mark::Dots,
            ),
        ),
        (
            "histogram",
            small(
                format!("Errors of {name}"),
                "predicted − measured",
                format!("{name} errors, count"),
                &spread.centres,
                &spread.counts,
                Mark::Bars,
            ),
        ),
        (
            "autocorrelation",
            small(
                format!("Autocorrelation of the errors of {name}"),
                "lag in truths",
                format!("{name} autocorrelation"),
                &spread.lags,
                &spread.correlation,
                Mark::Bars,
            ),
        ),
    ];
    charts
        .iter()
        .map(|(kind, chart)| (format!("{kind}-{name}"), chart.svg(), chart.file()))
        .collect()
}

fn loss(worth: &Worth) -> Chart<'_> {
    let highest = 10.0 * worth.loss_limit;
    Chart {
        title: "Optical loss over five minutes".into(),
        x_label: "hours",
        y_label: "loss in dB".into(),
        height: 260.0,
        layers: vec![
            Layer::line(&worth.loss_without, "c1", "without correction"),
            Layer::line(&worth.loss_with, "c3", "with correction"),
        ],
        bands: Vec::new(),
        limit: Some(worth.loss_limit),
        y_range: Some((0.0, highest)),
        time: true,
    }
}

fn worth_section(worth: &Worth) -> String {
    let below = |losses: &[f64]| {
        let low = losses
            .iter()
            .filter(|loss| **loss < worth.loss_limit)
            .count();
        100.0 * low as f64 / losses.len().max(1) as f64
    };
    let mut html = String::from("<h2>What the correction is worth</h2>");
    if !worth.loss_without.value.is_empty() {
        let worst = |losses: &[f64]| losses.iter().copied().fold(0.0, f64::max);
        let _ = write!(
            html,
            "<p>Five-minute losses below {} dB: <b>{:.1} %</b> without, <b class=\"good\">{:.1} %</b> with correction. \
             Largest loss {} dB without, {} dB with (the picture ends at {} dB).</p><div class=\"wide\">{}</div>",
            worth.loss_limit,
            below(&worth.loss_without.value),
            below(&worth.loss_with.value),
            figure(Some(worst(&worth.loss_without.value))),
            figure(Some(worst(&worth.loss_with.value))),
            10.0 * worth.loss_limit,
            loss(worth).svg()
        );
    }
    if !worth.settling.is_empty() {
        let unit = escaped(worth.set_point_unit.as_deref().unwrap_or_default());
        html.push_str("<h3>Settle time and largest loss per change of the set point</h3><div class=\"wide\"><table><tr><th>at</th><th>from</th><th>to</th><th>without</th><th>with</th><th>largest loss without</th><th>with</th></tr>");
        for s in &worth.settling {
            let minutes =
                |m: Option<f64>| m.map_or("not settled".to_owned(), |m| format!("{m:.1} min"));
            let _ = write!(
                html,
                "<tr><td>{:.1} h</td><td>{:.1} {unit}</td><td>{:.1} {unit}</td><td>{}</td><td>{}</td><td>{} dB</td><td>{} dB</td></tr>",
                s.at_s / 3600.0,
                s.from,
                s.to,
                minutes(s.without_min),
                minutes(s.with_min),
                figure(Some(s.largest_without)),
                figure(Some(s.largest_with))
            );
        }
        html.push_str("</table></div><p class=\"muted\">From the change to the start of the first ten minutes that are stable throughout.</p>");
    }
    html
}

fn chosen(facts: &Facts) -> String {
    let Some(card) = &facts.card else {
        return String::new();
    };
    let mut html = String::from(
        "<h2>Chosen features</h2><p class=\"muted\">Sensor and window, in the order chosen, with the cross-validated R² after each. The window is the time constant that the feature sees.</p>",
    );
    for estimator in card
        .estimators
        .iter()
        .filter(|e| !e.report.selection.is_empty())
    {
        let steps = estimator
            .report
            .selection
            .iter()
            .map(|s| format!("{} ({:.3})", escaped(&s.regressor), s.score));
        let _ = write!(
            html,
            "<p><b>{}</b>: {}</p>",
            escaped(&estimator.node),
            steps.collect::<Vec<_>>().join(", ")
        );
    }
    html
}

fn sensors(facts: &Facts) -> String {
    let mut rows = String::new();
    for sensor in facts.course.sensors.iter() {
        let (low, high) = sensor.range.unwrap_or((f64::NAN, f64::NAN));
        let gap = sensor.longest_gap_s > 5.0 * sensor.mean_gap_s && sensor.samples > 1;
        let _ = write!(
            rows,
            "<tr><td>{}</td><td>{}</td><td{}>{}</td><td>{:.1} s</td><td{}>{:.0} s</td><td>{low:.2}</td><td>{high:.2}</td></tr>",
            escaped(&sensor.name),
            sensor.samples,
            if sensor.rejected > 0 {
                " class=\"bad\""
            } else {
                ""
            },
            sensor.rejected,
            sensor.mean_gap_s,
            if gap { " class=\"bad\"" } else { "" },
            sensor.longest_gap_s,
        );
    }
    format!(
        "<h2>Sensors</h2><div class=\"wide\"><table><tr><th>channel</th><th>samples</th><th>rejected</th><th>mean gap</th><th>longest gap</th><th>lowest</th><th>highest</th></tr>{rows}</table></div>"
    )
}

fn card(facts: &Facts) -> String {
    let Some(card) = &facts.card else {
        return "<h2>Model</h2><p>A graph without a fit.</p>".to_owned();
    };
    let mut html = format!(
        "<h2>Model card</h2><p>Made by athermal {}",
        escaped(&card.athermal)
    );
    if let Some(created) = &card.created {
        let _ = write!(html, " on {}", escaped(created));
    }
    let _ = write!(html, " from {} ticks.</p><ul>", card.ticks);
    for data in &card.data {
        let _ = write!(
            html,
            "<li>{}: {} rows, {} bytes, checksum {}</li>",
            escaped(&data.path),
            data.rows,
            data.bytes,
            escaped(&data.hash)
        );
    }
    html.push_str("</ul>");
    html
}

/// One self-contained HTML page: no request leaves it, it prints, and it follows the reader's light or dark.
#[must_use]
pub fn page(facts: &Facts) -> String {
    let title = escaped(&facts.graph);
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>{title} report</title><link rel=\"icon\" href=\"data:,\"><style>:root{{color-scheme:light dark}}{COLOURS}{STYLE}{PAGE_STYLE}</style></head><body><h1>{title}</h1>"
    );
    let data: Vec<String> = facts.data.iter().map(|path| escaped(path)).collect();
    let (from, to) = facts.course.period_s.unwrap_or((0.0, 0.0));
    let _ = write!(
        html,
        "<p class=\"muted\">On {}: {} ticks over {:.1} days.</p><ul>",
        data.join(", "),
        facts.course.ticks,
        (to - from) / 86400.0
    );
    for axis in &facts.course.axes {
        let (good, text) = verdict(axis, facts);
        let _ = write!(
            html,
            "<li{}>{text}</li>",
            if good { "" } else { " class=\"bad\"" }
        );
    }
    html.push_str("</ul>");
    html.push_str(&facts.worth.as_ref().map(worth_section).unwrap_or_default());
    html.push_str("<h2>Scores</h2><p class=\"muted\">Every prediction against the drift measured later, on the instants at which all are valid.</p>");
    html.push_str(&score_table(&facts.scores));
    html.push_str("<h2>Drift over time</h2><p class=\"muted screen\">Drag across a picture to look closer, double-click for all; the wheel with Ctrl or Shift zooms.</p><p class=\"muted\">Shaded: quasi-stable from 30, transient from 80 nm/min.</p>");
    for axis in &facts.course.axes {
        let remaining = errors(axis);
        let _ = write!(
            html,
            "<div class=\"wide\">{}</div>",
            drift(axis, &remaining, facts).svg()
        );
    }
    html.push_str("<h2>Votes and errors</h2>");
    for axis in &facts.course.axes {
        let _ = write!(
            html,
            "<details><summary>{}</summary><div class=\"wide\">{}</div><div class=\"pair\">",
            escaped(&axis.name),
            voters(axis).svg()
        );
        for (_, svg, _) in error_charts(axis) {
            html.push_str(&svg);
        }
        html.push_str("</div></details>");
    }
    html.push_str(&chosen(facts));
    html.push_str(&sensors(facts));
    html.push_str(&card(facts));
    let _ = write!(html, "<script>{SCRIPT}</script></body></html>");
    html
}

/// Every picture as a file of its own: name without ending, and SVG.
#[must_use]
pub fn plots(facts: &Facts) -> Vec<(String, String)> {
    let mut plots = Vec::new();
    for axis in &facts.course.axes {
        let remaining = errors(axis);
        plots.push((
            format!("drift-{}", axis.name),
            drift(axis, &remaining, facts).file(),
        ));
        plots.push((format!("votes-{}", axis.name), voters(axis).file()));
        plots.extend(
            error_charts(axis)
                .into_iter()
                .map(|(name, _, file)| (name, file)),
        );
    }
    if let Some(worth) = facts
        .worth
        .as_ref()
        .filter(|worth| !worth.loss_with.value.is_empty())
    {
        plots.push(("loss".to_owned(), loss(worth).file()));
    }
    plots
}
