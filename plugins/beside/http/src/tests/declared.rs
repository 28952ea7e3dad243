//! What is declared once is everywhere: a fact, an event and a route of another crate.

use std::sync::Arc;
use std::time::Duration as Wait;

use athermal_core::engine::Engine;
use athermal_core::event::Event as _;
use athermal_core::events;
use athermal_core::time::Instant;
use athermal_run::live::TickView;
use athermal_serve::facts::{Known as _, StatusFacts, guide};
use athermal_serve::service::{PredictionErrors, Service, ServiceEvent};
use athermal_serve::{facts, register_events, register_facts};
use serde_json::{Value, json};

use super::{Bench, GRAPH, fitted};
use crate::{Asked, Gives, Refused, Reply, mount, openapi};

facts! {
    /// The spindle.
    SpindleFacts(hours: u64) {
        /// Hours that the spindle has run.
        hours: u64 [counter "athermal_spindle_hours_total"] [line "the spindle has run for {hours} h"] = hours;
    }
}

register_facts!(SpindleFacts, "spindle");

events! {
    /// What happens to a spindle.
    #[derive(Debug)]
    enum Spindle {
        /// The spindle is worn.
        Worn(hours: u64) => "spindle_worn", fault, { hours: u64 = hours },
            format!("the spindle has run for {hours} h: is it worn?"),
            counts "athermal_worn_spindles_total" "Spindles that are worn.";
    }
}

register_events!(Spindle);

fn page(service: &mut Service, asked: &Asked) -> Result<Reply, Refused> {
    let text = format!("{} {}\n", service.name(), asked.query);
    Ok(Reply::text("text/html; charset=utf-8", text))
}

mount!(
    "/spindle",
    "The spindle, for people.",
    Gives::Text("text/html; charset=utf-8"),
    page
);

#[test]
fn a_fact_and_an_event_that_are_declared_once_are_in_log_status_metrics_description_and_guide() {
    let bench = Bench::start(GRAPH, "");
    let report = |service: &mut Service| {
        service.contribute("spindle", || SpindleFacts::read(7));
        service.report(ServiceEvent::Of(Box::new(Spindle::Worn(7))));
    };
    bench.handle.ask(Wait::from_secs(10), report).unwrap();
    let is_worn = |of: &Value| of["event"] == "spindle_worn";
    let status = bench.until("the event", |of| {
        of["events"].as_array().unwrap().iter().any(is_worn)
    });
    // The log is given this.
    let words = "the spindle has run for 7 h: is it worn?";
    let [(is_fault, message)] = &ServiceEvent::Of(Box::new(Spindle::Worn(7))).messages(true)[..]
    else {
        panic!("it is one")
    };
    let line = json!({ "event": "spindle_worn", "level": "warning", "hours": 7, "message": words });
    assert_eq!(
        (*is_fault, message.line("warning")),
        (true, line.to_string())
    );

    assert_eq!(status["companions"]["spindle"], json!({ "hours": 7 }));
    let event = status["events"]
        .as_array()
        .unwrap()
        .iter()
        .find(|of| is_worn(of))
        .unwrap();
    assert_eq!(
        (&event["level"], &event["message"], &event["facts"]),
        (&json!("warning"), &json!(words), &json!({ "hours": 7 }))
    );
    let shown = StatusFacts::declared().unwrap().words(&status);
    for line in ["the spindle has run for 7 h", &format!("lately: {words}")] {
        assert!(shown.lines().any(|of| of == line), "{shown}");
    }

    let metrics = String::from_utf8(bench.get("/metrics").body).unwrap();
    for line in [
        "# HELP athermal_spindle_hours_total Hours that the spindle has run.",
        "# TYPE athermal_spindle_hours_total counter",
        "athermal_spindle_hours_total{machine=\"line\"} 7",
        "athermal_worn_spindles_total{machine=\"line\"} 1",
        "athermal_events_total{machine=\"line\",event=\"spindle_worn\"} 1",
    ] {
        assert!(metrics.lines().any(|of| of == line), "{line}\n{metrics}");
    }

    let whole: Value = serde_json::from_str(openapi()).unwrap();
    let schemas = &whole["components"]["schemas"];
    let hours = &schemas["SpindleFacts"]["properties"]["hours"];
    assert_eq!(hours["description"], "Hours that the spindle has run.");
    let names = schemas["EventFacts"]["properties"]["event"]["enum"]
        .as_array()
        .unwrap();
    assert!(names.contains(&json!("spindle_worn")), "{names:?}");

    let guide = guide();
    for row in [
        "| `/v1/status`: `companions.spindle.hours` | `athermal_spindle_hours_total` | counter | Hours that the spindle has run. |",
        "| `spindle_worn` | fault | `hours` | `athermal_worn_spindles_total` | The spindle is worn. |",
    ] {
        assert!(guide.lines().any(|of| of == row), "{guide}");
    }
}

