//! What an author is told who makes a mistake with the macros. Where a new compiler words it otherwise,
//! `TRYBUILD=overwrite cargo test --test kinds misuse -- --ignored` writes it down anew.

#[test]
#[ignore = "builds the crate a second time, and the words are those of one compiler; .ci/run does"]
fn mistakes_with_the_macros_are_told_so_that_they_can_be_mended() {
    trybuild::TestCases::new().compile_fail("tests/kinds/misuse/*.rs");
}
