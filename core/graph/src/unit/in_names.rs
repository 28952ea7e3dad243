//! Which unit a word in the name of a column means; where in a name it may stand is decided by the reader of the name.

use super::Unit;
use super::spelling::MICROINCH;

/// Words, and the UCUM codes that they mean; the case counts for single letters, and where words differ in nothing else.
const WORDS: [(&str, &str); 102] = [
    ("degC", "Cel"),
    ("°C", "Cel"),
    ("celsius", "Cel"),
    ("C", "Cel"),
    ("degF", "[degF]"),
    ("°F", "[degF]"),
    ("fahrenheit", "[degF]"),
    ("F", "[degF]"),
    ("K", "K"),
    ("mK", "mK"),
    ("nm", "nm"),
    ("um", "um"),
    ("µm", "um"),
    ("μm", "um"),
    ("mm", "mm"),
    ("m", "m"),
    ("micron", "um"),
    ("microns", "um"),
    ("inch", "[in_i]"),
    ("inches", "[in_i]"),
    ("mil", "[mil_i]"),
    ("mils", "[mil_i]"),
    ("thou", "[mil_i]"),
    ("uin", MICROINCH),
    ("µin", MICROINCH),
    ("μin", MICROINCH),
    ("microinch", MICROINCH),
    ("microinches", MICROINCH),
    ("uinch", MICROINCH),
    ("V", "V"),
    ("mV", "mV"),
    ("A", "A"),
    ("mA", "mA"),
    ("W", "W"),
    ("kW", "kW"),
    ("Wm2", "W/m2"),
    ("W/m2", "W/m2"),
    ("Pa", "Pa"),
    ("bar", "bar"),
    ("%", "%"),
    ("pct", "%"),
    ("percent", "%"),
    ("%RH", "%"),
    ("rpm", "/min"),
    ("Hz", "Hz"),
    ("kHz", "kHz"),
    ("Nm", "N.m"),
    ("kWh", "kW.h"),
    ("dB", "dB"),
    ("ppm", "[ppm]"),
    ("hPa", "hPa"),
    ("kPa", "kPa"),
    ("mbar", "mbar"),
    ("MHz", "MHz"),
    ("GHz", "GHz"),
    ("mHz", "mHz"),
    ("uV", "uV"),
    ("µV", "uV"),
    ("μV", "uV"),
    ("kV", "kV"),
    ("uA", "uA"),
    ("µA", "uA"),
    ("μA", "uA"),
    ("mW", "mW"),
    ("MW", "MW"),
    ("uW", "uW"),
    ("µW", "uW"),
    ("μW", "uW"),
    ("uK", "uK"),
    ("µK", "uK"),
    ("μK", "uK"),
    ("cm", "cm"),
    ("km", "km"),
    ("MPa", "MPa"),
    ("mPa", "mPa"),
    ("psi", "psi"),
    ("kN", "kN"),
    ("mN", "mN"),
    ("kg", "kg"),
    ("kJ", "kJ"),
    ("Ohm", "Ohm"),
    ("kOhm", "kOhm"),
    ("mOhm", "mOhm"),
    ("mrad", "mrad"),
    ("urad", "urad"),
    ("µrad", "urad"),
    ("μrad", "urad"),
    ("nrad", "nrad"),
    ("arcsec", "arcsec"),
    ("arcmin", "arcmin"),
    ("lpm", "lpm"),
    ("ustrain", "ustrain"),
    ("microstrain", "ustrain"),
    ("ppb", "[ppb]"),
    ("steps", "1"),
    ("counts", "1"),
    ("ticks", "1"),
    ("pulses", "1"),
    ("increments", "1"),
    ("pixel", "1"),
    ("pixels", "1"),
    ("px", "1"),
];

impl Unit {
    /// The unit that a word in the name of a column means, such as `degC` in `plate_degC`; none where the word has other meanings
    /// that are as usual, such as `min`.
    #[must_use]
    pub fn in_name(word: &str) -> Option<Self> {
        let in_any_case = |known: &str| {
            known.len() > 1
                && known.eq_ignore_ascii_case(word)
                && !["MK", "NM", "MN", "mn"].contains(&word)
        };
        let exact = WORDS.iter().find(|(known, _)| *known == word);
        let (_, code) = exact.or_else(|| WORDS.iter().find(|(known, _)| in_any_case(known)))?;
        Self::parse(code).ok()
    }

    /// The unit that a text means which is meant to be one: a word as in names, or a spelling as in graph files.
    #[must_use]
    pub fn in_words(text: &str) -> Option<Self> {
        Self::in_name(text).or_else(|| Self::parse(text).ok())
    }
}
