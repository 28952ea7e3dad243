use proptest::prelude::*;

use super::*;

fn unit(text: &str) -> Unit {
    Unit::parse(text).unwrap_or_else(|error| panic!("{text}: {error}"))
}

fn factor(from: &str, to: &str) -> Option<f64> {
    unit(from).factor_to(&unit(to))
}

#[test]
fn common_spellings_mean_ucum_codes() {
    for (spelling, code) in [
        ("degC", "Cel"),
        ("\u{b0}C", "Cel"),
        ("\u{2103}", "Cel"),
        ("degF", "[degF]"),
        ("\u{b0}F", "[degF]"),
        ("\u{b5}m", "um"),
        ("\u{3bc}m", "um"),
        ("um", "um"),
        ("nm / min", "nm/min"),
        ("m^2", "m2"),
        ("m\u{b2}", "m2"),
        ("s\u{207b}\u{b9}", "s-1"),
        ("N\u{b7}m", "N.m"),
        ("k\u{3a9}", "kOhm"),
        ("m\u{3a9}/K", "mOhm/K"),
        ("in", "[in_i]"),
        ("10*3", "10*3"),
    ] {
        assert_eq!(unit(spelling).text(), code, "{spelling}");
    }
}

#[test]
fn factors_of_decimal_units_are_exact() {
    assert_eq!(factor("nm/min", "nm/min"), Some(1.0));
    assert_eq!(factor("K/s", "mK/min"), Some(60_000.0));
    assert_eq!(factor("mK/min", "K/s"), Some(1.0 / 60_000.0));
    assert_eq!(factor("nm/s", "nm/min"), Some(60.0));
    assert_eq!(factor("um/h", "nm/min"), Some(1_000.0 / 60.0));
    assert_eq!(factor("m", "nm"), Some(1e9));
    assert_eq!(factor("nm", "m"), Some(1e-9));
    assert_eq!(factor("um", "nm"), Some(1_000.0));
    assert_eq!(factor("[in_i]", "nm"), Some(25_400_000.0));
    assert_eq!(factor("[mil_i]", "nm"), Some(25_400.0));
    assert_eq!(factor("10*-6.[in_i]", "nm"), Some(25.4));
    assert_eq!(factor("d", "min"), Some(1_440.0));
    assert_eq!(factor("km/h", "m/s"), Some(1.0 / 3.6));
    assert_eq!(factor("m2", "mm2"), Some(1e6));
    assert_eq!(factor("%", "1"), Some(0.01));
    assert_eq!(factor("kPa", "mbar"), Some(10.0));
    assert_eq!(factor("N", "kg.m/s2"), Some(1.0));
    assert_eq!(factor("N", "kg.(m/s2)"), Some(1.0));
}

#[test]
fn different_quantities_have_no_factor() {
    assert_eq!(factor("nm", "s"), None);
    assert_eq!(factor("nm/min", "nm"), None);
    assert_eq!(factor("dB", "1"), None);
    assert_eq!(factor("[pH]", "dB"), None);
    assert_eq!(factor("dB", "dB"), Some(1.0));
    assert_eq!(factor("B", "dB"), Some(10.0));
    assert_eq!(factor("dB/min", "dB/s"), Some(1.0 / 60.0));
}

#[test]
fn temperatures_convert_as_points_and_their_differences_by_factors() {
    let (celsius, fahrenheit, kelvin) = (unit("Cel"), unit("degF"), unit("K"));
    assert!(
        celsius.is_temperature_point()
            && fahrenheit.is_temperature_point()
            && !kelvin.is_temperature_point()
    );
    assert_eq!(celsius.convert(20.0, &kelvin), Some(293.15));
    assert_eq!(celsius.convert(100.0, &fahrenheit), Some(212.0));
    assert_eq!(fahrenheit.convert(32.0, &celsius), Some(0.0));
    assert_eq!(fahrenheit.convert(-459.67, &kelvin), Some(0.0));
    assert_eq!(kelvin.convert(273.15, &celsius), Some(0.0));
    assert_eq!(unit("mK").convert(273_150.0, &celsius), Some(0.0));
    assert_eq!(celsius.convert(37.0, &celsius), Some(37.0));
    assert_eq!(celsius.factor_to(&kelvin), Some(1.0));
    assert_eq!(fahrenheit.factor_to(&kelvin), Some(5.0 / 9.0));
    assert_eq!(celsius.factor_to(&unit("mK")), Some(1_000.0));
    assert_eq!(celsius.difference(), kelvin);
    assert_eq!(fahrenheit.difference(), unit("[degR]"));
    assert_eq!(fahrenheit.difference().factor_to(&kelvin), Some(5.0 / 9.0));
    assert_eq!(unit("nm").difference(), unit("nm"));
    assert_ne!(celsius, kelvin);
}

