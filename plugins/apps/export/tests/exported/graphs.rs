//! Random graphs of all kinds that are exported, as text.

use std::fmt::Write as _;

use athermal_core::prng::Prng;

fn one_of<'a>(random: &mut Prng, words: &[&'a str]) -> &'a str {
    words[(random.between(0.0, words.len() as f64) as usize).min(words.len() - 1)]
}

pub fn chance(random: &mut Prng, share: f64) -> bool {
    random.between(0.0, 1.0) < share
}

/// A list of different durations in seconds.
fn durations(random: &mut Prng, most: usize, from: f64, to: f64) -> String {
    let count = 1 + random.between(0.0, most as f64) as usize;
    let mut list: Vec<u64> = (0..count)
        .map(|_| random.between(from, to) as u64)
        .collect();
    list.sort_unstable();
    list.dedup();
    if chance(random, 0.5) {
        list.reverse();
    }
    let list: Vec<String> = list.iter().map(|s| format!("\"{s}s\"")).collect();
    format!("[{}]", list.join(", "))
}

/// A graph of everything, with parameters at random.
pub fn graph(random: &mut Prng) -> String {
    let channels = 1 + random.between(0.0, 10.0) as usize;
    // Of fewer than three sensors none contradicts the others.
    let is_checked = channels > 2;
    let checked = if is_checked { "trusted" } else { "temperature" };
    let channels: Vec<String> = (0..channels).map(|nth| format!("\"t{nth}\"")).collect();
    let span = 20 + random.between(0.0, 40.0) as u64;
    let ahead = [0, span / 2, span, span + 7][random.between(0.0, 4.0) as usize % 4];
    let legal = span.saturating_sub(ahead);
    let lag = |random: &mut Prng| legal + random.between(0.0, 60.0) as u64;
    let lags = [lag(random), lag(random) + 61, lag(random) + 122];
    let cold = one_of(random, &["absent", "partial"]);
    let outside = one_of(random, &["shrink", "absent", "pass"]);
    let mut text = format!(
        r#"schema = 1
name = "random graph"
[sets]
axis = ["X", "Z"]
[time]
column = "t"
[signals.temperature]
unit = "Cel"
channels = [{}]
range = ["-50 Cel", "150 Cel"]
max_age = "{}s"
[signals.position]
unit = "nm"
channels = "axis"
max_age = "{}s"
[signals.applied]
unit = "um"
channels = "axis"
max_age = "20s"
[signals.mark]
unit = "1"
channels = ["m"]
max_age = "5s"
[nodes.own]
type = "uncorrected"
inputs = {{ position = "position", applied = "applied" }}
until_first = "{}"
[nodes.drift]
type = "slope"
inputs.signal = "own"
windows = ["{span}s"]
unit = "nm/min"
min_samples = {}
min_coverage = {}
[nodes.gradients]
type = "slope"
inputs.signal = "{checked}"
windows = {}
unit = "mK/min"
min_samples = {}
min_coverage = {}
cold = "{cold}"
[nodes.before]
type = "lag"
inputs.signal = "temperature"
lags = {}
[nodes.masses]
type = "first_order"
inputs.signal = "temperature"
time_constants = {}
output = "{}"
[nodes.chosen]
type = "pick"
inputs.signal = "gradients.t0*"
"#,
        channels.join(", "),
        2 + random.between(0.0, 30.0) as u64,
        2 + random.between(0.0, 30.0) as u64,
        one_of(random, &["absent", "zero"]),
        2 + random.between(0.0, 4.0) as u64,
        one_of(random, &["0.0", "0.3", "0.5", "0.8"]),
        durations(random, 7, 4.0, 150.0),
        2 + random.between(0.0, 4.0) as u64,
        one_of(random, &["0.0", "0.3", "0.5", "0.8"]),
        durations(random, 3, 0.0, 60.0),
        durations(random, 4, 1.0, 300.0),
        one_of(random, &["difference", "value"]),
    );
    let _ = write!(
        text,
        r#"
[nodes.thermal]
type = "linear"
each = "axis"
inputs.features = "gradients"
inputs.truth = "drift.{{axis}}"
ahead = "{ahead}s"
outside = "{outside}"
[nodes.masses_too]
type = "linear"
each = "axis"
inputs.features = {{ from = ["masses", "chosen", "before"], max_age = "15s" }}
inputs.truth = "drift.{{axis}}"
ahead = "{ahead}s"
[nodes.motion]
type = "ar"
each = "axis"
inputs.truth = "drift.{{axis}}"
ahead = "{ahead}s"
lags = ["{}s", "{}s"]
outside = "{outside}"
[nodes.both]
type = "arx"
each = "axis"
inputs.features = "gradients"
inputs.truth = "drift.{{axis}}"
ahead = "{ahead}s"
lags = ["{}s", "{}s", "{}s"]
feature_lags = ["0s", "13s"]
[nodes.nothing]
type = "zero"
each = "axis"
inputs.truth = "drift.{{axis}}"
ahead = "{ahead}s"
[nodes.lasting]
type = "persistence"
each = "axis"
inputs.truth = "drift.{{axis}}"
ahead = "{ahead}s"
"#,
        lags[0], lags[1], lags[0], lags[1], lags[2],
    );
    if is_checked {
        let _ = write!(
            text,
            r#"
[nodes.trusted]
type = "cross_check"
inputs.signal = {{ from = "temperature", max_age = "{}s" }}
inputs.truth = "drift.X"
ahead = "{ahead}s"
lag = "{}s"
limit = {}
after = "{}s"
recover = "{}s"
longest = "{}s"
hindsight = {}
"#,
            5 + random.between(0.0, 60.0) as u64,
            1 + random.between(0.0, 60.0) as u64,
            one_of(random, &["6.0", "60.0", "600.0"]),
            random.between(0.0, 20.0) as u64,
            20 + random.between(0.0, 100.0) as u64,
            one_of(random, &["200", "5000"]),
            random.between(0.0, 1.0) < 0.8,
        );
    }
    // What is measured rarely and counts long does not age what is made of it and of gradients.
    let _ = write!(
        text,
        r#"
[signals.voltage]
unit = "V"
channels = ["battery"]
max_age = "{}s"
[nodes.late]
type = "lag"
inputs.signal = "voltage"
lags = ["10s"]
[nodes.warm]
type = "linear"
each = "axis"
inputs.features = ["gradients", "voltage", "late"]
inputs.truth = "drift.{{axis}}"
ahead = "{ahead}s"
"#,
        one_of(random, &["200", "400", "900"]),
    );
    // What is made of drift may not choose who predicts it while windows overlap.
    let state = if legal > 0 { "mark" } else { "state.{axis}" };
    votes(random, state, &mut text);
    learning(random, ahead, legal, &mut text);
    control(random, &mut text);
    text.push_str(OF_LEARNING);
    if is_checked {
        text.push_str("trusted = \"trusted\"\nwhy_trusted = \"trusted:reason\"\n");
    }
    text
}

