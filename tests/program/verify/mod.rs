//! `membranes verify`: honest runs hold, changed ones do not.

mod folder;
mod honest;
mod refused;