#[test]
fn a_unit_per_another_is_their_quotient() {
    let per = |above: &str, below: &str| unit(above).per(&unit(below));
    assert_eq!(per("nm", "min"), unit("nm/min"));
    assert_eq!(per("nm", "min").to_string(), "nm/min");
    assert_eq!(per("Cel", "min").to_string(), "K/min");
    assert_eq!(per("nm/min", "s").to_string(), "nm/min/s");
    assert_eq!(per("nm", "nm/K"), unit("K"));
    assert_eq!(per("nm", "nm/K").to_string(), "nm/(nm/K)");
    assert_eq!(per("nm", "1").to_string(), "nm");
    assert_eq!(per("1", "s"), unit("Hz"));
    assert_eq!(
        Unit::parse(per("nm", "nm/K").text()).as_ref(),
        Ok(&unit("K"))
    );
    assert_eq!(Unit::second(), unit("s"));
    assert_eq!(Unit::one(), unit("1"));
}

#[test]
fn equal_units_are_those_that_mean_the_same() {
    assert_eq!(unit("um"), unit("\u{b5}m"));
    assert_eq!(unit("m/ks"), unit("mm/s"));
    assert_eq!(unit("mL"), unit("cm3"));
    assert_ne!(unit("nm"), unit("um"));
    assert_ne!(unit("dB"), unit("B"));
}

#[test]
fn what_is_no_unit_is_refused_with_advice() {
    let error = |text: &str| {
        Unit::parse(text)
            .expect_err("the test's text is no unit")
            .to_string()
    };
    assert_eq!(
        error(""),
        "a unit is a UCUM code like \"nm/min\" (\"1\" if there is none), found an empty text"
    );
    assert_eq!(
        error("nm/mn"),
        "\"mn\" in \"nm/mn\" is not a unit that UCUM knows; did you mean \"nm/min\"?"
    );
    assert_eq!(
        error("kPaa"),
        "\"kPaa\" is not a unit that UCUM knows; did you mean \"kPa\"?"
    );
    assert_eq!(
        error("flurble"),
        "\"flurble\" is not a unit that UCUM knows"
    );
    assert_eq!(
        error("nm/"),
        "\"nm/\" is not built like a unit, e.g. \"nm/min\": reading stopped at byte 3"
    );
    assert_eq!(
        error("\u{b0}C/min"),
        "\"\u{b0}C/min\" has a temperature scale in a compound, where only differences have a meaning; write \"K/min\""
    );
    assert_eq!(
        error("mCel"),
        "\"mCel\" has a temperature scale in a compound, where only differences have a meaning; write \"mK\""
    );
    assert_eq!(
        error(&"m.".repeat(40)),
        "a unit has at most 64 characters, found 80"
    );
}

#[test]
fn json_holds_units_as_texts() {
    assert_eq!(serde_json::json!(unit("degC")), serde_json::json!("Cel"));
    assert_eq!(
        serde_json::from_str::<Unit>("\"\u{b5}m\"").ok(),
        Some(unit("um"))
    );
    assert!(serde_json::from_str::<Unit>("5").is_err());
}

