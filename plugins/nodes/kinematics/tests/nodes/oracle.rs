//! The point of a chain whose links are grown and turned for good, by matrices of 4 × 4: small motions must agree with the node.

use std::sync::Arc;

use athermal_core::compile::{Plan, Wanted, compile};
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{Memory, declare, load_text};
use athermal_core::engine::{Engine, Fitted};
use athermal_core::time::Instant;
use athermal_kinematics as _;

type Matrix = [[f64; 4]; 4];

/// A rotation by Rodrigues' formula and a shift behind it, as one matrix.
fn rigid(about: [f64; 3], angle: f64, shift: [f64; 3]) -> Matrix {
    let [x, y, z] = about;
    let (s, c) = angle.sin_cos();
    let v = 1.0 - c;
    [
        [
            c + x * x * v,
            x * y * v - z * s,
            x * z * v + y * s,
            shift[0],
        ],
        [
            y * x * v + z * s,
            c + y * y * v,
            y * z * v - x * s,
            shift[1],
        ],
        [
            z * x * v - y * s,
            z * y * v + x * s,
            c + z * z * v,
            shift[2],
        ],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

fn product(a: Matrix, b: Matrix) -> Matrix {
    let entry = |row: usize, column: usize| (0..4).map(|k| a[row][k] * b[k][column]).sum();
    [0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| entry(row, column)))
}

/// A link: its vector in m, its direction, the axis that it turns about, and by how much it grows in m or turns in rad.
struct Moved {
    length: f64,
    along: [f64; 3],
    about: Option<[f64; 3]>,
    by: f64,
}

fn unit(of: [f64; 3]) -> [f64; 3] {
    let length = of.iter().map(|part| part * part).sum::<f64>().sqrt();
    of.map(|part| part / length)
}

/// The frame at the point, with all links moved.
fn frame(links: &[Moved], point: [f64; 3]) -> Matrix {
    let still = rigid([0.0, 0.0, 1.0], 0.0, [0.0; 3]);
    let end = links.iter().fold(still, |frame, link| {
        let (grown, angle) = match link.about {
            None => (link.by, 0.0),
            Some(_) => (0.0, link.by),
        };
        let about = unit(link.about.unwrap_or([0.0, 0.0, 1.0]));
        let shift = unit(link.along).map(|part| part * (link.length + grown));
        let turned = product(frame, rigid(about, angle, [0.0; 3]));
        product(turned, rigid(about, 0.0, shift))
    });
    product(end, rigid([0.0, 0.0, 1.0], 0.0, point))
}

const LINKS: &str = r#"
links = [
  { length = "600 mm", along = [0, 0, 1] },
  { length = "350 mm", along = [1, 0.2, 0], about = [0, 1, 0.3] },
  { length = "12 cm", along = [0, -1, 1] },
  { length = "80 mm", along = [0, 0, -2], about = [1, 1, 1] },
]
point = ["15 mm", "-4 mm", "-30 mm"]
"#;

fn text(signals: &str, parameters: &str) -> String {
    format!(
        "schema = 1\n{signals}\n[nodes.tool]\ntype = \"kinematics\"\ninputs.links = [\"grows.column\", \"turns.arm\", \
         \"grows.head\", \"turns.tilt\"]\n{parameters}\n[outputs]\nmoved = \"tool\"\nturned = \"tool:rotation\"\n"
    )
}

const SIGNALS: &str = "signals.grows = { unit = \"nm\", channels = [\"column\", \"head\"], max_age = \"1s\" }\n\
    signals.turns = { unit = \"urad\", channels = [\"arm\", \"tilt\"], max_age = \"1s\" }\n";

/// The plan of a text, or what is wrong with it.
fn compiled(text: &str) -> Result<Plan, String> {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let graph = load_text(
        "graph.toml",
        text,
        &Memory::new(),
        &mut sources,
        &mut diagnostics,
    )
    .and_then(|document| declare(document, &mut diagnostics));
    let plan = graph.and_then(|graph| compile(&graph, Wanted::default(), &mut diagnostics));
    plan.ok_or_else(|| diagnostics.render(&sources, false, 160))
}

/// What a graph gives for the motions of column, head, arm and tilt.
fn moved(text: &str, samples: [f64; 4]) -> Vec<f64> {
    let plan = compiled(text).unwrap_or_else(|problems| panic!("{problems}"));
    let mut engine = Engine::new(Arc::new(plan), &Fitted::new()).unwrap();
    engine.step(Instant::from_ns(0), &samples).unwrap().to_vec()
}

/// Column and head in nm, arm and tilt in urad: how the chain of matrices moves and turns, in nm and urad.
fn expected(column: f64, head: f64, arm: f64, tilt: f64) -> [f64; 6] {
    let links = |part: f64| {
        [
            (0.6, [0.0, 0.0, 1.0], None, 1e-9 * column),
            (0.35, [1.0, 0.2, 0.0], Some([0.0, 1.0, 0.3]), 1e-6 * arm),
            (0.12, [0.0, -1.0, 1.0], None, 1e-9 * head),
            (0.08, [0.0, 0.0, -2.0], Some([1.0, 1.0, 1.0]), 1e-6 * tilt),
        ]
        .map(|(length, along, about, by)| Moved {
            length,
            along,
            about,
            by: part * by,
        })
    };
    // From both sides, so that what is of second order falls out.
    let point = [0.015, -0.004, -0.03];
    let [after, before] = [0.5, -0.5].map(|part| frame(&links(part), point));
    let shift = |nth: usize| 1e9 * (after[nth][3] - before[nth][3]);
    let turn = |row: usize, column: usize| {
        let both = |of: &Matrix| 0.5 * (of[row][column] - of[column][row]);
        1e6 * (both(&after) - both(&before))
    };
    [
        shift(0),
        shift(1),
        shift(2),
        turn(2, 1),
        turn(0, 2),
        turn(1, 0),
    ]
}

#[test]
fn a_point_moves_as_a_chain_of_matrices_that_is_moved_for_good() {
    let graph = text(SIGNALS, LINKS);
    for [column, head, arm, tilt] in [
        [1000.0, 0.0, 0.0, 0.0],
        [0.0, -700.0, 0.0, 0.0],
        [0.0, 0.0, 3.0, 0.0],
        [0.0, 0.0, 0.0, -8.0],
        [1234.0, -321.0, 4.0, 7.0],
    ] {
        let found = moved(&graph, [column, head, arm, tilt]);
        let expected = expected(column, head, arm, tilt);
        for (nth, (found, expected)) in found.iter().zip(expected).enumerate() {
            let size = if nth < 3 { 1000.0 } else { 10.0 };
            assert!(
                (found - expected).abs() < 1e-6 * size,
                "output {nth}: {found} instead of {expected}"
            );
        }
    }
}

#[test]
fn an_arm_of_half_a_metre_that_turns_by_a_microradian_moves_its_end_by_500_nm() {
    let signals = "signals.turns = { unit = \"urad\", channels = [\"arm\"], max_age = \"1s\" }";
    let graph = format!(
        "schema = 1\n{signals}\n[nodes.tool]\ntype = \"kinematics\"\ninputs.links = \"turns\"\n\
         links = [{{ length = \"50 cm\", along = [1, 0, 0], about = [0, 0, 1] }}]\n\
         [outputs]\nmoved = \"tool\"\nturned = \"tool:rotation\"\n"
    );
    let plan = compiled(&graph).unwrap_or_else(|problems| panic!("{problems}"));
    let mut engine = Engine::new(Arc::new(plan), &Fitted::new()).unwrap();
    let found = engine.step(Instant::from_ns(0), &[1.0]).unwrap();
    for (found, expected) in found.iter().zip([0.0, 500.0, 0.0, 0.0, 0.0, 1.0]) {
        assert!(
            (found - expected).abs() < 1e-9,
            "{found} instead of {expected}"
        );
    }
}

#[test]
fn what_a_missing_link_does_not_move_is_still_known() {
    let found = moved(&text(SIGNALS, LINKS), [f64::NAN, 5.0, 1.0, 1.0]);
    // The column grows along Z alone.
    assert!(found[2].is_nan());
    let others = [0, 1, 3, 4, 5];
    assert!(
        others.iter().all(|&nth| found[nth].is_finite()),
        "{found:?}"
    );
}

#[test]
fn what_does_not_fit_is_refused_with_what_was_found() {
    let about = LINKS.replace(", about = [0, 1, 0.3]", "");
    let grown = LINKS.replace(
        "along = [0, -1, 1] }",
        "along = [0, -1, 1], about = [0, 0, 1] }",
    );
    let short = LINKS.replace("  { length = \"12 cm\", along = [0, -1, 1] },\n", "");
    let still = LINKS.replace("along = [0, 0, -2]", "along = [0, 0, 0]");
    let warm = LINKS.replace("\"12 cm\"", "\"12 K\"");
    let unit = format!("unit = \"nm/min\"\n{LINKS}");
    let rate = SIGNALS.replace("urad", "urad/min");
    let heat = SIGNALS.replace("\"nm\"", "\"K\"");
    for (signals, parameters, words) in [
        (SIGNALS, &about, "nothing says about which axis it turns"),
        (
            SIGNALS,
            &grown,
            "its input is a length, which turns nothing",
        ),
        (SIGNALS, &short, "there are 3 `links` for 4 channels"),
        (SIGNALS, &still, "a direction has a length above 0"),
        (SIGNALS, &warm, "is in K, which is no length"),
        (
            SIGNALS,
            &unit,
            "`unit` is nm/min, and a point moves by a length",
        ),
        (
            &rate,
            &LINKS.to_owned(),
            "a motion and a rate do not add up",
        ),
        (&heat, &LINKS.to_owned(), "is in K, which moves no link"),
    ] {
        let problems = compiled(&text(signals, parameters)).unwrap_err();
        assert!(problems.contains(words), "{words} in\n{problems}");
    }
}
