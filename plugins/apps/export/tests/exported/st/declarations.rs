//! Gives all that is declared its type and its place, and constants their values. Types are strict: only DINT widens to LINT by itself, literals take the type that they are
//! used as, indices are DINT, constants and inputs are not written, and whatever is called is given all that it takes.

use std::collections::{HashMap, HashSet};

use super::compiler::Body;
use super::machine::{Kind, Machine};
use super::parser::{Ast, Initial, Result, Section, Texts, TypeOf, Unit};

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Type {
    Basic(Kind),
    /// A whole number as it is written.
    Literal,
    Array(i64, i64, Box<Type>),
    Structure(usize),
    Block(usize),
}

pub(super) struct Structure {
    pub(super) fields: Vec<(String, Type, usize)>,
    pub(super) size: usize,
}

/// What a unit shows to those who call it: variables with their places, in the memory of a function or within an instance.
pub(super) struct Signature {
    pub(super) is_block: bool,
    pub(super) result: Option<Type>,
    pub(super) variables: Vec<(Section, String, Type, usize)>,
    /// Of a function block: the size of an instance, and the word that says where it lies.
    pub(super) size: usize,
    pub(super) own: usize,
    pub(super) cleared: std::ops::Range<usize>,
    pub(super) result_cell: usize,
}

/// A program, and what is known of its names.
pub struct Program {
    pub machine: Machine,
    compiler: Compiler,
    texts: Texts,
}

/// A function block with its memory.
#[derive(Debug, Clone, Copy)]
pub struct Instance {
    unit: usize,
    address: usize,
}

impl Program {
    /// Reads and checks all of several texts.
    pub fn new(all: &[&str]) -> Result<Self> {
        let mut texts = Texts::default();
        for text in all {
            texts.read(text)?;
        }
        let mut compiler = Compiler::default();
        compiler.declare(&texts)?;
        let mut routines = Vec::new();
        for (nth, unit) in texts.units.iter().enumerate() {
            let routine = Body::of(&compiler, nth, unit)?;
            routines.push(routine);
        }
        Ok(Self {
            machine: Machine::new(std::mem::take(&mut compiler.memory), routines),
            compiler,
            texts,
        })
    }

    /// One more instance of a function block.
    pub fn instance(&mut self, block: &str) -> Result<Instance> {
        let block = block.to_lowercase();
        let unit = *self
            .compiler
            .units
            .get(&block)
            .ok_or(format!("there is no {block}"))?;
        let address = self.machine.memory.len();
        let size = self.compiler.signatures[unit].size;
        self.machine.memory.resize(address + size, 0);
        self.compiler
            .begin(&self.texts, unit, address, &mut self.machine.memory)?;
        Ok(Instance { unit, address })
    }

    /// The place of a variable of an instance: of an element of it.
    fn place(&self, of: Instance, name: &str, nth: usize) -> usize {
        let signature = &self.compiler.signatures[of.unit];
        let mut variables = signature.variables.iter();
        let found = variables.find(|(_, own, _, _)| own == name);
        let (_, _, kind, offset) = found.unwrap_or_else(|| panic!("there is no {name}"));
        assert!(nth < self.compiler.size(kind), "{name}[{nth}]");
        of.address + offset + nth
    }

    pub fn set(&mut self, of: Instance, name: &str, nth: usize, word: u64) {
        let place = self.place(of, name, nth);
        self.machine.memory[place] = word;
    }

    pub fn get(&self, of: Instance, name: &str, nth: usize) -> u64 {
        self.machine.memory[self.place(of, name, nth)]
    }

    pub fn call(&mut self, of: Instance) -> Result<()> {
        let own = self.compiler.signatures[of.unit].own;
        self.machine.memory[own] = of.address as u64;
        self.machine.enter(of.unit).map(drop)
    }
}

#[derive(Default)]
pub(super) struct Compiler {
    pub(super) memory: Vec<u64>,
    pub(super) structures: Vec<Structure>,
    pub(super) named: HashMap<String, Type>,
    pub(super) constants: HashMap<String, (Type, usize)>,
    /// Of whole constants their values, for bounds and labels.
    pub(super) values: HashMap<String, i64>,
    pub(super) units: HashMap<String, usize>,
    pub(super) signatures: Vec<Signature>,
}

