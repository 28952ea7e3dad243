//! Where the boxes of a diagram stand and where its arrows pass.
//!
//! Layers by longest path, long arrows broken by way points, orders within layers by the mean of the neighbours (Sugiyama,
//! Tagawa and Toda, IEEE Trans. SMC 11(2), 1981).

use super::{Diagram, Flow};

/// Sweeps over the layers; more do not change graphs of this size.
const SWEEPS: usize = 12;
/// Space between layers, and between boxes of a layer.
const BETWEEN_LAYERS: f64 = 72.0;
const BETWEEN_BOXES: f64 = 22.0;
/// Height of a way point.
const WAY_POINT: f64 = 14.0;

/// Where everything is.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Left, top, width and height of each box.
    pub boxes: Vec<[f64; 4]>,
    /// The way of each arrow: at least a start and an end.
    pub arrows: Vec<Vec<[f64; 2]>>,
    /// Width and height of the whole.
    pub size: [f64; 2],
}

/// One box, or one way point of an arrow.
struct Item {
    layer: usize,
    size: [f64; 2],
    y: f64,
    before: Vec<usize>,
    after: Vec<usize>,
}

impl Item {
    fn new(layer: usize, size: [f64; 2]) -> Self {
        Self {
            layer,
            size,
            y: 0.0,
            before: Vec::new(),
            after: Vec::new(),
        }
    }

    fn middle(&self) -> f64 {
        self.y + self.size[1] / 2.0
    }

    /// The mean of a value of the items on one side; none where there are none.
    fn mean(&self, is_before: bool, value: impl Fn(usize) -> f64) -> Option<f64> {
        let beside = if is_before { &self.before } else { &self.after };
        let sum: f64 = beside.iter().map(|&other| value(other)).sum();
        (!beside.is_empty()).then(|| sum / beside.len() as f64)
    }
}

/// Places boxes of the given widths and heights.
#[must_use]
pub fn layout(diagram: &Diagram, sizes: &[[f64; 2]]) -> Layout {
    let layers = layers(diagram);
    let boxes = layers.iter().zip(sizes);
    let mut items: Vec<Item> = boxes
        .map(|(&layer, &size)| Item::new(layer, size))
        .collect();
    let mut ways: Vec<Vec<usize>> = Vec::new();
    for arrow in &diagram.arrows {
        let mut way = vec![arrow.from];
        for layer in layers[arrow.from] + 1..layers[arrow.to].max(layers[arrow.from] + 1) {
            items.push(Item::new(layer, [0.0, WAY_POINT]));
            way.push(items.len() - 1);
        }
        way.push(arrow.to);
        if layers[arrow.to] > layers[arrow.from] {
            for pair in way.windows(2) {
                items[pair[0]].after.push(pair[1]);
                items[pair[1]].before.push(pair[0]);
            }
        }
        ways.push(way);
    }
    let columns = ordered(&items);
    let height = place(&mut items, &columns);
    finish(diagram, &items, &columns, &ways, height)
}

/// The layer of each box: one more than the deepest of those before it. Arrows that close loops do not count.
fn layers(diagram: &Diagram) -> Vec<usize> {
    let count = diagram.boxes.len();
    let mut layers = vec![0; count];
    // As many rounds as there are boxes settle any graph without a loop, and end for one with.
    for _ in 0..count {
        let before = layers.clone();
        for arrow in diagram.arrows.iter().filter(|a| a.kind != Flow::Delayed) {
            let deepest: usize = layers[arrow.from] + 1;
            layers[arrow.to] = layers[arrow.to].max(deepest.min(count));
        }
        if layers == before {
            break;
        }
    }
    layers
}

/// The items of each layer, in an order with few crossings.
fn ordered(items: &[Item]) -> Vec<Vec<usize>> {
    let depth = items.iter().map(|item| item.layer + 1).max().unwrap_or(0);
    let mut columns: Vec<Vec<usize>> = vec![Vec::new(); depth];
    for (index, item) in items.iter().enumerate() {
        columns[item.layer].push(index);
    }
    let mut rank = vec![0.0; items.len()];
    let remember = |columns: &[Vec<usize>], rank: &mut Vec<f64>| {
        for column in columns {
            for (position, &item) in column.iter().enumerate() {
                rank[item] = (position as f64 + 0.5) / column.len() as f64;
            }
        }
    };
    remember(&columns, &mut rank);
    for sweep in 0..SWEEPS {
        let forth = sweep % 2 == 0;
        for nth in 0..depth {
            let layer = if forth { nth } else { depth - 1 - nth };
            let key = |&item: &usize| {
                let mean = items[item].mean(forth, |other| rank[other]);
                mean.unwrap_or(rank[item])
            };
            columns[layer].sort_by(|a, b| key(a).total_cmp(&key(b)));
            remember(&columns[layer..=layer], &mut rank);
        }
    }
    columns
}

