//! A graph as a functional mock-up unit for co-simulation, after the FMI standard 3.0.2 (<https://fmi-standard.org>): what is exported
//! in C with a model description, as sources and, where there is a C compiler, as a binary for this machine.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;

use athermal_core::engine::fnv_1a;
use athermal_core::unit::Unit;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::c::write_bytes;
use crate::form::{Form, Port};
use crate::{ExportError, Exported};

/// What became of the binary of a unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Binary {
    /// It is in the unit, for this platform: `x86_64-linux`.
    Built(String),
    /// There is no compiler of this name, or no form of binaries for this system: the unit has its sources alone.
    Without(String),
}

/// The flags without which results are not those of the engine.
const FLAGS: &str = "-std=c99 -ffp-contract=off";

/// Writes a unit as a file, with a binary by a C compiler where there is one.
///
/// # Errors
/// When the file or its parts cannot be written, and when the compiler refuses the sources.
pub fn write(exported: &Exported, path: &Path, compiler: &str) -> Result<Binary, ExportError> {
    let mut files = sources(exported);
    let token = token(exported, &files);
    let form = &exported.form;
    files.push(("fmu.c".to_owned(), unit(form, &token)));
    let (binary, bytes) = build(&files, compiler, path)?;
    files.push((
        "buildDescription.xml".to_owned(),
        build_description(form, &files),
    ));
    let mut all = vec![(
        "modelDescription.xml".to_owned(),
        model_description(form, &token).into_bytes(),
    )];
    let inner = |(name, text): (String, String)| (format!("sources/{name}"), text.into_bytes());
    all.extend(files.into_iter().map(inner));
    if let Binary::Built(platform) = &binary {
        all.push((format!("binaries/{platform}/{}.so", form.name), bytes));
    }
    let (folder, name) = (path.parent(), path.file_name());
    let (folder, name) = (folder.unwrap_or(Path::new("")), name.unwrap_or_default());
    let packed = packed(&all).map_err(|source| ExportError::Write {
        path: path.to_owned(),
        source,
    })?;
    write_bytes(folder, &name.to_string_lossy(), &packed)?;
    Ok(binary)
}

/// The files of C that a unit is made of.
fn sources(exported: &Exported) -> Vec<(String, String)> {
    let of_c = exported.files.iter().filter(|file| {
        !file.path.contains('/') && (file.path.ends_with(".c") || file.path.ends_with(".h"))
    });
    of_c.map(|file| (file.path.clone(), file.text.clone()))
        .collect()
}

/// What a binary and a description of the same export share: the revision, and a hash of the tables, in which rates show too.
fn token(exported: &Exported, files: &[(String, String)]) -> String {
    let all: String = files.iter().map(|(_, text)| &**text).collect();
    format!("{}-{:016x}", exported.form.revision, fnv_1a(all.as_bytes()))
}

fn unit(form: &Form, token: &str) -> String {
    include_str!("fmu/fmu.c.in")
        .replace("@name@", &form.name)
        .replace("@NAME@", &form.name.to_uppercase())
        .replace("@token@", token)
}

/// Text within an element, or an attribute, where the end of a line is read as a space.
pub(crate) fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            c if c.is_control() && c != '\n' => escaped.push(' '),
            c => escaped.push(c),
        }
    }
    escaped
}