impl Compiler {
    fn declare(&mut self, texts: &Texts) -> Result<()> {
        let names = texts.constants.iter().map(|of| &of.name);
        let names = names.chain(texts.structures.iter().map(|of| &of.0));
        let mut seen = HashSet::new();
        for name in names.chain(texts.units.iter().map(|of| &of.name)) {
            if !seen.insert(name) {
                return Err(format!("`{name}` is declared twice; case does not count"));
            }
        }
        for (name, kind) in [
            ("bool", Kind::Bool),
            ("dint", Kind::Dint),
            ("lint", Kind::Lint),
            ("lreal", Kind::Lreal),
        ] {
            self.named.insert(name.to_owned(), Type::Basic(kind));
        }
        for constant in &texts.constants {
            if let (TypeOf::Named(of), Some(Initial::Value(value))) =
                (&constant.of, &constant.initial)
                && (of == "dint" || of == "lint")
            {
                let value = self.whole(value)?;
                self.values.insert(constant.name.clone(), value);
            }
        }
        for (name, fields) in &texts.structures {
            let mut structure = Structure {
                fields: Vec::new(),
                size: 0,
            };
            for field in fields {
                let of = self.type_of(&field.of)?;
                if structure
                    .fields
                    .iter()
                    .any(|(own, _, _)| *own == field.name)
                    || field.initial.is_some()
                {
                    return Err(format!("line {}: `{}`", field.line, field.name));
                }
                let size = self.size(&of);
                structure
                    .fields
                    .push((field.name.clone(), of, structure.size));
                structure.size += size;
            }
            self.named
                .insert(name.clone(), Type::Structure(self.structures.len()));
            self.structures.push(structure);
        }
        for (nth, unit) in texts.units.iter().enumerate() {
            let signature = self.signature(unit)?;
            self.signatures.push(signature);
            self.units.insert(unit.name.clone(), nth);
            if unit.result.is_none() {
                self.named.insert(unit.name.clone(), Type::Block(nth));
            }
        }
        for constant in &texts.constants {
            let of = self.type_of(&constant.of)?;
            let address = self.memory.len();
            let mut words = vec![0; self.size(&of)];
            if let Some(initial) = &constant.initial {
                self.fill(&of, initial, &mut words)
                    .map_err(|why| format!("{}: {why}", constant.name))?;
            }
            self.memory.extend(words);
            self.constants.insert(constant.name.clone(), (of, address));
        }
        Ok(())
    }

    fn signature(&mut self, unit: &Unit) -> Result<Signature> {
        let is_block = unit.result.is_none();
        let own = self.memory.len();
        self.memory.push(0);
        let mut variables: Vec<(Section, String, Type, usize)> = Vec::new();
        let mut size = 0;
        let mut cleared = 0..0;
        // What is given lies first, what is cleared behind it.
        for is_given in [true, false] {
            if !is_given && !is_block {
                cleared.start = self.memory.len();
            }
            for (section, variable) in &unit.variables {
                if is_given != matches!(section, Section::Input | Section::InOut) {
                    continue;
                }
                let of = self.type_of(&variable.of)?;
                let is_known = variables.iter().any(|(_, own, _, _)| *own == variable.name)
                    || variable.name == unit.name;
                let wrong = is_known
                    || (!is_block && variable.initial.is_some())
                    || (is_block && *section == Section::InOut)
                    || (!is_block && *section == Section::Input && !matches!(of, Type::Basic(_)));
                if wrong {
                    return Err(format!("line {}: `{}`", variable.line, variable.name));
                }
                let words = match section {
                    Section::InOut => 1,
                    _ => self.size(&of),
                };
                let place = match is_block {
                    true => size,
                    false => self.memory.len(),
                };
                match is_block {
                    true => size += words,
                    false => self.memory.resize(place + words, 0),
                }
                variables.push((*section, variable.name.clone(), of, place));
            }
        }
        // Arguments without names go in as they are declared.
        let order = |name: &String| unit.variables.iter().position(|(_, of)| of.name == *name);
        variables.sort_by_key(|(_, name, _, _)| order(name));
        let result_cell = self.memory.len();
        self.memory.push(0);
        if !is_block {
            cleared.end = self.memory.len();
        }
        Ok(Signature {
            is_block,
            result: unit
                .result
                .as_ref()
                .map(|of| self.type_of(of))
                .transpose()?,
            variables,
            size,
            own,
            cleared,
            result_cell,
        })
    }

