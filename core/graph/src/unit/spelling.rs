//! How units are spelt: common spellings to UCUM codes, a code taken apart into symbols; it knows no factors but prefixes.

use crate::diagnostic::nearest;

/// Spellings of whole symbols, and the UCUM symbols they stand for.
const SPELLINGS: [(&str, &str); 66] = [
    ("degC", "Cel"),
    ("\u{b0}C", "Cel"),
    ("\u{2103}", "Cel"),
    ("celsius", "Cel"),
    ("Celsius", "Cel"),
    ("degF", "[degF]"),
    ("\u{b0}F", "[degF]"),
    ("\u{2109}", "[degF]"),
    ("fahrenheit", "[degF]"),
    ("Fahrenheit", "[degF]"),
    ("kelvin", "K"),
    ("Kelvin", "K"),
    ("\u{212a}", "K"),
    ("\u{b0}", "deg"),
    ("ohm", "Ohm"),
    ("\u{c5}", "Ao"),
    ("\u{212b}", "Ao"),
    ("sec", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("minute", "min"),
    ("minutes", "min"),
    ("hr", "h"),
    ("hour", "h"),
    ("hours", "h"),
    ("day", "d"),
    ("days", "d"),
    ("in", "[in_i]"),
    ("inch", "[in_i]"),
    ("ft", "[ft_i]"),
    ("psi", "[psi]"),
    ("ppm", "[ppm]"),
    ("arcsec", "''"),
    ("arcmin", "'"),
    ("mas", "10*-3.''"),
    ("rpm", "/min"),
    ("RPM", "/min"),
    ("rps", "/s"),
    ("rev", "{rev}"),
    ("Nm", "N.m"),
    ("uNm", "uN.m"),
    ("mNm", "mN.m"),
    ("cNm", "cN.m"),
    ("kNm", "kN.m"),
    ("Ncm", "N.cm"),
    ("Nmm", "N.mm"),
    ("Wh", "W.h"),
    ("mWh", "mW.h"),
    ("kWh", "kW.h"),
    ("MWh", "MW.h"),
    ("Ah", "A.h"),
    ("mAh", "mA.h"),
    ("VA", "V.A"),
    ("kVA", "kV.A"),
    ("%RH", "%"),
    ("%rH", "%"),
    ("%rh", "%"),
    ("u\u{3b5}", "um/m"),
    ("ustrain", "um/m"),
    ("microstrain", "um/m"),
    ("mps", "m/s"),
    ("Pas", "Pa.s"),
    ("mPas", "mPa.s"),
    ("lpm", "L/min"),
    ("LPM", "L/min"),
    ("mmHg", "mm[Hg]"),
];

/// Whether a symbol is a level above a power, of which UCUM has none: `dBm` is that above 1 mW.
pub(super) fn is_level(symbol: &str) -> bool {
    ["dBm", "dBmW", "dB[mW]"].contains(&symbol)
}

/// The unit that a text may be a slip of the finger for. Short names lie near to many: one of a single letter, or that begins with
/// another, is none of them, and one that differs in its capitals alone is none where these separate units of different kinds (`mPa`, `NM`).
pub(super) fn near(text: &str) -> Option<&'static str> {
    let spelt = SPELLINGS.iter().map(|(spelling, _)| *spelling);
    let known = COMMON.iter().copied().chain(spelt);
    let same: Vec<_> = known
        .filter(|known| known.eq_ignore_ascii_case(text))
        .collect();
    let differing = |known: &&&str| {
        known
            .bytes()
            .zip(text.bytes())
            .filter(|(a, b)| a != b)
            .count()
    };
    if let Some(first) = same.iter().min_by_key(differing) {
        let dimension = |text: &str| ucum::analyze(&ucum_code(text)).ok().map(|of| of.dimension);
        let is_alike = |other: &&str| dimension(other) == dimension(first);
        return same.iter().all(is_alike).then_some(first);
    }
    let begins = |known: &&str| known.len() > 1 && known.chars().next() == text.chars().next();
    nearest(text, COMMON.iter().copied().filter(begins))
}

/// Units that are suggested for one that is not known.
pub(super) const COMMON: [&str; 61] = [
    "nm", "um", "mm", "cm", "m", "km", "pm", "K", "mK", "uK", "Cel", "degC", "degF", "s", "ms",
    "us", "ns", "min", "h", "d", "Pa", "kPa", "mPa", "MPa", "bar", "mbar", "V", "mV", "uV", "A",
    "mA", "W", "mW", "Hz", "kHz", "dB", "%", "rad", "urad", "mrad", "deg", "N", "mN", "J", "g",
    "kg", "mg", "1", "nm/min", "nm/s", "um/s", "mm/s", "mK/min", "K/min", "K/s", "nm/K", "um/K",
    "um/min", "L", "L/min", "Ohm",
];

