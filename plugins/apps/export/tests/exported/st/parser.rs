//! Reads the subset of Structured Text that is exported: declarations, statements and expressions. What is not of it is refused, with its
//! line; types are looked at elsewhere.

use super::lexer::{Token, is_reserved, tokens};

/// What cannot be read, with its line.
pub type Result<T> = std::result::Result<T, String>;

/// An expression.
#[derive(Debug, Clone)]
pub enum Ast {
    Int(i64),
    Real(f64),
    Bool(bool),
    Name(String),
    Field(Box<Ast>, String),
    Index(Box<Ast>, Box<Ast>),
    Call(String, Vec<Argument>),
    Minus(Box<Ast>),
    Not(Box<Ast>),
    Binary(&'static str, Box<Ast>, Box<Ast>),
}

/// What a call is given: by place, by name, or `output => variable`.
#[derive(Debug, Clone)]
pub struct Argument {
    pub name: Option<String>,
    pub is_output: bool,
    pub value: Ast,
}

#[derive(Debug, Clone)]
pub enum TypeOf {
    Named(String),
    Array(Ast, Ast, Box<TypeOf>),
}

/// What something begins with.
#[derive(Debug, Clone)]
pub enum Initial {
    Value(Ast),
    List(Vec<Initial>),
    Fields(Vec<(String, Initial)>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Section {
    Input,
    Output,
    InOut,
    Local,
}

#[derive(Debug, Clone)]
pub struct Variable {
    pub name: String,
    pub of: TypeOf,
    pub initial: Option<Initial>,
    pub line: usize,
}

#[derive(Debug, Clone)]
pub struct Statement {
    pub line: usize,
    pub what: What,
}

#[derive(Debug, Clone)]
pub enum What {
    Assign(Ast, Ast),
    Call(String, Vec<Argument>),
    If(Vec<(Ast, Vec<Statement>)>, Vec<Statement>),
    Case(Ast, Vec<(Ast, Vec<Statement>)>, Vec<Statement>),
    For(String, Ast, Ast, i64, Vec<Statement>),
    While(Ast, Vec<Statement>),
    Return,
    Exit,
}

/// A function, or a function block, which has no result.
#[derive(Debug)]
pub struct Unit {
    pub name: String,
    pub result: Option<TypeOf>,
    pub variables: Vec<(Section, Variable)>,
    pub body: Vec<Statement>,
}

/// All that texts declare.
#[derive(Debug, Default)]
pub struct Texts {
    pub constants: Vec<Variable>,
    pub structures: Vec<(String, Vec<Variable>)>,
    pub units: Vec<Unit>,
}

impl Texts {
    /// Reads one more text.
    pub fn read(&mut self, text: &str) -> Result<()> {
        let mut parser = Parser {
            tokens: tokens(text)?,
            place: 0,
        };
        while *parser.peek() != Token::End {
            parser.declaration(self)?;
        }
        Ok(())
    }
}

struct Parser {
    tokens: Vec<(Token, usize)>,
    place: usize,
}

impl Parser {
    fn peek(&self) -> &Token {
        &self.tokens[self.place].0
    }

    fn line(&self) -> usize {
        self.tokens[self.place].1
    }

    fn next(&mut self) -> Token {
        let token = self.tokens[self.place].0.clone();
        self.place = (self.place + 1).min(self.tokens.len() - 1);
        token
    }

    fn wrong<T>(&self, expected: &str) -> Result<T> {
        Err(format!(
            "line {}: {expected} expected, not {:?}",
            self.line(),
            self.peek()
        ))
    }

    fn is(&self, word: &str) -> bool {
        matches!(self.peek(), Token::Word(own) if own == word)
    }

    fn take(&mut self, word: &str) -> bool {
        let is = self.is(word) || matches!(self.peek(), Token::Mark(own) if *own == word);
        if is {
            self.next();
        }
        is
    }

    fn expect(&mut self, word: &str) -> Result<()> {
        match self.take(word) {
            true => Ok(()),
            false => self.wrong(&format!("`{word}`")),
        }
    }

    /// A name that is no keyword.
    fn name(&mut self) -> Result<String> {
        match self.peek().clone() {
            Token::Word(word) if !is_reserved(&word) => {
                self.next();
                Ok(word)
            }
            _ => self.wrong("a name"),
        }
    }

    fn declaration(&mut self, texts: &mut Texts) -> Result<()> {
        if self.take("var_global") {
            self.expect("constant")?;
            self.variables(&mut texts.constants)
        } else if self.take("type") {
            let name = self.name()?;
            self.expect(":")?;
            self.expect("struct")?;
            let mut fields = Vec::new();
            while !self.take("end_struct") {
                fields.push(self.variable()?);
            }
            self.expect("end_type")?;
            texts.structures.push((name, fields));
            Ok(())
        } else if self.take("function") {
            let name = self.name()?;
            self.expect(":")?;
            let result = Some(self.type_of()?);
            self.unit(texts, name, result, "end_function")
        } else if self.take("function_block") {
            let name = self.name()?;
            self.unit(texts, name, None, "end_function_block")
        } else {
            self.wrong("a declaration")
        }
    }

    fn unit(
        &mut self,
        texts: &mut Texts,
        name: String,
        result: Option<TypeOf>,
        end: &str,
    ) -> Result<()> {
        let mut variables = Vec::new();
        let sections = [
            ("var_input", Section::Input),
            ("var_output", Section::Output),
            ("var_in_out", Section::InOut),
            ("var", Section::Local),
        ];
        while let Some((word, section)) = sections.iter().find(|(word, _)| self.is(word)) {
            self.expect(word)?;
            let mut own = Vec::new();
            self.variables(&mut own)?;
            variables.extend(own.into_iter().map(|variable| (*section, variable)));
        }
        let body = self.statements(&[end])?;
        self.expect(end)?;
        texts.units.push(Unit {
            name,
            result,
            variables,
            body,
        });
        Ok(())
    }

    fn variables(&mut self, all: &mut Vec<Variable>) -> Result<()> {
        while !self.take("end_var") {
            all.push(self.variable()?);
        }
        Ok(())
    }

    fn variable(&mut self) -> Result<Variable> {
        let line = self.line();
        let name = self.name()?;
        self.expect(":")?;
        let of = self.type_of()?;
        let initial = match self.take(":=") {
            true => Some(self.initial()?),
            false => None,
        };
        self.expect(";")?;
        Ok(Variable {
            name,
            of,
            initial,
            line,
        })
    }

    fn type_of(&mut self) -> Result<TypeOf> {
        if self.take("array") {
            self.expect("[")?;
            let low = self.expression()?;
            self.expect("..")?;
            let high = self.expression()?;
            self.expect("]")?;
            self.expect("of")?;
            return Ok(TypeOf::Array(low, high, Box::new(self.type_of()?)));
        }
        match self.next() {
            Token::Word(word)
                if ["bool", "dint", "lint", "lreal"].contains(&&*word) || !is_reserved(&word) =>
            {
                Ok(TypeOf::Named(word))
            }
            _ => self.wrong("a type"),
        }
    }

    fn initial(&mut self) -> Result<Initial> {
        if self.take("[") {
            let mut list = vec![self.initial()?];
            while self.take(",") {
                list.push(self.initial()?);
            }
            self.expect("]")?;
            return Ok(Initial::List(list));
        }
        if self.take("(") {
            let mut fields = Vec::new();
            loop {
                let name = self.name()?;
                self.expect(":=")?;
                fields.push((name, self.initial()?));
                if !self.take(",") {
                    break;
                }
            }
            self.expect(")")?;
            return Ok(Initial::Fields(fields));
        }
        self.expression().map(Initial::Value)
    }

    /// Statements up to one of these words, which is left.
    fn statements(&mut self, ends: &[&str]) -> Result<Vec<Statement>> {
        let mut all = Vec::new();
        while !ends.iter().any(|end| self.is(end)) {
            // A label of a case ends the statements before it.
            if ends.contains(&"end_case") && self.is_label() {
                break;
            }
            let line = self.line();
            let what = self.statement()?;
            self.expect(";")?;
            all.push(Statement { line, what });
        }
        Ok(all)
    }

    fn is_label(&self) -> bool {
        matches!(self.peek(), Token::Word(_) | Token::Int(_))
            && matches!(
                &self.tokens[(self.place + 1).min(self.tokens.len() - 1)].0,
                Token::Mark(":")
            )
    }

    fn statement(&mut self) -> Result<What> {
        if self.take("if") {
            let mut branches = Vec::new();
            let mut otherwise = Vec::new();
            loop {
                let condition = self.expression()?;
                self.expect("then")?;
                branches.push((condition, self.statements(&["elsif", "else", "end_if"])?));
                if !self.take("elsif") {
                    break;
                }
            }
            if self.take("else") {
                otherwise = self.statements(&["end_if"])?;
            }
            self.expect("end_if")?;
            return Ok(What::If(branches, otherwise));
        }
        if self.take("case") {
            let of = self.expression()?;
            self.expect("of")?;
            let mut branches = Vec::new();
            while self.is_label() {
                let label = self.expression()?;
                self.expect(":")?;
                branches.push((label, self.statements(&["else", "end_case"])?));
            }
            let otherwise = match self.take("else") {
                true => self.statements(&["end_case"])?,
                false => Vec::new(),
            };
            self.expect("end_case")?;
            return Ok(What::Case(of, branches, otherwise));
        }
        if self.take("for") {
            let name = self.name()?;
            self.expect(":=")?;
            let from = self.expression()?;
            self.expect("to")?;
            let to = self.expression()?;
            let by = match self.take("by") {
                true => match self.expression()? {
                    Ast::Int(by) if by > 0 => by,
                    Ast::Minus(by) if matches!(*by, Ast::Int(1)) => -1,
                    _ => return self.wrong("a constant step"),
                },
                false => 1,
            };
            self.expect("do")?;
            let body = self.statements(&["end_for"])?;
            self.expect("end_for")?;
            return Ok(What::For(name, from, to, by, body));
        }
        if self.take("while") {
            let condition = self.expression()?;
            self.expect("do")?;
            let body = self.statements(&["end_while"])?;
            self.expect("end_while")?;
            return Ok(What::While(condition, body));
        }
        if self.take("return") {
            return Ok(What::Return);
        }
        if self.take("exit") {
            return Ok(What::Exit);
        }
        match self.postfix()? {
            Ast::Call(name, arguments) => Ok(What::Call(name, arguments)),
            target => {
                self.expect(":=")?;
                Ok(What::Assign(target, self.expression()?))
            }
        }
    }

    fn expression(&mut self) -> Result<Ast> {
        self.binary(0)
    }

    /// Operators by how weakly they bind.
    fn binary(&mut self, level: usize) -> Result<Ast> {
        const LEVELS: [&[&str]; 6] = [
            &["or"],
            &["and"],
            &["=", "<>"],
            &["<", ">", "<=", ">="],
            &["+", "-"],
            &["*", "/", "mod"],
        ];
        let Some(operators) = LEVELS.get(level) else {
            return self.unary();
        };
        let mut left = self.binary(level + 1)?;
        while let Some(&operator) = operators.iter().find(|of| self.take(of)) {
            let right = self.binary(level + 1)?;
            left = Ast::Binary(operator, Box::new(left), Box::new(right));
        }
        Ok(left)
    }

    fn unary(&mut self) -> Result<Ast> {
        if self.take("-") {
            return Ok(Ast::Minus(Box::new(self.unary()?)));
        }
        if self.take("not") {
            return Ok(Ast::Not(Box::new(self.unary()?)));
        }
        self.postfix()
    }

    fn postfix(&mut self) -> Result<Ast> {
        let mut value = self.primary()?;
        loop {
            if self.take("[") {
                let index = self.expression()?;
                self.expect("]")?;
                value = Ast::Index(Box::new(value), Box::new(index));
            } else if self.take(".") {
                value = Ast::Field(Box::new(value), self.name()?);
            } else {
                return Ok(value);
            }
        }
    }

    fn primary(&mut self) -> Result<Ast> {
        const FUNCTIONS: [&str; 6] = ["abs", "sqrt", "exp", "ln", "expt", "trunc"];
        match self.peek().clone() {
            Token::Int(value) => {
                self.next();
                Ok(Ast::Int(value))
            }
            Token::Real(value) => {
                self.next();
                Ok(Ast::Real(value))
            }
            Token::Mark("(") => {
                self.next();
                let inner = self.expression()?;
                self.expect(")")?;
                Ok(inner)
            }
            Token::Word(word) if word == "true" || word == "false" => {
                self.next();
                Ok(Ast::Bool(word == "true"))
            }
            Token::Word(word) if FUNCTIONS.contains(&&*word) || !is_reserved(&word) => {
                self.next();
                match self.take("(") {
                    true => Ok(Ast::Call(word, self.arguments()?)),
                    false => Ok(Ast::Name(word)),
                }
            }
            _ => self.wrong("a value"),
        }
    }

    fn arguments(&mut self) -> Result<Vec<Argument>> {
        let mut all = Vec::new();
        if self.take(")") {
            return Ok(all);
        }
        loop {
            let after = self.tokens[(self.place + 1).min(self.tokens.len() - 1)]
                .0
                .clone();
            let is_output = after == Token::Mark("=>");
            let name = match after == Token::Mark(":=") || is_output {
                true => Some(self.name()?),
                false => None,
            };
            if name.is_some() {
                self.next();
            }
            all.push(Argument {
                name,
                is_output,
                value: self.expression()?,
            });
            if !self.take(",") {
                break;
            }
        }
        self.expect(")")?;
        Ok(all)
    }
}
