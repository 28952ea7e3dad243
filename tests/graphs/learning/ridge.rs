//! A ridge beside the program: slopes by their formula and normal equations by elimination, with nothing of its code.

/// Lines of `(time, [room, plate, frame, position, sound])`.
pub type Rows = [(i64, [f64; 5])];

const WINDOWS: [i64; 4] = [150, 300, 600, 1200];
const WIDTH: usize = 3 * WINDOWS.len();

/// The slopes of temperatures at an instant, and those of the position and of the sound one.
pub struct Line {
    pub time: i64,
    features: [f64; WIDTH],
    truth: f64,
    pub reference: f64,
}

/// The slope of a column over a window that ends at a row, by least squares; NaN of less than two values.
fn slope(rows: &Rows, column: usize, last: usize, window: i64) -> f64 {
    let now = rows[last].0;
    let within = rows[..=last]
        .iter()
        .rev()
        .take_while(|(time, _)| now - time < window);
    let values: Vec<(f64, f64)> = within
        .filter(|(_, row)| !row[column].is_nan())
        .map(|(time, row)| ((time - now) as f64, row[column]))
        .collect();
    let count = values.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| values.iter().map(of).sum::<f64>() / count;
    let (t, v) = (mean(&|pair| pair.0), mean(&|pair| pair.1));
    let both: f64 = values.iter().map(|pair| (pair.0 - t) * (pair.1 - v)).sum();
    both / values.iter().map(|pair| (pair.0 - t).powi(2)).sum::<f64>()
}

/// The lines of all rows with a position, from the longest window on. Truths are per minute.
pub fn lines(rows: &Rows) -> Vec<Line> {
    let first = rows[0].0 + WINDOWS[WINDOWS.len() - 1];
    let all = rows.iter().enumerate();
    let whole = all.filter(|(_, (time, row))| *time >= first && !row[4].is_nan());
    let line = |(last, (time, _)): (usize, &(i64, [f64; 5]))| Line {
        time: *time,
        features: std::array::from_fn(|nth| {
            slope(
                rows,
                nth / WINDOWS.len(),
                last,
                WINDOWS[nth % WINDOWS.len()],
            )
        }),
        truth: 60.0 * slope(rows, 3, last, 300),
        reference: 60.0 * slope(rows, 4, last, 300),
    };
    whole.map(line).collect()
}

/// Coefficients of standardised features and a constant.
pub struct Ridge {
    means: [f64; WIDTH],
    scales: [f64; WIDTH],
    coefficients: Vec<f64>,
}

impl Ridge {
    /// Fitted with a penalty of 1, the constant without.
    pub fn of(lines: &[Line]) -> Self {
        let count = lines.len() as f64;
        let mean = |of: &dyn Fn(&Line) -> f64| lines.iter().map(of).sum::<f64>() / count;
        let means: [f64; WIDTH] = std::array::from_fn(|nth| mean(&|line| line.features[nth]));
        let variance = |nth: usize| mean(&|line| (line.features[nth] - means[nth]).powi(2));
        let mut ridge = Self {
            means,
            scales: std::array::from_fn(|nth| variance(nth).sqrt()),
            coefficients: Vec::new(),
        };
        const ORDER: usize = WIDTH + 1;
        let mut equations = vec![[0.0; ORDER + 1]; ORDER];
        for line in lines {
            let row = ridge.row(line);
            for (i, equation) in equations.iter_mut().enumerate() {
                for (cell, x) in equation.iter_mut().zip(row.iter().chain([&line.truth])) {
                    *cell += row[i] * x;
                }
            }
        }
        for (i, equation) in equations.iter_mut().enumerate().take(WIDTH) {
            equation[i] += 1.0;
        }
        for k in 0..ORDER {
            let pivot = equations[k].map(|cell| cell / equations[k][k]);
            equations[k] = pivot;
            for (i, equation) in equations.iter_mut().enumerate() {
                let share = if i == k { 0.0 } else { equation[k] };
                for (cell, of) in equation.iter_mut().zip(pivot) {
                    *cell -= share * of;
                }
            }
        }
        ridge.coefficients = equations.iter().map(|equation| equation[ORDER]).collect();
        ridge
    }

    fn row(&self, line: &Line) -> [f64; WIDTH + 1] {
        std::array::from_fn(|nth| match nth {
            WIDTH => 1.0,
            _ => (line.features[nth] - self.means[nth]) / self.scales[nth],
        })
    }

    /// The root mean square by which it misses the reference.
    pub fn rmse<'a>(&self, lines: impl Iterator<Item = &'a Line>) -> f64 {
        let errors: Vec<f64> = lines
            .map(|line| {
                let row = self.row(line);
                let products = row.iter().zip(&self.coefficients);
                products.map(|(x, b)| x * b).sum::<f64>() - line.reference
            })
            .collect();
        (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
    }
}
