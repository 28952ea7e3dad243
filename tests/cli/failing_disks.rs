//! A service on disks that fill, hang, cannot be written or have been damaged: it goes on, reports it, and loses no row of its sinks.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use crate::services::{
    HEADER, SERVICE, by_run, desk, end, history, lines, rows, serve, until_reported, until_rows,
};
use crate::workbench::{Scratch, athermal};

/// A small file system of its own, which goes with the test.
struct Disk {
    path: PathBuf,
    is_frozen: bool,
}

fn is_done(command: &str, arguments: &[&str]) -> bool {
    let output = Command::new(command).args(arguments).output();
    output.is_ok_and(|of| of.status.success())
}

impl Disk {
    /// None, with a remark, where it cannot be mounted here.
    fn mount(path: PathBuf, arguments: &[&str]) -> Option<Self> {
        fs::create_dir_all(&path).unwrap();
        let shown = path.display().to_string();
        if !is_done("mount", &[arguments, &[&*shown]].concat()) {
            println!("skipped: a small file system cannot be mounted here");
            return None;
        }
        Some(Self {
            path,
            is_frozen: false,
        })
    }

    fn small(scratch: &Scratch) -> Option<Self> {
        let arguments = ["-t", "tmpfs", "-o", "size=4m", "tmpfs"];
        Self::mount(scratch.path("disk"), &arguments)
    }

    /// Takes all the room that there is.
    fn fill(&self) {
        let mut size = 1 << 20;
        let mut file = fs::File::create(self.path.join("ballast")).unwrap();
        while size > 0 {
            match std::io::Write::write_all(&mut file, &vec![1; size]) {
                Ok(()) => {}
                Err(_) => size /= 2,
            }
        }
    }

    fn make_room(&self) {
        fs::remove_file(self.path.join("ballast")).unwrap();
    }

    fn freeze(&mut self, frozen: bool) {
        let way = if frozen { "-f" } else { "-u" };
        assert!(is_done(
            "fsfreeze",
            &[way, &self.path.display().to_string()]
        ));
        self.is_frozen = frozen;
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let path = self.path.display().to_string();
        if self.is_frozen {
            is_done("fsfreeze", &["-u", &path]);
        }
        is_done("umount", &["-l", &path]);
    }
}

fn append(scratch: &Scratch, from: usize, to: usize) {
    let log = scratch.path("log.csv");
    let mut file = fs::OpenOptions::new().append(true).open(log).unwrap();
    std::io::Write::write_all(&mut file, rows(from, to).as_bytes()).unwrap();
}

