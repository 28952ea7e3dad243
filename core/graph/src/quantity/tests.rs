use super::*;

fn quantity(text: &str) -> Quantity {
    text.parse()
        .unwrap_or_else(|error| panic!("{text}: {error}"))
}

fn in_unit(text: &str, unit: &str) -> Option<f64> {
    quantity(text).in_unit(&Unit::parse(unit).expect("the test's unit is valid"))
}

#[test]
fn a_quantity_is_a_number_and_a_unit() {
    assert_eq!(in_unit("150 nm/min", "nm/min"), Some(150.0));
    assert_eq!(in_unit("150nm/min", "nm/s"), Some(2.5));
    assert_eq!(in_unit("-20 Cel", "K"), Some(-20.0 + 273.15));
    assert_eq!(in_unit("5e-3 K", "mK"), Some(5.0));
    assert_eq!(in_unit("+.5 s", "ms"), Some(500.0));
    assert_eq!(in_unit("3 1", "%"), Some(300.0));
    assert_eq!(in_unit("5 nm", "s"), None);
    // The `e` of electronvolt is no exponent.
    assert_eq!(quantity("5eV").unit.text(), "eV");
}

#[test]
fn what_is_no_quantity_is_refused_with_its_reason() {
    let error = |text: &str| {
        text.parse::<Quantity>()
            .expect_err("the test's text is no quantity")
            .to_string()
    };
    assert_eq!(
        error(""),
        "a quantity is a number and a unit, e.g. \"150 nm/min\", found an empty text"
    );
    assert_eq!(
        error("nm"),
        "a quantity is a number and a unit, e.g. \"150 nm/min\", found \"nm\""
    );
    assert_eq!(
        error("5"),
        "the number 5 needs a unit, e.g. \"5 nm/min\" (\"5 1\" if it has none)"
    );
    assert_eq!(error("NaN nm"), "a quantity is a finite number, found NaN");
    assert_eq!(
        error("-inf nm"),
        "a quantity is a finite number, found -inf"
    );
    assert_eq!(
        error("1e999 nm"),
        "a quantity is a finite number, found 1e999"
    );
    assert_eq!(
        error("5 nm/mn"),
        "\"mn\" in \"nm/mn\" is not a unit that UCUM knows; did you mean \"nm/min\"?"
    );
}

#[test]
fn a_decimal_comma_is_told_with_the_number_that_was_meant() {
    let error = |text: &str| text.parse::<Quantity>().unwrap_err();
    for (text, instead) in [
        ("-82,5 Cel", "-82.5 Cel"),
        ("0,25 um/min", "0.25 um/min"),
        ("0,5K/h", "0.5K/h"),
        ("0,25", "0.25"),
    ] {
        let error = error(text);
        assert_eq!(error.reason(), format!("\"{text}\" has a decimal comma"));
        let help = format!("a number has a decimal point: \"{instead}\"");
        assert_eq!(error.help(), Some(help.clone()));
        assert_eq!(error.to_string(), format!("{}; {help}", error.reason()));
    }
    for text in ["1,5 nn", "5 nm,6 nm", "1,2,3 nm", "nan"] {
        let told = error(text).to_string();
        assert!(!told.contains("comma"), "{text}: {told}");
    }
}

#[test]
fn json_holds_quantities_as_texts() {
    for text in [
        "150 nm/min",
        "-20 Cel",
        "0.005 K",
        "1e-9 m",
        "1e300 s",
        "0 1",
    ] {
        let quantity = quantity(text);
        assert_eq!(quantity.to_string(), text);
        let json = serde_json::to_string(&quantity).expect("quantities are serialisable");
        assert_eq!(serde_json::from_str::<Quantity>(&json).ok(), Some(quantity));
    }
    let error = serde_json::from_str::<Quantity>("5")
        .expect_err("a number is no quantity")
        .to_string();
    assert!(
        error.contains("expected a quantity like \"150 nm/min\""),
        "{error}"
    );
}