fn model_description(form: &Form, token: &str) -> String {
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"3.0\" modelName=\"{}\" instantiationToken=\"{token}\" version=\"{}\"\n\
         \x20   description=\"A step from t to t + h is one tick at t; NaN is a sample that is not new, or an output without a value\"\n\
         \x20   generationTool=\"athermal {}\" variableNamingConvention=\"flat\">\n\
         \x20 <CoSimulation modelIdentifier=\"{}\" canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\" canHandleVariableCommunicationStepSize=\"true\"/>\n",
        escaped(&form.title),
        form.revision,
        env!("CARGO_PKG_VERSION"),
        form.name,
    );
    text.push_str("  <UnitDefinitions>\n");
    let mut units: Vec<&str> = vec!["s"];
    for port in form.sources.iter().chain(&form.outputs) {
        if !units.contains(&&*port.unit) {
            units.push(&port.unit);
        }
    }
    for unit in units {
        text.push_str(&unit_definition(unit));
    }
    let step = form.period_ns as f64 / 1e9;
    let _ = write!(
        text,
        "  </UnitDefinitions>\n\
         \x20 <LogCategories>\n    <Category name=\"logStatusWarning\"/>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n\
         \x20 <DefaultExperiment startTime=\"0\" stopTime=\"{}\" stepSize=\"{step}\"/>\n\
         \x20 <ModelVariables>\n\
         \x20   <Float64 name=\"time\" valueReference=\"0\" causality=\"independent\" variability=\"continuous\" unit=\"s\" description=\"Time of the simulation\"/>\n",
        600.0 * step,
    );
    for (nth, port) in form.sources.iter().enumerate() {
        text.push_str(&variable(port, 1 + nth, "input", &sample(form, nth)));
    }
    let first = 1 + form.sources.len();
    for (nth, port) in form.outputs.iter().enumerate() {
        let what = "NaN where there is no value";
        text.push_str(&variable(port, first + nth, "output", what));
    }
    let said = first + form.outputs.len();
    let _ = write!(
        text,
        "    <Int32 name=\"step.said\" valueReference=\"{said}\" causality=\"output\" variability=\"discrete\" initial=\"exact\" start=\"0\" \
         description=\"What the last step said: 0, or 2 for steps too short, 4 for a sample that was refused, 6 for both\"/>\n\
         \x20 </ModelVariables>\n  <ModelStructure>\n"
    );
    for reference in first..=said {
        let _ = writeln!(text, "    <Output valueReference=\"{reference}\"/>");
    }
    text.push_str("  </ModelStructure>\n</fmiModelDescription>\n");
    text
}

/// What an input is.
fn sample(form: &Form, nth: usize) -> String {
    let mut text = format!(
        "A sample each {} s; NaN where it is not new",
        form.periods_ns[nth] as f64 / 1e9
    );
    let (lowest, highest) = form.ranges[nth];
    if lowest.is_finite() || highest.is_finite() {
        let _ = write!(text, "; counts from {lowest} to {highest}");
    }
    text
}

fn variable(port: &Port, reference: usize, causality: &str, description: &str) -> String {
    let initial = match causality {
        "output" => " initial=\"exact\"",
        _ => "",
    };
    format!(
        "    <Float64 name=\"{}\" valueReference=\"{reference}\" causality=\"{causality}\" variability=\"discrete\"{initial} start=\"NaN\" unit=\"{}\" description=\"{}\"/>\n",
        escaped(&port.name),
        escaped(&port.unit),
        escaped(description)
    )
}

/// A unit with what it is in units of the SI, where it is of any.
fn unit_definition(name: &str) -> String {
    let base = Unit::parse(name).ok().and_then(|unit| base_unit(&unit));
    match base {
        Some(base) => format!(
            "    <Unit name=\"{}\">\n      <BaseUnit{base}/>\n    </Unit>\n",
            escaped(name)
        ),
        None => format!("    <Unit name=\"{}\"/>\n", escaped(name)),
    }
}

