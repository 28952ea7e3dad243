//! Compiles bodies: every variable to its place, every expression to one type.

use super::declarations::{Compiler, Signature, Type};
use super::machine::{Action, Call, Code, Index, Kind, Known, Operator, Place, Routine, Step};
use super::parser::{Argument, Ast, Result, Section, Statement, Unit, What};

/// A body while it is compiled.
pub(super) struct Body<'a> {
    compiler: &'a Compiler,
    unit: &'a Unit,
    signature: &'a Signature,
    /// Counters of loops that are open.
    counters: Vec<String>,
}

impl<'a> Body<'a> {
    pub(super) fn of(compiler: &'a Compiler, nth: usize, unit: &'a Unit) -> Result<Routine> {
        let signature = &compiler.signatures[nth];
        let mut body = Self {
            compiler,
            unit,
            signature,
            counters: Vec::new(),
        };
        Ok(Routine {
            name: unit.name.clone(),
            result: signature.result_cell,
            cleared: signature.cleared.clone(),
            body: body.steps(&unit.body)?,
        })
    }

    fn steps(&mut self, statements: &[Statement]) -> Result<Vec<Step>> {
        let mut steps = Vec::new();
        for statement in statements {
            let line = statement.line;
            let actions =
                self.actions(&statement.what)
                    .map_err(|why| match why.starts_with("line ") {
                        true => why,
                        false => format!("line {line}, {}: {why}", self.unit.name),
                    })?;
            steps.extend(actions.into_iter().map(|what| Step { line, what }));
        }
        Ok(steps)
    }

    fn actions(&mut self, what: &What) -> Result<Vec<Action>> {
        let one = match what {
            What::Assign(to, value) => {
                let (place, of) = self.target(to)?;
                self.assigned(place, &of, value)?
            }
            What::Call(name, arguments) => match self.variable(name) {
                Some((place, Type::Block(unit), _)) => {
                    return self.block_call(&place, unit, arguments);
                }
                _ => Action::Call(self.call(name, arguments)?.0),
            },
            What::If(branches, otherwise) => {
                let mut compiled = Vec::new();
                for (condition, body) in branches {
                    compiled.push((self.condition(condition)?, self.steps(body)?));
                }
                Action::If(compiled, self.steps(otherwise)?)
            }
            What::Case(of, branches, otherwise) => {
                let (of, kind) = self.expression(of)?;
                if kind != Type::Basic(Kind::Dint) {
                    return Err("a case of another type than DINT".to_owned());
                }
                let mut compiled: Vec<(i64, Vec<Step>)> = Vec::new();
                for (label, body) in branches {
                    let label = self.compiler.whole(label)?;
                    if compiled.iter().any(|(own, _)| *own == label) {
                        return Err(format!("label {label} twice"));
                    }
                    compiled.push((label, self.steps(body)?));
                }
                Action::Case(of, compiled, self.steps(otherwise)?)
            }
            What::For(name, from, to, by, body) => {
                let (place, of) = self.target(&Ast::Name(name.clone()))?;
                let Type::Basic(kind @ (Kind::Dint | Kind::Lint)) = of else {
                    return Err(format!("`{name}` cannot count"));
                };
                let (from, to) = (self.as_type(from, kind)?, self.as_type(to, kind)?);
                self.counters.push(name.clone());
                let body = self.steps(body)?;
                self.counters.pop();
                Action::For(place, from, to, *by, body)
            }
            What::While(condition, body) => {
                Action::While(self.condition(condition)?, self.steps(body)?)
            }
            What::Return => Action::Return,
            What::Exit => Action::Exit,
        };
        Ok(vec![one])
    }

    fn assigned(&mut self, place: Place, of: &Type, value: &Ast) -> Result<Action> {
        if let Type::Basic(kind) = of {
            return Ok(Action::Assign(place, self.as_type(value, *kind)?));
        }
        let (from, own, _) = self.place(value)?;
        match own == *of {
            true => Ok(Action::Copy(place, from, self.compiler.size(of))),
            false => Err(format!("{own:?} for {of:?}")),
        }
    }

    fn condition(&mut self, of: &Ast) -> Result<Code> {
        self.as_type(of, Kind::Bool)
    }

