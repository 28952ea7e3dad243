//! What reports ask of a kind beside its ports and parameters: data of the kind, which [`register!`](crate::register) reads, so that nobody
//! else has to know kinds by their names.

/// What a kind of node is to whoever reports on a graph.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct KindFacts {
    /// Its outputs are changes or figures of their own, whatever it reads: their zero is not arbitrary, as that of a position is.
    pub is_change: bool,
    /// What the numbers of the port with its reasons say, by number; nothing of one that says nothing.
    pub reasons: &'static [&'static str],
    /// What it does, where reports go by that.
    pub duty: Duty,
    /// What runs may be another for the same parameters, such as a class of Python: models with it share no plan.
    pub can_change: bool,
    /// Of a feature, how often its channels are given something.
    pub pace: Pace,
}

/// How often the channels of a feature are given something.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Pace {
    /// All when it runs.
    #[default]
    Together,
    /// Those that are made of a channel of its first port when that is, in all ports.
    ByChannel,
    /// Those of its first port when the channels that pass through it are, which its first input begins with; the others at every tick.
    Passes,
    /// All when its second input is.
    BySecond,
}

/// What a node does for a graph. Names are those of parameters, each a quantity or a duration.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Duty {
    /// Nothing that a report goes by.
    #[default]
    None,
    /// Takes slopes: the first port has one of each channel for every one of the `windows`, in `unit`.
    Slope,
    /// Watches over sensors: the second port gives the reason of each.
    Watch,
    /// Compares sensors: the port `reason` is 1 where one contradicts the others, and 2 while it recovers.
    Compare,
    /// Integrates rates into corrections. The second port gives what holds each back: 1 where there is no valid prediction.
    Correct,
    /// Puts back what a correction took away.
    PutBack,
    /// Asks for alignments at the port `ask`.
    Ask {
        /// Where it asks.
        tolerance: &'static str,
    },
    /// What drifts cost.
    Loss {
        /// The window of the drifts.
        over: &'static str,
    },
    /// How long a loss takes to settle after its set point has changed; gives that at the port `since`.
    Settle {
        /// Where it has settled.
        below: &'static str,
        /// The smallest change that counts.
        change: &'static str,
    },
    /// Grades drifts.
    Grade {
        /// Below which a drift is stable.
        stable: &'static str,
        /// Above which it is transient.
        transient: &'static str,
    },
    /// Takes the first of its voters that has a value.
    Fallback,
}

impl KindFacts {
    /// Those of a kind with a duty alone.
    #[must_use]
    pub const fn of(duty: Duty) -> Self {
        Self {
            is_change: false,
            reasons: &[],
            duty,
            can_change: false,
            pace: Pace::Together,
        }
    }

    /// The same of a feature whose channels are given something so often.
    #[must_use]
    pub const fn pace(self, pace: Pace) -> Self {
        Self { pace, ..self }
    }

    /// The same of a kind whose outputs are changes.
    #[must_use]
    pub const fn change(self) -> Self {
        Self {
            is_change: true,
            ..self
        }
    }

    /// The same with reasons.
    #[must_use]
    pub const fn reasons(self, reasons: &'static [&'static str]) -> Self {
        Self { reasons, ..self }
    }

    /// What a number of the port with its reasons says; nothing for one that says nothing.
    #[must_use]
    pub fn reason(&self, number: f64) -> Option<&'static str> {
        let is_whole = number.fract() == 0.0 && number >= 0.0;
        let reason = is_whole.then(|| self.reasons.get(number as usize))??;
        (!reason.is_empty()).then_some(*reason)
    }
}