    fn type_of(&self, of: &TypeOf) -> Result<Type> {
        match of {
            TypeOf::Named(name) => self
                .named
                .get(name)
                .cloned()
                .ok_or(format!("there is no type `{name}`")),
            TypeOf::Array(low, high, of) => {
                let (low, high) = (self.whole(low)?, self.whole(high)?);
                match low <= high {
                    true => Ok(Type::Array(low, high, Box::new(self.type_of(of)?))),
                    false => Err(format!("an array of {low}..{high}")),
                }
            }
        }
    }

    pub(super) fn size(&self, of: &Type) -> usize {
        match of {
            Type::Basic(_) | Type::Literal => 1,
            Type::Array(low, high, of) => (high - low + 1) as usize * self.size(of),
            Type::Structure(nth) => self.structures[*nth].size,
            Type::Block(nth) => self.signatures[*nth].size,
        }
    }

    /// A whole number that is known before anything runs.
    pub(super) fn whole(&self, of: &Ast) -> Result<i64> {
        let none = || format!("{of:?} is no whole constant");
        match of {
            Ast::Int(value) => Ok(*value),
            Ast::Name(name) => self.values.get(name).copied().ok_or_else(none),
            Ast::Minus(of) => self.whole(of)?.checked_neg().ok_or_else(none),
            Ast::Binary("+", a, b) => self.whole(a)?.checked_add(self.whole(b)?).ok_or_else(none),
            Ast::Binary("-", a, b) => self.whole(a)?.checked_sub(self.whole(b)?).ok_or_else(none),
            _ => Err(none()),
        }
    }

    /// What something begins with, all of it given.
    fn fill(&self, of: &Type, initial: &Initial, words: &mut [u64]) -> Result<()> {
        match (of, initial) {
            (Type::Basic(Kind::Bool), Initial::Value(Ast::Bool(value))) => {
                words[0] = u64::from(*value)
            }
            (Type::Basic(Kind::Lreal), Initial::Value(Ast::Real(value))) => {
                words[0] = value.to_bits()
            }
            (Type::Basic(Kind::Lreal), Initial::Value(Ast::Minus(value))) => match **value {
                Ast::Real(value) => words[0] = (-value).to_bits(),
                _ => return Err(format!("{value:?} is no number")),
            },
            (Type::Basic(kind @ (Kind::Dint | Kind::Lint)), Initial::Value(value)) => {
                let value = self.whole(value)?;
                if *kind == Kind::Dint && i32::try_from(value).is_err() {
                    return Err(format!("{value} is no DINT"));
                }
                words[0] = value as u64;
            }
            (Type::Array(low, high, of), Initial::List(list)) => {
                if list.len() as i64 != high - low + 1 {
                    return Err(format!("{} elements for {low}..{high}", list.len()));
                }
                let size = self.size(of);
                for (nth, initial) in list.iter().enumerate() {
                    self.fill(of, initial, &mut words[nth * size..][..size])?;
                }
            }
            (Type::Structure(nth), Initial::Fields(given)) => {
                let fields = &self.structures[*nth].fields;
                if fields.len() != given.len() {
                    return Err(format!(
                        "{} fields instead of {}",
                        given.len(),
                        fields.len()
                    ));
                }
                for (name, initial) in given {
                    let field = fields.iter().find(|(own, _, _)| own == name);
                    let (_, of, offset) = field.ok_or(format!("no field `{name}`"))?;
                    let size = self.size(of);
                    self.fill(of, initial, &mut words[*offset..][..size])
                        .map_err(|why| format!("{name}: {why}"))?;
                }
            }
            _ => return Err(format!("{initial:?} is none of {of:?}")),
        }
        Ok(())
    }

    /// Lets an instance begin.
    fn begin(&self, texts: &Texts, unit: usize, address: usize, memory: &mut [u64]) -> Result<()> {
        for (_, name, of, offset) in &self.signatures[unit].variables {
            let mut declared = texts.units[unit].variables.iter();
            let initial = declared
                .find(|(_, variable)| variable.name == *name)
                .and_then(|(_, of)| of.initial.as_ref());
            let place = address + offset;
            if let Some(initial) = initial {
                let size = self.size(of);
                self.fill(of, initial, &mut memory[place..][..size])?;
            }
            if let Type::Block(inner) = of {
                self.begin(texts, *inner, place, memory)?;
            }
        }
        Ok(())
    }
}
