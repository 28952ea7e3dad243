//! Decides which rules there are, and what to do about a broken one; how each is tried is decided by its module.

use std::fmt;

/// What every node must do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rule {
    /// The kind, its ports and its parameters are explained, and bare numbers have no unit hidden in their names.
    Explained,
    /// The kind, its states and its predictors have names that no other has, and its ports and channels such as a reference can name.
    Names,
    /// A case compiles, and something comes out of the node in it; out of each channel in one case or another.
    Answers,
    /// The parameters written out and read back are the same.
    ReadsBack,
    /// All that the schema allows is accepted and runs, words and switches among it.
    Ranges,
    /// The same samples give the same bits, again and on another thread.
    Deterministic,
    /// Beside another instance, tick by tick, the same bits come out as in one long run over a recording.
    LongRun,
    /// What goes on from a snapshot gives the same bits as what never stopped.
    Restores,
    /// A snapshot of another version, kind or shape is refused with a reason.
    Versions,
    /// What has never been measured is not answered, and gaps anywhere do no harm.
    Absence,
    /// Huge and infinite samples do no harm that outlasts them, and nothing infinite comes out.
    Infinity,
    /// A value is made of the channels that `reach` names, as far back as its span, and of nothing yet to come.
    Past,
    /// What fills a gap is as old as the sample that it was.
    Stamps,
    /// What starts as far back as `memory` reaches gives what one gives that has always run.
    Memory,
    /// A new segment starts afresh, at whatever time it begins.
    Segments,
    /// A port gives the same bits whatever is read beside it.
    Wanted,
    /// However many channels come, where it takes so many, it runs, and gives the same bits again.
    Widths,
    /// The same samples in other units give the same outputs in theirs.
    Units,
    /// Once warm, a tick allocates nothing.
    Allocation,
    /// A combiner takes no absent vote for zero, and its answer is the sum of the votes by its weights where it weighs.
    Votes,
    /// A promised standard deviation is present and not negative; an interval stands about the prediction.
    Uncertainty,
    /// A promised novelty is hardly ever above 1 on the data of the fit, above 1 far from them, and up to 1 changes no prediction.
    Novelty,
    /// An answer that is asked for leaves no trace.
    NoTrace,
    /// A fit is the same with any number of threads; data that allow none are an error in words.
    Fits,
    /// A fitted estimator written into a model and read back predicts with the same bits.
    Models,
    /// A fitted estimator that says to be a linear form predicts what the form does, and so does one that goes on learning.
    Linear,
    /// A model that was edited by hand is refused in words, or runs.
    Edited,
}

impl Rule {
    /// The name by which reports call it: `reads back`.
    #[must_use]
    pub fn name(self) -> String {
        let mut name = String::new();
        for letter in format!("{self:?}").chars() {
            if letter.is_uppercase() && !name.is_empty() {
                name.push(' ');
            }
            name.extend(letter.to_lowercase());
        }
        name
    }

