//! How instances of a node are named, and what belongs together.

/// Whether a prediction is what an instance puts out: `thermal.Z1` is, of itself and of `thermal`.
#[must_use]
pub fn is_of(prediction: &str, node: &str) -> bool {
    let rest = prediction.strip_prefix(node);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// What is alike in `by` together, in the order in which the first of each comes.
pub fn grouped<T, K: PartialEq>(all: impl Iterator<Item = T>, by: impl Fn(&T) -> K) -> Vec<Vec<T>> {
    let mut groups: Vec<(K, Vec<T>)> = Vec::new();
    for one in all {
        let key = by(&one);
        match groups.iter_mut().find(|(known, _)| *known == key) {
            Some((_, group)) => group.push(one),
            None => groups.push((key, vec![one])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

/// The node of an instance: `thermal` of `thermal.Z1`.
pub(super) fn name_of(instance: &str) -> &str {
    instance.split_once('.').map_or(instance, |(node, _)| node)
}

/// The axis of a channel: `Z1` of `thermal.Z1`, and the whole of a name without one.
#[must_use]
pub fn axis_of(channel: &str) -> String {
    let axis = channel.split_once('.').map_or(channel, |(_, axis)| axis);
    axis.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prediction_is_of_its_instance_and_of_its_node_and_of_none_that_begins_alike() {
        let of = ["thermal", "thermal.Z1", "therm", "thermal.Z"];
        assert_eq!(
            of.map(|node| is_of("thermal.Z1", node)),
            [true, true, false, false]
        );
    }
}
