//! Transfer functions of inputs and noise, and the search for those whose one-step predictions err least. Decides how such a
//! model predicts and how it is found; not which orders it has, nor at which instants its samples are taken.
//!
//! All kinds are cases of one model (Ljung 1999, eq. 4.33): `A(q) (y − μ) = Σ B_i(q)/F_i(q) u_i + C(q)/(D(q) (1 − q⁻¹)^d) e`.
//!
//! What is made least is the sum of squared one-step prediction errors; in segments of which values are missing the likelihood,
//! of which that is the case where nothing is (Jones 1980). There, derivatives by `A`, `C` and `D` are by differences, and elsewhere
//! exact.

mod anywhere;
mod begin;
mod brought;
mod criteria;
mod doubt;
mod fit;
mod initial;
mod missing;
mod past;
mod polynomials;
mod precision;
mod residuals;
mod ring;
mod roots;
mod samples;
mod search;
mod segment;
mod starts;
mod stepper;
#[cfg(test)]
mod tests;

pub use anywhere::Beginning;
pub use criteria::InformationCriteria;
pub use polynomials::{InputOrders, Orders, Polynomials, Transfer};
pub use roots::Fading;
pub use samples::Samples;
pub use search::{PredictionError, PredictionErrorFit};
pub use stepper::Stepper;
