//! Random graphs, random data for them, and random edits; what an edit touches is worked out here, from the texts alone.

use std::collections::{BTreeMap, BTreeSet};

use athermal::core::prng::Prng;

use super::model::{Happening, s};

pub const TEMPERATURES: [&str; 3] = ["a", "b", "c"];
pub const AXES: [&str; 2] = ["X", "Z"];

/// What a row of data holds.
pub fn feed() -> Vec<String> {
    let temperatures = TEMPERATURES.iter().map(|t| format!("temperature.{t}"));
    let positions = AXES.iter().map(|p| format!("position.{p}"));
    temperatures.chain(positions).collect()
}

/// A node: its parameters, and the references of its inputs by port, in which `{axis}` is a member of the set.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    pub each: bool,
    pub parameters: BTreeMap<&'static str, String>,
    pub inputs: BTreeMap<&'static str, Vec<String>>,
    pub max_age: Option<&'static str>,
}

/// A graph: some axes, and nodes by name.
#[derive(Debug, Clone, PartialEq)]
pub struct Graph {
    pub axes: Vec<&'static str>,
    pub range: &'static str,
    pub nodes: BTreeMap<String, Node>,
    pub salt: BTreeMap<String, u8>,
}

pub fn pick<T: Copy>(random: &mut Prng, from: &[T]) -> T {
    from[(random.bits() % from.len() as u64) as usize]
}

pub fn chance(random: &mut Prng, probability: f64) -> bool {
    random.uniform() < probability
}

fn some_temperatures(random: &mut Prng) -> Vec<String> {
    let mut some: Vec<_> = TEMPERATURES
        .iter()
        .filter(|_| chance(random, 0.6))
        .map(|t| format!("temperature.{t}"))
        .collect();
    if some.is_empty() {
        some.push("temperature.a".to_owned());
    }
    some
}