/// Waits until the journal of a state folder has the tick of a time.
fn until_journalled(scratch: &Scratch, state: &Path, time_s: f64) {
    let (began, again) = (Instant::now(), scratch.path("again.csv"));
    loop {
        let replayed = athermal(&[&"replay", &state, &"--output", &again]);
        let text = fs::read_to_string(&again).unwrap_or_default();
        let last = text.lines().last().and_then(|line| line.split(',').next());
        if last.and_then(|of| of.parse().ok()) == Some(time_s) {
            return;
        }
        let told = replayed.told;
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "{last:?}: {told}"
        );
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// A service whose state is in this folder, with its first rows.
fn begun(name: &str) -> Scratch {
    let scratch = desk(name, SERVICE);
    scratch.file("log.csv", &(HEADER.to_owned() + &rows(0, 200)));
    scratch
}

#[test]
fn a_full_disk_of_the_state_is_reported_and_the_service_goes_on() {
    let scratch = begun("full-state");
    let Some(disk) = Disk::small(&scratch) else {
        return;
    };
    let (state, out) = (disk.path.join("state"), scratch.path("history.csv"));
    let state: &str = &state.display().to_string();
    let mut child = serve(&scratch, &["--state", state]);
    until_rows(&out, 200, &mut child);
    disk.fill();
    // More than a file of the journal has room for ahead.
    for from in (200..14_200).step_by(2_000) {
        append(&scratch, from, from + 2_000);
        until_rows(&out, from + 2_000, &mut child);
    }
    let before = until_reported(&mut child, "the journal cannot be written: ");
    disk.make_room();
    let before = before + &until_reported(&mut child, "the journal is written again; ");
    append(&scratch, 14_200, 14_400);
    until_rows(&out, 14_400, &mut child);
    until_journalled(&scratch, &disk.path.join("state"), 1_439.9);
    let text = before + &end(child);
    assert!(text.contains("No space left"), "{text}");
    assert!(history(&scratch) == by_run(&scratch));
    // It goes on behind the gap, of which the journal knows.
    append(&scratch, 14_400, 14_600);
    let mut child = serve(&scratch, &["--state", state]);
    until_rows(&out, 14_600, &mut child);
    let text = end(child);
    assert!(text.contains("goes on where it ended"), "{text}");
    assert!(history(&scratch) == by_run(&scratch));
}

/// Started on such a disk it does what one that runs does when the disk becomes so.
#[test]
fn a_start_on_a_disk_that_is_full_or_may_not_be_written_is_a_state_and_the_journal_goes_on() {
    for (name, is_full) in [("start-full", true), ("start-read-only", false)] {
        let scratch = begun(name);
        let Some(disk) = Disk::small(&scratch) else {
            return;
        };
        let write = |may: bool| match (is_full, may) {
            (true, false) => disk.fill(),
            (true, true) => disk.make_room(),
            (false, may) => {
                let how = if may { "remount,rw" } else { "remount,ro" };
                let path = disk.path.display().to_string();
                assert!(is_done("mount", &["-o", how, &path]));
            }
        };
        let (state, out) = (disk.path.join("state"), scratch.path("history.csv"));
        let named: &str = &state.display().to_string();
        let mut text = String::new();
        // A new state, one that a kill left, and one that was ended.
        for round in 0..3 {
            let rows = 200 + 400 * round;
            write(false);
            let mut child = serve(&scratch, &["--state", named]);
            append(&scratch, rows, rows + 200);
            until_rows(&out, rows + 200, &mut child);
            text += &until_reported(&mut child, "the journal cannot be written: ");
            if round == 0 {
                // It is not reported as often as it is tried.
                std::thread::sleep(Duration::from_millis(2_500));
            }
            write(true);
            let again = until_reported(&mut child, "the journal is written again; ");
            assert!(!again.contains("the journal cannot be written"), "{again}");
            append(&scratch, rows + 200, rows + 400);
            until_rows(&out, rows + 400, &mut child);
            until_journalled(&scratch, &state, (rows + 399) as f64 / 10.0);
            if round == 0 {
                std::thread::sleep(Duration::from_millis(500));
                child.kill().unwrap();
                child.wait().unwrap();
            } else {
                text += &end(child);
            }
        }
        assert!(history(&scratch) == by_run(&scratch), "{text}");
    }
}

#[test]
fn rows_wait_for_a_sink_whose_disk_is_full_and_none_is_lost() {
    let scratch = begun("full-sink");
    let Some(disk) = Disk::small(&scratch) else {
        return;
    };
    let machine = SERVICE.replace("history.csv", "disk/history.csv");
    let machine = format!("schema = 1\nextends = \"graph.toml\"\n{machine}");
    scratch.file("line.toml", machine);
    let out = disk.path.join("history.csv");
    let mut child = serve(&scratch, &[]);
    until_rows(&out, 200, &mut child);
    disk.fill();
    append(&scratch, 200, 600);
    let before = until_reported(&mut child, "sink `history`: cannot write ");
    assert!(lines(&out) < 600, "the disk is full");
    disk.make_room();
    until_rows(&out, 600, &mut child);
    let before = before + &until_reported(&mut child, "sink `history` puts out again");
    let text = before + &end(child);
    assert!(text.contains("No space left"), "{text}");
    fs::copy(&out, scratch.path("history.csv")).unwrap();
    assert!(history(&scratch) == by_run(&scratch));
}

#[test]
fn rows_come_in_time_while_the_disk_of_the_state_hangs() {
    let scratch = begun("hung");
    let image = scratch.path("image");
    fs::File::create(&image).unwrap().set_len(24 << 20).unwrap();
    let image = image.display().to_string();
    is_done("mkfs.ext4", &["-q", &image]);
    let Some(mut disk) = Disk::mount(scratch.path("disk"), &["-o", "loop", &image]) else {
        return;
    };
    let (state, out) = (disk.path.join("state"), scratch.path("history.csv"));
    let mut child = serve(&scratch, &["--state", &state.display().to_string()]);
    until_rows(&out, 200, &mut child);
    disk.freeze(true);
    let mut slowest = Duration::ZERO;
    for nth in 0..120 {
        // Longer than a position of a sink and a checkpoint take until they are kept.
        let (from, began) = (200 + 10 * nth, Instant::now());
        append(&scratch, from, from + 10);
        until_rows(&out, from + 10, &mut child);
        slowest = slowest.max(began.elapsed());
        std::thread::sleep(Duration::from_millis(50).saturating_sub(began.elapsed()));
    }
    let before = until_reported(&mut child, "the journal cannot be written: the disk hangs");
    disk.freeze(false);
    let before = before + &until_reported(&mut child, "the journal is written again; ");
    append(&scratch, 1_400, 1_500);
    until_rows(&out, 1_500, &mut child);
    until_journalled(&scratch, &state, 149.9);
    let text = before + &end(child);
    println!("the slowest ten rows took {slowest:?}");
    assert!(slowest < Duration::from_secs(1), "{slowest:?}\n{text}");
    assert!(history(&scratch) == by_run(&scratch));
}

#[test]
fn a_folder_that_cannot_be_written_is_refused_and_a_torn_journal_goes_on() {
    let scratch = begun("refused");
    let file = scratch.path("log.csv");
    let machine = scratch.path("line.toml");
    let refused = athermal(&[&"serve", &machine, &"--state", &file]).ended(3);
    assert!(refused.told.contains("cannot write "), "{}", refused.told);
    assert!(refused.told.contains("log.csv"), "{}", refused.told);

    let mut child = serve(&scratch, &[]);
    until_rows(&scratch.path("history.csv"), 200, &mut child);
    end(child);
    let journal = scratch.path("line.state").join("journal");
    let segment = fs::read_dir(&journal)
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    let bytes = fs::read(&segment).unwrap();
    let written = bytes.iter().rposition(|byte| *byte != 0).unwrap();
    // The end may be torn: it is left out, and the service goes on. Behind the last record stands that all is synced.
    fs::write(&segment, &bytes[..written - 30]).unwrap();
    append(&scratch, 200, 300);
    let mut child = serve(&scratch, &[]);
    until_rows(&scratch.path("history.csv"), 300, &mut child);
    let text = end(child);
    assert!(text.contains(" are left out"), "{text}");
    assert!(history(&scratch) == by_run(&scratch));
}

/// Where the wall clock is read: it decides nothing of ticks, so that it may be stepped.
#[test]
fn the_wall_clock_is_read_where_its_first_stamp_is_judged_and_where_files_grow_old() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("core/serve/src");
    let mut found = Vec::new();
    let mut folders = vec![sources];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let text = fs::read_to_string(&path).unwrap();
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                let reads = ["SystemTime", "UNIX_EPOCH"]
                    .iter()
                    .any(|of| text.contains(of));
                found.extend(reads.then_some(name));
            }
        }
    }
    found.sort();
    assert_eq!(found, ["host.rs", "retention.rs"]);
}