    /// An expression where a type is wanted.
    fn as_type(&mut self, of: &Ast, kind: Kind) -> Result<Code> {
        let (code, own) = self.expression(of)?;
        let fits = match (&own, &code) {
            (Type::Literal, Code::Constant(word)) => {
                kind == Kind::Lint || (kind == Kind::Dint && i32::try_from(*word as i64).is_ok())
            }
            (Type::Basic(Kind::Dint), _) => matches!(kind, Kind::Dint | Kind::Lint),
            (own, _) => *own == Type::Basic(kind),
        };
        match fits {
            true => Ok(code),
            false => Err(format!("{own:?} where {kind:?} is wanted: {of:?}")),
        }
    }

    /// A variable: where it lies, its type, and whether it may be written.
    fn variable(&self, name: &str) -> Option<(Place, Type, bool)> {
        let fixed = |base: usize| Place {
            base,
            is_pointer: false,
            offset: 0,
            indices: Vec::new(),
        };
        if name == self.unit.name
            && let Some(result) = &self.signature.result
        {
            return Some((fixed(self.signature.result_cell), result.clone(), true));
        }
        let mut own = self.signature.variables.iter();
        if let Some((section, _, of, place)) = own.find(|(_, own, _, _)| own == name) {
            let is_counter = self.counters.iter().any(|counter| counter == name);
            let place = match (self.signature.is_block, section) {
                (true, _) => Place {
                    is_pointer: true,
                    offset: *place,
                    ..fixed(self.signature.own)
                },
                (false, Section::InOut) => Place {
                    is_pointer: true,
                    ..fixed(*place)
                },
                (false, _) => fixed(*place),
            };
            return Some((place, of.clone(), *section != Section::Input && !is_counter));
        }
        let (of, address) = self.compiler.constants.get(name)?;
        Some((fixed(*address), of.clone(), false))
    }

    fn place(&mut self, of: &Ast) -> Result<(Place, Type, bool)> {
        match of {
            Ast::Name(name) => self.variable(name).ok_or(format!("there is no `{name}`")),
            Ast::Field(inner, name) => {
                let (mut place, kind, is_written) = self.place(inner)?;
                match kind {
                    Type::Structure(nth) => {
                        let mut fields = self.compiler.structures[nth].fields.iter();
                        let field = fields.find(|(own, _, _)| own == name);
                        let (_, kind, offset) = field.ok_or(format!("no field `{name}`"))?;
                        place.offset += offset;
                        Ok((place, kind.clone(), is_written))
                    }
                    Type::Block(nth) => {
                        let mut variables = self.compiler.signatures[nth].variables.iter();
                        let found = variables.find(|(section, own, _, _)| {
                            own == name && *section == Section::Output
                        });
                        let (_, _, kind, offset) = found.ok_or(format!("no output `{name}`"))?;
                        place.offset += offset;
                        Ok((place, kind.clone(), false))
                    }
                    _ => Err(format!("`{name}` of what has no fields")),
                }
            }
            Ast::Index(inner, index) => {
                let (mut place, kind, is_written) = self.place(inner)?;
                let Type::Array(low, high, of) = kind else {
                    return Err("an index of no array".to_owned());
                };
                place.indices.push(Index {
                    of: self.as_type(index, Kind::Dint)?,
                    low,
                    high,
                    stride: self.compiler.size(&of),
                });
                Ok((place, *of, is_written))
            }
            _ => Err(format!("{of:?} is no variable")),
        }
    }

    /// Something that may be written.
    fn target(&mut self, of: &Ast) -> Result<(Place, Type)> {
        match self.place(of)? {
            (place, kind, true) => Ok((place, kind)),
            _ => Err(format!("{of:?} may not be written")),
        }
    }

