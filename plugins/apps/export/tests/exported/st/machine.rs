//! Runs what was compiled. All memory is one list of words; whatever a controller could take otherwise ends the run: an index out of its
//! bounds, an overflow, a division by zero, a number that becomes none.

/// What ended a run.
pub type Fault = String;

/// How numbers are computed with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Bool,
    Dint,
    Lint,
    Lreal,
}

/// Where something lies: at a fixed place or where a word says, and how far from there.
#[derive(Debug, Clone)]
pub struct Place {
    pub base: usize,
    pub is_pointer: bool,
    pub offset: usize,
    pub indices: Vec<Index>,
}

#[derive(Debug, Clone)]
pub struct Index {
    pub of: Code,
    pub low: i64,
    pub high: i64,
    pub stride: usize,
}

#[derive(Debug, Clone)]
pub enum Code {
    Constant(u64),
    Load(Box<Place>),
    Call(Box<Call>),
    /// A function that every compiler has.
    Known(Known, Box<Code>),
    /// EXPT: a power.
    Power(Box<(Code, Code)>),
    Binary(Operator, Kind, Box<(Code, Code)>),
    Minus(Kind, Box<Code>),
    Not(Box<Code>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Known {
    Abs,
    Sqrt,
    Exp,
    Ln,
    Trunc,
    ToReal,
    ToDint,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Modulo,
    Equal,
    Differs,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    And,
    Or,
}

/// A call: values and addresses that go in, and words that come out.
#[derive(Debug, Clone)]
pub struct Call {
    pub unit: usize,
    pub inputs: Vec<(usize, Code)>,
    pub addresses: Vec<(usize, Place)>,
    pub outputs: Vec<(usize, Place)>,
}

#[derive(Debug)]
pub struct Step {
    pub line: usize,
    pub what: Action,
}

#[derive(Debug)]
pub enum Action {
    Assign(Place, Code),
    Copy(Place, Place, usize),
    Call(Call),
    If(Vec<(Code, Vec<Step>)>, Vec<Step>),
    Case(Code, Vec<(i64, Vec<Step>)>, Vec<Step>),
    For(Place, Code, Code, i64, Vec<Step>),
    While(Code, Vec<Step>),
    Return,
    Exit,
}

/// A function or the body of a function block.
#[derive(Debug, Default)]
pub struct Routine {
    pub name: String,
    pub result: usize,
    /// What is zero again at each call, and what then begins otherwise.
    pub cleared: std::ops::Range<usize>,
    pub body: Vec<Step>,
}

enum Flow {
    On,
    Exit,
    Return,
}

#[derive(Debug)]
pub struct Machine {
    pub memory: Vec<u64>,
    pub routines: Vec<Routine>,
    active: Vec<bool>,
    stack: Vec<u64>,
}

impl Machine {
    pub fn new(memory: Vec<u64>, routines: Vec<Routine>) -> Self {
        let active = vec![false; routines.len()];
        Self {
            memory,
            routines,
            active,
            stack: Vec::new(),
        }
    }

    /// Calls a routine that has its inputs.
    pub fn enter(&mut self, unit: usize) -> Result<u64, Fault> {
        if std::mem::replace(&mut self.active[unit], true) {
            return Err(format!("{} calls itself", self.routines[unit].name));
        }
        let cleared = self.routines[unit].cleared.clone();
        self.memory[cleared].fill(0);
        // The body is taken out while it runs, so that memory can change.
        let body = std::mem::take(&mut self.routines[unit].body);
        let ran = self.run(&body);
        self.routines[unit].body = body;
        self.active[unit] = false;
        match ran {
            Ok(_) => Ok(self.memory[self.routines[unit].result]),
            Err(fault) => Err(format!("{fault}\n  in {}", self.routines[unit].name)),
        }
    }

    fn run(&mut self, steps: &[Step]) -> Result<Flow, Fault> {
        for step in steps {
            match self.step(&step.what) {
                Ok(Flow::On) => {}
                Ok(flow) => return Ok(flow),
                Err(fault) if fault.starts_with("line ") => return Err(fault),
                Err(fault) => return Err(format!("line {}: {fault}", step.line)),
            }
        }
        Ok(Flow::On)
    }

    fn step(&mut self, action: &Action) -> Result<Flow, Fault> {
        match action {
            Action::Assign(place, code) => {
                let value = self.value(code)?;
                let address = self.address(place)?;
                self.memory[address] = value;
            }
            Action::Copy(to, from, count) => self.copy(to, from, *count)?,
            Action::Call(call) => drop(self.call(call)?),
            Action::If(branches, otherwise) => {
                for (condition, body) in branches {
                    if self.value(condition)? != 0 {
                        return self.run(body);
                    }
                }
                return self.run(otherwise);
            }
            Action::Case(of, branches, otherwise) => {
                let of = self.value(of)? as i64;
                let branch = branches.iter().find(|(label, _)| *label == of);
                return self.run(branch.map_or(otherwise, |(_, body)| body));
            }
            Action::For(counter, from, to, by, body) => {
                let (mut nth, to) = (self.value(from)? as i64, self.value(to)? as i64);
                let counter = self.address(counter)?;
                self.memory[counter] = nth as u64;
                while if *by > 0 { nth <= to } else { nth >= to } {
                    self.memory[counter] = nth as u64;
                    match self.run(body)? {
                        Flow::On => {}
                        Flow::Exit => break,
                        Flow::Return => return Ok(Flow::Return),
                    }
                    nth += by;
                }
            }
            Action::While(condition, body) => {
                while self.value(condition)? != 0 {
                    match self.run(body)? {
                        Flow::On => {}
                        Flow::Exit => break,
                        Flow::Return => return Ok(Flow::Return),
                    }
                }
            }
            Action::Return => return Ok(Flow::Return),
            Action::Exit => return Ok(Flow::Exit),
        }
        Ok(Flow::On)
    }

    fn copy(&mut self, to: &Place, from: &Place, count: usize) -> Result<(), Fault> {
        let (to, from) = (self.address(to)?, self.address(from)?);
        self.memory.copy_within(from..from + count, to);
        Ok(())
    }

    fn address(&mut self, place: &Place) -> Result<usize, Fault> {
        let base = match place.is_pointer {
            true => self.memory[place.base] as usize,
            false => place.base,
        };
        let mut address = base + place.offset;
        for index in &place.indices {
            let nth = self.value(&index.of)? as i64;
            if nth < index.low || nth > index.high {
                return Err(format!("index {nth} of {}..{}", index.low, index.high));
            }
            address += (nth - index.low) as usize * index.stride;
        }
        Ok(address)
    }

    fn call(&mut self, call: &Call) -> Result<u64, Fault> {
        // All that goes in is computed before any of it is put there: it may call the same function.
        let first = self.stack.len();
        for (_, code) in &call.inputs {
            let value = self.value(code)?;
            self.stack.push(value);
        }
        for (_, place) in &call.addresses {
            let address = self.address(place)?;
            self.stack.push(address as u64);
        }
        let cells = call.inputs.iter().map(|of| of.0);
        let cells = cells.chain(call.addresses.iter().map(|of| of.0));
        for (nth, cell) in cells.enumerate() {
            self.memory[cell] = self.stack[first + nth];
        }
        self.stack.truncate(first);
        let result = self.enter(call.unit)?;
        for (cell, place) in &call.outputs {
            let address = self.address(place)?;
            self.memory[address] = self.memory[*cell];
        }
        Ok(result)
    }

    fn value(&mut self, code: &Code) -> Result<u64, Fault> {
        match code {
            Code::Constant(word) => Ok(*word),
            Code::Load(place) => self.address(place).map(|address| self.memory[address]),
            Code::Call(call) => self.call(call),
            Code::Known(known, of) => {
                let word = self.value(of)?;
                apply(*known, word)
            }
            Code::Power(of) => {
                let base = f64::from_bits(self.value(&of.0)?);
                let exponent = f64::from_bits(self.value(&of.1)?);
                match base > 0.0 {
                    true => number(libm::pow(base, exponent)),
                    false => Err(format!("EXPT of {base}")),
                }
            }
            Code::Binary(operator, kind, of) => {
                // Both sides, as a controller may: AND and OR too.
                let left = self.value(&of.0)?;
                let right = self.value(&of.1)?;
                binary(*operator, *kind, left, right)
            }
            Code::Minus(Kind::Lreal, of) => Ok((-f64::from_bits(self.value(of)?)).to_bits()),
            Code::Minus(kind, of) => whole(0i64.checked_sub(self.value(of)? as i64), *kind),
            Code::Not(of) => Ok(1 - self.value(of)?),
        }
    }
}

/// A whole number that fits its type.
fn whole(value: Option<i64>, kind: Kind) -> Result<u64, Fault> {
    match value {
        Some(value) if kind == Kind::Lint || i32::try_from(value).is_ok() => Ok(value as u64),
        _ => Err("a whole number is too large for its type".to_owned()),
    }
}

fn number(value: f64) -> Result<u64, Fault> {
    match value.is_nan() {
        true => Err("a number becomes none".to_owned()),
        false => Ok(value.to_bits()),
    }
}

fn apply(known: Known, word: u64) -> Result<u64, Fault> {
    let of = f64::from_bits(word);
    match known {
        // Of what came in without being a number too.
        Known::Abs => Ok(of.abs().to_bits()),
        Known::Sqrt => number(of.sqrt()),
        // As the engine computes them; a controller has its own.
        Known::Exp => number(libm::exp(of)),
        Known::Ln if of <= 0.0 => Err(format!("LN of {of}")),
        Known::Ln => number(libm::log(of)),
        Known::Trunc if of.abs() < 2e9 => Ok(of.trunc() as i64 as u64),
        Known::Trunc => Err(format!("{of} is too large for TRUNC")),
        Known::ToReal => Ok((word as i64 as f64).to_bits()),
        Known::ToDint => whole(Some(word as i64), Kind::Dint),
    }
}

fn binary(operator: Operator, kind: Kind, left: u64, right: u64) -> Result<u64, Fault> {
    if kind == Kind::Lreal {
        let (a, b) = (f64::from_bits(left), f64::from_bits(right));
        return match operator {
            Operator::Add => number(a + b),
            Operator::Subtract => number(a - b),
            Operator::Multiply => number(a * b),
            Operator::Divide if b == 0.0 => Err("a division by zero".to_owned()),
            Operator::Divide => number(a / b),
            Operator::Equal => Ok(u64::from(a == b)),
            Operator::Differs => Ok(u64::from(a != b)),
            Operator::Less => Ok(u64::from(a < b)),
            Operator::LessEqual => Ok(u64::from(a <= b)),
            Operator::Greater => Ok(u64::from(a > b)),
            Operator::GreaterEqual => Ok(u64::from(a >= b)),
            Operator::And | Operator::Or | Operator::Modulo => {
                Err("no operator of numbers".to_owned())
            }
        };
    }
    let (a, b) = (left as i64, right as i64);
    match operator {
        Operator::Add => whole(a.checked_add(b), kind),
        Operator::Subtract => whole(a.checked_sub(b), kind),
        Operator::Multiply => whole(a.checked_mul(b), kind),
        Operator::Divide | Operator::Modulo if b == 0 => Err("a division by zero".to_owned()),
        Operator::Divide => whole(a.checked_div(b), kind),
        Operator::Modulo => whole(a.checked_rem(b), kind),
        Operator::Equal => Ok(u64::from(a == b)),
        Operator::Differs => Ok(u64::from(a != b)),
        Operator::Less => Ok(u64::from(a < b)),
        Operator::LessEqual => Ok(u64::from(a <= b)),
        Operator::Greater => Ok(u64::from(a > b)),
        Operator::GreaterEqual => Ok(u64::from(a >= b)),
        Operator::And => Ok(left & right),
        Operator::Or => Ok(left | right),
    }
}
