use super::*;

/// The text that is left, without blank lines, and the ways to what is lost.
fn left(text: &str) -> (Vec<String>, Vec<String>) {
    let salvaged = salvage(text).expect("it is plain what the errors touch");
    assert_eq!(salvaged.text.len(), text.len());
    let lines = salvaged.text.lines().map(str::trim_end);
    let lines = lines.filter(|line| !line.is_empty()).map(str::to_owned);
    let ways = salvaged.lost.iter();
    let ways = ways.map(|lost| {
        lost.way
            .as_ref()
            .map_or("?".to_owned(), |way| way.join("."))
    });
    (lines.collect(), ways.collect())
}

#[test]
fn a_value_without_quotes_costs_its_key_alone() {
    let (lines, lost) = left("schema = 1\nname = x y\n[sets]\naxis = [\"X\"]\n");
    assert_eq!(lines, ["schema = 1", "[sets]", "axis = [\"X\"]"]);
    assert_eq!(lost, ["name"]);
}

#[test]
fn a_list_of_several_lines_is_lost_whole_and_what_follows_an_open_one_is_not() {
    let (lines, lost) = left("[sets]\naxis = [\n  \"X\",\n  Y,\n]\nside = [\"a\"]\n");
    assert_eq!(lines, ["[sets]", "side = [\"a\"]"]);
    assert_eq!(lost, ["sets.axis"]);
    let (lines, lost) = left("a = \n  { b = 1 },\n]\nc = [\n  }{ b = 1 },\n]\nd = 1");
    assert_eq!(lines, ["d = 1"]);
    assert_eq!(lost, ["a", "c"]);
    let (lines, lost) = left("[nodes.a]\nwindows = [\"1min\",\nunit = \"K\"\n[nodes.b]\nx = 1");
    assert_eq!(lines, ["[nodes.a]", "unit = \"K\"", "[nodes.b]", "x = 1"]);
    assert_eq!(lost, ["nodes.a.windows"]);
}

#[test]
fn a_header_that_is_not_closed_takes_what_stands_under_it_along() {
    let (lines, lost) = left("[nodes.a\nx = 1\n[nodes.b]\nx = 2 # [\"\n");
    assert_eq!(lines, ["[nodes.b]", "x = 2 # [\""]);
    assert_eq!(lost, ["nodes.a", "nodes.a.x"]);
}

#[test]
fn a_quote_that_is_not_closed_ends_with_its_line() {
    let (lines, lost) = left("a = \"b\nc = \"d\"\ne = '''\nf = \n'''\n\"g\" = 1 2");
    assert_eq!(lines, ["c = \"d\"", "e = '''", "f =", "'''"]);
    assert_eq!(lost, ["a", "g"]);
}

#[test]
fn what_follows_a_header_that_is_twice_there_halved_or_swallowed_is_lost() {
    let (lines, lost) = left("[nodes.a]\nx = 1\n[nodes.a]\nx = 2\n[nodes.b]\n");
    assert_eq!(lines, ["[nodes.a]", "x = 1", "[nodes.b]"]);
    assert_eq!(lost, ["?", "nodes.a.x"]);
    let (lines, lost) = left("[nodes.a]\nx = 1\nnodes.b]\nx = 2\n");
    assert_eq!(lines, ["[nodes.a]", "x = 1"]);
    assert_eq!(lost, ["nodes.b", "nodes.b.x"]);
    let (lines, lost) = left("[nodes.a]\n\"[nodes.b]\nx = 2\n[nodes.c]\n");
    assert_eq!(lines, ["[nodes.a]", "[nodes.c]"]);
    assert_eq!(lost, ["?", "?"]);
    let (lines, lost) = left("a = [\"b\"][nodes.b]\nx = 2\n[nodes.c]\ny = [z]\n");
    assert_eq!(lines, ["[nodes.c]"]);
    assert_eq!(lost, ["?", "x", "nodes.c.y"]);
    let (lines, lost) = left("[sets]\na = [\"b\"]c = [\"d\"]\n[nodes.c]\ny = 1z = 2\n");
    assert_eq!(lines, ["[sets]", "[nodes.c]"]);
    assert_eq!(lost, ["?", "nodes.c.y"]);
    let (lines, lost) = left("a = \"\"\"b\"\n[nodes.a]\nx = \"\"\"c\"\ny = 1\n[nodes.b]\n");
    assert_eq!(lines, ["[nodes.b]"]);
    assert_eq!(lost, ["?", "y"]);
}

#[test]
fn of_a_statement_only_the_first_error_is_told_and_every_text_without_quotes() {
    let of = |text: &str| {
        let told = salvage(text)
            .expect("it is plain what the errors touch")
            .errors;
        told.iter()
            .map(|error| error.bytes.start)
            .collect::<Vec<_>>()
    };
    assert_eq!(of("x = [a, b, \"c\", d]\ny = e\n"), [5, 8, 16, 23]);
    assert_eq!(
        of("x = [\n  { a = 1 b = 2 },\n  { a = 1, b = 2 },\n]\n"),
        [14]
    );
}

#[test]
fn all_sections_of_a_named_thing_stand_around_what_it_lost() {
    let text = "[nodes.a]\nx = y\n[nodes.b]\n[nodes.a.inputs]\n";
    let salvaged = salvage(text).expect("one statement is wrong");
    let around: Vec<_> = salvaged.lost[0]
        .around
        .iter()
        .map(|bytes| &text[bytes.clone()])
        .collect();
    assert_eq!(around, ["[nodes.a]\nx = y\n", "[nodes.a.inputs]\n"]);
}