/// The millionth of an inch, which takes no prefix.
pub(super) const MICROINCH: &str = "10*-6.[in_i]";

/// Units as words, without a prefix, and their codes.
const WORDS: [(&str, &str); 41] = [
    ("meter", "m"),
    ("metre", "m"),
    ("micron", "um"),
    ("inch", "[in_i]"),
    ("inches", "[in_i]"),
    ("mil", "[mil_i]"),
    ("thou", "[mil_i]"),
    ("uin", MICROINCH),
    ("\u{b5}in", MICROINCH),
    ("\u{3bc}in", MICROINCH),
    ("microinch", MICROINCH),
    ("microinches", MICROINCH),
    ("second", "s"),
    ("sec", "s"),
    ("minute", "min"),
    ("hour", "h"),
    ("hr", "h"),
    ("day", "d"),
    ("kelvin", "K"),
    ("celsius", "Cel"),
    ("centigrade", "Cel"),
    ("fahrenheit", "[degF]"),
    ("volt", "V"),
    ("watt", "W"),
    ("ampere", "A"),
    ("amp", "A"),
    ("ohm", "Ohm"),
    ("pascal", "Pa"),
    ("newton", "N"),
    ("joule", "J"),
    ("hertz", "Hz"),
    ("gram", "g"),
    ("gramme", "g"),
    ("liter", "L"),
    ("litre", "L"),
    ("radian", "rad"),
    ("degree", "deg"),
    ("arcsecond", "''"),
    ("arcminute", "'"),
    ("decibel", "dB"),
    ("percent", "%"),
];

/// Prefixes as words.
const PREFIX_WORDS: [(&str, &str); 7] = [
    ("nano", "n"),
    ("micro", "u"),
    ("milli", "m"),
    ("centi", "c"),
    ("kilo", "k"),
    ("mega", "M"),
    ("pico", "p"),
];

/// The code of a unit that is written as a word: `nm` for `nanometers`.
fn of_word(word: &str) -> Option<String> {
    let word = word.to_lowercase();
    let singular = word.strip_suffix('s').unwrap_or(&word);
    let known = |word: &str| WORDS.iter().find(|(name, _)| *name == word);
    for word in [word.as_str(), singular] {
        if let Some((_, code)) = known(word) {
            return Some((*code).to_owned());
        }
        for (prefix, short) in PREFIX_WORDS {
            if let Some((_, code)) = word.strip_prefix(prefix).and_then(known) {
                return Some(format!("{short}{code}"));
            }
        }
    }
    None
}

/// The text with codes in the place of words: `nm/min` for `nanometers/minute`.
pub(super) fn without_words(text: &str) -> String {
    let mut codes = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let in_word = |c: char| c.is_alphabetic() == first.is_alphabetic();
        let end = rest.find(|c| !in_word(c)).unwrap_or(rest.len());
        let (part, after) = rest.split_at(end);
        match of_word(part) {
            Some(code) => codes.push_str(&code),
            None => codes.push_str(part),
        }
        rest = after;
    }
    codes
}

/// Metric prefixes and their powers of ten.
const PREFIXES: [(&str, i32); 20] = [
    ("da", 1),
    ("Y", 24),
    ("Z", 21),
    ("E", 18),
    ("P", 15),
    ("T", 12),
    ("G", 9),
    ("M", 6),
    ("k", 3),
    ("h", 2),
    ("d", -1),
    ("c", -2),
    ("m", -3),
    ("u", -6),
    ("n", -9),
    ("p", -12),
    ("f", -15),
    ("a", -18),
    ("z", -21),
    ("y", -24),
];

/// `text` with every common spelling replaced by its UCUM code; what is not known stays as it is.
pub(super) fn ucum_code(text: &str) -> String {
    // Revolutions, in the language of many a drive, and no enzyme units.
    if text == "U/min" {
        return "/min".to_owned();
    }
    let mut code = String::new();
    let mut symbol = String::new();
    let mut brackets = 0usize;
    let flush = |symbol: &mut String, code: &mut String| {
        let of_symbol = one_symbol(symbol);
        // What stands for one symbol stays one operand.
        let one = if of_symbol.starts_with('/') && !code.is_empty() {
            "1"
        } else {
            ""
        };
        if code.ends_with('/') && of_symbol.contains(['.', '/']) {
            code.push_str(&format!("({one}{of_symbol})"));
        } else {
            code.push_str(one);
            code.push_str(&of_symbol);
        }
        symbol.clear();
    };
    for c in text.chars() {
        match c {
            '[' | '{' => brackets += 1,
            ']' | '}' => brackets = brackets.saturating_sub(1),
            _ => {}
        }
        match c {
            _ if brackets > 0 || c == ']' || c == '}' => symbol.push(c),
            // U+00B7 and U+22C5 are the raised dots; a star is a product except in UCUM's own `10*`.
            '.' | '\u{b7}' | '\u{22c5}' => {
                flush(&mut symbol, &mut code);
                code.push('.');
            }
            '*' if symbol != "10" => {
                flush(&mut symbol, &mut code);
                code.push('.');
            }
            '/' | '(' | ')' => {
                flush(&mut symbol, &mut code);
                code.push(c);
            }
            ' ' | '^' => {}
            _ => symbol.push(c),
        }
    }
    flush(&mut symbol, &mut code);
    code
}

