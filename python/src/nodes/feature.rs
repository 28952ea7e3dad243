//! A feature that is written in Python.

use athermal::core::node::KindFacts;
use athermal::core::node::prelude::*;
use athermal::core::state;
use pyo3::exceptions::PyValueError;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyList;

use super::{Parameters, ask, raise};

/// A feature that is written in Python, for trying things out: a class or function decorated with `@athermal.feature`.
///
/// It runs only where Python does, in the package `athermal`, and a model with it imports the module that it names.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PythonFeature {
    /// The class or function as `module:Name`; the name alone of what was decorated in this process.
    python: String,
    /// Its named arguments.
    #[serde(default)]
    parameters: Parameters,
}

/// What the decorator was given.
#[derive(Debug, Default, FromPyObject)]
struct Facts {
    span: Option<String>,
    memory: Option<String>,
    endless: bool,
    own: bool,
    every_tick: bool,
}

/// What it is about: its channels by name and unit.
type Channels = Vec<(String, String)>;

fn length(text: Option<&str>) -> Result<Duration, String> {
    text.map_or(Ok(Duration::ZERO), |text| {
        text.parse()
            .map_err(|_| format!("`{text}` is no length of time, such as \"5min\""))
    })
}

impl PythonFeature {
    /// What the decorator was given; what is not known to the compiler already is of no use.
    fn facts(&self) -> Facts {
        Python::attach(|py| ask(py, "facts", (&self.python, "feature"))?.extract())
            .unwrap_or_default()
    }

    fn made<'py>(&self, py: Python<'py>, inputs: &Inputs) -> PyResult<Bound<'py, PyAny>> {
        let channels = inputs.port("signal").iter();
        let channels = channels.map(|of| (of.name.clone(), of.unit.to_string()));
        let parameters = serde_json::Value::from(self.parameters.clone()).to_string();
        ask(
            py,
            "feature_at_work",
            (&self.python, parameters, channels.collect::<Channels>()),
        )
    }
}

impl Feature for PythonFeature {
    fn facts() -> KindFacts {
        KindFacts {
            can_change: true,
            ..KindFacts::default()
        }
    }

    fn inputs() -> &'static [InputPort] {
        const {
            &[InputPort::fresh(
                "signal",
                "what the class or function is given",
            )]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let wrong = |message: String| vec![Mistake::at("python", message)];
        let planned = Python::attach(|py| -> PyResult<(Channels, Facts)> {
            let made = self.made(py, inputs)?;
            let facts = ask(py, "facts", (&self.python, "feature"))?;
            Ok((made.getattr("outputs")?.extract()?, facts.extract()?))
        });
        let (outputs, facts) =
            planned.map_err(|error| wrong(format!("`{}`: {error}", self.python)))?;
        length(facts.memory.as_deref()).map_err(wrong)?;
        let own_span = length(facts.span.as_deref()).map_err(wrong)?;
        let read = inputs.port("signal").iter();
        let max_age = read.clone().filter_map(|of| of.max_age).max();
        let span = read.map(|of| of.span).max().unwrap_or_default() + own_span;
        let channels = outputs.into_iter().map(|(name, unit)| {
            let unit = Unit::parse(&unit).map_err(|error| {
                wrong(format!(
                    "`{}` gives `{name}` in `{unit}`: {}",
                    self.python,
                    error.reason()
                ))
            })?;
            Ok(Channel {
                name,
                unit,
                span,
                ahead: Duration::ZERO,
                max_age,
            })
        });
        Ok(vec![OutputPort {
            name: "value",
            channels: channels.collect::<Result<_, Vec<Mistake>>>()?,
        }])
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let made = Python::attach(|py| Ok(self.made(py, inputs)?.unbind()));
        Box::new(Running {
            python: self.python.clone(),
            width: inputs.port("signal").len(),
            made: made.unwrap_or_else(|error| raise(error)),
        })
    }

    fn every_tick(&self) -> bool {
        self.facts().every_tick
    }

    fn reach(&self, _port: &str) -> Reach {
        match self.facts().own {
            true => Reach::Own,
            false => Reach::All,
        }
    }

    fn is_endless(&self) -> bool {
        self.facts().endless
    }

    fn memory(&self) -> Duration {
        length(self.facts().memory.as_deref()).unwrap_or_default()
    }
}

athermal::core::register!(PythonFeature, Feature, "python_feature");

/// An object that runs.
struct Running {
    python: String,
    width: usize,
    made: Py<PyAny>,
}

/// What an object knows, in the words of its own.
#[derive(Debug, Serialize, Deserialize)]
struct Known {
    python: String,
    width: usize,
    text: String,
}

state!(Known, "python_feature/1");

impl Running {
    fn answer(&self, py: Python<'_>, tick: &Tick<'_>) -> PyResult<Option<Vec<Option<f64>>>> {
        let values = tick.port(0).iter();
        let values = PyList::new(py, values.map(|value| (!value.is_nan()).then_some(*value)))?;
        let step = intern!(py, "step");
        let now = tick.now.as_ns();
        self.made
            .bind(py)
            .call_method1(step, (now, values))?
            .extract()
    }
}

impl Operator for Running {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let answer = Python::attach(|py| {
            let answer = self.answer(py, tick)?;
            match &answer {
                Some(values) if values.len() != outputs.len() => {
                    Err(PyValueError::new_err(format!(
                        "`{}` gives {} values and has {} outputs",
                        self.python,
                        values.len(),
                        outputs.len()
                    )))
                }
                _ => Ok(answer),
            }
        });
        let answer = answer.unwrap_or_else(|error| raise(error));
        for (nth, value) in answer.into_iter().flatten().enumerate() {
            if let Some(value) = value {
                outputs.set(nth, value);
            }
        }
    }

    fn segment(&mut self) {
        let done = Python::attach(|py| self.made.call_method0(py, "segment").map(drop));
        done.unwrap_or_else(|error| raise(error));
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        let text = Python::attach(|py| self.made.call_method0(py, "snapshot")?.extract(py));
        let text: Option<String> = text.unwrap_or_else(|error: PyErr| raise(error));
        Some(Box::new(Known {
            python: self.python.clone(),
            width: self.width,
            text: text?,
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let known: Known = match state.known() {
            Ok(known) => known,
            Err(cold) => return cold,
        };
        if (&known.python, known.width) != (&self.python, self.width) {
            return Restored::cold(format!(
                "the state is that of `{}` with {} channels",
                known.python, known.width
            ));
        }
        let taken = Python::attach(|py| {
            self.made
                .call_method1(py, "restore", (known.text,))
                .map(drop)
        });
        match taken {
            Ok(()) => Restored::Accepted,
            Err(error) => Restored::cold(error.to_string()),
        }
    }
}
