//! The source keeps the rules of every source, and counts.

use std::path::Path;

use athermal_core::time::Duration;
use athermal_serve::testkit::{SourceTrial, assert_source};
use my_node::MyNode;

const CHANNELS: [(&str, &str); 2] = [("count.a", "a"), ("count.b", "b")];

#[test]
fn it_keeps_the_rules_of_every_source() {
    let source = MyNode::new(Duration::from_ns(2_000_000));
    assert_source(&source, Path::new("."), &CHANNELS, 20);
}

#[test]
fn each_channel_is_given_one_more_each_time() {
    let source = MyNode::new(Duration::from_ns(2_000_000));
    let trial = SourceTrial::new(&source, Path::new("."), &CHANNELS);
    let given = trial.run(10, &[]).unwrap();
    for (nth, sample) in given.iter().enumerate() {
        assert_eq!(sample.channel, nth % 2);
        assert_eq!(sample.value, (1 + nth / 2) as f64);
    }
}
