//! `postgres` as a sink: rows into a table of PostgreSQL. They are copied into a temporary table and taken from there, since a copy into the
//! table itself would stop at the first one that comes again.

use std::fmt::Write as _;
use std::io::Write as _;
use std::time::Duration as Wait;

use athermal_serve::connector::{ConnectorError, Outlet, ParameterRemark, Sink, SinkWiring};
use athermal_serve::deployment::Login;
use athermal_serve::register_sink;
use postgres::{Client, Config, Error, NoTls};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::batches::{Batches, Row, Store, Trouble};

/// A row of a table of PostgreSQL for each output of each tick: machine, time, output, value, and the revision of the graph.
///
/// The key is machine, time and output: a row that comes again after a restart changes nothing. The table is made where it is not there.
/// Where the database is away the journal keeps the rows; one that is refused is set aside in a file.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct PostgresSink {
    /// The host, or the folder of its socket.
    host: String,
    /// Its port.
    #[serde(default = "port")]
    port: u16,
    /// The database.
    database: String,
    /// User and password.
    login: Login,
    /// The table, perhaps with its schema, such as "public.athermal".
    #[serde(default = "athermal")]
    table: String,
}

register_sink!(PostgresSink, "postgres");

const fn port() -> u16 {
    5432
}

fn athermal() -> String {
    "athermal".to_owned()
}

/// How long a connection, and an answer, may take.
const PATIENCE: Wait = Wait::from_secs(10);

/// A name as SQL writes it.
fn quoted(name: &str) -> String {
    let parts = name
        .split('.')
        .map(|of| format!("\"{}\"", of.replace('"', "\"\"")));
    parts.collect::<Vec<_>>().join(".")
}

impl Sink for PostgresSink {
    fn remarks(&self) -> Vec<ParameterRemark> {
        let is_wrong = self.table.contains('\0') || self.table.split('.').any(str::is_empty);
        let remark = is_wrong.then(|| ParameterRemark {
            at: vec!["table".to_owned()],
            is_mistake: true,
            words: format!("\"{}\" names no table", self.table.escape_debug()),
            help: "write a name such as \"athermal\", or \"public.athermal\"".to_owned(),
        });
        remark.into_iter().collect()
    }

    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        let (user, password) = self
            .login
            .read(&wiring.folder)
            .map_err(ConnectorError::new)?;
        let mut config = Config::new();
        config
            .host(&self.host)
            .port(self.port)
            .dbname(&self.database)
            .user(&user)
            .password(password)
            .application_name("athermal")
            .connect_timeout(PATIENCE)
            .tcp_user_timeout(PATIENCE)
            .keepalives_idle(PATIENCE);
        let machine = wiring
            .machine
            .clone()
            .unwrap_or_else(|| "machine".to_owned());
        let store = Postgres {
            config,
            client: None,
            table: quoted(&self.table),
            name: format!("PostgreSQL at {}", self.host),
            machine: copied(&machine),
            outputs: wiring.outputs.iter().map(|of| copied(&of.name)).collect(),
        };
        Ok(Box::new(Batches::new(store, &wiring)))
    }
}

/// A text as a copy has it.
fn copied(text: &str) -> String {
    let mut copied = String::new();
    for of in text.chars().filter(|of| *of != '\0') {
        match of {
            '\\' => copied += "\\\\",
            '\n' => copied += "\\n",
            '\r' => copied += "\\r",
            '\t' => copied += "\\t",
            of => copied.push(of),
        }
    }
    copied
}

/// A database.
struct Postgres {
    config: Config,
    /// None where there is no connection.
    client: Option<Client>,
    table: String,
    name: String,
    machine: String,
    outputs: Vec<String>,
}

impl Postgres {
    fn connect(&self) -> Result<Client, Error> {
        let mut client = self.config.connect(NoTls)?;
        let table = &self.table;
        client.batch_execute(&format!(
            "set statement_timeout = '10s';
             set timezone = 'UTC';
             create table if not exists {table} (
                 machine text not null,
                 time timestamptz not null,
                 output text not null,
                 value double precision not null,
                 revision text not null,
                 primary key (machine, time, output)
             );
             create temporary table athermal_rows (like {table});"
        ))?;
        Ok(client)
    }