proptest! {
    #[test]
    fn no_text_makes_the_parser_panic(text in "\\PC{0,20}|[a-zA-Z0-9./()\\[\\]{}*^-]{0,24}") {
        match Unit::parse(&text) {
            Ok(unit) => {
                prop_assert_eq!(Unit::parse(unit.text()), Ok(unit.clone()));
                prop_assert_eq!(unit.factor_to(&unit), Some(1.0));
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }

    #[test]
    fn factors_there_and_back_cancel(a in 0..spelling::COMMON.len(), b in 0..spelling::COMMON.len()) {
        let (a, b) = (unit(spelling::COMMON[a]), unit(spelling::COMMON[b]));
        if let (Some(there), Some(back)) = (a.factor_to(&b), b.factor_to(&a)) {
            prop_assert!((there * back - 1.0).abs() < 1e-15);
        }
    }
}

#[test]
fn units_in_words_are_not_taken_and_the_codes_are_suggested() {
    for (words, code) in [
        ("nanometer", "nm"),
        ("Nanometers/minute", "nm/min"),
        ("micrometres", "um"),
        ("millikelvin/second", "mK/s"),
        ("percent", "%"),
        ("mil", "[mil_i]"),
        ("thou/h", "[mil_i]/h"),
        ("\u{b5}in/min", "10*-6.[in_i]/min"),
        ("microns", "um"),
    ] {
        let error = Unit::parse(words).unwrap_err();
        assert_eq!(error.advice(), Some(code), "{words}: {error}");
    }
}

#[test]
fn a_name_may_say_inches_and_their_parts() {
    for (word, nm) in [
        ("inch", 25_400_000.0),
        ("Inches", 25_400_000.0),
        ("mil", 25_400.0),
        ("thou", 25_400.0),
        ("\u{b5}in", 25.4),
        ("uin", 25.4),
        ("micron", 1_000.0),
    ] {
        let found = Unit::in_name(word).and_then(|unit| unit.factor_to(&unit_of_nm()));
        assert_eq!(found, Some(nm), "{word}");
    }
    assert!(Unit::in_name("in").is_none(), "an inlet has that name too");
}

fn unit_of_nm() -> Unit {
    unit("nm")
}

#[test]
fn spellings_of_machine_logs_are_taken_for_what_they_mean() {
    for (spelling, code) in [
        ("Nm", "N.m"),
        ("N\u{b7}m", "N.m"),
        ("mNm", "mN.m"),
        ("Nm/A", "N.m/A"),
        ("A/Nm", "A/(N.m)"),
        ("rpm", "/min"),
        ("U/min", "/min"),
        ("min-1", "/min"),
        ("rev/min", "/min"),
        ("rpm/s", "/min/s"),
        ("V/rpm", "V.min"),
        ("N.rpm", "N/min"),
        ("kWh", "kW.h"),
        ("mAh", "mA.h"),
        ("kVA", "kV.A"),
        ("%RH", "%"),
        ("\u{b5}\u{3b5}", "um/m"),
        ("\u{3bc}\u{3b5}", "um/m"),
        ("l/min", "L/min"),
        ("lpm", "L/min"),
        ("mPas", "mPa.s"),
        ("mmHg", "mm[Hg]"),
        ("mbar", "hPa"),
        ("ppm", "[ppm]"),
    ] {
        assert_eq!(unit(spelling), unit(code), "{spelling}");
    }
    assert_eq!(unit("rpm").text(), "/min");
    assert_eq!(unit("Nm").text(), "N.m");
}

#[test]
fn no_unit_of_another_kind_is_suggested() {
    for text in ["NM", "gpm", "r/min", "rH", "gn", "fpm/s"] {
        let error = Unit::parse(text).unwrap_err();
        assert_eq!(error.advice(), None, "{error}");
    }
    for (text, code) in [
        ("mk/min", "mK/min"),
        ("bars", "bar"),
        ("pa", "Pa"),
        ("Mpa", "MPa"),
        ("nn", "nm"),
    ] {
        let error = Unit::parse(text).unwrap_err();
        assert_eq!(error.advice(), Some(code), "{error}");
    }
    let level = "\"dBm\" is not a unit that UCUM knows; a level above 1 W is \"dB[W]\", in which 0 dBm are -30; \
                 a difference of levels is in \"dB\"";
    assert_eq!(Unit::parse("dBm").unwrap_err().to_string(), level);
    assert!(Unit::parse("dB[W]").is_ok());
}

#[test]
fn a_name_may_say_torque_and_revolutions() {
    for (word, code) in [
        ("rpm", "/min"),
        ("RPM", "/min"),
        ("Nm", "N.m"),
        ("nm", "nm"),
        ("%RH", "%"),
    ] {
        assert_eq!(Unit::in_name(word), Some(unit(code)), "{word}");
    }
    assert!(Unit::in_name("NM").is_none(), "a torque or a length");
}

#[test]
fn a_name_may_say_units_with_prefixes_and_counts() {
    for (word, code) in [
        ("MHz", "MHz"),
        ("mhz", "MHz"),
        ("mHz", "mHz"),
        ("\u{b5}V", "uV"),
        ("MPA", "MPa"),
        ("mPa", "mPa"),
        ("MW", "MW"),
        ("mw", "mW"),
        ("arcsec", "''"),
        ("urad", "urad"),
        ("kN", "kN"),
        ("steps", "1"),
        ("Counts", "1"),
    ] {
        assert_eq!(Unit::in_name(word), Some(unit(code)), "{word}");
    }
    for word in ["MN", "mn", "N", "rad", "deg", "step", "min"] {
        assert!(Unit::in_name(word).is_none(), "{word}");
    }
}
