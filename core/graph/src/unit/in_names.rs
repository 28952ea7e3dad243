//! Which unit a word in the name of a column means; where in a name it may stand is decided by the reader of the name.

use super::Unit;
use super::spelling::MICROINCH;

/// Words, and the UCUM codes that they mean; the case counts for single letters, and where words differ in nothing else.
const WORDS: [(&str, &str); 137] = [
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
    ("kelvin", "K"),
    ("Å", "Ao"),
    ("\u{212b}", "Ao"),
    ("angstrom", "Ao"),
    ("angstroms", "Ao"),
    ("mas", "mas"),
    ("arcseconds", "arcsec"),
    ("arcsecond", "arcsec"),
    ("asec", "arcsec"),
    ("VDC", "V"),
    ("VAC", "V"),
    ("mVDC", "mV"),
    ("volts", "V"),
    ("volt", "V"),
    ("millivolts", "mV"),
    ("amps", "A"),
    ("watts", "W"),
    ("ohms", "Ohm"),
    ("Ω", "Ohm"),
    ("\u{2126}", "Ohm"),
    ("kΩ", "kOhm"),
    ("mΩ", "mOhm"),
    ("RH%", "%"),
    ("rF%", "%"),
    ("millimeter", "mm"),
    ("millimeters", "mm"),
    ("micrometer", "um"),
    ("micrometers", "um"),
    ("nanometer", "nm"),
    ("nanometers", "nm"),
    ("mmHg", "mm[Hg]"),
    ("mg", "mg"),
    ("mGal", "mGal"),
    ("uGal", "uGal"),
    ("µGal", "uGal"),
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

    /// The unit that a text means which is meant to be one: a word as in names, a spelling as in graph files, or one in full
    /// such as `Deg C`.
    #[must_use]
    pub fn in_words(text: &str) -> Option<Self> {
        let code = || Self::parse(text).ok();
        let in_full = || {
            let squeezed = text.to_lowercase().replace([' ', '.', '^'], "");
            let rest = squeezed.strip_prefix("degrees");
            let rest = rest.or_else(|| squeezed.strip_prefix("degree"));
            let short = rest.map_or(squeezed.clone(), |rest| match rest {
                "" => "deg".to_owned(),
                "celsius" => "degC".to_owned(),
                rest => format!("deg{rest}"),
            });
            Self::in_name(&short).or_else(|| Self::parse(&short).ok().filter(|_| rest.is_some()))
        };
        Self::in_name(text).or_else(code).or_else(in_full)
    }
}