fn votes(random: &mut Prng, state: &str, text: &mut String) {
    let voters =
        r#"["thermal.{axis}", "motion.{axis}", "warm.{axis}", "both.{axis}", "masses_too.{axis}"]"#;
    // A memory, and how many truths it holds at most.
    let memory = |random: &mut Prng| {
        let truths = 1 + random.between(0.0, 30.0) as u64;
        let seconds = 5 + random.between(0.0, 200.0) as u64;
        match random.between(0.0, 3.0) as u64 {
            0 => (format!("{{ truths = {truths} }}"), truths),
            1 => (format!("{{ half_life = \"{seconds}s\" }}"), u64::MAX),
            _ => (format!("\"{seconds}s\""), u64::MAX),
        }
    };
    let ((weighted, _), (best, _), (guard, held)) =
        (memory(random), memory(random), memory(random));
    let weights = one_of(random, &["inverse_power", "as_printed", "as_printed_raw"]);
    let power = match weights {
        "inverse_power" => one_of(
            random,
            &["", "0.0", "1.0", "4.0", "6.0", "6.0", "3.7", "16.0"],
        ),
        _ => "",
    };
    let power = match power {
        "" => String::new(),
        power => format!("power = {power}\n"),
    };
    let rate = one_of(random, &["", "rate = 0.5\n", "rate = 20.0\n"]);
    let fades = one_of(
        random,
        &["", "half_life = \"90s\"\n", "half_life = \"9s\"\n"],
    );
    let kept_apart = if weights == "as_printed_raw" || chance(random, 0.4) {
        String::new()
    } else {
        format!(
            "shrinkage = {}\nfloor = {}\n",
            one_of(random, &["0.0", "0.2", "1.0"]),
            one_of(random, &["0.0", "0.1", "0.4"])
        )
    };
    let _ = write!(
        text,
        r#"
[nodes.vote]
type = "auto_weighted"
each = "axis"
inputs.voters = {voters}
inputs.truth = "drift.{{axis}}"
memory = {weighted}
weights = "{weights}"
{power}
{kept_apart}
[nodes.steep]
type = "auto_weighted"
each = "axis"
inputs.voters = {voters}
inputs.truth = "drift.{{axis}}"
memory = {{ half_life = "{}s" }}
power = 6
[nodes.hedge]
type = "hedge"
each = "axis"
inputs.voters = {voters}
inputs.truth = "drift.{{axis}}"
{rate}{fades}floor = {}
[nodes.mean]
type = "mean"
each = "axis"
inputs.voters = {voters}
[nodes.median]
type = "median"
each = "axis"
inputs.voters = {voters}
[nodes.trimmed]
type = "trimmed"
each = "axis"
inputs.voters = {voters}
share = {}
[nodes.best]
type = "best"
each = "axis"
inputs.voters = {voters}
inputs.truth = "drift.{{axis}}"
memory = {best}
[nodes.fallback]
type = "fallback"
each = "axis"
inputs.voters = {{ from = {voters}, max_age = "8s" }}
[nodes.guard]
type = "guard"
each = "axis"
inputs.voters = ["vote.{{axis}}", "motion.{{axis}}"]
inputs.truth = "drift.{{axis}}"
memory = {guard}
min_truths = {}
most_novel = {}
[nodes.gate]
type = "state_gate"
each = "axis"
inputs = {{ voters = ["thermal.{{axis}}", "both.{{axis}}", "motion.{{axis}}"], state = "{state}" }}
dwell = "{}s"
"#,
        10 + random.between(0.0, 100.0) as u64,
        one_of(random, &["0.0", "0.0", "0.1"]),
        one_of(random, &["0.0", "0.2", "0.3", "0.49"]),
        held.min(1 + random.between(0.0, 6.0) as u64),
        one_of(random, &["1.0", "1.5", "3.0"]),
        random.between(0.0, 20.0) as u64,
    );
}