fn one_symbol(symbol: &str) -> String {
    let plain: String = symbol
        .chars()
        .map(|c| match c {
            '\u{b5}' | '\u{3bc}' => 'u',
            '\u{207b}' | '\u{2212}' => '-',
            '\u{b9}' => '1',
            '\u{b2}' => '2',
            '\u{b3}' => '3',
            '\u{2074}' => '4',
            _ => c,
        })
        .collect::<String>()
        .replace(['\u{3a9}', '\u{2126}'], "Ohm");
    let (name, exponent) = split_exponent(&plain);
    match SPELLINGS.iter().find(|(spelling, _)| *spelling == name) {
        Some((_, code)) => format!("{code}{exponent}"),
        None => plain,
    }
}

/// A symbol and the digits of its exponent, which may be empty.
fn split_exponent(symbol: &str) -> (&str, &str) {
    let name = symbol.trim_end_matches(|c: char| c.is_ascii_digit());
    let name = name
        .strip_suffix(['-', '+'])
        .filter(|_| name.len() < symbol.len())
        .unwrap_or(name);
    if name.is_empty() {
        (symbol, "")
    } else {
        symbol.split_at(name.len())
    }
}

/// The symbols of a canonical UCUM code, each with its exponent, negative below the line; `None` for exponents beyond 1000.
pub(super) fn factors(code: &str) -> Option<Vec<(String, i32)>> {
    let mut factors = Vec::new();
    // UCUM reads from left to right: a `/` turns the sign of one operand, which may be a group, and holds in all of that group.
    let (mut group, mut sign) = (vec![1], 1);
    let mut rest = code;
    while let Some(first) = rest.chars().next() {
        let around = *group.last()?;
        let length = match first {
            '.' | '/' => {
                sign = if first == '/' { -1 } else { 1 };
                1
            }
            '(' => {
                group.push(around * sign);
                sign = 1;
                1
            }
            ')' => {
                group.pop();
                1
            }
            _ => {
                let length = symbol_length(rest);
                let (symbol, exponent) = split_exponent(&rest[..length]);
                let exponent = if exponent.is_empty() {
                    1
                } else {
                    exponent.parse::<i32>().ok().filter(|e| e.abs() <= 1000)?
                };
                factors.push((symbol.to_owned(), exponent * sign * around));
                length
            }
        };
        rest = &rest[length..];
    }
    Some(factors)
}

/// Length of the symbol at the start of `code`; what stands in brackets belongs to it.
fn symbol_length(code: &str) -> usize {
    let mut bracket = false;
    code.find(|c: char| {
        match c {
            '[' => bracket = true,
            ']' => bracket = false,
            _ => {}
        }
        !bracket && matches!(c, '.' | '/' | '(' | ')')
    })
    .unwrap_or(code.len())
}

/// The power of ten of a special unit's prefix, and the unit without it: `dB` is −1 and `B`.
pub(super) fn without_prefix(symbol: &str) -> (i32, &str) {
    PREFIXES
        .iter()
        .filter_map(|&(prefix, power)| Some((power, symbol.strip_prefix(prefix)?)))
        .find(|(_, name)| ucum::analyze(name).is_ok_and(|unit| unit.is_special))
        .unwrap_or((0, symbol))
}

/// The same for a linear unit that is a prefix and a unit, `None` for one that stands alone (`min`, `cd`, `Pa`).
pub(super) fn without_prefix_of_linear(symbol: &str) -> Option<(i32, &str)> {
    let whole = ucum::analyze(symbol).ok()?;
    PREFIXES
        .iter()
        .filter_map(|&(prefix, power)| Some((power, symbol.strip_prefix(prefix)?)))
        .filter(|(_, name)| !name.is_empty())
        .find(|(power, name)| {
            // `cd` is no hundredth of a day: the rest must be a unit of the same dimension, and the factors must fit.
            ucum::analyze(name).is_ok_and(|base| {
                let factor = base.factor * 10f64.powi(*power);
                base.dimension == whole.dimension && (factor / whole.factor - 1.0).abs() < 1e-12
            })
        })
}
