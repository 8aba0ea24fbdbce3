//! The numbers: reference values, rates, efficiency of the indicators, agreement of the solvers, covariance under scaling.

mod agreement;
mod cases;
mod certificate;
mod covariance;
mod efficiency;
mod rates;
mod reference;
