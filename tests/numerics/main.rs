//! The numbers: reference values, the certificate, rates, efficiency of the indicators, agreement of the solvers,
//! covariance under scaling, steps of multigrid.

mod agreement;
mod cases;
mod certificate;
mod certificate_extremes;
mod contact_set;
mod counting;
mod covariance;
mod efficiency;
mod global_bound;
mod rates;
mod reference;
mod second;
mod steps;