    /// What to do where it is broken.
    #[must_use]
    pub fn advice(self) -> &'static str {
        match self {
            Self::Explained => {
                "write a doc comment of a sentence or more; it is what `athermal nodes KIND` prints. Give times as `Duration` \
                 and sizes as `Quantity`, so that the unit stands in the graph file"
            }
            Self::Names => {
                "take another name, and begin those of states and predictors with that of the kind: all crates of a program share them. \
                 Ports and kinds are a letter, then letters, digits, `_` and `-`; a feature of several output ports declares them in `ports`"
            }
            Self::Answers => {
                "give the case what a graph file needs too, such as `ahead = \"5min\"` in `Case::new`, and inputs with which the node has \
                 something to say (`Case::input`, `Case::between`)"
            }
            Self::ReadsBack => {
                "let `Serialize` and `Deserialize` of the parameters be each other's inverse, defaults included"
            }
            Self::Ranges => {
                "declare the range in the schema, which the compiler checks (`#[schemars(range(min = 0.0, max = 1.0))]`, or \
                 `#[schemars(extend(\"exclusiveMinimum\" = 0.0))]`), refuse a quantity of another unit, and run with everything \
                 else, each of the words of an `enum` included"
            }
            Self::Deterministic => {
                "take no time, no random number without a seed, no order of a hash map and no address into account"
            }
            Self::LongRun => {
                "keep all that the node knows in its operator: no `static`, no `thread_local!`, nothing shared by two instances"
            }
            Self::Restores => {
                "put all that later outputs depend on into the state that `snapshot` gives, and take all of it in `restore`"
            }
            Self::Versions => {
                "name the state `kind/1`; in `restore`, answer `Restored::cold(reason)` to a state that is not `known`, or whose \
                 lists have other lengths than this node's"
            }
            Self::Absence => {
                "where an input is NaN, set no output or NaN, never 0. Ports that have something to say of nothing are named by \
                 `Case::speaks_without_input`"
            }
            Self::Infinity => {
                "give NaN where a result is not finite, and keep no such value: begin again where `!value.is_finite()`"
            }
            Self::Past => {
                "state in `outputs` the span that a value summarises, or `is_endless` where it depends on all of the past; name in `reach` \
                 all that a channel is made of; give no stamp that is later than `tick.now`"
            }
            Self::Stamps => {
                "give a value that is held, or stands for one that is missing, at the time of the sample that it was (`Outputs::set_stamped` \
                 with `Tick::stamps`), or none at all, and never 0; say `every_tick` where the answer changes with time alone"
            }
            Self::Memory => {
                "state in `memory` how far back the inputs reach that outputs depend on, the longest window or dwell, with what still counts of \
                 what fades; say `is_endless` where that is all of the past"
            }
            Self::Segments => {
                "clear in `segment` all that `step` has gathered, the last instant included; what was learned may stay, and its instants \
                 move by the shift that `segment` is given"
            }
            Self::Wanted => {
                "count the places of outputs over all ports in their order, those that `wanted` says nobody reads included, and leave these \
                 unset"
            }
            Self::Widths => {
                "take the number of channels from `Inputs` in `build`, or of regressors from `TrainingSetup`, and refuse numbers that cannot be \
                 by a `Mistake`; go through nothing in the order of a hash map"
            }
            Self::Units => {
                "convert parameters given with a unit into the unit of the channel (`Quantity::in_unit`), state the right unit for \
                 each output, and have no bare thresholds"
            }
            Self::Allocation => {
                "make room in `build` and `restore` (`vec![…; n]`, `reserve`), and use it again at every tick"
            }
            Self::Votes => {
                "combine `Votes::present` alone, and let `weights` be NaN for a vote that is not there and, for the others, the factors \
                 of which `combine` is the sum"
            }
            Self::Uncertainty => {
                "give NaN where no deviation or interval is known; else a deviation of 0 or more, and the lower end before the upper, \
                 with the combination between them. An estimator that says `has_std_dev` gives one in `Predictor::std_dev`, and in \
                 `Learner::std_dev` if it learns"
            }
            Self::Novelty => {
                "keep in the fit what says how far regressors are outside of its rows, give it in `Predictor::novelty`, and in \
                 `Learner::novelty` if it learns, 1 being where one row of a thousand lies beyond"
            }
            Self::NoTrace => {
                "let `predict` and `combine` change nothing, not even behind a `Cell`, that later answers depend on"
            }
            Self::Fits => {
                "in `Trainer::finish`, answer `TrainingError` where there are too few rows or no solution, and start random numbers \
                 from a seed; let `Predictor::uses` name regressors of `TrainingSetup`; a feature that is fitted has an `Encoder`, a \
                 port `truth`, and nothing to say without a fit. A learner's `Predictor::trained_range` holds the `TrainedRange` of its rows, or \
                 `Estimator::keeps_range` says that there is none"
            }
            Self::Models => {
                "let the predictor's serde form hold every number that it predicts with, and use `athermal_core::node::number` where \
                 one may be infinite or NaN"
            }
            Self::Linear => {
                "let `predict` be `LinearForm::at` of what `linear` gives, of a `Predictor` as of a `Learner`, with a coefficient for \
                 each of `uses`; where a prediction is anything else, leave `linear` out"
            }
            Self::Edited => {
                "say in `Predictor::mistakes` what does not fit together, such as a list that is not as long as `uses`: it is asked \
                 when a model is read, and nothing else of the predictor is if there is any"
            }
        }
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.name())
    }
}
