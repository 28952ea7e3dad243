//! The program as a user calls it: its commands, their files, messages and exit codes. No kind of node is registered here, so
//! that those linked are those shipped.

#![allow(clippy::unwrap_used)]

#[path = "../workbench/mod.rs"]
mod workbench;

#[cfg(unix)]
mod ageing_services;
#[cfg(feature = "mqtt")]
mod alarms_over_mqtt;
mod architecture_page;
#[cfg(unix)]
mod asked_services;
mod brought;
mod command_line;
mod compare;
mod data_warnings;
mod diagnose;
mod doubtful_fits;
mod evaluation_modes;
mod every_estimator;
mod evidence;
mod explain;
mod failing_disks;
mod faulty_logs;
mod first_minutes;
mod fit_blocks;
mod fit_json;
mod fleet;
mod forms_of_logs;
mod graph_file_page;
mod guide_pages;
mod hosts;
mod idle;
mod init_readings;
mod init_refuses;
mod init_warnings;
mod json_messages;
mod json_page;
mod kept_runs;
mod language_commands;
mod levels;
mod looked_at_services;
mod meant_calls;
mod named_models;
mod not_files;
mod nothing_to_score;
mod orders;
mod other_processors;
#[cfg(feature = "parquet")]
mod parquet;
mod plugin_crates;
mod priors;
mod report;
mod report_graphs;
mod report_novelty;
mod restarted_pipes;
#[cfg(unix)]
mod same_warnings;
mod schema;
mod services;
mod several_loggers;
mod shipped_graphs;
mod starter_graphs;
mod stopped_runs;
mod stretches;
mod swap_commands;
mod thinned_sources;
#[cfg(feature = "top")]
mod top;
mod trials;
mod watched_runs;
