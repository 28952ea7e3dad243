//! A recipe as one file of `time`, `value` and `applies_at`, with times as text: `run` knows it ahead.

use crate::workbench::{Graph, Scratch, athermal, athermal_fed};

fn coming() -> Graph {
    Graph::new()
        .time("time")
        .with("unit = 'rfc3339'")
        .signal("set_point", "Cel", "chuck", "1h")
        .with("column = 'value'; known_ahead = '10min'")
        .node("recipe", "lag", "set_point")
        .with("lags = ['-5min', '0s']")
        .outputs("recipe = 'recipe'")
}

/// A row a minute: at first 20 °C, in the fourth minute 50 °C from the thirteenth on, in the 21st 30 °C without an instant.
fn recipe() -> String {
    let row = |minute: usize| {
        let announced = match minute {
            0 => "20.0,2025-01-01T00:00:00Z",
            // The same instant with another offset.
            3 => "50.0,2025-01-01T01:12:00+01:00",
            20 => "30.0,",
            _ => ",",
        };
        format!("2025-01-01T00:{minute:02}:00Z,{announced}\n")
    };
    "time,value,applies_at\n".to_owned() + &(0..30).map(row).collect::<String>()
}

/// The last two cells of each row of a table.
fn cells(table: &str) -> Vec<[f64; 2]> {
    let row = |line: &str| {
        let mut cells = line.rsplit(',').map(|cell| cell.parse().unwrap());
        let (now, ahead) = (cells.next().unwrap(), cells.next().unwrap());
        [ahead, now]
    };
    table.lines().skip(1).map(row).collect()
}

#[test]
fn a_recipe_with_instants_as_text_is_known_ahead() {
    let scratch = Scratch::new("planned-rows");
    let graph = scratch.file("graph.toml", coming());
    let recipe = recipe();
    let input = scratch.file("recipe.csv", &recipe);
    let run = athermal(&[&"run", &graph, &"--input", &input]).ended(0);
    let found = cells(&run.out);
    assert_eq!(found.len(), 30);
    for (minute, cells) in found.iter().enumerate() {
        let step = |at: usize| match minute {
            20.. => 30.0,
            _ if minute >= at => 50.0,
            _ => 20.0,
        };
        assert_eq!(*cells, [step(7), step(12)], "minute {minute}");
    }
    let piped = athermal_fed(&[&"run", &graph, &"--input", &"-"], recipe.as_bytes()).ended(0);
    assert_eq!(piped.out, run.out);
}

#[test]
fn an_instant_that_is_none_is_refused_with_its_place() {
    let scratch = Scratch::new("planned-rows-wrong");
    let graph = scratch.file("graph.toml", coming());
    let wrong = recipe().replace("2025-01-01T01:12:00+01:00", "soon");
    let input = scratch.file("recipe.csv", wrong);
    athermal(&[&"run", &graph, &"--input", &input])
        .ended(2)
        .tells(&["recipe.csv:5: column `applies_at`", "soon"]);
}