/// The attributes of a base unit: powers, factor and offset.
fn base_unit(unit: &Unit) -> Option<String> {
    let base = unit.base();
    let (mut powers, mut factor) = ([0_i32; 6], unit.factor_to(&base)?);
    for word in base.text().split('.').filter(|word| *word != "1") {
        let end = word.find(|c: char| c == '-' || c.is_ascii_digit())?;
        let power: i32 = word[end..].parse().ok()?;
        match &word[..end] {
            "g" => {
                powers[0] += power;
                factor *= 1e-3_f64.powi(power);
            }
            "m" => powers[1] += power,
            "s" => powers[2] += power,
            "C" => {
                powers[2] += power;
                powers[3] += power;
            }
            "K" => powers[4] += power,
            "rad" => powers[5] += power,
            _ => return None,
        }
    }
    let mut text = String::new();
    for (name, power) in ["kg", "m", "s", "A", "K", "rad"].iter().zip(powers) {
        if power != 0 {
            let _ = write!(text, " {name}=\"{power}\"");
        }
    }
    let offset = unit.convert(0.0, &base)?;
    for (name, value, usual) in [("factor", factor, 1.0), ("offset", offset, 0.0)] {
        if value != usual {
            let _ = write!(text, " {name}=\"{value}\"");
        }
    }
    Some(text)
}

fn build_description(form: &Form, files: &[(String, String)]) -> String {
    let compiled = files.iter().filter(|(name, _)| name.ends_with(".c"));
    let compiled: String = compiled
        .map(|(name, _)| format!("      <SourceFile name=\"{name}\"/>\n"))
        .collect();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiBuildDescription fmiVersion=\"3.0\">\n\
         \x20 <BuildConfiguration modelIdentifier=\"{}\" description=\"Without fused products and sums, as the self test asks for\">\n\
         \x20   <SourceFileSet language=\"C99\" compiler=\"gcc\" compilerOptions=\"{FLAGS}\">\n{compiled}    </SourceFileSet>\n\
         \x20   <Library name=\"m\" external=\"true\"/>\n\
         \x20 </BuildConfiguration>\n</fmiBuildDescription>\n",
        form.name
    )
}

/// The binary of the sources, built beside the file that is written.
fn build(
    files: &[(String, String)],
    compiler: &str,
    path: &Path,
) -> Result<(Binary, Vec<u8>), ExportError> {
    let platform = match (std::env::consts::ARCH, std::env::consts::OS) {
        (arch @ ("x86_64" | "aarch64"), "linux") => format!("{arch}-linux"),
        (arch, system) => {
            let none = format!("binaries for {arch} and {system} are not made here");
            return Ok((Binary::Without(none), Vec::new()));
        }
    };
    let folder = Folder(path.with_extension(format!("{}.build", std::process::id())));
    for (name, text) in files {
        write_bytes(&folder.0, name, text.as_bytes())?;
    }
    let compiled = files.iter().filter(|(name, _)| name.ends_with(".c"));
    let program = folder.0.join("unit.so");
    let built = Command::new(compiler)
        .current_dir(&folder.0)
        .args(FLAGS.split(' '))
        .args([
            "-O2",
            "-fPIC",
            "-shared",
            "-fvisibility=hidden",
            "-s",
            "-I.",
        ])
        .args(compiled.map(|(name, _)| name))
        .args(["-lm", "-o", "unit.so"])
        .output();
    let built = match built {
        Ok(built) => built,
        Err(error) => {
            let none = format!("there is no C compiler to be run as `{compiler}` ({error})");
            return Ok((Binary::Without(none), Vec::new()));
        }
    };
    if !built.status.success() {
        return Err(ExportError::Compiler {
            compiler: compiler.to_owned(),
            said: String::from_utf8_lossy(&built.stderr).into_owned(),
        });
    }
    let bytes = std::fs::read(&program).map_err(|source| ExportError::Write {
        path: program.clone(),
        source,
    })?;
    Ok((Binary::Built(platform), bytes))
}

/// A folder that is gone when it is no longer needed.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Files as an archive, the same bytes for the same files.
fn packed(files: &[(String, Vec<u8>)]) -> std::io::Result<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(zip::DateTime::default())
        .unix_permissions(0o644);
    for (name, bytes) in files {
        archive.start_file(name, options)?;
        archive.write_all(bytes)?;
    }
    Ok(archive.finish()?.into_inner())
}
