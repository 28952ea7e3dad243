//! Files that are not as they were written: a thousand cases.

use std::fs;

use super::*;
use crate::journal::{DamageKind, JournalError};

/// A journal of several files, and its records.
struct Journal {
    folder: Folder,
    records: Vec<Record>,
    files: Vec<PathBuf>,
}

/// As it stands after the program was killed: the last file is not sealed.
fn killed(seed: u64, options: JournalOptions) -> Journal {
    let (model, folder) = (model(), Folder::new());
    let mut line = Line::begin(&model, &folder.0, options);
    for nth in 0..12 {
        run(&mut line, 12 * seed + nth, 100);
        line.settle();
        let is_synced = || line.recorder.progress().synced() == line.recorder.event();
        while options.sync < std::time::Duration::from_secs(1) && !is_synced() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
    // The files as they are while the program runs are those that a kill leaves.
    let copy = Folder::new();
    for entry in fs::read_dir(&folder.0).unwrap() {
        let entry = entry.unwrap();
        let copied = fs::copy(entry.path(), copy.0.join(entry.file_name()));
        // What was to become a file may have its name by now; there is nothing in it yet.
        assert!(copied.is_ok() || entry.path().extension().is_some_and(|of| of == "part"));
    }
    let mut files: Vec<_> = fs::read_dir(&copy.0)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    Journal {
        records: line.records.clone(),
        folder: copy,
        files,
    }
}

/// No sync before the end, so that all of the last file may be torn.
fn unsynced() -> JournalOptions {
    JournalOptions {
        sync: std::time::Duration::from_secs(3_600),
        ..small()
    }
}

enum Found {
    /// Records that are right, and how many bytes are cut off.
    Read(usize, Option<u64>),
    Refused(JournalError),
}

/// Reads all, and checks that what is given is what was written.
fn look(journal: &Journal) -> Found {
    let mut log = Log::open(&journal.folder.0).unwrap();
    let mut read = 0;
    loop {
        match log.read() {
            Ok(Some(Entry::Record(event, record))) => {
                assert_eq!(event, read as u64);
                assert_eq!(record, journal.records[read], "record {read} is another");
                read += 1;
            }
            Ok(Some(Entry::Begin(_))) => {}
            Ok(None) => return Found::Read(read, log.torn().map(|torn| torn.bytes)),
            Err(error) => return Found::Refused(error),
        }
    }
}

/// How much of a file is written, without the zeros behind.
fn used(bytes: &[u8]) -> usize {
    bytes.iter().rposition(|byte| *byte != 0).unwrap() + 1
}

#[test]
fn a_killed_program_leaves_all_that_it_wrote() {
    let journal = killed(1, small());
    assert!(journal.files.len() > 3, "{:?}", journal.files);
    assert!(matches!(look(&journal), Found::Read(all, None) if all == journal.records.len()));
}

#[test]
fn of_a_truncated_last_file_all_whole_records_are_read() {
    let journal = killed(2, unsynced());
    let last = journal.files.last().unwrap();
    let bytes = fs::read(last).unwrap();
    let mut prng = Prng::stream(5, "serve");
    let (mut cut, mut fewer) = (0, 0);
    for _ in 0..300 {
        let length = (prng.uniform() * used(&bytes) as f64) as usize;
        fs::write(last, &bytes[..length]).unwrap();
        match look(&journal) {
            Found::Read(read, torn) => {
                fewer += usize::from(read < journal.records.len());
                cut += usize::from(torn.is_some());
            }
            // What a file begins with is synced before the file has its name.
            Found::Refused(JournalError::Damaged(damage)) => assert!(damage.offset <= 32),
            Found::Refused(error) => panic!("{error}"),
        }
    }
    assert!(cut > 150 && fewer > 150, "{cut} {fewer}");
}

#[test]
fn a_torn_end_of_noise_is_cut_off_and_the_next_file_follows_on_it() {
    let journal = killed(3, unsynced());
    let last = journal.files.last().unwrap();
    let bytes = fs::read(last).unwrap();
    let mut prng = Prng::stream(6, "serve");
    for _ in 0..200 {
        let mut torn = bytes.clone();
        let from = used(&bytes) - 1 - (prng.uniform() * 200.0) as usize;
        for byte in &mut torn[from..] {
            *byte = (prng.uniform() * 256.0) as u8;
        }
        fs::write(last, &torn).unwrap();
        let Found::Read(read, Some(left_out)) = look(&journal) else {
            panic!(
                "not cut off at {from}: {:?}",
                fs::read_dir(&journal.folder.0).unwrap().collect::<Vec<_>>()
            );
        };
        assert!(left_out > 0 && read + 12 > journal.records.len() - 12);
        let mut log = Log::open(&journal.folder.0).unwrap();
        while log.read().unwrap().is_some() {}
        log.seal().unwrap();
        assert!(matches!(look(&journal), Found::Read(again, None) if again == read));
    }
}

#[test]
fn a_flipped_bit_in_what_was_synced_is_refused_with_its_place() {
    let journal = killed(4, small());
    let mut prng = Prng::stream(7, "serve");
    let sealed = &journal.files[..journal.files.len() - 1];
    for nth in 0..400 {
        let path = &sealed[nth % sealed.len()];
        let bytes = fs::read(path).unwrap();
        let mut flipped = bytes.clone();
        let place = (prng.uniform() * bytes.len() as f64) as usize;
        flipped[place] ^= 1 << (nth % 8);
        fs::write(path, &flipped).unwrap();
        let Found::Refused(error) = look(&journal) else {
            panic!("bit {} of byte {place} of {path:?} is not noticed", nth % 8);
        };
        let text = error.to_string();
        assert!(text.contains(path.to_str().unwrap()), "{text}");
        match error {
            JournalError::Damaged(damage) => {
                assert!(damage.offset <= place as u64 && place as u64 - damage.offset < 4_096);
                assert!(text.contains("move it and all later ones away"), "{text}");
            }
            // A length that grows by as much as the file has.
            other => panic!("{other}"),
        }
        fs::write(path, &bytes).unwrap();
    }
}

#[test]
fn a_flipped_bit_in_the_last_file_is_refused_where_it_was_synced_and_cut_off_else() {
    // One file, with a sync now and then.
    let options = JournalOptions {
        file: 1 << 20,
        ..small()
    };
    let journal = killed(8, options);
    let last = journal.files.last().unwrap();
    let bytes = fs::read(last).unwrap();
    let (mut refused, mut cut) = (0, 0);
    let mut prng = Prng::stream(9, "serve");
    for nth in 0..300 {
        let mut flipped = bytes.clone();
        let place = (prng.uniform() * used(&bytes) as f64) as usize;
        flipped[place] ^= 1 << (nth % 8);
        fs::write(last, &flipped).unwrap();
        match look(&journal) {
            Found::Refused(_) => refused += 1,
            Found::Read(_, torn) => {
                assert!(torn.is_some(), "byte {place} is not noticed");
                cut += 1;
            }
        }
    }
    assert!(refused > 50, "{refused} refused, {cut} cut off");
}

#[test]
fn after_a_clean_end_a_flipped_bit_is_refused_wherever_it_is() {
    let (model, folder) = (model(), Folder::new());
    let options = JournalOptions {
        file: 1 << 20,
        ..unsynced()
    };
    let mut line = Line::begin(&model, &folder.0, options);
    run(&mut line, 1, 300);
    line.recorder.finish();
    let path = fs::read_dir(&folder.0)
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    let journal = Journal {
        records: line.records,
        folder,
        files: vec![path.clone()],
    };
    assert!(matches!(look(&journal), Found::Read(all, None) if all == journal.records.len()));
    let bytes = fs::read(&path).unwrap();
    // What stands last says that all before is synced.
    let records = bytes.len() - 17;
    let mut prng = Prng::stream(14, "serve");
    for nth in 0..200 {
        let mut flipped = bytes.clone();
        let place = match nth {
            // The last record.
            0..17 => records - 1 - nth,
            _ => (prng.uniform() * records as f64) as usize,
        };
        flipped[place] ^= 1 << (nth % 8);
        fs::write(&path, &flipped).unwrap();
        assert!(
            matches!(look(&journal), Found::Refused(_)),
            "byte {place} of {records}"
        );
    }
}

#[test]
fn a_missing_file_is_named() {
    let journal = killed(10, small());
    fs::remove_file(&journal.files[1]).unwrap();
    let Found::Refused(error) = look(&journal) else {
        panic!("not noticed");
    };
    let JournalError::Missing { path, from, to } = &error else {
        panic!("{error}");
    };
    assert_eq!(path, &journal.files[2]);
    assert!(from < to);
    let text = error.to_string();
    assert!(text.contains(&format!("lacks the records {from} to {}", to - 1)));
}

#[test]
fn a_truncated_file_before_another_is_refused() {
    let journal = killed(11, small());
    let bytes = fs::read(&journal.files[1]).unwrap();
    // Between two records: each by itself is right.
    let mut refused = 0;
    // Behind the last record stands that all is synced.
    let records = bytes.len() - 17;
    for length in (records - 200)..records {
        fs::write(&journal.files[1], &bytes[..length]).unwrap();
        refused += usize::from(matches!(look(&journal), Found::Refused(_)));
    }
    assert_eq!(refused, 200);
}

#[test]
fn a_file_of_a_later_release_is_refused_with_what_it_is() {
    let journal = killed(12, small());
    let mut bytes = fs::read(&journal.files[0]).unwrap();
    bytes[8] = 2;
    let crc = {
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(&bytes[..12]);
        hasher.update(&bytes[16..32]);
        hasher.finalize()
    };
    bytes[12..16].copy_from_slice(&crc.to_le_bytes());
    fs::write(&journal.files[0], &bytes).unwrap();
    let Found::Refused(error) = look(&journal) else {
        panic!("not noticed");
    };
    assert!(error.to_string().contains("has format 2"), "{error}");
}

#[test]
fn other_files_in_the_folder_are_left_alone() {
    let journal = killed(13, small());
    for name in [
        "README",
        "journal-7.log",
        "journal-00000000000000000001.log.bak",
    ] {
        fs::write(journal.folder.0.join(name), "notes").unwrap();
    }
    assert!(matches!(look(&journal), Found::Read(all, None) if all == journal.records.len()));
    let folder = journal.folder.0.join("nowhere");
    assert!(Log::open(&folder).unwrap().is_empty());
    let header = DamageKind::Header.to_string();
    assert_eq!(header, "its header is not one of a journal");
}