fn control(random: &mut Prng, text: &mut String) {
    let stop = one_of(
        random,
        &["", "stop = { below = \"3 nm/min\", above = \"20 nm/min\" }"],
    );
    let when_lost = one_of(
        random,
        &[
            "when_lost = \"hold\"",
            "when_lost = \"zero\"",
            "when_lost = \"value\"\nvalue = \"0.5 um\"",
        ],
    );
    let distrust = one_of(random, &["", "inputs.distrust = \"mark\""]);
    let _ = write!(
        text,
        r#"
[nodes.state]
type = "stability"
inputs.drift = "drift"
stable_below = "60 nm/min"
transient_above = "400 nm/min"
hysteresis = "{} nm/min"
dwell = "{}s"
[nodes.compensate]
type = "compensate"
inputs = {{ rate = "vote", state = "state", realigned = "mark" }}
range = "{} um"
max_rate = "{} nm/min"
max_slew = "60 nm/s"
deadband = "{} nm/min"
{stop}
stop_in = [{}]
max_gap = "{}s"
[nodes.safe]
type = "safe_state"
inputs.signal = {{ from = "compensate", max_age = "3s" }}
{distrust}
{when_lost}
after = {}
max_slew = "20 nm/s"
[nodes.loss]
type = "optical_loss"
inputs.drift = "drift"
preset = "mandelli"
[nodes.settled]
type = "settled"
inputs = {{ loss = "loss", set_point = "temperature.t0" }}
below = "0.5 dB"
change = "1 K"
for = "40s"
same_change = "30s"
[outputs]
own = "own"
drift = "drift"
gradients = "gradients"
before = "before"
masses = "masses"
chosen = "chosen"
thermal = "thermal"
novelty = "thermal:novelty"
masses_too = "masses_too"
late = "late"
warm = "warm"
motion = "motion"
both = "both"
nothing = "nothing"
lasting = "lasting"
vote = "vote"
weights = "vote:weights"
steep = "steep"
steep_weights = "steep:weights"
hedge = "hedge"
hedge_weights = "hedge:weights"
of_vote = "vote:novelty"
mean = "mean"
median = "median"
middle = "median:weights"
trimmed = "trimmed"
best = "best"
chosen_best = "best:weights"
fallback = "fallback"
guard = "guard"
guarded = "guard:reason"
gate = "gate"
gated = "gate:reason"
state = "state"
worst = "state:worst"
correction = "compensate"
why = "compensate:why"
safe = "safe"
why_safe = "safe:why"
loss = "loss"
share = "loss:share"
settled = "settled"
since = "settled:since"
"#,
        one_of(random, &["0", "5", "40"]),
        random.between(0.0, 20.0) as u64,
        one_of(random, &["1", "20", "0.2"]),
        one_of(random, &["300", "3000"]),
        one_of(random, &["0", "10"]),
        one_of(random, &["", "\"stable\"", "\"stable\", \"quasi_stable\""]),
        one_of(random, &["2", "20", "60"]),
        random.between(0.0, 5.0) as u64,
    );
}