#[test]
fn the_page_on_json_has_what_is_declared() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/src/json.md");
    let page = std::fs::read_to_string(path).unwrap();
    let [begin, end] = ["<!-- what is declared -->\n", "<!-- until here -->"];
    let (before, rest) = page.split_once(begin).unwrap();
    let (found, after) = rest.split_once(end).unwrap();
    let declared = guide();
    let declared = declared.lines().filter(|of| !of.contains("spindle"));
    let declared: String = declared.map(|of| format!("{of}\n")).collect();
    if std::env::var_os("ATHERMAL_WRITE").is_some() {
        std::fs::write(path, format!("{before}{begin}{declared}{end}{after}")).unwrap();
    } else {
        assert_eq!(
            found, declared,
            "`ATHERMAL_WRITE=1 cargo test -p athermal-http page_on_json` writes it"
        );
    }
}

#[test]
fn a_route_that_another_crate_mounts_is_answered_and_described() {
    let bench = Bench::start(GRAPH, "");
    let reply = bench.get("/spindle?x=1");
    assert_eq!((reply.status, &*reply.body), (200, &b"line x=1\n"[..]));
    assert_eq!(bench.post("/spindle", &json!({})).status, 405);
    let whole: Value = serde_json::from_str(openapi()).unwrap();
    assert_eq!(
        whole["paths"]["/spindle"]["get"]["summary"],
        "The spindle, for people."
    );
}

#[test]
fn the_last_ticks_of_each_output_are_kept() {
    let bench = Bench::start(GRAPH, "");
    bench.until("ticks", |of| of["ticks"].as_u64() > Some(300));
    let of = bench.get("/v1/ticks").json();
    let ticks = of["ticks"].as_array().unwrap();
    assert_eq!(ticks.len(), 256);
    let times = ticks
        .windows(2)
        .map(|of| of[1]["time_s"].as_f64().unwrap() - of[0]["time_s"].as_f64().unwrap());
    assert!(
        times.into_iter().all(|of| (0.05..0.15).contains(&of)),
        "{of:#}"
    );
    let outputs = of["outputs"].as_array().unwrap().len();
    assert!(
        outputs > 0
            && ticks
                .iter()
                .all(|of| of["values"].as_array().unwrap().len() == outputs)
    );
}

#[test]
fn what_was_predicted_before_a_break_is_no_prediction_of_what_comes_after_it() {
    let path = std::env::temp_dir().join(format!("athermal-break-{}.toml", std::process::id()));
    std::fs::write(&path, GRAPH).unwrap();
    let model = fitted(athermal_run::model::Model::load(&path).unwrap());
    std::fs::remove_file(path).unwrap();
    let mut engine = Engine::new(Arc::clone(&model.plan), &model.fitted).unwrap();
    let mut errors = PredictionErrors::default();
    let mut step = |ms: i64, z: f64| {
        let now = Instant::from_ns(ms * 1_000_000);
        if engine.last().is_some_and(|last| now <= last) {
            engine.segment();
        }
        engine.step(now, &[20.5, 21.5, z]).unwrap();
        errors.look(&TickView::of(now, &engine));
        errors.iter().filter(|of| of.rmse().is_some()).count()
    };
    for tick in 0..30 {
        assert_eq!(step(100 * tick, f64::NAN), 0);
    }
    // It goes back by less than the predictions reach, and no truth has been paired before.
    assert_eq!(step(2_050, 50.0), 0);
    assert_eq!(step(3_050, 50.0), 2);
}