    fn expression(&mut self, of: &Ast) -> Result<(Code, Type)> {
        let real = Type::Basic(Kind::Lreal);
        match of {
            Ast::Int(value) => Ok((Code::Constant(*value as u64), Type::Literal)),
            Ast::Real(value) => Ok((Code::Constant(value.to_bits()), real)),
            Ast::Bool(value) => Ok((Code::Constant(u64::from(*value)), Type::Basic(Kind::Bool))),
            Ast::Not(of) => Ok((
                Code::Not(Box::new(self.condition(of)?)),
                Type::Basic(Kind::Bool),
            )),
            Ast::Minus(of) => match self.expression(of)? {
                (Code::Constant(word), Type::Literal) => Ok((
                    Code::Constant((word as i64).wrapping_neg() as u64),
                    Type::Literal,
                )),
                (code, Type::Basic(kind)) if kind != Kind::Bool => {
                    Ok((Code::Minus(kind, Box::new(code)), Type::Basic(kind)))
                }
                (_, kind) => Err(format!("minus {kind:?}")),
            },
            Ast::Binary(operator, a, b) => self.binary(operator, a, b),
            Ast::Call(name, arguments) => self.function(name, arguments),
            Ast::Name(_) | Ast::Field(..) | Ast::Index(..) => {
                let (place, kind, _) = self.place(of)?;
                // Constants are as good as literals.
                match kind {
                    Type::Basic(_)
                        if !place.is_pointer
                            && place.indices.is_empty()
                            && self.is_constant(of) =>
                    {
                        Ok((Code::Constant(self.compiler.memory[place.base]), kind))
                    }
                    Type::Basic(_) => Ok((Code::Load(Box::new(place)), kind)),
                    _ => Err(format!("{of:?} is more than one value")),
                }
            }
        }
    }

    fn is_constant(&self, of: &Ast) -> bool {
        matches!(of, Ast::Name(name) if self.compiler.constants.contains_key(name)
            && !self.signature.variables.iter().any(|(_, own, _, _)| own == name))
    }

    fn binary(&mut self, operator: &str, a: &Ast, b: &Ast) -> Result<(Code, Type)> {
        let ((a, of_a), (b, of_b)) = (self.expression(a)?, self.expression(b)?);
        let kind = match (&of_a, &of_b) {
            (Type::Basic(a), Type::Basic(b)) if a == b => *a,
            (Type::Basic(Kind::Dint), Type::Basic(Kind::Lint))
            | (Type::Basic(Kind::Lint), Type::Basic(Kind::Dint)) => Kind::Lint,
            (Type::Basic(kind @ (Kind::Dint | Kind::Lint)), Type::Literal)
            | (Type::Literal, Type::Basic(kind @ (Kind::Dint | Kind::Lint))) => *kind,
            _ => return Err(format!("{of_a:?} {operator} {of_b:?}")),
        };
        let (operator, is_logical, is_comparison) = match operator {
            "+" => (Operator::Add, false, false),
            "-" => (Operator::Subtract, false, false),
            "*" => (Operator::Multiply, false, false),
            "/" => (Operator::Divide, false, false),
            "mod" if kind != Kind::Lreal => (Operator::Modulo, false, false),
            "=" => (Operator::Equal, kind == Kind::Bool, true),
            "<>" => (Operator::Differs, kind == Kind::Bool, true),
            "<" => (Operator::Less, false, true),
            "<=" => (Operator::LessEqual, false, true),
            ">" => (Operator::Greater, false, true),
            ">=" => (Operator::GreaterEqual, false, true),
            "and" => (Operator::And, true, false),
            "or" => (Operator::Or, true, false),
            other => return Err(format!("{other} of {kind:?}")),
        };
        if is_logical != (kind == Kind::Bool) {
            return Err(format!("{operator:?} of {kind:?}"));
        }
        let result = if is_comparison { Kind::Bool } else { kind };
        Ok((
            Code::Binary(operator, kind, Box::new((a, b))),
            Type::Basic(result),
        ))
    }

