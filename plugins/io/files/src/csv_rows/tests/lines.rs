//! Lines that do not end, and rows over several of them.

use super::*;

#[test]
fn a_last_line_that_was_cut_off_is_reported_and_the_rest_used() {
    let (rows, reader) = read_with("t,a,b\n0,1,2.5\n1,3,\n2,4", Options::default());
    assert_eq!(rows, TWO_ROWS);
    assert_eq!(
        reader.report().truncated.as_ref().map(|place| place.line),
        Some(4)
    );
    assert_eq!(reader.report().refused_rows.count, 0);
}

#[test]
fn a_last_line_with_all_cells_but_no_end_is_complete() {
    let (rows, reader) = read_with("t,a,b\n0,1,2.5\n1,3,", Options::default());
    assert_eq!(rows, TWO_ROWS);
    assert!(reader.report().truncated.is_none());
}

#[test]
fn a_last_line_without_an_end_is_left_out_where_more_comes_later() {
    let options = Options {
        goes_on: true,
        ..Options::default()
    };
    for cut in ["2,4,928", "2,4", "2,4,\"5\"", "t,b,a"] {
        let text = format!("t,a,b\n0,1,2.5\n1,3,\n{cut}");
        let (rows, reader) = read_with(&text, options.clone());
        assert_eq!(rows, TWO_ROWS);
        let truncated = reader.report().truncated.as_ref();
        assert_eq!(truncated.map(|place| place.line), Some(4), "{cut}");
    }
    let (rows, reader) = read_with("t,a,b\n0,1,2.5\n1,3,\n", options.clone());
    assert_eq!(rows, TWO_ROWS);
    assert!(reader.report().truncated.is_none());
    assert_eq!(read_with("t,a,b", options).0, "");
}

#[test]
fn a_quote_that_is_not_closed_is_an_error_at_its_row_or_that_row_is_left_out() {
    for open in [
        "5,\"1,2\n",
        "5,1,\"2\n",
        "\"5,1,2\r\n",
        "5,\"1,\n\nno row\n",
    ] {
        let text = format!("t,a,b\n0,1,2.5\n{open}6,3,\n7,5,6\n8,7,8\n");
        assert_eq!(
            error(&text),
            "f.csv:3: a quoted cell starts here that does not end; close the quote or remove it, or read leniently (`--lenient`) to \
             leave the row out"
        );
        let (rows, reader) = read_with(&text, lenient());
        assert_eq!(
            rows, "0 [1.0, 2.5]; 6 [3.0, NaN]; 7 [5.0, 6.0]; 8 [7.0, 8.0]",
            "{open}"
        );
        let report = reader.report();
        let lines = open.lines().filter(|line| !line.is_empty()).count();
        assert_eq!(report.refused_rows.count, lines as u64, "{open}");
        assert_eq!(report.bad_cells.count, 0);
    }
    let endless = format!("t,a,b\n0,1,\"{}", "2\n".repeat(1_000_000));
    assert!(error(&endless).starts_with("f.csv:2: a quoted cell starts here"));
    let long = format!("t,a,b\n0,1,\"2\n{}\n1,3,\n", "x".repeat(2_000_000));
    let (rows, reader) = read_with(&long, lenient());
    assert_eq!(
        (&*rows, reader.report().refused_rows.count),
        ("1 [3.0, NaN]", 2)
    );
}

#[test]
fn a_note_may_go_over_lines_and_have_delimiters() {
    let text =
        "t,a,b,note\n0,1,2.5,\"moved, see\n2,3 and 5,\n\nfar \"\"away\"\"\"\n1,3,,\n2,5,6,\"x\ny\"";
    let (rows, reader) = read_with(text, Options::default());
    assert_eq!(rows, "0 [1.0, 2.5]; 1 [3.0, NaN]; 2 [5.0, 6.0]");
    assert!(reader.report().truncated.is_none());
    let ends_in_delimiter = "t,a,b,note\n0,1,2.5,\"x\ny\",\n1,3,,,\n";
    assert_eq!(read(ends_in_delimiter), TWO_ROWS);
}

#[test]
fn a_last_line_that_ends_within_quotes_was_cut_off() {
    for cut in ["2,4,\"5", "2,4,\"5\nand", "2,4,5,\"x"] {
        let text = format!("t,a,b\n0,1,2.5\n1,3,\n{cut}");
        let (rows, reader) = read_with(&text, Options::default());
        assert_eq!(rows, TWO_ROWS);
        let truncated = reader.report().truncated.as_ref();
        assert_eq!(truncated.map(|place| place.line), Some(4), "{cut}");
    }
}

#[test]
fn a_line_that_is_too_long_is_an_error_or_left_out_and_the_next_is_read() {
    let text = format!("t,a,b\n0,1,2.5\n{}\n1,3,\n", "x".repeat(3_000_000));
    assert_eq!(
        error(&text),
        "f.csv:3: a row longer than 1048576 bytes starts here; look for missing line ends, or read leniently (`--lenient`) to leave \
         it out"
    );
    let (rows, reader) = read_with(&text, lenient());
    assert_eq!(rows, TWO_ROWS);
    assert_eq!(reader.report().refused_rows.count, 1);
}
