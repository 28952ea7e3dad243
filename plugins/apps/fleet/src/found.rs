//! Decides which files are of which machine: by a folder such as `machine=17`, or by what stands for `{machine}` in a pattern.

use std::collections::BTreeMap;
use std::path::{MAIN_SEPARATOR, Path, PathBuf};

use athermal_files::recordings_in;
use thiserror::Error;

/// What stands for the name of a machine in a pattern.
const MACHINE: &str = "{machine}";

/// Why files cannot be given to machines.
#[derive(Debug, Error)]
pub enum FindError {
    /// A path or pattern stands for no file.
    #[error(
        "{0}: no file is of that name; quote a pattern, such as 'logs/machine=*/*.csv', so that it comes here as it is"
    )]
    Nothing(String),
    /// A file is of no machine.
    #[error(
        "{path}: which machine is it of? No folder on its path is `{key}=…`: write {MACHINE} where the pattern has the name, \
         such as 'logs/{MACHINE}/*.csv', or the key of the folders, such as `--by unit`"
    )]
    Nameless {
        /// The file.
        path: String,
        /// The key of the folders.
        key: String,
    },
    /// A machine has a name that no model can have as its file.
    #[error(
        "{path}: no model can be called `{name}`: a machine's name begins with neither `.` nor `_`"
    )]
    Unusable {
        /// The file.
        path: String,
        /// The name.
        name: String,
    },
}

/// The files of each machine, in the order of their paths.
pub type Machines = BTreeMap<String, Vec<PathBuf>>;

/// Gives files to machines. Each of `given` is a file, a folder of files, or a pattern: `*` stands for any letters of a name, `?` for
/// one, `{machine}` for those that name the machine, as few as possible. Else a folder `key=…` names it, as Hive writes partitions.
///
/// # Errors
/// When one stands for no file, or a file is of no machine.
pub fn machines_of(given: &[String], key: &str) -> Result<Machines, FindError> {
    let mut machines = Machines::new();
    for given in given {
        let mut found = Vec::new();
        if Path::new(given).exists() {
            found.push((PathBuf::from(given), None));
        } else {
            let (start, rest) = match given.strip_prefix(MAIN_SEPARATOR) {
                Some(rest) => (PathBuf::from(MAIN_SEPARATOR.to_string()), rest),
                None => (PathBuf::new(), given.as_str()),
            };
            let parts: Vec<&str> = rest
                .split(MAIN_SEPARATOR)
                .filter(|of| !of.is_empty())
                .collect();
            expand(&start, &parts, None, &mut found);
        }
        if found.is_empty() {
            return Err(FindError::Nothing(given.clone()));
        }
        for (path, name) in found {
            let files = if path.is_dir() {
                recordings_in(&path)
            } else {
                vec![path]
            };
            for file in files {
                let of_folder = || athermal_jobs::data::of_folder(&file, key);
                let Some(name) = name.clone().or_else(of_folder) else {
                    let (path, key) = (file.display().to_string(), key.to_owned());
                    return Err(FindError::Nameless { path, key });
                };
                if name.starts_with(['.', '_']) {
                    let path = file.display().to_string();
                    return Err(FindError::Unusable { path, name });
                }
                machines.entry(name).or_default().push(file);
            }
        }
    }
    if machines.is_empty() {
        return Err(FindError::Nothing(given.join(" ")));
    }
    for files in machines.values_mut() {
        files.sort();
        files.dedup();
    }
    Ok(machines)
}