    fn function(&mut self, name: &str, arguments: &[Argument]) -> Result<(Code, Type)> {
        let known = [
            ("abs", Known::Abs, Kind::Lreal, Kind::Lreal),
            ("sqrt", Known::Sqrt, Kind::Lreal, Kind::Lreal),
            ("exp", Known::Exp, Kind::Lreal, Kind::Lreal),
            ("ln", Known::Ln, Kind::Lreal, Kind::Lreal),
            ("trunc", Known::Trunc, Kind::Lreal, Kind::Dint),
            ("dint_to_lreal", Known::ToReal, Kind::Dint, Kind::Lreal),
            ("lint_to_lreal", Known::ToReal, Kind::Lint, Kind::Lreal),
            ("lint_to_dint", Known::ToDint, Kind::Lint, Kind::Dint),
        ];
        if let Some((_, known, from, to)) = known.into_iter().find(|(own, ..)| *own == name) {
            let [
                Argument {
                    name: None, value, ..
                },
            ] = arguments
            else {
                return Err(format!("{name} takes one value"));
            };
            return Ok((
                Code::Known(known, Box::new(self.as_type(value, from)?)),
                Type::Basic(to),
            ));
        }
        if name == "expt" {
            let [
                Argument {
                    name: None,
                    value: base,
                    ..
                },
                Argument {
                    name: None,
                    value: exponent,
                    ..
                },
            ] = arguments
            else {
                return Err("expt takes two values".to_owned());
            };
            let of = (
                self.as_type(base, Kind::Lreal)?,
                self.as_type(exponent, Kind::Lreal)?,
            );
            return Ok((Code::Power(Box::new(of)), Type::Basic(Kind::Lreal)));
        }
        let (call, result) = self.call(name, arguments)?;
        Ok((Code::Call(Box::new(call)), result))
    }

    fn call(&mut self, name: &str, arguments: &[Argument]) -> Result<(Call, Type)> {
        let unit = *self
            .compiler
            .units
            .get(name)
            .ok_or(format!("there is no function `{name}`"))?;
        let compiler = self.compiler;
        let signature = &compiler.signatures[unit];
        let Some(result) = &signature.result else {
            return Err(format!("`{name}` is no function"));
        };
        let mut call = Call {
            unit,
            inputs: Vec::new(),
            addresses: Vec::new(),
            outputs: Vec::new(),
        };
        let given: Vec<_> = (signature.variables.iter())
            .filter(|of| matches!(of.0, Section::Input | Section::InOut))
            .collect();
        let is_named = arguments.iter().any(|of| of.name.is_some());
        let taken = arguments.iter().filter(|of| !of.is_output).count();
        if taken != given.len() || arguments.iter().any(|of| of.name.is_some() != is_named) {
            return Err(format!("`{name}` takes {} values", given.len()));
        }
        for (nth, argument) in arguments.iter().enumerate() {
            let found = match &argument.name {
                None => given.get(nth).copied(),
                Some(name) => signature
                    .variables
                    .iter()
                    .find(|(_, own, _, _)| own == name),
            };
            let Some((section, own, of, cell)) = found else {
                return Err(format!("`{name}` has no {:?}", argument.name));
            };
            match (section, of) {
                (Section::Input, Type::Basic(kind)) if !argument.is_output => {
                    let code = self.as_type(&argument.value, *kind)?;
                    call.inputs.push((*cell, code));
                }
                (Section::InOut, _) if !argument.is_output => {
                    let (place, kind) = self.target(&argument.value)?;
                    if kind != *of {
                        return Err(format!("{kind:?} for `{own}` of `{name}`"));
                    }
                    call.addresses.push((*cell, place));
                }
                (Section::Output, _) if argument.is_output => {
                    let (place, kind) = self.target(&argument.value)?;
                    if kind != *of {
                        return Err(format!("{kind:?} from `{own}` of `{name}`"));
                    }
                    call.outputs.push((*cell, place));
                }
                _ => return Err(format!("`{own}` of `{name}` is not given so")),
            }
        }
        Ok((call, result.clone()))
    }

    /// Puts the inputs into an instance, and runs it.
    fn block_call(
        &mut self,
        instance: &Place,
        unit: usize,
        arguments: &[Argument],
    ) -> Result<Vec<Action>> {
        let compiler = self.compiler;
        let signature = &compiler.signatures[unit];
        let mut actions = Vec::new();
        for argument in arguments {
            let mut variables = signature.variables.iter();
            let found = variables.find(|(section, own, _, _)| {
                Some(own) == argument.name.as_ref() && *section == Section::Input
            });
            let Some((_, _, of, offset)) = found.filter(|_| !argument.is_output) else {
                return Err(format!("{:?} is no input", argument.name));
            };
            let mut place = instance.clone();
            place.offset += offset;
            actions.push(self.assigned(place, of, &argument.value)?);
        }
        actions.push(Action::Call(Call {
            unit,
            inputs: Vec::new(),
            addresses: vec![(signature.own, instance.clone())],
            outputs: Vec::new(),
        }));
        Ok(actions)
    }
}