/// Sensors that are watched, what is sampled at the instants of positions, and what goes on learning.
fn learning(random: &mut Prng, ahead: u64, legal: u64, text: &mut String) {
    let mut checks = String::new();
    for check in [
        "range = [\"17 Cel\", \"23 Cel\"]\n",
        "max_rate = \"0.15 K/s\"\n",
        "stuck_after = \"20s\"\n",
        "max_gap = \"7s\"\n",
    ] {
        checks.push_str(if chance(random, 0.75) { check } else { "" });
    }
    checks += one_of(
        random,
        &[
            "",
            "noise_above = \"1 mK\"\nnoise_below = \"0.4 K\"\nnoise_samples = 9\n",
            "noise_below = \"0.2 K\"\nnoise_samples = 4\n",
        ],
    );
    let forgets = one_of(random, &["", "memory = \"60s\"\n", "memory = \"10min\"\n"]);
    let _ = write!(
        text,
        r#"[nodes.sound]
type = "health"
inputs.signal = "temperature"
{checks}recover = "{}s"
[nodes.aligned]
type = "sample_at"
each = "axis"
inputs.signal = {{ from = "sound", max_age = "{}s" }}
inputs.instants = "position.{{axis}}"
[nodes.growth]
type = "slope"
each = "axis"
inputs.signal = "aligned.{{axis}}*"
windows = ["25s"]
unit = "mK/min"
[nodes.learner]
type = "rls"
each = "axis"
inputs.features = ["chosen", "late", "voltage"]
inputs.truth = "drift.{{axis}}"
inputs.freeze = {{ from = "mark", max_age = "60s" }}
ahead = "{ahead}s"
learn = {{ outliers = {}, margin = {} }}
{forgets}outside = "{}"
[nodes.autoregression]
type = "rls"
each = "axis"
inputs.features = {{ from = "growth.{{axis}}*", max_age = "30s" }}
inputs.truth = "drift.{{axis}}"
ahead = "{ahead}s"
lags = ["{legal}s", "{}s"]
learn = {{ margin = 100.0 }}
[nodes.pupils]
type = "auto_weighted"
each = "axis"
inputs.voters = ["learner.{{axis}}", "autoregression.{{axis}}", "thermal.{{axis}}"]
inputs.truth = "drift.{{axis}}"
memory = "1min"
"#,
        one_of(random, &["0", "5", "30"]),
        one_of(random, &["2", "10"]),
        one_of(random, &["1.5", "6.0"]),
        one_of(random, &["0.0", "0.5", "100.0"]),
        one_of(random, &["shrink", "absent", "pass"]),
        legal + 20,
    );
}

const OF_LEARNING: &str = r#"sound = "sound"
why_sound = "sound:reason"
aligned = "aligned"
growth = "growth"
learner = "learner"
became = "learner:learning"
unsure = "learner:std_dev"
far = "learner:novelty"
autoregression = "autoregression"
learned = "autoregression:learning"
pupils = "pupils"
off = "pupils:std_dev"
off_thermal = "thermal:std_dev"
"#;
