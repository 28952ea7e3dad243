//! The words, numbers and marks of Structured Text, each with its line. What is not of the subset is refused.

use std::iter::Peekable;
use std::str::Chars;

use super::parser::Result;

#[derive(Debug, Clone, PartialEq)]
pub enum Token {
    /// Identifiers and keywords, in lower case: case does not count.
    Word(String),
    Int(i64),
    Real(f64),
    Mark(&'static str),
    End,
}

const MARKS: [&str; 21] = [
    ":=", "=>", "<=", ">=", "<>", "..", "(", ")", "[", "]", ":", ";", ",", ".", "+", "-", "*", "/",
    "=", "<", ">",
];

/// Words that are no identifiers: keywords, and the functions that every compiler has.
const RESERVED: &str = "abs acos action add and any any_int any_num any_real array asin at atan bool by byte case configuration constant continue cos ctd ctu ctud date \
    delete dint div do dt dword else elsif en end_case end_for end_function end_function_block end_if end_program end_repeat end_struct \
    end_type end_var end_while eno eq exit exp expt false find for from function function_block ge gt if in_out initial_step insert int \
    interface jmp le left len limit ln log lreal lt lint lword max method mid min mod move mul mux ne nil not null of on or override \
    pointer private program property protected public read_only read_write real ref ref_to reference repeat replace resource retain \
    return right rol ror rs sel shl shr sin sint sqrt sr step string struct sub super tan task then this time time_of_day to tod tof ton \
    tp transition true trunc type udint uint ulint until usint var var_access var_config var_external var_global var_in_out var_input \
    var_output var_temp while with word wstring xor";

/// Whether a word may name something.
pub fn is_reserved(word: &str) -> bool {
    RESERVED.split_ascii_whitespace().any(|of| of == word)
}

/// All of a text.
pub fn tokens(text: &str) -> Result<Vec<(Token, usize)>> {
    let mut all = Vec::new();
    let mut chars = text.chars().peekable();
    let mut line = 1;
    while let Some(&c) = chars.peek() {
        if c == '\n' {
            line += 1;
        }
        if c.is_ascii_whitespace() {
            chars.next();
        } else if c.is_ascii_alphabetic() || c == '_' {
            all.push((word(&mut chars, line)?, line));
        } else if c.is_ascii_digit() {
            all.push((number(&mut chars, line)?, line));
        } else {
            let mut ahead = chars.clone();
            let two: String = ahead.by_ref().take(2).collect();
            if two == "(*" {
                let begun = line;
                let mut last = ' ';
                chars = ahead;
                loop {
                    let next = chars
                        .next()
                        .ok_or(format!("line {begun}: a comment does not end"))?;
                    line += usize::from(next == '\n');
                    if last == '*' && next == ')' {
                        break;
                    }
                    last = next;
                }
                continue;
            }
            let mark = MARKS.iter().find(|mark| two.starts_with(**mark));
            let mark = *mark.ok_or(format!("line {line}: `{c}` is not of the subset"))?;
            chars.nth(mark.len() - 1);
            all.push((Token::Mark(mark), line));
        }
    }
    all.push((Token::End, line));
    Ok(all)
}

fn word(chars: &mut Peekable<Chars<'_>>, line: usize) -> Result<Token> {
    let mut word = String::new();
    while let Some(c) = chars.next_if(|c| c.is_ascii_alphanumeric() || *c == '_') {
        word.push(c.to_ascii_lowercase());
    }
    if word.contains("__") || word.ends_with('_') || word.starts_with('_') {
        return Err(format!("line {line}: `{word}` is no identifier"));
    }
    Ok(Token::Word(word))
}

fn number(chars: &mut Peekable<Chars<'_>>, line: usize) -> Result<Token> {
    let mut text = String::new();
    while let Some(c) = chars.next_if(char::is_ascii_digit) {
        text.push(c);
    }
    let mut ahead = chars.clone();
    let is_real = ahead.next() == Some('.') && ahead.next().is_some_and(|c| c.is_ascii_digit());
    if !is_real {
        return text
            .parse()
            .map(Token::Int)
            .map_err(|_| format!("line {line}: {text} is too large"));
    }
    text.extend(chars.next());
    while let Some(c) = chars.next_if(|c| c.is_ascii_digit()) {
        text.push(c);
    }
    if let Some(e) = chars.next_if(|c| *c == 'E') {
        text.push(e);
        text.extend(chars.next_if(|c| matches!(c, '+' | '-')));
        while let Some(c) = chars.next_if(|c| c.is_ascii_digit()) {
            text.push(c);
        }
    }
    let value: f64 = text
        .parse()
        .map_err(|_| format!("line {line}: {text} is no number"))?;
    match value.is_finite() {
        true => Ok(Token::Real(value)),
        false => Err(format!("line {line}: {text} is too large")),
    }
}
