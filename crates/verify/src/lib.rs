//! x
mod base64;
mod vtk;