fn windows(random: &mut Prng) -> String {
    pick(
        random,
        &[r#"["20s"]"#, r#"["20s", "45s"]"#, r#"["30s", "90s"]"#],
    )
    .to_owned()
}

impl Node {
    fn new(kind: &str, each: bool) -> Self {
        Self {
            each,
            parameters: BTreeMap::from([("type", format!("\"{kind}\""))]),
            inputs: BTreeMap::new(),
            max_age: None,
        }
    }

    fn with(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.parameters.insert(name, value.into());
        self
    }

    fn reads(mut self, port: &'static str, references: Vec<String>) -> Self {
        self.inputs.insert(port, references);
        self
    }

    fn slope(random: &mut Prng, from: Vec<String>) -> Self {
        Self::new("slope", false)
            .reads("signal", from)
            .with("windows", windows(random))
            .with("unit", "\"mK/min\"")
    }

    fn delay(random: &mut Prng, from: Vec<String>) -> Self {
        let delay = pick(random, &["\"1 tick\"", "\"3 ticks\"", "\"12s\"", "\"40s\""]);
        Self::new("delay", false)
            .reads("signal", from)
            .with("delay", delay)
    }

    fn text(&self, name: &str, cosmetic: Option<&mut Prng>) -> String {
        let mut lines: Vec<String> = self
            .parameters
            .iter()
            .map(|(name, value)| format!("{name} = {value}"))
            .collect();
        for (port, references) in &self.inputs {
            let listed: Vec<_> = references.iter().map(|r| format!("{r:?}")).collect();
            let listed = format!("[{}]", listed.join(", "));
            lines.push(match self.max_age.filter(|_| *port == "features") {
                Some(age) => format!("inputs.{port} = {{ from = {listed}, max_age = {age:?} }}"),
                None => format!("inputs.{port} = {listed}"),
            });
        }
        if self.each {
            lines.push("each = \"axis\"".to_owned());
        }
        if let Some(random) = cosmetic {
            respell(random, &mut lines);
        }
        format!("[nodes.{name}]\n{}\n\n", lines.join("\n"))
    }
}

/// Writes the same in other words.
fn respell(random: &mut Prng, lines: &mut [String]) {
    for line in lines.iter_mut() {
        for (from, to) in [
            ("\"45s\"", "\"0.75min\""),
            ("\"90s\"", "\"1m30s\""),
            ("\"40s\"", "\"40000ms\""),
            ("\"mK/min\"", "\"mK.min-1\""),
            ("\"nm/min\"", "\"pm/ms/60\""),
            ("\"0s\"", "\"0min\""),
        ] {
            if from != "\"nm/min\"" && chance(random, 0.5) {
                *line = line.replace(from, to);
            }
        }
        if chance(random, 0.2) {
            line.push_str("   # a remark");
        }
    }
    let by = (random.bits() % lines.len() as u64) as usize;
    lines.rotate_left(by);
}

impl Graph {
    pub fn random(random: &mut Prng) -> Self {
        let mut graph = Self {
            axes: AXES.to_vec(),
            range: "[\"-20 Cel\", \"200 Cel\"]",
            nodes: BTreeMap::new(),
            salt: BTreeMap::new(),
        };
        let window = pick(random, &["40s", "60s"]);
        graph.insert(
            "drift",
            Node::new("slope", true)
                .reads("signal", vec!["position.{axis}".to_owned()])
                .with("windows", format!("[\"{window}\"]"))
                .with("unit", "\"nm/min\"")
                .with("min_samples", "2"),
        );
        let from = some_temperatures(random);
        let slopes = Node::slope(random, from);
        graph.insert("slopes", slopes);
        if chance(random, 0.5) {
            graph.insert(
                "chosen",
                Node::new("pick", false).reads("signal", vec!["slopes".into()]),
            );
        }
        if chance(random, 0.5) {
            let from = some_temperatures(random);
            graph.insert("late", Node::delay(random, from));
            graph.insert("late_slopes", Node::slope(random, vec!["late".into()]));
        }
        for _ in 0..1 + random.bits() % 3 {
            graph.add_estimator(random);
        }
        if chance(random, 0.8) {
            graph.add_vote(random);
        }
        if chance(random, 0.4) {
            graph.add_loop();
        }
        graph
    }

    fn insert(&mut self, name: &str, node: Node) {
        self.nodes.insert(name.to_owned(), node);
    }

    fn new_name(&self, random: &mut Prng, stem: &str) -> String {
        loop {
            let name = format!("{stem}{}", random.bits() % 1000);
            if !self.nodes.contains_key(&name) {
                return name;
            }
        }
    }

    fn features(&self, random: &mut Prng) -> Vec<String> {
        let mut from: Vec<String> = ["slopes", "chosen", "late_slopes"]
            .iter()
            .filter(|name| self.nodes.contains_key(**name) && chance(random, 0.6))
            .map(|name| (*name).to_owned())
            .collect();
        if from.is_empty() {
            from.push("slopes".to_owned());
        }
        from
    }

    pub fn add_estimator(&mut self, random: &mut Prng) {
        let kind = pick(
            random,
            &["linear", "linear", "ar", "arx", "persistence", "zero"],
        );
        let mut node = Node::new(kind, true)
            .reads("truth", vec!["drift.{axis}".to_owned()])
            .with("ahead", "\"60s\"");
        if ["linear", "arx"].contains(&kind) {
            node = node.reads("features", self.features(random));
        }
        if ["ar", "arx"].contains(&kind) {
            node = node.with("lags", pick(random, &["[\"0s\"]", "[\"0s\", \"25s\"]"]));
        }
        let name = self.new_name(random, "est");
        self.insert(&name, node);
    }

    pub fn voters(&self) -> Vec<String> {
        let voters = self.nodes.keys().filter(|name| name.starts_with("est"));
        voters.map(|name| format!("{name}.{{axis}}")).collect()
    }

    pub fn add_vote(&mut self, random: &mut Prng) {
        let node = Node::new("auto_weighted", true)
            .reads("truth", vec!["drift.{axis}".to_owned()])
            .with("memory", pick(random, &["\"90s\"", "\"200s\""]));
        let node = if chance(random, 0.25) {
            Node::new("mean", true)
        } else {
            node
        };
        let name = self.new_name(random, "vote");
        self.insert(&name, node.reads("voters", self.voters()));
    }

    /// An estimator that reads its own prediction of the tick before.
    pub fn add_loop(&mut self) {
        let mut closing = Node::new("linear", false)
            .reads("truth", vec![format!("drift.{}", self.axes[0])])
            .reads("features", vec!["slopes".to_owned(), "echo".to_owned()])
            .with("ahead", "\"60s\"");
        closing.max_age = Some("50s");
        self.insert("closing", closing);
        let echo = Node::new("delay", false)
            .reads("signal", vec!["closing".to_owned()])
            .with("delay", "\"1 tick\"")
            .with("unit", "\"nm/min\"");
        self.insert("echo", echo);
    }

    /// The graph as a file. With `cosmetic`, the same in other words and another order.
    pub fn text(&self, mut cosmetic: Option<&mut Prng>) -> String {
        let listed = |names: &[&str]| format!("{names:?}");
        let mut text = format!(
            "schema = 1\n[sets]\naxis = {}\n[time]\ncolumn = \"t\"\n\n\
             [signals.temperature]\nunit = \"Cel\"\nchannels = {}\nrange = {}\nmax_age = \"30s\"\n\n\
             [signals.position]\nunit = \"nm\"\nchannels = {}\nmax_age = \"1min\"\n\n",
            listed(&self.axes),
            listed(&TEMPERATURES),
            self.range,
            listed(&AXES),
        );
        let mut nodes: Vec<_> = self
            .nodes
            .iter()
            .map(|(name, node)| node.text(name, cosmetic.as_deref_mut()))
            .collect();
        let mut outputs: Vec<_> = self
            .nodes
            .keys()
            .map(|name| format!("{name} = {name:?}\n"))
            .collect();
        for name in self.nodes.keys().filter(|name| name.starts_with("est")) {
            outputs.push(format!(
                "slow_{name} = {{ from = {name:?}, blend = \"0.01 nm/min/s\" }}\n"
            ));
        }
        if let Some(random) = cosmetic {
            text = text
                .replace("\"Cel\"", "\"degC\"")
                .replace("\"1min\"", "\"60s\"");
            shuffle(random, &mut nodes);
            shuffle(random, &mut outputs);
        }
        format!("{text}{}[outputs]\n{}", nodes.concat(), outputs.concat())
    }

    /// Changes something. What results may no longer be a graph; then it is put right or left out by [`Graph::repair`].
    pub fn edit(&mut self, random: &mut Prng) {
        let names: Vec<String> = self.nodes.keys().cloned().collect();
        let name = names[(random.bits() % names.len() as u64) as usize].clone();
        match random.bits() % 9 {
            0 => self.add_estimator(random),
            1 => self.add_vote(random),
            2 => {
                if name != "drift" && name != "slopes" {
                    self.nodes.remove(&name);
                }
            }
            3 => self.axes = pick(random, &[&["X"][..], &["Z"], &["Z", "X"], &["X", "Z"]]).to_vec(),
            4 => {
                *self.salt.entry(name).or_default() += 1;
            }
            5 => {
                let voters = self.voters();
                let node = self.nodes.get_mut(&name);
                if let Some(list) = node.and_then(|node| node.inputs.get_mut("voters")) {
                    *list = voters;
                    let by = (random.bits() % list.len().max(1) as u64) as usize;
                    list.rotate_left(by);
                }
            }
            6 => {
                self.range = pick(
                    random,
                    &["[\"-20 Cel\", \"200 Cel\"]", "[\"-20 Cel\", \"26 Cel\"]"],
                );
            }
            7 => {
                let features = self.features(random);
                if let Some(node) = self.nodes.get_mut(&name)
                    && name.starts_with("est")
                    && let Some(list) = node.inputs.get_mut("features")
                {
                    *list = features;
                }
            }
            _ => {
                let other = [
                    ("windows", windows(random)),
                    (
                        "delay",
                        pick(random, &["\"2 ticks\"", "\"25s\""]).to_owned(),
                    ),
                    ("memory", pick(random, &["\"50s\"", "\"300s\""]).to_owned()),
                    ("lags", "[\"0s\", \"35s\"]".to_owned()),
                ];
                if let Some(node) = self.nodes.get_mut(&name)
                    && name != "drift"
                    && name != "echo"
                {
                    for (parameter, value) in other {
                        if let Some(place) = node.parameters.get_mut(parameter) {
                            *place = value;
                        }
                    }
                }
            }
        }
        self.repair();
    }

    /// Takes out references to what is gone, and nodes that read nothing any more.
    fn repair(&mut self) {
        if let Some(closing) = self.nodes.get_mut("closing") {
            let truth = format!("drift.{}", self.axes[0]);
            closing.inputs.insert("truth", vec![truth]);
        }
        loop {
            let known: BTreeSet<String> = self.nodes.keys().cloned().collect();
            for node in self.nodes.values_mut() {
                for list in node.inputs.values_mut() {
                    list.retain(|reference| {
                        let node = reference.split('.').next().unwrap();
                        node == "temperature" || node == "position" || known.contains(node)
                    });
                }
            }
            let before = self.nodes.len();
            self.nodes
                .retain(|_, node| node.inputs.values().all(|list| !list.is_empty()));
            if self.nodes.len() == before {
                return;
            }
        }
    }

    /// The instances, each with all that makes it what it is, and what it reads.
    fn instances(&self) -> BTreeMap<String, (String, Vec<String>)> {
        let mut all = BTreeMap::new();
        for (name, node) in &self.nodes {
            let members: &[&str] = if node.each { &self.axes } else { &[""] };
            for member in members {
                let instance = if node.each {
                    format!("{name}.{member}")
                } else {
                    name.clone()
                };
                let text = node.text(name, None).replace("{axis}", member);
                let read = node.inputs.values().flatten();
                let read = read.map(|r| r.replace("{axis}", member)).collect();
                let salt = self.salt.get(name).copied().unwrap_or(0);
                let fitted = ["linear", "ar", "arx"]
                    .iter()
                    .any(|kind| node.parameters["type"] == format!("\"{kind}\""));
                let salt = if fitted { salt } else { 0 };
                all.insert(instance, (format!("{text}{salt}"), read));
            }
        }
        all
    }

    /// The instances of `new` that go on exactly as they were in `self`: neither they nor anything before them has changed.
    pub fn untouched(&self, new: &Self) -> BTreeSet<String> {
        let (old, new_ones) = (self.instances(), new.instances());
        let mut same: BTreeSet<String> = new_ones
            .iter()
            .filter(|(name, (text, _))| old.get(*name).is_some_and(|(was, _)| was == text))
            .map(|(name, _)| name.clone())
            .collect();
        loop {
            let still: BTreeSet<String> = same
                .iter()
                .filter(|name| {
                    new_ones[*name].1.iter().all(|reference| {
                        let signal = reference.split('.').next().unwrap();
                        match signal {
                            "temperature" => self.range == new.range,
                            "position" => true,
                            _ => same.contains(reference),
                        }
                    })
                })
                .cloned()
                .collect();
            if still == same {
                return same;
            }
            same = still;
        }
    }

    /// The instances that hang on something outside of `within`.
    pub fn hangs_on_others(&self, within: &BTreeSet<String>) -> BTreeSet<String> {
        let all = self.instances();
        let mut hanging: BTreeSet<String> = all
            .keys()
            .filter(|name| !within.contains(*name))
            .cloned()
            .collect();
        loop {
            let more: BTreeSet<String> = all
                .iter()
                .filter(|(name, (_, read))| {
                    hanging.contains(*name) || read.iter().any(|read| hanging.contains(read))
                })
                .map(|(name, _)| name.clone())
                .collect();
            if more == hanging {
                return hanging;
            }
            hanging = more;
        }
    }
}

fn shuffle<T>(random: &mut Prng, items: &mut [T]) {
    for i in (1..items.len()).rev() {
        items.swap(i, (random.bits() % (i as u64 + 1)) as usize);
    }
}

/// Ticks at irregular instants; each channel has a rate and absences of its own.
pub fn happenings(random: &mut Prng, rows: usize) -> Vec<Happening> {
    let mut all = Vec::new();
    let mut now = (random.bits() % 1000) as i64 - 500;
    let mut values = [22.0, 24.0, 25.0, 0.0, 100.0];
    while all.len() < rows {
        if chance(random, 0.004) {
            all.push(Happening::Break);
            now = (random.bits() % 2000) as i64 - 1000;
        }
        now += 1 + (random.bits() % 9) as i64;
        if chance(random, 0.01) {
            now += 70;
        }
        let mut row = vec![f64::NAN; 5];
        for (channel, value) in values.iter_mut().enumerate() {
            let (size, rate) = if channel < 3 {
                (0.2, 0.7)
            } else {
                (20.0, 0.35)
            };
            *value += size * random.normal();
            if chance(random, rate) {
                row[channel] = *value;
            }
        }
        all.push(Happening::Row(s(now), row));
    }
    all
}