    /// Rows as a copy has them. The time is in whole microseconds, as the database keeps it.
    fn lines(&self, rows: &[Row]) -> String {
        let mut text = String::new();
        for row in rows {
            let us = jiff::Timestamp::from_microsecond(row.at.as_ns().div_euclid(1000));
            let time = us.unwrap_or_default();
            for (nth, value) in &row.values {
                let (machine, output) = (&self.machine, &self.outputs[*nth]);
                let revision = row.revision;
                let _ = writeln!(
                    text,
                    "{machine}\t{time}\t{output}\t{value}\t{revision:016x}"
                );
            }
        }
        text
    }
}

fn insert(client: &mut Client, table: &str, lines: &str) -> Result<(), Error> {
    let mut work = client.transaction()?;
    work.batch_execute("truncate athermal_rows")?;
    let mut copy = work.copy_in("copy athermal_rows from stdin")?;
    // What fails is said by the end of it.
    let _ = copy.write_all(lines.as_bytes());
    copy.finish()?;
    work.batch_execute(&format!(
        "insert into {table} (machine, time, output, value, revision)
         select machine, time, output, value, revision from athermal_rows on conflict do nothing"
    ))?;
    work.commit()
}

impl Store for Postgres {
    fn write(&mut self, rows: &[Row]) -> Result<(), Trouble> {
        let lines = self.lines(rows);
        let client = self.client.take().map_or_else(|| self.connect(), Ok);
        let written = client.and_then(|mut client| {
            let written = insert(&mut client, &self.table, &lines);
            if !client.is_closed() {
                self.client = Some(client);
            }
            written
        });
        written.map_err(|error| {
            let database = error.as_db_error();
            let words = database.map_or_else(|| error.to_string(), |of| of.message().to_owned());
            let cause = std::error::Error::source(&error).filter(|_| database.is_none());
            let cause = cause.map_or_else(String::new, |of| format!(": {of}"));
            let class = database.map_or("", |of| of.code().code().get(..2).unwrap_or_default());
            let advice = match class {
                "28" => "; see `login`",
                "3D" => "; make the database, or see `database`",
                "42" => "; see `table`, and what this user may do",
                "53" => "; it has no room",
                _ => "",
            };
            let words = format!("{}: {words}{cause}{advice}", self.name);
            match class {
                // Of the data themselves, or of a rule of the table.
                "22" | "23" | "44" | "P0" => Trouble::Refused(words),
                _ => {
                    // One that is in the middle of something is left.
                    self.client = None;
                    Trouble::Away(words)
                }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use athermal_core::time::Instant;

    use super::*;

    #[test]
    fn a_row_is_a_line_for_each_output_with_its_time_in_microseconds() {
        let postgres = Postgres {
            config: Config::new(),
            client: None,
            table: String::new(),
            name: String::new(),
            machine: copied("m\t\\1"),
            outputs: vec!["a".to_owned(), copied("b\nc")],
        };
        let row = |ns: i64, values: &[(usize, f64)]| Row {
            at: Instant::from_ns(ns),
            revision: 0xab,
            values: values.to_vec(),
        };
        let text = postgres.lines(&[
            row(1_764_279_677_123_456_789, &[(0, 1.5), (1, -2e-300)]),
            row(-1, &[(0, 0.0)]),
        ]);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(
            lines[0],
            "m\\t\\\\1\t2025-11-27T21:41:17.123456Z\ta\t1.5\t00000000000000ab"
        );
        assert!(lines[1].contains("\tb\\nc\t-0.00"), "{}", lines[1]);
        assert!(
            lines[2].contains("1969-12-31T23:59:59.999999Z"),
            "{}",
            lines[2]
        );
        assert_eq!(quoted("a.b\"c"), "\"a\".\"b\"\"c\"");
    }
}
