//! The engine thread allocates nothing, at a hand-over, while catching up and at a segment break neither.

use athermal::core::prng::Prng;

use super::course::{live, rows};
use super::model::{d, model};

const GRAPH: &str = include_str!("../../../graphs/die-tester.toml");

#[test]
fn the_engine_thread_allocates_and_frees_nothing() {
    let text = GRAPH.replace("memory = \"15min\"", "memory = \"20min\"");
    let graphs = [model(GRAPH, "0"), model(&text, "0"), model(GRAPH, "1")];
    let (mut stepper, mut control) = live(&graphs[0]);
    let channels = stepper.feed().len();
    let data = rows(&mut Prng::stream(4, "rows"), channels, 6, 3000);
    let mut total = 0;
    let mut first = None;
    for (tick, (time, row)) in data.iter().enumerate() {
        if tick >= 800 && tick % 100 == 0 {
            control.stage(&graphs[(tick / 100) % 3], false).unwrap();
            control.commit().unwrap();
        }
        let warm = tick >= 800;
        let time = *time + d(if tick >= 2050 { 1 } else { 0 });
        let counted = allocation_counter::measure(|| {
            if tick == 2050 {
                stepper.segment();
            }
            stepper.step(time, row).unwrap();
        });
        if warm && tick < 2050 || tick == 2050 {
            total += counted.count_total;
            if counted.count_total > 0 {
                first.get_or_insert(tick);
            }
            assert!(counted.count_current >= 0, "freed at tick {tick}");
        }
        control.pump();
    }
    assert_eq!(total, 0, "first at tick {first:?}");
}