/// Gives each item a height, near the mean of its neighbours; gives the height of the whole.
fn place(items: &mut [Item], columns: &[Vec<usize>]) -> f64 {
    let of_column = |column: &[usize], items: &[Item]| {
        let sum: f64 = column.iter().map(|&item| items[item].size[1]).sum();
        sum + BETWEEN_BOXES * column.len().saturating_sub(1) as f64
    };
    let height = columns
        .iter()
        .map(|column| of_column(column, items))
        .fold(0.0, f64::max);
    for column in columns.iter() {
        let mut y = (height - of_column(column, items)) / 2.0;
        for &item in column {
            items[item].y = y;
            y += items[item].size[1] + BETWEEN_BOXES;
        }
    }
    // The last sweep looks back: a box belongs below what it is made from, rather than above what it goes into.
    for looks_back in (0..SWEEPS).map(|sweep| sweep % 2 == 1) {
        for column in columns.iter() {
            let wanted = |&item: &usize| {
                let item = &items[item];
                let mean = item.mean(looks_back, |other| items[other].middle());
                mean.map_or(item.y, |middle| middle - item.size[1] / 2.0)
            };
            let wanted: Vec<f64> = column.iter().map(wanted).collect();
            settle(items, column, &wanted, height);
        }
    }
    height
}

/// Moves the items of a column towards where they want to be, without changing their order or leaving the picture.
fn settle(items: &mut [Item], column: &[usize], wanted: &[f64], height: f64) {
    let mut least = 0.0;
    let mut lows = Vec::with_capacity(column.len());
    for (&item, &wanted) in column.iter().zip(wanted) {
        let y = wanted.max(least);
        lows.push(y);
        least = y + items[item].size[1] + BETWEEN_BOXES;
    }
    let mut most = height;
    for (position, &item) in column.iter().enumerate().rev() {
        let y = lows[position].min(most - items[item].size[1]);
        items[item].y = y;
        most = y - BETWEEN_BOXES;
    }
}

fn finish(
    diagram: &Diagram,
    items: &[Item],
    columns: &[Vec<usize>],
    ways: &[Vec<usize>],
    height: f64,
) -> Layout {
    let width = |column: &Vec<usize>| {
        let widths = column.iter().map(|&item| items[item].size[0]);
        widths.fold(0.0, f64::max)
    };
    let widths: Vec<f64> = columns.iter().map(width).collect();
    let mut lefts = Vec::with_capacity(columns.len());
    let mut left = 0.0;
    for width in &widths {
        lefts.push(left);
        left += width + BETWEEN_LAYERS;
    }
    let boxes: Vec<[f64; 4]> = items[..diagram.boxes.len()]
        .iter()
        .map(|item| [lefts[item.layer], item.y, widths[item.layer], item.size[1]])
        .collect();
    let arrows = ways
        .iter()
        .map(|way| {
            let mut points = Vec::new();
            for (position, &item) in way.iter().enumerate() {
                let (layer, middle) = (items[item].layer, items[item].middle());
                if position > 0 {
                    points.push([lefts[layer], middle]);
                }
                if position + 1 < way.len() {
                    points.push([lefts[layer] + widths[layer], middle]);
                }
            }
            points
        })
        .collect();
    Layout {
        boxes,
        arrows,
        size: [(left - BETWEEN_LAYERS).max(0.0), height],
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Arrow, Box, Class};
    use super::*;

    fn diagram(boxes: usize, arrows: &[(usize, usize)]) -> Diagram {
        Diagram {
            name: String::new(),
            boxes: (0..boxes)
                .map(|number| Box {
                    title: number.to_string(),
                    class: Class::Feature,
                    lines: Vec::new(),
                })
                .collect(),
            arrows: arrows
                .iter()
                .map(|&(from, to)| Arrow {
                    from,
                    to,
                    kind: Flow::Data,
                })
                .collect(),
        }
    }

    #[test]
    fn arrows_point_to_the_right_and_boxes_do_not_overlap() {
        let diagram = diagram(
            7,
            &[
                (0, 2),
                (0, 3),
                (1, 3),
                (2, 4),
                (3, 4),
                (0, 6),
                (4, 5),
                (1, 5),
            ],
        );
        let layout = layout(&diagram, &[[80.0, 40.0]; 7]);
        for (arrow, way) in diagram.arrows.iter().zip(&layout.arrows) {
            assert!(layout.boxes[arrow.from][0] < layout.boxes[arrow.to][0]);
            assert!(
                way.windows(2).all(|pair| pair[0][0] <= pair[1][0]),
                "{way:?}"
            );
        }
        for (number, a) in layout.boxes.iter().enumerate() {
            for b in &layout.boxes[number + 1..] {
                let apart_x = a[0] + a[2] <= b[0] || b[0] + b[2] <= a[0];
                let apart_y = a[1] + a[3] <= b[1] || b[1] + b[3] <= a[1];
                assert!(apart_x || apart_y, "{a:?} {b:?}");
            }
            assert!(a[1] >= 0.0 && a[1] + a[3] <= layout.size[1] + 1e-9, "{a:?}");
        }
    }

    #[test]
    fn crossed_neighbours_are_put_in_order() {
        let layout = layout(&diagram(4, &[(0, 3), (1, 2)]), &[[80.0, 40.0]; 4]);
        let above = |a: usize, b: usize| layout.boxes[a][1] < layout.boxes[b][1];
        assert_eq!(above(0, 1), above(3, 2));
    }

    #[test]
    fn a_loop_ends_the_layering_all_the_same() {
        let layout = layout(&diagram(2, &[(0, 1), (1, 0)]), &[[80.0, 40.0]; 2]);
        assert_eq!(layout.boxes.len(), 2);
    }

    #[test]
    fn nothing_is_an_empty_picture() {
        assert_eq!(layout(&diagram(0, &[]), &[]).size, [0.0, 0.0]);
    }
}