/// What there is below a folder by the rest of a pattern, each with the name of its machine as far as that is known.
fn expand(
    folder: &Path,
    parts: &[&str],
    name: Option<&str>,
    found: &mut Vec<(PathBuf, Option<String>)>,
) {
    let Some((part, rest)) = parts.split_first() else {
        found.push((folder.to_owned(), name.map(str::to_owned)));
        return;
    };
    if !part.contains(['*', '?']) && !part.contains(MACHINE) {
        let path = folder.join(part);
        if path.exists() {
            expand(&path, rest, name, found);
        }
        return;
    }
    let here = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let Ok(entries) = std::fs::read_dir(here) else {
        return;
    };
    let mut names: Vec<_> = entries.flatten().map(|entry| entry.file_name()).collect();
    names.sort();
    for entry in names {
        let text = entry.to_string_lossy();
        if text.starts_with('.') && !part.starts_with('.') {
            continue;
        }
        if let Some(of_part) = matched(part, &text) {
            expand(
                &folder.join(&entry),
                rest,
                of_part.as_deref().or(name),
                found,
            );
        }
    }
}

/// Whether a name is one of a pattern, and what stands in it for the machine.
fn matched(pattern: &str, name: &str) -> Option<Option<String>> {
    let ends = |text: &str| {
        text.char_indices()
            .map(|(at, of)| at + of.len_utf8())
            .collect::<Vec<_>>()
    };
    if let Some(rest) = pattern.strip_prefix(MACHINE) {
        let mut ends = ends(name).into_iter();
        return ends.find_map(|end| {
            matched(rest, &name[end..])?;
            Some(Some(name[..end].to_owned()))
        });
    }
    let Some(first) = pattern.chars().next() else {
        return name.is_empty().then_some(None);
    };
    let rest = &pattern[first.len_utf8()..];
    if first == '*' {
        let ends = std::iter::once(0).chain(ends(name));
        return ends.into_iter().find_map(|end| matched(rest, &name[end..]));
    }
    let letter = name.chars().next()?;
    (first == '?' || first == letter).then(|| matched(rest, &name[letter.len_utf8()..]))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_stands_for_names_and_names_machines() {
        let of = |pattern: &str, name: &str| matched(pattern, name);
        let machine = |name: &str| Some(Some(name.to_owned()));
        assert_eq!(of("*.csv", "a.csv"), Some(None));
        assert_eq!(of("*.csv", "a.csvx"), None);
        assert_eq!(of("m?.csv", "mü.csv"), Some(None));
        assert_eq!(of("machine=*", "machine=17"), Some(None));
        assert_eq!(of("{machine}.csv", "m17.csv"), machine("m17"));
        assert_eq!(of("log-{machine}_*.csv", "log-m_1_2.csv"), machine("m"));
        assert_eq!(of("{machine}", ""), None);
    }

    #[test]
    fn files_are_of_the_machine_of_their_folder_or_pattern_in_the_order_of_their_paths() {
        let folder =
            std::env::temp_dir().join(format!("athermal-fleet-{}-found", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        for file in [
            "machine=b/2.csv",
            "machine=a/2.csv",
            "machine=a/1.csv",
            "machine=a/.3.csv",
        ] {
            let path = folder.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let text = |rest: &str| format!("{}/{rest}", folder.display());
        let files = |given: &str, key| {
            let found = machines_of(&[text(given)], key)?;
            let all = found.into_iter().map(|(name, files)| {
                let files = files
                    .iter()
                    .map(|file| file.strip_prefix(&folder).unwrap().display().to_string());
                format!("{name}: {}", files.collect::<Vec<_>>().join(" "))
            });
            Ok::<_, FindError>(all.collect::<Vec<_>>())
        };
        let both = ["a: machine=a/1.csv machine=a/2.csv", "b: machine=b/2.csv"];
        assert_eq!(files("machine=*/*.csv", "machine").unwrap(), both);
        assert_eq!(files("", "machine").unwrap(), both);
        assert_eq!(files("machine={machine}/*", "unit").unwrap(), both);
        assert_eq!(
            files("machine=?/{machine}.csv", "machine").unwrap(),
            ["1: machine=a/1.csv", "2: machine=a/2.csv machine=b/2.csv"]
        );
        assert!(matches!(
            files("machine=*/*.csv", "unit"),
            Err(FindError::Nameless { .. })
        ));
        assert!(matches!(
            files("machine=*/*.parquet", "machine"),
            Err(FindError::Nothing(_))
        ));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
