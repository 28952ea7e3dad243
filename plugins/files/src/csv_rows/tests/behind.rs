//! Names of columns behind the beginning of a row, and behind the mark of a file.

use super::*;

#[test]
fn names_behind_the_beginning_of_a_row_are_an_error_or_move_the_columns() {
    for begun in ["20,1", "20", "20,", "20,1,", "20,\"1", "2", "20,1,7,"] {
        for header in ["t,b,a", "b,a,t", "t,a,b", "a,t,b"] {
            let cells = |row: [&str; 3]| {
                let cell = |name| row[["t", "a", "b"].iter().position(|of| *of == name).unwrap()];
                header.split(',').map(cell).collect::<Vec<_>>().join(",")
            };
            let rows = [["30", "3", "4"], ["40", "5", ""]].map(cells).join("\n");
            let text = format!("t,a,b\n0,1,2.5\n{begun}{header}\n{rows}\n");
            assert!(error(&text).starts_with("f.csv:3: "), "{text}");
            let (read, reader) = read_with(&text, lenient());
            assert_eq!(read, "0 [1.0, 2.5]; 30 [3.0, 4.0]; 40 [5.0, NaN]", "{text}");
            assert_eq!(reader.report().refused_rows.count, 1);
            let told = reader.report().refused_rows.first.as_ref().unwrap();
            assert_eq!(
                told.to_string(),
                "f.csv:3: the names of the columns stand here behind the beginning of a row, which was left out"
            );
            let moved = u64::from(header != "t,a,b");
            assert_eq!(reader.report().headers_moved.count, moved, "{text}");
        }
    }
}

#[test]
fn other_names_behind_the_beginning_of_a_row_let_no_row_be_taken_until_a_line_of_its_own_names_them()
 {
    for header in ["1t,b,a,c", "1c,t,b,a", "b,a,c"] {
        let text = format!("t,a,b\n0,1,2.5\n20,{header}\n5,6,7\n5,6,7,\n5,6,7,8\nt,b,a\n1,,3\n");
        let (read, reader) = read_with(&text, lenient());
        assert_eq!(read, TWO_ROWS, "no value is taken for another: {text}");
        assert_eq!(reader.report().refused_rows.count, 4);
        let told = reader.report().refused_rows.first.as_ref().unwrap();
        assert!(
            told.to_string().ends_with(
                "which was left out; since they are not those from before, no row is taken until a line of its own names the columns"
            ),
            "{told}"
        );
    }
}

#[test]
fn the_time_glued_to_a_value_names_columns_too_and_one_without_a_name_stays_where_it_is() {
    for behind in ["20,1t,b,c", "20t,b,c", "20,1,2t,b,c"] {
        let text = format!("t,a,b\n0,1,2.5\n{behind}\n10,20,30\nt,b,a\n1,,3\n");
        let (read, _) = read_with(&text, lenient());
        assert_eq!(read, TWO_ROWS, "no value is taken for another: {text}");
    }
    let text = ",t,a,b\n0,0,1,2.5\n1,5,1,t,a,b\n2,1,,3\n";
    assert_eq!(read_with(text, lenient()).0, "0 [1.0, 2.5]; 1 [NaN, 3.0]");
}

#[test]
fn a_row_that_is_too_long_and_ends_in_a_name_is_no_header() {
    let text = "t,a,b,axis\n0,1,2.5,a\n1,2,3,4,a\n2,3,4,5,b\n1,3,,t\n";
    let (rows, reader) = read_with(text, lenient());
    assert_eq!(rows, TWO_ROWS);
    assert_eq!(reader.report().refused_rows.count, 2);
}

#[test]
fn files_with_a_mark_that_are_put_behind_each_other_are_read_as_one() {
    let text = "\u{feff}t,a,b\n0,1,2.5\n\u{feff}t,b,a\n1,,3\n";
    let (rows, reader) = read_with(text, Options::default());
    assert_eq!((&*rows, headers(&reader).0), (TWO_ROWS, 1));
}
