//! `athermal top`: a running service in a terminal, for whoever stands at the machine over SSH. It says what the page says.
//!
//! | part | decides |
//! |---|---|
//! | `known` | what is asked of the service, and since when nothing may be said |
//! | `picture` | where what stands, from 80 columns and 24 lines on |

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod known;
mod picture;

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::time::Duration as Wait;

use athermal_command::{Answer, Command, Failure, Group, Terminal, println, register_command};
use athermal_http::client::Address;
use clap::Args;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};

use known::{Known, SPANS_S};
use picture::draw;

/// How often the service is asked.
const EVERY: Wait = Wait::from_secs(1);

/// Show a running service in the terminal: each axis in a sentence, its drift, sources, sensors and alarms
///
/// Keys: left and right choose the axis, `+` and `-` how much of the past, up and down move through the sensors. `a` acknowledges the
/// first alarm that is raised, `p` holds the picture, `q` ends. Where the output is no terminal, one picture is printed.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  athermal top die-tester\n  athermal top machine.toml")]
struct Top {
    /// Its name, its machine file, its state folder, its socket, or `http://127.0.0.1:PORT`
    service: String,
    /// The file with the token, for orders over `http://`
    #[arg(long, value_name = "FILE")]
    token: Option<PathBuf>,
}

register_command!(Top, "top");

impl Command for Top {
    const GROUP: Group = Group::Service;
    fn run(&self, _: &Terminal) -> Result<Answer, Failure> {
        let address = Address::of(&self.service, self.token.as_deref())?;
        let mut known = Known::new(address);
        known.ask();
        if let Some(why) = known.never() {
            return Err(Failure::Outside(why));
        }
        let failed = |error: std::io::Error| Failure::Outside(format!("the terminal: {error}"));
        if !std::io::stdout().is_terminal() {
            println!("{}", text(&known, 100, 40));
            return Ok(Answer::Fine);
        }
        let mut terminal = ratatui::try_init().map_err(failed)?;
        let shown = loop {
            if let Err(error) = terminal.draw(|frame| draw(frame, &known)) {
                break Err(error);
            }
            match turn(&mut known) {
                Ok(true) => {}
                Ok(false) => break Ok(()),
                Err(error) => break Err(error),
            }
        };
        ratatui::try_restore().map_err(failed)?;
        shown.map_err(failed)?;
        Ok(Answer::Fine)
    }
}

/// A picture without a terminal.
fn text(known: &Known, width: u16, height: u16) -> String {
    let Ok(mut terminal) = ratatui::Terminal::new(TestBackend::new(width, height));
    let Ok(_) = terminal.draw(|frame| draw(frame, known));
    let buffer = terminal.backend().buffer();
    let lines = buffer.content.chunks(usize::from(width));
    let line = |cells: &[ratatui::buffer::Cell]| {
        let text: String = cells.iter().map(|cell| cell.symbol()).collect();
        text.trim_end().to_owned()
    };
    lines.map(line).collect::<Vec<_>>().join("\n")
}

/// Waits for a key, or for the next time that the service is asked; false at the end.
fn turn(known: &mut Known) -> std::io::Result<bool> {
    let left = EVERY.saturating_sub(known.asked.elapsed());
    if !event::poll(left)? {
        if !known.is_held {
            known.ask();
        } else {
            known.asked = std::time::Instant::now();
        }
        return Ok(true);
    }
    let Event::Key(key) = event::read()? else {
        return Ok(true);
    };
    if key.kind == KeyEventKind::Release {
        return Ok(true);
    }
    let axes = known.axes().len().max(1);
    match key.code {
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return Ok(false),
        KeyCode::Char('q') | KeyCode::Esc => return Ok(false),
        KeyCode::Right | KeyCode::Tab => known.axis = (known.axis + 1) % axes,
        KeyCode::Left | KeyCode::BackTab => known.axis = (known.axis + axes - 1) % axes,
        KeyCode::Down => known.first_sensor += 1,
        KeyCode::Up => known.first_sensor = known.first_sensor.saturating_sub(1),
        KeyCode::Char('+') => known.span = known.span.saturating_sub(1),
        KeyCode::Char('-') => known.span = (known.span + 1).min(SPANS_S.len() - 1),
        KeyCode::Char('p') => known.is_held = !known.is_held,
        KeyCode::Char('a') => known.acknowledge(),
        _ => return Ok(true),
    }
    if !known.is_held {
        known.ask();
    }
    Ok(true)
}
