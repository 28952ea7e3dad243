//! A diagnosis as tables for a terminal: what estimators answer, and how days were predicted.

mod days;
mod instances;
mod responses;

pub use days::{days, enough};
pub use instances::{axis_of, grouped, is_of};
pub use responses::responses;
